//! Where models end: folds, edges, the space behind the camera; and what `Camera` itself refuses or rescales.

use nalgebra::{Vector2, Vector3};
use resight_core::camera::*;
use resight_core::{Error, Point};

const VGA: CameraMatrix = CameraMatrix { fx_px: 535.4, fy_px: 535.9, cx_px: 341.8, cy_px: 234.2 };
const VGA_SIZE: ImageSize = ImageSize { width_px: 640, height_px: 480 };

fn square(f: f64, cx_px: f64, cy_px: f64) -> CameraMatrix {
    CameraMatrix { fx_px: f, fy_px: f, cx_px, cy_px }
}

fn ray_at(angle: f64, azimuth: f64) -> Point {
    Vector3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos())
}

/// x (1 + k1 r²) folds at r = 1/√(−3 k1), where the image is 2/3 of that wide: no pixel farther out, no point farther out.
#[test]
fn barrel_folds_where_calculus_says() {
    let k1: f64 = -0.4;
    let model = BrownConrady::new(square(500.0, 320.0, 240.0), &[k1, 0.0, 0.0, 0.0]).unwrap();
    let fold = 1.0 / (-3.0 * k1).sqrt();
    assert!((model.radius_max() - fold).abs() < 1e-14);
    let camera = Camera { lens: model.into(), size: None };
    let at = |r: f64| Vector3::new(r, 0.0, 1.0);
    assert!(camera.project(&at(fold * (1.0 - 1e-9))).is_some());
    // Beyond the fold the formula gives a pixel well inside the image again.
    for r in [1.001, 1.2, 1.5, 3.0] {
        assert!(camera.project(&at(fold * r)).is_none(), "{r}");
    }
    let last_u = 320.0 + 500.0 * fold * 2.0 / 3.0;
    assert!(camera.bearing(&Vector2::new(last_u - 1e-9, 240.0)).is_ok());
    let error = camera.bearing(&Vector2::new(last_u + 1e-6, 240.0)).unwrap_err();
    assert!(matches!(error, Error::OutsideField { model: "brown_conrady", .. }));
    assert!(error.to_string().contains("0.912871"), "{error}");
}

/// kornia#4285: k1 = 0.5, three focal lengths off the axis; five fixed-point steps miss by 288 px, 200 steps by 1338 px.
#[test]
fn far_corner_of_a_pincushion_inverts_where_the_fixed_point_cycles() {
    let matrix = square(100.0, 4.0, 3.0);
    let camera =
        Camera { lens: BrownConrady::new(matrix, &[0.5, 0.0, 0.0, 0.0]).unwrap().into(), size: None };
    let pixel = Vector2::new(304.0, 3.0);
    let back = camera.project(&camera.bearing(&pixel).unwrap()).unwrap();
    assert!((back - pixel).norm() <= 1e-9);
    // The divergence this test exists for.
    let mut x = 3.0;
    for _ in 0..5 {
        x = 3.0 / (1.0 + 0.5 * x * x);
    }
    assert!(100.0 < (100.0 * (x * (1.0 + 0.5 * x * x) - 3.0_f64)).abs());
}

/// Strong k1, k2, k3, not monotone: every pixel of the image has the one bearing inside the fold or none.
#[test]
fn strong_polynomial_never_answers_from_beyond_the_fold() {
    for coefficients in
        [[-1.2, 1.1, 0.0, 0.0, -0.45], [0.8, -2.5, 1e-3, 1e-3, 0.9], [-0.9, 0.4, 0.0, 0.0, -0.1]]
    {
        let model = BrownConrady::new(square(500.0, 320.0, 240.0), &coefficients).unwrap();
        let limit = model.radius_max();
        let camera = Camera { lens: model.into(), size: Some(VGA_SIZE) };
        let (mut inside, mut outside) = (0, 0);
        for u in (-2000..2640).step_by(40) {
            for v in (-2000..2480).step_by(40) {
                let pixel = Vector2::new(f64::from(u), f64::from(v));
                match camera.bearing(&pixel) {
                    Ok(bearing) => {
                        inside += 1;
                        assert!(bearing.xy().norm() / bearing.z <= limit, "{pixel}");
                        assert!((camera.project(&bearing).unwrap() - pixel).norm() <= 1e-9, "{pixel}");
                    }
                    Err(_) => outside += 1,
                }
            }
        }
        assert!(10 < inside && 10 < outside, "{coefficients:?}: {inside} inside, {outside} outside");
    }
}

