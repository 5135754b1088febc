//! One suite for all camera models: there and back over the whole valid field, and every derivative.

use crate::camera_zoo::cameras;
use nalgebra::{Rotation3, Vector3};
use resight_core::{Camera, Point};
use std::f64::consts::PI;

/// Direction at `angle` from the optical axis and `azimuth` about it.
fn ray(angle: f64, azimuth: f64) -> Point {
    Vector3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos())
}

/// The largest angle at this azimuth that still has a pixel, by bisection down to neighbouring numbers.
fn edge(camera: &Camera, azimuth: f64) -> f64 {
    let (mut low, mut high) = (0.0, PI * (1.0 + 1e-15));
    while low < 0.5 * (low + high) && 0.5 * (low + high) < high {
        let middle = 0.5 * (low + high);
        if camera.project(&ray(middle, azimuth)).is_some() { low = middle } else { high = middle }
    }
    low
}

/// Angles from the axis to the edge, dense near both ends.
fn angles(edge: f64) -> Vec<f64> {
    let near_ends = (1..=16).map(|k| 10f64.powi(-k));
    let mut parts: Vec<f64> = (0..=200).map(|i| f64::from(i) / 200.0).collect();
    parts.extend(near_ends.clone());
    parts.extend(near_ends.map(|e| 1.0 - e));
    parts.into_iter().map(|part| part * edge).collect()
}

fn azimuths() -> impl Iterator<Item = f64> {
    (0..24).map(|i| f64::from(i) * PI / 12.0)
}

/// Calls `check` for every camera at points all over its field.
fn over_the_field(check: impl Fn(&str, &Camera, &Point, f64)) {
    for (name, camera) in cameras() {
        for azimuth in azimuths() {
            let edge = edge(&camera, azimuth);
            assert!(0.15 < edge, "{name}: the field ends at {edge} rad");
            for angle in angles(edge) {
                check(&name, &camera, &ray(angle, azimuth), angle / edge);
            }
        }
    }
}

/// The first half of the contract: a pixel's bearing has that pixel. Up to the very edge of the field.
#[test]
fn pixel_of_the_bearing_is_the_pixel() {
    over_the_field(|name, camera, x, part| {
        let Some(pixel) = camera.project(x) else { return };
        let bearing = camera.bearing(&pixel).unwrap_or_else(|e| panic!("{name} at {part} of the edge: {e}"));
        let back =
            camera.project(&bearing).unwrap_or_else(|| panic!("{name} at {part}: {pixel} has no way back"));
        let miss = (back - pixel).norm();
        // The pinhole's field has no end, but its pixels have 53 bits.
        let bound = if name.starts_with("pinhole") { 4.0 * f64::EPSILON * pixel.norm() } else { 0.0 };
        assert!(miss <= bound.max(1e-9), "{name} at {part} of the edge: {miss:e} px at {pixel}");
    });
}

/// The second half: the bearing is that of the point, not of another one on the far side of a fold. A fold makes the
/// inverse's slope infinite, hence the loose bound near the edge: a rounding error ε of the pixel is √ε there.
#[test]
fn bearing_of_the_projection_is_the_point() {
    over_the_field(|name, camera, x, part| {
        let Some(pixel) = camera.project(x) else { return };
        let bearing = camera.bearing(&pixel).unwrap();
        let miss = bearing.cross(x).norm().atan2(bearing.dot(x));
        let bound = if part < 0.95 { 2e-13 } else { 1e-6 };
        assert!(miss <= bound, "{name} at {part} of the edge: {miss:e} rad");
    });
}

/// Pixels need not come from points: whatever pixel has a bearing must have it to 1e-9 px.
#[test]
fn every_pixel_has_a_true_bearing_or_none() {
    for (name, camera) in cameras() {
        let mut answered = 0;
        let scale = camera.parameters()[0].1;
        let centre = camera.project(&Vector3::z()).unwrap();
        for i in -60..=60 {
            for j in -60..=60 {
                let pixel = centre + nalgebra::Vector2::new(f64::from(i), f64::from(j)) * (0.05 * scale);
                let Ok(bearing) = camera.bearing(&pixel) else { continue };
                answered += 1;
                let back =
                    camera.project(&bearing).unwrap_or_else(|| panic!("{name}: {pixel} has no way back"));
                assert!((back - pixel).norm() <= 1e-9, "{name}: {pixel}");
            }
        }
        assert!(30 < answered, "{name} sees only {answered} of 14641");
    }
}

/// Says that the derivative belongs to `project`; whether `project` is right, the golden tables say.
#[test]
fn point_jacobian_matches_central_difference() {
    over_the_field(|name, camera, x, part| {
        if 0.98 < part {
            return; // A difference would step over the edge.
        }
        let x = x * 2.5;
        let (pixel, jacobian) = camera.project_with_jacobian(&x).unwrap();
        assert_eq!(pixel, camera.project(&x).unwrap(), "{name}: the two projections differ");
        for i in 0..3 {
            // Error of the central difference: h² f''' + ε |pixel|/h; h = 1e-5.
            let h = 1e-5;
            let mut step = Vector3::zeros();
            step[i] = h;
            let (Some(after), Some(before)) = (camera.project(&(x + step)), camera.project(&(x - step)))
            else {
                continue;
            };
            let difference = (after - before) / (2.0 * h);
            let scale = jacobian.norm() + pixel.norm();
            let miss = (jacobian.column(i) - difference).norm();
            let bound = if part < 0.9 { 1e-7 } else { 1e-4 };
            assert!(
                miss <= bound * scale,
                "{name} at {part}, column {i}: {} against {difference}",
                jacobian.column(i)
            );
        }
    });
}

