//! What an image costs: the target near its place, and the whole image, least of many rounds.

use crate::cameras::RATE_HZ;
use crate::live_support::{camera, film, map, tag, tag_pose, trembling};
use nalgebra::Vector6;
use resight::core::{Pose, Target};
use resight::detect::Detector;
use resight::detect::follow::{Extent, Follower};
use std::time::Instant;

const ROUNDS: usize = 240;
const PICTURES: usize = 6;

pub fn run() {
    println!("\none image of 1280 × 960, least of {ROUNDS} rounds");
    for edge_px in [25.0, 40.0, 80.0, 160.0, 320.0] {
        row(&format!("tag of {edge_px} px"), &tag(), tag_pose(edge_px, 150.0, -80.0));
    }
    let wall = Pose::exp(&Vector6::new(0.25, -0.3, 0.1, 0.05, 0.0, 2.2));
    row("12 tags on a wall", &map(), wall);
}

fn row(name: &str, target: &Target, cam_from_target: Pose) {
    let pictures = film(target, &trembling(cam_from_target, PICTURES), 500);
    let mut follower = Follower::new(target).expect("a follower");
    let mut detector = Detector::new(target).expect("a detector");
    let (mut near_ms, mut besides_ms, mut whole_ms) = (f64::INFINITY, 0.0f64, f64::INFINITY);
    for i in 0..ROUNDS {
        let picture = &pictures[i % PICTURES];
        let started = Instant::now();
        let found = follower.detect(picture, &camera(), i as f64 / RATE_HZ, &[]).expect("found");
        let ms = started.elapsed().as_secs_f64() * 1e3;
        assert!(!found.is_empty(), "{name}, round {i}");
        if follower.extent() == Extent::Near {
            near_ms = near_ms.min(ms);
            besides_ms += ms / ROUNDS as f64;
        }
        if i % 8 == 0 {
            let started = Instant::now();
            assert!(!detector.detect(picture).expect("found").is_empty(), "{name}, round {i}");
            whole_ms = whole_ms.min(started.elapsed().as_secs_f64() * 1e3);
        }
    }
    println!("  {name:<20} near {near_ms:6.2} ms (mean {besides_ms:6.2})   whole {whole_ms:6.2} ms");
}
