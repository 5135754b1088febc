//! The usual faults of points and intrinsics in words: what makes points agree that contradict each other.

use crate::report::explanation::MotionObject;
use resight_core::camera::ImageSize;
use resight_core::locate::suspects::{Explanation, Fault, Origin, correction, explanations};
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::solve::configuration::Configuration;
use resight_core::{Camera, Correspondence, Error as MathError};
use schemars::JsonSchema;
use serde::Serialize;

/// A likely fault of the points of a view, or of the intrinsics.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PointsCause {
    /// `uv_exchanged`, `v_upwards`, `u_leftwards`, `xy_exchanged`, `axis_reversed`, `axis_unit`, `labels_shifted`, `labels_exchanged`,
    /// `rows_columns_exchanged`, `other_resolution`, `other_focal_length`, `other_crop`, `coefficient_order`, `undistorted_already` or `distorted`.
    cause: &'static str,
    /// A second one, where only both together explain the points.
    #[serde(skip_serializing_if = "Option::is_none")]
    second_cause: Option<&'static str>,
    /// χ² per degree of freedom once the fault is corrected.
    chi2_per_degree_of_freedom: f64,
    /// Its probability among all that were tried, the points as stated included.
    probability: f64,
    /// By how much the pose moves once it is corrected; absent where the points as stated have no pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    motion: Option<MotionObject>,
    /// The correction that makes the points agree.
    message: String,
}

/// Largest number of causes named in the sentence.
const MOST_NAMED: usize = 4;

/// Returns the causes that explain a contradiction, the most probable first; none where the points agree, or where the priors contradict them.
pub(super) fn causes(
    solved: Result<&PoseEstimate, &MathError>,
    seen: &[Correspondence],
    camera: &Camera,
    config: &Config,
    origin: Origin,
    label: impl Fn(usize) -> String,
) -> Vec<PointsCause> {
    let geometry = solved.ok().and_then(|e| e.geometry);
    let is_planar = geometry.is_some_and(|geometry| geometry.configuration == Configuration::Planar);
    let words = Words { camera, label, is_planar };
    explanations(solved, seen, camera, config, origin).iter().filter_map(|found| words.cause(found)).collect()
}

/// Returns the sentence about the causes where a pixel is outside the field of the lens, so that nothing was solved. Bearings are not used.
pub(crate) fn outside_field(
    reason: &MathError,
    seen: &[Correspondence],
    camera: &Camera,
    label: impl Fn(usize) -> String,
) -> Option<String> {
    sentence(&causes(Err(reason), seen, camera, &Config::default(), Origin::Table, label))
}

/// Solves for the pose of points of a table and returns the sentence about the causes; none where they agree.
pub(crate) fn of_table(
    seen: &[Correspondence],
    camera: &Camera,
    config: &Config,
    label: impl Fn(usize) -> String,
) -> Option<String> {
    let solved = locate(seen, camera, config);
    sentence(&causes(solved.as_ref(), seen, camera, config, Origin::Table, label))
}

/// The names of points, and the numbers that were stated.
struct Words<'a, L> {
    camera: &'a Camera,
    label: L,
    is_planar: bool,
}

impl<L: Fn(usize) -> String> Words<'_, L> {
    fn cause(&self, found: &Explanation) -> Option<PointsCause> {
        let (first, second) = (found.faults.first()?, found.faults.get(1));
        Some(PointsCause {
            cause: first.name(),
            second_cause: second.map(Fault::name),
            chi2_per_degree_of_freedom: found.chi2 / found.degrees_of_freedom as f64,
            probability: found.probability,
            motion: found.motion.as_ref().map(MotionObject::of),
            message: correction(&found.faults, Some(self.camera), self.is_planar, &self.label),
        })
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
    Some(format!("the points agree {which}: correct it and solve again"))
}

#[cfg(test)]
mod tests {
    use super::super::{LocateOptions, NamedPoint, PointsOptions, locate_image, locate_points};
    use crate::GrayImage;
    use crate::answer::{PoseAnswer, Status};
    use crate::formats::{read_camera, read_target};
    use resight_core::camera::{ImageSize, Pinhole};
    use resight_core::{Camera, CameraMatrix, Correspondence, Pixel, Point, Pose, Vector6};
    use std::path::Path;

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

    /// The principal point of another crop, and v upwards with intrinsics of half the resolution, are named with their numbers.
    #[test]
    fn a_crop_and_two_faults_at_once_are_named() {
        let matrix = CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 255.0, cy_px: 741.0 };
        let crop = Camera::new(Pinhole { matrix }, camera(900.0).size).expect("a camera");
        let crop = solved(&points(), &crop);
        assert_eq!((crop.status(), crop.causes[0].cause), (Status::Inconsistent, "other_crop"));
        assert!(crop.causes[0].message.contains("px instead of (255, 741) px"), "{}", crop.causes[0].message);
        let half = camera(900.0).scaled_to(640, 480).expect("half");
        let both = solved(&changed(|x, p| (x, Pixel::new(p.x, 959.0 - p.y))), &half);
        let names = (both.causes[0].cause, both.causes[0].second_cause);
        assert_eq!(names, ("v_upwards", Some("other_resolution")), "{}", both.verdict.message);
        assert!(
            both.verdict.message.contains(" and with pixels of images of 1280 × 960 px"),
            "{}",
            both.verdict.message
        );
    }

    /// The image of the demo before a camera file without distortion; with the right file nothing is named.
    #[test]
    fn forgotten_distortion_is_named_in_an_image() {
        let demo = |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/demo").join(name);
        let image = GrayImage::read(demo("left.png")).expect("the image");
        let target = read_target(demo("grid.toml")).expect("the grid").target;
        let located = |name: &str| {
            let camera = read_camera(demo(name)).expect("the camera").camera;
            locate_image(&image, &camera, &target, &LocateOptions::default()).expect("an answer")
        };
        let right = located("left.toml");
        assert_eq!((right.status(), right.causes.len()), (Status::Ok, 0), "{}", right.verdict.message);
        let forgotten = located("left-distortion-forgotten.toml");
        assert_eq!(forgotten.status(), Status::Inconsistent);
        let names: Vec<&str> = forgotten.causes.iter().map(|cause| cause.cause).collect();
        assert_eq!(names.first(), Some(&"distorted"), "{}", forgotten.verdict.message);
        let start = "the points agree with the distortion k1 = -0.2";
        assert!(forgotten.verdict.message.starts_with(start), "{}", forgotten.verdict.message);
    }

    /// Correct points have no cause, nor have other faults: a wrong point, a mirrored image with a wrong point.
    #[test]
    fn other_faults_have_none_of_these_causes() {
        let answer = solved(&points(), &camera(900.0));
        assert_eq!((answer.status(), answer.causes.len()), (Status::Ok, 0));
        let mut wrong = points();
        wrong[4].1.x += 60.0;
        assert_eq!(causes(&wrong).0.len(), 0);
        let mut both = changed(|x, p| (x, Pixel::new(p.y, p.x)));
        both[4].1.x += 60.0;
        assert_eq!(causes(&both).0.len(), 0);
    }
}
