//! A panel with logarithmic axes.

use nalgebra::Vector2;
use resight::drawing::{Anchor, Drawing};

const WIDTH_PX: f64 = 300.0;
const HEIGHT_PX: f64 = 270.0;
const GRID: [u8; 3] = [228, 231, 236];
const DIM: [u8; 3] = [100, 106, 116];
const INK: [u8; 3] = [25, 28, 33];

/// How a line is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Pen {
    pub color: [u8; 3],
    pub width: f64,
    pub opacity: f64,
    pub has_dots: bool,
}

impl Pen {
    pub fn draw(&self, drawing: &mut Drawing, path: Vec<Vector2<f64>>) {
        if self.has_dots {
            for at in &path {
                drawing.line(vec![*at, *at], self.color, 2.4 * self.width.max(1.6));
            }
        }
        drawing.faint_line(path, self.color, self.width, self.opacity);
    }
}

/// Least and most of both axes, and the upper left corner in px.
#[derive(Debug, Clone, Copy)]
pub struct Axes {
    pub corner: Vector2<f64>,
    pub x: (f64, f64),
    pub y: (f64, f64),
}

impl Axes {
    /// Where a point is on the sheet, px.
    pub fn at(&self, point: &Vector2<f64>) -> Vector2<f64> {
        let share = |value: f64, (least, most): (f64, f64)| (value / least).ln() / (most / least).ln();
        let (x, y) = (share(point.x, self.x), share(point.y, self.y));
        self.corner + Vector2::new(WIDTH_PX * x, HEIGHT_PX * (1.0 - y))
    }

    fn holds(&self, point: &Vector2<f64>) -> bool {
        (self.x.0..=self.x.1).contains(&point.x) && (self.y.0..=self.y.1).contains(&point.y)
    }

    /// Grid with its labels, frame, title.
    pub fn frame(&self, drawing: &mut Drawing, title: &str, x: &[(f64, &str)], y: &[(f64, &str)]) {
        let high = self.corner + Vector2::new(WIDTH_PX, HEIGHT_PX);
        for (value, label) in x.iter().filter(|(value, _)| self.holds(&Vector2::new(*value, self.y.0))) {
            let at = self.at(&Vector2::new(*value, self.y.0));
            drawing.line(vec![at, Vector2::new(at.x, self.corner.y)], GRID, 1.0);
            drawing.text(label, at + Vector2::new(0.0, 15.0), 7.5, DIM, Anchor::Middle);
        }
        for (value, label) in y.iter().filter(|(value, _)| self.holds(&Vector2::new(self.x.0, *value))) {
            let at = self.at(&Vector2::new(self.x.0, *value));
            drawing.line(vec![at, Vector2::new(high.x, at.y)], GRID, 1.0);
            drawing.text(label, at + Vector2::new(-5.0, 3.0), 7.5, DIM, Anchor::End);
        }
        let low = self.corner;
        let frame = [low, Vector2::new(high.x, low.y), high, Vector2::new(low.x, high.y), low];
        drawing.line(frame.to_vec(), DIM, 1.0);
        drawing.text(title, low + Vector2::new(0.0, -9.0), 9.5, INK, Anchor::Start);
    }

    /// What the axes count.
    pub fn names(&self, drawing: &mut Drawing, x: &str, y: &str) {
        let below = self.corner + Vector2::new(0.5 * WIDTH_PX, HEIGHT_PX + 31.0);
        drawing.text(x, below, 8.0, DIM, Anchor::Middle);
        let left = self.corner + Vector2::new(-46.0, 0.5 * HEIGHT_PX);
        drawing.rotated_text(y, left, 8.0, DIM, Anchor::Middle, -std::f64::consts::FRAC_PI_2);
    }

    /// A curve, without what lies outside.
    pub fn curve(&self, drawing: &mut Drawing, points: &[Vector2<f64>], pen: &Pen) {
        for inside in points.split(|point| !self.holds(point)) {
            let path: Vec<_> = inside.iter().map(|point| self.at(point)).collect();
            if !path.is_empty() {
                pen.draw(drawing, path);
            }
        }
    }
}
