//! Images: the sweeps with whisker shapes and hub path; the contacts with their ellipses and the outline.

use anyhow::{Result, anyhow, bail};
use nalgebra::Vector2;
use resight::drawing::chart::Chart;
use resight::drawing::{Anchor, Drawing};
use resight::formats::write_atomically;
use resight::overlay::canvas::Color;
use resight_whisker::contact::Method;
use resight_whisker::contact::bent::shape_in_hub;
use resight_whisker::estimate::{Mode, Status};
use resight_whisker::files::ContactRow;
use resight_whisker::files::contacts::RowStatus;
use resight_whisker::solve::Solved;
use resight_whisker::{Rod, Sample, Shape};
use std::path::{Path, PathBuf};

const INK: Color = [25, 28, 33];
const SHAPE: Color = [120, 128, 140];
const HUB: Color = [125, 60, 160];
const OUTLINE: Color = [20, 130, 60];
const MID: Color = [25, 105, 200];
const TIP: Color = [225, 120, 0];
const ODD: Color = [210, 40, 40];
const WEAK: Color = [165, 170, 178];

/// Side of a frame, px, and the room around it.
const SIDE_PX: f64 = 640.0;
const LEFT_PX: f64 = 62.0;
const TOP_PX: f64 = 46.0;
/// Room for what is said beside a frame.
const NOTES_PX: u32 = 280;
const LEGEND_PX: f64 = 92.0;
/// Whisker shapes drawn for each sweep.
const SHAPES_PER_SWEEP: usize = 11;
/// Points of a drawn outline.
const OUTLINE_POINTS: usize = 240;
/// Points of a drawn whisker.
const SHAPE_POINTS: usize = 81;
/// Contacts whose error bar exceeds this share of the whisker do not decide what the magnified frame shows.
const VAGUE: f64 = 0.02;

/// A path whose ending names a kind of image.
pub fn path(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("svg" | "png") => Ok(path),
        _ => Err("a name that ends in .svg or .png is needed".to_string()),
    }
}

/// Writes an image in the kind its ending names.
pub fn write(path: &Path, drawing: &Drawing) -> Result<()> {
    let is_png = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    let bytes = match is_png {
        true => drawing.png().map_err(|reason| anyhow!("{}: {reason}", path.display()))?,
        false => drawing.svg().into_bytes(),
    };
    Ok(write_atomically(path, &bytes)?)
}

/// Two frames: the sweeps to one scale, the contacts magnified.
pub fn sweeps(solved: &Solved, object: Option<&Shape>) -> Result<Drawing> {
    let rod = &solved.rod;
    let shapes: Vec<Vec<Vector2<f64>>> = drawn(solved).map(|sample| whisker_shape(rod, sample)).collect();
    let hubs: Vec<Vec<Vector2<f64>>> = hub_paths(solved);
    let outline = object.map(outline).unwrap_or_default();
    let left = Chart::around(
        Vector2::new(LEFT_PX, TOP_PX),
        SIDE_PX,
        shapes.iter().chain(&hubs).flatten().chain(&outline).copied(),
    );
    let Some(left) = left else { bail!("no image: there is no complete reading") };
    let mut drawing = sheet(2);
    left.frame(&mut drawing, "sweeps");
    shapes.iter().for_each(|shape| left.line(&mut drawing, shape, SHAPE, 1.2, 0.55));
    for hub in &hubs {
        left.line(&mut drawing, hub, HUB, 2.0, 1.0);
        hub.iter().step_by((hub.len() / 8).max(1)).for_each(|x| left.dot(&mut drawing, x, HUB, 5.0));
    }
    left.line(&mut drawing, &outline, OUTLINE, 2.0, 1.0);
    points(&mut drawing, &left, &solved.rows, 3.0);
    left.scale_bar(&mut drawing);
    let corner = Vector2::new(2.0 * LEFT_PX + SIDE_PX, TOP_PX);
    magnified(&mut drawing, corner, rod.length_m, &solved.rows, &outline);
    legend(&mut drawing, &[(SHAPE, "whisker"), (HUB, "hub")], &solved.rows, !outline.is_empty());
    Ok(drawing)
}

/// One frame: the contacts with their ellipses, the outline, and what is to be said of it.
pub fn contacts(rows: &[ContactRow], object: Option<&Shape>, notes: &[String]) -> Drawing {
    let outline = object.map(outline).unwrap_or_default();
    let mut drawing = sheet(1);
    drawing.width_px += if notes.is_empty() { 0 } else { NOTES_PX };
    magnified(&mut drawing, Vector2::new(LEFT_PX, TOP_PX), 0.0, rows, &outline);
    for (i, note) in notes.iter().enumerate() {
        let at = Vector2::new(LEFT_PX + SIDE_PX + 20.0, TOP_PX + 22.0 + 22.0 * i as f64);
        drawing.text(note, at, 10.0, INK, Anchor::Start);
    }
    legend(&mut drawing, &[], rows, !outline.is_empty());
    drawing
}

fn sheet(frames: u32) -> Drawing {
    let width = frames as f64 * (LEFT_PX + SIDE_PX) + 24.0;
    Drawing::new(width as u32, (TOP_PX + SIDE_PX + LEGEND_PX) as u32)
}

