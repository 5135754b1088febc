//! What an image costs: the target near its place, and the whole image, least of many rounds.

use crate::cameras::RATE_HZ;
use crate::live_support::{camera, film, map, tag, tag_pose, trembling};
use crate::process;
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
    println!("\nboards in an image of 1280 × 960, means of {BOARD_ROUNDS} rounds");
    (0..=crate::boards::TAKEN).for_each(board_row);
}

/// Images of each row of boards, and of the half second after one was lost.
const BOARD_ROUNDS: usize = 30;
const LOST_ROUNDS: usize = 15;

/// What a camera costs that follows its board, and one that has lost it: processor time of a search near the board's place, of the whole image
/// with it and without it, and of the frames of the half second after it was lost.
fn board_row(i: usize) {
    let target = crate::boards::target(i);
    let poses: Vec<Pose> = crate::boards::poses(i, &target).into_iter().take(PICTURES).collect();
    let pictures = film(&target, &poses, 500);
    let gone = film(&target, &[Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, -5.0))], 700);
    let mut follower = Follower::new(&target).expect("a follower");
    let mut detector = Detector::new(&target).expect("a detector");
    let mut number = 0;
    let mut follow = |picture: &GrayImage, is_there: bool| {
        number += 1;
        let t_s = number as f64 / RATE_HZ;
        let found = follower.detect(picture, &camera(), t_s, &[]).expect("an answer");
        assert_eq!(!found.is_empty(), is_there);
    };
    follow(&pictures[0], true);
    let near = mean_ms(BOARD_ROUNDS, &pictures, |picture| follow(picture, true));
    let lost = mean_ms(LOST_ROUNDS, &gone, |picture| follow(picture, false));
    let mut whole = |picture: &GrayImage| drop(detector.detect(picture).expect("an answer"));
    let with = mean_ms(BOARD_ROUNDS, &pictures, &mut whole);
    let without = mean_ms(BOARD_ROUNDS, &gone, &mut whole);
    println!(
        "  {:<12} near {near:6.1} ms   whole {with:6.1} ms, without it {without:6.1} ms   lost, a frame {lost:6.1} ms",
        target.kind(),
    );
}

/// Mean time of all cores, milliseconds: the search for corners of boards uses more than one.
fn mean_ms(rounds: usize, pictures: &[GrayImage], mut look: impl FnMut(&GrayImage)) -> f64 {
    let (started, before) = (Instant::now(), process::cpu_s());
    (0..rounds).for_each(|i| look(&pictures[i % pictures.len()]));
    let spent = process::cpu_s().zip(before).map(|(after, before)| after - before);
    1e3 * spent.unwrap_or(started.elapsed().as_secs_f64()) / rounds as f64
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
