//! Lines: vanishing points, the rotations and the poses they allow; exact from exact data, as good as the Cramér–Rao bound with noise.

use crate::budget::assert_adds_up;
use crate::common::{Rng, views};
use nalgebra::{Matrix3, Unit, Vector2, Vector3};
use resight_core::line::{ImageLine, LineCorrespondence};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::consistency::is_unlikely;
use resight_core::locate::known_rotation::{KnownRotation, position_with_rotation};
use resight_core::locate::lines::{LinesEstimate, locate_lines, refine_lines};
use resight_core::locate::problem::Problem;
use resight_core::solve::line_rotation::line_rotation;
use resight_core::solve::vanishing::{rotations, vanishing_point};
use resight_core::{Correspondence, Error, Matrix6, Point, Pose, Vector6};

const SIGMA_PX: f64 = 0.5;

fn direction(x: f64, y: f64, z: f64) -> Unit<Vector3<f64>> {
    Unit::new_normalize(Vector3::new(x, y, z))
}

/// The image of the segment from `a` to `b`; none where an end is behind the camera.
fn image(rng: &mut Rng, pose: &Pose, [a, b]: [Point; 2], noise_px: f64) -> Option<ImageLine> {
    let mut end = |x: Point| {
        let x = pose * &x;
        (0.2 < x.z).then(|| views::pixel_of(&x) + Vector2::new(rng.normal(), rng.normal()) * noise_px)
    };
    ImageLine::new(&views::camera(), [end(a)?, end(b)?], SIGMA_PX).ok()
}

/// A line surveyed by another point of it and by either arrow.
fn line(rng: &mut Rng, pose: &Pose, [a, b]: [Point; 2], noise_px: f64) -> Option<LineCorrespondence> {
    let seen = image(rng, pose, [a, b], noise_px)?;
    let arrow = if rng.uniform(0.0, 1.0) < 0.5 { 1.0 } else { -1.0 };
    let point_in_target = Some(a + (b - a) * rng.uniform(-1.0, 2.0));
    Some(LineCorrespondence {
        point_in_target,
        direction_in_target: Unit::new_normalize((b - a) * arrow),
        seen,
    })
}

fn angle_between_axes(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b).abs())
}

/// Parallel segments through a box before the camera, along `v` (camera frame).
fn parallels(rng: &mut Rng, n: usize, v: &Vector3<f64>, noise_px: f64) -> Vec<ImageLine> {
    let mut found = Vec::new();
    while found.len() < n {
        let x = Point::new(rng.uniform(-2.0, 2.0), rng.uniform(-1.5, 1.5), rng.uniform(4.0, 8.0));
        let ends = [x - v * rng.uniform(1.0, 2.0), x + v * rng.uniform(1.0, 2.0)];
        found.extend(image(rng, &Pose::identity(), ends, noise_px));
    }
    found
}

/// Also where the lines look parallel (v across the optical axis), or run straight away from the camera.
#[test]
fn exact_parallels_meet_in_their_direction() {
    let mut rng = Rng::new(1);
    let mut refused = 0;
    for i in 0..20_000 {
        let v = match i % 4 {
            0 => direction(rng.normal(), rng.normal(), 0.0).into_inner(),
            1 => Vector3::z(),
            _ => rng.unit_vector(),
        };
        match vanishing_point(&parallels(&mut rng, 2 + i % 5, &v, 0.0)) {
            Ok(found) => {
                let off = angle_between_axes(&found.direction, &v);
                let sigma = found.covariance.trace().sqrt();
                // Pixels of 1e-13 where their sigma is 0.5.
                assert!(off < 1e-11 * sigma + 1e-14, "{i}: {off:e} {sigma:e}");
                assert!(found.chi2 < 1e-15);
            }
            Err(Error::DegenerateView { metric, needed, .. }) if metric < needed => refused += 1,
            Err(other) => panic!("{other}"),
        }
    }
    assert!(refused < 1000, "{refused}");
}

