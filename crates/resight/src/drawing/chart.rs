//! A square chart with equal scales, a grid in millimetres and a scale bar; what extends beyond the frame is clipped.

use super::{Anchor, Drawing};
use crate::overlay::canvas::{Color, Path};
use crate::overlay::geometry::{ellipse, round_down_125, semi_axes};
use nalgebra::{Matrix2, Vector2};

const INK: Color = [25, 28, 33];
const GRID: Color = [230, 233, 238];
const DIM: Color = [110, 116, 126];
const TEXT_PX: f64 = 9.0;
/// Approximate distance of grid lines, px.
const GRID_PX: f64 = 80.0;

/// The frame and its scale. World y points up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chart {
    /// Its upper left corner, px.
    pub corner: Vector2<f64>,
    /// Its side, px.
    pub side_px: f64,
    /// World point at its lower left corner, metres.
    pub least_m: Vector2<f64>,
    /// Scale.
    pub px_per_m: f64,
}

impl Chart {
    /// Creates a chart that shows all of `points` (world, metres) with a margin; `None` where no point is finite.
    pub fn around(
        corner: Vector2<f64>,
        side_px: f64,
        points: impl Iterator<Item = Vector2<f64>>,
    ) -> Option<Self> {
        let none = Vector2::repeat(f64::INFINITY);
        let finite = points.filter(|p| p.iter().all(|x| x.is_finite()));
        let (least, most) = finite.fold((none, -none), |(a, b), p| (a.inf(&p), b.sup(&p)));
        if !(least.x <= most.x) {
            return None;
        }
        // A single point still has a frame of a millimetre.
        let extent_m = 1.2 * (most - least).max().max(1e-3);
        let least_m = 0.5 * (least + most) - Vector2::repeat(0.5 * extent_m);
        Some(Chart { corner, side_px, least_m, px_per_m: side_px / extent_m })
    }

    /// Returns the position of a world point in the drawing, px.
    pub fn at(&self, x_in_world: &Vector2<f64>) -> Vector2<f64> {
        let p = (x_in_world - self.least_m) * self.px_per_m;
        self.corner + Vector2::new(p.x, self.side_px - p.y)
    }

    /// Draws the grid, its numbers in millimetres, the frame and the title.
    pub fn frame(&self, drawing: &mut Drawing, title: &str) {
        let (low, high) = (self.corner, self.corner + Vector2::repeat(self.side_px));
        let step = round_down_125(GRID_PX / self.px_per_m);
        for axis in 0..2 {
            let from = (self.least_m[axis] / step).ceil() as i64;
            let to = ((self.least_m[axis] + self.side_px / self.px_per_m) / step).floor() as i64;
            for i in from..=to {
                let at = self.at(&Vector2::repeat(i as f64 * step));
                let label = number(1e3 * i as f64 * step, 1e3 * step);
                if axis == 0 {
                    drawing.line(vec![Vector2::new(at.x, low.y), Vector2::new(at.x, high.y)], GRID, 1.0);
                    drawing.text(&label, Vector2::new(at.x, high.y + 16.0), TEXT_PX, DIM, Anchor::Middle);
                } else {
                    drawing.line(vec![Vector2::new(low.x, at.y), Vector2::new(high.x, at.y)], GRID, 1.0);
                    drawing.text(&label, Vector2::new(low.x - 6.0, at.y + 4.0), TEXT_PX, DIM, Anchor::End);
                }
            }
        }
        let box_path = [low, Vector2::new(high.x, low.y), high, Vector2::new(low.x, high.y), low];
        drawing.line(box_path.to_vec(), DIM, 1.0);
        drawing.text("x / mm", Vector2::new(high.x, high.y + 34.0), TEXT_PX, DIM, Anchor::End);
        drawing.text("y / mm", Vector2::new(low.x - 6.0, low.y - 10.0), TEXT_PX, DIM, Anchor::End);
        drawing.text(title, Vector2::new(low.x + 12.0, low.y - 10.0), 11.0, INK, Anchor::Start);
    }

    /// Draws a bar of a round length in the lower right corner.
    pub fn scale_bar(&self, drawing: &mut Drawing) {
        let length_m = round_down_125(0.25 * self.side_px / self.px_per_m);
        let to = self.corner + Vector2::new(self.side_px - 14.0, self.side_px - 14.0);
        let from = to - Vector2::new(length_m * self.px_per_m, 0.0);
        for end in [from, to] {
            drawing.line(vec![end - Vector2::new(0.0, 4.0), end + Vector2::new(0.0, 4.0)], INK, 2.0);
        }
        drawing.line(vec![from, to], INK, 2.0);
        let label = format!("{} mm", number(1e3 * length_m, 1e3 * length_m));
        drawing.text(&label, 0.5 * (from + to) - Vector2::new(0.0, 8.0), TEXT_PX, INK, Anchor::Middle);
    }

