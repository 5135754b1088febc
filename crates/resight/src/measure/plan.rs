//! The plan: the scene from above, to scale, with control points, points, lengths, photographs and 95 % ellipses.

use super::answers::{Answers, QueryAnswer};
use super::scene::{NamedScene, QueryKind};
use super::words;
use crate::core::multiview::network::Adjusted;
use crate::drawing::{Anchor, Drawing};
use crate::overlay::canvas::{Color, Path};
use crate::overlay::font;
use crate::overlay::geometry::{ellipse, round_down_125, semi_axes};
use nalgebra::{Matrix2, Vector2, Vector3};

const INK: Color = [25, 28, 33];
const GRID: Color = [226, 230, 236];
const DIM: Color = [110, 116, 126];
const MARK: Color = [200, 30, 30];
const POINT: Color = [20, 95, 190];
const LENGTH: Color = [0, 120, 70];
const ELLIPSE: Color = [225, 110, 20];
const PHOTO: Color = [125, 60, 160];
const AXES: [Color; 2] = [[220, 50, 47], [40, 150, 60]];

/// The drawing's longer side without its margins, px.
const LONGER_SIDE_PX: f64 = 1200.0;
const MARGIN_PX: f64 = 90.0;
/// Height of the caption at the bottom, px.
const CAPTION_PX: f64 = 86.0;
const TEXT_PX: f64 = 11.0;
/// Number of letters of a warning that fit across the drawing.
const MOST_WARNING: usize = 150;
/// √χ² of two degrees of freedom at 95 %.
const SIGMAS_95: f64 = 2.447_746_830_680_816;
/// Smallest visible semi-axis of an ellipse, px.
const VISIBLE_PX: f64 = 5.0;

/// The map from metres to the drawing; its axes `right` and `up` are axes of the frame.
struct Sheet {
    right: usize,
    up: usize,
    least: Vector2<f64>,
    px_per_m: f64,
    width_px: f64,
    height_px: f64,
}

impl Sheet {
    fn flat(&self, x: &Vector3<f64>) -> Vector2<f64> {
        Vector2::new(x[self.right], x[self.up])
    }

    fn px(&self, flat: &Vector2<f64>) -> Vector2<f64> {
        let p = (flat - self.least) * self.px_per_m;
        Vector2::new(MARGIN_PX + p.x, MARGIN_PX + self.height_px - p.y)
    }

    fn at(&self, x: &Vector3<f64>) -> Vector2<f64> {
        self.px(&self.flat(x))
    }
}

/// Draws the plan; `None` where nothing has a position.
pub fn plan(scene: &NamedScene, answers: &Answers, title: &str) -> Option<Drawing> {
    let sheet = sheet(scene, &answers.adjusted)?;
    let (w, h) = (sheet.width_px + 2.0 * MARGIN_PX, sheet.height_px + 2.0 * MARGIN_PX + CAPTION_PX);
    let mut drawing = Drawing::new(w.ceil() as u32, h.ceil() as u32);
    let mut labels = Labels { sheet: Vector2::new(w, h), taken: Vec::new() };
    grid(&mut drawing, &sheet, scene);
    photos(&mut drawing, &mut labels, &sheet, scene, &answers.adjusted);
    let magnified = ellipses(&mut drawing, &sheet, scene, &answers.adjusted);
    answers.answers.iter().for_each(|answer| lines(&mut drawing, &sheet, answer, &answers.adjusted));
    points(&mut drawing, &mut labels, &sheet, scene, &answers.adjusted);
    answers
        .answers
        .iter()
        .for_each(|answer| lengths(&mut drawing, &mut labels, &sheet, answer, &answers.adjusted));
    axes(&mut drawing, &sheet);
    caption(&mut drawing, &sheet, scene, title, magnified);
    warning(&mut drawing, answers);
    Some(drawing)
}

fn placed(scene: &NamedScene, adjusted: &Adjusted) -> Vec<Vector3<f64>> {
    let points = (0..scene.points.len()).filter_map(|p| adjusted.point(p));
    let eyes = (0..scene.photos.len()).filter_map(|p| adjusted.cam_from_world(p)).map(|pose| pose.origin());
    points.chain(eyes).collect()
}

