//! Place with the rotation known: exact from every sufficient mixture, covariance true, an earlier place updated as Kalman does.

use crate::common::{Rng, views};
use nalgebra::{Matrix3, Unit, Vector2, Vector3};
use resight_core::line::{ImageLine, LineCorrespondence};
use resight_core::locate::known_rotation::{Known, KnownRotation, PositionEstimate, position_with_rotation};
use resight_core::{Correspondence, Error, Matrix6, Point, Pose, Vector6};

const SIGMA_PX: f64 = 0.5;

fn exactly(cam_from_target: &Pose) -> KnownRotation {
    KnownRotation { cam_from_target: cam_from_target.rotation, covariance: Matrix3::zeros() }
}

/// The camera 2 to 6 m from the targets of the suite, turned at random about its line of sight too.
fn random_view(rng: &mut Rng) -> Pose {
    let direction = rng.unit_vector();
    let centre = Point::new(0.4, 0.4, 0.0) + direction * rng.uniform(2.0, 6.0);
    let roll = Pose::exp(&Vector6::new(0.0, 0.0, rng.uniform(-3.0, 3.0), 0.0, 0.0, 0.0));
    roll * views::looking_at(centre, Point::new(rng.uniform(0.0, 0.8), rng.uniform(0.0, 0.8), 0.0))
}

/// A line through two places and its image, ends disturbed across and along alike.
fn line(rng: &mut Rng, pose: &Pose, [a, b]: [Point; 2], noise_px: f64) -> LineCorrespondence {
    let mut end =
        |x: Point| views::pixel_of(&(pose * &x)) + Vector2::new(rng.normal(), rng.normal()) * noise_px;
    // What is seen is another part of the line than what is surveyed.
    let ends_px = [end(a * 0.9 + b * 0.1), end(a * 0.1 + b * 0.9)];
    let seen = ImageLine::new(&views::camera(), ends_px, SIGMA_PX).expect("a line");
    let direction_in_target = Unit::new_normalize(a - b);
    LineCorrespondence { point_in_target: Some(a), direction_in_target, seen }
}

fn height(pose: &Pose, error_m: f64, sigma_m: f64) -> Known {
    let normal_in_target = Unit::new_normalize(Vector3::new(0.2, -0.3, 0.9));
    let height_m = normal_in_target.dot(&pose.origin()) - 0.25 + error_m;
    Known::Height { normal_in_target, offset_m: 0.25, height_m, sigma_m }
}

fn distance(pose: &Pose, point: usize, x: &Point, error_m: f64, sigma_m: f64) -> Known {
    Known::Distance { point, distance_m: (pose * x).norm() + error_m, sigma_m }
}

fn error(truth: &Pose, found: &PositionEstimate) -> Vector6 {
    (*truth * found.cam_from_target.inverse()).log()
}

/// Two points; one and its distance; one and a height; one and a place; three lines; two lines and a height; a line and a point.
#[test]
fn exact_data_give_the_exact_place() {
    let mut rng = Rng::new(1);
    let points = views::general();
    let edges = [[points[0], points[1]], [points[0], points[3]], [points[1], points[6]]];
    let mut refused = 0;
    for _ in 0..2000 {
        let pose = random_view(&mut rng);
        let seen = views::seen_from(&pose, &points, SIGMA_PX);
        let lines = edges.map(|edge| line(&mut rng, &pose, edge, 0.0));
        let there =
            Known::Place { origin_in_target: pose.origin(), covariance_m2: Matrix3::identity() * 0.01 };
        let (d, h) = (distance(&pose, 0, &points[0], 0.0, 1e-3), height(&pose, 0.0, 1e-3));
        let cases: [(&[Correspondence], &[LineCorrespondence], &[Known]); 8] = [
            (&seen[..2], &[], &[]),
            (&seen, &[], &[]),
            (&seen[..1], &[], &[d]),
            (&seen[..1], &[], &[h]),
            (&seen[..1], &[], &[there]),
            (&[], &lines, &[]),
            (&[], &lines[..2], &[h]),
            (&seen[6..7], &lines[..1], &[]),
        ];
        for (i, (points, lines, known)) in cases.into_iter().enumerate() {
            match position_with_rotation(&exactly(&pose), points, lines, &views::camera(), known) {
                // A plane or a line seen edge on: about one view in fifty of a case.
                Err(Error::DegenerateView { metric, needed, .. }) if metric < needed => refused += 1,
                Err(other) => panic!("case {i}: {other}"),
                Ok(found) => {
                    let off = error(&pose, &found).norm();
                    let loss = found.covariance.trace().sqrt();
                    // Pixels of 1e-13 px where their sigma is 0.5: 1e-11 of the standard deviation is ample.
                    assert!(off < 1e-11 * (1.0 + loss), "case {i}: {off:e}");
                    assert!(found.chi2 < 1e-15, "case {i}: {:e}", found.chi2);
                }
            }
        }
    }
    println!("{refused} refused of 16000");
    assert!(refused < 800, "{refused}");
}

