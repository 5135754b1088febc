//! What is looked at: known points, each with a feature name, in the target's own frame.
//!
//! Every flat target lies in its z = 0 plane. Seen upright from the front its x runs to the right, y down and
//! z into the surface, so an upright frontal view is nearly the identity rotation. The one exception is the AprilGrid,
//! which keeps Kalibr's own frame (origin at the bottom-left tag, x right, y up, z towards the viewer).
//! Images: CONVENTIONS.md.

mod circle_grid;
mod printed;
mod symmetry;

pub use circle_grid::CircleGrid;
pub use printed::{MOST_PRINTED_ERROR, Printed, PrintedScale};

use crate::covariance::is_covariance;
use crate::{Error, Matrix6, Point, Pose};
use nalgebra::DMatrix;

/// Name of one known point of a target: `id` counts tags or points, `corner` the corners of a tag (else 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Feature {
    /// Tag id, ChArUco corner id, chessboard corner or circle (row · columns + column) or index of a named point.
    pub id: u32,
    /// Tag corner 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left of the upright tag; 0 for everything else.
    pub corner: u8,
}

/// A known point: its place in the target frame and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownPoint {
    /// Metres, target frame.
    pub position: Point,
    /// Standard deviation of each coordinate, metres; 0 when exact.
    pub sigma_m: f64,
}

/// Three points on a line and one off it: ids 0, 1, 2 on the line, 3 off it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinePlusOne {
    /// Abscissae of the collinear points, metres; point i is `(line_m[i], 0, 0)`.
    pub line_m: [f64; 3],
    /// The fourth point along and across the line, metres: `(off_m[0], off_m[1], 0)`.
    pub off_m: [f64; 2],
}

/// One square fiducial; origin at its centre.
#[derive(Debug, Clone, PartialEq)]
pub struct Tag {
    /// Family name, e.g. `tag36h11` or `DICT_4X4_50`.
    pub family: String,
    /// The id looked for.
    pub id: u32,
    /// Outer edge of the black square, metres.
    pub size_m: f64,
}

/// Kalibr's grid of tags with corner squares.
#[derive(Debug, Clone, PartialEq)]
pub struct AprilGrid {
    /// Tag family; Kalibr's is `tag36h11`.
    pub family: String,
    /// Tags along y.
    pub rows: u32,
    /// Tags along x.
    pub columns: u32,
    /// Outer edge of each black square, metres.
    pub tag_size_m: f64,
    /// Gap between tags over tag size.
    pub tag_spacing_ratio: f64,
    /// Id of the bottom-left tag; ids run along x, then y.
    pub first_id: u32,
}

/// Inner corners of a chessboard; origin at corner 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chessboard {
    /// Inner corners along y.
    pub rows: u32,
    /// Inner corners along x.
    pub columns: u32,
    /// Edge of a square, metres.
    pub square_m: f64,
}

/// Chessboard with markers in its white squares; origin at the board's top-left outer corner, as OpenCV.
#[derive(Debug, Clone, PartialEq)]
pub struct Charuco {
    /// Squares along y.
    pub rows: u32,
    /// Squares along x.
    pub columns: u32,
    /// Edge of a square, metres.
    pub square_m: f64,
    /// Edge of a marker, metres.
    pub marker_m: f64,
    /// OpenCV dictionary name, e.g. `DICT_4X4_50`.
    pub dictionary: String,
    /// The pattern of OpenCV before 4.6 (differs for an even number of rows).
    pub legacy_pattern: bool,
}

/// One tag of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapTag {
    /// Tag id.
    pub id: u32,
    /// Outer edge of the black square, metres.
    pub size_m: f64,
    /// Where it is: tag frame to map frame.
    pub world_from_tag: Pose,
    /// Standard deviation of its position along each axis, metres; 0 when exact. All its corners share the error.
    pub sigma_m: f64,
    /// Standard deviation of its rotation about each axis, radians; 0 when exact.
    pub sigma_rad: f64,
}

/// Several tags of one family at known places; the target frame is the map's world.
#[derive(Debug, Clone, PartialEq)]
pub struct TagMap {
    /// Tag family.
    pub family: String,
    /// The tags.
    pub tags: Vec<MapTag>,
    /// Covariance of the small left motions `[rotation_rad; translation_m]` of all tags together, map frame, 6 rows for each in the order of
    /// `tags`; none where their errors are independent. With it, `sigma_m` and `sigma_rad` are only its summary.
    pub joint_covariance: Option<DMatrix<f64>>,
}

/// One surveyed landmark.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPoint {
    /// Its name.
    pub name: String,
    /// Where, metres.
    pub position: Point,
    /// Standard deviation of each coordinate, metres.
    pub sigma_m: f64,
}

