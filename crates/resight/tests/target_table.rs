//! The table of docs/targets.md: what each target is worth at each distance, in the adviser's own figures. `RESIGHT_BLESS=1` writes it anew.

use resight_core::advise::Optics;
use resight_core::advise::volume::{Shape, Volume, outlook, poses};
use resight_core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight_core::target::{AprilGrid, Charuco, Chessboard, LinePlusOne, Tag};
use resight_core::{Camera, Lens, Target};
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::Path;

const DISTANCES_M: [f64; 6] = [0.3, 0.5, 1.0, 2.0, 5.0, 10.0];
/// Median over so many views, tilted by 20° to 60° in any direction, anywhere in the image.
const VIEWS: usize = 160;
const TILT_RAD: [f64; 2] = [PI / 9.0, PI / 3.0];
/// What corners of a photograph with some noise and blur have, model errors of an ordinary lens included.
const SIGMA_PX: f64 = 0.2;

fn optics(camera: &Camera) -> Optics<'_> {
    Optics { camera, sigma_px: SIGMA_PX, intrinsics_covariance: None }
}
/// Pixels that the smallest feature needs, as the sweep of docs/targets.md found: edge of a tag or square, diameter of a dot.
const LEAST_TAG_PX: f64 = 16.0;
const LEAST_DOT_PX: f64 = 4.0;

/// A target with its smallest feature, metres, and the pixels that this needs.
fn targets() -> Vec<(&'static str, Target, f64, f64)> {
    let tag = |size_m| Target::Tag(Tag { family: "tag36h11".into(), id: 7, size_m });
    let charuco = |rows, columns, square_m, marker_m| {
        let dictionary = "DICT_5X5_100".to_string();
        Target::Charuco(Charuco { rows, columns, square_m, marker_m, dictionary, legacy_pattern: false })
    };
    let grid = |rows, columns, tag_size_m| {
        let family = "tag36h11".to_string();
        Target::AprilGrid(AprilGrid {
            family,
            rows,
            columns,
            tag_size_m,
            tag_spacing_ratio: 0.3,
            first_id: 0,
        })
    };
    let board = |square_m| Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m });
    let dots = |m: f64| Target::LinePlusOne(LinePlusOne { line_m: [0.0, 2.0 * m / 3.0, m], off_m: [0.0, m] });
    vec![
        ("tag, 100 mm", tag(0.1), 0.1, LEAST_TAG_PX),
        ("tag, 200 mm", tag(0.2), 0.2, LEAST_TAG_PX),
        ("AprilGrid 4 × 3, tags of 40 mm (A4)", grid(4, 3, 0.04), 0.04, LEAST_TAG_PX),
        ("AprilGrid 6 × 4, tags of 45 mm (A3)", grid(6, 4, 0.045), 0.045, LEAST_TAG_PX),
        ("chessboard 6 × 9, 25 mm (A4)", board(0.025), 0.025, LEAST_TAG_PX),
        ("chessboard 6 × 9, 36 mm (A3)", board(0.036), 0.036, LEAST_TAG_PX),
        ("ChArUco 8 × 5, 30 mm (A4)", charuco(8, 5, 0.03, 0.022), 0.03, LEAST_TAG_PX),
        ("ChArUco 8 × 5, 45 mm (A3)", charuco(8, 5, 0.045, 0.033), 0.045, LEAST_TAG_PX),
        ("four dots over 150 mm", dots(0.15), 0.05 / 3.0, LEAST_DOT_PX),
        ("four dots over 1.5 m", dots(1.5), 0.5 / 3.0, LEAST_DOT_PX),
    ]
}

/// A camera by its size and horizontal field of view.
fn camera(width_px: u32, height_px: u32, hfov_deg: f64) -> (Camera, f64) {
    let f = 0.5 * f64::from(width_px) / (0.5 * hfov_deg).to_radians().tan();
    let (cx_px, cy_px) = (0.5 * (f64::from(width_px) - 1.0), 0.5 * (f64::from(height_px) - 1.0));
    let matrix = CameraMatrix { fx_px: f, fy_px: f, cx_px, cy_px };
    (Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: Some(ImageSize { width_px, height_px }) }, f)
}