#[test]
fn intrinsics_jacobian_matches_central_difference() {
    for (name, camera) in cameras() {
        let parameters = camera.parameters();
        let values: Vec<f64> = parameters.iter().map(|p| p.1).collect();
        for azimuth in azimuths() {
            let edge = edge(&camera, azimuth);
            for part in [0.0, 1e-9, 0.1, 0.35, 0.6, 0.85] {
                let x = ray(part * edge, azimuth) * 1.7;
                let columns = camera.intrinsics_jacobian(&x).unwrap();
                assert_eq!(columns.len(), parameters.len(), "{name}");
                for (i, (parameter, value)) in parameters.iter().enumerate() {
                    // Relative to the parameter's own scale: k3 of a lens in px is 1e-20.
                    let reach = columns[i].norm().max(1e-3 * values[0].min(1.0));
                    let h = (1e-5 * values[0] / reach).min(1e-4 * value.abs().max(1.0));
                    let at = |v: f64| {
                        let mut changed = values.clone();
                        changed[i] = v;
                        camera.with_parameters(&changed).ok()?.project(&x)
                    };
                    let (Some(after), Some(before)) = (at(value + h), at(value - h)) else { continue };
                    let difference = (after - before) / (2.0 * h);
                    let miss = (columns[i] - difference).norm();
                    let rounding = 1e-15 * (values[0] + after.norm()) / h;
                    assert!(
                        miss <= 1e-5 * columns[i].norm() + 20.0 * rounding,
                        "{name} {parameter} at {part}: {} against {difference} (h = {h:e})",
                        columns[i]
                    );
                }
            }
        }
    }
}

/// Distance does not matter, only direction: 1 nm and 1e9 m away.
#[test]
fn projection_is_scale_free() {
    for (name, camera) in cameras() {
        let x = ray(0.1, 0.7);
        let pixel = camera.project(&x).unwrap();
        for scale in [1e-9, 1e-3, 1e9] {
            let there = camera.project(&(x * scale)).unwrap();
            assert!((there - pixel).norm() <= 1e-11 * pixel.norm().max(1.0), "{name} at {scale}");
        }
    }
}

/// On the axis every model gives its principal point, with a finite derivative; just behind the camera centre, nothing.
#[test]
fn the_axis_is_the_principal_point() {
    for (name, camera) in cameras() {
        let (pixel, jacobian) = camera.project_with_jacobian(&Vector3::new(0.0, 0.0, 2.0)).unwrap();
        let bearing = camera.bearing(&pixel).unwrap();
        assert!(bearing.xy().norm() < 1e-15, "{name}");
        assert!(jacobian.iter().all(|j| j.is_finite()) && 0.0 < jacobian.m11.abs(), "{name}: {jacobian}");
        let nearby = camera.project_with_jacobian(&Vector3::new(1e-12, -1e-12, 2.0)).unwrap().1;
        assert!((nearby - jacobian).norm() <= 1e-9 * jacobian.norm(), "{name}: {nearby} against {jacobian}");
        assert!(camera.project(&Vector3::new(0.0, 0.0, -2.0)).is_none(), "{name}: straight behind");
        assert!(camera.project(&Vector3::zeros()).is_none(), "{name}: the centre itself");
    }
}

#[test]
fn nan_and_infinity_are_refused() {
    for (name, camera) in cameras() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for i in 0..3 {
                let mut x = Vector3::new(0.1, 0.2, 1.0);
                x[i] = bad;
                assert!(camera.project(&x).is_none(), "{name}: {x}");
                assert!(
                    camera.project_with_jacobian(&x).is_none() && camera.intrinsics_jacobian(&x).is_none()
                );
            }
            assert!(camera.bearing(&nalgebra::Vector2::new(bad, 0.0)).is_err(), "{name}: pixel {bad}");
            assert!(camera.bearing(&nalgebra::Vector2::new(0.0, bad)).is_err(), "{name}: pixel {bad}");
            let mut values: Vec<f64> = camera.parameters().iter().map(|p| p.1).collect();
            for i in 0..values.len() {
                let good = std::mem::replace(&mut values[i], bad);
                assert!(camera.with_parameters(&values).is_err(), "{name}: parameter {i} = {bad}");
                values[i] = good;
            }
        }
    }
}

/// Everything that comes out is a number, for points all around the camera, near and far.
#[test]
fn nothing_but_numbers_comes_out() {
    for (name, camera) in cameras() {
        for i in 0..2000 {
            let t = f64::from(i);
            let x = Rotation3::new(Vector3::new(t * 0.37, t * 1.13, t * 0.71))
                * Vector3::new(0.0, 0.0, 10f64.powf(t % 17.0 - 8.0));
            if let Some((pixel, jacobian)) = camera.project_with_jacobian(&x) {
                assert!(pixel.iter().chain(jacobian.iter()).all(|v| v.is_finite()), "{name}: {x}");
            }
        }
    }
}
