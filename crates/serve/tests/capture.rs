//! A capture of intrinsics behind the page: its state, its images, what two pages ask of it, and how it ends.

use crate::client::{get, post};
use crate::described::must_be;
use crate::feed::{Feed, Told};
use resight::GrayImage;
use resight::capture::{Capture, CaptureConfig};
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::multiview::intrinsics::Placement;
use resight::core::target::Chessboard;
use resight::core::{Camera, CameraMatrix, Pixel, Point, Target};
use resight::render::{Finish, Scene, Style, render};
use resight_serve::{Capturing, ServeConfig, Server};
use resight_watch::capture::capture;
use resight_watch::source::{Content, Frame, Next, Source};
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);
const SIZE: ImageSize = ImageSize { width_px: 640, height_px: 480 };

fn board() -> Target {
    Target::Chessboard(Chessboard { rows: 5, columns: 7, square_m: 0.025 })
}

/// An image of the board, tilted differently each time.
fn image(i: usize) -> GrayImage {
    let matrix = CameraMatrix { fx_px: 600.0, fy_px: 600.0, cx_px: 319.5, cy_px: 239.5 };
    let camera = Camera { lens: Pinhole { matrix }.into(), size: Some(SIZE) };
    let at = |k: usize| [0.5, 0.35, 0.65][k % 3];
    let centre = Pixel::new(640.0 * at(i), 480.0 * at(i / 3));
    let placement = Placement { centre, tilt_rad: 0.6, axis_rad: 1.9 * i as f64, part: 0.55 };
    let pose = placement
        .cam_from_target(&camera, SIZE, [Point::zeros(), Point::new(0.15, 0.1, 0.0)])
        .expect("a pose");
    let finish = Finish { seed: i as u64, ..Finish::default() };
    render(&Scene::of(board(), pose, Style::default()), &camera, &finish).expect("an image")
}

/// Images, one after the other.
struct Slides(std::vec::IntoIter<GrayImage>, u64);

impl Source for Slides {
    fn next(&mut self, _: Duration) -> Next {
        let Some(image) = self.0.next() else { return Next::End };
        self.1 += 1;
        let name = format!("slide {}", self.1);
        Next::Frame(Frame { number: self.1, capture_s: 0.0, name, content: Content::Image(image) })
    }

    fn is_live(&self) -> bool {
        false
    }

    fn are_photographs(&self) -> bool {
        true
    }
}

/// A capture of images, shown by a server; ends when it is asked to.
fn capturing(images: Vec<GrayImage>) -> (SocketAddr, JoinHandle<usize>) {
    let config = CaptureConfig { are_photographs: true, ..CaptureConfig::default() };
    let mut job = Capture::new(board(), config).expect("a capture");
    let page = Arc::new(Capturing::new("slides".into(), Path::new("camera.toml"), &job));
    let mut server = Server::bind(&ServeConfig {
        flag: "--serve",
        address: "127.0.0.1:0".into(),
        token_file: None,
        hosts: Vec::new(),
        patience: ServeConfig::PATIENCE,
    })
    .expect("a free port");
    server.show_capture(Arc::clone(&page));
    let place = server.place();
    std::thread::spawn(move || server.run());
    let run = move || {
        let source = Box::new(Slides(images.into_iter(), 0));
        capture(source, &mut job, (page.operator(), true), |job, news| {
            page.take(job, &news);
            Ok(())
        })
        .expect("an end");
        page.ended(&job, Ok(true));
        job.kept().len()
    };
    (place, std::thread::spawn(run))
}

