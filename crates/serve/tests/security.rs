//! Only this machine, by its own names, from its own pages, and with the token where there is one.

use crate::client::{Answer, ask, get, post, server, server_with, session};
use resight_serve::{ServeConfig, Server};
use serde_json::json;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

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
        (format!("localhost.:{port}"), 421),
        ("localhost:1".to_owned(), 421),
        (String::new(), 421),
    ] {
        for path in ["/", "/healthz", "/api/live", "/nothing", "/api/session", "/ws/session?session=x"] {
            let answer = ask(place, &format!("GET {path}"), &[("Host", &host)], &[]);
            assert!((answer.status == 421) == (status == 421), "{host} {path}: {}", answer.status);
        }
    }
}

/// A host named in the request's target counts, and naming two is none.
#[test]
fn a_host_is_named_once() {
    let place = server(None);
    let own = format!("127.0.0.1:{}", place.port());
    let twice = ask(place, "GET /healthz", &[("Host", &own), ("Host", &own)], &[]);
    assert!(matches!(twice.status, 400 | 421), "{}", twice.status);
    let foreign = ask(place, "GET http://evil.example/healthz", &[("Host", &own)], &[]);
    assert_eq!(foreign.status, 421);
}

fn upgrade<'a>(more: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
    let own = [
        ("Upgrade", "websocket"),
        ("Connection", "Upgrade"),
        ("Sec-WebSocket-Version", "13"),
        ("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="),
    ];
    own.into_iter().chain(more.iter().copied()).collect()
}

/// Browsers apply no rule of origins to WebSockets: the server does. What names no origin is no browser.
#[test]
fn foreign_pages_are_not_answered() {
    let place = server(None);
    let id = session(place);
    let own = format!("http://127.0.0.1:{}", place.port());
    let other_port = "http://127.0.0.1:1";
    for (origin, status) in [
        (own.as_str(), 200),
        ("http://evil.example", 403),
        ("null", 403),
        ("", 403),
        (other_port, 403),
        ("file://", 403),
    ] {
        let answer = ask(place, &format!("GET /api/session/view?session={id}"), &[("Origin", origin)], &[]);
        assert_eq!(answer.status, status, "{origin}");
        let socket =
            ask(place, &format!("GET /ws/session?session={id}"), &upgrade(&[("Origin", origin)]), &[]).status;
        assert_eq!(socket, if status == 200 { 101 } else { 403 }, "{origin}");
        let live = ask(place, "GET /ws/live", &upgrade(&[("Origin", origin)]), &[]).status;
        assert_eq!(live, if status == 200 { 404 } else { 403 }, "{origin}: no cameras are watched here");
    }
    assert_eq!(ask(place, &format!("GET /ws/session?session={id}"), &upgrade(&[]), &[]).status, 101);
    for site in ["cross-site", "same-site"] {
        let path = format!("GET /api/session/photograph?session={id}");
        assert_eq!(ask(place, &path, &[("Sec-Fetch-Site", site)], &[]).status, 403, "{site}");
    }
}

/// A form of another page cannot send JSON: whatever changes something, or computes, asks for it. Read from the description, so that a
/// new route is tested too.
#[test]
fn what_is_posted_says_its_type_and_nothing_is_changed_by_get() {
    let place = server(None);
    let id = session(place);
    let description = get(place, "/openapi.json").json();
    let mut n_posts = 0;
    for (path, methods) in description["paths"].as_object().expect("paths") {
        if methods.get("post").is_none() {
            continue;
        }
        n_posts += 1;
        for kind in ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", ""] {
            let request = format!("POST {path}?session={id}");
            let status = ask(place, &request, &[("Content-Type", kind)], b"{}").status;
            // No cameras are watched or calibrated here: those routes are missing before their body is looked at.
            let is_missing = ["/api/live", "/api/capture"].iter().any(|start| path.starts_with(start));
            let is_refused = status == 415 || (status == 404 && is_missing);
            assert!(is_refused, "{path} {kind}: {status}");
        }
        if methods.get("get").is_none() {
            assert_eq!(get(place, path).status, 405, "{path}");
        }
    }
    assert!(7 < n_posts, "{n_posts}");
}

