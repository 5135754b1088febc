//! Draws an answer over the photograph: what was detected, what the pose predicts, and how uncertain it is.
//!
//! Every line is a curve of the target frame, projected by the pose and the lens model, and ends where the valid field of the lens model ends.
//! Every magnification is stated in the caption.

pub mod canvas;
pub mod font;
pub(crate) mod geometry;
pub mod ground;
#[cfg(test)]
mod tests;

use crate::GrayImage;
use crate::core::correspondence::Detection;
use crate::core::locate::PoseEstimate;
use crate::core::locate::choose::{Ambiguity, Hypothesis};
use crate::core::{Camera, Point, Pose, Target};
use crate::report::verdict::figures;
use crate::report::words::{distance_sigma_m, distance_with_sigma_m, length, percent, with_sigma};
use canvas::{Canvas, Color, Path, Pen};
pub(crate) use geometry::round_down_125;
use nalgebra::Vector2;

/// The contents of one image.
pub struct Scene<'a> {
    /// The photograph.
    pub image: &'a GrayImage,
    /// The features detected in it.
    pub detections: &'a [Detection],
    /// The camera it was taken with; without it only the detections are drawn.
    pub camera: Option<&'a Camera>,
    /// The target.
    pub target: &'a Target,
    /// The answer, if there is one.
    pub estimate: Option<&'a PoseEstimate>,
    /// First caption line, left: usually the file's name.
    pub title: &'a str,
    /// First caption line, right.
    pub verdict: &'a str,
    /// Colour of the verdict.
    pub tone: Tone,
}

/// The colour of the verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// An answer that can be relied on.
    Good,
    /// An answer with a second solution.
    Doubtful,
    /// An answer that contradicts its own error bars, or no answer.
    Bad,
}

const BACKGROUND: Color = [24, 26, 30];
const PAPER: Color = [238, 238, 238];
const DIM: Color = [150, 155, 165];
const GRID: Color = [120, 200, 235];
const OUTLINE: Color = [255, 214, 90];
const OTHER: Color = [235, 120, 255];
const SEEN: Color = [90, 255, 120];
const RESIDUAL: Color = [255, 140, 60];
const ELLIPSE: Color = [255, 105, 180];
const AXES: [(&str, Color); 3] = [("x", [255, 70, 70]), ("y", [70, 220, 90]), ("z", [90, 150, 255])];

/// Draws the scene; a caption is added below the photograph, which keeps its position and shape.
///
/// Photographs narrower than 600 px are shown at twice their size so that text stays readable.
pub fn draw(scene: &Scene) -> Canvas {
    let zoom = if scene.image.width_px < 600 { 2 } else { 1 };
    let diagonal = (scene.image.width_px as f64).hypot(scene.image.height_px as f64) * zoom as f64;
    let unit = (diagonal / 800.0).clamp(0.75, 8.0).powf(0.92);
    let margin = (46.0 * unit).round() as u32;
    let canvas = Canvas::from_photograph(scene.image, zoom, margin, BACKGROUND);
    let mut sheet =
        Sheet { canvas, zoom: zoom as f64, unit, room: 0.0, labels: Vec::new(), notes: Vec::new() };
    sheet.canvas.open_rows = scene.image.height_px * zoom;
    sheet.room = sheet.room_between(scene.detections);
    if let (Some(estimate), Some(camera)) = (scene.estimate, scene.camera) {
        sheet.prediction(scene, estimate, camera);
    }
    sheet.detections(scene);
    if let (Some(estimate), Some(camera)) = (scene.estimate, scene.camera) {
        sheet.ellipses(scene, estimate, camera);
        sheet.axes(scene.target, camera, estimate);
    }
    sheet.canvas.open_rows = sheet.canvas.height;
    sheet.caption(scene);
    sheet.canvas
}

/// Up to this number of tags, names are written beside them.
const FEW_TAGS: usize = 4;

