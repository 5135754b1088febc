//! The change detector for streams of poses that are not `watch`'s own: each state is the event that `watch --json` prints.

use crate::answer::PoseAnswer;
use crate::arrays::{Numbers, array, words};
use crate::error;
use crate::pose::{NOT_RIGID, Pose, rigid};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use resight::core::Matrix6;
use resight::core::temporal::monitor::learn::{LearnConfig, learn, unsettled};
use resight::core::temporal::monitor::{self as core, MonitorConfig, Reading, Reference};
use resight_watch::live::{LiveConfig, reference};
use resight_watch::names::Names;
use resight_watch::outputs::said::EventText;
use resight_watch::{Event, live};
use std::path::PathBuf;

/// Whether a camera moved against a target, reading by reading, at a stated rate of false alarms.
#[pyclass(module = "resight")]
pub struct Monitor {
    monitor: core::Monitor,
    learned: Reference,
    names: Names,
}

/// What counts as an alarm; the defaults are those of the library.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Alarms {
    false_alarms_per_day: f64,
    decision_period_s: f64,
    stale_after_s: f64,
    tolerance_rotation_rad: f64,
    tolerance_translation_m: f64,
}

impl Alarms {
    fn config(&self) -> MonitorConfig {
        MonitorConfig {
            false_alarms_per_day: self.false_alarms_per_day,
            decision_period_s: self.decision_period_s,
            stale_after_s: self.stale_after_s,
            tolerance_rotation_rad: self.tolerance_rotation_rad,
            tolerance_translation_m: self.tolerance_translation_m,
        }
    }
}

#[pymethods]
impl Monitor {
    /// From readings during which nothing moved: times (n,), poses (n, 4, 4), covariances (n, 6, 6).
    #[staticmethod]
    fn learned(
        py: Python<'_>,
        times_s: &Bound<'_, PyAny>,
        cam_from_target: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
        alarms: Alarms,
        names: (String, String),
    ) -> PyResult<Self> {
        let readings = readings(py, times_s, cam_from_target, covariance)?;
        let known: LearnConfig = LiveConfig::default().correlated;
        if let Some(found) = unsettled(&readings, &known) {
            let event = Event::MovedWhileLearning {
                camera: 0,
                target: 0,
                alternatives: Vec::new(),
                unsettled: Box::new(found),
            };
            return Err(error::error(
                py,
                "moved_while_learning",
                EventText::new(&named(names)).words(&event),
            ));
        }
        let learned = learn(&readings, &known).map_err(|reason| error::math(py, &reason))?;
        let last_s = readings.last().map_or(0.0, |reading| reading.t_s);
        Self::new(py, learned, &alarms, names, last_s, &readings)
    }

    /// From a reference file that `watch --save-reference` or `save` wrote; time begins at `t_s`.
    #[staticmethod]
    fn read(
        py: Python<'_>,
        file: PathBuf,
        t_s: f64,
        alarms: Alarms,
        names: (String, String),
    ) -> PyResult<Self> {
        let learned = reference::read(&file).map_err(|reason| error::file(py, &reason))?;
        Self::new(py, learned, &alarms, names, t_s, &[])
    }

    /// The next reading, and how things stand after it.
    fn push(
        &mut self,
        py: Python<'_>,
        t_s: f64,
        pose: &Bound<'_, PyAny>,
        covariance: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<String> {
        let reading = match pose.cast::<PoseAnswer>() {
            Ok(answer) => answer.get().reading(t_s),
            Err(_) => Some(given(py, t_s, pose, covariance)?),
        };
        if !t_s.is_finite() || t_s < self.monitor.last_s() {
            let message = format!("t_s: {t_s} is given after {}; times never fall", self.monitor.last_s());
            return Err(error::input(py, message));
        }
        match reading {
            Some(reading) => {
                let watch = self.monitor.push(&reading);
                Ok(self.said(t_s, watch))
            }
            None => Ok(self.said(t_s, self.monitor.watch(t_s))),
        }
    }

    /// How things stand at a time, also where no reading has come.
    fn state(&self, t_s: f64) -> String {
        self.said(t_s, self.monitor.watch(t_s))
    }

    /// Takes where the camera is now for its reference.
    fn accept(&mut self, py: Python<'_>) -> PyResult<()> {
        self.monitor.accept().map_err(|reason| error::math(py, &reason))
    }

    /// Smallest rotations (rad) and translations (m) about and along each axis that are found within this time, nine times in ten.
    fn detectable(&self, within_s: f64) -> Option<([f64; 3], [f64; 3])> {
        self.monitor.detectable(within_s).map(|found| (found.rotation_rad, found.translation_m))
    }

    /// The pose that readings are compared with.
    #[getter]
    fn reference(&self) -> Pose {
        let pose = self.monitor.reference().a_from_b;
        Pose { pose, b: "cam".to_owned(), a: "target".to_owned() }
    }

    /// Covariance of the reference, (6, 6).
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array(py, self.learned.noise.reference.iter().copied().collect(), &[6, 6])
    }

