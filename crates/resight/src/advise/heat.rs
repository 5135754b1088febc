//! A map of one figure: colours, lines of equal value with their values, control points, axes and a scale.

use super::contour::{Grid, levels};
use crate::overlay::canvas::{Canvas, Color, Path, Pen};
use crate::overlay::font;
use nalgebra::Vector2;

/// The quantity that a map shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// Metres.
    Length,
    /// Radians.
    Angle,
}

/// What a map is drawn over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Under {
    /// An image: pixels, v down.
    Image {
        /// Number of columns.
        width_px: u32,
        /// Number of rows.
        height_px: u32,
    },
    /// A plane seen from above: metres, the second axis up.
    Plan {
        /// Corner with the smallest coordinates.
        least_m: [f64; 2],
        /// Corner with the largest coordinates.
        greatest_m: [f64; 2],
        /// Names of the two axes.
        axes: [&'static str; 2],
    },
}

/// How a control point is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapMarkerKind {
    /// A point that exists already.
    Known,
    /// A point that is advised.
    Best,
    /// A camera and its viewing direction, towards `MapMarker::towards`.
    Camera,
}

/// A marker on a map, in the coordinates of the map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapMarker {
    /// Position of the marker.
    pub at: [f64; 2],
    /// Its name, written beside it.
    pub name: String,
    /// How it looks.
    pub kind: MapMarkerKind,
    /// For a camera: the point that it looks at.
    pub towards: Option<[f64; 2]>,
}

/// A map of one quantity, with markers and lines.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatMap {
    /// First line.
    pub title: String,
    /// Further lines, below.
    pub notes: Vec<String>,
    /// The quantity that the values are of.
    pub figure: Figure,
    /// What the map is drawn over.
    pub under: Under,
    /// Number of cells in a row.
    pub columns: usize,
    /// Values at the centres of the cells, row by row: from the top of an image, from the bottom of a plan. `None` where a cell has no value.
    pub values: Vec<Option<f64>>,
    /// Markers shown on the map.
    pub control_points: Vec<MapMarker>,
    /// Lines shown on it, such as the length to be measured.
    pub lines: Vec<[[f64; 2]; 2]>,
}

const BACKGROUND: Color = [24, 26, 30];
const NOTHING: Color = [52, 55, 61];
const HATCH: Color = [64, 68, 75];
const PAPER: Color = [238, 238, 238];
const DIM: Color = [165, 170, 180];
const KNOWN: Color = [255, 255, 255];
const BEST: Color = [255, 70, 90];
const CAMERA: Color = [255, 180, 60];
/// Dark blue (certain) through green to yellow (uncertain); readable in grey too.
const SCALE: [Color; 6] =
    [[48, 30, 110], [48, 80, 150], [33, 130, 142], [60, 175, 110], [150, 212, 64], [250, 230, 60]];
/// The longer side of a map, canvas pixels.
const SIDE: f64 = 860.0;
/// Margins to the left, above, to the right and below.
const LEFT: f64 = 92.0;
const TOP: f64 = 46.0;
const RIGHT: f64 = 150.0;
const TEXT: f64 = 11.0;

/// Draws a map on a canvas.
pub fn draw(map: &HeatMap) -> Canvas {
    let (width, height) = map.size();
    let below = 66.0 + 22.0 * map.notes.len() as f64;
    let text =
        map.notes.iter().map(|note| font::width(note, TEXT)).fold(font::width(&map.title, 13.0), f64::max);
    let across = LEFT + (width + RIGHT).max(text + 20.0);
    let canvas = Canvas::blank(across as u32, (TOP + height + below) as u32, BACKGROUND);
    let mut sheet = Sheet { map, canvas, width, height, range: map.range(), labels: Vec::new() };
    sheet.colours();
    sheet.contours();
    sheet.things();
    sheet.frame();
    sheet.scale();
    sheet.canvas
}

impl HeatMap {
    /// Returns the corner with the smallest coordinates and the extent, in the coordinates of the map.
    fn extent(&self) -> ([f64; 2], [f64; 2]) {
        match self.under {
            Under::Image { width_px, height_px } => {
                ([-0.5, -0.5], [f64::from(width_px), f64::from(height_px)])
            }
            Under::Plan { least_m, greatest_m, .. } => {
                (least_m, [greatest_m[0] - least_m[0], greatest_m[1] - least_m[1]])
            }
        }
    }

