//! `capture` as a user runs it: photographs and films as sources, kept images, and sources that come to nothing.

use crate::film_support::has_ffmpeg;
use crate::recorded::recorded;
use crate::support::{folder, json_lines, resight};
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::multiview::intrinsics::Placement;
use resight::core::target::Chessboard;
use resight::core::{Camera, CameraMatrix, Pixel, Point, Target};
use resight::render::{Finish, Scene, Style, render};
use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

const BOARD: &str = "kind = \"chessboard\"\nrows = 6\ncolumns = 9\nsquare_m = 0.025\n";

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

fn parameter(camera: &Value, name: &str) -> [f64; 2] {
    let all = camera["intrinsics"]["parameters"].as_array().unwrap();
    let found = all.iter().find(|p| p["name"] == name).unwrap();
    ["value", "sigma"].map(|key| found[key].as_f64().unwrap())
}

/// A pattern of thirteen photographs: the published camera within its ±, a camera file, and kept images for which `intrinsics` gives the same
/// answer. A second run gives the same file.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn photographs_give_the_published_camera_and_kept_images_the_same() {
    let data = recorded("opencv_stereo_chessboard");
    let folder = folder("capture_photographs");
    let board = write(&folder, "board.toml", BOARD);
    let pattern = data.join("left*.jpg").display().to_string();
    let output = folder.join("camera.toml").display().to_string();
    let keep = folder.join("kept").display().to_string();
    let arguments = ["capture", &pattern, "--target", &board, "--json", "-o", &output];
    let run = resight(&[&arguments[..], &["--keep", &keep]].concat());
    let lines = json_lines(&run);
    let (answer, views) = lines.split_last().unwrap();
    println!("{}", answer["message"]);
    assert_eq!(run.code, if answer["status"] == "ok" { 0 } else { 1 });
    assert!(views.iter().all(|view| view["kind"] == "capture_view") && 10 <= views.len(), "{}", run.stdout);
    for (name, published) in [("fx_px", 536.07), ("fy_px", 536.02), ("cx_px", 342.37), ("cy_px", 235.54)] {
        let [value, sigma] = parameter(&answer["camera"], name);
        println!("{name} {value:.2} ± {sigma:.2}, published {published}");
        assert!((value - published).abs() < 5.0 * sigma && sigma < 5.0, "{name} {value} ± {sigma}");
    }
    let first = std::fs::read(&output).unwrap();
    let mut kept: Vec<String> =
        std::fs::read_dir(&keep).unwrap().map(|entry| entry.unwrap().path().display().to_string()).collect();
    kept.sort();
    assert_eq!(kept.len(), views.len());
    let images: Vec<&str> = kept.iter().map(String::as_str).collect();
    let again = resight(&[&["intrinsics", "--json", "--target", &board], &images[..]].concat());
    assert_eq!(json_lines(&again).pop().unwrap()["cameras"][0], answer["camera"]);
    resight(&arguments);
    assert_eq!(std::fs::read(&output).unwrap(), first);
    let refused = resight(&[&arguments[..], &["--keep", &keep]].concat());
    assert!(refused.code == 2 && refused.stderr.contains("an earlier capture"), "{}", refused.stderr);
}

const SIZE: ImageSize = ImageSize { width_px: 320, height_px: 240 };

/// An image of a board at a place of the image, tilted.
fn frame(place: [f64; 2], tilt_rad: f64, axis_rad: f64, seed: u64) -> Vec<u8> {
    let matrix = CameraMatrix { fx_px: 300.0, fy_px: 300.0, cx_px: 159.5, cy_px: 119.5 };
    let camera = Camera { lens: Pinhole { matrix }.into(), size: Some(SIZE) };
    let centre = Pixel::new(320.0 * place[0], 240.0 * place[1]);
    let placement = Placement { centre, tilt_rad, axis_rad, part: 0.55 };
    let high = Point::new(0.15, 0.1, 0.0);
    let pose = placement.cam_from_target(&camera, SIZE, [Point::zeros(), high]).expect("a pose");
    let board = Target::Chessboard(Chessboard { rows: 5, columns: 7, square_m: 0.025 });
    let finish = Finish { seed, ..Finish::default() };
    render(&Scene::of(board, pose, Style::default()), &camera, &finish).expect("an image").data
}

