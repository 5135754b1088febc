//! Converts the answer of the mathematics to one with names.

use super::gather::{CameraViews, NamedView};
use crate::answer::Status;
use crate::answer::budget::parts_of_numbers;
use crate::answer::intrinsics::*;
use crate::core::Target;
use crate::core::camera::ImageSize;
use crate::core::multiview::intrinsics::{
    BadView, Finding, IntrinsicsOutcome, IntrinsicsView, LEAST_POINTS, NextView, Placement, Severity,
    SolvedIntrinsics,
};
use crate::core::multiview::intrinsics_check::SkippedFrame;
use crate::formats::NamedCamera;
use crate::report::face::is_from_behind;
use crate::report::verdict::Verdict;
use crate::report::words::{counted, found_nowhere};
use crate::rig::Collected;

/// Returns the answer for a camera that observed no target.
pub(crate) fn not_found(camera: &CameraViews, n_images: usize) -> CameraIntrinsics {
    let seen = Collected::explanation(&camera.left_out, &camera.name);
    let message = match seen {
        Some(seen) => found_nowhere(n_images, &seen),
        None => format!(
            "no target was found in {}; check the target file and that the whole target is in focus",
            counted(n_images, "image")
        ),
    };
    unsolved(camera, Status::NotFound, message, Vec::new(), &[])
}

/// Returns the answer for a camera whose views have too few points each, for any pose of the target.
pub(super) fn too_few_points(camera: &CameraViews, most: usize) -> CameraIntrinsics {
    let message = too_few_points_of(camera.views.iter().find_map(|view| view.target.as_ref()), most);
    unsolved(camera, Status::Degenerate, message, Vec::new(), &[])
}

/// Explains that a view of a target has too few points, and which target to take instead.
pub(crate) fn too_few_points_of(target: Option<&Target>, most: usize) -> String {
    let target = target.map(Target::design);
    let instead = match target {
        Some(Target::Tag(tag)) => format!(
            "print a sheet of several, `resight print --kind tag --family {} --id 0-11 --size-m {} -o tags.pdf`, and give its file tags.toml as the target",
            tag.family,
            tag.size_m.min(LARGEST_OF_SHEET_M)
        ),
        _ => "take a board of many corners: `resight print --kind charuco --rows 8 --columns 5 --square-m 0.03 -o board.pdf`".to_owned(),
    };
    let kind = target.map_or("target", Target::kind).replace('_', " ");
    format!(
        "a view of this {kind} has {most} points at most, {LEAST_POINTS} are needed to estimate a lens from; {instead}"
    )
}

/// Twelve tags of this size with their margins fit on a sheet of A4, metres.
const LARGEST_OF_SHEET_M: f64 = 0.035;

pub(super) fn described(
    camera: &CameraViews,
    size: ImageSize,
    outcome: &IntrinsicsOutcome,
) -> CameraIntrinsics {
    let name_of = |view: usize| camera.views[view].name.clone();
    let object = |finding: &Finding| FindingObject {
        name: finding.name(),
        severity: finding.severity().into(),
        message: finding.message(name_of),
    };
    match outcome {
        IntrinsicsOutcome::Refused(refusal) => {
            let findings: Vec<FindingObject> = refusal.findings.iter().map(object).collect();
            let message = findings.first().map_or_else(String::new, |finding| finding.message.clone());
            let status = match refusal.findings.first() {
                Some(Finding::NoCamera { .. } | Finding::UsualFault { .. }) => Status::Inconsistent,
                _ => Status::Degenerate,
            };
            unsolved(camera, status, message, findings, &refusal.skipped)
        }
        IntrinsicsOutcome::Solved(solved) => {
            let mut findings: Vec<FindingObject> = solved.findings.iter().map(object).collect();
            findings.extend(mirrored(camera, solved));
            let status = match solved.severity() {
                Severity::Remark => Status::Ok,
                Severity::Inconsistent => Status::Inconsistent,
                Severity::Degenerate => Status::Degenerate,
            };
            let lens = NamedCamera {
                name: camera.name.clone(),
                camera: solved.camera.clone(),
                placement: None,
                intrinsics_covariance: Some(solved.covariance.clone()),
            };
            let message = if status == Status::Ok { good(solved) } else { findings[0].message.clone() };
            let Verdict { status, message } = Verdict { status, message }.with_sizes(&camera.size_remarks());
            CameraIntrinsics {
                name: camera.name.clone(),
                status,
                message,
                findings,
                left_out: left_out(camera, &solved.skipped),
                intrinsics: Some(intrinsics(camera, size, solved)),
                camera: Some(lens),
            }
        }
    }
}

