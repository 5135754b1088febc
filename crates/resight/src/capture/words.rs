//! What became of a frame, and the progress of a capture, in sentences.

use super::{Capture, FrameUse, LEAST_GAIN, LEAST_VIEWS};
use crate::answer::Status;
use crate::answer::capture::{LookObject, ProgressObject};
use crate::answer::intrinsics::CameraIntrinsics;
use crate::core::multiview::intrinsics::{GOOD_COVERAGE, LEAST_POINTS};
use crate::report::words::counted;
use std::collections::BTreeMap;

/// More further views are not predicted: the uncertainty of few views is mostly that of the lens model, which does not fall in proportion.
const MOST_FORETOLD: f64 = 50.0;

impl FrameUse {
    /// Returns the word for a frame that is not kept, in JSON.
    pub fn refusal(&self) -> Option<&'static str> {
        match self {
            FrameUse::Kept { .. } => None,
            FrameUse::NotFound => Some("not_found"),
            FrameUse::Unusable { .. } => Some("unusable"),
            FrameUse::FewPoints { .. } => Some("few_points"),
            FrameUse::OtherSize { .. } => Some("other_size"),
            FrameUse::Moving { .. } => Some("moving"),
            FrameUse::First => Some("first"),
            FrameUse::Alike { .. } => Some("alike"),
            FrameUse::SameTilt { .. } => Some("same_tilt"),
            FrameUse::TakenBack { .. } => Some("taken_back"),
            FrameUse::LittleNew { .. } => Some("little_new"),
            FrameUse::Full { .. } => Some("full"),
        }
    }

    /// Returns what became of the frame, in a sentence.
    pub fn message(&self) -> String {
        match self {
            FrameUse::Kept { view, gain: None } => format!("kept as {view}"),
            FrameUse::Kept { view, gain: Some(gain) } => {
                format!("kept as {view}: it lowers the projection's uncertainty by {:.0} %", 100.0 * gain)
            }
            FrameUse::NotFound => "the target is not found: show all of it, sharp and evenly lit".to_string(),
            FrameUse::Unusable { reason } => reason.clone(),
            FrameUse::FewPoints { n } => {
                format!("{} found, {LEAST_POINTS} are needed: show more of the target", counted(*n, "point"))
            }
            FrameUse::OtherSize { size, first } => format!(
                "the image has {} × {} px, the first one {} × {} px: it takes no part",
                size.width_px, size.height_px, first.width_px, first.height_px
            ),
            FrameUse::Moving { px, allowed_px } => format!(
                "the target moves by {px:.1} px from frame to frame, {allowed_px:.1} px at most are sharp: hold it still"
            ),
            FrameUse::First => "hold the target still".to_string(),
            FrameUse::Alike { view, px, needed_px } => format!(
                "{view} shows the target {px:.0} px from here, {needed_px:.0} px are needed: move or tilt it"
            ),
            FrameUse::SameTilt { view } => format!(
                "{view} shows the target with the same tilt, and such views determine no camera: tilt it by 30° to 45°"
            ),
            FrameUse::TakenBack { px, needed_px } => format!(
                "a view that was taken back shows the target {px:.0} px from here, {needed_px:.0} px are needed: move or tilt it"
            ),
            FrameUse::LittleNew { gain } => format!(
                "it would lower the projection's uncertainty by {:.1} %, {:.0} % are needed: move the target to where the next view is drawn",
                100.0 * gain.max(0.0),
                100.0 * LEAST_GAIN
            ),
            FrameUse::Full { n } => format!("{n} views are kept already"),
        }
    }
}

impl Capture {
    /// Returns how far the capture has come, and how far it has to go.
    pub fn progress(&self) -> ProgressObject {
        let solved = self.solved();
        let n_used = solved.map_or(0, |solved| solved.views.len());
        let coverage_share = solved.map_or(0.0, |solved| solved.coverage.share());
        let worst_px = self.known.as_ref().and_then(|known| known.worst_px);
        let is_ok = self.camera().is_some_and(|camera| camera.status == Status::Ok);
        let is_enough = is_ok
            && LEAST_VIEWS <= n_used
            && GOOD_COVERAGE <= coverage_share
            && worst_px.is_some_and(|px| px <= self.config.enough_px);
        ProgressObject {
            is_enough,
            n_views: self.kept.len(),
            n_used,
            needed_views: LEAST_VIEWS,
            worst_px,
            needed_px: self.config.enough_px,
            coverage_share,
            needed_coverage: GOOD_COVERAGE,
        }
    }
}

