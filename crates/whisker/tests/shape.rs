//! Convex outlines: the same object seen as support function, boundary, corners and inside.

use nalgebra::Vector2;
use resight_whisker::{Error, Shape};
use std::f64::consts::{PI, TAU};

fn shapes() -> Vec<Shape> {
    let centre_m = Vector2::new(0.03, -0.02);
    let corners_m =
        [(0.0, 0.0), (0.06, 0.01), (0.05, 0.05), (0.01, 0.04)].map(|(x, y)| Vector2::new(x, y)).to_vec();
    vec![
        Shape::Circle { centre_m, radius_m: 0.02 },
        Shape::Ellipse { centre_m, semi_axes_m: [0.05, 0.02], angle_rad: 0.3 },
        Shape::Ellipse { centre_m, semi_axes_m: [0.02, 0.05], angle_rad: -1.3 },
        Shape::Rectangle { centre_m, sides_m: [0.04, 0.07], angle_rad: 0.5 },
        Shape::square(centre_m, 0.03, -0.2),
        Shape::Polygon { corners_m },
    ]
}

fn unit(angle: f64) -> Vector2<f64> {
    Vector2::new(angle.cos(), angle.sin())
}

/// The point with a normal is the farthest along it: its height is the support, and none of the outline is higher.
#[test]
fn support_is_the_height_of_the_outline() {
    for shape in shapes() {
        let outline = shape.outline_m(4000);
        for i in 0..100 {
            let normal = unit(TAU * f64::from(i) / 100.0);
            let highest = outline.iter().map(|x| x.dot(&normal)).fold(f64::NEG_INFINITY, f64::max);
            // 4000 points of an outline curved to 0.125 m miss its highest by (TAU/4000)² ρ/8.
            let miss = shape.support_m(normal) - highest;
            assert!((-1e-15..5e-8).contains(&miss), "{shape:?} {miss:e}");
            if let Some((point, _)) = shape.smooth_point_m(TAU * f64::from(i) / 100.0) {
                assert!((point.dot(&normal) - shape.support_m(normal)).abs() < 1e-15, "{shape:?}");
            }
        }
    }
}

/// dx/dν = ρ (−sin ν, cos ν); central differences of 1e-5 err by 1e-10 of the radius' scale.
#[test]
fn radius_of_curvature_matches_central_difference() {
    for shape in shapes() {
        for i in 0..40 {
            let at = TAU * f64::from(i) / 40.0;
            let Some((_, radius)) = shape.smooth_point_m(at) else { continue };
            let point = |angle: f64| shape.smooth_point_m(angle).expect("smooth").0;
            let slope = (point(at + 1e-5) - point(at - 1e-5)) / 2e-5;
            let said = Vector2::new(-at.sin(), at.cos()) * radius;
            assert!((slope - said).norm() < 1e-8, "{shape:?} {at}: {slope:?} {said:?}");
        }
    }
}

/// On the outline the measure is zero, on either side it has its sign, and its normal is the outline's.
#[test]
fn outside_and_normal_agree_with_the_outline() {
    for shape in shapes() {
        let corners = shape.corners_m();
        let outline = shape.outline_m(97);
        for (i, &x) in outline.iter().enumerate() {
            assert!(shape.outside_m(x).abs() < 1e-15, "{shape:?}");
            let inward = (shape.centre_m() - x) * 1e-3;
            assert!(shape.outside_m(x + inward) < 0.0 && 0.0 < shape.outside_m(x - inward), "{shape:?}");
            if corners.is_empty() {
                let turn = (shape.normal_near_rad(x) - TAU * i as f64 / 97.0).sin();
                assert!(turn.abs() < 1e-12, "{shape:?} {turn:e}");
            }
        }
        assert!(shape.outside_m(shape.centre_m()) < 0.0);
    }
}

/// Normals of faces are across them and outward, and turn once around.
#[test]
fn face_normals_are_outward() {
    for shape in shapes() {
        let (corners, normals) = (shape.corners_m(), shape.face_normals_rad());
        assert_eq!(corners.len(), normals.len());
        for (i, &normal) in normals.iter().enumerate() {
            let face = corners[(i + 1) % corners.len()] - corners[i];
            assert!(unit(normal).dot(&face).abs() < 1e-15);
            assert!((shape.support_m(unit(normal)) - unit(normal).dot(&corners[i])).abs() < 1e-15);
            let middle = corners[i] + face * 0.5;
            assert!((unit(shape.normal_near_rad(middle)) - unit(normal)).norm() < 1e-12);
        }
    }
}

/// A segment cuts an object exactly where a finely sampled one has a point inside.
#[test]
fn cut_segments_have_points_inside() {
    for shape in shapes() {
        let mut cuts = 0;
        for i in 0..400 {
            let (a, b) = (f64::from(i) * 0.37, f64::from(i) * 1.71);
            let from = shape.centre_m() + unit(a) * 0.09;
            let to = shape.centre_m() + unit(b) * (0.02 + 0.0002 * f64::from(i));
            let inside =
                (0..=2000).map(|j| from + (to - from) * (f64::from(j) / 2000.0)).map(|x| shape.outside_m(x));
            let deepest = inside.fold(f64::INFINITY, f64::min);
            // Between two samples of 0.1 mm a corner can hide.
            if deepest.abs() < 1e-4 {
                continue;
            }
            assert_eq!(shape.is_cut_by(from, to, 0.0), deepest < 0.0, "{shape:?} {i} {deepest:e}");
            cuts += u32::from(deepest < 0.0);
        }
        assert!((50..350).contains(&cuts), "{shape:?} {cuts}");
    }
}

