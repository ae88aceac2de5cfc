//! Who has sent a request, and by which scheme and name, when proxies stand between: what those that are trusted say in
//! `Forwarded` (RFC 7239) or `X-Forwarded-*`.
//!
//! Everybody can send these headers. So the chain is followed from its near end: what a trusted proxy has added is
//! believed, and tells who was before it; the first that is not trusted is the client, and what that says counts for
//! nothing.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use axum::middleware::Next;
use axum::response::Response;

use visage_service::config::Network;

const FOR: HeaderName = HeaderName::from_static("x-forwarded-for");
const PROTO: HeaderName = HeaderName::from_static("x-forwarded-proto");
const HOST: HeaderName = HeaderName::from_static("x-forwarded-host");
/// Proxies that are followed.
const MOST_HOPS: usize = 16;

/// Whoever has opened a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Peer {
    /// From where.
    pub address: IpAddr,
    /// Whether by TLS.
    pub is_secure: bool,
}

/// Whoever has sent a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Client {
    /// From where.
    pub address: IpAddr,
    /// Whether by https, as far as is known.
    pub is_secure: bool,
    /// The name by which the service was called, if a trusted proxy tells.
    host: Option<String>,
}

impl Client {
    /// Whoever has sent this one, if that was noted.
    pub fn of<B>(request: &axum::http::Request<B>) -> Option<&Client> {
        request.extensions().get()
    }
}

#[cfg(test)]
impl From<IpAddr> for Client {
    fn from(address: IpAddr) -> Client {
        Client { address, is_secure: false, host: None }
    }
}

/// What one proxy has added.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Hop {
    from: Option<IpAddr>,
    is_secure: Option<bool>,
    host: Option<String>,
}

/// Notes whoever has sent a request, and calls the service by the name that a trusted proxy says it was called by.
pub async fn noted(State(trusted): State<Arc<[Network]>>, mut request: Request, next: Next) -> Response {
    if let Some(peer) = request.extensions().get::<Peer>().copied() {
        let client = client(peer, &trusted, request.headers());
        if let Some(host) = client.host.as_deref().and_then(|host| HeaderValue::from_str(host).ok()) {
            request.headers_mut().insert(header::HOST, host);
        }
        request.extensions_mut().insert(client);
    }
    next.run(request).await
}

fn client(peer: Peer, trusted: &[Network], headers: &HeaderMap) -> Client {
    let mut client = Client { address: peer.address.to_canonical(), is_secure: peer.is_secure, host: None };
    let is_trusted = |address: IpAddr| trusted.iter().any(|network| network.holds(address));
    if !is_trusted(client.address) {
        return client;
    }
    for hop in hops(headers).into_iter().rev().take(MOST_HOPS) {
        client.is_secure = hop.is_secure.unwrap_or(client.is_secure);
        client.host = hop.host.or(client.host);
        let Some(from) = hop.from else { break };
        client.address = from;
        if !is_trusted(from) {
            break;
        }
    }
    client
}

/// What proxies have added, the farthest first.
fn hops(headers: &HeaderMap) -> Vec<Hop> {
    if headers.contains_key(header::FORWARDED) {
        return list(headers, &header::FORWARDED).iter().map(|element| Hop::of_element(element)).collect();
    }
    let [from, proto, host] = [FOR, PROTO, HOST].map(|name| list(headers, &name));
    let count = from.len().max(1);
    // a value for each proxy, or that of the nearest alone
    let nth = |values: &[String], index: usize| {
        let at = (index + values.len()).checked_sub(count)?;
        values.get(at).cloned()
    };
    let hop = |index| Hop {
        from: nth(&from, index).and_then(|text| address(&text)),
        is_secure: nth(&proto, index).map(|text| text.eq_ignore_ascii_case("https")),
        host: nth(&host, index),
    };
    (0..count).map(hop).collect()
}

/// The values of a list that may be in several lines; a comma in quotes parts nothing.
fn list(headers: &HeaderMap, name: &HeaderName) -> Vec<String> {
    let lines = headers.get_all(name).iter().filter_map(|value| value.to_str().ok());
    lines.flat_map(|line| parts(line, ',')).filter(|value| !value.is_empty()).collect()
}

fn parts(text: &str, at: char) -> Vec<String> {
    let (mut parts, mut is_quoted) = (vec![String::new()], false);
    for c in text.chars() {
        is_quoted ^= c == '"';
        match parts.last_mut() {
            Some(part) if c != at || is_quoted => part.push(c),
            _ => parts.push(String::new()),
        }
    }
    parts.iter().map(|part| part.trim().to_owned()).collect()
}