/// An image under construction.
struct Sheet {
    canvas: Canvas,
    zoom: f64,
    unit: f64,
    /// Typical distance of a detection to its nearest neighbour, canvas pixels, which limits the size of the symbols.
    room: f64,
    /// Boxes of the labels written so far: least and greatest corner.
    labels: Vec<[Vector2<f64>; 2]>,
    /// The parts of the second caption line.
    notes: Vec<String>,
}

impl Sheet {
    fn room_between(&self, detections: &[Detection]) -> f64 {
        let distance = |a: &Detection, b: &Detection| (a.pixel - b.pixel).norm() * self.zoom;
        let nearest = detections.iter().enumerate().map(|(i, a)| {
            let others = detections.iter().enumerate().filter(|(j, _)| *j != i);
            others.map(|(_, b)| distance(a, b)).fold(f64::INFINITY, f64::min)
        });
        median(nearest).unwrap_or(f64::INFINITY)
    }

    /// Returns `size` in canvas pixels, reduced where the detections are close to each other.
    fn sized(&self, size: f64) -> f64 {
        (size * self.unit).min(0.32 * self.room)
    }

    /// Returns a pen of `width`, thinner where the detections are close to each other.
    fn pen(&self, color: Color, width: f64, opacity: f64) -> Pen {
        let width = (width * self.unit * (self.room / (24.0 * self.unit)).clamp(0.4, 1.0)).max(0.8);
        Pen { color, width, opacity }
    }

    /// Returns whether a name would cover its tag.
    fn crowded(&self) -> bool {
        self.room < 16.0 * self.unit
    }

    /// Returns the canvas position of a position in the image.
    fn place(&self, pixel: &Vector2<f64>) -> Vector2<f64> {
        (pixel + Vector2::repeat(0.5)) * self.zoom - Vector2::repeat(0.5)
    }

    fn segments(&self, camera: &Camera, pose: &Pose, lines: &[(Point, Point)]) -> Vec<Path> {
        let project = |(a, b): &(Point, Point)| geometry::project_segment(camera, pose, a, b);
        lines.iter().flat_map(project).map(|path| path.iter().map(|p| self.place(p)).collect()).collect()
    }

    /// Draws the grid, the outline, the outline of the other pose, and the residuals.
    fn prediction(&mut self, scene: &Scene, estimate: &PoseEstimate, camera: &Camera) {
        let (least, greatest) = geometry::bounds(scene.target);
        let extent = (greatest - least).xy().max();
        let pose = &estimate.cam_from_target;
        if 0.0 < extent {
            let step_m = geometry::round_down_125(extent / 3.0);
            let grid = geometry::grid(&least, &greatest, step_m);
            if let Ambiguity::Ambiguous { other, .. } = &estimate.ambiguity {
                let lines = self.segments(camera, &other.cam_from_target, &grid);
                self.canvas.stroke(&lines, self.pen(OTHER, 1.0, 0.6));
            }
            let lines = self.segments(camera, pose, &grid);
            self.canvas.stroke(&lines, self.pen(GRID, 1.0, 0.45));
            self.notes.push(format!("grid {}", length(step_m)));
        }
        let outline = geometry::outline(scene.target);
        let drawn = self.segments(camera, pose, &outline);
        self.canvas.stroke_with_rim(&drawn, self.pen(OUTLINE, 1.2, 0.9));
        self.residuals(scene, pose, camera);
    }

