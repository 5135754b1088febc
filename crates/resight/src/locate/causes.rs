//! What would make points that contradict each other agree: columns exchanged, an axis upwards, two labels exchanged.
//!
//! Asked only where the answer is not to be believed. Each is solved whole, and named only where it brings the residual down to what noise explains.

use resight_core::locate::consistency::{Consistency, is_unlikely};
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::{Camera, Correspondence, Pixel, Point};
use schemars::JsonSchema;
use serde::Serialize;

/// What is probably wrong with the points of a view.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PointsCause {
    /// `uv_exchanged`, `v_upwards`, `xy_exchanged`, `axis_reversed` or `labels_exchanged`.
    cause: &'static str,
    /// χ² per degree of freedom once it is put right.
    chi2_per_degree_of_freedom: f64,
    /// The sentence: what is wrong, and what to do.
    pub message: String,
}

/// Pairs of labels tried among so many points; of more points the worst are tried.
const MOST_POINTS: usize = 12;
/// χ² must fall to this part: what fits a little better by chance is no cause.
const MOST_PART: f64 = 0.1;

/// The single cause that explains the contradiction, and those that explain it as well; the best first.
pub(super) fn causes(
    seen: &[Correspondence],
    camera: &Camera,
    config: &Config,
    found: &PoseEstimate,
    label: impl Fn(usize) -> String,
) -> Vec<PointsCause> {
    let Consistency::Inconsistent { worst_prior: None, .. } = found.consistency else { return Vec::new() };
    let mut tried = columns(seen, camera, config, found);
    if tried.is_empty() {
        tried = labels(seen, camera, config, found, label);
    }
    tried.sort_by(|a, b| a.chi2_per_degree_of_freedom.total_cmp(&b.chi2_per_degree_of_freedom));
    tried
}

/// χ² per degree of freedom of changed points, where noise explains it.
fn explained(
    seen: &[Correspondence],
    camera: &Camera,
    config: &Config,
    found: &PoseEstimate,
    changed: impl Fn(usize, &Correspondence) -> (Point, Pixel),
) -> Option<f64> {
    let changed = seen.iter().enumerate().map(|(i, c)| {
        let (x_in_target, pixel) = changed(i, c);
        Some(Correspondence { x_in_target, pixel, bearing: camera.bearing(&pixel).ok()?, ..*c })
    });
    let e = locate(&changed.collect::<Option<Vec<_>>>()?, camera, config).ok()?;
    let is_noise = 0 < e.degrees_of_freedom && !is_unlikely(e.chi2, e.degrees_of_freedom);
    (is_noise && e.chi2 < MOST_PART * found.chi2).then_some(e.chi2 / e.degrees_of_freedom as f64)
}

fn columns(
    seen: &[Correspondence],
    camera: &Camera,
    config: &Config,
    found: &PoseEstimate,
) -> Vec<PointsCause> {
    let last_row = camera.size.map(|size| f64::from(size.height_px) - 1.0);
    let explained = |changed: &dyn Fn(&Correspondence) -> Option<(Point, Pixel)>| {
        let all: Option<Vec<(Point, Pixel)>> = seen.iter().map(changed).collect();
        let all = all?;
        explained(seen, camera, config, found, |i, _| all[i])
    };
    let (x, p) = (|c: &Correspondence| c.x_in_target, |c: &Correspondence| c.pixel);
    let tried: [(&'static str, &str, Option<f64>); 4] = [
        (
            "uv_exchanged",
            "with u and v exchanged the points agree: u_px counts columns from the left, v_px rows from the top; exchange the two",
            explained(&|c| Some((x(c), Pixel::new(p(c).y, p(c).x)))),
        ),
        (
            "v_upwards",
            "with v counted from the bottom of the image the points agree: v_px counts rows from the top; subtract it from the height less one",
            explained(&|c| Some((x(c), Pixel::new(p(c).x, last_row? - p(c).y)))),
        ),
        (
            "xy_exchanged",
            "with x and y exchanged the points agree: exchange the columns x_m and y_m (northing and easting?)",
            explained(&|c| Some((Point::new(x(c).y, x(c).x, x(c).z), p(c)))),
        ),
        (
            "axis_reversed",
            "with one axis reversed the points agree: the coordinates are left-handed (Unity, Unreal, y downwards beside z upwards); change the sign of one of x_m, y_m, z_m",
            explained(&|c| Some((Point::new(x(c).x, -x(c).y, x(c).z), p(c)))),
        ),
    ];
    let cause = |(cause, message, chi2): (&'static str, &str, Option<f64>)| {
        Some(PointsCause { cause, chi2_per_degree_of_freedom: chi2?, message: message.to_string() })
    };
    tried.into_iter().filter_map(cause).collect()
}

/// Two points whose pixels are exchanged.
fn labels(
    seen: &[Correspondence],
    camera: &Camera,
    config: &Config,
    found: &PoseEstimate,
    label: impl Fn(usize) -> String,
) -> Vec<PointsCause> {
    let residual = |c: &Correspondence| {
        let predicted = camera.project(&(found.cam_from_target * c.x_in_target));
        predicted.map_or(f64::INFINITY, |predicted| (c.pixel - predicted).norm() / c.sigma_px)
    };
    let mut worst: Vec<(usize, f64)> = seen.iter().map(residual).enumerate().collect();
    worst.sort_by(|a, b| b.1.total_cmp(&a.1));
    let worst: Vec<usize> = worst.into_iter().take(MOST_POINTS).map(|(i, _)| i).collect();
    let pairs = worst.iter().enumerate().flat_map(|(n, i)| worst[n + 1..].iter().map(move |k| (*i, *k)));
    let cause = |(i, k): (usize, usize)| {
        let of = |n: usize| {
            if n == i {
                k
            } else if n == k {
                i
            } else {
                n
            }
        };
        let chi2 = explained(seen, camera, config, found, |n, c| (c.x_in_target, seen[of(n)].pixel))?;
        let (first, second) = (i.min(k), i.max(k));
        let message = format!(
            "{} and {} look exchanged: with each at the other's pixel the points agree",
            label(first),
            label(second)
        );
        Some(PointsCause { cause: "labels_exchanged", chi2_per_degree_of_freedom: chi2, message })
    };
    pairs.filter_map(cause).collect()
}
