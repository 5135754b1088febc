//! Degenerate and hostile inputs give a named error or the right pose: never NaN, never a panic, never a quiet wrong answer.
//! Random garbage: `fuzz.rs`.

use crate::common::{Rng, views};
use nalgebra::{Unit, Vector2, Vector3};
use resight_core::correspondence::{Detection, correspond};
use resight_core::locate::consistency::Consistency;
use resight_core::locate::{Config, Method, PoseEstimate, locate};
use resight_core::target::{Feature, LinePlusOne, NamedPoint};
use resight_core::{Correspondence, Error, Matrix6, Point, Pose, Target, Vector6};

const SIGMA_PX: f64 = 0.1;
const METHODS: [Method; 6] =
    [Method::Auto, Method::Wang2004, Method::LinePlusOne, Method::P3p, Method::Planar, Method::Sqpnp];

type Answer = Result<PoseEstimate, Error>;

fn solve(seen: &[Correspondence]) -> Answer {
    locate(seen, &views::camera(), &Config::default())
}

fn exact(points: &[Point]) -> Vec<Correspondence> {
    views::seen_from(&views::oblique(), points, SIGMA_PX)
}

/// Largest distance between a target point in the camera frame and where it should be, over the size of the scene.
fn misplaced(pose: &Pose, truth: &Pose, points: &[Point]) -> f64 {
    let size = points.iter().map(|x| (truth * x).norm()).fold(0.0, f64::max);
    points.iter().map(|x| (pose * x - truth * x).norm()).fold(0.0, f64::max) / size
}

/// Every pose of an answer that fits, each with its covariance; three points fit several alike.
fn poses(e: &PoseEstimate) -> Vec<(Pose, Matrix6)> {
    let fitting = e.minima().filter(|h| h.is_alternative);
    fitting.map(|h| (h.minimum.cam_from_target, h.minimum.covariance)).collect()
}

/// The pose of an answer nearest in rotation to a given one.
fn nearest(e: &PoseEstimate, to: &Pose) -> (Pose, Matrix6) {
    let angle = |p: &(Pose, Matrix6)| p.0.angle_to_rad(to);
    poses(e).into_iter().min_by(|a, b| angle(a).total_cmp(&angle(b))).expect("at least one")
}

/// The true pose is the answer, or one of those of an ambiguous answer.
fn is_correct(answer: &Answer, truth: &Pose, points: &[Point], tolerance: f64) -> bool {
    let Ok(e) = answer else { return false };
    poses(e).iter().any(|(pose, _)| misplaced(pose, truth, points) < tolerance)
}

/// Says that something is wrong: an error, or a residual called inconsistent.
fn is_refused(answer: &Answer) -> bool {
    answer.as_ref().map_or(true, |e| matches!(e.consistency, Consistency::Inconsistent { .. }))
}

type Change = (&'static str, fn(&mut Correspondence, f64));

#[test]
fn a_number_that_is_none_is_named_in_every_field_of_every_point() {
    let fields: [Change; 10] = [
        ("the position", |c, x| c.x_in_target.x = x),
        ("the position", |c, x| c.x_in_target.y = x),
        ("the position", |c, x| c.x_in_target.z = x),
        ("the pixel", |c, x| c.pixel.x = x),
        ("the pixel", |c, x| c.pixel.y = x),
        ("the bearing", |c, x| c.bearing = Unit::new_unchecked(Vector3::new(x, 0.0, 1.0))),
        ("the bearing", |c, x| c.bearing = Unit::new_unchecked(Vector3::new(0.0, x, 1.0))),
        ("the bearing", |c, x| c.bearing = Unit::new_unchecked(Vector3::new(0.0, 0.0, x))),
        ("sigma_px", |c, x| c.sigma_px = x),
        ("sigma_m", |c, x| c.sigma_m = x),
    ];
    for (name, points) in views::all() {
        for method in METHODS {
            for index in 0..points.len() {
                for (what, change) in fields {
                    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                        let mut seen = exact(&points);
                        change(&mut seen[index], x);
                        let answer = locate(&seen, &views::camera(), &Config { method, ..Config::default() });
                        assert_eq!(answer, Err(Error::NotFinite { what, index }), "{name} {method:?} {x}");
                    }
                }
            }
        }
    }
}

