//! `resight.PoseAnswer`: the answer about one view; its JSON is that of the program.

use crate::arrays::array;
use crate::pose::{Pose, rigid};
use crate::{error, notebook};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use resight::core::locate::consistency::Consistency;
use resight::core::temporal::monitor::Reading;
use resight::core::{self, Matrix6, PoseEstimate};
use resight::report::words::{sigmas, translation_sigma_m};
use resight::rig::ViewPoses;
use serde::Deserialize;
use std::sync::OnceLock;

/// The answer about one view: status and sentence, and the pose where there is one.
#[pyclass(frozen, module = "resight")]
pub struct PoseAnswer {
    state: State,
    figures: OnceLock<Figures>,
}

/// Solved here, or read from a line of JSON.
enum State {
    Solved(Box<resight::PoseAnswer>),
    Read(String, Box<Figures>),
}

/// What attributes and tables show.
pub struct Figures {
    pub view: String,
    pub status: String,
    pub message: String,
    pub n_points: usize,
    remarks: Vec<String>,
    method: Option<String>,
    pub pose: Option<PoseFigures>,
}

/// A pose, and how well it is known.
#[derive(Clone)]
pub struct PoseFigures {
    pub cam_from_target: core::Pose,
    pub covariance: Matrix6,
    pub probability: f64,
    pub rms_px: f64,
    pub chi2: f64,
    pub degrees_of_freedom: usize,
    /// Every minimum, the answer first, and whether it is within the gate.
    pub minima: Vec<(core::Pose, bool)>,
}

/// An answer as a row of a table.
pub struct Row<'a> {
    pub view: String,
    pub status: &'a str,
    pub message: &'a str,
    pub n_points: usize,
    pub pose: Option<&'a PoseFigures>,
}

impl From<resight::PoseAnswer> for PoseAnswer {
    fn from(answer: resight::PoseAnswer) -> Self {
        PoseAnswer { state: State::Solved(Box::new(answer)), figures: OnceLock::new() }
    }
}

impl From<&PoseEstimate> for PoseFigures {
    fn from(e: &PoseEstimate) -> Self {
        let minima = e.minima().map(|h| (h.minimum.cam_from_target, h.is_alternative)).collect();
        PoseFigures { minima, ..PoseFigures::without_minima(e) }
    }
}

impl From<&resight::PoseAnswer> for Figures {
    fn from(answer: &resight::PoseAnswer) -> Self {
        let estimate = answer.estimate.as_ref();
        Figures {
            view: answer.view.clone(),
            status: answer.status().name().to_owned(),
            message: answer.verdict.message.clone(),
            n_points: answer.n_points,
            remarks: answer.remarks.clone(),
            method: estimate.map(|e| resight::locate::method_name(e.method).to_owned()),
            pose: estimate.map(PoseFigures::from),
        }
    }
}

/// The keys of the JSON object that attributes show.
#[derive(Deserialize)]
struct Line {
    view: String,
    status: String,
    message: String,
    n_points: usize,
    #[serde(default)]
    remarks: Vec<String>,
    method: Option<String>,
    cam_from_target: Option<Transform>,
    covariance: Option<[[f64; 6]; 6]>,
    probability: Option<f64>,
    rms_px: Option<f64>,
    chi2: Option<f64>,
    degrees_of_freedom: Option<usize>,
    minima: Option<Vec<Minimum>>,
}

#[derive(Deserialize)]
struct Transform {
    matrix: [[f64; 4]; 4],
}

#[derive(Deserialize)]
struct Minimum {
    cam_from_target: Transform,
    within_gate: bool,
}

impl Transform {
    fn pose(&self) -> Result<core::Pose, String> {
        let numbers: [f64; 16] = std::array::from_fn(|i| self.matrix[i / 4][i % 4]);
        rigid(&numbers).ok_or_else(|| "cam_from_target is no rigid transform".to_owned())
    }
}

impl Line {
    fn figures(self) -> Result<Figures, String> {
        let pose = match (self.cam_from_target, self.covariance) {
            (Some(transform), Some(covariance)) => {
                let minimum = |m: &Minimum| Ok((m.cam_from_target.pose()?, m.within_gate));
                Some(PoseFigures {
                    cam_from_target: transform.pose()?,
                    covariance: Matrix6::from_fn(|i, j| covariance[i][j]),
                    probability: self.probability.unwrap_or(f64::NAN),
                    rms_px: self.rms_px.unwrap_or(f64::NAN),
                    chi2: self.chi2.unwrap_or(f64::NAN),
                    degrees_of_freedom: self.degrees_of_freedom.unwrap_or(0),
                    minima: self.minima.iter().flatten().map(minimum).collect::<Result<_, String>>()?,
                })
            }
            _ => None,
        };
        let Line { view, status, message, n_points, remarks, method, .. } = self;
        Ok(Figures { view, status, message, n_points, remarks, method, pose })
    }
}

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