/// Regions that hold what they say, χ² of n − 2, lines that are not parallel found out. Directions known to 0.03 rad or better: farther off
/// the second order of the noise shows.
#[test]
fn vanishing_point_covariance_is_true() {
    for (seed, n) in [(2, 3), (3, 12)] {
        let mut rng = Rng::new(seed);
        let (mut nees, mut covered, mut chi2, mut taken) = (0.0, 0, 0.0, 0);
        for _ in 0..20_000 {
            let v = rng.unit_vector();
            let Ok(found) = vanishing_point(&parallels(&mut rng, n, &v, SIGMA_PX)) else { continue };
            if 0.03 * 0.03 < found.covariance.trace() {
                continue;
            }
            let v = if v.dot(&found.direction) < 0.0 { -v } else { v };
            // The covariance has rank two: along the direction anything will do.
            let w = found.direction.into_inner();
            let whole = found.covariance + w * w.transpose();
            let squared = (v - w).dot(&(whole.try_inverse().expect("positive definite") * (v - w)));
            nees += squared / 2.0;
            covered += usize::from(squared < 5.991); // χ²₂ at 95 %
            chi2 += found.chi2 / found.degrees_of_freedom as f64;
            taken += 1;
        }
        let per = |x: f64| x / taken as f64;
        println!(
            "vanishing point, n = {n}: NEES/2 {:.3}, 95 % covers {:.4}, χ²/dof {:.3}, {taken}",
            per(nees),
            per(covered as f64),
            per(chi2)
        );
        assert!(10_000 < taken, "{taken}");
        assert!((0.96..1.04).contains(&per(nees)) && (0.943..0.957).contains(&per(covered as f64)));
        assert!((0.96..1.04).contains(&per(chi2)));
    }
    let mut rng = Rng::new(4);
    let mut mixed = parallels(&mut rng, 6, &direction(1.0, 0.2, 0.3), SIGMA_PX);
    mixed.extend(parallels(&mut rng, 1, &direction(1.0, 0.4, 0.3), SIGMA_PX));
    let found = vanishing_point(&mixed).expect("a direction");
    assert!(is_unlikely(found.chi2, found.degrees_of_freedom), "{}", found.chi2);
}

/// docs/math/lines.md section 3: two rotations, four at right angles; the true one among them.
#[test]
fn known_directions_leave_two_rotations_or_four() {
    let mut rng = Rng::new(5);
    for i in 0..2000 {
        let rotation = rng.rotation();
        let right_angle = i % 2 == 0;
        let (a, b) = if right_angle {
            (Vector3::x(), Vector3::y())
        } else {
            (Vector3::x(), direction(0.5, 1.0, 0.0).into_inner())
        };
        let mut known = vec![a, b];
        if i % 3 == 0 {
            known.push(direction(0.3, 0.2, 1.0).into_inner()); // out of the plane: one rotation is left
        }
        let pairs: Vec<_> = known
            .iter()
            .filter_map(|d| {
                let lines = parallels(&mut rng, 3, &(rotation * d), 0.0);
                vanishing_point(&lines).ok().map(|v| v.pair(Unit::new_normalize(*d)))
            })
            .collect();
        if pairs.len() < known.len() {
            continue;
        }
        let found = rotations(&pairs).expect("rotations");
        let is_true = |r: &Matrix3<f64>| (r - rotation).norm() < 1e-8;
        let there = found.iter().any(|r| is_true(&r.second_from_first));
        assert!(there, "{i}");
        match (known.len(), right_angle) {
            (2, true) => assert_eq!(found.len(), 4),
            (2, false) => assert_eq!(found.len(), 2),
            _ => assert!(is_true(&found[0].second_from_first)),
        }
    }
}

/// In general position, edges at right angles (also face on), and two parallel lines with a third: the true rotation is among the
/// answers, and all answers close.
#[test]
fn three_lines_give_the_true_rotation() {
    let mut rng = Rng::new(6);
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let (mut most, mut missed, total) = (0, [0; 4], 4000);
    for i in 0..total {
        let family = i % 4;
        let face_on = i % 8 == 1;
        let rotation = if face_on { Matrix3::identity() } else { rng.rotation() };
        let mut any = || Unit::new_normalize(rng.unit_vector());
        let directions = match family {
            0 => [any(), any(), any()],
            1 => axes,
            2 => [axes[1], axes[1], axes[0]],
            _ => {
                let d = any();
                [d, any(), -d]
            }
        };
        let normals = directions.map(|d| {
            // A line before the camera.
            let x = Point::new(rng.uniform(-2.0, 2.0), rng.uniform(-1.5, 1.5), rng.uniform(4.0, 8.0));
            Unit::new_normalize((rotation * d.into_inner()).cross(&x))
        });
        let found = line_rotation(&normals, &directions);
        for r in &found {
            assert!((r * r.transpose() - Matrix3::identity()).norm() < 1e-12);
        }
        let least = found.iter().map(|r| (r - rotation).norm()).fold(f64::INFINITY, f64::min);
        missed[family] += usize::from(!(least < 1e-6));
        most = most.max(found.len());
    }
    println!("missed at 1e-6, by family: {missed:?} of {} each; most answers {most}", total / 4);
    // Two roots within a sample of each other merge into a dip, which a refinement finds again.
    assert!(missed.iter().all(|m| *m <= total / 400), "{missed:?}");
}