    /// The text of a reference file.
    fn to_toml(&self, py: Python<'_>) -> PyResult<String> {
        reference::to_text(self.monitor.reference()).map_err(|reason| error::error(py, "write", reason))
    }

    fn __repr__(&self) -> String {
        let state: live::State = self.monitor.watch(self.monitor.last_s()).into();
        let words = resight_watch::outputs::said::state_words(&state);
        format!("Monitor({}: {words})", self.names.pair(0, 0))
    }
}

impl Monitor {
    fn new(
        py: Python<'_>,
        learned: Reference,
        alarms: &Alarms,
        names: (String, String),
        t_s: f64,
        readings: &[Reading],
    ) -> PyResult<Self> {
        let monitor = core::Monitor::new(&learned, &alarms.config(), t_s);
        let mut monitor = monitor.map_err(|reason| error::math(py, &reason))?;
        monitor.measure_noise(readings);
        Ok(Monitor { monitor, learned, names: named(names) })
    }

    fn said(&self, t_s: f64, watch: core::Watch) -> String {
        let event = Event::StateChanged { camera: 0, target: 0, t_s, state: watch.into() };
        EventText::new(&self.names).object(&event).to_string()
    }
}

fn named((camera, target): (String, String)) -> Names {
    Names { cameras: vec![camera], targets: vec![target] }
}

fn covariance_of(py: Python<'_>, numbers: &[f64]) -> PyResult<Matrix6> {
    let covariance = Matrix6::from_row_slice(numbers);
    let is_one = (covariance - covariance.transpose()).amax() <= 1e-9 * covariance.amax()
        && covariance.cholesky().is_some();
    match is_one {
        true => Ok(covariance),
        false => {
            Err(error::input(py, "covariance: no covariance (symmetric and positive definite is needed)"))
        }
    }
}

fn given(
    py: Python<'_>,
    t_s: f64,
    pose: &Bound<'_, PyAny>,
    covariance: Option<&Bound<'_, PyAny>>,
) -> PyResult<Reading> {
    let Some(covariance) = covariance else {
        return Err(error::input(
            py,
            "covariance: a pose needs its covariance (6, 6); a PoseAnswer brings its own",
        ));
    };
    let a_from_b = match pose.cast::<Pose>() {
        Ok(pose) => pose.get().pose,
        Err(_) => {
            let numbers = Numbers::new("pose", pose)?;
            let rows = <&[f64; 16]>::try_from(numbers.slice()).ok().filter(|_| numbers.shape() == [4, 4]);
            rows.and_then(rigid).ok_or_else(|| error::input(py, format!("pose: {NOT_RIGID}")))?
        }
    };
    let numbers = Numbers::new("covariance", covariance)?;
    if numbers.shape() != [6, 6] {
        let shape = words(numbers.shape());
        return Err(error::input(py, format!("covariance: shape {shape} is given, (6, 6) is needed")));
    }
    Ok(Reading { t_s, a_from_b, covariance: covariance_of(py, numbers.slice())?, is_consistent: true })
}

fn readings(
    py: Python<'_>,
    times_s: &Bound<'_, PyAny>,
    poses: &Bound<'_, PyAny>,
    covariances: &Bound<'_, PyAny>,
) -> PyResult<Vec<Reading>> {
    let times = Numbers::new("times_s", times_s)?;
    let (poses, covariances) =
        (Numbers::new("cam_from_target", poses)?, Numbers::new("covariance", covariances)?);
    let n = times.slice().len();
    for (name, numbers, shape) in [
        ("times_s", &times, vec![n]),
        ("cam_from_target", &poses, vec![n, 4, 4]),
        ("covariance", &covariances, vec![n, 6, 6]),
    ] {
        if numbers.shape() != shape {
            let (seen, needed) = (words(numbers.shape()), words(&shape));
            return Err(error::input(py, format!("{name}: shape {seen} is given, {needed} is needed")));
        }
    }
    if times.slice().iter().any(|t| !t.is_finite()) || !times.slice().is_sorted() {
        return Err(error::input(py, "times_s: finite times that never fall are needed"));
    }
    let rows =
        times.slice().iter().zip(poses.slice().as_chunks::<16>().0).zip(covariances.slice().chunks(36));
    let reading = |((t_s, pose), covariance): ((&f64, &[f64; 16]), &[f64])| {
        let a_from_b =
            rigid(pose).ok_or_else(|| error::input(py, format!("cam_from_target: {NOT_RIGID}")))?;
        Ok(Reading { t_s: *t_s, a_from_b, covariance: covariance_of(py, covariance)?, is_consistent: true })
    };
    rows.map(reading).collect()
}
