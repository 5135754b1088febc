//! One view, one more point, a place and a length on the ground: what the adviser foretells against many noisy images.

use crate::advise_support::{above_the_road, known, rms, trial};
use crate::common::{Rng, views};
use nalgebra::{Matrix6, Vector2, Vector3, Vector6};
use resight_core::advise::expect::{View, correspondences_in_view, expect, worst_sigmas};
use resight_core::advise::ground::Plane;
use resight_core::advise::layout::{LayoutWarning, layout_warnings};
use resight_core::advise::point::{Aim, NextPoint};
use resight_core::advise::{FirstOrderLimit, volume::Shape};
use resight_core::camera::ImageSize;
use resight_core::locate::{Config, locate};
use resight_core::target::{Chessboard, KnownPoint, Tag, Target};
use resight_core::{Camera, Correspondence, Error, Point, Pose};

/// Images of each view: the spread of six coordinates is then known to 1/√(12 · 1500) = 0.75 %.
const N: usize = 1500;
/// What is foretold must hold to this, where no doubt is stated: seven times what chance leaves of the mean.
const WITHIN: f64 = 0.05;

fn camera() -> Camera {
    Camera { size: Some(ImageSize { width_px: 640, height_px: 480 }), ..views::camera() }
}

/// Three control points on the road.
fn control_points() -> Vec<KnownPoint> {
    known(&[[-2.0, 10.0, 0.0], [2.5, 11.0, 0.0], [-1.0, 16.0, 0.0]])
}

fn view<'a>(camera: &'a Camera, cam_from_target: Pose, points: &'a [KnownPoint]) -> View<'a> {
    View { camera, cam_from_target, points, sigma_px: 0.5, intrinsics_covariance: None }
}

fn with(points: &[KnownPoint], x: f64, y: f64) -> Vec<KnownPoint> {
    [points, &known(&[[x, y, 0.0]])].concat()
}

/// Where the fourth control point may be painted: from good to poor.
const FOURTH: [[f64; 2]; 5] = [[3.0, 17.0], [0.0, 8.5], [-3.0, 18.0], [2.5, 13.0], [0.5, 12.0]];

#[test]
fn view_without_a_rotation_is_refused() {
    let (camera, points) = (camera(), control_points());
    let right = above_the_road();
    for (off, rotation) in
        [(3.0, 2.0 * right.rotation), (2.0, -right.rotation), (2.0, f64::NAN * right.rotation)]
    {
        let wrong = Pose { rotation, ..right };
        let view = view(&camera, wrong, &points);
        for refused in [expect(&view).err(), NextPoint::new(view).err()] {
            match refused {
                Some(Error::InvalidSetting { setting: "cam_from_target", seen, .. }) => {
                    assert!((seen - off).abs() < 1e-9, "{seen}");
                }
                other => panic!("{other:?}"),
            }
        }
    }
}

#[test]
fn fourth_point_is_worth_what_is_foretold() {
    let (camera, points) = (camera(), control_points());
    let next = NextPoint::new(view(&camera, above_the_road(), &points)).unwrap();
    let mut clear = 0;
    for (i, [x, y]) in FOURTH.into_iter().enumerate() {
        let four = with(&points, x, y);
        let whole = view(&camera, above_the_road(), &four);
        let (gain, e) = (next.with(&four[3]).expect("in sight"), expect(&whole).unwrap());
        assert!((gain.covariance - e.covariance).norm() < 1e-6 * e.covariance.norm());
        let t = trial(&whole, N, 11 + i as u64);
        let ratio = t.over(&gain.covariance);
        println!(
            "({x}, {y}): spread / foretold {ratio:.3}, worst {:.3}; separation {:.1} by one point, {:.1} whole; ambiguous {:.3}, said {:.3}; bend {:.3}",
            t.worst_over(&gain.covariance),
            gain.separation_sigma,
            e.separation_sigma,
            t.ambiguous,
            e.chance_ambiguous(),
            e.bend_ratio
        );
        assert!(
            (t.ambiguous - e.chance_ambiguous()).abs() < 0.03,
            "{} {}",
            t.ambiguous,
            e.chance_ambiguous()
        );
        if e.first_order_limits().is_empty() {
            clear += 1;
            assert!((ratio - 1.0).abs() < WITHIN, "({x}, {y}): {ratio}");
        }
    }
    assert!(3 <= clear, "doubts nearly everywhere: {clear} of {} clear", FOURTH.len());
}

