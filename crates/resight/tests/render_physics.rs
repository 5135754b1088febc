//! The renderer against what can be computed by hand.

use resight::render::{Finish, Pcg, Placed, RenderError, Scene, Style, clutter, render};
use resight_core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight_core::target::{LinePlusOne, NamedPoint, Tag};
use resight_core::{Camera, Lens, Point, Pose, Target};

const CLEAN: Finish = Finish {
    blur_sigma_px: 0.0,
    noise_sigma: 0.0,
    seed: 1,
    illumination_gradient: [0.0; 2],
    vignetting: 0.0,
    samples_per_axis: 16,
};

fn camera(width_px: u32, height_px: u32) -> Camera {
    let (cx_px, cy_px) = (0.5 * (width_px as f64 - 1.0), 0.5 * (height_px as f64 - 1.0));
    let matrix = CameraMatrix { fx_px: 500.0, fy_px: 500.0, cx_px, cy_px };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: Some(ImageSize { width_px, height_px }) }
}

fn away(z: f64) -> Pose {
    Pose::new(Pose::identity().rotation, Point::new(0.0, 0.0, z))
}

fn lamp(diameter_m: f64) -> Scene {
    let point = NamedPoint { name: "a".into(), position: Point::zeros(), sigma_m: 0.0 };
    let style = Style { ink: 200.0, ..Style::lamps(diameter_m) };
    let mut scene = Scene::of(Target::Points(vec![point]), away(1.0), style);
    scene.background = 0.0;
    scene
}

/// A disc of diameter d at distance Z covers π(f d / 2Z)² pixels: light is conserved, for dots below a pixel too.
#[test]
fn light_of_a_disc_is_its_area() {
    for diameter_m in [0.001, 0.003, 0.02, 0.1] {
        let image = render(&lamp(diameter_m), &camera(160, 120), &CLEAN).unwrap();
        let light: f64 = image.data.iter().map(|g| *g as f64).sum::<f64>() / 200.0;
        let area = std::f64::consts::PI * (500.0 * diameter_m / 2.0f64).powi(2);
        assert!((light - area).abs() < 0.02 * area + 0.02, "{diameter_m}: {light} px² seen, {area} px² true");
    }
}

/// Pixel (0, 0) is the centre of the top-left pixel: a dot on the axis is centred on the principal point.
#[test]
fn a_dot_on_the_axis_is_centred_on_the_principal_point() {
    let image = render(&lamp(0.03), &camera(81, 64), &Finish { blur_sigma_px: 1.0, ..CLEAN }).unwrap();
    let (mut sum, mut su, mut sv) = (0.0, 0.0, 0.0);
    for v in 0..64 {
        for u in 0..81 {
            let g = image.at(u, v) as f64;
            (sum, su, sv) = (sum + g, su + g * u as f64, sv + g * v as f64);
        }
    }
    assert!((su / sum - 40.0).abs() < 0.01 && (sv / sum - 31.5).abs() < 0.01, "{} {}", su / sum, sv / sum);
}

#[test]
fn the_nearer_target_hides_the_farther_in_either_order() {
    let tag = |size_m: f64, id: u32| Target::Tag(Tag { family: "tag36h11".into(), id, size_m });
    let at = |target: Target, z: f64, ink: f64| Placed {
        target,
        cam_from_target: away(z),
        style: Style { ink, paper: Some(ink), ..Style::default() },
    };
    let (near, far) = (at(tag(0.05, 0), 1.0, 10.0), at(tag(0.2, 1), 2.0, 250.0));
    for placed in [vec![near.clone(), far.clone()], vec![far, near]] {
        let scene = Scene { placed, background: 100.0, clutter: Vec::new() };
        let image = render(&scene, &camera(160, 120), &CLEAN).unwrap();
        assert_eq!((image.at(80, 60), image.at(80, 39), image.at(2, 2)), (10, 250, 100));
    }
}

