//! A small MQTT 3.1.1 broker: it takes connections, keeps retained messages, speaks last wills, and breaks off where it is told to.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

/// A message that came.
#[derive(Debug, Clone, PartialEq)]
pub struct Came {
    pub topic: String,
    pub payload: String,
    pub qos: u8,
    pub is_retained: bool,
}

/// What the broker has seen.
#[derive(Debug, Default)]
pub struct Observed {
    pub came: Vec<Came>,
    /// Those that came and those that were lost.
    pub sent: usize,
    /// As a late subscriber would get them.
    pub retained: BTreeMap<String, String>,
    pub connections: usize,
    pub farewells: usize,
    pub users: Vec<(Option<String>, Option<String>)>,
    pub wills: Vec<Came>,
}

/// The broker; its threads end with the test.
pub struct Broker {
    pub place: String,
    seen: Arc<Mutex<Observed>>,
}

/// What it does with the n-th message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Deed {
    Acknowledge,
    /// It is lost with the connection.
    BreakOff,
}

impl Broker {
    pub fn start(deeds: fn(usize) -> Deed) -> Self {
        Self::at(TcpListener::bind("127.0.0.1:0").expect("a port"), deeds)
    }

    pub fn at(listener: TcpListener, deeds: fn(usize) -> Deed) -> Self {
        let place = listener.local_addr().expect("an address").to_string();
        let seen = Arc::new(Mutex::new(Observed::default()));
        let shared = Arc::clone(&seen);
        thread::spawn(move || {
            for stream in listener.incoming() {
                let seen = Arc::clone(&shared);
                thread::spawn(move || serve(stream.expect("a connection"), &seen, deeds));
            }
        });
        Broker { place, seen }
    }

    pub fn see<T>(&self, look: impl FnOnce(&Observed) -> T) -> T {
        look(&self.seen.lock().expect("what was seen"))
    }
}

fn serve(mut stream: TcpStream, seen: &Mutex<Observed>, deeds: fn(usize) -> Deed) {
    stream.set_read_timeout(Some(Duration::from_secs(60))).expect("a socket");
    let mut will = None;
    while let Some((kind, body)) = packet(&mut stream) {
        let mut seen = seen.lock().expect("what was seen");
        match kind >> 4 {
            1 => {
                let (found, user, password) = connect(&body);
                seen.connections += 1;
                seen.users.push((user, password));
                seen.wills.extend(found.clone());
                will = found;
                stream.write_all(&[0x20, 2, 0, 0]).expect("CONNACK");
            }
            3 => {
                let (came, id) = publish(kind, &body);
                seen.sent += 1;
                if deeds(seen.sent - 1) == Deed::BreakOff {
                    break;
                }
                if came.is_retained {
                    seen.retained.insert(came.topic.clone(), came.payload.clone());
                }
                seen.came.push(came);
                if let Some([high, low]) = id {
                    stream.write_all(&[0x40, 2, high, low]).expect("PUBACK");
                }
            }
            12 => stream.write_all(&[0xD0, 0]).expect("PINGRESP"),
            14 => {
                seen.farewells += 1;
                return;
            }
            other => panic!("packet type {other} is not expected from a publisher"),
        }
    }
    if let Some(will) = will {
        seen.lock().expect("what was seen").retained.insert(will.topic, will.payload);
    }
}

/// First byte and rest of a packet; none at the end of the connection.
fn packet(stream: &mut TcpStream) -> Option<(u8, Vec<u8>)> {
    let mut byte = [0];
    stream.read_exact(&mut byte).ok()?;
    let kind = byte[0];
    let (mut length, mut shift) = (0_usize, 0);
    loop {
        stream.read_exact(&mut byte).ok()?;
        length |= usize::from(byte[0] & 0x7F) << shift;
        shift += 7;
        if byte[0] & 0x80 == 0 {
            break;
        }
    }
    let mut body = vec![0; length];
    stream.read_exact(&mut body).ok()?;
    Some((kind, body))
}

/// Cuts a string with its length before it off the front.
fn text(body: &mut &[u8]) -> String {
    let length = usize::from(u16::from_be_bytes([body[0], body[1]]));
    let (text, rest) = body[2..].split_at(length);
    *body = rest;
    String::from_utf8(text.to_vec()).expect("text")
}

fn connect(body: &[u8]) -> (Option<Came>, Option<String>, Option<String>) {
    let mut rest = body;
    assert_eq!(text(&mut rest), "MQTT");
    let (level, flags) = (rest[0], rest[1]);
    assert_eq!(level, 4, "3.1.1");
    rest = &rest[4..];
    let client = text(&mut rest);
    assert!((1..=23).contains(&client.len()), "{client}");
    let will = (flags & 4 != 0).then(|| {
        let (topic, payload) = (text(&mut rest), text(&mut rest));
        Came { topic, payload, qos: flags >> 3 & 3, is_retained: flags & 32 != 0 }
    });
    let user = (flags & 128 != 0).then(|| text(&mut rest));
    let password = (flags & 64 != 0).then(|| text(&mut rest));
    (will, user, password)
}

fn publish(kind: u8, body: &[u8]) -> (Came, Option<[u8; 2]>) {
    let (qos, is_retained) = (kind >> 1 & 3, kind & 1 != 0);
    let mut rest = body;
    let topic = text(&mut rest);
    let id = (qos != 0).then(|| [rest[0], rest[1]]);
    let payload = if qos == 0 { rest } else { &rest[2..] };
    let payload = String::from_utf8(payload.to_vec()).expect("text");
    (Came { topic, payload, qos, is_retained }, id)
}
