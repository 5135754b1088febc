//! Numbers for people: a unit that fits, and the digits that the uncertainty justifies.
//!
//! Degrees and millimetres are used here and nowhere else in the library.

use super::truth::point_covariance;
use crate::core::budget::{Budget, ErrorSource};
use crate::core::locate::PoseEstimate;
use crate::core::locate::observability::{Axis, Observability};
use crate::core::{Matrix6, Point, Pose};
use nalgebra::{Matrix3, Vector3};

/// Returns the distance from the camera to the target's origin and its standard deviation, metres.
pub fn distance_with_sigma_m(estimate: &PoseEstimate) -> (f64, f64) {
    distance_sigma_m(&estimate.cam_from_target, &estimate.covariance)
}

/// Returns the distance from the camera to the origin of frame a and its standard deviation, metres, from `cam_from_a` and its covariance.
///
/// To first order a small motion ν moves the camera by −Rᵀν, so the distance changes by t·ν/|t|.
pub fn distance_sigma_m(cam_from_a: &Pose, covariance: &Matrix6) -> (f64, f64) {
    let t = cam_from_a.translation;
    let distance_m = t.norm();
    let along = if 0.0 < distance_m { t / distance_m } else { t };
    let translation = covariance.fixed_view::<3, 3>(3, 3);
    (distance_m, (along.transpose() * translation * along)[(0, 0)].max(0.0).sqrt())
}

/// Returns the camera's position in the target frame and the standard deviation along each axis of that frame, metres.
pub fn position_with_sigma_m(estimate: &PoseEstimate) -> (Point, Vector3<f64>) {
    let sigma_m = position_sigma_m(&estimate.cam_from_target, &estimate.covariance);
    (estimate.cam_from_target.origin(), sigma_m)
}

/// Returns the standard deviation of the camera's position along each axis of frame a, metres, from `cam_from_a` and its covariance.
pub fn position_sigma_m(cam_from_a: &Pose, covariance: &Matrix6) -> Vector3<f64> {
    let r = &cam_from_a.rotation;
    let translation: Matrix3<f64> = covariance.fixed_view::<3, 3>(3, 3).into();
    (r.transpose() * translation * r).diagonal().map(|x| x.max(0.0).sqrt())
}

/// Returns the standard deviation of each component of the translation of b_from_a, along the axes of frame b, metres. To first order a small
/// motion (ω, ν) changes t by ω × t + ν, so a rotation of frame b is part of it, whereas the last three of [`sigmas`] are those of ν alone.
pub fn translation_sigma_m(b_from_a: &Pose, covariance: &Matrix6) -> [f64; 3] {
    let of_translation = point_covariance(&b_from_a.translation, covariance);
    [0, 1, 2].map(|i| of_translation[(i, i)].max(0.0).sqrt())
}

/// A part of a budget that is less than this of it is not named.
const LEAST_SHARE: f64 = 0.005;

/// Returns the sources of a budget with their fractions of the variance of the position, the largest first; empty where one source is all there
/// is.
pub fn budget_shares(budget: &Budget) -> Vec<(ErrorSource, f64)> {
    shares(budget.parts().iter().map(|part| (part.source, budget.position_share(part))))
}

/// Returns sources with their fractions, the largest first and without those hardly there; empty where one source is all there is.
pub fn shares(of: impl Iterator<Item = (ErrorSource, f64)>) -> Vec<(ErrorSource, f64)> {
    let mut shares: Vec<(ErrorSource, f64)> = of.collect();
    shares.retain(|(_, share)| LEAST_SHARE <= *share);
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    if 1 < shares.len() { shares } else { Vec::new() }
}

/// Writes the standard deviation of a position, the root of the sum over its axes, and what its variance consists of: `± 3.1 mm: pixels 62 %, lens
/// 30 %, target 8 %`. `None` where one source is all there is.
pub fn budget(budget: &Budget) -> Option<String> {
    let named = all_share_words(budget_shares(budget))?;
    Some(format!("± {}: {named}", length(budget_sigma_m(budget))))
}