#[pymethods]
impl PoseAnswer {
    /// From the line that the program prints with `--json`, or that `to_json` gave.
    #[staticmethod]
    fn from_json(py: Python<'_>, line: String) -> PyResult<Self> {
        let read = serde_json::from_str::<Line>(&line).map_err(|reason| reason.to_string());
        let figures = read
            .and_then(Line::figures)
            .map_err(|reason| error::input(py, format!("line: no answer about a pose: {reason}")))?;
        Ok(PoseAnswer { state: State::Read(line, Box::new(figures)), figures: OnceLock::new() })
    }

    /// `ok`, `ambiguous`, `inconsistent`, `degenerate`, `not_found` or `error`; only `ok` may be used unseen.
    #[getter]
    fn status(&self) -> &str {
        &self.figures().status
    }

    /// Why, with the numbers seen and needed.
    #[getter]
    fn message(&self) -> &str {
        &self.figures().message
    }

    /// Name of the image or view.
    #[getter]
    fn view(&self) -> &str {
        &self.figures().view
    }

    /// What is unusual about the input.
    #[getter]
    fn remarks(&self) -> Vec<String> {
        self.figures().remarks.clone()
    }

    /// The solver that answered.
    #[getter]
    fn method(&self) -> Option<&str> {
        self.figures().method.as_deref()
    }

    /// How many points were used.
    #[getter]
    fn n_points(&self) -> usize {
        self.figures().n_points
    }

    /// The most probable pose; None where there is none.
    #[getter]
    fn cam_from_target(&self) -> Option<Pose> {
        self.pose().map(|p| of_target(p.cam_from_target))
    }

    /// Its inverse: the camera's place in the target frame.
    #[getter]
    fn target_from_cam(&self) -> Option<Pose> {
        self.cam_from_target().map(|pose| pose.inverted())
    }

    /// Covariance (6, 6) of the small left motion `[rotation_rad; translation_m]` of `cam_from_target`, camera frame.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        let rows = |p: &PoseFigures| array(py, p.covariance.iter().copied().collect(), &[6, 6]); // Symmetric.
        self.pose().map(rows).transpose()
    }

    /// Standard deviations of the camera's rotation about its axes, (3,), radians.
    #[getter]
    fn sigma_rad<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        self.pose().map(|p| array(py, sigmas(&p.covariance).0.to_vec(), &[3])).transpose()
    }

    /// Standard deviations of the camera's place along its axes, (3,), metres.
    #[getter]
    fn sigma_m<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        self.pose().map(|p| array(py, sigmas(&p.covariance).1.to_vec(), &[3])).transpose()
    }

    /// Standard deviations of `cam_from_target.translation_m` itself, (3,), metres: a rotation of the camera changes it too.
    #[getter]
    fn sigma_translation_m<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        self.pose().map(|p| array(py, p.sigma_translation_m().to_vec(), &[3])).transpose()
    }

    /// The parts of `covariance` by the sources of the errors, objects with `part`, `sigma_rad`, `sigma_m`, `share` of the position's variance and
    /// `covariance`; None where there are none.
    #[getter]
    fn budget<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.to_dict(py)?.call_method1("get", ("budget",))
    }

    /// Of this pose among all that were found.
    #[getter]
    fn probability(&self) -> Option<f64> {
        self.pose().map(|p| p.probability)
    }

    /// Root mean square reprojection error over points.
    #[getter]
    fn rms_px(&self) -> Option<f64> {
        self.pose().map(|p| p.rms_px)
    }

    /// Sum of squared residuals over their variances.
    #[getter]
    fn chi2(&self) -> Option<f64> {
        self.pose().map(|p| p.chi2)
    }

    /// Of `chi2`: two for each point, less six.
    #[getter]
    fn degrees_of_freedom(&self) -> Option<usize> {
        self.pose().map(|p| p.degrees_of_freedom)
    }

    /// The other pose that fits as well, where the answer is ambiguous.
    #[getter]
    fn other_cam_from_target(&self) -> Option<Pose> {
        let (other, _) = self.pose()?.minima.iter().skip(1).find(|(_, is_within)| *is_within)?;
        Some(of_target(*other))
    }

    /// Every minimum as a homogeneous matrix, (k, 4, 4), the answer first.
    #[getter]
    fn minima<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let minima = self.pose().map_or(&[][..], |p| &p.minima);
        let numbers = minima.iter().flat_map(|(pose, _)| pose.matrix().concat()).collect();
        array(py, numbers, &[minima.len(), 4, 4])
    }

    /// The line that the program prints with `--json`.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        match &self.state {
            State::Solved(answer) => serde_json::to_string(&**answer)
                .map_err(|reason| error::error(py, "write", reason.to_string())),
            State::Read(line, _) => Ok(line.clone()),
        }
    }

    /// The JSON object of the program's `--json` as plain Python values.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (self.to_json(py)?,))
    }

    /// How `pickle` and `copy` make it again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<PoseAnswer>().getattr("from_json")?, (self.to_json(py)?,)))
    }

    fn __eq__(&self, py: Python<'_>, other: &Bound<'_, PyAny>) -> PyResult<bool> {
        match other.cast::<PoseAnswer>() {
            Ok(other) => Ok(self.to_json(py)? == other.get().to_json(py)?),
            Err(_) => Ok(false),
        }
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        self.to_json(py)?.into_pyobject(py)?.hash()
    }

    /// What a notebook shows.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        notebook::named(py, self.figures().lines())
    }

    fn __repr__(&self) -> String {
        let Figures { status, message, pose, .. } = self.figures();
        let Some(pose) = pose else { return format!("PoseAnswer({status}: {message})") };
        let [x, y, z] = pose.sigma_translation_m().map(|sigma_m| 1e3 * sigma_m);
        format!(
            "PoseAnswer({status}, {} ± ({x:.2}, {y:.2}, {z:.2}) mm, rotation ± {:.3} deg)",
            of_target(pose.cam_from_target).words(),
            largest(sigmas(&pose.covariance).0).to_degrees()
        )
    }
}

