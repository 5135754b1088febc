//! Parts of real recordings against each other: two halves of the same views must differ by what their covariances say. Needs the folder
//! named by RESIGHT_DATA.

use crate::common::recordings::{Recording, chessboard, webcams};
use crate::common::{Rng, rooms};
use crate::recorded::recorded;
use resight_core::Matrix6;
use resight_core::multiview::rig::{RigConfig, RigSolution};

/// Squared differences of all pairs of parts and cameras in units of their covariances, as stated and by the inverse information
/// times χ² per degree of freedom.
fn differences(
    recording: &Recording,
    reference: usize,
    part_of: &[usize],
    n_parts: usize,
) -> Vec<(f64, f64)> {
    let solve = |shared_errors: bool| -> Vec<RigSolution> {
        let config = RigConfig { reference, shared_errors, ..RigConfig::default() };
        let part = |p: usize| recording.part(|v| part_of[v] == p).solve(&config).expect("a rig");
        (0..n_parts).map(part).collect()
    };
    let (parts, without) = (solve(true), solve(false));
    let mut all = Vec::new();
    for (i, a) in parts.iter().enumerate() {
        for (j, b) in parts[..i].iter().enumerate() {
            for c in (0..recording.cameras.len()).filter(|c| *c != reference) {
                let (p, q) = (&a.cameras[c], &b.cameras[c]);
                let apart = (p.cam_from_rig * q.cam_from_rig.inverse()).log();
                let stated: Matrix6 = p.covariance + q.covariance;
                let old = without[i].cameras[c].covariance + without[j].cameras[c].covariance;
                all.push((rooms::nees(&apart, &stated), rooms::nees(&apart, &old)));
            }
        }
    }
    all
}

fn mean(all: &[(f64, f64)]) -> (f64, f64, f64) {
    let n = all.len() as f64;
    let sum = all.iter().fold((0.0, 0.0, 0.0f64), |s, d| (s.0 + d.0, s.1 + d.1, s.2.max(d.0)));
    (sum.0 / n, sum.1 / n, sum.2)
}

fn show(recording: &Recording, which: &str, all: &[(f64, f64)]) -> f64 {
    let (stated, old, largest) = mean(all);
    println!(
        "{:>10}, {which:<28} NEES {stated:5.2} (largest {largest:4.1}), by the old formula {old:5.1}, {} differences",
        recording.name,
        all.len()
    );
    stated
}

/// Interleaved halves and thirds, and parts drawn at random, with every camera as the reference.
fn check(recording: &Recording) {
    let n = recording.n_views;
    let references = 0..if recording.cameras.len() == 2 { 1 } else { recording.cameras.len() };
    for (which, k) in [("interleaved halves", 2), ("interleaved thirds", 3)] {
        let part_of: Vec<usize> = (0..n).map(|v| v % k).collect();
        let all: Vec<_> = references.clone().flat_map(|r| differences(recording, r, &part_of, k)).collect();
        let mean = show(recording, which, &all);
        // One difference alone scatters as χ² with six degrees of freedom: its 99 % quantile.
        let bar = if all.len() == 1 { 0.0..16.81 } else { 4.0..9.0 };
        assert!(bar.contains(&mean), "{}, {which}: {mean}", recording.name);
    }
    for (which, k) in [("halves drawn at random", 2), ("thirds drawn at random", 3)] {
        let mut rng = Rng::new(77);
        let mut all = Vec::new();
        for _ in 0..12 {
            let mut order: Vec<usize> = (0..n).collect();
            (1..n).rev().for_each(|i| order.swap(i, rng.index(i + 1)));
            let mut part_of = vec![0; n];
            order.iter().enumerate().for_each(|(i, v)| part_of[*v] = i % k);
            all.extend(differences(recording, 0, &part_of, k));
        }
        let mean = show(recording, which, &all);
        assert!((4.0..9.0).contains(&mean), "{}, {which}: {mean}", recording.name);
    }
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn parts_of_the_webcams_differ_by_what_is_stated() {
    let root = recorded("");
    check(&webcams(&root));
}

/// At the default of 0.5 px, three times what these corners show, and at 0.2 px, about what they show.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn parts_of_the_chessboard_differ_by_what_is_stated() {
    let root = recorded("");
    for sigma_px in [0.5, 0.2] {
        println!("stated {sigma_px} px");
        check(&chessboard(&root, sigma_px));
    }
}