/// A target of any kind.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Target {
    /// Three points on a line, one off it.
    LinePlusOne(LinePlusOne),
    /// One tag.
    Tag(Tag),
    /// Kalibr's grid.
    AprilGrid(AprilGrid),
    /// Chessboard.
    Chessboard(Chessboard),
    /// Chessboard with markers.
    Charuco(Charuco),
    /// Circles in rows.
    CircleGrid(CircleGrid),
    /// Tags at known places.
    TagMap(TagMap),
    /// Surveyed landmarks.
    Points(Vec<NamedPoint>),
    /// Any of the others that is flat, with the measured scale of its print.
    Printed(Printed),
}

impl Target {
    /// The name `kind` has in target.toml.
    pub fn kind(&self) -> &'static str {
        match self {
            Target::LinePlusOne(_) => "line_plus_one",
            Target::Tag(_) => "tag",
            Target::AprilGrid(_) => "aprilgrid",
            Target::Chessboard(_) => "chessboard",
            Target::Charuco(_) => "charuco",
            Target::CircleGrid(_) => "circle_grid",
            Target::TagMap(_) => "tag_map",
            Target::Points(_) => "points",
            Target::Printed(t) => t.design.kind(),
        }
    }

    /// The target as designed: of a print with a measured scale what it was printed from, else itself. Families, ids and numbers of rows
    /// are those of the design; lengths are not.
    pub fn design(&self) -> &Target {
        match self {
            Target::Printed(t) => &t.design,
            itself => itself,
        }
    }

    /// The same, to be changed.
    pub fn design_mut(&mut self) -> &mut Target {
        match self {
            Target::Printed(t) => &mut t.design,
            itself => itself,
        }
    }

    /// The measured scale of the print, where there is one.
    pub fn printed_scale(&self) -> Option<&PrintedScale> {
        match self {
            Target::Printed(t) => Some(&t.scale),
            _ => None,
        }
    }

    /// The same design printed at a scale, which replaces an earlier one.
    pub fn printed_at(&self, scale: PrintedScale) -> Target {
        Target::Printed(Printed { design: Box::new(self.design().clone()), scale })
    }

    /// The same with its printed scale taken as exact: for what is common to all views and must not be counted as noise of each.
    pub fn with_exact_scale(&self) -> Target {
        match self {
            Target::Printed(t) => self.printed_at(PrintedScale { sigma: [0.0; 2], ..t.scale }),
            other => other.clone(),
        }
    }

    /// Where a feature is; none when the target has no such feature.
    pub fn point(&self, feature: Feature) -> Option<KnownPoint> {
        let exact = |position| Some(KnownPoint { position, sigma_m: 0.0 });
        if 3 < feature.corner || (feature.corner != 0 && !self.has_tag_corners()) {
            return None;
        }
        match self {
            Target::LinePlusOne(t) => exact(t.point(feature.id)?),
            Target::Tag(t) => {
                (feature.id == t.id).then(|| tag_corner(t.size_m, feature.corner)).and_then(exact)
            }
            Target::AprilGrid(t) => exact(t.point(feature)?),
            Target::Chessboard(t) => (feature.id < t.rows * t.columns)
                .then(|| grid_point(feature.id, t.columns, t.square_m, 0.0))
                .and_then(exact),
            Target::Charuco(t) => (feature.id < (t.rows - 1) * (t.columns - 1))
                .then(|| grid_point(feature.id, t.columns - 1, t.square_m, t.square_m))
                .and_then(exact),
            Target::CircleGrid(t) => exact(t.point(feature.id)?),
            Target::TagMap(t) => {
                let tag = t.tags.iter().find(|tag| tag.id == feature.id)?;
                exact(tag.world_from_tag * tag_corner(tag.size_m, feature.corner))
            }
            Target::Points(points) => points
                .get(feature.id as usize)
                .map(|p| KnownPoint { position: p.position, sigma_m: p.sigma_m }),
            Target::Printed(t) => {
                let designed = t.design.point(feature)?;
                Some(KnownPoint { position: t.scale.apply(&designed.position), ..designed })
            }
        }
    }

    /// Every feature the target has, in ascending order of ids, then corners.
    pub fn features(&self) -> Vec<Feature> {
        let simple = |n: u32| (0..n).map(|id| Feature { id, corner: 0 }).collect::<Vec<_>>();
        let tags = |ids: Vec<u32>| {
            ids.into_iter().flat_map(|id| (0..4).map(move |corner| Feature { id, corner })).collect()
        };
        match self {
            Target::LinePlusOne(_) => simple(4),
            Target::Tag(t) => tags(vec![t.id]),
            Target::AprilGrid(t) => tags((t.first_id..t.first_id + t.rows * t.columns).collect()),
            Target::Chessboard(t) => simple(t.rows * t.columns),
            Target::Charuco(t) => simple((t.rows - 1) * (t.columns - 1)),
            Target::CircleGrid(t) => simple(t.rows * t.columns),
            Target::TagMap(t) => {
                let mut ids: Vec<u32> = t.tags.iter().map(|tag| tag.id).collect();
                ids.sort_unstable();
                tags(ids)
            }
            Target::Points(points) => simple(points.len() as u32),
            Target::Printed(t) => t.design.features(),
        }
    }

    /// Whether its features are tag corners (`corner` 0..4).
    pub fn has_tag_corners(&self) -> bool {
        matches!(self.design(), Target::Tag(_) | Target::AprilGrid(_) | Target::TagMap(_))
    }

    /// Refuses dimensions that cannot be right, naming the key.
    pub fn check(&self) -> Result<(), Error> {
        let positive = |parameter: &'static str, seen: f64| match 0.0 < seen && seen.is_finite() {
            true => Ok(()),
            false => Err(Error::InvalidTarget { parameter, seen, needed: "it must be positive" }),
        };
        let at_least = |parameter: &'static str, seen: u32, least: u32, needed: &'static str| {
            if seen < least {
                Err(Error::InvalidTarget { parameter, seen: seen as f64, needed })
            } else {
                Ok(())
            }
        };
        match self {
            Target::LinePlusOne(t) => t.check(),
            Target::Tag(t) => positive("size_m", t.size_m),
            Target::AprilGrid(t) => {
                at_least("rows", t.rows, 1, "it must be at least 1")?;
                at_least("columns", t.columns, 1, "it must be at least 1")?;
                positive("tag_size_m", t.tag_size_m)?;
                positive("tag_spacing_ratio", t.tag_spacing_ratio)
            }
            Target::Chessboard(t) => {
                at_least("rows", t.rows, 2, "a board has at least 2 inner corners each way")?;
                at_least("columns", t.columns, 2, "a board has at least 2 inner corners each way")?;
                positive("square_m", t.square_m)
            }
            Target::Charuco(t) => {
                at_least("rows", t.rows, 2, "a board has at least 2 squares each way")?;
                at_least("columns", t.columns, 2, "a board has at least 2 squares each way")?;
                positive("square_m", t.square_m)?;
                positive("marker_m", t.marker_m)?;
                if t.square_m <= t.marker_m {
                    let needed = "a marker is smaller than its square (marker_m < square_m)";
                    return Err(Error::InvalidTarget { parameter: "marker_m", seen: t.marker_m, needed });
                }
                Ok(())
            }
            Target::CircleGrid(t) => t.check(),
            Target::TagMap(t) => {
                t.tags.iter().try_for_each(|tag| {
                    positive("size_m", tag.size_m)?;
                    check_sigma("sigma_m", tag.sigma_m)?;
                    check_sigma("sigma_rad", tag.sigma_rad)
                })?;
                t.check_joint()
            }
            Target::Points(points) => check_points(points),
            Target::Printed(t) => t.check(),
        }
    }
}

