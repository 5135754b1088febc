//! `resight.PoseAnswer`: the answer about one view; its JSON is that of the program.

use crate::arrays::array;
use crate::error;
use crate::pose::Pose;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use resight::core::PoseEstimate;
use resight::core::locate::consistency::Consistency;
use resight::core::temporal::monitor::Reading;
use resight::report::words::sigmas;

/// Status and sentence, and the pose where there is one.
#[pyclass(frozen, module = "resight")]
pub struct PoseAnswer {
    pub answer: Box<resight::PoseAnswer>,
}

impl From<resight::PoseAnswer> for PoseAnswer {
    fn from(answer: resight::PoseAnswer) -> Self {
        PoseAnswer { answer: Box::new(answer) }
    }
}

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

#[pymethods]
impl PoseAnswer {
    #[getter]
    fn status(&self) -> &'static str {
        self.answer.status().name()
    }

    #[getter]
    fn message(&self) -> &str {
        &self.answer.verdict.message
    }

    #[getter]
    fn view(&self) -> &str {
        &self.answer.view
    }

    #[getter]
    fn remarks(&self) -> Vec<String> {
        self.answer.remarks.clone()
    }

    #[getter]
    fn method(&self) -> Option<&'static str> {
        self.estimate().map(|e| resight::locate::method_name(e.method))
    }

    #[getter]
    fn n_points(&self) -> usize {
        self.answer.n_points
    }

    #[getter]
    fn cam_from_target(&self) -> Option<Pose> {
        self.estimate().map(|e| pose(e, false))
    }

    #[getter]
    fn target_from_cam(&self) -> Option<Pose> {
        self.estimate().map(|e| pose(e, true))
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        let rows = |e: &PoseEstimate| array(py, e.covariance.iter().copied().collect(), &[6, 6]); // Symmetric.
        self.estimate().map(rows).transpose()
    }

    #[getter]
    fn sigma_rad<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        self.estimate().map(|e| array(py, sigmas(&e.covariance).0.to_vec(), &[3])).transpose()
    }

    #[getter]
    fn sigma_m<'py>(&self, py: Python<'py>) -> PyResult<Option<Array<'py>>> {
        self.estimate().map(|e| array(py, sigmas(&e.covariance).1.to_vec(), &[3])).transpose()
    }

    #[getter]
    fn probability(&self) -> Option<f64> {
        self.estimate().map(|e| e.probability)
    }

    #[getter]
    fn rms_px(&self) -> Option<f64> {
        self.estimate().map(|e| e.rms_px)
    }

    #[getter]
    fn chi2(&self) -> Option<f64> {
        self.estimate().map(|e| e.chi2)
    }

    #[getter]
    fn degrees_of_freedom(&self) -> Option<usize> {
        self.estimate().map(|e| e.degrees_of_freedom)
    }

    /// The pose within the gate that fits as well, where the answer is ambiguous.
    #[getter]
    fn other_cam_from_target(&self) -> Option<Pose> {
        let estimate = self.estimate()?;
        let other = estimate.minima().skip(1).find(|h| h.is_alternative)?;
        Some(of_target(other.minimum.cam_from_target))
    }

    /// Every minimum, (k, 4, 4), the answer first.
    #[getter]
    fn minima<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let minima: Vec<f64> = self
            .estimate()
            .into_iter()
            .flat_map(PoseEstimate::minima)
            .flat_map(|h| h.minimum.cam_from_target.matrix().concat())
            .collect();
        let k = minima.len() / 16;
        array(py, minima, &[k, 4, 4])
    }

    /// The line that the program prints with --json.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        serde_json::to_string(&*self.answer).map_err(|reason| error::error(py, "write", reason.to_string()))
    }

    /// The same as plain Python values.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (self.to_json(py)?,))
    }

    fn __repr__(&self) -> String {
        let status = self.answer.status().name();
        let Some(estimate) = self.estimate() else {
            return format!("PoseAnswer({status}: {})", self.answer.verdict.message);
        };
        let (turn, shift) = sigmas(&estimate.covariance);
        format!(
            "PoseAnswer({status}, {} ± {:.2} mm, ± {:.3} deg)",
            pose(estimate, false).words(),
            1e3 * largest(shift),
            largest(turn).to_degrees()
        )
    }
}

impl PoseAnswer {
    /// What the change detector hears of it; none where there is no pose.
    pub fn reading(&self, t_s: f64) -> Option<Reading> {
        let estimate = self.estimate()?;
        Some(Reading {
            t_s,
            a_from_b: estimate.cam_from_target,
            covariance: estimate.covariance,
            is_consistent: matches!(estimate.consistency, Consistency::Consistent),
        })
    }

    fn estimate(&self) -> Option<&PoseEstimate> {
        self.answer.estimate.as_ref()
    }
}

/// Of three standard deviations.
pub fn largest(sigmas: [f64; 3]) -> f64 {
    sigmas.into_iter().fold(0.0, f64::max)
}

fn pose(estimate: &PoseEstimate, inverse: bool) -> Pose {
    let pose = of_target(estimate.cam_from_target);
    if inverse { Pose { pose: pose.pose.inverse(), b: pose.a, a: pose.b } } else { pose }
}

fn of_target(cam_from_target: resight::core::Pose) -> Pose {
    Pose { pose: cam_from_target, b: "cam".to_owned(), a: "target".to_owned() }
}

impl Pose {
    /// Frames and translation.
    fn words(&self) -> String {
        let t = self.pose.translation;
        format!("{}_from_{} t ({:.4}, {:.4}, {:.4}) m", self.b, self.a, t.x, t.y, t.z)
    }
}