impl Hop {
    /// `for=192.0.2.1;proto=https;host=visage.example`
    fn of_element(element: &str) -> Hop {
        let mut hop = Hop::default();
        for pair in parts(element, ';') {
            let Some((name, value)) = pair.split_once('=') else { continue };
            let value = value.trim().trim_matches('"');
            match name.trim().to_ascii_lowercase().as_str() {
                "for" => hop.from = address(value),
                "proto" => hop.is_secure = Some(value.eq_ignore_ascii_case("https")),
                "host" => hop.host = Some(value.to_owned()),
                _ => {}
            }
        }
        hop
    }
}

/// An address with a port or without, an IPv6 one in brackets or without. Names that hide one are none.
fn address(text: &str) -> Option<IpAddr> {
    let bare = text.strip_prefix('[').and_then(|text| text.strip_suffix(']')).unwrap_or(text);
    let address = bare.parse().ok().or_else(|| text.parse::<SocketAddr>().ok().map(|addr| addr.ip()))?;
    Some(IpAddr::to_canonical(&address))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(peer: &str, trusted: &[&str], headers: &[(&str, &str)]) -> (String, bool, Option<String>) {
        let trusted: Vec<Network> = trusted.iter().map(|text| text.parse().expect("a network")).collect();
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            let name = HeaderName::try_from(*name).expect("a name");
            map.append(name, HeaderValue::from_str(value).expect("a value"));
        }
        let peer = Peer { address: peer.parse().expect("an address"), is_secure: false };
        let Client { address, is_secure, host } = client(peer, &trusted, &map);
        (address.to_string(), is_secure, host)
    }

    fn is(address: &str, is_secure: bool, host: Option<&str>) -> (String, bool, Option<String>) {
        (address.to_owned(), is_secure, host.map(str::to_owned))
    }

    const ALL: [(&str, &str); 3] =
        [("x-forwarded-for", "1.1.1.1"), ("x-forwarded-proto", "https"), ("x-forwarded-host", "a.example")];

    #[test]
    fn who_is_not_trusted_says_nothing_of_others() {
        assert_eq!(seen("9.9.9.9", &[], &ALL), is("9.9.9.9", false, None));
        assert_eq!(seen("9.9.9.9", &["10.0.0.0/8"], &ALL), is("9.9.9.9", false, None));
        let forwarded = [("forwarded", "for=1.1.1.1;proto=https;host=a.example")];
        assert_eq!(seen("9.9.9.9", &["10.0.0.0/8"], &forwarded), is("9.9.9.9", false, None));
    }

    #[test]
    fn the_client_is_the_first_that_is_not_trusted_from_the_near_end() {
        let trusted = ["10.0.0.0/8", "::1"];
        assert_eq!(seen("10.0.0.1", &trusted, &ALL), is("1.1.1.1", true, Some("a.example")));
        assert_eq!(seen("::ffff:10.0.0.1", &trusted, &ALL), is("1.1.1.1", true, Some("a.example")));
        // what the client itself has put before is not looked at
        let forged = [("x-forwarded-for", "7.7.7.7, 1.1.1.1"), ("x-forwarded-for", "10.0.0.2")];
        assert_eq!(seen("10.0.0.1", &trusted, &forged), is("1.1.1.1", false, None));
        let forged =
            [("forwarded", "for=7.7.7.7;proto=https;host=evil.example, for=1.1.1.1;proto=http;host=a.example")];
        assert_eq!(seen("10.0.0.1", &trusted, &forged), is("1.1.1.1", false, Some("a.example")));
        let chain = [("forwarded", "for=\"[2001:db8::1]:47\";proto=https;host=a.example,for=10.0.0.2;proto=http")];
        assert_eq!(seen("::1", &trusted, &chain), is("2001:db8::1", true, Some("a.example")));
    }

    #[test]
    fn what_is_no_address_ends_the_chain_and_forwarded_counts_before_the_others() {
        let trusted = ["10.0.0.0/8"];
        for value in ["unknown", "_hidden", "", "1.1.1", "evil, unknown", "\"", "for=1.1.1.1"] {
            assert_eq!(seen("10.0.0.1", &trusted, &[("x-forwarded-for", value)]).0, "10.0.0.1", "{value}");
        }
        let both = [("forwarded", "for=2.2.2.2"), ("x-forwarded-for", "1.1.1.1")];
        assert_eq!(seen("10.0.0.1", &trusted, &both).0, "2.2.2.2");
        let quoted = [("forwarded", "host=\"a,b\";for=\"2.2.2.2:80\"")];
        assert_eq!(seen("10.0.0.1", &trusted, &quoted), is("2.2.2.2", false, Some("a,b")));
        let loop_of_trusted = "10.0.0.9, ".repeat(40) + "10.0.0.9";
        assert_eq!(seen("10.0.0.1", &trusted, &[("x-forwarded-for", &loop_of_trusted)]).0, "10.0.0.9");
    }
}
