//! Many views at once, on the vector kernel of `core::batch` where there are three or four points.

use crate::answer::{PoseFigures, Row, largest};
use crate::arrays::{Numbers, array, words};
use crate::camera::Camera;
use crate::error;
use crate::points::MANY_POINTS;
use crate::pose::rigid;
use crate::run::{Heard, here, run};
use numpy::{PyArray1, PyArrayDyn};
use pyo3::prelude::*;
use resight::core::batch::{Given, Views, locate_each, locate_each_of_three};
use resight::core::correspondence::without_equals;
use resight::core::locate::choose::Ambiguity;
use resight::core::locate::consistency::Consistency;
use resight::core::locate::{Config, PoseEstimate, locate};
use resight::core::{Camera as Lens, Correspondence, Error as MathError, Matrix6, Pixel, Point};
use resight::formats::plausible::of_points;
use resight::locate::is_missing;
use resight::report::words::sigmas;
use std::ops::Range;
use std::time::{Duration, Instant};

type Answers = Vec<Result<PoseEstimate, MathError>>;

/// Poses of many views, cam_from_target, as arrays. Rows of views without a pose are zero, and their status says why.
#[pyclass(frozen, module = "resight")]
pub struct Poses {
    views: Vec<View>,
}

/// The pose of a view, or why there is none.
struct View {
    status: &'static str,
    n_points: usize,
    pose: Result<PoseFigures, String>,
}

/// What is known of a view before it is solved.
struct Asked {
    n_points: usize,
    /// Whether its points may be in metres.
    is_plausible: bool,
}

impl View {
    fn new(answer: &Result<PoseEstimate, MathError>, Asked { n_points, is_plausible }: Asked) -> Self {
        let pose = answer.as_ref().map(PoseFigures::without_minima).map_err(ToString::to_string);
        let status = match status(answer) {
            "ok" if !is_plausible => "implausible",
            status => status,
        };
        View { status, n_points, pose }
    }
}

fn is_plausible(points: &[[f64; 3]]) -> bool {
    of_points(bytemuck::cast_slice(points)).is_none()
}

/// What `pickle` keeps of `Poses`: status, number of points and error of each view; matrices, covariances, probabilities, χ² and residuals.
type Kept<'py> = (Vec<String>, Vec<usize>, Vec<Option<String>>, [Bound<'py, PyArrayDyn<f64>>; 5]);

#[pymethods]
impl Poses {
    fn __len__(&self) -> usize {
        self.views.len()
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

    /// Of each view, as of `PoseAnswer`.
    #[getter]
    fn status(&self) -> Vec<&'static str> {
        self.views.iter().map(|view| view.status).collect()
    }

    /// Which views are `ok`, (n,).
    #[getter]
    fn is_ok<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_vec(py, self.views.iter().map(|view| view.status == "ok").collect())
    }

    /// Why a view has no pose; None where it has one.
    fn error(&self, py: Python<'_>, view: usize) -> PyResult<Option<String>> {
        match self.views.get(view) {
            Some(view) => Ok(view.pose.as_ref().err().cloned()),
            None => Err(error::input(py, format!("view {view} is asked for, there are {}", self.__len__()))),
        }
    }

    /// What `__reduce__` kept.
    #[staticmethod]
    fn _of(py: Python<'_>, kept: Kept<'_>) -> PyResult<Self> {
        let (status, n_points, errors, arrays) = kept;
        let (n, wrong) = (status.len(), || error::input(py, "these are no poses that were pickled"));
        let [matrices, covariances, rest @ ..] =
            arrays.each_ref().map(|array| Numbers::new("poses", array.as_any()));
        let (matrices, covariances) = (matrices?, covariances?);
        let [probability, chi2, rms_px] = rest;
        let rest = [probability?, chi2?, rms_px?];
        let fits = [n_points.len(), errors.len()].iter().all(|m| *m == n)
            && (matrices.shape(), covariances.shape()) == (&[n, 4, 4][..], &[n, 6, 6][..])
            && rest.iter().all(|numbers| numbers.shape() == [n]);
        if !fits {
            return Err(wrong());
        }
        let rows = status.iter().zip(n_points).zip(errors).enumerate();
        let view = |(i, ((status, n_points), error)): (usize, ((&String, usize), Option<String>))| {
            let status = STATUS.into_iter().find(|known| known == status).ok_or_else(wrong)?;
            let pose = match error {
                Some(reason) => Err(reason),
                None => {
                    let matrix: [f64; 16] = std::array::from_fn(|k| matrices.slice()[16 * i + k]);
                    Ok(PoseFigures {
                        cam_from_target: rigid(&matrix).ok_or_else(wrong)?,
                        covariance: Matrix6::from_fn(|j, k| covariances.slice()[36 * i + 6 * j + k]),
                        probability: rest[0].slice()[i],
                        chi2: rest[1].slice()[i],
                        rms_px: rest[2].slice()[i],
                        ..PoseFigures::nowhere()
                    })
                }
            };
            Ok(View { status, n_points, pose })
        };
        Ok(Poses { views: rows.map(view).collect::<PyResult<_>>()? })
    }

    /// How `pickle` and `copy` make them again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Kept<'py>,))> {
        let numbers = [
            self.cam_from_target(py)?,
            self.covariance(py)?,
            self.probability(py)?,
            self.chi2(py)?,
            self.rms_px(py)?,
        ];
        let status = self.views.iter().map(|view| view.status.to_owned()).collect();
        let n_points = self.views.iter().map(|view| view.n_points).collect();
        let errors = self.views.iter().map(|view| view.pose.as_ref().err().cloned()).collect();
        Ok((py.get_type::<Poses>().getattr("_of")?, ((status, n_points, errors, numbers),)))
    }

    fn __repr__(&self) -> String {
        let is_ok = |view: &&View| view.status == "ok";
        let ok: Vec<&PoseFigures> =
            self.views.iter().filter(is_ok).filter_map(|v| v.pose.as_ref().ok()).collect();
        let counted = format!("{} views cam_from_target, {} ok", self.__len__(), ok.len());
        let typical = |of: fn(&PoseFigures) -> f64| {
            let mut sigmas: Vec<f64> = ok.iter().map(|pose| of(pose)).collect();
            sigmas.sort_by(f64::total_cmp);
            sigmas.get(sigmas.len() / 2).copied()
        };
        match (typical(|e| largest(sigmas(&e.covariance).1)), typical(|e| largest(sigmas(&e.covariance).0))) {
            (Some(shift_m), Some(turn_rad)) => {
                let (shift_mm, turn_deg) = (1e3 * shift_m, turn_rad.to_degrees());
                format!(
                    "Poses({counted}; camera's position ± {shift_mm:.2} mm, rotation ± {turn_deg:.3} deg in the median)"
                )
            }
            _ => format!("Poses({counted})"),
        }
    }
}

