//! The jobs of fleets as doors ask for them: files in, files and an answer out.

use crate::answer::{BatchObject, FleetCameraObject};
use crate::assess::{AssessConfig, Assessment, assess, assess_since};
use crate::run::{Job, Progress, run};
use crate::source::expand;
use crate::{Cameras, FleetError, FleetState, Solver, report, reread, units};
use resight::formats::{read_target, write_atomically};
use resight::input::table::how_file_is_read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Views to poses.
#[derive(Debug, Clone, PartialEq)]
pub struct BatchRequest {
    /// Files of views, folders of them, or patterns.
    pub inputs: Vec<String>,
    /// Cameras by name: a table, a file of several, or a folder of files.
    pub cameras: PathBuf,
    /// The points that all cameras see, where neither rows nor cameras state them.
    pub target: Option<PathBuf>,
    /// Where the poses go.
    pub output: PathBuf,
    /// Where what became of each camera goes, as JSON Lines.
    pub drift: Option<PathBuf>,
    /// Standard deviation of u and v where a row states none.
    pub sigma_px: f64,
    /// Seconds of a period of the drift.
    pub period_s: f64,
    /// Threads; 0: one for each core.
    pub threads: usize,
}

/// What a job says while it runs.
#[derive(Debug, Clone, PartialEq)]
pub enum News {
    /// What is unusual but not wrong, in a sentence.
    Warning(String),
    /// How far it is.
    Progress(Progress),
}

/// Solves all views. `hear` learns how far the work is; where it returns false the work ends with `Stopped`, and what is solved by then is
/// kept for the next run.
///
/// # Errors
/// What is wrong with an argument, before any work; a disk that is full.
pub fn batch(
    request: &BatchRequest,
    hear: &(dyn Fn(News) -> bool + Sync),
) -> Result<BatchObject, FleetError> {
    let (inputs, output) = (expand(&request.inputs)?, &request.output);
    if let Some(same) = inputs.iter().find(|input| is_same(input, output)) {
        let reason = format!("-o {}: this is one of the inputs; write elsewhere", same.display());
        return Err(FleetError::Setting(reason));
    }
    let solver = Solver { cameras: Arc::new(cameras_of(request)?), sigma_px: request.sigma_px };
    let of_views = inputs.first().map(|first| units::of_views(first)).unwrap_or_default();
    let how_read = inputs.iter().find_map(how_file_is_read);
    for text in solver.cameras.warnings.iter().chain(&of_views).chain(&how_read) {
        hear(News::Warning(text.clone()));
    }
    let (period_s, threads) = (request.period_s, request.threads);
    let job = Job { inputs: &inputs, solver: &solver, output, period_s, threads };
    let begun = Instant::now();
    let done = run(&job, &|progress| hear(News::Progress(progress)))?;
    if let Some(remark) = units::of_times(&done.state) {
        hear(News::Warning(remark));
    }
    let answer = BatchObject::of(&done, &solver.cameras, output, begun.elapsed().as_secs_f64());
    if let Some(drift) = &request.drift {
        write_drift(drift, done.state, &solver.cameras)?;
    }
    Ok(answer)
}

/// The cameras of a request, with the points of its target.
fn cameras_of(request: &BatchRequest) -> Result<Cameras, FleetError> {
    let cameras = Cameras::read(&request.cameras)?;
    match &request.target {
        Some(target) => cameras.with_target(&read_target(target)?.target),
        None => Ok(cameras),
    }
}

fn is_same(a: &Path, b: &Path) -> bool {
    let (a, b) = (a.canonicalize(), b.canonicalize());
    a.is_ok_and(|a| b.is_ok_and(|b| a == b))
}

fn write_drift(path: &Path, state: FleetState, cameras: &Cameras) -> Result<(), FleetError> {
    let mut lines = Vec::new();
    for line in json_lines(&assess(state, Some(cameras), &AssessConfig::default())?)? {
        lines.extend(line.into_bytes());
        lines.push(b'\n');
    }
    Ok(write_atomically(path, &lines)?)
}

/// A JSON object for each camera, those that moved first.
///
/// # Errors
/// None for numbers that JSON has.
pub fn json_lines(fleet: &Assessment) -> Result<Vec<String>, FleetError> {
    let line = |camera| serde_json::to_string(&FleetCameraObject::from(camera));
    let lines: Result<Vec<String>, _> = fleet.cameras.iter().map(line).collect();
    lines.map_err(|reason| FleetError::Setting(reason.to_string()))
}

/// Which cameras moved?
#[derive(Debug, Clone, PartialEq)]
pub struct ReportRequest {
    /// Files that `batch` wrote, folders of them, or patterns.
    pub inputs: Vec<String>,
    /// The cameras that should be there, and where each stands.
    pub cameras: Option<PathBuf>,
    /// Where the page goes, one HTML file.
    pub output: Option<PathBuf>,
    /// The state that an earlier report wrote, of the time before these poses: what is new since then.
    pub since: Option<PathBuf>,
    /// Where the state of these poses goes, for the next report.
    pub state: Option<PathBuf>,
    /// Seconds of a period.
    pub period_s: f64,
    /// What counts as a motion.
    pub config: AssessConfig,
}

/// Judges every camera of the poses that `batch` wrote.
///
/// # Errors
/// Files that are no poses of `batch`, a table of cameras that cannot be read, a page that cannot be written.
pub fn fleet_report(request: &ReportRequest) -> Result<Assessment, FleetError> {
    let inputs = expand(&request.inputs)?;
    let cameras = request.cameras.as_deref().map(Cameras::read).transpose()?;
    let state = reread(&inputs, request.period_s)?;
    let bytes = request.state.is_some().then(|| state.to_bytes());
    let fleet = match &request.since {
        Some(path) => {
            let before = std::fs::read(path).map_err(|e| FleetError::at(path, e.to_string()))?;
            let before = FleetState::from_bytes(&before).map_err(|e| FleetError::at(path, e.to_string()))?;
            assess_since(state, before, cameras.as_ref(), &request.config)?
        }
        None => assess(state, cameras.as_ref(), &request.config)?,
    };
    write_page(&fleet, cameras.as_ref(), request.output.as_deref())?;
    if let Some((path, bytes)) = request.state.as_ref().zip(bytes) {
        write_atomically(path, &bytes)?;
    }
    Ok(fleet)
}

/// The same of a state, as many machines may have summed it.
///
/// # Errors
/// As `fleet_report`.
pub fn report_of(
    state: FleetState,
    cameras: Option<&Cameras>,
    output: Option<&Path>,
    config: &AssessConfig,
) -> Result<Assessment, FleetError> {
    let fleet = assess(state, cameras, config)?;
    write_page(&fleet, cameras, output)?;
    Ok(fleet)
}

fn write_page(
    fleet: &Assessment,
    cameras: Option<&Cameras>,
    output: Option<&Path>,
) -> Result<(), FleetError> {
    let Some(output) = output else { return Ok(()) };
    Ok(write_atomically(output, report::page(fleet, cameras).as_bytes())?)
}
