//! Identification: exact contacts, the recorded sets, and inputs of every bad kind. Statistics over many objects:
//! identify_trials.rs.

use crate::real_support::{Set, sets};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use resight_whisker::contact::Method;
use resight_whisker::estimate::{Mode, Status};
use resight_whisker::friction::{Mu, solve_record};
use resight_whisker::identify::{Class, Config, Identification, Reason, Touch, Use, Verdict, identify};
use resight_whisker::{ContactEstimate, Rod, Shape};
use std::f64::consts::{FRAC_PI_2, PI};

/// A contact of the object with a whisker whose outward normal is β: 1 mm along the whisker, 0.2 mm across, 4 mrad.
fn touch(object: &Shape, beta: f64) -> Touch {
    let (n, t) = (Vector2::new(beta.cos(), beta.sin()), Vector2::new(-beta.sin(), beta.cos()));
    let step = 1e-6;
    let height = |angle: f64| object.support_m(Vector2::new(angle.cos(), angle.sin()));
    let slope = (height(beta + step) - height(beta - step)) / (2.0 * step);
    let place = 1e-6 * t * t.transpose() + 4e-8 * n * n.transpose();
    let mut covariance = Matrix3::from_diagonal_element(1.6e-5);
    covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place);
    let x_in_world = height(beta) * n + slope * t;
    let theta_rad = beta - FRAC_PI_2;
    Touch { sweep: 0, x_in_world, theta_rad, side: 1.0, mode: Mode::Mid, covariance, status: Status::Ok }
}

/// Contacts with normals all over the lower side.
fn touches(object: &Shape, n: usize) -> Vec<Touch> {
    (0..n).map(|k| touch(object, -PI + 0.013 + PI * k as f64 / n as f64)).collect()
}

fn found(touches: &[Touch]) -> Identification {
    identify(touches, &Config::default()).expect("a sound configuration")
}

fn value(found: &Identification, name: &str) -> f64 {
    found.parameters.iter().find(|p| p.name == name).unwrap_or_else(|| panic!("{name}: {found:?}")).value
}

fn all() -> Vec<(Class, Shape)> {
    let centre_m = Vector2::new(0.01, 0.16);
    let corner = |degrees: f64| centre_m + 0.04 * Vector2::new(1.0, 0.0).rotated(degrees.to_radians());
    vec![
        (Class::Circle, Shape::Circle { centre_m, radius_m: 0.025 }),
        (Class::Ellipse, Shape::Ellipse { centre_m, semi_axes_m: [0.05, 0.02], angle_rad: 0.3 }),
        (Class::Square, Shape::square(centre_m, 0.06, 0.5)),
        (Class::Rectangle, Shape::Rectangle { centre_m, sides_m: [0.07, 0.04], angle_rad: 0.4 }),
        (
            Class::Polygon,
            Shape::Polygon { corners_m: [10.0, 80.0, 160.0, 225.0, 300.0].map(corner).to_vec() },
        ),
    ]
}

trait Rotated {
    fn rotated(self, angle: f64) -> Self;
}

impl Rotated for Vector2<f64> {
    fn rotated(self, angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Vector2::new(cos * self.x - sin * self.y, sin * self.x + cos * self.y)
    }
}

/// Without noise the answer is the object to a thousandth of the noise it reckons with: outlier floors and starts leave no trace.
#[test]
fn exact_contacts_give_the_exact_object() {
    for (class, object) in all() {
        let found = found(&touches(&object, 240));
        assert_eq!(found.verdict, Verdict::Is(class), "{object:?}: {:?}", found.reason);
        let answer = found.shape.clone().expect("a shape");
        for k in 0..180 {
            let angle = PI + PI * (f64::from(k) + 0.5) / 180.0;
            let n = Vector2::new(angle.cos(), angle.sin());
            let error = (answer.support_m(n) - object.support_m(n)).abs();
            assert!(error < 2e-7, "{class:?} at {angle}: {error:e}");
        }
        assert_eq!((found.coverage.used, found.coverage.gated), (240, 0));
        assert!(found.fits && found.chi2_per_degree_of_freedom < 1e-3 && found.advice.is_empty());
    }
}

