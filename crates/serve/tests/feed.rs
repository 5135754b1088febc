//! A WebSocket client as plain as the other one: `/ws/live` as a page sees it.

use serde_json::{Value, json};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

/// An open feed.
pub struct Feed {
    stream: TcpStream,
    read: Vec<u8>,
}

/// What a feed says.
#[derive(Debug)]
pub enum Told {
    Text(Value),
    /// Header and JPEG.
    Picture(Value, Vec<u8>),
}

impl Feed {
    pub fn open(place: SocketAddr) -> Self {
        Feed::of(place, "/ws/live")
    }

    /// Of another address.
    pub fn of(place: SocketAddr, path: &str) -> Self {
        let mut stream = TcpStream::connect(place).expect("a connection");
        let head = format!(
            "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n",
            place.port()
        );
        stream.write_all(head.as_bytes()).expect("sent");
        let mut feed = Feed { stream, read: Vec::new() };
        let until = Instant::now() + Duration::from_secs(10);
        let end = loop {
            if let Some(end) = feed.read.windows(4).position(|w| w == b"\r\n\r\n") {
                break end + 4;
            }
            assert!(Instant::now() < until && feed.more(Duration::from_secs(1)), "no answer");
        };
        assert!(feed.read.starts_with(b"HTTP/1.1 101"), "{}", String::from_utf8_lossy(&feed.read[..end]));
        feed.read.drain(..end);
        feed
    }

    /// Sends a text; masked with zeros, which is a mask too.
    pub fn say(&mut self, message: &Value) {
        let text = message.to_string();
        let mut frame = match text.len() {
            n if n < 126 => vec![0x81, 0x80 | n as u8],
            n => match u16::try_from(n) {
                Ok(n) => [&[0x81, 0x80 | 126], &n.to_be_bytes()[..]].concat(),
                Err(_) => [&[0x81, 0x80 | 127], &(n as u64).to_be_bytes()[..]].concat(),
            },
        };
        frame.extend([0; 4]);
        frame.extend(text.as_bytes());
        let _ = self.stream.write_all(&frame);
    }

    pub fn acknowledge(&mut self) {
        self.say(&json!({ "ack": 1 }));
    }

    /// The next message, if it comes in time.
    pub fn next(&mut self, patience: Duration) -> Option<Told> {
        let until = Instant::now() + patience;
        loop {
            if let Some(told) = self.parsed() {
                return Some(told);
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() || !self.more(left) {
                return None;
            }
        }
    }

    /// Whether the connection is still there.
    fn more(&mut self, patience: Duration) -> bool {
        let mut buffer = [0; 1 << 16];
        self.stream.set_read_timeout(Some(patience.max(Duration::from_millis(1)))).expect("a timeout");
        match self.stream.read(&mut buffer) {
            Ok(0) => false,
            Ok(n) => {
                self.read.extend_from_slice(&buffer[..n]);
                true
            }
            Err(e) => matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
        }
    }

    fn parsed(&mut self) -> Option<Told> {
        let (kind, length) = (*self.read.first()? & 0x0f, usize::from(*self.read.get(1)? & 0x7f));
        let (at, length) = match length {
            126 => (4, usize::from(u16::from_be_bytes(self.read.get(2..4)?.try_into().ok()?))),
            127 => (10, u64::from_be_bytes(self.read.get(2..10)?.try_into().ok()?) as usize),
            _ => (2, length),
        };
        let body = self.read.get(at..at + length)?.to_vec();
        self.read.drain(..at + length);
        match kind {
            1 => Some(Told::Text(serde_json::from_slice(&body).expect("JSON"))),
            2 => {
                let header = 4 + u32::from_le_bytes(body[..4].try_into().expect("a length")) as usize;
                let parsed = serde_json::from_slice(&body[4..header]).expect("a header");
                Some(Told::Picture(parsed, body[header..].to_vec()))
            }
            _ => self.parsed(),
        }
    }
}
