//! `Content-Digest` of RFC 9530: a lost or changed byte on the way is noticed.

use axum::http::HeaderMap;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use sha2::Digest;

use super::problem::{Code, Problem};

/// Digests of a body that is still arriving.
#[derive(Debug, Clone, Default)]
pub struct Hashers {
    sha256: sha2::Sha256,
    sha512: sha2::Sha512,
}

impl Hashers {
    /// Takes more of it.
    pub fn update(&mut self, chunk: &[u8]) {
        self.sha256.update(chunk);
        self.sha512.update(chunk);
    }

    /// Its digests.
    pub fn finish(self) -> Digests {
        Digests { sha256: self.sha256.finalize().to_vec(), sha512: self.sha512.finalize().to_vec() }
    }
}

/// Digests of a raw body, to be held against `Content-Digest`.
#[derive(Debug)]
pub struct Digests {
    sha256: Vec<u8>,
    sha512: Vec<u8>,
}

/// Holds the digests of a body against the `Content-Digest` header, if there is one. Algorithms that are not known
/// here are skipped, but a header without any that is known is refused: its sender counts on the check.
pub fn check(headers: &HeaderMap, name: &str, digests: &Digests) -> Result<(), Problem> {
    let values = headers.get_all("content-digest").iter();
    let values = values.map(|value| value.to_str().map_err(|_| unreadable(name))).collect::<Result<Vec<_>, _>>()?;
    check_values(&values, name, digests)
}

/// The same with what the header says.
pub fn check_values(values: &[&str], name: &str, digests: &Digests) -> Result<(), Problem> {
    let mut checked = false;
    for value in values {
        for member in value.split(',') {
            let (algorithm, digest) = member.trim().split_once('=').ok_or_else(|| unreadable(name))?;
            let expected = match algorithm {
                "sha-256" => &digests.sha256,
                "sha-512" => &digests.sha512,
                _ => continue,
            };
            let digest = digest.strip_prefix(':').and_then(|rest| rest.strip_suffix(':'));
            let digest = digest.and_then(|text| STANDARD.decode(text).ok()).ok_or_else(|| unreadable(name))?;
            if digest != *expected {
                let detail = format!("{name}: the {algorithm} of what arrived is not the one in Content-Digest");
                return Err(Problem::new(Code::DigestMismatch, detail, "send the file again").scan(name));
            }
            checked = true;
        }
    }
    if !values.is_empty() && !checked { Err(unreadable(name)) } else { Ok(()) }
}

fn unreadable(name: &str) -> Problem {
    let detail = format!("{name}: the Content-Digest can't be checked");
    Problem::new(Code::DigestMismatch, detail, "write it as sha-256=:BASE64: (RFC 9530), or leave it out").scan(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_value(value: &str) -> Result<(), Problem> {
        let mut hashers = Hashers::default();
        hashers.update(b"abc");
        let mut headers = HeaderMap::new();
        headers.insert("content-digest", value.parse().expect("a header"));
        check(&headers, "a.ply", &hashers.finish())
    }

    #[test]
    fn the_right_digest_passes_and_others_do_not() {
        // FIPS 180-2, appendix B.1
        let right = "sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:";
        check_value(right).expect("SHA-256 of abc");
        check_value(&format!("unixsum=:30637:, {right}")).expect("unknown ones are skipped");
        assert!(check_value(&right.replace("ungW", "ungX")).is_err());
        assert!(check_value("sha-256=ungWv48").is_err());
        assert!(check_value("md5=:AAAA:").is_err());
    }
}