type Segments = Vec<[Point; 2]>;

/// Both edges of a lane 3.5 m wide, and a stop line.
fn lane() -> Segments {
    let edge = |x: f64| [Point::new(x, 2.0, 0.0), Point::new(x, 14.0, 0.0)];
    vec![edge(-1.75), edge(1.75), [Point::new(-1.75, 6.0, 0.0), Point::new(1.75, 6.0, 0.0)]]
}

/// Eight edges of a box of 1 × 0.8 × 0.6 m.
fn edges_of_a_box() -> Segments {
    let at = |x: f64, y: f64, z: f64| Point::new(x, 0.8 * y, 0.6 * z);
    vec![
        [at(0., 0., 0.), at(1., 0., 0.)],
        [at(0., 1., 0.), at(1., 1., 0.)],
        [at(0., 0., 1.), at(1., 0., 1.)],
        [at(0., 0., 0.), at(0., 1., 0.)],
        [at(1., 0., 0.), at(1., 1., 0.)],
        [at(0., 0., 0.), at(0., 0., 1.)],
        [at(1., 0., 0.), at(1., 0., 1.)],
        [at(0., 1., 0.), at(0., 1., 1.)],
    ]
}

fn three_in_space() -> Segments {
    let at = Point::new;
    vec![
        [at(0.0, 0.0, 0.0), at(1.0, 0.2, 0.1)],
        [at(0.1, 0.8, 0.2), at(0.9, 0.3, 0.7)],
        [at(0.9, 0.9, 0.0), at(0.3, 0.6, 0.8)],
    ]
}

fn around(rng: &mut Rng) -> Pose {
    let centre = Point::new(0.5, 0.4, 0.3) + rng.unit_vector() * rng.uniform(2.0, 4.0);
    views::looking_at(centre, Point::new(rng.uniform(0.2, 0.8), rng.uniform(0.2, 0.6), 0.3))
}

/// Lines and points of a scene.
type Scene = (fn() -> Segments, fn(&mut Rng) -> Pose, usize);

const LANE: Scene = (lane, views::on_the_road, 0);
const BOX: Scene = (edges_of_a_box, around, 0);
const THREE: Scene = (three_in_space, around, 0);
const BOX_AND_TWO_POINTS: Scene = (edges_of_a_box, around, 2);

fn observe(
    rng: &mut Rng,
    pose: &Pose,
    scene: &Scene,
    noise_px: f64,
) -> Option<(Vec<LineCorrespondence>, Vec<Correspondence>)> {
    let lines: Option<Vec<_>> = (scene.0)().into_iter().map(|ends| line(rng, pose, ends, noise_px)).collect();
    let points: Vec<Point> = (scene.0)().iter().skip(1).take(scene.2).map(|ends| ends[1]).collect();
    let exact = views::seen_from(pose, &points, SIGMA_PX);
    let points = exact
        .iter()
        .map(|c| views::moved_pixel(c, Vector2::new(rng.normal(), rng.normal()) * noise_px))
        .collect();
    Some((lines?, points))
}

fn solve(lines: &[LineCorrespondence], seen: &[Correspondence]) -> Result<LinesEstimate, Error> {
    locate_lines(lines, &Problem::new(seen, &views::camera()))
}

fn error(truth: &Pose, found: &Pose) -> Vector6 {
    (*truth * found.inverse()).log()
}

/// The pose among those the answer names, first or second solution, that is nearest to the truth, and whether it stands alone.
///
/// Three lines alone, and a lane with its stop line, have more poses than one: rotated by half a turn about the stop line the lane
/// looks the same, from below. `above` tells these two apart where it must.
fn answers(found: &LinesEstimate) -> Vec<(Pose, Matrix6)> {
    let mut all = vec![(found.cam_from_target, found.covariance)];
    if let Ambiguity::Ambiguous { other, .. } = found.ambiguity {
        all.push((other.cam_from_target, other.covariance));
    }
    all
}