    /// Draws a line through world points, clipped at the frame.
    pub fn line(
        &self,
        drawing: &mut Drawing,
        points_m: &[Vector2<f64>],
        color: Color,
        width: f64,
        opacity: f64,
    ) {
        let path: Path = points_m.iter().map(|p| self.at(p)).collect();
        self.cut_line(drawing, &path, color, width, opacity);
    }

    /// Draws a dot of `width` px, unless it is outside the frame.
    pub fn dot(&self, drawing: &mut Drawing, x_in_world: &Vector2<f64>, color: Color, width: f64) {
        let at = self.at(x_in_world);
        if self.holds(&at) {
            drawing.line(vec![at, at], color, width);
        }
    }

    /// Draws the ellipse of a number of standard deviations of a covariance, m²; nothing for an invalid covariance.
    pub fn ellipse(
        &self,
        drawing: &mut Drawing,
        x_in_world: &Vector2<f64>,
        covariance: &Matrix2<f64>,
        sigmas: f64,
        color: Color,
        opacity: f64,
    ) {
        if covariance.iter().all(|c| c.is_finite()) {
            let axes = semi_axes(covariance, sigmas).map(|v| Vector2::new(v.x, -v.y) * self.px_per_m);
            self.cut_line(drawing, &ellipse(self.at(x_in_world), &axes), color, 1.0, opacity);
        }
    }

    fn holds(&self, at: &Vector2<f64>) -> bool {
        (at - self.corner).iter().all(|x| (0.0..=self.side_px).contains(x))
    }

    fn cut_line(&self, drawing: &mut Drawing, path: &Path, color: Color, width: f64, opacity: f64) {
        let mut part = Path::new();
        for pair in path.windows(2) {
            match self.cut(pair[0], pair[1]) {
                Some((a, b)) => {
                    if part.last() != Some(&a) {
                        flush(drawing, &mut part, color, width, opacity);
                        part.push(a);
                    }
                    part.push(b);
                }
                None => flush(drawing, &mut part, color, width, opacity),
            }
        }
        flush(drawing, &mut part, color, width, opacity);
    }

    /// Returns the part of a segment inside the frame (Liang–Barsky).
    fn cut(&self, a: Vector2<f64>, b: Vector2<f64>) -> Option<(Vector2<f64>, Vector2<f64>)> {
        let d = b - a;
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let to_low = self.corner[axis] - a[axis];
            let (near, far) = (to_low / d[axis], (to_low + self.side_px) / d[axis]);
            match d[axis] {
                0.0 if to_low <= 0.0 && -self.side_px <= to_low => {}
                0.0 => return None,
                _ => (enter, leave) = (enter.max(near.min(far)), leave.min(near.max(far))),
            }
        }
        // Ends that are not clipped stay exactly equal, so that segments join.
        let from = if enter == 0.0 { a } else { a + d * enter };
        let to = if leave == 1.0 { b } else { a + d * leave };
        (enter < leave).then_some((from, to))
    }
}

fn flush(drawing: &mut Drawing, part: &mut Path, color: Color, width: f64, opacity: f64) {
    if 1 < part.len() {
        drawing.faint_line(std::mem::take(part), color, width, opacity);
    }
    part.clear();
}

/// Formats a number with the decimals that distinguish the steps.
fn number(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches('-').chars().all(|c| "0.".contains(c)) {
        text.trim_start_matches('-').to_string()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::Item;

    fn chart() -> Chart {
        let ends = [Vector2::new(0.0, 0.0), Vector2::new(1.0, 0.5)];
        Chart::around(Vector2::new(10.0, 20.0), 100.0, ends.into_iter()).expect("points")
    }

    #[test]
    fn all_points_lie_inside_and_y_runs_up() {
        let chart = chart();
        let (low, high) = (chart.at(&Vector2::new(0.0, 0.0)), chart.at(&Vector2::new(1.0, 0.5)));
        assert!(chart.holds(&low) && chart.holds(&high));
        assert!(high.y < low.y && low.x < high.x);
        assert!(Chart::around(Vector2::zeros(), 100.0, std::iter::empty()).is_none());
    }

    #[test]
    fn what_leaves_the_frame_is_cut_at_it() {
        let (chart, mut drawing) = (chart(), Drawing::new(200, 200));
        chart.line(
            &mut drawing,
            &[Vector2::new(-9.0, 0.2), Vector2::new(0.5, 0.2), Vector2::new(9.0, 0.2)],
            INK,
            1.0,
            1.0,
        );
        chart.line(&mut drawing, &[Vector2::new(-9.0, 9.0), Vector2::new(9.0, 9.0)], INK, 1.0, 1.0);
        let [Item::Line { path, .. }] = &drawing.items[..] else { panic!("{:?}", drawing.items) };
        assert!(path.iter().all(|p| 10.0 - 1e-9 <= p.x && p.x <= 110.0 + 1e-9));
        assert!((path[0].x - 10.0).abs() < 1e-9 && (path[2].x - 110.0).abs() < 1e-9);
    }
}
