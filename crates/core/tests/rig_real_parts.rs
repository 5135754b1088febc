//! Parts of real recordings against each other: two halves of the same views must differ by what their covariances say. Needs the folder
//! named by RESIGHT_DATA.

mod common;

use common::{Rng, rooms};
use resight_core::camera::BrownConrady;
use resight_core::rig::{RigConfig, RigProblem, RigSolution, Sighting, solve_rig};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Matrix6, Pixel, Point};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A recording: its cameras and what they saw, views counted from 0 in the order of time.
struct Recording {
    name: &'static str,
    cameras: Vec<Camera>,
    n_views: usize,
    sightings: Vec<Sighting>,
}

fn root() -> Option<PathBuf> {
    let root = std::env::var_os("RESIGHT_DATA").map(PathBuf::from);
    if root.is_none() {
        println!("RESIGHT_DATA is not set: real recordings are skipped");
    }
    root
}

/// All numbers of a text.
fn numbers(text: &str) -> Vec<f64> {
    let is_part = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    text.split(|c| !is_part(c)).filter_map(|word| word.parse().ok()).collect()
}

/// The numbers of the bracketed list that follows `key`.
fn list(text: &str, key: &str) -> Vec<f64> {
    let after = text.split_once(key).unwrap_or_else(|| panic!("{key} is missing")).1;
    let from = after.find('[').expect("a list");
    let mut depth = 0;
    let end = after[from..].find(|c| {
        depth += i32::from(c == '[') - i32::from(c == ']');
        depth == 0
    });
    numbers(&after[from..from + end.expect("an end")])
}

fn camera(k: &[f64], distortion: &[f64]) -> Camera {
    let matrix = CameraMatrix { fx_px: k[0], fy_px: k[4], cx_px: k[2], cy_px: k[5] };
    let lens = BrownConrady::new(matrix, distortion).expect("a lens");
    Camera { lens: Lens::BrownConrady(lens), size: None }
}

/// Rows of a table, camera and view in the given columns, x, y, z, u, v from `first` on.
fn recording(
    name: &'static str,
    file: &Path,
    cameras: Vec<Camera>,
    camera_of: impl Fn(&str) -> usize,
    columns: [usize; 3],
    sigma_px: f64,
) -> Recording {
    let text = std::fs::read_to_string(file).expect("the corners");
    let [view_at, camera_at, first] = columns;
    let mut seen: BTreeMap<(u32, usize), Vec<Correspondence>> = BTreeMap::new();
    for row in text.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let camera = camera_of(cells[camera_at]);
        // Some numbers were written with their type's name, which ends in 64, around them.
        let value = |i: usize| -> f64 {
            let cell = cells[first + i].trim_start_matches("np.float64(").trim_end_matches(')');
            cell.parse().expect("a number")
        };
        let (x, u) = (Point::new(value(0), value(1), value(2)), Pixel::new(value(3), value(4)));
        let point = Correspondence::new(&cameras[camera], x, u, sigma_px).expect("in the field");
        seen.entry((cells[view_at].parse().expect("a view"), camera)).or_default().push(point);
    }
    let mut views: Vec<u32> = seen.keys().map(|k| k.0).collect();
    views.dedup();
    let view_of = |v: u32| views.binary_search(&v).expect("a view");
    let sightings = seen
        .into_iter()
        .map(|((view, camera), seen)| Sighting { camera, view: view_of(view), target: 0, seen })
        .collect();
    Recording { name, cameras, n_views: views.len(), sightings }
}

fn chessboard(root: &Path, sigma_px: f64) -> Recording {
    let folder = root.join("opencv_stereo_chessboard");
    let truth = std::fs::read_to_string(folder.join("truth.json")).expect("the truth");
    let own = truth.split_once("\"reference_calibration_opencv5\"").expect("the lenses").1;
    let right = own.split_once("\"right\"").expect("the right camera").1;
    let cameras = [own, right].map(|text| camera(&list(text, "\"K\""), &list(text, "\"D")));
    let side = |name: &str| usize::from(name == "right");
    recording("chessboard", &folder.join("detections.csv"), cameras.into(), side, [1, 0, 5], sigma_px)
}

fn webcams(root: &Path) -> Recording {
    let folder = root.join("caliscope_4cam_charuco");
    let file = std::fs::read_to_string(folder.join("camera_array.toml")).expect("the lenses");
    let cameras = (0..4).map(|i| {
        let text = file.split_once(&format!("[cameras.{i}]")).expect("a camera").1;
        camera(&list(text, "matrix ="), &list(text, "distortions ="))
    });
    let index = |name: &str| name.parse().expect("a camera");
    recording("webcams", &folder.join("detections.csv"), cameras.collect(), index, [0, 1, 3], 0.5)
}

impl Recording {
    fn solve(
        &self,
        reference: usize,
        shared_errors: bool,
        takes: impl Fn(usize) -> bool,
    ) -> Option<RigSolution> {
        let sightings: Vec<Sighting> = self.sightings.iter().filter(|s| takes(s.view)).cloned().collect();
        let problem = RigProblem {
            cameras: &self.cameras,
            body_of_target: &[0],
            n_views: self.n_views,
            sightings: &sightings,
        };
        solve_rig(&problem, &RigConfig { reference, shared_errors, ..RigConfig::default() }).ok()
    }

    /// Squared differences of all pairs of parts and cameras in units of their covariances, as stated and by the inverse information
    /// times χ² per degree of freedom.
    fn differences(&self, reference: usize, part_of: &[usize], n_parts: usize) -> Vec<(f64, f64)> {
        let solve = |shared_errors: bool| -> Vec<RigSolution> {
            let part = |p: usize| self.solve(reference, shared_errors, |v| part_of[v] == p).expect("a rig");
            (0..n_parts).map(part).collect()
        };
        let (parts, without) = (solve(true), solve(false));
        let mut all = Vec::new();
        for (i, a) in parts.iter().enumerate() {
            for (j, b) in parts[..i].iter().enumerate() {
                for c in (0..self.cameras.len()).filter(|c| *c != reference) {
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
        let all: Vec<_> = references.clone().flat_map(|r| recording.differences(r, &part_of, k)).collect();
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
            all.extend(recording.differences(0, &part_of, k));
        }
        let mean = show(recording, which, &all);
        assert!((4.0..9.0).contains(&mean), "{}, {which}: {mean}", recording.name);
    }
}

#[test]
fn parts_of_the_webcams_differ_by_what_is_stated() {
    let Some(root) = root() else { return };
    check(&webcams(&root));
}

/// At the default of 0.5 px, three times what these corners show, and at 0.2 px, about what they show.
#[test]
fn parts_of_the_chessboard_differ_by_what_is_stated() {
    let Some(root) = root() else { return };
    for sigma_px in [0.5, 0.2] {
        println!("stated {sigma_px} px");
        check(&chessboard(&root, sigma_px));
    }
}
