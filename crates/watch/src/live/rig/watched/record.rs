//! The record of a rig with hand-held targets: the change detector, or the frame sets learned from so far, and the frames that wait for those of
//! other cameras. Poses of single frames are solved again from their points.

use super::super::moments::{Shown, SynchronisedFrames, TargetPoints};
use super::Cameras;
use crate::live::state::rig_record::{
    FrameRecord, FrameSetRecord, HeardRecord, PointRecord, RigRecord, SeenRecord, StageRecord,
};
use crate::live::state::{changed, unix_s};
use resight_core::correspondence::PixelCovariance;
use resight_core::locate::{Config, locate};
use resight_core::temporal::monitor::rig::RigMonitor;
use resight_core::{Camera, Correspondence};
use std::time::Instant;

impl Cameras {
    /// Returns the state after complete frames only: an incomplete one is processed again.
    pub(super) fn record(&self) -> RigRecord {
        let heard = |camera: usize| HeardRecord {
            name: self.nodes.cameras[camera].clone(),
            last: self.whole[camera],
            seen_s: self.seen_s[camera],
        };
        let stage = match &self.monitor {
            Some(monitor) => StageRecord::Watching(monitor.snapshot().into()),
            None => StageRecord::Learning(self.learning.iter().map(FrameSetRecord::from).collect()),
        };
        RigRecord {
            settings: self.nodes.settings.clone(),
            cameras: (0..self.nodes.cameras.len()).map(heard).collect(),
            first_s: self.first_s,
            last_s: self.last_s,
            stage,
            waiting: self.frame_sets.waiting().map(FrameRecord::from).collect(),
        }
    }

    /// Continues from the state of another session.
    ///
    /// # Errors
    /// The reason why the record does not belong to this rig; nothing has changed then.
    pub(super) fn restore(&mut self, record: &RigRecord) -> Result<(), String> {
        if let Some(words) = changed(&record.settings, &self.nodes.settings) {
            return Err(words);
        }
        let damaged = || "what was seen so far is damaged".to_string();
        let waiting = all(&record.waiting, |frame| frame.shown(&self.nodes.lenses)).ok_or_else(damaged)?;
        match &record.stage {
            StageRecord::Watching(snapshot) => {
                let monitor = RigMonitor::restore(&snapshot.snapshot()).map_err(|e| e.to_string())?;
                if monitor.reference().cam_from_rig.len() != self.nodes.lenses.len() {
                    return Err(damaged());
                }
                self.monitor = Some(monitor);
            }
            StageRecord::Learning(frame_sets) => {
                self.learning = all(frame_sets, |frame_set| frame_set.together(&self.nodes.lenses))
                    .ok_or_else(damaged)?;
            }
        }
        (self.first_s, self.last_s) = (record.first_s, record.last_s);
        let now = Instant::now();
        waiting.into_iter().for_each(|frame| self.frame_sets.push(frame, now));
        for camera in 0..self.nodes.cameras.len() {
            if let Some(heard) = record.cameras.iter().find(|heard| heard.name == self.nodes.cameras[camera])
            {
                self.resume(camera, heard);
            }
        }
        Ok(())
    }

    /// Accounts for the time between the sessions: states are reported for the present time until a frame arrives.
    fn resume(&mut self, camera: usize, heard: &HeardRecord) {
        self.seen_s[camera] = heard.seen_s;
        let Some((last_s, last_unix_s)) = heard.last else { return };
        let ago_s = (unix_s() - last_unix_s).max(0.0);
        self.resumed[camera] = Some((last_s, ago_s));
        self.whole[camera] = heard.last;
        let now_s = last_s + ago_s;
        self.heard[camera] = Some((now_s, Instant::now()));
        self.idle_s = Some(self.idle_s.map_or(now_s, |idle_s| idle_s.min(now_s)));
    }
}

fn all<R, T>(records: &[R], of: impl Fn(&R) -> Option<T>) -> Option<Vec<T>> {
    records.iter().map(of).collect()
}

impl From<&SynchronisedFrames> for FrameSetRecord {
    fn from(frame_set: &SynchronisedFrames) -> Self {
        FrameSetRecord {
            t_s: frame_set.t_s,
            frames: frame_set.frames.iter().map(FrameRecord::from).collect(),
        }
    }
}

impl FrameSetRecord {
    fn together(&self, lenses: &[Camera]) -> Option<SynchronisedFrames> {
        Some(SynchronisedFrames { t_s: self.t_s, frames: all(&self.frames, |frame| frame.shown(lenses))? })
    }
}

impl From<&Shown> for FrameRecord {
    fn from(frame: &Shown) -> Self {
        let seen = |seen: &TargetPoints| SeenRecord {
            target: seen.target,
            size_px: seen.lens.size.map(|size| [size.width_px, size.height_px]),
            points: seen.points.iter().map(PointRecord::from).collect(),
        };
        FrameRecord { camera: frame.camera, t_s: frame.t_s, seen: frame.seen.iter().map(seen).collect() }
    }
}

impl FrameRecord {
    /// Returns none where the record is damaged: an invalid camera, or points without a pixel.
    fn shown(&self, lenses: &[Camera]) -> Option<Shown> {
        let own = lenses.get(self.camera)?;
        Some(Shown { camera: self.camera, t_s: self.t_s, seen: all(&self.seen, |seen| seen.seen(own))? })
    }
}

impl SeenRecord {
    fn seen(&self, own: &Camera) -> Option<TargetPoints> {
        let lens = match self.size_px {
            Some([width_px, height_px]) => {
                resight::formats::check_image_size(own, width_px, height_px).ok()?
            }
            None => own.clone(),
        };
        let points = all(&self.points, |point| point.correspondence(&lens))?;
        let estimate = locate(&points, &lens, &Config::default()).ok()?;
        Some(TargetPoints { target: self.target, points, lens, estimate })
    }
}

impl From<&Correspondence> for PointRecord {
    fn from(point: &Correspondence) -> Self {
        PointRecord {
            x_in_target_m: point.x_in_target.into(),
            pixel: point.pixel.into(),
            sigma_px: point.sigma_px,
            covariance_px2: point.covariance_px2.map(|c| [c.uu_px2, c.uv_px2, c.vv_px2]),
            sigma_m: point.sigma_m,
        }
    }
}

impl PointRecord {
    fn correspondence(&self, lens: &Camera) -> Option<Correspondence> {
        let point =
            Correspondence::new(lens, self.x_in_target_m.into(), self.pixel.into(), self.sigma_px).ok()?;
        let covariance_px2 =
            self.covariance_px2.map(|[uu_px2, uv_px2, vv_px2]| PixelCovariance { uu_px2, uv_px2, vv_px2 });
        Some(Correspondence { covariance_px2, sigma_m: self.sigma_m, ..point })
    }
}
