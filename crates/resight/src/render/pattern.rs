//! The appearance of each kind of target: planes with a pattern, and balls for surveyed points.

use super::family::{self, Cells};
use super::{Placed, RenderError, Style};
use nalgebra::Matrix3;
use resight_core::target::{
    AprilGrid, Charuco, Chessboard, CircleGrid, Feature, LinePlusOne, NamedPoint, PrintedScale, Target,
};
use resight_core::{Point, Pose};

/// An object that a ray can hit.
#[allow(clippy::large_enum_variant)] // A scene has a handful; indirection would cost every sample.
pub(super) enum Patch {
    /// A flat pattern.
    Plane(Plane),
    /// A ball of one grey level: a surveyed point, drawn so that it is visible from everywhere.
    Ball { centre_in_cam: Point, radius_m: f64, grey: f64 },
}

/// A rectangle of the z = 0 plane of a frame, with a pattern.
pub(super) struct Plane {
    cam_from_plane: Pose,
    /// Maps a ray d to (x, y, 1)/λ, where λ d lies in the plane: inverse of [r₁ r₂ t].
    plane_from_ray: Matrix3<f64>,
    /// Whether the printed side faces the camera.
    front: bool,
    low: [f64; 2],
    high: [f64; 2],
    pattern: Pattern,
    ink: f64,
    paper: Option<f64>,
}

pub(super) enum Pattern {
    Dots {
        centres: Vec<[f64; 2]>,
        radius_m: f64,
    },
    /// Top-left corner of the cells at `origin_m`.
    Tag {
        cells: Cells,
        cell_m: f64,
        origin_m: [f64; 2],
    },
    Grid {
        tags: Vec<Cells>,
        columns: usize,
        size_m: f64,
        gap_m: f64,
    },
    Chess {
        square_m: f64,
    },
    Charuco {
        markers: Vec<Option<Cells>>,
        columns: usize,
        square_m: f64,
        marker_m: f64,
        odd: usize,
    },
}

impl Patch {
    /// Returns the patch of a print that is slightly longer along the target's axes: the point x of the target's frame is at S x.
    fn printed_at(self, cam_from_target: &Pose, scale: &PrintedScale) -> Patch {
        let Patch::Plane(plane) = self else { return self };
        let target_from_cam = cam_from_target.inverse();
        let place = |x: &Point| *cam_from_target * scale.apply(&(target_from_cam * *x));
        let origin = plane.cam_from_plane.translation;
        let axis = |i: usize| {
            let end = origin + plane.cam_from_plane.rotation.column(i);
            place(&end) - place(&origin)
        };
        let ray_from_plane = Matrix3::from_columns(&[axis(0), axis(1), place(&origin)]);
        let plane_from_ray = ray_from_plane.try_inverse().unwrap_or(plane.plane_from_ray);
        Patch::Plane(Plane { plane_from_ray, ..plane })
    }

    /// Returns (inverse depth along the ray, grey level); `None` when the ray misses the patch.
    pub fn hit(&self, ray: &Point) -> Option<(f64, f64)> {
        match self {
            Patch::Plane(plane) => plane.hit(ray),
            Patch::Ball { centre_in_cam, radius_m, grey } => {
                let along = ray.dot(centre_in_cam) / ray.norm_squared();
                let off = (ray * along - centre_in_cam).norm_squared();
                (0.0 < along && off < radius_m * radius_m).then(|| (1.0 / along, *grey))
            }
        }
    }

    /// Returns the centres (camera frame, metres) and radii of all dots.
    pub fn dots_in_cam(&self) -> Vec<(Point, f64)> {
        match self {
            Patch::Ball { centre_in_cam, radius_m, .. } => vec![(*centre_in_cam, *radius_m)],
            Patch::Plane(plane) => match &plane.pattern {
                Pattern::Dots { centres, radius_m } => {
                    let place =
                        |c: &[f64; 2]| (plane.cam_from_plane * Point::new(c[0], c[1], 0.0), *radius_m);
                    centres.iter().map(place).collect()
                }
                _ => Vec::new(),
            },
        }
    }
}

