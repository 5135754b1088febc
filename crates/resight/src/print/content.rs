//! The content of one sheet: the target's ink in millimetres, the white it needs, and its caption.

use super::PrintRequest;
use super::shape::Shape;
use super::text::latin;
use crate::error::Error;
use crate::render::Style;
use crate::render::ink::{self, Ink, Sheet};
use resight_core::Target;
use resight_core::target::{Tag, TagMap};

/// A target to be placed on pages.
#[derive(Debug, Clone)]
pub(super) struct Content {
    /// Kind, family, ids and sizes.
    pub title: String,
    /// Complete sentences below the rulers.
    pub words: Vec<String>,
    /// The ink, its box from (0, 0) to `size`.
    pub shapes: Vec<Shape>,
    /// Width and height of the ink.
    pub size: [f64; 2],
    /// White around the ink: the recommended width, and the least.
    pub white: [f64; 2],
}

/// Least width of free white in which ids are written below tags.
const LEAST_LABEL_ROOM_MM: f64 = 3.0;

/// Returns one sheet; for a map whose tags are mounted separately, one for each tag.
pub(super) fn contents(request: &PrintRequest) -> Result<Vec<Content>, Error> {
    let dot_diameter_m = request.dot_diameter_m;
    if let Some(seen) = dot_diameter_m.filter(|d| !(0.0 < *d && d.is_finite())) {
        return Err(Error::request(format!("the diameter of dots is {seen} m; it must be positive")));
    }
    let style = Style { dot_diameter_m, ..Style::default() };
    let one = |target: &Target| Content::new(target, &style, request);
    match request.target.design() {
        Target::Points(points) => Err(Error::request(format!(
            "{} surveyed points are not printed; printed are line_plus_one, tag, aprilgrid, chessboard, charuco, circle_grid and tag_map",
            points.len()
        ))),
        Target::LinePlusOne(dots) => {
            let line = dots.line_m.iter().map(|x| [*x, 0.0]);
            check_dots(&line.chain([dots.off_m]).collect::<Vec<_>>(), dot_diameter_m)?;
            Ok(vec![one(request.target.design())?])
        }
        Target::CircleGrid(grid) => {
            let next = 0.5f64.sqrt() * grid.pitch_m();
            let neighbours = if grid.asymmetric { [next, next] } else { [grid.spacing_m, 0.0] };
            check_dots(&[[0.0; 2], neighbours], dot_diameter_m)?;
            Ok(vec![one(request.target.design())?])
        }
        Target::TagMap(map) if !is_one_sheet(map) => {
            map.tags.iter().map(|tag| one(&lone(map, tag))).collect()
        }
        design => Ok(vec![one(design)?]),
    }
}

/// Returns whether the tags of a map should be printed together: in one plane, and near each other.
fn is_one_sheet(map: &TagMap) -> bool {
    /// Largest area of the sheet, in areas of its tags: the tags of sparser maps are mounted separately.
    const SPARSE: f64 = 16.0;
    let (low, high) = ink::bounds(map.tags.iter().map(|tag| {
        let t = tag.world_from_tag.translation;
        [t.x, t.y]
    }));
    let largest = map.tags.iter().map(|tag| tag.size_m).fold(0.0, f64::max);
    let area = (high[0] - low[0] + largest) * (high[1] - low[1] + largest);
    let inked: f64 = map.tags.iter().map(|tag| tag.size_m * tag.size_m).sum();
    map.sheet_facing().is_some() && area <= SPARSE * inked
}

fn lone(map: &TagMap, tag: &resight_core::target::MapTag) -> Target {
    Target::Tag(Tag { family: map.family.clone(), id: tag.id, size_m: tag.size_m })
}