impl ProgressObject {
    /// Returns what is missing, each in a clause: the number seen, the number needed.
    pub fn missing(&self) -> Vec<String> {
        let mut missing = Vec::new();
        if self.n_used < self.needed_views {
            missing.push(format!(
                "{} of {} needed: take {} more",
                counted(self.n_used, "good view"),
                self.needed_views,
                self.needed_views - self.n_used
            ));
        }
        match self.worst_px {
            None if 0 < self.n_used => missing.push(
                "the projection is not known everywhere inside the covered part of the image".to_string(),
            ),
            Some(px) if self.needed_px < px => {
                // Variances fall in proportion to the number of views.
                let more = (self.n_used as f64 * ((px / self.needed_px).powi(2) - 1.0)).ceil().max(1.0);
                let how_many = match more <= MOST_FORETOLD {
                    true => format!("about {more:.0} more views, or fewer where the next view is drawn"),
                    false => "take views where the next one is drawn".to_string(),
                };
                missing.push(format!(
                    "the projection is known to {px:.2} px at worst inside the covered part of the image, {:.2} px needed: {how_many}",
                    self.needed_px
                ));
            }
            _ => {}
        }
        if 0 < self.n_used && self.coverage_share < self.needed_coverage {
            missing.push(format!(
                "corners reach {:.0} % of the image, {:.0} % needed: go into its corners",
                100.0 * self.coverage_share,
                100.0 * self.needed_coverage
            ));
        }
        missing
    }
}

/// Returns what became of a frame.
pub(super) fn look(frame: &str, outcome: &FrameUse, n_points: usize) -> LookObject {
    let view = match outcome {
        FrameUse::Kept { view, .. } => Some(view.clone()),
        _ => None,
    };
    let (reason, message) = (outcome.refusal(), outcome.message());
    LookObject { frame: frame.to_string(), view, reason, message, n_points }
}

/// Returns the status of a capture with this camera.
pub(super) fn status(camera: &CameraIntrinsics, progress: &ProgressObject) -> Status {
    match camera.status {
        Status::Ok if !progress.is_enough => Status::Undecided,
        status => status,
    }
}

/// Returns the verdict without what is missing.
pub(super) fn headline(camera: &CameraIntrinsics, progress: &ProgressObject) -> String {
    match camera.status {
        _ if progress.is_enough => format!(
            "enough: {} know the projection to {:.2} px or better inside the covered part of the image ({:.2} px needed), and corners reach {:.0} % of it",
            counted(progress.n_used, "view"),
            progress.worst_px.unwrap_or(0.0),
            progress.needed_px,
            100.0 * progress.coverage_share
        ),
        Status::Ok => "not enough yet".to_string(),
        _ => camera.message.clone(),
    }
}

/// Returns the verdict: enough, or what is missing and why frames were not kept.
pub(super) fn verdict(
    camera: &CameraIntrinsics,
    progress: &ProgressObject,
    refused: &BTreeMap<&'static str, usize>,
    most_views: usize,
) -> String {
    let mut parts = vec![headline(camera, progress)];
    if progress.is_enough {
        return parts.remove(0);
    }
    if 0 < progress.n_views {
        parts.extend(progress.missing());
    }
    if most_views <= progress.n_views {
        parts.push(format!(
            "no more than {most_views} views are kept: improve the light, the target or the focus"
        ));
    }
    // Without any view the message of the camera says it.
    parts.extend(most_refused(refused).filter(|_| 0 < progress.n_views));
    parts.join("; ")
}

/// Names the reason for which most frames were not kept.
pub(super) fn most_refused(refused: &BTreeMap<&'static str, usize>) -> Option<String> {
    let (reason, n) = refused.iter().max_by_key(|(_, n)| **n)?;
    let (n, why) = (
        *n,
        match *reason {
            "moving" | "first" => "the target was not still; hold it still for a moment at each place",
            "alike" => "they show the target where a kept view has it; move it between views",
            "taken_back" => "they show the target where a view was taken back; move it between views",
            "same_tilt" => "they show the target with the tilt of a kept view; tilt it",
            "little_new" => "they add too little; move the target to where the next view is drawn",
            "other_size" => "they have another size than the first image; capture images of each size apart",
            "few_points" => "they show too little of the target",
            "not_found" => "the target was not found in them; show all of it, sharp and evenly lit",
            "unusable" => "they cannot be used",
            _ => return None,
        },
    );
    Some(format!("{} not kept: {why}", counted(n, "frame")))
}
