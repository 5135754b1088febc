//! The question put to the solver, and what it says, in names.

use super::LeftOut;
use resight::core::rig::{RigConfig, SharedViews, shared_views, solve_rig};
use resight::core::{Error, rig};
use resight::rig::gather::Gathered;
use resight::rig::relative::{InWorld, in_world};
use resight::rig::{InputFile, RigRun};

/// A rig, solved.
pub struct Solved {
    /// Question, answer, files and command line.
    pub run: RigRun,
    /// For each sighting the view it was taken in.
    pub taken_in: Vec<String>,
    /// For each sighting the names of its points.
    pub points: Vec<Vec<String>>,
    /// Where the rig stands in the frame of the target at rest.
    pub in_world: Option<InWorld>,
    /// Name of that target.
    pub world_target: Option<String>,
    /// What took no part from the beginning.
    pub left_out: Vec<LeftOut>,
    /// Frames that no other camera has a counterpart of.
    pub n_alone: usize,
}

/// Why there is no rig.
pub struct Unsolved {
    /// `not_connected` or `error`.
    pub status: &'static str,
    /// What is wrong and what would help.
    pub message: String,
    /// Cameras by group, where they fall apart.
    pub groups: Vec<Vec<String>>,
}

/// Checks that shared views join the cameras, then solves.
pub fn solve(gathered: Gathered, reference: usize, inputs: Vec<InputFile>) -> Result<Solved, Unsolved> {
    let Gathered { rig, taken_in, points, world_view } = gathered;
    let names: Vec<String> = rig.cameras.iter().map(|camera| camera.name.clone()).collect();
    let shared = shared_views(&rig.problem());
    if 1 < shared.groups.len() {
        return Err(falls_apart(&shared, &names));
    }
    // Poses between two cameras need what all have in common.
    let config = RigConfig { reference, joint_covariance: true, ..RigConfig::default() };
    let failed =
        |reason: Error| Unsolved { status: "error", message: in_names(&reason, &names), groups: Vec::new() };
    let solution = solve_rig(&rig.problem(), &config).map_err(failed)?;
    let in_world = world_view
        .map(|view| in_world(&rig.problem(), &config, &solution, view))
        .transpose()
        .map_err(failed)?;
    let world_target = rig.sightings.iter().find(|s| Some(s.view) == world_view);
    let world_target = world_target.map(|s| rig.targets[s.target].name.clone());
    let run = RigRun { rig, solution, inputs, command: command_line() };
    Ok(Solved { run, taken_in, points, in_world, world_target, left_out: Vec::new(), n_alone: 0 })
}

/// A refusal of the solver, with names for numbers.
fn in_names(reason: &Error, _names: &[String]) -> String {
    reason.to_string()
}

fn falls_apart(shared: &SharedViews, names: &[String]) -> Unsolved {
    let of_group = |group: &Vec<usize>| group.iter().map(|camera| names[*camera].clone()).collect();
    let groups: Vec<Vec<String>> = shared.groups.iter().map(of_group).collect();
    let blind: Vec<&str> =
        (0..names.len()).filter(|i| shared.counts[*i][*i] == 0).map(|i| names[i].as_str()).collect();
    let said: Vec<String> = groups.iter().map(|group| group.join(", ")).collect();
    let blind = match &blind[..] {
        [] => String::new(),
        [only] => format!("; camera {only} saw nothing at all"),
        several => format!("; cameras {} saw nothing at all", several.join(", ")),
    };
    let message = format!(
        "nothing connects the cameras {}{blind}; add views in which a camera of one group and a camera of another see the same target at the same time (a chain is enough), or, for targets that are mounted together, say --fixed-together",
        said.iter().map(|group| format!("[{group}]")).collect::<Vec<_>>().join(" and ")
    );
    Unsolved { status: "not_connected", message, groups }
}

/// The command line as a shell would take it again.
fn command_line() -> String {
    let quoted = |argument: String| {
        let is_plain = |c: char| c.is_alphanumeric() || "-_./=:,#+@%".contains(c);
        match !argument.is_empty() && argument.chars().all(is_plain) {
            true => argument,
            false => format!("'{}'", argument.replace('\'', "'\\''")),
        }
    };
    let arguments =
        std::env::args_os().skip(1).map(|argument| quoted(argument.to_string_lossy().into_owned()));
    std::iter::once("resight".to_string()).chain(arguments).collect::<Vec<_>>().join(" ")
}

/// Whether a sighting took no part, in words.
pub fn rejection(reason: &rig::RejectedSighting) -> String {
    match reason {
        rig::RejectedSighting::Undetermined(error) => error.to_string(),
        rig::RejectedSighting::Contradicts { rms_px } => format!(
            "contradicts the other sightings (rms {rms_px:.1} px): wrong labels, a moved target or another moment"
        ),
        _ => "took no part".to_string(),
    }
}
