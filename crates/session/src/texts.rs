//! Every sentence of the session, in one place.

use crate::cameras::of_model;
use crate::state::Distance;
use resight::core::camera::ImageSize;
use resight::image::exif::ExifCamera;
use resight::layout::Contradiction;

pub const NO_PHOTOGRAPH: &str = "Drop a photograph here, as PNG or JPEG.";
pub const NO_LENS: &str = "State the lens: a camera file, EXIF, its field of view, or \"I don't know\".";
pub const NO_MEASUREMENT: &str = "Click two points of the ground to measure a length.";
pub const NO_POSE_YET: &str = "It is measured as soon as the camera has a pose: finish the points first.";
pub const NOTHING_TO_UNDO: &str = "There is nothing to undo.";
pub const NOTHING_TO_REDO: &str = "There is nothing to redo.";
pub const NO_TAG: &str = "No tag of this family is in the photograph.";
pub const NOTHING_SAVED: &str = "This is no session that the page saved: it has no table [session].";
pub const REPORT: &str = "± of the pose and of measurements, and intervals, hold with 95 % probability; ± 1σ is one standard deviation. Pixels are those of the file: (0, 0) is the middle of the top-left one.";
pub const OPEN_LENS: &str = "estimated as soon as the marks determine it";

pub const COMMON_CAMERA: &str = "the focal length is that of the maker's main camera; a photograph that was zoomed or cropped has another";
pub const BY_LINES: &str =
    "the focal length is that at which the marked lines are parallel; distortion is taken as none";
const UNKNOWN_NEXT: &str = "The marks alone do not say how long the lens is. On this page, in this order: choose its camera from the list; or mark lines that are parallel in the scene, three upright and two along a wall or a road, or the horizon and two upright ones; or add a second photograph by the same camera, not zoomed, that shows the marks at more of a slant, let its focal length be estimated there, and take the lens of that photograph here; or give the field of view; or add a mark well off the plane of the others.";
pub const BY_PHOTOGRAPH: &str = "the focal length is that of another photograph; it holds where the same camera took both, without zooming or cropping";

/// What to do with a photograph whose EXIF does not say how long its lens is as of 35 mm film.
pub fn no_exif_lens(camera: Option<&ExifCamera>) -> String {
    let Some(camera) = camera else {
        return format!(
            "The photograph has no EXIF about its camera, which messengers and editors remove. Drop the original file, {OTHER_LENS}"
        );
    };
    let focal = camera.focal_mm.map_or_else(String::new, |mm| format!(" and {mm} mm"));
    let named = format!("The photograph's EXIF names {}{focal}, but not the size of its sensor", camera.name);
    match camera.model.as_deref().and_then(of_model) {
        Some(known) => format!(
            "{named}. The list has it: \"{}\", for photographs of the main camera, neither zoomed nor cropped; for others {OTHER_LENS}",
            known.name
        ),
        None => format!("{named}. Give the horizontal field of view of its data sheet, {OTHER_LENS}"),
    }
}

const OTHER_LENS: &str = "choose a similar camera from the list, mark lines that are parallel in the scene, or choose \"I don't know\".";

/// Why the marks do not determine the lens, and what does.
pub fn unknown_next(reason: &str) -> String {
    format!("{}. {UNKNOWN_NEXT}", reason.trim_end().trim_end_matches('.'))
}

pub fn lens_of(photograph: &str) -> String {
    format!("lens of {photograph}")
}

pub fn no_photograph_named(name: &str) -> String {
    format!("No photograph of this session is called {name}.")
}

pub fn no_lens_yet(photograph: &str) -> String {
    format!(
        "{photograph} has no lens yet: state it there, or place marks there until its focal length is estimated."
    )
}

pub fn borrowed_lens(photograph: &str) -> String {
    format!(
        "{photograph} takes its lens from another photograph; choose one whose lens is stated or estimated."
    )
}

pub fn other_size(name: &str, other: ImageSize, size: ImageSize) -> String {
    format!(
        "{name} has {} × {} px, this photograph {} × {} px: a lens holds for photographs of one size.",
        other.width_px, other.height_px, size.width_px, size.height_px
    )
}

