//! One view: rows to correspondences, the pose, what uncertain intrinsics add, and the verdict.

use super::KnownCamera;
use super::read::{RigPoint, RigPointsView};
use crate::answer::Status;
use crate::answer::rig_pose::{RigAgreement, RigCameraFit, RigPoseAnswer};
use crate::core::multiview::rig_pose::{
    RigAmbiguity, RigConsistency, RigPoseEstimate, RigView, locate_rig, rig_consensus,
};
use crate::core::{Camera, Correspondence, Error as MathError, Matrix6, Pixel, Point};
use crate::report::verdict::{self, figures};
use crate::rig::uncertain_lens::share;
use nalgebra::DVector;

/// Squares of larger numbers, and their products, leave the range of numbers.
const LARGEST: f64 = 1e60;
/// A camera with fewer rows may lose most of them to wrong correspondences.
const ROWS_TO_JUDGE: usize = 6;

/// How poses of a rig are found.
#[derive(Debug, Clone, Copy)]
pub struct RigPoseRequest {
    /// Standard deviation of u and v where a row states none, px.
    pub sigma_px: f64,
    /// How far off a point may be to agree with the pose, px; none where every point is taken as right.
    pub robust_threshold_px: Option<f64>,
}

impl Default for RigPoseRequest {
    fn default() -> Self {
        RigPoseRequest { sigma_px: 0.5, robust_threshold_px: None }
    }
}

/// Correspondences by camera, and the row of each.
struct Seen {
    points: Vec<Vec<Correspondence>>,
    rows: Vec<Vec<usize>>,
}

pub(super) fn solved(rig: &[KnownCamera], view: &RigPointsView, request: &RigPoseRequest) -> RigPoseAnswer {
    let mut answer = RigPoseAnswer::unsolved(view.name.clone(), view.rows.len());
    let seen = match seen(rig, view, request) {
        Ok(seen) => seen,
        Err(reason) => return RigPoseAnswer { message: reason, ..answer },
    };
    let views = rig_views(rig, &seen.points);
    let found = match request.robust_threshold_px {
        None => locate_rig(&views).map(|estimate| (estimate, None)),
        Some(limit) => rig_consensus(&views, limit).map(|c| (c.estimate, Some(c))),
    };
    let (estimate, consensus) = match found {
        Ok(found) => found,
        Err(reason) => {
            let refused = verdict::of_error(&reason);
            return RigPoseAnswer { status: refused.status, message: named(&reason, rig), ..answer };
        }
    };
    answer.agreement = consensus.map(|c| {
        let mut inliers: Vec<usize> = c.inliers.iter().map(|(camera, i)| seen.rows[*camera][*i]).collect();
        inliers.sort_unstable();
        RigAgreement {
            threshold_px: request.robust_threshold_px.unwrap_or_default(),
            n_inliers: inliers.len(),
            inliers,
            n_samples: c.n_samples,
            confidence: c.confidence,
            log10_false_alarms: c.log10_false_alarms,
            truncation: c.truncation,
        }
    });
    let used = |row: usize| answer.agreement.as_ref().is_none_or(|a| a.inliers.binary_search(&row).is_ok());
    let kept: Vec<Vec<Correspondence>> = (0..rig.len())
        .map(|c| {
            seen.points[c].iter().zip(&seen.rows[c]).filter(|(_, row)| used(**row)).map(|(p, _)| *p).collect()
        })
        .collect();
    let lens = lens_share(rig, &kept, &estimate);
    answer.cameras = (0..rig.len())
        .filter(|c| !seen.points[*c].is_empty())
        .map(|c| fit(&rig[c], &seen.points[c], &kept[c], &estimate))
        .collect();
    (answer.status, answer.message) = judged(&estimate, &answer, &seen, view, rig);
    answer.with_estimate(&estimate, lens)
}

fn rig_views<'a>(rig: &'a [KnownCamera], points: &'a [Vec<Correspondence>]) -> Vec<RigView<'a>> {
    let view = |(known, seen): (&'a KnownCamera, &'a Vec<Correspondence>)| RigView {
        camera: known.camera(),
        cam_from_rig: known.cam_from_rig,
        cam_from_rig_covariance: known.covariance,
        seen,
    };
    rig.iter().zip(points).map(view).collect()
}

fn seen(rig: &[KnownCamera], view: &RigPointsView, request: &RigPoseRequest) -> Result<Seen, String> {
    let mut seen = Seen { points: vec![Vec::new(); rig.len()], rows: vec![Vec::new(); rig.len()] };
    for (i, row) in view.rows.iter().enumerate() {
        seen.points[row.camera].push(correspondence(row, rig[row.camera].camera(), request)?);
        seen.rows[row.camera].push(i);
    }
    Ok(seen)
}

fn correspondence(
    row: &RigPoint,
    camera: &Camera,
    request: &RigPoseRequest,
) -> Result<Correspondence, String> {
    let (sigma_px, sigma_m) = (row.sigma_px.unwrap_or(request.sigma_px), row.sigma_m.unwrap_or(0.0));
    let ([x, y, z], [u, v]) = (row.x_in_target, row.image);
    let cells = [
        ("x_m", x),
        ("y_m", y),
        ("z_m", z),
        ("u_px", u),
        ("v_px", v),
        ("sigma_px", sigma_px),
        ("sigma_m", sigma_m),
    ];
    for (column, value) in cells {
        if !value.is_finite() || LARGEST < value.abs() {
            return Err(format!(
                "line {}: column `{column}` is {value:e}; correct it or remove the row",
                row.line
            ));
        }
    }
    if sigma_px <= 0.0 || sigma_m < 0.0 {
        return Err(format!(
            "line {}: `sigma_px` is {sigma_px} and `sigma_m` {sigma_m}; the first must be positive, the second not negative",
            row.line
        ));
    }
    Correspondence::new(camera, Point::from(row.x_in_target), Pixel::from(row.image), sigma_px)
        .map(|c| Correspondence { sigma_m, ..c })
        .map_err(|reason| format!("line {}: {reason}", row.line))
}