/// opencv#20736: a published 8-coefficient calibration whose top edge has no stable inverse: neighbouring pixels jump by
/// hundreds. Here each has a true bearing or an error, and the good ones stay neighbours.
#[test]
fn rational_model_at_its_edge_gives_true_bearings_or_errors() {
    let matrix = square(2421.791748046875, 1919.6131591796875, 1090.346435546875);
    let coefficients = [
        2.9972164630889893,
        -6.0928826332092285,
        0.0005746248061768711,
        -4.857033854932524e-05,
        -1.2618762254714966,
        3.5340938568115234,
        -4.270793914794922,
        -5.302351951599121,
    ];
    let camera = Camera { lens: BrownConrady::new(matrix, &coefficients).unwrap().into(), size: None };
    let bearings: Vec<_> = (0..3840).map(|u| camera.bearing(&Vector2::new(f64::from(u), 2.0))).collect();
    let good = bearings.iter().filter(|b| b.is_ok()).count();
    assert!(1000 < good && good < 3840, "{good}");
    for pair in bearings.windows(2) {
        if let [Ok(a), Ok(b)] = pair {
            assert!(a.angle(b) < 0.02, "{} rad between neighbours", a.angle(b));
        }
    }
}

/// Numerator and denominator fall to 4·10⁻⁴ together at r = 0.2925 and leave a map whose slope is 0.990 to 1.000 everywhere: the whole image has
/// bearings. Where k1 is a little different the numerator does not fall there, the slope grows beyond use, and the field ends before.
#[test]
fn rational_lens_whose_factors_nearly_cancel_is_judged_by_its_slope() {
    let coefficients = [-11.964486, -129.853044, 0.0, 0.0, 1556.123897, -11.864486, -132.189493, 1569.774107];
    let matrix = square(1850.0, 639.5, 479.5);
    let lens = |k1: f64| {
        let mut c = coefficients;
        c[0] = k1;
        BrownConrady::new(matrix, &c).unwrap()
    };
    let model = lens(coefficients[0]);
    assert!(1.0 < model.radius_max(), "{}", model.radius_max());
    let camera = Camera { lens: model.into(), size: None };
    for (u, v) in (0..1280).step_by(20).flat_map(|u| (0..960).step_by(20).map(move |v| (u, v))) {
        let pixel = Vector2::new(f64::from(u), f64::from(v));
        let bearing = camera.bearing(&pixel).unwrap_or_else(|e| panic!("{pixel}: {e}"));
        let back = camera.project(&bearing).expect("in the field");
        // Rounding of the denominator, 1e-16/4e-4, at 540 px from the centre.
        assert!((back - pixel).norm() <= 5e-9, "{pixel}: {:e}", (back - pixel).norm());
        let distorted = Vector2::new(pixel.x - 639.5, pixel.y - 479.5) / 1850.0;
        let gain = distorted.norm() / (bearing.xy() / bearing.z).norm();
        assert!((0.99..=1.0).contains(&gain), "{pixel}: {gain}");
    }
    for k1 in [-11.9, -12.0] {
        let limit = lens(k1).radius_max();
        assert!(0.25 < limit && limit < 0.2925, "{k1}: {limit}");
    }
}

