//! Time offsets between the cameras of a rig that watches a moving target: docs/math/rig.md section 16.
//!
//! The poses of a body in neighbouring views give its path; a camera that exposes later sees the body farther along it. Poses are at their minimum
//! under given times, so that the Gauss–Newton step of the times alone is that of times and poses together, as in section 15:
//!
//! ```text
//!   P(T + Δ) = P(T) Exp(ζ(Δ))     Δ = t + τ + κ (row − centre) − T                                         eqs. (32), (33)
//!   S = QᵀWQ − KᵀH⁻¹K,   S δ = QᵀWr,   K = JᵀWQ                                                             eq. (34)
//!   Σ_τ = ν S⁻¹ or Σ c cᵀ over views, whichever is larger                                                   eq. (35)
//!   Q  derivative of the pixels by τ and κ   ·   t  stamp of a frame   ·   T  time of its view   ·   τ, κ  offset of a camera, line time
//! ```

use super::adjust::{Adjusted, adjust, keeps_minimum};
use super::layout::Layout;
use super::sighted::{LocatedViews, poses_of_observations};
use super::start::start;
use super::uncertain_lens::{OfObservation, sums_of};
use super::{Observation, RigConfig, RigProblem};
use crate::explanation::Estimate;
use crate::least_squares::rig::{Common, Eliminated, RigPoses};
use crate::locate::loss::Loss;
use crate::{Camera, Correspondence, Error, Point, Pose, Vector6};
use nalgebra::{DMatrix, DVector, Vector2, Vector3};
use std::collections::BTreeMap;

/// When the observations of a rig were made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameStamps<'a> {
    /// The stamp of each observation's frame, s, in the order of `RigProblem::observations`.
    pub stamps_s: &'a [f64],
    /// Whether the time from one row of a rolling shutter to the next, which all cameras share, is estimated too.
    pub line_time: bool,
}

/// Estimated times of exposure.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeOffsets {
    /// For each camera the time to add to its stamps, s, and its standard deviation: zero for the camera with which the others are compared, none
    /// for a camera that sees no motion.
    pub offset_s: Vec<Option<(f64, f64)>>,
    /// The time from one row to the next, s, and its standard deviation, where asked for and shown.
    pub line_time_s: Option<(f64, f64)>,
    /// Whether a camera's stamps count one by one; otherwise only their mean offset does, because they scatter more than the exposures, as times
    /// of arrival do.
    pub stamps_count: bool,
    /// By how much χ² is lower than with all frames of a view taken at once, in units of the noise.
    pub gain_chi2: f64,
    /// The observations with their points where the target had them at the time of each exposure.
    pub observations: Vec<Observation>,
    /// The motion of each observation's target at its exposure, target frame, 1/s; none where it is not known.
    twists: Vec<Option<Vector6>>,
    columns: Columns,
    /// Covariance of the times in the order of their columns, s².
    pub(super) covariance: DMatrix<f64>,
}

/// The columns of the times that are estimated.
#[derive(Debug, Clone, PartialEq)]
struct Columns {
    of_camera: Vec<Option<usize>>,
    of_line_time: Option<usize>,
    n: usize,
}

impl TimeOffsets {
    /// Returns the offsets of the cameras that are compared with another one, none where all are that of the line time.
    pub(super) fn estimate(&self, degrees_of_freedom: f64) -> Option<Estimate> {
        let known = self.columns.of_camera.iter().zip(&self.offset_s);
        let known: Vec<(usize, f64)> = known.filter_map(|(k, offset)| Some(((*k)?, (*offset)?.0))).collect();
        let covariance = |i: usize, j: usize| self.covariance[(known[i].0, known[j].0)];
        (!known.is_empty()).then(|| Estimate {
            value: DVector::from_iterator(known.len(), known.iter().map(|(_, offset_s)| *offset_s)),
            covariance: DMatrix::from_fn(known.len(), known.len(), covariance),
            degrees_of_freedom,
        })
    }
}

