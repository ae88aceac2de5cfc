//! Connections on which a test says byte by byte what is sent.

use std::time::Duration;

use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use super::TestServer;

/// Far more than any test needs: whoever waits so long waits for ever.
const FOR_EVER: Duration = Duration::from_secs(60);

/// A connection to a server.
pub struct Raw(TcpStream);

impl Raw {
    pub async fn open(server: &TestServer) -> Raw {
        Raw(TcpStream::connect(server.handle.addr()).await.expect("a connection"))
    }

    /// Opens a connection and sends this.
    pub async fn send_to(server: &TestServer, bytes: impl AsRef<[u8]>) -> Raw {
        let mut raw = Raw::open(server).await;
        raw.send(bytes).await;
        raw
    }

    pub async fn send(&mut self, bytes: impl AsRef<[u8]>) {
        self.0.write_all(bytes.as_ref()).await.expect("sent");
    }

    /// Sends as long as the server takes it; false when it does not any more.
    pub async fn try_send(&mut self, bytes: impl AsRef<[u8]>) -> bool {
        self.0.write_all(bytes.as_ref()).await.is_ok()
    }

    /// What the server says before it closes the connection.
    pub async fn rest(mut self) -> String {
        let mut text = Vec::new();
        let reading = async {
            let mut chunk = [0; 4096];
            // a connection that is cut off is closed too
            while let Ok(count @ 1..) = self.0.read(&mut chunk).await {
                text.extend_from_slice(&chunk[..count]);
            }
        };
        tokio::time::timeout(FOR_EVER, reading).await.expect("the connection is closed");
        String::from_utf8_lossy(&text).into_owned()
    }

    /// The head of one answer, and its body if that is a problem or anything else with a length.
    pub async fn answer(&mut self) -> Answer {
        tokio::time::timeout(FOR_EVER, self.read_answer()).await.expect("an answer")
    }

    async fn read_answer(&mut self) -> Answer {
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            head.push(self.0.read_u8().await.expect("the head of an answer"));
        }
        let head = String::from_utf8(head).expect("text").to_ascii_lowercase();
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).expect("a status");
        let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
        let mut body = vec![0; length.map_or(0, |length| length.parse().expect("a length"))];
        self.0.read_exact(&mut body).await.expect("the body of an answer");
        Answer { status, body: serde_json::from_slice(&body).unwrap_or_default() }
    }
}

/// An answer.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    /// Null if it is no JSON.
    pub body: Value,
}
