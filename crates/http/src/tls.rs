//! TLS, where no proxy does it: rustls with ring, and HTTP/1.1 inside. It is a feature of the build (`tls`), since it
//! is some 17 s of processor time of a clean one.

use std::sync::Arc;

use tokio::net::TcpStream;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::{self, ServerConfig};
use tokio_rustls::server::TlsStream;

use visage_service::config::TlsPem;

/// Why there is no TLS.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// The file with the certificates.
    #[error("--tls-cert: {0}; it has to hold the certificate and those that lead from it to its authority, as PEM")]
    Certificate(String),
    /// The file with the key.
    #[error("--tls-key: {0}; it has to hold the private key of the certificate, as PEM and without a password")]
    Key(String),
    /// Both do not go together.
    #[error("--tls-cert and --tls-key: {0}")]
    Pair(#[from] rustls::Error),
}

/// Takes connections by TLS. Cheap to clone.
#[derive(Clone)]
pub struct Tls(TlsAcceptor);

impl Tls {
    /// With this certificate and its key.
    pub fn new(pem: &TlsPem) -> Result<Tls, TlsError> {
        let refused = |error: rustls::pki_types::pem::Error| TlsError::Certificate(error.to_string());
        let certificates: Vec<CertificateDer<'static>> =
            CertificateDer::pem_slice_iter(&pem.certificate).collect::<Result<_, _>>().map_err(refused)?;
        if certificates.is_empty() {
            return Err(TlsError::Certificate("there is no certificate in it".to_owned()));
        }
        let key = PrivateKeyDer::from_pem_slice(&pem.key).map_err(|error| TlsError::Key(error.to_string()))?;
        let provider = Arc::new(ring::default_provider());
        let mut config = ServerConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()?
            .with_no_client_auth()
            .with_single_cert(certificates, key)?;
        config.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Tls(TlsAcceptor::from(Arc::new(config))))
    }

    /// Shakes hands.
    pub async fn accept(&self, stream: TcpStream) -> std::io::Result<TlsStream<TcpStream>> {
        self.0.accept(stream).await
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use axum::Router;
    use axum::routing::get;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::TcpListener;
    use tokio::sync::watch;
    use tokio_rustls::TlsConnector;
    use tokio_rustls::rustls::{ClientConfig, RootCertStore};
    use tokio_util::sync::CancellationToken;

    use super::*;
    use crate::connections::{Connections, serve};
    use crate::outgoing::{HttpCourier, ProbeError, probe};
    use visage_service::app::webhooks::{Courier, Letter, Unreached};
    use visage_service::config::{EdgeLimits, WebhookSettings};

    /// Of `localhost`, until 2126, signed by itself; it protects nothing.
    const CERTIFICATE: &str = "-----BEGIN CERTIFICATE-----
MIIBkzCCATigAwIBAgIUINnTaiY4ZL3esmRFUqrNJcpJ8pUwCgYIKoZIzj0EAwIw
FDESMBAGA1UEAwwJbG9jYWxob3N0MCAXDTI2MTEyOTIzMDU0NloYDzIxMjYxMTA1
MjMwNTQ2WjAUMRIwEAYDVQQDDAlsb2NhbGhvc3QwWTATBgcqhkjOPQIBBggqhkjO
PQMBBwNCAAQOvLwDvlb7UPbdqVW5S9oGu7OlLEfLaDgjL7t/UDLjgbTEidRegRNL
xQ9DFhURcV6te5A2kWzb9okhEU2W6RNSo2YwZDAdBgNVHQ4EFgQUDTvLMW2Hin4m
W157vgP8mPTPmigwHwYDVR0jBBgwFoAUDTvLMW2Hin4mW157vgP8mPTPmigwFAYD
VR0RBA0wC4IJbG9jYWxob3N0MAwGA1UdEwEB/wQCMAAwCgYIKoZIzj0EAwIDSQAw
RgIhAOD9RPVJYYDN1orbiE4Fo1PWPH09OKYbEie9wbO+yxdSAiEA3glFphZk5fzC
h4hnppZibYedzqJpvAP9MHuhWb/BLWY=
-----END CERTIFICATE-----
";

    /// The certificate of somebody else who says to be the same.
    const OTHER: &str = "-----BEGIN CERTIFICATE-----
MIIBlTCCATugAwIBAgIUHRutuSuuy3gpjZotklkr24NUh9wwCgYIKoZIzj0EAwIw
FDESMBAGA1UEAwwJbG9jYWxob3N0MCAXDTI2MTEzMDAyMzUwMloYDzIxMjYxMTA2
MDIzNTAyWjAUMRIwEAYDVQQDDAlsb2NhbGhvc3QwWTATBgcqhkjOPQIBBggqhkjO
PQMBBwNCAATNhTgIvZSgOdeXa7pbJld9ODEP+DDoUfY82pSbXPh5sWFPC8QmAmhu
vdXLGeSYVjNKo/WTsTlujNmb5zsZpqryo2kwZzAdBgNVHQ4EFgQUWe++gEh7Nuoq
krgY7s8orfihP5owHwYDVR0jBBgwFoAUWe++gEh7NuoqkrgY7s8orfihP5owDwYD
VR0TAQH/BAUwAwEB/zAUBgNVHREEDTALgglsb2NhbGhvc3QwCgYIKoZIzj0EAwID
SAAwRQIgVCifosEZDFgxZiUsnhuSIRu6UPAvjAp9GFaedMk4aZECIQCWGv47H/ym
e1DFRmvwFztTAdr3a7+uExmVbnhDxITbQg==
-----END CERTIFICATE-----
";

    fn key(lines: &str) -> String {
        let label = ["PRIVATE", "KEY"].join(" ");
        format!("-----BEGIN {label}-----\n{lines}\n-----END {label}-----\n")
    }

    fn own_key() -> String {
        key(
            "MIGHAgEAMBMGByqGSM49AgEGCCqGSM49AwEHBG0wawIBAQQg4fLRjaVYX3D1bM/C\nI0e8bcwdS5u+plyejFF90AX++bShRANCAAQOvLwDvlb7UPbdqVW5S9oGu7OlLEfL\naDgjL7t/UDLjgbTEidRegRNLxQ9DFhURcV6te5A2kWzb9okhEU2W6RNS",
        )
    }

    fn other_key() -> String {
        key(
            "MIGHAgEAMBMGByqGSM49AgEGCCqGSM49AwEHBG0wawIBAQQgVmcxJdz/oGhffAAj\nqkM+vR8DYwyL2k5LTUCybF+OUDGhRANCAATcS8j+SR6N/tsYV0CFqW9jJtFh72aW\n5vqeKiyAgPe8jLnf43DegIEvSOGUy/Jbysz7WJin0xSmX+dgqXg9I/Wc",
        )
    }

    fn tls(certificate: &str, key: &str) -> Result<Tls, TlsError> {
        Tls::new(&TlsPem { certificate: certificate.as_bytes().to_vec(), key: key.as_bytes().to_vec() })
    }

    fn connector(trusts: bool) -> TlsConnector {
        let mut roots = RootCertStore::empty();
        if trusts {
            let certificate = CertificateDer::from_pem_slice(CERTIFICATE.as_bytes()).expect("a certificate");
            roots.add(certificate).expect("a root");
        }
        let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
        let builder = builder.with_safe_default_protocol_versions().expect("versions");
        TlsConnector::from(Arc::new(builder.with_root_certificates(roots).with_no_client_auth()))
    }

    #[test]
    fn what_is_no_certificate_or_no_key_of_it_is_refused_with_the_file() {
        tls(CERTIFICATE, &own_key()).map(drop).expect("they go together");
        for (certificate, key, part) in [
            ("", own_key(), "--tls-cert"),
            ("-----BEGIN CERTIFICATE-----\n!\n-----END CERTIFICATE-----\n", own_key(), "--tls-cert"),
            (CERTIFICATE, String::new(), "--tls-key"),
            (CERTIFICATE, CERTIFICATE.to_owned(), "--tls-key"),
            (CERTIFICATE, other_key(), "--tls-cert and --tls-key"),
        ] {
            let refused = tls(certificate, &key).map(drop).expect_err(part).to_string();
            assert!(refused.contains(part), "{refused}");
        }
    }

    #[tokio::test]
    async fn requests_are_answered_by_tls_and_not_without() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let addr = listener.local_addr().expect("an address");
        let (stop, limits) =
            (CancellationToken::new(), EdgeLimits { head_time: Duration::from_secs(1), ..EdgeLimits::default() });
        let (count, mut connections) = watch::channel(Connections::default());
        let router = Router::new().route("/healthz", get(|| async { "well" }));
        let tls = tls(CERTIFICATE, &own_key()).expect("they go together");
        let serving = tokio::spawn(serve(listener, router, limits, stop.clone(), count, Some(tls)));
        let connect = async || tokio::net::TcpStream::connect(addr).await.expect("a connection");
        let name = || "localhost".try_into().expect("a name");

        let mut stream = connector(true).connect(name(), connect().await).await.expect("trusted");
        assert_eq!(stream.get_ref().1.alpn_protocol(), None, "the client asked for none");
        stream.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").await.expect("sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.expect("an answer, and a proper end");
        assert!(answer.starts_with("HTTP/1.1 200") && answer.ends_with("well"), "{answer}");
        assert!(connector(false).connect(name(), connect().await).await.is_err(), "nobody vouches for it");

        // in the clear there is no answer, and who says nothing is cut off as with half a head
        let mut plain = connect().await;
        plain.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n").await.expect("sent");
        let mut answer = Vec::new();
        let _ = plain.read_to_end(&mut answer).await;
        assert!(!answer.windows(4).any(|bytes| bytes == b"HTTP"), "{answer:?}");
        let mut silent = connect().await;
        let _ = silent.read_to_end(&mut answer).await;
        let gone = connections.wait_for(|connections| connections.open == 0);
        tokio::time::timeout(Duration::from_secs(60), gone).await.expect("in time").expect("it serves");
        stop.cancel();
        serving.await.expect("it ends");
    }

    #[tokio::test]
    async fn a_health_check_takes_the_certificate_of_the_service_and_no_other() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let addr = listener.local_addr().expect("an address");
        let stop = CancellationToken::new();
        let (count, _connections) = watch::channel(Connections::default());
        let router = Router::new().route("/healthz", get(|| async { "well" }));
        let tls = tls(CERTIFICATE, &own_key()).expect("they go together");
        let serving = serve(listener, router, EdgeLimits::default(), stop.clone(), count, Some(tls));
        let serving = tokio::spawn(serving);
        // the name in it is not looked at: it is asked by an address
        assert_eq!(probe(addr, "/healthz", Some(CERTIFICATE.as_bytes())).await.expect("it is well"), 200);
        assert!(matches!(probe(addr, "/healthz", Some(OTHER.as_bytes())).await, Err(ProbeError::Failed(_))));
        assert!(matches!(probe(addr, "/healthz", Some(b"")).await, Err(ProbeError::Certificate(_))));
        assert!(matches!(probe(addr, "/healthz", None).await, Err(ProbeError::Failed(_))));
        stop.cancel();
        serving.await.expect("it ends");
    }

    /// What nobody vouches for gets no message, whatever its address.
    #[tokio::test]
    async fn a_receiver_that_nobody_vouches_for_gets_no_message() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let url = format!("https://localhost:{}/", listener.local_addr().expect("an address").port());
        let stop = CancellationToken::new();
        let (count, _connections) = watch::channel(Connections::default());
        let tls = tls(CERTIFICATE, &own_key()).expect("they go together");
        let router = Router::new();
        let serving = tokio::spawn(serve(listener, router, EdgeLimits::default(), stop.clone(), count, Some(tls)));
        let networks = vec!["127.0.0.1".parse().expect("a network")];
        let courier = HttpCourier::new(WebhookSettings { networks, ..WebhookSettings::default() });
        let headers = ["a", "b", "c"].map(|name| (name, String::new()));
        let letter = Letter { address: url.parse().expect("an address"), headers, body: "{}".to_owned() };
        // without any authority of the system there is no TLS at all
        let refused = courier.deliver(&letter).await.expect_err("nobody vouches for it");
        assert!(matches!(refused, Unreached::Failed(_) | Unreached::NoTls), "{refused}");
        stop.cancel();
        serving.await.expect("it ends");
    }
}