/// The readings whose whisker is drawn: evenly chosen among those in contact, sweep by sweep.
fn drawn(solved: &Solved) -> impl Iterator<Item = &Sample> {
    let touching: Vec<&Sample> = solved
        .rows
        .iter()
        .zip(&solved.samples)
        .filter(|(row, _)| row.is_ok())
        .filter_map(|(_, s)| s.as_ref())
        .collect();
    let mut chosen = Vec::new();
    for sweep in touching.chunk_by(|a, b| a.sweep == b.sweep) {
        let step = sweep.len().div_ceil(SHAPES_PER_SWEEP).max(1);
        chosen.extend(sweep.iter().rev().step_by(step).copied());
    }
    chosen.into_iter()
}

/// The whisker's centre line in the world.
fn whisker_shape(rod: &Rod, sample: &Sample) -> Vec<Vector2<f64>> {
    let line = shape_in_hub(rod, &sample.load, Method::Auto, SHAPE_POINTS);
    line.into_iter().map(|x_in_hub| sample.world_from_hub.apply(x_in_hub)).collect()
}

/// One line for each sweep.
fn hub_paths(solved: &Solved) -> Vec<Vec<Vector2<f64>>> {
    let samples: Vec<&Sample> = solved.samples.iter().flatten().collect();
    let place = |s: &&Sample| Vector2::new(s.world_from_hub.x_m, s.world_from_hub.y_m);
    samples.chunk_by(|a, b| a.sweep == b.sweep).map(|sweep| sweep.iter().map(place).collect()).collect()
}

/// A closed line around an object.
fn outline(shape: &Shape) -> Vec<Vector2<f64>> {
    let mut points = shape.outline_m(OUTLINE_POINTS);
    points.extend(points.first().copied());
    points
}

/// The frame of the contacts: it holds those that are known well, and the outline.
fn magnified(
    drawing: &mut Drawing,
    corner: Vector2<f64>,
    length_m: f64,
    rows: &[ContactRow],
    outline: &[Vector2<f64>],
) {
    let limit = if 0.0 < length_m { VAGUE * length_m } else { typical_m(rows) };
    let well = rows.iter().filter(|row| row.is_ok()).filter_map(|row| row.figures);
    let well = well.filter(|f| sigma_m(&f.covariance) <= limit).map(|f| f.x_in_world);
    let Some(chart) = Chart::around(corner, SIDE_PX, well.chain(outline.iter().copied())) else {
        drawing.text("no contact that is ok", corner + Vector2::repeat(30.0), 11.0, INK, Anchor::Start);
        return;
    };
    chart.frame(drawing, "contacts with 2 σ ellipses");
    for row in rows {
        if let Some(f) = row.figures {
            let covariance = f.covariance.fixed_view::<2, 2>(0, 0).into_owned();
            chart.ellipse(drawing, &f.x_in_world, &covariance, 2.0, color(row), 0.4);
        }
    }
    chart.line(drawing, outline, OUTLINE, 2.5, 1.0);
    points(drawing, &chart, rows, 5.0);
    chart.scale_bar(drawing);
}

/// Worst standard deviation.
fn sigma_m(c: &nalgebra::Matrix3<f64>) -> f64 {
    let (mean, half) = (0.5 * (c[(0, 0)] + c[(1, 1)]), 0.5 * (c[(0, 0)] - c[(1, 1)]));
    (mean + half.hypot(c[(0, 1)])).sqrt()
}

/// Four times the median error bar.
fn typical_m(rows: &[ContactRow]) -> f64 {
    let mut sigmas: Vec<f64> = rows
        .iter()
        .filter(|row| row.is_ok())
        .filter_map(|row| row.figures)
        .map(|f| sigma_m(&f.covariance))
        .collect();
    sigmas.sort_by(f64::total_cmp);
    sigmas.get(sigmas.len() / 2).map_or(f64::INFINITY, |median| 4.0 * median)
}

fn color(row: &ContactRow) -> Color {
    match (row.status, row.mode) {
        (RowStatus::Read(Status::Ok), Mode::Tip) => TIP,
        (RowStatus::Read(Status::Ok), _) => MID,
        (RowStatus::Read(Status::LowForce), _) => WEAK,
        _ => ODD,
    }
}

fn points(drawing: &mut Drawing, chart: &Chart, rows: &[ContactRow], width: f64) {
    for row in rows {
        if let Some(figures) = row.figures {
            chart.dot(drawing, &figures.x_in_world, color(row), width);
        }
    }
}

/// What the colours mean, with counts.
fn legend(drawing: &mut Drawing, first: &[(Color, &str)], rows: &[ContactRow], has_outline: bool) {
    let count =
        |wanted: Color| rows.iter().filter(|row| row.figures.is_some() && color(row) == wanted).count();
    let kinds = [(MID, "mid-whisker"), (TIP, "tip"), (WEAK, "low force"), (ODD, "other status")];
    let mut entries: Vec<(Color, String)> = first.iter().map(|(c, text)| (*c, text.to_string())).collect();
    entries.extend(
        kinds.iter().filter(|(c, _)| 0 < count(*c)).map(|(c, text)| (*c, format!("{text} ({})", count(*c)))),
    );
    if has_outline {
        entries.push((OUTLINE, "outline".to_string()));
    }
    let mut x = LEFT_PX;
    for (color, text) in entries {
        let y = TOP_PX + SIDE_PX + 62.0;
        drawing.line(vec![Vector2::new(x, y - 4.0), Vector2::new(x + 22.0, y - 4.0)], color, 5.0);
        drawing.text(&text, Vector2::new(x + 30.0, y), 10.0, INK, Anchor::Start);
        x += 54.0 + resight::overlay::font::width(&text, 10.0);
    }
}
