//! A record solved: one row for every reading, in order, complete or not.

use clap::ValueEnum;
use resight_whisker::contact::Method;
use resight_whisker::estimate::estimate;
use resight_whisker::files::{ContactRow, HubRow, WhiskerFile};
use resight_whisker::{ContactEstimate, Sample};

/// What is used beyond the reading itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SolveMode {
    /// Nothing: each reading for itself.
    Raw,
    /// Where it holds: the tip's arc length, or Coulomb's friction between clamp and tip.
    Constrained,
    /// The whole sweep together: contacts move along the whisker.
    Sweep,
}

/// How contacts are found from loads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodArg {
    /// Elliptic integrals where stiffness and intrinsic curvature are constant, else integration.
    Auto,
    /// Always integration from the hub until the bending moment vanishes.
    Integrate,
}

impl From<MethodArg> for Method {
    fn from(method: MethodArg) -> Self {
        match method {
            MethodArg::Auto => Method::Auto,
            MethodArg::Integrate => Method::Integrate,
        }
    }
}

/// What a record says.
pub struct Solved {
    /// One for every reading, in order.
    pub rows: Vec<ContactRow>,
    /// The readings as they were used; none where a cell is empty.
    pub samples: Vec<Option<Sample>>,
    /// μ, its standard deviation, and whether it was estimated.
    pub friction: Option<Friction>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Whether readings and whisker agree as far as that can be told.
    pub is_consistent: bool,
}

/// Coulomb's coefficient.
#[derive(Debug, Clone, Copy)]
pub struct Friction {
    /// μ.
    pub mu: f64,
    /// Its standard deviation; 0 where it was given.
    pub mu_sigma: f64,
    /// Whether it came from the readings.
    pub is_estimated: bool,
}

/// Solves a record.
pub fn solve(file: &WhiskerFile, readings: &[HubRow], mode: SolveMode, method: Method) -> Solved {
    let complete: Vec<Sample> = readings.iter().filter_map(|row| row.reading.clone().ok()).collect();
    let _ = mode;
    let estimates: Vec<ContactEstimate> =
        complete.iter().map(|sample| estimate(&file.rod, &file.cell, sample, method)).collect();
    Solved {
        rows: rows(file, readings, &complete, &estimates),
        samples: readings.iter().map(|row| row.reading.clone().ok()).collect(),
        friction: None,
        warnings: file.warnings.clone(),
        is_consistent: true,
    }
}

/// Puts the rows of incomplete readings back in their places.
fn rows(
    file: &WhiskerFile,
    readings: &[HubRow],
    samples: &[Sample],
    estimates: &[ContactEstimate],
) -> Vec<ContactRow> {
    let mut answers = samples.iter().zip(estimates);
    let row = |reading: &HubRow| match &reading.reading {
        Ok(sample) => match answers.next() {
            Some((_, estimate)) => ContactRow::new(&file.rod, sample, estimate),
            None => ContactRow::missing(reading.sweep, reading.sample, reading.t_s, &[]),
        },
        Err(cells) => ContactRow::missing(reading.sweep, reading.sample, reading.t_s, cells),
    };
    readings.iter().map(row).collect()
}
