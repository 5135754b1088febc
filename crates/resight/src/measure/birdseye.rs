//! Rectifies a photograph onto the ground plane: the ground seen vertically from above, with a metric grid and the limits of the photograph.
//!
//! Each pixel of the image is a point of the plane; pose and lens map it to the photograph, where its grey level is read. Hatched areas are
//! those where one pixel of the photograph covers more ground than a stated size, and those where an image point would be off by more than a
//! stated length (95 %, from the image point's sigma and the uncertainty of photograph, lens and plane).

use super::answers::Answers;
use super::scene::NamedScene;
use crate::GrayImage;
use crate::core::multiview::network::{Adjusted, Constraint};
use crate::core::{Camera, Pixel, Pose};
use crate::drawing::{Anchor, strokes};
use crate::image::exif::Heading;
use crate::overlay::canvas::{Canvas, Color, Path, Pen};
use crate::overlay::font;
use crate::overlay::geometry::round_down_125;
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

const BACKGROUND: Color = [24, 26, 30];
const PAPER: Color = [238, 238, 238];
const GRID: Color = [90, 215, 255];
const MARK: Color = [255, 90, 80];
const POINT: Color = [255, 225, 90];
const COARSE: Color = [255, 150, 40];
const UNSURE: Color = [240, 110, 255];
/// Longer side of the rectified ground, px.
const LONGER_SIDE_PX: f64 = 1300.0;
/// Grey level outside the photograph.
const UNSEEN: u8 = 52;
/// Margin of ground beyond the outermost points, as a part of their extent.
const RIM: f64 = 0.35;
/// Distance of the samples of the limits, px.
const CELL_PX: usize = 6;
/// Pixels between hatch lines.
const HATCH_PX: usize = 26;
/// Height of capitals: 8 px where the image is a third as large, as beside the photograph on a page.
const TEXT_PX: f64 = 24.0;
const LINE_PX: f64 = 40.0;
/// Radius of a point, px.
const POINT_PX: f64 = 10.0;
/// Length of the arrow to the north, px.
const ARROW_PX: f64 = 90.0;
/// Least horizontal part of a unit line of sight whose heading is defined: that of a camera that points 12° from vertically down.
const LEAST_LEVEL: f64 = 0.2;
/// √χ² of two degrees of freedom at 95 %.
const SIGMAS_95: f64 = 2.447_746_830_680_816;

/// The plane with its axes: point = origin + s · right + t · ahead, t upwards in the image.
struct Ground {
    origin: Vector3<f64>,
    axes: Matrix3x2<f64>,
    least: Vector2<f64>,
    size_m: Vector2<f64>,
    px_per_m: f64,
}

/// The photograph that is rectified.
struct Source<'a> {
    image: &'a GrayImage,
    camera: &'a Camera,
    cam_from_world: Pose,
    adjusted: &'a Adjusted,
    photo: usize,
    sigma_px: f64,
}

/// The accuracy of one point of the ground.
#[derive(Clone, Copy)]
struct Worth {
    /// Longer side of the ground that one pixel covers, m.
    pixel_m: f64,
    /// 95 % error of an image point, m.
    error_m: f64,
}

