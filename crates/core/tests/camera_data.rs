//! Real calibrations, real corners: our bearings against the undistorted coordinates OpenCV computed for the same pixels.
//!
//! Reads `aprilgrid_tumvi_euroc` in the folder named by RESIGHT_DATA.

use crate::recorded::recorded;
use nalgebra::{Vector2, Vector3};
use resight_core::camera::*;

/// The numbers of `"section": { … "key": [ … ] }`.
fn numbers(json: &str, section: &str, key: &str) -> Vec<f64> {
    let after_section = json.split_once(&format!("\"{section}\"")).expect(section).1;
    let after_key = after_section.split_once(&format!("\"{key}\": [")).expect(key).1;
    after_key.split_once(']').expect("]").0.split(',').map(|n| n.trim().parse().unwrap()).collect()
}

fn matrix(json: &str, section: &str) -> CameraMatrix {
    let v = numbers(json, section, "fx_fy_cx_cy");
    CameraMatrix { fx_px: v[0], fy_px: v[1], cx_px: v[2], cy_px: v[3] }
}

/// The fisheye coordinates agree to rounding (8e-16). The others come from OpenCV's fixed-point iteration, which stops 5e-7
/// short; ours project back to the pixel to 1e-9 px.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn bearings_match_the_undistorted_corners() {
    let folder = recorded("aprilgrid_tumvi_euroc");
    let json = std::fs::read_to_string(folder.join("truth.json")).unwrap();
    let (fisheye, radtan) = ("tum_vi_cam0_kb4_1024", "euroc_cam0_radtan");
    let tum_vi = KannalaBrandt::new(matrix(&json, fisheye), &numbers(&json, fisheye, "k1k2k3k4")).unwrap();
    let euroc = BrownConrady::new(matrix(&json, radtan), &numbers(&json, radtan, "k1k2p1p2")).unwrap();
    let tum_vi = Camera::new(tum_vi, Some(ImageSize { width_px: 1024, height_px: 1024 })).unwrap();
    let euroc = Camera::new(euroc, Some(ImageSize { width_px: 752, height_px: 480 })).unwrap();

    let table = std::fs::read_to_string(folder.join("four_point.csv")).unwrap();
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).expect(name);
    let mut checked = 0;
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        let is_fisheye = fields[column("camera")].starts_with("tumvi");
        let (camera, bound) = if is_fisheye { (&tum_vi, 1e-14) } else { (&euroc, 1e-6) };
        for i in 1..=4 {
            let at = |name: &str| fields[column(&format!("{name}{i}"))].parse::<f64>().unwrap();
            let pixel = Vector2::new(at("u"), at("v"));
            let bearing = camera.bearing(&pixel).unwrap();
            let ours = bearing.xy() / bearing.z;
            let miss = (ours - Vector2::new(at("xn"), at("yn"))).norm();
            assert!(miss < bound, "{miss:e}: {line}");
            assert!((camera.project(&Vector3::from(*bearing)).unwrap() - pixel).norm() <= 1e-9);
            checked += 1;
        }
    }
    assert!(100 < checked, "{checked} corners");
}
