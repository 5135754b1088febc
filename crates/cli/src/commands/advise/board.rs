//! A rig: where should the next board go?

use super::read::poses;
use super::say::{doubts, say};
use super::{Advise, CriterionName};
use crate::output::Outcome;
use anyhow::{Context, Result, bail};
use resight::advise::maps::BoardMaps;
use resight::advise::words::{sigma_m, sigma_rad};
use resight::answer::TransformObject;
use resight::core::Pose;
use resight::core::advise::board::{
    CameraOutlook, Criterion, RigCamera, RigInformation, RigPlan, Suggestion,
};
use resight::core::advise::volume::Shape;
use resight::formats::{NamedCamera, pose_between};
use serde::Serialize;
use std::collections::BTreeMap;

/// Places tried for each board.
const TRIED: usize = 3000;

#[derive(Serialize)]
struct CameraObject {
    determined: bool,
    sigma_place_m: f64,
    sigma_rotation_rad: f64,
}

#[derive(Serialize)]
struct Now {
    kind: &'static str,
    n_views: usize,
    reference: String,
    cameras: BTreeMap<String, CameraObject>,
}

#[derive(Serialize)]
struct Next<'a> {
    kind: &'static str,
    rank: usize,
    rig_from_target: TransformObject,
    centre_in_rig_m: [f64; 3],
    seen_by: Vec<&'a str>,
    cameras: BTreeMap<String, CameraObject>,
    holds: bool,
    doubts: Vec<String>,
}

struct Rig<'a> {
    args: &'a Advise,
    names: Vec<String>,
    plan: RigPlan<'a>,
}

/// See `Advise`.
pub fn run(args: &Advise, cameras: &[NamedCamera]) -> Result<Outcome> {
    for camera in cameras {
        super::must_have_image(&camera.camera, &format!("{}#{}", args.camera, camera.name))?;
    }
    let target = args.target()?;
    let distance_m =
        args.distance_m.context("--distance-m A..B is needed: how far from the cameras boards are held")?;
    let reference = reference(args, cameras)?;
    let placed = placed(args, cameras, reference)?;
    let shape = Shape::of(&target);
    let plan = RigPlan { cameras: &placed, reference, board: &shape, sigma_px: args.sigma_px };
    let names = cameras.iter().map(|c| c.name.clone()).collect();
    let views = match &args.views {
        Some(path) => poses(path, &["rig_from_target", "rig_from_body", "rig_from_board"])?,
        None => Vec::new(),
    };
    Rig { args, names, plan }.answer(&views, distance_m)
}

fn reference(args: &Advise, cameras: &[NamedCamera]) -> Result<usize> {
    let Some(name) = &args.reference else { return Ok(0) };
    cameras.iter().position(|c| c.name == *name).with_context(|| {
        let names: Vec<&str> = cameras.iter().map(|c| c.name.as_str()).collect();
        format!("--reference {name}: no such camera; there are {}", names.join(", "))
    })
}

/// Every camera in the frame of the reference.
fn placed<'a>(args: &Advise, cameras: &'a [NamedCamera], reference: usize) -> Result<Vec<RigCamera<'a>>> {
    let name = &cameras[reference].name;
    let one = |c: &'a NamedCamera| {
        let cam_from_rig =
            if c.name == *name { Some(Pose::identity()) } else { pose_between(cameras, &c.name, name) };
        let cam_from_rig = cam_from_rig.with_context(|| {
            format!(
                "{}: nothing says where camera `{}` is relative to `{name}`; about is enough",
                args.camera, c.name
            )
        })?;
        Ok(RigCamera { camera: &c.camera, cam_from_rig })
    };
    cameras.iter().map(one).collect()
}