impl LinePlusOne {
    fn point(&self, id: u32) -> Option<Point> {
        match id {
            0..=2 => Some(Point::new(self.line_m[id as usize], 0.0, 0.0)),
            3 => Some(Point::new(self.off_m[0], self.off_m[1], 0.0)),
            _ => None,
        }
    }

    fn check(&self) -> Result<(), Error> {
        let finite = self.line_m.iter().chain(&self.off_m).find(|x| !x.is_finite());
        if let Some(&seen) = finite {
            return Err(Error::InvalidTarget {
                parameter: "line_m or off_m",
                seen,
                needed: "it must be finite",
            });
        }
        let [a, b, c] = self.line_m;
        let gap = (a - b).abs().min((b - c).abs()).min((a - c).abs());
        if gap == 0.0 {
            let needed = "the three abscissae must differ";
            return Err(Error::InvalidTarget { parameter: "line_m", seen: gap, needed });
        }
        if self.off_m[1] == 0.0 {
            let needed = "the fourth point must lie off the line (across ≠ 0)";
            return Err(Error::InvalidTarget { parameter: "off_m[1]", seen: 0.0, needed });
        }
        Ok(())
    }

    /// Where the fourth point stands along the line: 0 over the first end, 1 over the other, 0.5 over the middle.
    ///
    /// The camera cannot tell two poses apart from the plane through the fourth point perpendicular to the line; a
    /// foot at or beyond an end (≤ 0.2 or ≥ 0.8) keeps that plane out of the way (docs/math/line_plus_one.md).
    pub fn foot_ratio(&self) -> f64 {
        let min = self.line_m.iter().copied().fold(f64::INFINITY, f64::min);
        let max = self.line_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (self.off_m[0] - min) / (max - min)
    }
}

