//! The size of a motion in rendered JPEG films. Left out: other targets, qualities and sizes, which `cargo run --release -p resight-watch
//! --example watch_images` makes a table of.

use crate::film_support::{Film, kind, nees, tag, watch};
use nalgebra::Vector6;

/// χ² of six numbers that one in a thousand exceeds.
const RARE: f64 = 22.5;
const RUNS: u64 = 4;

/// A rotation of a third of a degree, 4 px: named as one, at the alarm and at the end, with the error that it has.
#[test]
fn a_rotation_in_a_jpeg_film_is_told_as_one() {
    let mut sums = [0.0; 2];
    for seed in 0..RUNS {
        let axis = Vector6::ith(seed as usize % 3, f64::to_radians(0.3));
        let film = Film {
            target: tag(),
            jpeg: Some(75),
            noise_grey: 2.0,
            blur_px: 0.7,
            old_from_new: axis,
            readings_before: 70,
            readings_after: 40,
            seed,
        };
        let told = watch(&film);
        let drifts = told.drifts.expect("an alarm");
        assert!(told.false_alarms == 0 && told.delay <= 4, "{seed}: after {}", told.delay);
        for (sum, drift) in sums.iter_mut().zip(&drifts) {
            assert_eq!(kind(drift), "rotated", "{seed}: {drift:?}");
            let nees = nees(drift, &axis);
            assert!(nees < RARE, "{seed}: {nees}");
            *sum += nees / RUNS as f64;
        }
    }
    println!("NEES {sums:?}");
    // Of four runs the mean of six numbers scatters by 1.7; far fewer would say that the stated error is too large.
    assert!(sums.iter().all(|mean| 1.5 < *mean), "{sums:?}");
}