/// Returns the standard deviation of the position, the root of the sum over its axes, metres.
pub fn budget_sigma_m(budget: &Budget) -> f64 {
    budget.covariance().fixed_view::<3, 3>(3, 3).trace().max(0.0).sqrt()
}

/// Writes sources with their fractions: `lens 30 %, pixels 70 %`; `None` where there are none.
pub fn all_share_words(shares: Vec<(ErrorSource, f64)>) -> Option<String> {
    let named: Vec<String> = shares.into_iter().map(share_words).collect();
    (!named.is_empty()).then(|| named.join(", "))
}

/// Writes a source with its fraction: `lens 30 %`.
pub fn share_words((source, share): (ErrorSource, f64)) -> String {
    format!("{} {:.0} %", source_words(source), 100.0 * share)
}

fn source_words(source: ErrorSource) -> &'static str {
    match source {
        ErrorSource::CameraPoses => "camera poses",
        ErrorSource::Bend => "bend of the likelihood",
        ErrorSource::SharedInView => "errors shared in a view",
        ErrorSource::SharedInBlock => "errors shared by neighbouring views",
        ErrorSource::Residuals => "residuals beyond the stated noise",
        ErrorSource::Pixels => "pixels",
        ErrorSource::Lens => "lens",
        ErrorSource::LensModel => "choice of the lens model",
        ErrorSource::Target => "target",
        ErrorSource::ControlPoints => "control points",
        ErrorSource::Distances => "distances",
        ErrorSource::RobotAtGripper => "robot at the gripper",
        ErrorSource::RobotInBase => "robot in the base",
        ErrorSource::TimeOffsets => "times of exposure",
        ErrorSource::Priors => "priors",
        other => other.name(),
    }
}

/// Returns the remark about observations that repeat others in all digits; `None` where none does.
pub fn repeated(n_repeated: usize, n: usize) -> Option<String> {
    let (repeat, they) = if n_repeated == 1 { ("repeats", "it counts") } else { ("repeat", "they count") };
    (0 < n_repeated).then(|| {
        format!(
            "{n_repeated} of {n} rows {repeat} another to the last digit: equal rows are one observation, and {they} once"
        )
    })
}

/// Returns yaw, pitch and roll, radians, of `cam_from_target` = R_z(roll) R_x(pitch) R_y(yaw); for display only.
///
/// Yaw is a rotation about the target's y, roll about the optical axis; at pitch = ±90° yaw and roll are undetermined.
pub fn yaw_pitch_roll_rad(cam_from_target: &Pose) -> [f64; 3] {
    let r = &cam_from_target.rotation;
    [(-r[(2, 0)]).atan2(r[(2, 2)]), r[(2, 1)].clamp(-1.0, 1.0).asin(), (-r[(0, 1)]).atan2(r[(1, 1)])]
}

/// Returns the standard deviations of the rotation about the camera's x, y, z, radians, and of its position along them, metres.
pub fn sigmas(covariance: &crate::core::Matrix6) -> ([f64; 3], [f64; 3]) {
    let sigma = |i: usize| covariance[(i, i)].max(0.0).sqrt();
    ([sigma(0), sigma(1), sigma(2)], [sigma(3), sigma(4), sigma(5)])
}

/// Writes a length with its standard deviation, each in the unit that fits best: `0.5123 m ± 0.3 mm`.
pub fn with_sigma(value_m: f64, sigma_m: f64) -> String {
    let decimals = if 0.0 < sigma_m { (1.0 - sigma_m.log10().floor()).clamp(0.0, 6.0) as usize } else { 6 };
    format!("{value_m:.decimals$} m ± {}", length(sigma_m))
}

/// Writes a coordinate with its standard deviation in one unit: `+123.4 ± 0.2 mm`.
pub fn coordinate(value_m: f64, sigma_m: f64) -> String {
    let (scale, unit) = if 10.0 <= value_m.abs() || 1.0 <= sigma_m { (1.0, "m") } else { (1e3, "mm") };
    let (value, sigma) = (value_m * scale, sigma_m * scale);
    let decimals = decimals(sigma);
    format!("{value:+.decimals$} ± {sigma:.decimals$} {unit}")
}

