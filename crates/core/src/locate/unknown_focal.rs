//! Pose and focal length of one view, neither known: four points or more, docs/math/focal.md sections 6 to 8.
//!
//! starts (closed forms) → descend (pose and lens together, on the one loop) → choose → is the focal length determined?

mod lens;
mod cost;
mod ridge;
mod field;
mod starts;
mod layout;
pub mod marked_lines;

use lens::LensCovariance;
pub use lens::LensPrior;

use crate::locate::choose::{AMBIGUITY_GATE_CHI2, Ambiguity, Hypothesis, Minimum, Others, is_within_gate};
use crate::locate::common::Common;
use crate::locate::consistency::{Consistency, consistency_of, is_inconsistent, noise_scale};
use crate::locate::method::Method;
use crate::locate::problem::Problem;
use crate::locate::refine::{log_determinant, residual_sums};
use crate::locate::uncertainty::{Doubts, check_known};
use crate::locate::{PoseEstimate, choose};
use crate::solve::configuration::{Geometry, describe_geometry};
use crate::{Camera, Correspondence, Error, Matrix6};
use cost::{Descent, FocalProblem, JointCovariance};
use nalgebra::{DMatrix, SMatrix};

/// Pose and focal length of one view.
#[derive(Debug, Clone, PartialEq)]
pub struct FocalEstimate {
    /// The pose; its covariance holds that of the lens.
    pub estimate: PoseEstimate,
    /// The focal length, px: that of both axes to the prior's aspect.
    pub focal_px: f64,
    /// Its standard deviation.
    pub sigma_px: f64,
    /// Covariance of [rotation_rad; translation_m; log f], the motion as of `estimate.covariance`.
    pub covariance: SMatrix<f64, 7, 7>,
    /// The camera: the points move principal point, aspect and distortion from what is usual only as far as they show it.
    pub camera: Camera,
    /// Covariance of `camera.parameters`.
    pub intrinsics_covariance: DMatrix<f64>,
    /// Focal lengths of the other poses, px, in the order of `estimate.others`.
    pub other_focal_px: Vec<f64>,
}

/// Fewer points leave pose and focal length open.
const MIN_POINTS: usize = 4;
/// Largest standard deviation of log f of an answer. Beyond it the interval is no longer that of a normal distribution: docs/math/focal.md
/// section 9.
pub const MAX_RELATIVE_SIGMA: f64 = 0.15;
/// Focal lengths outside these horizontal fields of view, radians, are those of no lens of this kind: 2° to 130°.
const LEAST_FIELD_RAD: f64 = 0.034_906_585;
const MOST_FIELD_RAD: f64 = 2.268_928;

/// Pose and focal length from known points of one view, the other intrinsics being those that `lens` states of lenses in general.
///
/// # Errors
/// `TooFewPoints` for fewer than four, `Collinear`, `Coincident`; `UndeterminedFocal` where focal length and distance cannot be distinguished;
/// `ImpossibleFocal` where the points fit best with a focal length that no lens has; `NoSolution`.
pub fn estimate_focal(seen: &[Correspondence], lens: &LensPrior) -> Result<FocalEstimate, Error> {
    estimate_focal_of(seen, lens, [0.0; 2])
}

/// The same with the standard deviations of a printed target's scale along its x and y.
///
/// # Errors
/// As of [`estimate_focal`].
pub fn estimate_focal_of(
    seen: &[Correspondence],
    lens: &LensPrior,
    target_scale_sigma: [f64; 2],
) -> Result<FocalEstimate, Error> {
    if !lens.is_usable() {
        let needed = "standard deviations must be positive and the image must have a size";
        return Err(Error::InvalidSetting { setting: "lens", seen: lens.principal_point_sigma_px, needed });
    }
    let geometry = describe_geometry(seen)?;
    if seen.len() < MIN_POINTS {
        return Err(Error::TooFewPoints { seen: seen.len(), needed: MIN_POINTS });
    }
    let problem = FocalProblem::new(seen, lens);
    let minima = minima(&problem, &geometry)?;
    let view = FocalView { problem, geometry, target_scale_sigma };
    view.answer(&minima)
}

/// A minimum over pose and lens.
struct FocalMinimum {
    descent: Descent,
    camera: Camera,
    covariance: JointCovariance,
    /// As of a pose: its covariance is that of the pixels alone.
    minimum: Minimum,
    /// Of `seen`, with bearings through this camera.
    seen: Vec<Correspondence>,
}

