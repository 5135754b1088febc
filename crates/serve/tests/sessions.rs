//! What a page does, by plain requests.

use crate::client::{ask, get, post, server, session};
use serde_json::{Value, json};

#[test]
fn the_example_has_an_answer() {
    let place = server(None);
    let opened = post(place, "/api/session", &json!({ "example": true })).json();
    let view = &opened["view"];
    assert_eq!(view["answer"]["status"], "ok", "{}", view["refusal"]);
    assert_eq!(view["missing"], json!([]));
    // Four squares of 25 mm.
    let m = &view["measurements"][0];
    let (low, high) = (m["low"].as_f64().expect("low"), m["high"].as_f64().expect("high"));
    assert!(low < 0.1 && 0.1 < high && high - low < 0.01, "{m}");
    let id = opened["session"].as_str().expect("an id");
    let saved = get(place, &format!("/api/session/save?session={id}"));
    let text = String::from_utf8(saved.body).expect("text");
    let again = post(place, "/api/session", &json!({ "load": text })).json();
    assert_eq!(again["view"]["figures"], view["figures"]);
    let png = get(place, &format!("/api/session/birdseye?session={id}"));
    assert!(png.body.starts_with(b"\x89PNG"));
    let photograph = get(place, &format!("/api/session/photograph?session={id}"));
    assert_eq!(photograph.status, 200);
    let tag = photograph.head.lines().find_map(|l| l.strip_prefix("etag: ")).expect("an etag").to_owned();
    let again =
        ask(place, &format!("GET /api/session/photograph?session={id}"), &[("If-None-Match", &tag)], &[]);
    assert_eq!(again.status, 304);
}

/// At most 32 sessions; the one that was not used for longest goes.
#[test]
fn old_sessions_go() {
    let place = server(None);
    let first = session(place);
    let second = session(place);
    let view = |id: &str| get(place, &format!("/api/session/view?session={id}")).status;
    for _ in 0..31 {
        assert_eq!(view(&first), 200);
        session(place);
    }
    assert_eq!((view(&first), view(&second)), (200, 404));
}

#[test]
fn commands_that_are_none_are_refused_in_a_sentence() {
    let place = server(None);
    let id = session(place);
    let path = format!("/api/session/command?session={id}");
    let bad: [Value; 4] = [
        json!({}),
        json!({ "command": { "kind": "explode" } }),
        json!([]),
        json!({ "command": { "kind": "undo" }, "more": 1 }),
    ];
    for body in bad {
        let answer = post(place, &path, &body);
        assert_eq!(answer.status, 422, "{body}");
        assert!(answer.message().ends_with('.'), "{}", answer.message());
    }
    let none = post(
        place,
        &path,
        &json!({ "seq": 4, "command": { "kind": "put_point", "name": "A", "u_px": 1, "v_px": 1 } }),
    )
    .json();
    assert_eq!(none["view"]["error"]["step"], "photograph");
    assert_eq!(none["seq"], 4);
}