/// Two views of a body farther apart than this say nothing of its motion between them, s: a hand changes its motion within half a second.
const LONGEST_GAP_S: f64 = 0.5;
/// Number of rounds; the first finds the offset, the others what is lost by the curvature of the path.
const MAX_ROUNDS: usize = 8;
/// The offsets have converged when a round changes none by more than this, s.
const SETTLED_S: f64 = 1e-6;
/// A time that the pixels do not show keeps only this share of its information, by rounding.
const NOTHING_LEFT: f64 = 1e-9;
/// Stamps within a view that differ by less are equal, s.
const EQUAL_S: f64 = 1e-7;
/// Largest number of times that the means of cameras and views are taken in turn.
const MAX_ALTERNATIONS: usize = 1000;
/// Smallest gain of χ², in units of the noise, by counting stamps only in the mean: 2 ln 10⁴, because stamps are usually right.
const NEEDED_GAIN: f64 = 18.4;

/// Number of neighbours that a path goes through.
const NEIGHBOURS: usize = 4;

/// The motion of a target about its pose at the time of its view, in its own frame: the coefficients of Δ, Δ², … in ζ, rad and m.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Motion([Vector6; NEIGHBOURS]);

/// Estimates the offsets of the cameras' clocks from a target that moves, and moves the points of the observations accordingly: to be used
/// in place of those given, with `RigConfig::time_offsets`.
///
/// `None` where no two cameras see a body that moves: in views less than half a second apart.
///
/// # Errors
/// Those of `solve_rig`; `InvalidSetting` for times that are not finite or not one for each observation, and under a loss that keeps wrong
/// points.
pub fn time_offsets(
    problem: &RigProblem,
    config: &RigConfig,
    times: &FrameStamps,
) -> Result<Option<TimeOffsets>, Error> {
    check(problem, config, times)?;
    let layout = Layout::new(problem, config)?;
    let moving = Clock::new(problem, times, true);
    if !moving.has_neighbours(problem) {
        return Ok(None);
    }
    let located_views = poses_of_observations(&layout);
    let at_once = (problem.observations.to_vec(), start(&layout, &located_views)?);
    let simultaneous = State::new(problem, config, at_once, &located_views)?;
    let Some(as_stamped) = estimated(problem, config, times, &moving, &simultaneous)? else {
        return Ok(None);
    };
    if !moving.scatters {
        return Ok(Some(as_stamped.offsets));
    }
    let mean = Clock::new(problem, times, false);
    let best = match estimated(problem, config, times, &mean, &simultaneous)? {
        Some(by_mean) if NEEDED_GAIN * by_mean.noise < as_stamped.chi2 - by_mean.chi2 => by_mean,
        _ => as_stamped,
    };
    Ok(Some(best.offsets))
}

fn check(problem: &RigProblem, config: &RigConfig, times: &FrameStamps) -> Result<(), Error> {
    let refused = |setting, seen, needed| Err(Error::InvalidSetting { setting, seen, needed });
    if times.stamps_s.len() != problem.observations.len() {
        return refused("stamps_s", times.stamps_s.len() as f64, "there must be one for each observation");
    }
    if let Some(bad) = times.stamps_s.iter().find(|t_s| !t_s.is_finite()) {
        return refused("stamps_s", *bad, "times must be finite");
    }
    match keeps_minimum(config.loss) {
        true => Ok(()),
        false => {
            refused("loss", f64::NAN, "the squared or the truncated loss where time offsets are estimated")
        }
    }
}

/// Stamps within their views.
struct Clock {
    /// T of each view.
    view_s: Vec<f64>,
    /// t − T of each observation.
    stamp_s: Vec<f64>,
    /// Mean of t − T for each camera: whoever's stamps are late, the search begins with all cameras exposing at once.
    mean_s: Vec<f64>,
    /// Variance of the mean stamp of each camera, where only that counts.
    mean_variance_s2: Vec<f64>,
    stamps_count: bool,
    /// Whether stamps scatter from view to view.
    scatters: bool,
}

