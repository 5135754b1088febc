//! The learned noise, and the motion that is certain to be detected with it.

use super::object::{CorrelatedObject, DetectableObject, HeldObject, NoiseObject};
use crate::live::Promise;

/// Returns the words after "reference learned, ± …".
pub(super) fn words(promise: &Promise) -> String {
    let Promise { noise, detectable, held, .. } = promise;
    let largest = |of: &[f64; 3]| of.iter().copied().fold(0.0, f64::max);
    let (rotation, translation) =
        (largest(&detectable.rotation_rad).to_degrees(), 1e3 * largest(&detectable.translation_m));
    let mut words = format!(
        "; a sudden rotation of {rotation:.3}° or translation of {translation:.1} mm about or along any axis is found within {:.0} s, nine times \
         in ten, whatever errors the readings do not exclude yet",
        detectable.within_s
    );
    if noise.contradicts_stated() {
        words += &format!(
            "; readings scatter {:.2} ± {:.2} times as much as their stated standard deviations",
            noise.sigma_ratio, noise.sigma_ratio_sigma
        );
    }
    if let Some(correlated) = noise.correlated {
        words += &format!(
            "; errors of {:.1} times a reading's own noise last for about {:.0} s",
            correlated.sigma_ratio, correlated.time_s
        );
    }
    if let Some(held) = held {
        let (rotation, translation) =
            (largest(&held.rotation_rad).to_degrees(), 1e3 * largest(&held.translation_m));
        words += &format!(
            "; motions came back by themselves {} times: one below {rotation:.3}° or {translation:.1} mm is reported when it has lasted for \
             {}, and no rate of false alarms is promised for it",
            held.count,
            lasting(held.held_s)
        );
    }
    words
}

/// Returns a length of time in the unit that people would say it in.
fn lasting(seconds: f64) -> String {
    match seconds {
        ..120.0 => format!("{seconds:.0} s"),
        ..7200.0 => format!("{:.0} minutes", seconds / 60.0),
        _ => format!("{:.0} hours", seconds / 3600.0),
    }
}

/// Returns the promise as JSON objects.
pub(super) fn objects(promise: &Promise) -> (NoiseObject, DetectableObject) {
    let Promise { noise, detectable, held, .. } = promise;
    let correlated =
        noise.correlated.map(|l| CorrelatedObject { sigma_ratio: l.sigma_ratio, time_s: l.time_s });
    let noise = NoiseObject {
        sigma_ratio: noise.sigma_ratio,
        sigma_ratio_sigma: noise.sigma_ratio_sigma,
        contradicts_stated: noise.contradicts_stated(),
        correlated,
        n_readings: noise.readings,
    };
    let detectable = DetectableObject {
        within_s: detectable.within_s,
        rotation_rad: detectable.rotation_rad,
        translation_m: detectable.translation_m,
        held: held.map(|held| HeldObject {
            count: held.count,
            held_s: held.held_s,
            rotation_rad: held.rotation_rad,
            translation_m: held.translation_m,
        }),
    };
    (noise, detectable)
}