fn until(place: SocketAddr, what: &str, is: impl Fn(&Value) -> bool) -> Value {
    let end = Instant::now() + PATIENCE;
    loop {
        let view = get(place, "/api/capture").json();
        if is(&view) {
            return view;
        }
        assert!(Instant::now() < end, "{what}: {view:#}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

fn n_views(view: &Value) -> usize {
    view["state"]["views"].as_array().expect("views").len()
}

/// The last message of a feed that says how the capture is, and the pictures before it.
fn to_the_end(feed: &mut Feed) -> (Value, Vec<(Value, Vec<u8>)>) {
    let (mut last, mut pictures) = (Value::Null, Vec::new());
    while let Some(told) = feed.next(Duration::from_secs(10)) {
        match told {
            Told::Text(mut text) => last = text["capture"].take(),
            Told::Picture(header, jpeg) => pictures.push((header, jpeg)),
        }
        feed.acknowledge();
        if last["is_over"] == true {
            break;
        }
    }
    (last, pictures)
}

/// Two pages see the same; one takes the last view back, the other's request for the same view comes too late; either ends the capture, and both
/// hear of the end.
#[test]
fn two_pages_show_a_capture_and_end_it() {
    let (place, run) = capturing((0..9).map(image).collect());
    let mut feeds = [Feed::of(place, "/ws/capture"), Feed::of(place, "/ws/capture")];
    let view = until(place, "the end of the source", |view| !view["source_ended"].is_null());
    let description = get(place, "/openapi.json").json();
    let schema = &description["paths"]["/api/capture"]["get"]["responses"]["200"]["content"]["application/json"]
        ["schema"];
    must_be(&description, schema, "/api/capture", &view);
    let n = n_views(&view);
    assert!(6 < n && view["state"]["n_frames"] == 9 && view["state"]["is_usable"] == true, "{view:#}");
    let counts = view["state"]["coverage"]["counts"].as_array().expect("cells");
    let n_corners = counts.iter().map(|n| n.as_u64().expect("a number")).sum::<u64>();
    assert!((30 * n as u64..=35 * n as u64).contains(&n_corners), "{n_corners}");
    let focal = |view: &Value| view["state"]["parameters"][0]["sigma"].as_f64().expect("a sigma");
    assert_eq!(view["state"]["views"][n - 1]["parameters"][0]["sigma"].as_f64(), Some(focal(&view)));
    let last = view["state"]["views"][n - 1]["view"].clone();
    let other = post(place, "/api/capture/take-back", &json!({ "view": "view-001" }));
    assert!(other.status == 409 && other.message().contains("not the last view"), "{}", other.message());
    let back = post(place, "/api/capture/take-back", &json!({ "view": last }));
    assert_eq!((back.status, n_views(&back.json())), (200, n - 1));
    let late = post(place, "/api/capture/take-back", &json!({ "view": last }));
    assert_eq!(late.status, 409, "the other page's request");
    assert!(focal(&back.json()) != focal(&view), "the camera is estimated again");
    let finished = post(place, "/api/capture/finish", &json!({}));
    assert!(finished.status == 200 && finished.json()["is_written"] == true, "{:#}", finished.json());
    let header = &description["paths"]["/ws/capture"]["get"]["x-messages"]["binary"]["header"];
    for feed in &mut feeds {
        let (end, pictures) = to_the_end(feed);
        assert!(end["is_over"] == true && n_views(&end) == n - 1, "{end:#}");
        let (shown, jpeg) = pictures.last().expect("a picture");
        must_be(&description, header, "/ws/capture", shown);
        assert_eq!(shown["points_px"].as_array().expect("points").len(), 35);
        assert!(jpeg.starts_with(&[0xff, 0xd8]) && shown["width_px"] == 640, "{shown}");
    }
    assert_eq!(run.join().expect("an end"), n - 1);
}

/// Without a target there is nothing to write: the request for the end is refused with the reason, and the capture continues.
#[test]
fn a_capture_without_a_camera_is_not_finished() {
    let (place, run) = capturing(vec![GrayImage::filled(320, 240, 90); 2]);
    let view = until(place, "the end of the source", |view| !view["source_ended"].is_null());
    assert!(
        view["state"]["status"] == "not_found" && view["state"]["last"]["reason"] == "not_found",
        "{view:#}"
    );
    let refused = post(place, "/api/capture/finish", &json!({}));
    assert!(
        refused.status == 409 && refused.message().contains("no camera to write yet: no target was found"),
        "{}",
        refused.message()
    );
    assert_eq!(post(place, "/api/capture/take-back", &json!({ "view": "view-001" })).status, 409);
    assert!(!run.is_finished());
}

/// A server that calibrates nothing says so, and what starts one.
#[test]
fn without_a_capture_there_is_none() {
    let place = crate::client::server(None);
    assert_eq!(get(place, "/api/capture").json(), Value::Null);
    let refused = post(place, "/api/capture/finish", &json!({}));
    assert!(refused.status == 404 && refused.message().contains("resight capture"), "{}", refused.message());
}
