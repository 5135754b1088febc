//! Residual vectors over each camera's image: all of them packed for the script, and the means of cells drawn for readers without scripts.

use super::Drawn;
use super::pieces::{color_class, number};
use crate::core::Pixel;
use crate::core::camera::Lens;
use crate::report::html::base64;
use crate::rig::RigRun;
use crate::scene::geometry::{self, Area};
use nalgebra::Vector2;

/// Columns and rows of cells over an image.
const CELLS: [usize; 2] = [16, 12];
/// Least number of points for the mean of a cell: with fewer, only noise would be visible.
const LEAST_IN_CELL: usize = 3;
/// Largest numbers of points on the page, used and left out: eight bytes each, a third more as text.
const MOST_USED: usize = 120_000;
const MOST_LEFT_OUT: usize = 30_000;
/// Number of steps of the image's width and height in which positions are stored; the top bit means "left out".
const PLACE_STEPS: f64 = 32_767.0;
const FINEST_STEP_PX: f64 = 0.01;
const WIDTH: f64 = 320.0;

/// The residuals of a run in the form that the script reads.
pub(super) struct Packed {
    /// Four little-endian 16-bit numbers per point: u and v in steps of the area (u's top bit: left out), residual in `step_px`.
    pub base64: String,
    /// Indices of camera, view and target, and the number of points stored.
    pub observations: Vec<[usize; 4]>,
    /// Unit of the stored residuals, for each camera.
    pub steps_px: Vec<f64>,
    /// One in this many of the points used, and of the points left out, is stored.
    pub one_in: [usize; 2],
}

/// Position, residual, whether used.
type Mark = (Pixel, Vector2<f64>, bool);

/// Iterates over the points of an observation that have a projection.
fn marks(run: &RigRun, observation: usize) -> impl Iterator<Item = Mark> {
    let seen = &run.rig.observations[observation].seen;
    let results = &run.solution.observations[observation].residuals_px;
    seen.iter().zip(results).filter_map(|(c, r)| r.map(|(residual, is_used)| (c.pixel, residual, is_used)))
}

pub(super) fn packed(run: &RigRun) -> Packed {
    let observations = run.rig.observations.len().min(run.solution.observations.len());
    let mut counts = [0usize; 2];
    (0..observations).flat_map(|i| marks(run, i)).for_each(|m| counts[usize::from(!m.2)] += 1);
    let one_in = [counts[0].div_ceil(MOST_USED).max(1), counts[1].div_ceil(MOST_LEFT_OUT).max(1)];
    let areas: Vec<Area> = (0..run.rig.cameras.len()).map(|i| geometry::image_area(&run.rig, i)).collect();
    let steps_px: Vec<f64> = (0..areas.len()).map(|camera| step_px(run, camera)).collect();
    let (mut bytes, mut stored, mut passed) = (Vec::new(), Vec::new(), [0usize; 2]);
    for i in 0..observations {
        let s = &run.rig.observations[i];
        let before = bytes.len();
        for mark in marks(run, i) {
            let kind = usize::from(!mark.2);
            if passed[kind].is_multiple_of(one_in[kind]) {
                pack(&mut bytes, &mark, &areas[s.camera], steps_px[s.camera]);
            }
            passed[kind] += 1;
        }
        stored.push([s.camera, s.view, s.target, (bytes.len() - before) / 8]);
    }
    Packed { base64: base64(&bytes), observations: stored, steps_px, one_in }
}

/// Returns a hundredth of a pixel, or the step with which the largest residual fits into 16 bits.
fn step_px(run: &RigRun, camera: usize) -> f64 {
    let of_camera =
        (0..run.solution.observations.len()).filter(|&i| run.rig.observations[i].camera == camera);
    let largest = of_camera
        .flat_map(|i| marks(run, i))
        .map(|m| m.1.amax())
        .filter(|r| r.is_finite())
        .fold(0.0, f64::max);
    let fits = largest / f64::from(i16::MAX);
    match (unit(run, camera), fits) {
        ("px", step) => step.max(FINEST_STEP_PX),
        (_, step) if 0.0 < step => step,
        _ => 1.0,
    }
}

fn pack(bytes: &mut Vec<u8>, (pixel, residual, is_used): &Mark, area: &Area, step: f64) {
    let along = |x: f64, least: f64, length: f64| {
        ((x - least) / length * PLACE_STEPS).round().clamp(0.0, PLACE_STEPS) as u16
    };
    let left_out = if *is_used { 0 } else { 1 << 15 };
    let u = along(pixel.x, area.least.x, area.width()) | left_out;
    let v = along(pixel.y, area.least.y, area.height());
    let [du, dv] = [residual.x, residual.y].map(|r| (r / step).round() as i16);
    bytes.extend(
        [u, v].into_iter().flat_map(u16::to_le_bytes).chain([du, dv].into_iter().flat_map(i16::to_le_bytes)),
    );
}

/// Returns the unit of a camera's image coordinates.
pub(super) fn unit(run: &RigRun, camera: usize) -> &'static str {
    match (&run.rig.lenses[camera].lens, run.rig.lenses[camera].size) {
        (Lens::Photogrammetric(_), _) => "units of f",
        (_, None) => "units of the image coordinates",
        _ => "px",
    }
}

