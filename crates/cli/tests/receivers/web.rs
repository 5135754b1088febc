//! A web server that answers as told, and remembers what it was asked.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// A request as it came.
#[derive(Debug, Clone)]
pub struct Asked {
    pub head: String,
    pub body: String,
    pub at: Instant,
}

impl Asked {
    /// The value of a header, by its name in any case.
    pub fn header(&self, name: &str) -> Option<&str> {
        let lines = self.head.lines().filter_map(|line| line.split_once(':'));
        lines.filter(|(found, _)| found.eq_ignore_ascii_case(name)).map(|(_, value)| value.trim()).next()
    }

    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.body).expect("JSON")
    }
}

/// The server; its threads end with the test.
pub struct Web {
    pub place: String,
    asked: Arc<Mutex<Vec<Asked>>>,
}

/// What it answers: status line and further headers for the n-th request; none: nothing, with the connection left open.
pub type Answers = fn(usize) -> Option<&'static str>;

impl Web {
    pub fn start(answers: Answers) -> Self {
        Self::at(TcpListener::bind("127.0.0.1:0").expect("a port"), answers)
    }

    pub fn at(listener: TcpListener, answers: Answers) -> Self {
        let place = listener.local_addr().expect("an address").to_string();
        let asked = Arc::new(Mutex::new(Vec::new()));
        let shared = Arc::clone(&asked);
        thread::spawn(move || {
            let mut hanging = Vec::new();
            for stream in listener.incoming() {
                let mut stream = stream.expect("a connection");
                let Some(request) = read(&stream) else { continue };
                let n = {
                    let mut asked = shared.lock().expect("requests");
                    asked.push(request);
                    asked.len() - 1
                };
                match answers(n) {
                    None => hanging.push(stream),
                    Some(answer) => {
                        let text =
                            format!("HTTP/1.1 {answer}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
                        // A client that has gone away is its own affair.
                        let _ = stream.write_all(text.as_bytes());
                    }
                }
            }
        });
        Web { place, asked }
    }

    pub fn asked(&self) -> Vec<Asked> {
        self.asked.lock().expect("requests").clone()
    }
}

fn read(stream: &TcpStream) -> Option<Asked> {
    stream.set_read_timeout(Some(Duration::from_secs(10))).ok()?;
    let mut reader = BufReader::new(stream);
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        if reader.read_line(&mut head).ok()? == 0 {
            return None;
        }
    }
    let mut asked = Asked { head, body: String::new(), at: Instant::now() };
    let length = asked.header("Content-Length").map_or(0, |length| length.parse().expect("a length"));
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    asked.body = String::from_utf8(body).expect("text");
    Some(asked)
}

/// Asks once: status and page. None where the server gave no whole answer.
pub fn get(place: &str, head: &str) -> Option<(u16, String)> {
    let mut stream = TcpStream::connect(place).ok()?;
    stream.set_read_timeout(Some(Duration::from_secs(30))).ok()?;
    stream.write_all(format!("{head}\r\n\r\n").as_bytes()).ok()?;
    let mut text = String::new();
    stream.read_to_string(&mut text).ok()?;
    let _ = stream.shutdown(Shutdown::Both);
    let (head, page) = text.split_once("\r\n\r\n")?;
    let status = head.split(' ').nth(1)?.parse().ok()?;
    Some((status, page.to_string()))
}

/// Where the metrics are, as the log says.
pub fn metrics_place(session: &super::Session) -> String {
    session.reported("metrics: http://").trim_end_matches("/metrics").to_string()
}

/// Samples by name and labels.
pub fn page(place: &str, head: &str) -> BTreeMap<String, f64> {
    let (status, page) =
        get(place, &format!("GET /metrics HTTP/1.1\r\nHost: {place}{head}")).expect("an answer");
    assert_eq!(status, 200);
    let samples = page.lines().filter(|line| !line.starts_with('#'));
    samples
        .map(|line| {
            let (name, value) = line.rsplit_once(' ').expect("a sample");
            (name.to_string(), value.parse().expect("a number"))
        })
        .collect()
}