/// The true pose to 1e-9, as the only answer or as one of two that fit alike; a refusal only where the place is open to a third.
fn exact_lines_give_the_exact_pose(name: &str, seed: u64, scene: Scene, ambiguous_expected: usize) {
    let mut rng = Rng::new(seed);
    let (mut taken, mut ambiguous, mut refused) = (0, 0, 0);
    for _ in 0..2000 {
        let pose = (scene.1)(&mut rng);
        let Some((lines, points)) = observe(&mut rng, &pose, &scene, 0.0) else { continue };
        taken += 1;
        let found = match solve(&lines, &points) {
            Ok(found) => answers(&found),
            Err(Error::DegenerateView { metric, needed, .. }) if metric < needed => {
                refused += 1;
                continue;
            }
            Err(reason) => panic!("{name}: {reason}"),
        };
        ambiguous += found.len() - 1;
        let least = found.iter().map(|(p, _)| error(&pose, p).norm()).fold(f64::INFINITY, f64::min);
        assert!(least < 1e-9, "{name}: {least:e}");
    }
    println!("{name}: {taken} views, {ambiguous} ambiguous, {refused} refused");
    assert!(1500 < taken && refused <= taken / 100, "{taken} {refused}");
    assert_eq!(ambiguous, if ambiguous_expected == 0 { 0 } else { taken - refused }, "{name}");
}

#[test]
fn exact_data_give_the_exact_pose() {
    exact_lines_give_the_exact_pose("lane and stop line", 11, LANE, 1);
    exact_lines_give_the_exact_pose("edges of a box", 12, BOX, 0);
    exact_lines_give_the_exact_pose("edges of a box and two points", 13, BOX_AND_TWO_POINTS, 0);
}

/// Three lines in space have up to eight poses; the true one is among those of the closed forms.
#[test]
fn three_lines_in_space_give_the_true_pose_among_others() {
    let mut rng = Rng::new(14);
    let (mut taken, mut refused, mut several) = (0, 0, 0);
    for _ in 0..2000 {
        let pose = around(&mut rng);
        let Some((lines, _)) = observe(&mut rng, &pose, &THREE, 0.0) else { continue };
        let three = [0, 1, 2].map(|i: usize| lines[i]);
        let mut least = f64::INFINITY;
        for cam_from_target in
            line_rotation(&three.map(|l| l.seen.normal()), &three.map(|l| l.direction_in_target))
        {
            let rotation = KnownRotation { cam_from_target, covariance: Matrix3::zeros() };
            match position_with_rotation(&rotation, &[], &lines, &views::camera(), &[]) {
                Ok(placed) => least = least.min(error(&pose, &placed.cam_from_target).norm()),
                Err(_) => refused += usize::from((cam_from_target - pose.rotation).norm() < 1e-6),
            }
        }
        taken += 1;
        several += usize::from(least < 1e-9);
    }
    println!("three lines in space: {several} of {taken} exact, {refused} refused as open");
    // A double root to the root of rounding: one view in a thousand.
    assert!(taken - refused <= several + taken / 500 && refused < taken / 50, "{several} {refused} {taken}");
}

