//! The headers of the protocol tus 1.0.

use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use sha2::Digest;

use crate::problem::{Code, Problem};
use visage_domain::UploadRecord;

/// The version that is spoken.
const VERSION: HeaderValue = HeaderValue::from_static("1.0.0");
pub const RESUMABLE: HeaderName = HeaderName::from_static("tus-resumable");
pub const LENGTH: HeaderName = HeaderName::from_static("upload-length");
pub const OFFSET: HeaderName = HeaderName::from_static("upload-offset");
pub const EXPIRES: HeaderName = HeaderName::from_static("upload-expires");
const METADATA: HeaderName = HeaderName::from_static("upload-metadata");
const CHECKSUM: HeaderName = HeaderName::from_static("upload-checksum");
/// The media type of a piece.
pub const PIECE: &str = "application/offset+octet-stream";
/// What of the protocol there is besides its core, and what pieces may be held against.
const SAID: [(HeaderName, &str); 3] = [
    (HeaderName::from_static("tus-version"), "1.0.0"),
    (HeaderName::from_static("tus-extension"), "creation,expiration,checksum,termination"),
    (HeaderName::from_static("tus-checksum-algorithm"), "sha1,sha256"),
];

/// Refuses other versions than the one that is spoken, and names it in each answer. Whoever names none is taken to mean it.
pub async fn spoken(request: Request, next: Next) -> Response {
    let asked = request.headers().get(RESUMABLE);
    let is_known = asked.is_none_or(|asked| asked == VERSION) || request.method() == Method::OPTIONS;
    let mut response = if is_known {
        next.run(request).await
    } else {
        let detail = "the version of tus that Tus-Resumable names is not spoken here";
        let [version, ..] = SAID;
        let problem = Problem::new(Code::PreconditionFailed, detail, "send Tus-Resumable: 1.0.0");
        problem.header(version.0, HeaderValue::from_static(version.1)).into_response()
    };
    response.headers_mut().insert(RESUMABLE, VERSION);
    response
}

/// What can be done, for files of at most so many bytes.
pub fn capabilities(most: u64) -> HeaderMap {
    let mut headers: HeaderMap =
        SAID.into_iter().map(|(name, value)| (name, HeaderValue::from_static(value))).collect();
    headers.insert(HeaderName::from_static("tus-max-size"), most.into());
    headers
}

/// What a file is, as its sender says at the beginning.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Metadata {
    /// Its name.
    pub name: Option<String>,
    /// What it is held against at its end.
    pub digest: Option<String>,
}

/// Reads `Upload-Metadata`; what is not known is left out.
pub fn metadata(headers: &HeaderMap) -> Result<Metadata, Problem> {
    let mut found = Metadata::default();
    for pair in text(headers, &METADATA)?.unwrap_or_default().split(',').map(str::trim).filter(|pair| !pair.is_empty())
    {
        let (key, value) = pair.split_once(' ').unwrap_or((pair, ""));
        let value = || {
            let decoded = STANDARD.decode(value.trim()).ok().and_then(|bytes| String::from_utf8(bytes).ok());
            decoded.ok_or_else(|| malformed(&METADATA, "the value of a key is not UTF-8 in base64"))
        };
        match key {
            "filename" => found.name = Some(value()?),
            "digest" => found.digest = Some(value()?),
            _ => {}
        }
    }
    Ok(found)
}

/// Reads a header that is a number of bytes.
pub fn bytes(headers: &HeaderMap, name: &HeaderName) -> Result<u64, Problem> {
    let value = text(headers, name)?.ok_or_else(|| malformed(name, "it is not there"))?;
    let is_plain = !value.is_empty() && value.bytes().all(|byte| byte.is_ascii_digit());
    value.parse().ok().filter(|_| is_plain).ok_or_else(|| malformed(name, "it is no number of bytes"))
}

/// What a piece is held against.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Checksum {
    /// SHA-1, which the protocol asks for.
    Sha1(Vec<u8>),
    /// SHA-256.
    Sha256(Vec<u8>),
}

impl Checksum {
    /// Of `Upload-Checksum`, if it is there.
    pub fn of(headers: &HeaderMap) -> Result<Option<Checksum>, Problem> {
        let Some(value) = text(headers, &CHECKSUM)? else { return Ok(None) };
        let (algorithm, digest) = value.split_once(' ').unwrap_or((value, ""));
        let digest = STANDARD.decode(digest.trim()).map_err(|_| malformed(&CHECKSUM, "it is not in base64"))?;
        match algorithm {
            "sha1" => Ok(Some(Checksum::Sha1(digest))),
            "sha256" => Ok(Some(Checksum::Sha256(digest))),
            _ => Err(malformed(&CHECKSUM, "it is of another kind than sha1 and sha256")),
        }
    }