/// A film in which the board jumps from place to place and rests for three frames at each: one image of each place is kept, none of them the
/// first after the jump.
#[test]
fn a_film_gives_one_image_of_each_place() {
    if !has_ffmpeg() {
        return;
    }
    let folder = folder("capture_film");
    let places = [[0.5, 0.5], [0.3, 0.4], [0.7, 0.4], [0.35, 0.62], [0.65, 0.6]];
    let film = folder.join("film.mkv").display().to_string();
    let frames = (0..15).flat_map(|i| frame(places[i / 3], 0.6, 1.9 * (i / 3) as f64, i as u64));
    let frames: Vec<u8> = frames.collect();
    let mut encoder = Command::new("ffmpeg")
        .args(["-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-video_size", "320x240"])
        .args(["-framerate", "10", "-i", "-", "-c:v", "ffv1", &film])
        .stdin(Stdio::piped())
        .spawn()
        .expect("ffmpeg");
    encoder.stdin.take().expect("its input").write_all(&frames).expect("taken");
    assert!(encoder.wait().expect("an end").success());
    let board =
        write(&folder, "board.toml", "kind = \"chessboard\"\nrows = 5\ncolumns = 7\nsquare_m = 0.025\n");
    let run = resight(&["capture", &film, "--target", &board, "--json"]);
    let lines = json_lines(&run);
    let (answer, views) = lines.split_last().unwrap();
    let frames: Vec<u32> = views
        .iter()
        .map(|view| view["frame"].as_str().unwrap().rsplit_once('#').unwrap().1.parse().unwrap())
        .collect();
    println!("{frames:?} {}", answer["message"]);
    assert_eq!(frames, [1, 4, 7, 10, 13]);
    assert!(run.code == 1 && answer["message"].as_str().unwrap().contains("of 10 needed"), "{}", run.stdout);
}

/// Sources that cannot be opened are wrong usage; sources without a target are an answer.
#[test]
fn sources_that_come_to_nothing() {
    let folder = folder("capture_nothing");
    let board = write(&folder, "board.toml", BOARD);
    let bad = write(&folder, "camera.mp4", "no film");
    for (source, needed) in [
        ("nowhere.png", "no such file"),
        ("/dev/video87", "/dev/video87"),
        ("rtsp://me:secret@cam/x", "@FILE"),
    ] {
        let run = resight(&["capture", source, "--target", &board]);
        assert!(run.code == 2 && run.stderr.contains(needed), "{source}: {} {}", run.code, run.stderr);
        assert!(!run.stderr.contains("secret@"), "{}", run.stderr);
    }
    let run = resight(&["capture", "left*.png", "--target", "nowhere.toml"]);
    assert!(run.code == 2 && run.stderr.contains("nowhere.toml"), "{}", run.stderr);
    let empty = folder.join("empty");
    std::fs::create_dir(&empty).unwrap();
    let run = resight(&["capture", &empty.display().to_string(), "--target", &board, "--json"]);
    let answer = json_lines(&run).pop().unwrap();
    assert!(run.code == 1 && answer["status"] == "not_found", "{answer}");
    let run = resight(&["capture", &bad, "--target", &board, "--json"]);
    let answer = json_lines(&run).pop().unwrap();
    let message = answer["message"].as_str().unwrap();
    assert!(run.code == 1 && message.contains("not a PNG or JPEG"), "{message}");
    let output = folder.join("none.toml");
    let image = crate::support::demo("left.png");
    let arguments = ["capture", &image, "--target", &board, "-o", &output.display().to_string()];
    let run = resight(&arguments);
    assert!(
        run.code == 1 && run.stdout.contains("NOT FOUND") && run.stdout.contains("nothing was written"),
        "{}",
        run.stdout
    );
    assert!(!output.exists());
}
