//! The three-dimensional view: cameras, targets and the cameras' error ellipsoids, drawn once for readers without scripts.

use super::Drawn;
use super::pieces::{Viewpoint, color_class, number};
use crate::core::{Point, Pose};
use crate::report::html::escaped;
use crate::scene::geometry;
use nalgebra::Matrix3;

const SIZE: [f64; 2] = [960.0, 560.0];
/// Largest number of targets drawn; more would only cover each other.
const MOST_TARGETS: usize = 60;
/// Number of corners of an ellipse drawn as a line.
const ROUND: usize = 32;
/// The view is from behind the right side of the cameras, which is also where `view.js` starts.
const YAW_RAD: f64 = 0.6;
const PITCH_RAD: f64 = 0.45;
/// Distance of the viewer in radii of the scene, and the part of the image's half height that the radius fills: ellipsoids, which stand out of
/// it by a sixth at most, fit too.
const DISTANCE: f64 = 3.2;
const FILLED: f64 = 0.8;

pub(super) fn viewpoint(drawn: &Drawn) -> Viewpoint {
    Viewpoint {
        yaw_rad: YAW_RAD,
        pitch_rad: PITCH_RAD,
        centre: drawn.extent.centre,
        distance_m: DISTANCE * drawn.extent.radius_m,
        focal: FILLED * DISTANCE * SIZE[1] / 2.0,
        middle: [SIZE[0] / 2.0, SIZE[1] / 2.0],
    }
}

pub(super) fn figure(drawn: &Drawn) -> String {
    let eye = viewpoint(drawn);
    let targets = targets(drawn, &eye);
    let n = drawn.run.rig.cameras.len();
    let cameras: String = (0..n).map(|camera| pyramid(drawn, &eye, camera)).collect();
    let ellipsoids: String = (0..n).map(|camera| ellipsoid(drawn, &eye, camera)).collect();
    let caption = caption(drawn);
    format!(
        "<figure class=\"space\">{}<svg id=\"space-still\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{caption}\">\
         <g class=\"target\">{targets}</g>{ellipsoids}{cameras}{}</svg>\
         <canvas id=\"space\" tabindex=\"0\" role=\"application\" hidden aria-label=\"the rig in space: drag or arrow keys turn, plus and minus come nearer and go away\"></canvas>\
         <figcaption>{caption}<span data-script hidden>. Drag, one finger or arrow keys turn; wheel (after a click), two fingers or + and − come nearer and go \
         away; right button, two fingers or shift and arrow keys shift; 0 starts over.</span></figcaption></figure>",
        choices(),
        SIZE[0],
        SIZE[1],
        axes(drawn, &eye),
    )
}

fn choices() -> String {
    let boxes = [
        ("targets", "targets"),
        ("sights", "lines of sight"),
        ("ellipsoids", "ellipsoids"),
        ("names", "names"),
    ];
    let boxes: String = boxes
        .iter()
        .map(|(id, label)| {
            let checked = if *id == "sights" { "" } else { " checked" };
            format!("<label><input type=\"checkbox\" id=\"show-{id}\"{checked}> {label}</label>")
        })
        .collect();
    let turns: String =
        [("start", "start"), ("top", "from above"), ("front", "from behind"), ("side", "from the side")]
            .iter()
            .map(|(id, label)| format!("<button type=\"button\" data-turn=\"{id}\">{label}</button>"))
            .collect();
    format!("<div class=\"bar inline\" data-script hidden>{turns}{boxes}</div>")
}

fn caption(drawn: &Drawn) -> String {
    let (n_placed, n_drawn) = (drawn.targets.len(), drawn.targets.len().div_ceil(one_in(drawn)));
    let drawn_of =
        if n_drawn < n_placed { format!(" ({n_drawn} of them in the still image)") } else { String::new() };
    format!(
        "{} cameras and {n_placed} placed targets{drawn_of}; ellipsoids hold 95 % of each place, magnified {}\u{a0}×; axes of the rig are {} long \
         (x red, y green, z blue)",
        drawn.run.rig.cameras.len(),
        number(drawn.ellipse_magnification, 6),
        crate::report::words::length(geometry::pyramid_depth_m(&drawn.extent)),
    )
}