impl Poses {
    /// As a table has them.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.views.iter().enumerate().map(|(i, view)| Row {
            view: i.to_string(),
            status: view.status,
            message: view.pose.as_ref().err().map_or("", String::as_str),
            n_points: view.n_points,
            pose: view.pose.as_ref().ok(),
        })
    }

    fn each<'py>(
        &self,
        py: Python<'py>,
        shape: &[usize],
        write: impl Fn(&PoseFigures, &mut [f64]),
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let size: usize = shape.iter().product();
        let mut values = vec![0.0; size * self.__len__()];
        for (view, out) in self.views.iter().zip(values.chunks_exact_mut(size)) {
            if let Ok(pose) = &view.pose {
                write(pose, out);
            }
        }
        array(py, values, &[&[self.__len__()], shape].concat())
    }
}

/// What `status` says.
const STATUS: [&str; 5] = ["ok", "implausible", "ambiguous", "inconsistent", "degenerate"];

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
#[pyo3(signature = (points_m, pixels, camera, *, offsets=None, sigma_px=0.5, progress=None))]
pub fn solve_many<'py>(
    py: Python<'py>,
    points_m: &Bound<'py, PyAny>,
    pixels: &Bound<'py, PyAny>,
    camera: &Camera,
    offsets: Option<Vec<usize>>,
    sigma_px: f64,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Poses> {
    if camera.known.intrinsics_covariance.is_some() {
        let message = "solve_many takes the intrinsics as exact, and this camera states how uncertain they are; use solve";
        return Err(error::input(py, message));
    }
    let (points, seen) = (Numbers::new("points_m", points_m)?, Numbers::new("pixels", pixels)?);
    let progress = Heard::new(py, progress)?;
    match offsets {
        None => together(py, &points, &seen, (&camera.known.camera, sigma_px), &progress),
        Some(offsets) => {
            let (points, seen) = (points.rows::<3>("points_m")?, seen.rows::<2>("pixels")?);
            check_offsets(py, &offsets, points.len(), seen.len())?;
            let view = |view: usize| {
                let rows = offsets[view]..offsets[view + 1];
                (&points[rows.clone()], &seen[rows])
            };
            let n = offsets.len() - 1;
            let longest = offsets.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0);
            each_alone(py, n, longest, view, (&camera.known.camera, sigma_px), &progress)
        }
    }
}

