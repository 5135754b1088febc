//! The metrics: one table for those of a camera, one for those of a camera and a target.

use super::tally::{CameraTally, Deviation, PairTally, Tally};
use super::write::{Page, number};
use crate::live::State;
use crate::outputs::said::{WORDS, word};

/// Content type of the pages.
pub const CONTENT_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

const STAGES: [&str; 4] = ["waited", "detect", "solve", "decide"];

/// A metric of one number for each camera or pair: name, type, help, value where there is one.
type Family<T> = (&'static str, &'static str, &'static str, fn(&Tally, &T) -> Option<f64>);

const OF_CAMERAS: [Family<CameraTally>; 5] = [
    ("resight_source_up", "gauge", "Whether the camera's source gives frames.", |_, c| {
        Some(f64::from(u8::from(c.connected)))
    }),
    ("resight_source_losses_total", "counter", "How often the source was lost.", |_, c| {
        Some(c.losses as f64)
    }),
    (
        "resight_frames_dropped_total",
        "counter",
        "Frames dropped because those before them took too long.",
        |_, c| Some(c.dropped as f64),
    ),
    (
        "resight_frames_left_out_total",
        "counter",
        "Frames that could not be decoded or came out of order.",
        |_, c| Some(c.left_out as f64),
    ),
    ("resight_clock_steps_total", "counter", "How often the clock of the frames was set.", |_, c| {
        Some(c.clock_steps as f64)
    }),
];

const OF_PAIRS: [Family<PairTally>; 14] = [
    ("resight_frames_total", "counter", "Frames looked at.", |_, p| Some(p.frames as f64)),
    ("resight_frames_with_pose_total", "counter", "Frames that gave a pose.", |_, p| {
        Some(p.with_pose as f64)
    }),
    (
        "resight_frames_unreadable_total",
        "counter",
        "Frames that could not be read: torn, frozen, of another size.",
        |_, p| Some(p.unreadable as f64),
    ),
    ("resight_frame_rate_hertz", "gauge", "Frames a second over the last 10 s.", |t, p| Some(t.rate_hz(p))),
    ("resight_alarms_total", "counter", "Alarms: how often a motion was reported.", |_, p| {
        Some(p.alarms as f64)
    }),
    (
        "resight_moved_while_learning_total",
        "counter",
        "How often the camera moved while its reference was learned, so that it is learned again.",
        |_, p| Some(p.moved_while_learning as f64),
    ),
    (
        "resight_usable_reading_age_seconds",
        "gauge",
        "Since the last usable reading arrived, or since the start where there was none.",
        |t, p| Some(t.unobserved_s(p)),
    ),
    ("resight_points", "gauge", "Points found in the last frame.", |_, p| Some(p.last.n_points as f64)),
    (
        "resight_reprojection_rms_pixels",
        "gauge",
        "Root mean square reprojection error of the last frame.",
        |_, p| p.last.rms_px,
    ),
    (
        "resight_innovation_ratio",
        "gauge",
        "Chi-square of the last pose against the tracked one over its 6 degrees of freedom: 1 on average where the noise is as stated.",
        |_, p| p.last.innovation_ratio,
    ),
    (
        "resight_deviation_rotation_radians",
        "gauge",
        "Rotation of the tracked pose against the reference, noise included; resight_state states whether it is drift.",
        |_, p| deviation(p, |d| d.rotation_rad),
    ),
    (
        "resight_deviation_rotation_sigma_radians",
        "gauge",
        "Its standard deviation, along its own axis.",
        |_, p| deviation(p, |d| d.rotation_sigma_rad),
    ),
    (
        "resight_deviation_translation_meters",
        "gauge",
        "Shift of the tracked pose against the reference, noise included.",
        |_, p| deviation(p, |d| d.translation_m),
    ),
    (
        "resight_deviation_translation_sigma_meters",
        "gauge",
        "Its standard deviation, along its own direction.",
        |_, p| deviation(p, |d| d.translation_sigma_m),
    ),
];

fn deviation(pair: &PairTally, part: fn(&Deviation) -> f64) -> Option<f64> {
    pair.last.deviation.as_ref().map(part)
}

/// Returns all metrics as text.
pub fn page(tally: &Tally) -> String {
    let mut page = Page::default();
    page.family("resight_build_info", "gauge", "Which version this is.");
    page.sample("resight_build_info", &[("version", env!("CARGO_PKG_VERSION"))], 1.0);
    page.family(
        "resight_allowed_false_alarms_per_day",
        "gauge",
        "False alarms that are allowed, all cameras together.",
    );
    page.sample("resight_allowed_false_alarms_per_day", &[], tally.false_alarms_per_day);
    for (name, kind, help, value) in OF_CAMERAS {
        page.family(name, kind, help);
        for camera in &tally.cameras {
            if let Some(value) = value(tally, camera) {
                page.sample(name, &[("camera", &camera.name)], value);
            }
        }
    }
    for (name, kind, help, value) in OF_PAIRS {
        page.family(name, kind, help);
        for pair in &tally.pairs {
            if let Some(value) = value(tally, pair).filter(|value| value.is_finite()) {
                page.sample(name, &[("camera", &pair.camera), ("target", &pair.target)], value);
            }
        }
    }
    states(&mut page, tally);
    troubles(&mut page, tally);
    drifts(&mut page, tally);
    stages(&mut page, tally);
    deliveries(&mut page, tally);
    page.into_text()
}

/// Writes one sample for each state, one of them 1: an alert can use any, and none is mistaken for a healthy session.
fn states(page: &mut Page, tally: &Tally) {
    let name = "resight_state";
    page.family(name, "gauge", "1 for the state that holds, 0 for the others; stale before the first frame.");
    for pair in &tally.pairs {
        let now = pair.state.as_ref().map_or("stale", word);
        for state in WORDS {
            let labels = [("camera", pair.camera.as_str()), ("target", &pair.target), ("state", state)];
            page.sample(name, &labels, f64::from(u8::from(state == now)));
        }
    }
}

fn troubles(page: &mut Page, tally: &Tally) {
    let name = "resight_frame_trouble";
    page.family(name, "gauge", "1 for each reason for which the last frame says less or nothing.");
    for pair in &tally.pairs {
        for (reason, is) in pair.last.troubles {
            let labels = [("camera", pair.camera.as_str()), ("target", &pair.target), ("reason", reason)];
            page.sample(name, &labels, f64::from(u8::from(is)));
        }
    }
}

/// Writes the values of the alarm while it lasts.
fn drifts(page: &mut Page, tally: &Tally) {
    let name = "resight_drift_began_timestamp_seconds";
    page.family(name, "gauge", "When the drift began, in the time of the frames; only while drifted.");
    for pair in &tally.pairs {
        if let Some(State::Drifted(drift)) = &pair.state {
            page.sample(name, &[("camera", &pair.camera), ("target", &pair.target)], drift.began_s);
        }
    }
    page.family("resight_moved", "gauge", "1 for each camera or target that moved relative to the others.");
    for moved in &tally.moved {
        page.sample("resight_moved", &[("name", moved)], 1.0);
    }
}

fn stages(page: &mut Page, tally: &Tally) {
    page.family(
        "resight_stage_seconds",
        "histogram",
        "What each stage of a frame took; waited: before its turn came.",
    );
    for pair in &tally.pairs {
        for (stage, histogram) in STAGES.iter().zip(&pair.stages) {
            let labels = [("camera", pair.camera.as_str()), ("target", &pair.target), ("stage", stage)];
            let count = histogram.count() as f64;
            let all = std::iter::once((f64::INFINITY, histogram.count()));
            for (bound_s, below) in histogram.cumulative().chain(all) {
                let bound = number(bound_s);
                let [camera, target, stage] = labels;
                page.sample(
                    "resight_stage_seconds_bucket",
                    &[camera, target, stage, ("le", &bound)],
                    below as f64,
                );
            }
            page.sample("resight_stage_seconds_sum", &labels, histogram.sum_s());
            page.sample("resight_stage_seconds_count", &labels, count);
        }
    }
}

fn deliveries(page: &mut Page, tally: &Tally) {
    let counts: Vec<_> = tally.counted.iter().map(|(output, counted)| (*output, counted.counts())).collect();
    let name = "resight_notices_total";
    page.family(name, "counter", "Notifications to other programs, by outcome.");
    for (output, counts) in &counts {
        for (outcome, n) in
            [("delivered", counts.delivered), ("refused", counts.refused), ("dropped", counts.dropped)]
        {
            page.sample(name, &[("output", output), ("outcome", outcome)], n as f64);
        }
    }
    page.family("resight_notices_waiting", "gauge", "What has not been acknowledged yet.");
    for (output, counts) in &counts {
        page.sample("resight_notices_waiting", &[("output", output)], counts.waiting() as f64);
    }
}