fn one_in(drawn: &Drawn) -> usize {
    drawn.targets.len().div_ceil(MOST_TARGETS).max(1)
}

fn targets(drawn: &Drawn, eye: &Viewpoint) -> String {
    let points = geometry::target_points(&drawn.run.rig);
    let shown = drawn.targets.iter().step_by(one_in(drawn));
    let outline = |t: &geometry::TargetInView| {
        let points = &points[t.target];
        let corners = geometry::outline(points);
        let (corners, is_closed) =
            if corners.is_empty() { ((0..points.len()).collect(), false) } else { (corners, true) };
        eye.path(corners.into_iter().map(|i| t.rig_from_target * points[i]), is_closed)
    };
    let paths: String = shown.map(outline).collect();
    format!("<path d=\"{paths}\"/>")
}

/// Draws the border of the image at a chosen depth, lines from the centre to its corners, and the name.
fn pyramid(drawn: &Drawn, eye: &Viewpoint, camera: usize) -> String {
    let rig_from_cam = drawn.run.solution.cameras[camera].cam_from_rig.inverse();
    let depth = geometry::pyramid_depth_m(&drawn.extent);
    let area = geometry::image_area(&drawn.run.rig, camera);
    let border: Vec<Point> = geometry::border_in_cam(&drawn.run.rig.lenses[camera], &area)
        .iter()
        .map(|x| rig_from_cam * (x * depth))
        .collect();
    let corners = border.iter().step_by((border.len() / 4).max(1));
    let edges: String = corners.map(|x| eye.path([rig_from_cam.translation, *x], false)).collect();
    let label = eye.project(&rig_from_cam.translation).map_or(String::new(), |[x, y]| {
        format!(
            "<text x=\"{}\" y=\"{}\">{}</text>",
            number(x + 6.0, 1),
            number(y - 6.0, 1),
            drawn.camera_name(camera)
        )
    });
    format!("<g class=\"{}\"><path d=\"{}{edges}\"/>{label}</g>", color_class(camera), eye.path(border, true))
}

/// Draws the three principal ellipses of an ellipsoid, magnified.
fn ellipsoid(drawn: &Drawn, eye: &Viewpoint, camera: usize) -> String {
    let placed = &drawn.run.solution.cameras[camera];
    let covariance = geometry::position_covariance(&placed.cam_from_rig, &placed.covariance);
    let axes = geometry::half_axes(&covariance, geometry::CHI2_3_95.sqrt() * drawn.ellipse_magnification);
    let centre = placed.cam_from_rig.origin();
    let rings: String =
        [(0, 1), (0, 2), (1, 2)].map(|(i, j)| eye.path(ring(&centre, &axes, i, j), true)).concat();
    format!("<path class=\"ellipsoid {}\" d=\"{rings}\"/>", color_class(camera))
}

fn ring(centre: &Point, axes: &Matrix3<f64>, i: usize, j: usize) -> impl Iterator<Item = Point> {
    (0..ROUND).map(move |k| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / ROUND as f64).sin_cos();
        centre + axes.column(i) * cos + axes.column(j) * sin
    })
}

fn axes(drawn: &Drawn, eye: &Viewpoint) -> String {
    let length = geometry::pyramid_depth_m(&drawn.extent);
    let rig = Pose::identity().translation;
    let axis = |(class, direction): (&str, Point)| {
        format!("<path class=\"{class}\" d=\"{}\"/>", eye.path([rig, rig + direction * length], false))
    };
    [("x", Point::x()), ("y", Point::y()), ("z", Point::z())].map(axis).concat() + &name_of_reference(drawn)
}

/// Returns the text of the drawing for screen readers.
fn name_of_reference(drawn: &Drawn) -> String {
    let reference = drawn.run.rig.cameras.get(drawn.run.solution.reference);
    reference.map_or(String::new(), |c| format!("<desc>Frame of the rig: {}</desc>", escaped(&c.name)))
}
