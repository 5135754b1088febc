//! The data of the script, embedded in the page as JSON.

use super::Drawn;
use super::pieces::number;
use super::residuals::{self, Packed};
use crate::core::{Point, Pose};
use crate::scene::geometry;

/// Largest number of target poses for the script; with more, one in every few is taken, evenly.
const MOST_PLACED: usize = 6_000;

/// Returns a script element that holds data and never runs.
pub(super) fn json(drawn: &Drawn, packed: &Packed) -> String {
    let run = drawn.run;
    let cameras = list((0..run.rig.cameras.len()).map(|i| camera(drawn, packed, i)));
    let points = geometry::target_points(&run.rig);
    let targets = list(points.iter().enumerate().map(|(i, points)| target(&run.rig.targets[i].name, points)));
    let views = list(run.rig.views.iter().map(|name| text(name)));
    let one_in = drawn.targets.len().div_ceil(MOST_PLACED).max(1);
    let placed = list(
        drawn
            .targets
            .iter()
            .step_by(one_in)
            .map(|t| format!("{},{},{}", t.view, t.target, pose(&t.rig_from_target))),
    );
    let observations = list(packed.observations.iter().map(|[c, v, t, n]| format!("{c},{v},{t},{n}")));
    let extent = numbers(drawn.extent.centre.iter().copied().chain([drawn.extent.radius_m]), 6);
    format!(
        "<script type=\"application/json\" id=\"rig-data\">{{\"cameras\":{cameras},\"targets\":{targets},\"views\":{views},\"placed\":{placed},\
         \"placed_one_in\":{one_in},\"observations\":{observations},\"extent\":{extent},\"depth_m\":{},\
         \"ellipse_magnification\":{},\"residual_magnification\":{},\"residuals\":\"{}\"}}</script>",
        number(geometry::pyramid_depth_m(&drawn.extent), 6),
        drawn.ellipse_magnification,
        residuals::first_magnification(run),
        packed.base64,
    )
}

/// Writes a camera. Border and half axes have three numbers per point; half axes are those of the 95 % ellipsoid, metres, not magnified.
fn camera(drawn: &Drawn, packed: &Packed, camera: usize) -> String {
    let run = drawn.run;
    let placed = &run.solution.cameras[camera];
    let area = geometry::image_area(&run.rig, camera);
    let border = geometry::border_in_cam(&run.rig.lenses[camera], &area);
    let covariance = geometry::position_covariance(&placed.cam_from_rig, &placed.covariance);
    let axes = geometry::half_axes(&covariance, geometry::CHI2_3_95.sqrt());
    format!(
        "{{\"name\":{},\"rig_from_cam\":[{}],\"border\":{},\"axes\":{},\"area\":{},\"step\":{},\"unit\":{}}}",
        text(&run.rig.cameras[camera].name),
        pose(&placed.cam_from_rig.inverse()),
        numbers(border.iter().flat_map(|x| [x.x, x.y, x.z]), 4),
        numbers(axes.iter().copied(), 9),
        numbers([area.least.x, area.least.y, area.greatest.x, area.greatest.y], 6),
        packed.steps_px[camera],
        text(residuals::unit(run, camera)),
    )
}

fn target(name: &str, points: &[Point]) -> String {
    format!(
        "{{\"name\":{},\"points\":{},\"outline\":{}}}",
        text(name),
        numbers(points.iter().flat_map(|x| [x.x, x.y, x.z]), 5),
        list(geometry::outline(points).iter().map(usize::to_string))
    )
}

/// Writes a pose as seven numbers: w, x, y, z of the rotation, and the translation in metres.
fn pose(b_from_a: &Pose) -> String {
    let wxyz = b_from_a.quaternion_wxyz().map(|x| json_number(x, 5));
    let xyz = [0, 1, 2].map(|i| json_number(b_from_a.translation[i], 5));
    format!("{},{}", wxyz.join(","), xyz.join(","))
}

fn numbers(values: impl IntoIterator<Item = f64>, decimals: usize) -> String {
    list(values.into_iter().map(|x| json_number(x, decimals)))
}

/// Writes a number; JSON has no word for numbers that are not finite, and they cannot be drawn.
fn json_number(x: f64, decimals: usize) -> String {
    if x.is_finite() { number(x, decimals) } else { "0".into() }
}

fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(","))
}

/// Writes a JSON text that cannot end its element.
fn text(text: &str) -> String {
    let quoted = serde_json::Value::from(text).to_string();
    quoted
        .replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('&', "\\u0026")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029")
}

#[cfg(test)]
mod tests {
    /// The text is unchanged when read back, and contains nothing that HTML interprets.
    #[test]
    fn texts_survive_and_stay_texts() {
        let hostile = "</script><script>alert(\"1\")</script><!-- & \u{2028} \\ 'é";
        let quoted = super::text(hostile);
        assert!(!quoted.contains(['<', '>', '&']));
        assert_eq!(serde_json::from_str::<String>(&quoted).unwrap(), hostile);
    }
}