    fn ellipses(&mut self, scene: &Scene, estimate: &PoseEstimate, camera: &Camera) {
        let seen = scene.detections.iter().filter_map(|d| scene.target.point(d.feature));
        let ellipses: Vec<_> = seen
            .filter_map(|p| {
                let x_in_cam = estimate.cam_from_target * p.position;
                let (pixel, covariance) =
                    geometry::pixel_covariance(camera, &x_in_cam, &estimate.covariance)?;
                Some((pixel, geometry::semi_axes(&covariance, 2.0)))
            })
            .filter(|(_, axes)| axes.iter().all(|a| a.norm().is_finite()))
            .collect();
        let longest = median(ellipses.iter().map(|(_, axes)| axes[0].norm().max(axes[1].norm()) * self.zoom));
        let Some(factor) = longest.and_then(|px| magnification(px, self.sized(9.0))) else { return };
        let paths: Vec<Path> = ellipses
            .iter()
            .map(|(pixel, axes)| geometry::ellipse(self.place(pixel), &axes.map(|a| a * self.zoom * factor)))
            .collect();
        self.canvas.stroke_with_rim(&paths, self.pen(ELLIPSE, 1.1, 0.9));
        self.notes.push(format!("ellipses 2σ{}", times(factor)));
    }

    fn residuals(&mut self, scene: &Scene, pose: &Pose, camera: &Camera) {
        let pairs: Vec<_> = scene
            .detections
            .iter()
            .filter_map(|d| {
                let known = scene.target.point(d.feature)?;
                Some((camera.project(&(pose * &known.position))?, d.pixel))
            })
            .collect();
        let typical = median(pairs.iter().map(|(predicted, seen)| (seen - predicted).norm() * self.zoom));
        let Some(factor) = typical.and_then(|px| magnification(px, self.sized(9.0))) else { return };
        let arrow = |(predicted, seen): &(Vector2<f64>, Vector2<f64>)| {
            let from = self.place(predicted);
            vec![from, from + (seen - predicted) * self.zoom * factor]
        };
        let paths: Vec<Path> = pairs.iter().map(arrow).collect();
        self.canvas.stroke_with_rim(&paths, self.pen(RESIDUAL, 1.5, 1.0));
        self.notes.push(format!("residuals{}", times(factor)));
    }

    /// Draws a cross with an open centre at each feature, and its name where there is room.
    fn detections(&mut self, scene: &Scene) {
        let outer = self.sized(6.0);
        let inner = 0.33 * outer;
        let mut crosses = Vec::new();
        for d in scene.detections {
            let centre = self.place(&d.pixel);
            for direction in [Vector2::x(), Vector2::y(), -Vector2::x(), -Vector2::y()] {
                crosses.push(vec![centre + direction * inner, centre + direction * outer]);
            }
        }
        self.canvas.stroke_with_rim(&crosses, self.pen(SEEN, 1.1, 1.0));
        self.names(scene);
    }

    /// Writes names: tags at their centres, unless there is room to number their corners; of crowded points the first and last.
    fn names(&mut self, scene: &Scene) {
        let spacious = 36.0 * self.unit < self.room;
        let corners = scene.target.has_tag_corners();
        if corners && !spacious {
            for tag in scene.detections.chunk_by(|a, b| a.feature.id == b.feature.id) {
                let centre =
                    tag.iter().map(|d| self.place(&d.pixel)).sum::<Vector2<f64>>() / tag.len() as f64;
                let name = tag[0].feature.id.to_string();
                // A name is written beside a separate tag only; within a grid it would not be clear to which tag it belongs.
                match self.crowded() && scene.detections.len() <= 4 * FEW_TAGS {
                    true => self.label(&name, centre, SEEN, 8.0, 1.6 * self.room / self.unit),
                    false => self.centred(&name, centre, SEEN, 9.0),
                }
            }
            return;
        }
        let last = scene.detections.len().saturating_sub(1);
        for (i, d) in scene.detections.iter().enumerate() {
            let name = match corners {
                true => format!("{}.{}", d.feature.id, d.feature.corner),
                false => d.feature.id.to_string(),
            };
            if spacious || i == 0 || i == last {
                self.label(&name, self.place(&d.pixel), SEEN, 8.0, 9.0);
            }
        }
    }

