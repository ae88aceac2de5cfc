//! The name of a file in the head of a form's part, however its client wrote it: as it is, percent-encoded behind
//! `filename*` (RFC 8187), or as an encoded word of mail (RFC 2047).

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// The name that a `Content-Disposition` gives to a file. `plain` is its parameter `filename` as it stands.
pub fn file_name(header: Option<&[u8]>, plain: Option<&str>) -> Option<String> {
    let header = header.map(String::from_utf8_lossy);
    let extended =
        header.as_deref().and_then(|header| parameter(header, "filename*")).and_then(|value| extended(&value));
    extended.or_else(|| plain.map(|name| words(name).unwrap_or_else(|| name.to_owned())))
}

/// The value of a parameter; what is in quotes is passed over, since it may look like one.
fn parameter(header: &str, name: &str) -> Option<String> {
    let mut is_quoted = false;
    let mut is_escaped = false;
    let parts = header.split(|c: char| {
        let is_end = c == ';' && !is_quoted;
        is_quoted ^= c == '"' && !is_escaped;
        is_escaped = c == '\\' && is_quoted && !is_escaped;
        is_end
    });
    let parts = parts.filter_map(|part| part.split_once('='));
    let found = parts.map(|(key, value)| (key.trim(), value.trim())).find(|(key, _)| key.eq_ignore_ascii_case(name));
    found.map(|(_, value)| value.trim_matches('"').to_owned())
}

/// `UTF-8'en'a%20b.ply`; `None` if it is not that.
fn extended(value: &str) -> Option<String> {
    let (charset, rest) = value.split_once('\'')?;
    let (_, text) = rest.split_once('\'')?;
    decoded(charset, unescaped(text.as_bytes(), b'%')?)
}

/// A name made of encoded words, `=?UTF-8?B?...?=`; `None` if it is not that.
fn words(name: &str) -> Option<String> {
    let mut text = String::new();
    let mut rest = name.trim();
    while !rest.is_empty() {
        let mut parts = rest.strip_prefix("=?")?.splitn(4, '?');
        let (charset, kind, content) = (parts.next()?, parts.next()?, parts.next()?);
        // between two words a blank is none of the name
        rest = parts.next()?.strip_prefix('=')?.trim_start();
        let bytes = match kind {
            "B" | "b" => STANDARD.decode(content).ok()?,
            "Q" | "q" => unescaped(content.replace('_', " ").as_bytes(), b'=')?,
            _ => return None,
        };
        text.push_str(&decoded(charset, bytes)?);
    }
    (!text.is_empty()).then_some(text)
}

/// Bytes of which some are written as two hexadecimal digits behind a sign.
fn unescaped(text: &[u8], sign: u8) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.iter().copied();
    let digit = |byte: u8| (byte as char).to_digit(16).map(|digit| digit as u8);
    while let Some(byte) = rest.next() {
        bytes.push(match byte == sign {
            true => digit(rest.next()?)? << 4 | digit(rest.next()?)?,
            false => byte,
        });
    }
    Some(bytes)
}

fn decoded(charset: &str, bytes: Vec<u8>) -> Option<String> {
    match charset.to_ascii_lowercase().as_str() {
        "utf-8" | "us-ascii" => String::from_utf8(bytes).ok(),
        // its codes are those of Unicode
        "iso-8859-1" => Some(bytes.into_iter().map(char::from).collect()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(header: &str, plain: &str) -> String {
        file_name(Some(header.as_bytes()), Some(plain)).expect("a name")
    }

    #[test]
    fn names_are_read_however_they_are_written() {
        let head = "form-data; name=\"scans\"; filename=\"b_ste.ply\"; filename*=UTF-8''b%C3%BCste.ply";
        assert_eq!(of(head, "b_ste.ply"), "b\u{fc}ste.ply");
        assert_eq!(of("form-data; FILENAME*=iso-8859-1'de'b%FCste.ply", "x"), "b\u{fc}ste.ply");
        assert_eq!(of("form-data", "=?utf-8?B?YsO8c3RlLnBseQ==?="), "b\u{fc}ste.ply");
        assert_eq!(of("form-data", "=?UTF-8?Q?b=C3=BCste?= =?utf-8?q?_1.ply?="), "b\u{fc}ste 1.ply");
        assert_eq!(of("form-data", "plain = 100%.ply"), "plain = 100%.ply");
        assert_eq!(file_name(None, None), None);
    }

    #[test]
    fn what_is_no_code_is_a_name_as_it_stands() {
        for name in ["=?utf-8?B?***?=", "=?utf-8?X?a?=", "=?koi8-r?Q?a?=", "=?utf-8?Q?=ZZ?=", "=?a", "=?utf-8?Q?=FF?="]
        {
            assert_eq!(of("form-data", name), name);
        }
        for value in ["UTF-8", "UTF-8''%C3", "UTF-8''%C3%28", "UTF-8''%G0", "koi8-r''a", "UTF-8''%"] {
            assert_eq!(of(&format!("form-data; filename*={value}"), "plain.ply"), "plain.ply", "{value}");
        }
        let quoted = "form-data; name=\"a\\\"; filename*=UTF-8''evil.ply\"; filename=\"a.ply\"";
        assert_eq!(of(quoted, "a.ply"), "a.ply");
    }
}