/// How many points of a view were seen.
fn n_seen(pixels: &[[f64; 2]]) -> usize {
    pixels.iter().filter(|pixel| !is_missing(pixel)).count()
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

/// Views solved at once at most, and at first: between two blocks Ctrl-C takes effect and progress is reported.
const BLOCK: Range<usize> = 1..10_000;
/// How long a block should take: shorter ones grow, longer ones shrink.
const BLOCK_TAKES: Duration = Duration::from_millis(20);

fn in_blocks(
    py: Python<'_>,
    n: usize,
    of: impl Fn(Range<usize>) -> Answers + Sync,
    asked: impl Fn(usize) -> Asked,
    progress: &Heard,
) -> PyResult<Poses> {
    let (mut views, mut first, mut size) = (Vec::new(), 0, BLOCK.start);
    while first < n {
        let last = n.min(first + size);
        let begun = Instant::now();
        let answers = here(py, || of(first..last))?;
        views.extend((first..).zip(&answers).map(|(i, answer)| View::new(answer, asked(i))));
        size = if begun.elapsed() < BLOCK_TAKES { BLOCK.end.min(2 * size) } else { 1.max(size / 2) };
        first = last;
        py.check_signals()?;
        progress.done(first, n)?;
    }
    Ok(Poses { views })
}

/// Lens and standard deviation of a pixel coordinate.
type Seen<'a> = (&'a Lens, f64);

/// Views of any number of points each; the largest has `longest`.
fn each_alone<'a>(
    py: Python<'_>,
    n: usize,
    longest: usize,
    view: impl Fn(usize) -> (&'a [[f64; 3]], &'a [[f64; 2]]) + Sync,
    (lens, sigma_px): Seen,
    progress: &Heard,
) -> PyResult<Poses> {
    let asked = |i| {
        let (points, pixels) = view(i);
        Asked { n_points: n_seen(pixels), is_plausible: is_plausible(points) }
    };
    if longest < MANY_POINTS {
        let of = |i| {
            let (points, pixels) = view(i);
            alone(points, pixels, (lens, sigma_px))
        };
        return in_blocks(py, n, |views| views.map(of).collect(), asked, progress);
    }
    let mut views = Vec::with_capacity(n);
    for i in 0..n {
        let (points, pixels, lens) = (view(i).0.to_vec(), view(i).1.to_vec(), lens.clone());
        let answer = run(py, None, move |_| alone(&points, &pixels, (&lens, sigma_px)))?;
        views.push(View::new(&answer, asked(i)));
        progress.done(i + 1, n)?;
    }
    Ok(Poses { views })
}

/// `pixels` (n, k, 2); `points_m` (k, 3) for all, or (n, k, 3).
fn together(
    py: Python<'_>,
    points: &Numbers,
    pixels: &Numbers,
    with: Seen,
    progress: &Heard,
) -> PyResult<Poses> {
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
    let (points, pixels) = (points.slice().as_chunks::<3>().0, pixels.slice().as_chunks::<2>().0);
    let view = |i: usize| {
        let points = if is_shared { points } else { &points[i * k..(i + 1) * k] };
        (points, &pixels[i * k..(i + 1) * k])
    };
    match k {
        3 | 4 => {
            let on_lanes = |views: Range<usize>| {
                let points = if is_shared { points } else { &points[k * views.start..k * views.end] };
                let seen = &pixels[k * views.start..k * views.end];
                let mut answers = match k {
                    4 => of_four(points, is_shared, seen, with),
                    _ => of_three(points, is_shared, seen, with),
                };
                // A view in which a point was not seen is none of the kernel's.
                for (i, answer) in views.zip(&mut answers) {
                    let (points, pixels) = view(i);
                    if n_seen(pixels) < k {
                        *answer = alone(points, pixels, with);
                    }
                }
                answers
            };
            let shared = is_shared.then(|| is_plausible(points));
            let asked = |i| {
                let (points, pixels) = view(i);
                let is_plausible = shared.unwrap_or_else(|| is_plausible(points));
                Asked { n_points: n_seen(pixels), is_plausible }
            };
            in_blocks(py, n, on_lanes, asked, progress)
        }
        _ => each_alone(py, n, k, view, with, progress),
    }
}

fn of_four(points: &[[f64; 3]], is_shared: bool, pixels: &[[f64; 2]], (lens, sigma_px): Seen) -> Answers {
    let points: &[[Point; 4]] = bytemuck::cast_slice(points);
    let views = Views {
        camera: Given::Shared(lens),
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

fn of_three(points: &[[f64; 3]], is_shared: bool, pixels: &[[f64; 2]], (lens, sigma_px): Seen) -> Answers {
    let points: &[[Point; 3]] = bytemuck::cast_slice(points);
    let views = Views::<3> {
        camera: Given::Shared(lens),
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
    (lens, sigma_px): Seen,
) -> Result<PoseEstimate, MathError> {
    let one = |(x, [u, v]): (&[f64; 3], &[f64; 2])| {
        Correspondence::new(lens, Point::from(*x), Pixel::new(*u, *v), sigma_px)
    };
    let seen = points.iter().zip(pixels).filter(|(_, pixel)| !is_missing(pixel));
    let seen: Vec<Correspondence> = seen.map(one).collect::<Result<_, _>>()?;
    locate(&without_equals(seen), lens, &Config::default())
}