#[test]
fn fewer_than_three_points_are_too_few_for_every_method() {
    for method in METHODS {
        for n in 0..3 {
            let seen = exact(&views::general()[..n]);
            let answer = locate(&seen, &views::camera(), &Config { method, ..Config::default() });
            assert_eq!(answer, Err(Error::TooFewPoints { seen: n, needed: 3 }));
        }
    }
}

#[test]
fn a_sigma_that_is_zero_or_negative_is_refused() {
    for (_, points) in views::all() {
        for sigma in [0.0, -0.0, -1.0, -f64::MIN_POSITIVE] {
            let mut seen = exact(&points);
            seen[1].sigma_px = sigma;
            assert_eq!(solve(&seen), Err(Error::NotPositive { index: 1, seen: sigma }));
        }
        let mut seen = exact(&points);
        seen[1].sigma_m = -1e-3;
        assert_eq!(solve(&seen), Err(Error::NotPositive { index: 1, seen: -1e-3 }));
    }
}

/// A place seen twice is two observations of it: at pixels far apart they contradict each other, at one they agree, and where too few
/// other places are left, that is what is wrong. (Places seen twice in earnest: `repeated.rs`.)
#[test]
fn a_place_at_two_pixels_contradicts_itself() {
    for (name, points) in views::all() {
        let mut seen = exact(&points);
        let last = seen.len() - 1;
        seen[last].x_in_target = seen[0].x_in_target;
        assert!(is_refused(&solve(&seen)), "{name}, two pixels: {:?}", solve(&seen));
        seen[last] = seen[0];
        match (name, solve(&seen)) {
            ("three", answer) => assert_eq!(answer, Err(Error::TooFewPoints { seen: 2, needed: 3 })),
            ("line_plus_one", answer) => {
                assert!(matches!(answer, Err(Error::Collinear { .. })), "{answer:?}")
            }
            (_, answer) => {
                assert!(is_correct(&answer, &views::oblique(), &points, 1e-6), "{name}: {answer:?}")
            }
        }
    }
}

/// Two marks may lie on one line of sight, but these do not: the label of one slipped, and the residual says so.
#[test]
fn a_pixel_given_to_two_points_is_never_a_quiet_answer() {
    for (name, points) in views::all().into_iter().skip(1) {
        let mut seen = exact(&points);
        (seen[1].pixel, seen[1].bearing) = (seen[3].pixel, seen[3].bearing);
        assert!(is_refused(&solve(&seen)), "{name}: {:?}", solve(&seen));
    }
}

#[test]
fn points_on_one_line_are_refused_by_name() {
    for n in [3, 4, 8] {
        let along = Vector3::new(0.3, 0.2, 0.1);
        let points: Vec<Point> = (0..n).map(|i| along * (i as f64 + 0.1 * (i * i) as f64)).collect();
        for method in METHODS {
            let answer = locate(&exact(&points), &views::camera(), &Config { method, ..Config::default() });
            assert!(matches!(answer, Err(Error::Collinear { .. })), "{n} points, {method:?}: {answer:?}");
        }
    }
}

#[test]
fn a_fourth_point_on_the_line_is_refused_in_the_points_and_in_the_target_file() {
    let mut points = views::line_plus_one();
    points[3] = Point::new(0.25, 0.0, 0.0);
    assert!(matches!(solve(&exact(&points)), Err(Error::Collinear { .. })));
    let target = Target::LinePlusOne(LinePlusOne { line_m: [0.0, 0.6, 1.0], off_m: [0.25, 0.0] });
    assert!(matches!(target.check(), Err(Error::InvalidTarget { parameter: "off_m[1]", .. })));
}

/// A flat target behind the lens, drawn by the pinhole formula, is also one in front of it: −x = −R X − t, and the
/// reflection −R of a plane is a rotation of it. In space there is no such pose.
#[test]
fn points_behind_the_camera_have_no_pose_unless_they_are_flat() {
    let look_away = Pose::exp(&Vector6::new(0.0, std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0));
    let behind = look_away * views::oblique();
    for (name, points) in views::all().into_iter().skip(1) {
        let answer = solve(&views::seen_from(&behind, &points, SIGMA_PX));
        if name == "general" {
            assert!(is_refused(&answer), "{answer:?}");
            continue;
        }
        let e = answer.expect("the mirrored plane");
        assert!(points.iter().all(|x| 0.0 < (e.cam_from_target * *x).z), "{name}");
        assert!(e.rms_px < 1e-6, "{name}: {}", e.rms_px);
    }
}

