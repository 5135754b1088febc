//! How a camera stands over a scene of three directions at right angles, from lines that are marked in one photograph: lane lines, kerbs, posts,
//! walls. docs/math/vanishing.md, whose equations are cited.
//!
//!   R  cam_from_scene; its columns are the directions across, along and up  ·  h  height over the ground  ·  θ  the lens, where it is not known
//!   r = g/s  a line's distance from its vanishing point, in standard deviations, eq. (1)

use super::lens::{LENS, LensPrior, LensState};
use super::{LEAST_FIELD_RAD, MAX_RELATIVE_SIGMA, MOST_FIELD_RAD};
use crate::budget::{Budget, ErrorSource};
use crate::error::FocalRemedy;
use crate::least_squares::dense::{DenseEquations, minimize_dense};
use crate::line::ImageLine;
use crate::locate::consistency::{is_inconsistent, noise_scale};
use crate::solve::pure_rotation::DirectionPair;
use crate::solve::vanishing::{rotations, vanishing_point};
use crate::{Camera, Error, Matrix6, Pixel, Point, Pose, Vector6};
use arrayvec::ArrayVec;
use nalgebra::{DMatrix, DVector, Dyn, Matrix3, OMatrix, U6, Unit, Vector2, Vector3};

/// Which way a line runs in the scene. Its frame: x across (to the right), y along (away from the camera), z up; the origin is the point of the
/// ground below the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// x.
    Across,
    /// y.
    Along,
    /// z.
    Up,
    /// None of them: the line is the horizon, the image of the level directions, eqs. (6), (7). The ground lies below it.
    Horizon,
}

impl Axis {
    /// How many equations a line of it gives.
    pub fn equations(self) -> usize {
        if self == Axis::Horizon { 2 } else { 1 }
    }
}

/// A straight line of the scene, marked by two pixels on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkedLine {
    /// Its marks; where it has a length, its ends.
    pub ends_px: [Pixel; 2],
    /// Standard deviation of each coordinate of a mark.
    pub sigma_px: f64,
    /// Its direction.
    pub axis: Axis,
    /// Where it is known: both ends of a line across or along lie on the ground, a line up stands on it. A horizon has none.
    pub length: Option<Length>,
}

/// A length that was measured in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Length {
    /// The length.
    pub metres: f64,
    /// Its standard deviation.
    pub sigma_m: f64,
}

/// What is known of the camera.
#[derive(Debug, Clone, Copy)]
pub enum LineCamera<'a> {
    /// Nothing but the lens in general: the focal length is estimated.
    Unknown(&'a LensPrior),
    /// Its intrinsics, and their covariance (row by row, in the order of `Camera::parameters`) unless they are exact.
    Known(&'a Camera, Option<&'a [f64]>),
}

/// A number and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// How a camera stands over its scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneView {
    /// x_in_cam = cam_from_scene · x_in_scene. Without a length its translation is in units of the camera's height.
    pub cam_from_scene: Pose,
    /// 6×6 covariance of its small left motion, camera frame; without a length the height is one without error.
    pub covariance: Matrix6,
    /// The parts of `covariance` by their sources, which add up to it.
    pub budget: Budget,
    /// The camera that was given or found.
    pub camera: Camera,
    /// Focal length, px, where it was estimated.
    pub focal_px: Option<Estimate>,
    /// By how much the optical axis points below the horizon, rad.
    pub tilt_rad: Estimate,
    /// By how much the camera is rotated about its axis, clockwise as seen from behind it, rad.
    pub roll_rad: Estimate,
    /// The optical axis's heading from `along` towards `across`, rad; `None` where no line runs along or across: along is then the way that the
    /// camera looks.
    pub heading_rad: Option<Estimate>,
    /// Height over the ground, m, where a length is known.
    pub height_m: Option<Estimate>,
    /// Sum of squared residuals, in standard deviations.
    pub chi2: f64,
    /// Of that sum; at least one.
    pub degrees_of_freedom: usize,
    /// Whether the lines contradict each other.
    pub is_inconsistent: bool,
    /// The line (or length) that fits worst, and its residual in its standard deviations.
    pub worst: (usize, f64),
}