/// Returns the initial magnification of single residuals: their root mean square becomes 1/40 of the width.
pub(super) fn first_magnification(run: &RigRun) -> f64 {
    let widths = (0..run.rig.cameras.len()).map(|i| geometry::image_area(&run.rig, i).width());
    geometry::magnification(run.solution.rms_px, widths.fold(f64::INFINITY, f64::min) / 40.0)
}

/// Returns one drawing per camera, with the mean residual of each cell, and a canvas beside it for the script.
pub(super) fn figures(drawn: &Drawn, packed: &Packed) -> String {
    let means: Vec<Vec<(Pixel, Vector2<f64>)>> =
        (0..drawn.run.rig.cameras.len()).map(|i| cell_means(drawn.run, i)).collect();
    let figures: String = (0..means.len()).map(|camera| figure(drawn, camera, &means[camera])).collect();
    format!(
        "<p class=\"note\">{}</p>\n{}<div class=\"row residuals\">{figures}</div>",
        explained(packed),
        choices()
    )
}

fn explained(packed: &Packed) -> String {
    let coarsest = packed.steps_px.iter().copied().fold(FINEST_STEP_PX, f64::max);
    let thinned = match packed.one_in {
        [1, 1] => String::new(),
        [used, left_out] => {
            format!(" One in {used} of the points used and one in {left_out} of those left out are drawn.")
        }
    };
    format!(
        "Residuals are observed − predicted, drawn at the observed point. Without scripts each drawing shows the mean of the points used in \
         each of {} × {} cells ({LEAST_IN_CELL} or more); with scripts, every point, rounded to {} px or finer.{thinned} What a lens model gets \
         wrong shows as a pattern, noise does not. Points that are predicted nowhere in the image are counted as left out and not drawn.",
        CELLS[0],
        CELLS[1],
        number(coarsest, 3)
    )
}

fn choices() -> &'static str {
    "<div class=\"bar inline\" data-script hidden><label>Magnified <select id=\"magnified\"></select></label>\
     <label><input type=\"checkbox\" id=\"left-out\" checked> points left out</label></div>\n"
}

fn figure(drawn: &Drawn, camera: usize, means: &[(Pixel, Vector2<f64>)]) -> String {
    let area = geometry::image_area(&drawn.run.rig, camera);
    let height = (WIDTH * area.height() / area.width()).clamp(40.0, 4.0 * WIDTH);
    let (name, unit) = (drawn.camera_name(camera), unit(drawn.run, camera));
    let longest = means.iter().map(|(_, mean)| mean.norm()).fold(0.0, f64::max);
    let factor = geometry::magnification(longest, area.width() / CELLS[0] as f64);
    let arrows: String = means.iter().map(|mean| arrow(mean, &area, height, factor)).collect();
    let caption = format!(
        "{name}: cell means magnified {}\u{a0}×, the longest {} {unit}; rms of single points {} {unit}",
        number(factor, 6),
        number(longest, 3),
        number(drawn.run.solution.cameras[camera].rms_px, 3)
    );
    format!(
        "<figure><svg class=\"field {}\" viewBox=\"0 0 {WIDTH} {}\" role=\"img\" aria-label=\"{caption}\">{arrows}</svg>\
         <canvas data-camera=\"{camera}\" role=\"img\" hidden></canvas><figcaption>{caption}</figcaption></figure>\n",
        color_class(camera),
        number(height, 1)
    )
}

fn arrow((place, mean): &(Pixel, Vector2<f64>), area: &Area, height: f64, factor: f64) -> String {
    let scale = [WIDTH / area.width(), height / area.height()];
    let (x, y) = ((place.x - area.least.x) * scale[0], (place.y - area.least.y) * scale[1]);
    let (dx, dy) = (mean.x * factor * scale[0], mean.y * factor * scale[1]);
    format!(
        "<circle cx=\"{}\" cy=\"{}\" r=\"1.6\"/><path d=\"M{} {}l{} {}\"/>",
        number(x, 1),
        number(y, 1),
        number(x, 1),
        number(y, 1),
        number(dx, 1),
        number(dy, 1)
    )
}

/// Returns the centre of each cell and the mean residual of the points used in it, row by row.
fn cell_means(run: &RigRun, camera: usize) -> Vec<(Pixel, Vector2<f64>)> {
    let area = geometry::image_area(&run.rig, camera);
    let mut sums = vec![(0usize, Vector2::zeros()); CELLS[0] * CELLS[1]];
    let own = (0..run.solution.observations.len()).filter(|&i| run.rig.observations[i].camera == camera);
    for (pixel, residual, is_used) in own.flat_map(|i| marks(run, i)) {
        let column = ((pixel.x - area.least.x) / area.width() * CELLS[0] as f64) as usize;
        let row = ((pixel.y - area.least.y) / area.height() * CELLS[1] as f64) as usize;
        if is_used && column < CELLS[0] && row < CELLS[1] {
            let cell = &mut sums[row * CELLS[0] + column];
            *cell = (cell.0 + 1, cell.1 + residual);
        }
    }
    let middle = |i: usize| {
        let (column, row) = ((i % CELLS[0]) as f64 + 0.5, (i / CELLS[0]) as f64 + 0.5);
        let share = Vector2::new(column / CELLS[0] as f64, row / CELLS[1] as f64);
        area.least + share.component_mul(&(area.greatest - area.least))
    };
    let enough = sums.iter().enumerate().filter(|(_, (n, _))| LEAST_IN_CELL <= *n);
    enough.map(|(i, (n, sum))| (middle(i), sum / *n as f64)).collect()
}
