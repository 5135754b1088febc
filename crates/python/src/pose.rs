//! `resight.Pose`: a rigid transform between two named frames.

use crate::arrays::{Numbers, array};
use crate::{error, notebook};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyIterator, PyTuple};
use resight::core::{self, Point};

/// x_in_b = b_from_a · x_in_a.
#[pyclass(frozen, module = "resight")]
#[derive(Clone)]
pub struct Pose {
    pub pose: core::Pose,
    /// The frame that it leads to.
    #[pyo3(get)]
    pub b: String,
    /// The frame that it starts from.
    #[pyo3(get)]
    pub a: String,
}

#[pymethods]
impl Pose {
    /// From a homogeneous matrix (4, 4).
    #[staticmethod]
    #[pyo3(signature = (matrix, *, b="b", a="a"))]
    fn from_matrix(matrix: &Bound<'_, PyAny>, b: &str, a: &str) -> PyResult<Self> {
        let py = matrix.py();
        let numbers = Numbers::new("matrix", matrix)?;
        if numbers.shape() != [4, 4] {
            let shape = crate::arrays::words(numbers.shape());
            return Err(error::input(py, format!("matrix: shape {shape} is given, (4, 4) is needed")));
        }
        let rows: [f64; 16] = std::array::from_fn(|i| numbers.slice()[i]);
        let pose = rigid(&rows).ok_or_else(|| error::input(py, format!("matrix: {NOT_RIGID}")))?;
        Ok(Pose { pose, b: b.to_owned(), a: a.to_owned() })
    }

    /// From OpenCV's `rvec` (axis times angle, radians) and `tvec`, (3,) each.
    #[staticmethod]
    #[pyo3(signature = (rotation_vector, translation_m, *, b="b", a="a"))]
    fn from_vectors(
        rotation_vector: &Bound<'_, PyAny>,
        translation_m: &Bound<'_, PyAny>,
        b: &str,
        a: &str,
    ) -> PyResult<Self> {
        let turn = three("rotation_vector", rotation_vector)?;
        let shift = three("translation_m", translation_m)?;
        let turn = nalgebra::Vector6::new(turn[0], turn[1], turn[2], 0.0, 0.0, 0.0);
        let pose = core::Pose { translation: shift.into(), ..core::Pose::exp(&turn) };
        Ok(Pose { pose, b: b.to_owned(), a: a.to_owned() })
    }