impl Clock {
    /// `stamps_count`: one by one, otherwise only their mean for each camera, which is that beside the views' times, whoever saw a view.
    fn new(problem: &RigProblem, times: &FrameStamps, stamps_count: bool) -> Self {
        // Stamps may count from 1970: what is left of their digits is kept.
        let first_s = times.stamps_s.iter().copied().fold(f64::INFINITY, f64::min);
        let all = || problem.observations.iter().zip(times.stamps_s.iter().map(move |t_s| t_s - first_s));
        let of_views = |of_cameras: &[f64]| {
            means(problem.n_views, all().map(|(s, t_s)| (s.view, t_s - of_cameras[s.camera])))
        };
        let of_cameras = |of_views: &[f64]| {
            means(problem.cameras.len(), all().map(|(s, t_s)| (s.camera, t_s - of_views[s.view])))
        };
        let mut views = of_views(&vec![0.0; problem.cameras.len()]);
        let mut cameras = of_cameras(&views);
        for _ in 0..MAX_ALTERNATIONS {
            views = of_views(&cameras);
            let next = of_cameras(&views);
            let change = next.iter().zip(&cameras).map(|(now, before)| (now - before).abs());
            let is_settled = change.fold(0.0, f64::max) < SETTLED_S;
            cameras = next;
            if is_settled {
                break;
            }
        }
        let rest = || all().map(|(s, t_s)| (s.camera, t_s - views[s.view] - cameras[s.camera]));
        let scatters = EQUAL_S < rest().map(|(_, rest_s)| rest_s.abs()).fold(0.0, f64::max);
        if stamps_count {
            let stamp_s = all().map(|(s, t_s)| t_s - views[s.view]).collect();
            let mean_variance_s2 = vec![0.0; cameras.len()];
            return Clock {
                stamp_s,
                view_s: views,
                mean_s: cameras,
                mean_variance_s2,
                stamps_count,
                scatters,
            };
        }
        let mut n = vec![0.0; cameras.len()];
        all().for_each(|(s, _)| n[s.camera] += 1.0);
        let squares = means(cameras.len(), rest().map(|(camera, rest_s)| (camera, rest_s * rest_s)));
        let mean_variance_s2 =
            squares.iter().zip(&n).map(|(square, n)| square / f64::max(n - 1.0, 1.0)).collect();
        let stamp_s = all().map(|(s, _)| cameras[s.camera]).collect();
        Clock { stamp_s, view_s: views, mean_s: cameras, mean_variance_s2, stamps_count, scatters }
    }
}

/// Returns the mean of the values of each index; 0 where there are none.
fn means(n: usize, values: impl Iterator<Item = (usize, f64)>) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); n];
    for (index, value) in values {
        sums[index].0 += value;
        sums[index].1 += 1.0;
    }
    sums.into_iter().map(|(sum, n)| sum / f64::max(n, 1.0)).collect()
}

impl Clock {
    /// Returns whether any body is seen in two views near enough to each other for a path.
    fn has_neighbours(&self, problem: &RigProblem) -> bool {
        let place = |seen: &Observation| (problem.body_of_target[seen.target], self.view_s[seen.view]);
        let mut places: Vec<(usize, f64)> = problem.observations.iter().map(place).collect();
        places.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        places.windows(2).any(|pair| pair[0].0 == pair[1].0 && are_near(pair[0].1, pair[1].1))
    }
}

/// Returns whether two times are those of neighbours in a path.
fn are_near(earlier_s: f64, later_s: f64) -> bool {
    let gap_s = later_s - earlier_s;
    EQUAL_S < gap_s && gap_s <= LONGEST_GAP_S
}

/// The rig under the times of a moment.
#[derive(Clone)]
struct State<'a> {
    observations: Vec<Observation>,
    /// Poses of the observations as given: what the points move by does not lead to other ones.
    located_views: &'a LocatedViews,
    adjusted: Adjusted,
}

