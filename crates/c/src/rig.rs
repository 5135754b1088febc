//! `resight_rig`: several cameras with known poses, and where all of them are.

use crate::answer::Answer;
use crate::call::{call, done, guarded};
use crate::message::Message;
use crate::pointer::{Out, borrowed, free, path, slice};
use crate::solve::{Points, Rows};
use crate::status::{Refusal, Status};
use resight::rig_pose::{KnownCamera, RigPoint, RigPointsView, RigPoseRequest, read_known_rig, rig_poses};
use std::ffi::{CString, c_char};
use std::ptr::null;

/// Several cameras with known poses in a common frame. It does not change: threads may share it.
pub struct Rig {
    cameras: Vec<KnownCamera>,
    names: Vec<CString>,
}

/// Reads a rig: a file with several cameras and their poses, as `resight rig -o` writes it, or of another program.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_rig_read(
    file: *const c_char,
    rig: *mut *mut Rig,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (rig, file) = unsafe { (Out::handle("rig", rig)?, path(file)?) };
        let cameras = read_known_rig(file)?;
        // A zero would end a name early.
        let name =
            |known: &KnownCamera| CString::new(known.named.name.replace('\0', " ")).unwrap_or_default();
        rig.give(Rig { names: cameras.iter().map(name).collect(), cameras });
        Ok(())
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Returns the number of cameras of a rig; 0 for null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_rig_n_cameras(rig: *const Rig) -> usize {
    // SAFETY: what callers promise of handles.
    guarded(0, || unsafe { borrowed("rig", rig) }.map_or(0, |rig| rig.names.len()))
}

/// Returns the name of a camera, which lives as long as the rig; null where there is no such camera.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_rig_camera_name(rig: *const Rig, index: usize) -> *const c_char {
    // SAFETY: what callers promise of handles.
    let name = || Some(unsafe { borrowed("rig", rig) }.ok()?.names.get(index)?.as_ptr());
    guarded(null(), || name().unwrap_or(null()))
}

/// Solves for the pose of a rig from points that any of its cameras see: the answer of `resight rig-pose`. Three points over all cameras are enough.
///
/// `cameras` (n) are the indices of the cameras that see the points. Messages name a point by its line: the row, counted from 1. Returns the status of
/// the answer; gives RESIGHT_STATUS_INVALID_ARGUMENT, and a null answer, for a camera that the rig does not have.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_rig_pose(
    rig: *const Rig,
    points: *const Points,
    cameras: *const usize,
    answer: *mut *mut Answer,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (out, rig, points) =
            unsafe { (Out::handle("answer", answer)?, borrowed("rig", rig)?, borrowed("points", points)?) };
        // SAFETY: the same, also of what is in the structure.
        let (rows, cameras) = unsafe { (points.rows()?, slice("cameras", cameras, points.n)?) };
        let views = [view_of(&rows, cameras, rig)?];
        let robust_threshold_px = points.robust_threshold_px();
        let request = RigPoseRequest { robust_threshold_px, ..RigPoseRequest::default() };
        let answer = rig_poses(&rig.cameras, &views, &request).pop().ok_or_else(Refusal::mistake)?;
        let ended = (answer.status.into(), answer.message.clone());
        out.give(Answer::of_rig_pose(answer));
        Ok(ended)
    };
    // SAFETY: the same.
    unsafe { call(message, job) }
}

/// Frees a rig; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_rig_free(rig: *mut Rig) {
    // SAFETY: what callers promise of handles.
    guarded((), || unsafe { free(rig) });
}

/// The points as a table has them.
fn view_of(given: &Rows, cameras: &[usize], rig: &Rig) -> Result<RigPointsView, Refusal> {
    let n_cameras = rig.cameras.len();
    if let Some(row) = cameras.iter().position(|camera| n_cameras <= *camera) {
        let camera = cameras[row];
        return Err(Refusal::argument(format!(
            "cameras: {camera} of point {row}; the rig has {n_cameras} cameras"
        )));
    }
    let point = |row: usize| RigPoint {
        line: row as u64 + 1,
        camera: cameras[row],
        name: row.to_string(),
        x_in_target: given.points_m[row],
        image: given.pixels[row],
        sigma_px: given.sigma_px.map(|sigma_px| sigma_px[row]),
        sigma_m: given.sigma_m.map(|sigma_m| sigma_m[row]),
    };
    let rows = (0..cameras.len()).map(point).collect();
    Ok(RigPointsView { name: given.view.to_owned(), rows, how_read: None })
}
