//! A calibration file in sentences: what maps to what, in which unit, where each camera stands and looks.

use super::document::{Document, Fault};
use super::lens::{self, LensNumbers};
use super::read::{contents_of, not_a_camera, target_of};
use super::scene::{towards, xyz};
use super::table::{camera_format, target_format};
use super::{ClockOffset, Contents, Format, NamedCamera, Placement, open};
use crate::FileError;
use crate::core::camera::ImageSize;
use crate::core::target::{MapTag, PrintedScale};
use crate::core::{Camera, Lens, Pixel, Point, Target};
use nalgebra::Vector3;
use std::path::Path;

/// Says in sentences what a camera or target file holds: format, models and numbers with units, field of view, valid
/// field, which frame maps to which, camera centres and viewing directions, and how files of this shape are commonly
/// misread.
///
/// Errors as `read_cameras`; files that hold poses without intrinsics are explained too.
pub fn explain(path: impl AsRef<Path>) -> Result<String, FileError> {
    let path = path.as_ref();
    let document = open::read(path)?;
    explain_document(&document).map_err(|fault| fault.in_file(path))
}

/// As `explain`, from bytes in memory; `path` serves names and messages only.
pub fn explain_from_bytes(path: impl AsRef<Path>, bytes: Vec<u8>) -> Result<String, FileError> {
    let path = path.as_ref();
    let document = open::parse(path, bytes).map_err(|fault| fault.in_file(path))?;
    explain_document(&document).map_err(|fault| fault.in_file(path))
}

/// What is unusual about a camera or target file that can be read, in sentences, as `explain` lists them under its warnings.
pub fn remarks(path: impl AsRef<Path>) -> Vec<String> {
    let path = path.as_ref();
    let Ok(document) = open::read(path) else { return Vec::new() };
    match camera_format(&document) {
        Some((format, reads)) => contents_of(&document, reads)
            .map(|contents| contents.into_file(format.format).warnings)
            .unwrap_or_default(),
        None => {
            target_of(&document, &super::TagOptions::default()).map(|file| file.warnings).unwrap_or_default()
        }
    }
}

fn explain_document(document: &Document) -> Result<String, Fault> {
    if let Some((format, reads)) = camera_format(document) {
        let contents = contents_of(document, reads)?;
        let text =
            cameras_text(document, format.format.name(), &contents) + &sketch(format.format, &contents);
        let remarks = [&contents.notes[..], &owned(format.traps)[..]].concat();
        return Ok(text
            + &bullets("Often misread:", &remarks)
            + &bullets("Warnings:", &contents.into_file(format.format).warnings));
    }
    let Some(format) = target_format(document) else { return Err(not_a_camera(document)) };
    let file = target_of(document, &super::TagOptions::default())?;
    let head = format!("{}: {}.\n\n", document.path.display(), format.format.name());
    let body = target_text(&file.target);
    Ok(head
        + &body
        + &bullets("Often misread:", &owned(format.traps))
        + &bullets("Warnings:", &file.warnings))
}

/// Where several cameras stand and look, seen together.
fn sketch(format: Format, contents: &Contents) -> String {
    let placed = contents.cameras.iter().filter(|c| c.placement.is_some()).count();
    let scene = super::scene(&contents.clone().into_file(format), None);
    match scene {
        Ok(scene) if 1 < contents.cameras.len() && 0 < placed => format!("\n{}", scene.text()),
        _ => String::new(),
    }
}

fn owned(texts: &[&str]) -> Vec<String> {
    texts.iter().map(|t| (*t).to_owned()).collect()
}

fn bullets(title: &str, lines: &[String]) -> String {
    if lines.is_empty() {
        return String::new();
    }
    let body: String = lines.iter().map(|line| format!("  - {line}\n")).collect();
    format!("\n{title}\n{body}")
}

fn cameras_text(document: &Document, format: &str, contents: &Contents) -> String {
    let n = contents.cameras.len();
    let count = match n {
        0 => "no intrinsics, poses only".to_owned(),
        1 => "one camera".to_owned(),
        n => format!("{n} cameras"),
    };
    let head = format!(
        "{}: {format}, {count}.\nCamera frames: x right, y down, z forward. Pixel (0, 0) is the centre of \
            the top-left pixel. Lengths in metres.\n",
        document.path.display()
    );
    let cameras: String = contents.cameras.iter().map(camera_text).collect();
    let relations: String =
        contents.relations.iter().map(|p| format!("\n{}", placement_text(p, None))).collect();
    let clocks: String = contents.clocks.iter().map(clock_text).collect();
    head + &cameras + &relations + &clocks
}