/// Two significant digits.
fn short(x: f64) -> String {
    let decimals = (1.0 - x.abs().max(1e-9).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{x:.decimals$}")
}

/// "1.2 mm, 0.14°", and the share of ambiguous answers where there are any; a dash where it does not fit or is too small to be found.
fn cell(target: &Target, camera: &Camera, distance_m: f64) -> String {
    let shape = Shape::of(target);
    let volume = Volume { distance_m: [distance_m; 2], tilt_rad: TILT_RAD, direction_rad: [-PI, PI] };
    let views = poses(&shape, camera, &volume, VIEWS);
    let o = outlook(&shape, &optics(camera), &views);
    let (Some(position_m), Some(rotation_rad)) = (o.position_m, o.rotation_rad) else {
        return "too near".into();
    };
    if VIEWS < 2 * o.n_out_of_view {
        return "too near".into();
    }
    let position = match 1e3 * position_m.median {
        mm if mm < 1000.0 => format!("{} mm", short(mm)),
        mm => format!("{} m", short(1e-3 * mm)),
    };
    let share = (100.0 * o.ambiguous).round();
    let ambiguous = if share < 1.0 { String::new() } else { format!("; {share} %") };
    format!("{position}, {}°{ambiguous}", short(rotation_rad.median.to_degrees()))
}

fn table(width_px: u32, height_px: u32, hfov_deg: f64) -> String {
    let (camera, f) = camera(width_px, height_px, hfov_deg);
    let mut text = format!("{width_px} × {height_px} px, {hfov_deg}° across:\n\n| target | found up to |");
    DISTANCES_M.iter().for_each(|d| write!(text, " {d} m |").unwrap());
    text += "\n| --- | ---: |";
    DISTANCES_M.iter().for_each(|_| text += " ---: |");
    for (name, target, feature_m, least_px) in targets() {
        // Tilted by 60° the feature is half as wide.
        let farthest_m = f * feature_m / least_px;
        write!(text, "\n| {name} | {} m |", short(farthest_m)).unwrap();
        for distance_m in DISTANCES_M {
            let said =
                if farthest_m < distance_m { "–".into() } else { cell(&target, &camera, distance_m) };
            write!(text, " {said} |").unwrap();
        }
    }
    text + "\n"
}

const BEGIN: &str = "<!-- the adviser's figures -->\n";
const END: &str = "<!-- end of the adviser's figures -->\n";

/// Somebody who changes the adviser, a target or a limit sees what it changes in the choice of a target.
#[test]
fn the_page_shows_the_advisers_figures() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/targets.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = page.split_once(BEGIN).unwrap();
    let (shown, after) = rest.split_once(END).unwrap();
    let made = [table(640, 480, 60.0), table(1920, 1080, 70.0), table(3840, 2160, 30.0)].join("\n");
    if std::env::var_os("RESIGHT_BLESS").is_some() {
        std::fs::write(&path, format!("{before}{BEGIN}{made}{END}{after}")).unwrap();
        return;
    }
    assert!(shown == made, "shown\n{shown}\nmade\n{made}");
}

/// The figures mean what they say: twice as far is about four times as uncertain in position, for a small target.
#[test]
fn uncertainty_grows_with_the_square_of_the_distance() {
    let (camera, _) = camera(1920, 1080, 70.0);
    let board = &targets()[4].1;
    let at = |distance_m: f64| {
        let volume = Volume { distance_m: [distance_m; 2], tilt_rad: TILT_RAD, direction_rad: [-PI, PI] };
        let shape = Shape::of(board);
        outlook(&shape, &optics(&camera), &poses(&shape, &camera, &volume, VIEWS)).position_m.unwrap().median
    };
    let ratio = at(2.0) / at(1.0);
    assert!((3.4..4.6).contains(&ratio), "{ratio}");
}