fn check_dots(points: &[[f64; 2]], diameter_m: Option<f64>) -> Result<(), Error> {
    let apart = |(i, a): (usize, &[f64; 2])| {
        points[i + 1..].iter().map(|b| (a[0] - b[0]).hypot(a[1] - b[1])).fold(f64::INFINITY, f64::min)
    };
    let least = points.iter().enumerate().map(apart).fold(f64::INFINITY, f64::min);
    match diameter_m.filter(|d| least <= *d) {
        Some(d) => Err(Error::request(format!(
            "dots of {} mm touch: two are {} mm apart; a third of that is a good diameter",
            mm(d),
            mm(least)
        ))),
        None => Ok(()),
    }
}

impl Content {
    fn new(target: &Target, style: &Style, request: &PrintRequest) -> Result<Self, Error> {
        let sheet = ink::sheet(target, style).map_err(|e| Error::request(e.to_string()))?;
        let (low, high) = sheet.ink_bounds();
        let page = |[x, y]: [f64; 2]| {
            let down = if sheet.is_y_up { high[1] - y } else { y - low[1] };
            [1e3 * (x - low[0]), 1e3 * down]
        };
        let shape = |ink: &Ink| match ink {
            Ink::Area(outlines) => {
                Shape::Area(outlines.iter().map(|o| o.iter().map(|p| page(*p)).collect()).collect())
            }
            Ink::Disc { centre_m, radius_m } => {
                Shape::Disc { centre: page(*centre_m), radius: 1e3 * radius_m }
            }
        };
        let size = [1e3 * (high[0] - low[0]), 1e3 * (high[1] - low[1])];
        if !size.iter().all(|side| 0.0 < *side && side.is_finite()) {
            return Err(Error::request(format!(
                "the target is {} × {} mm; check number and unit",
                size[0], size[1]
            )));
        }
        let mut shapes: Vec<Shape> = sheet.ink.iter().map(shape).collect();
        shapes.extend(ids(target, &page));
        let title = latin(&title(target));
        Ok(Content {
            words: words(target, &title, request),
            title,
            shapes,
            size,
            white: white(target, &sheet),
        })
    }
}

/// Returns the number below each tag of a sheet, where neither its rim nor that of the next tag is in the way.
fn ids(target: &Target, page: &dyn Fn([f64; 2]) -> [f64; 2]) -> Vec<Shape> {
    let Target::TagMap(map) = target else { return Vec::new() };
    let one = |tag: &resight_core::target::MapTag| {
        let rim = crate::render::family::cells(&map.family, tag.id)
            .map_or(0.0, |c| (c.per_side - c.per_size) as f64 / c.per_size as f64);
        let t = tag.world_from_tag.translation;
        let step_m = |other: &resight_core::target::MapTag| {
            let step = other.world_from_tag.translation - t;
            (step.x.abs() < tag.size_m && 0.0 < step.y.abs()).then_some(step.y.abs())
        };
        let next_m = map.tags.iter().filter_map(step_m).fold(f64::INFINITY, f64::min);
        let free_mm = 1e3 * (0.15 * tag.size_m).min(next_m - tag.size_m * (1.0 + rim) + 1e-9);
        let [x, y] = page([t.x, t.y]);
        let below = y + 1e3 * tag.size_m * 0.5 * (1.0 + rim);
        let size = (0.6 * free_mm).min(4.0);
        let text = format!("{} id {}", map.family, tag.id);
        let width = super::text::width_mm(&text, size);
        (LEAST_LABEL_ROOM_MM <= free_mm).then(|| Shape::Text {
            at: [x - 0.5 * width, below + 0.5 * free_mm + 0.36 * size],
            size,
            text: latin(&text),
        })
    };
    map.tags.iter().filter_map(one).collect()
}