impl Rig<'_> {
    fn answer(&self, views: &[Pose], distance_m: [f64; 2]) -> Result<Outcome> {
        let (mut so_far, mut used) = (RigInformation::nothing(&self.plan), Vec::new());
        for (n, view) in views.iter().enumerate() {
            match self.plan.with(&so_far, view) {
                Some((information, _)) => {
                    so_far = information;
                    used.push(*view);
                }
                None => self
                    .args
                    .remark(&format!("view {}: fewer than two cameras see this board; left out", n + 1)),
            }
        }
        let start = so_far.clone();
        self.say_now(&so_far, used.len())?;
        let candidates = self.plan.candidates(distance_m, TRIED);
        if candidates.is_empty() {
            bail!(
                "no board within {} to {} m is seen by two cameras; check the distances and the rig's poses",
                distance_m[0],
                distance_m[1]
            );
        }
        let criterion = match self.args.criterion {
            CriterionName::Worst => Criterion::Worst,
            CriterionName::Trace => Criterion::Trace,
            CriterionName::Determinant => Criterion::Determinant,
        };
        let mut best = Vec::new();
        for rank in 1..=usize::from(self.args.next) {
            let found = self.plan.next(&so_far, &candidates, criterion, 1)?;
            let Some(found) = found.into_iter().next() else { break };
            self.say_next(rank, &found)?;
            best.push(found.rig_from_board);
            so_far = found.information;
        }
        self.pictures(&start, &used, &best, distance_m)?;
        Ok(Outcome::Answered)
    }

    fn cameras(&self, all: &[CameraOutlook]) -> BTreeMap<String, CameraObject> {
        let one = |c: &CameraOutlook| {
            let object = CameraObject {
                determined: c.is_determined,
                sigma_place_m: c.place_m,
                sigma_rotation_rad: c.rotation_rad,
            };
            (self.names[c.camera].clone(), object)
        };
        all.iter().map(one).collect()
    }

    fn words(&self, all: &[CameraOutlook]) -> String {
        let one = |c: &CameraOutlook| match c.is_determined {
            true => {
                format!("{} ± {} ± {}", self.names[c.camera], sigma_m(c.place_m), sigma_rad(c.rotation_rad))
            }
            false => format!("{} unknown", self.names[c.camera]),
        };
        all.iter().map(one).collect::<Vec<_>>().join("   ")
    }

    fn say_now(&self, so_far: &RigInformation, n_views: usize) -> Result<()> {
        let all = so_far.cameras().context("the views so far")?;
        let reference = self.names[self.plan.reference].clone();
        let text = format!(
            "{n_views} views, σ {} px; each camera relative to {reference}: place and rotation, worst direction\n  now   {}\n\nboards to show next, each with those before it\n",
            self.args.sigma_px,
            self.words(&all)
        );
        say(self.args.json, &Now { kind: "now", n_views, reference, cameras: self.cameras(&all) }, &text)
    }

    fn say_next(&self, rank: usize, s: &Suggestion) -> Result<()> {
        let seen_by: Vec<&str> = s.seen_by.iter().map(|i| self.names[*i].as_str()).collect();
        let centre = s.rig_from_board * self.plan.board.centre();
        let front = s.rig_from_board.rotation * self.plan.board.front_in_target;
        let doubts = doubts(&s.doubts);
        let warnings: String = doubts.iter().map(|d| format!("    ! in each camera alone: {d}\n")).collect();
        let text = format!(
            "  {rank}  centre x {:.2}  y {:.2}  z {:.2} m, front towards ({:+.2} {:+.2} {:+.2}), seen by {}\n        {}\n{warnings}",
            centre.x,
            centre.y,
            centre.z,
            front.x,
            front.y,
            front.z,
            seen_by.join(", "),
            self.words(&s.cameras)
        );
        let object = Next {
            kind: "suggestion",
            rank,
            rig_from_target: s.rig_from_board.into(),
            centre_in_rig_m: centre.into(),
            seen_by,
            cameras: self.cameras(&s.cameras),
            holds: doubts.is_empty(),
            doubts,
        };
        say(self.args.json, &object, &text)
    }

    fn pictures(
        &self,
        start: &RigInformation,
        boards: &[Pose],
        best: &[Pose],
        distance_m: [f64; 2],
    ) -> Result<()> {
        if self.args.output.is_none() {
            return Ok(());
        }
        let maps =
            BoardMaps { plan: &self.plan, so_far: start, names: &self.names, boards, best, distance_m };
        self.args.picture("next-board-above.png", Some(maps.from_above()))?;
        for (i, name) in self.names.iter().enumerate() {
            let safe: String =
                name.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
            self.args.picture(&format!("next-board-{safe}.png"), maps.over_image(i))?;
        }
        Ok(())
    }
}
