//! Pose from lines, with points and priors where there are any: starts from closed forms, then maximum likelihood.
//!
//! A line known in place adds the distances of its two image ends from its image; one of which only the direction is known adds one
//! number. Derivation: docs/math/lines.md, whose equations are cited.
//!
//!   D = R d, x = R p + t  direction and point of a line in the camera frame   ·   m = D × x   ·   b, J  bearing of an end, ∂b/∂pixel

use crate::least_squares::{NormalEquations, PivotedPose, minimize_pose};
use crate::line::LineCorrespondence;
use crate::locate::choose::{AMBIGUITY_GATE_CHI2, Ambiguity, Minima, Minimum, choose, insert};
use crate::locate::known_rotation::{Known, KnownRotation, position_with_rotation};
use crate::locate::prior::Prior;
use crate::locate::problem::Problem;
use crate::locate::refine::{log_determinant, normal_equations, residual_sums};
use crate::locate::reweight::minimize_reweighted;
use crate::solve::line_rotation::line_rotation;
use crate::solve::p3p::p3p;
use crate::{Correspondence, Error, Matrix6, Point, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Unit, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A pose from lines, how uncertain, and whether another one fits as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinesEstimate {
    /// The pose: x_in_cam = cam_from_target · x_in_target.
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Sum of squared residuals of lines, points and priors over their variances.
    pub chi2: f64,
    /// Numbers measured less six; compare `chi2` by `consistency::is_unlikely`.
    pub degrees_of_freedom: usize,
    /// Does another pose fit as well?
    pub ambiguity: Ambiguity,
}

/// Starts tried at most: each triple of lines has up to eight rotations.
const MAX_STARTS: usize = 32;
/// Triples of lines that give starts.
const MAX_TRIPLES: usize = 3;

/// The pose that `lines`, and the points and priors of `problem`, agree on best.
///
/// Enough are three lines not all parallel (two edges of a lane of known width and a stop line), two parallel edges of which one is
/// known in direction only and a stop line with the camera's height (`Prior::Height`), or any three lines in space. What lies behind the
/// camera is no answer. Starts come from the lines' directions, from three points, and from a pose prior.
///
/// # Errors
/// `TooFewPoints` for less than six numbers; `InvalidPrior`; `DegenerateView` where lines and points leave the pose open;
/// `NoSolution` where no pose has them in front of the camera.
pub fn locate_lines(lines: &[LineCorrespondence], problem: &Problem) -> Result<LinesEstimate, Error> {
    let numbers = problem.rows() + lines.iter().map(rows).sum::<usize>();
    let n_seen = lines.len() + problem.seen.len();
    check(lines, problem)?;
    if numbers < 6 {
        return Err(Error::TooFewPoints { seen: n_seen, needed: 3 });
    }
    let mut minima = Minima::new();
    let (starts, mut refusal) = starts(lines, problem);
    for start in starts {
        match refine_lines(&start, lines, problem) {
            Ok(minimum) if in_front(&minimum.cam_from_target, lines) => insert(&mut minima, minimum),
            Ok(_) => {}
            Err(reason) => refusal = reason,
        }
    }
    if minima.is_empty() {
        return Err(refusal);
    }
    let choice = choose(&minima, n_seen, 1.0, AMBIGUITY_GATE_CHI2)?;
    let ambiguity = match (choice.alternative, choice.ratio) {
        (Some(alternative), Some(ratio)) => Ambiguity::Ambiguous { ratio, other: *alternative },
        (_, ratio) => Ambiguity::Unique { ratio },
    };
    // Once more from the minimum: to rounding, where the loop ended within 3·10⁻⁴ standard deviations.
    let Minimum { cam_from_target, covariance, chi2, .. } =
        refine_lines(&choice.best.cam_from_target, lines, problem)?;
    Ok(LinesEstimate { cam_from_target, covariance, chi2, degrees_of_freedom: numbers - 6, ambiguity })
}

/// The information of the lines about the pivot.
pub(super) fn information(place: &PivotedPose, pivot: &Point, lines: &[LineCorrespondence]) -> Matrix6 {
    let mut normal = NormalEquations::zero();
    lines.iter().for_each(|line| add_line(&mut normal, place, pivot, line));
    normal.information()
}

/// How many numbers a line measures.
fn rows(line: &LineCorrespondence) -> usize {
    if line.point_in_target.is_some() { 2 } else { 1 }
}

fn check(lines: &[LineCorrespondence], problem: &Problem) -> Result<(), Error> {
    problem.check()?;
    for (index, line) in lines.iter().enumerate() {
        let place = line.point_in_target.map_or(0.0, |p| p.sum());
        if !(place + line.direction_in_target.sum() + line.seen.normal().sum()).is_finite() {
            return Err(Error::NotFinite { what: "the line", index });
        }
    }
    Ok(())
}

/// Refines `start` to the nearest minimum of the joint cost of lines, points and priors, with its covariance. `rms_px` is that of
/// the points and the ends of lines known in place.
///
/// # Errors
/// As `refine::refine`.
pub fn refine_lines(start: &Pose, lines: &[LineCorrespondence], problem: &Problem) -> Result<Minimum, Error> {
    let pivot = pivot(lines, problem);
    let n_points = lines.len() + problem.seen.len();
    let evaluate = |place: &PivotedPose, problem: &Problem| {
        let mut normal = normal_equations(place, &pivot, problem)?;
        lines.iter().for_each(|line| add_line(&mut normal, place, &pivot, line));
        normal.chi2.is_finite().then_some(normal)
    };
    let start = PivotedPose::new(start, &pivot);
    let found = if problem.has_uncertain_points() {
        minimize_reweighted(start, &pivot, |place, at| evaluate(place, &problem.held_at(at)))
    } else {
        minimize_pose(start, None, |place| evaluate(place, problem))
    };
    let solution = found.ok_or(Error::NoSolution { n_points })?;
    if !solution.is_minimum() {
        return Err(Error::NotConverged { steps: solution.steps });
    }
    let covariance =
        solution.equations.covariance_at_camera(&solution.state.pivot_in_cam).ok_or(Error::DegenerateView {
            reason: "lines and points leave a direction of the pose open; add a line of another direction or a point",
            metric: 0.0,
            needed: f64::MIN_POSITIVE,
        })?;
    let cam_from_target = solution.state.pose(&pivot);
    let (chi2, rms_px) = sums(&cam_from_target, lines, problem);
    let log_determinant = log_determinant(&cam_from_target, problem);
    Ok(Minimum { cam_from_target, covariance, chi2, rms_px, log_determinant })
}

/// The mean of the points, and of the lines' points.
pub(super) fn pivot(lines: &[LineCorrespondence], problem: &Problem) -> Point {
    let points =
        problem.seen.iter().map(|c| c.x_in_target).chain(lines.iter().filter_map(|l| l.point_in_target));
    let (sum, n) = points.fold((Point::zeros(), 0.0), |(sum, n), x| (sum + x, n + 1.0));
    sum / f64::max(n, 1.0)
}

/// Residuals and derivatives of one line, eqs. (6)–(7), about the pivot.
fn add_line(normal: &mut NormalEquations, place: &PivotedPose, pivot: &Point, line: &LineCorrespondence) {
    let d = place.rotation * line.direction_in_target.into_inner();
    let Some(point) = line.point_in_target else {
        let (r, by_direction) = line.seen.direction_residual(&d);
        return normal.add(-r, &d.cross(&by_direction), &Vector3::zeros());
    };
    let y = place.rotation * (point - pivot);
    let x = y + place.pivot_in_cam;
    let m = d.cross(&x);
    for i in 0..2 {
        let (r, q) = line.seen.plane_residual(i, &m);
        let by_place = q.cross(&d);
        normal.add(-r, &(y.cross(&by_place) + d.cross(&x.cross(&q))), &by_place);
    }
}

/// χ² and root mean square distance, px.
fn sums(cam_from_target: &Pose, lines: &[LineCorrespondence], problem: &Problem) -> (f64, f64) {
    let (points_chi2, points_rms_px) =
        if problem.rows() == 0 { (0.0, 0.0) } else { residual_sums(cam_from_target, problem) };
    let (mut chi2, mut sum, mut n) =
        (points_chi2, points_rms_px.powi(2) * problem.seen.len() as f64, problem.seen.len());
    for line in lines {
        let d = cam_from_target.rotation * line.direction_in_target.into_inner();
        let Some(point) = line.point_in_target else {
            chi2 += line.seen.direction_residual(&d).0.powi(2);
            continue;
        };
        let squared: f64 =
            line.seen.residuals(&d.cross(&(cam_from_target * &point))).iter().map(|r| r * r).sum();
        chi2 += squared;
        sum += squared * line.seen.sigma_px.powi(2);
        n += 2;
    }
    (chi2, (sum / n.max(1) as f64).sqrt())
}

/// Whether what is seen of every line lies in front of the camera: the point of the line nearest to the ray of each end.
fn in_front(cam_from_target: &Pose, lines: &[LineCorrespondence]) -> bool {
    lines.iter().all(|line| {
        let Some(point) = line.point_in_target else { return true };
        let d = cam_from_target.rotation * line.direction_in_target.into_inner();
        let x = d.cross(&(cam_from_target * &point));
        // λ b − x runs along D: λ (D × b) = D × x.
        line.seen.bearings.iter().all(|b| 0.0 < d.cross(b).dot(&x))
    })
}

/// Where the refinement starts, and why it starts nowhere else.
fn starts(lines: &[LineCorrespondence], problem: &Problem) -> (ArrayVec<Pose, MAX_STARTS>, Error) {
    let mut found = ArrayVec::<Pose, MAX_STARTS>::new();
    let mut refusal = Error::NoSolution { n_points: lines.len() + problem.seen.len() };
    let prior = problem.priors.iter().find_map(|prior| match prior {
        Prior::Pose { cam_from_target, .. } => Some(*cam_from_target),
        _ => None,
    });
    found.extend(prior);
    if let Some(three) = three_off_a_line(problem.seen) {
        found.extend(p3p(&three.map(|c| c.bearing), &three.map(|c| c.x_in_target)));
    }
    let known = known(problem);
    for triple in triples(lines) {
        let chosen = triple.map(|i| &lines[i]);
        for cam_from_target in
            line_rotation(&chosen.map(|l| l.seen.normal()), &chosen.map(|l| l.direction_in_target))
        {
            let rotation = KnownRotation { cam_from_target, covariance: Matrix3::zeros() };
            match position_with_rotation(&rotation, problem.seen, lines, problem.camera, &known) {
                Ok(placed) if !found.is_full() => found.push(placed.cam_from_target),
                Ok(_) => {}
                Err(reason) => refusal = reason,
            }
        }
    }
    (found, refusal)
}

/// Three points that give a start: the first one, the one farthest from it, and the one farthest from the line through both. None where all lie on a
/// line.
fn three_off_a_line(seen: &[Correspondence]) -> Option<[&Correspondence; 3]> {
    let first = seen.first()?;
    let from_first = |c: &Correspondence| c.x_in_target - first.x_in_target;
    let farthest = |distance2: &dyn Fn(&Correspondence) -> f64| {
        seen.iter().max_by(|a, b| distance2(a).total_cmp(&distance2(b)))
    };
    let second = farthest(&|c| from_first(c).norm_squared())?;
    let off_line2 = |c: &Correspondence| from_first(second).cross(&from_first(c)).norm_squared();
    let third = farthest(&off_line2)?;
    (0.0 < off_line2(third)).then_some([first, second, third])
}

/// What the priors say about the place.
fn known(problem: &Problem) -> ArrayVec<Known, 4> {
    let height = |normal: &Vector3<f64>, offset_m: f64, height_m: f64, sigma_m: f64| Known::Height {
        normal_in_target: Unit::new_normalize(*normal),
        offset_m,
        height_m,
        sigma_m,
    };
    let known = |prior: &Prior| match prior {
        Prior::Height { normal_in_target, offset_m, height_m, sigma_m }
        | Prior::Plane { normal_in_target, offset_m, height_m, sigma_m, .. } => {
            Some(height(normal_in_target, *offset_m, *height_m, *sigma_m))
        }
        Prior::Pose { cam_from_target, covariance } => Some(Known::position_of(cam_from_target, covariance)),
        Prior::Gravity { .. } => None,
    };
    problem.priors.iter().filter_map(known).take(4).collect()
}

/// Triples of lines that see the rotation best: the volume of their directions, or of their planes where two are parallel.
fn triples(lines: &[LineCorrespondence]) -> ArrayVec<[usize; 3], MAX_TRIPLES> {
    let mut best = ArrayVec::<(f64, [usize; 3]), MAX_TRIPLES>::new();
    let n = lines.len().min(MAX_COMPARED);
    for [i, j, k] in (0..n).flat_map(|i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [i, j, k]))) {
        let score = openness([&lines[i], &lines[j], &lines[k]]);
        let place = best.iter().position(|(other, _)| *other < score).unwrap_or(best.len());
        if place < MAX_TRIPLES {
            best.truncate(MAX_TRIPLES - 1);
            best.insert(place.min(best.len()), (score, [i, j, k]));
        }
    }
    best.into_iter().filter(|(score, _)| 0.0 < *score).map(|(_, triple)| triple).collect()
}

/// More lines than this are not compared for a start; all take part in the refinement.
const MAX_COMPARED: usize = 12;

/// Sines between the directions, and between the planes of those that are parallel, multiplied.
fn openness(lines: [&LineCorrespondence; 3]) -> f64 {
    let [a, b, c] = lines;
    let (mut score, mut parallels) = (1.0, 0);
    for (x, y) in [(a, b), (b, c), (a, c)] {
        let between_planes = x.seen.normal().cross(&y.seen.normal()).norm();
        let sine = x.direction_in_target.cross(&y.direction_in_target).norm();
        let is_parallel = sine < 1e-6;
        parallels += usize::from(is_parallel);
        score *= if is_parallel { between_planes } else { sine };
    }
    if parallels < 2 { score } else { 0.0 }
}