/// Noise has the stated standard deviation, the gradient the stated ends, and a seed repeats.
#[test]
fn finish_does_what_it_says() {
    let blank = Scene { placed: Vec::new(), background: 120.0, clutter: Vec::new() };
    let finish = Finish { noise_sigma: 5.0, ..CLEAN };
    let image = render(&blank, &camera(320, 240), &finish).unwrap();
    assert_eq!(image, render(&blank, &camera(320, 240), &finish).unwrap());
    assert_ne!(image, render(&blank, &camera(320, 240), &Finish { seed: 2, ..finish }).unwrap());
    let n = image.data.len() as f64;
    let mean = image.data.iter().map(|g| *g as f64).sum::<f64>() / n;
    let variance = image.data.iter().map(|g| (*g as f64 - mean).powi(2)).sum::<f64>() / n;
    // 76,800 samples: the standard deviation is known to 0.25 %; rounding adds 1/12.
    assert!((variance - 25.0 - 1.0 / 12.0).abs() < 0.6, "{variance}");
    let sloped = Finish { illumination_gradient: [0.5, 0.0], ..CLEAN };
    let image = render(&blank, &camera(320, 240), &sloped).unwrap();
    assert_eq!((image.at(0, 100), image.at(160, 100), image.at(319, 100)), (90, 120, 150));
    // In the corners a vignette of 40 % leaves 60 % of the light, in the middle of an edge of a 4 : 3 image 1 − 0.4 / 2.
    let image = render(&blank, &camera(320, 240), &Finish { vignetting: 0.4, ..CLEAN }).unwrap();
    assert_eq!((image.at(160, 120), image.at(0, 120), image.at(319, 239)), (120, 96, 72));
}

#[test]
fn what_cannot_be_drawn_is_refused_by_name() {
    let target = |family: &str, id: u32| Target::Tag(Tag { family: family.into(), id, size_m: 0.1 });
    let try_it = |t: Target| render(&Scene::of(t, away(1.0), Style::default()), &camera(8, 8), &CLEAN);
    assert!(matches!(try_it(target("tag37h11", 0)), Err(RenderError::UnknownFamily { .. })));
    assert!(matches!(try_it(target("tag36h11", 587)), Err(RenderError::UnknownId { last: 586, .. })));
    assert!(matches!(try_it(target("DICT_4X4_50", 50)), Err(RenderError::UnknownId { last: 49, .. })));
    assert!(try_it(target("tagStandard41h12", 2)).is_ok());
    let flat = LinePlusOne { line_m: [0.0, 0.1, 0.1], off_m: [0.0, 0.1] };
    assert!(matches!(try_it(Target::LinePlusOne(flat)), Err(RenderError::Target(_))));
    let unsized_camera = Camera::normalized();
    let scene = Scene::of(target("tag36h11", 0), away(1.0), Style::default());
    assert_eq!(render(&scene, &unsized_camera, &CLEAN), Err(RenderError::NoImageSize));
}

/// Poses edge-on, behind the camera or through its centre draw something or nothing, and never panic.
#[test]
fn hostile_poses_draw_without_panic() {
    let target = LinePlusOne { line_m: [0.0, 0.1, 0.15], off_m: [0.0, 0.15] };
    let mut pcg = Pcg::new(5);
    for i in 0..60 {
        let turn = nalgebra::Vector6::from_fn(|_, _| pcg.between(-3.0, 3.0));
        let mut at = Pose::exp(&turn);
        if i % 3 == 0 {
            at.translation = Point::zeros();
        }
        let mut scene = Scene::of(Target::LinePlusOne(target), at, Style::default());
        scene.clutter = clutter::words(2, [32, 24], 6.0, 10.0, i);
        render(&scene, &camera(32, 24), &Finish::default()).unwrap();
    }
}

/// Pcg's normal numbers have mean 0, variance 1 and kurtosis 3.
#[test]
fn normal_numbers_are_normal() {
    let mut pcg = Pcg::new(9);
    let n = 200_000;
    let (mut m1, mut m2, mut m4) = (0.0, 0.0, 0.0);
    for _ in 0..n {
        let x = pcg.normal();
        (m1, m2, m4) = (m1 + x, m2 + x * x, m4 + x.powi(4));
    }
    let n = n as f64;
    assert!((m1 / n).abs() < 0.01 && (m2 / n - 1.0).abs() < 0.02 && (m4 / n - 3.0).abs() < 0.15);
}