/// Returns the rectified ground of a photograph; `None` where the plane or the photograph is not determined, or fewer than three points are on
/// the plane. Where the camera's heading is known, an arrow shows north.
pub fn birdseye(
    scene: &NamedScene,
    answers: &Answers,
    photo: usize,
    image: &GrayImage,
    heading: Option<Heading>,
) -> Option<Canvas> {
    let adjusted = &answers.adjusted;
    let source = Source {
        image,
        camera: adjusted.camera(scene.camera_of_photo[photo])?,
        cam_from_world: adjusted.cam_from_world(photo)?,
        adjusted,
        photo,
        sigma_px: scene.sigma_px,
    };
    let ground = ground(scene, answers, &source)?;
    let size = ground.size_m * ground.px_per_m;
    let (width, height) = (size.x.ceil() as u32, size.y.ceil() as u32);
    let north = heading.and_then(|heading| north(&ground.axes, &source.cam_from_world, heading.deg));
    let lines = caption(scene, photo, ground.grid_m(), width, heading.filter(|_| north.is_some()));
    let caption_px = ((lines.len() as f64 + 0.5) * LINE_PX) as u32;
    let mut canvas =
        Canvas::from_photograph(&rectified(&ground, &source, width, height), 1, caption_px, BACKGROUND);
    canvas.open_rows = height;
    let worth = Field::new(&ground, &source, width, height);
    let mut labels = Labels::new([f64::from(width), f64::from(height)]);
    if north.is_some() {
        labels.keep_free([f64::from(width) - 2.0 * ARROW_PX, 0.0], [f64::from(width), 2.0 * ARROW_PX]);
    }
    limits(&mut canvas, &worth, scene, &mut labels);
    grid(&mut canvas, &ground, scene, &mut labels, [width, height]);
    points(&mut canvas, &ground, scene, answers, &mut labels);
    if let Some(north) = &north {
        arrow(&mut canvas, north);
    }
    canvas.open_rows = canvas.height;
    for (i, line) in lines.iter().enumerate() {
        let at = Vector2::new(10.0, f64::from(height) + (i as f64 + 0.9) * LINE_PX);
        write(&mut canvas, line, at, PAPER, Anchor::Start);
    }
    Some(canvas)
}

fn ground(scene: &NamedScene, answers: &Answers, source: &Source) -> Option<Ground> {
    let adjusted = &answers.adjusted;
    let (normal, offset_m) = adjusted.plane(0).filter(|_| scene.has_ground)?;
    // World x points to the right, as in the plan, unless the plane is perpendicular to it.
    let x = Vector3::x() - normal * normal.x;
    let right = if 0.1 < x.norm() { x.normalize() } else { (Vector3::y() - normal * normal.y).normalize() };
    let axes = Matrix3x2::from_columns(&[right, normal.cross(&right)]);
    let origin = normal * offset_m;
    let on_it = scene.constraints.iter().filter_map(|f| match f {
        Constraint::OnPlane { plane: 0, point, .. } => adjusted.point(*point),
        _ => None,
    });
    let flat: Vec<Vector2<f64>> = on_it.map(|x| axes.tr_mul(&(x - origin))).collect();
    let first = *flat.first().filter(|_| 3 <= flat.len())?;
    let (least, most) = flat.iter().fold((first, first), |(a, b), p| (a.inf(p), b.sup(p)));
    let rim = RIM * (most - least).max();
    let (least, most) = (least - Vector2::repeat(rim), most + Vector2::repeat(rim));
    let size_m = most - least;
    let ground = Ground { origin, axes, least, size_m, px_per_m: LONGER_SIDE_PX / size_m.max() };
    let seen = flat.iter().any(|p| ground.project(source, &ground.place(p)).is_some());
    (seen && ground.px_per_m.is_finite()).then_some(ground)
}

impl Ground {
    fn place(&self, flat: &Vector2<f64>) -> Vector3<f64> {
        self.origin + self.axes * flat
    }

    /// Returns the point on the plane of a pixel of the image.
    fn at(&self, x: f64, y: f64) -> Vector3<f64> {
        let flat =
            Vector2::new(x, -y) / self.px_per_m + Vector2::new(self.least.x, self.least.y + self.size_m.y);
        self.place(&flat)
    }

    /// Returns the pixel in the image of a point on the plane.
    fn px(&self, flat: &Vector2<f64>) -> Vector2<f64> {
        let p = (flat - self.least) * self.px_per_m;
        Vector2::new(p.x, self.size_m.y * self.px_per_m - p.y)
    }

    fn project(&self, source: &Source, place: &Vector3<f64>) -> Option<Pixel> {
        let pixel = source.camera.project(&(source.cam_from_world * *place))?;
        let inside = |x: f64, n: u32| 0.0 <= x && x <= f64::from(n) - 1.0;
        (inside(pixel.x, source.image.width_px) && inside(pixel.y, source.image.height_px)).then_some(pixel)
    }

