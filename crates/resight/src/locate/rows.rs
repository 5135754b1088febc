//! Points as rows of numbers, as in arrays. A row without a pixel is a point that was not observed.

use super::{NamedPoint, PointsOptions, locate_points, outside_field};
use crate::answer::PoseAnswer;
use crate::formats::plausible::{of_pixels, of_uncertain_points};
use nalgebra::Vector3;
use resight_core::locate::consistency::Consistency;
use resight_core::{Camera, Correspondence, Error as MathError, Pixel, Point, Pose};

/// Squares of larger numbers, and their products, overflow.
pub(crate) const LARGEST: f64 = 1e60;

/// Points in the target frame and their pixels, one row each.
#[derive(Debug, Clone, Copy)]
pub struct PointRows<'a> {
    /// Positions in the target frame, metres.
    pub points_m: &'a [[f64; 3]],
    /// Pixels; NaN in both coordinates where the point was not observed.
    pub pixels: &'a [[f64; 2]],
    /// Standard deviation of each pixel coordinate.
    pub sigma_px: &'a [f64],
    /// Standard deviation of each coordinate of the position, metres; 0 where it is exact.
    pub sigma_m: &'a [f64],
    /// Names of the points; by default their row numbers.
    pub names: Option<&'a [String]>,
}

/// Why rows are not valid points: the kind of the error, where the mathematics refuses one, and a sentence that names the row.
#[derive(Debug, Clone, PartialEq)]
pub struct RowFault {
    /// The refusal.
    pub kind: Option<MathError>,
    /// The row, what is wrong with it, and the way out.
    pub message: String,
}

/// The points that were observed, and the indices of their rows.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenRows {
    points: Vec<NamedPoint>,
    rows: Vec<usize>,
    names: Vec<String>,
}

/// Returns whether a point was not observed: both coordinates of its pixel are NaN, as arrays and tables mark missing values.
pub fn is_missing(pixel: &[f64; 2]) -> bool {
    pixel.iter().all(|x| x.is_nan())
}

impl PointRows<'_> {
    /// Returns the rows that were observed.
    ///
    /// # Errors
    /// Columns of different lengths, a pixel with one coordinate missing, a pixel outside the field of the lens.
    pub fn seen(&self, camera: &Camera) -> Result<SeenRows, RowFault> {
        let n = self.points_m.len();
        let lengths = [self.pixels.len(), self.sigma_px.len(), self.sigma_m.len()];
        let names =
            self.names.map(<[String]>::to_vec).unwrap_or_else(|| (0..n).map(|i| i.to_string()).collect());
        if let Some(other) = lengths.into_iter().chain([names.len()]).find(|length| *length != n) {
            let message =
                format!("{n} points and a column of {other} rows; one of each is needed for each point");
            return Err(RowFault { kind: None, message });
        }
        let rows: Vec<usize> = (0..n).filter(|row| !is_missing(&self.pixels[*row])).collect();
        let point = |row: &usize| {
            Ok(NamedPoint { name: names[*row].clone(), line: None, seen: self.correspondence(*row, camera)? })
        };
        let points = rows.iter().map(point).collect::<Result<_, _>>();
        let points = points.map_err(|fault| self.with_causes(fault, &rows, &names, camera))?;
        Ok(SeenRows { points, rows, names })
    }

    /// Adds what is likely wrong to the fault of a pixel outside the field of the lens.
    fn with_causes(&self, fault: RowFault, rows: &[usize], names: &[String], camera: &Camera) -> RowFault {
        let without_bearing = |row: &usize| Correspondence {
            x_in_target: self.points_m[*row].into(),
            pixel: self.pixels[*row].into(),
            bearing: Vector3::z_axis(),
            sigma_px: self.sigma_px[*row],
            covariance_px2: None,
            sigma_m: self.sigma_m[*row],
        };
        let seen: Vec<Correspondence> = rows.iter().map(without_bearing).collect();
        let label = |i: usize| format!("point {}", names[rows[i]]);
        let causes = fault.kind.as_ref().and_then(|reason| outside_field(reason, &seen, camera, label));
        match causes {
            Some(causes) => RowFault { message: format!("{causes}; {}", fault.message), ..fault },
            None => fault,
        }
    }

    fn correspondence(&self, row: usize, camera: &Camera) -> Result<Correspondence, RowFault> {
        let ([x, y, z], [u, v]) = (self.points_m[row], self.pixels[row]);
        let fault = |kind, reason: String| RowFault { kind, message: format!("point {row}: {reason}") };
        if u.is_nan() || v.is_nan() {
            return Err(fault(
                None,
                format!(
                    "its pixel ({u}, {v}) is half missing; give both numbers, or NaN twice where it was not seen"
                ),
            ));
        }
        let numbers = [x, y, z, u, v, self.sigma_px[row], self.sigma_m[row]];
        if let Some(number) = numbers.into_iter().find(|x| x.is_finite() && LARGEST < x.abs()) {
            let reason = format!(
                "one of its numbers is {number:e}; the largest accepted is {LARGEST:e}, check the unit"
            );
            return Err(fault(None, reason));
        }
        let seen = Correspondence::new(camera, Point::new(x, y, z), Pixel::new(u, v), self.sigma_px[row]);
        let seen = seen.map_err(|reason| fault(Some(reason.clone()), reason.to_string()))?;
        Ok(Correspondence { sigma_m: self.sigma_m[row], ..seen })
    }
}

