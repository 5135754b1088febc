//! Advice for a rig: where to show the next board.

use super::maps::BoardMaps;
use crate::Error;
use crate::answer::advise::{
    BoardAdvice, BoardSuggestion, CameraFigures, Picture, RigNow, first_order_limits,
};
use crate::answer::{SchemaNumber, Status};
use crate::core::advise::board::{CameraOutlook, Criterion, RigCamera, RigInformation, RigPlan, Suggestion};
use crate::core::advise::volume::Shape;
use crate::core::{Pose, Target};
use crate::formats::{NamedCamera, pose_between};
use std::collections::BTreeMap;

/// Number of poses tried for each board.
const TRIED: usize = 3000;

/// A question about boards.
#[derive(Debug, Clone)]
pub struct NextBoardRequest<'a> {
    /// The cameras, with approximate poses.
    pub cameras: &'a [NamedCamera],
    /// The board.
    pub target: &'a Target,
    /// Standard deviation of u and v, pixels.
    pub sigma_px: f64,
    /// rig_from_target of the boards seen so far.
    pub views: &'a [Pose],
    /// Shortest and longest distance between the cameras and a board.
    pub distance_m: [f64; 2],
    /// The camera whose frame is the frame of the rig; by default the first.
    pub reference: Option<&'a str>,
    /// What to minimise.
    pub criterion: Criterion,
    /// How many boards to plan; each is planned as if those before it had been observed.
    pub n_boards: usize,
    /// Whether to draw maps, which takes seconds.
    pub pictures: bool,
}

/// Computes where to show the next boards to a rig so that its uncertainty becomes smallest.
///
/// # Errors
/// Cameras without an image size or without poses relative to each other; distances at which no board is seen by two cameras.
pub fn advise_boards(request: &NextBoardRequest) -> Result<BoardAdvice, Error> {
    for camera in request.cameras {
        super::must_have_image(&camera.camera)
            .map_err(|reason| Error::request(format!("camera {}: {reason}", camera.name)))?;
    }
    let reference = reference(request)?;
    let rows: Vec<Option<Vec<f64>>> = request.cameras.iter().map(NamedCamera::intrinsics_rows).collect();
    let placed = placed(request, reference, &rows)?;
    let shape = Shape::of(request.target);
    let plan = RigPlan { cameras: &placed, reference, board: &shape, sigma_px: request.sigma_px };
    let names = request.cameras.iter().map(|c| c.name.clone()).collect();
    Planning { request, names, plan }.answer()
}

fn reference(request: &NextBoardRequest) -> Result<usize, Error> {
    let Some(name) = request.reference else { return Ok(0) };
    request.cameras.iter().position(|c| c.name == name).ok_or_else(|| {
        let names: Vec<&str> = request.cameras.iter().map(|c| c.name.as_str()).collect();
        Error::request(format!("--reference {name}: no such camera; there are {}", names.join(", ")))
    })
}

/// Returns all cameras with their poses in the frame of the reference camera.
fn placed<'a>(
    request: &NextBoardRequest<'a>,
    reference: usize,
    rows: &'a [Option<Vec<f64>>],
) -> Result<Vec<RigCamera<'a>>, Error> {
    let name = &request.cameras[reference].name;
    let one = |(c, rows): (&'a NamedCamera, &'a Option<Vec<f64>>)| {
        let cam_from_rig = match c.name == *name {
            true => Some(Pose::identity()),
            false => pose_between(request.cameras, &c.name, name),
        };
        let unknown = || {
            format!(
                "no file states the pose of camera `{}` relative to `{name}`; an approximate one is enough",
                c.name
            )
        };
        let cam_from_rig = cam_from_rig.ok_or_else(|| Error::request(unknown()))?;
        Ok(RigCamera { camera: &c.camera, cam_from_rig, intrinsics_covariance: rows.as_deref() })
    };
    request.cameras.iter().zip(rows).map(one).collect()
}

struct Planning<'a> {
    request: &'a NextBoardRequest<'a>,
    names: Vec<String>,
    plan: RigPlan<'a>,
}