    fn worth(&self, source: &Source, place: &Vector3<f64>) -> Option<Worth> {
        self.project(source, place)?;
        let x = source.cam_from_world * *place;
        let (_, by_point) = source.camera.project_with_jacobian(&x)?;
        let by_ground: Matrix2<f64> = by_point * source.cam_from_world.rotation * self.axes;
        let inverse = by_ground.try_inverse()?;
        let full =
            source.adjusted.image_point_on_plane_covariance_m2(source.photo, 0, place, source.sigma_px)?;
        let largest = |m: Matrix2<f64>| m.symmetric_eigenvalues().max().max(0.0).sqrt();
        Some(Worth {
            pixel_m: largest(inverse * inverse.transpose()),
            error_m: SIGMAS_95 * largest(self.axes.transpose() * full * self.axes),
        })
    }
}

fn rectified(ground: &Ground, source: &Source, width: u32, height: u32) -> GrayImage {
    let mut image = GrayImage::filled(width, height, UNSEEN);
    for y in 0..height {
        for x in 0..width {
            if let Some(p) = ground.project(source, &ground.at(f64::from(x), f64::from(y))) {
                image.data[(y * width + x) as usize] = bilinear(source.image, &p);
            }
        }
    }
    image
}

fn bilinear(image: &GrayImage, p: &Pixel) -> u8 {
    let (u, v) = (p.x.floor(), p.y.floor());
    let (a, b) = (p.x - u, p.y - v);
    let at = |du: u32, dv: u32| {
        f64::from(image.at((u as u32 + du).min(image.width_px - 1), (v as u32 + dv).min(image.height_px - 1)))
    };
    let top = at(0, 0) * (1.0 - a) + at(1, 0) * a;
    let bottom = at(0, 1) * (1.0 - a) + at(1, 1) * a;
    (top * (1.0 - b) + bottom * b).round() as u8
}

/// The accuracy of the ground on a coarse grid.
struct Field {
    columns: usize,
    rows: usize,
    worth: Vec<Option<Worth>>,
}

impl Field {
    fn new(ground: &Ground, source: &Source, width: u32, height: u32) -> Self {
        let (columns, rows) = (width as usize / CELL_PX + 1, height as usize / CELL_PX + 1);
        let at = |i: usize| ground.at(((i % columns) * CELL_PX) as f64, ((i / columns) * CELL_PX) as f64);
        let worth = (0..columns * rows).map(|i| ground.worth(source, &at(i))).collect();
        Field { columns, rows, worth }
    }

    fn at(&self, column: usize, row: usize) -> Option<Worth> {
        if self.columns <= column || self.rows <= row {
            None
        } else {
            self.worth[row * self.columns + column]
        }
    }

    /// Returns the line where a quantity crosses a limit, as short segments (marching squares).
    fn contour(&self, of: impl Fn(&Worth) -> f64, limit: f64) -> Vec<Path> {
        let mut lines = Vec::new();
        for row in 0..self.rows.saturating_sub(1) {
            for column in 0..self.columns.saturating_sub(1) {
                let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| (column + i, row + j));
                let values = corners.map(|(c, r)| self.at(c, r).map(|w| of(&w) - limit));
                let mut crossings = Path::new();
                for k in 0..4 {
                    let (Some(a), Some(b)) = (values[k], values[(k + 1) % 4]) else { continue };
                    if (a < 0.0) != (b < 0.0) {
                        let place =
                            |(c, r): (usize, usize)| Vector2::new(c as f64, r as f64) * CELL_PX as f64;
                        crossings.push(place(corners[k]).lerp(&place(corners[(k + 1) % 4]), a / (a - b)));
                    }
                }
                if crossings.len() == 2 {
                    lines.push(crossings);
                }
            }
        }
        lines
    }

    /// Returns diagonal lines over the part beyond a limit; `falling` to the right, or rising.
    fn hatch(&self, of: impl Fn(&Worth) -> f64, limit: f64, falling: bool) -> Vec<Path> {
        let (width, height) = ((self.columns - 1) * CELL_PX, (self.rows - 1) * CELL_PX);
        let beyond = |x: usize, y: usize| {
            self.at((x + CELL_PX / 2) / CELL_PX, (y + CELL_PX / 2) / CELL_PX).is_some_and(|w| limit < of(&w))
        };
        let mut lines = Vec::new();
        for start in (0..width + height).step_by(HATCH_PX) {
            let mut run: Option<(usize, usize)> = None;
            let mut last = (0, 0);
            for y in 0..height {
                let x = if falling { (start + y).checked_sub(height) } else { start.checked_sub(y) };
                let Some(x) = x.filter(|x| *x < width) else { continue };
                if beyond(x, y) {
                    run = run.or(Some((x, y)));
                    last = (x, y);
                } else if let Some(first) = run.take() {
                    lines.push(segment(first, last));
                }
            }
            lines.extend(run.map(|first| segment(first, last)));
        }
        lines
    }
}

