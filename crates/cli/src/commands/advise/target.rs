//! A target over a volume: how sure, how often ambiguous, and which change helps?

use super::Advise;
use super::say::{OutlookObject, outlook_header, outlook_row, say};
use crate::output::{Outcome, print};
use anyhow::{Context, Result};
use resight::advise::maps::TargetMaps;
use resight::advise::words;
use resight::core::Camera;
use resight::core::advise::change::{cost, tried};
use resight::core::advise::volume::{Outlook, Shape, Volume, outlook, poses};
use resight::report::verdict::Status;
use serde::Serialize;

/// Views tried over the whole volume, and over each of its parts.
const VIEWS: usize = 1500;
const VIEWS_OF_PART: usize = 400;
const VIEWS_OF_CHANGE: usize = 600;
/// Parts of the ranges of distance and tilt.
const PARTS: usize = 3;

#[derive(Serialize)]
struct Row {
    kind: &'static str,
    distance_m: [f64; 2],
    tilt_rad: [f64; 2],
    #[serde(flatten)]
    outlook: OutlookObject,
}

#[derive(Serialize)]
struct ChangeRow {
    kind: &'static str,
    rank: usize,
    key: &'static str,
    from: f64,
    to: f64,
    grows: bool,
    /// Median of the place over the share of answers of use, over that of the target as it is: below 1 it helps.
    cost_ratio: f64,
    #[serde(flatten)]
    outlook: OutlookObject,
}

/// See `Advise`.
pub fn run(args: &Advise, camera: &Camera) -> Result<Outcome> {
    super::must_have_image(camera, &args.camera)?;
    let target = args.target()?;
    let distance_m =
        args.distance_m.context("--distance-m A..B is needed: how far the camera is from the target")?;
    let radians = |range: [f64; 2]| range.map(f64::to_radians);
    let volume =
        Volume { distance_m, tilt_rad: radians(args.tilt_deg), direction_rad: radians(args.direction_deg) };
    let shape = Shape::of(&target);
    let views = poses(&shape, camera, &volume, VIEWS);
    let whole = outlook(&shape, camera, args.sigma_px, &views);
    if !args.json {
        print(&format!(
            "{} of {} points at σ {} px; standard deviations as the answers will state them\n\n{}",
            target.kind(),
            shape.points.len(),
            args.sigma_px,
            outlook_header("distance and tilt")
        ))?;
    }
    row(args, "whole volume", &volume, &whole)?;
    for (name, part) in parts(&volume) {
        let o = outlook(&shape, camera, args.sigma_px, &poses(&shape, camera, &part, VIEWS_OF_PART));
        row(args, &name, &part, &o)?;
    }
    remarks(args, &whole)?;
    changes(args, camera, &target, &volume, &whole)?;
    let maps = TargetMaps { shape: &shape, camera, sigma_px: args.sigma_px, volume };
    if args.output.is_some() {
        args.picture("target-image.png", maps.over_image())?;
        args.picture("around-x.png", Some(maps.around(true)))?;
        args.picture("around-y.png", Some(maps.around(false)))?;
    }
    Ok(Outcome::of([if whole.place_m.is_some() { Status::Ok } else { Status::Degenerate }]))
}

fn row(args: &Advise, name: &str, volume: &Volume, o: &Outlook) -> Result<()> {
    let object = Row {
        kind: "outlook",
        distance_m: volume.distance_m,
        tilt_rad: volume.tilt_rad,
        outlook: OutlookObject::from(o),
    };
    say(args.json, &object, &outlook_row(name, o))
}

/// The volume cut by distance and by tilt.
fn parts(volume: &Volume) -> Vec<(String, Volume)> {
    let third = |[a, b]: [f64; 2], i: usize| {
        let at = |k: usize| a + (b - a) * k as f64 / PARTS as f64;
        [at(i), at(i + 1)]
    };
    let count = |[a, b]: [f64; 2]| if a < b { PARTS } else { 1 };
    let mut found = Vec::new();
    for i in 0..count(volume.distance_m) {
        for j in 0..count(volume.tilt_rad) {
            let part = Volume {
                distance_m: third(volume.distance_m, i),
                tilt_rad: third(volume.tilt_rad, j),
                ..*volume
            };
            let ([a, b], [c, d]) = (part.distance_m, part.tilt_rad.map(f64::to_degrees));
            found.push((format!("{a:.2} to {b:.2} m, {c:.0}° to {d:.0}°"), part));
        }
    }
    found
}

fn remarks(args: &Advise, o: &Outlook) -> Result<()> {
    if args.json {
        return Ok(());
    }
    let mut text = String::new();
    if 0.01 < o.ambiguous {
        text += &format!(
            "\n  ! {:.0} % of the answers over this volume will be ambiguous, {:.1} % have the wrong pose first; tilt the target, come closer or make it larger\n",
            100.0 * o.ambiguous,
            100.0 * o.wrong
        );
    }
    if 0.01 < o.doubtful {
        text += &format!(
            "  ! in {:.0} % of the views first-order figures do not hold (frontal, or a second pose near); there the table rests on drawn pictures\n",
            100.0 * o.doubtful
        );
    }
    if o.n_out_of_sight != 0 {
        let share = 100.0 * o.n_out_of_sight as f64 / o.n_views as f64;
        text += &format!(
            "  ! in {share:.0} % of the views the target does not fit into the image; step back or make it smaller\n"
        );
    }
    print(&text)
}

fn changes(
    args: &Advise,
    camera: &Camera,
    target: &resight::core::Target,
    volume: &Volume,
    now: &Outlook,
) -> Result<()> {
    let all = tried(target, camera, args.sigma_px, volume, VIEWS_OF_CHANGE);
    if !args.json && !all.is_empty() {
        print(&format!("\n{}", outlook_header("changes, best first")))?;
    }
    for (i, t) in all.iter().enumerate() {
        let c = &t.change;
        let object = ChangeRow {
            kind: "change",
            rank: i + 1,
            key: c.key,
            from: c.from,
            to: c.to,
            grows: c.grows,
            cost_ratio: cost(&t.outlook) / cost(now),
            outlook: OutlookObject::from(&t.outlook),
        };
        say(args.json, &object, &outlook_row(&words::change(c), &t.outlook))?;
    }
    if let Some(free) = all.iter().find(|t| !t.change.grows)
        && !args.json
    {
        let helps = cost(&free.outlook) < 0.97 * cost(now);
        print(&match helps {
            true => format!("\nwithout making it larger: {}\n", words::change(&free.change)),
            false => "\nwithout making it larger, nothing tried helps\n".to_string(),
        })?;
    }
    Ok(())
}