/// What uncertain intrinsics of the cameras that see anything add to the covariance: the rig is located again through other lenses.
fn lens_share(
    rig: &[KnownCamera],
    kept: &[Vec<Correspondence>],
    estimate: &RigPoseEstimate,
) -> Option<Matrix6> {
    let mut sum: Option<Matrix6> = None;
    for (i, known) in rig.iter().enumerate().filter(|(i, _)| !kept[*i].is_empty()) {
        let with = |lens: &Camera| {
            let through = |c: &Correspondence| {
                let moved = Correspondence::new(lens, c.x_in_target, c.pixel, c.sigma_px).ok()?;
                Some(Correspondence { sigma_m: c.sigma_m, ..moved })
            };
            let mut points = kept.to_vec();
            points[i] = kept[i].iter().map(through).collect::<Option<_>>()?;
            let mut views = rig_views(rig, &points);
            views[i].camera = lens;
            let found = locate_rig(&views).ok()?;
            let change = (found.rig_from_target * estimate.rig_from_target.inverse()).log();
            Some(DVector::from_column_slice(change.as_slice()))
        };
        if let Some(added) = share(&known.named, with) {
            let added = Matrix6::from_fn(|r, c| added[(r, c)]);
            sum = Some(sum.map_or(added, |sum| sum + added));
        }
    }
    sum
}

fn fit(
    known: &KnownCamera,
    seen: &[Correspondence],
    kept: &[Correspondence],
    estimate: &RigPoseEstimate,
) -> RigCameraFit {
    let cam_from_target = known.cam_from_rig * estimate.rig_from_target;
    let squares = kept.iter().filter_map(|c| {
        let pixel = known.camera().project(&(cam_from_target * c.x_in_target))?;
        Some((c.pixel - pixel).norm_squared())
    });
    let (n, sum) = squares.fold((0, 0.0), |(n, sum), square| (n + 1, sum + square));
    RigCameraFit {
        name: known.named.name.clone(),
        n_points: seen.len(),
        n_inliers: kept.len(),
        rms_px: (0 < n).then(|| (sum / f64::from(n)).sqrt()),
    }
}

/// The status in one place: contradiction, then loss, then a second pose.
fn judged(
    e: &RigPoseEstimate,
    answer: &RigPoseAnswer,
    seen: &Seen,
    view: &RigPointsView,
    rig: &[KnownCamera],
) -> (Status, String) {
    if let RigConsistency::Inconsistent { chi2_per_degree_of_freedom, worst_camera, worst_point, worst_px } =
        e.consistency
    {
        let row = seen.rows[worst_camera].get(worst_point).map(|row| &view.rows[*row]);
        let point = row.map_or_else(String::new, |row| {
            format!(", its point {} (line {}) is {} px off", row.name, row.line, figures(worst_px))
        });
        let camera = &rig[worst_camera].named.name;
        let way_out = match answer.agreement {
            None => {
                "check the correspondences (--robust PX finds wrong ones), the unit of the points, and whether that camera moved"
            }
            Some(_) => "check the rig file, the unit of the points, and whether that camera moved",
        };
        let message = format!(
            "the residual is far above the stated noise (χ²/dof {chi2_per_degree_of_freedom:.1}, expected 1); camera {camera} fits worst{point}; {way_out}"
        );
        return (Status::Inconsistent, message);
    }
    if let Some(agreement) = &answer.agreement {
        let n = view.rows.len();
        if 2 * agreement.n_inliers < n {
            let message = format!(
                "only {} of {n} points agree with one pose; more than half are wrong: check the correspondences before using it",
                agreement.n_inliers
            );
            return (Status::Inconsistent, message);
        }
        let lost = |fit: &&RigCameraFit| ROWS_TO_JUDGE <= fit.n_points && 2 * fit.n_inliers < fit.n_points;
        if let Some(fit) = answer.cameras.iter().find(lost) {
            let message = format!(
                "{} of {} points of camera {} do not agree with the pose that the other points have; did it move, or is its lens another?",
                fit.n_points - fit.n_inliers,
                fit.n_points,
                fit.name
            );
            return (Status::Inconsistent, message);
        }
    }
    match e.ambiguity {
        RigAmbiguity::Ambiguous { ratio, .. } => (
            Status::Ambiguous,
            format!(
                "two poses fit about equally well (error ratio {ratio:.2}); let another camera see points, or use points out of one plane"
            ),
        ),
        RigAmbiguity::Unique { .. } if e.degrees_of_freedom == 0 => (
            Status::Ok,
            format!(
                "one pose fits; {} points leave nothing to check the residual with, so add another",
                e.n_points
            ),
        ),
        RigAmbiguity::Unique { .. } => (Status::Ok, "one pose fits".into()),
    }
}

/// A refusal that counts cameras names them.
fn named(reason: &MathError, rig: &[KnownCamera]) -> String {
    match reason {
        MathError::InvalidRig { camera, .. } | MathError::InvalidRigPoint { camera, .. } => {
            let name = rig.get(*camera).map_or("", |c| c.named.name.as_str());
            format!("camera {name}: {reason}")
        }
        _ => reason.to_string(),
    }
}
