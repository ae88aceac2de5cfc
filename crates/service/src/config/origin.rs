//! The origin of a page: scheme, host and port, as browsers write it.

use std::fmt;
use std::str::FromStr;

use super::HostName;

/// An origin whose pages may ask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin(String);

/// A text that is no origin.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0:?} is no origin: write http:// or https:// and a host, with a port or without, and no path; `*` is not taken"
)]
pub struct NoOrigin(String);

impl Origin {
    /// As browsers write it.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Origin {
    type Err = NoOrigin;

    fn from_str(text: &str) -> Result<Origin, NoOrigin> {
        let refused = || NoOrigin(text.chars().take(100).collect());
        let (scheme, host) = text.split_once("://").ok_or_else(refused)?;
        let usual = match scheme {
            "https" => 443,
            "http" => 80,
            _ => return Err(refused()),
        };
        let name: HostName = host.parse().map_err(|_| refused())?;
        let name = HostName { port: name.port.filter(|port| *port != usual), ..name };
        Ok(Origin(format!("{scheme}://{name}")))
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_are_written_as_browsers_do() {
        let read = |text: &str| text.parse::<Origin>().map(|origin| origin.to_string());
        for (text, written) in [
            ("https://App.Example:443", "https://app.example"),
            ("http://app.example:80", "http://app.example"),
            ("http://app.example:8080", "http://app.example:8080"),
            ("https://[FD00::5]", "https://[fd00::5]"),
        ] {
            assert_eq!(read(text), Ok(written.to_owned()));
        }
        for text in
            ["*", "app.example", "https://", "https://a/b", "file://a", "https://*.example", "null", "https://a b"]
        {
            assert!(read(text).is_err(), "{text}");
        }
    }
}
