//! The deviation of a camera from its reference, in words and as JSON.

use super::object::DeviationObject;
use resight::answer::pose::rows;
use resight::core::temporal::monitor::Deviation;

/// Returns `now 0.300° ± 0.002° from the reference`, with a translation where chance does not explain it.
pub(super) fn words(deviation: &Deviation) -> String {
    let (turn, shift) = deviation.sizes();
    let turn = format!("{:.3}° ± {:.3}°", turn.value.to_degrees(), turn.sigma.to_degrees());
    let shift = shift.map(|shift| format!(" and {:.2} mm ± {:.2} mm", 1e3 * shift.value, 1e3 * shift.sigma));
    format!("now {turn}{} from the reference", shift.unwrap_or_default())
}

/// Returns the deviation as a JSON object.
pub(super) fn object(deviation: &Deviation) -> DeviationObject {
    let (turn, shift) = deviation.sizes();
    DeviationObject {
        rotation_rad: turn.value,
        sigma_rad: turn.sigma,
        translation_m: shift.map(|shift| shift.value),
        sigma_m: shift.map(|shift| shift.sigma),
        old_from_new: deviation.old_from_new.into(),
        covariance: rows(&deviation.covariance),
        n_readings: deviation.readings,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight::core::{Matrix6, Vector6};

    /// A pan whose translation is uncertain, and one with a translation that chance does not explain.
    #[test]
    fn the_shift_is_told_where_it_is_one() {
        let deviation = |motion: Vector6, shift_m2: f64| Deviation {
            old_from_new: motion,
            covariance: Matrix6::from_diagonal(&Vector6::new(
                1e-10, 1e-10, 1e-10, shift_m2, shift_m2, shift_m2,
            )),
            readings: 10,
        };
        let pan = deviation(Vector6::y() * 0.3_f64.to_radians(), 1e-6);
        assert_eq!(words(&pan), "now 0.300° ± 0.001° from the reference");
        let both = deviation(pan.old_from_new + Vector6::ith(3, 5e-3), 1e-8);
        assert_eq!(words(&both), "now 0.300° ± 0.001° and 5.00 mm ± 0.10 mm from the reference");
        let said = object(&both);
        assert_eq!((said.translation_m, said.sigma_m), (Some(5e-3), Some(1e-4)));
        assert!(object(&pan).translation_m.is_none());
    }
}
