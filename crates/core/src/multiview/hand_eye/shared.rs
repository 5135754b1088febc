//! Errors that all views share: of the target's size, and of the lens. docs/math/hand_eye.md section 7.

use super::views::Known;
use crate::multiview::rig_pose::{RigCost, RigView};
use crate::{Camera, Vector6};
use core::fmt;

/// An error that moves the measured poses of all views.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SharedError {
    /// The target is larger than stated by a part of its size.
    Size,
    /// The lens is another one.
    Lens(LensError),
}

/// How a lens differs from the stated one, by a part of its focal length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LensError {
    /// Its focal length is longer.
    FocalLength,
    /// Its focal length along x is longer.
    FocalLengthX,
    /// Its focal length along y is longer.
    FocalLengthY,
}

impl SharedError {
    pub const ALL: [SharedError; 4] = [
        SharedError::Size,
        SharedError::Lens(LensError::FocalLength),
        SharedError::Lens(LensError::FocalLengthX),
        SharedError::Lens(LensError::FocalLengthY),
    ];

    /// Returns how a measured pose moves for a unit of the error, as a left motion; `None` where it is not known.
    pub fn motion(self, view: &Known, candidate: usize) -> Option<Vector6> {
        let measured = &view.candidates[candidate].cam_from_target;
        match self {
            SharedError::Size => {
                let t = measured.translation;
                Some(Vector6::new(0.0, 0.0, 0.0, t.x, t.y, t.z))
            }
            SharedError::Lens(error) => {
                let [only] = view.seen else { return None };
                let through = |amount: f64| {
                    let camera = error.applied(only.camera, amount)?;
                    let other = [RigView { camera: &camera, ..*only }];
                    Some(RigCost::new(&other).refine(measured, None).ok()?.cam_from_target)
                };
                let motion = (through(STEP)? * through(-STEP)?.inverse()).log() / (2.0 * STEP);
                motion.iter().all(|x| x.is_finite()).then_some(motion)
            }
        }
    }
}

/// Steps of the numeric derivative, as a part of the focal length: far above the tolerance of a minimum, within the linear range.
const STEP: f64 = 1e-3;

impl LensError {
    /// Returns the camera with this error; `None` where its model has no such parameter.
    fn applied(self, camera: &Camera, amount: f64) -> Option<Camera> {
        let parameters = camera.parameters();
        let changed = |(name, value): &(&str, f64)| match (self, *name) {
            (LensError::FocalLength, "fx_px" | "fy_px" | "f")
            | (LensError::FocalLengthX, "fx_px")
            | (LensError::FocalLengthY, "fy_px") => value * (1.0 + amount),
            _ => *value,
        };
        let values: Vec<f64> = parameters.iter().map(changed).collect();
        let is_other = values.iter().zip(&parameters).any(|(new, (_, old))| new != old);
        is_other.then(|| camera.with_parameters(&values).ok())?
    }
}

impl fmt::Display for LensError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            LensError::FocalLength => "the focal length",
            LensError::FocalLengthX => "the focal length along x",
            LensError::FocalLengthY => "the focal length along y",
        })
    }
}
