//! Two plans, from above and from behind, with the cameras' 95 % ellipses.

use super::Drawn;
use super::pieces::{color_class, number, path};
use crate::core::{Matrix6, Point, Pose};
use crate::report::words;
use crate::scene::geometry;
use nalgebra::Matrix2;

const SIDE: f64 = 420.0;
const MARGIN: f64 = 30.0;

/// The axes of the rig that point to the right and up in the drawing, the latter with its sign, and the name of the view.
#[derive(Clone, Copy)]
struct Plane {
    across: usize,
    up: usize,
    sign: f64,
    name: &'static str,
    axes: &'static str,
}

const ABOVE: Plane =
    Plane { across: 0, up: 2, sign: 1.0, name: "From above", axes: "x to the right, z (forward) up" };
const BEHIND: Plane =
    Plane { across: 0, up: 1, sign: -1.0, name: "From behind", axes: "x to the right, y down" };

pub(super) fn figure(drawn: &Drawn) -> String {
    format!("<div class=\"row\">{}{}</div>", plan(drawn, ABOVE), plan(drawn, BEHIND))
}

impl Plane {
    /// Returns the drawing coordinates of a point; y points down in drawings.
    fn place(&self, drawn: &Drawn, x: &Point) -> [f64; 2] {
        let (d, scale) = (x - drawn.extent.centre, self.scale(drawn));
        [SIDE / 2.0 + d[self.across] * scale, SIDE / 2.0 - self.sign * d[self.up] * scale]
    }

    /// Returns the drawing units per metre.
    fn scale(&self, drawn: &Drawn) -> f64 {
        (SIDE / 2.0 - MARGIN) / drawn.extent.radius_m
    }

    /// Returns the part of a covariance in this plane, second axis down.
    fn covariance(&self, cam_from_rig: &Pose, covariance: &Matrix6) -> Matrix2<f64> {
        let all = geometry::position_covariance(cam_from_rig, covariance);
        let crossed = -self.sign * all[(self.across, self.up)];
        Matrix2::new(all[(self.across, self.across)], crossed, crossed, all[(self.up, self.up)])
    }
}

fn plan(drawn: &Drawn, plane: Plane) -> String {
    let dots: String =
        drawn.targets.iter().map(|t| dot(drawn, plane, &t.rig_from_target.translation)).collect();
    let cameras: String = (0..drawn.run.rig.cameras.len()).map(|i| camera(drawn, plane, i)).collect();
    let bar_m = geometry::magnification(1.0, drawn.extent.radius_m / 2.0);
    let bar = bar_m * plane.scale(drawn);
    let caption = format!(
        "{} ({}); ellipses hold 95 % of each place in this plane, magnified {}\u{a0}×; grey: origins of the targets",
        plane.name,
        plane.axes,
        number(drawn.ellipse_magnification, 6)
    );
    format!(
        "<figure><svg class=\"plan\" viewBox=\"0 0 {SIDE} {SIDE}\" role=\"img\" aria-label=\"{caption}\"><path class=\"dots\" d=\"{dots}\"/>{cameras}\
         <path class=\"bar-line\" d=\"M12 {y}h{}\"/><text x=\"12\" y=\"{}\">{}</text></svg><figcaption>{caption}</figcaption></figure>",
        number(bar, 1),
        SIDE - 18.0,
        words::length(bar_m),
        y = SIDE - 12.0,
    )
}

/// Draws a dot as a line of zero length with round ends.
fn dot(drawn: &Drawn, plane: Plane, x_in_rig: &Point) -> String {
    let [x, y] = plane.place(drawn, x_in_rig);
    let is_inside = (0.0..=SIDE).contains(&x) && (0.0..=SIDE).contains(&y);
    if is_inside { format!("M{} {}h0", number(x, 1), number(y, 1)) } else { String::new() }
}

/// Draws the field of view as a wedge, the ellipse, and the name.
fn camera(drawn: &Drawn, plane: Plane, camera: usize) -> String {
    let placed = &drawn.run.solution.cameras[camera];
    let rig_from_cam = placed.cam_from_rig.inverse();
    let depth = geometry::pyramid_depth_m(&drawn.extent);
    let area = geometry::image_area(&drawn.run.rig, camera);
    let border = geometry::border_in_cam(&drawn.run.rig.lenses[camera], &area);
    let corners = border.iter().step_by((border.len() / 4).max(1));
    let place = plane.place(drawn, &rig_from_cam.translation);
    let wedge: String =
        corners.map(|x| path(&[place, plane.place(drawn, &(rig_from_cam * (x * depth)))], false)).collect();
    let scale = geometry::CHI2_2_95.sqrt() * drawn.ellipse_magnification * plane.scale(drawn);
    let (long, short, direction_rad) =
        geometry::ellipse(&plane.covariance(&placed.cam_from_rig, &placed.covariance), scale);
    let [x, y] = place.map(|x| number(x, 1));
    format!(
        "<g class=\"{}\"><path d=\"{wedge}\"/><ellipse cx=\"{x}\" cy=\"{y}\" rx=\"{}\" ry=\"{}\" transform=\"rotate({} {x} {y})\"/>{}</g>",
        color_class(camera),
        number(long.max(1.5), 1),
        number(short.max(1.5), 1),
        number(direction_rad.to_degrees(), 1),
        label(place, &drawn.camera_name(camera))
    )
}

/// Writes a name beside a position, on the side where there is room.
fn label([x, y]: [f64; 2], name: &str) -> String {
    let (side, anchor) = if x < 0.75 * SIDE { (7.0, "start") } else { (-7.0, "end") };
    let [x, y] = [number(x + side, 1), number(y - 7.0, 1)];
    format!("<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{name}</text>")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Vector6;

    /// A position that is uncertain along one line of the rig only has an ellipse along the drawing of that line.
    #[test]
    fn ellipses_lie_along_what_is_uncertain() {
        let cam_from_rig = Pose::exp(&Vector6::new(0.3, -0.7, 0.2, 0.1, 0.5, -0.4));
        for direction in [Point::new(1.0, 0.4, 0.7), Point::new(-0.3, 0.9, 0.2)] {
            let in_cam = cam_from_rig.rotation * direction;
            let mut covariance = Matrix6::zeros();
            covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&(in_cam * in_cam.transpose()));
            for plane in [ABOVE, BEHIND] {
                let (long, short, along_rad) =
                    geometry::ellipse(&plane.covariance(&cam_from_rig, &covariance), 1.0);
                // In drawings y points down: `up` is drawn as −sign.
                let drawn = [direction[plane.across], -plane.sign * direction[plane.up]];
                let crossed = drawn[0] * along_rad.sin() - drawn[1] * along_rad.cos();
                assert!(crossed.abs() < 1e-9 && short < 1e-6, "{crossed} {short}");
                assert!((long - drawn[0].hypot(drawn[1])).abs() < 1e-9);
            }
        }
    }
}