/// A rigid motion of the world moves the answer and changes nothing else; and the same input gives the same answer.
#[test]
fn the_answer_moves_with_the_world() {
    let (shift, turn) = (Vector2::new(1.7, -0.4), 2.2_f64);
    for (class, object) in all() {
        let list = touches(&object, 200);
        let rotation = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), turn).into_inner();
        let moved = |touch: &Touch| Touch {
            x_in_world: touch.x_in_world.rotated(turn) + shift,
            theta_rad: touch.theta_rad + turn,
            covariance: rotation * touch.covariance * rotation.transpose(),
            ..*touch
        };
        let (here, there) = (found(&list), found(&list.iter().map(moved).collect::<Vec<_>>()));
        assert_eq!(here, found(&list));
        assert_eq!((here.verdict, there.verdict), (Verdict::Is(class), Verdict::Is(class)));
        for k in 0..60 {
            let angle = PI + PI * (f64::from(k) + 0.5) / 60.0;
            let n = Vector2::new(angle.cos(), angle.sin());
            let moved_n = n.rotated(turn);
            let height = here.shape.as_ref().expect("a shape").support_m(n);
            let moved_height =
                there.shape.as_ref().expect("a shape").support_m(moved_n) - moved_n.dot(&shift);
            assert!((height - moved_height).abs() < 2e-7, "{class:?}");
        }
    }
}

/// One contact in eight somewhere else: left out, counted, and the answer stays.
#[test]
fn outliers_are_left_out_and_counted() {
    for (class, object) in all() {
        let mut list = touches(&object, 240);
        for (k, touch) in list.iter_mut().enumerate().filter(|(k, _)| k % 8 == 3) {
            touch.x_in_world += Vector2::new(0.03 * (k as f64).sin(), 0.03 * (1.7 * k as f64).cos());
            touch.theta_rad += 0.4 * (2.3 * k as f64).sin();
        }
        let found = found(&list);
        assert_eq!(found.verdict, Verdict::Is(class), "{:?}", found.reason);
        let outliers = found.uses.iter().filter(|used| **used == Use::Outlier).count();
        // A few of the thirty land on the outline by chance.
        assert!((26..=30).contains(&outliers), "{class:?} {outliers}");
        assert_eq!(found.coverage.used + found.coverage.gated, 240);
        assert!(found.uses.iter().zip(0..).all(|(used, k)| *used == Use::Used || k % 8 == 3));
    }
}

/// One corner, seen over 60°: its place is reported, its radius bounded, its class not.
#[test]
fn one_corner_is_not_a_class() {
    let square = Shape::square(Vector2::new(0.0, 0.165), 0.06, PI / 4.0);
    let corner = Vector2::new(0.0, 0.165 - 0.06 * 0.5_f64.sqrt());
    let list: Vec<_> = (0..100).map(|k| touch(&square, -FRAC_PI_2 - 0.5 + 0.01 * f64::from(k))).collect();
    let found = found(&list);
    assert_eq!(found.verdict, Verdict::InsufficientCoverage);
    let Some(Reason::OneCorner { corner_in_world, covariance, radius_bound_m }) = &found.reason else {
        panic!("{:?}", found.reason)
    };
    assert!((corner_in_world - corner).norm() < 1e-6);
    assert!(covariance.trace().sqrt() < 2e-4);
    // σ = 0.2 mm, 100 contacts, 60°: the radius is known to 0.2 mm / (√100 · 0.04), the bound is 3.2 of it.
    assert!((1e-4..4e-3).contains(radius_bound_m), "{radius_bound_m}");
    assert_eq!(found.coverage.corners_seen.len(), 1);
    assert!(found.advice.contains("one point"), "{}", found.advice);
}

