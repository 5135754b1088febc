//! The time of each frame of each camera.

use super::super::observed::{Collected, LeftOut};
use crate::error::{Error, FileError};
use crate::input::not_among;
use crate::input::table::Table;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The times of frames, by camera and name of the frame.
#[derive(Debug, Clone, Default)]
pub struct FrameTimes {
    times: HashMap<(String, String), f64>,
    /// The file that they come from.
    file: Option<PathBuf>,
}

impl FrameTimes {
    /// Sets the time of a frame, seconds, on a clock that all cameras share; returns whether it had none before. `frame` is the image's name
    /// without its extension, or the index of a video's frame, counted from 0.
    pub fn insert(&mut self, camera: &str, frame: &str, t_s: f64) -> bool {
        self.times.insert((camera.to_string(), frame.to_string()), t_s).is_none()
    }

    /// Reads the columns camera, frame, t_s of a CSV file; `cameras` are the known names.
    ///
    /// # Errors
    /// With its line: an unknown camera, a frame without a name or with two times, a time that is not a number.
    pub fn read(path: impl AsRef<Path>, cameras: &[String]) -> Result<Self, FileError> {
        let path = path.as_ref();
        let table = Table::open(path, "camera,frame,t_s")?;
        let (camera, frame, t_s) =
            (table.need("camera", None)?, table.need("frame", None)?, table.need("t_s", None)?);
        let mut times = FrameTimes { times: HashMap::new(), file: Some(path.to_path_buf()) };
        table.each(|row| {
            let name = row.text(camera).unwrap_or_default();
            if !cameras.iter().any(|known| known == name) {
                let what = format!("is `{name}`: {}", not_among(name, "camera", cameras));
                return Err(row.complaint(camera, &what));
            }
            let Some(label) = row.text(frame) else {
                return Err(row.complaint(frame, "is empty; name the frame"));
            };
            let time = row.number(t_s)?;
            if !time.is_finite() {
                return Err(row.complaint(t_s, &format!("is {time}; remove the row or correct it")));
            }
            if !times.insert(name, label, time) {
                let what = format!("is `{label}` a second time for camera {name}");
                return Err(row.complaint(frame, &what));
            }
            Ok(())
        })?;
        Ok(times)
    }

    /// Refuses unknown cameras, and times that are not numbers.
    pub(super) fn check(&self, cameras: &[String]) -> Result<(), Error> {
        for ((camera, frame), t_s) in &self.times {
            if !cameras.contains(camera) {
                return Err(Error::request(format!("timestamps: {}", not_among(camera, "camera", cameras))));
            }
            if !t_s.is_finite() {
                return Err(Error::request(format!(
                    "timestamps: frame {frame} of camera {camera} is at {t_s} s"
                )));
            }
        }
        Ok(())
    }

    /// Gives each frame its time; frames without one cannot be matched and are left out.
    pub(super) fn stamp(&self, collected: &mut Collected) -> Result<(), Error> {
        let frames = std::mem::take(&mut collected.frames);
        let n = frames.len();
        for mut frame in frames {
            let camera = collected.cameras[frame.camera].name.clone();
            let key = (camera, frame.name.clone());
            frame.t_s = self.times.get(&key).copied();
            if frame.t_s.is_some() {
                collected.frames.push(frame);
                continue;
            }
            collected.left_out.push(LeftOut {
                camera: key.0,
                view: frame.name,
                what: "frame".into(),
                reason: "no time stamp of this frame in the file of --timestamps".into(),
            });
        }
        collected.files.extend(self.file.clone());
        if 0 < n && collected.frames.is_empty() {
            return Err(Error::request(format!(
                "--timestamps names none of the {n} frames: `frame` is an image's name without its ending, or the number of a video's frame counted from 0"
            )));
        }
        Ok(())
    }
}
