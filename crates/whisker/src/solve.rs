//! A record solved: one row for every reading, in order, complete or not.

pub mod rig;
pub mod prediction;

use crate::calibrate::Tare;
use crate::contact::Method;
use crate::estimate::{Status, estimate};
use crate::events::consistency::{flag, widen};
use crate::events::{self, Consistency, EventKind, Fault, Label, TouchDetector};
use crate::files::contacts::RowStatus;
use crate::files::{ContactRow, HubRow, WhiskerFile};
use crate::friction::{Mu, Record, solve_record};
use crate::sweep;
use crate::{Cell, ContactEstimate, Error, Rod, Sample};
use prediction::{At, Forecast};
use rig::{Rig, SIX_AXES};

/// What is used beyond the reading itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Nothing: each reading for itself.
    Raw,
    /// Where it holds: the tip's arc length, or Coulomb's friction between clamp and tip.
    Constrained,
    /// The whole sweep together: contacts move along the whisker.
    Sweep,
}

/// The answer of a record.
#[derive(Debug, Clone)]
pub struct Solved {
    /// One for every reading, in order.
    pub rows: Vec<ContactRow>,
    /// The readings as they were used; none where a cell is empty.
    pub samples: Vec<Option<Sample>>,
    /// μ, its standard deviation, and whether it was estimated.
    pub friction: Option<Friction>,
    /// Remarks.
    pub warnings: Vec<String>,
    /// What lies ahead where a sweep ends in contact.
    pub forecasts: Vec<Forecast>,
    /// The whisker as it was used.
    pub rod: Rod,
    /// Whether readings and whisker agree as far as that can be reported.
    pub is_consistent: bool,
}

/// Coulomb's coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// μ.
    pub mu: f64,
    /// Its standard deviation; 0 where it was given.
    pub mu_sigma: f64,
    /// Whether it came from the readings.
    pub is_estimated: bool,
}

/// How a record is solved.
#[derive(Debug, Clone, Copy)]
pub struct Config {
    /// What is used beyond the reading itself.
    pub mode: Mode,
    /// Coulomb's coefficient of friction.
    pub mu: Mu,
    /// How contacts are found from loads.
    pub method: Method,
    /// The sweeps touch different objects, or one that moved: their outlines need not agree.
    pub several_objects: bool,
    /// The rig is not calibrated: error bars are widened by the errors that the record cannot exclude (constrained mode).
    pub uncalibrated: bool,
    /// Predicts slip-off at every contact, not only where a sweep ends in contact (constrained mode).
    pub predict: bool,
}

impl Default for Config {
    fn default() -> Self {
        Config {
            mode: Mode::Constrained,
            mu: Mu::Auto,
            method: Method::Auto,
            several_objects: false,
            uncalibrated: false,
            predict: false,
        }
    }
}

/// Estimates of complete readings, and what was learnt on the way.
struct Answers {
    estimates: Vec<ContactEstimate>,
    /// What each touches; empty where that was not asked.
    features: Vec<Option<Label>>,
    friction: Option<Friction>,
    warnings: Vec<String>,
    forecasts: Vec<Forecast>,
    is_consistent: bool,
}

/// Solves a record.
///
/// # Errors
/// Too few readings for what is asked, or six axes where only the plane is known.
pub fn solve(
    file: &WhiskerFile,
    readings: &[HubRow],
    tare: Option<&Tare>,
    config: &Config,
) -> Result<Solved, Error> {
    let rig = Rig::new(file, tare);
    if readings.iter().any(|row| row.out_of_plane.is_some()) {
        return in_space(file, rig, readings, config);
    }
    let read: Vec<Sample> = readings.iter().filter_map(|row| row.reading.clone().ok()).collect();
    let meant: Vec<Sample> = read.iter().map(|sample| rig.meant(sample)).collect();
    let mut answers = match config.mode {
        Mode::Raw => raw(&rig, &meant, config.method),
        Mode::Constrained => constrained(&rig, &meant, config)?,
        Mode::Sweep => smoothed(&rig, &meant, config)?,
    };
    for (estimate, read) in answers.estimates.iter_mut().zip(&read) {
        rig.widen(estimate, read, config.mode == Mode::Raw);
    }
    let mut left = meant.iter().copied();
    Ok(Solved {
        rows: rows(&rig, readings, &meant, &answers),
        samples: readings.iter().map(|row| row.reading.as_ref().ok().and_then(|_| left.next())).collect(),
        friction: answers.friction,
        warnings: file.warnings.iter().cloned().chain(answers.warnings).collect(),
        forecasts: last_of_sweeps(answers.forecasts, &meant),
        is_consistent: answers.is_consistent,
        rod: rig.rod,
    })
}