    /// What reckons it of what arrives.
    pub fn hasher(&self) -> Hasher {
        match self {
            Checksum::Sha1(_) => Hasher::Sha1(sha1::Sha1::default()),
            Checksum::Sha256(_) => Hasher::Sha256(sha2::Sha256::default()),
        }
    }
}

/// Reckons the checksum of a piece.
pub enum Hasher {
    Sha1(sha1::Sha1),
    Sha256(sha2::Sha256),
}

impl Hasher {
    /// Takes more of the piece.
    pub fn update(&mut self, chunk: &[u8]) {
        match self {
            Hasher::Sha1(hasher) => sha1::Digest::update(hasher, chunk),
            Hasher::Sha256(hasher) => hasher.update(chunk),
        }
    }

    /// Its checksum.
    pub fn finish(self) -> Checksum {
        match self {
            Hasher::Sha1(hasher) => Checksum::Sha1(sha1::Digest::finalize(hasher).to_vec()),
            Hasher::Sha256(hasher) => Checksum::Sha256(hasher.finalize().to_vec()),
        }
    }
}

/// How far a file is.
pub fn state(upload: &UploadRecord, offset: u64) -> Result<HeaderMap, Problem> {
    let name = format!("filename {}", STANDARD.encode(&upload.name));
    // a date of RFC 9110
    let expires = upload.expires_at.strftime("%a, %d %b %Y %H:%M:%S GMT").to_string();
    Ok(HeaderMap::from_iter([
        (OFFSET, offset.into()),
        (LENGTH, upload.bytes.into()),
        (METADATA, HeaderValue::try_from(name).map_err(Problem::internal)?),
        (EXPIRES, HeaderValue::try_from(expires).map_err(Problem::internal)?),
    ]))
}

fn text<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Result<Option<&'a str>, Problem> {
    headers.get(name).map(|value| value.to_str().map_err(|_| malformed(name, "it is no text"))).transpose()
}

fn malformed(name: &HeaderName, why: &str) -> Problem {
    let detail = format!("the header {name} can't be read: {why}");
    Problem::new(Code::MalformedRequest, detail, "send it as tus 1.0 says (tus.io), or use a client of tus")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(name: HeaderName, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name, HeaderValue::from_str(value).expect("a header"))])
    }

    #[test]
    fn metadata_is_read_and_what_is_not_known_left_out() {
        let read = |value: &str| metadata(&headers(METADATA, value));
        let found = read("filename YS5wbHk=, relativePath,is_new ,digest c2hhLTI1Nj06eDo=").expect("read");
        assert_eq!((found.name.as_deref(), found.digest.as_deref()), (Some("a.ply"), Some("sha-256=:x:")));
        assert_eq!(metadata(&HeaderMap::new()).expect("nothing"), Metadata::default());
        for broken in ["filename a.ply", "filename /w==", "filename  !"] {
            assert_eq!(read(broken).expect_err(broken).code(), Code::MalformedRequest);
        }
    }

    #[test]
    fn numbers_of_bytes_are_plain() {
        let read = |value: &str| bytes(&headers(LENGTH, value), &LENGTH);
        assert_eq!(read("00512").expect("a number"), 512);
        for broken in ["", "-1", "+1", "1.5", "1e3", "99999999999999999999", " "] {
            assert_eq!(read(broken).expect_err(broken).code(), Code::MalformedRequest);
        }
        assert!(bytes(&HeaderMap::new(), &LENGTH).is_err());
    }

    #[test]
    fn checksums_are_those_of_the_standards() {
        let of = |value: &str| Checksum::of(&headers(CHECKSUM, value)).expect("read").expect("there");
        // FIPS 180-2, appendices A.1 and B.1
        for abc in ["sha1 qZk+NkcGgWq6PiVxeFDCbJzQ2J0=", "sha256 ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0="] {
            let expected = of(abc);
            let mut hasher = expected.hasher();
            hasher.update(b"abc");
            assert_eq!(hasher.finish(), expected);
        }
        assert!(Checksum::of(&headers(CHECKSUM, "md5 kAFQmDzST7DWlj99KOF/cg==")).is_err());
        assert_eq!(Checksum::of(&HeaderMap::new()).expect("none"), None);
    }
}