/// All minima found, the lowest first.
fn minima(problem: &FocalProblem, geometry: &Geometry) -> Result<Vec<FocalMinimum>, Error> {
    let mut found: Vec<FocalMinimum> = Vec::new();
    let mut open: Option<Descent> = None;
    for start in starts::starts(problem, geometry) {
        let Some(descent) = problem.descend(start) else { continue };
        let minimum = descent.is_minimum.then(|| FocalMinimum::of(problem, &descent)).flatten();
        match minimum {
            Some(minimum) if found.iter().any(|other| other.is_same(&minimum)) => {}
            Some(minimum) => found.push(minimum),
            None if open.as_ref().is_none_or(|lowest| descent.chi2 < lowest.chi2) => open = Some(descent),
            None => {}
        }
    }
    found.sort_by(|a, b| a.minimum.cost().total_cmp(&b.minimum.cost()));
    match (found.first(), open) {
        // Points that contradict every focal length show nothing by where they fit least badly.
        (Some(_), Some(valley)) if is_inconsistent(valley.chi2, degrees_of_freedom(problem)) => Ok(found),
        // A valley without an end that is as low as any minimum: focal length and distance grow together.
        (best, Some(valley)) if best.is_none_or(|best| valley.chi2 < best.descent.chi2) => {
            let remedy = layout::remedy(problem, &valley.state, geometry, |c| is_determined(c, 1.0));
            Err(Error::UndeterminedFocal {
                relative_sigma: f64::INFINITY,
                needed: MAX_RELATIVE_SIGMA,
                remedy,
            })
        }
        (None, _) => Err(Error::NoSolution { n_points: problem.seen.len() }),
        _ => Ok(found),
    }
}

fn degrees_of_freedom(problem: &FocalProblem) -> usize {
    (2 * problem.seen.len()).saturating_sub(7)
}

fn is_determined(covariance: &JointCovariance, noise_scale: f64) -> bool {
    covariance[(6, 6)] * noise_scale <= MAX_RELATIVE_SIGMA * MAX_RELATIVE_SIGMA
}

impl FocalMinimum {
    /// None where it is open in some direction.
    fn of(problem: &FocalProblem, descent: &Descent) -> Option<Self> {
        let covariance = problem.covariance(descent)?;
        let camera = problem.lens.camera(&descent.state.lens)?;
        let cam_from_target = problem.pose(&descent.state);
        let through =
            |c: &Correspondence| Some(Correspondence { bearing: camera.bearing(&c.pixel).ok()?, ..*c });
        let seen: Vec<Correspondence> = problem.seen.iter().map(through).collect::<Option<_>>()?;
        let alone = crate::locate::refine::refine(&cam_from_target, &seen, &camera).ok()?;
        let pose = Problem::new(&seen, &camera);
        let minimum = Minimum {
            cam_from_target,
            covariance: alone.covariance,
            chi2: descent.chi2,
            rms_px: residual_sums(&cam_from_target, &pose).1,
            log_determinant: log_determinant(&cam_from_target, &pose),
        };
        Some(FocalMinimum { descent: descent.clone(), camera, covariance, minimum, seen })
    }

    fn is_same(&self, other: &FocalMinimum) -> bool {
        let variance = |m: &FocalMinimum| m.covariance.fixed_view::<3, 3>(0, 0).trace();
        let rotation =
            (self.minimum.cam_from_target.rotation - other.minimum.cam_from_target.rotation).norm_squared();
        let focal = self.descent.state.lens.log_focal - other.descent.state.lens.log_focal;
        let near = choose::DUPLICATE_SIGMAS * choose::DUPLICATE_SIGMAS;
        0.5 * rotation < near * variance(self).min(variance(other)) + ROUNDING
            && focal * focal < near * self.covariance[(6, 6)].min(other.covariance[(6, 6)]) + ROUNDING
    }

    fn focal_px(&self) -> f64 {
        self.descent.state.lens.focal_px()
    }
}

/// A minimum within the gate.
struct Fitting<'a> {
    m: &'a FocalMinimum,
    probability: f64,
    /// Its covariance, whole.
    whole: JointCovariance,
    /// What all points share along one axis of the image, px.
    shared_error_px: f64,
}

impl Fitting<'_> {
    fn pose_covariance(&self) -> Matrix6 {
        crate::pose::symmetric(&self.whole.fixed_view::<6, 6>(0, 0).into_owned())
    }
}

/// Squared distance of two ends of descents that rounding parts.
const ROUNDING: f64 = 1e-16;

