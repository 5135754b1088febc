//! Counts equal observations once: a row that repeats an earlier point and pixel takes no part, but the answer counts the rows as given.

use super::NamedPoint;
use crate::answer::PoseAnswer;
use crate::report::words;
use resight_core::Correspondence;
use resight_core::correspondence::first_of_equals;
use resight_core::locate::consistency::Consistency;

/// Observations, some of which repeat others.
pub(super) struct Once {
    /// For each observation the index of the first one that is equal to it.
    first: Vec<usize>,
    /// Observations that repeat no earlier one.
    kept: Vec<usize>,
}

impl Once {
    /// Finds the repetitions; `None` where no observation repeats an earlier one.
    pub(super) fn of(seen: &[Correspondence]) -> Option<Self> {
        let first = first_of_equals(seen);
        let kept: Vec<usize> = (0..first.len()).filter(|i| first[*i] == *i).collect();
        (kept.len() < first.len()).then_some(Once { first, kept })
    }

    /// Converts the answer from the remaining observations to the indices of the given rows.
    pub(super) fn answered(
        &self,
        points: &[NamedPoint],
        answer: impl FnOnce(&[NamedPoint]) -> PoseAnswer,
    ) -> PoseAnswer {
        let once: Vec<NamedPoint> = self.kept.iter().map(|i| points[*i].clone()).collect();
        let mut answer = answer(&once);
        let n_repeated = self.first.len() - self.kept.len();
        answer.remarks.extend(words::repeated(n_repeated, self.first.len()));
        if let Some(agreement) = &mut answer.agreement {
            agreement.repeat_in_rows(&self.first, &self.kept);
        }
        let consistency = answer.estimate.as_mut().map(|e| &mut e.consistency);
        if let Some(Consistency::Inconsistent { worst_point, .. }) = consistency {
            // The indices of lines follow those of the points.
            *worst_point = self.kept.get(*worst_point).copied().unwrap_or(*worst_point + n_repeated);
        }
        let others = answer.names.split_off(self.kept.len().min(answer.names.len()));
        answer.names = points.iter().map(|point| point.name.clone()).chain(others).collect();
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::super::{NamedLine, PointsOptions, locate_lines_and_points, locate_points};
    use super::*;
    use nalgebra::Unit;
    use resight_core::camera::Pinhole;
    use resight_core::line::{ImageLine, LineCorrespondence};
    use resight_core::{Camera, CameraMatrix, Lens, Pixel, Point, Pose, Vector6};

    fn camera() -> Camera {
        let matrix = CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 640.0, cy_px: 480.0 };
        Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
    }

    /// Twelve points, each with its own small error.
    fn points() -> Vec<NamedPoint> {
        let pose = Pose::exp(&Vector6::new(0.2, -0.4, 0.1, 0.02, 0.03, 1.2));
        let point = |i: u32| {
            let x = Point::new(0.1 * f64::from(i % 4), 0.1 * f64::from(i / 4), 0.05 * f64::from(i % 3));
            let error = Pixel::new((12.9 * f64::from(i)).sin(), (78.2 * f64::from(i)).cos());
            let pixel = camera().project(&(pose * x)).expect("in front") + error * 0.3;
            let seen = Correspondence::new(&camera(), x, pixel, 0.3).expect("in the field");
            NamedPoint { name: format!("p{i}"), line: None, seen }
        };
        (0..12).map(point).collect()
    }

    fn solved(points: &[NamedPoint], robust_threshold_px: Option<f64>) -> PoseAnswer {
        let options = PointsOptions { robust_threshold_px, ..PointsOptions::default() };
        locate_points("view", points, &camera(), &options)
    }

    #[test]
    fn six_copies_of_every_row_change_nothing() {
        let once = points();
        let copies: Vec<NamedPoint> = (0..6).flat_map(|_| once.clone()).collect();
        for robust in [None, Some(3.0)] {
            let (a, b) = (solved(&once, robust), solved(&copies, robust));
            assert!(a.estimate.is_some() && a.estimate == b.estimate, "robust {robust:?}");
            assert_eq!((a.n_points, b.n_points, a.remarks.len()), (12, 12, 0));
            assert!(b.remarks[0].starts_with("60 of 72 rows repeat another"), "{:?}", b.remarks);
            let inliers = |answer: &PoseAnswer| answer.agreement.as_ref().map(|a| a.inliers.len());
            assert_eq!((inliers(&a), inliers(&b)), (robust.map(|_| 12), robust.map(|_| 72)));
        }
    }

    /// The same point at another pixel is a separate observation.
    #[test]
    fn other_pixels_of_a_point_count_in_full() {
        // Fewer than twelve points are used: from twelve on, equal errors of neighbours are treated as shared.
        let once = points()[..5].to_vec();
        let mut twice = once.clone();
        for mut point in once.clone() {
            point.seen.pixel.x += 1e-6;
            twice.push(point);
        }
        let (a, b) = (solved(&once, None), solved(&twice, None));
        assert_eq!((b.n_points, b.remarks.len()), (10, 0));
        let variance = |answer: &PoseAnswer| answer.estimate.expect("a pose").covariance[(5, 5)];
        let ratio = variance(&a) / variance(&b);
        assert!((ratio - 2.0).abs() < 0.2, "{ratio}");
    }

    #[test]
    fn the_worst_point_is_the_row_as_given() {
        let mut rows = points();
        rows[7].seen = Correspondence::new(
            &camera(),
            rows[7].seen.x_in_target,
            rows[7].seen.pixel + Pixel::new(40.0, 0.0),
            0.3,
        )
        .expect("in the field");
        rows.splice(0..0, rows[..2].to_vec());
        rows.insert(1, rows[0].clone());
        let answer = solved(&rows, None);
        let consistency = answer.estimate.expect("a pose").consistency;
        assert!(
            matches!(consistency, Consistency::Inconsistent { worst_point: 10, .. }),
            "{consistency:?}, {}",
            answer.verdict.message
        );
        assert_eq!((answer.names.len(), answer.names[10].as_str()), (15, "p7"));
        assert!(answer.verdict.message.contains("p7"), "{}", answer.verdict.message);
    }

    #[test]
    fn points_beside_lines_count_once_too() {
        let once = points();
        let copies: Vec<NamedPoint> = (0..3).flat_map(|_| once.clone()).collect();
        let line = |i: usize, k: usize| {
            let (from, to) = (&once[i].seen, &once[k].seen);
            let seen = ImageLine::new(&camera(), [from.pixel, to.pixel], 0.3).expect("two pixels");
            let direction_in_target = Unit::new_normalize(to.x_in_target - from.x_in_target);
            let seen =
                LineCorrespondence { point_in_target: Some(from.x_in_target), direction_in_target, seen };
            NamedLine { name: format!("{i}-{k}"), line: None, seen }
        };
        let lines = [line(0, 5), line(3, 10)];
        let solved = |points: &[NamedPoint]| {
            locate_lines_and_points("view", points, &lines, &camera(), &PointsOptions::default())
        };
        let (a, b) = (solved(&once), solved(&copies));
        assert!(a.estimate.is_some() && a.estimate == b.estimate, "{}", a.verdict.message);
        assert_eq!((a.names.len(), b.names.len(), b.remarks.len()), (14, 38, 1));
    }
}
