//! What the jobs read: the whisker, its readings, objects.

use anyhow::{Context, Result, anyhow};
use clap::{Args, ValueEnum};
use resight_whisker::Sample;
use resight_whisker::calibrate::{self, Tare};
use resight_whisker::files::hub::{Conventions, ForceFrame, Sign};
use resight_whisker::files::object::ObjectFile;
use resight_whisker::files::units::Units;
use resight_whisker::files::{HubRow, TextError, WhiskerFile, object, read_hub, whisker};
use std::path::{Path, PathBuf};

/// The whisker and how its readings are meant.
#[derive(Debug, Args)]
pub struct WhiskerArgs {
    /// Whisker file (JSON): length, stiffness, taper, intrinsic curvature, noise of the instruments, calibration.
    #[arg(long, value_name = "META.json")]
    whisker: PathBuf,
    #[command(flatten)]
    readings: ReadingArgs,
}

/// How readings are meant where their header does not say.
#[derive(Debug, Args)]
pub struct ReadingArgs {
    /// Units of columns whose header states none, e.g. length=mm,angle=deg,moment=Nmm [default: as the whisker file says, else SI]
    #[arg(long, value_name = "QUANTITY=UNIT,…", value_parser = Units::parse)]
    units: Option<Units>,
    /// Axes of fx and fy: `hub` turns with the whisker's clamp, `world` stands still [default: as the whisker file says, else hub]
    #[arg(long, value_name = "FRAME")]
    force_frame: Option<FrameArg>,
    /// Whose force the cell reads: that of the whisker on the hub, or that of the hub on the whisker (its opposite)
    /// [default: as the whisker file says, else on-hub]
    #[arg(long, hide_short_help = true, value_name = "SIGN")]
    sign: Option<SignArg>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum FrameArg {
    Hub,
    World,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum SignArg {
    OnHub,
    OnWhisker,
}

impl WhiskerArgs {
    /// Reads the whisker file; flags overrule what it says about readings.
    pub fn read(&self) -> Result<WhiskerFile> {
        whisker_file(&self.whisker, &self.readings)
    }
}

/// Reads a whisker file; flags overrule what it says about readings.
pub fn whisker_file(path: &Path, flags: &ReadingArgs) -> Result<WhiskerFile> {
    let mut file = whisker::read(&text(path)?).map_err(|reason| anyhow!("{}: {reason}", path.display()))?;
    file.conventions = flags.overruled(file.conventions);
    Ok(file)
}

impl ReadingArgs {
    fn overruled(&self, said: Conventions) -> Conventions {
        Conventions {
            units: self.units.unwrap_or(said.units),
            force_frame: match self.force_frame {
                None => said.force_frame,
                Some(FrameArg::Hub) => ForceFrame::Hub,
                Some(FrameArg::World) => ForceFrame::World,
            },
            sign: match self.sign {
                None => said.sign,
                Some(SignArg::OnHub) => Sign::OnHub,
                Some(SignArg::OnWhisker) => Sign::OnWhisker,
            },
        }
    }
}

/// A text file, whole.
pub fn text(path: &Path) -> Result<String> {
    crate::files::must_exist(path)?;
    Ok(resight::input::read_text(path, resight::input::Kind::Literal)?)
}

/// Hub readings, CSV or JSON Lines.
pub fn readings(path: &Path, conventions: Conventions) -> Result<Vec<HubRow>> {
    read_hub(&text(path)?, conventions).map_err(|reason| located(path, &reason))
}

/// Zeros of the load cell from readings of the untouched whisker.
pub fn tare(path: &Path, file: &WhiskerFile) -> Result<Tare> {
    let rows = readings(path, file.conventions)?;
    let free: Vec<Sample> = rows.into_iter().filter_map(|row| row.reading.ok()).collect();
    calibrate::tare(&file.cell, &free, None).with_context(|| path.display().to_string())
}

/// An object file.
pub fn object(path: &Path) -> Result<ObjectFile> {
    object::read(&text(path)?).map_err(|reason| anyhow!("{}: {reason}", path.display()))
}

/// `FILE:LINE: reason`.
pub fn located(path: &Path, reason: &TextError) -> anyhow::Error {
    let line = reason.line.map(|line| format!(":{line}")).unwrap_or_default();
    anyhow!("{}{line}: {}", path.display(), reason.message)
}