impl Planning<'_> {
    fn answer(&self) -> Result<BoardAdvice, Error> {
        let mut remarks = Vec::new();
        let (mut so_far, mut used) = (RigInformation::nothing(&self.plan), Vec::new());
        for (n, view) in self.request.views.iter().enumerate() {
            match self.plan.with(&so_far, view) {
                Some((information, _)) => {
                    so_far = information;
                    used.push(*view);
                }
                None => {
                    remarks.push(format!("view {}: fewer than two cameras see this board; left out", n + 1));
                }
            }
        }
        let (start, now) = (so_far.clone(), self.now(&so_far, used.len())?);
        let [nearest_m, farthest_m] = self.request.distance_m;
        let candidates = self.plan.candidates(self.request.distance_m, TRIED);
        if candidates.is_empty() {
            return Err(Error::request(format!(
                "no board within {nearest_m} to {farthest_m} m is seen by two cameras; check the distances and the rig's poses"
            )));
        }
        let (mut suggestions, mut best) = (Vec::new(), Vec::new());
        for rank in 1..=self.request.n_boards {
            let found = self.plan.next(&so_far, &candidates, self.request.criterion, 1)?;
            let Some(found) = found.into_iter().next() else { break };
            suggestions.push(self.suggestion(rank, &found));
            best.push(found.rig_from_board);
            so_far = found.information;
        }
        let pictures = self.pictures(&start, &used, &best);
        Ok(BoardAdvice { now, suggestions, remarks, pictures })
    }

    fn cameras(&self, all: &[CameraOutlook]) -> BTreeMap<String, CameraFigures> {
        let one = |c: &CameraOutlook| {
            let figures = CameraFigures {
                determined: c.is_determined,
                sigma_position_m: c.position_m,
                sigma_position_exact_intrinsics_m: c.position_exact_intrinsics_m,
                sigma_rotation_rad: c.rotation_rad,
            };
            (self.names[c.camera].clone(), figures)
        };
        all.iter().map(one).collect()
    }

    fn now(&self, so_far: &RigInformation, n_views: usize) -> Result<RigNow, Error> {
        let all = so_far.cameras().ok_or_else(|| {
            Error::request("the views so far contradict each other: their information is no covariance")
        })?;
        let is_determined = all.iter().all(|camera| camera.is_determined);
        Ok(RigNow {
            schema: SchemaNumber,
            kind: "now",
            status: if is_determined { Status::Ok } else { Status::Degenerate },
            n_views,
            reference: self.names[self.plan.reference].clone(),
            cameras: self.cameras(&all),
        })
    }

    fn suggestion(&self, rank: usize, s: &Suggestion) -> BoardSuggestion {
        let first_order_limits = first_order_limits(&s.first_order_limits);
        BoardSuggestion {
            schema: SchemaNumber,
            kind: "suggestion",
            status: if first_order_limits.is_empty() { Status::Ok } else { Status::Degenerate },
            rank,
            rig_from_target: s.rig_from_board.into(),
            centre_in_rig_m: (s.rig_from_board * self.plan.board.centre()).into(),
            front_in_rig: (s.rig_from_board.rotation * self.plan.board.front_in_target).into(),
            seen_by: s.seen_by.iter().map(|i| self.names[*i].clone()).collect(),
            cameras: self.cameras(&s.cameras),
            first_order_valid: first_order_limits.is_empty(),
            first_order_limits,
        }
    }

    fn pictures(&self, start: &RigInformation, boards: &[Pose], best: &[Pose]) -> Vec<Picture> {
        if !self.request.pictures {
            return Vec::new();
        }
        let maps = BoardMaps {
            plan: &self.plan,
            so_far: start,
            names: &self.names,
            boards,
            best,
            distance_m: self.request.distance_m,
        };
        let safe = |name: &str| -> String {
            name.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect()
        };
        let over = self.names.iter().enumerate();
        let over = over.map(|(i, name)| (format!("next-board-{}.png", safe(name)), maps.over_image(i)));
        super::drawn([("next-board-above.png".to_owned(), Some(maps.from_above()))].into_iter().chain(over))
    }
}
