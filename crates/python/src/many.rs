//! Many views at once, on the vector kernel of `core::batch` where there are three or four points.

use crate::arrays::{Numbers, array, words};
use crate::camera::Camera;
use crate::answer::largest;
use crate::error;
use crate::run::here;
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use resight::core::batch::{Given, Views, locate_each, locate_each_of_three};
use resight::core::locate::choose::Ambiguity;
use resight::core::locate::consistency::Consistency;
use resight::core::locate::{Config, PoseEstimate, locate};
use resight::core::{Correspondence, Error as MathError, Pixel, Point};
use resight::report::words::sigmas;
use std::ops::Range;

type Answers = Vec<Result<PoseEstimate, MathError>>;

/// Poses of many views, as arrays. Rows of views without a pose are zero, and their status says why.
#[pyclass(frozen, module = "resight")]
pub struct Poses {
    /// Of each block of views.
    answers: Vec<Answers>,
    /// Points of each view.
    n_points: Vec<usize>,
}

#[pymethods]
impl Poses {
    fn __len__(&self) -> usize {
        self.n_points.len()
    }

    /// Homogeneous matrices, (n, 4, 4).
    #[getter]
    fn cam_from_target<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.each(py, &[4, 4], |e, out| out.copy_from_slice(&e.cam_from_target.matrix().concat()))
    }

    /// Covariances of `[rotation_rad; translation_m]`, camera frame, (n, 6, 6).
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.each(py, &[6, 6], |e, out| out.copy_from_slice(e.covariance.as_slice()))
    }

    /// Probability of each pose among all that were found, (n,).
    #[getter]
    fn probability<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.each(py, &[], |e, out| out[0] = e.probability)
    }

    /// Sum of squared residuals over their variances, (n,).
    #[getter]
    fn chi2<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.each(py, &[], |e, out| out[0] = e.chi2)
    }

    /// Root mean square reprojection error, px, (n,).
    #[getter]
    fn rms_px<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.each(py, &[], |e, out| out[0] = e.rms_px)
    }

    /// Status of each view.
    #[getter]
    fn status(&self) -> Vec<&'static str> {
        self.answers().map(status).collect()
    }

    /// Which views are `ok`, (n,) of bool.
    #[getter]
    fn is_ok<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_vec(py, self.answers().map(|answer| status(answer) == "ok").collect())
    }

    /// Why a view has no pose; none where it has one.
    fn error(&self, py: Python<'_>, view: usize) -> PyResult<Option<String>> {
        match self.answers().nth(view) {
            Some(answer) => Ok(answer.as_ref().err().map(ToString::to_string)),
            None => {
                Err(error::input(py, format!("view {view} is asked for, there are {}", self.__len__())))
            }
        }
    }

    fn __repr__(&self) -> String {
        let ok: Vec<&PoseEstimate> =
            self.answers().filter(|answer| status(answer) == "ok").filter_map(|answer| answer.as_ref().ok()).collect();
        let counted = format!("{} views cam_from_target, {} ok", self.__len__(), ok.len());
        let typical = |of: fn(&PoseEstimate) -> f64| {
            let mut sigmas: Vec<f64> = ok.iter().map(|e| of(e)).collect();
            sigmas.sort_by(f64::total_cmp);
            sigmas.get(sigmas.len() / 2).copied()
        };
        match (typical(|e| largest(sigmas(&e.covariance).1)), typical(|e| largest(sigmas(&e.covariance).0))) {
            (Some(shift_m), Some(turn_rad)) => {
                let (shift_mm, turn_deg) = (1e3 * shift_m, turn_rad.to_degrees());
                format!("Poses({counted}, median ± {shift_mm:.2} mm, ± {turn_deg:.3} deg)")
            }
            _ => format!("Poses({counted})"),
        }
    }
}

