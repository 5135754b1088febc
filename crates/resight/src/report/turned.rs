//! Small motions in words, and the rotation since a reference image, in words and as JSON.

use crate::core::Vector6;
use crate::landmarks::LandmarkObservation;
use nalgebra::Vector2;

/// Words for the directions of a rotation or shift and their opposites, about x right, y down, z forward.
const TURNS: [[&str; 2]; 3] = [["up", "down"], ["right", "left"], ["clockwise", "counter-clockwise"]];
const SHIFTS: [[&str; 2]; 3] = [["right", "left"], ["down", "up"], ["forward", "backward"]];

/// Describes a motion: `right 0.420° ± 0.030°, …`; zeros are left out.
pub fn parts(motion: &Vector6, sigma: impl Fn(usize) -> Option<f64>) -> String {
    let part = |i: usize| {
        let (words, scale, unit) =
            if i < 3 { (TURNS[i], f64::to_degrees(1.0), "°") } else { (SHIFTS[i - 3], 1e3, " mm") };
        let doubt = sigma(i).map(|s| format!(" ± {:.3}{unit}", s * scale)).unwrap_or_default();
        let direction = words[usize::from(motion[i] < 0.0)];
        (motion[i] != 0.0).then(|| format!("{direction} {:.3}{unit}{doubt}", (motion[i] * scale).abs()))
    };
    (0..6).filter_map(part).collect::<Vec<_>>().join(", ")
}

/// Explains why the rotation cannot be used: most of the landmarks contradict it.
pub fn contradiction(landmark_observation: &LandmarkObservation) -> Option<String> {
    let (agree, found) =
        (landmark_observation.relative_rotation.used.len(), landmark_observation.relative_rotation.given);
    (!landmark_observation.relative_rotation.is_consistent()).then(|| {
        format!(
            "inconsistent: {agree} of the {found} landmarks found agree, half are needed: near things as the camera shifts, or much that moves"
        )
    })
}

/// Describes a rotation: `turned up 0.0011° ± 0.0020°, …; image shifted 8.00 px left, 0.02 px up; 310 of 320 landmarks agree`. If most of the
/// landmarks contradict the rotation, the description begins with that.
pub fn words(landmark_observation: &LandmarkObservation) -> String {
    let turned = rotation_words(landmark_observation);
    match contradiction(landmark_observation) {
        Some(why) => format!("{why}; they say: {turned}"),
        None => turned,
    }
}

fn rotation_words(landmark_observation: &LandmarkObservation) -> String {
    let (relative_rotation, covariance) = landmark_observation.relative_rotation.old_from_new();
    let part = |i: usize| {
        let direction = TURNS[i][usize::from(relative_rotation[i] < 0.0)];
        let [size, sigma] = [relative_rotation[i].abs(), covariance[(i, i)].sqrt()].map(f64::to_degrees);
        format!("{direction} {size:.4}° ± {sigma:.4}°")
    };
    let shift = landmark_observation.shift.map(|shift| format!("; image shifted {}", shift_words(&shift.px)));
    format!(
        "rotated {}{}; {} of {} landmarks agree",
        [0, 1, 2].map(part).join(", "),
        shift.unwrap_or_default(),
        landmark_observation.relative_rotation.used.len(),
        landmark_observation.in_view
    )
}

fn shift_words(px: &Vector2<f64>) -> String {
    let word =
        |value: f64, i: usize| format!("{:.2} px {}", value.abs(), SHIFTS[i][usize::from(value < 0.0)]);
    format!("{}, {}", word(px.x, 0), word(px.y, 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::temporal::relative_rotation::RelativeRotation;
    use nalgebra::Matrix3;

    #[test]
    fn a_contradictory_turn_is_reported_as_one() {
        let said = |agree: usize| {
            let relative_rotation = RelativeRotation {
                now_from_reference: Matrix3::identity(),
                covariance: Matrix3::identity() * 1e-8,
                used: (0..agree).collect(),
                given: 100,
                bend: 0.0,
                noise_factor: 1.0,
                coherence: 1.0,
                rms_px: 0.1,
            };
            words(&LandmarkObservation { relative_rotation, shift: None, found: Vec::new(), in_view: 120 })
        };
        assert!(said(49).starts_with("inconsistent: 49 of the 100 landmarks found agree"), "{}", said(49));
        assert!(said(50).starts_with("rotated "), "{}", said(50));
    }
}