impl Plane {
    fn hit(&self, ray: &Point) -> Option<(f64, f64)> {
        let h = self.plane_from_ray * ray;
        if !(0.0 < h.z) {
            return None;
        }
        let (x, y) = (h.x / h.z, h.y / h.z);
        if x < self.low[0] || self.high[0] < x || y < self.low[1] || self.high[1] < y {
            return None;
        }
        let inked = self.front && self.pattern.is_ink(x, y);
        let grey = if inked { Some(self.ink) } else { self.paper };
        grey.map(|g| (h.z, g))
    }
}

impl Pattern {
    pub(super) fn is_ink(&self, x: f64, y: f64) -> bool {
        match self {
            Pattern::Dots { centres, radius_m } => {
                let inside = |c: &[f64; 2]| (x - c[0]).powi(2) + (y - c[1]).powi(2) < radius_m * radius_m;
                centres.iter().any(inside)
            }
            Pattern::Tag { cells, cell_m, origin_m } => {
                ink_in_cells(cells, (x - origin_m[0]) / cell_m, (y - origin_m[1]) / cell_m)
            }
            Pattern::Grid { tags, columns, size_m, gap_m } => grid_ink(tags, *columns, *size_m, *gap_m, x, y),
            Pattern::Chess { square_m } => {
                let parity = (x / square_m).floor() as i64 + (y / square_m).floor() as i64;
                parity.rem_euclid(2) == 0
            }
            Pattern::Charuco { markers, columns, square_m, marker_m, odd } => {
                let (column, row) = ((x / square_m).floor() as usize, (y / square_m).floor() as usize);
                match markers.get(row * columns + column) {
                    Some(Some(cells)) if (row + column) % 2 != *odd => {
                        let centre = |i: usize| (i as f64 + 0.5) * square_m;
                        let cell_m = marker_m / cells.per_size as f64;
                        let half = 0.5 * cells.per_side as f64;
                        let (cx, cy) =
                            ((x - centre(column)) / cell_m + half, (y - centre(row)) / cell_m + half);
                        ink_in_cells(cells, cx, cy)
                    }
                    Some(_) => (row + column) % 2 == *odd,
                    None => false,
                }
            }
        }
    }
}

/// Evaluates the cells at coordinates in cells from the top-left corner.
fn ink_in_cells(cells: &Cells, x: f64, y: f64) -> bool {
    let inside = |t: f64| 0.0 <= t && t < cells.per_side as f64;
    inside(x) && inside(y) && !cells.is_white(y as usize, x as usize)
}

/// Evaluates Kalibr's grid in its own frame (y up): tags, and a black square of the gap's size at each crossing of gaps.
fn grid_ink(tags: &[Cells], columns: usize, size_m: f64, gap_m: f64, x: f64, y: f64) -> bool {
    let pitch = size_m + gap_m;
    let (column, row) = ((x / pitch).floor(), (y / pitch).floor());
    let (dx, dy) = (x - column * pitch, y - row * pitch);
    if size_m < dx || size_m < dy {
        return size_m < dx && size_m < dy;
    }
    if column < 0.0 || row < 0.0 || columns as f64 <= column {
        return false;
    }
    let Some(cells) = tags.get(row as usize * columns + column as usize) else { return false };
    let cell_m = size_m / cells.per_size as f64;
    let rim = 0.5 * (cells.per_side - cells.per_size) as f64;
    ink_in_cells(cells, dx / cell_m + rim, (size_m - dy) / cell_m + rim)
}