impl SeenRows {
    /// Returns the number of points observed.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns whether no point was observed.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Returns the observed pixel less the projected point for each row of the input; NaN where the point was not observed, or is outside the
    /// field of the camera at this pose.
    pub fn residuals_px(&self, camera: &Camera, cam_from_target: &Pose) -> Vec<[f64; 2]> {
        let mut residuals = vec![[f64::NAN; 2]; self.names.len()];
        for (row, NamedPoint { seen, .. }) in self.rows.iter().zip(&self.points) {
            let projected = camera.project(&(*cam_from_target * seen.x_in_target));
            residuals[*row] = projected.map_or([f64::NAN; 2], |pixel| (seen.pixel - pixel).into());
        }
        residuals
    }

    /// Returns what is hardly in metres and pixels, in sentences.
    fn implausible(&self, camera: &Camera) -> Vec<String> {
        let seen = || self.points.iter().map(|point| &point.seen);
        let of_points = of_uncertain_points(seen().map(|c| (c.x_in_target, c.sigma_m)));
        of_points.into_iter().chain(of_pixels(seen().map(|c| c.pixel), camera.size)).collect()
    }

    /// Solves for the pose from the observed points; row numbers in the answer are those of the input.
    pub fn locate(&self, view: &str, camera: &Camera, options: &PointsOptions) -> PoseAnswer {
        let mut answer = locate_points(view, &self.points, camera, options);
        answer.verdict = answer.verdict.with_sizes(&self.implausible(camera));
        let n_missing = self.names.len() - self.rows.len();
        if n_missing == 0 {
            return answer;
        }
        if let Some(agreement) = &mut answer.agreement {
            agreement.place_in_rows(&self.rows, self.names.len());
        }
        if let Some(estimate) = &mut answer.estimate
            && let Consistency::Inconsistent { worst_point, .. } = &mut estimate.consistency
        {
            *worst_point = self.rows[*worst_point];
        }
        answer.names = self.names.clone();
        let were = if n_missing == 1 { "was" } else { "were" };
        answer.remarks.push(format!(
            "{n_missing} of {} points {were} not seen (the pixel is NaN) and {were} left out",
            self.names.len()
        ));
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer::Status;
    use resight_core::camera::{BrownConrady, ImageSize, Pinhole};
    use resight_core::{CameraMatrix, Lens, Vector6};

    const NAN: f64 = f64::NAN;

    fn camera() -> Camera {
        let matrix = CameraMatrix { fx_px: 500.0, fy_px: 500.0, cx_px: 320.0, cy_px: 240.0 };
        Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
    }

    fn points() -> (Vec<[f64; 3]>, Vec<[f64; 2]>) {
        let pose = Pose::exp(&Vector6::new(0.2, -0.4, 0.1, 0.02, 0.03, 1.2));
        let points: Vec<[f64; 3]> = (0..12)
            .map(|i| [0.1 * f64::from(i % 4), 0.1 * f64::from(i / 4), 0.02 * f64::from(i % 3)])
            .collect();
        let pixel = |x: &[f64; 3]| camera().project(&(pose * Point::from(*x))).expect("in front").into();
        let pixels = points.iter().map(pixel).collect();
        (points, pixels)
    }

    fn seen(points_m: &[[f64; 3]], pixels: &[[f64; 2]]) -> Result<SeenRows, RowFault> {
        let (ones, zeros) = (vec![0.5; points_m.len()], vec![0.0; points_m.len()]);
        PointRows { points_m, pixels, sigma_px: &ones, sigma_m: &zeros, names: None }.seen(&camera())
    }

    #[test]
    fn positions_in_millimetres_are_implausible() {
        let (points, pixels) = points();
        let status = |factor: f64| {
            let scaled: Vec<[f64; 3]> =
                points.iter().map(|x| x.map(|x| (factor * x).round() / 10.0)).collect();
            let answer = seen(&scaled, &pixels).unwrap().locate("view", &camera(), &PointsOptions::default());
            (answer.status(), answer.verdict.message)
        };
        let (implausible, message) = status(1e4);
        assert_eq!(implausible, Status::Implausible);
        assert!(message.contains("are they in millimetres (0.3 m"), "{message}");
        assert_eq!(status(1e3).0, Status::Ok);
    }

    /// Points that were not observed change only the count, even if they have no position.
    #[test]
    fn rows_without_a_pixel_are_left_out() {
        let (mut points, mut pixels) = points();
        let (mut fewer, mut of_fewer) = (points.clone(), pixels.clone());
        fewer.remove(3);
        of_fewer.remove(3);
        (points[3], pixels[3]) = ([NAN, 0.0, 0.0], [NAN, NAN]);
        let options = PointsOptions::default();
        let with = seen(&points, &pixels).unwrap().locate("v", &camera(), &options);
        let without = seen(&fewer, &of_fewer).unwrap().locate("v", &camera(), &options);
        assert_eq!(with.estimate, without.estimate);
        assert_eq!((with.n_points, with.remarks.len(), without.remarks.len()), (11, 1, 0));
        assert!(with.remarks[0].starts_with("1 of 12 points was not seen"), "{:?}", with.remarks);
    }

    #[test]
    fn inliers_and_the_worst_point_are_rows_as_given() {
        let (points, mut pixels) = points();
        pixels[1] = [NAN, NAN];
        pixels[5][0] += 60.0;
        let robust = PointsOptions { robust_threshold_px: Some(4.0), ..PointsOptions::default() };
        let answer = seen(&points, &pixels).unwrap().locate("v", &camera(), &robust);
        let inliers = &answer.agreement.as_ref().unwrap().inliers;
        assert_eq!(*inliers, [0, 2, 3, 4, 6, 7, 8, 9, 10, 11]);
        let answer = seen(&points, &pixels).unwrap().locate("v", &camera(), &PointsOptions::default());
        let worst = serde_json::to_value(&answer).unwrap()["worst_point"].clone();
        assert_eq!((worst["index"].as_u64(), worst["name"].as_str()), (Some(5), Some("5")));
    }

    /// Rows as given; together they are the root mean square of the answer.
    #[test]
    fn residuals_are_observed_less_projected() {
        let (points, mut pixels) = points();
        pixels[2] = [NAN, NAN];
        pixels[5][0] += 0.75;
        let seen = seen(&points, &pixels).unwrap();
        let estimate = seen.locate("v", &camera(), &PointsOptions::default()).estimate.expect("a pose");
        let residuals = seen.residuals_px(&camera(), &estimate.cam_from_target);
        assert!(residuals.len() == 12 && residuals[2].iter().all(|x| x.is_nan()));
        assert!(0.3 < residuals[5][0], "{residuals:?}");
        let sum: f64 = residuals.iter().flatten().filter(|x| !x.is_nan()).map(|x| x * x).sum();
        assert!(((sum / 11.0).sqrt() - estimate.rms_px).abs() < 1e-9, "{}", estimate.rms_px);
    }

    #[test]
    fn a_number_whose_square_overflows_is_named() {
        let (mut points, pixels) = points();
        points[1][2] = -1e300;
        let fault = seen(&points, &pixels).unwrap_err();
        assert!(fault.message.starts_with("point 1: one of its numbers is -1e300;"), "{}", fault.message);
    }

    /// A lens with barrel distortion alone has no bearings for pixels of images twice as large, which is named.
    #[test]
    fn pixels_outside_the_field_have_their_cause() {
        let matrix = CameraMatrix { fx_px: 300.0, fy_px: 300.0, cx_px: 319.5, cy_px: 239.5 };
        let lens = BrownConrady::new(matrix, &[-0.28, 0.0, 0.0, 0.0]).expect("a lens");
        let size = Some(ImageSize { width_px: 640, height_px: 480 });
        let stated = Camera::new(lens, size).expect("a camera");
        let true_one = stated.scaled_to(1280, 960).expect("a camera");
        let pose = Pose::exp(&Vector6::new(0.2, -0.4, 0.1, -0.2, -0.1, 2.0));
        let x = |i: u32| {
            let angle = 2.399 * f64::from(i);
            [0.9 * angle.cos(), 0.7 * angle.sin(), 0.3 * (1.7 * angle).sin()]
        };
        let points: Vec<[f64; 3]> = (0..14).map(x).collect();
        let pixel = |x: &[f64; 3]| true_one.project(&(pose * Point::from(*x))).expect("in front").into();
        let pixels: Vec<[f64; 2]> = points.iter().map(pixel).collect();
        let (ones, zeros) = (vec![0.5; 14], vec![0.0; 14]);
        let rows =
            |pixels| PointRows { points_m: &points, pixels, sigma_px: &ones, sigma_m: &zeros, names: None };
        let fault = rows(&pixels).seen(&stated).expect_err("a pixel outside the field");
        assert!(fault.message.contains("with pixels of images of 1280 × 960 px"), "{}", fault.message);
        assert!(rows(&pixels).seen(&true_one).is_ok());
    }

    #[test]
    fn half_a_point_is_named() {
        let (points, mut pixels) = points();
        pixels[2][1] = NAN;
        assert!(seen(&points, &pixels).unwrap_err().message.contains("point 2: its pixel"));
        assert!(seen(&points, &pixels[1..]).is_err());
        let none = vec![[NAN, NAN]; points.len()];
        let answer = seen(&points, &none).unwrap().locate("v", &camera(), &PointsOptions::default());
        assert!(answer.estimate.is_none() && answer.remarks[0].starts_with("12 of 12 points were"));
    }
}
