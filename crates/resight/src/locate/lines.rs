//! Solves for a pose from lines, and points where there are any.

use super::once::Once;
use super::{NamedPoint, PointsOptions, PoseAnswer, mean_square_root, point_sigma_m};
use crate::answer::Status;
use crate::report::verdict::{self, Verdict};
use resight_core::budget::{Budget, ErrorSource};
use resight_core::line::{ImageLine, LineCorrespondence};
use resight_core::locate::choose::{Ambiguity, Hypothesis, Minimum};
use resight_core::locate::consistency::{Consistency, is_inconsistent, is_unlikely};
use resight_core::locate::lines::{LinesEstimate, locate_lines, refine_lines};
use resight_core::locate::observability::Observability;
use resight_core::locate::problem::Problem;
use resight_core::{
    Camera, Correspondence, Error as MathError, Matrix6, Method, Point, Pose, PoseEstimate, Vector6,
};

/// A known line and two points of its image, with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedLine {
    /// Its name: an id, or a number.
    pub name: String,
    /// Its line in the file from which it was read.
    pub line: Option<u64>,
    /// The known line and its observation.
    pub seen: LineCorrespondence,
}

/// Solves for the pose of a camera from known lines and points; `view` is their name in the answer.
///
/// Uncertain intrinsics widen the covariance: the pose is solved again with each parameter one standard deviation off.
pub fn locate_lines_and_points(
    view: &str,
    points: &[NamedPoint],
    lines: &[NamedLine],
    camera: &Camera,
    options: &PointsOptions,
) -> PoseAnswer {
    let of_points: Vec<Correspondence> = points.iter().map(|point| point.seen).collect();
    if let Some(once) = Once::of(&of_points) {
        let answer = |points: &[NamedPoint]| locate_lines_and_points(view, points, lines, camera, options);
        return once.answered(points, answer);
    }
    let seen = Seen { points: of_points, lines: lines.iter().map(|line| line.seen).collect() };
    let label = |i: usize| match points.get(i) {
        Some(point) => format!("point {}", point.label()),
        None => lines.get(i - points.len()).map_or_else(String::new, |l| format!("line {}", l.label())),
    };
    let problem = Problem { priors: &options.priors, ..Problem::new(&seen.points, camera) };
    let found = locate_lines(&seen.lines, &problem);
    let solved = found.as_ref().map_err(Clone::clone).and_then(|f| seen.estimate(f, &problem, options));
    let budget = found.ok().zip(solved.as_ref().ok());
    let budget = budget.and_then(|(found, e)| seen.budget(&found, e, &problem, options).ok());
    let sigmas = seen.points.iter().map(|c| c.sigma_px).chain(seen.lines.iter().map(|l| l.seen.sigma_px));
    let answer = PoseAnswer {
        n_points: seen.points.len(),
        n_lines: seen.lines.len(),
        image_unit: options.image_unit,
        sigma_px: mean_square_root(sigmas),
        point_sigma_m: point_sigma_m(&seen.points),
        intrinsics_sigma: options.intrinsics.as_ref().map(super::IntrinsicsCovariance::sigmas),
        names: points.iter().map(|p| p.name.clone()).chain(lines.iter().map(|l| l.name.clone())).collect(),
        ..PoseAnswer::without_pose(view.to_owned(), Status::Error, "")
    };
    match solved {
        Ok(estimate) => PoseAnswer {
            verdict: verdict::of_estimate(&estimate, label, options.image_unit),
            observability: Some(Observability::of(&estimate, &seen.places())),
            estimate: Some(estimate),
            budget,
            ..answer
        },
        Err(reason) => PoseAnswer { verdict: of_error(&reason, &seen), ..answer },
    }
}

impl NamedLine {
    fn label(&self) -> String {
        match self.line {
            Some(line) => format!("{} (line {line} of the file)", self.name),
            None => self.name.clone(),
        }
    }
}

/// Returns the verdict on an error; numbers of observations are counted in lines here.
fn of_error(reason: &MathError, seen: &Seen) -> Verdict {
    let verdict = verdict::of_error(reason);
    match reason {
        MathError::TooFewPoints { .. } => Verdict {
            message: format!(
                "{} lines and {} points given; three lines that are not all parallel, or two points or lines more, are needed",
                seen.lines.len(),
                seen.points.len()
            ),
            ..verdict
        },
        _ => verdict,
    }
}

/// Returns the factor by which residuals beyond the stated noise widen the covariance.
fn noise_scale(found: &LinesEstimate) -> f64 {
    match is_unlikely(found.chi2, found.degrees_of_freedom) {
        true => found.chi2 / found.degrees_of_freedom as f64,
        false => 1.0,
    }
}

struct Seen {
    points: Vec<Correspondence>,
    lines: Vec<LineCorrespondence>,
}

impl Seen {
    /// Returns the known points and a point of each line, for figures that depend on where the target is.
    fn places(&self) -> Vec<Correspondence> {
        let of_line = |l: &LineCorrespondence| {
            let [pixel, _] = l.seen.ends_px;
            let x_in_target = l.point_in_target.unwrap_or_default();
            let bearing = l.seen.bearings[0];
            Correspondence {
                x_in_target,
                pixel,
                bearing,
                sigma_px: l.seen.sigma_px,
                covariance_px2: None,
                sigma_m: 0.0,
            }
        };
        self.points.iter().copied().chain(self.lines.iter().map(of_line)).collect()
    }