/// Variance over the Cramér–Rao bound (the covariance at the true pose), normalised errors, 95 % regions, χ². First order: answers
/// near the truth.
fn efficient_and_consistent(name: &str, seed: u64, scene: Scene) {
    let mut rng = Rng::new(seed);
    let (mut rotation, mut position_with_rotation, mut nees, mut covered, mut chi2, mut taken, mut flips) =
        (0.0, 0.0, 0.0, 0, 0.0, 0, 0);
    for _ in 0..6000 {
        let pose = (scene.1)(&mut rng);
        let Some((lines, points)) = observe(&mut rng, &pose, &scene, SIGMA_PX) else { continue };
        let Ok(found) = solve(&lines, &points) else { continue };
        // Of the lane's two poses the one above the road; a box has one.
        let above = |(p, _): &(Pose, Matrix6)| scene.0().len() != 3 || 0.0 < p.origin().z;
        let Some((found_pose, covariance)) = answers(&found).into_iter().find(above) else { continue };
        let e = error(&pose, &found_pose);
        if 0.3 < e.fixed_rows::<3>(0).norm() {
            flips += 1;
            continue;
        }
        let Some((exact, exact_points)) = observe(&mut rng, &pose, &scene, 0.0) else { continue };
        let bound = refine_lines(&pose, &exact, &Problem::new(&exact_points, &views::camera()))
            .expect("the bound")
            .covariance;
        rotation += e.fixed_rows::<3>(0).norm_squared() / bound.fixed_view::<3, 3>(0, 0).trace();
        position_with_rotation +=
            e.fixed_rows::<3>(3).norm_squared() / bound.fixed_view::<3, 3>(3, 3).trace();
        let squared = e.dot(&(covariance.try_inverse().expect("positive definite") * e));
        nees += squared / 6.0;
        if taken % 20 == 0 {
            let budget = found.budget(&lines, &Problem::new(&points, &views::camera())).expect("its parts");
            assert_adds_up(&budget, &found.covariance, name);
        }
        covered += usize::from(squared < 12.592); // χ²₆ at 95 %
        chi2 += found.chi2 / found.degrees_of_freedom.max(1) as f64;
        taken += 1;
    }
    let per = |x: f64| x / taken as f64;
    let (rotation, position_with_rotation, nees, coverage, chi2) =
        (per(rotation), per(position_with_rotation), per(nees), per(covered as f64), per(chi2));
    println!(
        "{name}: {taken} answers, {flips} flips; variance/bound {rotation:.3} {position_with_rotation:.3}, NEES/6 {nees:.3}, 95 % covers {coverage:.4}, χ²/dof {chi2:.3}"
    );
    assert!(3000 < taken && flips <= taken / 500, "{name}: {taken} {flips}");
    assert!(rotation < 1.06 && position_with_rotation < 1.06, "{name}: {rotation} {position_with_rotation}");
    assert!((0.95..1.06).contains(&nees) && (0.94..0.96).contains(&coverage), "{name}: {nees} {coverage}");
}

#[test]
fn noisy_lines_reach_the_bound() {
    efficient_and_consistent("lane and stop line", 21, LANE);
    efficient_and_consistent("edges of a box", 22, BOX);
    efficient_and_consistent("edges of a box and two points", 23, BOX_AND_TWO_POINTS);
}

#[test]
fn lines_that_leave_the_pose_open_are_refused() {
    let mut rng = Rng::new(31);
    let pose = views::on_the_road(&mut rng);
    let lines: Vec<_> = lane().into_iter().filter_map(|ends| line(&mut rng, &pose, ends, 0.0)).collect();
    assert_eq!(lines.len(), 3);
    assert_eq!(solve(&lines[..2], &[]).map(|_| ()), Err(Error::TooFewPoints { seen: 2, needed: 3 }));
    // Three edges, all parallel: the place along the road is open.
    let third =
        line(&mut rng, &pose, [Point::new(0.5, 3.0, 0.0), Point::new(0.5, 12.0, 0.0)], 0.0).expect("in view");
    let parallel = [lines[0], lines[1], third];
    assert!(solve(&parallel, &[]).is_err());
    let mut nan = lines.clone();
    nan[1].point_in_target = Some(Point::new(f64::NAN, 0.0, 0.0));
    assert_eq!(solve(&nan, &[]).map(|_| ()), Err(Error::NotFinite { what: "the line", index: 1 }));
    // One plane with the camera: twice the same line.
    assert!(vanishing_point(&[lines[0].seen, lines[0].seen]).is_err());
    assert!(vanishing_point(&[lines[0].seen]).is_err());
}

/// Rows of a file often begin along an edge: three points on a line give no start, and those behind them do.
#[test]
fn points_that_begin_on_a_line_give_a_start() {
    let (mut rng, pose) = (Rng::new(17), Pose::exp(&Vector6::new(0.2, -0.4, 0.1, 0.02, 0.03, 1.2)));
    let at = |i: u32| Point::new(0.1 * f64::from(i % 4), 0.1 * f64::from(i / 4), 0.0);
    let seen: Vec<Correspondence> = (0..8)
        .map(|i| Correspondence::new(&views::camera(), at(i), views::pixel_of(&(pose * at(i))), SIGMA_PX))
        .collect::<Result<_, _>>()
        .expect("in the field");
    let lines: Vec<LineCorrespondence> = [[at(0), at(5)], [at(3), at(6)]]
        .into_iter()
        .filter_map(|ends| line(&mut rng, &pose, ends, 0.0))
        .collect();
    let found = solve(&lines, &seen).expect("a pose").cam_from_target;
    assert!((found.inverse() * pose).log().norm() < 1e-9);
}
