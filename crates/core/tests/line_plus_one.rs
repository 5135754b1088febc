//! The bars of the line-plus-one solver: what a user may rely on, on 20,000 random problems a bar.
//!
//! Layout and range of the paper's own experiment: f = 1000 px, line at 0, 1, 2 m, the fourth point 1 m off its end, the
//! target 4–15 m away in the camera's field, attitude uniform on SO(3).

use crate::common::Rng;
use nalgebra::{Rotation3, Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::refine::refine;
use resight_core::locate::{Config, Method, PoseEstimate, locate};
use resight_core::{Camera, CameraMatrix, Correspondence, Error, Lens, Matrix6, Point, Pose, Vector6};

const N: usize = 20_000;
const POINTS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
const CENTRE: [f64; 3] = [0.75, 0.25, 0.0];

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

struct Problem {
    cam_from_target: Pose,
    seen: Vec<Correspondence>,
}

/// A target in view, its pixels disturbed by `noise_px` and labelled with the same sigma (1e-3 px where exact).
fn problem(rng: &mut Rng, range_m: (f64, f64), noise_px: f64) -> Problem {
    let camera = camera();
    loop {
        let z = rng.uniform(range_m.0, range_m.1);
        let centre_in_cam = Vector3::new(rng.uniform(-0.5, 0.5) * z, rng.uniform(-0.4, 0.4) * z, z);
        let rotation = rng.rotation();
        let cam_from_target = Pose::new(rotation, centre_in_cam - rotation * Vector3::from(CENTRE));
        let sigma_px = noise_px.max(1e-3);
        let seen: Option<Vec<_>> = POINTS
            .iter()
            .map(|x| {
                let x = Point::from(*x);
                let pixel = camera.project(&(cam_from_target * x))?
                    + Vector2::new(rng.normal(), rng.normal()) * noise_px;
                let in_image = (-100.0..1380.0).contains(&pixel.x) && (-100.0..1060.0).contains(&pixel.y);
                in_image.then(|| Correspondence::new(&camera, x, pixel, sigma_px).ok())?
            })
            .collect();
        if let Some(seen) = seen {
            return Problem { cam_from_target, seen };
        }
    }
}

fn auto(seen: &[Correspondence]) -> PoseEstimate {
    let estimate = locate(seen, &camera(), &Config::default()).expect("a pose");
    assert_eq!(estimate.method, Method::LinePlusOne);
    estimate
}

/// None where the rotation is known to a radian only, which is refused by name.
fn answered(seen: &[Correspondence]) -> Option<PoseEstimate> {
    match locate(seen, &camera(), &Config::default()) {
        Err(Error::DegenerateView { reason, needed: 1.0, .. }) if reason.contains("radian") => None,
        answer => Some(answer.expect("a pose")),
    }
}

fn squared_mahalanobis(error: &Vector6, covariance: &Matrix6) -> f64 {
    error.dot(&(covariance.try_inverse().expect("positive definite") * error))
}

#[test]
fn exact_data_give_the_true_pose_first_when_unique() {
    let mut rng = Rng::new(1);
    let mut ambiguous = 0;
    for _ in 0..N {
        let p = problem(&mut rng, (4.0, 15.0), 0.0);
        let e = auto(&p.seen);
        let is_true = |pose: &Pose| pose.angle_to_rad(&p.cam_from_target) < 1e-6;
        match e.ambiguity {
            Ambiguity::Unique { .. } => assert!(is_true(&e.cam_from_target)),
            Ambiguity::Ambiguous { other, .. } => {
                ambiguous += 1;
                assert!(is_true(&e.cam_from_target) || is_true(&other.cam_from_target));
            }
        }
    }
    assert!(ambiguous < N / 1000, "{ambiguous} of {N} exact problems called ambiguous");
}

/// Of the minima given: where two fit, the answer is the more probable, which need not be the lowest.
fn lowest_chi2(e: &PoseEstimate) -> f64 {
    e.minima().map(|h| h.minimum.chi2).fold(f64::INFINITY, f64::min)
}

/// The optimum to find is the best of 25 refinements: from the truth and from 24 random attitudes at the true place.
fn global_optimum_chi2(rng: &mut Rng, p: &Problem) -> f64 {
    let centre = Vector3::from(CENTRE);
    let centre_in_cam = p.cam_from_target * centre;
    let mut best = f64::INFINITY;
    for i in 0..25 {
        let rotation = if i == 0 { p.cam_from_target.rotation } else { rng.rotation() };
        let start = Pose::new(rotation, centre_in_cam - rotation * centre);
        if let Ok(m) = refine(&start, &p.seen, &camera()) {
            best = best.min(m.chi2);
        }
    }
    best
}

/// The reprojection error's global optimum is found; and a unique answer is not off by more than 5 of its own σ, in any
/// of the six printed standard deviations, in more than one problem of a thousand. As one Mahalanobis distance the six
/// exceed 5 in 0.03 % by chance alone; nearly frontal views at long range, whose likelihood no ellipsoid describes, add to it.
fn optimum_is_found(noise_px: f64, misses_allowed: usize, far_allowed: usize) {
    let (mut rng, mut starts) = (Rng::new(2), Rng::new(77));
    let (mut misses, mut wrong, mut far, mut refused) = (0, 0, 0, 0);
    for _ in 0..N {
        let p = problem(&mut rng, (4.0, 15.0), noise_px);
        let Some(e) = answered(&p.seen) else {
            refused += 1;
            continue;
        };
        let optimum = global_optimum_chi2(&mut starts, &p);
        misses += usize::from(optimum + 1e-6 * (1.0 + optimum) < lowest_chi2(&e));
        if let Ambiguity::Unique { .. } = e.ambiguity {
            let error = (e.cam_from_target * p.cam_from_target.inverse()).log();
            wrong += usize::from((0..6).any(|i| 25.0 * e.covariance[(i, i)] < error[i] * error[i]));
            far += usize::from(25.0 < squared_mahalanobis(&error, &e.covariance));
        }
    }
    println!(
        "{noise_px} px: {misses} misses, {wrong} unique and wrong, {far} beyond Mahalanobis 5, {refused} refused, of {N}"
    );
    assert!(refused <= N / 100, "{refused} of {N} known to a radian only");
    assert!(misses <= misses_allowed, "{misses} misses of {N}, {misses_allowed} allowed");
    assert!(wrong <= N / 1000, "{wrong} of {N} unique and off by more than 5 σ");
    assert!(far <= far_allowed, "{far} of {N} unique and beyond Mahalanobis 5");
}

#[test]
fn global_optimum_at_a_tenth_of_a_pixel() {
    optimum_is_found(0.1, 2, 20);
}

#[test]
fn global_optimum_at_half_a_pixel() {
    optimum_is_found(0.5, 3, 40);
}

#[test]
fn global_optimum_at_one_pixel() {
    optimum_is_found(1.0, 4, 80);
}

/// The box: 2–6 m, σ ≤ 0.5 px, unambiguous. Variance over the Cramér–Rao bound at the true pose, and NEES, apart from flips:
/// a gate of three standard deviations lets the wrong minimum win by chance now and then, which is counted and bounded.
#[test]
fn efficient_and_consistent_in_the_box() {
    for noise_px in [0.1, 0.3, 0.5] {
        let mut rng = Rng::new(3);
        let (mut rotation, mut translation, mut nees, mut covered, mut n, mut flips) =
            (0.0, 0.0, 0.0, 0, 0, 0);
        for _ in 0..N {
            let p = problem(&mut rng, (2.0, 6.0), noise_px);
            let Some(e) = answered(&p.seen) else { continue };
            if let Ambiguity::Ambiguous { .. } = e.ambiguity {
                continue;
            }
            if 0.5 < e.cam_from_target.angle_to_rad(&p.cam_from_target) {
                flips += 1;
                continue;
            }
            let bound = cramer_rao_bound(&p, noise_px);
            let error = (e.cam_from_target * p.cam_from_target.inverse()).log();
            rotation += error.fixed_rows::<3>(0).norm_squared() / bound.fixed_view::<3, 3>(0, 0).trace();
            translation += error.fixed_rows::<3>(3).norm_squared() / bound.fixed_view::<3, 3>(3, 3).trace();
            let squared = squared_mahalanobis(&error, &e.covariance);
            nees += squared;
            covered += usize::from(squared < 12.592); // χ²₆ at 95 %
            n += 1;
        }
        let per = |x: f64| x / n as f64;
        let (rotation, translation, nees, coverage) =
            (per(rotation), per(translation), per(nees), per(covered as f64));
        println!(
            "{noise_px} px: {n} of {N} unique and {flips} flips, variance/CRB {rotation:.3} {translation:.3}, NEES {nees:.3}, 95 % covers {coverage:.4}"
        );
        assert!(flips <= N / 5000, "{flips} flips");
        assert!(rotation < 1.05 && translation < 1.05, "{rotation} {translation}");
        assert!((5.7..6.3).contains(&nees), "{nees}");
        assert!((0.94..0.96).contains(&coverage), "{coverage}");
    }
}

/// (JᵀJ/σ²)⁻¹ at the true pose, from exact pixels.
fn cramer_rao_bound(p: &Problem, noise_px: f64) -> Matrix6 {
    let camera = camera();
    let exact: Vec<_> = p
        .seen
        .iter()
        .map(|c| {
            let pixel = camera.project(&(p.cam_from_target * c.x_in_target)).expect("in front");
            Correspondence::new(&camera, c.x_in_target, pixel, noise_px).expect("in the field")
        })
        .collect();
    refine(&p.cam_from_target, &exact, &camera).expect("a minimum").covariance
}

#[test]
fn any_order_of_the_points_gives_the_same_answer() {
    let mut rng = Rng::new(4);
    for _ in 0..200 {
        let p = problem(&mut rng, (2.0, 6.0), 0.3);
        let first = auto(&p.seen);
        for order in [[3, 0, 1, 2], [1, 3, 2, 0], [2, 1, 0, 3], [0, 2, 3, 1]] {
            let seen = order.map(|i: usize| p.seen[i]);
            let e = auto(&seen);
            assert!(e.cam_from_target.angle_to_rad(&first.cam_from_target) < 1e-6);
            assert!((e.chi2 - first.chi2).abs() < 1e-6);
        }
    }
}

/// Table II as printed, with the nominal target L1 = 10, L2 = 15, G3 = (0, 15, 0): 0.08° and 0.12°, where the printed
/// procedure is 2.5° and 18.8° off (`wang2004`). The focal lengths are those recovered in docs/math/wang2004.md.
#[test]
fn table_two_to_a_tenth_of_a_degree() {
    let target = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [15.0, 0.0, 0.0], [0.0, 15.0, 0.0]];
    let one = [[-0.2361, -0.1180], [-0.2921, -0.2101], [-0.3209, -0.2574], [-0.1542, -0.2278]];
    let two = [[-0.2016, -0.1210], [-0.2170, -0.1892], [-0.2249, -0.2246], [-0.1336, -0.1827]];
    let cases = [
        (3.54144878, one, [45.0, 30.0, 60.0], 0.08, 2.46),
        (2.01646963, two, [53.0, 37.0, 81.0], 0.12, 18.8),
    ];
    for (f, pixels, angles_deg, limit_deg, printed_deg) in cases {
        let matrix = CameraMatrix { fx_px: -f, fy_px: -f, cx_px: 0.0, cy_px: 0.0 };
        let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
        let seen: Vec<_> = (0..4)
            .map(|i| {
                Correspondence::new(&camera, Point::from(target[i]), pixels[i].into(), 2.9e-5)
                    .expect("in the field")
            })
            .collect();
        let [x, y, z] = angles_deg.map(f64::to_radians);
        let truth = Pose::new(Rotation3::from_euler_angles(x, y, z).into_inner(), Vector3::zeros());
        let error_deg = |method| {
            let e = locate(&seen, &camera, &Config { method, ..Config::default() }).expect("a pose");
            e.cam_from_target.angle_to_rad(&truth).to_degrees()
        };
        let (ours, literal) = (error_deg(Method::Auto), error_deg(Method::Wang2004));
        assert!(ours <= limit_deg, "{ours}°");
        assert!((literal / printed_deg - 1.0).abs() < 0.05, "literal {literal}°, expected {printed_deg}°");
    }
}