impl<'a> State<'a> {
    fn new(
        problem: &RigProblem,
        config: &RigConfig,
        (observations, places): (Vec<Observation>, RigPoses),
        located_views: &'a LocatedViews,
    ) -> Result<Self, Error> {
        let now = RigProblem { observations: &observations, ..*problem };
        let layout = Layout::new(&now, config)?;
        let adjusted = adjust(&layout, located_views, places, config)?;
        Ok(State { observations, located_views, adjusted })
    }

    /// Returns χ² of all points, each with at most `most`.
    fn chi2(&self, most: f64) -> f64 {
        let points = self.adjusted.residuals.iter().flat_map(|r| &r.points);
        points.map(|point| point.as_ref().map_or(most, |p| p.1.min(most))).sum()
    }
}

struct Estimated {
    offsets: TimeOffsets,
    chi2: f64,
    /// Variance of the noise in units of the stated one.
    noise: f64,
}

/// The offset of each camera, and the line time; zero where they are not estimated.
#[derive(Clone)]
struct Times {
    offset_s: Vec<f64>,
    line_time_s: f64,
}

fn estimated(
    problem: &RigProblem,
    config: &RigConfig,
    times: &FrameStamps,
    clock: &Clock,
    simultaneous: &State,
) -> Result<Option<Estimated>, Error> {
    let mut found = Times { offset_s: clock.mean_s.iter().map(|mean_s| -mean_s).collect(), line_time_s: 0.0 };
    let mut state = simultaneous.clone();
    for _ in 0..MAX_ROUNDS {
        let Some(step) = Step::new(problem, config, times, clock, (&state, &found))? else { return Ok(None) };
        let largest_s = step.add_to(&mut found);
        let observations = step.motions.exposed(problem, clock, &found);
        let moved = (observations, state.adjusted.places);
        state = State::new(problem, config, moved, state.located_views)?;
        if largest_s < SETTLED_S {
            break;
        }
    }
    let Some(last) = Step::new(problem, config, times, clock, (&state, &found))? else { return Ok(None) };
    let most = match config.loss {
        Loss::Truncated { sigmas } => sigmas * sigmas * simultaneous.adjusted.variance,
        _ => f64::MAX.sqrt(),
    };
    let (chi2, noise) = (state.chi2(most), last.noise);
    let gain_chi2 = (simultaneous.chi2(most) - chi2) / noise;
    let variance = |k: usize| last.covariance[(k, k)];
    // The pose hangs on the time of exposure; that beside the stamps is as uncertain as their means besides.
    let of_means =
        |camera: usize| clock.mean_variance_s2[camera] + clock.mean_variance_s2[last.compared_with];
    let of_camera = |(camera, value): (usize, &f64)| match camera == last.compared_with {
        true => Some((0.0, 0.0)),
        false => last.columns.of_camera[camera]
            .map(|k| (*value - found.offset_s[last.compared_with], (variance(k) + of_means(camera)).sqrt())),
    };
    let offsets = TimeOffsets {
        offset_s: found.offset_s.iter().enumerate().map(of_camera).collect(),
        line_time_s: last.columns.of_line_time.map(|k| (found.line_time_s, variance(k).sqrt())),
        stamps_count: clock.stamps_count,
        gain_chi2,
        twists: last.motions.twists(problem, clock, &found),
        columns: last.columns,
        covariance: last.covariance,
        observations: state.observations,
    };
    Ok(Some(Estimated { offsets, chi2, noise }))
}

/// The motion of each observation's target.
struct Motions(Vec<Option<Motion>>);