fn sheet(scene: &NamedScene, adjusted: &Adjusted) -> Option<Sheet> {
    let (right, up) = if scene.is_camera_frame { (0, 2) } else { (0, 1) };
    let all: Vec<Vector2<f64>> =
        placed(scene, adjusted).iter().map(|x| Vector2::new(x[right], x[up])).collect();
    let first = *all.first()?;
    let (least, most) = all.iter().fold((first, first), |(a, b), x| (a.inf(x), b.sup(x)));
    let extent = (most - least).max().max(1e-3);
    let px_per_m = LONGER_SIDE_PX / extent;
    // A scene along one line still has a plan of some width.
    let room = Vector2::repeat(0.3 * extent);
    let short = (most - least).zip_map(&room, |have, need| f64::max(need - have, 0.0) * 0.5);
    let (least, most) = (least - short, most + short);
    let [width_px, height_px] = [(most.x - least.x) * px_per_m, (most.y - least.y) * px_per_m];
    Some(Sheet { right, up, least, px_per_m, width_px, height_px })
}

/// Draws grid lines with a round step, labelled along the edges in the scene's own coordinates.
fn grid(drawing: &mut Drawing, sheet: &Sheet, scene: &NamedScene) {
    let step = round_down_125(110.0 / sheet.px_per_m);
    let (left, right) = (0.4 * MARGIN_PX, sheet.width_px + 1.6 * MARGIN_PX);
    let (top, bottom) = (0.4 * MARGIN_PX, sheet.height_px + 1.6 * MARGIN_PX);
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let origin = sheet.flat(&scene.origin_m);
    let first = |x: f64| (x / step).ceil() as i64;
    let metres = |px: f64| (px - MARGIN_PX) / sheet.px_per_m;
    for i in first(sheet.least.x + metres(left))..=(sheet.least.x + metres(right)).div_euclid(step) as i64 {
        let x = i as f64 * step;
        let u = sheet.px(&Vector2::new(x, 0.0)).x;
        drawing.line(vec![Vector2::new(u, top), Vector2::new(u, bottom)], GRID, 1.0);
        let label = format!("{:.decimals$}", x + origin.x);
        drawing.text(&label, Vector2::new(u, top - 6.0), 8.0, DIM, Anchor::Middle);
    }
    // Grid lines end at the edge of the drawing.
    let height = |px: f64| sheet.least.y + (sheet.height_px + MARGIN_PX - px) / sheet.px_per_m;
    for i in first(height(bottom))..=height(top).div_euclid(step) as i64 {
        let y = i as f64 * step;
        let v = sheet.px(&Vector2::new(0.0, y)).y;
        drawing.line(vec![Vector2::new(left, v), Vector2::new(right, v)], GRID, 1.0);
        let label = format!("{:.decimals$}", y + origin.y);
        drawing.text(&label, Vector2::new(left - 4.0, v + 3.0), 8.0, DIM, Anchor::End);
    }
}

fn arrow(from: Vector2<f64>, to: Vector2<f64>, head_px: f64) -> Vec<Path> {
    let along = (to - from).normalize();
    let across = Vector2::new(-along.y, along.x);
    let barb = |side: f64| to - along * head_px + across * (0.4 * side * head_px);
    vec![vec![from, to], vec![barb(1.0), to, barb(-1.0)]]
}

/// Draws the axes in the band at the bottom, where nothing else is.
fn axes(drawing: &mut Drawing, sheet: &Sheet) {
    let names = ["x", "y", "z"];
    let corner = Vector2::new(f64::from(drawing.width_px) - 110.0, f64::from(drawing.height_px) - 24.0);
    for (axis, direction) in [(sheet.right, Vector2::new(1.0, 0.0)), (sheet.up, Vector2::new(0.0, -1.0))] {
        let color = AXES[usize::from(axis != sheet.right)];
        let tip = corner + direction * 46.0;
        arrow(corner, tip, 9.0).into_iter().for_each(|path| drawing.line(path, color, 2.0));
        let at = tip + direction * 12.0 + Vector2::new(0.0, 4.0);
        drawing.text(names[axis], at, TEXT_PX, color, Anchor::Middle);
    }
}

/// The positions of texts, kept so that no two overlap: their middle lines, as points with a radius.
struct Labels {
    /// Width and height of the sheet, px.
    sheet: Vector2<f64>,
    taken: Vec<(Vector2<f64>, f64)>,
}