/// From the plane through the fourth point perpendicular to the line both poses fit exactly: both come back, and why.
#[test]
fn the_critical_plane_is_named_and_both_poses_returned() {
    let camera = camera();
    let mut rng = Rng::new(5);
    for _ in 0..500 {
        let turn = Pose::new(rng.rotation(), Vector3::zeros());
        // The camera centre at abscissa 0.8, the foot of the fourth point.
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.8, 1.2, 0.0]].map(Point::from);
        let (angle, range) = (rng.uniform(0.0, std::f64::consts::TAU), rng.uniform(3.0, 6.0));
        let centre = Point::new(0.8, range * angle.cos(), range * angle.sin());
        let forward = (Point::new(1.0, 0.3, 0.0) - centre).normalize();
        let right = forward.cross(&turn.rotation.column(0)).normalize();
        let rotation = nalgebra::Matrix3::from_rows(&[
            right.transpose(),
            forward.cross(&right).transpose(),
            forward.transpose(),
        ]);
        let truth = Pose::new(rotation, -(rotation * centre));
        let seen: Vec<_> = points
            .iter()
            .map(|x| {
                let pixel = camera.project(&(truth * *x)).expect("in front");
                Correspondence::new(&camera, *x, pixel, 0.3).expect("in the field")
            })
            .collect();
        let e = auto(&seen);
        let Ambiguity::Ambiguous { other, .. } = e.ambiguity else { continue };
        let near = |pose: &Pose| pose.angle_to_rad(&truth) < 1e-5;
        assert!(near(&e.cam_from_target) || near(&other.cam_from_target));
        assert!(other.chi2 < 1e-6 || !near(&e.cam_from_target), "the mirror pose fits exactly");
        assert!(e.weakness.is_some(), "{e:?}");
    }
}