fn clock_text(clock: &ClockOffset) -> String {
    let (camera, reference, ms) = (&clock.camera, &clock.reference, 1e3 * clock.offset_s);
    format!("\nClock: time of `{reference}` = time stamp of {camera} + {ms:.3} ms.\n")
}

fn camera_text(named: &NamedCamera) -> String {
    let camera = &named.camera;
    let mut out = format!("\n{}\n  Lens: {}\n", named.name, lens_text(camera));
    match camera.size {
        Some(size) => {
            out +=
                &format!("  Images: {} × {} px. {}\n", size.width_px, size.height_px, view_text(camera, size))
        }
        None if camera.matrix().is_some() => out += "  Images: the file states no size.\n",
        None => out += "  Image coordinates are in the unit of f.\n",
    }
    out += &format!("  Valid field: {}\n", valid_text(camera));
    match &named.placement {
        Some(placement) => out += &placement_text(placement, Some(&named.name)),
        None => out += "  The file does not say where it is.\n",
    }
    out
}

fn lens_text(camera: &Camera) -> String {
    if let Lens::Photogrammetric(model) = &camera.lens {
        let t = model.table();
        return format!(
            "photogrammetric: f = {}, principal point ({}, {}), k = {:?}, p = {:?}, a = {:?}, lengths in \
                one unit of the caller's choice; the camera frame is the paper's W.",
            t.f, t.xp, t.yp, t.k, t.p, t.a
        );
    }
    let Ok((k, numbers)) = lens::numbers_of(camera) else { return camera.model_name().to_owned() };
    format!(
        "{}, fx = {} px, fy = {} px, principal point ({}, {}) px.",
        model_text(&numbers),
        short(k.fx_px),
        short(k.fy_px),
        short(k.cx_px),
        short(k.cy_px)
    )
}

fn short(x: f64) -> String {
    let fixed = format!("{x:.3}");
    fixed.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn model_text(numbers: &LensNumbers) -> String {
    let named = |names: &[&str], values: &[f64]| {
        names.iter().zip(values).map(|(n, v)| format!("{n} = {v}")).collect::<Vec<_>>().join(", ")
    };
    let brown = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "τx", "τy"];
    match numbers {
        LensNumbers::Pinhole => "pinhole without distortion".into(),
        LensNumbers::BrownConrady(d) => format!(
            "pinhole with Brown–Conrady distortion of {} coefficients ({})",
            d.len(),
            named(&brown, d)
        ),
        LensNumbers::KannalaBrandt(k) => format!(
            "fisheye (Kannala–Brandt; OpenCV fisheye, Kalibr equidistant; {})",
            named(&["k1", "k2", "k3", "k4"], k)
        ),
        LensNumbers::Omni { xi, k1k2p1p2 } => {
            format!("omnidirectional (Mei; xi = {xi}, {})", named(&brown, k1k2p1p2))
        }
        LensNumbers::Eucm { alpha, beta } => format!("enhanced unified (alpha = {alpha}, beta = {beta})"),
        LensNumbers::DoubleSphere { xi, alpha } => format!("double sphere (xi = {xi}, alpha = {alpha})"),
        LensNumbers::Fov { w_rad } => format!("field-of-view model (w = {w_rad} rad)"),
        LensNumbers::Photogrammetric(_) => "photogrammetric".into(),
    }
}