#[test]
fn pages_run_nothing_foreign_and_paths_lead_nowhere() {
    let place = server(None);
    for path in ["/", "/app.js", "/nothing", "/api/session"] {
        let head = get(place, path).head.to_ascii_lowercase();
        for wanted in [
            "content-security-policy: default-src 'self'",
            "object-src 'none'",
            "x-content-type-options: nosniff",
            "frame-ancestors 'none'",
            "referrer-policy: no-referrer",
            "cross-origin-resource-policy: same-origin",
        ] {
            assert!(head.contains(wanted), "{path}: {head}");
        }
        for unwanted in ["unsafe", "access-control-allow", "set-cookie"] {
            assert!(!head.contains(unwanted), "{path}: {head}");
        }
    }
    for path in [
        "/../Cargo.toml",
        "/%2e%2e/Cargo.toml",
        "/app.js/../../Cargo.toml",
        "/api/session/export?session=../../etc/passwd",
        "/page/index.html",
        "//etc/passwd",
    ] {
        assert_eq!(get(place, path).status, 404, "{path}");
    }
}

/// Names of files are words in messages: nothing of that name is opened, and no folder of it is repeated.
#[test]
fn names_of_files_open_nothing() {
    let place = server(None);
    let here = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    for path in ["/api/rig", "/api/whisker"] {
        for text in ["", "x", "[package]", "name = 3"] {
            let answer = post(place, path, &json!({ "files": [{ "name": here, "text": text }] }));
            assert_eq!(answer.status, 422, "{path} {text}");
            let message = answer.message();
            assert!(
                !message.contains(env!("CARGO_MANIFEST_DIR")) && !message.contains("resight-serve"),
                "{message}"
            );
        }
    }
    let lens = json!({ "kind": "set_lens", "lens": { "kind": "file", "name": here, "text": "" } });
    let id = session(place);
    let view = post(place, &format!("/api/session/command?session={id}"), &json!({ "command": lens })).json();
    assert!(!view.to_string().contains("resight-serve"), "{view}");
}

/// A file with the token, which only its owner can read.
struct TokenFile(PathBuf);

impl TokenFile {
    fn new(name: &str, token: &str, mode: u32) -> Self {
        let path = std::env::temp_dir().join(format!("resight-serve-{name}-{}", std::process::id()));
        std::fs::write(&path, token).expect("written");
        allow(&path, mode);
        TokenFile(path)
    }
}

impl Drop for TokenFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

#[cfg(unix)]
fn allow(path: &Path, mode: u32) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).expect("permissions");
}

#[cfg(not(unix))]
fn allow(_: &Path, _: u32) {}

fn guarded() -> SocketAddr {
    let file = TokenFile::new("token", TOKEN, 0o600);
    server(Some(file.0.clone()))
}

#[test]
fn the_token_is_needed_where_there_is_one() {
    let place = guarded();
    for open in ["/", "/app.js", "/app.css", "/healthz", "/openapi.json"] {
        assert_eq!(get(place, open).status, 200, "{open}");
    }
    let json = ("Content-Type", "application/json");
    let open = |headers: &[(&str, &str)]| -> Answer {
        let headers: Vec<(&str, &str)> = headers.iter().copied().chain([json]).collect();
        ask(place, "POST /api/session", &headers, b"{}")
    };
    assert_eq!(open(&[]).status, 401);
    for (given, status) in [
        (format!("Bearer {TOKEN}"), 200),
        (format!("bearer {TOKEN}"), 200),
        (format!("Bearer {TOKEN}x"), 401),
        (format!("Bearer {}", &TOKEN[1..]), 401),
        ("Bearer ".to_owned(), 401),
        (format!("Basic {TOKEN}"), 401),
    ] {
        let answer = open(&[("Authorization", &given)]);
        assert_eq!(answer.status, status, "{given}");
        assert!(!String::from_utf8_lossy(&answer.body).contains(TOKEN) && !answer.head.contains(TOKEN));
    }
    // What stands in an address is logged and remembered: it does not count there, nor in a cookie.
    let cookie = format!("token={TOKEN}");
    assert_eq!(get(place, &format!("/api/live?token={TOKEN}")).status, 401);
    assert_eq!(ask(place, "GET /api/live", &[("Cookie", &cookie)], &[]).status, 401);
    // A route that is none says so only to whom it may concern.
    assert_eq!(get(place, "/nothing").status, 401);
}