impl Motions {
    fn new(problem: &RigProblem, layout: &Layout, adjusted: &Adjusted, clock: &Clock) -> Self {
        let mut paths: BTreeMap<usize, Vec<(f64, usize, Pose)>> = BTreeMap::new();
        for (index, (view, body)) in layout.bodies.iter().enumerate() {
            if adjusted.graph.is_active[index] {
                let place = &adjusted.places.rig_from_body[index];
                let pose = place.pose(&adjusted.graph.pivot_in_body[index]);
                paths.entry(*body).or_default().push((clock.view_s[*view], index, pose));
            }
        }
        let mut of_bodies = vec![None; layout.bodies.len()];
        for path in paths.values_mut() {
            path.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for at in 0..path.len() {
                of_bodies[path[at].1] = motion(path, at);
            }
        }
        let mut of_observations = vec![None; problem.observations.len()];
        for (i, link) in layout.graph.links.iter().enumerate() {
            let pivot = &layout.pivot_in_target[link.target];
            let target_from_body =
                adjusted.places.body_from_target[link.target].pose(pivot).inverse().adjoint();
            of_observations[layout.given_at[i]] =
                of_bodies[link.body].map(|motion: Motion| Motion(motion.0.map(|by| target_from_body * by)));
        }
        Motions(of_observations)
    }

    /// Returns the observations with their points where they were at each exposure, eq. (33).
    fn exposed(&self, problem: &RigProblem, clock: &Clock, found: &Times) -> Vec<Observation> {
        let moved = |(i, (observation, motion)): (usize, (&Observation, &Option<Motion>))| {
            let Some(motion) = motion else { return observation.clone() };
            let centre_v_px = axis_v_px(&problem.cameras[observation.camera]);
            let of_frame_s = clock.stamp_s[i] + found.offset_s[observation.camera];
            let of_frame = motion.after(of_frame_s);
            let point = |c: &Correspondence| {
                let pose = match found.line_time_s {
                    0.0 => of_frame,
                    line_s => motion.after(of_frame_s + line_s * (c.pixel.y - centre_v_px)),
                };
                Correspondence { x_in_target: pose * c.x_in_target, ..*c }
            };
            Observation { seen: observation.seen.iter().map(point).collect(), ..observation.clone() }
        };
        problem.observations.iter().zip(&self.0).enumerate().map(moved).collect()
    }

    fn twists(&self, problem: &RigProblem, clock: &Clock, found: &Times) -> Vec<Option<Vector6>> {
        let twist = |(i, motion): (usize, &Option<Motion>)| {
            let after_s = clock.stamp_s[i] + found.offset_s[problem.observations[i].camera];
            motion.map(|motion| motion.velocity(after_s))
        };
        self.0.iter().enumerate().map(twist).collect()
    }
}

impl Motion {
    fn after(&self, seconds: f64) -> Pose {
        let sum = self.0.iter().rev().fold(Vector6::zeros(), |sum, by| (sum + by) * seconds);
        Pose::exp(&sum)
    }

    fn velocity(&self, seconds: f64) -> Vector6 {
        let by = self.0.iter().enumerate().rev();
        by.fold(Vector6::zeros(), |sum, (k, by)| sum * seconds + by * (k as f64 + 1.0))
    }
}

/// Returns the motion at one place of a path: the polynomial through it and its neighbours, as many before as after but at an end.
fn motion(path: &[(f64, usize, Pose)], at: usize) -> Option<Motion> {
    let is_near = |pair: &[(f64, usize, Pose)]| are_near(pair[0].0, pair[1].0);
    let n_before = path[..=at].windows(2).rev().take(NEIGHBOURS).take_while(|pair| is_near(pair)).count();
    let n_after = path[at..].windows(2).take(NEIGHBOURS).take_while(|pair| is_near(pair)).count();
    let before = n_before.min(NEIGHBOURS - n_after.min(NEIGHBOURS / 2));
    let after = n_after.min(NEIGHBOURS - before);
    let here = &path[at];
    let others: Vec<&(f64, usize, Pose)> =
        path[at - before..=at + after].iter().filter(|other| other.1 != here.1).collect();
    let scale_s = others.iter().map(|other| (other.0 - here.0).abs()).reduce(f64::max)?;
    let n = others.len();
    let powers = DMatrix::from_fn(n, n, |i, k| ((others[i].0 - here.0) / scale_s).powi(k as i32 + 1));
    let relative: Vec<Vector6> = others.iter().map(|other| (here.2.inverse() * other.2).log()).collect();
    let values = DMatrix::from_fn(n, 6, |i, k| relative[i][k]);
    let solved = powers.lu().solve(&values)?;
    let coefficient = |k: usize| match k < n {
        true => solved.row(k).transpose().fixed_rows::<6>(0) / scale_s.powi(k as i32 + 1),
        false => Vector6::zeros(),
    };
    Some(Motion(core::array::from_fn(coefficient)))
}

