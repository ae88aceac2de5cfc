//! `Content-Digest` of RFC 9530: a lost or changed byte on the way is noticed.

use axum::http::HeaderMap;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use sha2::Digest;

use super::problem::{Code, Problem};

/// Digests of a body that is still arriving.
#[derive(Debug, Clone)]
pub struct Hashers {
    sha256: Option<sha2::Sha256>,
    sha512: Option<sha2::Sha512>,
}

impl Default for Hashers {
    /// Of all that may be asked for.
    fn default() -> Self {
        Hashers { sha256: Some(sha2::Sha256::default()), sha512: Some(sha2::Sha512::default()) }
    }
}

impl Hashers {
    /// Of those that a request will be held against: they take longer than all else that is done to a body as it arrives.
    pub fn wanted_by(headers: &HeaderMap) -> Hashers {
        let values: Vec<&str> =
            headers.get_all("content-digest").iter().filter_map(|value| value.to_str().ok()).collect();
        let is_named = |name: &str| values.iter().any(|value| value.contains(name));
        Hashers {
            sha256: is_named("sha-256").then(sha2::Sha256::default),
            sha512: is_named("sha-512").then(sha2::Sha512::default),
        }
    }

    /// Takes more of it.
    pub fn update(&mut self, chunk: &[u8]) {
        if let Some(sha256) = &mut self.sha256 {
            sha256.update(chunk);
        }
        if let Some(sha512) = &mut self.sha512 {
            sha512.update(chunk);
        }
    }

    /// Its digests.
    pub fn finish(self) -> Digests {
        Digests {
            sha256: self.sha256.map(|hasher| hasher.finalize().to_vec()),
            sha512: self.sha512.map(|hasher| hasher.finalize().to_vec()),
        }
    }
}

/// Digests of a raw body, to be held against `Content-Digest`.
#[derive(Debug)]
pub struct Digests {
    sha256: Option<Vec<u8>>,
    sha512: Option<Vec<u8>>,
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
            if Some(&digest) != expected.as_ref() {
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
        let mut headers = HeaderMap::new();
        headers.insert("content-digest", value.parse().expect("a header"));
        let mut hashers = Hashers::wanted_by(&headers);
        hashers.update(b"abc");
        check(&headers, "a.ply", &hashers.finish())
    }

    #[test]
    fn the_right_digest_passes_and_others_do_not() {
        // FIPS 180-2, appendix B.1
        let right = "sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:";
        check_value(right).expect("SHA-256 of abc");
        check_value(&format!("unixsum=:30637:, {right}")).expect("unknown ones are skipped");
        // appendix C.1
        let long = "sha-512=:3a81oZNherrMQXNJriBBMRLm+k6JqX6iCp7u5ktV05ohkpkqJ0/BqDa6PCOj/uu9RU1EI2Q86A4qmslPpUyknw==:";
        check_value(long).expect("SHA-512 of abc");
        check_value(&format!("{right}, {long}")).expect("both");
        assert!(check_value(&format!("{right}, {}", long.replace("3a81", "3a82"))).is_err());
        assert!(check_value(&right.replace("ungW", "ungX")).is_err());
        assert!(check_value("sha-256=ungWv48").is_err());
        assert!(check_value("md5=:AAAA:").is_err());
    }
}