/// A noisy mixture of measurements and its true pose.
type Noisy = (Vec<Correspondence>, Vec<LineCorrespondence>, Vec<Known>);

fn two_points(rng: &mut Rng, pose: &Pose) -> Noisy {
    let points = views::general();
    (views::disturbed(rng, &views::seen_from(pose, &[points[0], points[2]], SIGMA_PX)), vec![], vec![])
}

fn eight_points(rng: &mut Rng, pose: &Pose) -> Noisy {
    (views::disturbed(rng, &views::seen_from(pose, &views::general(), SIGMA_PX)), vec![], vec![])
}

fn one_point_and_its_distance(rng: &mut Rng, pose: &Pose) -> Noisy {
    let x = views::general()[0];
    let known = distance(pose, 0, &x, 0.02 * rng.normal(), 0.02);
    (views::disturbed(rng, &views::seen_from(pose, &[x], SIGMA_PX)), vec![], vec![known])
}

fn one_point_and_an_earlier_place(rng: &mut Rng, pose: &Pose) -> Noisy {
    let (x, sigma) = (views::general()[0], Vector3::new(0.02, 0.05, 0.1));
    let off = sigma.map(|s| s * rng.normal());
    let covariance_m2 = Matrix3::from_diagonal(&sigma.component_mul(&sigma));
    let known = Known::Place { origin_in_target: pose.origin() + off, covariance_m2 };
    (views::disturbed(rng, &views::seen_from(pose, &[x], SIGMA_PX)), vec![], vec![known])
}

fn lines_points_and_a_height(rng: &mut Rng, pose: &Pose) -> Noisy {
    let p = views::general();
    let lines =
        [[p[0], p[1]], [p[0], p[3]], [p[1], p[6]]].map(|edge| line(rng, pose, edge, SIGMA_PX)).to_vec();
    let known = height(pose, 0.03 * rng.normal(), 0.03);
    (views::disturbed(rng, &views::seen_from(pose, &p[4..6], SIGMA_PX)), lines, vec![known])
}