/// A possible position of a text: a point of its baseline, its anchor, its rotation.
type Spot = (Vector2<f64>, Anchor, f64);

impl Labels {
    /// Returns points along a text, at distances of the letters' height.
    fn beads(text: &str, height: f64, (at, anchor, rotation_rad): Spot) -> Vec<Vector2<f64>> {
        let width = font::width(text, height);
        let back = match anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => 0.5 * width,
            Anchor::End => width,
        };
        let (along, up) = (
            Vector2::new(rotation_rad.cos(), rotation_rad.sin()),
            Vector2::new(rotation_rad.sin(), -rotation_rad.cos()) * (0.5 * height),
        );
        let n = (width / height).ceil().max(1.0);
        (0..=n as usize).map(|i| at + along * (width * i as f64 / n - back) + up).collect()
    }

    fn is_free(&self, beads: &[Vector2<f64>], height: f64) -> bool {
        let inside = |b: &Vector2<f64>| height < b.x.min(b.y) && height < (self.sheet - b).min();
        let clear =
            |b: &Vector2<f64>| self.taken.iter().all(|(at, radius)| 0.85 * height + radius < (b - at).norm());
        beads.iter().all(|b| inside(b) && clear(b))
    }

    /// Writes a text at the first free position, or at the first of all where none is free.
    fn write(&mut self, drawing: &mut Drawing, text: &str, height: f64, color: Color, spots: &[Spot]) {
        let free = spots.iter().find(|spot| self.is_free(&Self::beads(text, height, **spot), height));
        let Some(spot) = free.or(spots.first()) else { return };
        self.taken.extend(Self::beads(text, height, *spot).into_iter().map(|b| (b, 0.6 * height)));
        drawing.rotated_text(text, spot.0, height, color, spot.1, spot.2);
    }

    fn keep_clear(&mut self, at: Vector2<f64>, radius: f64) {
        self.taken.push((at, radius));
    }
}

/// Returns positions beside a point: right above, left above, right below, left below, then farther away.
fn around(at: Vector2<f64>) -> Vec<Spot> {
    let ring = |far: f64| {
        [
            (9.0, -8.0, Anchor::Start),
            (-9.0, -8.0, Anchor::End),
            (9.0, 18.0, Anchor::Start),
            (-9.0, 18.0, Anchor::End),
            (0.0, -14.0, Anchor::Middle),
            (0.0, 26.0, Anchor::Middle),
        ]
        .map(|(u, v, anchor)| (at + Vector2::new(u, v) * far, anchor, 0.0))
    };
    [1.0, 1.7, 2.6, 3.6].iter().flat_map(|far| ring(*far)).collect()
}

/// Returns positions along a line, never upside down, above or below it, in the middle or towards its ends.
fn along(a: Vector2<f64>, b: Vector2<f64>) -> Vec<Spot> {
    let (a, b) = if b.x < a.x { (b, a) } else { (a, b) };
    let rotation_rad = (b.y - a.y).atan2(b.x - a.x);
    let up = Vector2::new(rotation_rad.sin(), -rotation_rad.cos());
    let spot = |part: f64, lift: f64| (a.lerp(&b, part) + up * lift, Anchor::Middle, rotation_rad);
    let parts = [0.5, 0.35, 0.65, 0.22, 0.78];
    let near = parts.into_iter().flat_map(|part| [spot(part, 6.0), spot(part, -6.0 - TEXT_PX)]);
    near.chain(parts.into_iter().flat_map(|part| [spot(part, 22.0), spot(part, -22.0 - TEXT_PX)])).collect()
}

