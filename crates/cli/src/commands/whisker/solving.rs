//! How a record is solved, from flags.

use clap::{Args, ValueEnum};
use resight_whisker::contact::Method;
use resight_whisker::friction::Mu;
use resight_whisker::solve;

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
    /// The sweeps touch different objects, or one that moved: their outlines need not agree.
    #[arg(long)]
    pub several_objects: bool,
    /// Nobody has calibrated the rig: gains known to 1 %, angles to 0.2°, the clamp to 0.5 mm; error bars are widened by what of that
    /// the record cannot exclude (constrained mode).
    #[arg(long)]
    pub uncalibrated: bool,
    /// Predicts slip-off at every contact (columns steps_to_slip_off …), not only where a sweep ends in contact (constrained mode).
    #[arg(long, alias = "foresee")]
    pub predict: bool,
}

impl From<&SolvingArgs> for solve::Config {
    fn from(args: &SolvingArgs) -> Self {
        solve::Config {
            mode: match args.mode {
                SolveMode::Raw => solve::Mode::Raw,
                SolveMode::Constrained => solve::Mode::Constrained,
                SolveMode::Sweep => solve::Mode::Sweep,
            },
            mu: args.mu,
            method: args.method.into(),
            several_objects: args.several_objects,
            uncalibrated: args.uncalibrated,
            predict: args.predict,
        }
    }
}