    /// Homogeneous matrix (4, 4).
    #[getter]
    fn matrix<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array(py, self.pose.matrix().concat(), &[4, 4])
    }

    /// Rotation matrix (3, 3).
    #[getter]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array(py, self.pose.rotation.transpose().iter().copied().collect(), &[3, 3])
    }

    /// Translation (3,), metres: the origin of frame a seen in frame b.
    #[getter]
    fn translation_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        array(py, self.pose.translation.iter().copied().collect(), &[3])
    }

    /// Unit quaternion w, x, y, z with w ≥ 0.
    #[getter]
    fn rotation_wxyz(&self) -> [f64; 4] {
        self.pose.quaternion_wxyz()
    }

    /// OpenCV's `rvec`: axis times angle, radians, (3,).
    #[getter]
    fn rotation_vector<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let turn = core::Pose::new(self.pose.rotation, nalgebra::Vector3::zeros());
        array(py, turn.log().iter().take(3).copied().collect(), &[3])
    }

    /// The inverse pose, a_from_b.
    fn inverse(&self) -> Self {
        self.inverted()
    }

    /// `R, t = pose`: the rotation matrix (3, 3) and the translation (3,), metres.
    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        (self.rotation(py)?, self.translation_m(py)?).into_pyobject(py)?.try_iter()
    }

    /// Poses are equal that have the same frames and the same numbers, to the last bit.
    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Pose>().is_ok_and(|other| {
            let other = other.get();
            self.pose == other.pose && self.b == other.b && self.a == other.a
        })
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        let numbers: Vec<f64> = self.pose.matrix().concat().into_iter().map(|x| x + 0.0).collect(); // −0 is 0.
        (PyTuple::new(py, numbers)?, &self.b, &self.a).into_pyobject(py)?.hash()
    }

    /// `c_from_b @ b_from_a` is `c_from_a`; `b_from_a @ points` (n, 3) are the points in b.
    fn __matmul__<'py>(&self, py: Python<'py>, other: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        if let Ok(right) = other.cast::<Pose>() {
            let right = right.get();
            if self.a != right.b {
                let (c, b, d, a) = (&self.b, &self.a, &right.b, &right.a);
                return Err(error::input(
                    py,
                    format!("{c}_from_{b} @ {d}_from_{a}: the inner frames differ"),
                ));
            }
            let product = Pose { pose: self.pose * right.pose, b: self.b.clone(), a: right.a.clone() };
            return Ok(product.into_pyobject(py)?.into_any());
        }
        let numbers = Numbers::new("points", other)?;
        let rows = numbers.rows::<3>("points")?;
        let moved = rows.iter().map(|x| self.pose.rotation * Point::from(*x) + self.pose.translation);
        let moved: Vec<f64> = moved.flat_map(<[f64; 3]>::from).collect();
        Ok(array(py, moved, &[rows.len(), 3])?.into_any())
    }

    /// How `pickle` and `copy` make it again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, PoseParts<'py>)> {
        let parts = (self.matrix(py)?, self.b.clone(), self.a.clone());
        Ok((py.import("resight._make")?.getattr("pose")?, parts))
    }

    /// What a notebook shows.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let t = self.pose.translation;
        let turn = self.pose.log();
        let rows = [
            ("pose", format!("{}_from_{}", self.b, self.a)),
            ("translation", format!("({:.4}, {:.4}, {:.4}) m", t.x, t.y, t.z)),
            (
                "rotation",
                format!(
                    "({:.3}, {:.3}, {:.3}) deg, axis times angle",
                    turn[0].to_degrees(),
                    turn[1].to_degrees(),
                    turn[2].to_degrees()
                ),
            ),
        ];
        notebook::named(py, rows)
    }

    fn __repr__(&self) -> String {
        let t = self.pose.translation;
        let angle = core::Pose::identity().angle_to_rad(&self.pose).to_degrees();
        format!(
            "Pose({}_from_{}: t ({:.4}, {:.4}, {:.4}) m, rotation {angle:.2} deg)",
            self.b, self.a, t.x, t.y, t.z
        )
    }
}

impl Pose {
    /// The inverse pose, a_from_b.
    pub fn inverted(&self) -> Self {
        Pose { pose: self.pose.inverse(), b: self.a.clone(), a: self.b.clone() }
    }
}

/// A pose's matrix and the names of its frames.
type PoseParts<'py> = (Bound<'py, PyArrayDyn<f64>>, String, String);

pub const NOT_RIGID: &str = "no rigid transform (a rotation matrix, a translation and 0, 0, 0, 1 are needed)";

/// A homogeneous matrix, row by row; none where it is no rigid transform to 1e-6.
pub fn rigid(m: &[f64; 16]) -> Option<core::Pose> {
    let rotation = nalgebra::Matrix3::from_fn(|i, j| m[4 * i + j]);
    let defect = (rotation.transpose() * rotation - nalgebra::Matrix3::identity()).norm();
    let is_rigid = defect < 1e-6 && 0.0 < rotation.determinant() && m[12..] == [0.0, 0.0, 0.0, 1.0];
    let translation = nalgebra::Vector3::new(m[3], m[7], m[11]);
    (is_rigid && m.iter().all(|x| x.is_finite())).then(|| core::Pose::new(rotation, translation))
}

fn three(name: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; 3]> {
    let numbers = Numbers::new(name, value)?;
    let shape = crate::arrays::words(numbers.shape());
    let three = <[f64; 3]>::try_from(numbers.slice()).ok().filter(|_| numbers.shape() == [3]);
    let three = three
        .ok_or_else(|| error::input(value.py(), format!("{name}: shape {shape} is given, (3,) is needed")))?;
    match three.iter().all(|x| x.is_finite()) {
        true => Ok(three),
        false => Err(error::input(value.py(), format!("{name}: a number is not finite"))),
    }
}