impl Poses {
    /// Index, number of points, answer and status of each view.
    pub fn rows(
        &self,
    ) -> impl Iterator<Item = (usize, usize, &Result<PoseEstimate, MathError>, &'static str)> {
        let answers = self.answers().zip(&self.n_points).enumerate();
        answers.map(|(view, (answer, n_points))| (view, *n_points, answer, status(answer)))
    }

    fn answers(&self) -> impl Iterator<Item = &Result<PoseEstimate, MathError>> {
        self.answers.iter().flatten()
    }

    fn each<'py>(
        &self,
        py: Python<'py>,
        shape: &[usize],
        write: impl Fn(&PoseEstimate, &mut [f64]),
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let size: usize = shape.iter().product();
        let mut values = vec![0.0; size * self.__len__()];
        for (answer, out) in self.answers().zip(values.chunks_exact_mut(size)) {
            if let Ok(estimate) = answer {
                write(estimate, out);
            }
        }
        array(py, values, &[&[self.__len__()], shape].concat())
    }
}

/// The one rule of `report::verdict`, without its words.
fn status(answer: &Result<PoseEstimate, MathError>) -> &'static str {
    match answer {
        Ok(e) if !matches!(e.consistency, Consistency::Consistent) => "inconsistent",
        Ok(PoseEstimate { ambiguity: Ambiguity::Ambiguous { .. }, .. }) => "ambiguous",
        Ok(_) => "ok",
        Err(_) => "degenerate",
    }
}

/// Poses of many views of one target by one camera.
#[pyfunction]
#[pyo3(signature = (points_m, pixels, camera, *, offsets=None, sigma_px=0.5))]
pub fn solve_many<'py>(
    py: Python<'py>,
    points_m: &Bound<'py, PyAny>,
    pixels: &Bound<'py, PyAny>,
    camera: &Camera,
    offsets: Option<Vec<usize>>,
    sigma_px: f64,
) -> PyResult<Poses> {
    if camera.known.intrinsics_covariance.is_some() {
        let message = "solve_many takes the intrinsics as exact, and this camera states how uncertain they are; use solve";
        return Err(error::input(py, message));
    }
    let (points, seen) = (Numbers::new("points_m", points_m)?, Numbers::new("pixels", pixels)?);
    match offsets {
        None => {
            let answers = together(py, &points, &seen, camera, sigma_px)?;
            Ok(Poses { answers, n_points: vec![seen.shape()[1]; seen.shape()[0]] })
        }
        Some(offsets) => {
            let (points, seen) = (points.rows::<3>("points_m")?, seen.rows::<2>("pixels")?);
            check_offsets(py, &offsets, points.len(), seen.len())?;
            let of = |view: usize| {
                let rows = offsets[view]..offsets[view + 1];
                alone(&points[rows.clone()], &seen[rows], camera, sigma_px)
            };
            let answers = in_blocks(py, offsets.len() - 1, |views| views.map(of).collect())?;
            Ok(Poses { answers, n_points: offsets.windows(2).map(|w| w[1] - w[0]).collect() })
        }
    }
}

fn check_offsets(py: Python<'_>, offsets: &[usize], points: usize, pixels: usize) -> PyResult<()> {
    let rises = offsets.windows(2).all(|w| w[0] <= w[1]);
    if points != pixels || offsets.first() != Some(&0) || offsets.last() != Some(&points) || !rises {
        let message = format!(
            "offsets: they start with 0, never fall and end with the number of points; {points} points_m and {pixels} pixels are given"
        );
        return Err(error::input(py, message));
    }
    Ok(())
}

/// Views that are solved between two looks for Ctrl-C: a tenth of a second at most.
const BLOCK: usize = 10_000;

fn in_blocks(py: Python<'_>, n: usize, of: impl Fn(Range<usize>) -> Answers + Sync) -> PyResult<Vec<Answers>> {
    let mut answers = Vec::with_capacity(n.div_ceil(BLOCK));
    for first in (0..n).step_by(BLOCK) {
        answers.push(here(py, || of(first..n.min(first + BLOCK)))?);
        py.check_signals()?;
    }
    Ok(answers)
}