fn segment(a: (usize, usize), b: (usize, usize)) -> Path {
    [a, b].iter().map(|(x, y)| Vector2::new(*x as f64, *y as f64)).collect()
}

/// Labels of a drawing, of which none lies over another: one that finds no free spot is left out.
pub struct Labels {
    size: [f64; 2],
    /// Boxes that are written already: corners with the least and the largest coordinates.
    taken: Vec<[[f64; 2]; 2]>,
}

impl Labels {
    /// No labels yet, in a drawing of this width and height.
    pub fn new(size: [f64; 2]) -> Self {
        Labels { size, taken: Vec::new() }
    }

    /// Keeps a box free of labels.
    pub fn keep_free(&mut self, least: [f64; 2], most: [f64; 2]) {
        self.taken.push([least, most]);
    }

    /// Keeps a point free that is drawn with a radius.
    pub fn keep_free_around(&mut self, [x, y]: [f64; 2], radius: f64) {
        let half = 0.8 * radius; // So that its own label has room beside it.
        self.keep_free([x - half, y - half], [x + half, y + half]);
    }

    /// Takes the first spot where a text of this width and height of capitals is inside the drawing and over no other label. Spots are where its
    /// baseline begins.
    pub fn first_free(
        &mut self,
        spots: impl IntoIterator<Item = [f64; 2]>,
        width: f64,
        capital: f64,
    ) -> Option<[f64; 2]> {
        // A little room at both sides: two texts side by side are not one.
        let space = 0.2 * capital;
        let area =
            |[x, y]: [f64; 2]| [[x - space, y - 1.2 * capital], [x + width + space, y + 0.3 * capital]];
        let is_inside =
            |[least, most]: [[f64; 2]; 2]| (0..2).all(|i| 0.0 <= least[i] && most[i] <= self.size[i]);
        let meets =
            |a: &[[f64; 2]; 2], b: &[[f64; 2]; 2]| (0..2).all(|i| a[0][i] < b[1][i] && b[0][i] < a[1][i]);
        let is_free = |spot: &[f64; 2]| {
            let own = area(*spot);
            is_inside(own) && !self.taken.iter().any(|other| meets(&own, other))
        };
        let found = spots.into_iter().find(is_free)?;
        self.taken.push(area(found));
        Some(found)
    }
}

/// Spots beside a point that is drawn with a radius: right, left, above and below.
pub fn spots_beside([x, y]: [f64; 2], radius: f64, width: f64, capital: f64) -> [[f64; 2]; 6] {
    let (right, left) = (x + 1.4 * radius, x - 1.4 * radius - width);
    let (above, below) = (y - 0.8 * radius, y + 0.8 * radius + capital);
    [
        [right, above],
        [left, above],
        [right, below],
        [left, below],
        [x - 0.5 * width, y - 1.4 * radius - 0.4 * capital],
        [x - 0.5 * width, y + 1.4 * radius + 1.2 * capital],
    ]
}