/// Draws each camera as a triangle, open towards what it looks at, with its name.
fn photos(
    drawing: &mut Drawing,
    labels: &mut Labels,
    sheet: &Sheet,
    scene: &NamedScene,
    adjusted: &Adjusted,
) {
    for (index, photo) in scene.photos.iter().enumerate() {
        let Some(cam_from_world) = adjusted.cam_from_world(index) else { continue };
        let eye = sheet.at(&cam_from_world.origin());
        let ahead = cam_from_world.rotation.tr_mul(&Vector3::z());
        let flat = sheet.flat(&ahead);
        let along = Vector2::new(flat.x, -flat.y).try_normalize(1e-6).unwrap_or(Vector2::new(0.0, -1.0));
        let across = Vector2::new(-along.y, along.x);
        let corners = [along * 30.0 + across * 14.0, along * 30.0 - across * 14.0];
        drawing.line(vec![eye, eye + corners[0], eye + corners[1], eye], PHOTO, 2.0);
        arrow(eye + along * 30.0, eye + along * 58.0, 8.0)
            .into_iter()
            .for_each(|p| drawing.line(p, PHOTO, 2.0));
        let name = format!("photo {}", photo.name);
        let below = (eye - along * 18.0 + Vector2::new(0.0, 4.0), Anchor::Middle, 0.0);
        labels.keep_clear(eye + along * 20.0, 16.0);
        labels.write(drawing, &name, TEXT_PX, PHOTO, &[&[below][..], &around(eye)].concat());
    }
}

/// Draws the 95 % ellipses, all with one magnification where most would be invisible; returns the factor.
fn ellipses(drawing: &mut Drawing, sheet: &Sheet, scene: &NamedScene, adjusted: &Adjusted) -> f64 {
    let axes = |p: usize| {
        let full = adjusted.point_covariance_m2(p)?;
        let pick = [sheet.right, sheet.up];
        let [a, b] = semi_axes(&Matrix2::from_fn(|i, j| full[(pick[i], pick[j])]), SIGMAS_95);
        let px = |v: Vector2<f64>| Vector2::new(v.x, -v.y) * sheet.px_per_m;
        Some((sheet.at(&adjusted.point(p)?), [px(a), px(b)]))
    };
    let all: Vec<_> = (0..scene.points.len()).filter_map(axes).collect();
    let mut sizes: Vec<f64> =
        all.iter().map(|(_, [a, b])| a.norm().max(b.norm())).filter(|s| 0.01 < *s).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2).copied().unwrap_or(VISIBLE_PX);
    let factor = if median < VISIBLE_PX { round_down_125(VISIBLE_PX * 2.0 / median).max(1.0) } else { 1.0 };
    for (centre, axes) in all {
        drawing.line(ellipse(centre, &axes.map(|a| a * factor)), ELLIPSE, 1.5);
    }
    factor
}

fn path_of(sheet: &Sheet, answer: &QueryAnswer, adjusted: &Adjusted) -> Option<Path> {
    answer.result.as_ref().ok()?;
    answer.query.points.iter().map(|p| adjusted.point(*p).map(|x| sheet.at(&x))).collect()
}

fn arms(path: &Path) -> [Vector2<f64>; 2] {
    [path[0], path[2]].map(|end| path[1] + (end - path[1]).cap_magnitude(44.0))
}

/// Draws the measured quantities as lines.
fn lines(drawing: &mut Drawing, sheet: &Sheet, answer: &QueryAnswer, adjusted: &Adjusted) {
    let Some(mut path) = path_of(sheet, answer, adjusted) else { return };
    match answer.query.kind {
        QueryKind::Distance | QueryKind::Polyline => drawing.line(path, LENGTH, 2.0),
        QueryKind::Area => {
            path.push(path[0]);
            drawing.line(path, LENGTH, 1.0);
        }
        QueryKind::Angle => drawing.line(arc(&path), LENGTH, 1.2),
        QueryKind::Height | QueryKind::Position => {}
    }
}

/// Returns the arc from one arm of an angle to the other, along the smaller angle.
fn arc(path: &Path) -> Path {
    let [a, b] = arms(path).map(|end| end - path[1]);
    let (from, turn) = (a.y.atan2(a.x), (a.x * b.y - a.y * b.x).atan2(a.dot(&b)));
    let at = |i: usize| {
        let (sin, cos) = (from + turn * i as f64 / 24.0).sin_cos();
        path[1] + Vector2::new(cos, sin) * 30.0
    };
    (0..=24).map(at).collect()
}

