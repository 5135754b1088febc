//! `watch --webhook`, `--mqtt`, `--nt4`: the receivers of each event; a slow or absent receiver delays nothing.

use crate::receivers::broker::{Broker, Deed};
use crate::receivers::networktables::{SERVER_US, Server};
use crate::receivers::web::{Asked, Web, metrics_place, page};
use crate::receivers::{Ended, Session, lines, times, wait_for};
use crate::support::{demo, folder};
use serde_json::{Value, json};
use std::net::TcpListener;
use std::time::Duration;

/// Past the end of every feed.
const NEVER: usize = usize::MAX;

/// A port where nobody listens: the system gives it to nobody else so soon.
fn deserted() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.local_addr().expect("an address").to_string()
}

fn run(arguments: &[&str], input: &str) -> Ended {
    let mut session = Session::start(arguments);
    session.feed(input);
    session.end()
}

/// Two minutes, a frame a second: learning, steady, settling, drifted.
fn knocked() -> String {
    lines(None, 0..120, 90)
}

/// Body and JSON line are the same but for what a notice adds.
fn assert_same(asked: &[Asked], ended: &Ended) {
    let notices = ended.notices();
    assert_eq!(asked.len(), notices.len(), "{}", ended.log);
    for (asked, line) in asked.iter().zip(notices) {
        let body = asked.json();
        let line = line.as_object().expect("an object");
        assert!(line.iter().all(|(key, value)| body[key] == *value), "{body} is not {line:?}");
        assert!(["host", "text"].iter().all(|key| body[key].as_str().is_some_and(|text| !text.is_empty())));
        assert_eq!(body["id"].as_str(), asked.header("Idempotency-Key"));
    }
}

#[test]
fn a_webhook_gets_each_change_once_acknowledged_in_order() {
    let web = Web::start(|n| Some(if n < 2 { "503 Service Unavailable" } else { "200 OK" }));
    let url = format!("http://{}/hook/secret-path", web.place);
    let ended =
        run(&["--webhook", &url, "--webhook-header", "Authorization: Bearer secret-token"], &knocked());
    assert_eq!(ended.code, 3, "{}", ended.log);
    let asked = web.asked();
    // The first one three times with the same key, then each once.
    let keys: Vec<_> = asked.iter().map(|asked| asked.header("Idempotency-Key")).collect();
    assert!(keys[0].is_some() && keys[0] == keys[1] && keys[1] == keys[2], "{keys:?}");
    assert_same(&asked[2..], &ended);
    let states: Vec<Value> = asked[2..].iter().map(|asked| asked.json()["state"].clone()).collect();
    assert_eq!(states[..2], ["learning", "steady"]);
    assert_eq!(states.last().and_then(Value::as_str), Some("drifted"));
    for asked in &asked {
        assert!(asked.head.starts_with("POST /hook/secret-path HTTP/1.1"));
        assert_eq!(asked.header("Authorization"), Some("Bearer secret-token"));
        assert_eq!(asked.header("Content-Type"), Some("application/json"));
    }
    let said = |text| times(&ended.log, text);
    assert_eq!((said("answers 503"), said("answers again"), said("secret")), (1, 1, 0), "{}", ended.log);
}

#[test]
fn a_webhook_that_is_not_there_yet_is_waited_for() {
    let place = deserted();
    let url = format!("http://{place}/");
    let mut session = Session::start(&["--webhook", &url, "--flush-s", "30"]);
    session.feed(&knocked());
    session.reported("cannot be reached");
    let web = Web::at(TcpListener::bind(&place).expect("the port"), |_| Some("204 No Content"));
    let ended = session.end();
    assert_same(&web.asked(), &ended);
    assert_eq!(
        (times(&ended.log, "cannot be reached"), times(&ended.log, "answers again")),
        (1, 1),
        "{}",
        ended.log
    );
}

#[test]
fn a_webhook_that_refuses_is_not_asked_again() {
    let web =
        Web::start(|n| Some(if n == 1 { "302 Found\r\nLocation: /elsewhere" } else { "404 Not Found" }));
    let ended = run(&["--webhook", &format!("http://{}/", web.place)], &lines(None, 0..60, NEVER));
    assert_eq!(ended.code, 0);
    assert_same(&web.asked(), &ended);
    assert_eq!(times(&ended.log, "answers 404 Not Found: not tried again"), 1, "{}", ended.log);
    assert_eq!(times(&ended.log, "answers 302 Found (redirects are not followed"), 1, "{}", ended.log);
    let reported = ended.notices().len();
    let lost = format!("{reported} of {reported} never arrived: 0 dropped, {reported} refused, 0 not taken");
    assert_eq!(times(&ended.log, &lost), 1, "{}", ended.log);
}

