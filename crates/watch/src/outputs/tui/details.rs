//! The view of the last frame of the selected camera.

use super::panel;
use super::picture::Picture;
use super::table::ms;
use crate::board::pair::PairBoard;
use crate::live::Observation;
use nalgebra::{Matrix6, Vector3};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Color;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use resight::core::locate::PoseEstimate;
use resight::core::locate::choose::Ambiguity;
use resight::core::locate::consistency::Consistency;
use resight::core::temporal::track::Tracked;

/// Draws the view; what does not fit is cut.
pub fn draw(frame: &mut Frame<'_>, area: Rect, picture: &Picture<'_>) {
    let Some(pair) = picture.board.pairs.get(picture.view.chosen) else { return };
    let mut lines = panel::words(picture, area.width);
    let mut rows = Rows::new();
    if let Some(last) = &pair.last {
        rows.push(of_frame(last));
        rows.extend(last.estimate.iter().flat_map(of_estimate));
        rows.extend(last.tracked.iter().map(of_track));
    }
    rows.push(counts(pair));
    if let Some(estimate) = pair.last.as_ref().and_then(|last| last.estimate.as_ref()) {
        rows.extend(correlations(&estimate.covariance));
    }
    let line = |(name, text): (&str, String)| {
        let name = Span::styled(format!("{name:<13}"), picture.color(Color::DarkGray));
        Line::from(vec![name, Span::raw(text)])
    };
    lines.extend(rows.into_iter().map(line));
    frame.render_widget(Paragraph::new(lines), area);
}

type Rows = Vec<(&'static str, String)>;

fn of_frame(last: &Observation) -> (&'static str, String) {
    let times = &last.times;
    let total_us = times.waited_us + times.detect_us + times.solve_us + times.decide_us;
    let taken = format!("{} (number {}) at {:.3} s", last.name, last.number, last.capture_s);
    ("frame", format!("{taken}: {} points, {} ms", last.n_points, ms(total_us)))
}

fn of_estimate(estimate: &PoseEstimate) -> Rows {
    let sigma = estimate.covariance.diagonal().map(f64::sqrt);
    let pose = &estimate.cam_from_target;
    let turn = Vector3::from(pose.log().fixed_rows::<3>(0)).map(f64::to_degrees);
    let residual = match estimate.consistency {
        Consistency::Consistent => "agrees with the stated noise",
        Consistency::Inconsistent { .. } => "contradicts the stated noise",
    };
    let only_if = if 1 < estimate.n_alternatives() { ", if this pose is the right one" } else { "" };
    vec![
        ("camera at", format!("{} mm in the target's frame", three(&(pose.origin() * 1e3), 2))),
        (
            "  ±",
            format!("{} mm along the camera's x, y, z{only_if}", three(&(sigma.fixed_rows::<3>(3) * 1e3), 3)),
        ),
        ("rotated by", format!("{}° (rotation vector, camera from target)", three(&turn, 3))),
        (
            "  ±",
            format!(
                "{}° about the camera's x, y, z{only_if}",
                three(&sigma.fixed_rows::<3>(0).map(f64::to_degrees), 4)
            ),
        ),
        ("ambiguity", ambiguity(estimate)),
        ("residual", format!("{:.3} px rms, {residual}", estimate.rms_px)),
    ]
}

fn ambiguity(estimate: &PoseEstimate) -> String {
    let percent = 100.0 * estimate.probability;
    match estimate.ambiguity {
        Ambiguity::Unique { ratio: None } => format!("one pose fits ({percent:.1} %)"),
        Ambiguity::Unique { ratio: Some(ratio) } if 1000.0 < ratio => {
            format!("one pose fits ({percent:.1} %); the next has over 1000 times the error")
        }
        Ambiguity::Unique { ratio: Some(ratio) } => {
            format!("one pose fits ({percent:.1} %); the next has {ratio:.1} times the error")
        }
        Ambiguity::Ambiguous { ratio, .. } => {
            format!(
                "two poses fit ({percent:.1} % this one, the more probable); the other has {ratio:.2} times the error"
            )
        }
    }
}

fn of_track(tracked: &Tracked) -> (&'static str, String) {
    let taken = match tracked.innovation_chi2 {
        Some(chi2) => format!("χ² {chi2:.1} of 6 from where it was expected"),
        None => "the last frame was an outlier".to_string(),
    };
    ("through time", format!("{:.1} % this pose; {taken}", 100.0 * tracked.probability))
}

fn counts(pair: &PairBoard) -> (&'static str, String) {
    let last = match &pair.last_reason {
        Some((name, reason)) => format!("; last without, {name}: {reason}"),
        None => String::new(),
    };
    ("frames", format!("{}, {} with a pose{last}", pair.frames, pair.poses))
}

/// Returns the correlations of the covariance, rotations first.
fn correlations(covariance: &Matrix6<f64>) -> Rows {
    const NAMES: [&str; 6] = ["rot. x", "rot. y", "rot. z", "shift x", "shift y", "shift z"];
    let sigma = covariance.diagonal().map(f64::sqrt);
    let of_row = |row: usize| {
        let number =
            |column: usize| format!("{:>7.2}", covariance[(row, column)] / (sigma[row] * sigma[column]));
        let numbers: String = (0..=row).map(number).collect();
        (if row == 0 { "correlations" } else { "" }, format!("{:<8}{numbers}", NAMES[row]))
    };
    (0..6).map(of_row).collect()
}

fn three(v: &Vector3<f64>, decimals: usize) -> String {
    format!("{:.decimals$} {:.decimals$} {:.decimals$}", v.x, v.y, v.z)
}