/// A length of 4 m on the road, its ends pointed at with the same noise as the control points.
#[test]
fn length_on_the_ground_is_as_sure_as_foretold() {
    let (camera, points) = (camera(), control_points());
    let (ground, ends) = (Plane::level(0.0), [Point::new(-1.5, 13.0, 0.0), Point::new(2.3, 14.2, 0.0)]);
    let length = ground.length(&camera, &above_the_road(), ends, 0.5).unwrap();
    let aim = Aim::Length(length);
    let next = NextPoint::new(view(&camera, above_the_road(), &points)).unwrap();
    let mut order = Vec::new();
    for (i, [x, y]) in FOURTH.into_iter().enumerate() {
        let four = with(&points, x, y);
        let whole = view(&camera, above_the_road(), &four);
        if !expect(&whole).unwrap().first_order_limits().is_empty() {
            continue;
        }
        let predicted = aim.sigma(&next.with(&four[3]).unwrap().covariance);
        // 1/√(2 · 6000) = 0.9 % by chance.
        let t = trial(&whole, 4 * N, 21 + i as u64);
        let mut rng = Rng::new(31 + i as u64);
        let mut image_point = |x: &Point| {
            camera.project(&(above_the_road() * *x)).unwrap() + Vector2::new(rng.normal(), rng.normal()) * 0.5
        };
        let error = |pose: &Pose| {
            let image_points = [image_point(&ends[0]), image_point(&ends[1])];
            let [a, b] = image_points.map(|p| ground.seen_at(&camera, pose, &p).expect("on the road"));
            (b - a).norm() - length.length_m
        };
        let found = rms(t.poses.iter().map(error));
        println!("({x}, {y}): {:.2} mm, foretold {:.2} mm", 1e3 * found, 1e3 * predicted);
        assert!((found / predicted - 1.0).abs() < WITHIN, "{found} {predicted}");
        order.push((predicted, found));
    }
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let differ = |pair: &[(f64, f64)]| 1.05 * pair[0].0 < pair[1].0;
    assert!(order.windows(2).filter(|p| differ(p)).all(|p| p[0].1 < p[1].1), "ranked otherwise than found");
}

#[test]
fn place_on_the_ground_is_as_sure_as_foretold() {
    let (camera, four) = (camera(), with(&control_points(), 3.0, 17.0));
    let whole = view(&camera, above_the_road(), &four);
    let e = expect(&whole).unwrap();
    let ground = Plane::level(0.0);
    let t = trial(&whole, 2 * N, 41);
    let mut rng = Rng::new(42);
    for x in [[0.0, 12.0], [3.0, 20.0], [-4.0, 15.0]] {
        let x = Point::new(x[0], x[1], 0.0);
        let p = ground.point(&camera, &above_the_road(), &x).unwrap();
        let covariance = p.covariance_m2(&e.covariance, 0.5).fixed_view::<2, 2>(0, 0).into_owned();
        let inverse = covariance.try_inverse().unwrap();
        let pixel = camera.project(&(above_the_road() * x)).unwrap();
        let error = |pose: &Pose| {
            let image_point = pixel + Vector2::new(rng.normal(), rng.normal()) * 0.5;
            let off = (ground.seen_at(&camera, pose, &image_point).expect("on the road") - x).xy();
            (off.dot(&(inverse * off)) / 2.0).sqrt()
        };
        let ratio = rms(t.poses.iter().map(error));
        println!("{:?}: {ratio:.3}, {:.1} mm", x.xy(), 1e3 * p.worst_sigma_m(&e.covariance, 0.5));
        assert!((ratio - 1.0).abs() < WITHIN, "{x}: {ratio}");
    }
}