/// Most lines; more are refused.
pub const MOST_LINES: usize = 10_000;
/// The rotation must be known better than this, rad, or no covariance describes it.
const MAX_SIGMA_RAD: f64 = 0.1;
/// Horizontal fields of view that starts are tried with, degrees.
const FIELDS_DEG: [f64; 6] = [10.0, 20.0, 35.0, 55.0, 80.0, 110.0];
/// Descents, each with the weights where the one before ended.
const PASSES: usize = 3;
/// Steps of central differences: radians and logarithms, and pixels.
const SMALL: f64 = 1e-6;
const SMALL_PX: f64 = 1e-3;
/// What a direction counts for that one line alone gives to a start, rad.
const ROUGH_RAD: f64 = 0.05;
/// Fewest upright lines that give a height with the horizon and an unknown lens: with two or three the mean square of its error is four variances.
const LEAST_UP: usize = 5;
/// Scale of the equation that makes a heading zero by definition, rad. The answer does not depend on it.
const HELD_RAD: f64 = 1e-3;

/// Rotation, focal length where it is not known, and height where a length is.
///
/// # Errors
/// `TooFewPoints` for fewer equations than unknowns and one (five, four with a known camera, one less where no line runs along or across; a
/// horizon gives two); `DegenerateView` where lines of one direction only, a horizon alone, or lines that nearly pass through one point, leave the
/// rotation open, or a length reaches above the horizon; `UndeterminedFocal`; `ImpossibleFocal`; `NotPositive`, `NotFinite`, `Coincident`,
/// `OutsideField` and `InvalidSetting` for marks and lengths that cannot be.
pub fn scene_view(lines: &[MarkedLine], lens: LineCamera) -> Result<SceneView, Error> {
    check(lines, lens)?;
    let problem = Problem { lines, lens };
    let mut found = problem.without_lengths()?;
    let lengths = lines.iter().filter(|line| line.length.is_some()).count();
    if 0 < lengths {
        found = problem.with_lengths(&found.state)?;
    }
    problem.answer(&found, lengths)
}

fn check(lines: &[MarkedLine], lens: LineCamera) -> Result<(), Error> {
    if MOST_LINES < lines.len() {
        let needed = "ten thousand lines at most";
        return Err(Error::InvalidSetting { setting: "number of lines", seen: lines.len() as f64, needed });
    }
    if let Some(length) = lines.iter().filter(|line| line.axis == Axis::Horizon).find_map(|line| line.length)
    {
        let needed = "a horizon has none, so leave it empty, or give it to a line of the scene";
        return Err(Error::InvalidSetting { setting: "length of a horizon", seen: length.metres, needed });
    }
    for (index, line) in lines.iter().enumerate() {
        if line.ends_px.iter().any(|end| !(end.x.abs() < 1e9 && end.y.abs() < 1e9)) {
            return Err(Error::NotFinite { what: "pixel", index });
        }
        let length = line.length.unwrap_or(Length { metres: 1.0, sigma_m: 1.0 });
        for seen in [line.sigma_px, length.metres, length.sigma_m] {
            if !(0.0 < seen && seen < 1e9) {
                return Err(Error::NotPositive { index, seen });
            }
        }
        if line.ends_px[0] == line.ends_px[1] {
            return Err(Error::Coincident { first: index, second: index, where_: "in the image" });
        }
    }
    let is_unknown = matches!(lens, LineCamera::Unknown(_));
    if let Some(first) = lines.first()
        && lines.iter().all(|line| line.axis == first.axis)
    {
        let reason = match (first.axis, is_unknown) {
            (Axis::Horizon, true) => {
                "the horizon alone leaves the focal length open; mark two upright lines too, or lines along and across"
            }
            (Axis::Horizon, false) => {
                "with the horizon alone a wrong mark is not seen; mark an upright line too, or lines along or across"
            }
            _ => {
                "all lines run in one direction, which leaves the rotation about it open; mark lines of a second one"
            }
        };
        return Err(Error::DegenerateView { reason, metric: 1.0, needed: 2.0 });
    }
    let n_up = lines.iter().filter(|line| line.axis == Axis::Up).count();
    if is_unknown
        && leaves_heading(lines)
        && n_up < LEAST_UP
        && lines.iter().any(|line| line.length.is_some())
    {
        let reason = "beside the horizon too few upright lines leave the distortion so open that a height is twice as wrong as it seems; mark five, give the camera, or leave the length out";
        return Err(Error::DegenerateView { reason, metric: n_up as f64, needed: LEAST_UP as f64 });
    }
    let seen = lines.iter().map(|line| line.axis.equations()).sum();
    let needed = 4 + usize::from(is_unknown) - usize::from(leaves_heading(lines));
    if seen < needed {
        return Err(Error::TooFewPoints { seen, needed });
    }
    Ok(())
}