/// `pixels` (n, k, 2); `points_m` (k, 3) for all, or (n, k, 3).
fn together(
    py: Python<'_>,
    points: &Numbers,
    pixels: &Numbers,
    camera: &Camera,
    sigma_px: f64,
) -> PyResult<Vec<Answers>> {
    let (n, k) = match *pixels.shape() {
        [n, k, 2] if 0 < k => (n, k),
        ref shape => {
            let message = format!("pixels: shape {} is given, (n, k, 2) is needed", words(shape));
            return Err(error::input(py, message));
        }
    };
    let is_shared = points.shape() == [k, 3];
    if !is_shared && points.shape() != [n, k, 3] {
        let shape = words(points.shape());
        let message = format!("points_m: shape {shape} is given, ({k}, 3) or ({n}, {k}, 3) is needed");
        return Err(error::input(py, message));
    }
    let (points, pixels) = (points.slice(), pixels.slice());
    in_blocks(py, n, |views| {
        let points = if is_shared { points } else { &points[3 * k * views.start..3 * k * views.end] };
        let pixels = &pixels[2 * k * views.start..2 * k * views.end];
        match k {
            4 => of_four(points, is_shared, pixels, camera, sigma_px),
            3 => of_three(points, is_shared, pixels, camera, sigma_px),
            _ => {
                let (points, _) = points.as_chunks::<3>();
                let (pixels, _) = pixels.as_chunks::<2>();
                let of = |view: usize| if is_shared { points } else { &points[view * k..(view + 1) * k] };
                let pixels = pixels.chunks_exact(k).enumerate();
                pixels.map(|(view, seen)| alone(of(view), seen, camera, sigma_px)).collect()
            }
        }
    })
}

fn of_four(points: &[f64], is_shared: bool, pixels: &[f64], camera: &Camera, sigma_px: f64) -> Answers {
    let points: &[[Point; 4]] = bytemuck::cast_slice(points);
    let views = Views {
        camera: Given::Shared(&camera.known.camera),
        points_in_target: if is_shared { Given::Shared(&points[0]) } else { Given::Each(points) },
        pixels: bytemuck::cast_slice(pixels),
        sigma_px: Given::Shared(&[sigma_px; 4]),
    };
    let mut answers = Vec::new();
    match locate_each(&views, &mut answers) {
        Ok(_) => answers,
        Err(reason) => vec![Err(reason); views.pixels.len()],
    }
}

fn of_three(points: &[f64], is_shared: bool, pixels: &[f64], camera: &Camera, sigma_px: f64) -> Answers {
    let points: &[[Point; 3]] = bytemuck::cast_slice(points);
    let views = Views::<3> {
        camera: Given::Shared(&camera.known.camera),
        points_in_target: if is_shared { Given::Shared(&points[0]) } else { Given::Each(points) },
        pixels: bytemuck::cast_slice(pixels),
        sigma_px: Given::Shared(&[sigma_px; 3]),
    };
    let mut answers = Vec::new();
    match locate_each_of_three(&views, &mut answers) {
        Ok(_) => answers,
        Err(reason) => vec![Err(reason); views.pixels.len()],
    }
}

fn alone(
    points: &[[f64; 3]],
    pixels: &[[f64; 2]],
    camera: &Camera,
    sigma_px: f64,
) -> Result<PoseEstimate, MathError> {
    let camera = &camera.known.camera;
    let one = |(x, [u, v]): (&[f64; 3], &[f64; 2])| {
        Correspondence::new(camera, Point::from(*x), Pixel::new(*u, *v), sigma_px)
    };
    let seen: Vec<Correspondence> = points.iter().zip(pixels).map(one).collect::<Result<_, _>>()?;
    locate(&seen, camera, &Config::default())
}
