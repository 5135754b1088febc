//! Our own target file: TOML, `kind = "…"`, lengths in metres and said so in the key.

use super::document::{Document, Fault, Syntax};
use super::entry::Entry;
use super::{Format, TargetFormat, checks};
use crate::core::target::{
    AprilGrid, Charuco, Chessboard, CircleGrid, LinePlusOne, MapTag, NamedPoint, PrintedScale, Tag, TagMap,
};
use crate::core::{Point, Pose, Target};
use crate::input::nearest;
use nalgebra::DMatrix;

pub(super) const FORMAT: TargetFormat = TargetFormat {
    format: Format::OwnTarget,
    recognises: |document| document.syntax == Syntax::Toml && document.root.get("kind").is_some(),
    read,
    traps: &[],
};

const KINDS: [&str; 8] =
    ["line_plus_one", "tag", "aprilgrid", "chessboard", "charuco", "circle_grid", "tag_map", "points"];
const FAMILY: &str = "tag36h11";
/// The scale of the print: printed length over designed length along x and y, each with its standard deviation.
pub(super) const PRINTED: &str = "printed_scale";
/// The covariance of all tags of a map together: the rows up to the diagonal.
pub(super) const JOINT: &str = "joint_covariance";
/// More points or tags than any survey; keeps a hostile file from filling the memory later.
const MOST_ENTRIES: usize = 10_000;

fn read(document: &Document) -> Result<(Target, Vec<String>), Fault> {
    let root = document.entry();
    let kind = root.need("kind")?;
    let target = match kind.text()? {
        "line_plus_one" => line_plus_one(&root),
        "tag" => tag(&root),
        "aprilgrid" => aprilgrid(&root),
        "chessboard" => chessboard(&root),
        "charuco" => charuco(&root),
        "circle_grid" => circle_grid(&root),
        "tag_map" => tag_map(&root),
        "points" => points(&root),
        other => Err(kind.fault(match nearest(other, KINDS.iter().map(|kind| kind.to_string())) {
            Some(right) => format!("unknown kind `{other}`; did you mean `{right}`?"),
            None => format!("unknown kind `{other}`; the kinds are {}", KINDS.join(", ")),
        })),
    }?;
    Ok((printed(&root, target)?, Vec::new()))
}

/// Where the file states the scale of a print, the target is that print; a scale that cannot be is refused when the target is checked.
fn printed(root: &Entry<'_>, design: Target) -> Result<Target, Fault> {
    let Some(stated) = root.get(PRINTED) else { return Ok(design) };
    stated.only(&["x", "y", "sigma_x", "sigma_y"])?;
    let pair = |x: &str, y: &str| Ok([stated.need(x)?.number()?, stated.need(y)?.number()?]);
    let scale = PrintedScale { ratio: pair("x", "y")?, sigma: pair("sigma_x", "sigma_y")? };
    Ok(design.printed_at(scale))
}

fn line_plus_one(root: &Entry<'_>) -> Result<Target, Fault> {
    root.only(&["kind", "line_m", "off_m", PRINTED])?;
    let line = root.need("line_m")?.exactly(3, "abscissae of the three points on the line")?;
    let off = root.need("off_m")?.exactly(2, "along and across the line")?;
    Ok(Target::LinePlusOne(LinePlusOne { line_m: [line[0], line[1], line[2]], off_m: [off[0], off[1]] }))
}

fn family(root: &Entry<'_>) -> Result<String, Fault> {
    root.get("family").map_or(Ok(FAMILY), |f| f.text()).map(str::to_owned)
}

fn tag(root: &Entry<'_>) -> Result<Target, Fault> {
    root.only(&["kind", "family", "id", "size_m", PRINTED])?;
    Ok(Target::Tag(Tag {
        family: family(root)?,
        id: root.need("id")?.id()?,
        size_m: root.need("size_m")?.number()?,
    }))
}

fn aprilgrid(root: &Entry<'_>) -> Result<Target, Fault> {
    root.only(&[
        "kind",
        "family",
        "rows",
        "columns",
        "tag_size_m",
        "tag_spacing_ratio",
        "first_id",
        PRINTED,
    ])?;
    Ok(Target::AprilGrid(AprilGrid {
        family: family(root)?,
        rows: root.need("rows")?.side(1)?,
        columns: root.need("columns")?.side(1)?,
        tag_size_m: root.need("tag_size_m")?.number()?,
        tag_spacing_ratio: root.need("tag_spacing_ratio")?.number()?,
        first_id: root.get("first_id").map_or(Ok(0), |id| id.id())?,
    }))
}

fn chessboard(root: &Entry<'_>) -> Result<Target, Fault> {
    root.only(&["kind", "rows", "columns", "square_m", PRINTED])?;
    let square_m = root.need("square_m")?.number()?;
    Ok(Target::Chessboard(Chessboard {
        rows: root.need("rows")?.side(2)?,
        columns: root.need("columns")?.side(2)?,
        square_m,
    }))
}