/// Whether a horizon and upright lines are all, so that nothing but the camera says which way along is.
fn leaves_heading(lines: &[MarkedLine]) -> bool {
    let is_level = |line: &MarkedLine| matches!(line.axis, Axis::Across | Axis::Along);
    lines.iter().any(|line| line.axis == Axis::Horizon) && !lines.iter().any(is_level)
}

/// The unknowns.
#[derive(Debug, Clone)]
struct State {
    cam_from_scene: Matrix3<f64>,
    /// Where the lens is estimated.
    lens: Option<LensState>,
    camera: Camera,
    /// Of the height in metres, where a length is known.
    log_height: Option<f64>,
}

/// A minimum, with the residuals and derivatives there.
struct Found {
    state: State,
    chi2: f64,
    residuals: Vec<f64>,
    derivatives: DMatrix<f64>,
    covariance: DMatrix<f64>,
}

/// Weights that a descent holds.
struct Held {
    bend_sigma: f64,
    /// Of the logarithm of each known length, in the order of the lines.
    log_length_sigmas: Vec<f64>,
}

struct Problem<'a> {
    lines: &'a [MarkedLine],
    lens: LineCamera<'a>,
}

impl Problem<'_> {
    fn without_lengths(&self) -> Result<Found, Error> {
        let (mut best, mut refusal): (Option<Found>, Option<Error>) = (None, None);
        for (camera, lens) in self.cameras()? {
            match self.start(camera, lens).and_then(|state| self.descend(state)) {
                Ok(found) if best.as_ref().is_none_or(|best| found.chi2 < best.chi2) => best = Some(found),
                Ok(_) => {}
                Err(reason) => refusal = Some(reason),
            }
        }
        best.ok_or(refusal.unwrap_or(Error::NoSolution { n_points: self.lines.len() }))
    }

    fn with_lengths(&self, from: &State) -> Result<Found, Error> {
        let logs: Option<Vec<f64>> = self
            .known_lengths()
            .map(|(line, length)| Some(length.metres.ln() - self.log_length(line, &line.ends_px, from)?))
            .collect();
        let logs = logs.ok_or(ABOVE_HORIZON)?;
        let log_height = logs.iter().sum::<f64>() / logs.len().max(1) as f64;
        self.descend(State { log_height: Some(log_height), ..from.clone() })
    }

    fn cameras(&self) -> Result<Vec<(Camera, Option<LensState>)>, Error> {
        match self.lens {
            LineCamera::Known(camera, _) => Ok(vec![(camera.clone(), None)]),
            LineCamera::Unknown(prior) if prior.is_usable() => Ok(FIELDS_DEG
                .iter()
                .map(|deg| prior.state(prior.focal_of_field_px(deg.to_radians())))
                .filter_map(|state| Some((prior.camera(&state)?, Some(state))))
                .collect()),
            LineCamera::Unknown(prior) => {
                let needed = "standard deviations must be positive and the image must have a size";
                Err(Error::InvalidSetting { setting: "lens", seen: prior.principal_point_sigma_px, needed })
            }
        }
    }

    /// A rotation by the horizon and the vanishing points, or where a direction has one line only, by its plane.
    fn start(&self, camera: Camera, lens: Option<LensState>) -> Result<State, Error> {
        let (mut seen, mut horizon): ([Vec<ImageLine>; 3], Option<ImageLine>) = Default::default();
        for line in self.lines {
            let image = ImageLine::new(&camera, line.ends_px, line.sigma_px)?;
            match line.axis {
                Axis::Horizon => horizon = Some(image),
                axis => seen[axis as usize].push(image),
            }
        }
        let mut points = [0, 1, 2].map(|axis| {
            vanishing_point(&seen[axis]).ok().map(|point| (point.direction, point.covariance.trace()))
        });
        if let Some(horizon) = horizon {
            points[Axis::Up as usize] = Some((horizon.normal(), 0.0));
        }
        let spread = |axis: &usize| points[*axis].map_or(f64::INFINITY, |(_, spread)| spread);
        let first = (0..3).min_by(|a, b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
        let Some((main, _)) = points[first] else {
            let reason = "no two lines of one direction lie apart; mark a second one of a direction, far from the first";
            return Err(Error::DegenerateView { reason, metric: 1.0, needed: 2.0 });
        };
        if leaves_heading(self.lines) {
            let across =
                Unit::try_new(Vector3::z().cross(&main), 1e-9).ok_or_else(|| open_rotation(f64::INFINITY))?;
            let cam_from_scene = oriented(&Matrix3::from_columns(&[*across, main.cross(&across), *main]));
            return Ok(State { cam_from_scene, lens, camera, log_height: None });
        }
        let mut pairs: ArrayVec<DirectionPair, 3> = ArrayVec::new();
        for axis in 0..3 {
            let in_scene = Unit::new_unchecked(Vector3::from_fn(|i, _| f64::from(i == axis)));
            match (points[axis], seen[axis].first()) {
                (Some((direction, _)), _) => pairs.push(DirectionPair {
                    in_first: in_scene,
                    in_second: direction,
                    sigma_rad: ROUGH_RAD,
                }),
                (None, Some(line)) => {
                    let in_second = Unit::try_new(line.normal().cross(&main), 1e-9);
                    pairs.extend(in_second.map(|in_second| DirectionPair {
                        in_first: in_scene,
                        in_second,
                        sigma_rad: ROUGH_RAD,
                    }));
                }
                (None, None) => {}
            }
        }
        let found = rotations(&pairs)?;
        let rotation = found.first().ok_or(Error::NoSolution { n_points: self.lines.len() })?;
        let cam_from_scene = oriented(&rotation.second_from_first);
        Ok(State { cam_from_scene, lens, camera, log_height: None })
    }

    fn n_unknowns(state: &State) -> usize {
        3 + state.lens.map_or(0, |_| LENS) + usize::from(state.log_height.is_some())
    }

    fn moved(&self, state: &State, step: &[f64]) -> Option<State> {
        let turn = Pose::exp(&Vector6::new(step[0], step[1], step[2], 0.0, 0.0, 0.0)).rotation;
        let mut next = State { cam_from_scene: turn * state.cam_from_scene, ..state.clone() };
        if let (Some(lens), LineCamera::Unknown(prior)) = (&state.lens, self.lens) {
            let lens = lens.moved(step.get(3..3 + LENS)?)?;
            next.camera = prior.camera(&lens)?;
            next.lens = Some(lens);
        }
        if let (Some(log_height), Some(by)) = (state.log_height, step.last()) {
            next.log_height = Some(log_height + by);
        }
        Some(next)
    }

    fn held_at(&self, state: &State) -> Option<Held> {
        let bend_sigma = match (&state.lens, self.lens) {
            (Some(lens), LineCamera::Unknown(prior)) => prior.bend_sigma(lens.focal_px()),
            _ => 1.0,
        };
        let sigma = |(line, length): (&MarkedLine, Length)| {
            let mut variance = (length.sigma_m / length.metres).powi(2);
            for (end, axis) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let at = |by: f64| {
                    let mut ends = line.ends_px;
                    ends[end][axis] += by;
                    self.log_length(line, &ends, state)
                };
                let slope = (at(SMALL_PX)? - at(-SMALL_PX)?) / (2.0 * SMALL_PX);
                variance += (slope * line.sigma_px).powi(2);
            }
            Some(variance.sqrt())
        };
        let with_height = self.known_lengths().filter(|_| state.log_height.is_some());
        Some(Held { bend_sigma, log_length_sigmas: with_height.map(sigma).collect::<Option<_>>()? })
    }

    fn known_lengths(&self) -> impl Iterator<Item = (&MarkedLine, Length)> {
        self.lines.iter().filter_map(|line| Some((line, line.length?)))
    }

    /// Which line each of the first rows is of.
    fn line_of_row(&self) -> Vec<usize> {
        let rows = |(i, line): (usize, &MarkedLine)| core::iter::repeat_n(i, line.axis.equations());
        self.lines.iter().enumerate().flat_map(rows).collect()
    }

    /// Of every line, of every length, of what is known of the lens, and of a heading that is zero by definition.
    fn residuals(&self, state: &State, held: &Held) -> Option<Vec<f64>> {
        let mut all = Vec::with_capacity(self.lines.len() + held.log_length_sigmas.len() + LENS);
        for line in self.lines {
            let seen = ImageLine::new(&state.camera, line.ends_px, line.sigma_px).ok()?;
            // The loop wants observed − predicted.
            match line.axis {
                Axis::Horizon => {
                    let up = state.cam_from_scene.column(Axis::Up as usize).into_owned();
                    all.extend(seen.residuals(&up).map(|r| -r));
                }
                axis => {
                    let direction = state.cam_from_scene.column(axis as usize).into_owned();
                    all.push(-seen.direction_residual(&direction).0);
                }
            }
        }
        if let Some(log_height) = state.log_height {
            for ((line, length), sigma) in self.known_lengths().zip(&held.log_length_sigmas) {
                let predicted = log_height + self.log_length(line, &line.ends_px, state)?;
                all.push((length.metres.ln() - predicted) / sigma);
            }
        }
        if let (Some(lens), LineCamera::Unknown(prior)) = (&state.lens, self.lens) {
            all.extend(prior.residuals(lens, held.bend_sigma).map(|(_, residual, _)| residual));
        }
        if leaves_heading(self.lines) {
            all.push(-state.cam_from_scene[(2, 0)] / HELD_RAD);
        }
        all.iter().all(|r| r.is_finite()).then_some(all)
    }

    /// Residuals and, by central differences, the derivatives of what they predict.
    fn rows(&self, state: &State, held: &Held) -> Option<(Vec<f64>, DMatrix<f64>)> {
        let residuals = self.residuals(state, held)?;
        let n = Self::n_unknowns(state);
        let mut derivatives = DMatrix::zeros(residuals.len(), n);
        for unknown in 0..n {
            let is_pixel = state.lens.is_some() && (5..7).contains(&unknown);
            let small = if is_pixel { SMALL_PX } else { SMALL };
            let at = |by: f64| {
                let mut step = [0.0; 4 + LENS];
                step[unknown] = by;
                self.residuals(&self.moved(state, &step[..n])?, held)
            };
            let (above, below) = (at(small)?, at(-small)?);
            for (row, (above, below)) in above.iter().zip(&below).enumerate() {
                derivatives[(row, unknown)] = (below - above) / (2.0 * small);
            }
        }
        Some((residuals, derivatives))
    }

    fn descend(&self, mut state: State) -> Result<Found, Error> {
        let open = || self.open(f64::INFINITY);
        for _ in 0..PASSES {
            let held = self.held_at(&state).ok_or(ABOVE_HORIZON)?;
            let evaluate = |state: &State| {
                let (residuals, derivatives) = self.rows(state, &held)?;
                let residuals = DVector::from_vec(residuals);
                Some(DenseEquations {
                    chi2: residuals.norm_squared(),
                    gradient: derivatives.tr_mul(&residuals),
                    information: derivatives.tr_mul(&derivatives),
                })
            };
            let moved = |state: &State, step: &DVector<f64>| self.moved(state, step.as_slice());
            state = minimize_dense(state, evaluate, moved).ok_or_else(open)?.state;
        }
        let held = self.held_at(&state).ok_or(ABOVE_HORIZON)?;
        let (residuals, derivatives) = self.rows(&state, &held).ok_or_else(open)?;
        let covariance = derivatives.tr_mul(&derivatives).cholesky().ok_or_else(open)?.inverse();
        let chi2 = residuals.iter().map(|r| r * r).sum();
        Ok(Found { state, chi2, residuals, derivatives, covariance })
    }

    /// What is left open: the focal length where it is sought, else the rotation.
    fn open(&self, sigma: f64) -> Error {
        match self.lens {
            LineCamera::Unknown(_) => Error::UndeterminedFocal {
                relative_sigma: sigma,
                needed: MAX_RELATIVE_SIGMA,
                remedy: FocalRemedy::Lines,
            },
            LineCamera::Known(..) => open_rotation(sigma),
        }
    }

    /// The length of a line's image for a camera of height one, its logarithm: eqs. (4), (5).
    fn log_length(&self, line: &MarkedLine, ends_px: &[Pixel; 2], state: &State) -> Option<f64> {
        let ray = |pixel: &Pixel| {
            let bearing = state.camera.bearing(pixel).ok()?;
            Some(state.cam_from_scene.tr_mul(&bearing.into_inner()))
        };
        let rays = [ray(&ends_px[0])?, ray(&ends_px[1])?];
        let length = match line.axis {
            Axis::Across | Axis::Along => (on_ground(&rays[0])? - on_ground(&rays[1])?).norm(),
            Axis::Up => {
                // The lower end is the foot.
                let slope = |ray: &Vector3<f64>| ray.z / ray.xy().norm();
                let [foot, top] = if slope(&rays[0]) < slope(&rays[1]) { rays } else { [rays[1], rays[0]] };
                let (foot, across) = (on_ground(&foot)?, top.xy());
                1.0 + top.z * foot.dot(&across) / across.norm_squared()
            }
            Axis::Horizon => return None,
        };
        (0.0 < length && length.is_finite()).then(|| length.ln())
    }

    fn answer(&self, found: &Found, lengths: usize) -> Result<SceneView, Error> {
        let Found { state, chi2, .. } = found;
        let n_rows = self.line_of_row().len() + lengths;
        let leaves_heading = leaves_heading(self.lines);
        // What is known of the lens brings as many rows as unknowns, the focal length apart; so does a heading that is zero by definition.
        let n = 3 - usize::from(leaves_heading)
            + usize::from(state.lens.is_some())
            + usize::from(state.log_height.is_some());
        let degrees_of_freedom = n_rows.saturating_sub(n);
        let budget = self.budget(found, noise_scale(*chi2, degrees_of_freedom))?;
        let mut covariance = DMatrix::zeros(found.covariance.nrows(), found.covariance.ncols());
        budget.parts().iter().for_each(|part| covariance += &part.covariance);
        let is_inconsistent = is_inconsistent(*chi2, degrees_of_freedom);
        let rotation = covariance.fixed_view::<3, 3>(0, 0).into_owned();
        // Of lines that contradict each other, that is what has to be said.
        if !is_inconsistent {
            if let Some(lens) = &state.lens {
                self.check_focal(lens, covariance[(3, 3)].sqrt())?;
            }
            let spread_rad = rotation.trace().sqrt();
            if !(spread_rad < MAX_SIGMA_RAD) {
                return Err(open_rotation(spread_rad));
            }
        }
        let focal = |lens: &LensState| Estimate {
            value: lens.focal_px(),
            sigma: lens.focal_px() * covariance[(3, 3)].sqrt(),
        };
        let focal_px = state.lens.as_ref().map(focal);
        let r = &state.cam_from_scene;
        let up = r.column(2).into_owned();
        let height_m = state.log_height.map(f64::exp);
        let last = covariance.nrows() - 1;
        let log_sigma = if height_m.is_some() { covariance[(last, last)].sqrt() } else { 0.0 };
        let translation = -up * height_m.unwrap_or(1.0);
        // Eq. (9): the translation goes with the rotation, and along itself with the height.
        let mut by_unknown = OMatrix::<f64, U6, Dyn>::zeros(covariance.nrows());
        by_unknown.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        if height_m.is_some() {
            by_unknown.fixed_view_mut::<3, 1>(3, last).copy_from(&translation);
        }
        let budget = budget.transformed(&by_unknown);
        let angle = |value: f64, by_turn: Vector3<f64>| Estimate {
            value,
            sigma: by_turn.dot(&(rotation * by_turn)).max(0.0).sqrt(),
        };
        let [tilt, roll, heading] = angles(r);
        Ok(SceneView {
            cam_from_scene: Pose::new(*r, translation),
            covariance: budget.covariance(),
            budget,
            camera: state.camera.clone(),
            focal_px,
            tilt_rad: angle(tilt.0, tilt.1),
            roll_rad: angle(roll.0, roll.1),
            heading_rad: (!leaves_heading).then(|| angle(heading.0, heading.1)),
            height_m: height_m.map(|value| Estimate { value, sigma: value * log_sigma }),
            chi2: *chi2,
            degrees_of_freedom,
            is_inconsistent,
            worst: self.worst(found, n_rows),
        })
    }

    fn check_focal(&self, lens: &LensState, relative_sigma: f64) -> Result<(), Error> {
        let focal_px = lens.focal_px();
        if !(relative_sigma <= MAX_RELATIVE_SIGMA) {
            return Err(self.open(relative_sigma));
        }
        let LineCamera::Unknown(prior) = self.lens else { return Ok(()) };
        let field_of_view_rad = prior.field_of_view_rad(focal_px);
        match (LEAST_FIELD_RAD..=MOST_FIELD_RAD).contains(&field_of_view_rad) {
            true => Ok(()),
            false => Err(Error::ImpossibleFocal { focal_px, field_of_view_rad }),
        }
    }

    /// The parts of the covariance of the unknowns by their sources: docs/math/budget.md section 8.
    fn budget(&self, found: &Found, noise_scale: f64) -> Result<Budget<DMatrix<f64>>, Error> {
        let held = self.held_at(&found.state).ok_or(ABOVE_HORIZON)?;
        let mut pulls = Budget::default();
        let mut add = |source: ErrorSource, row: usize, share: f64| {
            let by = found.derivatives.row(row);
            pulls.add(source, &(by.transpose() * by * share));
        };
        let mut next = self.line_of_row().len();
        (0..next).for_each(|row| add(ErrorSource::Pixels, row, 1.0));
        let with_height = self.known_lengths().filter(|_| found.state.log_height.is_some());
        for ((_, length), sigma) in with_height.zip(&held.log_length_sigmas) {
            let of_length = (length.sigma_m / length.metres / sigma).powi(2).min(1.0);
            add(ErrorSource::Distances, next, of_length);
            add(ErrorSource::Pixels, next, 1.0 - of_length);
            next += 1;
        }
        // A heading that is zero by definition has no error.
        let n_with_error = found.derivatives.nrows() - usize::from(leaves_heading(self.lines));
        (next..n_with_error).for_each(|row| add(ErrorSource::Lens, row, 1.0));
        let mut budget = pulls.transformed(&found.covariance);
        let mut of_rows = DMatrix::zeros(found.covariance.nrows(), found.covariance.ncols());
        budget.parts().iter().for_each(|part| of_rows += &part.covariance);
        budget.add(ErrorSource::Residuals, &(of_rows * (noise_scale - 1.0)));
        budget.add(ErrorSource::Lens, &self.of_intrinsics(found));
        Ok(budget)
    }

    /// What uncertain intrinsics of a known camera add, eq. (10).
    fn of_intrinsics(&self, found: &Found) -> DMatrix<f64> {
        let n = found.covariance.nrows();
        let LineCamera::Known(camera, Some(covariance)) = self.lens else { return DMatrix::zeros(n, n) };
        let values: Vec<f64> = camera.parameters().iter().map(|(_, value)| *value).collect();
        let p = values.len();
        if covariance.len() != p * p {
            return DMatrix::zeros(n, n);
        }
        let Some(held) = self.held_at(&found.state) else { return DMatrix::zeros(n, n) };
        let mut by_parameter = DMatrix::zeros(found.residuals.len(), p);
        for i in (0..p).filter(|i| 0.0 < covariance[i * p + i]) {
            let small = 1e-3 * covariance[i * p + i].sqrt();
            let at = |by: f64| {
                let mut changed = values.clone();
                changed[i] += by;
                let camera = camera.with_parameters(&changed).ok()?;
                self.residuals(&State { camera, ..found.state.clone() }, &held)
            };
            if let (Some(above), Some(below)) = (at(small), at(-small)) {
                for (row, (above, below)) in above.iter().zip(&below).enumerate() {
                    by_parameter[(row, i)] = (below - above) / (2.0 * small);
                }
            }
        }
        let gain = -&found.covariance * found.derivatives.transpose() * by_parameter;
        &gain * DMatrix::from_row_slice(p, p, covariance) * gain.transpose()
    }

    /// By its residual over the standard deviation that the residual has, its own share in the answer taken off.
    fn worst(&self, found: &Found, n_rows: usize) -> (usize, f64) {
        let mut of_row = self.line_of_row();
        of_row.extend((0..self.lines.len()).filter(|i| self.lines[*i].length.is_some()));
        let studentised = |row: usize| {
            let by = found.derivatives.row(row);
            let share = (by * &found.covariance * by.transpose())[(0, 0)];
            found.residuals[row].abs() / (1.0 - share).max(0.01).sqrt()
        };
        let rows = (0..n_rows.min(of_row.len())).map(|row| (of_row[row], studentised(row)));
        rows.fold((0, 0.0), |worst, next| if worst.1 < next.1 { next } else { worst })
    }
}

