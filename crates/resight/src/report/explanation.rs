//! The explanations of an answer, each with its probability and how far the answer moves under it: one shape and one sentence for rigs and hand–eye
//! calibrations.

use crate::core::Vector6;
use crate::core::explanation::Weighed;
use crate::report::words::{degrees, length, percent};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// An explanation of the observations, weighed against the others.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct WeighedExplanation {
    /// `as_stated`, or what is another one: `lens`, `target_size`, `exchanged_lenses`, `time`; for a rig also the first usual fault of a camera, by its name in
    /// the causes of a pose.
    pub explanation: &'static str,
    /// The camera or target concerned, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Its probability among those that were tried.
    pub probability: f64,
    /// By how much each pose moves under it, by the name of the camera or pose.
    pub motions: BTreeMap<String, MotionObject>,
    /// The same in words.
    pub message: String,
}

/// A difference between two poses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct MotionObject {
    /// Angle, rad.
    pub rotation_rad: f64,
    /// Distance, metres.
    pub translation_m: f64,
}

impl MotionObject {
    pub(crate) fn of(motion: &Vector6) -> Self {
        MotionObject {
            rotation_rad: motion.fixed_rows::<3>(0).norm(),
            translation_m: motion.fixed_rows::<3>(3).norm(),
        }
    }
}

/// The names of an explanation: its key, whose it is, and what it supposes in words.
pub(crate) struct Named {
    pub key: &'static str,
    pub of: Option<String>,
    pub words: String,
}

impl WeighedExplanation {
    pub(crate) fn of<K>(weighed: &Weighed<K>, named: Named, poses: &[String]) -> Self {
        let moves = poses.iter().zip(weighed.motions.iter().map(MotionObject::of));
        let farthest = moves.clone().max_by(|a, b| a.1.translation_m.total_cmp(&b.1.translation_m));
        let moved = farthest.filter(|(_, motion)| 0.0 < motion.translation_m + motion.rotation_rad);
        let moved = moved.map_or(String::new(), |(pose, motion)| {
            format!(", moves {pose} by {} and {}", length(motion.translation_m), degrees(motion.rotation_rad))
        });
        WeighedExplanation {
            explanation: named.key,
            of: named.of,
            probability: weighed.probability,
            motions: moves.map(|(pose, motion)| (pose.clone(), motion)).collect(),
            message: format!("{} (probability {}){moved}", named.words, percent(weighed.probability)),
        }
    }

    /// Returns the explanations for a person: all where the answer is inconsistent, the best one where it is not as stated.
    pub fn worth_reading(all: &[Self], is_inconsistent: bool) -> &[Self] {
        match all {
            [best, ..] if best.explanation != AS_STATED => {
                if is_inconsistent {
                    all
                } else {
                    &all[..1]
                }
            }
            _ if is_inconsistent && 1 < all.len() => all,
            _ => &[],
        }
    }
}

/// The key of the input as stated.
pub(crate) const AS_STATED: &str = "as_stated";

impl Named {
    pub fn as_stated() -> Self {
        Named { key: AS_STATED, of: None, words: "everything as stated".into() }
    }
}