/// Writes a length in the unit that fits best: two figures when it is small.
pub fn length(x_m: f64) -> String {
    let (value, unit) = match x_m.abs() {
        0.0 => (0.0, "mm"),
        x if x < 1e-3 => (x_m * 1e6, "µm"),
        x if x < 1.0 => (x_m * 1e3, "mm"),
        x if x < 1e4 => (x_m, "m"),
        _ => (x_m * 1e-3, "km"),
    };
    let decimals = if value.abs() < 10.0 && 1e-9 < value.fract().abs() { 1 } else { 0 };
    format!("{value:.decimals$} {unit}")
}

/// Writes an angle, given in radians, in degrees with two figures: `0.021°`.
pub fn degrees(angle_rad: f64) -> String {
    let degrees = angle_rad.to_degrees();
    let decimals = decimals(degrees.abs());
    format!("{degrees:.decimals$}°")
}

/// Describes the rotation and the shift that the points determine least, `0.8°` and `12 mm`, the weaker first.
pub fn weakest(o: &Observability) -> String {
    let shift = format!("{}, ± {}", shift_words(&o.shift_axis), length(o.sigma_m));
    let turn = match o.sigma_rad {
        all_round if std::f64::consts::PI < all_round => {
            format!("{}, > 180°", rotation_words(&o.rotation_axis))
        }
        sigma => format!("{}, ± {}", rotation_words(&o.rotation_axis), degrees(sigma)),
    };
    let (first, second) = if o.is_shift { (shift, turn) } else { (turn, shift) };
    let together = if o.correlated() { "; the two go together" } else { "" };
    format!("{first}; {second}{together}")
}

fn shift_words(axis: &Axis) -> String {
    match axis {
        Axis::LineOfSight => "distance along the line of sight".into(),
        Axis::Horizontal => "shift sideways".into(),
        Axis::Vertical => "shift up and down".into(),
        Axis::Oblique { from_sight_rad, .. } => {
            format!("shift at {:.0}° to the line of sight", from_sight_rad.to_degrees())
        }
        _ => "shift".into(),
    }
}

/// Describes a rotation: about an axis across the line of sight it tilts the target, about one along it, it rotates the image.
fn rotation_words(axis: &Axis) -> String {
    match axis {
        Axis::LineOfSight => "rotation about the line of sight".into(),
        Axis::Horizontal => "tilt about the horizontal axis".into(),
        Axis::Vertical => "tilt about the vertical axis".into(),
        Axis::LineOfPoints => "rotation about the line of three points".into(),
        Axis::Oblique { from_sight_rad, in_image_rad } if ACROSS_RAD < *from_sight_rad => {
            let sense = if *in_image_rad < 0.0 { "anticlockwise" } else { "clockwise" };
            format!("tilt about an axis {:.0}° {sense} of the horizontal", in_image_rad.abs().to_degrees())
        }
        Axis::Oblique { from_sight_rad, .. } => {
            format!("rotation about an axis {:.0}° from the line of sight", from_sight_rad.to_degrees())
        }
        _ => "rotation".into(),
    }
}

/// From this angle to the line of sight on, an axis is described by its direction in the image: two thirds of a right angle.
const ACROSS_RAD: f64 = std::f64::consts::FRAC_PI_3;

/// Remarks on points in one plane, which do not show whether coordinates (or, for a single camera, the image) are mirrored: an observer on the
/// other side fits as well.
pub fn below_one_level(
    who: &str,
    mirrored: &str,
    z_m: impl IntoIterator<Item = f64>,
    observer_z_m: f64,
) -> Option<String> {
    let mut z_m = z_m.into_iter();
    let level_m = z_m.next()?;
    let below_m = level_m - observer_z_m;
    (z_m.all(|z| z == level_m) && 0.0 < below_m).then(|| {
        format!(
            "the {who} is {below_m:.2} m below the points (smaller z_m); points of one level cannot show whether {mirrored}, which would \
             put it above them"
        )
    })
}

