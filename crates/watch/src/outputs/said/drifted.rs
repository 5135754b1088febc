//! A drift in words and as JSON: its start, step or rate, axis, and the motion that reverses it.

use super::object::{AgainObject, AxisObject, DriftObject};
use resight::answer::pose::rows;
use resight::core::Vector6;
use resight::core::temporal::monitor::{Alone, Drift, MotionKind, Rate};
use resight::report::turned::parts;
use resight::report::words::moment;

const HOUR_S: f64 = 3600.0;
/// The usual names of camera motions: rotations about x, y, z, translations along them.
const AXES: [&str; 6] = ["tilt", "pan", "roll", "x", "y", "range"];

/// Returns `moved in a step, since 200.0 s ± 1.0 s: rotated right 0.507° ± 0.010°; to put it back: left 0.507°`; for a further motion `moved
/// again in a step, since 900.0 s ± 1.0 s: rotated right 1.000° ± 0.010°; in all rotated right 1.507° ± 0.010°; to put it back: …`.
pub fn words(drift: &Drift) -> String {
    let how = match (drift.course, drift.rate) {
        (MotionKind::Step, _) => "in a step".to_string(),
        (MotionKind::Ramp, None) => "in a ramp".to_string(),
        (MotionKind::Ramp, Some(rate)) => format!("in a ramp{}", rate_words(&rate)),
    };
    let since = format!("{how}, since {} ± {:.1} s", moment(drift.began_s, 1), drift.began_sigma_s);
    let (all, back) = size(drift);
    match drift.again {
        Some(_) => {
            format!("moved again {since}: {}; in all {all}; to put it back: {back}", size(&drift.last()).0)
        }
        None => format!("moved {since}: {all}; to put it back: {back}"),
    }
}

/// Returns `rotated right 0.507° ± 0.010°`, and its opposite.
fn size(drift: &Drift) -> (String, String) {
    if let Some(Alone { axis, size, sigma }) = drift.alone() {
        let motion = Vector6::ith(axis, size);
        let verb = if axis < 3 { "rotated" } else { "shifted" };
        let [is, back] = [parts(&motion, |_| Some(sigma)), parts(&-motion, |_| None)];
        let name = if ["roll", "range"].contains(&AXES[axis]) {
            format!(" ({})", AXES[axis])
        } else {
            String::new()
        };
        return (format!("{verb} {is}{name}"), back);
    }
    let (verb, motion, sigma) = match drift.pure_rotation() {
        Some((turn, covariance)) => {
            let sigma = covariance.diagonal().map(f64::sqrt).as_slice().to_vec();
            ("rotated", Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0), sigma)
        }
        None => {
            let sigma = drift.covariance.diagonal().map(f64::sqrt).as_slice().to_vec();
            ("rotated and shifted", drift.old_from_new, sigma)
        }
    };
    let is = parts(&motion, |i| sigma.get(i).copied());
    (format!("{verb} {is}"), back(&motion, &sigma))
}

/// Returns `, at right 0.100° ± 0.002° an hour`: the components larger than their own error, of the rotation alone where that explains it.
fn rate_words(rate: &Rate) -> String {
    let sigma = rate.covariance.diagonal().map(f64::sqrt);
    let (per_s, sigma) = match rate.rotation_alone() {
        Some((turn, covariance)) => {
            let sigma = covariance.diagonal().map(f64::sqrt);
            let motion = Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0);
            (motion, Vector6::new(sigma.x, sigma.y, sigma.z, 0.0, 0.0, 0.0))
        }
        None => (rate.per_s, sigma),
    };
    let is_clear = |i: usize| 2.0 * sigma[i] < per_s[i].abs();
    let clear = Vector6::from_fn(|i, _| if is_clear(i) { per_s[i] * HOUR_S } else { 0.0 });
    let said = parts(&clear, |i| Some(sigma[i] * HOUR_S));
    if said.is_empty() { said } else { format!(", {said} an hour") }
}

/// Returns kind of motion, rate and axis.
pub fn object(drift: &Drift) -> DriftObject {
    let pure = drift.pure_rotation();
    let axis = drift.alone().map(|Alone { axis, size, sigma }| {
        let [about, along] = [axis < 3, 3 <= axis].map(|is_this| is_this.then_some((size, sigma)));
        let (rotation_rad, sigma_rad) = about.unzip();
        let (translation_m, sigma_m) = along.unzip();
        AxisObject { name: AXES[axis], rotation_rad, sigma_rad, translation_m, sigma_m }
    });
    DriftObject {
        pure_rotation_rad: pure.as_ref().map(|(rotation, _)| (*rotation).into()),
        pure_rotation_sigma_rad: pure.map(|(_, covariance)| covariance.diagonal().map(f64::sqrt).into()),
        course: if drift.course == MotionKind::Ramp { "ramp" } else { "step" },
        course_probability: drift.course_probability,
        rate_per_s: drift.rate.as_ref().map(|rate| rate.per_s.into()),
        rate_covariance: drift.rate.as_ref().map(|rate| rows(&rate.covariance)),
        axis,
        again: drift.again.map(|again| AgainObject {
            number: again.number,
            first_began_s: again.first_began_s,
            old_from_new: again.old_from_new.into(),
            covariance: rows(&again.covariance),
        }),
    }
}

/// Returns the opposite of the components that are larger than their own error.
fn back(motion: &Vector6, sigma: &[f64]) -> String {
    let is_clear = |i: usize| sigma.get(i).is_some_and(|sigma| 2.0 * sigma < motion[i].abs());
    let back = parts(&Vector6::from_fn(|i, _| if is_clear(i) { -motion[i] } else { 0.0 }), |_| None);
    if back.is_empty() { "nothing that can be distinguished from zero".to_string() } else { back }
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight::core::Matrix6;
    use resight::core::temporal::monitor::Again;

    /// States both sizes of a second motion, and what puts all of it back.
    #[test]
    fn a_further_motion_is_told_with_its_own_size() {
        let (pan, covariance) =
            (|degrees: f64| Vector6::y() * degrees.to_radians(), Matrix6::identity() * 1e-8);
        let again = Again { number: 2, first_began_s: 20.0, old_from_new: pan(1.0), covariance };
        let second = Drift {
            old_from_new: pan(1.05),
            covariance,
            began_s: 30.0,
            began_sigma_s: 1.0,
            course: MotionKind::Step,
            course_probability: 1.0,
            rate: None,
            again: Some(again),
        };
        assert_eq!(
            words(&second),
            "moved again in a step, since 30.0 s ± 1.0 s: rotated right 1.000° ± 0.006°; in all rotated right 1.050° ± 0.006°; to put it back: left 1.050°"
        );
        let said = object(&second).again.expect("the second motion");
        assert_eq!((said.number, said.first_began_s, said.old_from_new[1]), (2, 20.0, 1_f64.to_radians()));
    }
}
