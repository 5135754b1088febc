//! A record solved: one row for every reading, in order, complete or not.

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use resight_whisker::contact::Method;
use resight_whisker::estimate::estimate;
use resight_whisker::friction::{Mu, solve_record};
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

/// What is known of friction: `auto`, or μ.
pub fn parse_mu(text: &str) -> Result<Mu, String> {
    match (text, text.parse::<f64>()) {
        ("auto", _) => Ok(Mu::Auto),
        (_, Ok(mu)) if 0.0 <= mu && mu.is_finite() => Ok(Mu::Known(mu)),
        _ => Err("`auto` or a number not below 0 is needed".to_string()),
    }
}

/// How a record is solved.
#[derive(Debug, Clone, Copy, Args)]
pub struct SolvingArgs {
    /// What is used beyond the reading itself.
    #[arg(long, value_name = "MODE", value_enum, default_value_t = SolveMode::Constrained)]
    pub mode: SolveMode,
    /// Coulomb's coefficient of friction: `auto` estimates it from the record.
    #[arg(long, value_name = "auto|MU", default_value = "auto", allow_negative_numbers = true, value_parser = parse_mu)]
    pub mu: Mu,
    /// How contacts are found from loads.
    #[arg(long, value_name = "METHOD", value_enum, default_value_t = MethodArg::Auto)]
    pub method: MethodArg,
}

/// Estimates of complete readings, and what was learnt on the way.
struct Answers {
    estimates: Vec<ContactEstimate>,
    friction: Option<Friction>,
    warnings: Vec<String>,
    is_consistent: bool,
}

/// Solves a record.
pub fn solve(file: &WhiskerFile, readings: &[HubRow], args: &SolvingArgs) -> Result<Solved> {
    let samples: Vec<Sample> = readings.iter().filter_map(|row| row.reading.clone().ok()).collect();
    let answers = match args.mode {
        SolveMode::Raw => raw(file, &samples, args.method.into()),
        SolveMode::Constrained => constrained(file, &samples, args)?,
        SolveMode::Sweep => bail!("--mode sweep"),
    };
    Ok(Solved {
        rows: rows(file, readings, &samples, &answers.estimates),
        samples: readings.iter().map(|row| row.reading.clone().ok()).collect(),
        friction: answers.friction,
        warnings: file.warnings.iter().cloned().chain(answers.warnings).collect(),
        is_consistent: answers.is_consistent,
    })
}

fn raw(file: &WhiskerFile, samples: &[Sample], method: Method) -> Answers {
    let estimates = samples.iter().map(|sample| estimate(&file.rod, &file.cell, sample, method)).collect();
    Answers { estimates, friction: None, warnings: Vec::new(), is_consistent: true }
}

fn constrained(file: &WhiskerFile, samples: &[Sample], args: &SolvingArgs) -> Result<Answers> {
    let record = solve_record(&file.rod, &file.cell, samples, args.mu, args.method.into())?;
    let friction = Friction {
        mu: record.mu,
        mu_sigma: record.mu_sigma,
        is_estimated: args.mu == Mu::Auto,
    };
    Ok(Answers { estimates: record.estimates, friction: Some(friction), warnings: Vec::new(), is_consistent: true })
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
