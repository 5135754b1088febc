//! A record solved: one row for every reading, in order, complete or not.

use anyhow::Result;
use clap::{Args, ValueEnum};
use resight_whisker::contact::Method;
use resight_whisker::calibrate::{Calibration, Parameter, Tare};
use resight_whisker::estimate::{Mode, estimate};
use resight_whisker::friction::{Mu, solve_record};
use resight_whisker::files::{ContactRow, HubRow, WhiskerFile};
use resight_whisker::sweep;
use resight_whisker::{Cell, ContactEstimate, Rod, Sample};

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
    /// The whisker as it was used.
    pub rod: Rod,
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

/// The whisker, its cell and the readings, as the calibration has them.
struct Rig {
    /// None where nothing is to be corrected.
    calibration: Option<Calibration>,
    rod: Rod,
    cell: Cell,
    /// As they came.
    read: Vec<Sample>,
    /// As they are meant.
    meant: Vec<Sample>,
}

impl Rig {
    fn new(file: &WhiskerFile, tare: Option<&Tare>, read: Vec<Sample>) -> Self {
        let calibration = calibration(file, tare);
        let (rod, cell) = match &calibration {
            Some(calibration) => (calibration.rod(), calibration.apply_to_cell(&file.cell)),
            None => (file.rod.clone(), file.cell),
        };
        let apply = |sample: &Sample| calibration.as_ref().map_or(*sample, |c| c.apply(sample));
        let meant = read.iter().map(apply).collect();
        Rig { calibration, rod, cell, read, meant }
    }

    /// What is not known of the rig makes every contact less certain.
    fn widen(&self, estimates: &mut [ContactEstimate], is_raw: bool) {
        let Some(calibration) = &self.calibration else { return };
        for (estimate, sample) in estimates.iter_mut().zip(&self.read) {
            let mode = if is_raw { Mode::Free } else { estimate.mode };
            if let Some(contact) = &mut estimate.contact
                && let Some(added) = calibration.systematic_covariance(&self.cell, sample, mode)
                && added.iter().all(|x| x.is_finite())
            {
                contact.covariance += added;
            }
        }
    }
}

/// That of the file, with the zeros of the tare in place of its own.
pub fn calibration(file: &WhiskerFile, tare: Option<&Tare>) -> Option<Calibration> {
    let Some(tare) = tare else { return file.calibration.clone() };
    let mut calibration = file.calibration.clone().unwrap_or_else(|| Calibration::ideal(&file.rod));
    let zeros = [Parameter::ForceXZero, Parameter::ForceYZero, Parameter::TorqueZero].map(Parameter::index);
    for (i, place) in zeros.into_iter().enumerate() {
        calibration.values[place] = tare.zeros[i];
        calibration.covariance.row_mut(place).fill(0.0);
        calibration.covariance.column_mut(place).fill(0.0);
    }
    for (i, a) in zeros.into_iter().enumerate() {
        for (j, b) in zeros.into_iter().enumerate() {
            calibration.covariance[(a, b)] = tare.covariance[(i, j)];
        }
    }
    Some(calibration)
}

/// Solves a record.
pub fn solve(
    file: &WhiskerFile,
    readings: &[HubRow],
    tare: Option<&Tare>,
    args: &SolvingArgs,
) -> Result<Solved> {
    let rig = Rig::new(file, tare, readings.iter().filter_map(|row| row.reading.clone().ok()).collect());
    let mut answers = match args.mode {
        SolveMode::Raw => raw(&rig, args.method.into()),
        SolveMode::Constrained => constrained(&rig, args)?,
        SolveMode::Sweep => smoothed(&rig, args)?,
    };
    rig.widen(&mut answers.estimates, args.mode == SolveMode::Raw);
    let mut meant = rig.meant.iter().copied();
    Ok(Solved {
        rows: rows(&rig, readings, &answers.estimates),
        samples: readings.iter().map(|row| row.reading.as_ref().ok().and_then(|_| meant.next())).collect(),
        friction: answers.friction,
        warnings: file.warnings.iter().cloned().chain(answers.warnings).collect(),
        is_consistent: answers.is_consistent,
        rod: rig.rod,
    })
}

fn raw(rig: &Rig, method: Method) -> Answers {
    let estimates = rig.meant.iter().map(|sample| estimate(&rig.rod, &rig.cell, sample, method)).collect();
    Answers { estimates, friction: None, warnings: Vec::new(), is_consistent: true }
}

fn constrained(rig: &Rig, args: &SolvingArgs) -> Result<Answers> {
    let record = solve_record(&rig.rod, &rig.cell, &rig.meant, args.mu, args.method.into())?;
    let friction =
        Friction { mu: record.mu, mu_sigma: record.mu_sigma, is_estimated: args.mu == Mu::Auto };
    Ok(Answers {
        estimates: record.estimates,
        friction: Some(friction),
        warnings: Vec::new(),
        is_consistent: true,
    })
}

fn smoothed(rig: &Rig, args: &SolvingArgs) -> Result<Answers> {
    let friction = match args.mu {
        Mu::Auto => sweep::Friction::Unknown,
        Mu::Known(mu) => sweep::Friction::Given { mu },
    };
    let options = sweep::Options { friction, method: args.method.into(), ..sweep::Options::default() };
    let smoothed = sweep::smooth(&rig.rod, &rig.cell, &rig.meant, &options)?;
    let friction =
        Friction { mu: smoothed.mu, mu_sigma: smoothed.mu_sigma, is_estimated: args.mu == Mu::Auto };
    let jump = |jump: &sweep::Jump| {
        let sample = &rig.meant[jump.after_row];
        format!(
            "the contact jumps after sample {} of sweep {} ({:.0} standard deviations off the tangent)",
            sample.sample, sample.sweep, jump.deviations
        )
    };
    Ok(Answers {
        estimates: smoothed.estimates,
        friction: Some(friction),
        warnings: smoothed.jumps.iter().map(jump).collect(),
        is_consistent: true,
    })
}

/// Puts the rows of incomplete readings back in their places.
fn rows(rig: &Rig, readings: &[HubRow], estimates: &[ContactEstimate]) -> Vec<ContactRow> {
    let mut answers = rig.meant.iter().zip(estimates);
    let row = |reading: &HubRow| match (&reading.reading, &reading.reading.as_ref().ok().and_then(|_| answers.next())) {
        (Ok(_), Some((sample, estimate))) => ContactRow::new(&rig.rod, sample, estimate),
        (Err(cells), _) => ContactRow::missing(reading.sweep, reading.sample, reading.t_s, cells),
        (Ok(_), None) => unreachable!("one estimate for every complete reading"),
    };
    readings.iter().map(row).collect()
}
