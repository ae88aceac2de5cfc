//! `Content-Digest` of RFC 9530: a lost or changed byte on the way is noticed.

use axum::http::HeaderMap;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::problem::{Code, Problem};
use super::upload::Digests;

/// Holds the digests of a body against the `Content-Digest` header, if there is one. Algorithms that are not known
/// here are skipped, but a header without any that is known is refused: its sender counts on the check.
pub fn check(headers: &HeaderMap, name: &str, digests: &Digests) -> Result<(), Problem> {
    let mut checked = false;
    let mut given = false;
    for value in headers.get_all("content-digest") {
        given = true;
        let value = value.to_str().map_err(|_| unreadable(name))?;
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
    if given && !checked { Err(unreadable(name)) } else { Ok(()) }
}

fn unreadable(name: &str) -> Problem {
    let detail = format!("{name}: the Content-Digest can't be checked");
    Problem::new(Code::DigestMismatch, detail, "write it as sha-256=:BASE64: (RFC 9530), or leave it out").scan(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sha2::Digest;

    fn check_value(value: &str) -> Result<(), Problem> {
        let digests =
            Digests { sha256: sha2::Sha256::digest(b"abc").to_vec(), sha512: sha2::Sha512::digest(b"abc").to_vec() };
        let mut headers = HeaderMap::new();
        headers.insert("content-digest", value.parse().expect("a header"));
        check(&headers, "a.ply", &digests)
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
