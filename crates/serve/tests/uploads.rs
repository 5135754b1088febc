//! Bad photographs and closed tabs: a sentence, and nothing lost.

use crate::client::{ask, get, server, session};
use std::io::Write;
use std::net::TcpStream;

/// A PNG whose header claims this size.
fn header(width: u32, height: u32) -> Vec<u8> {
    let mut chunk = b"IHDR".to_vec();
    chunk.extend(width.to_be_bytes());
    chunk.extend(height.to_be_bytes());
    chunk.extend([8, 0, 0, 0, 0]);
    let mut table = !0u32;
    for byte in &chunk {
        table ^= u32::from(*byte);
        for _ in 0..8 {
            table = if table & 1 == 1 { 0xedb8_8320 ^ (table >> 1) } else { table >> 1 };
        }
    }
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\x0d".to_vec();
    png.extend(&chunk);
    png.extend((!table).to_be_bytes());
    png.extend(b"\0\0\0\x04IDATxxxx");
    png
}

#[test]
fn a_bad_photograph_gets_a_sentence_and_the_server_stays() {
    let place = server(None);
    let id = session(place);
    let demo = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/demo/left.png"))
        .expect("the demo");
    let path = format!("POST /api/session/photograph?session={id}&name=x.png");
    let put = |kind: &str, body: &[u8]| ask(place, &path, &[("Content-Type", kind)], body);
    for (kind, body, said) in [
        ("image/png", header(20_000, 15_000), "64 Mpx"),
        ("image/jpeg", b"hello, this is a text".to_vec(), "a text file, not a PNG or JPEG image"),
        ("image/png", demo[..demo.len() / 2].to_vec(), "not a readable"),
        ("image/png", Vec::new(), "an empty file, not a PNG or JPEG image"),
        ("image/jpeg", b"\0\0\0\x18ftypheic".to_vec(), "a HEIC image, not a PNG or JPEG image; convert it"),
    ] {
        let answer = put(kind, &body);
        assert_eq!(answer.status, 422);
        assert!(answer.message().contains(said), "{}", answer.message());
    }
    assert_eq!(put("text/html", &demo).status, 415);
    assert_eq!(put("image/png", &demo).status, 200);
    let view = get(place, &format!("/api/session/view?session={id}")).json();
    assert_eq!(view["photo"]["width_px"], 800);
}

#[test]
fn a_tab_closed_in_the_middle_of_an_upload_loses_nothing() {
    let place = server(None);
    let id = session(place);
    for _ in 0..20 {
        let mut stream = TcpStream::connect(place).expect("a connection");
        let head = format!(
            "POST /api/session/photograph?session={id} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: image/png\r\nContent-Length: 1000000\r\n\r\nhalf",
            place.port()
        );
        stream.write_all(head.as_bytes()).expect("sent");
    }
    assert_eq!(get(place, &format!("/api/session/view?session={id}")).status, 200);
}