#[test]
fn a_webhook_may_ask_for_patience() {
    let web = Web::start(|n| Some(if n == 0 { "429 Too Many Requests\r\nRetry-After: 2" } else { "200 OK" }));
    let mut session = Session::start(&["--webhook", &format!("http://{}/", web.place)]);
    session.feed(&lines(None, 0..1, NEVER));
    let asked = wait_for("a second request", || Some(web.asked()).filter(|asked| 2 <= asked.len()));
    assert!(Duration::from_secs(2) <= asked[1].at - asked[0].at);
    session.end();
}

/// All frames, in order, none dropped, none late, whoever is reported. Lines come as fast as they are read, so that whoever waited for a receiver
/// would keep the frame behind him waiting for as long: a receiver that hangs is given 10 s.
#[test]
fn receivers_that_hang_or_are_dead_delay_nothing() {
    let (web, dead) = (Web::start(|_| None), deserted());
    let hung = TcpListener::bind("127.0.0.1:0").expect("a port"); // Takes connections and says nothing.
    let brokers = [format!("mqtt://{dead}"), format!("mqtt://{}", hung.local_addr().expect("an address"))];
    for broker in brokers {
        let url = format!("http://{}/", web.place);
        let arguments =
            ["--webhook", &url, "--mqtt", &broker, "--mqtt-frames", "--frames", "--flush-s", "0.5"];
        let ended = run(&arguments, &lines(None, 0..1500, 1200));
        assert_eq!(ended.code, 3, "{}", ended.log);
        let frames: Vec<&Value> = ended.events.iter().filter(|event| event["event"] == "frame").collect();
        let times_s: Vec<f64> = frames.iter().map(|frame| frame["t_s"].as_f64().expect("a time")).collect();
        assert_eq!(times_s, (0..1500).map(f64::from).collect::<Vec<_>>());
        assert!(ended.events.iter().all(|event| event["event"] != "dropped"));
        let waited_us = frames.iter().map(|frame| frame["times_us"]["waited"].as_f64().expect("a time"));
        let longest_us = waited_us.fold(0.0, f64::max);
        assert!(longest_us < 5e6, "a frame waited for {longest_us} µs");
        // The broker is also told that the source is there.
        for (part, reported) in [("webhook", ended.notices().len()), ("mqtt", ended.notices().len() + 1)] {
            let wanted = format!("{reported} of {reported} never arrived");
            let of_part = ended.log.lines().filter(|line| line.contains(&format!(" {part}: ")));
            assert_eq!(of_part.filter(|line| line.contains(&wanted)).count(), 1, "{part}\n{}", ended.log);
        }
        assert!(ended.log.lines().count() <= 4, "a line for each try?\n{}", ended.log);
    }
}

#[test]
fn addresses_that_cannot_be_are_refused_before_the_session() {
    let folder = folder("outputs-refused");
    let private = folder.join("token");
    std::fs::write(&private, "short\n").expect("written");
    let file = private.to_str().expect("a path");
    let cases: [(&[&str], &str); 9] = [
        (&["--nt4", "25600"], "the number of a team is 1 to 25599"),
        (&["--mqtt", "mqtt://gate:secret@host"], "--mqtt-password-file"),
        (&["--webhook", "ftp://host/secret"], "http:// or https://"),
        (&["--webhook", "http://h/", "--webhook-header", "secret"], "a colon is missing"),
        (&["--mqtt", "http://host"], "mqtt:// or mqtts://"),
        (&["--mqtt", "mqtt://host", "--ca-file", "/nowhere"], "--ca-file: /nowhere"),
        (&["--metrics", "0.0.0.0:0"], "give --metrics-token-file"),
        (&["--metrics", "nonsense"], "--metrics nonsense"),
        (&["--metrics", "127.0.0.1:0", "--metrics-token-file", file], "--metrics-token-file"),
    ];
    let files = ["poses.mcap", "gate.sqlite"].map(|name| folder.join(name));
    let [tf, history] = files.each_ref().map(|file| file.to_str().expect("a path"));
    for (arguments, reason) in cases {
        let ended = run(&[&["--tf", tf, "--history", history], arguments].concat(), "");
        assert!(files.iter().all(|file| !file.exists()), "{arguments:?}: a file was begun");
        assert_eq!(ended.code, 2, "{arguments:?}");
        assert!(ended.log.contains(reason) && !ended.log.contains("secret"), "{arguments:?}: {}", ended.log);
    }
}