/// Returns the recommended white for a detector, and the least, mm.
fn white(target: &Target, sheet: &Sheet) -> [f64; 2] {
    let (low, high) = sheet.ink_bounds();
    let rim_m = [
        low[0] - sheet.low_m[0],
        low[1] - sheet.low_m[1],
        sheet.high_m[0] - high[0],
        sheet.high_m[1] - high[1],
    ];
    let rim = 1e3 * rim_m.into_iter().fold(0.0, f64::max);
    match target {
        // The end of the board decides which corner is the first: docs/math/print.md section 3.
        Target::Chessboard(t) => [(500.0 * t.square_m).max(5.0), 5.0],
        // The end of the grid decides which circle is the first, where some are hidden: docs/math/circle_grid.md section 3.
        Target::CircleGrid(t) => [1e3 * t.pitch_m(), 4.0],
        Target::LinePlusOne(_) => {
            let radius = sheet
                .ink
                .iter()
                .map(|ink| if let Ink::Disc { radius_m, .. } = ink { *radius_m } else { 0.0 });
            let diameter = 2e3 * radius.fold(0.0, f64::max);
            [diameter.max(6.0), (0.5 * diameter).max(4.0)]
        }
        Target::Tag(_) | Target::TagMap(_) => [rim + 3.0, rim.max(2.0)],
        _ => [8.0, 4.0],
    }
}

/// Writes a length, given in metres, as millimetres without trailing zeros.
fn mm(metres: f64) -> String {
    super::shape::number((1e3 * metres * 1e4).round() / 1e4)
}

fn title(target: &Target) -> String {
    match target {
        Target::LinePlusOne(t) => format!(
            "four dots: on the line at {} mm, the fourth at ({}, {}) mm",
            t.line_m.map(mm).join(", "),
            mm(t.off_m[0]),
            mm(t.off_m[1])
        ),
        Target::CircleGrid(t) => format!(
            "{} circle grid of {} rows × {} columns, rows {} mm apart, circles of one row {} mm",
            if t.asymmetric { "asymmetric" } else { "symmetric" },
            t.rows,
            t.columns,
            mm(t.spacing_m),
            mm(if t.asymmetric { 2.0 * t.spacing_m } else { t.spacing_m })
        ),
        Target::Tag(t) => format!("{} id {}, {} mm (outer edge of the square)", t.family, t.id, mm(t.size_m)),
        Target::AprilGrid(t) => format!(
            "AprilGrid of {} rows × {} columns, {} ids {} to {}, tags of {} mm, gaps of {} mm",
            t.rows,
            t.columns,
            t.family,
            t.first_id,
            t.first_id.saturating_add(t.rows * t.columns).saturating_sub(1),
            mm(t.tag_size_m),
            mm(t.tag_size_m * t.tag_spacing_ratio)
        ),
        Target::Chessboard(t) => {
            format!(
                "chessboard of {} rows × {} columns of inner corners, squares of {} mm",
                t.rows,
                t.columns,
                mm(t.square_m)
            )
        }
        Target::Charuco(t) => format!(
            "ChArUco board of {} rows × {} columns of squares of {} mm, markers of {} mm from {}{}",
            t.rows,
            t.columns,
            mm(t.square_m),
            mm(t.marker_m),
            t.dictionary,
            if t.legacy_pattern { ", legacy pattern" } else { "" }
        ),
        Target::TagMap(t) => {
            let id = |of: fn(u32, u32) -> u32| t.tags.iter().map(|tag| tag.id).reduce(of).unwrap_or(0);
            let size = t.tags.iter().map(|tag| tag.size_m).fold(0.0, f64::max);
            format!(
                "{} tags of {}, ids {} to {}, {} mm",
                t.tags.len(),
                t.family,
                id(u32::min),
                id(u32::max),
                mm(size)
            )
        }
        other => other.kind().to_owned(),
    }
}

fn words(target: &Target, title: &str, request: &PrintRequest) -> Vec<String> {
    let y = if let Target::AprilGrid(_) = target { "up" } else { "down" };
    let file = latin(&request.name);
    let mut first = title.to_owned();
    if let Some(letter) = first
        .get_mut(..1)
        .filter(|_| ["four", "chess", "symm", "asymm"].iter().any(|start| title.starts_with(start)))
    {
        letter.make_ascii_uppercase();
    }
    vec![
        format!("{first}. x to the right, y {y}."),
        format!(
            "Print at 100 % (actual size, not fitted to the page). Measure both rulers between their end marks: \
             resight print --target {file}.toml --measured-x-mm ... --measured-y-mm ... -o {file}.toml"
        ),
    ]
}