impl Figures {
    /// What a notebook shows, line by line.
    fn lines(&self) -> Vec<(&'static str, String)> {
        let said = if self.message.is_empty() { String::new() } else { format!(": {}", self.message) };
        let mut lines = vec![("view", self.view.clone()), ("status", format!("{}{said}", self.status))];
        if let Some(pose) = &self.pose {
            let [x, y, z] = pose.sigma_translation_m().map(|sigma_m| 1e3 * sigma_m);
            let turn = core::Pose::identity().angle_to_rad(&pose.cam_from_target).to_degrees();
            let sigma_deg = largest(sigmas(&pose.covariance).0).to_degrees();
            let place = of_target(pose.cam_from_target).words();
            lines.push(("pose", format!("{place} ± ({x:.2}, {y:.2}, {z:.2}) mm")));
            lines.push(("rotation", format!("{turn:.3} ± {sigma_deg:.3} deg")));
            lines.push(("residual", format!("{:.3} px over {} points", pose.rms_px, self.n_points)));
        }
        lines.extend(self.remarks.iter().map(|remark| ("remark", remark.clone())));
        lines.retain(|(_, text)| !text.is_empty());
        lines
    }
}

impl PoseFigures {
    /// Of an estimate, without its minima.
    pub fn without_minima(e: &PoseEstimate) -> Self {
        PoseFigures {
            cam_from_target: e.cam_from_target,
            covariance: e.covariance,
            probability: e.probability,
            rms_px: e.rms_px,
            chi2: e.chi2,
            degrees_of_freedom: e.degrees_of_freedom,
            minima: Vec::new(),
        }
    }

    /// At the origin, known exactly.
    pub fn nowhere() -> Self {
        PoseFigures {
            cam_from_target: core::Pose::identity(),
            covariance: Matrix6::zeros(),
            probability: 0.0,
            rms_px: 0.0,
            chi2: 0.0,
            degrees_of_freedom: 0,
            minima: Vec::new(),
        }
    }

    /// Of the translation of cam_from_target.
    fn sigma_translation_m(&self) -> [f64; 3] {
        translation_sigma_m(&self.cam_from_target, &self.covariance)
    }
}

impl PoseAnswer {
    pub fn figures(&self) -> &Figures {
        match &self.state {
            State::Solved(answer) => self.figures.get_or_init(|| Figures::from(&**answer)),
            State::Read(_, figures) => figures,
        }
    }

    fn pose(&self) -> Option<&PoseFigures> {
        self.figures().pose.as_ref()
    }

    /// What the change detector hears of it; none where there is no pose.
    pub fn reading(&self, t_s: f64) -> Option<Reading> {
        let pose = self.pose()?;
        let is_consistent = match &self.state {
            State::Solved(answer) => {
                let consistency = answer.estimate.as_ref().map(|e| e.consistency);
                matches!(consistency, Some(Consistency::Consistent))
            }
            State::Read(..) => self.figures().status != "inconsistent",
        };
        Some(Reading { t_s, a_from_b: pose.cam_from_target, covariance: pose.covariance, is_consistent })
    }

    /// The poses that fit, under another name of the view, for a hand–eye calibration.
    pub fn poses(&self, view: String) -> Result<ViewPoses, String> {
        match &self.state {
            State::Solved(answer) => Ok(ViewPoses::of_answer(view, answer)),
            State::Read(line, _) => Ok(ViewPoses { view, ..ViewPoses::of_line(line)? }),
        }
    }
}

/// Of three standard deviations.
pub fn largest(sigmas: [f64; 3]) -> f64 {
    sigmas.into_iter().fold(0.0, f64::max)
}

fn of_target(cam_from_target: core::Pose) -> Pose {
    Pose { pose: cam_from_target, b: "cam".to_owned(), a: "target".to_owned() }
}

impl Pose {
    /// Frames and translation.
    fn words(&self) -> String {
        let t = self.pose.translation;
        format!("{}_from_{} t ({:.4}, {:.4}, {:.4}) m", self.b, self.a, t.x, t.y, t.z)
    }
}
