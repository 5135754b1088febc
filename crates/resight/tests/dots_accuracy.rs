//! How well dots are measured: error, stated sigma, perspective's shift, over range, tilt, polarity, blur and noise.

use crate::dots_support::*;
use resight::detect::dots::{DotConfig, DotDetector};
use resight::render::{Finish, Pcg, Scene, Style, true_pixels};
use resight_core::Pixel;
use resight_core::target::LinePlusOne;

struct Case {
    name: &'static str,
    style: Style,
    background: f64,
    distance_m: f64,
    tilt_rad: f64,
    blur_sigma_px: f64,
    noise_sigma: f64,
    /// Bound on the root mean square error of a coordinate: two to three times what was measured.
    most_rms_px: f64,
}

const PRINTED: Style = Style {
    ink: 20.0,
    paper: Some(235.0),
    margin_m: None,
    dot_diameter_m: Some(0.03),
    tag_border_bits: None,
};
const REFLECTORS: Style = Style {
    ink: 230.0,
    paper: Some(30.0),
    margin_m: None,
    dot_diameter_m: Some(0.03),
    tag_border_bits: None,
};

fn lamps(diameter_m: f64) -> Style {
    Style::lamps(diameter_m)
}

/// Detection rate 1, small errors and honest sigmas in each case; prints the table of the documentation.
#[test]
fn centroids_are_exact_to_hundredths_of_a_pixel() {
    let case = |name, style, background, distance_m, tilt_rad, blur_sigma_px, noise_sigma, most_rms_px| {
        Case { name, style, background, distance_m, tilt_rad, blur_sigma_px, noise_sigma, most_rms_px }
    };
    let cases = [
        case("printed 75 px", PRINTED, 120.0, 0.4, 0.6, 0.7, 2.0, 0.01),
        case("printed 30 px", PRINTED, 120.0, 1.0, 0.6, 0.7, 2.0, 0.02),
        case("printed 12 px", PRINTED, 120.0, 2.5, 0.9, 0.7, 2.0, 0.04),
        case("printed, noise 8", PRINTED, 120.0, 1.0, 0.6, 1.0, 8.0, 0.05),
        case("printed, blur 2", PRINTED, 120.0, 1.2, 0.3, 2.0, 2.0, 0.03),
        case("printed, tilt 75°", PRINTED, 120.0, 0.6, 1.31, 0.7, 2.0, 0.05),
        case("light on dark", REFLECTORS, 90.0, 1.0, 0.6, 0.7, 2.0, 0.02),
        case("lamps 10 px", lamps(0.004), 20.0, 0.4, 0.6, 0.7, 2.0, 0.03),
        case("lamps 4 px", lamps(0.004), 20.0, 1.0, 0.6, 1.0, 2.0, 0.04),
        case("lamps 1.6 px", lamps(0.004), 20.0, 2.5, 0.3, 1.0, 2.0, 0.12),
    ];
    let camera = camera(1280, 960, 1000.0);
    println!("| case | found | rms px | stated px | (error/σ)² | ");
    for case in cases {
        let (found, tried, e2, sigma2, nees, n) = run(&case, &camera);
        let (rms, stated) = ((e2 / n).sqrt(), (sigma2 / n).sqrt());
        println!("| {} | {found}/{tried} | {rms:.4} | {stated:.4} | {:.2} |", case.name, nees / n);
        assert!(5 <= tried && found == tried, "{}: {found} of {tried}", case.name);
        assert!(rms < case.most_rms_px, "{}: {rms} px", case.name);
        // One coordinate has one degree of freedom; the floor of 0.01 px makes good dots pessimistic, never optimistic.
        assert!(nees / n < 1.7, "{}: {}", case.name, nees / n);
    }
}

fn run(case: &Case, camera: &resight_core::Camera) -> (usize, usize, f64, f64, f64, f64) {
    let mut pcg = Pcg::new(21);
    let (mut found, mut tried) = (0, 0);
    let (mut e2, mut sigma2, mut nees, mut n) = (0.0, 0.0, 0.0, 0.0);
    for i in 0..8u64 {
        let target = if i % 2 == 0 { UNEQUAL } else { EQUAL };
        let placed =
            placed(&target, pose(&target, case.distance_m, case.tilt_rad, 0.08, &mut pcg), case.style);
        let scene = Scene { placed: vec![placed.clone()], background: case.background, clutter: Vec::new() };
        let finish = Finish {
            blur_sigma_px: case.blur_sigma_px,
            noise_sigma: case.noise_sigma,
            seed: i,
            illumination_gradient: [0.2, -0.1],
            vignetting: 0.0,
            samples_per_axis: 8,
        };
        // The detector needs the surroundings of each dot.
        let inside = |p: &Pixel| 50.0 < p.x && p.x < 1230.0 && 50.0 < p.y && p.y < 910.0;
        if true_pixels(&placed, camera).iter().filter(|(_, p)| inside(p)).count() < 4 {
            continue;
        }
        let image = picture(&scene, camera, &finish);
        let detections = DotDetector::new(&target).unwrap().detect_with_camera(&image, camera).unwrap();
        tried += 1;
        let Some(off) = errors(&detections, &placed, camera) else { continue };
        assert!(worst_px(&off) < 0.5, "{}: {off:?}", case.name);
        found += 1;
        for (e, d) in off.iter().zip(&detections) {
            e2 += e.norm_squared();
            sigma2 += 2.0 * d.sigma_px * d.sigma_px;
            nees += e.norm_squared() / (d.sigma_px * d.sigma_px);
            n += 2.0;
        }
    }
    (found, tried, e2, sigma2, nees, n)
}