    fn size(&self) -> (f64, f64) {
        let [w, h] = self.extent().1.map(|x| x.max(f64::MIN_POSITIVE));
        let unit = SIDE / w.max(h);
        ((w * unit).max(240.0).round(), (h * unit).max(240.0).round())
    }

    /// Returns the range of the colours: from the smallest value to the one that a twentieth of the cells exceeds.
    fn range(&self) -> Option<[f64; 2]> {
        let mut all: Vec<f64> =
            self.values.iter().flatten().copied().filter(|v| 0.0 < *v && v.is_finite()).collect();
        all.sort_by(f64::total_cmp);
        let (least, most) = (*all.first()?, all[(all.len() - 1) * 19 / 20]);
        Some([least, most.max(least * 1.05)])
    }

    /// Writes a value with three significant figures, so that a scale from 12.1 to 12.9 mm does not read 12, 12, 13.
    fn words(&self, value: f64) -> String {
        let (value, unit) = match self.figure {
            Figure::Angle => (value.to_degrees(), "°"),
            Figure::Length if value < 1e-3 => (value * 1e6, " µm"),
            Figure::Length if value < 1.0 => (value * 1e3, " mm"),
            Figure::Length => (value, " m"),
        };
        let whole = if 0.0 < value && value.is_finite() { value.log10().floor() as i32 } else { 0 };
        let text = format!("{value:.*}", (2 - whole).clamp(0, 6) as usize);
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        format!("{text}{unit}")
    }
}

struct Sheet<'a> {
    map: &'a HeatMap,
    canvas: Canvas,
    width: f64,
    height: f64,
    range: Option<[f64; 2]>,
    /// Positions of the labels written already.
    labels: Vec<Vector2<f64>>,
}

