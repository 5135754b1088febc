//! Finds the likely cause where points contradict each other: exchanged columns, an axis reversed, labels off by a row or exchanged, intrinsics of
//! another resolution, another focal length.
//!
//! This is tried only where the answer cannot be relied on. Each cause is corrected and the view solved again, and it is named only where noise
//! explains the remaining residual.

use crate::minimum::golden_section;
use resight_core::camera::ImageSize;
use resight_core::locate::consistency::{Consistency, is_unlikely};
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::{Camera, Correspondence, Error as MathError, Pixel, Point};
use schemars::JsonSchema;
use serde::Serialize;

/// A likely fault of the points of a view.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PointsCause {
    /// `uv_exchanged`, `v_upwards`, `u_leftwards`, `xy_exchanged`, `axis_reversed`, `labels_shifted`, `labels_exchanged`, `other_resolution` or
    /// `other_focal_length`.
    cause: &'static str,
    /// χ² per degree of freedom once the fault is corrected.
    chi2_per_degree_of_freedom: f64,
    /// The correction that makes the points agree.
    message: String,
}

/// Number of points of which pairs of labels are tried: the worst ones.
const MOST_LABELS: usize = 12;
/// With more points, two exchanged labels are found by `--robust`.
const MOST_POINTS: usize = 200;
/// χ² must fall to this share: a correction that fits slightly better by chance is not a cause.
const MOST_PART: f64 = 0.1;
/// Image sizes over those of the intrinsics, as fractions, that are tried.
const RESOLUTIONS: [[u32; 2]; 10] =
    [[1, 4], [1, 3], [1, 2], [2, 3], [3, 4], [4, 3], [3, 2], [2, 1], [3, 1], [4, 1]];
/// With more points the focal length is not tried: it takes more than fifty solutions.
const MOST_SCANNED: usize = 10_000;
/// Largest factor of the focal length that is tried, and steps up to it.
const FOCAL_RANGE: f64 = 3.0;
const FOCAL_STEPS: f64 = 12.0;
/// Steps of the refinement, which leave a millionth of the range.
const SECTIONS: usize = 29;
/// Largest number of causes named in the sentence.
const MOST_NAMED: usize = 4;

/// Returns the causes that explain a contradiction, the best first; none where the points agree, or where the priors contradict them.
pub(super) fn causes(
    solved: Result<&PoseEstimate, &MathError>,
    seen: &[Correspondence],
    camera: &Camera,
    config: &Config,
    label: impl Fn(usize) -> String,
) -> Vec<PointsCause> {
    let pose = match solved {
        Ok(e) if matches!(e.consistency, Consistency::Inconsistent { worst_prior: None, .. }) => Some(e),
        Err(MathError::NoSolution { .. } | MathError::NotConverged { .. }) => None,
        _ => return Vec::new(),
    };
    let contradiction = Contradiction { seen, camera, config, pose };
    let mut causes = contradiction.columns();
    if causes.is_empty() {
        causes = contradiction.shifted();
    }
    if causes.is_empty() {
        causes = contradiction.labels(label);
    }
    if causes.is_empty() {
        causes.extend(contradiction.resolution().or_else(|| contradiction.focal_length()));
    }
    causes.sort_by(|a, b| a.chi2_per_degree_of_freedom.total_cmp(&b.chi2_per_degree_of_freedom));
    causes
}

/// A view whose points contradict each other.
struct Contradiction<'a> {
    seen: &'a [Correspondence],
    camera: &'a Camera,
    config: &'a Config<'a>,
    /// The pose that fits best; `None` where no pose was found.
    pose: Option<&'a PoseEstimate>,
}