    fn estimate(
        &self,
        found: &LinesEstimate,
        problem: &Problem,
        options: &PointsOptions,
    ) -> Result<PoseEstimate, MathError> {
        let LinesEstimate { cam_from_target, chi2, degrees_of_freedom, .. } = *found;
        let scale = noise_scale(found);
        let widened = |pose: &Pose, covariance: &Matrix6| -> Result<Matrix6, MathError> {
            Ok((covariance + self.share_of_intrinsics(pose, problem, options)?) * scale)
        };
        let first = refine_lines(&cam_from_target, &self.lines, problem)?;
        let ambiguity = match &found.ambiguity {
            Ambiguity::Ambiguous { ratio, other } => {
                let covariance = widened(&other.cam_from_target, &other.covariance)?;
                Ambiguity::Ambiguous { ratio: *ratio, other: Minimum { covariance, ..*other } }
            }
            unique => *unique,
        };
        let mut others = [None; 3];
        let mut probability = 1.0;
        if let Ambiguity::Ambiguous { other, .. } = &ambiguity {
            // Of two poses that fit, the one with the lower χ² is more probable; their prior volumes are equal.
            let odds = (-0.5 * (other.chi2 - chi2) / scale).exp();
            probability = 1.0 / (1.0 + odds);
            others[0] = Some(Hypothesis {
                minimum: *other,
                delta_chi2: other.chi2 - chi2,
                probability: 1.0 - probability,
                is_alternative: true,
            });
        }
        Ok(PoseEstimate {
            cam_from_target,
            covariance: widened(&cam_from_target, &found.covariance)?,
            rms_px: first.rms_px,
            chi2,
            shared_error_px: 0.0,
            log_determinant: first.log_determinant,
            delta_chi2: 0.0,
            degrees_of_freedom,
            n_points: self.points.len() + self.lines.len(),
            method: Method::Lines,
            ambiguity,
            consistency: self.consistency(&cam_from_target, chi2, degrees_of_freedom, problem.camera),
            probability,
            others,
            weakness: None,
            geometry: None,
        })
    }

    /// Returns the parts of the estimate's covariance by their sources.
    fn budget(
        &self,
        found: &LinesEstimate,
        estimate: &PoseEstimate,
        problem: &Problem,
        options: &PointsOptions,
    ) -> Result<Budget, MathError> {
        let mut budget = found.budget(&self.lines, problem)?;
        let of_lens = self.share_of_intrinsics(&found.cam_from_target, problem, options)?;
        budget.add(ErrorSource::Lens, &of_lens);
        let scale = noise_scale(found);
        budget.add(ErrorSource::Residuals, &(estimate.covariance * ((scale - 1.0) / scale)));
        Ok(budget)
    }

    fn consistency(
        &self,
        cam_from_target: &Pose,
        chi2: f64,
        degrees_of_freedom: usize,
        camera: &Camera,
    ) -> Consistency {
        if !is_inconsistent(chi2, degrees_of_freedom) {
            return Consistency::Consistent;
        }
        let of_point = |c: &Correspondence| {
            camera.project(&(*cam_from_target * c.x_in_target)).map_or(0.0, |pixel| (c.pixel - pixel).norm())
        };
        let of_line = |l: &LineCorrespondence| {
            let normal = |p: Point| {
                let direction = cam_from_target.rotation * l.direction_in_target.into_inner();
                direction.cross(&(*cam_from_target * p))
            };
            let off = |p: Point| l.seen.residuals(&normal(p)).into_iter().map(f64::abs).fold(0.0, f64::max);
            l.point_in_target.map_or(0.0, off) * l.seen.sigma_px
        };
        let misses = self.points.iter().map(of_point).chain(self.lines.iter().map(of_line));
        let (worst_point, worst_px) =
            misses.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
        let chi2_per_degree_of_freedom = chi2 / degrees_of_freedom as f64;
        Consistency::Inconsistent { chi2_per_degree_of_freedom, worst_point, worst_px, worst_prior: None }
    }

    /// Returns Σ D C Dᵀ, with D the change of the answer with each parameter, from differences over its standard deviation.
    fn share_of_intrinsics(
        &self,
        cam_from_target: &Pose,
        problem: &Problem,
        options: &PointsOptions,
    ) -> Result<Matrix6, MathError> {
        let Some(known) = &options.intrinsics else { return Ok(Matrix6::zeros()) };
        let covariance = known.covariance(problem.camera);
        let values: Vec<f64> = problem.camera.parameters().iter().map(|(_, value)| *value).collect();
        let n = values.len();
        let mut by_parameter = vec![Vector6::zeros(); n];
        for (i, by) in by_parameter.iter_mut().enumerate() {
            let sigma = covariance[i * n + i].max(0.0).sqrt();
            if sigma == 0.0 {
                continue;
            }
            let mut moved = values.clone();
            moved[i] += sigma;
            let camera = problem.camera.with_parameters(&moved)?;
            let seen = self.through(&camera)?;
            let other = Problem { camera: &camera, seen: &seen.points, ..*problem };
            let found = refine_lines(cam_from_target, &seen.lines, &other)?;
            *by = (found.cam_from_target * cam_from_target.inverse()).log() / sigma;
        }
        let mut share = Matrix6::zeros();
        for (k, c) in covariance.iter().enumerate() {
            share += by_parameter[k / n] * by_parameter[k % n].transpose() * *c;
        }
        Ok((share + share.transpose()) * 0.5)
    }

    /// Returns the same pixels as seen by another camera.
    fn through(&self, camera: &Camera) -> Result<Seen, MathError> {
        let point = |c: &Correspondence| Ok(Correspondence { bearing: camera.bearing(&c.pixel)?, ..*c });
        let line = |l: &LineCorrespondence| {
            Ok(LineCorrespondence { seen: ImageLine::new(camera, l.seen.ends_px, l.seen.sigma_px)?, ..*l })
        };
        Ok(Seen {
            points: self.points.iter().map(point).collect::<Result<_, MathError>>()?,
            lines: self.lines.iter().map(line).collect::<Result<_, MathError>>()?,
        })
    }
}
