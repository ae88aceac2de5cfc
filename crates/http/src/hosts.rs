//! Who is meant: requests that name another host are refused.
//!
//! A page that a browser has loaded from elsewhere can lead its name to this machine (DNS rebinding); what it asks then
//! names that host. Addresses can't be led elsewhere, so where the service listens on all of the machine's, it may be
//! called by any address.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{Version, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use tower_http::csrf::{ConfigError, CsrfLayer, ProtectionError};

use super::problem::{Code, Problem};
use visage_service::config::{Host, HostName, Origin};

const HINT: &str = "call the service by its address or by localhost; other names have to be allowed when it is started: \
                    visage serve --host NAME";

/// Makes the answer to a request of a foreign page.
pub type Refusal = fn(ProtectionError) -> Response;

/// By which names the service may be called.
#[derive(Debug, Clone)]
pub struct Hosts {
    bound: IpAddr,
    others: Arc<[HostName]>,
}

impl Hosts {
    /// Loopback names, the address it listens on, and others.
    pub fn new(bound: SocketAddr, others: &[HostName]) -> Hosts {
        Hosts { bound: bound.ip().to_canonical(), others: others.into() }
    }

    /// Whether the service may be called so. Ports are not looked at unless one was given: they change on the way
    /// through tunnels and containers.
    fn allow(&self, name: &HostName) -> bool {
        let is_bound = match name.host {
            Host::Address(address) => self.bound.is_unspecified() || address == self.bound,
            Host::Name(_) => false,
        };
        let is_known = |other: &HostName| other.host == name.host && (other.port.is_none() || other.port == name.port);
        is_bound || name.host.is_loopback() || self.others.iter().any(is_known)
    }

    fn check(&self, request: &Request) -> Result<(), Problem> {
        let mut given = request.headers().get_all(header::HOST).iter();
        let (first, second) = (given.next(), given.next());
        if second.is_some() || (first.is_none() && request.version() >= Version::HTTP_11) {
            let detail = "a request of HTTP/1.1 has exactly one Host header";
            return Err(Problem::new(Code::MalformedRequest, detail, "send the name by which the service is called"));
        }
        // a proxy's form of the address stands above the header; both have to be ours
        let in_uri = request.uri().authority().map(|authority| authority.as_str().as_bytes());
        for text in first.map(|value| value.as_bytes()).into_iter().chain(in_uri) {
            let name = std::str::from_utf8(text).ok().and_then(|text| text.parse::<HostName>().ok());
            if !name.is_some_and(|name| self.allow(&name)) {
                let shown: String = String::from_utf8_lossy(text).chars().take(100).collect();
                return Err(Problem::new(Code::ForeignHost, format!("the service is not called {shown:?}"), HINT));
            }
        }
        Ok(())
    }

    /// Refuses changes that a page of another origin asks a browser for. Pages under the allowed names may ask for
    /// them, whatever a proxy made of `Host` on the way, and so may those of `others`.
    pub fn same_origin(&self, others: &[Origin]) -> Result<CsrfLayer<Refusal>, ConfigError> {
        let layer = CsrfLayer::new().with_rejection_response(foreign_origin as Refusal);
        let origins = self.others.iter().flat_map(|name| [origin("https", 443, name), origin("http", 80, name)]);
        let mut origins = origins.chain(others.iter().map(Origin::to_string));
        origins.try_fold(layer, |layer, origin| layer.add_trusted_origin(origin))
    }
}

/// The origin of pages under a name as browsers write it: without the port that goes without saying.
fn origin(scheme: &str, usual: u16, name: &HostName) -> String {
    let name = HostName { port: name.port.filter(|port| *port != usual), ..name.clone() };
    format!("{scheme}://{name}")
}

fn foreign_origin(_: ProtectionError) -> Response {
    let detail = "the request comes from a page of another origin (Origin, Sec-Fetch-Site)";
    let hint = "changes can only be asked for by programs and by pages of the service's own; a page behind a proxy is \
                one when its name is allowed: visage serve --host NAME";
    Problem::new(Code::ForeignOrigin, detail, hint).into_response()
}

/// Refuses requests that name another host.
pub async fn known_host(State(hosts): State<Hosts>, request: Request, next: Next) -> Response {
    match hosts.check(&request) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allows(bound: &str, others: &[&str], name: &str) -> bool {
        let others: Vec<HostName> = others.iter().map(|other| other.parse().expect("a host")).collect();
        Hosts::new(bound.parse().expect("an address"), &others).allow(&name.parse().expect("a host"))
    }

    #[test]
    fn loopback_names_and_the_bound_address_are_known() {
        for name in ["localhost", "localhost:1", "app.localhost:9000", "127.0.0.1:80", "[::1]:80", "[::ffff:127.0.0.1]"]
        {
            assert!(allows("127.0.0.1:8080", &[], name), "{name}");
        }
        for name in ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "10.0.0.1", "visage"] {
            assert!(!allows("127.0.0.1:8080", &[], name), "{name}");
        }
        assert!(allows("10.0.0.1:8080", &[], "10.0.0.1:8080"));
        assert!(!allows("10.0.0.1:8080", &[], "10.0.0.2:8080"));
    }

    #[test]
    fn on_all_addresses_it_is_called_by_any_address_but_not_by_any_name() {
        for bound in ["0.0.0.0:80", "[::]:80"] {
            assert!(allows(bound, &[], "192.168.1.5:9000") && allows(bound, &[], "[fd00::1]"));
            assert!(!allows(bound, &[], "visage.example"));
        }
    }

    #[test]
    fn other_names_are_known_with_their_port_if_they_have_one() {
        let others = ["visage.example", "faces.example:8443"];
        for name in ["visage.example", "VISAGE.example:443", "faces.example:8443"] {
            assert!(allows("127.0.0.1:80", &others, name), "{name}");
        }
        for name in ["faces.example", "faces.example:80", "a.visage.example"] {
            assert!(!allows("127.0.0.1:80", &others, name), "{name}");
        }
    }

    #[test]
    fn every_host_name_makes_an_origin() {
        for name in ["visage.example", "a_b.example:8443", "[fd00::5]:80", "10.0.0.1", "xn--exmple-cua.com"] {
            let hosts = Hosts::new(([127, 0, 0, 1], 80).into(), &[name.parse().expect("a host")]);
            assert!(hosts.same_origin(&[]).is_ok(), "{name}");
        }
        let name: HostName = "visage.example:443".parse().expect("a host");
        assert_eq!(origin("https", 443, &name), "https://visage.example");
        assert_eq!(origin("http", 80, &name), "http://visage.example:443");
    }
}
