//! The learned noise, the motion that is certain to be detected with it, and the errors for which no rate of false alarms is promised.

use super::object::{CorrelatedObject, DetectableObject, HeldObject, NoiseObject, UnpromisedObject};
use crate::live::Promise;
use resight::core::temporal::monitor::Unpromised;
use resight::report::words::counted;

/// Returns the promise in words.
pub(super) fn words(promise: &Promise) -> String {
    let Promise { noise, detectable, held, .. } = promise;
    let largest = |of: &[f64; 3]| of.iter().copied().fold(0.0, f64::max);
    let (rotation, translation) =
        (largest(&detectable.rotation_rad).to_degrees(), 1e3 * largest(&detectable.translation_m));
    let mut words = format!(
        "a sudden rotation of {rotation:.3}° or translation of {translation:.1} mm about or along any axis is found within {:.0} s, nine times \
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
            "; a motion below {rotation:.3}° or {translation:.1} mm is reported when it has lasted for {}",
            lasting(held.held_s)
        );
    }
    words + &unpromised_words(promise)
}

/// Disturbances that no record of readings excludes.
const ALWAYS: &str = "disturbances that come and go, such as rain, insects and flickering lamps";

/// Returns the errors for which no rate of false alarms is promised, and which of them are there.
fn unpromised_words(promise: &Promise) -> String {
    let unseen = unpromised(promise).into_iter().filter(|of| !of.is_present).map(|of| of.message + ", and ");
    let words = format!(
        "; the rate of false alarms is promised for errors like those so far, but not for {}{ALWAYS}",
        unseen.collect::<String>()
    );
    words + &present(&unpromised(promise)).map_or(String::new(), |present| format!("; {present}"))
}

/// Returns in words that disturbances are there for which no rate is promised; none where there are none.
pub(super) fn present(unpromised: &[UnpromisedObject]) -> Option<String> {
    let present: Vec<&str> =
        unpromised.iter().filter(|of| of.is_present).map(|of| of.message.as_str()).collect();
    let reasons = present.join(", ");
    (!present.is_empty()).then(|| format!("no rate of false alarms is promised now: {reasons}"))
}

/// Returns the errors for which no rate of false alarms is promised, each with its reason.
pub(super) fn unpromised(promise: &Promise) -> Vec<UnpromisedObject> {
    let of = |kind, is_present, message| UnpromisedObject { kind, is_present, message };
    let known = promise.unpromised.iter().map(|unpromised| match unpromised {
        Unpromised::UnwatchedHours { watched_s } => {
            let hours = format!("those of hours that were not watched yet ({} so far)", lasting(*watched_s));
            of("unwatched_hours", false, hours)
        }
        Unpromised::Returning { count } => {
            let motions = match count {
                1 => "a motion came back by itself".to_string(),
                _ => format!("motions came back by themselves {count} times"),
            };
            of("returning", true, motions)
        }
        Unpromised::Contradictions { share } => {
            let contradict = format!("{:.0} % of the readings contradict their noise", 100.0 * share);
            of("contradictions", true, contradict)
        }
        Unpromised::ChangedErrors => {
            let changed = "errors are correlated otherwise than the readings before had shown";
            of("changed_errors", true, changed.to_string())
        }
    });
    let key_frames = promise.missed_key_frames.map(|seen| {
        let after = counted(seen as usize, "key frame");
        let message = format!(
            "the reference was learned from a video with {after} after the first reading, and errors change at each"
        );
        of("key_frames", true, message)
    });
    known.chain(key_frames).collect()
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
