//! One file per command; what several share is here.

pub mod advise;
pub mod batch;
pub mod compare;
pub mod convert;
pub mod demo;
pub mod fleet_report;
pub mod detect;
pub mod explain;
pub mod georeference;
pub mod print;
pub mod history;
pub mod locate;
pub mod rig;
pub mod rig_pose;
pub mod map;
pub mod intrinsics;
pub mod pose_graph;
pub mod hand_eye;
pub mod landmarks;
pub mod measure;
pub mod solve;
pub mod vehicle;
pub mod whisker;
pub mod zones;
pub mod watch;
pub mod capture;
pub mod serve;
pub mod completions;
pub mod schema;

use crate::args::TagArgs;
use anyhow::Result;
use resight::core::Target;
use resight::formats;
use std::path::Path;

/// Reads a target, passes its warnings on and returns them.
fn target(path: &Path, tags: &TagArgs, mut remark: impl FnMut(&str)) -> Result<(Target, Vec<String>)> {
    crate::files::must_exist(path)?;
    let file = formats::read_target_with(path, &tags.options())?;
    for warning in &file.warnings {
        remark(&format!("warning: {}: {warning}", path.display()));
    }
    Ok((file.target, file.warnings))
}

/// Says that the uncertain scale of a printed target is not in what a command answers.
fn warn_of_scale(path: &Path, target: &Target, what: &str) {
    if let Some(remark) = resight::print::scale_remark(target, what) {
        crate::output::remark(&format!("warning: {}: {remark}", path.display()));
    }
}