const ABOVE_HORIZON: Error = Error::DegenerateView {
    reason: "a line of known length reaches above the horizon: its ends across or along must lie on the ground, a line up must stand on it",
    metric: 0.0,
    needed: 0.0,
};

fn open_rotation(sigma_rad: f64) -> Error {
    let reason = "the lines leave the rotation open; mark lines farther apart, and of a second direction";
    Error::DegenerateView { reason, metric: 1.0 / sigma_rad, needed: 1.0 / MAX_SIGMA_RAD }
}

/// Where a ray meets the ground under a camera of height one, eq. (4).
fn on_ground(ray: &Vector3<f64>) -> Option<Vector2<f64>> {
    (ray.z < -1e-9 * ray.norm()).then(|| ray.xy() / -ray.z)
}

/// The same axes with the arrows of the convention: up points up in the image (towards the camera where it looks straight down or up), along
/// points away from the camera.
fn oriented(r: &Matrix3<f64>) -> Matrix3<f64> {
    let (along, up) = (r.column(1).into_owned(), r.column(2).into_owned());
    let is_up = if up.y.abs() < 0.1 { up.z < 0.0 } else { up.y < 0.0 };
    let up = if is_up { up } else { -up };
    let along = if along.z < 0.0 { -along } else { along };
    Matrix3::from_columns(&[along.cross(&up), along, up])
}

