//! The kernel on plain columns: views in, poses out, row by row and whatever else is in the batch.
//!
//! Three and four points of one view go to the vectors of `core::batch`, others to `locate`. Rows are worked on camera by camera, so that
//! neighbours in a vector share their target; where a row's answer stands, and every bit of it, does not depend on that.

use crate::answers::{Answers, Fault};
use crate::cameras::{Cameras, UNKNOWN};
use resight::core::batch::{Given, Views, locate_each_of_three_with, locate_each_with};
use resight::core::correspondence::without_equals;
use resight::core::locate::{Config, PoseEstimate, locate};
use resight::core::{Camera, Correspondence, Error as MathError, Pixel, Point};
use resight::formats::plausible;
use resight::report::verdict::Status;
use std::array::from_fn;
use std::sync::Arc;

/// One number of each row at a time, from a column of its own or from rows that lie side by side; what is missing is NaN.
#[derive(Debug, Clone, Copy)]
pub enum Numbers<'a> {
    /// `columns[i][row]`.
    Columns(&'a [&'a [f64]]),
    /// `values[row · width + i]`, as a NumPy array of shape (rows, width) holds them.
    Rows {
        /// All of them.
        values: &'a [f64],
        /// Numbers a row.
        width: usize,
    },
    /// `values[offsets[row] + i]`; a row ends where the next one begins.
    Lists {
        /// All of them.
        values: &'a [f64],
        /// One more than there are rows, never falling.
        offsets: &'a [usize],
    },
}

impl Numbers<'_> {
    /// How many numbers a row has.
    #[inline]
    pub fn width(&self, row: usize) -> usize {
        match self {
            Numbers::Columns(columns) => columns.len(),
            Numbers::Rows { width, .. } => *width,
            Numbers::Lists { offsets, .. } => match offsets.get(row..row + 2) {
                Some([from, to]) => to.saturating_sub(*from),
                _ => 0,
            },
        }
    }

    /// One of them; NaN where there is none.
    #[inline]
    pub fn at(&self, row: usize, i: usize) -> f64 {
        let found = match self {
            Numbers::Columns(columns) => columns.get(i).and_then(|column| column.get(row)),
            Numbers::Rows { values, width } => values.get(row * width + i).filter(|_| i < *width),
            Numbers::Lists { values, offsets } => {
                offsets.get(row).and_then(|from| values.get(from + i)).filter(|_| i < self.width(row))
            }
        };
        found.copied().unwrap_or(f64::NAN)
    }
}

/// Views to solve, one a row.
#[derive(Debug, Clone, Copy)]
pub struct ViewColumns<'a> {
    /// The camera's number; `UNKNOWN` where the table has none of that name.
    pub camera: &'a [u32],
    /// `u0, v0, u1, v1, …` of each row, px.
    pub pixels: Numbers<'a>,
    /// `x0, y0, z0, x1, …` of each row, metres; none: those of the camera.
    pub points_m: Option<Numbers<'a>>,
    /// Standard deviation of every pixel coordinate of a row, px; none: `sigma_px` for all.
    pub sigma_px: Option<&'a [f64]>,
}

/// What is the same for all rows.
#[derive(Debug, Clone)]
pub struct Solver {
    /// The cameras, by number.
    pub cameras: Arc<Cameras>,
    /// Standard deviation of pixel coordinates where no row states its own, px.
    pub sigma_px: f64,
}

/// As many views are gathered at a time, so that what is known about them stays near.
const BLOCK: usize = 256;
/// Points of one view that are accepted; more is no view but a mistake in the columns.
const MOST_POINTS: usize = 100_000;
/// Squares of larger numbers, and their products, leave the range of numbers.
const LARGEST: f64 = 1e60;

impl Solver {
    /// Poses of all rows, in their order. Never fails: what is wrong with a row is its status, with a reason, and its neighbours are
    /// left alone to the last bit.
    pub fn solve(&self, views: &ViewColumns) -> Answers {
        let mut answers = Answers::new(views.camera.len());
        let mut rows: [Vec<u32>; 3] = Default::default();
        for row in 0..views.camera.len() {
            match self.check(views, row) {
                Err(fault) => answers.refuse(row, &fault),
                Ok(n_points) => {
                    answers.n_points[row] = n_points as u32;
                    let kind = match n_points {
                        _ if self.repeats(views, row, n_points) => 2,
                        4 => 0,
                        3 => 1,
                        _ => 2,
                    };
                    rows[kind].push(row as u32);
                }
            }
        }
        let [four, three, many] = &mut rows;
        for rows in [&mut *four, &mut *three, &mut *many] {
            rows.sort_by_key(|row| views.camera[*row as usize]); // Stable: rows of a camera stay in their order.
        }
        for block in four.chunks(BLOCK) {
            let some = self.gather(views, block);
            let done = locate_each_with(&some.views(), |i, solved| answers.set(block[i] as usize, &solved));
            answers.set_all(block, done);
        }
        for block in three.chunks(BLOCK) {
            let some = self.gather(views, block);
            let done =
                locate_each_of_three_with(&some.views(), |i, solved| answers.set(block[i] as usize, &solved));
            answers.set_all(block, done);
        }
        for row in many {
            answers.set(*row as usize, &self.solve_alone(views, *row as usize));
        }
        self.check_sizes(views, &mut answers);
        answers
    }

