//! A rig with names: what commands, files and reports say about cameras, views and targets.

use crate::core::rig::{RigProblem, RigSolution, Sighting};
use crate::core::{Camera, Target};
use crate::formats::NamedCamera;

/// A target as the user gave it.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedTarget {
    /// Its name.
    pub name: String,
    /// Its points; none when they came with the detections.
    pub target: Option<Target>,
    /// The body it is fixed to, index.
    pub body: usize,
}

/// Cameras, views, targets and sightings in one canonical order: by name, so that the order of files does not matter.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedRig {
    /// The cameras, sorted by name.
    pub cameras: Vec<NamedCamera>,
    /// Their lenses, in the same order: what `RigProblem` takes.
    pub lenses: Vec<Camera>,
    /// View names, in order.
    pub views: Vec<String>,
    /// The targets, sorted by name.
    pub targets: Vec<NamedTarget>,
    /// Body of each target, in the same order: what `RigProblem` takes.
    pub body_of_target: Vec<usize>,
    /// What was seen; sorted by view, camera, target.
    pub sightings: Vec<Sighting>,
}

impl NamedRig {
    /// What the solver takes.
    pub fn problem(&self) -> RigProblem<'_> {
        RigProblem {
            cameras: &self.lenses,
            body_of_target: &self.body_of_target,
            n_views: self.views.len(),
            sightings: &self.sightings,
        }
    }
}

/// A file that an answer rests on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputFile {
    /// Path as given.
    pub path: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
}

/// An answer with everything needed to report it.
#[derive(Debug, Clone, PartialEq)]
pub struct RigRun {
    /// The question.
    pub rig: NamedRig,
    /// The answer.
    pub solution: RigSolution,
    /// The files read.
    pub inputs: Vec<InputFile>,
    /// The exact command line.
    pub command: String,
}