/// What is asked, and what was measured on the points beforehand.
struct FocalView<'a> {
    problem: FocalProblem<'a>,
    geometry: Geometry,
    target_scale_sigma: [f64; 2],
}

impl FocalView<'_> {
    fn answer(&self, minima: &[FocalMinimum]) -> Result<FocalEstimate, Error> {
        let lowest = minima.first().ok_or(Error::NoSolution { n_points: self.problem.seen.len() })?;
        let degrees_of_freedom = degrees_of_freedom(&self.problem);
        let noise_scale = noise_scale(lowest.descent.chi2, degrees_of_freedom);
        let fitting: Vec<&FocalMinimum> = minima
            .iter()
            .filter(|m| is_within_gate(&m.minimum, &lowest.minimum, noise_scale, AMBIGUITY_GATE_CHI2))
            .collect();
        let probabilities = probabilities(&fitting, noise_scale);
        let fitting = fitting.into_iter().zip(probabilities);
        let fitting: Vec<Fitting> = fitting
            .map(|(m, probability)| self.whole(m, probability, lowest, noise_scale))
            .collect::<Result<_, _>>()?;
        self.check(&fitting, noise_scale, is_inconsistent(lowest.descent.chi2, degrees_of_freedom))?;
        let mut ordered = fitting;
        ordered.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        let leading = ordered.first().ok_or(Error::NoSolution { n_points: self.problem.seen.len() })?;
        let first = leading.m;
        let (covariance, shared_error_px) = (leading.pose_covariance(), leading.shared_error_px);
        let others = self.others(&ordered, lowest, noise_scale)?;
        let next = minima.iter().find(|m| !core::ptr::eq(*m, first));
        let ratio = next.map(|m| squared(m) / squared(first));
        let ambiguity = match (&others[0], ordered.get(1)) {
            (Some(other), Some(next)) => {
                Ambiguity::Ambiguous { ratio: squared(next.m) / squared(first), other: other.minimum }
            }
            _ => Ambiguity::Unique { ratio },
        };
        let consistency =
            consistency_of(&lowest.minimum, &Problem::new(&lowest.seen, &lowest.camera), degrees_of_freedom);
        let pose = PoseEstimate {
            cam_from_target: first.minimum.cam_from_target,
            covariance,
            rms_px: first.minimum.rms_px,
            chi2: first.descent.chi2,
            shared_error_px,
            log_determinant: first.minimum.log_determinant,
            delta_chi2: first.minimum.cost_above(&lowest.minimum, noise_scale),
            degrees_of_freedom,
            n_points: self.problem.seen.len(),
            method: Method::UnknownFocal,
            ambiguity,
            consistency,
            probability: leading.probability,
            others,
            weakness: None,
            geometry: Some(self.geometry),
        };
        if matches!(ambiguity, Ambiguity::Unique { .. }) && consistency == Consistency::Consistent {
            check_known(&pose.cam_from_target, &pose.covariance, &Problem::new(&first.seen, &first.camera))?;
        }
        Ok(self.estimate(pose, leading, &ordered))
    }

    fn estimate(&self, pose: PoseEstimate, leading: &Fitting, ordered: &[Fitting]) -> FocalEstimate {
        let Fitting { m: first, whole, .. } = leading;
        let focal_px = first.focal_px();
        let mut covariance: SMatrix<f64, 7, 7> = whole.fixed_view::<7, 7>(0, 0).into_owned();
        covariance.fixed_view_mut::<6, 6>(0, 0).copy_from(&pose.covariance);
        let lens: LensCovariance = whole.fixed_view::<5, 5>(6, 6).into_owned();
        let lens_state = &first.descent.state.lens;
        FocalEstimate {
            estimate: pose,
            focal_px,
            sigma_px: focal_px * covariance[(6, 6)].sqrt(),
            covariance,
            camera: first.camera.clone(),
            intrinsics_covariance: self.problem.lens.parameter_covariance(lens_state, &lens),
            other_focal_px: ordered.iter().skip(1).map(|f| f.m.focal_px()).collect(),
        }
    }

    /// The refusals: a focal length that the points do not determine, or that no lens has. Where the points contradict the stated noise the noise
    /// that they show says nothing of what they determine: the stated noise decides, and the answer is `inconsistent`.
    fn check(&self, fitting: &[Fitting], noise_scale: f64, is_contradicted: bool) -> Result<(), Error> {
        for Fitting { m, whole, .. } in fitting {
            let is_shown = is_determined(whole, 1.0) || is_contradicted && is_determined(&m.covariance, 1.0);
            if !is_shown {
                let state = &m.descent.state;
                let enough = |c: &JointCovariance| is_determined(c, noise_scale);
                let remedy = layout::remedy(&self.problem, state, &self.geometry, enough);
                let relative_sigma = whole[(6, 6)].sqrt();
                return Err(Error::UndeterminedFocal { relative_sigma, needed: MAX_RELATIVE_SIGMA, remedy });
            }
        }
        let fields =
            fitting.iter().map(|f| f.m.focal_px()).map(|f| (f, self.problem.lens.field_of_view_rad(f)));
        match fields.into_iter().find(|(_, field)| !(LEAST_FIELD_RAD..=MOST_FIELD_RAD).contains(field)) {
            Some((focal_px, field_of_view_rad)) => {
                Err(Error::ImpossibleFocal { focal_px, field_of_view_rad })
            }
            None => Ok(()),
        }
    }

    /// A minimum within the gate with its whole covariance: pixels and lens, the bends, and errors that the points share.
    fn whole<'a>(
        &self,
        m: &'a FocalMinimum,
        probability: f64,
        lowest: &FocalMinimum,
        noise_scale: f64,
    ) -> Result<Fitting<'a>, Error> {
        let mut whole = ridge::whole(&self.problem, &m.descent, &m.covariance, noise_scale);
        let view = &Problem::new(&m.seen, &m.camera);
        let lens: LensCovariance = m.covariance.fixed_view::<5, 5>(6, 6).into_owned();
        let intrinsics = self.problem.lens.parameter_covariance(&m.descent.state.lens, &lens);
        let common = Common { intrinsics: Some(intrinsics.as_slice()), scale_sigma: self.target_scale_sigma };
        let doubts = Doubts {
            problem: view,
            common,
            noise_scale,
            lowest: lowest.minimum,
            shared_errors: false,
            gate: AMBIGUITY_GATE_CHI2,
        };
        // What the bend of the pose and a printed target's scale add to what is in `whole` already.
        let pose = doubts.covariance(&m.minimum, None)?.covariance
            - m.covariance.fixed_view::<6, 6>(0, 0) * noise_scale;
        let mut block = whole.fixed_view_mut::<6, 6>(0, 0);
        block += pose;
        let shared = field::shared(&self.problem, &m.descent, &m.minimum, view);
        let (field, shared_error_px) = shared.unwrap_or((JointCovariance::zeros(), 0.0));
        Ok(Fitting { m, probability, whole: whole + field, shared_error_px })
    }

    fn others(&self, ordered: &[Fitting], lowest: &FocalMinimum, noise_scale: f64) -> Result<Others, Error> {
        let mut others = Others::default();
        for (place, fitting) in others.iter_mut().zip(ordered.iter().skip(1)) {
            let Fitting { m, probability, .. } = fitting;
            let covariance = fitting.pose_covariance();
            *place = Some(Hypothesis {
                minimum: Minimum { covariance, ..m.minimum },
                delta_chi2: m.minimum.cost_above(&lowest.minimum, noise_scale),
                probability: *probability,
                is_alternative: true,
            });
        }
        Ok(others)
    }
}

/// Residual sum of squares, but for rounding.
fn squared(m: &FocalMinimum) -> f64 {
    m.minimum.rms_px.max(choose::ROUNDING_PX).powi(2)
}

/// Laplace's approximation over pose and lens, docs/math/posterior.md eq. (5).
fn probabilities(minima: &[&FocalMinimum], noise_scale: f64) -> Vec<f64> {
    let Some(best) = minima.first() else { return Vec::new() };
    let half_log_volume = |m: &FocalMinimum| {
        let scale = best.covariance.diagonal().map(|v| v.sqrt().recip());
        let scaled = m.covariance.component_mul(&(scale * scale.transpose()));
        scaled.cholesky().map_or(0.0, |c| c.l_dirty().diagonal().iter().map(|l| l.ln()).sum::<f64>())
    };
    let at_best = half_log_volume(best);
    let mass = |m: &&FocalMinimum| {
        let above = m.minimum.cost_above(&best.minimum, noise_scale) / noise_scale;
        (half_log_volume(m) - at_best - 0.5 * above).min(300.0).exp()
    };
    let masses: Vec<f64> = minima.iter().map(mass).collect();
    let total: f64 = masses.iter().sum();
    masses.into_iter().map(|mass| mass / total).collect()
}
