//! Only this machine, by its own names, from its own pages, and with the token where there is one.

use crate::client::{ask, get, post, server, session};
use resight_serve::{ServeConfig, Server};
use serde_json::json;

#[test]
fn only_its_own_names_are_answered() {
    let place = server(None);
    let port = place.port();
    for (host, status) in [
        (format!("localhost:{port}"), 200),
        (format!("127.0.0.1:{port}"), 200),
        (format!("[::1]:{port}"), 200),
        ("evil.example".to_owned(), 421),
        (format!("127.0.0.1.evil.example:{port}"), 421),
        (format!("evil.example:{port}"), 421),
        ("localhost:1".to_owned(), 421),
    ] {
        for path in ["/", "/healthz", "/api/live", "/nothing"] {
            let answer = ask(place, &format!("GET {path}"), &[("Host", &host)], &[]);
            assert!((answer.status == 421) == (status == 421), "{host} {path}: {}", answer.status);
        }
    }
}

#[test]
fn foreign_pages_are_not_answered() {
    let place = server(None);
    let id = session(place);
    let own = format!("http://127.0.0.1:{}", place.port());
    for (origin, status) in
        [(own.as_str(), 200), ("http://evil.example", 403), ("null", 403), ("http://127.0.0.1:1", 403)]
    {
        let answer = ask(place, &format!("GET /api/session/view?session={id}"), &[("Origin", origin)], &[]);
        assert_eq!(answer.status, status, "{origin}");
        let upgrade = [
            ("Origin", origin),
            ("Upgrade", "websocket"),
            ("Connection", "Upgrade"),
            ("Sec-WebSocket-Version", "13"),
            ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
        ];
        if status == 403 {
            assert_eq!(
                ask(place, &format!("GET /ws/session?session={id}"), &upgrade, &[]).status,
                403,
                "{origin}"
            );
        }
    }
    let cross = ask(
        place,
        &format!("GET /api/session/photograph?session={id}"),
        &[("Sec-Fetch-Site", "cross-site")],
        &[],
    );
    assert_eq!(cross.status, 403);
    // A form of another page cannot send JSON.
    for kind in ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data"] {
        assert_eq!(ask(place, "POST /api/session", &[("Content-Type", kind)], b"{}").status, 415, "{kind}");
    }
}

#[test]
fn nothing_is_changed_by_get_and_pages_run_nothing_foreign() {
    let place = server(None);
    for path in ["/api/session", "/api/session/command", "/api/rig", "/api/live/reference"] {
        assert_eq!(get(place, path).status, 405, "{path}");
    }
    let page = get(place, "/");
    let head = page.head.to_ascii_lowercase();
    for wanted in [
        "content-security-policy: default-src 'self'",
        "x-content-type-options: nosniff",
        "frame-ancestors 'none'",
    ] {
        assert!(head.contains(wanted), "{head}");
    }
    assert!(!head.contains("unsafe") && !head.contains("access-control-allow"), "{head}");
    for path in ["/../Cargo.toml", "/api/session/export?session=../../etc/passwd", "/page/index.html"] {
        assert_eq!(get(place, path).status, 404, "{path}");
    }
}

#[test]
fn the_token_is_needed_where_there_is_one() {
    let token = "0123456789abcdef0123456789abcdef";
    let path = std::env::temp_dir().join(format!("resight-serve-token-{}", std::process::id()));
    std::fs::write(&path, token).expect("written");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).expect("private");
    }
    let place = server(Some(path.clone()));
    std::fs::remove_file(path).expect("removed");
    assert_eq!(get(place, "/").status, 200);
    assert_eq!(post(place, "/api/session", &json!({})).status, 401);
    let json = ("Content-Type", "application/json");
    for (given, status) in
        [(format!("Bearer {token}"), 200), (format!("Bearer {token}x"), 401), ("Basic x".to_owned(), 401)]
    {
        assert_eq!(
            ask(place, "POST /api/session", &[json, ("Authorization", &given)], b"{}").status,
            status,
            "{given}"
        );
    }
}

#[test]
fn other_machines_need_a_token() {
    let config = |address: &str| ServeConfig {
        flag: "--listen",
        address: address.into(),
        token_file: None,
        hosts: Vec::new(),
    };
    let refused = Server::bind(&config("0.0.0.0:0")).err().expect("refused").to_string();
    assert!(refused.contains("--token-file"), "{refused}");
}