/// Returns the planes and balls of a placed target.
pub(super) fn patches(placed: &Placed) -> Result<Vec<Patch>, RenderError> {
    placed.target.check()?;
    let style = &placed.style;
    let plane = |cam_from_plane: Pose, low, high, pattern, facing: f64| {
        plane_patch(cam_from_plane, low, high, pattern, facing, style)
    };
    let at = placed.cam_from_target;
    let one = |patch: Option<Patch>| patch.into_iter().collect();
    if let Some(scale) = placed.target.printed_scale() {
        let design = Placed { target: placed.target.design().clone(), ..placed.clone() };
        return Ok(patches(&design)?.into_iter().map(|patch| patch.printed_at(&at, scale)).collect());
    }
    Ok(match &placed.target {
        Target::LinePlusOne(t) => {
            let (low, high, pattern) = line_plus_one(t, style);
            one(plane(at, low, high, pattern, 1.0))
        }
        Target::Tag(t) => {
            let (low, high, pattern) = tag(&t.family, t.id, t.size_m, style)?;
            one(plane(at, low, high, pattern, 1.0))
        }
        Target::TagMap(t) => {
            let mut all = Vec::new();
            for tag_at in &t.tags {
                let (low, high, pattern) = tag(&t.family, tag_at.id, tag_at.size_m, style)?;
                all.extend(plane(at * tag_at.world_from_tag, low, high, pattern, 1.0));
            }
            all
        }
        Target::AprilGrid(t) => {
            let (low, high, pattern) = april_grid(t, style)?;
            one(plane(at, low, high, pattern, -1.0))
        }
        Target::Chessboard(t) => board_on_sheet(at, chessboard(t), style),
        Target::Charuco(t) => board_on_sheet(at, charuco(t)?, style),
        Target::CircleGrid(t) => {
            let (low, high, pattern) = circle_grid(t, style);
            one(plane(at, low, high, pattern, 1.0))
        }
        Target::Points(points) => balls(points, &at, style),
        other => return Err(RenderError::Unsupported { kind: other.kind() }),
    })
}

/// `facing` is 1 when the plane's z points into the surface, -1 when towards the viewer.
fn plane_patch(
    cam_from_plane: Pose,
    low: [f64; 2],
    high: [f64; 2],
    pattern: Pattern,
    facing: f64,
    style: &Style,
) -> Option<Patch> {
    let (r, t) = (&cam_from_plane.rotation, &cam_from_plane.translation);
    let ray_from_plane = Matrix3::from_columns(&[r.column(0).into(), r.column(1).into(), *t]);
    let plane_from_ray = ray_from_plane.try_inverse()?;
    let front = 0.0 < facing * ray_from_plane.determinant();
    let side = (high[0] - low[0]).max(high[1] - low[1]);
    let margin = style.margin_m.unwrap_or(0.1 * side);
    let grow = |x: [f64; 2], by: f64| [x[0] + by, x[1] + by];
    let paper = match pattern {
        Pattern::Dots { .. } => style.paper,
        _ => Some(style.paper.unwrap_or(255.0 - style.ink)),
    };
    let (low, high) = (grow(low, -margin), grow(high, margin));
    Some(Patch::Plane(Plane {
        cam_from_plane,
        plane_from_ray,
        front,
        low,
        high,
        pattern,
        ink: style.ink,
        paper,
    }))
}

/// Adds a blank sheet just behind a checkered pattern, which must not continue into the rim.
fn board_on_sheet(at: Pose, (low, high, pattern): Extent, style: &Style) -> Vec<Patch> {
    let exact = Style { margin_m: Some(0.0), ..*style };
    let blank = Pattern::Dots { centres: Vec::new(), radius_m: 0.0 };
    let paper = Style { paper: Some(style.paper.unwrap_or(255.0 - style.ink)), ..*style };
    // The sheet is behind by a millionth of the distance: far less than a pixel, but enough to order the two.
    let behind = Pose::new(at.rotation, at.translation * (1.0 + 1e-6));
    let sheet = plane_patch(behind, low, high, blank, 1.0, &paper);
    plane_patch(at, low, high, pattern, 1.0, &exact).into_iter().chain(sheet).collect()
}

pub(super) type Extent = ([f64; 2], [f64; 2], Pattern);

pub(super) fn line_plus_one(t: &LinePlusOne, style: &Style) -> Extent {
    let centres: Vec<[f64; 2]> = t.line_m.iter().map(|x| [*x, 0.0]).chain([t.off_m]).collect();
    let radius_m = 0.5 * style.dot_diameter_m.unwrap_or_else(|| smallest_distance(&centres) / 3.0);
    dots(centres, radius_m)
}

pub(super) fn circle_grid(t: &CircleGrid, style: &Style) -> Extent {
    let target = Target::CircleGrid(*t);
    let place = |feature: Feature| target.point(feature).map(|p| [p.position.x, p.position.y]);
    let centres = target.features().into_iter().filter_map(place).collect();
    dots(centres, 0.5 * style.dot_diameter_m.unwrap_or(t.printed_diameter_m()))
}