/// Angles off the axis add up on both sides, so that views beyond 180° come out right.
fn view_text(camera: &Camera, size: ImageSize) -> String {
    let Some(k) = camera.matrix() else { return String::new() };
    let (right, bottom) = (size.width_px as f64 - 0.5, size.height_px as f64 - 0.5);
    let off_axis =
        |u: f64, v: f64| camera.bearing(&Pixel::new(u, v)).ok().map(|b| b.angle(&Vector3::z()).to_degrees());
    let across = |a: (f64, f64), b: (f64, f64)| Some(off_axis(a.0, a.1)? + off_axis(b.0, b.1)?);
    let spans = [
        ("across", across((-0.5, k.cy_px), (right, k.cy_px))),
        ("down", across((k.cx_px, -0.5), (k.cx_px, bottom))),
        ("corner to corner", across((-0.5, -0.5), (right, bottom))),
    ];
    let said: Vec<String> =
        spans.iter().filter_map(|(name, x)| x.map(|x| format!("{x:.1}° {name}"))).collect();
    if said.is_empty() { String::new() } else { format!("Field of view: {}.", said.join(", ")) }
}

fn valid_text(camera: &Camera) -> String {
    let angle = valid_angle_rad(camera).to_degrees();
    let limit = format!("the model is one-to-one up to {angle:.1}° off the axis");
    let Some(size) = camera.size else { return format!("{limit}.") };
    let (right, bottom) = (size.width_px as f64 - 0.5, size.height_px as f64 - 0.5);
    let corners = [(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom)];
    match corners.iter().find_map(|(u, v)| camera.bearing(&Pixel::new(*u, *v)).err()) {
        None => format!("{limit}; the whole image is inside."),
        Some(e) => format!("{limit}; not the whole image: {e}."),
    }
}

/// Largest angle off the axis at which the model still has a pixel, in the worst of eight directions.
fn valid_angle_rad(camera: &Camera) -> f64 {
    let sees = |angle: f64, around: f64| {
        let (s, c) = angle.sin_cos();
        camera.project(&Point::new(s * around.cos(), s * around.sin(), c)).is_some()
    };
    let limit = |around: f64| {
        let (mut inside, mut outside) = (0.0, std::f64::consts::PI);
        for _ in 0..40 {
            let middle = 0.5 * (inside + outside);
            if sees(middle, around) { inside = middle } else { outside = middle }
        }
        inside
    };
    (0..8).map(|i| limit(i as f64 * std::f64::consts::FRAC_PI_4)).fold(f64::INFINITY, f64::min)
}

fn placement_text(p: &Placement, camera: Option<&str>) -> String {
    let (a, b) = (&p.a, &p.b);
    let t = xyz(&p.b_from_a.translation);
    let q = p.b_from_a.quaternion_wxyz().map(|x| format!("{x:.6}")).join(", ");
    let turn = p.b_from_a.angle_to_rad(&crate::core::Pose::identity()).to_degrees();
    let maps = format!(
        "  x_{b} = R x_{a} + t: it maps points of frame `{a}` into frame `{b}`; t = {t} m, R turns by \
            {turn:.3}°, quaternion (w, x, y, z) = ({q}).\n"
    );
    let (name, frame, centre, axis) = if camera == Some(a.as_str()) {
        (a, b, p.b_from_a.translation, p.b_from_a.rotation * Vector3::z())
    } else {
        (b, a, p.b_from_a.origin(), p.b_from_a.rotation.tr_mul(&Vector3::z()))
    };
    let away = centre.norm();
    maps + &format!(
        "  Centre of {name} in frame `{frame}`: {} m ({away:.4} m from its origin); it looks along {}, {}.\n",
        xyz(&centre),
        xyz(&axis),
        towards(&axis)
    )
}

fn target_text(target: &Target) -> String {
    let kind = target.kind();
    let points: Vec<Point> =
        target.features().into_iter().filter_map(|f| target.point(f)).map(|known| known.position).collect();
    let extent = |i: usize| {
        let (low, high) =
            points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[i]), h.max(p[i])));
        1000.0 * (high - low)
    };
    let (w, h, d) = (extent(0), extent(1), extent(2));
    let size =
        if d == 0.0 { format!("{w:.1} × {h:.1} mm") } else { format!("{w:.1} × {h:.1} × {d:.1} mm") };
    let printed = target.printed_scale().map_or_else(String::new, printed_text);
    format!(
        "Target of kind `{kind}`: {} known points over {size}.\n{}\n{printed}",
        points.len(),
        describe(target.design())
    )
}

/// What the print does to the lengths above, which are those of the design.
fn printed_text(scale: &PrintedScale) -> String {
    let percent =
        |i: usize| format!("{:+.3} % ± {:.3} %", 100.0 * (scale.ratio[i] - 1.0), 100.0 * scale.sigma[i]);
    format!(
        "The lengths in the line above are designed; the print was measured and is longer by {} along x and {} along y (1σ). Points are placed \
            as printed, and poses carry the standard deviation.\n",
        percent(0),
        percent(1)
    )
}

