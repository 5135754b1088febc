//! Solves one view: rows to correspondences, the pose, the contribution of uncertain intrinsics, and the verdict.

use super::KnownCamera;
use super::read::{RigPoint, RigPointsView};
use crate::answer::Status;
use crate::answer::rig_pose::{RigAgreement, RigCameraFit, RigPoseAnswer};
use crate::core::correspondence::Observations;
use crate::core::multiview::rig_pose::{
    RigAmbiguity, RigConsistency, RigPoseEstimate, RigView, locate_rig, rig_consensus,
};
use crate::core::{Camera, Correspondence, Error as MathError, Pixel, Point};
use crate::locate::LARGEST;
use crate::report::verdict::{self, figures};
use crate::report::words::{self, sigmas};

/// A camera with fewer rows may lose most of them to wrong correspondences without being judged.
const ROWS_TO_JUDGE: usize = 6;

/// Settings of [`rig_poses`](super::rig_poses).
#[derive(Debug, Clone, Copy)]
pub struct RigPoseRequest {
    /// Standard deviation of u and v where a row states none, px.
    pub sigma_px: f64,
    /// Largest distance of a point that agrees with the pose, px; `None` where every point is trusted.
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
    /// Number of rows that repeat an earlier one.
    n_repeated: usize,
}

pub(super) fn solved(rig: &[KnownCamera], view: &RigPointsView, request: &RigPoseRequest) -> RigPoseAnswer {
    let mut answer = RigPoseAnswer::unsolved(view.name.clone(), view.rows.len());
    let seen = match seen(rig, view, request) {
        Ok(seen) => seen,
        Err(reason) => return RigPoseAnswer { message: reason, ..answer },
    };
    let lenses: Vec<Option<Vec<f64>>> = rig.iter().map(|known| known.named.intrinsics_rows()).collect();
    let views = rig_views(rig, &seen.points, &lenses);
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
    let truncation = answer.agreement.as_ref().map_or(1.0, |a| a.truncation);
    let exact = sigma_with_exact_lenses(rig, &kept, &estimate, truncation);
    answer.cameras = (0..rig.len())
        .filter(|c| !seen.points[*c].is_empty())
        .map(|c| fit(&rig[c], &seen.points[c], &kept[c], &estimate))
        .collect();
    answer.remarks.extend(words::repeated(seen.n_repeated, view.rows.len()));
    (answer.status, answer.message) = judged(&estimate, &answer, &seen, view, rig);
    if answer.status == Status::Ok {
        let z_m = view.rows.iter().map(|row| row.x_in_target[2]);
        answer.remarks.extend(words::below_one_level(
            "rig",
            "x_m and y_m are exchanged",
            z_m,
            estimate.rig_from_target.origin().z,
        ));
    }
    let budget = estimate.budget(&rig_views(rig, &kept, &lenses)).ok();
    answer.with_estimate(&estimate, budget, exact)
}

fn rig_views<'a>(
    rig: &'a [KnownCamera],
    points: &'a [Vec<Correspondence>],
    lenses: &'a [Option<Vec<f64>>],
) -> Vec<RigView<'a>> {
    let view =
        |((known, seen), lens): ((&'a KnownCamera, &'a Vec<Correspondence>), &'a Option<Vec<f64>>)| RigView {
            camera: known.camera(),
            cam_from_rig: known.cam_from_rig,
            cam_from_rig_covariance: known.covariance,
            intrinsics_covariance: lens.as_deref(),
            seen,
        };
    rig.iter().zip(points).zip(lenses).map(view).collect()
}

fn seen(rig: &[KnownCamera], view: &RigPointsView, request: &RigPoseRequest) -> Result<Seen, String> {
    let mut seen =
        Seen { points: vec![Vec::new(); rig.len()], rows: vec![Vec::new(); rig.len()], n_repeated: 0 };
    let mut known = Observations::default();
    for (i, row) in view.rows.iter().enumerate() {
        let (x, pixel) = (Point::from(row.x_in_target), Pixel::from(row.image));
        if known.first(row.camera, &x, &pixel, i) != i {
            seen.n_repeated += 1;
            continue;
        }
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

/// Returns the standard deviations of the rig's position for exact intrinsics: the predicted points are solved again, so that no residual due to
/// the lenses widens them. `None` where every lens in use is exact.
fn sigma_with_exact_lenses(
    rig: &[KnownCamera],
    kept: &[Vec<Correspondence>],
    estimate: &RigPoseEstimate,
    truncation: f64,
) -> Option<[f64; 3]> {
    let is_uncertain = |(known, seen): (&KnownCamera, &Vec<Correspondence>)| {
        known.named.intrinsics_covariance.is_some() && !seen.is_empty()
    };
    if !rig.iter().zip(kept).any(is_uncertain) {
        return None;
    }
    let ideal = |known: &KnownCamera, c: &Correspondence| {
        let x_in_cam = known.cam_from_rig * estimate.rig_from_target * c.x_in_target;
        let pixel = known.camera().project(&x_in_cam)?;
        Some(Correspondence { pixel, bearing: known.camera().bearing(&pixel).ok()?, ..*c })
    };
    let of_camera = |(known, seen): (&KnownCamera, &Vec<Correspondence>)| {
        seen.iter().filter_map(|c| ideal(known, c)).collect::<Vec<_>>()
    };
    let points: Vec<Vec<Correspondence>> = rig.iter().zip(kept).map(of_camera).collect();
    let exact = locate_rig(&rig_views(rig, &points, &vec![None; rig.len()])).ok()?;
    Some(sigmas(&(exact.covariance / truncation)).1)
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

/// Determines the status in one place: contradiction first, then loss of a camera's rows, then a second pose.
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
    if let RigConsistency::CameraApart { camera, chi2 } = e.consistency {
        let message = format!(
            "camera {} alone puts the target elsewhere than the other cameras do (χ² {chi2:.0}, 6 expected); check its file, whether it moved, whether all saw the target at one time, and the unit of the points",
            rig[camera].named.name
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

/// Names the cameras in an error that refers to their indices.
fn named(reason: &MathError, rig: &[KnownCamera]) -> String {
    match reason {
        MathError::InvalidRig { camera, .. } | MathError::InvalidRigPoint { camera, .. } => {
            let name = rig.get(*camera).map_or("", |c| c.named.name.as_str());
            format!("camera {name}: {reason}")
        }
        _ => reason.to_string(),
    }
}