fn charuco(root: &Entry<'_>) -> Result<Target, Fault> {
    root.only(&["kind", "rows", "columns", "square_m", "marker_m", "dictionary", "legacy_pattern", PRINTED])?;
    Ok(Target::Charuco(Charuco {
        rows: root.need("rows")?.side(2)?,
        columns: root.need("columns")?.side(2)?,
        square_m: root.need("square_m")?.number()?,
        marker_m: root.need("marker_m")?.number()?,
        dictionary: root.need("dictionary")?.text()?.to_owned(),
        legacy_pattern: root.get("legacy_pattern").map_or(Ok(false), |l| l.flag())?,
    }))
}

fn circle_grid(root: &Entry<'_>) -> Result<Target, Fault> {
    root.only(&["kind", "rows", "columns", "spacing_m", "diameter_m", "asymmetric", PRINTED])?;
    Ok(Target::CircleGrid(CircleGrid {
        rows: root.need("rows")?.side(2)?,
        columns: root.need("columns")?.side(2)?,
        spacing_m: root.need("spacing_m")?.number()?,
        diameter_m: root.get("diameter_m").map(|d| d.number()).transpose()?,
        asymmetric: root.need("asymmetric")?.flag()?,
    }))
}

fn listed<'a>(root: &Entry<'a>, key: &str) -> Result<Vec<Entry<'a>>, Fault> {
    let list = root.need(key)?;
    let items = list.items()?;
    if items.is_empty() || MOST_ENTRIES < items.len() {
        return Err(list.fault(format!("has {} entries; 1 to {MOST_ENTRIES} are supported", items.len())));
    }
    Ok(items)
}

fn tag_map(root: &Entry<'_>) -> Result<Target, Fault> {
    root.only(&["kind", "family", "sigma_m", "sigma_rad", "tag", PRINTED, JOINT])?;
    let number = |entry: &Entry<'_>, key: &str, otherwise: f64| {
        entry.get(key).map_or(Ok(otherwise), |value| value.number())
    };
    let (sigma_m, sigma_rad) = (number(root, "sigma_m", 0.0)?, number(root, "sigma_rad", 0.0)?);
    let mut tags: Vec<MapTag> = Vec::new();
    let mut ids = std::collections::HashSet::new();
    for entry in listed(root, "tag")? {
        entry.only(&["id", "size_m", "world_from_tag", "sigma_m", "sigma_rad"])?;
        let id = entry.need("id")?.id()?;
        if !ids.insert(id) {
            return Err(entry.fault(format!("tag {id} is listed twice; an id names one tag of the map")));
        }
        let world_from_tag = pose(&entry.need("world_from_tag")?)?;
        let (sigma_m, sigma_rad) =
            (number(&entry, "sigma_m", sigma_m)?, number(&entry, "sigma_rad", sigma_rad)?);
        tags.push(MapTag { id, size_m: entry.need("size_m")?.number()?, world_from_tag, sigma_m, sigma_rad });
    }
    let joint_covariance = root.get(JOINT).map(|rows| joint(&rows, tags.len())).transpose()?;
    Ok(Target::TagMap(TagMap { family: family(root)?, tags, joint_covariance }))
}

/// Reads the rows of a symmetric matrix up to the diagonal, six for each tag.
fn joint(rows: &Entry<'_>, n_tags: usize) -> Result<DMatrix<f64>, Fault> {
    let (items, n) = (rows.items()?, 6 * n_tags);
    if items.len() != n {
        let way_out =
            "leave the key out after adding or removing tags; each then has its sigma_m and sigma_rad";
        return Err(rows.fault(format!(
            "has {} rows; {n} are needed, six for each of {n_tags} tags ({way_out})",
            items.len()
        )));
    }
    let mut matrix = DMatrix::zeros(n, n);
    for (i, row) in items.iter().enumerate() {
        for (j, x) in row.exactly(i + 1, "the row up to the diagonal")?.into_iter().enumerate() {
            (matrix[(i, j)], matrix[(j, i)]) = (x, x);
        }
    }
    Ok(matrix)
}

fn pose(entry: &Entry<'_>) -> Result<Pose, Fault> {
    entry.only(&["rotation_wxyz", "translation_m"])?;
    let rotation = entry.need("rotation_wxyz")?;
    let q = rotation.exactly(4, "w, x, y, z")?;
    checks::quaternion_pose(
        &rotation,
        [q[0], q[1], q[2], q[3]],
        checks::vector3(&entry.need("translation_m")?)?,
    )
}

fn points(root: &Entry<'_>) -> Result<Target, Fault> {
    root.only(&["kind", "point"])?;
    let mut points: Vec<NamedPoint> = Vec::new();
    let mut names = std::collections::HashSet::new();
    for entry in listed(root, "point")? {
        entry.only(&["name", "position_m", "sigma_m"])?;
        let name = entry.need("name")?.text()?;
        if !names.insert(name) {
            return Err(entry.fault(format!("point `{name}` is listed twice; names must differ")));
        }
        let position = Point::from_row_slice(&entry.need("position_m")?.exactly(3, "x, y, z")?);
        let sigma_m = entry.get("sigma_m").map_or(Ok(0.0), |s| s.number())?;
        points.push(NamedPoint { name: name.to_owned(), position, sigma_m });
    }
    Ok(Target::Points(points))
}
