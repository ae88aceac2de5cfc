//! What the service may ask of others: an absolute URL of http or https, without a user and without a fragment.

use std::fmt;
use std::str::FromStr;

use super::{HostName, Network, is_public};

/// The longest address, in bytes.
const LONGEST: usize = 2000;

/// Where a message of a webhook goes, or a scan is fetched from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    /// Whether by TLS.
    pub is_secure: bool,
    /// The host, and the port if it is not the usual one.
    pub host: HostName,
    /// Path and query; `/` at least.
    pub target: String,
}

/// A text that is no such address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the address is not http:// or https:// with a host, a path, and nothing else that a user or a fragment would be"
)]
pub struct NoAddress;

impl Address {
    /// The port.
    pub fn port(&self) -> u16 {
        self.host.port.unwrap_or(if self.is_secure { 443 } else { 80 })
    }

    /// Whether a message may be sent to this one of its host's addresses: a public one by TLS, one of these networks
    /// in any way.
    pub fn may_reach(&self, address: std::net::IpAddr, networks: &[Network]) -> bool {
        (self.is_secure && is_public(address)) || networks.iter().any(|network| network.holds(address))
    }
}

impl FromStr for Address {
    type Err = NoAddress;

    fn from_str(text: &str) -> Result<Address, NoAddress> {
        let (scheme, rest) = text.split_once("://").ok_or(NoAddress)?;
        let is_secure = match scheme.to_ascii_lowercase().as_str() {
            "https" => true,
            "http" => false,
            _ => return Err(NoAddress),
        };
        let (host, target) = rest.split_at(rest.find(['/', '?']).unwrap_or(rest.len()));
        let host: HostName = host.parse().map_err(|_| NoAddress)?;
        let is_plain = |byte: u8| byte.is_ascii_graphic() && !matches!(byte, b'#' | b'"' | b'<' | b'>' | b'\\' | b'`');
        if text.len() > LONGEST || !target.bytes().all(is_plain) || host.port == Some(0) {
            return Err(NoAddress);
        }
        let target = if target.starts_with('/') { target.to_owned() } else { format!("/{target}") };
        Ok(Address { is_secure, host, target })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scheme = if self.is_secure { "https" } else { "http" };
        write!(f, "{scheme}://{}{}", self.host, self.target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_and_written() {
        for (text, written, port) in [
            ("https://a.example", "https://a.example/", 443),
            ("HTTP://A.example:8000/hook?x=1", "http://a.example:8000/hook?x=1", 8000),
            ("https://[fd00::5]:444?x", "https://[fd00::5]:444/?x", 444),
        ] {
            let address: Address = text.parse().expect(text);
            assert_eq!((address.to_string().as_str(), address.port()), (written, port));
        }
        let long = format!("https://a.example/{}", "x".repeat(2000));
        for text in [
            "",
            "a.example",
            "ftp://a.example",
            "https://",
            "https://user@a.example/",
            "https://user:pass@a.example/",
            "https://a.example/#x",
            "https://a.example/ x",
            "https://a.example/\r\nx: y",
            "https://a.example:0/",
            "https://2130706433/",
            "https://0x7f.1/",
            "https://a.example\\@b.example/",
            "file:///etc/passwd",
            &long,
        ] {
            assert_eq!(text.parse::<Address>(), Err(NoAddress), "{text}");
        }
    }

    #[test]
    fn what_is_not_public_is_reached_if_it_is_listed_and_in_the_clear_nothing_else_is() {
        let networks: Vec<Network> = vec!["10.0.0.0/8".parse().expect("a network")];
        for (url, address, may) in [
            ("https://a.example/", "1.1.1.1", true),
            ("http://a.example/", "1.1.1.1", false),
            ("https://a.example/", "169.254.169.254", false),
            ("https://a.example/", "::ffff:127.0.0.1", false),
            ("https://a.example/", "10.1.1.1", true),
            ("http://a.example/", "10.1.1.1", true),
            ("http://a.example/", "11.1.1.1", false),
        ] {
            let url: Address = url.parse().expect("an address");
            assert_eq!(url.may_reach(address.parse().expect("an address"), &networks), may, "{url} {address}");
        }
    }
}
