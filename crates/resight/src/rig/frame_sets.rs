//! Finds frames that were taken at the same time, by name or by time stamp: synchronised frame sets, the views of a rig.

use super::observed::Frame;
use super::synchronise::{TimedFrame, by_time};
use crate::error::Error;
use std::collections::HashMap;

/// The result of the matching.
pub(super) struct FrameSets {
    /// Number of frames without a counterpart from another camera.
    pub n_alone: usize,
    /// Remarks about the matching.
    pub remarks: Vec<String>,
}

/// Gives the frames of one view the same name: with a tolerance, the name of their time, otherwise their own.
pub(super) fn name_views(frames: &mut [Frame], tolerance_s: Option<f64>) -> Result<FrameSets, Error> {
    let n_timed = frames.iter().filter(|frame| frame.t_s.is_some()).count();
    let mut remarks = Vec::new();
    match tolerance_s {
        Some(_) if n_timed == 0 => {
            return Err(Error::request(
                "--sync-tolerance-s needs time stamps: a column t_s in the detections, or --timestamps FILE.csv",
            ));
        }
        Some(tolerance_s) => remarks.push(by_time_stamps(frames, tolerance_s)?),
        None if n_timed == 0 => {}
        None => remarks.push(
            "times are given but no --sync-tolerance-s, so frames of one name are one view".to_string(),
        ),
    }
    let n_alone = n_alone(frames);
    if 0 < n_alone {
        let (n, frames) = (frames.len(), if n_alone == 1 { "frame has" } else { "frames have" });
        remarks.push(format!("{n_alone} of {n} {frames} no counterpart of another camera"));
    }
    Ok(FrameSets { n_alone, remarks })
}

fn by_time_stamps(frames: &mut [Frame], tolerance_s: f64) -> Result<String, Error> {
    let mut timed = Vec::with_capacity(frames.len());
    for frame in frames.iter() {
        let Some(t_s) = frame.t_s else {
            return Err(Error::request(format!(
                "frame {} has no time stamp; give every frame its time, or leave --sync-tolerance-s out",
                frame.name
            )));
        };
        timed.push(TimedFrame { camera: frame.camera, t_s });
    }
    let views = by_time(&timed, tolerance_s);
    let n_views = views.iter().max().map_or(0, |last| last + 1);
    let mut first_s = vec![f64::INFINITY; n_views];
    let mut last_s = vec![f64::NEG_INFINITY; n_views];
    for (frame, view) in timed.iter().zip(&views) {
        first_s[*view] = first_s[*view].min(frame.t_s);
        last_s[*view] = last_s[*view].max(frame.t_s);
    }
    for (frame, view) in frames.iter_mut().zip(&views) {
        frame.name = format!("{:.6} s", first_s[*view]);
    }
    let widest_s = first_s.iter().zip(&last_s).map(|(first, last)| last - first).fold(0.0, f64::max);
    Ok(format!(
        "{} frames in {n_views} views by time, at most {:.1} ms apart (tolerance {:.1} ms)",
        frames.len(),
        1e3 * widest_s,
        1e3 * tolerance_s
    ))
}

fn n_alone(frames: &[Frame]) -> usize {
    if frames.iter().all(|frame| frame.camera == frames[0].camera) {
        return 0; // A single camera on a robot needs no counterpart.
    }
    let mut cameras: HashMap<&str, (usize, bool)> = HashMap::new();
    for frame in frames {
        let (camera, is_shared) = cameras.entry(&frame.name).or_insert((frame.camera, false));
        *is_shared |= *camera != frame.camera;
    }
    frames.iter().filter(|frame| !cameras[frame.name.as_str()].1).count()
}
