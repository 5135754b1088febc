//! What an image costs: the target near its place, and the whole image, least of many rounds.

use crate::cameras::RATE_HZ;
use crate::live_support::{camera, film, map, tag, tag_pose, trembling};
use nalgebra::Vector6;
use resight::GrayImage;
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
    println!("\nboards in an image of 1280 × 960, mean of {BOARD_ROUNDS} rounds");
    (0..=crate::boards::TAKEN).for_each(board_row);
}

/// A board that trembles in its place, looked for near it and in the whole image, and images without it: what a camera costs that follows its board,
/// and one that has lost it. Means of the time of this thread's processor, for the searches of a lost board differ from frame to frame.
fn board_row(i: usize) {
    let target = crate::boards::target(i);
    let poses: Vec<Pose> = crate::boards::poses(i, &target).into_iter().take(PICTURES).collect();
    let pictures = film(&target, &poses, 500);
    let gone = film(&target, &[Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, -5.0))], 700);
    let mut follower = Follower::new(&target).expect("a follower");
    let mut detector = Detector::new(&target).expect("a detector");
    let mut time_s = 0.0;
    let mut follow = |picture: &GrayImage| {
        time_s += 1.0 / RATE_HZ;
        let found = follower.detect(picture, &camera(), time_s, &[]).expect("an answer");
        !found.is_empty()
    };
    assert!(follow(&pictures[0]));
    let near = mean_ms(&pictures, |picture| assert!(follow(picture)));
    // The half second after it was lost.
    let lost_frames: Vec<&GrayImage> = std::iter::repeat_n(&gone[0], BOARD_ROUNDS / 2).collect();
    let lost: Vec<f64> = lost_frames
        .iter()
        .map(|picture| {
            let started = Instant::now();
            assert!(!follow(picture));
            started.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    let whole = mean_ms(&pictures, |picture| assert!(!detector.detect(picture).expect("found").is_empty()));
    let nothing = mean_ms(&gone, |picture| assert!(detector.detect(picture).expect("found").is_empty()));
    let mean_lost = lost.iter().sum::<f64>() / lost.len() as f64;
    let longest = lost.iter().copied().fold(0.0, f64::max);
    println!(
        "  {:<12} near {near:6.2} ms   whole {whole:6.2} ms   whole without it {nothing:6.2} ms   lost, a frame {mean_lost:6.2} ms, longest {longest:6.2} ms",
        target.kind()
    );
}

const BOARD_ROUNDS: usize = 30;

fn mean_ms(pictures: &[GrayImage], mut look: impl FnMut(&GrayImage)) -> f64 {
    let mut all = 0.0;
    for i in 0..BOARD_ROUNDS {
        let started = Instant::now();
        look(&pictures[i % pictures.len()]);
        all += started.elapsed().as_secs_f64() * 1e3;
    }
    all / BOARD_ROUNDS as f64
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