/// Writes the measured quantities beside their lines.
fn lengths(
    drawing: &mut Drawing,
    labels: &mut Labels,
    sheet: &Sheet,
    answer: &QueryAnswer,
    adjusted: &Adjusted,
) {
    let (Some(path), Ok(values)) = (path_of(sheet, answer, adjusted), &answer.result) else { return };
    let Some(measured) = values.first() else { return };
    let said = words::value(answer.query.kind, measured);
    let (text, spots) = match answer.query.kind {
        QueryKind::Distance => (said, along(path[0], path[1])),
        QueryKind::Polyline => {
            let pieces = path.windows(2).flat_map(|pair| along(pair[0], pair[1])).collect();
            (format!("{}: {said}", answer.query.name), pieces)
        }
        QueryKind::Area => {
            (format!("area {said}"), around(path.iter().sum::<Vector2<f64>>() / path.len() as f64))
        }
        QueryKind::Angle => {
            (said, around(path[1] + (0.5 * (arms(&path)[0] + arms(&path)[1]) - path[1]) * 0.6))
        }
        QueryKind::Height => (format!("{}: height {said}", answer.query.name), around(path[0])),
        QueryKind::Position => return,
    };
    labels.write(drawing, &text, TEXT_PX, LENGTH, &spots);
}

/// Points nearer than this in the drawing share one label.
const SAME_PX: f64 = 6.0;

/// Draws control points as crossed squares and points as dots, with names; points above one another share a label.
fn points(
    drawing: &mut Drawing,
    labels: &mut Labels,
    sheet: &Sheet,
    scene: &NamedScene,
    adjusted: &Adjusted,
) {
    let all: Vec<(usize, Vector2<f64>)> =
        (0..scene.points.len()).filter_map(|p| Some((p, sheet.at(&adjusted.point(p)?)))).collect();
    for (index, at) in &all {
        let color = if scene.is_control_point[*index] { MARK } else { POINT };
        if scene.is_control_point[*index] {
            let corner = |u: f64, v: f64| at + Vector2::new(u, v) * 5.0;
            let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)];
            drawing.line(square.iter().map(|(u, v)| corner(*u, *v)).collect(), color, 1.6);
        }
        drawing.line(vec![*at, *at], color, if scene.is_control_point[*index] { 3.0 } else { 7.0 });
        labels.keep_clear(*at, 3.0);
    }
    for (i, (index, at)) in all.iter().enumerate() {
        let is_near = |(_, other): &&(usize, Vector2<f64>)| (other - at).norm() < SAME_PX;
        if all[..i].iter().any(|other| is_near(&other)) {
            continue;
        }
        let names: Vec<&str> =
            all[i..].iter().filter(is_near).map(|(p, _)| scene.points[*p].as_str()).collect();
        let color = if scene.is_control_point[*index] { MARK } else { POINT };
        labels.write(drawing, &names.join(", "), TEXT_PX, color, &around(*at));
    }
}

/// Writes the fault above everything else.
fn warning(drawing: &mut Drawing, answers: &Answers) {
    if let Some(first) = answers.verdict.first() {
        let short: String = first.chars().take(MOST_WARNING).collect();
        let cut = if short.len() < first.len() { " …" } else { "" };
        drawing.text(
            &format!("{short}{cut}"),
            Vector2::new(0.4 * MARGIN_PX, 20.0),
            12.0,
            MARK,
            Anchor::Start,
        );
    }
}

fn caption(drawing: &mut Drawing, sheet: &Sheet, scene: &NamedScene, title: &str, magnified: f64) {
    let bottom = drawing.height_px as f64;
    let bar_m = round_down_125(200.0 / sheet.px_per_m);
    let from = Vector2::new(0.4 * MARGIN_PX, bottom - 44.0);
    let to = from + Vector2::new(bar_m * sheet.px_per_m, 0.0);
    for end in [from, to] {
        drawing.line(vec![end - Vector2::new(0.0, 5.0), end + Vector2::new(0.0, 5.0)], INK, 2.0);
    }
    drawing.line(vec![from, to], INK, 2.0);
    drawing.text(
        &format!("{bar_m} m"),
        0.5 * (from + to) + Vector2::new(0.0, -8.0),
        TEXT_PX,
        INK,
        Anchor::Middle,
    );
    let seen =
        if scene.is_camera_frame { "seen from above (x right, z ahead)" } else { "seen from above (z)" };
    let ellipses = match magnified {
        1.0 => "95 % ellipses to scale".to_string(),
        factor => format!("95 % ellipses {factor} × enlarged"),
    };
    let note = format!("{title}, {seen}; {ellipses}; lengths with 95 % intervals; squares are marks");
    drawing.text(&note, Vector2::new(0.4 * MARGIN_PX, bottom - 14.0), 10.0, INK, Anchor::Start);
}
