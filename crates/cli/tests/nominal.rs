//! Cameras without a file: the lens from a field of view, from millimetres or from EXIF; how far that is off stands in every ±.

use crate::support::{folder, json_lines, resight};
use serde_json::Value;

fn photo(name: &str) -> String {
    format!("{}/../../examples/photo/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn located(images: &[&str], flags: &[&str]) -> Vec<Value> {
    let board = photo("board.toml");
    let run = resight(&[&["locate", "--target", &board, "--json"], images, flags].concat());
    assert!(run.code <= 1, "{}", run.stderr);
    json_lines(&run)
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// Camera position in the frame of the target, and its standard deviations about the camera's axes.
fn position(answer: &Value) -> ([f64; 3], [f64; 3]) {
    let three = |v: &Value| [0, 1, 2].map(|i| number(&v[i]));
    (three(&answer["target_from_cam"]["translation_m"]), three(&answer["sigma_m"]))
}

/// Seven photographs of a chessboard through a lens whose field of view (61.8° by its calibration) is stated as a data sheet would, 5 % off:
/// every position is within three of its ±, the ± are what the lens costs, and the answer says so.
#[test]
fn a_stated_field_of_view_is_honest() {
    let names =
        ["left01.jpg", "left03.jpg", "left04.jpg", "left05.jpg", "left06.jpg", "left07.jpg", "left08.jpg"];
    let images: Vec<String> = names.iter().map(|name| photo(name)).collect();
    let images: Vec<&str> = images.iter().map(String::as_str).collect();
    let exact = located(&images, &["--camera", &photo("left.yml")]);
    let nominal = located(&images, &["--hfov-deg", "60"]);
    let mut squares = 0.0;
    for (known, guessed) in exact.iter().zip(&nominal) {
        let ((a, _), (b, sigma)) = (position(known), position(guessed));
        let error = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
        let total = sigma.iter().map(|s| s * s).sum::<f64>().sqrt();
        squares += (error / total).powi(2);
        assert!(error < 3.0 * total, "{error} ± {total}");
        let cost = &guessed["intrinsics_cost"];
        assert!((number(&cost["position_sigma_m"]) / total - 1.0).abs() < 1e-9, "{cost}");
        assert!(number(&cost["with_exact_intrinsics_m"]) < 0.2 * total, "{cost}");
        assert!(["focal length", "principal point"].contains(&cost["mostly"].as_str().expect("a word")));
        let remarks = guessed["remarks"].to_string();
        assert!(remarks.contains("not calibrated") && remarks.contains("60°"), "{remarks}");
        assert!(known["intrinsics_cost"].is_null() && number(&guessed["intrinsics_sigma"]["fx_px"]) > 20.0);
    }
    // The ± are not empty words either: the errors are a fair part of them.
    let rms = (squares / nominal.len() as f64).sqrt();
    assert!((0.1..1.5).contains(&rms), "{rms}");
}

/// A JPEG with an EXIF block that names a focal length.
fn with_exif(name: &str, focal_35mm: u8) -> String {
    let jpeg = std::fs::read(photo("left01.jpg")).expect("a photograph");
    let entry = |tag: [u8; 2], kind: u8, count: u8, value: [u8; 4]| {
        [&tag[..], &[0, kind, 0, 0, 0, count], &value[..]].concat()
    };
    let first = [&[0, 1][..], &entry([0x87, 0x69], 4, 1, [0, 0, 0, 26]), &[0; 4]].concat();
    let second = [&[0, 1][..], &entry([0xa4, 0x05], 3, 1, [0, focal_35mm, 0, 0]), &[0; 4]].concat();
    let block = [b"Exif\0\0MM\0*\0\0\0\x08", &first[..], &second[..]].concat();
    let length = u16::try_from(block.len() + 2).expect("short").to_be_bytes();
    let path = folder("nominal_exif").join(name);
    let bytes = [&jpeg[..2], &[0xff, 0xe1], &length, &block, &jpeg[2..]].concat();
    std::fs::write(&path, bytes).expect("written");
    path.display().to_string()
}

/// A focal length of 536 px at a diagonal of 800 px is that of 29 mm on film.
#[test]
fn exif_says_the_lens() {
    let path = with_exif("phone.jpg", 29);
    let answer = &located(&[&path], &[])[0];
    assert!(answer["remarks"].to_string().contains("EXIF: 29 mm"), "{answer}");
    let known = &located(&[&photo("left01.jpg")], &["--camera", &photo("left.yml")])[0];
    let ((a, _), (b, sigma)) = (position(known), position(answer));
    assert!((0..3).all(|i| (a[i] - b[i]).abs() < 3.0 * sigma.iter().map(|s| s * s).sum::<f64>().sqrt()));
}

#[test]
fn what_is_missing_is_named() {
    let (board, image) = (photo("board.toml"), photo("left01.jpg"));
    let points = photo("../marks/marks.csv");
    let zoomed = (with_exif("wide.jpg", 29), with_exif("tele.jpg", 50));
    for (line, said) in [
        (vec!["locate", &image, "--target", &board], "names no focal length; give --camera FILE"),
        (vec!["locate", &zoomed.0, &zoomed.1, "--target", &board], "they are not of one lens"),
        (vec!["locate", &image, "--target", &board, "--hfov-deg", "1.07"], "2° to 130°"),
        (vec!["locate", &image, "--target", &board, "--focal-mm", "4"], "--sensor-width-mm"),
        (vec!["locate", &image, "--target", &board, "--hfov-deg", "-60"], "a positive number is needed"),
        (
            vec!["locate", &image, "--target", &board, "--hfov-deg", "60", "--method", "wang2004"],
            "printed procedure",
        ),
        (vec!["solve", &points], "no camera is given"),
        (vec!["solve", &points, "--hfov-deg", "60"], "--image-size-px"),
        (vec!["landmarks", &image, &image], "names no focal length"),
        (vec!["watch", "--hfov-deg", "60", "--target", &board, "--source", &image, "--once"], "has no file"),
        (
            vec!["watch", "--hfov-deg", "x", "--landmarks", &image, "--source", &image, "--once"],
            "a positive number",
        ),
        (vec!["watch", "--landmarks", &image, "--source", &image, "--once"], "names no focal length"),
    ] {
        let run = resight(&line);
        assert!(run.code == 2 && run.stderr.contains(said), "{line:?}: {} {}", run.code, run.stderr);
    }
}

/// A camera watched by landmarks alone, its lens from one number.
#[test]
fn landmarks_are_watched_without_a_camera_file() {
    let image = photo("left01.jpg");
    let run = resight(&["landmarks", &image, &image, "--hfov-deg", "60", "--json"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stderr.contains("not calibrated"), "{}", run.stderr);
    let answer = &json_lines(&run)[0];
    assert_eq!(answer["status"], "ok");
    let watched = resight(&[
        "watch",
        "--hfov-deg",
        "60",
        "--landmarks",
        &image,
        "--source",
        &image,
        "--period-s",
        "1",
        "--once",
    ]);
    assert!(
        watched.stderr.contains("not calibrated") && watched.code == 1,
        "{} {}",
        watched.code,
        watched.stderr
    );
}
