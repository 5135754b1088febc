//! A real room of eleven cameras, from 38 pairwise calibrations that were published with the chain they led to.

use crate::real_support::{apart, json, largest, median};
use crate::recorded::recorded;
use nalgebra::{Matrix3, Vector3};
use resight::core::multiview::pose_graph::{PoseGraph, PoseGraphConfig, chain, solve_pose_graph};
use resight::core::{Pose, Vector6};
use resight::rig::pairs::{PairFile, read_pairs};
use serde_json::Value;
use std::path::Path;

fn numbers(text: &Value) -> Vec<f64> {
    let text = text.as_str().unwrap().replace(['[', ']'], " ");
    text.split_whitespace().map(|x| x.parse().unwrap()).collect()
}

/// The published places, in the order of the cameras.
fn published(path: &Path, cameras: &[String]) -> Vec<Pose> {
    let file = json(path);
    let pose = |name: &String| {
        let (r, t) = (numbers(&file[name]["rotation"]), numbers(&file[name]["translation"]));
        Pose::new(Matrix3::from_row_slice(&r), Vector3::from_row_slice(&t))
    };
    cameras.iter().map(pose).collect()
}

fn room() -> (PairFile, Vec<Pose>, usize) {
    let folder = recorded("caliscope_pose_graph");
    let file = read_pairs(folder.join("main_stereocal_all_results.json")).unwrap();
    assert_eq!((file.cameras.len(), file.pairs.len()), (11, 38));
    let places = published(&folder.join("main_initial_camera_array.json"), &file.cameras);
    let reference_camera = file.cameras.iter().position(|name| name == "8").unwrap();
    (file, places, reference_camera)
}

/// Eight printed decimals: 1e-8 rad is 6e-7°, 1e-8 m is 1e-5 mm.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn the_published_chain_is_reproduced() {
    let (file, places, reference_camera) = room();
    let graph = PoseGraph { n_cameras: file.cameras.len(), pairs: &file.pairs };
    let found = chain(&graph, reference_camera).unwrap();
    let off: Vec<(f64, f64)> =
        found.cameras.iter().zip(&places).map(|(camera, place)| apart(&camera.cam_from_rig, place)).collect();
    let (deg, mm) = (largest(off.iter().map(|o| o.0)), largest(off.iter().map(|o| o.1)));
    println!("chain from camera 8: within {deg:.1e}° and {mm:.1e} mm of the published one");
    assert!(deg < 1e-4 && mm < 1e-3, "{deg} {mm}");
}

/// Around each triangle of cameras the joint poses come back to where they began; the pairs themselves do not.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn every_triangle_of_the_joint_answer_closes() {
    let (file, _, reference_camera) = room();
    let graph = PoseGraph { n_cameras: file.cameras.len(), pairs: &file.pairs };
    let found = solve_pose_graph(&graph, &PoseGraphConfig { reference_camera, median_sigma: None }).unwrap();
    let stated = |a: usize, b: usize| {
        let pair = file.pairs.iter().find(|p| (p.a, p.b) == (a, b) || (p.a, p.b) == (b, a))?;
        Some(if pair.a == a { pair.b_from_a } else { pair.b_from_a.inverse() })
    };
    let solved = |a: usize, b: usize| found.b_from_a(a, b).unwrap().0;
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for (i, j, k) in (0..11).flat_map(|i| (i + 1..11).flat_map(move |j| (j + 1..11).map(move |k| (i, j, k))))
    {
        let (Some(ij), Some(jk), Some(ki)) = (stated(i, j), stated(j, k), stated(k, i)) else { continue };
        before.push((ki * jk * ij).log());
        after.push((solved(k, i) * solved(j, k) * solved(i, j)).log());
    }
    assert_eq!(after.len(), 78);
    let turn = |xi: &Vector6| xi.fixed_rows::<3>(0).norm().to_degrees();
    println!("78 triangles: median {:.3}° before", median(before.iter().map(turn).collect()));
    assert!((median(before.iter().map(turn).collect()) - 0.340).abs() < 0.02);
    let worst = largest(after.iter().map(|xi| xi.amax()));
    println!("after: {worst:.1e}");
    assert!(worst < 1e-9, "{worst}");
}

/// The pairs' own agreement gives the sigmas, and the answer does not hang on the reference camera as the chain does (up to 1.17° and 36 mm).
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn the_joint_answer_has_one_shape_whatever_the_anchor() {
    let (file, _, reference_camera) = room();
    let graph = PoseGraph { n_cameras: file.cameras.len(), pairs: &file.pairs };
    let solve = |reference_camera| {
        solve_pose_graph(&graph, &PoseGraphConfig { reference_camera, median_sigma: None }).unwrap()
    };
    let found = solve(reference_camera);
    let sigma = found.median_sigma.unwrap();
    println!(
        "sigma of a median pair {:.4}° {:.2} mm, {} degrees of freedom, {} suspicious",
        sigma.sigma_rad.to_degrees(),
        1e3 * sigma.sigma_m,
        found.degrees_of_freedom,
        found.pairs.iter().filter(|pair| pair.is_suspicious).count()
    );
    for (pair, result) in file.pairs.iter().zip(&found.pairs) {
        let (turn, shift) =
            (result.residual.fixed_rows::<3>(0).norm(), result.residual.fixed_rows::<3>(3).norm());
        println!(
            "{:>2}-{:<2} {:.3}° {:5.1} mm  {:.2?} {}",
            file.cameras[pair.a],
            file.cameras[pair.b],
            turn.to_degrees(),
            1e3 * shift,
            result.disagreement_sigma,
            if result.is_suspicious { "suspicious" } else { "" }
        );
    }
    for other in [0, 5, 10] {
        let second = solve(other);
        let named = |s: &resight::core::multiview::pose_graph::PoseGraphSolution| {
            s.pairs.iter().map(|pair| pair.is_suspicious).collect::<Vec<_>>()
        };
        assert_eq!(named(&found), named(&second));
        for a in 0..11 {
            for b in 0..11 {
                let (deg, mm) = apart(&found.b_from_a(a, b).unwrap().0, &second.b_from_a(a, b).unwrap().0);
                // The loop ends 3·10⁻⁴ standard deviations or nearer to the minimum: microradians and micrometres.
                assert!(deg < 1e-4 && mm < 1e-2, "{a} {b} {deg} {mm}");
            }
        }
    }
}
