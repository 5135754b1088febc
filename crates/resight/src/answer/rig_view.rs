//! A rig as a viewer needs it, read from the answer of `resight rig --json`, from rig and camera files of any format, or from both.
//!
//! The answer holds poses, counts and reasons; a rig file holds the lenses. Cameras of both are matched by their names.

mod cameras;
mod read;
mod tables;

use super::Status;
use crate::FileError;
use crate::core::Point;
use crate::report::words::counted;
use crate::scene::geometry;
use cameras::RigCamera;
use read::{Answer, Placed, RejectedRow, Source};
use schemars::JsonSchema;
use serde::Serialize;
use tables::{PairRow, TargetPlace, ViewRow};

/// Largest number of cameras in one view; a larger rig is shown in parts.
const MOST_CAMERAS: usize = 1000;

/// What a viewer of a rig shows: metres, radians, the frame of the rig. Null where the files do not state it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RigView {
    /// Whether the rig may be relied on; rig files without a status have none.
    status: Option<Status>,
    /// In a sentence.
    message: String,
    /// What contradicts, and the likely cause.
    contradiction: Option<String>,
    /// The frame of the rig: a camera's name, or another frame's.
    reference: String,
    /// What is unusual about the files.
    remarks: Vec<String>,
    rms_px: Option<f64>,
    n_views: Option<usize>,
    n_seen: Option<usize>,
    n_used: Option<usize>,
    /// The centre of everything and its reach: what a viewer shows first.
    centre_m: [f64; 3],
    radius_m: f64,
    /// Length of the axes of the rig and depth of the cameras' fields of view, chosen for the eye.
    axis_m: f64,
    /// By which viewers multiply the ellipsoids: 1, 2 or 5 times a power of ten.
    ellipsoid_magnification: f64,
    cameras: Vec<RigCamera>,
    /// Targets where they stood; evenly one in `targets_one_in`.
    targets: Vec<TargetPlace>,
    targets_one_in: usize,
    /// One a view, with a cell for every camera; those with the smallest share of points used where there are too many.
    views: Vec<ViewRow>,
    pairs: Vec<PairRow>,
    /// Pairs left out of `pairs`.
    n_pairs_left_out: usize,
    /// What took no part: whole frames and observations first, then points by their residuals, the largest first.
    rejected: Vec<RejectedRow>,
    /// What is left out of `rejected`.
    n_rejected_left_out: usize,
    /// Of the answer: how large targets are against their stated sizes.
    scale: Option<String>,
}

/// Builds the view of a rig; each file is given as a name and its text.
///
/// # Errors
/// What is wrong with a file: no rig, two answers, two cameras of one name, numbers that no rig has.
pub fn rig_view(files: &[(&str, &str)]) -> Result<RigView, FileError> {
    let source = Source::read(files)?;
    let lenses = source.lenses()?;
    let view = match &source.answer {
        Some((name, answer)) => of_answer(name, answer, &lenses, source.warnings()),
        None => of_files(&lenses, source.warnings()),
    }?;
    match view.cameras.len() {
        n if MOST_CAMERAS < n => {
            let reason = format!("{n} cameras; {MOST_CAMERAS} are shown at most: give it in parts");
            Err(FileError::new(source.name(), reason))
        }
        _ => Ok(view),
    }
}

/// Builds the view from an answer, with the lenses that rig files add.
fn of_answer(
    name: &str,
    answer: &Answer,
    lenses: &read::Lenses,
    mut remarks: Vec<String>,
) -> Result<RigView, FileError> {
    let fault = |reason: String| FileError::new(name, reason);
    let placed = answer.placed().map_err(fault)?;
    let targets = tables::targets(answer).map_err(fault)?;
    let stage = Stage::around(placed.iter().map(|one| one.origin_in_rig()), &targets.places);
    let has_lens = |camera: &&Placed| lenses.of(&camera.name).is_some();
    match placed.iter().filter(has_lens).count() {
        0 if !placed.is_empty() => {
            remarks
                .push("The answer holds no lenses: give the rig file too to see the fields of view.".into());
        }
        n if n < placed.len() => {
            remarks.push(format!("The files given have no lens of {}.", counted(placed.len() - n, "camera")));
        }
        _ => {}
    }
    let magnification = cameras::magnification(&placed, stage.radius_m);
    let (rejected, n_rejected_left_out) = tables::rejected(answer);
    let (pairs, n_pairs_left_out) = tables::pairs(answer).map_err(fault)?;
    Ok(RigView {
        status: Some(answer.status),
        message: answer.message.clone(),
        contradiction: answer.contradiction.clone(),
        reference: answer.reference.clone().unwrap_or_default(),
        remarks,
        rms_px: answer.rms_px,
        n_views: answer.n_views,
        n_seen: answer.n_seen,
        n_used: answer.n_used,
        cameras: placed.iter().map(|one| one.object(lenses, &stage)).collect(),
        targets: targets.shown,
        targets_one_in: targets.one_in,
        views: tables::views(answer),
        pairs,
        n_pairs_left_out,
        rejected,
        n_rejected_left_out,
        scale: answer.scale.as_ref().map(|scale| scale.message.clone()).filter(|text| !text.is_empty()),
        ..RigView::empty(&stage, magnification)
    })
}

/// Builds the view from rig files alone.
fn of_files(lenses: &read::Lenses, mut remarks: Vec<String>) -> Result<RigView, FileError> {
    let (reference, placed, unplaced) = lenses.placed()?;
    let stage = Stage::around(placed.iter().map(|one| one.origin_in_rig()), &[]);
    if !unplaced.is_empty() {
        remarks.push(format!("No pose joins these to the frame {reference}: {}.", unplaced.join(", ")));
    }
    let magnification = cameras::magnification(&placed, stage.radius_m);
    let n = placed.len();
    Ok(RigView {
        status: lenses.contradiction.as_ref().map(|_| Status::Inconsistent),
        message: format!(
            "{n} camera{} of a rig file, in the frame {reference}.",
            if n == 1 { "" } else { "s" }
        ),
        contradiction: lenses.contradiction.clone(),
        reference,
        remarks,
        cameras: placed.iter().map(|one| one.object(lenses, &stage)).collect(),
        ..RigView::empty(&stage, magnification)
    })
}

impl RigView {
    fn empty(stage: &Stage, ellipsoid_magnification: f64) -> Self {
        RigView {
            status: None,
            message: String::new(),
            contradiction: None,
            reference: String::new(),
            remarks: Vec::new(),
            rms_px: None,
            n_views: None,
            n_seen: None,
            n_used: None,
            centre_m: stage.centre.into(),
            radius_m: stage.radius_m,
            axis_m: stage.depth_m,
            ellipsoid_magnification,
            cameras: Vec::new(),
            targets: Vec::new(),
            targets_one_in: 1,
            views: Vec::new(),
            pairs: Vec::new(),
            n_pairs_left_out: 0,
            rejected: Vec::new(),
            n_rejected_left_out: 0,
            scale: None,
        }
    }
}

/// What everything is drawn on.
struct Stage {
    centre: Point,
    radius_m: f64,
    depth_m: f64,
}

impl Stage {
    fn around(cameras: impl Iterator<Item = Point>, targets: &[Point]) -> Self {
        let extent = geometry::extent_of(&cameras.collect::<Vec<_>>(), targets.to_vec());
        let depth_m = geometry::pyramid_depth_m(&extent);
        Stage { centre: extent.centre, radius_m: extent.radius_m, depth_m }
    }
}
