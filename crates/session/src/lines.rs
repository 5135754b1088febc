//! The curves drawn over the photograph, in its pixels.

use crate::pose::{Solved, bounds};
use crate::state::State;
use resight::core::Pixel;
use resight::overlay::ground::{GroundLines, ground_lines, prediction_ellipse};
use schemars::JsonSchema;
use serde::Serialize;

/// A curve of `[u_px, v_px]` points.
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

/// Largest distance between what is drawn and the curve, px.
const APART_PX: f64 = 0.05;

/// Curves in tenths of a pixel, without the points that a straight line passes closely enough.
fn curve(line: &[Pixel]) -> Curve {
    let tenth = |x: f64| (10.0 * x).round() / 10.0;
    bends(line).map(|p| [tenth(p.x), tenth(p.y)]).collect()
}

/// The ends of a line and the points between at which it turns: from each to the next it stays within `APART_PX` of the straight line.
fn bends(line: &[Pixel]) -> impl Iterator<Item = &Pixel> {
    let mut from = 0;
    std::iter::from_fn(move || {
        let kept = line.get(from)?;
        from += 1 + line.get(from + 1..).map_or(0, |next| straight(kept, next).saturating_sub(1));
        Some(kept)
    })
}

/// Returns the number of following points near a straight line that begins at `start` and ends at the last of them.
fn straight(start: &Pixel, points: &[Pixel]) -> usize {
    let Some(axis) = points.first().map(|first| (first - start).normalize()) else { return 0 };
    let (mut reach, mut least, mut most) = (APART_PX, f64::NEG_INFINITY, f64::INFINITY);
    for (i, point) in points.iter().enumerate() {
        let (along, aside) = (axis.dot(&(point - start)), axis.perp(&(point - start)));
        if !(reach <= along && least <= aside / along && aside / along <= most) {
            return i;
        }
        (reach, least, most) =
            (along, least.max((aside - APART_PX) / along), most.min((aside + APART_PX) / along));
    }
    points.len()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance of a point from a polyline.
    fn off(p: &Pixel, line: &[&Pixel]) -> f64 {
        let from = |w: &[&Pixel]| {
            let along = w[1] - w[0];
            let at = ((p - w[0]).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (p - (w[0] + along * at)).norm()
        };
        line.windows(2).map(from).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn what_is_left_out_lies_on_what_is_drawn() {
        let arc = |n: usize, radius: f64| -> Vec<Pixel> {
            (0..=n)
                .map(|i| i as f64 * 6.2 / n as f64)
                .map(|t| Pixel::new(radius * t.cos(), radius * t.sin()))
                .collect()
        };
        let straight: Vec<Pixel> =
            (0..40).map(|i| Pixel::new(3.0 * f64::from(i), 100.0 - 1.7 * f64::from(i))).collect();
        let there_and_back = [0.0, 5.0, 9.0, 4.0, 1.0].map(|x| Pixel::new(x, 0.0)).to_vec();
        let standing = vec![Pixel::new(1.0, 1.0); 3];
        for (line, most) in
            [(arc(200, 80.0), 120), (arc(64, 4.0), 30), (straight, 2), (there_and_back, 3), (standing, 3)]
        {
            let kept: Vec<&Pixel> = bends(&line).collect();
            assert!(kept.len() <= most, "{}", kept.len());
            assert_eq!([kept[0], kept[kept.len() - 1]], [&line[0], &line[line.len() - 1]]);
            for p in line.iter().filter(|p| !kept.contains(p)) {
                assert!(off(p, &kept) < APART_PX, "{p}");
            }
        }
        assert_eq!(bends(&[]).count(), 0);
        assert_eq!(bends(&[Pixel::new(1.0, 2.0)]).count(), 1);
    }
}
