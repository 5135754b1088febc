//! The causes of an inconsistent hand–eye answer, in words.

use super::settle::Settled;
use super::shared::LensError;
use super::written::RotationConvention;
use super::{HandEye, MAX_GRIPPER_SIGMA_BY_REACH, MAX_GRIPPER_SIGMA_RAD, TargetSize};
use crate::budget::{Accounted, ErrorSource, Warning};
use crate::multiview::intrinsics_check::Group;
use core::fmt;

/// A possible cause.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum HandEyeCause {
    /// The target is `ratio` times as large as stated, or the gripper's positions are in another unit, or the focal length is wrong by this
    /// factor: with this ratio the views agree.
    Size {
        /// True size divided by stated size.
        ratio: f64,
        /// Its standard deviation.
        sigma: f64,
    },
    /// The gripper's motions contradict the lens, which is another one by a part of its focal length: with it the views agree.
    Lens {
        /// What is different.
        error: LensError,
        /// By how much, as a part of the focal length.
        part: f64,
        /// Its standard deviation.
        sigma: f64,
    },
    /// The pixels contradict the given intrinsics.
    Intrinsics {
        /// The wrong groups, the most significant first.
        groups: Vec<Group>,
        /// Corrected divided by given focal length, where it is among them.
        focal_ratio: Option<f64>,
    },
    /// The views agree if every pose of the gripper is inverted.
    InvertedGripper,
    /// The views agree if the numbers of the quaternion are in another order.
    QuaternionOrder,
    /// The views agree if every rotation of the gripper is transposed, with its position as it is.
    TransposedRotation,
    /// The views agree if the three numbers of each rotation are read as this convention.
    Convention(RotationConvention),
    /// The views agree if every view has the gripper pose of its neighbour (this many rows later).
    ShiftedRows(isize),
    /// The gripper's noise would have to be larger than that of any robot.
    LargeNoise {
        /// Of its orientation, rad.
        sigma_rad: f64,
        /// Of its position, m.
        sigma_m: f64,
        /// The gripper's travel, or the distance of the target, m.
        reach_m: f64,
    },
    /// The stated noise of the gripper does not explain the views' disagreement, which is `ratio` times as large.
    StatedNoise {
        /// Square root of χ² of the poses per degree of freedom.
        ratio: f64,
    },
    /// The pixels of single views do not fit the target: their residuals are `ratio` times the stated sigma.
    Pixels {
        /// Square root of χ² of the pixels per degree of freedom.
        ratio: f64,
    },
    /// More views contradict the others than expected of a few wrong ones.
    ManyContradict {
        /// Number of views that contradict.
        n_rejected: usize,
        /// Number of views with a pose.
        n_views: usize,
    },
}

/// What explains the views of a hand–eye answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum HandEyeExplanation {
    /// Everything is as stated.
    AsStated,
    /// The target has another size, or the gripper's positions another unit.
    Size,
    /// The lens is another one.
    Lens(LensError),
}

/// Something that is said against a hand–eye answer.
#[derive(Debug, Clone, PartialEq)]
pub enum HandEyeWarning {
    /// A cause of an inconsistent answer.
    Cause(HandEyeCause),
    /// Residuals exceed the stated noise by this factor of standard deviations.
    Residuals(f64),
    /// Neighbouring views share errors, which make standard deviations of X or Z larger by this factor.
    SharedInBlock(f64),
    /// The target's size is off, by little.
    Size(TargetSize),
    /// The gripper's motions fit another lens a little better: what is different, and by which part of the focal length.
    OtherLens(LensError, f64),
    /// The pixels contradict the intrinsics; by how far the camera's position moves with better ones, m.
    Lens(f64),
    /// A view took no part.
    LeftOut(usize),
}

impl Warning for HandEyeWarning {
    fn accounted(&self) -> Accounted {
        match self {
            HandEyeWarning::Cause(
                HandEyeCause::Size { .. }
                | HandEyeCause::Lens { .. }
                | HandEyeCause::Intrinsics { .. }
                | HandEyeCause::InvertedGripper
                | HandEyeCause::QuaternionOrder
                | HandEyeCause::TransposedRotation
                | HandEyeCause::Convention(_)
                | HandEyeCause::ShiftedRows(_)
                | HandEyeCause::LargeNoise { .. }
                | HandEyeCause::StatedNoise { .. }
                | HandEyeCause::Pixels { .. }
                | HandEyeCause::ManyContradict { .. },
            ) => Accounted::Status,
            HandEyeWarning::Residuals(_) => Accounted::Parts(&[ErrorSource::Residuals]),
            HandEyeWarning::SharedInBlock(_) => Accounted::Parts(&[ErrorSource::SharedInBlock]),
            HandEyeWarning::Size(_) => Accounted::Parts(&[ErrorSource::Target]),
            HandEyeWarning::Lens(_) | HandEyeWarning::OtherLens(..) => Accounted::Parts(&[ErrorSource::Lens]),
            HandEyeWarning::LeftOut(_) => Accounted::Nothing,
        }
    }
}

