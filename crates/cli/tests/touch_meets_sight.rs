//! A whisker's contacts and their pixels, solved by the program: cam_from_hub, as exact as it says.

use crate::example::{Chance, HEADER, cam_from_hub, points_csv, simulated, wire};
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use resight_core::statistics::SplitMix64;
use serde_json::Value;
use std::path::Path;

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(rows) => rows.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

/// The small motion [rotation; translation], on the left, from the answer to the truth, and its covariance.
fn miss(view: &Value, truth: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
    let got = numbers(&view["cam_from_target"]["matrix"]);
    let rotation = |m: &[f64]| Matrix3::from_fn(|i, j| m[4 * i + j]);
    let place = |m: &[f64]| Vector3::new(m[3], m[7], m[11]);
    let turn = rotation(truth) * rotation(&got).transpose();
    let angle = Rotation3::from_matrix_unchecked(turn).scaled_axis();
    let shift = place(truth) - turn * place(&got);
    let motion = DVector::from_iterator(6, angle.iter().chain(shift.iter()).copied());
    (motion, DMatrix::from_row_slice(6, 6, &numbers(&view["covariance"])))
}

/// The shipped touches: within 3 of its own sigma of the truth, and the touch of two objects left out.
#[test]
fn the_shipped_touches_give_the_camera() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/whisker/touch_meets_sight");
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(root.join("truth.json")).unwrap()).unwrap();
    let (rod, cell, touches) = crate::example::read_folder(&root).unwrap();
    let points = points_csv("touch", &rod, &cell, &touches).unwrap();
    assert_eq!(points.lines().filter(|line| line.ends_with("left out: OutOfPlane")).count(), 1, "{points}");
    let file = crate::support::folder("touch_meets_sight").join("points.csv");
    std::fs::write(&file, format!("{HEADER}{points}")).unwrap();
    let camera = root.join("camera.toml");
    let arguments = [
        "solve",
        file.to_str().unwrap(),
        "--camera",
        camera.to_str().unwrap(),
        "--sigma-px",
        "0.3",
        "--json",
    ];
    let run = crate::support::resight(&arguments);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let view = &crate::support::json_lines(&run)[0];
    assert_eq!(view["status"], "ok");
    assert_eq!(view["n_points"], 23);
    let (motion, covariance) = miss(view, &numbers(&truth["cam_from_hub"]["matrix"]));
    for i in 0..6 {
        let sigma = covariance[(i, i)].sqrt();
        assert!(motion[i].abs() < 3.0 * sigma, "component {i}: {} with sigma {sigma}", motion[i]);
    }
    // And sigmas worth having: half a centimetre and one degree would be no calibration.
    assert!(covariance[(3, 3)].sqrt() < 2e-3 && covariance[(0, 0)].sqrt() < 5e-3);
}

/// 200 simulated calibrations, a view each: the covariance of the program is that of its errors, though the file has one sigma for
/// the three axes of a contact that is less certain along the whisker than across.
#[test]
fn two_hundred_calibrations_are_as_exact_as_they_say() {
    let (rod, cell) = wire();
    let mut text = HEADER.to_string();
    let mut chance = Chance(SplitMix64::new(7));
    for view in 0..200 {
        let touches = simulated(&mut chance);
        text += &points_csv(&view.to_string(), &rod, &cell, &touches).unwrap();
    }
    let file = crate::support::folder("touch_meets_sight_200").join("points.csv");
    std::fs::write(&file, text).unwrap();
    let camera =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/whisker/touch_meets_sight/camera.toml");
    let arguments = [
        "solve",
        file.to_str().unwrap(),
        "--camera",
        camera.to_str().unwrap(),
        "--sigma-px",
        "0.3",
        "--json",
    ];
    let run = crate::support::resight(&arguments);
    let truth: Vec<f64> = cam_from_hub().matrix().as_flattened().to_vec();
    let mut nees = Vec::new();
    for view in crate::support::json_lines(&run) {
        assert_eq!(view["status"], "ok", "{view}");
        let (motion, covariance) = miss(&view, &truth);
        nees.push(motion.dot(&(covariance.try_inverse().unwrap() * &motion)));
    }
    assert_eq!(nees.len(), 200);
    let mean = nees.iter().sum::<f64>() / 200.0;
    println!("NEES {mean:.2} of 6");
    // Mean of 200 χ² of 6 degrees of freedom: 6 ± 0.25.
    assert!((mean - 6.0).abs() < 1.5, "NEES {mean}");
}
