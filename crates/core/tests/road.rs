//! Road marks: a lane of known width with its stop line, and a road of unknown width with the height of the camera.

use crate::common::{Rng, views};
use nalgebra::{Unit, Vector2, Vector3};
use resight_core::line::{ImageLine, LineCorrespondence};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::lines::{LinesEstimate, locate_lines, refine_lines};
use resight_core::locate::prior::Prior;
use resight_core::locate::problem::Problem;
use resight_core::{Error, Matrix6, Point, Pose, Vector6};

const SIGMA_PX: f64 = 0.5;

/// A segment and its image; `is_placed` says whether its place is known, or only its direction.
fn control_point(
    rng: &mut Rng,
    pose: &Pose,
    [a, b]: [Point; 2],
    is_placed: bool,
    noise_px: f64,
) -> LineCorrespondence {
    let mut end =
        |x: &Point| views::pixel_of(&(pose * x)) + Vector2::new(rng.normal(), rng.normal()) * noise_px;
    let seen = ImageLine::new(&views::camera(), [end(&a), end(&b)], SIGMA_PX).expect("a line");
    LineCorrespondence {
        point_in_target: is_placed.then_some(a),
        direction_in_target: Unit::new_normalize(b - a),
        seen,
    }
}

/// Left edge, right edge (known in direction only where the width is not known), stop line.
fn control_points(
    rng: &mut Rng,
    pose: &Pose,
    width_is_known: bool,
    noise_px: f64,
) -> Vec<LineCorrespondence> {
    let edge = |x: f64| [Point::new(x, 2.0, 0.0), Point::new(x, 14.0, 0.0)];
    let stop = [Point::new(-1.75, 6.0, 0.0), Point::new(1.75, 6.0, 0.0)];
    let mut control_point = |ends, is_placed| control_point(rng, pose, ends, is_placed, noise_px);
    vec![
        control_point(edge(-1.75), true),
        control_point(edge(1.75), width_is_known),
        control_point(stop, true),
    ]
}

/// The camera's height over the road, off by `error_m`.
fn height(pose: &Pose, error_m: f64, sigma_m: f64) -> Prior {
    let height_m = pose.origin().z + error_m;
    Prior::Height { normal_in_target: Vector3::z(), offset_m: 0.0, height_m, sigma_m }
}

fn solve(lines: &[LineCorrespondence], priors: &[Prior]) -> Result<LinesEstimate, Error> {
    locate_lines(lines, &Problem { priors, ..Problem::new(&[], &views::camera()) })
}

fn error(truth: &Pose, found: &Pose) -> Vector6 {
    (*truth * found.inverse()).log()
}

/// Half a turn about the stop line maps the lane onto itself: its image has a second camera under the road. Any word about the height,
/// here to half a metre, or about gravity, to ten degrees, ends that.
#[test]
fn a_lane_with_its_stop_line_has_a_duplicate_below_the_road() {
    let mut rng = Rng::new(1);
    for _ in 0..300 {
        let pose = views::on_the_road(&mut rng);
        let lines = control_points(&mut rng, &pose, true, 0.0);
        let Ambiguity::Ambiguous { other, .. } = solve(&lines, &[]).expect("a pose").ambiguity else {
            panic!("the duplicate is missing")
        };
        assert!(other.chi2 < 1e-9);
        let down_in_target = -Vector3::z();
        let gravity =
            Prior::Gravity { down_in_target, down_in_cam: pose.rotation * down_in_target, sigma_rad: 0.17 };
        for prior in [height(&pose, 0.0, 0.3), gravity] {
            let found = solve(&lines, &[prior]).expect("a pose");
            assert!(matches!(found.ambiguity, Ambiguity::Unique { .. }));
            let off = error(&pose, &found.cam_from_target).norm();
            assert!(off < 1e-9, "{off:e}");
        }
    }
}

