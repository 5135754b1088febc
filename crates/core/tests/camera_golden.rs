//! Projections against two independent sources: OpenCV's own, and 50-digit evaluations of the papers' formulas.
//!
//! Tables and how they were made: camera_tables/*.txt, docs/math/check/camera_opencv.py and camera.py.

use nalgebra::{Vector2, Vector3};
use resight_core::camera::*;
use resight_core::{Pixel, Point};

struct Row {
    camera: Camera,
    x_in_cam: Point,
    pixel: Pixel,
    text: &'static str,
}

fn camera(model: &str, v: &[f64]) -> Camera {
    if model == "photogrammetric" {
        let parameters = PhotogrammetricParameters {
            f: v[0],
            xp: v[1],
            yp: v[2],
            k: [v[3], v[4], v[5]],
            p: [v[6], v[7]],
            a: [v[8], v[9]],
        };
        return Camera::new(Photogrammetric::new(parameters).unwrap(), None).unwrap();
    }
    let matrix = CameraMatrix { fx_px: v[0], fy_px: v[1], cx_px: v[2], cy_px: v[3] };
    let lens: Lens = match model {
        "brown_conrady" => BrownConrady::new(matrix, &v[4..]).unwrap().into(),
        "kannala_brandt" => KannalaBrandt::new(matrix, &v[4..]).unwrap().into(),
        "fov" => Fov::new(matrix, v[4]).unwrap().into(),
        "omni" => Omni::new(matrix, v[4], &v[5..]).unwrap().into(),
        "eucm" => Eucm::new(matrix, v[4], v[5]).unwrap().into(),
        "double_sphere" => DoubleSphere::new(matrix, v[4], v[5]).unwrap().into(),
        other => panic!("{other}"),
    };
    Camera::new(lens, None).unwrap()
}

fn rows(table: &'static str) -> Vec<Row> {
    table
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|text| {
            let mut parts = text.split('|').map(str::trim);
            let model = parts.next().unwrap();
            let mut numbers =
                || -> Vec<f64> { parts.next().unwrap().split(' ').map(|n| n.parse().unwrap()).collect() };
            let (parameters, x, pixel) = (numbers(), numbers(), numbers());
            Row {
                camera: camera(model, &parameters),
                x_in_cam: Vector3::from_row_slice(&x),
                pixel: Vector2::from_row_slice(&pixel),
                text,
            }
        })
        .collect()
}

fn projections_match(table: &'static str, at_least: usize, bound_px: f64) {
    let rows = rows(table);
    assert!(at_least <= rows.len(), "{} rows", rows.len());
    for Row { camera, x_in_cam, pixel, text } in rows {
        let ours = camera.project(&x_in_cam).unwrap_or_else(|| panic!("outside the field: {text}"));
        let miss = (ours - pixel).norm();
        assert!(miss <= bound_px, "{miss:e} px: {text}");
        let bearing = camera.bearing(&pixel).unwrap();
        let angle = bearing.cross(&x_in_cam).norm().atan2(bearing.dot(&x_in_cam));
        assert!(angle <= 1e-11, "bearing off by {angle:e} rad: {text}");
    }
}

#[test]
fn projections_match_opencv() {
    projections_match(include_str!("camera_tables/opencv.txt"), 225, 1e-9);
}

/// 1e-12 px per px of image: a few roundings.
#[test]
fn projections_match_50_digit_table() {
    projections_match(include_str!("camera_tables/mpmath.txt"), 400, 2e-11);
}