/// The disc of the valid field is one-to-one also with strong tangential and prism terms: (F(a) − F(b))·(a − b) > 0 there.
#[test]
fn asymmetric_distortion_is_monotone_on_its_field() {
    let coefficients = [-0.2, 0.05, 0.03, -0.02, 0.0, 0.0, 0.0, 0.0, 0.02, -0.01, -0.03, 0.01];
    let model = BrownConrady::new(square(1.0, 0.0, 0.0), &coefficients).unwrap();
    let radius = model.radius_max();
    assert!(0.5 < radius && radius < 5.0, "{radius}");
    let at = |i: usize| {
        let (r, angle) = (radius * (i as f64 * 0.618_033_988_7).fract().sqrt(), i as f64 * 2.399_963);
        Vector2::new(r * angle.cos(), r * angle.sin()) * (1.0 - 1e-12)
    };
    for i in 0..400 {
        for j in 0..i {
            let (a, b) = (at(i), at(j));
            let image = |q: Vector2<f64>| model.project(&Vector3::new(q.x, q.y, 1.0)).unwrap();
            assert!(0.0 < (image(a) - image(b)).dot(&(a - b)), "{a} and {b}");
        }
    }
}

/// θ − 0.3·θ³ folds at θ = 1/√0.9; OpenCV's inverse fails near such limits (opencv#26174, #23961).
#[test]
fn fisheye_inverts_up_to_its_fold_and_no_farther() {
    let model = KannalaBrandt::new(square(190.0, 255.0, 255.0), &[-0.3, 0.0, 0.0, 0.0]).unwrap();
    let fold = 1.0 / 0.9_f64.sqrt();
    assert!((model.angle_max_rad() - fold).abs() < 1e-14);
    let camera = Camera { lens: model.into(), size: None };
    let rim = 190.0 * fold * 2.0 / 3.0;
    for gap in [1.0, 1e-3, 1e-6, 1e-9, 1e-12] {
        let pixel = Vector2::new(255.0 + rim - gap, 255.0);
        assert!((camera.project(&camera.bearing(&pixel).unwrap()).unwrap() - pixel).norm() <= 1e-9, "{gap}");
    }
    assert!(camera.bearing(&Vector2::new(255.0 + rim + 1e-6, 255.0)).is_err());
    assert!(camera.project(&ray_at(fold + 1e-9, 0.4)).is_none());
}

/// Models with an angle for a field see past 90°; models of the plane z = 1 have nothing there.
#[test]
fn only_angle_models_see_behind_the_image_plane() {
    let sees = |lens: Lens| Camera { lens, size: None }.project(&ray_at(1.75, 0.3)).is_some();
    assert!(sees(KannalaBrandt::new(VGA, &[0.003, 0.0007, -0.002, 0.0002]).unwrap().into()));
    assert!(sees(Omni::new(VGA, 1.0, &[]).unwrap().into()));
    assert!(sees(Eucm::new(VGA, 0.59, 1.1).unwrap().into()));
    assert!(sees(DoubleSphere::new(VGA, -0.2, 0.59).unwrap().into()));
    assert!(!sees(Pinhole::new(VGA).unwrap().into()));
    assert!(!sees(BrownConrady::new(VGA, &[0.0; 5]).unwrap().into()));
    assert!(!sees(Fov::new(VGA, 0.9).unwrap().into()));
}

/// A fisheye with all coefficients zero is equidistant (u = f θ), not undistorted.
#[test]
fn zero_coefficients_of_a_fisheye_are_not_a_pinhole() {
    let camera =
        Camera { lens: KannalaBrandt::new(square(200.0, 0.0, 0.0), &[0.0; 4]).unwrap().into(), size: None };
    let pixel = camera.project(&ray_at(1.2, 0.0)).unwrap();
    assert!((pixel.x - 240.0).abs() < 1e-12);
}

/// Eq. (1) negates: a point right of and below the axis has negative measured coordinates.
#[test]
fn photogrammetric_is_negated_perspective_in_the_unit_of_f() {
    let table = PhotogrammetricParameters { f: 3.5, xp: 0.0, yp: 0.0, k: [0.0; 3], p: [0.0; 2], a: [0.0; 2] };
    let camera = Camera { lens: Photogrammetric::new(table).unwrap().into(), size: None };
    let c = camera.project(&Vector3::new(20.0, 10.0, 300.0)).unwrap();
    assert!((c - Vector2::new(-3.5 / 15.0, -3.5 / 30.0)).norm() < 1e-15);
    assert!(camera.project(&Vector3::new(20.0, 10.0, -300.0)).is_none());
}