/// Writes a time with `decimals` of a second: `2026-05-28 20:26:40.25 UTC` if it is a plausible number of seconds since 1970, else `12.35 s`.
pub fn moment(t_s: f64, decimals: usize) -> String {
    // The range from 1990 to 2200.
    if !(6.3e8..7.3e9).contains(&t_s) {
        return format!("{t_s:.decimals$} s");
    }
    let part = 10_i64.pow(decimals.min(6) as u32);
    let parts = (t_s * part as f64).round() as i64;
    let (seconds, fraction) = (parts.div_euclid(part), parts.rem_euclid(part));
    let (year, month, day) = date(seconds.div_euclid(86_400));
    let of_day = seconds.rem_euclid(86_400);
    let fraction =
        if decimals == 0 { String::new() } else { format!(".{fraction:0width$}", width = decimals.min(6)) };
    let (h, min, s) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{year}-{month:02}-{day:02} {h:02}:{min:02}:{s:02}{fraction} UTC")
}

/// Returns year, month and day of a number of days since 1970, by the civil calendar's 400-year cycle.
fn date(days: i64) -> (i64, i64, i64) {
    let shifted = days + 719_468;
    let (era, of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let m = (5 * of_year + 2) / 153;
    let month = if m < 10 { m + 3 } else { m - 9 };
    (year + era * 400 + i64::from(month <= 2), month, of_year - (153 * m + 2) / 5 + 1)
}

/// Writes a number with a noun, given in the singular: `1 view`, `2 views`.
pub fn counted(n: usize, what: &str) -> String {
    match n {
        1 => format!("1 {what}"),
        _ => format!("{n} {what}s"),
    }
}

/// Writes what no image shows: where nothing was found, and what the first image shows instead.
pub(crate) fn found_nowhere(n_images: usize, seen: &str) -> String {
    match n_images {
        1 => format!("no target was found in the image: {seen}"),
        n => format!("no target was found in any of {n} images; in the first one, {seen}"),
    }
}

/// Writes a probability as a percentage, such as `27 %`; 0 and 100 only where they are exact.
pub fn percent(probability: f64) -> String {
    match 100.0 * probability {
        p if p < 1.0 => "< 1 %".into(),
        p if 99.0 < p => "> 99 %".into(),
        p => format!("{p:.0} %"),
    }
}

/// Returns the number of decimals that show two figures of a standard deviation, at most 6.
pub fn decimals(sigma: f64) -> usize {
    if 0.0 < sigma && sigma.is_finite() { (1.0 - sigma.log10().floor()).clamp(0.0, 6.0) as usize } else { 3 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Vector6;

    #[test]
    fn moments_are_dates_where_they_can_be() {
        assert_eq!(moment(1_780_000_000.0, 0), "2026-05-28 20:26:40 UTC");
        assert_eq!(moment(1_780_000_000.999_6, 3), "2026-05-28 20:26:41.000 UTC");
        assert_eq!(moment(951_782_400.25, 1), "2000-02-29 00:00:00.3 UTC");
        assert_eq!(
            [moment(12.3456, 3), moment(-1.0, 0), moment(1.78e12, 0)],
            ["12.346 s", "-1 s", "1780000000000 s"]
        );
        assert_eq!([counted(1, "view"), counted(0, "view")], ["1 view", "0 views"]);
    }

    #[test]
    fn lengths_read_well() {
        let cases = [
            (0.0, "0 mm"),
            (3e-7, "0.3 µm"),
            (0.00025, "250 µm"),
            (0.0025, "2.5 mm"),
            (0.02, "20 mm"),
            (2.0, "2 m"),
        ];
        for (x_m, text) in cases {
            assert_eq!(length(x_m), text);
        }
    }

    #[test]
    fn the_weakest_motion_reads_well() {
        let weak = Observability {
            motion: Vector6::zeros(),
            is_shift: true,
            ratio: 2.0,
            rotation_axis: Axis::Horizontal,
            sigma_rad: 0.014,
            shift_axis: Axis::LineOfSight,
            sigma_m: 0.012,
            correlation: 0.9,
        };
        let both = "distance along the line of sight, ± 12 mm; tilt about the horizontal axis, ± 0.80°";
        assert_eq!(weakest(&weak), format!("{both}; the two go together"));
        assert_eq!(weakest(&Observability { correlation: 0.2, ..weak }), both);
        let oblique = Axis::Oblique { from_sight_rad: 1.4, in_image_rad: -0.5 };
        let turned = weakest(&Observability { rotation_axis: oblique, is_shift: false, ..weak });
        assert!(
            turned.starts_with("tilt about an axis 29° anticlockwise of the horizontal, ± 0.80°; distance")
        );
        assert_eq!([0.004, 0.273, 0.999].map(percent), ["< 1 %", "27 %", "> 99 %"]);
    }

    #[test]
    fn two_figures_of_sigma_decide_the_decimals() {
        assert_eq!(coordinate(0.12345678, 0.000234), "+123.46 ± 0.23 mm");
        assert_eq!(coordinate(123.456, 0.02), "+123.456 ± 0.020 m");
        assert_eq!(with_sigma(0.512341, 0.0003), "0.51234 m ± 300 µm");
    }

    #[test]
    fn yaw_pitch_roll_rebuild_the_rotation() {
        let about = |axis: usize, angle: f64| {
            let mut xi = Vector6::zeros();
            xi[axis] = angle;
            Pose::exp(&xi)
        };
        let pose = about(2, 0.3) * about(0, -0.4) * about(1, 0.5);
        let [yaw, pitch, roll] = yaw_pitch_roll_rad(&pose);
        assert!((yaw - 0.5).abs() + (pitch + 0.4).abs() + (roll - 0.3).abs() < 1e-12);
    }

    /// To first order, a motion of 1e-5 changes the translation as its standard deviation states, to 1e-9.
    #[test]
    fn translation_sigma_is_that_of_small_motions() {
        let pose = Pose::exp(&Vector6::new(0.7, 0.1, -0.4, 0.3, 0.2, 2.0));
        for i in 0..6 {
            let (mut xi, mut covariance) = (Vector6::zeros(), Matrix6::zeros());
            (xi[i], covariance[(i, i)]) = (1e-5, 1e-10);
            let change = ((Pose::exp(&xi) * pose).translation - pose.translation).abs();
            let sigma = Vector3::from(translation_sigma_m(&pose, &covariance));
            assert!((change - sigma).norm() < 1e-9, "{i}: {change} {sigma}");
        }
    }

    /// σ of the camera's position and distance equal the changes under small motions of one σ.
    #[test]
    fn place_and_distance_sigmas_match_small_motions() {
        use crate::core::locate::{Config, locate};
        use crate::core::{Camera, Correspondence};
        let pose = Pose::exp(&Vector6::new(0.7, 0.1, -0.4, 0.3, 0.2, 2.0));
        let camera = Camera::normalized();
        let corners = [(0.0, 0.0, 0.0), (0.5, 0.0, 0.1), (0.0, 0.4, 0.0), (0.5, 0.5, 0.3), (0.2, 0.1, 0.6)];
        let seen: Vec<Correspondence> = corners
            .iter()
            .map(|&(x, y, z)| Point::new(x, y, z))
            .filter_map(|x| Correspondence::new(&camera, x, camera.project(&(pose * x))?, 1e-3).ok())
            .collect();
        let mut estimate = locate(&seen, &camera, &Config::default()).unwrap();
        for i in 3..6 {
            let mut xi = Vector6::zeros();
            xi[i] = 1e-5;
            estimate.covariance = Matrix6::zeros();
            estimate.covariance[(i, i)] = 1e-10;
            let moved = Pose::exp(&xi) * estimate.cam_from_target;
            let (place, sigma) = position_with_sigma_m(&estimate);
            assert!(((moved.origin() - place).abs() - sigma).norm() < 1e-9);
            let (distance, sigma) = distance_with_sigma_m(&estimate);
            assert!(((moved.origin().norm() - distance).abs() - sigma).abs() < 1e-9);
        }
    }
}
