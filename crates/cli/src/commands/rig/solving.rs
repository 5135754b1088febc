//! The question put to the solver, and what it says, in names.

use super::LeftOut;
use anyhow::{Context, Result as Parsed, bail};
use resight::core::rig::{KnownDistance, RigConfig, SharedViews, shared_views, solve_rig};
use resight::core::{Error, rig};
use resight::rig::gather::Gathered;
use resight::rig::relative::{InWorld, in_world};
use resight::rig::{InputFile, NamedRig, RigRun};

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
pub fn solve(
    gathered: Gathered,
    reference: usize,
    known_distances: &[KnownDistance],
    inputs: Vec<InputFile>,
) -> Result<Solved, Unsolved> {
    let Gathered { rig, taken_in, points, world_view } = gathered;
    let names: Vec<String> = rig.cameras.iter().map(|camera| camera.name.clone()).collect();
    let shared = shared_views(&rig.problem());
    if 1 < shared.groups.len() {
        return Err(falls_apart(&shared, &names));
    }
    // Poses between two cameras need what all have in common.
    let config = RigConfig { reference, joint_covariance: true, known_distances, ..RigConfig::default() };
    let failed = |reason: Error| {
        let message = in_names(&reason, &rig, &points);
        Unsolved { status: "error", message, groups: Vec::new() }
    };
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

/// `A,B,METRES,SIGMA`, in the order of the cameras' names.
pub fn known_distances(arguments: &[String], gathered: &Gathered) -> Parsed<Vec<KnownDistance>> {
    let mut distances =
        arguments.iter().map(|argument| known_distance(argument, gathered)).collect::<Parsed<Vec<_>>>()?;
    distances.sort_by(|x, y| (x.a, x.b).cmp(&(y.a, y.b)).then(x.distance_m.total_cmp(&y.distance_m)));
    Ok(distances)
}

fn known_distance(argument: &str, gathered: &Gathered) -> Parsed<KnownDistance> {
    let flag = "--known-distance-m";
    let parts: Vec<&str> = argument.split(',').map(str::trim).collect();
    let [a, b, distance, sigma] = parts[..] else {
        bail!(
            "{flag} {argument}: two cameras, the distance and its standard deviation in metres are needed, e.g. left,right,0.1205,0.0002"
        )
    };
    let camera = |name: &str| {
        let names: Vec<String> = gathered.rig.cameras.iter().map(|camera| camera.name.clone()).collect();
        let found = gathered.rig.camera(name);
        found.with_context(|| {
            format!("{flag} {argument}: {}", super::named::not_among(name, "camera", &names))
        })
    };
    let length = |text: &str| {
        crate::args::positive(text).map_err(|e| anyhow::anyhow!("{flag} {argument}: `{text}`: {e}"))
    };
    let (x, y) = (camera(a)?, camera(b)?);
    if x == y {
        bail!("{flag} {argument}: these are one camera; a distance is between two");
    }
    Ok(KnownDistance { a: x.min(y), b: x.max(y), distance_m: length(distance)?, sigma_m: length(sigma)? })
}

/// A refusal of the solver, with names for numbers.
fn in_names(reason: &Error, rig: &NamedRig, points: &[Vec<String>]) -> String {
    let camera = |i: usize| rig.cameras[i].name.as_str();
    let target = |i: usize| rig.targets[i].name.as_str();
    let listed = |cameras: &[usize]| cameras.iter().map(|i| camera(*i)).collect::<Vec<_>>().join(", ");
    match reason {
        Error::CameraUnseen { camera: i, n_sightings } => format!(
            "camera {} has {n_sightings} sightings and none gives a pose; add views in which it sees a target with four or more points, or leave it out",
            camera(*i)
        ),
        Error::CamerasUnconnected { first, second, n_rejected, needed } => {
            let aside = match n_rejected {
                0 => String::new(),
                n => format!(" once {n} sightings that contradict the others or give no pose are set aside"),
            };
            format!("cameras [{}] and [{}] are not connected{aside}; {needed}", listed(first), listed(second))
        }
        Error::TargetUnconnected { target: i, .. } => format!(
            "target {} is never seen together with another target of its body; add a view in which one camera sees both, or leave --fixed-together (column body) out",
            target(*i)
        ),
        Error::InvalidSighting { camera: c, view, target: t, reason } => {
            let found = rig.sightings.iter().position(|s| (s.camera, s.view, s.target) == (*c, *view, *t));
            let reason = match (&**reason, found) {
                (Error::Coincident { first, second, where_ }, Some(i)) => {
                    let (first, second) = (&points[i][*first], &points[i][*second]);
                    format!("points {first} and {second} coincide {where_}; remove one of them")
                }
                (reason, _) => reason.to_string(),
            };
            format!("camera {}, view {}, target {}: {reason}", camera(*c), rig.views[*view], target(*t))
        }
        other => other.to_string(),
    }
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