#[test]
fn a_broker_keeps_the_last_state_and_knows_who_is_there() {
    let broker = Broker::start(|_| Deed::Acknowledge);
    let password = folder("mqtt-password").join("password");
    std::fs::write(&password, "p@ss\n").expect("written");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(&password, std::fs::Permissions::from_mode(0o600)).expect("private");
    }
    let (address, password) = (format!("mqtt://gate@{}/site", broker.place), password.display().to_string());
    let ended = run(&["--mqtt", &address, "--mqtt-password-file", &password], &knocked());
    broker.see(|seen| {
        assert_eq!((seen.connections, seen.farewells), (1, 1), "{}", ended.log);
        assert_eq!(seen.users, [(Some("gate".to_string()), Some("p@ss".to_string()))]);
        assert_eq!(
            (seen.wills[0].topic.as_str(), seen.wills[0].payload.as_str()),
            ("site/availability", "offline")
        );
        assert!(seen.wills[0].is_retained && seen.wills[0].qos == 1);
        assert_eq!(seen.retained["site/availability"], "offline");
        assert_eq!(
            (seen.came[0].topic.as_str(), seen.came[0].payload.as_str()),
            ("site/availability", "online")
        );
        let states: Vec<Value> = seen
            .came
            .iter()
            .filter(|came| came.topic == "site/cam0/target0/state")
            .map(|came| {
                assert!(came.is_retained && came.qos == 1);
                serde_json::from_str(&came.payload).expect("JSON")
            })
            .collect();
        let reported: Vec<&Value> = states.iter().map(|state| &state["state"]).collect();
        let lines: Vec<&Value> = ended.notices().iter().map(|line| &line["state"]).collect();
        assert_eq!(reported, lines);
        // What an earlier session said of the source no longer holds.
        let source: Value = serde_json::from_str(&seen.retained["site/cam0/source"]).expect("JSON");
        assert_eq!((&source["event"], &source["connected"]), (&json!("source"), &json!(true)), "{source}");
        assert_eq!(seen.came.last().map(|came| came.payload.as_str()), Some("offline"));
    });
    assert_eq!(times(&ended.log, "connected"), 1, "{}", ended.log);
    assert_eq!(times(&ended.log, "p@ss") + times(&ended.log, "p%40ss"), 0);
}

/// The fourth message is lost with the connection: it comes again, and what is kept is reported again to a broker that may have forgotten it.
#[test]
fn a_broken_connection_loses_no_state() {
    let broker = Broker::start(|n| if n == 3 { Deed::BreakOff } else { Deed::Acknowledge });
    let ended = run(&["--mqtt", &format!("mqtt://{}", broker.place), "--flush-s", "30"], &knocked());
    broker.see(|seen| {
        assert_eq!((seen.connections, seen.farewells), (2, 1), "{}", ended.log);
        let last = ended.notices().last().expect("a change")["state"].clone();
        let kept: Value = serde_json::from_str(&seen.retained["resight/cam0/target0/state"]).expect("JSON");
        assert_eq!(kept["state"], last);
        let mut reported: Vec<String> = seen
            .came
            .iter()
            .filter(|came| came.topic.ends_with("/state"))
            .map(|came| serde_json::from_str::<Value>(&came.payload).expect("JSON")["id"].to_string())
            .collect();
        assert_eq!(reported.len(), ended.notices().len() + 1, "the one that was kept is reported again");
        reported.sort();
        reported.dedup();
        assert_eq!(reported.len(), ended.notices().len(), "each arrived at least once");
    });
    assert_eq!(times(&ended.log, "answers again"), 1, "{}", ended.log);
}

/// Whoever is killed says no farewell: the broker does.
#[test]
fn a_killed_session_is_offline() {
    let broker = Broker::start(|_| Deed::Acknowledge);
    let mut session = Session::start(&["--mqtt", &format!("mqtt://{}", broker.place)]);
    session.feed(&lines(None, 0..60, NEVER));
    let availability = || broker.see(|seen| seen.retained.get("resight/availability").cloned());
    wait_for("steady", || {
        let state = broker.see(|seen| seen.retained.get("resight/cam0/target0/state").cloned());
        state.filter(|state| state.contains("\"steady\""))
    });
    assert_eq!(availability().as_deref(), Some("online"));
    session.kill();
    wait_for("the last will", || availability().filter(|word| word == "offline"));
}

#[test]
fn several_cameras_and_targets_have_topics_and_metrics_of_their_own() {
    let broker = Broker::start(|_| Deed::Acknowledge);
    let mut session = four_pairs(&format!("mqtt://{}", broker.place));
    let place = metrics_place(&session);
    session.reported("connected");
    session.feed(&lines(Some("gate"), 0..60, NEVER));
    session.feed(&lines(Some("yard"), 0..60, 30));
    let page = wait_for("all frames counted", || {
        let page = page(&place, "");
        let counted = |camera: &str| {
            page.get(&format!("resight_frames_total{{camera=\"{camera}\",target=\"b\"}}")) == Some(&60.0)
        };
        (counted("gate") && counted("yard")).then_some(page)
    });
    assert_eq!(page["resight_state{camera=\"gate\",target=\"a\",state=\"steady\"}"], 1.0);
    let ended = session.end();
    broker.see(|seen| {
        for topic in ["gate/a", "gate/b", "yard/a", "yard/b"] {
            assert!(seen.retained.contains_key(&format!("resight/{topic}/state")), "{topic}\n{}", ended.log);
            let frames = seen.came.iter().filter(|came| came.topic == format!("resight/{topic}/frame"));
            let frames: Vec<_> = frames.map(|came| (came.qos, came.is_retained)).collect();
            assert_eq!(frames, vec![(0, false); 60]);
        }
        let announced =
            seen.retained.keys().filter(|topic| topic.starts_with("homeassistant/sensor/")).count();
        assert_eq!(announced, 4);
    });
}