/// Views with three or more minima in which the closed form's two candidates once led past the lowest.
#[test]
fn the_lowest_of_three_minima_is_found() {
    let target = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let views = [
        [[363.1419, 449.0841], [427.5669, 430.8297], [491.6043, 412.1405], [400.3012, 574.5039]],
        [[835.5529, 323.0716], [860.2855, 225.2788], [887.5034, 120.2478], [647.5878, 279.3515]],
        [[1122.8714, 272.4162], [1136.0019, 314.6431], [1149.5363, 356.907], [1031.6143, 302.8196]],
    ];
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
    let mut rng = Rng::new(6);
    for view in views {
        let seen: Vec<_> = target
            .iter()
            .zip(view)
            .map(|(x, u)| Correspondence::new(&camera, Point::from(*x), u.into(), 0.5).expect("in the field"))
            .collect();
        let e = locate(&seen, &camera, &Config::default()).expect("a pose");
        let centre = Point::new(0.4, 0.25, 0.0);
        let centre_in_cam = e.cam_from_target * centre;
        for _ in 0..200 {
            let rotation = rng.rotation();
            let start = Pose::new(rotation, centre_in_cam - rotation * centre);
            if let Ok(m) = refine(&start, &seen, &camera) {
                assert!(lowest_chi2(&e) < m.chi2 + 1e-6, "{} above {}", lowest_chi2(&e), m.chi2);
            }
        }
    }
}