/// Draws hatching and outlines of both limits, each outline with its value.
fn limits(canvas: &mut Canvas, field: &Field, scene: &NamedScene, labels: &mut Labels) {
    let pixel = |w: &Worth| w.pixel_m;
    let error = |w: &Worth| w.error_m;
    let thin = |color| Pen { color, width: 1.0, opacity: 0.5 };
    canvas.stroke(&field.hatch(pixel, scene.pixel_limit_m, false), thin(COARSE));
    canvas.stroke(&field.hatch(error, scene.error_limit_m, true), thin(UNSURE));
    let thick = |color| Pen { color, width: 2.2, opacity: 1.0 };
    for (lines, color, text, part) in [
        (
            field.contour(pixel, scene.pixel_limit_m),
            COARSE,
            format!("1 px = {}", centimetres(scene.pixel_limit_m)),
            3,
        ),
        (
            field.contour(error, scene.error_limit_m),
            UNSURE,
            format!("± {}", centimetres(scene.error_limit_m)),
            2,
        ),
    ] {
        canvas.stroke_with_rim(&lines, thick(color));
        if let Some(at) = lines.get(lines.len() / part).and_then(|line| line.first()) {
            let (w, h) = (f64::from(canvas.width), f64::from(canvas.open_rows));
            let beside = 0.5 * font::width(&text, TEXT_PX) + 0.25 * TEXT_PX;
            let at = Vector2::new(
                at.x.clamp(beside, (w - beside).max(beside)),
                at.y.clamp(2.0 * TEXT_PX, (h - 8.0).max(2.0 * TEXT_PX)),
            );
            let width = font::width(&text, TEXT_PX);
            let corner = [at.x - 0.5 * width, at.y - 8.0];
            if let Some([x, y]) = labels.first_free([corner], width, TEXT_PX) {
                write(canvas, &text, Vector2::new(x, y), color, Anchor::Start);
            }
        }
    }
}

fn centimetres(x_m: f64) -> String {
    if x_m < 1.0 { format!("{} cm", (x_m * 1000.0).round() / 10.0) } else { format!("{x_m} m") }
}

fn write(canvas: &mut Canvas, text: &str, at: Vector2<f64>, color: Color, anchor: Anchor) {
    let pen = Pen { color, width: 0.14 * TEXT_PX, opacity: 1.0 };
    canvas.stroke_with_rim(&strokes(text, at, TEXT_PX, anchor, 0.0), pen);
}

impl Ground {
    /// Returns the step of the grid, m.
    fn grid_m(&self) -> f64 {
        round_down_125(130.0 / self.px_per_m)
    }
}

/// Draws grid lines with a round step, labelled in the scene's coordinates along the plane, as many of them as have room for their labels.
fn grid(
    canvas: &mut Canvas,
    ground: &Ground,
    scene: &NamedScene,
    labels: &mut Labels,
    [width, height]: [u32; 2],
) {
    let step = ground.grid_m();
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let shift = ground.axes.tr_mul(&(ground.origin + scene.origin_m));
    let pen = Pen { color: GRID, width: 1.0, opacity: 0.55 };
    let (w, h) = (f64::from(width), f64::from(height));
    for axis in [0, 1] {
        let low = ground.least[axis] + shift[axis];
        let lines = (low / step).ceil() as i64..=((low + ground.size_m[axis]) / step).floor() as i64;
        let label = |i: i64| format!("{:.decimals$}", i as f64 * step);
        let widest = lines.clone().map(|i| font::width(&label(i), TEXT_PX)).fold(0.0, f64::max);
        let needed = [widest + TEXT_PX, 2.0 * TEXT_PX][axis];
        let every = (needed / (step * ground.px_per_m)).ceil().max(1.0) as i64;
        for i in lines {
            let mut flat = Vector2::zeros();
            flat[axis] = i as f64 * step - shift[axis];
            let at = ground.px(&flat);
            let (ends, corner) = match axis {
                0 => ([Vector2::new(at.x, 0.0), Vector2::new(at.x, h)], Vector2::new(at.x + 4.0, h - 8.0)),
                _ => ([Vector2::new(0.0, at.y), Vector2::new(w, at.y)], Vector2::new(5.0, at.y - 6.0)),
            };
            canvas.stroke(&[ends.to_vec()], pen);
            let width = font::width(&label(i), TEXT_PX);
            if i % every == 0 && labels.first_free([[corner.x, corner.y]], width, TEXT_PX).is_some() {
                write(canvas, &label(i), corner, GRID, Anchor::Start);
            }
        }
    }
}