fn unsolved(
    camera: &CameraViews,
    status: Status,
    message: String,
    findings: Vec<FindingObject>,
    skipped: &[SkippedFrame],
) -> CameraIntrinsics {
    let left_out = left_out(camera, skipped);
    CameraIntrinsics {
        name: camera.name.clone(),
        status,
        message,
        findings,
        intrinsics: None,
        left_out,
        camera: None,
    }
}

fn left_out(camera: &CameraViews, skipped: &[SkippedFrame]) -> Vec<LeftOutObject> {
    let given = camera.left_out.iter().map(|one| LeftOutObject {
        view: one.view.clone(),
        what: one.what.clone(),
        reason: one.reason.clone(),
    });
    let unusable = skipped.iter().map(|one| LeftOutObject {
        view: camera.views[one.frame].name.clone(),
        what: "frame".to_string(),
        reason: one.reason.to_string(),
    });
    given.chain(unusable).collect()
}

fn good(solved: &SolvedIntrinsics) -> String {
    let (focal, sigma) = (solved.camera.parameters()[0].1, solved.sigmas()[0]);
    let known = solved.projection.rms_px().map_or_else(String::new, |px| {
        let weak = if WEAK_PX < px { ", which is weak (0.3 px is good)" } else { "" };
        format!("; a pixel's direction is known to {px:.2} px in the mean over the image{weak}")
    });
    format!("the focal length is {focal:.2} ± {sigma:.2} px{known}")
}

/// Our flat targets have a front: a print seen from behind in every view is mirrored.
fn mirrored(camera: &CameraViews, solved: &SolvedIntrinsics) -> Option<FindingObject> {
    let side = |view: &IntrinsicsView| -> Option<bool> {
        let NamedView { target, points, .. } = &camera.views[view.view];
        is_from_behind(target.as_ref()?, &view.cam_from_target, points)
    };
    let sides: Vec<bool> = solved.views.iter().filter_map(side).collect();
    let n = sides.iter().filter(|behind| **behind).count();
    (0 < n && sides.len() < 2 * n).then(|| FindingObject {
        name: "mirrored_target",
        severity: SeverityObject::Remark,
        message: format!(
            "{n} of {} views show the target from behind: the print is mirrored, or its ids run the other way; the intrinsics do not depend on that, poses do, so correct print or ids",
            sides.len()
        ),
    })
}

fn intrinsics(camera: &CameraViews, size: ImageSize, solved: &SolvedIntrinsics) -> IntrinsicsObject {
    let name_of = |view: usize| camera.views[view].name.clone();
    let estimated = solved.estimated();
    let parameters = solved.camera.parameters().into_iter().zip(solved.sigmas());
    let shares = solved.projection_shares();
    IntrinsicsObject {
        model: solved.camera.model_name(),
        width_px: size.width_px,
        height_px: size.height_px,
        parameters: parameters
            .map(|((name, value), sigma)| ParameterObject {
                name,
                value,
                sigma,
                estimated: estimated.contains(&name),
            })
            .collect(),
        covariance: solved.covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        budget: parts_of_numbers(&solved.budget, |part| {
            shares.iter().find(|(source, _)| *source == part.source).map_or(0.0, |(_, share)| *share)
        }),
        rms_px: solved.rms_px,
        chi2: solved.chi2,
        degrees_of_freedom: solved.degrees_of_freedom,
        noise_scale: solved.noise_scale,
        contradiction: solved.contradiction,
        tried: tried(solved),
        n_corners: solved.views.iter().map(|view| view.residuals.len()).sum(),
        views: solved.views.iter().map(|view| view_object(view, name_of(view.view))).collect(),
        bad_views: solved.bad_views.iter().map(|(view, bad)| bad_view(name_of(*view), bad)).collect(),
        bad_corners: solved
            .bad_corners
            .iter()
            .map(|bad| BadCornerObject {
                view: name_of(bad.view),
                point: camera.views[bad.view].names[bad.point].clone(),
                residual_px: bad.residual_px.map(Into::into),
            })
            .collect(),
        target_shape: solved.target_shape.map(|([stretch, bend_x_m, bend_y_m], _)| TargetShapeObject {
            stretch,
            bend_x_m: Some(bend_x_m).filter(|[_, sigma]| 0.0 < *sigma),
            bend_y_m: Some(bend_y_m).filter(|[_, sigma]| 0.0 < *sigma),
        }),
        coverage: CoverageObject {
            columns: solved.coverage.columns,
            rows: solved.coverage.rows,
            counts: solved.coverage.counts.clone(),
            share: solved.coverage.share(),
        },
        projection: ProjectionObject {
            columns: solved.projection.columns,
            rows: solved.projection.rows,
            sigma_px: solved.projection.places.iter().map(|place| place.sigma_px).collect(),
            rms_px: solved.projection.rms_px(),
        },
        held_out: solved.held_out.map(|held| HeldOutObject {
            rms_px: held.rms_px,
            with_all_px: held.with_all_px,
            p: held.p,
        }),
        next_view: solved.next_view.map(|next| next_view(&next, size)),
    }
}

