//! Where scans may be fetched from: an address, and all that is below it.

use std::fmt;
use std::str::FromStr;

use super::Address;

/// All addresses of one host (and port) whose path is below this one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FetchSource(Address);

/// A text that names no such place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0:?} is no place to fetch from: write https:// (or http://), a host, and a path without a query, such as https://data.example/scans/"
)]
pub struct NoFetchSource(String);

impl FetchSource {
    /// Whether an address is below this one. No address that goes up on its way is: servers differ in where it leads.
    pub fn holds(&self, address: &Address) -> bool {
        let Address { is_secure, host, target } = &self.0;
        let path = address.target.split('?').next().unwrap_or_default();
        let is_same_host = host.host == address.host.host && self.0.port() == address.port();
        is_same_host && *is_secure == address.is_secure && path.starts_with(target) && !goes_up(path)
    }
}

/// Whether a path has a part that is `.` or `..`, also where that is written with escapes; what looks like a further slash counts as one.
fn goes_up(path: &str) -> bool {
    let plain = path.to_ascii_lowercase().replace("%2e", ".").replace("%2f", "/").replace("%5c", "/");
    plain.split('/').any(|part| matches!(part, "." | ".."))
}

impl FromStr for FetchSource {
    type Err = NoFetchSource;

    fn from_str(text: &str) -> Result<FetchSource, NoFetchSource> {
        let refused = || NoFetchSource(text.chars().take(100).collect());
        let mut address: Address = text.parse().map_err(|_| refused())?;
        if address.target.contains('?') || goes_up(&address.target) {
            return Err(refused());
        }
        // /scans is no beginning of /scans-of-others
        if !address.target.ends_with('/') {
            address.target.push('/');
        }
        Ok(FetchSource(address))
    }
}

impl fmt::Display for FetchSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_below_may_be_fetched_and_nothing_else() {
        let source: FetchSource = "https://Data.example/scans".parse().expect("a place");
        assert_eq!(source.to_string(), "https://data.example/scans/");
        for (address, may) in [
            ("https://data.example/scans/a.ply", true),
            ("https://data.example:443/scans/day1/a.ply?signature=../x", true),
            ("https://data.example/scans/..a/b.ply", true),
            ("http://data.example/scans/a.ply", false),
            ("https://data.example:8443/scans/a.ply", false),
            ("https://other.example/scans/a.ply", false),
            ("https://data.example.evil.example/scans/a.ply", false),
            ("https://data.example/scans-of-others/a.ply", false),
            ("https://data.example/scans/../private/a.ply", false),
            ("https://data.example/scans/%2E./private/a.ply", false),
            ("https://data.example/scans/..%2fprivate/a.ply", false),
            ("https://data.example/scans/..%5Cprivate/a.ply", false),
            ("https://data.example/", false),
        ] {
            assert_eq!(source.holds(&address.parse().expect("an address")), may, "{address}");
        }
        let all: FetchSource = "http://10.0.0.7:9000".parse().expect("a place");
        assert!(all.holds(&"http://10.0.0.7:9000/bucket/a.ply".parse().expect("an address")));
    }

    #[test]
    fn what_names_no_place_is_refused() {
        for text in [
            "",
            "data.example",
            "s3://bucket/",
            "https://data.example/?a",
            "https://data.example/a/../",
            "https://u@h/",
        ] {
            assert!(text.parse::<FetchSource>().is_err(), "{text}");
        }
    }
}
