//! How far a tag is from where the map says.
//!
//! ```text
//!   δ  motion of the tag, about its centre, from where the others' pose puts it to where it is seen, covariance C
//!   s  the scale at which motions N(0, s² S₀) would be as large as δ;  d = s²S₀ (s²S₀ + C)⁻¹ δ  its best estimate
//! ```
//! docs/math/tag_map.md eqs. (8)–(10).

use super::{SeenTag, TagView};
use crate::locate::choose::Minimum;
use crate::locate::consistency::inconsistent_above;
use crate::locate::{Config, PoseEstimate, locate};
use crate::{Matrix6, Vector6};

/// A tag that is not where the map says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DisplacedTag {
    /// Its id.
    pub id: u32,
    /// How far its centre is from where the map says, metres; none where the tag alone gives no pose.
    pub distance_m: Option<f64>,
    /// By how much it is rotated, radians.
    pub rotation_rad: Option<f64>,
    /// The distance, in this direction and with this much rotation in proportion, from which on a tag is left out: what tolerance and
    /// noise exceed once in ten thousand.
    pub limit_m: Option<f64>,
}

impl DisplacedTag {
    /// Whether tolerance and noise do not explain it, as far as the tag alone gives a pose.
    pub(super) fn is_proven(&self) -> bool {
        self.distance_m.zip(self.limit_m).is_none_or(|(distance_m, limit_m)| limit_m < distance_m)
    }

    fn unknown(id: u32) -> Self {
        DisplacedTag { id, distance_m: None, rotation_rad: None, limit_m: None }
    }
}

/// Of the tag with this index, the pose being known from others.
pub(super) fn displaced(view: &TagView, index: usize, others: &PoseEstimate) -> DisplacedTag {
    let Some(tag) = view.tags.get(index) else { return DisplacedTag::unknown(0) };
    let Ok(own) = locate(&tag.corners, view.camera, &Config { groups: &[], ..*view.config }) else {
        return DisplacedTag::unknown(tag.id);
    };
    // A square seen nearly from the front has two poses: the one that is less of a displacement.
    let found =
        own.minima().filter(|h| h.is_alternative).filter_map(|h| displacement(tag, others, &h.minimum));
    let least = found.min_by(|a, b| a.scale.total_cmp(&b.scale));
    least.map_or(DisplacedTag::unknown(tag.id), |d| DisplacedTag {
        id: tag.id,
        distance_m: Some(d.motion.fixed_rows::<3>(3).norm()),
        rotation_rad: Some(d.motion.fixed_rows::<3>(0).norm()),
        limit_m: Some(d.motion.fixed_rows::<3>(3).norm() * d.limit),
    })
}

struct Displacement {
    motion: Vector6,
    scale: f64,
    /// The part of it that would just be left out; 1 and more where it is no displacement that tolerance and noise do not explain.
    limit: f64,
}

/// `own` is the map's pose by this tag alone.
fn displacement(tag: &SeenTag, others: &PoseEstimate, own: &Minimum) -> Option<Displacement> {
    let centre = others.cam_from_target * tag.group.centre_in_target;
    let mut about_centre = Matrix6::identity();
    about_centre.fixed_view_mut::<3, 3>(3, 0).copy_from(&-centre.cross_matrix());
    let seen = about_centre * (own.cam_from_target * others.cam_from_target.inverse()).log();
    let noise = about_centre * (own.covariance + others.covariance) * about_centre.transpose();
    let mut allowed = noise + tag.group.motion_covariance(&nalgebra::Vector3::zeros());
    let excess = seen.dot(&allowed.cholesky()?.solve(&seen));
    let limit = (inconsistent_above(6) / excess).sqrt();
    let turn = (1.0 / tag.size_m).powi(2);
    let shape = Matrix6::from_diagonal(&Vector6::new(turn, turn, turn, 1.0, 1.0, 1.0));
    let scale = scale(&seen, &noise, &shape)?;
    allowed = noise + shape * (scale * scale);
    let motion = shape * (scale * scale) * allowed.cholesky()?.solve(&seen);
    motion.sum().is_finite().then_some(Displacement { motion, scale, limit })
}

/// s with δᵀ (s²S₀ + C)⁻¹ δ = 6; the least tried where δ is no larger than its noise.
fn scale(seen: &Vector6, noise: &Matrix6, shape: &Matrix6) -> Option<f64> {
    let is_large =
        |s: f64| -> Option<bool> { Some(6.0 < seen.dot(&(noise + shape * (s * s)).cholesky()?.solve(seen))) };
    // Metres: a micrometre to ten thousand kilometres, to 1e-12 of it.
    let (mut low, mut high) = (1e-6f64, 1e7f64);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if is_large(middle)? { low = middle } else { high = middle }
    }
    Some(low)
}