/// A cut of known depth: seen above it, not below.
#[test]
fn depth_of_a_cut_is_reported() {
    for shape in shapes() {
        // Along the first face, or the tangent across the first semi-axis.
        let normal_rad = match &shape {
            Shape::Ellipse { angle_rad, .. } => *angle_rad,
            Shape::Circle { .. } => 0.4,
            _ => shape.face_normals_rad()[0],
        };
        let (normal, along) = (unit(normal_rad), unit(normal_rad + 0.5 * PI));
        let foot =
            shape.centre_m() + normal * (shape.support_m(normal) - normal.dot(&shape.centre_m()) - 1e-6);
        let cut = |depth: f64| shape.is_cut_by(foot - along * 0.1, foot + along * 0.1, depth);
        assert!(cut(0.0) && cut(0.9e-6) && !cut(1.1e-6), "{shape:?}");
    }
}

/// Perimeters: of a circle, of an ellipse 5 : 2 by its complete integral 4 a E(1 − b²/a²) at 50 digits, of polygons by hand.
#[test]
fn perimeters_and_widths_are_known() {
    let all = shapes();
    let perimeter = |i: usize| all[i].perimeter_m();
    assert!((perimeter(0) - TAU * 0.02).abs() < 1e-15);
    assert!((perimeter(1) - ELLIPSE_M).abs() < 1e-13, "{}", perimeter(1));
    assert!((perimeter(2) - ELLIPSE_M).abs() < 1e-13);
    assert!((perimeter(3) - 0.22).abs() < 1e-15);
    let widths = [0.04, 0.04, 0.04, 0.04, 0.03];
    for (shape, width) in all.iter().zip(widths) {
        assert!((shape.width_m() - width).abs() < 1e-15, "{shape:?}");
    }
    for shape in &all {
        let strips = (0..2000).map(|i| PI * f64::from(i) / 2000.0);
        let least = strips
            .map(|a| shape.support_m(unit(a)) + shape.support_m(-unit(a)))
            .fold(f64::INFINITY, f64::min);
        // Half a step of the strips' direction past the narrowest one, over 0.1 m.
        let miss = least - shape.width_m();
        assert!((-1e-12..0.1 * PI / 4000.0).contains(&miss), "{shape:?} {miss:e}");
    }
}

/// 4 · 0.05 · E(m = 0.84).
const ELLIPSE_M: f64 = 0.230_131_125_956_648_43;

#[test]
fn what_is_no_convex_object_is_refused() {
    let at = |x: f64, y: f64| Vector2::new(x, y);
    let polygon = |corners: &[Vector2<f64>]| Shape::Polygon { corners_m: corners.to_vec() }.check();
    let square = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
    assert_eq!(polygon(&square), Ok(()));
    let clockwise: Vec<_> = square.iter().rev().copied().collect();
    assert!(matches!(polygon(&clockwise), Err(Error::NotConvex { .. })));
    assert!(matches!(polygon(&square[..2]), Err(Error::TooFew { seen: 2, .. })));
    let dent = [at(0.0, 0.0), at(1.0, 0.0), at(0.4, 0.4), at(0.0, 1.0)];
    assert!(matches!(polygon(&dent), Err(Error::NotConvex { corner: 2, .. })));
    let straight = [at(0.0, 0.0), at(0.5, 0.0), at(1.0, 0.0), at(1.0, 1.0)];
    assert!(matches!(polygon(&straight), Err(Error::NotConvex { corner: 1, .. })));
    let star: Vec<_> = (0..5).map(|i| unit(f64::from(2 * i) * TAU / 5.0)).collect();
    assert!(matches!(polygon(&star), Err(Error::NotConvex { .. })));
    assert!(matches!(
        polygon(&[at(0.0, 0.0), at(f64::NAN, 0.0), at(1.0, 1.0)]),
        Err(Error::NotFinite { .. })
    ));
    let centre_m = at(0.0, 0.0);
    let refused = [
        Shape::Circle { centre_m, radius_m: -1.0 },
        Shape::Ellipse { centre_m, semi_axes_m: [1.0, 0.0], angle_rad: 0.0 },
        Shape::square(centre_m, f64::INFINITY, 0.0),
    ];
    for shape in refused {
        assert!(matches!(shape.check(), Err(Error::NotPositive { .. })), "{shape:?}");
    }
    let nowhere = Shape::square(at(f64::NAN, 0.0), 1.0, 0.0);
    assert!(matches!(nowhere.check(), Err(Error::NotFinite { .. })));
    for shape in shapes() {
        assert_eq!(shape.check(), Ok(()), "{shape:?}");
    }
}
