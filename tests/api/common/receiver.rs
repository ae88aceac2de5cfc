//! A receiver of webhooks that answers as a test tells it.

use std::net::SocketAddr;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

/// What a receiver was sent.
#[derive(Debug, Clone)]
pub struct Message {
    head: String,
    /// The body, as it was sent.
    pub body: String,
}

impl Message {
    /// A header.
    pub fn header(&self, name: &str) -> &str {
        let mut lines = self.head.lines().filter_map(|line| line.split_once(": "));
        lines.find_map(|(known, value)| known.eq_ignore_ascii_case(name).then_some(value)).expect("the header")
    }

    /// The kind of event.
    pub fn kind(&self) -> String {
        super::text(&serde_json::from_str(&self.body).expect("JSON"), "/type")
    }
}

/// A receiver on a port of this machine; it is gone when this is dropped.
pub struct Receiver {
    pub addr: SocketAddr,
    messages: mpsc::UnboundedReceiver<Message>,
    serving: JoinHandle<()>,
}

impl Drop for Receiver {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

impl Receiver {
    /// Answers with these statuses, and with 200 from then on; 0 is no answer at all.
    pub async fn start(statuses: &[u16]) -> Receiver {
        Self::start_at(([127, 0, 0, 1], 0).into(), statuses).await
    }

    /// The same at an address.
    pub async fn start_at(addr: SocketAddr, statuses: &[u16]) -> Receiver {
        let listener = TcpListener::bind(addr).await.expect("a port");
        let addr = listener.local_addr().expect("an address");
        let (tell, messages) = mpsc::unbounded_channel();
        let statuses = statuses.to_vec();
        let mut statuses = statuses.into_iter();
        let serving = tokio::spawn(async move {
            // who gets no answer waits for it as long as it likes
            let mut hanging = Vec::new();
            while let Ok((mut stream, _)) = listener.accept().await {
                let Some(message) = read(&mut stream).await else { continue };
                let status = statuses.next().unwrap_or(200);
                let _ = tell.send(message);
                if status == 0 {
                    hanging.push(stream);
                    continue;
                }
                let answer =
                    format!("HTTP/1.1 {status} So\r\nlocation: http://127.0.0.1:9/\r\ncontent-length: 0\r\n\r\n");
                let _ = stream.write_all(answer.as_bytes()).await;
            }
        });
        Receiver { addr, messages, serving }
    }

    /// Where it listens.
    pub fn url(&self) -> String {
        format!("http://{}/hook", self.addr)
    }

    /// The next message.
    pub async fn message(&mut self) -> Message {
        let next = tokio::time::timeout(Duration::from_secs(60), self.messages.recv()).await;
        next.expect("a message in time").expect("it serves")
    }
}

async fn read(stream: &mut TcpStream) -> Option<Message> {
    let mut bytes = Vec::new();
    loop {
        let text = String::from_utf8_lossy(&bytes).into_owned();
        if let Some((head, body)) = text.split_once("\r\n\r\n") {
            let message = Message { head: head.to_owned(), body: body.to_owned() };
            if message.header("content-length").parse() == Ok(body.len()) {
                return Some(message);
            }
        }
        if stream.read_buf(&mut bytes).await.ok()? == 0 {
            return None;
        }
    }
}