#[test]
fn one_point_of_eight_behind_the_camera_is_inconsistent() {
    let mut points = views::general();
    points[4] = views::oblique().inverse() * Point::new(0.3, 0.2, -2.0);
    let answer = solve(&exact(&points));
    assert!(is_refused(&answer), "{answer:?}");
}

/// Rotation and relative place come out alike at every unit of length, and so does the covariance.
#[test]
fn coordinates_of_a_billionth_and_a_billion_lose_nothing() {
    for (name, points) in views::all() {
        let seen = views::disturbed(&mut Rng::new(11), &exact(&points));
        for scale in [1e-9, 1e-3, 1e3, 1e9] {
            agree(&format!("{name} {scale}"), &seen, |x| x * scale, scale);
        }
    }
}

/// Survey coordinates: 5e6 m away from the origin a coordinate is rounded to 1e-9 m, and no digit more is lost.
#[test]
fn an_offset_of_five_thousand_kilometres_loses_nothing_but_its_own_rounding() {
    let offset = Vector3::new(5e6, 4.1e5, 130.0);
    for (name, points) in views::all() {
        // Rounded as survey coordinates are, so that both problems have the same points.
        let near: Vec<Point> = points.iter().map(|x| (x + offset) - offset).collect();
        let seen = views::disturbed(&mut Rng::new(12), &exact(&near));
        agree(name, &seen, |x| x + offset, 1.0);
    }
}

/// Both poses and covariances agree with those of the changed target, lengths in units of `scale`.
fn agree(name: &str, seen: &[Correspondence], change: impl Fn(&Point) -> Point, scale: f64) {
    let changed: Vec<_> =
        seen.iter().map(|c| Correspondence { x_in_target: change(&c.x_in_target), ..*c }).collect();
    let (here, there) = (solve(seen).expect("a pose"), solve(&changed).expect("a pose"));
    assert_eq!(here.method, there.method);
    assert_eq!(poses(&here).len(), poses(&there).len(), "{name}");
    for (pose, covariance) in poses(&here) {
        let (changed_pose, changed_covariance) = nearest(&there, &pose);
        let angle = pose.angle_to_rad(&changed_pose);
        assert!(angle < 1e-7, "{name}: {angle} rad");
        for (c, d) in seen.iter().zip(&changed) {
            let apart = (pose * c.x_in_target - changed_pose * d.x_in_target / scale).norm();
            assert!(apart < 3e-7, "{name}: {apart} m");
        }
        for i in 0..6 {
            let unit = if i < 3 { 1.0 } else { scale * scale };
            let ratio = changed_covariance[(i, i)] / (unit * covariance[(i, i)]);
            assert!((ratio - 1.0).abs() < 1e-5, "{name}: variance {i} {ratio}");
        }
    }
}

/// All image points lie on one line there; three collinear points and one off it, and points in a plane, still have a pose.
#[test]
fn a_camera_in_the_plane_of_the_points_sees_its_pose() {
    let mut rng = Rng::new(13);
    for (name, points) in [
        ("line_plus_one", views::line_plus_one()),
        (
            "square",
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| Point::new(x, y, 0.0)).to_vec(),
        ),
        ("planar", views::planar()),
    ] {
        let (mut found, mut tried) = (0, 0);
        while tried < 300 {
            let (angle, range) = (rng.uniform(0.0, std::f64::consts::TAU), rng.uniform(2.0, 6.0));
            let off_plane = [0.0, 1e-12, 1e-6][rng.index(3)];
            let centre = Point::new(0.5 + range * angle.cos(), 0.4 + range * angle.sin(), off_plane);
            let truth = views::looking_at(centre, Point::new(0.5, 0.4, rng.uniform(-0.2, 0.2)));
            let exact = views::seen_from(&truth, &points, SIGMA_PX);
            let end_on = exact[0].bearing.cross(&exact[2].bearing).norm() < 0.1;
            if name == "line_plus_one" && end_on {
                continue; // its own test, below
            }
            tried += 1;
            let answer = solve(&exact);
            found += usize::from(is_correct(&answer, &truth, &points, 1e-6));
            let e = solve(&views::disturbed(&mut rng, &exact)).expect("a pose");
            assert!(!matches!(e.consistency, Consistency::Inconsistent { .. }), "{name} {centre:?}");
        }
        println!("{name}: {found} of {tried}");
        assert_eq!(found, tried, "{name}");
    }
}