fn describe(target: &Target) -> String {
    let flat = "Frame: x right, y down, z into the surface, seen upright from the front";
    match target {
        Target::LinePlusOne(t) => format!(
            "Three points on the line at {:?} m, the fourth at {:?} m (along, across). Frame: x along the \
                line, y towards the fourth point when that is positive, z = 0 plane.",
            t.line_m, t.off_m
        ),
        Target::Tag(t) => format!(
            "{} id {}, outer edge of the black square {:.1} mm. {flat}; origin at the centre.",
            t.family,
            t.id,
            1000.0 * t.size_m
        ),
        Target::TagMap(t) => format!(
            "{} tags of {}; each world_from_tag maps its frame (x right, y down, z into the surface) into \
                the map's world. {}",
            t.tags.len(),
            t.family,
            tolerance_text(&t.tags)
        ),
        Target::Points(points) => format!("{} named points in the surveyor's frame.", points.len()),
        board => describe_board(board, flat),
    }
}

/// How well the tags of a map are where it says.
fn tolerance_text(tags: &[MapTag]) -> String {
    let range = |of: &dyn Fn(&MapTag) -> f64| {
        tags.iter().map(of).fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)))
    };
    let (m, rad) = (range(&|tag| tag.sigma_m), range(&|tag| tag.sigma_rad));
    if m.1 == 0.0 && rad.1 == 0.0 {
        return "Each tag counts as exactly there (sigma_m states a tolerance).".into();
    }
    let words = |(low, high): (f64, f64), digits: usize| {
        if low == high {
            format!("±{low:.digits$}")
        } else {
            format!("±{low:.digits$} to ±{high:.digits$}")
        }
    };
    format!(
        "Each tag is there to {} mm along each axis and {}° about each (1σ); its four corners share the error.",
        words((1e3 * m.0, 1e3 * m.1), 1),
        words((rad.0.to_degrees(), rad.1.to_degrees()), 2)
    )
}

fn describe_board(target: &Target, flat: &str) -> String {
    match target {
        Target::AprilGrid(t) => format!(
            "{} rows × {} columns of {} tags, edge {:.1} mm, gap {:.1} mm (ratio {}), ids from {}. Frame: \
                Kalibr's, origin at the bottom-left tag, x right, y up, z towards the viewer.",
            t.rows,
            t.columns,
            t.family,
            1000.0 * t.tag_size_m,
            1000.0 * t.tag_size_m * t.tag_spacing_ratio,
            t.tag_spacing_ratio,
            t.first_id
        ),
        Target::Chessboard(t) => format!(
            "{} × {} inner corners, squares of {:.1} mm. {flat}; origin at corner 0.",
            t.rows,
            t.columns,
            1000.0 * t.square_m
        ),
        Target::Charuco(t) => format!(
            "{} rows × {} columns of squares of {:.1} mm, markers of {:.1} mm from {}{}. {flat}; origin \
                at the board's top-left outer corner.",
            t.rows,
            t.columns,
            1000.0 * t.square_m,
            1000.0 * t.marker_m,
            t.dictionary,
            if t.legacy_pattern { ", pattern of OpenCV before 4.6" } else { "" }
        ),
        Target::CircleGrid(t) => {
            let rows = if t.asymmetric {
                format!(
                    "of circles {:.1} mm apart, every second row shifted by {:.1} mm",
                    2000.0 * t.spacing_m,
                    1000.0 * t.spacing_m
                )
            } else {
                format!("of circles {:.1} mm apart", 1000.0 * t.spacing_m)
            };
            let diameter = t
                .diameter_m
                .map_or_else(String::new, |diameter_m| format!(", diameter {:.1} mm", 1000.0 * diameter_m));
            format!(
                "{} rows × {} columns {rows}, rows {:.1} mm apart{diameter}. {flat}; origin at the centre of circle 0.",
                t.rows,
                t.columns,
                1000.0 * t.spacing_m
            )
        }
        other => format!("A target of kind {}.", other.kind()),
    }
}