#[test]
fn scaling_keeps_pixel_centres() {
    let lenses: [Lens; 3] = [
        BrownConrady::new(VGA, &[-0.28, 0.07, 2e-4, 2e-5]).unwrap().into(),
        Eucm::new(VGA, 0.59, 1.1).unwrap().into(),
        Photogrammetric::new(PhotogrammetricParameters {
            f: 535.0,
            xp: 320.0,
            yp: 240.0,
            k: [1e-7, -1e-13, 1e-19],
            p: [1e-6, -2e-6],
            a: [1e-4, 2e-4],
        })
        .unwrap()
        .into(),
    ];
    for lens in lenses {
        let camera = Camera::new(lens, Some(VGA_SIZE)).unwrap();
        for (width, height) in [(320, 240), (1280, 960), (960, 720), (64, 48)] {
            let scaled = camera.scaled_to(width, height).unwrap();
            assert_eq!(scaled.size, Some(ImageSize { width_px: width, height_px: height }));
            let s = f64::from(width) / 640.0;
            for x in [Vector3::new(0.1, -0.2, 1.0), Vector3::new(-0.3, 0.25, 1.3)] {
                let half = Vector2::new(0.5, 0.5);
                let expected = (camera.project(&x).unwrap() + half) * s - half;
                let miss = (scaled.project(&x).unwrap() - expected).norm();
                assert!(miss < 1e-11, "{} at {width}: {miss:e}", camera.model_name());
            }
        }
    }
}

#[test]
fn scaling_refuses_another_aspect_ratio() {
    let camera = Camera::new(Pinhole::new(VGA).unwrap(), Some(VGA_SIZE)).unwrap();
    for (width, height) in [(640, 360), (1280, 720), (480, 640), (640, 479), (0, 0), (320, 0)] {
        let error = camera.scaled_to(width, height).unwrap_err();
        assert!(matches!(error, Error::InvalidCamera { .. }), "{width}×{height}: {error}");
    }
    // 213.3 × 160, rounded.
    assert!(camera.scaled_to(213, 160).is_ok());
    assert!(Camera::normalized().scaled_to(640, 480).is_err());
}

#[test]
fn image_contains_its_pixels_up_to_their_outer_edges() {
    let camera = Camera::new(Pinhole::new(VGA).unwrap(), Some(VGA_SIZE)).unwrap();
    for (u, v, inside) in [
        (-0.5, -0.5, true),
        (639.5, 479.5, true),
        (-0.51, 0.0, false),
        (0.0, 479.51, false),
        (640.0, 0.0, false),
        (f64::NAN, 0.0, false),
    ] {
        assert_eq!(camera.contains(&Vector2::new(u, v)), inside, "({u}, {v})");
    }
    assert!(Camera::normalized().contains(&Vector2::new(-7.0, 1e9)));
    assert!(!Camera::normalized().contains(&Vector2::new(f64::NAN, 0.0)));
}