impl Sheet<'_> {
    /// Returns the canvas position of a position on the map.
    fn place(&self, [x, y]: [f64; 2]) -> Vector2<f64> {
        let ([x0, y0], [w, h]) = self.map.extent();
        let (s, t) = ((x - x0) / w, (y - y0) / h);
        let t = if matches!(self.map.under, Under::Plan { .. }) { 1.0 - t } else { t };
        Vector2::new(LEFT + s * self.width, TOP + t * self.height)
    }

    /// Returns the canvas position of a position in grid units (cell centres are at whole numbers).
    fn grid_place(&self, p: &Vector2<f64>) -> Vector2<f64> {
        let ([x0, y0], [w, h]) = self.map.extent();
        let (columns, rows) = (self.map.columns as f64, self.grid().rows() as f64);
        self.place([x0 + (p.x + 0.5) / columns * w, y0 + (p.y + 0.5) / rows * h])
    }

    fn grid(&self) -> Grid<'_> {
        Grid { columns: self.map.columns, values: &self.map.values }
    }

    fn colours(&mut self) {
        let (w, h) = (self.width as u32, self.height as u32);
        let (columns, rows) = (self.map.columns as f64, self.grid().rows() as f64);
        let upwards = matches!(self.map.under, Under::Plan { .. });
        for y in 0..h {
            for x in 0..w {
                let (s, t) = ((f64::from(x) + 0.5) / self.width, (f64::from(y) + 0.5) / self.height);
                let t = if upwards { 1.0 - t } else { t };
                let (gx, gy) = (s * columns - 0.5, t * rows - 0.5);
                let grid = self.grid();
                let nearest = || grid.at(gx.round().max(0.0) as usize, gy.round().max(0.0) as usize);
                let hatched = if (x + y) % 12 < 2 { HATCH } else { NOTHING };
                let color = grid.between(gx, gy).or_else(nearest).map_or(hatched, |v| self.color(v));
                self.canvas.set(LEFT as u32 + x, TOP as u32 + y, color);
            }
        }
    }

    /// Returns the position of a value on the logarithmic scale, 0 to 1.
    fn share(&self, value: f64) -> f64 {
        let Some([least, most]) = self.range else { return 0.0 };
        if value.is_nan() { 1.0 } else { ((value / least).ln() / (most / least).ln()).clamp(0.0, 1.0) }
    }

    fn color(&self, value: f64) -> Color {
        let at = self.share(value) * (SCALE.len() - 1) as f64;
        let i = (at.floor() as usize).min(SCALE.len() - 2);
        let mix = |k: usize| {
            let (a, b) = (f64::from(SCALE[i][k]), f64::from(SCALE[i + 1][k]));
            (a + (b - a) * (at - i as f64)).round() as u8
        };
        [mix(0), mix(1), mix(2)]
    }

    fn levels(&self) -> Vec<f64> {
        // Labels state degrees, so the levels are round numbers of degrees.
        let unit = if self.map.figure == Figure::Angle { 1f64.to_radians() } else { 1.0 };
        let Some([least, most]) = self.range else { return Vec::new() };
        levels(least / unit, most / unit, 4).into_iter().map(|v| v * unit).collect()
    }

    fn contours(&mut self) {
        // Contour labels keep away from the control points and their names, so that these stay readable.
        self.labels = self
            .map
            .control_points
            .iter()
            .map(|control_point| self.place(control_point.at) + Vector2::new(20.0, 0.0))
            .collect();
        for level in self.levels() {
            let found = self.grid().contour(level);
            let segments: Vec<Path> =
                found.iter().map(|s| s.iter().map(|p| self.grid_place(p)).collect()).collect();
            self.canvas.stroke(&segments, Pen { color: [0, 0, 0], width: 1.2, opacity: 0.75 });
            self.label_contour(&segments, &self.map.words(level));
        }
    }

    /// Writes the value on the line, away from other labels and from the edges.
    fn label_contour(&mut self, segments: &[Path], text: &str) {
        let width = font::width(text, TEXT);
        let inside = |p: &Vector2<f64>| {
            LEFT + width < p.x
                && p.x < LEFT + self.width - width
                && TOP + 20.0 < p.y
                && p.y < TOP + self.height - 20.0
        };
        let room = |p: &Vector2<f64>| self.labels.iter().map(|l| (l - p).norm()).fold(600.0, f64::min);
        let middles = segments.iter().map(|s| (s[0] + s[1]) * 0.5).filter(inside);
        let best = middles.max_by(|a, b| room(a).total_cmp(&room(b)));
        let Some(at) = best.filter(|p| 60.0 < room(p)) else { return };
        self.labels.push(at);
        self.write(text, at - Vector2::new(0.5 * width, -0.5 * TEXT), TEXT, PAPER);
    }

    fn write(&mut self, text: &str, baseline: Vector2<f64>, height: f64, color: Color) {
        let pen = Pen { color, width: 1.3, opacity: 1.0 };
        let rim = Pen { color: [0, 0, 0], width: 4.2, opacity: 0.6 };
        let paths = font::strokes(text, baseline, height);
        self.canvas.stroke(&paths, rim);
        self.canvas.stroke(&paths, pen);
    }

    fn things(&mut self) {
        let lines: Vec<Path> =
            self.map.lines.iter().map(|ends| ends.iter().map(|e| self.place(*e)).collect()).collect();
        self.canvas.stroke_with_rim(&lines, Pen { color: PAPER, width: 2.5, opacity: 1.0 });
        for control_point in &self.map.control_points {
            self.control_point(control_point);
        }
    }

    fn control_point(&mut self, control_point: &MapMarker) {
        let at = self.place(control_point.at);
        let (color, paths) = match control_point.kind {
            MapMarkerKind::Known => (KNOWN, vec![ring(at, 6.0), vec![at]]),
            MapMarkerKind::Best => (BEST, vec![diamond(at, 10.0), diamond(at, 4.0)]),
            MapMarkerKind::Camera => (CAMERA, camera_sign(at, control_point.towards.map(|t| self.place(t)))),
        };
        self.canvas.stroke_with_rim(&paths, Pen { color, width: 2.4, opacity: 1.0 });
        let width = font::width(&control_point.name, TEXT);
        let right = at + Vector2::new(14.0, 4.0);
        let fits = right.x + width < LEFT + self.width;
        let baseline = if fits { right } else { at + Vector2::new(-14.0 - width, 4.0) };
        self.write(&control_point.name, baseline, TEXT, color);
    }

    /// Draws the title, the notes, the border, and the ticks with their numbers.
    fn frame(&mut self) {
        let corner = |dx: f64, dy: f64| Vector2::new(LEFT + dx * self.width, TOP + dy * self.height);
        let border =
            vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0), corner(0.0, 0.0)];
        self.canvas.stroke(&[border], Pen { color: DIM, width: 1.0, opacity: 1.0 });
        self.write(&self.map.title, Vector2::new(LEFT, 28.0), 13.0, PAPER);
        let ([x0, y0], [w, h]) = self.map.extent();
        let bottom = TOP + self.height;
        for x in ticks(x0, x0 + w) {
            let at = Vector2::new(self.place([x, y0]).x, bottom);
            self.tick(at, Vector2::new(0.0, 6.0));
            let text = number(x);
            self.write(&text, at + Vector2::new(-0.5 * font::width(&text, TEXT), 24.0), TEXT, DIM);
        }
        for y in ticks(y0, y0 + h) {
            let at = Vector2::new(LEFT, self.place([x0, y]).y);
            self.tick(at, Vector2::new(-6.0, 0.0));
            let text = number(y);
            self.write(&text, at + Vector2::new(-12.0 - font::width(&text, TEXT), 0.5 * TEXT), TEXT, DIM);
        }
        let [across, up] = match self.map.under {
            Under::Image { .. } => ["u px", "v px"],
            Under::Plan { axes, .. } => axes,
        };
        let end = LEFT + self.width - font::width(across, TEXT);
        self.write(across, Vector2::new(end, bottom + 44.0), TEXT, PAPER);
        self.write(up, Vector2::new(LEFT - 16.0 - font::width(up, TEXT), 28.0), TEXT, PAPER);
        for (i, note) in self.map.notes.iter().enumerate() {
            self.write(note, Vector2::new(LEFT, bottom + 62.0 + 22.0 * i as f64), TEXT, DIM);
        }
    }

    fn tick(&mut self, at: Vector2<f64>, by: Vector2<f64>) {
        self.canvas.stroke(&[vec![at, at + by]], Pen { color: DIM, width: 1.0, opacity: 1.0 });
    }

    /// Draws the colours with their numbers to the right of the map, and explains that grey means no value.
    fn scale(&mut self) {
        let Some([least, most]) = self.range else { return };
        let (left, bar, top) = (LEFT + self.width + 22.0, 20.0, TOP + 24.0);
        let height = (self.height - 60.0).min(360.0);
        for y in 0..height as u32 {
            let value = least * (most / least).powf(1.0 - f64::from(y) / height);
            let color = self.color(value);
            for x in 0..bar as u32 {
                self.canvas.set(left as u32 + x, top as u32 + y, color);
            }
        }
        self.write("2σ", Vector2::new(left, top - 8.0), TEXT, PAPER);
        let mut last = f64::INFINITY;
        for value in [vec![least], self.levels(), vec![most]].concat() {
            let y = top + height * (1.0 - self.share(value));
            // A number that would overlap another is left out.
            if 16.0 < last - y {
                self.tick(Vector2::new(left + bar, y), Vector2::new(5.0, 0.0));
                self.write(
                    &self.map.words(value),
                    Vector2::new(left + bar + 9.0, y + 0.5 * TEXT),
                    TEXT,
                    PAPER,
                );
                last = y;
            }
        }
        for i in 0..bar as u32 * 14 {
            let (x, y) = (i % bar as u32, i / bar as u32);
            let color = if (x + y) % 12 < 2 { HATCH } else { NOTHING };
            self.canvas.set(left as u32 + x, (top + height) as u32 + 14 + y, color);
        }
        self.write("none", Vector2::new(left + bar + 9.0, top + height + 26.0), TEXT, DIM);
    }
}

