//! Where files are kept when not in the data folder: a bucket of an S3 store.

use std::fmt;
use std::str::FromStr;

/// A bucket and the names in it that are ours: `s3://bucket/prefix`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BucketUrl {
    /// The bucket.
    pub bucket: String,
    /// What the names of all objects begin with, without slashes around it; may be empty.
    pub prefix: String,
}

/// A text that names no bucket.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} names no bucket: write s3://bucket or s3://bucket/prefix, in small letters, digits, dots and dashes")]
pub struct NoBucketUrl(String);

impl FromStr for BucketUrl {
    type Err = NoBucketUrl;

    fn from_str(text: &str) -> Result<Self, NoBucketUrl> {
        let refused = || NoBucketUrl(text.chars().take(200).collect());
        let rest = text.strip_prefix("s3://").ok_or_else(refused)?;
        let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
        let prefix = prefix.trim_end_matches('/');
        let in_bucket = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '.' | '-');
        let in_prefix = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
        let is_part = |part: &str| !part.is_empty() && part != "." && part != ".." && part.chars().all(in_prefix);
        let is_bucket = (3..=63).contains(&bucket.len()) && bucket.chars().all(in_bucket);
        let is_prefix = prefix.is_empty() || prefix.len() <= 500 && prefix.split('/').all(is_part);
        match is_bucket && is_prefix {
            true => Ok(BucketUrl { bucket: bucket.to_owned(), prefix: prefix.to_owned() }),
            false => Err(refused()),
        }
    }
}

impl fmt::Display for BucketUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.prefix.as_str() {
            "" => write!(f, "s3://{}", self.bucket),
            prefix => write!(f, "s3://{}/{prefix}", self.bucket),
        }
    }
}

/// How the bucket is reached. Keys are taken from the environment, by the names that all clients of S3 know (`AWS_*`).
#[derive(Debug, Clone)]
pub struct BucketSettings {
    /// The bucket.
    pub url: BucketUrl,
    /// The address of the store; `None` for Amazon's.
    pub endpoint: Option<String>,
    /// The store's region.
    pub region: Option<String>,
    /// Bytes of files that were fetched, or are on their way, that are kept on the local disk at most.
    pub cache_bytes: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bucket_has_a_name_and_perhaps_a_prefix() {
        for (text, written) in [
            ("s3://scans", "s3://scans"),
            ("s3://scans/", "s3://scans"),
            ("s3://my.scans-1/a/b_C/", "s3://my.scans-1/a/b_C"),
        ] {
            let url: BucketUrl = text.parse().unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(url.to_string(), written);
        }
        for text in [
            "scans",
            "s3://",
            "s3://ab",
            "s3://Scans",
            "s3://scans//a",
            "s3://scans/a/../b",
            "s3://scans/ü",
            "http://x/y",
        ] {
            let refused = text.parse::<BucketUrl>().expect_err(text);
            assert!(refused.to_string().contains("s3://bucket/prefix"), "{refused}");
        }
    }
}