/// A browser's WebSocket cannot bring a header: it offers the token among its protocols, and the server answers with the other one.
#[test]
fn sockets_bring_the_token_among_their_protocols() {
    let place = guarded();
    let bearer = format!("Bearer {TOKEN}");
    let headers = [("Authorization", bearer.as_str()), ("Content-Type", "application/json")];
    let opened = ask(place, "POST /api/session", &headers, b"{}").json();
    let path = format!("GET /ws/session?session={}", opened["session"].as_str().expect("an id"));
    let offer = |protocols: &str| ask(place, &path, &upgrade(&[("Sec-WebSocket-Protocol", protocols)]), &[]);
    let accepted = offer(&format!("resight, bearer.{TOKEN}"));
    assert_eq!(accepted.status, 101);
    assert!(
        accepted.head.to_ascii_lowercase().contains("sec-websocket-protocol: resight"),
        "{}",
        accepted.head
    );
    assert!(!accepted.head.contains(TOKEN));
    for wrong in ["resight", "resight, bearer.", "resight, bearer.x", TOKEN] {
        assert_eq!(offer(wrong).status, 401, "{wrong}");
    }
}

fn refused(address: &str, token_file: Option<PathBuf>, hosts: &[&str]) -> String {
    let hosts = hosts.iter().map(|host| (*host).to_owned()).collect();
    let config = ServeConfig {
        flag: "--listen",
        address: address.into(),
        token_file,
        hosts,
        patience: ServeConfig::PATIENCE,
    };
    Server::bind(&config).err().expect("refused").to_string()
}

#[test]
fn other_machines_need_a_token_and_a_name() {
    for address in ["0.0.0.0:0", "[::]:0"] {
        let without = refused(address, None, &["survey.local"]);
        assert!(without.contains("--token-file"), "{without}");
        let file = TokenFile::new("unnamed", TOKEN, 0o600);
        let unnamed = refused(address, Some(file.0.clone()), &[]);
        assert!(unnamed.contains("--allowed-host"), "{unnamed}");
    }
}

#[test]
fn a_token_is_secret_and_cannot_be_guessed() {
    let short = TokenFile::new("short", &TOKEN[..20], 0o600);
    let reason = refused("127.0.0.1:0", Some(short.0.clone()), &[]);
    assert!(reason.contains("20 characters") && reason.contains("32"), "{reason}");
    assert!(!reason.contains(&TOKEN[..20]), "{reason}");
    #[cfg(unix)]
    for mode in [0o644, 0o640, 0o604] {
        let open = TokenFile::new("open", TOKEN, mode);
        let reason = refused("127.0.0.1:0", Some(open.0.clone()), &[]);
        assert!(reason.contains("chmod 600") && !reason.contains(TOKEN), "{reason}");
    }
}

/// A name that is allowed besides: with a port that one, without a port every one.
#[test]
fn further_names_can_be_allowed() {
    let place = server_with(None, &["survey.local", "gate.local:80"]);
    for (host, status) in [
        ("survey.local", 200),
        ("survey.local:99", 200),
        ("gate.local:80", 200),
        ("gate.local", 421),
        ("gate.local:81", 421),
    ] {
        assert_eq!(ask(place, "GET /healthz", &[("Host", host)], &[]).status, status, "{host}");
    }
    let origin = [("Host", "survey.local"), ("Origin", "https://survey.local")];
    assert_eq!(ask(place, "GET /api/live", &origin, &[]).status, 404, "a proxy with TLS in front of it");
}
