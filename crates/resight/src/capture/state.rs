//! A capture while it runs: what a page shows.

use super::{Capture, words};
use crate::answer::Status;
use crate::answer::capture::{CaptureStateObject, CaptureStepObject};
use crate::answer::intrinsics::{CameraIntrinsics, CoverageObject, ParameterObject};
use crate::core::multiview::intrinsics::Coverage;

/// Parameters that the line of a kept view states.
pub const MATRIX: [&str; 4] = ["fx_px", "fy_px", "cx_px", "cy_px"];

impl Capture {
    /// Returns how everything is now.
    pub fn state(&self) -> CaptureStateObject {
        let progress = self.progress();
        let (status, message) = match self.camera() {
            Some(camera) => (words::status(camera, &progress), words::headline(camera, &progress)),
            None => (Status::NotFound, self.before_the_first()),
        };
        let found = self.camera().and_then(|camera| camera.intrinsics.as_ref());
        let missing = if self.kept.is_empty() { Vec::new() } else { progress.missing() };
        CaptureStateObject {
            status,
            message,
            is_usable: self.camera().is_some_and(CameraIntrinsics::is_reliable),
            missing,
            n_frames: self.n_frames,
            refused: self.refused(),
            remarks: self.remarks(),
            size_px: self.size.map(|size| [size.width_px, size.height_px]),
            last: self.last.clone(),
            model: found.map(|found| found.model),
            parameters: found.map(|found| found.parameters.clone()),
            progress,
            coverage: found.map(|found| found.coverage.clone()).or_else(|| self.coverage().map(of_cells)),
            next_view: self.next_view(),
            views: self.steps.clone(),
        }
    }

    fn before_the_first(&self) -> String {
        match &self.instead {
            Some(instead) => format!("no target was found yet; {instead}"),
            None if self.n_frames == 0 => "no image came yet".to_string(),
            None => "no view is kept yet".to_string(),
        }
    }

    /// Returns the last kept view with what is known now.
    pub(super) fn step(&self) -> Option<CaptureStepObject> {
        let (kept, progress) = (self.kept.last()?, self.progress());
        let matrix = |all: &[ParameterObject]| -> Vec<ParameterObject> {
            all.iter().filter(|p| MATRIX.contains(&p.name)).cloned().collect()
        };
        let found = self.camera().and_then(|camera| camera.intrinsics.as_ref());
        Some(CaptureStepObject {
            view: kept.view.clone(),
            frame: kept.frame.clone(),
            n_points: self.views().last().map_or(0, <[_]>::len),
            parameters: found.map(|found| matrix(&found.parameters)),
            worst_px: progress.worst_px,
            coverage_share: progress.coverage_share,
        })
    }
}

fn of_cells(coverage: Coverage) -> CoverageObject {
    let share = coverage.share();
    CoverageObject { columns: coverage.columns, rows: coverage.rows, counts: coverage.counts, share }
}
