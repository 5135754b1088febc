//! Who sends too much, too slowly, or too often is refused or left, and others are answered meanwhile.

use crate::client::{answer, ask, get, hasty_server, post, server, session};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

const JSON: (&str, &str) = ("Content-Type", "application/json");

/// Too much is refused by what the head says, before it is read.
#[test]
fn too_much_is_refused_by_the_head() {
    let place = server(None);
    let id = session(place);
    for path in [format!("/api/session/photograph?session={id}"), "/api/rig".into(), "/api/nothing".into()] {
        let mut stream = TcpStream::connect(place).expect("a connection");
        let head = format!(
            "POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: image/png\r\nContent-Length: 900000000\r\n\r\n",
            place.port()
        );
        stream.write_all(head.as_bytes()).expect("sent");
        stream.set_read_timeout(Some(Duration::from_secs(10))).expect("a timeout");
        assert_eq!(answer(&mut stream, true).expect("an answer").status, 413, "{path}");
    }
}

/// A body that does not say how long it is ends where the route's limit is.
#[test]
fn too_much_in_parts_is_refused() {
    let place = server(None);
    let mut stream = TcpStream::connect(place).expect("a connection");
    let head = format!(
        "POST /api/rig HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: application/json\r\nTransfer-Encoding: chunked\r\nConnection: close\r\n\r\n",
        place.port()
    );
    stream.write_all(head.as_bytes()).expect("sent");
    let part = [b"100000\r\n".as_slice(), &vec![b' '; 1 << 20], b"\r\n"].concat();
    for _ in 0..40 {
        if stream.write_all(&part).is_err() {
            break; // It has been refused already.
        }
    }
    let status = answer(&mut stream, true).map(|refusal| refusal.status);
    assert!(matches!(status, Some(413) | None), "{status:?}");
    assert_eq!(get(place, "/healthz").status, 200);
}

#[test]
fn a_large_head_is_refused() {
    let place = server(None);
    let long = "x".repeat(64 << 10);
    let mut stream = TcpStream::connect(place).expect("a connection");
    let head = format!("GET / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nX-Long: {long}\r\n\r\n", place.port());
    let _ = stream.write_all(head.as_bytes());
    let status = answer(&mut stream, true).map(|refusal| refusal.status);
    assert!(matches!(status, Some(431) | None), "{status:?}");
    assert_eq!(get(place, "/healthz").status, 200);
}

/// A request whose body does not come is given up when its time is over, not before, and others are answered meanwhile.
#[test]
fn a_request_that_takes_too_long_is_given_up() {
    let patience = Duration::from_millis(700);
    let place = hasty_server(patience);
    let mut stream = TcpStream::connect(place).expect("a connection");
    let head = format!(
        "POST /api/rig HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: application/json\r\nContent-Length: 100\r\n\r\n{{",
        place.port()
    );
    let began = Instant::now();
    stream.write_all(head.as_bytes()).expect("sent");
    assert_eq!(get(place, "/healthz").status, 200);
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
    let refusal = answer(&mut stream, true).expect("an answer");
    assert_eq!(refusal.status, 408);
    assert!(patience <= began.elapsed(), "{:?}", began.elapsed());
    assert_eq!(post(place, "/api/rig", &json!({ "example": true })).status, 200);
}