impl HandEye {
    /// Returns what is said against the answer, the likely cause first.
    pub fn warnings(&self) -> Vec<HandEyeWarning> {
        let mut warnings: Vec<HandEyeWarning> =
            self.causes.iter().cloned().map(HandEyeWarning::Cause).collect();
        warnings.extend((1.0 < self.noise_scale).then(|| HandEyeWarning::Residuals(self.noise_scale.sqrt())));
        let shared = self.block_scale[0].max(self.block_scale[1]);
        let in_block = (1.0 < shared).then(|| HandEyeWarning::SharedInBlock(shared.sqrt()));
        warnings.extend(in_block);
        warnings.extend(self.small_size.map(HandEyeWarning::Size));
        let other = self.other_lens.map(|(error, part)| HandEyeWarning::OtherLens(error, part));
        warnings.extend(other);
        warnings.extend(self.lens_shift_m.map(HandEyeWarning::Lens));
        let left_out = self.views.iter().enumerate().filter(|(_, view)| view.rejected.is_some());
        warnings.extend(left_out.map(|(i, _)| HandEyeWarning::LeftOut(i)));
        warnings
    }
}

/// Reports noise beyond that of any robot.
pub(super) fn large_noise(settled: &Settled) -> Option<HandEyeCause> {
    let ([sigma_rad, sigma_m], reach_m) = (settled.sigmas()?, settled.reach_m());
    let is_large = MAX_GRIPPER_SIGMA_RAD < sigma_rad || MAX_GRIPPER_SIGMA_BY_REACH * reach_m < sigma_m;
    is_large.then_some(HandEyeCause::LargeNoise { sigma_rad, sigma_m, reach_m })
}

impl fmt::Display for HandEyeCause {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            HandEyeCause::Size { ratio, sigma } => size(f, *ratio, *sigma),
            HandEyeCause::Lens { error, part, sigma } => write!(
                f,
                "by the gripper's motions {error} is {:.1} % ± {:.1} % {} than stated",
                100.0 * part.abs(),
                100.0 * sigma,
                if 0.0 < *part { "larger" } else { "smaller" }
            ),
            HandEyeCause::Intrinsics { groups, focal_ratio } => {
                let names: Vec<&str> = groups.iter().map(|group| group.name()).collect();
                write!(f, "the intrinsics do not fit the pixels: {}", names.join(" and "))?;
                match focal_ratio {
                    Some(ratio) => write!(f, " (the focal length should be about {ratio:.3} times the one given)"),
                    None => Ok(()),
                }
            }
            HandEyeCause::InvertedGripper => f.write_str(
                "the views agree once every pose of the gripper is inverted: gripper_from_base was given for base_from_gripper, target_from_cam for cam_from_target, or the target is on the gripper and not the camera (or the other way round)",
            ),
            HandEyeCause::QuaternionOrder => f.write_str(
                "the views agree once the quaternion's numbers are read in another order: its scalar is first in one convention and last in the other",
            ),
            HandEyeCause::TransposedRotation => f.write_str(
                "the views agree once every rotation of the gripper is transposed and its position kept: the matrices were written column by column, or the quaternions are conjugated",
            ),
            HandEyeCause::Convention(convention) => write!(
                f,
                "the views agree once the three numbers of each rotation are read as {convention}"
            ),
            HandEyeCause::ShiftedRows(by) => write!(
                f,
                "the views agree once each takes the gripper pose {} row{} {}: rows and images are out of step",
                by.unsigned_abs(),
                if by.unsigned_abs() == 1 { "" } else { "s" },
                if *by < 0 { "before" } else { "after" }
            ),
            HandEyeCause::LargeNoise { sigma_rad, sigma_m, reach_m } => write!(
                f,
                "the gripper's poses would have to be wrong by {:.2} degrees and {:.1} mm (1 sigma, over {:.2} m): more than 2 degrees or 2 % of the way is no robot's; state the noise if yours is as inexact",
                sigma_rad.to_degrees(),
                1e3 * sigma_m,
                reach_m
            ),
            HandEyeCause::StatedNoise { ratio } => write!(
                f,
                "the views disagree {ratio:.1} times as much as the stated sigmas explain; without stated sigmas the gripper's noise is estimated"
            ),
            HandEyeCause::Pixels { ratio } => write!(
                f,
                "the pixels of the single views do not fit the target: {ratio:.1} times their sigma; wrong intrinsics or a wrong target are likely"
            ),
            HandEyeCause::ManyContradict { n_rejected, n_views } => write!(
                f,
                "{n_rejected} of {n_views} views contradict the others, more than a few spoilt ones explain: gripper poses and images may not belong together"
            ),
        }
    }
}

/// Ratios between units.
const UNITS: [(f64, &str); 5] = [
    (1e-3, "the target (or the gripper) is given in millimetres where metres are needed"),
    (1e-2, "the target (or the gripper) is given in centimetres where metres are needed"),
    (0.0254, "the target (or the gripper) is given in inches where metres are needed"),
    (1e3, "the gripper's positions are given in millimetres where metres are needed"),
    (1e2, "the gripper's positions are given in centimetres where metres are needed"),
];
/// A ratio this near to that of two units is attributed to them.
const UNIT_TOLERANCE: f64 = 0.05;

fn size(f: &mut fmt::Formatter, ratio: f64, sigma: f64) -> fmt::Result {
    let unit = UNITS.iter().find(|(factor, _)| (ratio / factor - 1.0).abs() < UNIT_TOLERANCE);
    if let Some((_, meaning)) = unit {
        return write!(
            f,
            "measured by the gripper the target is {ratio:.4} times as large as stated: {meaning}"
        );
    }
    let (percent, word) = (100.0 * (ratio - 1.0).abs(), if 1.0 < ratio { "larger" } else { "smaller" });
    write!(
        f,
        "measured by the gripper the target is {percent:.1} % ± {:.1} % {word} than stated: its size, the unit of the gripper's positions or the focal length is wrong",
        100.0 * sigma
    )
}