/// Six axes: each reading for itself, in its own plane of bending.
fn in_space(file: &WhiskerFile, rig: Rig, readings: &[HubRow], config: &Config) -> Result<Solved, Error> {
    rig.must_know_six_axes()?;
    if config.mode == Mode::Sweep {
        return Err(Error::request(format!("--mode sweep follows a contact in the plane; {SIX_AXES}")));
    }
    let row = |reading: &HubRow| rig.row_in_space(reading);
    let mut warnings = file.warnings.clone();
    if config.mode == Mode::Constrained {
        warnings.push("six axes: each reading is solved for itself; friction and tip are not used".into());
    }
    let rows: Vec<ContactRow> = readings.iter().map(row).collect::<Result<_, Error>>()?;
    let touching = rows.iter().filter(|row| row.status.is_touching()).count();
    let out_of_plane = rows.iter().filter(|row| row.status == RowStatus::Read(Status::Inconsistent)).count();
    let is_consistent = (out_of_plane as f64) <= MOST_OUT_OF_PLANE * touching as f64;
    if !is_consistent {
        warnings.push(format!(
            "{out_of_plane} of {touching} contacts are not of one force in one plane (column `note`); sound ones fail once in 1000"
        ));
    }
    Ok(Solved {
        rows,
        samples: readings.iter().map(|row| row.reading.as_ref().ok().copied()).collect(),
        friction: None,
        warnings,
        forecasts: Vec::new(),
        rod: rig.rod,
        is_consistent,
    })
}

/// Ten times the share of sound contacts that the test of the plane fails.
const MOST_OUT_OF_PLANE: f64 = 0.01;

fn raw(rig: &Rig, samples: &[Sample], method: Method) -> Answers {
    let estimates = samples.iter().map(|sample| estimate(&rig.rod, &rig.cell, sample, method)).collect();
    Answers {
        estimates,
        features: Vec::new(),
        friction: None,
        warnings: Vec::new(),
        forecasts: Vec::new(),
        is_consistent: true,
    }
}

/// Those at which a sweep ends.
fn last_of_sweeps(forecasts: Vec<Forecast>, samples: &[Sample]) -> Vec<Forecast> {
    let is_last = |f: &Forecast| samples.get(f.index + 1).is_none_or(|next| next.sweep != f.sweep);
    forecasts.into_iter().filter(is_last).collect()
}

fn constrained(rig: &Rig, samples: &[Sample], config: &Config) -> Result<Answers, Error> {
    let method = config.method;
    let mut record = solve_record(&rig.rod, &rig.cell, samples, config.mu, method)?;
    let features = events::labels(&rig.rod, &rig.cell, samples, &record, method);
    let verdict = events::consistency(&rig.rod, &rig.cell, samples, &record, !config.several_objects, method);
    let mut warnings = several_contacts(&rig.cell, samples, &record);
    if let Some(verdict) = &verdict {
        let marked = flag(&rig.rod, &rig.cell, samples, &mut record, verdict, config.mu, method);
        warnings.extend(verdict.is_inconsistent.then(|| contradiction(verdict, marked)));
        if config.uncalibrated {
            let tolerances = Fault::ALL.map(|fault| fault.tolerance(&rig.cell));
            widen(&rig.rod, &rig.cell, samples, &mut record, verdict, &tolerances, method);
        }
    }
    let at = if config.predict { At::Every } else { At::Last };
    let forecasts = prediction::forecasts(rig, samples, &record.estimates, record.friction, method, at);
    let friction = Friction { mu: record.mu, mu_sigma: record.mu_sigma, is_estimated: config.mu == Mu::Auto };
    Ok(Answers {
        estimates: record.estimates,
        features,
        friction: Some(friction),
        warnings,
        forecasts,
        is_consistent: verdict.is_none_or(|verdict| !verdict.is_inconsistent),
    })
}

