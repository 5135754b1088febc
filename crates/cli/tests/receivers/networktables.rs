//! A small NetworkTables 4 server: it takes connections one after the other, keeps what is announced and published, answers with its time, and closes a
//! connection after a given number of samples.

use serde_json::Value;
use std::collections::BTreeMap;
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use tokio_tungstenite::tungstenite::handshake::server::{Request, Response};
use tokio_tungstenite::tungstenite::{Message, WebSocket, accept_hdr};

/// The time of the server when it begins, µs.
pub const SERVER_US: u64 = 70_000_000_000;

/// A sample that came: the time of the server, µs, the number of the data type, and the value as MessagePack.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    pub time_us: u64,
    pub kind: u8,
    pub value: Vec<u8>,
}

/// What the server has seen.
#[derive(Debug, Default)]
pub struct Observed {
    pub connections: usize,
    /// Topics of the last connection by number: name and type.
    pub topics: BTreeMap<u64, (String, String)>,
    /// Samples by the names of their topics, those of each connection in a list of its own.
    pub came: Vec<BTreeMap<String, Vec<Sample>>>,
    pub paths: Vec<String>,
}

/// The server; its thread ends with the test.
pub struct Server {
    pub place: String,
    seen: Arc<Mutex<Observed>>,
}

impl Server {
    /// Begins; each connection is broken off after so many samples.
    pub fn start(most_samples: fn(usize) -> usize) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let place = listener.local_addr().expect("an address").to_string();
        let seen = Arc::new(Mutex::new(Observed::default()));
        let shared = Arc::clone(&seen);
        thread::spawn(move || {
            for (n, stream) in listener.incoming().enumerate() {
                serve(stream.expect("a connection"), &shared, most_samples(n));
            }
        });
        Server { place, seen }
    }

    pub fn see<T>(&self, look: impl FnOnce(&Observed) -> T) -> T {
        look(&self.seen.lock().expect("what was seen"))
    }
}

fn serve(stream: TcpStream, seen: &Mutex<Observed>, most_samples: usize) {
    let mut path = String::new();
    // The newest version that is offered is the answer.
    #[allow(clippy::result_large_err)] // The type is that of the crate.
    let greeted = |request: &Request, mut response: Response| {
        path = request.uri().path().to_string();
        let offered = request.headers()["Sec-WebSocket-Protocol"].to_str().expect("text");
        let first = offered.split(", ").next().expect("a protocol").parse().expect("a header");
        response.headers_mut().insert("Sec-WebSocket-Protocol", first);
        Ok(response)
    };
    let mut socket = accept_hdr(stream, greeted).expect("a handshake");
    {
        let mut seen = seen.lock().expect("what was seen");
        seen.connections += 1;
        seen.paths.push(path);
        seen.topics.clear();
        seen.came.push(BTreeMap::new());
    }
    let mut n = 0;
    while n < most_samples
        && let Ok(message) = socket.read()
    {
        match message {
            Message::Text(text) => announced(&text, seen),
            Message::Binary(bytes) => n += took(&bytes, seen, &mut socket),
            _ => {}
        }
    }
}

fn announced(text: &str, seen: &Mutex<Observed>) {
    let all: Vec<Value> = serde_json::from_str(text).expect("a list of messages");
    for message in all {
        assert_eq!(message["method"], "publish");
        let of = &message["params"];
        let text = |key: &str| of[key].as_str().expect("text").to_string();
        let topic = (text("name"), text("type"));
        seen.lock().expect("what was seen").topics.insert(of["pubuid"].as_u64().expect("a number"), topic);
    }
}

/// Takes the samples of a message and returns how many there are; a question for the time is answered.
fn took(mut bytes: &[u8], seen: &Mutex<Observed>, socket: &mut WebSocket<TcpStream>) -> usize {
    let mut n = 0;
    while !bytes.is_empty() {
        assert_eq!(byte(&mut bytes), 0x94, "four members");
        if bytes[0] == 0xff {
            let mut answer = vec![0x94, 0xff, 0xcf];
            answer.extend(SERVER_US.to_be_bytes());
            // Type and question come back as they are.
            answer.extend(&bytes[2..]);
            socket.send(Message::binary(answer)).expect("an answer");
            return n;
        }
        let (topic, time_us, kind) = (integer(&mut bytes), integer(&mut bytes), integer(&mut bytes));
        let value = value(&mut bytes).to_vec();
        let mut seen = seen.lock().expect("what was seen");
        let (name, _) = seen.topics[&topic].clone();
        let sample = Sample { time_us, kind: kind as u8, value };
        seen.came.last_mut().expect("a connection").entry(name).or_default().push(sample);
        n += 1;
    }
    n
}

fn byte(bytes: &mut &[u8]) -> u8 {
    let (first, rest) = bytes.split_first().expect("a byte");
    *bytes = rest;
    *first
}

/// An integer that is not negative.
fn integer(bytes: &mut &[u8]) -> u64 {
    let length = match byte(bytes) {
        small @ 0..=0x7f => return u64::from(small),
        0xcc => 1,
        0xcd => 2,
        0xce => 4,
        0xcf => 8,
        other => panic!("{other:#x} is no integer"),
    };
    (0..length).fold(0, |sum, _| sum << 8 | u64::from(byte(bytes)))
}

/// A boolean, a short text, doubles or bytes.
fn value<'a>(bytes: &mut &'a [u8]) -> &'a [u8] {
    let length = match bytes[0] {
        0xc2 | 0xc3 => 1,
        text @ 0xa0..=0xbf => 1 + usize::from(text & 0x1f),
        doubles @ 0x90..=0x9f => 1 + 9 * usize::from(doubles & 0x0f),
        0xc4 => 2 + usize::from(bytes[1]),
        other => panic!("{other:#x} is no value"),
    };
    let (value, rest) = bytes.split_at(length);
    *bytes = rest;
    value
}