/// Mahalanobis distances and regions of the whole motion where the rotation is uncertain, of the translation where it is exact; and,
/// where it is exact, χ². First order only: the place must be well known, as in these scenes.
fn covariance_is_true(name: &str, seed: u64, scene: fn(&mut Rng, &Pose) -> Noisy, rotation_sigma_rad: f64) {
    let mut rng = Rng::new(seed);
    let (mut nees, mut covered, mut chi2, mut taken, total) = (0.0, 0, 0.0, 0, 20_000);
    let exact = rotation_sigma_rad == 0.0;
    for _ in 0..total {
        let pose = random_view(&mut rng);
        let (seen, lines, known) = scene(&mut rng, &pose);
        let w = Vector3::new(rng.normal(), rng.normal(), rng.normal()) * rotation_sigma_rad;
        let turn = Pose::exp(&Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)).rotation;
        let covariance = Matrix3::identity() * rotation_sigma_rad.powi(2);
        let rotation = KnownRotation { cam_from_target: turn * pose.rotation, covariance };
        let Ok(found) = position_with_rotation(&rotation, &seen, &lines, &views::camera(), &known) else {
            continue;
        };
        let e = error(&pose, &found);
        let squared = if exact {
            let (v, s) =
                (e.fixed_rows::<3>(3).into_owned(), found.covariance.fixed_view::<3, 3>(3, 3).into_owned());
            v.dot(&(s.try_inverse().expect("positive definite") * v))
        } else {
            e.dot(&(found.covariance.try_inverse().expect("positive definite") * e))
        };
        nees += squared;
        covered += usize::from(squared < if exact { 7.815 } else { 12.592 }); // χ² at 95 % of 3, 6 degrees
        chi2 += found.chi2 / found.degrees_of_freedom.max(1) as f64;
        taken += 1;
    }
    let per = |x: f64| x / taken as f64;
    let dimensions = if exact { 3.0 } else { 6.0 };
    let (nees, coverage, chi2) = (per(nees) / dimensions, per(covered as f64), per(chi2));
    println!(
        "{name}, rotation ±{rotation_sigma_rad} rad: NEES/d {nees:.3}, 95 % covers {coverage:.4}, χ²/dof {chi2:.3}, {taken} of {total}"
    );
    assert!(total * 9 / 10 < taken, "{name}: {taken}");
    assert!((0.97..1.04).contains(&nees) && (0.943..0.957).contains(&coverage), "{name}: {nees} {coverage}");
    if exact && 0.0 < chi2 && name != "one point and its distance" {
        assert!((0.95..1.05).contains(&chi2), "{name}: {chi2}");
    }
}

#[test]
fn covariance_is_true_with_an_exact_rotation() {
    covariance_is_true("two points", 2, two_points, 0.0);
    covariance_is_true("eight points", 3, eight_points, 0.0);
    covariance_is_true("one point and its distance", 4, one_point_and_its_distance, 0.0);
    covariance_is_true("one point and an earlier place", 5, one_point_and_an_earlier_place, 0.0);
    covariance_is_true("lines, points and a height", 6, lines_points_and_a_height, 0.0);
}

#[test]
fn covariance_is_true_with_an_uncertain_rotation() {
    covariance_is_true("eight points", 7, eight_points, 1e-3);
    covariance_is_true("one point and its distance", 8, one_point_and_its_distance, 2e-3);
    covariance_is_true("one point and an earlier place", 9, one_point_and_an_earlier_place, 2e-3);
    covariance_is_true("lines, points and a height", 10, lines_points_and_a_height, 1e-3);
}

/// The translation's covariance is N⁻¹, the derivative of the answer by each pixel: against central differences.
#[test]
fn covariance_matches_central_differences() {
    let pose = views::oblique();
    let seen = views::seen_from(&pose, &views::general()[..3], SIGMA_PX);
    let solve = |seen: &[Correspondence]| {
        position_with_rotation(&exactly(&pose), seen, &[], &views::camera(), &[]).expect("a place")
    };
    let (found, h) = (solve(&seen), 1e-4);
    let mut by_difference = Matrix6::zeros();
    for (i, axis) in (0..seen.len()).flat_map(|i| [(i, Vector2::x()), (i, Vector2::y())]) {
        let moved = |by: f64| {
            let mut seen = seen.clone();
            seen[i] = views::moved_pixel(&seen[i], axis * by);
            error(&pose, &solve(&seen))
        };
        let column = (moved(h) - moved(-h)) * (SIGMA_PX / (2.0 * h));
        by_difference += column * column.transpose();
    }
    let off = (by_difference - found.covariance).norm() / found.covariance.norm();
    assert!(off < 1e-6, "{off:e}");
}