pub fn no_common_camera(name: &str) -> String {
    format!(
        "No camera of the list is called {name}; take one of /api/session/cameras, or give a field of view."
    )
}

pub fn too_many_lines(seen: usize, most: usize) -> String {
    format!("{seen} lines were marked; {most} are the most that are taken, and six are enough.")
}

pub fn by_lines(focal_px: f64, sigma_px: f64) -> String {
    format!("by lines: {focal_px:.0} ± {sigma_px:.0} px")
}

pub fn several_cameras(file: &str, names: &[String]) -> String {
    format!(
        "{file} holds the cameras {}; write one after its name: {file}#{}",
        names.join(", "),
        names.first().map_or("", |n| n)
    )
}

pub fn scaled(from: ImageSize, to: ImageSize) -> String {
    format!(
        "the intrinsics are of images of {} × {} px and were scaled to {} × {} px, which is wrong where the photograph is a crop",
        from.width_px, from.height_px, to.width_px, to.height_px
    )
}

pub fn contradicting_distance(d: &Distance, c: &Contradiction) -> String {
    format!(
        "The distance {}–{} of {} m contradicts the others, which make it {:.3} m ({:.1} standard deviations): measure it again, or remove it.",
        d.a, d.b, d.distance_m, c.computed_m, c.sigmas
    )
}

pub fn points_missing(seen: usize, needed: usize) -> String {
    match needed - seen {
        1 => "Click one more point.".to_owned(),
        more => format!("Click {more} more points."),
    }
}

pub fn places_missing(names: &[&str]) -> String {
    format!(
        "Type the distances that give {} a place: two for each point, or one along a line.",
        names.join(", ")
    )
}

pub fn advice(now_m: f64, then_m: f64) -> String {
    let length = resight::report::words::length;
    format!(
        "A point here would make the camera's position ± {} instead of ± {}.",
        length(then_m),
        length(now_m)
    )
}

pub fn no_point(name: &str) -> String {
    format!("There is no point {name} in this photograph.")
}

pub fn not_inside(u_px: f64, v_px: f64, size: ImageSize) -> String {
    format!("({u_px:.1}, {v_px:.1}) is outside the photograph of {} × {} px.", size.width_px, size.height_px)
}

pub fn not_positive(what: &str, seen: f64, unit: &str) -> String {
    format!("{what} is {seen} {unit}; a positive number is needed.")
}

pub fn not_between(what: &str, seen: f64, [least, most]: [f64; 2], unit: &str) -> String {
    format!("{what} is {seen} {unit}; {least} to {most} {unit} are possible.")
}

pub fn too_many(what: &str, most: usize) -> String {
    format!("There are {most} {what} already, the most that a session holds; remove one first.")
}

pub fn too_large(bytes: usize, most: usize) -> String {
    let mb = |bytes: usize| bytes.div_ceil(1 << 20);
    format!(
        "The photographs of this session would have {} MB together; {} MB is the most that a session holds. Save this one with more compression, or begin a new session.",
        mb(bytes),
        mb(most)
    )
}

/// Title, one sentence and page of the book of each figure.
pub fn figure(name: &str) -> (&'static str, &'static str, &'static str) {
    match name {
        "height" => ("Height", "How far the camera is above the plane of the points.", "measuring.md"),
        "tilt" => ("Tilt", "How far the camera looks down below the plane's level.", "reading-the-answer.md"),
        "roll" => (
            "Roll",
            "How far the camera is rotated about its line of sight; clockwise is positive.",
            "reading-the-answer.md",
        ),
        "heading" => (
            "Heading",
            "Direction of view over the plane, anticlockwise from the x axis (the first two points).",
            "reading-the-answer.md",
        ),
        "distance" => (
            "Distance to the middle",
            "From the camera to what the middle of the image shows on the plane.",
            "measuring.md",
        ),
        "x" => (
            "Camera x",
            "The camera's position along the x axis, which runs from the first point to the second.",
            "reading-the-answer.md",
        ),
        _ => (
            "Camera y",
            "The camera's position along the y axis, in the plane and across x.",
            "reading-the-answer.md",
        ),
    }
}