    fn centred(&mut self, text: &str, at: Vector2<f64>, color: Color, height: f64) {
        let height = height * self.unit;
        let origin = at + Vector2::new(-0.5 * font::width(text, height), 0.5 * height);
        self.canvas.stroke_with_rim(&font::strokes(text, origin, height), self.pen(color, 1.2, 1.0));
    }

    fn axes(&mut self, target: &Target, camera: &Camera, estimate: &PoseEstimate) {
        let pose = &estimate.cam_from_target;
        let (least, greatest) = geometry::bounds(target);
        let extent = (greatest - least).xy().max();
        if !(0.0 < extent) {
            return;
        }
        let length_m = geometry::round_down_125(0.5 * extent);
        self.notes.insert(0, format!("axes {}", length(length_m)));
        if let Ambiguity::Ambiguous { other, .. } = &estimate.ambiguity {
            let probability = estimate.others[0].map_or(0.0, |h| h.probability);
            self.other_axes(camera, &other.cam_from_target, probability, length_m);
        }
        for (i, (name, color)) in AXES.iter().enumerate().rev() {
            let mut tip = Point::zeros();
            tip[i] = length_m;
            let line = self.segments(camera, pose, &[(Point::zeros(), tip)]);
            self.canvas.stroke_with_rim(&line, self.pen(*color, 2.6, 1.0));
            if let Some(end) = line.last().and_then(|path| path.last()).copied()
                && !self.crowded()
            {
                self.label(name, end, *color, 9.0, 6.0);
            }
        }
    }

    /// Draws the axes of the other pose, dashed: its points project to the same pixels as those of this pose, but its axes do not.
    fn other_axes(&mut self, camera: &Camera, other: &Pose, probability: f64, length_m: f64) {
        for i in 0..3 {
            let mut tip = Point::zeros();
            tip[i] = length_m;
            let line = self.segments(camera, other, &[(Point::zeros(), tip)]);
            let dashes: Vec<Path> = line.iter().flat_map(|path| dashed(path, 5.0 * self.unit)).collect();
            self.canvas.stroke_with_rim(&dashes, self.pen(OTHER, 2.0, 1.0));
        }
        self.notes.push(format!("magenta: the other pose, {}", percent(probability)));
    }

    /// Writes a name beside a position, on the first of four sides where it covers no other name; otherwise leaves it out.
    fn label(&mut self, text: &str, at: Vector2<f64>, color: Color, height: f64, away: f64) {
        let (height, away) = (height * self.unit, away * self.unit);
        let width = font::width(text, height);
        let sides = [(0.6, -0.6), (0.6, 0.6), (-0.6, 0.6), (-0.6, -0.6)];
        for (dx, dy) in sides {
            let left = at.x + dx * away - if dx < 0.0 { width } else { 0.0 };
            let bottom = at.y + dy * away + if 0.0 < dy { height } else { 0.0 };
            let taken = [
                Vector2::new(left - 2.0, bottom - height - 2.0),
                Vector2::new(left + width + 2.0, bottom + 2.0),
            ];
            let free = self.labels.iter().all(|l| apart(l, &taken));
            let limit = self.canvas.width as f64;
            if free && 0.0 <= taken[0].x && taken[1].x < limit && 0.0 <= taken[0].y {
                let paths = font::strokes(text, Vector2::new(left, bottom), height);
                self.canvas.stroke_with_rim(&paths, self.pen(color, 1.1, 1.0));
                self.labels.push(taken);
                return;
            }
        }
    }