/// Its output is not read and the disk of its log is full: the session ends, but not before that is reported elsewhere.
#[cfg(target_os = "linux")]
#[test]
fn a_broken_output_keeps_nothing_from_the_others() {
    let web = Web::start(|_| Some("200 OK"));
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    let url = format!("http://{}/", web.place);
    let mut session = std::process::Command::new("sh")
        .args([
            "-c",
            "exec \"$@\" > /dev/full 2> /dev/full",
            "sh",
            env!("CARGO_BIN_EXE_resight"),
            "watch",
            "--once",
        ])
        .args(["--camera", &camera, "--target", &target, "--source", "-", "--webhook", &url])
        .stdin(std::process::Stdio::piped())
        .spawn()
        .expect("it starts");
    let stdin = session.stdin.take();
    // A session that has ended reads no more.
    let _ = std::io::Write::write_all(&mut stdin.expect("stdin"), lines(None, 0..60, NEVER).as_bytes());
    let status = session.wait().expect("its end");
    assert_eq!(status.code(), Some(2));
    let reported: Vec<Value> = web.asked().iter().map(|asked| asked.json()["state"].clone()).collect();
    assert_eq!(reported, ["learning"]);
}

/// Two cameras, two targets.
fn four_pairs(broker: &str) -> Session {
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    let [gate, yard] = ["gate", "yard"].map(|name| format!("--camera={name}={camera}"));
    let [a, b] = ["a", "b"].map(|name| format!("--target={name}={target}"));
    let reported = ["--mqtt", broker, "--mqtt-frames", "--mqtt-discovery", "--metrics", "127.0.0.1:0"];
    Session::of(&[&[gate.as_str(), &yard, &a, &b], reported.as_slice()].concat())
}

/// A NetworkTables server has each pose with its standard deviations, in its own time, and the last states again after a connection was lost.
#[test]
fn a_networktables_server_has_poses_and_the_last_states() {
    let server = Server::start(|n| if n == 0 { 60 } else { usize::MAX });
    let mut session = Session::start(&["--nt4", &server.place, "--flush-s", "30"]);
    session.reported("connected");
    session.feed(&knocked());
    let ended = session.end();
    assert_eq!(ended.code, 3, "{}", ended.log);
    server.see(|seen| {
        assert_eq!((seen.connections, &seen.paths[0][..]), (2, "/nt/resight"), "{}", ended.log);
        let kinds: Vec<&str> = ["target_from_cam", "sigma", "state", "moved"]
            .map(|what| format!("/resight/cam0/target0/{what}"))
            .map(|name| seen.topics.values().find(|topic| topic.0 == name).expect("announced").1.as_str())
            .to_vec();
        assert_eq!(kinds, ["struct:Pose3d", "double[]", "string", "boolean"]);
        let [first, second] = &seen.came[..] else { panic!("two connections") };
        let of = |came: &std::collections::BTreeMap<String, Vec<_>>, what: &str| {
            came[&format!("/resight/cam0/target0/{what}")].clone()
        };
        assert_eq!(first["/resight/cam0/connected"][0].value, [0xc3]);
        assert_eq!(of(first, "state")[0].value, b"\xa8learning");
        assert_eq!(of(second, "state").last().expect("a state").value, b"\xa7drifted");
        assert_eq!(of(second, "moved").last().expect("a state").value, [0xc3]);
        for pose in of(first, "target_from_cam") {
            assert!(SERVER_US <= pose.time_us && pose.value.len() == 58, "{pose:?}");
            let member = |i: usize| {
                f64::from_le_bytes(pose.value[2 + 8 * i..10 + 8 * i].try_into().expect("a double"))
            };
            let length = (3..7).map(|i| member(i).powi(2)).sum::<f64>().sqrt();
            assert!((length - 1.0).abs() < 1e-12 && member(2) < -0.3, "{pose:?}");
        }
        for sigma in of(first, "sigma") {
            assert!((sigma.kind, sigma.value[0], sigma.value.len()) == (17, 0x96, 55));
        }
    });
    assert_eq!(
        (times(&ended.log, "closed the connection") + times(&ended.log, "broke off")),
        1,
        "{}",
        ended.log
    );
}