/// A client that sends its head letter by letter is left after some seconds, however busy it seems.
#[test]
fn slow_clients_are_left() {
    let place = server(None);
    let mut slow = TcpStream::connect(place).expect("a connection");
    slow.write_all(b"GET / HT").expect("sent");
    assert_eq!(get(place, "/healthz").status, 200);
    let began = Instant::now();
    slow.set_read_timeout(Some(Duration::from_millis(500))).expect("a timeout");
    let mut rest = [0; 64];
    loop {
        assert!(began.elapsed() < Duration::from_secs(15), "{:?}", began.elapsed());
        match slow.read(&mut rest) {
            Ok(0) => break,
            Ok(_) => {}
            Err(e) if matches!(e.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {
                if slow.write_all(b"T").is_err() {
                    break;
                }
            }
            Err(_) => break,
        }
    }
}

/// As many connections as are kept, all of them silent: the next one is answered when the first are left.
#[test]
fn silent_connections_do_not_keep_others_out() {
    let place = server(None);
    let silent: Vec<TcpStream> = (0..300).filter_map(|_| TcpStream::connect(place).ok()).collect();
    assert!(256 < silent.len(), "{}", silent.len());
    let began = Instant::now();
    assert_eq!(get(place, "/healthz").status, 200);
    assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
    drop(silent);
}

/// Who takes nothing of a large answer is left: it would hold its place, and the answer, for ever.
#[test]
fn who_takes_nothing_is_left() {
    let place = server(None);
    let id = large_session(place);
    let mut stuck = TcpStream::connect(place).expect("a connection");
    let head =
        format!("GET /api/session/save?session={id} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n", place.port());
    stuck.write_all(head.as_bytes()).expect("sent");
    std::thread::sleep(Duration::from_secs(25));
    stuck.set_read_timeout(Some(Duration::from_secs(5))).expect("a timeout");
    let mut all = Vec::new();
    let _ = stuck.read_to_end(&mut all);
    let whole = get(place, &format!("/api/session/save?session={id}")).body.len();
    assert!(all.len() < whole, "{} of {whole} bytes came", all.len());
}

/// A session whose file is far larger than what sockets hold.
fn large_session(place: SocketAddr) -> String {
    let id = session(place);
    let mut image = resight::GrayImage::filled(4000, 3000, 0);
    let mut noise = 1u32;
    for value in &mut image.data {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value = (noise >> 24) as u8;
    }
    let png = image.png().expect("a PNG");
    let added = ask(
        place,
        &format!("POST /api/session/photograph?session={id}"),
        &[("Content-Type", "image/png")],
        &png,
    );
    assert_eq!(added.status, 200);
    id
}

/// While results are solved, one after the other, everything else is answered.
#[test]
fn solving_keeps_nobody_waiting() {
    let place = server(None);
    let busy: Vec<_> = (0..12)
        .map(|_| std::thread::spawn(move || post(place, "/api/whisker", &json!({ "example": true })).status))
        .collect();
    for _ in 0..20 {
        let began = Instant::now();
        assert_eq!(get(place, "/healthz").status, 200);
        session(place);
        assert!(began.elapsed() < Duration::from_secs(3), "{:?}", began.elapsed());
    }
    assert!(busy.into_iter().all(|thread| thread.join().expect("an answer") == 200));
}

/// Depth, size, numbers beyond numbers: a sentence each, and the server stays.
#[test]
fn hostile_results_get_a_sentence() {
    let place = server(None);
    let deep = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    let whisker = include_str!("../../../testdata/whisker/whisker.json");
    let many = format!("sweep,sample,hub_angle,hub_x,hub_y,fx,fy,mz\n{}", "0,0,0,0,0,0,0,0\n".repeat(20_001));
    let file = |name: &str, text: &str| json!({ "name": name, "text": text });
    let one = |text: &str| json!({ "files": [file("x", text)] });
    let cases: Vec<(&str, Value, &str)> = vec![
        ("/api/rig", json!({ "files": [] }), "no file"),
        ("/api/rig", one(&deep), ""),
        ("/api/rig", one("\0\u{feff}%YAML"), ""),
        (
            "/api/rig",
            one(
                r#"{"status":"ok","cameras":{"a":{"cam_from_rig":{"rotation_wxyz":[0,0,0,0],"translation_m":[0,0,0]}}}}"#,
            ),
            "quaternion",
        ),
        (
            "/api/rig",
            one(
                r#"{"status":"ok","cameras":{"a":{"cam_from_rig":{"rotation_wxyz":[1,0,0,0],"translation_m":[1e300,0,0]}}}}"#,
            ),
            "translation_m",
        ),
        ("/api/rig", one(r#"{"status":"wonderful","cameras":{}}"#), "wonderful"),
        ("/api/rig", json!({ "files": (0..17).map(|_| file("x", "")).collect::<Vec<_>>() }), "17 files"),
        ("/api/whisker", json!({ "files": [] }), "no file"),
        ("/api/whisker", one(whisker), "no readings"),
        ("/api/whisker", one(&many), "whisker file"),
        ("/api/whisker", json!({ "files": [file("w", whisker), file("hub", &many)] }), "20000"),
        ("/api/whisker", json!({ "files": [file("w", whisker), file("v", whisker)] }), "same kind"),
        ("/api/whisker", one(&deep), ""),
        ("/api/whisker", json!({ "files": [file("w", &whisker.replace("0.2,", "-0.2,"))] }), "length_m"),
    ];
    for (path, body, said) in cases {
        let answer = post(place, path, &body);
        assert_eq!(answer.status, 422, "{path} {said}");
        let message = answer.message();
        assert!(message.contains(said) && message.ends_with('.') && message.len() < 900, "{path}: {message}");
    }
    let plain = ask(place, "POST /api/rig", &[JSON], deep.as_bytes());
    assert_eq!(plain.status, 422);
    assert_eq!(get(place, "/healthz").status, 200);
}