/// Where a record that was explained by one contact no longer is.
fn several_contacts(cell: &Cell, samples: &[Sample], record: &Record) -> Vec<String> {
    let found = events::events(cell, samples, record);
    let several = found.iter().filter(|event| event.kind == EventKind::SeveralContacts);
    let reported = several.map(|event| {
        let sample = &samples[event.index];
        format!("from sample {} of sweep {} no single contact explains the load", sample.sample, sample.sweep)
    });
    reported.collect()
}

fn contradiction(verdict: &Consistency, marked: usize) -> String {
    let likely = verdict.suspicions.first().map(|first| {
        let (size, sigma) = (first.size, first.sigma);
        let said = match first.fault {
            Fault::ForceGain => format!("forces {:+.2} ± {:.2} % too large", 100.0 * size, 100.0 * sigma),
            Fault::TorqueGain => {
                format!("the torque {:+.2} ± {:.2} % too large", 100.0 * size, 100.0 * sigma)
            }
            Fault::HubAngle => {
                format!("the hub angle {:+.3} ± {:.3}° off", size.to_degrees(), sigma.to_degrees())
            }
            Fault::CellAngle => {
                format!("the cell rotated by {:+.3} ± {:.3}°", size.to_degrees(), sigma.to_degrees())
            }
            Fault::HubAhead => format!("the clamp {:+.3} ± {:.3} mm ahead", 1e3 * size, 1e3 * sigma),
            Fault::HubAside => format!("the clamp {:+.3} ± {:.3} mm to the left", 1e3 * size, 1e3 * sigma),
            Fault::ZeroFx => format!("zero of fx {:+.2} ± {:.2} mN", 1e3 * size, 1e3 * sigma),
            Fault::ZeroFy => format!("zero of fy {:+.2} ± {:.2} mN", 1e3 * size, 1e3 * sigma),
            Fault::ZeroMz => format!("zero of mz {:+.4} ± {:.4} N mm", 1e3 * size, 1e3 * sigma),
        };
        format!("; most likely {said}")
    });
    format!(
        "the record contradicts itself (chi2 {:.0} for {} degrees of freedom){}; {marked} contacts are marked inconsistent; calibrate, or --several-objects",
        verdict.chi2,
        verdict.degrees_of_freedom,
        likely.unwrap_or_default()
    )
}

fn smoothed(rig: &Rig, samples: &[Sample], config: &Config) -> Result<Answers, Error> {
    let friction = match config.mu {
        Mu::Auto => sweep::Friction::Unknown,
        Mu::Known(mu) => sweep::Friction::Given { mu },
    };
    let options = sweep::Options { friction, method: config.method, ..sweep::Options::default() };
    let smoothed = sweep::smooth(&rig.rod, &rig.cell, samples, &options)?;
    let friction =
        Friction { mu: smoothed.mu, mu_sigma: smoothed.mu_sigma, is_estimated: config.mu == Mu::Auto };
    let jump = |jump: &sweep::Jump| {
        let sample = &samples[jump.after_row];
        format!(
            "the contact jumps after sample {} of sweep {} ({:.0} standard deviations off the tangent)",
            sample.sample, sample.sweep, jump.deviations
        )
    };
    Ok(Answers {
        estimates: smoothed.estimates,
        features: Vec::new(),
        friction: Some(friction),
        warnings: smoothed.jumps.iter().map(jump).collect(),
        forecasts: Vec::new(),
        is_consistent: true,
    })
}

/// Puts the rows of incomplete readings back in their places.
fn rows(rig: &Rig, readings: &[HubRow], samples: &[Sample], answers: &Answers) -> Vec<ContactRow> {
    let mut detector = TouchDetector::new(&rig.cell);
    let mut left = samples.iter().zip(&answers.estimates).enumerate();
    let mut forecasts = answers.forecasts.iter().peekable();
    let mut row = |reading: &HubRow| match &reading.reading {
        Ok(_) => left.next().map(|(i, (sample, estimate))| ContactRow {
            event: detector.push(sample),
            feature: answers.features.get(i).copied().flatten(),
            steps_to_slip_off: forecasts
                .next_if(|forecast| forecast.index == i)
                .and_then(|forecast| prediction::steps_to_slip_off(&forecast.prediction)),
            ..ContactRow::new(&rig.rod, sample, estimate)
        }),
        Err(cells) => Some(ContactRow::missing(reading.sweep, reading.sample, reading.t_s, cells)),
    };
    readings.iter().filter_map(&mut row).collect()
}
