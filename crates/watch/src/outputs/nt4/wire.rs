//! Messages of NetworkTables 4: topics are announced as JSON, values follow as MessagePack.
//!
//! Source: WPILib, "Network Tables Protocol Specification, Version 4.1".

use rmp::decode;
use rmp::encode::{self, ByteBuf, ValueWriteError};
use serde_json::{Value as Json, json};
use std::convert::Infallible;

/// The versions of the protocol, the newest first.
pub const PROTOCOLS: [&str; 2] = ["v4.1.networktables.first.wpi.edu", "networktables.first.wpi.edu"];

/// The topic number of the server's clock.
const CLOCK: i64 = -1;

/// Data types by their numbers.
const BOOLEAN: u64 = 0;
const INTEGER: u64 = 2;
const TEXT: u64 = 4;
const RAW: u64 = 5;
const DOUBLES: u64 = 17;

/// A topic that this client publishes; its number is its index among all.
#[derive(Debug, Clone, PartialEq)]
pub struct Topic {
    /// Its name, which begins with a slash.
    pub name: String,
    /// Its type, by the protocol's name.
    pub kind: &'static str,
}

/// A value of a topic.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    Boolean(bool),
    Text(&'static str),
    Doubles(Vec<f64>),
    /// The members of a structure, one after the other, each a double.
    Structure(Vec<f64>),
    /// The declaration of a structure.
    Declaration(&'static str),
}

/// Returns the message that announces topics.
pub fn announcement(topics: &[Topic]) -> String {
    let publish = |(number, Topic { name, kind }): (usize, &Topic)| {
        json!({
            "method": "publish",
            "params": { "name": name, "pubuid": number, "type": kind, "properties": {} },
        })
    };
    topics.iter().enumerate().map(publish).collect::<Json>().to_string()
}

/// Returns the message that a topic has a value since a time of the server, µs.
pub fn sample(topic: usize, time_us: i64, value: &Value) -> Vec<u8> {
    let kind = match value {
        Value::Boolean(_) => BOOLEAN,
        Value::Text(_) => TEXT,
        Value::Doubles(_) => DOUBLES,
        Value::Structure(_) | Value::Declaration(_) => RAW,
    };
    message(topic as i64, time_us, kind, |into| match value {
        Value::Boolean(is) => encode::write_bool(into, *is).map_err(ValueWriteError::InvalidMarkerWrite),
        Value::Text(text) => encode::write_str(into, text),
        Value::Doubles(all) => {
            encode::write_array_len(into, all.len() as u32)?;
            all.iter().try_for_each(|x| encode::write_f64(into, *x))
        }
        Value::Structure(members) => {
            let bytes: Vec<u8> = members.iter().flat_map(|x| x.to_le_bytes()).collect();
            encode::write_bin(into, &bytes)
        }
        Value::Declaration(text) => encode::write_bin(into, text.as_bytes()),
    })
}

/// Returns the question what time the server has; it repeats the time of this client, µs, in its answer.
pub fn clock_question(now_us: i64) -> Vec<u8> {
    message(CLOCK, 0, INTEGER, |into| encode::write_sint(into, now_us).map(drop))
}

/// Returns the server's time and that of the question, µs, where a message is the answer to it.
pub fn clock_answer(mut message: &[u8]) -> Option<(i64, i64)> {
    let from = &mut message;
    let is_four = decode::read_array_len(from).ok()? == 4;
    let is_clock = decode::read_int::<i64, _>(from).ok()? == CLOCK;
    let server_us = decode::read_int(from).ok()?;
    let is_integer = decode::read_int::<u64, _>(from).ok()? == INTEGER;
    let asked_us = decode::read_int(from).ok()?;
    (is_four && is_clock && is_integer).then_some((server_us, asked_us))
}

type Written = Result<(), ValueWriteError<Infallible>>;

/// Returns `[topic, time, type, value]`.
fn message(topic: i64, time_us: i64, kind: u64, value: impl FnOnce(&mut ByteBuf) -> Written) -> Vec<u8> {
    let mut into = ByteBuf::new();
    let write = || -> Written {
        encode::write_array_len(&mut into, 4)?;
        encode::write_sint(&mut into, topic)?;
        encode::write_sint(&mut into, time_us)?;
        encode::write_uint(&mut into, kind)?;
        value(&mut into)
    };
    // Memory takes everything.
    let _ = write();
    into.into_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes by the specification of MessagePack.
    #[test]
    fn a_sample_is_an_array_of_topic_time_type_and_value() {
        assert_eq!(sample(3, 1_000, &Value::Boolean(true)), [0x94, 3, 0xcd, 0x03, 0xe8, 0, 0xc3]);
        assert_eq!(sample(0, 0, &Value::Text("ok")), [0x94, 0, 0, 4, 0xa2, b'o', b'k']);
        let one = 1.0_f64.to_be_bytes();
        let doubles = sample(0, -1, &Value::Doubles(vec![1.0]));
        assert_eq!(doubles, [&[0x94, 0, 0xff, 17, 0x91, 0xcb], &one[..]].concat());
        let structure = sample(0, 0, &Value::Structure(vec![1.0]));
        assert_eq!(structure, [&[0x94, 0, 0, 5, 0xc4, 8], &1.0_f64.to_le_bytes()[..]].concat());
    }

    #[test]
    fn the_clock_is_read_from_its_answer_alone() {
        assert_eq!(clock_question(5), [0x94, 0xff, 0, 2, 5]);
        let answer = message(CLOCK, 70_000_000_000, INTEGER, |into| encode::write_sint(into, 5).map(drop));
        assert_eq!(clock_answer(&answer), Some((70_000_000_000, 5)));
        assert_eq!(clock_answer(&sample(1, 7, &Value::Boolean(true))), None);
        for end in 0..answer.len() {
            assert_eq!(clock_answer(&answer[..end]), None, "{end}");
        }
    }

    #[test]
    fn topics_are_numbered_in_their_order() {
        let topic = |name: &str| Topic { name: name.to_string(), kind: "boolean" };
        let all: Json = serde_json::from_str(&announcement(&[topic("/a"), topic("/b")])).expect("JSON");
        assert_eq!(
            all[1]["params"],
            json!({ "name": "/b", "pubuid": 1, "type": "boolean", "properties": {} })
        );
    }
}
