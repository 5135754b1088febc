//! Recorded image series, watched at default settings: quiet as they are, and a camera that turns amid them is found and named. Boards in a
//! hand before the same four cameras: resight-cli `watch_rig_real`. Needs the folder named by RESIGHT_FRAMES.

use crate::landmarks_support::{camera, photographed, turned};
use crate::recorded::frames;
use nalgebra::Matrix3;
use resight::GrayImage;
use resight::core::Camera;
use resight_watch::live::{CameraWatcher, LiveCamera, LiveConfig, State, WatchedLandmarks};
use resight_watch::source::pictures::{Clock, ImageFiles};
use resight_watch::source::{Content, Frame};

/// Frames a second.
const RATE_HZ: f64 = 6.0;
/// Frames before a step, and those within which it must be found.
const QUIET: usize = 8;
const WITHIN: usize = 8;

fn look(lens: &Camera) -> CameraWatcher {
    let watched = LiveCamera {
        name: "webcam".to_string(),
        camera: lens.clone(),
        targets: Vec::new(),
        intrinsics: None,
        landmarks: Some(WatchedLandmarks { reference_image: None }),
        source: Box::new(ImageFiles::new(Vec::new(), Clock::Every(1.0 / RATE_HZ))),
    };
    CameraWatcher::new(&watched, &LiveConfig::default()).expect("a session")
}

/// The state after each image, the camera turned from frame `QUIET` on.
fn states(lens: &Camera, images: &[GrayImage], degrees: [f64; 3]) -> Vec<State> {
    let mut look = look(lens);
    let state = |(i, image): (usize, &GrayImage)| {
        let turn = if i < QUIET { Matrix3::identity() } else { turned(degrees) };
        let grey = photographed(image, lens, &turn);
        let data = grey.iter().map(|grey| grey.round().clamp(0.0, 255.0) as u8).collect();
        let size = lens.size.expect("a size");
        let seen = GrayImage { width_px: size.width_px, height_px: size.height_px, data };
        let content = Content::Image(seen);
        let frame = Frame { number: i as u64, capture_s: i as f64 / RATE_HZ, name: i.to_string(), content };
        look.take(&frame, 0.0).remove(0).state
    };
    images.iter().enumerate().map(state).collect()
}

/// Somebody waves a board before four webcams that stand still. All four series, each image of them, and the sizes of the steps with
/// RESIGHT_SERIES set: it takes a minute; else the first images of one, and that each step is found.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn each_series_is_quiet_and_each_step_is_found_and_named() {
    let is_whole = std::env::var_os("RESIGHT_SERIES").is_some();
    let mut failed = Vec::new();
    for (series, name) in ["cam_0", "cam_1", "cam_2", "cam_3"].into_iter().enumerate() {
        if 0 < series && !is_whole {
            break;
        }
        let mut paths = frames(name);
        if !is_whole {
            paths.truncate(QUIET + WITHIN);
        }
        let images: Vec<GrayImage> =
            paths.iter().map(|path| GrayImage::read(path).expect("a frame")).collect();
        let (width, height) = (images[0].width_px / 2, images[0].height_px / 2);
        let lens = camera(width, height, 0.8 * f64::from(width));
        let quiet = states(&lens, &images, [0.0; 3]);
        let false_alarms = quiet.iter().filter(|state| matches!(state, State::Drifted(_))).count();
        println!("{name}: {false_alarms} of {} images said to have moved", images.len());
        if 0 < false_alarms {
            failed.push(format!("{name}: {false_alarms} false alarms"));
        }
        for (i, size) in [0.5, 1.0, 2.0, 5.0].into_iter().enumerate() {
            let (axis, sign) = ((series + i) % 2, if i % 2 == 0 { 1.0 } else { -1.0 });
            let mut degrees = [0.0; 3];
            degrees[axis] = sign * size;
            let stepped = states(&lens, &images[..QUIET + WITHIN], degrees);
            let found = stepped.iter().position(|state| matches!(state, State::Drifted(_)));
            let turn = match stepped.last() {
                Some(State::Drifted(drift)) => drift.pure_rotation().map(|(turn, _)| turn),
                _ => None,
            };
            println!("{name}, {degrees:?}°: at image {found:?} after {QUIET}, {turn:?}");
            let is_named = turn.is_some_and(|turn| {
                (0..3).all(|i| (turn[i].to_degrees() - degrees[i]).abs() < 0.05 + 0.02 * size)
            });
            if !((is_named || !is_whole) && found.is_some_and(|found| QUIET <= found)) {
                failed.push(format!("{name}, {degrees:?}°: {found:?}, {turn:?}"));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}