/// Over flat targets of every tilt and distance: where the spread leaves 5 %, or more answers than foretold are ambiguous, a doubt
/// is stated; and where nothing is wrong hardly ever.
#[test]
fn where_the_figures_fail_a_doubt_is_stated() {
    let camera = views::camera();
    let square = Shape::of(&Target::Tag(Tag { family: "tag36h11".into(), id: 0, size_m: 1.0 }));
    let board = Shape::of(&Target::Chessboard(Chessboard { rows: 4, columns: 5, square_m: 0.25 }));
    let dots = Shape {
        points: known(&[[-0.5, -0.2, 0.0], [0.1, -0.2, 0.0], [0.5, -0.2, 0.0], [-0.4, 0.5, 0.0]]),
        ..square.clone()
    };
    let (mut clear, mut sound, mut views) = (0, 0, 0);
    for (name, shape) in [("tag", &square), ("board", &board), ("dots", &dots)] {
        for distance_m in [2.0, 4.0, 8.0, 12.0] {
            for degrees in [0.0, 2.0, 5.0, 10.0, 20.0, 40.0, 60.0] {
                let centre = Point::new(0.05, -0.03, 1.0).normalize() * distance_m;
                let pose = shape.cam_from_target(&centre, f64::to_radians(degrees), 0.7, 0.4);
                let view = view(&camera, pose, &shape.points);
                let e = expect(&view).unwrap();
                let t = trial(&view, N, 51);
                let ratio = t.over(&e.covariance);
                let first_order_valid = (ratio - 1.0).abs() < WITHIN && t.ambiguous < 0.05;
                let is_clear = e.first_order_limits().is_empty();
                if is_clear != first_order_valid {
                    println!(
                        "{name} {distance_m} m {degrees}°: {ratio:.3}, ambiguous {:.3}; {:?}",
                        t.ambiguous,
                        e.first_order_limits()
                    );
                }
                assert!(
                    first_order_valid || !is_clear,
                    "{name} {distance_m} m {degrees}°: {ratio}, ambiguous {}",
                    t.ambiguous
                );
                views += 1;
                clear += usize::from(is_clear);
                sound += usize::from(first_order_valid);
            }
        }
    }
    println!("{views} views: {sound} hold, {clear} without a doubt");
    assert!(sound as f64 * 0.85 < clear as f64, "{clear} of {sound} sound views are called so");
}

/// What `locate` states of one exact image is what is foretold as stated.
#[test]
fn stated_covariance_is_what_locate_states() {
    use resight_core::locate::{Config, locate};
    let (camera, four) = (camera(), with(&control_points(), 3.0, 17.0));
    let whole = view(&camera, above_the_road(), &four);
    let e = expect(&whole).unwrap();
    let answer = locate(&correspondences_in_view(&whole).unwrap(), &camera, &Config::default()).unwrap();
    assert!((answer.covariance - e.covariance).norm() < 1e-3 * e.covariance.norm());
    assert!((e.stated_covariance - e.covariance).norm() < 0.1 * e.covariance.norm());
}

#[test]
fn ground_derivatives_match_central_differences() {
    // Central differences err by h² and ε/h.
    const STEP: f64 = 6e-6;
    let (camera, pose) = (camera(), above_the_road());
    for ground in [
        Plane::level(0.0),
        Plane { normal_in_target: Vector3::new(0.1, -0.2, 1.0).normalize(), offset_m: 0.3 },
    ] {
        let pixel = Vector2::new(300.0, 260.0);
        let x = ground.seen_at(&camera, &pose, &pixel).unwrap();
        assert!((ground.normal_in_target.dot(&x) - ground.offset_m).abs() < 1e-12);
        let p = ground.point(&camera, &pose, &x).unwrap();
        for i in 0..6 {
            let h = Vector6::ith(i, STEP);
            let at = |by: Vector6<f64>| ground.seen_at(&camera, &(Pose::exp(&by) * pose), &pixel).unwrap();
            let d = (at(h) - at(-h)) / (2.0 * STEP);
            assert!((d - p.by_motion.column(i)).norm() < 1e-6 * (1.0 + d.norm()), "{i}: {d} {}", p.by_motion);
        }
        for i in 0..2 {
            let h = Vector2::ith(i, 1e-3);
            let at = |by: Vector2<f64>| ground.seen_at(&camera, &pose, &(pixel + by)).unwrap();
            assert!(((at(h) - at(-h)) / 2e-3 - p.by_pixel.column(i)).norm() < 1e-7);
        }
        let b = Point::new(1.0, 14.0, 0.0);
        let b = b - ground.normal_in_target * (ground.normal_in_target.dot(&b) - ground.offset_m);
        let length = ground.length(&camera, &pose, [x, b], 0.5).unwrap();
        let pixel_b = camera.project(&(pose * b)).unwrap();
        for i in 0..6 {
            let h = Vector6::ith(i, STEP);
            let at = |by: Vector6<f64>| {
                let moved = Pose::exp(&by) * pose;
                let end = |p: &Vector2<f64>| ground.seen_at(&camera, &moved, p).unwrap();
                (end(&pixel_b) - end(&pixel)).norm()
            };
            let d = (at(h) - at(-h)) / (2.0 * STEP);
            assert!((d - length.by_motion[i]).abs() < 1e-6 * (1.0 + d.abs()), "{i}");
        }
    }
}

