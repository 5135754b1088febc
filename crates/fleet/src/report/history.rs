//! A camera's angles over the record.

use crate::assess::CameraVerdict;
use crate::words::utc;
use resight::report::html::escaped;
use std::fmt::Write;

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 190.0;
const LEFT: f64 = 58.0;
const TOP: f64 = 26.0;
const BOTTOM: f64 = 24.0;

/// Returns a figure; empty where there is nothing to draw.
pub(super) fn svg(camera: &CameraVerdict) -> String {
    let angles =
        || camera.history.iter().map(|(t_s, motion)| (*t_s, [0, 1, 2].map(|i| motion[i].to_degrees())));
    let (Some((begin, _)), Some((end, _))) = (camera.history.first(), camera.history.last()) else {
        return String::new();
    };
    let most = angles().flat_map(|(_, y)| y).fold(f64::MIN_POSITIVE, f64::max);
    let least = angles().flat_map(|(_, y)| y).fold(-f64::MIN_POSITIVE, f64::min);
    let span = (most - least).max(1e-6);
    let x = |t_s: f64| LEFT + (WIDTH - LEFT - 8.0) * (t_s - begin) / (end - begin).max(1.0);
    let y = |deg: f64| HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (deg - least) / span;
    let name = escaped(&camera.camera);
    let mut svg = format!(
        "<figure data-name=\"{name}\"><svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"angles of {name}\"><text x=\"{LEFT}\" y=\"16\" font-weight=\"600\">{name}</text>"
    );
    for level in [least, 0.0, most] {
        let (at, text) = (y(level), level_text(level, span));
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>",
            WIDTH - 8.0
        );
        let is_crowded = level != 0.0 && (y(0.0) - at).abs() < 12.0;
        if !is_crowded {
            let _ = write!(
                svg,
                "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
                LEFT - 5.0,
                at + 4.0
            );
        }
    }
    for (axis, class) in ["rx", "ry", "rz"].into_iter().enumerate() {
        let points: String =
            angles().map(|(t_s, deg)| format!("{:.1},{:.1} ", x(t_s), y(deg[axis]))).collect();
        let _ = write!(svg, "<polyline class=\"{class}\" points=\"{}\"/>", points.trim_end());
    }
    for motion in &camera.events {
        let at = x(motion.since_s).clamp(LEFT, WIDTH - 8.0);
        let bottom = HEIGHT - BOTTOM;
        let _ =
            write!(svg, "<line class=\"since\" x1=\"{at:.1}\" x2=\"{at:.1}\" y1=\"{TOP}\" y2=\"{bottom}\"/>");
    }
    for (t_s, anchor) in [(*begin, "start"), (*end, "end")] {
        let _ = write!(
            svg,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"{anchor}\">{}</text>",
            x(t_s),
            HEIGHT - 6.0,
            utc(t_s)
        );
    }
    svg + "</svg></figure>"
}

/// Returns a level with the digits that distinguish it from the others.
fn level_text(deg: f64, span: f64) -> String {
    let decimals = (1.5 - span.log10()).ceil().clamp(0.0, 7.0) as usize;
    if deg.abs() < 1e-12 { "0°".to_string() } else { format!("{deg:.decimals$}°") }
}