/// An earlier pose, the head rotated since by a known angle: the centre stays, and the point sharpens it.
#[test]
fn an_earlier_pose_goes_through_a_turn_of_the_head() {
    let earlier = views::oblique();
    let turn = Pose::exp(&Vector6::new(0.05, -0.1, 0.2, 0.0, 0.0, 0.0));
    let now = turn * earlier;
    let covariance = Matrix6::from_diagonal(&Vector6::new(1e-6, 1e-6, 1e-6, 4e-4, 1e-4, 9e-4));
    let known = Known::position_of(&earlier, &covariance);
    let seen = views::seen_from(&now, &views::general()[..1], SIGMA_PX);
    let found =
        position_with_rotation(&exactly(&now), &seen, &[], &views::camera(), &[known]).expect("a place");
    assert!(error(&now, &found).norm() < 1e-11);
    assert_eq!(found.degrees_of_freedom, 2);
    let turned = turn.adjoint() * covariance * turn.adjoint().transpose();
    let before = turned.fixed_view::<3, 3>(3, 3).into_owned();
    let after = found.covariance.fixed_view::<3, 3>(3, 3).into_owned();
    // Never worse in any direction; across the ray much better, along it as before.
    let b = seen[0].bearing.into_inner();
    assert!((before - after).symmetric_eigenvalues().min() > -1e-12);
    let along = |m: &Matrix3<f64>| 1.0 / b.dot(&(m.try_inverse().expect("positive") * b));
    assert!((along(&after) / along(&before) - 1.0).abs() < 1e-9);
    assert!(after.determinant() < 0.01 * before.determinant());
}

#[test]
fn what_leaves_the_place_open_is_refused_by_name() {
    let pose = views::oblique();
    let seen = views::seen_from(&pose, &views::general(), SIGMA_PX);
    let solve = |seen: &[Correspondence], known: &[Known]| {
        position_with_rotation(&exactly(&pose), seen, &[], &views::camera(), known).map(|_| ())
    };
    assert_eq!(solve(&[], &[]), Err(Error::TooFewPoints { seen: 0, needed: 2 }));
    assert_eq!(solve(&seen[..1], &[]), Err(Error::TooFewPoints { seen: 1, needed: 2 }));
    let is_degenerate = |answer| matches!(answer, Err(Error::DegenerateView { .. }));
    // Twice the same point: two numbers that count as four.
    assert!(is_degenerate(solve(&[seen[0], seen[0]], &[])));
    // A metre and half a pixel say nothing at a kilometre's baseline of a micrometre.
    let mut beside = seen[0];
    beside.x_in_target += Vector3::new(1e-4, 0.0, 0.0);
    let beside = views::seen_from(&pose, &[seen[0].x_in_target, beside.x_in_target], SIGMA_PX);
    assert!(is_degenerate(solve(&beside, &[])));
    // A height over a plane that contains the ray.
    let across = Unit::new_normalize(pose.rotation.tr_mul(&seen[0].bearing.cross(&Vector3::x())));
    let level = Known::Height { normal_in_target: across, offset_m: 0.0, height_m: 1.0, sigma_m: 0.01 };
    assert!(is_degenerate(solve(&seen[..1], &[level])));
    // Numbers that cannot be right.
    let bad = |known| matches!(solve(&seen[..1], &[known]), Err(Error::InvalidPrior { prior: 0, .. }));
    assert!(bad(Known::Distance { point: 1, distance_m: 3.0, sigma_m: 0.1 }));
    assert!(bad(Known::Distance { point: 0, distance_m: f64::NAN, sigma_m: 0.1 }));
    assert!(bad(Known::Distance { point: 0, distance_m: 3.0, sigma_m: 0.0 }));
    assert!(bad(Known::Place { origin_in_target: Point::zeros(), covariance_m2: -Matrix3::identity() }));
    // Behind the camera.
    let behind = Known::Distance { point: 0, distance_m: -3.0, sigma_m: 0.1 };
    assert_eq!(solve(&seen[..1], &[behind]), Err(Error::NoSolution { n_points: 1 }));
}