fn points(canvas: &mut Canvas, ground: &Ground, scene: &NamedScene, answers: &Answers, labels: &mut Labels) {
    let on_it = scene.constraints.iter().filter_map(|constraint| match constraint {
        Constraint::OnPlane { plane: 0, point, .. } => Some((*point, answers.adjusted.point(*point)?)),
        _ => None,
    });
    let shown: Vec<ShownPoint> = on_it
        .map(|(point, x)| ShownPoint {
            name: &scene.points[point],
            is_mark: scene.is_control_point[point],
            at: ground.px(&ground.axes.tr_mul(&(x - ground.origin))),
        })
        .collect();
    for ShownPoint { is_mark, at, .. } in &shown {
        let circle: Path = (0..=24)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 24.0).sin_cos();
                at + Vector2::new(cos, sin) * POINT_PX
            })
            .collect();
        let color = if *is_mark { MARK } else { POINT };
        canvas.stroke_with_rim(&[circle], Pen { color, width: 3.0, opacity: 1.0 });
    }
    for (name, is_mark, at) in names(&shown, labels) {
        write(canvas, name, at, if is_mark { MARK } else { POINT }, Anchor::Start);
    }
}

/// A point of the plane as it is drawn.
struct ShownPoint<'a> {
    name: &'a str,
    is_mark: bool,
    at: Vector2<f64>,
}

/// Returns the names that have room, with their places, marks first. The points of a measurement, which are called `NAME · 1`, `NAME · 2` …, have
/// its name once.
fn names<'a>(shown: &[ShownPoint<'a>], labels: &mut Labels) -> Vec<(&'a str, bool, Vector2<f64>)> {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let mut written: Vec<(&str, bool, Vector2<f64>)> = Vec::new();
    for ShownPoint { at, .. } in shown.iter().filter(|point| point.is_mark) {
        labels.keep_free_around([at.x, at.y], POINT_PX);
    }
    for marks in [true, false] {
        for ShownPoint { name, at, .. } in shown.iter().filter(|point| point.is_mark == marks) {
            let whole = name.rsplit_once(" · ").filter(|(_, number)| !marks && is_number(number));
            let name = whole.map_or(*name, |(measurement, _)| measurement);
            if whole.is_some() && written.iter().any(|(other, is_mark, _)| *other == name && !is_mark) {
                continue;
            }
            let width = font::width(name, TEXT_PX);
            let spots = spots_beside([at.x, at.y], POINT_PX, width, TEXT_PX);
            if let Some([x, y]) = labels.first_free(spots, width, TEXT_PX) {
                written.push((name, marks, Vector2::new(x, y)));
            }
        }
    }
    written
}

/// Returns north on the ground as a unit vector (right, ahead): the line of sight rotated back by the heading. `None` for a camera that points
/// vertically down.
fn north(axes: &Matrix3x2<f64>, cam_from_world: &Pose, heading_deg: f64) -> Option<Vector2<f64>> {
    let sight = axes.tr_mul(&cam_from_world.rotation.row(2).transpose());
    let level = sight.try_normalize(LEAST_LEVEL)?;
    let (sin, cos) = heading_deg.to_radians().sin_cos();
    Some(Vector2::new(level.x * cos - level.y * sin, level.x * sin + level.y * cos))
}

fn arrow(canvas: &mut Canvas, north: &Vector2<f64>) {
    let along = Vector2::new(north.x, -north.y);
    let aside = Vector2::new(-along.y, along.x);
    let centre = Vector2::new(f64::from(canvas.width) - ARROW_PX, ARROW_PX);
    let at = |a: f64, b: f64| centre + (along * a + aside * b) * ARROW_PX;
    let pen = Pen { color: PAPER, width: 4.0, opacity: 1.0 };
    canvas.stroke_with_rim(
        &[vec![at(-0.45, 0.0), at(0.45, 0.0)], vec![at(0.2, 0.16), at(0.45, 0.0), at(0.2, -0.16)]],
        pen,
    );
    write(canvas, "N", at(0.7, 0.0) + Vector2::new(0.0, 0.5 * TEXT_PX), PAPER, Anchor::Middle);
}

/// Returns the lines below the image.
fn caption(scene: &NamedScene, photo: usize, step: f64, width: u32, heading: Option<Heading>) -> Vec<String> {
    let name = &scene.photos[photo].name;
    let north = match heading {
        Some(Heading { is_magnetic: true, .. }) => "; N: magnetic north by the camera's compass",
        Some(_) => "; N: north by the camera's compass",
        None => "",
    };
    let first =
        format!("ground of photo {name} from above; grid {step} m; grey: not in the photograph{north}");
    let second = format!(
        "hatched / : one pixel covers more than {}; hatched \\ : 95 % error of an image point (σ {} px) above {}",
        centimetres(scene.pixel_limit_m),
        scene.sigma_px,
        centimetres(scene.error_limit_m)
    );
    [first, second].iter().flat_map(|text| wrapped(text, f64::from(width) - 20.0)).collect()
}

