//! What is drawn over the photograph, in its pixels.

use crate::pose::{Solved, bounds};
use crate::state::State;
use resight::core::Pixel;
use resight::overlay::ground::{GroundLines, ground_lines, prediction_ellipse};
use schemars::JsonSchema;
use serde::Serialize;

/// A curve: `[u_px, v_px]` each.
pub type Curve = Vec<[f64; 2]>;

/// One axis of the frame.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct AxisLine {
    /// `x`, `y` or `z`.
    pub name: &'static str,
    /// From the origin.
    pub points: Curve,
}

/// Curves of the photograph; each went through the lens.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Overlay {
    /// Lines of the plane z = 0.
    pub grid: Vec<Curve>,
    /// From one to the next, metres.
    pub grid_spacing_m: f64,
    /// The axes.
    pub axes: Vec<AxisLine>,
    /// The grid as the second pose has it.
    pub ghost: Option<Vec<Curve>>,
    /// 95 % ellipses of where the pose puts each point.
    pub ellipses: Vec<Curve>,
    /// Where the plane ends at infinity.
    pub horizon: Vec<Curve>,
}

/// Curves in tenths of a pixel.
fn curve(line: &[Pixel]) -> Curve {
    let tenth = |x: f64| (10.0 * x).round() / 10.0;
    line.iter().map(|p| [tenth(p.x), tenth(p.y)]).collect()
}

fn curves(lines: &[Vec<Pixel>]) -> Vec<Curve> {
    lines.iter().map(|line| curve(line)).collect()
}

/// Everything drawn of a pose.
pub fn overlay(state: &State, solved: &Solved) -> Overlay {
    let (least, greatest) = bounds(&solved.points);
    let lines = |pose| ground_lines(&solved.camera, pose, (&least, &greatest));
    let GroundLines { grid, spacing_m, axes, horizon } = lines(&solved.cam_from_world);
    let ellipse = |p: &resight::locate::NamedPoint| {
        prediction_ellipse(&solved.camera, &solved.cam_from_world, &p.seen.x_in_target, &solved.covariance)
    };
    let axes = axes.iter().map(|(name, line)| AxisLine { name, points: curve(line) });
    Overlay {
        grid: if state.show_grid { curves(&grid) } else { Vec::new() },
        grid_spacing_m: spacing_m,
        axes: if state.show_axes { axes.collect() } else { Vec::new() },
        ghost: solved.other_cam_from_world.as_ref().map(|pose| curves(&lines(pose).grid)),
        ellipses: solved.points.iter().filter_map(ellipse).map(|line| curve(&line)).collect(),
        horizon: curves(&horizon),
    }
}