fn ring(centre: Vector2<f64>, radius: f64) -> Path {
    let at = |k: i32| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 20.0).sin_cos();
        centre + Vector2::new(cos, sin) * radius
    };
    (0..=20).map(at).collect()
}

fn diamond(centre: Vector2<f64>, radius: f64) -> Path {
    [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
        .iter()
        .map(|(x, y)| centre + Vector2::new(*x, *y) * radius)
        .collect()
}

/// Returns the outline of a camera symbol: a box with an opening towards the point that the camera looks at.
fn camera_sign(at: Vector2<f64>, towards: Option<Vector2<f64>>) -> Vec<Path> {
    let ahead = towards.and_then(|t| (t - at).try_normalize(1e-9)).unwrap_or(-Vector2::y());
    let across = Vector2::new(-ahead.y, ahead.x);
    let body = [(-9.0, -6.0), (3.0, -6.0), (3.0, 6.0), (-9.0, 6.0), (-9.0, -6.0)];
    let hood = [(3.0, -3.0), (11.0, -8.0), (11.0, 8.0), (3.0, 3.0)];
    let path = |points: &[(f64, f64)]| points.iter().map(|(a, b)| at + ahead * *a + across * *b).collect();
    vec![path(&body), path(&hood)]
}

/// Returns four to nine round numbers within a range.
fn ticks(from: f64, to: f64) -> Vec<f64> {
    let step = crate::overlay::round_down_125((to - from) / 4.0);
    let (first, last) = ((from / step).ceil() as i64, (to / step).floor() as i64);
    let is_range = step.is_normal() && from.is_finite() && last.saturating_sub(first) <= 50;
    if is_range { (first..=last).map(|i| i as f64 * step).collect() } else { Vec::new() }
}

/// Formats a number without trailing zeros.
fn number(x: f64) -> String {
    let text = format!("{x:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> HeatMap {
        let value = |k: usize| if k % 40 < 4 { None } else { Some(0.01 * (1.0 + (k % 40) as f64)) };
        HeatMap {
            title: "a plan".into(),
            notes: vec!["one".into()],
            figure: Figure::Length,
            under: Under::Plan { least_m: [0.0, 0.0], greatest_m: [8.0, 4.0], axes: ["x m", "y m"] },
            columns: 40,
            values: (0..800).map(value).collect(),
            control_points: vec![MapMarker {
                at: [6.0, 1.0],
                name: "P".into(),
                kind: MapMarkerKind::Known,
                towards: None,
            }],
            lines: Vec::new(),
        }
    }

    /// Colours follow the values, the second axis points up, cells without a value are grey, and a control point is drawn at its position.
    #[test]
    fn what_is_drawn_is_where_it_belongs() {
        let map = map();
        let canvas = draw(&map);
        let at = |x: f64, y: f64| canvas.at((LEFT + x * SIDE) as u32, (TOP + y * SIDE / 2.0) as u32);
        assert!([NOTHING, HATCH].contains(&at(0.02, 0.51)), "{:?}", at(0.02, 0.51));
        let light = |c: Color| c.iter().map(|x| u32::from(*x)).sum::<u32>();
        assert!(light(at(0.13, 0.93)) < light(at(0.99, 0.93)));
        // (6, 1) of (8, 4): three quarters across, three quarters down.
        assert_eq!(at(0.75, 0.75), KNOWN);
        assert_ne!(at(0.75, 0.25), KNOWN);
    }

    #[test]
    fn a_map_of_nothing_is_drawn_too() {
        let values = vec![None; 800];
        let canvas = draw(&HeatMap { values, ..map() });
        assert!(canvas.png().is_ok_and(|bytes| 1000 < bytes.len()));
        let same = vec![Some(1.0); 800];
        assert!(draw(&HeatMap { values: same, ..map() }).png().is_ok());
    }

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(ticks(0.3, 8.4), [2.0, 4.0, 6.0, 8.0]);
        assert!(ticks(-0.5, 639.5).len() < 10 && ticks(0.0, f64::INFINITY).is_empty());
        let read = |figure, value: f64| HeatMap { figure, ..map() }.words(value);
        assert_eq!(
            [0.01212, 0.02, 1.5, 3e-4].map(|x| read(Figure::Length, x)),
            ["12.1 mm", "20 mm", "1.5 m", "300 µm"]
        );
        assert_eq!(read(Figure::Angle, 0.5f64.to_radians()), "0.5°");
        assert_eq!([number(-0.0), number(0.5), number(10.0)], ["0", "0.5", "10"]);
    }
}