    fn caption(&mut self, scene: &Scene) {
        let floor = scene.image.height_px as f64 * self.zoom;
        let (height, left) = (10.0 * self.unit, 10.0 * self.unit);
        let color = match scene.tone {
            Tone::Good => SEEN,
            Tone::Doubtful => OUTLINE,
            Tone::Bad => [255, 95, 95],
        };
        let first = floor + 19.0 * self.unit;
        let right = self.canvas.width as f64 - left;
        let verdict_width = font::width(scene.verdict, height);
        let (text, room) = (headline(scene), right - left - verdict_width - 2.0 * height);
        // A number that is cut off is misleading, so the letters are reduced first.
        let own = height * (room / font::width(&text, height)).clamp(SMALLEST, 1.0);
        self.write(&fitted(&text, own, room), Vector2::new(left, first), own, PAPER);
        self.write(scene.verdict, Vector2::new(right - verdict_width, first), height, color);
        let small = 7.0 * self.unit;
        let notes = fitted(&self.notes.join("  ·  "), small, right - left);
        self.write(&notes, Vector2::new(left, floor + 37.0 * self.unit), small, DIM);
    }

    fn write(&mut self, text: &str, at: Vector2<f64>, height: f64, color: Color) {
        let pen = Pen { color, width: (height * 0.14).max(1.0), opacity: 1.0 };
        self.canvas.stroke(&font::strokes(text, at, height), pen);
    }
}

/// The letters of the caption are reduced to this share before the text is cut off.
const SMALLEST: f64 = 0.65;

/// Returns the name of the view, the distance with its standard deviation, and the residual. Where several poses fit, no single standard
/// deviation describes the camera's position: then distances and probabilities of all, and the name last, for which there may be no room.
fn headline(scene: &Scene) -> String {
    let Some(e) = scene.estimate else { return scene.title.to_string() };
    if 1 < e.n_alternatives() {
        let fits = e.minima().filter(|h| h.is_alternative);
        let one = |h: Hypothesis| {
            let (distance_m, sigma_m) = distance_sigma_m(&h.minimum.cam_from_target, &h.minimum.covariance);
            format!("{}: {}", percent(h.probability), with_sigma(distance_m, sigma_m))
        };
        return format!("{}   {}", fits.map(one).collect::<Vec<_>>().join("  or  "), scene.title);
    }
    let (distance_m, sigma_m) = distance_with_sigma_m(e);
    let rms = if e.rms_px < 1e-3 { "below 0.001".to_string() } else { figures(e.rms_px) };
    format!("{}   {}   rms {rms} px", scene.title, with_sigma(distance_m, sigma_m))
}

fn times(factor: f64) -> String {
    if factor == 1.0 { String::new() } else { format!(" ×{factor:.0}") }
}

/// Returns the factor 1, 2, 5, 10, … with which `typical` becomes about `wanted`; `None` when it would exceed 10⁶.
fn magnification(typical: f64, wanted: f64) -> Option<f64> {
    if !(typical.is_finite() && wanted / 1e6 < typical) {
        return None;
    }
    Some(geometry::round_down_125((wanted / typical).max(1.0)))
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn apart(a: &[Vector2<f64>; 2], b: &[Vector2<f64>; 2]) -> bool {
    a[1].x < b[0].x || b[1].x < a[0].x || a[1].y < b[0].y || b[1].y < a[0].y
}

/// Returns the text, shortened from the right with `..` until it fits.
fn fitted(text: &str, height: f64, room: f64) -> String {
    let mut text = text.to_string();
    if room < font::width(&text, height) {
        while !text.is_empty() && room < font::width(&format!("{text}.."), height) {
            text.pop();
        }
        text.push_str("..");
    }
    text
}

/// Cuts a path into dashes of `length` with gaps of the same length.
fn dashed(path: &Path, length: f64) -> Vec<Path> {
    let mut dashes = Vec::new();
    let mut travelled = 0.0;
    for pair in path.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let span = (b - a).norm();
        if 1e4 < span {
            continue; // Far outside the image: a curve that passes close to the lens.
        }
        let mut from = 0.0;
        while from < span {
            let to = (from + length - travelled % length).min(span);
            if (travelled + 1e-9) % (2.0 * length) < length {
                dashes.push(vec![a + (b - a) * (from / span), a + (b - a) * (to / span)]);
            }
            travelled += to - from + 1e-9;
            from = to + 1e-9;
        }
    }
    dashes
}