impl AprilGrid {
    fn point(&self, feature: Feature) -> Option<Point> {
        let index = feature.id.checked_sub(self.first_id).filter(|i| *i < self.rows * self.columns)?;
        let pitch = self.tag_size_m * (1.0 + self.tag_spacing_ratio);
        let (column, row) = ((index % self.columns) as f64, (index / self.columns) as f64);
        let (dx, dy) = [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)][feature.corner as usize];
        Some(Point::new(column * pitch + dx * self.tag_size_m, row * pitch + dy * self.tag_size_m, 0.0))
    }
}

impl TagMap {
    /// Refuses a joint covariance of another size, or one that is none.
    fn check_joint(&self) -> Result<(), Error> {
        let Some(joint) = &self.joint_covariance else { return Ok(()) };
        let (parameter, n) = ("joint_covariance", 6 * self.tags.len());
        if joint.shape() != (n, n) {
            let needed =
                "it has six rows and columns for each tag; without it each tag has its sigma_m and sigma_rad";
            return Err(Error::InvalidTarget { parameter, seen: joint.nrows() as f64, needed });
        }
        if !is_covariance(joint) {
            let needed = "it must be symmetric without a negative variance; copy all digits, or leave it out";
            return Err(Error::InvalidTarget { parameter, seen: joint.nrows() as f64, needed });
        }
        Ok(())
    }

    /// Covariance of the small left motions `[rotation_rad; translation_m]` of some tags together, by their indices, map frame: the stated one, or
    /// that of the independent motions about their centres that the tolerances mean.
    pub fn covariance_of(&self, tags: &[usize]) -> DMatrix<f64> {
        if let Some(joint) = &self.joint_covariance {
            let at = |i: usize| 6 * tags[i / 6] + i % 6;
            return DMatrix::from_fn(6 * tags.len(), 6 * tags.len(), |i, j| joint[(at(i), at(j))]);
        }
        let mut all = DMatrix::zeros(6 * tags.len(), 6 * tags.len());
        for (i, tag) in tags.iter().map(|tag| &self.tags[*tag]).enumerate() {
            let mut about_origin = Matrix6::identity();
            about_origin
                .fixed_view_mut::<3, 3>(3, 0)
                .copy_from(&tag.world_from_tag.translation.cross_matrix());
            let mut own = Matrix6::identity() * (tag.sigma_rad * tag.sigma_rad);
            own.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(tag.sigma_m * tag.sigma_m);
            let own = crate::pose::symmetric(&(about_origin * own * about_origin.transpose()));
            all.fixed_view_mut::<6, 6>(6 * i, 6 * i).copy_from(&own);
        }
        all
    }

    /// Whether all tags lie in the map's plane z = 0 and face the same way, as on one sheet: 1 where that is the way of a lone tag
    /// (z into the sheet), −1 where z points towards the viewer.
    pub fn sheet_facing(&self) -> Option<f64> {
        /// Tilts below 10 µrad and offsets below 10 µm are rounding of a file.
        const FLAT: f64 = 1e-5;
        let facing = self.tags.first()?.world_from_tag.rotation[(2, 2)].signum();
        let in_sheet = |tag: &MapTag| {
            let Pose { rotation, translation } = &tag.world_from_tag;
            let tilt = rotation[(2, 0)].hypot(rotation[(2, 1)]);
            translation.z.abs() <= FLAT && tilt <= FLAT && 0.0 < rotation[(2, 2)] * facing
        };
        self.tags.iter().all(in_sheet).then_some(facing)
    }
}

/// Corner 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left, origin at the centre, y down.
fn tag_corner(size_m: f64, corner: u8) -> Point {
    let h = 0.5 * size_m;
    let (x, y) = [(-h, -h), (h, -h), (h, h), (-h, h)][corner as usize];
    Point::new(x, y, 0.0)
}

fn grid_point(id: u32, columns: u32, pitch_m: f64, origin_m: f64) -> Point {
    Point::new((id % columns) as f64 * pitch_m + origin_m, (id / columns) as f64 * pitch_m + origin_m, 0.0)
}

fn check_points(points: &[NamedPoint]) -> Result<(), Error> {
    for p in points {
        if let Some(&seen) = p.position.iter().find(|x| !x.is_finite()) {
            return Err(Error::InvalidTarget { parameter: "position_m", seen, needed: "it must be finite" });
        }
        check_sigma("sigma_m", p.sigma_m)?;
    }
    Ok(())
}

fn check_sigma(parameter: &'static str, seen: f64) -> Result<(), Error> {
    let usable = 0.0 <= seen && seen.is_finite();
    if usable {
        Ok(())
    } else {
        Err(Error::InvalidTarget { parameter, seen, needed: "it must be zero or positive" })
    }
}