/// Numbers of the literature that a frontal 1 m square must reproduce: f = 1000 px, σ = 0.3 px, at 3 m tilt known to about 1°, at
/// 10 m to more than 10°, and range there to metres: by then a doubt is stated.
#[test]
fn frontal_views_lose_their_tilt_with_distance() {
    use resight_core::camera::Pinhole;
    let matrix = resight_core::CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };
    let camera = Camera { lens: Pinhole { matrix }.into(), size: None };
    let dots = known(&[[-0.5, -0.2, 0.0], [0.0, -0.2, 0.0], [0.5, -0.2, 0.0], [-0.1, 0.4, 0.0]]);
    let tilt = |z: f64| {
        let pose = Pose::new(nalgebra::Matrix3::identity(), Vector3::new(0.0, 0.0, z));
        let e = expect(&View {
            camera: &camera,
            cam_from_target: pose,
            points: &dots,
            sigma_px: 0.3,
            intrinsics_covariance: None,
        })
        .unwrap();
        (worst_sigmas(&e.covariance).0.to_degrees(), e.first_order_limits())
    };
    let ((near, _), (far, first_order_limits)) = (tilt(3.0), tilt(10.0));
    println!("{near:.2}° at 3 m, {far:.1}° at 10 m");
    assert!((0.5..2.0).contains(&near) && (7.0..25.0).contains(&far), "{near} {far}");
    assert!(!first_order_limits.is_empty());
}

#[test]
fn faults_of_a_layout_are_named_with_their_numbers() {
    let camera = camera();
    let said = |cam_from_target: Pose, points: &[KnownPoint]| {
        let view =
            View { camera: &camera, cam_from_target, points, sigma_px: 0.5, intrinsics_covariance: None };
        layout_warnings(&view, &expect(&view).unwrap())
    };
    let road = above_the_road();
    let good = said(road, &with(&control_points(), 3.0, 17.0));
    assert!(good.is_empty(), "{good:?}");
    let line =
        said(road, &known(&[[-4.0, 12.0, 0.0], [-1.0, 12.3, 0.0], [2.0, 11.9, 0.0], [4.0, 12.2, 0.0]]));
    assert!(
        line.iter()
            .any(|c| matches!(c, LayoutWarning::NearCollinear { width_ratio, .. } if *width_ratio < 0.1)),
        "{line:?}"
    );
    let clustered =
        said(road, &known(&[[0.0, 12.0, 0.0], [0.4, 12.0, 0.0], [0.5, 12.6, 0.0], [0.1, 12.5, 0.0]]));
    assert!(
        clustered.iter().any(
            |c| matches!(c, LayoutWarning::FarClustered { span_rad, needed_rad } if span_rad < needed_rad)
        ),
        "{clustered:?}"
    );
    let facing = Pose::new(nalgebra::Matrix3::identity(), Vector3::new(0.0, 0.0, 8.0));
    let square = known(&[[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]]);
    let frontal = said(facing, &square);
    assert!(frontal.iter().any(|c| matches!(c, LayoutWarning::Frontal { tilt_rad, needed_rad } if *tilt_rad < 1e-6 && 0.1 < *needed_rad)), "{frontal:?}");
    assert!(frontal.iter().any(|c| matches!(c, LayoutWarning::EqualRange { .. })), "{frontal:?}");
    // The camera in the plane through the fourth point across the line.
    let dots = known(&[[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.4, 0.6, 0.0]]);
    let critical = said(views::looking_at(Point::new(0.4, 1.8, -2.4), Point::new(0.5, 0.2, 0.0)), &dots);
    assert!(critical.iter().any(|c| matches!(c, LayoutWarning::Weak(_))), "{critical:?}");
}

/// The rotation about the line of nearly collinear points is known worse in proportion to their width.
#[test]
fn a_narrow_layout_turns_about_its_line() {
    let camera = views::camera();
    let sigma = |width: f64| {
        let points = known(&[[0.0, 0.0, 0.0], [0.4, 0.3 * width, 0.0], [1.0, 0.0, 0.0], [0.6, width, 0.0]]);
        let pose = views::looking_at(Point::new(1.3, -1.5, 2.0), Point::new(0.5, 0.0, 0.0));
        worst_sigmas(&expect(&view(&camera, pose, &points)).unwrap().covariance).0
    };
    let (wide, narrow) = (sigma(0.1), sigma(0.05));
    assert!((1.6..2.4).contains(&(narrow / wide)), "{narrow} / {wide}");
}