/// Too few, or all the same: said so, with the numbers.
#[test]
fn too_few_contacts_are_said_to_be_too_few() {
    let circle = Shape::Circle { centre_m: Vector2::zeros(), radius_m: 0.02 };
    for n in 0..6 {
        let found = found(&touches(&circle, n));
        assert_eq!(found.verdict, Verdict::InsufficientCoverage);
        assert_eq!(found.reason, Some(Reason::TooFewContacts { seen: n, needed: 6 }));
        assert!(found.shape.is_none() && found.uses.len() == n);
    }
    for n in [6, 7, 50] {
        let found = found(&vec![touch(&circle, -1.0); n]);
        assert_eq!(found.verdict, Verdict::InsufficientCoverage, "{:?}", found.reason);
    }
    let tips: Vec<_> = touches(&circle, 60).into_iter().map(|t| Touch { mode: Mode::Tip, ..t }).collect();
    assert_eq!(found(&tips).verdict, Verdict::InsufficientCoverage, "tips alone carry no direction");
}

/// Numbers of every size, NaN among them: an answer, finite where it claims to be, in time.
#[test]
fn hostile_numbers_have_an_answer() {
    let wild = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0, -0.0, 1e-300, 1.0, -3.0, 7e5];
    let mut k = 0_usize;
    let mut next = || {
        k = k.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        wild[(k >> 33) % wild.len()]
    };
    let circle = Shape::Circle { centre_m: Vector2::zeros(), radius_m: 0.02 };
    for round in 0..60 {
        let mut list = touches(&circle, 30);
        for touch in list.iter_mut().skip(round % 7).step_by(1 + round % 3) {
            match round % 5 {
                0 => touch.x_in_world = Vector2::new(next(), next()),
                1 => touch.theta_rad = next(),
                2 => touch.covariance = Matrix3::from_fn(|_, _| next()),
                3 => touch.side = next(),
                _ => touch.covariance = Matrix3::zeros(),
            }
        }
        let found = found(&list);
        assert_eq!(found.uses.len(), 30);
        assert!(found.parameters.iter().all(|p| p.value.is_finite() && !p.sigma.is_nan()), "{found:?}");
        assert!(found.scores.iter().all(|s| !s.bic.is_nan()));
    }
}

/// A configuration that asks for nothing is refused; classes not asked for are not answered.
#[test]
fn only_classes_asked_for_are_answered() {
    let list = touches(&all()[2].1, 200);
    let with = |classes: Vec<Class>| identify(&list, &Config { classes, ..Config::default() });
    assert!(with(Vec::new()).expect_err("no classes").to_string().contains("circle, ellipse"));
    let limit = Config { material_ratio: 1.0, ..Config::default() };
    assert!(identify(&list, &limit).is_err());
    let rectangle = with(vec![Class::Rectangle, Class::Circle]).expect("an answer");
    assert_eq!(rectangle.verdict, Verdict::Is(Class::Rectangle));
    let circle = with(vec![Class::Circle]).expect("an answer");
    assert_eq!(circle.verdict, Verdict::InsufficientCoverage);
    assert!(!circle.fits);
}

/// Half the whisker's diameter lies between its centre line and the object.
#[test]
fn the_whisker_has_a_radius() {
    let mut rod = Rod::uniform(0.25, 0.01).expect("a rod");
    rod.diameters_m = [0.002, 0.001];
    let contact = resight_whisker::estimate::Contact {
        x_in_world: Vector2::new(0.1, 0.2),
        theta_rad: FRAC_PI_2,
        s_m: 0.125,
        s_sigma_m: 0.001,
        f_normal_n: 0.1,
        f_tangent_n: 0.0,
        friction_angle_rad: 0.0,
        friction_angle_sigma_rad: 0.01,
        modulus_squared: 0.5,
        covariance: Matrix3::identity(),
    };
    let estimate = ContactEstimate {
        status: Status::Ok,
        mode: Mode::Mid,
        mode_probability: 1.0,
        contact: Some(contact),
        branches: Vec::new(),
    };
    // A positive moment: the object is to the right of the upright whisker, its surface 0.75 mm to the right of the centre line.
    let touch = Touch::from_estimate(3, 0.01, &estimate, &rod).expect("a touch");
    assert!((touch.x_in_world - Vector2::new(0.10075, 0.2)).norm() < 1e-15);
    assert_eq!((touch.sweep, touch.side, touch.normal_angle_rad()), (3, 1.0, PI));
}