/// With the floor for what is not noise switched off, the stated sigma is that of the noise itself: mean squared error
/// over variance is 1 for each coordinate. 4 dots × 2 coordinates × 60 images: one σ of the mean is 0.065.
/// The pose is fixed, so that a bias would show as well.
#[test]
fn sigma_matches_monte_carlo() {
    let camera = camera(320, 240, 400.0);
    for (name, style, background, blur, noise) in
        [("printed", PRINTED, 120.0, 0.8, 8.0), ("lamps", lamps(0.006), 20.0, 0.9, 5.0)]
    {
        let mut pcg = Pcg::new(4);
        let placed = placed(&UNEQUAL, pose(&UNEQUAL, 0.6, 0.4, 0.05, &mut pcg), style);
        let scene = Scene { placed: vec![placed.clone()], background, clutter: Vec::new() };
        let config = DotConfig { sigma_floor_px: 0.0, ..DotConfig::default() };
        let mut detector = DotDetector::with_config(&UNEQUAL, config).unwrap();
        let (mut nees, mut n, mut bias) = (0.0, 0.0, Pixel::zeros());
        for seed in 0..60 {
            let finish = Finish {
                blur_sigma_px: blur,
                noise_sigma: noise,
                seed,
                samples_per_axis: 16,
                ..Finish::default()
            };
            let image = picture(&scene, &camera, &finish);
            let detections = detector.detect_with_camera(&image, &camera).unwrap();
            let off =
                errors(&detections, &placed, &camera).unwrap_or_else(|| panic!("{name} {seed}: not found"));
            for (e, d) in off.iter().zip(&detections) {
                nees += e.norm_squared() / (d.sigma_px * d.sigma_px);
                bias += e;
                n += 2.0;
            }
        }
        println!("{name}: (error/σ)² {:.3}, bias {:?} px", nees / n, (bias / (0.5 * n)).as_slice());
        assert!(0.75 < nees / n && nees / n < 1.3, "{name}: {}", nees / n);
    }
}

/// Large dots near the camera: their ellipses' centres lie pixels away from the images of their centres, and the
/// correction removes it, with the camera and (through the shapes alone) without.
#[test]
fn perspective_shift_is_removed() {
    let camera = camera(1280, 960, 900.0);
    let big = LinePlusOne { line_m: [0.0, 0.10, 0.18], off_m: [0.02, 0.10] };
    let style = Style { dot_diameter_m: Some(0.06), ..PRINTED };
    let mut pcg = Pcg::new(2);
    for _ in 0..3 {
        let placed = placed(&big, pose(&big, 0.30, 0.9, 0.02, &mut pcg), style);
        let scene = Scene::of(placed.target.clone(), placed.cam_from_target, style);
        let image = picture(&scene, &camera, &Finish { noise_sigma: 1.0, ..Finish::default() });
        let mut detector = DotDetector::new(&big).unwrap();
        for camera_given in [Some(&camera), None] {
            let found = detector.detect_all(&image, camera_given).unwrap();
            let target = found.first().expect("found");
            let truth = true_pixels(&placed, &camera);
            let raw = |i: usize| (target.dots[i].centroid - truth[i].1).norm();
            let shift = (0..4).map(raw).fold(0.0, f64::max);
            let left = worst_px(&errors(&target.detections, &placed, &camera).unwrap());
            println!("camera {}: shift {shift:.2} px, left {left:.3} px", camera_given.is_some());
            assert!(1.0 < shift, "the case shows nothing: {shift} px");
            assert!(left < 0.04 * shift, "{left} px left of {shift} px");
        }
    }
}

/// A strong gradient must not push a disc's centre: a quarter of the light from edge to edge.
#[test]
fn illumination_gradient_does_not_move_the_centre() {
    // Paper that the brightest corner does not overexpose.
    let style = Style { paper: Some(190.0), ..PRINTED };
    let camera = camera(640, 480, 500.0);
    let placed = placed(&UNEQUAL, pose(&UNEQUAL, 0.3, 0.0, 0.0, &mut Pcg::new(8)), style);
    let scene = Scene::of(placed.target.clone(), placed.cam_from_target, style);
    let mut detector = DotDetector::new(&UNEQUAL).unwrap();
    for gradient in [[0.0, 0.0], [0.5, 0.0], [0.0, -0.5]] {
        let finish = Finish {
            noise_sigma: 0.0,
            illumination_gradient: gradient,
            vignetting: 0.0,
            samples_per_axis: 8,
            ..Finish::default()
        };
        let image = picture(&scene, &camera, &finish);
        let found = detector.detect_with_camera(&image, &camera).unwrap();
        let worst = worst_px(&errors(&found, &placed, &camera).expect("found"));
        // Uncorrected, the slope alone moves a disc of 25 px radius by 0.06 px and its edges' threshold by as much.
        assert!(worst < 0.02, "{gradient:?}: {worst} px");
    }
}
