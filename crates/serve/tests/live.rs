//! Watched cameras over the interface: pictures one at a time, an alarm that waits, the way back that shrinks, a new reference.

use crate::client::{ask, get, post};
use crate::described::must_be;
use crate::feed::{Feed, Told};
use crate::live_support::{TAG_M, camera, config, film, picture, tag, tag_pose, trembling};
use nalgebra::Vector6;
use resight::GrayImage;
use resight::core::Pose;
use resight::formats::read_cameras_from_bytes;
use resight::locate::IntrinsicsCovariance;
use resight_serve::{ServeConfig, Server};
use resight_watch::history::Retention;
use resight_watch::live::{LiveCamera, LiveConfig, Watched};
use resight_watch::outputs::history::HistoryConfig;
use resight_watch::source::{Content, Frame, Next, Source};
use resight_watch::{Log, Request};
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Images of one pose.
const VARIANTS: usize = 6;
/// A camera gives one in this time.
const PERIOD: Duration = Duration::from_millis(50);
const PATIENCE: Duration = Duration::from_secs(60);
/// By which the camera is turned right, degrees.
const ANGLES_DEG: [f64; 3] = [0.0, 0.3, 0.6];

fn films() -> &'static [Arc<Vec<GrayImage>>; 3] {
    static FILMS: OnceLock<[Arc<Vec<GrayImage>>; 3]> = OnceLock::new();
    FILMS.get_or_init(|| {
        ANGLES_DEG.map(|deg: f64| {
            let turned = Pose::exp(&Vector6::new(0.0, deg.to_radians(), 0.0, 0.0, 0.0, 0.0)).inverse();
            film(&tag(), &trembling(turned * tag_pose(120.0, 80.0, -60.0), VARIANTS), deg.to_bits())
        })
    })
}

/// A camera that a test turns: it gives images of the pose that is chosen.
struct Turned {
    chosen: Arc<AtomicUsize>,
    due: Instant,
    number: u64,
    began: Instant,
}

impl Source for Turned {
    fn next(&mut self, patience: Duration) -> Next {
        let wait = self.due.saturating_duration_since(Instant::now());
        std::thread::sleep(wait.min(patience));
        if patience < wait {
            return Next::Nothing;
        }
        self.due = Instant::now() + PERIOD;
        self.number += 1;
        let film = &films()[self.chosen.load(Ordering::Relaxed)];
        let image = film[self.number as usize % film.len()].clone();
        let capture_s = self.began.elapsed().as_secs_f64();
        Next::Frame(Frame {
            number: self.number,
            capture_s,
            name: String::new(),
            content: Content::Image(image),
        })
    }

    fn is_live(&self) -> bool {
        true
    }
}

struct Watching {
    place: SocketAddr,
    /// By camera.
    chosen: Vec<Arc<AtomicUsize>>,
}

fn watching(names: &[&str]) -> Watching {
    watched_with(names, |_| {})
}

fn watched_with(names: &[&str], change: impl FnOnce(&mut Request)) -> Watching {
    films(); // Drawn before the clock starts.
    let chosen: Vec<Arc<AtomicUsize>> = names.iter().map(|_| Arc::default()).collect();
    let one = |(name, chosen): (&&str, &Arc<AtomicUsize>)| {
        let began = Instant::now();
        let source = Turned { chosen: Arc::clone(chosen), due: began, number: 0, began };
        let watched = Watched { name: "tag".into(), target: Arc::new(tag()), reference: None };
        LiveCamera { targets: vec![watched], ..LiveCamera::new(*name, camera(), Box::new(source)) }
    };
    let cameras = names.iter().zip(&chosen).map(one).collect();
    let mut request = Request::new(cameras, LiveConfig { learn_readings: 20, ..config() });
    request.is_once = false;
    change(&mut request);
    let mut server = Server::bind(&ServeConfig {
        flag: "--listen",
        address: "127.0.0.1:0".into(),
        token_file: None,
        hosts: Vec::new(),
        patience: ServeConfig::PATIENCE,
    })
    .expect("a free port");
    let place = server.place();
    server.watch(request, Log::default()).expect("a thread");
    std::thread::spawn(move || server.run());
    Watching { place, chosen }
}

impl Watching {
    fn view(&self, camera: usize) -> Value {
        get(self.place, "/api/live").json()["cameras"][camera].take()
    }