/// Returns the row of the optical axis, px: the stamp of a frame is the time of that row.
fn axis_v_px(camera: &Camera) -> f64 {
    camera.project_with_jacobian(&Point::z()).map_or(0.0, |(pixel, _)| pixel.y)
}

/// Returns the sums over the points of an observation whose target moves by `twist`; none where it does not.
fn of_observation(
    i: usize,
    twist: Option<Vector6>,
    columns: &Columns,
    layout: &Layout,
    adjusted: &Adjusted,
) -> Option<OfObservation> {
    let link = &adjusted.graph.links[i];
    let twist = twist.filter(|_| adjusted.graph.is_active[link.body])?;
    let (turn, shift): (Vector3<f64>, Vector3<f64>) =
        (twist.fixed_rows::<3>(0).into(), twist.fixed_rows::<3>(3).into());
    let of_camera = columns.of_camera[link.camera];
    let centre_v_px = axis_v_px(layout.camera(i));
    Some(sums_of(i, columns.n, layout, adjusted, |at| {
        let by_time = at.jacobian * (at.cam_from_target * (turn.cross(&at.x_in_target) + shift));
        let mut by = vec![Vector2::zeros(); columns.n];
        if let Some(k) = of_camera {
            by[k] = by_time;
        }
        if let Some(k) = columns.of_line_time {
            by[k] = by_time * (at.seen.pixel.y - centre_v_px);
        }
        Some(by)
    }))
}

/// Returns K for each time of `offsets`.
pub(super) fn by_times(offsets: &TimeOffsets, layout: &Layout, adjusted: &Adjusted) -> Vec<Common> {
    let mut common = vec![Common::new(&adjusted.graph); offsets.columns.n];
    for (i, link) in adjusted.graph.links.iter().enumerate() {
        let twist = offsets.twists[layout.given_at[i]];
        let Some(sums) = of_observation(i, twist, &offsets.columns, layout, adjusted) else { continue };
        for (common, by) in common.iter_mut().zip(&sums.by_motion) {
            common.add(&adjusted.places, &adjusted.graph, link, by);
        }
    }
    common
}

/// A Gauss–Newton step of the times, with all poses free.
struct Step {
    motions: Motions,
    /// The camera whose clock is that of the rig.
    compared_with: usize,
    columns: Columns,
    step_s: DVector<f64>,
    covariance: DMatrix<f64>,
    noise: f64,
}

impl Step {
    /// `None` where no time is shown.
    fn new(
        problem: &RigProblem,
        config: &RigConfig,
        times: &FrameStamps,
        clock: &Clock,
        (state, found): (&State, &Times),
    ) -> Result<Option<Self>, Error> {
        let now = RigProblem { observations: &state.observations, ..*problem };
        let layout = Layout::new(&now, config)?;
        let adjusted = &state.adjusted;
        let motions = Motions::new(problem, &layout, adjusted, clock);
        let twists = motions.twists(problem, clock, found);
        let eliminated =
            adjusted.equations.eliminated(0.0).ok_or(Error::NotConverged { steps: adjusted.steps })?;
        let (compared_with, columns) = match columns(problem, config, times, &twists) {
            Some(columns) => columns,
            None => return Ok(None),
        };
        let sums = Sums::new(&layout, adjusted, &eliminated, (&twists, &columns));
        let (columns, kept) = sums.shown(columns);
        if kept.is_empty() {
            return Ok(None);
        }
        let sums = sums.only(&kept);
        let Some(inverse) = sums.information.clone().cholesky().map(|c| c.inverse()) else { return Ok(None) };
        let noise = noise(adjusted);
        let step_s = &inverse * &sums.pull;
        let covariance = sums.covariance(&inverse, &step_s, noise);
        Ok(Some(Step { motions, compared_with, columns, step_s, covariance, noise }))
    }

