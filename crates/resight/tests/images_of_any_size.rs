//! Images of every size, shape and content before every detector: an answer or an error, in time, and never the end of the program.
//!
//! The AprilTag library ends the program where an edge has 32,768 px or more. `RESIGHT_FUZZ_SECONDS` draws for longer.

use crate::detect_support::*;
use resight::GrayImage;
use resight::core::correspondence::Detection;
use resight::core::target::{AprilGrid, Charuco, Chessboard, LinePlusOne, Tag};
use resight::core::{Camera, Pixel, Target};
use resight::detect::Detector;
use resight::detect::follow::Follower;
use std::time::{Duration, Instant};

fn targets() -> Vec<Target> {
    let family = "tag36h11".to_string();
    vec![
        Target::Tag(Tag { family: family.clone(), id: 1, size_m: 0.1 }),
        Target::AprilGrid(AprilGrid {
            family,
            rows: 3,
            columns: 4,
            tag_size_m: 0.08,
            tag_spacing_ratio: 0.3,
            first_id: 0,
        }),
        Target::Charuco(Charuco {
            rows: 5,
            columns: 4,
            square_m: 0.04,
            marker_m: 0.03,
            dictionary: "DICT_4X4_50".to_string(),
            legacy_pattern: false,
        }),
        Target::Chessboard(Chessboard { rows: 4, columns: 5, square_m: 0.03 }),
        Target::LinePlusOne(LinePlusOne { line_m: [0.0, 0.1, 0.15], off_m: [0.0, 0.15] }),
    ]
}

/// Contents that drive thresholds, outlines and corners to their ends.
fn picture(width_px: u32, height_px: u32, content: u32, mut state: u64) -> GrayImage {
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    let (step, dark, light) = (1 + u32::from(noise()) % 16, noise() / 2, 128 + noise() / 2);
    let mut data = Vec::with_capacity(width_px as usize * height_px as usize);
    for v in 0..height_px {
        for u in 0..width_px {
            let is_light = match content % 6 {
                0 => false,
                1 => noise() & 1 == 1,
                2 => (u / step + v / step) % 2 == 1,
                3 => (u / step) % 2 == 1,
                4 => (v / step) % 2 == 1,
                _ => (u / step).wrapping_mul(73_856_093) ^ (v / step).wrapping_mul(19_349_663) & 4 == 4,
            };
            data.push(if is_light { light } else { dark });
        }
    }
    GrayImage { width_px, height_px, data }
}

fn setting(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

/// The sizes that aborted the program, and their neighbours.
#[test]
fn long_edges_do_not_end_the_program() {
    for target in targets() {
        let mut detector = Detector::new(&target).expect("a detector");
        for [width, height] in [[64, 32_768], [32_768, 64], [65_535, 36]] {
            for content in [0, 3] {
                let found = detector.detect(&picture(width, height, content, 7));
                assert!(found.is_ok(), "{} {width} × {height}: {found:?}", target.kind());
            }
        }
    }
}

/// A tag in an image longer than the library takes is found, and where it is: at a border of two tiles too.
#[test]
fn a_tag_is_found_anywhere_in_a_long_picture() {
    let view = View::new(Pixel::new(161.3, 118.8), 90.0, 75.0, 25.0);
    let small = photograph(320, 240, &view, lone_marker("tag36h11", 1));
    let target = Target::Tag(Tag { family: "tag36h11".into(), id: 1, size_m: 1.0 });
    let mut detector = Detector::new(&target).expect("a detector");
    let near = detector.detect(&small).expect("an answer");
    assert_eq!(near.len(), 4);
    for top in (0..8).map(|i| 8 * (i * 620 + 13)).chain([33_000, 39_000]) {
        let mut long = GrayImage::filled(320, 40_000, 128);
        let at = top as usize * 320;
        long.data[at..at + small.data.len()].copy_from_slice(&small.data);
        let found = detector.detect(&long).expect("an answer");
        assert_eq!(found.len(), 4, "at row {top}");
        for (a, b) in found.iter().zip(&near) {
            let off = a.pixel - b.pixel - Pixel::new(0.0, top as f64);
            assert!(off.norm() < 0.05, "at row {top}: {off}");
        }
    }
}

#[test]
fn every_size_and_content_is_answered_in_time() {
    let (seconds, seed) = (setting("RESIGHT_FUZZ_SECONDS", 8), setting("RESIGHT_FUZZ_SEED", 9));
    let mut detectors: Vec<Detector> =
        targets().iter().map(|t| Detector::new(t).expect("a detector")).collect();
    let camera = Camera::normalized();
    let mut followers: Vec<Follower> =
        targets().iter().map(|t| Follower::new(t).expect("a follower")).collect();
    let (began, mut count, mut slowest) = (Instant::now(), 0u64, Duration::ZERO);
    let mut state = seed;
    let mut draw = |n: u32| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % u64::from(n)) as u32
    };
    while began.elapsed().as_secs() < seconds {
        let most = if draw(3) == 0 { 300 } else { 80 };
        let short = 1 + draw(most);
        let long = if draw(12) == 0 { 1 + draw(40_000) } else { 1 + draw(300) };
        let [width, height] = if draw(2) == 0 { [short, long] } else { [long, short] };
        let image = picture(width, height, draw(6), u64::from(draw(u32::MAX)));
        for (detector, follower) in detectors.iter_mut().zip(&mut followers) {
            let call = Instant::now();
            let found = detector.detect(&image).unwrap_or_default();
            let finite = |d: &Detection| {
                d.pixel.iter().all(|x| x.is_finite()) && 0.0 < d.sigma_px && d.sigma_px.is_finite()
            };
            assert!(found.iter().all(finite), "seed {seed}, image {count} of {width} × {height}: {found:?}");
            let _ = follower.detect(&image, &camera, count as f64 / 30.0, &[]);
            let took = call.elapsed();
            assert!(
                took < Duration::from_secs(20),
                "seed {seed}, image {count}, {width} × {height}: {took:?}"
            );
            slowest = slowest.max(took);
        }
        count += 1;
    }
    println!("{count} images before 5 detectors and 5 followers, the slowest {slowest:?}, seed {seed}");
}