#[test]
fn what_cannot_be_foretold_is_refused_with_its_reason() {
    let camera = camera();
    let try_points = |points: &[KnownPoint]| expect(&view(&camera, above_the_road(), points)).unwrap_err();
    assert!(matches!(try_points(&control_points()[..2]), Error::TooFewPoints { seen: 2, needed: 3 }));
    let line = known(&[[-2.0, 12.0, 0.0], [0.0, 12.0, 0.0], [2.0, 12.0, 0.0]]);
    assert!(matches!(try_points(&line), Error::Collinear { .. }));
    let behind = with(&control_points(), 0.0, -30.0);
    assert!(matches!(try_points(&behind), Error::InvalidSetting { seen: 3.0, .. }));
    let bad = View { sigma_px: f64::NAN, ..view(&camera, above_the_road(), &[]) };
    assert!(expect(&bad).is_err());
    let points = control_points();
    let next = NextPoint::new(view(&camera, above_the_road(), &points)).unwrap();
    assert!(next.with(&known(&[[0.0, -30.0, 0.0]])[0]).is_none(), "behind the camera");
    assert!(next.with(&known(&[[40.0, 12.0, 0.0]])[0]).is_none(), "outside the image");
}

/// Three points leave other poses possible, and the adviser says so.
#[test]
fn three_points_are_ambiguous() {
    let (camera, points) = (camera(), control_points());
    let e = expect(&view(&camera, above_the_road(), &points)).unwrap();
    let others = matches!(e.first_order_limits()[..], [FirstOrderLimit::Ambiguous { separation_sigma, .. }, ..] if separation_sigma < 1e-3);
    assert!(others || e.separation_sigma.is_infinite(), "{e:?}");
    let _: Matrix6<f64> = e.covariance;
}

/// The lens drawn from its covariance, the pixels from their noise: what `locate` answers lies within the ± foretold, and far outside that of
/// an exact lens; `locate` states the same, and so does the adviser of a further point.
#[test]
fn an_uncertain_lens_is_in_what_is_foretold() {
    let (camera, pose, points) =
        (camera(), above_the_road(), with(&with(&control_points(), 3.0, 17.0), 0.0, 8.5));
    let n_parameters = camera.parameters().len();
    let sigmas: Vec<f64> = (0..n_parameters).map(|i| if i < 2 { 4.0 } else { 3.0 }).collect();
    let mut stated = vec![0.0; n_parameters * n_parameters];
    (0..n_parameters).for_each(|i| stated[i * n_parameters + i] = sigmas[i] * sigmas[i]);
    let uncertain = View { intrinsics_covariance: Some(&stated), ..view(&camera, pose, &points) };
    let e = expect(&uncertain).unwrap();
    let exact = expect(&view(&camera, pose, &points)).unwrap();
    assert_eq!(e.exact_intrinsics_covariance, exact.covariance);
    assert_eq!(exact.exact_intrinsics_covariance, exact.covariance);
    let next = NextPoint::new(View { points: &points[..points.len() - 1], ..uncertain }).unwrap();
    let gain = next.with(&points[points.len() - 1]).expect("in sight");
    assert!((gain.covariance - e.covariance).norm() < 1e-6 * e.covariance.norm());

    let config = Config { intrinsics_covariance: Some(&stated), ..Config::default() };
    let (mut rng, n) = (Rng::new(311), 1500);
    let (mut foretold, mut as_exact) = (0.0, 0.0);
    for _ in 0..n {
        let values: Vec<f64> =
            camera.parameters().iter().zip(&sigmas).map(|(p, s)| p.1 + s * rng.normal()).collect();
        let took = camera.with_parameters(&values).unwrap();
        let one = |p: &KnownPoint| {
            let noise = Vector2::new(rng.normal(), rng.normal()) * uncertain.sigma_px;
            let pixel = took.project(&(pose * p.position)).unwrap() + noise;
            Correspondence::new(&camera, p.position, pixel, uncertain.sigma_px).unwrap()
        };
        let seen: Vec<Correspondence> = points.iter().map(one).collect();
        let answer = locate(&seen, &camera, &config).unwrap();
        let xi = (answer.cam_from_target * pose.inverse()).log();
        let nees = |c: &Matrix6<f64>| xi.dot(&c.cholesky().unwrap().solve(&xi)) / f64::from(n);
        foretold += nees(&e.covariance);
        as_exact += nees(&exact.covariance);
    }
    println!("NEES {foretold:.2}, with the lens taken as exact {as_exact:.2}");
    assert!((5.7..6.3).contains(&foretold), "{foretold}");
    assert!(20.0 < as_exact, "{as_exact}");
}
