//! Readings as they are drawn: shapes, contacts, ellipses, and their extent.

use crate::contact::Method;
use crate::contact::bent::shape_in_hub;
use crate::files::ContactRow;
use crate::files::contacts::{Figures, mode_name};
use crate::solve::Solved;
use crate::{Rod, Sample};
use nalgebra::{Matrix2, SymmetricEigen, Vector2};
use schemars::JsonSchema;
use serde::Serialize;

/// Shapes; beyond, evenly one in so many readings has one.
const MOST_SHAPES: usize = 2_000;
/// Points of a drawn whisker.
const SHAPE_POINTS: usize = 41;
/// Shapes are rounded to one of so many parts of a metre: far below a pixel of any screen.
const STEPS_PER_M: f64 = 1e6;
/// χ² with two degrees of freedom stays below this in 95 % of cases: −2 ln 0.05.
const CHI2_2_95: f64 = 5.991_464_547_107_98;

/// One reading.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PlayedReading {
    sweep: u32,
    sample: u32,
    t_s: Option<f64>,
    /// `ok`, `no_contact`, `low_force`, …: the words of `resight whisker solve`.
    status: &'static str,
    /// The clamp: x and y, metres, and its direction, radians.
    hub: Option<[f64; 3]>,
    /// The whisker's centre line from the clamp to the tip; empty where it is not drawn.
    shape_m: Vec<[f64; 2]>,
    contact: Option<PlayedContact>,
    /// Why there is no more information.
    note: String,
}

/// A contact.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PlayedContact {
    /// The point of the centre line that touches.
    x_m: [f64; 2],
    /// Where on the whisker: `mid` or `tip`.
    mode: &'static str,
    /// Half axes of the ellipse that contains 95 % of it, the longer first.
    half_axes_m: [[f64; 2]; 2],
    /// Standard deviation in the worst direction.
    sigma_m: f64,
    /// Arc length from the clamp; contact files may not state it.
    s_m: Option<f64>,
    /// Whether its numbers may be relied on.
    is_ok: bool,
}

/// All readings, and in how many one has a shape.
pub(super) fn readings(rows: &[ContactRow], solved: Option<&Solved>) -> (Vec<PlayedReading>, usize) {
    let one_in = rows.len().div_ceil(MOST_SHAPES).max(1);
    let in_space = rows.iter().any(|row| row.spatial.is_some());
    let played = rows.iter().enumerate().map(|(i, row)| {
        let sample = solved.and_then(|solved| solved.samples.get(i)?.as_ref());
        let is_drawn = i % one_in == 0 && !in_space;
        let rod = solved.map(|solved| &solved.rod).filter(|_| is_drawn);
        PlayedReading {
            sweep: row.sweep,
            sample: row.sample,
            t_s: row.t_s,
            status: row.status.name(),
            hub: sample.map(|s| [s.world_from_hub.x_m, s.world_from_hub.y_m, s.world_from_hub.angle_rad]),
            shape_m: rod.zip(sample).map_or(Vec::new(), |(rod, sample)| shape(rod, sample, row)),
            contact: row.figures.as_ref().map(|figures| contact(row, figures)),
            note: row.note.clone(),
        }
    });
    (played.collect(), one_in)
}

/// Straight where nothing is touched: what the cell reads then is noise.
fn shape(rod: &Rod, sample: &Sample, row: &ContactRow) -> Vec<[f64; 2]> {
    let load = if row.status.is_touching() { sample.load } else { Default::default() };
    let rounded = |x: f64| (x * STEPS_PER_M).round() / STEPS_PER_M;
    let line = shape_in_hub(rod, &load, Method::Auto, SHAPE_POINTS);
    let in_world = line.into_iter().map(|x_in_hub| sample.world_from_hub.apply(x_in_hub));
    in_world.map(|x| [rounded(x.x), rounded(x.y)]).collect()
}

fn contact(row: &ContactRow, figures: &Figures) -> PlayedContact {
    let covariance = plane(figures);
    let eigen = SymmetricEigen::new(covariance);
    let long = if eigen.eigenvalues[1] <= eigen.eigenvalues[0] { 0 } else { 1 };
    let axis = |i: usize| {
        let axis = eigen.eigenvectors.column(i) * (CHI2_2_95 * eigen.eigenvalues[i].max(0.0)).sqrt();
        [axis[0], axis[1]]
    };
    PlayedContact {
        x_m: [figures.x_in_world.x, figures.x_in_world.y],
        mode: mode_name(row.mode),
        half_axes_m: [axis(long), axis(1 - long)],
        sigma_m: sigma_m(figures),
        s_m: Some(figures.s_m).filter(|s| s.is_finite()),
        is_ok: row.is_ok(),
    }
}

fn plane(figures: &Figures) -> Matrix2<f64> {
    figures.covariance.fixed_view::<2, 2>(0, 0).into_owned()
}

/// In the worst direction.
fn sigma_m(figures: &Figures) -> f64 {
    plane(figures).symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// Half the contacts have a smaller one.
pub(super) fn median_sigma_m(rows: &[ContactRow]) -> Option<f64> {
    let ok = rows.iter().filter(|row| row.is_ok()).filter_map(|row| row.figures.as_ref());
    let mut sigmas: Vec<f64> = ok.map(sigma_m).collect();
    sigmas.sort_by(f64::total_cmp);
    sigmas.get(sigmas.len() / 2).copied()
}

/// Contacts that are known worse do not decide what a view of the locus shows.
pub(super) fn typical_m(rows: &[ContactRow]) -> f64 {
    median_sigma_m(rows).map_or(f64::INFINITY, |median| 4.0 * median)
}

/// What is drawn.
pub(super) struct Stage<'a> {
    pub readings: &'a [PlayedReading],
    pub outlines: [&'a [[f64; 2]]; 2],
}

impl Stage<'_> {
    pub fn extent_m(&self) -> [[f64; 2]; 2] {
        let shapes = self.readings.iter().flat_map(|one| &one.shape_m).copied();
        let hubs = self.readings.iter().filter_map(|one| one.hub).map(|[x, y, _]| [x, y]);
        let contacts = self.readings.iter().filter_map(|one| one.contact.as_ref()).map(|one| one.x_m);
        around(shapes.chain(hubs).chain(contacts).chain(self.outline_points()))
    }

    pub fn locus_extent_m(&self, typical_m: f64) -> [[f64; 2]; 2] {
        let contacts = self.readings.iter().filter_map(|one| one.contact.as_ref());
        let well = contacts.filter(|one| one.is_ok && one.sigma_m <= typical_m).map(|one| one.x_m);
        around(well.chain(self.outline_points()))
    }

    fn outline_points(&self) -> impl Iterator<Item = [f64; 2]> {
        self.outlines.into_iter().flatten().copied()
    }
}

/// The least and the greatest coordinates; a millimetre around the origin where there is nothing.
fn around(points: impl Iterator<Item = [f64; 2]>) -> [[f64; 2]; 2] {
    let points = points.map(Vector2::from).filter(|x| x.iter().all(|v| v.is_finite()));
    let extent = points.fold(None, |extent: Option<[Vector2<f64>; 2]>, x| match extent {
        None => Some([x, x]),
        Some([least, greatest]) => Some([least.inf(&x), greatest.sup(&x)]),
    });
    let [least, greatest] = extent.unwrap_or([Vector2::repeat(-5e-4), Vector2::repeat(5e-4)]);
    [least.into(), greatest.into()]
}