/// Breaks a text between words into lines of a width, px.
fn wrapped(text: &str, width_px: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if font::width(&format!("{line} {word}"), TEXT_PX) <= width_px => {
                *line += " ";
                *line += word;
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    /// A camera that looks along a direction of the world, its x axis level.
    fn looking(sight: Vector3<f64>) -> Pose {
        let z = sight.normalize();
        let x = z.cross(&Vector3::z()).try_normalize(1e-9).unwrap_or(Vector3::x());
        let rotation = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
        Pose::new(rotation, Vector3::new(0.3, -0.2, 4.0))
    }

    #[test]
    fn captions_keep_all_words_and_their_width() {
        let text = "hatched / : one pixel covers more than 5 cm; grey: not in the photograph";
        let lines = wrapped(text, 400.0);
        assert!(1 < lines.len() && lines.iter().all(|line| font::width(line, TEXT_PX) <= 400.0), "{lines:?}");
        assert_eq!(lines.join(" "), text);
        // A word that is too long stands alone.
        assert_eq!(wrapped("a incomprehensible b", 60.0).len(), 3);
    }

    /// Thirty lengths side by side: each name once, no name over another, and the marks have theirs.
    #[test]
    fn names_do_not_lie_over_each_other() {
        let all: Vec<String> =
            (0..30).flat_map(|i| [1, 2].map(|end| format!("length {i} · {end}"))).collect();
        let at = |i: usize| Vector2::new(300.0 + 60.0 * (i % 12) as f64, 300.0 + 35.0 * (i / 12) as f64);
        let mut shown: Vec<ShownPoint> =
            all.iter().enumerate().map(|(i, name)| ShownPoint { name, is_mark: false, at: at(i) }).collect();
        let corners = [("A", 320.0, 310.0), ("B · 7", 1290.0, 20.0)];
        shown.extend(corners.map(|(name, x, y)| ShownPoint { name, is_mark: true, at: Vector2::new(x, y) }));
        let size = [1300.0, 900.0];
        let written = names(&shown, &mut Labels::new(size));
        assert!(written[0].0 == "A" && written[1].0 == "B · 7" && 6 < written.len(), "{}", written.len());
        let area = |(name, _, at): &(&str, bool, Vector2<f64>)| {
            [at.x, at.y - TEXT_PX, at.x + font::width(name, TEXT_PX), at.y + TEXT_PX / 3.0]
        };
        for (i, one) in written.iter().enumerate() {
            let a = area(one);
            assert!(0.0 <= a[0] && 0.0 <= a[1] && a[2] <= size[0] && a[3] <= size[1], "{}", one.0);
            for other in &written[i + 1..] {
                let b = area(other);
                let meets = a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
                assert!(one.0 != other.0 && !meets, "{} {}", one.0, other.0);
            }
        }
    }

    #[test]
    fn north_is_where_the_compass_says() {
        let axes = Matrix3x2::from_columns(&[Vector3::x(), Vector3::y()]);
        let [east, ahead, down] = [Vector3::x(), Vector3::y(), -Vector3::z()];
        // A camera that faces north has north ahead; facing east along x, north is along y; facing south along x, north is behind.
        for (sight, heading_deg, expected) in [
            (ahead, 0.0, [0.0, 1.0]),
            (ahead + 2.0 * down, 0.0, [0.0, 1.0]),
            (east, 90.0, [0.0, 1.0]),
            (east + down, 180.0, [-1.0, 0.0]),
            (ahead, 270.0, [1.0, 0.0]),
        ] {
            let found = north(&axes, &looking(sight), heading_deg).expect("it looks somewhere");
            assert!((found - Vector2::from(expected)).norm() < 1e-12, "{sight} {heading_deg}: {found}");
        }
        assert_eq!(north(&axes, &looking(down), 10.0), None);
    }
}
