//! A server on a free port, and a client as plain as curl.

use resight_serve::{ServeConfig, Server};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

/// A server that runs until the tests end.
pub fn server(token_file: Option<std::path::PathBuf>) -> SocketAddr {
    let config =
        ServeConfig { flag: "--listen", address: "127.0.0.1:0".into(), token_file, hosts: Vec::new() };
    let server = Server::bind(&config).expect("a free port");
    let place = server.place();
    std::thread::spawn(move || server.run());
    place
}

/// Status and body of an answer.
pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&self.body)))
    }

    /// The sentence of an error.
    pub fn message(&self) -> String {
        self.json()["error"]["message"].as_str().expect("a message").to_owned()
    }
}

/// One request on a connection of its own.
pub fn ask(place: SocketAddr, request: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
    let host = format!("127.0.0.1:{}", place.port());
    let has_host = headers.iter().any(|(name, _)| *name == "Host");
    let own = if has_host { String::new() } else { format!("Host: {host}\r\n") };
    let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let head = format!(
        "{request} HTTP/1.1\r\n{own}{headers}Content-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    let mut stream = TcpStream::connect(place).expect("a connection");
    stream.set_read_timeout(Some(Duration::from_secs(60))).expect("a timeout");
    stream.write_all(head.as_bytes()).expect("sent");
    let _ = stream.write_all(body); // A server that refuses the head may close before the body is there.
    let mut all = Vec::new();
    let _ = stream.read_to_end(&mut all);
    let end =
        all.windows(4).position(|w| w == b"\r\n\r\n").unwrap_or_else(|| panic!("no answer to {request}"));
    let head = String::from_utf8_lossy(&all[..end]).into_owned();
    let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).expect("a status");
    Answer { status, head, body: all[end + 4..].to_vec() }
}

const JSON: (&str, &str) = ("Content-Type", "application/json");

pub fn get(place: SocketAddr, path: &str) -> Answer {
    ask(place, &format!("GET {path}"), &[], &[])
}

pub fn post(place: SocketAddr, path: &str, body: &Value) -> Answer {
    ask(place, &format!("POST {path}"), &[JSON], body.to_string().as_bytes())
}

/// The id of a new session.
pub fn session(place: SocketAddr) -> String {
    let opened = post(place, "/api/session", &serde_json::json!({})).json();
    opened["session"].as_str().expect("an id").to_owned()
}