    /// Changes rows that are `ok` to `implausible` where their points are hardly in metres; each row is judged by its own points.
    fn check_sizes(&self, views: &ViewColumns, answers: &mut Answers) {
        let mut points = Vec::new();
        for (row, camera) in views.camera.iter().enumerate() {
            if answers.status[row] != Status::Ok {
                continue;
            }
            let remark = match &views.points_m {
                None => self.cameras.size_remark(*camera).map(str::to_string),
                Some(_) => {
                    points.clear();
                    points.extend((0..answers.n_points[row] as usize).map(|k| self.point(views, row, k)));
                    plausible::of_points(&points)
                }
            };
            if let Some(remark) = remark {
                answers.doubt_size(row, remark);
            }
        }
    }

    /// How many points a row has.
    fn check(&self, views: &ViewColumns, row: usize) -> Result<usize, Fault> {
        let number = views.camera[row];
        if number == UNKNOWN || self.cameras.len() <= number as usize {
            return Err(Fault::UnknownCamera);
        }
        let seen = views.pixels.width(row);
        let known = match (&views.points_m, self.cameras.points(number)) {
            (Some(points), _) => points.width(row),
            (None, Some(points)) => 3 * points.len(),
            (None, None) => return Err(Fault::NoPoints),
        };
        if !seen.is_multiple_of(2)
            || !known.is_multiple_of(3)
            || seen / 2 != known / 3
            || MOST_POINTS < seen / 2
        {
            return Err(Fault::Counts { seen: seen / 2, known: known / 3 });
        }
        check_numbers("pixel of point", &views.pixels, row, seen, 2)?;
        if let Some(points) = &views.points_m {
            check_numbers("position of point", points, row, known, 3)?;
        }
        let sigma_px = self.sigma_px(views, row);
        let is_sigma = 0.0 < sigma_px && sigma_px <= LARGEST;
        if is_sigma {
            Ok(seen / 2)
        } else {
            Err(Fault::Number { what: "sigma_px", point: 0, value: sigma_px })
        }
    }

    fn sigma_px(&self, views: &ViewColumns, row: usize) -> f64 {
        views.sigma_px.map_or(self.sigma_px, |sigmas| sigmas.get(row).copied().unwrap_or(f64::NAN))
    }

    /// Views of three or four points, side by side.
    fn gather<const N: usize>(&self, views: &ViewColumns, rows: &[u32]) -> Block<'_, N> {
        let each = || rows.iter().map(|row| *row as usize);
        let pixel =
            |row: usize, k: usize| Pixel::new(views.pixels.at(row, 2 * k), views.pixels.at(row, 2 * k + 1));
        Block {
            cameras: self.cameras.cameras(),
            numbers: each().map(|row| views.camera[row]).collect(),
            pixels: each().map(|row| from_fn(|k| pixel(row, k))).collect(),
            points: each().map(|row| from_fn(|k| self.point(views, row, k))).collect(),
            sigmas: each().map(|row| [self.sigma_px(views, row); N]).collect(),
        }
    }

    fn point(&self, views: &ViewColumns, row: usize, k: usize) -> Point {
        match &views.points_m {
            Some(points) => {
                Point::new(points.at(row, 3 * k), points.at(row, 3 * k + 1), points.at(row, 3 * k + 2))
            }
            None => self
                .cameras
                .points(views.camera[row])
                .and_then(|points| points.get(k))
                .copied()
                .unwrap_or_default(),
        }
    }

    /// Whether a view of three or four points has two equal rows: one point at one pixel twice.
    fn repeats(&self, views: &ViewColumns, row: usize, n_points: usize) -> bool {
        let is_one = |i: usize, k: usize| {
            let pixel =
                |axis: usize| views.pixels.at(row, 2 * i + axis) == views.pixels.at(row, 2 * k + axis);
            pixel(0) && pixel(1) && self.point(views, row, i) == self.point(views, row, k)
        };
        n_points <= 4 && (1..n_points).any(|i| (0..i).any(|k| is_one(i, k)))
    }

    fn solve_alone(&self, views: &ViewColumns, row: usize) -> Result<PoseEstimate, MathError> {
        let camera = &self.cameras.cameras()[views.camera[row] as usize];
        let sigma_px = self.sigma_px(views, row);
        let one = |k: usize| {
            let pixel = Pixel::new(views.pixels.at(row, 2 * k), views.pixels.at(row, 2 * k + 1));
            Correspondence::new(camera, self.point(views, row, k), pixel, sigma_px)
        };
        let seen: Vec<Correspondence> =
            (0..views.pixels.width(row) / 2).map(one).collect::<Result<_, _>>()?;
        locate(&without_equals(seen), camera, &Config::default())
    }
}

/// Some views of N points.
struct Block<'a, const N: usize> {
    cameras: &'a [Camera],
    numbers: Vec<u32>,
    pixels: Vec<[Pixel; N]>,
    points: Vec<[Point; N]>,
    sigmas: Vec<[f64; N]>,
}

impl<const N: usize> Block<'_, N> {
    fn views(&self) -> Views<'_, N> {
        Views {
            camera: Given::Numbered { values: self.cameras, numbers: &self.numbers },
            points_in_target: Given::Each(&self.points),
            pixels: &self.pixels,
            sigma_px: Given::Each(&self.sigmas),
        }
    }
}

fn check_numbers(
    what: &'static str,
    numbers: &Numbers,
    row: usize,
    width: usize,
    each: usize,
) -> Result<(), Fault> {
    for i in 0..width {
        let value = numbers.at(row, i);
        if !(value.abs() <= LARGEST) {
            return Err(Fault::Number { what, point: i / each, value });
        }
    }
    Ok(())
}