#[test]
fn intrinsics_that_cannot_be_right_are_refused_by_name() {
    let refused = |result: Result<Camera, Error>| match result {
        Err(Error::InvalidCamera { parameter, .. }) => parameter,
        other => panic!("{other:?}"),
    };
    let sized = |matrix| Camera::new(Pinhole::new(matrix)?, Some(VGA_SIZE));
    assert_eq!(refused(sized(square(0.0, 320.0, 240.0))), "fx_px");
    assert_eq!(refused(sized(CameraMatrix { fy_px: -500.0, ..VGA })), "fy_px");
    assert_eq!(refused(sized(square(500.0, f64::NAN, 240.0))), "cx_px");
    // A principal point of 657 for a 640 px image (ros_aruco_opencv#44), a focal length in mm, normalised intrinsics.
    assert_eq!(refused(sized(square(500.0, 657.0, 240.0))), "cx_px");
    assert_eq!(refused(sized(square(4.2, 320.0, 240.0))), "fx_px");
    assert_eq!(refused(sized(square(1.0, 0.0, 0.0))), "fx_px");
    assert!(Camera::new(Pinhole::new(square(1.0, 0.0, 0.0)).unwrap(), None).is_ok());
    let empty = Some(ImageSize { width_px: 0, height_px: 480 });
    assert_eq!(refused(Camera::new(Pinhole::new(VGA).unwrap(), empty)), "width_px");

    let lens = |lens: Result<Lens, Error>| lens.and_then(|lens| Camera::new(lens, None));
    assert_eq!(refused(lens(Eucm::new(VGA, 1.2, 1.0).map(Lens::from))), "alpha");
    assert_eq!(refused(lens(Eucm::new(VGA, 0.5, 0.0).map(Lens::from))), "beta");
    assert_eq!(refused(lens(DoubleSphere::new(VGA, -1.0, 0.5).map(Lens::from))), "xi");
    assert_eq!(refused(lens(Omni::new(VGA, -1.5, &[]).map(Lens::from))), "xi");
    assert_eq!(refused(lens(Fov::new(VGA, 3.2).map(Lens::from))), "w");
    // Folds at the axis: coefficients in the wrong unit, or overflowing.
    for k1 in [-1e9, 1e300, -1e300] {
        assert_eq!(refused(lens(BrownConrady::new(VGA, &[k1, 0.0, 0.0, 0.0]).map(Lens::from))), "distortion");
        assert_eq!(
            refused(lens(KannalaBrandt::new(VGA, &[k1, 0.0, 0.0, 0.0]).map(Lens::from))),
            "distortion"
        );
        assert_eq!(refused(lens(Omni::new(VGA, 1.0, &[0.0, 0.0, k1, 0.0]).map(Lens::from))), "distortion");
    }
    let mut tilted = [0.0; 14];
    tilted[12] = 1.6;
    assert_eq!(refused(lens(BrownConrady::new(VGA, &tilted).map(Lens::from))), "tau_x");
    let mirrored =
        PhotogrammetricParameters { f: 3.5, xp: 0.0, yp: 0.0, k: [0.0; 3], p: [0.0; 2], a: [0.0, -1.5] };
    assert_eq!(refused(lens(Photogrammetric::new(mirrored).map(Lens::from))), "a");
}

#[test]
fn coefficient_counts_are_checked() {
    for n in 0..16 {
        let coefficients = vec![1e-3; n];
        let brown = BrownConrady::new(VGA, &coefficients);
        assert_eq!(brown.is_ok(), [4, 5, 8, 12, 14].contains(&n), "{n}");
        assert_eq!(KannalaBrandt::new(VGA, &coefficients).is_ok(), n == 4, "{n}");
        assert_eq!(Omni::new(VGA, 0.9, &coefficients).is_ok(), n == 0 || n == 4, "{n}");
    }
    let seen = BrownConrady::new(VGA, &[0.0; 6]).unwrap_err();
    assert_eq!(seen.to_string(), "brown_conrady takes 4, 5, 8, 12 or 14 distortion coefficients, 6 given");
}

#[test]
fn parameters_are_named_in_the_order_they_are_read_back() {
    let camera = Camera { lens: Omni::new(VGA, 0.9, &[0.1, 0.2, 0.3, 0.4]).unwrap().into(), size: None };
    let names: Vec<_> = camera.parameters().iter().map(|p| p.0).collect();
    assert_eq!(names, ["fx_px", "fy_px", "cx_px", "cy_px", "xi", "k1", "k2", "p1", "p2"]);
    let values: Vec<_> = camera.parameters().iter().map(|p| p.1).collect();
    assert_eq!(camera.with_parameters(&values).unwrap(), camera);
    assert!(matches!(camera.with_parameters(&values[1..]), Err(Error::CoefficientCount { seen: 8, .. })));
}

