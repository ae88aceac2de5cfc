//! Receivers that fail, hang, redirect, talk too much, or are where nobody may ask.

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use visage_service::app::webhooks::{Courier, Letter};
use visage_service::config::Network;

use super::*;

fn settings(networks: &[&str]) -> WebhookSettings {
    let networks = networks.iter().map(|text| text.parse::<Network>().expect("a network")).collect();
    WebhookSettings { networks, patience: Duration::from_secs(5), ..WebhookSettings::default() }
}

fn letter(url: &str) -> Letter {
    let headers = ["webhook-id", "webhook-timestamp", "webhook-signature"].map(|name| (name, format!("of {name}")));
    Letter { address: url.parse().expect("an address"), headers, body: "{}".to_owned() }
}

/// Answers one request with these bytes; gives back what was asked.
async fn receiver(answer: Vec<u8>) -> (SocketAddr, tokio::task::JoinHandle<String>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let addr = listener.local_addr().expect("an address");
    let serving = tokio::spawn(async move {
        let (mut stream, _) = listener.accept().await.expect("a connection");
        let mut asked = vec![0; 4096];
        let mut read = 0;
        while !asked[..read].ends_with(b"\r\n\r\n{}") {
            match stream.read(&mut asked[read..]).await.expect("a request") {
                0 => break,
                more => read += more,
            }
        }
        let _ = stream.write_all(&answer).await;
        String::from_utf8_lossy(&asked[..read]).into_owned()
    });
    (addr, serving)
}

async fn sent(answer: &[u8]) -> Result<u16, Unreached> {
    let (addr, _serving) = receiver(answer.to_vec()).await;
    HttpCourier::new(settings(&["127.0.0.1"])).deliver(&letter(&format!("http://{addr}/hook?a=b"))).await
}

#[tokio::test]
async fn a_message_arrives_with_its_headers() {
    let (addr, serving) = receiver(b"HTTP/1.1 204 No Content\r\n\r\n".to_vec()).await;
    let courier = HttpCourier::new(settings(&["127.0.0.0/8"]));
    // by its name the receiver is found too
    let url = format!("http://localhost:{}/hook?a=b", addr.port());
    assert_eq!(courier.deliver(&letter(&url)).await, Ok(204));
    let asked = serving.await.expect("asked").to_ascii_lowercase();
    assert!(asked.starts_with("post /hook?a=b http/1.1\r\n"), "{asked}");
    for line in
        ["content-type: application/json", "webhook-id: of webhook-id", &format!("host: localhost:{}", addr.port())]
    {
        assert!(asked.contains(line), "{asked}");
    }
}

#[tokio::test]
async fn where_nobody_may_ask_nothing_is_connected_to() {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let port = listener.local_addr().expect("an address").port();
    let courier = HttpCourier::new(settings(&["10.0.0.0/8"]));
    // addresses and names that lead to one, also as IPv6: what counts is what would be connected to
    for host in ["127.0.0.1", "localhost", "[::ffff:127.0.0.1]", "[::1]", "169.254.169.254", "0.0.0.0"] {
        let refused = courier.deliver(&letter(&format!("http://{host}:{port}/"))).await;
        assert!(matches!(refused, Err(Unreached::Forbidden(_))), "{host}: {refused:?}");
    }
    // in the clear nothing public is asked
    let refused = courier.deliver(&letter("http://1.1.1.1/")).await;
    assert!(matches!(refused, Err(Unreached::Forbidden(_))), "{refused:?}");
    let nobody = tokio::select! {
        biased;
        _ = listener.accept() => false,
        () = tokio::task::yield_now() => true,
    };
    assert!(nobody, "the listener was connected to");
}

#[tokio::test]
async fn a_redirect_is_an_answer_and_not_followed() {
    let (target, serving) = receiver(b"HTTP/1.1 200 OK\r\n\r\n".to_vec()).await;
    let answer = format!("HTTP/1.1 302 Found\r\nlocation: http://{target}/\r\ncontent-length: 0\r\n\r\n");
    assert_eq!(sent(answer.as_bytes()).await, Ok(302));
    assert!(!serving.is_finished());
    serving.abort();
}

#[tokio::test]
async fn what_is_no_answer_is_a_failure() {
    for answer in [&b""[..], b"hello", b"HTTP/1.1 2", b"SSH-2.0-x\r\n"] {
        assert!(matches!(sent(answer).await, Err(Unreached::Failed(_))), "{answer:?}");
    }
    // a head that has no end
    let endless = [b"HTTP/1.1 200 OK\r\nx: ".to_vec(), vec![b'x'; 1 << 20]].concat();
    assert!(matches!(sent(&endless).await, Err(Unreached::Failed(_))));
}

#[tokio::test]
async fn of_an_endless_body_nothing_is_read() {
    let answer = [b"HTTP/1.1 200 OK\r\ncontent-length: 999999999999\r\n\r\n".to_vec(), vec![b'x'; 1 << 20]].concat();
    assert_eq!(sent(&answer).await, Ok(200));
}

#[tokio::test]
async fn who_never_answers_is_given_up() {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let url = format!("http://{}/", listener.local_addr().expect("an address"));
    let courier = HttpCourier::new(WebhookSettings { patience: Duration::from_millis(50), ..settings(&["127.0.0.1"]) });
    assert_eq!(courier.deliver(&letter(&url)).await, Err(Unreached::TimedOut));
}

#[tokio::test]
async fn who_is_gone_is_a_failure() {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let url = format!("http://{}/", listener.local_addr().expect("an address"));
    drop(listener);
    let failed = HttpCourier::new(settings(&["127.0.0.1"])).deliver(&letter(&url)).await;
    assert!(matches!(failed, Err(Unreached::Failed(_))), "{failed:?}");
}

#[test]
fn what_can_never_be_reached_is_told_when_a_webhook_is_made() {
    let check = |url: &str, networks: &[&str]| check(&url.parse().expect("an address"), &settings(networks));
    assert!(matches!(check("http://10.0.0.1/", &[]), Err(Unreached::Forbidden(_))));
    assert!(matches!(check("http://a.example/", &[]), Err(Unreached::Forbidden(_))));
    assert!(matches!(check("https://127.0.0.1/", &[]), Err(Unreached::Forbidden(_))));
    assert_eq!(check("http://a.example/", &["10.0.0.0/8"]), Ok(()));
    let secure = if HAS_TLS { Ok(()) } else { Err(Unreached::NoTls) };
    assert_eq!(check("https://a.example/", &[]), secure);
}

#[test]
fn everywhere_is_asked_at_home() {
    let addr = |text: &str| text.parse::<SocketAddr>().expect("an address");
    assert_eq!(reachable(addr("0.0.0.0:80")), addr("127.0.0.1:80"));
    assert_eq!(reachable(addr("[::]:80")), addr("[::1]:80"));
    assert_eq!(reachable(addr("10.1.2.3:80")), addr("10.1.2.3:80"));
}