/// Seen end on the line is a point: its pose is correct, or the answer says that the view is weak or cannot be solved.
#[test]
fn a_line_through_the_camera_centre_is_found_or_named() {
    let points = views::line_plus_one();
    for off_axis in [0.0, 1e-12, 1e-6, 1e-3] {
        let truth = views::looking_at(Point::new(4.0, off_axis, 0.3 * off_axis), Point::new(0.5, 0.2, 0.0));
        let answer = solve(&views::seen_from(&truth, &points, SIGMA_PX));
        match &answer {
            Ok(e) => assert!(
                e.weakness.is_some()
                    && is_correct(&answer, &truth, &points, 10.0 * e.covariance.diagonal().max().sqrt()),
                "{off_axis}: {answer:?}"
            ),
            Err(Error::Coincident { .. } | Error::DegenerateView { .. } | Error::NoSolution { .. }) => {}
            Err(other) => panic!("{off_axis}: {other}"),
        }
    }
}

#[test]
fn a_covariance_of_intrinsics_that_cannot_be_one_is_refused() {
    let seen = exact(&views::general());
    let given = |covariance: &[f64]| {
        let config = Config { intrinsics_covariance: Some(covariance), ..Config::default() };
        locate(&seen, &views::camera(), &config)
    };
    let mut covariance = [0.0; 16];
    assert!(given(&covariance).is_ok());
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        covariance[5] = bad;
        assert!(matches!(given(&covariance), Err(Error::InvalidCamera { .. })), "{bad}");
    }
    assert!(matches!(given(&[1.0; 15]), Err(Error::InvalidCamera { .. })));
}

/// The kind of refusal, as a word.
fn refusal(answer: &Answer) -> &'static str {
    match answer {
        Err(Error::TooFewPoints { .. }) => "too few",
        Err(Error::NotFinite { .. }) => "not finite",
        Err(Error::Coincident { .. }) => "coincident",
        Err(Error::Collinear { .. }) => "collinear",
        Err(Error::NoSolution { .. }) => "no pose fits",
        Ok(e) if matches!(e.consistency, Consistency::Inconsistent { .. }) => "no pose fits",
        _ => "not refused",
    }
}

/// 15 bad inputs that have no pose: name, answer, expected refusal.
fn without_a_pose() -> Vec<(&'static str, Answer, &'static str)> {
    let eight = exact(&views::general());
    let with = |n: usize, change: &dyn Fn(&mut [Correspondence])| {
        let mut seen = eight[..n].to_vec();
        change(&mut seen);
        solve(&seen)
    };
    let line = |n: usize| {
        let points: Vec<Point> = (0..n).map(|i| Point::new(0.1 * (i * i + i) as f64, 0.0, 0.0)).collect();
        solve(&exact(&points))
    };
    let mut one_behind = views::general();
    one_behind[4] = views::oblique().inverse() * Point::new(0.3, 0.2, -2.0);
    let look_away = Pose::exp(&Vector6::new(0.0, std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0));
    let all_behind = views::seen_from(&(look_away * views::oblique()), &views::general(), SIGMA_PX);
    vec![
        ("n = 2", with(2, &|_| ()), "too few"),
        ("n = 1", with(1, &|_| ()), "too few"),
        ("n = 0", with(0, &|_| ()), "too few"),
        ("NaN in X, n = 8", with(8, &|s| s[3].x_in_target.y = f64::NAN), "not finite"),
        ("NaN in u, n = 8", with(8, &|s| s[3].pixel.x = f64::NAN), "not finite"),
        ("inf in X, n = 8", with(8, &|s| s[3].x_in_target.y = f64::INFINITY), "not finite"),
        ("inf in u, n = 8", with(8, &|s| s[3].pixel.x = f64::INFINITY), "not finite"),
        ("NaN in X, n = 4", with(4, &|s| s[3].x_in_target.y = f64::NAN), "not finite"),
        ("same X, two pixels", with(4, &|s| s[3].x_in_target = s[1].x_in_target), "no pose fits"),
        ("4 identical", with(4, &|s| s.fill(s[0])), "too few"),
        ("all zeros", with(4, &|s| s.iter_mut().for_each(|c| c.x_in_target = Point::zeros())), "too few"),
        ("4 collinear", line(4), "collinear"),
        ("8 collinear", line(8), "collinear"),
        ("all behind", solve(&all_behind), "no pose fits"),
        ("1 of 8 behind", solve(&exact(&one_behind)), "no pose fits"),
    ]
}

