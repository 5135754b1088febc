//! The points that agree with a pose, where wrong points were searched for.

use crate::locate::NamedPoint;
use resight_core::locate::{self, PoseEstimate};
use resight_core::robust::{Config, Consensus, consensus};
use resight_core::{Camera, Correspondence, Error};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::HashMap;

/// What the search for the consensus came to.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Agreement {
    /// How far off a row may be, in the unit of u and v.
    threshold_px: f64,
    /// Samples of three points drawn.
    n_samples: usize,
    /// Probability that no larger consensus was missed.
    confidence: f64,
    /// log₁₀ of the expected number of poses that as many random rows would agree with.
    log10_false_alarms: f64,
    /// What χ² per degree of freedom is expected to be, the tail beyond the threshold missing.
    truncation: f64,
    /// Rows given.
    #[serde(skip)]
    n_rows: usize,
    /// Rows that agree, counted from 0.
    #[serde(skip)]
    pub inliers: Vec<usize>,
}

/// The share of the squared residuals that a threshold of two standard deviations leaves: docs/math/robust.md eq. (14).
const AT_TWO_SIGMA: f64 = 0.687;
/// What a smaller share says.
const BELOW_NOISE: &str = "; good points are thrown out too: the threshold is below two standard deviations of the stated noise, give three to five";

/// Largest number of rows named in the text; further ones are only counted.
const MAX_NAMED: usize = 5;

/// Finds the pose that most points agree with to within `threshold_px`. Four points of one name that form a square are the corners of one tag,
/// and agree all together or not at all.
pub(crate) fn locate_most(
    points: &[NamedPoint],
    seen: &[Correspondence],
    camera: &Camera,
    threshold_px: f64,
    locate: locate::Config,
) -> Result<(PoseEstimate, Agreement), Error> {
    let groups = groups(points);
    let config = Config { groups: groups.as_deref(), locate, ..Config::with_threshold_px(threshold_px) };
    let Consensus { estimate, inliers, n_samples, confidence, log10_false_alarms, truncation } =
        consensus(seen, camera, &config)?;
    let n_rows = points.len();
    let agreement =
        Agreement { threshold_px, n_samples, confidence, log10_false_alarms, truncation, n_rows, inliers };
    Ok((estimate, agreement))
}

impl Agreement {
    /// Converts row indices to those in `n_rows` rows, of which only `rows`, in their order, were searched.
    pub(crate) fn place_in_rows(&mut self, rows: &[usize], n_rows: usize) {
        self.inliers.iter_mut().for_each(|inlier| *inlier = rows[*inlier]);
        self.n_rows = n_rows;
    }

    /// Converts row indices to those in rows with repetitions: `first` holds for each row the first row that is equal to it, `kept` the rows
    /// that took part. A row that repeats an inlier is an inlier.
    pub(crate) fn repeat_in_rows(&mut self, first: &[usize], kept: &[usize]) {
        let agrees: Vec<usize> = self.inliers.iter().filter_map(|i| kept.get(*i).copied()).collect();
        self.inliers = (0..first.len()).filter(|row| agrees.binary_search(&first[*row]).is_ok()).collect();
        self.n_rows = first.len();
    }

    /// Returns one sentence: how many rows agree, and the first few that do not.
    pub fn sentence(&self, names: &[String], unit: &str) -> String {
        let is_in = |row: &usize| self.inliers.binary_search(row).is_ok();
        let out: Vec<usize> = (0..self.n_rows).filter(|row| !is_in(row)).collect();
        let agree = format!(
            "{} of {} points agree to within {} {unit} (confidence {:.4}, {} samples){}",
            self.inliers.len(),
            self.n_rows,
            self.threshold_px,
            self.confidence,
            self.n_samples,
            if self.truncation < AT_TWO_SIGMA { BELOW_NOISE } else { "" }
        );
        if out.is_empty() {
            return format!("{agree}; none was thrown out");
        }
        let named: Vec<&str> = out.iter().take(MAX_NAMED).map(|row| names[*row].as_str()).collect();
        let more = if MAX_NAMED < out.len() { ", …" } else { "" };
        format!("{agree}; {} thrown out: {}{more}", out.len(), named.join(", "))
    }
}

/// Returns a label for each point, one for all corners of a tag; `None` when no tag is among the points.
fn groups(points: &[NamedPoint]) -> Option<Vec<u32>> {
    let mut by_name: HashMap<&str, Vec<usize>> = HashMap::new();
    points.iter().enumerate().for_each(|(i, point)| by_name.entry(&point.name).or_default().push(i));
    let mut labels: Vec<u32> = (0..).take(points.len()).collect();
    let mut any = false;
    for members in by_name.values().filter(|members| is_square(points, members)) {
        members.iter().for_each(|i| labels[*i] = labels[members[0]]);
        any = true;
    }
    any.then_some(labels)
}

/// Checks for four corners of a square, in any order, to a hundredth of its edge: of the six distances four are equal, two are its diagonals.
fn is_square(points: &[NamedPoint], members: &[usize]) -> bool {
    let [a, b, c, d] = members[..] else { return false };
    let apart = |i: usize, j: usize| (points[i].seen.x_in_target - points[j].seen.x_in_target).norm();
    let mut distances = [apart(a, b), apart(b, c), apart(c, d), apart(d, a), apart(a, c), apart(b, d)];
    distances.sort_by(f64::total_cmp);
    let [edge, .., long] = distances;
    let near = |x: f64, wanted: f64| (x - wanted).abs() <= 0.01 * edge;
    let diagonal = edge * std::f64::consts::SQRT_2;
    0.0 < edge && near(distances[3], edge) && near(distances[4], diagonal) && near(long, diagonal)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, x: f64, y: f64) -> NamedPoint {
        let x_in_target = resight_core::Point::new(x, y, 0.5);
        let seen = Correspondence::new(&Camera::normalized(), x_in_target, resight_core::Pixel::zeros(), 1.0);
        NamedPoint { name: name.to_string(), line: None, seen: seen.expect("in the field") }
    }

    #[test]
    fn corners_of_a_square_are_one_group_and_other_duplicates_are_not() {
        let tag = [
            row("7", 0.0, 0.0),
            row("a", 5.0, 5.0),
            row("7", 0.1, 0.0),
            row("7", 0.1, 0.1),
            row("7", 0.0, 0.1),
        ];
        assert_eq!(groups(&tag), Some(vec![0, 1, 0, 0, 0]));
        assert_eq!(groups(&tag[..4]), None);
        let oblong = [row("7", 0.0, 0.0), row("7", 0.2, 0.0), row("7", 0.2, 0.1), row("7", 0.0, 0.1)];
        assert_eq!(groups(&oblong), None);
    }
}
