//! `resight_solve`: known points to a pose.

use crate::answer::Answer;
use crate::call::call;
use crate::camera::Camera;
use crate::message::Message;
use crate::pointer::{Out, borrowed, optional_text, rows, slice};
use crate::status::{Refusal, Status};
use resight::locate::{PointRows, PointsOptions};
use resight::points::unit_and_sigma;
use std::ffi::c_char;

/// Points in the target frame and where they were seen, row by row.
#[repr(C)]
pub struct Points {
    /// Number of points: rows of each array.
    pub n: usize,
    /// Positions in the target frame (n, 3), m.
    pub points_m: *const f64,
    /// Where they were seen (n, 2), px; pixel (0, 0) is the centre of the top-left pixel. For resight_solve a row of two NaN is a point that was
    /// not observed.
    pub pixels: *const f64,
    /// Standard deviation of each pixel's u and v (n), px; null: 0.5 px. All image coordinates of a photogrammetric camera are in the unit of its
    /// f; null: f / 2000.
    pub sigma_px: *const f64,
    /// Standard deviation of each position's x, y and z (n), m; null: exact.
    pub sigma_m: *const f64,
    /// Where some points may be wrong, the largest distance of one that agrees with the pose, px; 0 where every point is trusted.
    pub robust_threshold_px: f64,
    /// What the points are called in the answer; null for no name.
    pub view: *const c_char,
}

/// The arrays of `Points`.
pub(crate) struct Rows<'a> {
    pub points_m: &'a [[f64; 3]],
    pub pixels: &'a [[f64; 2]],
    pub sigma_px: Option<&'a [f64]>,
    pub sigma_m: Option<&'a [f64]>,
    pub view: &'a str,
}

impl Points {
    /// # Safety
    /// What callers promise of the pointers in it.
    pub(crate) unsafe fn rows(&self) -> Result<Rows<'_>, Refusal> {
        let n = self.n;
        // SAFETY: the caller's promise.
        let optional = |name, pointer: *const f64| match pointer.is_null() {
            true => Ok(None),
            // SAFETY: the caller's promise.
            false => unsafe { slice(name, pointer, n) }.map(Some),
        };
        // SAFETY: the caller's promise.
        let (points_m, pixels, view) = unsafe {
            (
                rows("points_m", self.points_m, n)?,
                rows("pixels", self.pixels, n)?,
                optional_text("view", self.view)?.unwrap_or_default(),
            )
        };
        let (sigma_px, sigma_m) = (optional("sigma_px", self.sigma_px)?, optional("sigma_m", self.sigma_m)?);
        Ok(Rows { points_m, pixels, sigma_px, sigma_m, view })
    }

    pub(crate) fn robust_threshold_px(&self) -> Option<f64> {
        Some(self.robust_threshold_px).filter(|threshold_px| *threshold_px != 0.0)
    }
}

/// Solves for the pose of a camera from known points: four are enough, three have several poses.
///
/// Returns the status of the answer. Gives RESIGHT_STATUS_INVALID_ARGUMENT, and a null answer, where a pixel is outside the field of the lens or
/// half missing. `points` are only read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_solve(
    camera: *const Camera,
    points: *const Points,
    answer: *mut *mut Answer,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (out, camera, points) = unsafe {
            (Out::handle("answer", answer)?, borrowed("camera", camera)?, borrowed("points", points)?)
        };
        // SAFETY: what callers promise of the pointers in their structures.
        let rows = unsafe { points.rows() }?;
        let (answer, residuals_px) = solved(camera, &rows, points.robust_threshold_px())?;
        let ended = (answer.status().into(), answer.verdict.message.clone());
        out.give(Answer::of_pose(answer, &[], residuals_px));
        Ok(ended)
    };
    // SAFETY: the same.
    unsafe { call(message, job) }
}

fn solved(
    camera: &Camera,
    rows: &Rows,
    robust_threshold_px: Option<f64>,
) -> Result<(resight::PoseAnswer, Vec<[f64; 2]>), Refusal> {
    let (n, lens) = (rows.points_m.len(), &camera.known.camera);
    let (image_unit, assumed_sigma) = unit_and_sigma(lens);
    let (assumed, exact) = (vec![assumed_sigma; n], vec![0.0; n]);
    let given = PointRows {
        points_m: rows.points_m,
        pixels: rows.pixels,
        sigma_px: rows.sigma_px.unwrap_or(&assumed),
        sigma_m: rows.sigma_m.unwrap_or(&exact),
        names: None,
    };
    let seen = given.seen(lens).map_err(|fault| Refusal::argument(fault.message))?;
    let options = PointsOptions {
        intrinsics: camera.intrinsics(),
        robust_threshold_px,
        image_unit,
        ..PointsOptions::default()
    };
    let mut answer = seen.locate(rows.view, lens, &options);
    answer.remarks.extend(camera.remarks.iter().cloned());
    let pose = answer.estimate.as_ref().map(|e| e.cam_from_target);
    let residuals_px = pose.map_or_else(Vec::new, |pose| seen.residuals_px(lens, &pose));
    Ok((answer, residuals_px))
}