fn tried(solved: &SolvedIntrinsics) -> Vec<TriedObject> {
    let object = |one: &crate::core::multiview::intrinsics::Evidence| TriedObject {
        model: one.choice.label(),
        rms_px: one.rms_px.filter(|px| px.is_finite()),
        aic: one.aic,
        undetermined: one.undetermined.map(|(name, _)| name),
    };
    solved.tried.iter().map(object).collect()
}

fn view_object(view: &IntrinsicsView, name: String) -> IntrinsicsViewObject {
    IntrinsicsViewObject {
        view: name,
        n_corners: view.residuals.len(),
        rms_px: view.rms_px,
        cam_from_target: view.cam_from_target.into(),
        covariance: crate::answer::rows(&view.covariance),
        residuals_px: view.residuals.iter().map(|(p, e)| [p.x, p.y, e.x, e.y]).collect(),
    }
}

fn bad_view(view: String, bad: &BadView) -> BadViewObject {
    let reason = match bad {
        BadView::Scatters { rms_px, needed_px } => format!(
            "its corners scatter by {rms_px:.2} px, {needed_px:.2} px or less are expected; blurred, moving, or another camera's"
        ),
        BadView::GrossErrors { n, of } => format!("{n} of its {of} corners are gross errors"),
    };
    BadViewObject { view, reason }
}

fn next_view(next: &NextView, size: ImageSize) -> NextViewObject {
    let Placement { centre, tilt_rad, axis_rad, .. } = next.placement;
    NextViewObject {
        centre_px: centre.into(),
        tilt_rad,
        axis_rad,
        distance_m: next.distance_m,
        now_px: next.now_px,
        then_px: next.then_px,
        message: next_view_words(next, size),
    }
}

/// Describes a recommended view, and what it gains, in a sentence.
pub(crate) fn next_view_words(next: &NextView, size: ImageSize) -> String {
    format!(
        "{}, {:.2} m away: the projection's uncertainty falls from {:.3} to {:.3} px",
        placed(&next.placement, size),
        next.distance_m,
        next.now_px,
        next.then_px
    )
}

/// Says where to put a target in the image, and how to tilt it.
pub(crate) fn placed(placement: &Placement, size: ImageSize) -> String {
    let part = |x: f64, side: u32, names: [&'static str; 3]| {
        let part = x / f64::from(side.max(1));
        if part < 0.35 {
            names[0]
        } else if part < 0.65 {
            names[1]
        } else {
            names[2]
        }
    };
    let place = match (
        part(placement.centre.y, size.height_px, ["top", "middle", "bottom"]),
        part(placement.centre.x, size.width_px, ["left", "middle", "right"]),
    ) {
        ("middle", "middle") => "in the middle".to_string(),
        ("middle", side) | (side, "middle") => format!("at the {side}"),
        (vertical, horizontal) => format!("at the {vertical} {horizontal}"),
    };
    let tilt = match placement.tilt_rad {
        0.0 => "facing the camera".to_string(),
        tilt => {
            format!("tilted by {:.0}° with its {} nearer", tilt.to_degrees(), nearer(placement.axis_rad))
        }
    };
    format!("put the target {place} of the image, {tilt}")
}

/// Returns the part of a target that a tilt about this axis moves towards the camera: the direction (sin, −cos) of the image.
fn nearer(axis_rad: f64) -> &'static str {
    const PARTS: [&str; 8] = [
        "top edge",
        "top right corner",
        "right edge",
        "bottom right corner",
        "bottom edge",
        "bottom left corner",
        "left edge",
        "top left corner",
    ];
    let eighths = (axis_rad / std::f64::consts::FRAC_PI_4).round() as i64;
    PARTS[eighths.rem_euclid(8) as usize]
}