/// Tilt, roll and heading with their derivatives by a small rotation of the camera frame, eqs. (2), (3).
fn angles(r: &Matrix3<f64>) -> [(f64, Vector3<f64>); 3] {
    let (x, y, up) = (r.column(0).into_owned(), r.column(1).into_owned(), r.column(2).into_owned());
    let axis = Vector3::z();
    // d(u·a) = (ω × u)·a = ω·(u × a).
    let level = (1.0 - up.z * up.z).max(f64::MIN_POSITIVE);
    let tilt = ((-up.z).clamp(-1.0, 1.0).asin(), -up.cross(&axis) / level.sqrt());
    let of_atan2 = |sine: Vector3<f64>, cosine: Vector3<f64>, a: Vector3<f64>, b: Vector3<f64>| {
        let (s, c) = (sine.dot(&a), cosine.dot(&b));
        (s.atan2(c), (sine.cross(&a) * c - cosine.cross(&b) * s) / (s * s + c * c).max(f64::MIN_POSITIVE))
    };
    let roll = of_atan2(up, up, -Vector3::x(), -Vector3::y());
    let heading = of_atan2(x, y, axis, axis);
    [tilt, roll, heading]
}

/// The point of the ground that a pixel shows, scene frame (z = 0), metres.
pub fn ground_point(view: &SceneView, pixel: &Pixel) -> Option<Point> {
    let height_m = view.height_m?.value;
    let ray = view.cam_from_scene.rotation.tr_mul(&view.camera.bearing(pixel).ok()?.into_inner());
    let at = on_ground(&ray)? * height_m;
    Some(Point::new(at.x, at.y, 0.0))
}