    fn until(&self, camera: usize, what: &str, is: impl Fn(&Value) -> bool) -> Value {
        let end = Instant::now() + PATIENCE;
        loop {
            let view = self.view(camera);
            if is(&view) {
                return view;
            }
            assert!(Instant::now() < end, "{what}: {view:#}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

fn right_deg(view: &Value) -> f64 {
    -view["way_back"]["rotation_rad"][1].as_f64().unwrap_or(0.0).to_degrees()
}

#[test]
fn an_alarm_waits_the_way_back_shrinks_and_a_new_reference_is_learned() {
    let folder = std::env::temp_dir().join(format!("resight-serve-live-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let file = folder.join("gate.ref.toml");
    let hall = watched_with(&["gate", "yard"], |request| {
        request.save_references = vec![Some(file.display().to_string()), None];
    });
    let steady = |view: &Value| view["state"] == "steady";
    hall.until(0, "gate is steady", steady);
    hall.until(1, "yard is steady", steady);
    assert_eq!(hall.view(0)["alarm"], Value::Null);

    hall.chosen[0].store(2, Ordering::Relaxed);
    let moved = hall.until(0, "gate moved", |view| view["state"] == "drifted");
    assert!((right_deg(&moved) - 0.6).abs() < 0.05, "nothing of before the motion is in it: {moved:#}");
    let words = moved["way_back"]["words"].as_str().expect("words");
    assert!(words.contains("left 0.6") || words.contains("left 0.5"), "{words}");
    assert!(moved["alarm"]["words"].as_str().is_some_and(|words| words.contains("moved")), "{moved:#}");
    assert_eq!(hall.view(1)["alarm"], Value::Null, "the other camera did not move");

    hall.chosen[0].store(1, Ordering::Relaxed);
    hall.until(0, "half way back", |view| (right_deg(view) - 0.3).abs() < 0.02);
    std::thread::sleep(Duration::from_millis(600));
    let nearer = hall.view(0);
    assert!((right_deg(&nearer) - 0.3).abs() < 0.06, "{nearer:#}");

    let name = json!({ "camera": "gate" });
    let acknowledged = post(hall.place, "/api/live/acknowledge", &name).json();
    assert_eq!(acknowledged["cameras"][0]["alarm"], Value::Null);

    let asked = post(hall.place, "/api/live/reference", &name);
    assert_eq!((asked.status, asked.json()["error"]["kind"].as_str()), (409, Some("confirm")));
    hall.until(1, "yard goes on", steady);
    let confirmed = post(hall.place, "/api/live/reference", &json!({ "camera": "gate", "confirm": true }));
    assert_eq!(confirmed.status, 200);
    hall.until(0, "gate learns", |view| view["state"] == "learning");
    assert_eq!(hall.view(1)["state"], "steady", "the other camera keeps its reference");
    hall.until(0, "steady where it is", steady);
    let kept = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a reference");
    assert_ne!(kept("gate.ref.toml"), kept("gate.ref.toml.old1"), "the old one is kept beside the new one");
    std::fs::remove_dir_all(&folder).expect("removed");
    let references = get(hall.place, "/api/live/reference?camera=gate").json();
    let by = references[0]["changed"]["rotation_rad"][1].as_f64().expect("old and new").to_degrees();
    assert!((by - 0.3).abs() < 0.06, "{references:#}");

    let log = get(hall.place, "/api/live/log").json();
    let lines = log.as_array().expect("lines").iter().filter(|line| line["camera"] == "gate");
    assert!(lines.clone().any(|line| line["text"].as_str().is_some_and(|t| t.contains("moved in a step"))));
    let strip = get(hall.place, "/api/live/strip?camera=gate&bins=200").json();
    let bins = strip["bins"].as_array().expect("bins");
    assert_eq!((bins.len(), &strip["is_from_history"]), (200, &json!(false)));
    assert!(
        bins.iter().any(|bin| bin["state"] == "drifted") && bins.iter().any(|bin| bin["state"] == "steady")
    );

    let scene = get(hall.place, "/api/live/scene").json();
    let cameras = scene[0]["cameras"].as_array().expect("cameras");
    let is = |camera: &&Value| camera["name"] == "gate" && camera["is_reference"] == json!(false);
    let gate = cameras.iter().find(is).expect("gate");
    let place = tag_pose(120.0, 80.0, -60.0).origin();
    let seen: Vec<f64> =
        gate["position_m"].as_array().expect("three").iter().filter_map(Value::as_f64).collect();
    assert!(
        (Pose::identity().translation + place - nalgebra::Vector3::from_row_slice(&seen)).norm()
            < 0.1 * TAG_M
    );
    assert_eq!(gate["half_axes_m"].as_array().map(Vec::len), Some(3));
}

/// Counts pictures and states that come in some seconds.
fn counted(feed: &mut Feed, seconds: f64, acknowledges: bool) -> (usize, usize) {
    let (end, mut pictures, mut states) = (Instant::now() + Duration::from_secs_f64(seconds), 0, 0);
    while let Some(told) = feed.next(end.saturating_duration_since(Instant::now())) {
        match told {
            Told::Picture(header, jpeg) => {
                pictures += 1;
                assert_eq!((&header["width_px"], &header["height_px"]), (&json!(1280), &json!(960)));
                assert!(jpeg.starts_with(&[0xff, 0xd8]), "a JPEG");
                if acknowledges {
                    feed.acknowledge();
                }
            }
            Told::Text(text) => states += usize::from(!text["live"].is_null()),
        }
    }
    (pictures, states)
}

#[test]
fn a_client_that_is_slow_gets_less_and_the_others_all() {
    let hall = watching(&["gate", "yard"]);
    hall.until(0, "gate is steady", |view| view["state"] == "steady");
    let mut deaf: Vec<Feed> = (0..3).map(|_| Feed::open(hall.place)).collect();
    deaf.iter_mut().for_each(Feed::acknowledge);
    let mut silent = Feed::open(hall.place);
    let mut quick = Feed::open(hall.place);
    let (fast, slow) = std::thread::scope(|scope| {
        let slow = scope.spawn(|| counted(&mut silent, 4.0, false));
        (counted(&mut quick, 4.0, true), slow.join().expect("counted"))
    });
    assert_eq!(slow.0, 1, "no second picture before the first is acknowledged");
    assert!(8 <= slow.1 && 8 <= fast.1, "states: {slow:?} {fast:?}");
    assert!(20 <= fast.0, "{} pictures in 4 s of two cameras", fast.0);
    for camera in [0, 1] {
        assert_eq!(hall.view(camera)["dropped"], json!(0));
    }
}

#[test]
fn one_camera_is_shown_large_with_the_residuals_of_its_points() {
    let hall = watching(&["gate", "yard"]);
    let mut feed = Feed::open(hall.place);
    feed.say(&json!({ "show": "yard" }));
    let end = Instant::now() + PATIENCE;
    loop {
        let told = feed.next(Duration::from_secs(5)).expect("a message");
        assert!(Instant::now() < end, "no large picture");
        let Told::Picture(header, jpeg) = told else { continue };
        feed.acknowledge();
        let Some(points) = header["points"].as_array() else { continue };
        if points.is_empty() {
            continue; // Of the first frames, in which nothing was found.
        }
        assert_eq!(header["camera"], "yard");
        assert_eq!((points.len(), header["outline"].as_array().map(Vec::len)), (4, Some(4)));
        let large = resight::GrayImage::decode(&jpeg).expect("a picture");
        assert_eq!((large.width_px, large.height_px), (1280, 960));
        break;
    }
    let frame = get(hall.place, "/api/live/frame?camera=yard");
    assert_eq!(frame.status, 200);
    let frame = resight::GrayImage::decode(&frame.body).expect("a PNG");
    let is_one = |film: &Arc<Vec<GrayImage>>| film.iter().any(|image| image.data == frame.data);
    assert!(films().iter().any(is_one), "the frame is as the camera gave it");
    let _ = picture; // The rest of the support is for benches.
}

/// The header of a picture, small and large, a state and an event, as they are really sent.
#[test]
fn what_the_socket_sends_is_as_described() {
    let hall = watching(&["gate"]);
    let description = get(hall.place, "/openapi.json").json();
    let messages = &description["paths"]["/ws/live"]["get"]["x-messages"];
    let (text, header) = (&messages["sends"], &messages["binary"]["header"]);
    assert!(text.is_object() && header.is_object(), "{messages:#}");
    let mut feed = Feed::open(hall.place);
    let (mut states, mut events, mut small, mut large) = (0, 0, 0, 0);
    let end = Instant::now() + PATIENCE;
    while states == 0 || events == 0 || small == 0 || large == 0 {
        assert!(Instant::now() < end, "{states} states, {events} events, {small} and {large} pictures");
        match feed.next(Duration::from_secs(5)).expect("a message") {
            Told::Text(message) => {
                must_be(&description, text, "a message", &message);
                let is_state = !message["live"].is_null();
                let name = if is_state { "LiveMessage" } else { "EventObject" };
                let of_kind = json!({ "$ref": format!("#/components/schemas/{name}") });
                must_be(&description, &of_kind, name, &message);
                (states, events) = (states + usize::from(is_state), events + usize::from(!is_state));
            }
            Told::Picture(found, _) => {
                must_be(&description, header, "a header", &found);
                let is_large = found["points"].as_array().is_some_and(|points| !points.is_empty());
                (small, large) = (small + usize::from(!is_large), large + usize::from(is_large));
                feed.say(&json!({ "show": "gate" }));
                feed.acknowledge();
            }
        }
    }
    // A schema that lets anything through would pass all of that.
    let whole = json!({ "allOf": [header], "components": description["components"] });
    assert!(!jsonschema::draft202012::new(&whole).expect("a schema").is_valid(&json!({ "camera": 1 })));
}

/// `ok` while the session runs, `degraded` once it has failed: here its history has no place to be written.
#[test]
fn a_session_that_failed_is_degraded() {
    let hall = watching(&["gate"]);
    hall.until(0, "gate is seen", |view| !view["state"].is_null());
    let well = get(hall.place, "/healthz");
    assert_eq!((well.status, well.body.as_slice()), (200, b"ok\n".as_slice()));
    let broken = watched_with(&["gate"], |request| {
        let folder = std::env::temp_dir().join("resight-serve-nowhere").join("at-all");
        request.outputs.history = Some(HistoryConfig {
            file: folder.join("history.sqlite"),
            retention: Retention::default(),
            commit_s: 1.0,
            on_stored: None,
        });
    });
    let end = Instant::now() + PATIENCE;
    let failed = loop {
        let health = get(broken.place, "/healthz");
        if health.status != 200 {
            break health;
        }
        assert!(Instant::now() < end, "it is still well");
        std::thread::sleep(Duration::from_millis(50));
    };
    assert_eq!((failed.status, failed.body.as_slice()), (503, b"degraded\n".as_slice()));
    let view = get(broken.place, "/api/live").json();
    assert!(view["failed"].as_str().is_some_and(|reason| reason.contains("history")), "{view:#}");
}

/// The lens of a camera is a camera file with all that is known of it.
#[test]
fn the_lens_of_a_camera_is_a_camera_file() {
    let sigmas = [("fx_px".to_owned(), 2.0), ("cx_px".to_owned(), 0.5)].into();
    let known = IntrinsicsCovariance::independent(&sigmas, &camera()).expect("parameters of the model");
    let hall = watched_with(&["gate", "yard"], |request| request.cameras[1].intrinsics = Some(known.clone()));
    for (name, intrinsics) in [("gate", None), ("yard", Some(known))] {
        let file = get(hall.place, &format!("/api/live/lens?camera={name}"));
        assert_eq!(file.status, 200);
        let read = read_cameras_from_bytes(Path::new("camera.toml"), file.body).expect("a camera file");
        assert_eq!((read.cameras[0].name.as_str(), &read.cameras[0].camera), (name, &camera()));
        assert_eq!(IntrinsicsCovariance::of(&read.cameras[0]), intrinsics);
    }
    assert_eq!(get(hall.place, "/api/live/lens?camera=nobody").status, 404);
}

#[test]
fn without_a_session_every_route_says_how_to_start_one() {
    let place = crate::client::server(None);
    for path in [
        "/api/live",
        "/api/live/log",
        "/api/live/scene",
        "/api/live/strip?camera=a",
        "/cameras.mjpg?camera=a",
    ] {
        let answer = get(place, path);
        assert_eq!(answer.status, 404, "{path}");
        assert!(answer.message().contains("resight serve SESSION.toml"), "{path}: {}", answer.message());
    }
}

#[test]
fn what_makes_no_sense_is_refused_in_a_sentence() {
    let hall = watching(&["gate"]);
    let refused = |path: &str| (get(hall.place, path).status, get(hall.place, path).message());
    assert_eq!(refused("/api/live/reference?camera=nobody").0, 404);
    let (status, message) = refused("/api/live/strip?camera=gate&from_s=5&to_s=1");
    assert!(status == 422 && message.contains("before to_s"), "{status} {message}");
    let (status, message) = refused("/api/live/history?camera=gate");
    assert!(status == 404 && message.contains("`history`"), "{status} {message}");
    let form = ask(
        hall.place,
        "POST /api/live/acknowledge",
        &[("Content-Type", "text/plain")],
        b"{\"camera\":\"gate\"}",
    );
    assert_eq!(form.status, 415);
}
