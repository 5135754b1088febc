//! A rig of simulated cameras, and a board that a hand carries in front of them.

use super::rig_support::{Chance, SIGMA_PX};
use super::support::folder;
use nalgebra::Vector6;
use resight::core::camera::Pinhole;
use resight::core::{Camera, CameraMatrix, Lens, Point, Pose};
use serde_json::{Value, json};
use std::fmt::Write;

/// Four cameras on a bar, all looking at what is a metre in front of them.
pub fn cam_from_rig() -> Vec<Pose> {
    (0..4)
        .map(|i| {
            let turn = Pose::exp(&Vector6::new(0.03 * i as f64, 0.25 * (i as f64 - 1.5), 0.1, 0.0, 0.0, 0.0));
            let x = Point::new(-0.3 * (i as f64 - 1.5), 0.02 * i as f64, 0.01);
            turn * Pose { translation: x, ..Pose::identity() }
        })
        .collect()
}

pub const NAMES: [&str; 4] = ["north", "east", "south", "west"];

pub fn lens() -> Camera {
    let matrix = CameraMatrix { fx_px: 600.0, fy_px: 600.0, cx_px: 639.5, cy_px: 399.5 };
    Camera { lens: Lens::Pinhole(Pinhole::new(matrix).expect("a lens")), size: None }
}

/// A board of 5 × 4 corners, 50 mm apart.
pub const BOARD: &str = "kind = \"chessboard\"\nrows = 4\ncolumns = 5\nsquare_m = 0.05\n";

pub fn corners() -> Vec<Point> {
    (0..20).map(|i| Point::new(0.05 * (i % 5) as f64, 0.05 * (i / 5) as f64, 0.0)).collect()
}

/// Where a hand holds the board, a little further on each time.
pub fn carried(frame_set: usize, chance: &mut Chance) -> Pose {
    let phase = 0.21 * frame_set as f64;
    let mut shake = || 0.02 * chance.normal();
    let turn = Vector6::new(
        0.4 * phase.sin() + shake(),
        0.4 * (0.7 * phase).cos() + shake(),
        shake(),
        0.0,
        0.0,
        0.0,
    );
    let place = Point::new(
        0.15 * (1.3 * phase).sin() - 0.1,
        0.1 * phase.cos() - 0.08,
        1.1 + 0.1 * (0.4 * phase).sin(),
    );
    Pose { translation: place, ..Pose::identity() } * Pose::exp(&turn)
}

/// One line of a camera; what it does not see is an empty list.
pub fn line(
    camera: &str,
    t_s: f64,
    cam_from_board: Option<&Pose>,
    first_id: usize,
    chance: &mut Chance,
) -> Value {
    let lens = lens();
    let seen = |(i, x): (usize, &Point)| {
        let pixel = lens.project(&(cam_from_board? * x))?;
        let (u, v) = (pixel.x + SIGMA_PX * chance.normal(), pixel.y + SIGMA_PX * chance.normal());
        Some(json!({"id": first_id + i, "corner": 0, "u_px": u, "v_px": v, "sigma_px": SIGMA_PX}))
    };
    let detections: Vec<Value> = corners().iter().enumerate().filter_map(seen).collect();
    json!({"camera": camera, "t_s": t_s, "detections": detections})
}

/// A hand-held board, 10 frame sets a second. `old_from_new` of each camera and whether it sees, for each frame set.
pub fn carried_lines(
    cameras: usize,
    frame_sets: usize,
    seed: u64,
    camera: impl Fn(usize, usize) -> Option<Vector6<f64>>,
) -> String {
    let mut chance = Chance(seed);
    let mut text = String::new();
    for frame_set in 0..frame_sets {
        let rig_from_board = carried(frame_set, &mut chance);
        for (i, place) in cam_from_rig().iter().enumerate().take(cameras) {
            let moved = camera(i, frame_set);
            let pose = moved.map(|moved| Pose::exp(&moved).inverse() * *place * rig_from_board);
            let t_s = 0.1 * frame_set as f64 + 0.003 * i as f64;
            writeln!(text, "{}", line(NAMES[i], t_s, pose.as_ref(), 0, &mut chance)).expect("text");
        }
    }
    text
}

/// Board and rig as files. With a covariance the rig's places are what the cameras are compared with.
pub fn rig_arguments(name: &str, cameras: usize, is_certain: bool) -> Vec<String> {
    let folder = folder(name);
    let mut rig = String::new();
    for (name, place) in NAMES.iter().zip(cam_from_rig()).take(cameras) {
        let (q, t) = (place.quaternion_wxyz(), place.translation);
        let rows = (0..6).map(|i| (0..6).map(|j| if i == j { 1e-7 } else { 0.0 }).collect::<Vec<_>>());
        let covariance = match is_certain {
            true => format!(", covariance = {:?}", rows.collect::<Vec<_>>()),
            false => String::new(),
        };
        let placement = format!(
            "{{ b = \"{name}\", a = \"rig\", rotation_wxyz = {q:?}, translation_m = [{}, {}, {}]{covariance} }}",
            t.x, t.y, t.z
        );
        writeln!(
            rig,
            "[[camera]]\nname = \"{name}\"\nmodel = \"pinhole\"\nwidth_px = 1280\nheight_px = 800\nfx_px = 600.0\nfy_px = 600.0\ncx_px = 639.5\ncy_px = 399.5\nplacement = {placement}\n"
        )
        .expect("text");
    }
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("written");
        path.display().to_string()
    };
    let (board, rig) = (file("board.toml", BOARD), file("rig.toml", &rig));
    let moving = ["--moving-target", "--learn", "40"].map(String::from);
    [vec!["--rig".into(), rig, "--target".into(), format!("board={board}")], moving.to_vec()].concat()
}

pub fn turned(axis: usize, degrees: f64) -> Vector6<f64> {
    Vector6::ith(axis, degrees.to_radians())
}