fn recorded(set: &Set, sweeps: &[u32], mu: Mu) -> Vec<Touch> {
    let samples: Vec<_> = set.noisy.iter().filter(|s| sweeps.contains(&s.sweep)).copied().collect();
    let record = solve_record(&set.rod, &set.cell, &samples, mu, Method::Auto).expect("a record");
    let touch = |(sample, estimate): (&resight_whisker::Sample, &ContactEstimate)| {
        Touch::from_estimate(sample.sweep, sample.load.mz_n_m, estimate, &set.rod)
    };
    samples.iter().zip(&record.estimates).filter_map(touch).collect()
}

fn class_of(set: &Set) -> Class {
    match set.name {
        name if name.contains("square") => Class::Square,
        name if name.contains("ellipse") => Class::Ellipse,
        _ => Class::Circle,
    }
}

/// The recorded objects: right from three sweeps, with and without the columns of θ; never wrong from one.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn the_recorded_objects_are_identified() {
    let sets = sets();
    for set in &sets {
        let list = recorded(set, &[0, 1, 2], Mu::Auto);
        let found = found(&list);
        assert_eq!(found.verdict, Verdict::Is(class_of(set)), "{}: {:?}", set.name, found.reason);
        let sizes: Vec<_> = found
            .parameters
            .iter()
            .map(|p| format!("{} {:.3} ± {:.3}", p.name, 1e3 * p.value, 1e3 * p.sigma))
            .collect();
        println!("{}: {} mm, mrad; χ²/n {:.2}", set.name, sizes.join(", "), found.chi2_per_degree_of_freedom);
        for (name, truth) in truth_of(set) {
            // 0.1 mm, 0.15°.
            let bar = if name == "angle_rad" { 0.15_f64.to_radians() } else { 1e-4 };
            let error = value(&found, name) - truth;
            let error =
                if name == "angle_rad" { error - FRAC_PI_2 * (error / FRAC_PI_2).round() } else { error };
            assert!(error.abs() < bar, "{} {name}: {error:e}", set.name);
        }
        for sweep in 0..3 {
            let verdict =
                identify(&recorded(set, &[sweep], Mu::Auto), &Config::default()).expect("an answer").verdict;
            println!("  sweep {sweep} alone: {verdict:?}");
            assert!([Verdict::Is(class_of(set)), Verdict::InsufficientCoverage].contains(&verdict));
        }
        let plain: Vec<_> = list.iter().map(without_theta).collect();
        let verdict = identify(&plain, &Config::default()).expect("an answer").verdict;
        assert_eq!(verdict, Verdict::Is(class_of(set)), "{} without θ's columns", set.name);
    }
}

fn without_theta(touch: &Touch) -> Touch {
    let place: Matrix2<f64> = touch.covariance.fixed_view::<2, 2>(0, 0).into_owned();
    Touch { covariance: Touch::covariance_without_theta(&place), ..*touch }
}

fn truth_of(set: &Set) -> Vec<(&'static str, f64)> {
    match set.name {
        "f1_square_00" => vec![("side_m", 0.06), ("angle_rad", 0.0), ("centre_y_m", 0.165)],
        "f2_square_30" => vec![("side_m", 0.06), ("angle_rad", PI / 6.0), ("centre_y_m", 0.165)],
        "f5_taper_ellipse" => {
            vec![("semi_axis_a_m", 0.05), ("semi_axis_b_m", 0.02), ("angle_rad", PI / 9.0)]
        }
        "f6_slipoff_peg" => vec![("radius_m", 0.003), ("centre_x_m", 0.0), ("centre_y_m", 0.22)],
        _ => vec![("radius_m", 0.025), ("centre_x_m", 0.0), ("centre_y_m", 0.16)],
    }
}