/// Near w = 0 the derivative by w is a series; the suite's central differences cannot step below 0 there.
#[test]
fn fov_derivative_by_a_tiny_angle_matches_central_difference() {
    let camera = |w: f64| Camera { lens: Fov::new(square(1.0, 0.0, 0.0), w).unwrap().into(), size: None };
    let x = Vector3::new(3.0, 0.0, 1.0);
    let (w, h) = (5e-7, 4e-7);
    let by_w = camera(w).intrinsics_jacobian(&x).unwrap()[4].x;
    let difference = (camera(w + h).project(&x).unwrap() - camera(w - h).project(&x).unwrap()).x / (2.0 * h);
    // Rounding of the difference: ε · 3 / 8e-7 ≈ 1e-9 of 1e-5.
    assert!((by_w - difference).abs() < 1e-3 * by_w.abs(), "{by_w:e} against {difference:e}");
    assert_eq!(camera(0.0).intrinsics_jacobian(&x).unwrap()[4].x, 0.0);
}

/// Uniform in −1..1 from a fixed seed.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Lenses far wilder than any real one: whatever has a pixel has its way back, to the edge.
#[test]
fn random_brown_conrady_lenses_have_a_way_back_everywhere() {
    let mut noise = Noise(20_040_801);
    let mut checked = 0;
    for lens in 0..1500 {
        let scale = [0.6, 0.4, 0.03, 0.03, 0.3, 0.6, 0.4, 0.2, 0.02, 0.02, 0.02, 0.02, 0.3, 0.3];
        let count = [4, 5, 8, 12, 14][lens % 5];
        let coefficients: Vec<f64> = scale[..count].iter().map(|s| s * noise.next()).collect();
        let model = BrownConrady::new(VGA, &coefficients).unwrap();
        let radius = model.radius_max();
        let camera = Camera { lens: model.into(), size: None };
        for i in 0..40 {
            let part = if i < 30 { f64::from(i) / 30.0 } else { 1.0 - 10f64.powi(27 - i) };
            let angle = std::f64::consts::PI * noise.next();
            let x = Vector3::new(radius * part * angle.cos(), radius * part * angle.sin(), 1.0);
            let Some(pixel) = camera.project(&x) else { continue };
            let bearing =
                camera.bearing(&pixel).unwrap_or_else(|e| panic!("{coefficients:?} at {part}: {e}"));
            let back = camera.project(&bearing).unwrap_or_else(|| panic!("{coefficients:?} at {part}"));
            assert!((back - pixel).norm() <= 1e-9, "{coefficients:?} at {part}: {:e}", (back - pixel).norm());
            assert!(bearing.cross(&x).norm() <= 1e-5 * x.norm(), "{coefficients:?} at {part}: another point");
            checked += 1;
        }
    }
    assert!(50_000 < checked, "{checked}");
}

/// The same for eq. (1), whose way from point to pixel is the iterative one.
#[test]
fn random_photogrammetric_lenses_have_a_way_back_everywhere() {
    let mut noise = Noise(54_144_878);
    for _ in 0..1500 {
        let f = 10f64.powf(2.0 * noise.next());
        let mut at = |scale: f64, power: i32| scale * noise.next() * f.powi(-power);
        let table = PhotogrammetricParameters {
            f,
            xp: at(0.1, -1),
            yp: at(0.1, -1),
            k: [at(0.4, 2), at(0.3, 4), at(0.2, 6)],
            p: [at(0.03, 1), at(0.03, 1)],
            a: [at(0.1, 0), at(0.1, 0)],
        };
        let model = Photogrammetric::new(table).unwrap();
        let camera = Camera { lens: model.into(), size: None };
        for i in 0..40 {
            let part = if i < 30 { f64::from(i) / 30.0 } else { 1.0 - 10f64.powi(27 - i) };
            let angle = std::f64::consts::PI * noise.next();
            let radius = model.radius_max() * part;
            let c = Vector2::new(table.xp + radius * angle.cos(), table.yp + radius * angle.sin());
            let bearing = camera.bearing(&c).unwrap_or_else(|e| panic!("{table:?} at {part}: {e}"));
            let back = camera.project(&bearing).unwrap_or_else(|| panic!("{table:?} at {part}: no way back"));
            assert!((back - c).norm() <= 1e-9, "{table:?} at {part}: {:e}", (back - c).norm());
        }
    }
}
