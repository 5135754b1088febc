//! What the demo ships: images, cameras, targets and where the cameras truly were. All of it is drawn by
//! `crates/resight/tools/make_demo.rs`.

use anyhow::{Context, Result};
use resight::core::{Point, Pose};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

macro_rules! shipped {
    ($($name:literal),* $(,)?) => { [$(($name, include_bytes!(concat!("../../../../../testdata/demo/", $name)).as_slice())),*] };
}

const FILES: [(&str, &[u8]); 9] = shipped![
    "left.png",
    "right.png",
    "critical.png",
    "left.toml",
    "right.toml",
    "left-distortion-forgotten.toml",
    "dots.toml",
    "grid.toml",
    "truth.toml",
];

/// Unpacks everything into a folder, which is made if need be.
pub fn unpack(folder: &Path) -> Result<()> {
    crate::files::make_folder("-o", folder)?;
    for (name, bytes) in FILES {
        resight::formats::write_atomically(folder.join(name), bytes)?;
    }
    Ok(())
}

/// As `truth.toml` writes a pose.
#[derive(Deserialize)]
struct TruthPose {
    rotation_wxyz: [f64; 4],
    translation_m: [f64; 3],
}

/// True poses by name, e.g. `left_from_dots`.
pub struct Truth(BTreeMap<String, TruthPose>);

impl Truth {
    /// Reads `truth.toml` of an unpacked folder.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join("truth.toml");
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        Ok(Truth(toml::from_str(&text).with_context(|| path.display().to_string())?))
    }

    /// One of its poses.
    pub fn pose(&self, b_from_a: &str) -> Result<Pose> {
        let t = self.0.get(b_from_a).with_context(|| format!("truth.toml has no {b_from_a}"))?;
        Ok(Pose::from_quaternion_wxyz(t.rotation_wxyz, Point::from(t.translation_m)))
    }
}