/// The first three of the general points, again and again.
fn repeated(n: usize) -> Answer {
    let seen = exact(&views::general()[..3]);
    solve(&(0..n).map(|i| seen[i % 3]).collect::<Vec<_>>())
}

/// 8 awkward inputs that have one: name, answer, true pose, points, tolerance.
fn with_a_pose() -> Vec<(&'static str, Answer, Pose, Vec<Point>, f64)> {
    let (truth, all) = (views::oblique(), views::general());
    let moved = |name, change: &dyn Fn(&Point) -> Point, truth: Pose, tolerance| {
        let seen: Vec<_> = exact(&all)
            .iter()
            .map(|c| Correspondence { x_in_target: change(&c.x_in_target), ..*c })
            .collect();
        (name, solve(&seen), truth, seen.iter().map(|c| c.x_in_target).collect(), tolerance)
    };
    let scaled = |s: f64| Pose::new(truth.rotation, truth.translation * s);
    let offset = Vector3::new(5e6, 5e6, 0.0);
    let elsewhere = Pose::new(truth.rotation, truth.translation - truth.rotation * offset);
    let in_plane = views::looking_at(Point::new(3.0, -1.0, 0.0), Point::new(0.5, 0.4, 0.1));
    let flat = views::planar();
    vec![
        ("n = 3", solve(&exact(&views::three())), truth, views::three(), 1e-9),
        ("lengths 7 and 8", seven_points_eight_pixels(), truth, all[..7].to_vec(), 1e-9),
        (
            "camera in target plane",
            solve(&views::seen_from(&in_plane, &flat, SIGMA_PX)),
            in_plane,
            flat,
            1e-6,
        ),
        ("duplicate point, n = 4", repeated(4), truth, all[..3].to_vec(), 1e-9),
        ("8 correspondences, 3 distinct", repeated(8), truth, all[..3].to_vec(), 1e-9),
        moved("scale 1e9", &|x| x * 1e9, scaled(1e9), 1e-9),
        moved("scale 1e-9", &|x| x * 1e-9, scaled(1e-9), 1e-9),
        moved("offset 5e6 m", &|x| x + offset, elsewhere, 1e-8),
    ]
}

/// The 23 bad inputs on which published solvers report a wrong pose, NaN, or crash: each is solved or refused by name.
#[test]
fn the_twenty_three_bad_inputs_are_solved_or_refused() {
    let (refused, solved) = (without_a_pose(), with_a_pose());
    assert_eq!(refused.len() + solved.len(), 23);
    for (name, answer, expected) in &refused {
        assert_eq!(refusal(answer), *expected, "{name}: {answer:?}");
    }
    for (name, answer, truth, points, tolerance) in &solved {
        assert!(is_correct(answer, truth, points, *tolerance), "{name}: {answer:?}");
    }
}

/// Pixels and points are joined by name, so an eighth pixel without a point is set aside, not read past the end.
fn seven_points_eight_pixels() -> Answer {
    let points = views::general();
    let named = |(i, x): (usize, &Point)| NamedPoint { name: i.to_string(), position: *x, sigma_m: 0.0 };
    let target = Target::Points(points[..7].iter().enumerate().map(named).collect());
    let detections: Vec<_> = exact(&points)
        .iter()
        .enumerate()
        .map(|(i, c)| Detection {
            feature: Feature { id: i as u32, corner: 0 },
            pixel: c.pixel,
            sigma_px: SIGMA_PX,
            lens_sigma_px: 0.0,
            covariance_px2: None,
        })
        .collect();
    let (seen, skipped) = correspond(&detections, &target, &views::camera());
    assert_eq!((seen.len(), skipped.len()), (7, 1));
    solve(&seen.into_iter().map(|(_, c)| c).collect::<Vec<_>>())
}

/// A pixel 7 px off its place, seventy times its sigma.
#[test]
fn a_misplaced_point_is_inconsistent_and_named() {
    let mut seen = exact(&views::general());
    seen[2] = views::moved_pixel(&seen[2], Vector2::new(6.0, -4.0));
    let Consistency::Inconsistent { worst_point, worst_px, .. } = solve(&seen).expect("a pose").consistency
    else {
        panic!("consistent")
    };
    assert_eq!(worst_point, 2);
    assert!(1.0 < worst_px);
}
