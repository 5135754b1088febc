//! The four cameras: a tag of middle size, a small one, a wall of twelve, and one that moves suddenly four times a second.

use crate::live_support::{Pace, Replay, film, map, tag, tag_pose, trembling, watched};
use nalgebra::Vector6;
use resight::GrayImage;
use resight::core::{Pose, Target};
use resight_watch::live::LiveCamera;
use std::sync::Arc;

pub const RATE_HZ: f64 = 30.0;
pub const CAMERAS: usize = 4;
/// Images drawn for each camera, shown over and over.
const PICTURES: usize = 16;

pub fn target(camera: usize) -> Target {
    if camera == 2 { map() } else { tag() }
}

pub fn pictures(camera: usize) -> Arc<Vec<GrayImage>> {
    let stays = |edge_px, u_px, v_px| trembling(tag_pose(edge_px, u_px, v_px), PICTURES);
    let poses = match camera {
        0 => stays(120.0, 150.0, -80.0),
        1 => stays(40.0, -320.0, 210.0),
        2 => trembling(Pose::exp(&Vector6::new(0.25, -0.3, 0.1, 0.05, 0.0, 2.2)), PICTURES),
        _ => {
            let mut poses = stays(90.0, -250.0, 100.0);
            poses[PICTURES / 2..].copy_from_slice(&stays(90.0, 270.0, -150.0)[PICTURES / 2..]);
            poses
        }
    };
    film(&target(camera), &poses, 1000 * camera as u64)
}

pub fn from_memory(seconds: f64) -> Vec<LiveCamera> {
    let n_frames = (seconds * RATE_HZ) as u64;
    let camera = |i: usize| watched(&target(i), Replay::new(&pictures(i), Pace::Live, RATE_HZ, n_frames));
    (0..CAMERAS).map(camera).collect()
}
