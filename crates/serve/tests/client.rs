//! A server on a free port, and a client as plain as curl.

use resight_serve::{ServeConfig, Server};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

/// A server that runs until the tests end.
pub fn server(token_file: Option<std::path::PathBuf>) -> SocketAddr {
    server_with(token_file, &[])
}

/// One that is reached by further names.
pub fn server_with(token_file: Option<std::path::PathBuf>, hosts: &[&str]) -> SocketAddr {
    started(token_file, hosts, ServeConfig::PATIENCE)
}

/// One that gives requests so much time.
pub fn hasty_server(patience: Duration) -> SocketAddr {
    started(None, &[], patience)
}

fn started(token_file: Option<std::path::PathBuf>, hosts: &[&str], patience: Duration) -> SocketAddr {
    let hosts = hosts.iter().map(|host| (*host).to_owned()).collect();
    let config = ServeConfig { flag: "--listen", address: "127.0.0.1:0".into(), token_file, hosts, patience };
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
    let is_upgrade = headers.iter().any(|(name, _)| *name == "Upgrade");
    let close = if is_upgrade { "" } else { "Connection: close\r\n" };
    let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    let head = format!("{request} HTTP/1.1\r\n{own}{headers}Content-Length: {}\r\n{close}\r\n", body.len());
    let mut stream = TcpStream::connect(place).expect("a connection");
    stream.set_read_timeout(Some(Duration::from_secs(60))).expect("a timeout");
    stream.write_all(head.as_bytes()).expect("sent");
    let _ = stream.write_all(body); // A server that refuses the head may close before the body is there.
    answer(&mut stream, is_upgrade).unwrap_or_else(|| panic!("no answer to {request}"))
}

/// The answer on a connection: its head alone, or all that comes until it closes.
pub fn answer(stream: &mut TcpStream, is_head_enough: bool) -> Option<Answer> {
    let (mut all, mut part) = (Vec::new(), [0; 16 << 10]);
    let end = |all: &[u8]| all.windows(4).position(|w| w == b"\r\n\r\n");
    while !(is_head_enough && end(&all).is_some()) {
        match stream.read(&mut part) {
            Ok(n) if 0 < n => all.extend(&part[..n]),
            _ => break,
        }
    }
    let end = end(&all)?;
    let head = String::from_utf8_lossy(&all[..end]).into_owned();
    let status = head.split(' ').nth(1)?.parse().ok()?;
    Some(Answer { status, head, body: all[end + 4..].to_vec() })
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