impl Contradiction<'_> {
    /// Returns χ² per degree of freedom of changed points, where noise explains it.
    fn explained(&self, changed: impl Fn(usize, &Correspondence) -> Option<(Point, Pixel)>) -> Option<f64> {
        let change = |(i, c): (usize, &Correspondence)| {
            let (x_in_target, pixel) = changed(i, c)?;
            Some(Correspondence { x_in_target, pixel, bearing: self.camera.bearing(&pixel).ok()?, ..*c })
        };
        let changed: Option<Vec<Correspondence>> = self.seen.iter().enumerate().map(change).collect();
        let e = locate(&changed?, self.camera, self.config).ok()?;
        self.is_explained(e.chi2, e.degrees_of_freedom)
    }

    /// Returns χ² per degree of freedom, where it is noise and far below that of the points as stated.
    fn is_explained(&self, chi2: f64, degrees_of_freedom: usize) -> Option<f64> {
        let is_noise = 0 < degrees_of_freedom && !is_unlikely(chi2, degrees_of_freedom);
        let is_much_better = self.pose.is_none_or(|found| chi2 < MOST_PART * found.chi2);
        (is_noise && is_much_better).then_some(chi2 / degrees_of_freedom as f64)
    }

    /// Solves the same pixels with another camera.
    fn seen_by(&self, camera: &Camera) -> Option<PoseEstimate> {
        let seen: Option<Vec<Correspondence>> = self
            .seen
            .iter()
            .map(|c| Some(Correspondence { bearing: camera.bearing(&c.pixel).ok()?, ..*c }))
            .collect();
        locate(&seen?, camera, self.config).ok()
    }

    /// Tries intrinsics that were stated for images of another size than those that the pixels are of.
    fn resolution(&self) -> Option<PointsCause> {
        let size = self.camera.size?;
        let tried = RESOLUTIONS.iter().filter_map(|[times, over]| {
            let scaled = |side: u32| side.is_multiple_of(*over).then(|| (side / over).checked_mul(*times))?;
            let (width_px, height_px) = (scaled(size.width_px)?, scaled(size.height_px)?);
            let found = self.seen_by(&self.camera.scaled_to(width_px, height_px).ok()?)?;
            Some((self.is_explained(found.chi2, found.degrees_of_freedom)?, width_px, height_px))
        });
        let (chi2_per_degree_of_freedom, w, h) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let ImageSize { width_px, height_px } = size;
        let message = format!(
            "with pixels of images of {w} × {h} px, for which the intrinsics, stated for {width_px} × {height_px} px, are scaled"
        );
        Some(PointsCause { cause: "other_resolution", chi2_per_degree_of_freedom, message })
    }

    /// Tries other focal lengths, the rest of the lens as stated.
    fn focal_length(&self) -> Option<PointsCause> {
        let stated = self.camera.size.and(self.camera.matrix())?;
        if MOST_SCANNED < self.seen.len() {
            return None;
        }
        let fit = |factor: f64| {
            let mut values = self.camera.parameters().iter().map(|(_, value)| *value).collect::<Vec<_>>();
            values[..2].iter_mut().for_each(|f| *f *= factor);
            self.seen_by(&self.camera.with_parameters(&values).ok()?)
        };
        let chi2 = |log_factor: f64| fit(log_factor.exp()).map_or(f64::INFINITY, |found| found.chi2);
        let step = FOCAL_RANGE.ln() / FOCAL_STEPS;
        let steps = (-(FOCAL_STEPS as i32)..=FOCAL_STEPS as i32).map(|k| step * f64::from(k));
        let nearest = steps.map(|at| (chi2(at), at)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let best = golden_section(nearest.1, step, SECTIONS, chi2).1.exp();
        let found = fit(best)?;
        let chi2_per_degree_of_freedom =
            self.is_explained(found.chi2, found.degrees_of_freedom.saturating_sub(1))?;
        let message = format!(
            "with a focal length of {:.0} px instead of {:.0} px (another lens or zoom, or images of another size?)",
            best * stated.fx_px,
            stated.fx_px
        );
        Some(PointsCause { cause: "other_focal_length", chi2_per_degree_of_freedom, message })
    }

    fn columns(&self) -> Vec<PointsCause> {
        let last_row = self.camera.size.map(|size| f64::from(size.height_px) - 1.0);
        let last_column = self.camera.size.map(|size| f64::from(size.width_px) - 1.0);
        type Changed<'f> = &'f dyn Fn(&Correspondence) -> Option<(Point, Pixel)>;
        let tried: [(&'static str, &str, Changed); 5] = [
            (
                "uv_exchanged",
                "with u and v exchanged (u_px counts columns from the left, v_px rows from the top)",
                &|c| Some((c.x_in_target, Pixel::new(c.pixel.y, c.pixel.x))),
            ),
            (
                "v_upwards",
                "with v counted from the bottom of the image (v_px counts rows from the top: height − 1 − v)",
                &|c| Some((c.x_in_target, Pixel::new(c.pixel.x, last_row? - c.pixel.y))),
            ),
            (
                "u_leftwards",
                "with u counted from the right, as in a mirrored image (u_px counts columns from the left: width − 1 − u)",
                &|c| Some((c.x_in_target, Pixel::new(last_column? - c.pixel.x, c.pixel.y))),
            ),
            ("xy_exchanged", "with two axes exchanged (northing and easting? y and z?)", &|c| {
                Some((Point::new(c.x_in_target.y, c.x_in_target.x, c.x_in_target.z), c.pixel))
            }),
            (
                "axis_reversed",
                "with the sign of one axis changed (left-handed coordinates, as of Unity and Unreal?)",
                &|c| Some((Point::new(c.x_in_target.x, -c.x_in_target.y, c.x_in_target.z), c.pixel)),
            ),
        ];
        let cause = |(cause, message, changed): (&'static str, &str, Changed)| {
            let chi2_per_degree_of_freedom = self.explained(|_, c| changed(c))?;
            Some(PointsCause { cause, chi2_per_degree_of_freedom, message: message.to_string() })
        };
        tried.into_iter().filter_map(cause).collect()
    }

    /// Tries the pixels of the next or the last row, as where cells of a spreadsheet slipped; the row at the end has none, and is left out.
    fn shifted(&self) -> Vec<PointsCause> {
        let n = self.seen.len();
        if MOST_POINTS < n {
            return Vec::new();
        }
        let cause = |(which, of_point, of_pixel): (&str, usize, usize)| {
            let pairs = self.seen.iter().skip(of_point).zip(self.seen.iter().skip(of_pixel));
            let slipped: Vec<Correspondence> = pairs
                .map(|(point, pixel)| Correspondence { x_in_target: point.x_in_target, ..*pixel })
                .collect();
            let e = locate(&slipped, self.camera, self.config).ok()?;
            let chi2_per_degree_of_freedom = self.is_explained(e.chi2, e.degrees_of_freedom)?;
            let message = format!("with each pixel moved to the row {which} it");
            Some(PointsCause { cause: "labels_shifted", chi2_per_degree_of_freedom, message })
        };
        [("above", 0, 1), ("below", 1, 0)].into_iter().filter_map(cause).collect()
    }

    /// Tries to exchange the pixels of two points.
    fn labels(&self, label: impl Fn(usize) -> String) -> Vec<PointsCause> {
        if MOST_POINTS < self.seen.len() {
            return Vec::new();
        }
        let worst = self.worst();
        let pairs = worst.iter().enumerate().flat_map(|(n, i)| worst[n + 1..].iter().map(move |k| (*i, *k)));
        let cause = |(i, k): (usize, usize)| {
            let pixel_of = |n: usize| match n {
                _ if n == i => k,
                _ if n == k => i,
                _ => n,
            };
            let chi2_per_degree_of_freedom =
                self.explained(|n, c| Some((c.x_in_target, self.seen[pixel_of(n)].pixel)))?;
            let message = format!("with the pixels of {} and {} exchanged", label(i.min(k)), label(i.max(k)));
            Some(PointsCause { cause: "labels_exchanged", chi2_per_degree_of_freedom, message })
        };
        pairs.filter_map(cause).collect()
    }

    /// Returns the indices of the points with the largest residuals.
    fn worst(&self) -> Vec<usize> {
        let residual = |c: &Correspondence| {
            let predicted = self.pose.and_then(|e| self.camera.project(&(e.cam_from_target * c.x_in_target)));
            predicted.map_or(f64::INFINITY, |predicted| (c.pixel - predicted).norm() / c.sigma_px)
        };
        let mut worst: Vec<(usize, f64)> = self.seen.iter().map(residual).enumerate().collect();
        worst.sort_by(|a, b| b.1.total_cmp(&a.1));
        worst.into_iter().take(MOST_LABELS).map(|(i, _)| i).collect()
    }
}

/// Returns what is outside the image that the intrinsics are stated for; none where all points are inside, or where no size is stated.
pub(super) fn outside(
    seen: &[Correspondence],
    camera: &Camera,
    label: impl Fn(usize) -> String,
) -> Option<String> {
    let ImageSize { width_px, height_px } = camera.size?;
    let out: Vec<usize> = (0..seen.len()).filter(|i| !camera.contains(&seen[*i].pixel)).collect();
    let first = seen[*out.first()?].pixel;
    let more = match out.len() - 1 {
        0 => "lies".to_owned(),
        1 => "and 1 more lie".to_owned(),
        n => format!("and {n} more lie"),
    };
    Some(format!(
        "{} at ({:.1}, {:.1}) px {more} outside the {width_px} × {height_px} px of the camera's images",
        label(out[0]),
        first.x,
        first.y
    ))
}

/// Returns the sentence about the causes; `None` without causes.
pub(super) fn sentence(causes: &[PointsCause]) -> Option<String> {
    let named: Vec<&str> = causes.iter().take(MOST_NAMED).map(|cause| cause.message.as_str()).collect();
    let which = match &named[..] {
        [] => return None,
        [one] => one.to_string(),
        [first @ .., last] => format!("{}, or {last}, which fits as well", first.join(", ")),
    };
    Some(format!("the points agree {which}: correct them and solve again"))
}

#[cfg(test)]
mod tests {
    use super::super::{NamedPoint, PointsOptions, locate_points};
    use crate::answer::{PoseAnswer, Status};
    use resight_core::camera::{ImageSize, Pinhole};
    use resight_core::{Camera, CameraMatrix, Correspondence, Pixel, Point, Pose, Vector6};

    /// A camera whose principal point is off the middle, so that a mirrored image differs from mirrored points.
    fn camera(f_px: f64) -> Camera {
        let matrix = CameraMatrix { fx_px: f_px, fy_px: f_px, cx_px: 655.0, cy_px: 441.0 };
        let size = ImageSize { width_px: 1280, height_px: 960 };
        Camera::new(Pinhole { matrix }, Some(size)).expect("a camera")
    }

    /// Ten points in space with errors of a third of a pixel.
    fn points() -> Vec<(Point, Pixel)> {
        let pose = Pose::exp(&Vector6::new(0.2, -0.3, 0.1, -0.4, -0.3, 4.0));
        let point = |i: u32| {
            let angle = 2.399 * f64::from(i);
            let x =
                Point::new(angle.cos(), 0.7 * angle.sin(), 0.6 * (1.7 * angle).sin()) + Point::repeat(0.3);
            let error = Pixel::new((12.9 * f64::from(i)).sin(), (78.2 * f64::from(i)).cos()) * 0.3;
            (x, camera(900.0).project(&(pose * x)).expect("in front") + error)
        };
        (0..10).map(point).collect()
    }

    fn solved(points: &[(Point, Pixel)], camera: &Camera) -> PoseAnswer {
        let named = |(i, (x, pixel)): (usize, &(Point, Pixel))| {
            let seen = Correspondence::new(camera, *x, *pixel, 0.3).expect("in the field");
            NamedPoint { name: i.to_string(), line: None, seen }
        };
        let points: Vec<NamedPoint> = points.iter().enumerate().map(named).collect();
        locate_points("view", &points, camera, &PointsOptions::default())
    }

    fn causes(points: &[(Point, Pixel)]) -> (Vec<&'static str>, String) {
        let answer = solved(points, &camera(900.0));
        assert_ne!(answer.status(), Status::Ok, "{}", answer.verdict.message);
        (answer.causes.iter().map(|cause| cause.cause).collect(), answer.verdict.message)
    }

    fn changed(change: impl Fn(Point, Pixel) -> (Point, Pixel)) -> Vec<(Point, Pixel)> {
        points().into_iter().map(|(x, p)| change(x, p)).collect()
    }

    #[test]
    fn exchanged_columns_and_axes_are_named() {
        let (found, message) = causes(&changed(|x, p| (x, Pixel::new(p.y, p.x))));
        assert_eq!(found, ["uv_exchanged"], "{message}");
        assert!(message.starts_with("the points agree with u and v exchanged"), "{message}");
        let (found, message) = causes(&changed(|x, p| (x, Pixel::new(p.x, 959.0 - p.y))));
        assert_eq!(found, ["v_upwards"], "{message}");
        let (found, message) = causes(&changed(|x, p| (x, Pixel::new(1279.0 - p.x, p.y))));
        assert_eq!(found, ["u_leftwards"], "{message}");
        // Exchanged axes and a reversed one differ by a rotation, which no image determines: both are named.
        for points in
            [changed(|x, p| (Point::new(x.y, x.x, x.z), p)), changed(|x, p| (Point::new(x.x, x.y, -x.z), p))]
        {
            let (mut found, message) = causes(&points);
            found.sort_unstable();
            assert_eq!(found, ["axis_reversed", "xy_exchanged"], "{message}");
            assert!(message.contains("which fits as well"), "{message}");
        }
    }

    /// All pixels a row too low, the first row's being that of the last point, or of no point at all.
    #[test]
    fn pixels_that_slipped_by_a_row_are_named() {
        let shifted = |by: usize| {
            let of = points();
            (0..of.len()).map(|i| (of[i].0, of[(i + by) % of.len()].1)).collect::<Vec<_>>()
        };
        let mut without = shifted(9);
        without[0].1 = Pixel::new(30.0, 900.0);
        for (points, way) in [(shifted(9), "above"), (without, "above"), (shifted(1), "below")] {
            let (found, message) = causes(&points);
            assert_eq!(found, ["labels_shifted"], "{message}");
            assert!(message.contains(&format!("with each pixel moved to the row {way} it")), "{message}");
        }
    }

    #[test]
    fn two_exchanged_labels_are_named() {
        let mut exchanged = points();
        (exchanged[2].1, exchanged[7].1) = (exchanged[7].1, exchanged[2].1);
        let (found, message) = causes(&exchanged);
        assert_eq!(found, ["labels_exchanged"]);
        assert!(message.contains("the pixels of point 2 and point 7 exchanged"), "{message}");
    }

    /// Intrinsics of another resolution and another focal length are named with the right number.
    #[test]
    fn another_resolution_and_focal_length_are_named() {
        let half = camera(900.0).scaled_to(640, 480).expect("half");
        let answer = solved(&points(), &half);
        assert_eq!((answer.status(), answer.causes[0].cause), (Status::Inconsistent, "other_resolution"));
        assert!(answer.verdict.message.contains("of 1280 × 960 px"), "{}", answer.verdict.message);
        assert!(answer.verdict.message.contains("outside the 640 × 480 px"), "{}", answer.verdict.message);
        let answer = solved(&points(), &camera(1300.0));
        assert_eq!((answer.status(), answer.causes[0].cause), (Status::Inconsistent, "other_focal_length"));
        let (_, said) = answer.causes[0].message.split_once("focal length of ").expect("it");
        let focal_px: f64 = said.split_once(' ').expect("px").0.parse().expect("a number");
        assert!((focal_px - 900.0).abs() < 9.0, "{focal_px}");
    }

    /// Correct points have no cause, nor have other faults: another principal point, a wrong point, a mirrored image with a wrong point.
    #[test]
    fn other_faults_have_none_of_these_causes() {
        let answer = solved(&points(), &camera(900.0));
        assert_eq!((answer.status(), answer.causes.len()), (Status::Ok, 0));
        let matrix = CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 255.0, cy_px: 741.0 };
        let lens = Camera::new(Pinhole { matrix }, camera(900.0).size).expect("a camera");
        let lens = solved(&points(), &lens);
        assert_eq!((lens.status(), lens.causes.len()), (Status::Inconsistent, 0), "{}", lens.verdict.message);
        let mut wrong = points();
        wrong[4].1.x += 60.0;
        assert_eq!(causes(&wrong).0.len(), 0);
        let mut both = changed(|x, p| (x, Pixel::new(p.y, p.x)));
        both[4].1.x += 60.0;
        assert_eq!(causes(&both).0.len(), 0);
    }
}
