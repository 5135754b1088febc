//! What was learned of the noise, and which motion can be promised to be found.

use crate::live::Promise;
use serde_json::{Value, json};

/// After "reference learned, ± …".
pub(super) fn words(promise: &Promise) -> String {
    let Promise { noise, detectable, .. } = promise;
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
    words
}

/// The same as the JSON objects `noise` and `detectable`.
pub(super) fn objects(promise: &Promise) -> (Value, Value) {
    let Promise { noise, detectable, .. } = promise;
    let correlated = noise.correlated.map(|l| json!({"sigma_ratio": l.sigma_ratio, "time_s": l.time_s}));
    let noise = json!({"sigma_ratio": noise.sigma_ratio, "sigma_ratio_sigma": noise.sigma_ratio_sigma,
        "contradicts_stated": noise.contradicts_stated(), "correlated": correlated, "n_readings": noise.readings});
    let detectable = json!({"within_s": detectable.within_s, "rotation_rad": detectable.rotation_rad,
        "translation_m": detectable.translation_m});
    (noise, detectable)
}