    /// Adds the step; returns the largest change, s.
    fn add_to(&self, found: &mut Times) -> f64 {
        for (camera, column) in self.columns.of_camera.iter().enumerate() {
            found.offset_s[camera] += column.map_or(0.0, |k| self.step_s[k]);
        }
        found.line_time_s += self.columns.of_line_time.map_or(0.0, |k| self.step_s[k]);
        self.step_s.amax()
    }
}

/// Returns a column for every camera that sees a motion but the one with which they are compared: the rig's reference where it does.
fn columns(
    problem: &RigProblem,
    config: &RigConfig,
    times: &FrameStamps,
    twists: &[Option<Vector6>],
) -> Option<(usize, Columns)> {
    let sees = |camera: usize| {
        let mut all = problem.observations.iter().zip(twists);
        all.any(|(seen, twist)| seen.camera == camera && twist.is_some())
    };
    let cameras: Vec<usize> = (0..problem.cameras.len()).filter(|camera| sees(*camera)).collect();
    let compared_with =
        if cameras.contains(&config.reference) { config.reference } else { *cameras.first()? };
    let mut n = 0;
    let mut next = || {
        n += 1;
        n - 1
    };
    let has_column = |camera: usize| cameras.contains(&camera) && camera != compared_with;
    let of_camera = (0..problem.cameras.len()).map(|camera| has_column(camera).then(&mut next)).collect();
    let of_line_time = times.line_time.then(&mut next);
    (0 < n).then_some((compared_with, Columns { of_camera, of_line_time, n }))
}

/// Returns χ² per degree of freedom of the points that take part, at least 1.
fn noise(adjusted: &Adjusted) -> f64 {
    let points = adjusted.residuals.iter().zip(&adjusted.parts.is_used);
    let used = points.flat_map(|(r, used)| r.points.iter().zip(used).filter(|(_, used)| **used));
    let (chi2, n) =
        used.fold((0.0, 0_usize), |(sum, n), (p, _)| (sum + p.as_ref().map_or(0.0, |p| p.1), n + 1));
    let n_bodies = adjusted.graph.is_active.iter().filter(|active| **active).count();
    let freedom = (2 * n).saturating_sub(6 * (n_bodies + adjusted.graph.n_blocks)).max(1);
    f64::max(1.0, chi2 / freedom as f64)
}

/// The information of one view on the times, all poses free.
struct OfView {
    information: DMatrix<f64>,
    pull: DVector<f64>,
}

/// The information of all points on the times, all poses free: docs/math/rig.md eq. (34).
struct Sums {
    own: DMatrix<f64>,
    information: DMatrix<f64>,
    pull: DVector<f64>,
    of_views: Vec<OfView>,
}

impl Sums {
    fn new(
        layout: &Layout,
        adjusted: &Adjusted,
        eliminated: &Eliminated,
        (twists, columns): (&[Option<Vector6>], &Columns),
    ) -> Self {
        let (places, graph, n) = (&adjusted.places, &adjusted.graph, columns.n);
        let each: Vec<(usize, OfObservation)> = (0..graph.links.len())
            .filter_map(|i| {
                Some((i, of_observation(i, twists[layout.given_at[i]], columns, layout, adjusted)?))
            })
            .collect();
        let mut common = vec![Common::new(graph); n];
        for (i, sums) in &each {
            for (common, by) in common.iter_mut().zip(&sums.by_motion) {
                common.add(places, graph, &graph.links[*i], by);
            }
        }
        let following: Vec<[Common; 1]> =
            common.iter().map(|c| [adjusted.equations.following(eliminated, c, true)]).collect();
        let of_views = each.chunk_by(|a, b| layout.observations[a.0].view == layout.observations[b.0].view);
        let of_views: Vec<OfView> = of_views.map(|own| of_view(own, n, adjusted, &following)).collect();
        let zero = || (DMatrix::zeros(n, n), DVector::zeros(n));
        let ((mut own, mut pull), lost) =
            (zero(), DMatrix::from_fn(n, n, |i, j| common[i].dot(&following[j][0])));
        for (_, sums) in &each {
            own += &sums.own;
            pull += &sums.pull;
        }
        let information = &own - (&lost + lost.transpose()) * 0.5;
        Sums { own, information, pull, of_views }
    }

