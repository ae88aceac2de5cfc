//! The name in a URL by which a service is called: `visage.example`, `192.168.1.5`, `[fd00::5]`, each with a port or none.

use std::fmt;
use std::net::{IpAddr, Ipv6Addr};
use std::str::FromStr;

/// A host, with a port or for any port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HostName {
    /// The name or address.
    pub host: Host,
    /// The port; `None` stands for any.
    pub port: Option<u16>,
}

/// What a host is called.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Host {
    /// A name, in lower case and without the dot that may end it.
    Name(String),
    /// An address; an IPv4 one that is written as IPv6 is an IPv4 one.
    Address(IpAddr),
}

/// A text that is no host.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0:?} is no host: write a name such as visage.example or an address, with a port or without, and no scheme or path"
)]
pub struct NoHostName(String);

impl FromStr for HostName {
    type Err = NoHostName;

    fn from_str(text: &str) -> Result<Self, NoHostName> {
        let refused = || NoHostName(text.chars().take(100).collect());
        if let Ok(address) = text.parse::<Ipv6Addr>() {
            return Ok(HostName { host: Host::Address(address.to_canonical()), port: None });
        }
        let (host, port) = match text.rsplit_once(':') {
            // the colons of an address in brackets
            Some((_, rest)) if rest.ends_with(']') => (text, None),
            Some((host, port)) => (host, Some(port)),
            None => (text, None),
        };
        let port = port.map(|port| match port.bytes().all(|digit| digit.is_ascii_digit()) {
            true => port.parse().map_err(|_| refused()),
            false => Err(refused()),
        });
        let port = port.transpose()?;
        if let Some(inner) = host.strip_prefix('[') {
            let address = inner.strip_suffix(']').and_then(|inner| inner.parse::<Ipv6Addr>().ok());
            return Ok(HostName { host: Host::Address(address.ok_or_else(refused)?.to_canonical()), port });
        }
        if let Ok(address) = host.parse() {
            return Ok(HostName { host: Host::Address(address), port });
        }
        let name = host.strip_suffix('.').unwrap_or(host).to_ascii_lowercase();
        let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        let labels = name.split('.').all(|label| !label.is_empty());
        // browsers read names that end in a number as addresses, in notations that we don't
        let is_number = name.rsplit('.').next().is_some_and(|last| last.starts_with(|c: char| c.is_ascii_digit()));
        if name.len() > 253 || !labels || is_number || !name.chars().all(is_plain) {
            return Err(refused());
        }
        Ok(HostName { host: Host::Name(name), port })
    }
}

impl fmt::Display for HostName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.host {
            Host::Name(name) => f.write_str(name)?,
            Host::Address(IpAddr::V4(address)) => write!(f, "{address}")?,
            Host::Address(IpAddr::V6(address)) => write!(f, "[{address}]")?,
        }
        self.port.map_or(Ok(()), |port| write!(f, ":{port}"))
    }
}

impl Host {
    /// Whether it names this machine to itself and to nobody else. Names under `localhost` never leave the machine
    /// (RFC 6761).
    pub fn is_loopback(&self) -> bool {
        match self {
            Host::Name(name) => name == "localhost" || name.ends_with(".localhost"),
            Host::Address(address) => address.is_loopback(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> HostName {
        text.parse().unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn the_same_host_in_other_writing_is_the_same() {
        assert_eq!(read("Visage.Example."), read("visage.example"));
        assert_eq!(read("[::1]"), read("::1"));
        assert_eq!(read("[::ffff:127.0.0.1]:80"), read("127.0.0.1:80"));
        assert_eq!(read("a:80").port, Some(80));
        for text in ["visage.example", "visage.example:8443", "10.0.0.1:80", "[fd00::5]:80", "[fd00::5]"] {
            assert_eq!(read(text).to_string(), text);
        }
    }

    #[test]
    fn what_is_no_host_is_refused() {
        for text in [
            "",
            ".",
            "a..b",
            "http://a",
            "a/b",
            "a:b",
            "a:99999",
            "a:+80",
            "a:",
            ":80",
            "[::1",
            "[a]:80",
            "user@a",
            "a b",
            "2130706433",
            "0x7f.1",
            "a,b",
            "*",
        ] {
            assert!(text.parse::<HostName>().is_err(), "{text}");
        }
    }

    #[test]
    fn loopback_names_are_known() {
        for text in ["localhost", "LOCALHOST:80", "app.localhost", "127.0.0.1", "127.8.9.10", "[::1]:80"] {
            assert!(read(text).host.is_loopback(), "{text}");
        }
        for text in ["localhost.example", "notlocalhost", "10.0.0.1", "[fd00::1]", "0.0.0.0"] {
            assert!(!read(text).host.is_loopback(), "{text}");
        }
    }
}