/// Two parallel marks of unknown distance, a stop line and the camera's height: six numbers, the true pose and the one of a camera that
/// looks back: half a turn about the vertical through the corner maps the known lines onto themselves. A last pose, here good to 20°
/// and 2 m, ends that.
#[test]
fn a_road_of_unknown_width_needs_the_height() {
    let mut rng = Rng::new(2);
    let (mut ambiguous, total) = (0, 500);
    for _ in 0..total {
        let pose = views::on_the_road(&mut rng);
        let lines = control_points(&mut rng, &pose, false, 0.0);
        assert_eq!(solve(&lines, &[]).map(|_| ()), Err(Error::TooFewPoints { seen: 3, needed: 3 }));
        let found = solve(&lines, &[height(&pose, 0.0, 0.01)]).expect("a pose");
        let off = error(&pose, &found.cam_from_target).norm();
        let alternative = match found.ambiguity {
            Ambiguity::Unique { .. } => f64::INFINITY,
            Ambiguity::Ambiguous { other, .. } => {
                ambiguous += 1;
                error(&pose, &other.cam_from_target).norm()
            }
        };
        assert!(off.min(alternative) < 1e-9, "{off:e} {alternative:e}");
        let covariance = Matrix6::from_diagonal(&Vector6::new(0.12, 0.12, 0.12, 4.0, 4.0, 4.0));
        let last = Prior::Pose { cam_from_target: pose, covariance };
        let found = solve(&lines, &[height(&pose, 0.0, 0.01), last]).expect("a pose");
        assert!(matches!(found.ambiguity, Ambiguity::Unique { .. }));
        assert!(error(&pose, &found.cam_from_target).norm() < 1e-9);
    }
    assert_eq!(ambiguous, total);
}

/// Variance over the Cramér–Rao bound, normalised errors and 95 % regions, with noise of the marks (0.5 px) and of the height (2 cm).
#[test]
fn road_control_points_reach_the_bound() {
    for (seed, width_is_known) in [(3, true), (4, false)] {
        let mut rng = Rng::new(seed);
        let (mut rotation, mut place, mut nees, mut covered, mut taken, mut far) = (0.0, 0.0, 0.0, 0, 0, 0);
        for _ in 0..5000 {
            let pose = views::on_the_road(&mut rng);
            let lines = control_points(&mut rng, &pose, width_is_known, SIGMA_PX);
            let Ok(found) = solve(&lines, &[height(&pose, 0.02 * rng.normal(), 0.02)]) else { continue };
            let near = |p: &Pose| error(&pose, p).norm();
            let (cam_from_target, covariance) = match found.ambiguity {
                Ambiguity::Ambiguous { other, .. }
                    if near(&other.cam_from_target) < near(&found.cam_from_target) =>
                {
                    (other.cam_from_target, other.covariance)
                }
                _ => (found.cam_from_target, found.covariance),
            };
            let e = error(&pose, &cam_from_target);
            if 0.3 < e.fixed_rows::<3>(0).norm() {
                far += 1;
                continue;
            }
            let exact = control_points(&mut rng, &pose, width_is_known, 0.0);
            let (camera, known) = (views::camera(), [height(&pose, 0.0, 0.02)]);
            let problem = Problem { priors: &known, ..Problem::new(&[], &camera) };
            let bound = refine_lines(&pose, &exact, &problem).expect("the bound").covariance;
            rotation += e.fixed_rows::<3>(0).norm_squared() / bound.fixed_view::<3, 3>(0, 0).trace();
            place += e.fixed_rows::<3>(3).norm_squared() / bound.fixed_view::<3, 3>(3, 3).trace();
            let squared = e.dot(&(covariance.try_inverse().expect("positive definite") * e));
            nees += squared;
            covered += usize::from(squared < 12.592); // χ²₆ at 95 %
            taken += 1;
        }
        let per = |x: f64| x / taken as f64;
        let (rotation, place, nees, coverage) = (per(rotation), per(place), per(nees), per(covered as f64));
        println!(
            "width known {width_is_known}: variance/bound {rotation:.3} {place:.3}, NEES {nees:.3}, 95 % covers {coverage:.4}, {taken} taken, {far} far"
        );
        assert!(4900 < taken && far <= 5, "{taken} {far}");
        assert!(rotation < 1.06 && place < 1.06, "{rotation} {place}");
        assert!((5.7..6.35).contains(&nees) && (0.94..0.96).contains(&coverage), "{nees} {coverage}");
    }
}