fn dots(centres: Vec<[f64; 2]>, radius_m: f64) -> Extent {
    let fold = |pick: fn(f64, f64) -> f64, start: f64| {
        [0, 1].map(|axis| centres.iter().map(|c| c[axis]).fold(start, pick))
    };
    let low = fold(f64::min, f64::INFINITY).map(|x| x - radius_m);
    let high = fold(f64::max, f64::NEG_INFINITY).map(|x| x + radius_m);
    (low, high, Pattern::Dots { centres, radius_m })
}

fn smallest_distance(centres: &[[f64; 2]]) -> f64 {
    let mut least = f64::INFINITY;
    for (i, a) in centres.iter().enumerate() {
        for b in &centres[i + 1..] {
            least = least.min((a[0] - b[0]).hypot(a[1] - b[1]));
        }
    }
    least
}

fn bordered(cells: Cells, bits: u32) -> Cells {
    if bits != 1 && cells.has_black_frame() { cells.with_border(bits) } else { cells }
}

pub(super) fn tag(family: &str, id: u32, size_m: f64, style: &Style) -> Result<Extent, RenderError> {
    let cells = bordered(family::cells(family, id)?, style.tag_border_bits.unwrap_or(1));
    let cell_m = size_m / cells.per_size as f64;
    let half = 0.5 * cells.per_side as f64 * cell_m;
    Ok(([-half; 2], [half; 2], Pattern::Tag { cells, cell_m, origin_m: [-half; 2] }))
}

pub(super) fn april_grid(t: &AprilGrid, style: &Style) -> Result<Extent, RenderError> {
    let bits = style.tag_border_bits.unwrap_or(2);
    let ids = t.first_id..t.first_id + t.rows * t.columns;
    let tags: Result<Vec<_>, _> =
        ids.map(|id| family::cells(&t.family, id).map(|c| bordered(c, bits))).collect();
    let gap_m = t.tag_size_m * t.tag_spacing_ratio;
    let extent = |n: u32| n as f64 * (t.tag_size_m + gap_m);
    let pattern = Pattern::Grid { tags: tags?, columns: t.columns as usize, size_m: t.tag_size_m, gap_m };
    Ok(([-gap_m; 2], [extent(t.columns), extent(t.rows)], pattern))
}

/// The top-left outer square is black.
pub(super) fn chessboard(t: &Chessboard) -> Extent {
    let extent = |n: u32| n as f64 * t.square_m;
    ([-t.square_m; 2], [extent(t.columns), extent(t.rows)], Pattern::Chess { square_m: t.square_m })
}

/// As in OpenCV, the top-left square is black; in the legacy pattern with an even number of rows it is white.
pub(super) fn charuco(t: &Charuco) -> Result<Extent, RenderError> {
    let odd = usize::from(t.legacy_pattern && t.rows.is_multiple_of(2));
    let mut id = 0;
    let mut markers = Vec::new();
    for index in 0..t.rows as u64 * t.columns as u64 {
        let (row, column) = ((index / t.columns as u64) as usize, (index % t.columns as u64) as usize);
        let white = (row + column) % 2 != odd;
        markers.push(if white { Some(family::cells(&t.dictionary, id)?) } else { None });
        id += u32::from(white);
    }
    let pattern = Pattern::Charuco {
        markers,
        columns: t.columns as usize,
        square_m: t.square_m,
        marker_m: t.marker_m,
        odd,
    };
    Ok(([0.0; 2], [t.columns as f64 * t.square_m, t.rows as f64 * t.square_m], pattern))
}

fn balls(points: &[NamedPoint], cam_from_target: &Pose, style: &Style) -> Vec<Patch> {
    let mut least = f64::INFINITY;
    for (i, a) in points.iter().enumerate() {
        for b in &points[i + 1..] {
            least = least.min((a.position - b.position).norm());
        }
    }
    let spaced = if least.is_finite() { least / 3.0 } else { 0.01 };
    let radius_m = 0.5 * style.dot_diameter_m.unwrap_or(spaced);
    let ball = |p: &NamedPoint| Patch::Ball {
        centre_in_cam: *cam_from_target * p.position,
        radius_m,
        grey: style.ink,
    };
    points.iter().map(ball).collect()
}