    /// Returns the columns that the points show, renumbered, and the former number of each.
    fn shown(&self, columns: Columns) -> (Columns, Vec<usize>) {
        let mut reduced = self.information.clone();
        let mut kept = Vec::new();
        for k in 0..columns.n {
            let pivot = reduced[(k, k)];
            if NOTHING_LEFT * self.own[(k, k)] < pivot {
                let column = reduced.column(k).into_owned();
                reduced -= &column * column.transpose() / pivot;
                kept.push(k);
            }
        }
        let renumbered = |k: &Option<usize>| kept.iter().position(|old| Some(*old) == *k);
        let of_camera = columns.of_camera.iter().map(renumbered).collect();
        let of_line_time = renumbered(&columns.of_line_time);
        (Columns { of_camera, of_line_time, n: kept.len() }, kept)
    }

    fn only(&self, kept: &[usize]) -> Self {
        let matrix = |m: &DMatrix<f64>| m.select_rows(kept).select_columns(kept);
        let of_view = |view: &OfView| OfView {
            information: matrix(&view.information),
            pull: view.pull.select_rows(kept),
        };
        Sums {
            own: matrix(&self.own),
            information: matrix(&self.information),
            pull: self.pull.select_rows(kept),
            of_views: self.of_views.iter().map(of_view).collect(),
        }
    }

    /// Returns the covariance by single points, widened in each time to the scatter of views where that is larger, eq. (35).
    fn covariance(&self, inverse: &DMatrix<f64>, step: &DVector<f64>, noise: f64) -> DMatrix<f64> {
        let n = step.len();
        let by_points = inverse * noise;
        if self.of_views.len() < 2 * n {
            return by_points;
        }
        let change = |view: &OfView| {
            let leverage = DMatrix::identity(n, n) - &view.information * inverse;
            let rest = &view.pull - &view.information * step;
            Some(inverse * leverage.lu().solve(&rest)?)
        };
        let by_views = self
            .of_views
            .iter()
            .filter_map(change)
            .fold(DVector::zeros(n), |sum, change| sum + change.component_mul(&change));
        let wider = |k: usize| f64::max(1.0, (by_views[k] / by_points[(k, k)]).sqrt());
        DMatrix::from_fn(n, n, |i, j| by_points[(i, j)] * wider(i) * wider(j))
    }
}

fn of_view(
    each: &[(usize, OfObservation)],
    n: usize,
    adjusted: &Adjusted,
    following: &[[Common; 1]],
) -> OfView {
    let mut sum = OfView { information: DMatrix::zeros(n, n), pull: DVector::zeros(n) };
    for (i, sums) in each {
        let link = &adjusted.graph.links[*i];
        let moved: Vec<Vector6> = following
            .iter()
            .map(|f| adjusted.equations.moved(&adjusted.places, &adjusted.graph, link, f).0)
            .collect();
        let (information, gradient) = adjusted.equations.of_observation(*i);
        let entry = |a: usize, b: usize| {
            let (m, k) = (&moved, &sums.by_motion);
            sums.own[(a, b)] - m[a].dot(&k[b]) - k[a].dot(&m[b]) + m[a].dot(&(information * m[b]))
        };
        sum.information += DMatrix::from_fn(n, n, entry);
        sum.pull += DVector::from_fn(n, |a, _| sums.pull[a] - moved[a].dot(gradient));
    }
    sum
}
