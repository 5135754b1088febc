//! The lens as files state it, on its way to and from `core::Camera`.
//!
//! One mirror for all formats: each format knows its own names and orders, this file alone knows the core's types.

use super::document::Fault;
use super::entry::Entry;
use super::{WriteError, plausible};
use crate::core::camera::{
    BrownConrady, CameraMatrix, DoubleSphere, Eucm, Fov, ImageSize, KannalaBrandt, Omni, Photogrammetric,
    PhotogrammetricParameters, Pinhole,
};
use crate::core::{Camera, Error, Lens};

/// Model and coefficients, in OpenCV's or Kalibr's order.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum LensNumbers {
    Pinhole,
    /// k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [τx τy]]]].
    BrownConrady(Vec<f64>),
    /// k1 k2 k3 k4 of θ + k1 θ³ + ….
    KannalaBrandt([f64; 4]),
    /// Mei: mirror parameter and k1 k2 p1 p2.
    Omni {
        xi: f64,
        k1k2p1p2: [f64; 4],
    },
    Eucm {
        alpha: f64,
        beta: f64,
    },
    DoubleSphere {
        xi: f64,
        alpha: f64,
    },
    Fov {
        w_rad: f64,
    },
    Photogrammetric(PhotogrammetricParameters),
}

impl LensNumbers {
    /// The model, as messages name it.
    pub fn model(&self) -> &'static str {
        match self {
            LensNumbers::Pinhole => "pinhole",
            LensNumbers::BrownConrady(_) => "brown_conrady",
            LensNumbers::KannalaBrandt(_) => "kannala_brandt",
            LensNumbers::Omni { .. } => "omni",
            LensNumbers::Eucm { .. } => "eucm",
            LensNumbers::DoubleSphere { .. } => "double_sphere",
            LensNumbers::Fov { .. } => "fov",
            LensNumbers::Photogrammetric(_) => "photogrammetric",
        }
    }

    /// k1, k2, p1, p2 of the models that have them.
    fn radial_and_tangential(&self) -> Option<[f64; 4]> {
        match self {
            LensNumbers::BrownConrady(d) => d.first_chunk().copied(),
            LensNumbers::Omni { k1k2p1p2, .. } => Some(*k1k2p1p2),
            _ => None,
        }
    }

    fn lens(&self, matrix: CameraMatrix) -> Result<Lens, Error> {
        Ok(match self {
            LensNumbers::Pinhole => Pinhole::new(matrix)?.into(),
            LensNumbers::BrownConrady(d) => BrownConrady::new(matrix, d)?.into(),
            LensNumbers::KannalaBrandt(k) => KannalaBrandt::new(matrix, k)?.into(),
            LensNumbers::Omni { xi, k1k2p1p2 } => Omni::new(matrix, *xi, k1k2p1p2)?.into(),
            LensNumbers::Eucm { alpha, beta } => Eucm::new(matrix, *alpha, *beta)?.into(),
            LensNumbers::DoubleSphere { xi, alpha } => DoubleSphere::new(matrix, *xi, *alpha)?.into(),
            LensNumbers::Fov { w_rad } => Fov::new(matrix, *w_rad)?.into(),
            LensNumbers::Photogrammetric(table) => Photogrammetric::new(*table)?.into(),
        })
    }
}

/// A camera from its stated numbers, checked; `at` is blamed.
pub(super) fn camera(
    at: &Entry<'_>,
    numbers: &LensNumbers,
    matrix: CameraMatrix,
    size: Option<ImageSize>,
    warnings: &mut Vec<String>,
) -> Result<Camera, Fault> {
    let image = size.map_or_else(String::new, |s| format!(" (image {}×{} px)", s.width_px, s.height_px));
    let camera = numbers
        .lens(matrix)
        .and_then(|lens| Camera::new(lens, size))
        .map_err(|e| at.fault(format!("{e}{image}")))?;
    warnings.extend(
        plausible::of_lens(numbers.radial_and_tangential(), &matrix, size)
            .into_iter()
            .map(|remark| if at.path.is_empty() { remark } else { format!("{}: {remark}", at.path) }),
    );
    Ok(camera)
}

/// The stated numbers of a camera; an error for the photogrammetric model, which has no camera matrix in pixels.
pub(super) fn numbers_of(camera: &Camera) -> Result<(CameraMatrix, LensNumbers), WriteError> {
    let matrix = camera.matrix().ok_or_else(|| {
        WriteError(
            "the photogrammetric model has its own unit of image coordinates; only resight files hold it"
                .into(),
        )
    })?;
    let numbers = match &camera.lens {
        Lens::Pinhole(_) => LensNumbers::Pinhole,
        Lens::BrownConrady(m) => LensNumbers::BrownConrady(m.coefficients().to_vec()),
        Lens::KannalaBrandt(m) => LensNumbers::KannalaBrandt(m.coefficients()),
        Lens::Omni(m) => LensNumbers::Omni { xi: m.xi(), k1k2p1p2: m.distortion() },
        Lens::Eucm(m) => LensNumbers::Eucm { alpha: m.alpha(), beta: m.beta() },
        Lens::DoubleSphere(m) => LensNumbers::DoubleSphere { xi: m.xi(), alpha: m.alpha() },
        Lens::Fov(m) => LensNumbers::Fov { w_rad: m.w_rad() },
        other => {
            return Err(WriteError(format!("no file format here holds the {} model", other.model_name())));
        }
    };
    Ok((matrix, numbers))
}

/// Brown–Conrady coefficients in one of the `counts` (rising) that a format has: their own count where it is listed,
/// else the next one with zeros added; none when a coefficient beyond the last count is not zero.
pub(super) fn in_counts(d: &[f64], counts: &[usize]) -> Option<Vec<f64>> {
    if counts.contains(&d.len()) {
        return Some(d.to_vec());
    }
    let used = d.iter().rposition(|x| *x != 0.0).map_or(0, |last| last + 1);
    let count = counts.iter().find(|n| used <= **n && (d.len() <= **n || Some(*n) == counts.last()))?;
    let mut sized = d.to_vec();
    sized.resize(*count, 0.0);
    Some(sized)
}

#[cfg(test)]
mod tests {
    use super::in_counts;

    #[test]
    fn coefficients_keep_their_count_or_are_padded_and_never_lose_a_value() {
        let counts = [4, 5, 8];
        assert_eq!(in_counts(&[1.0; 5], &counts), Some(vec![1.0; 5]));
        assert_eq!(in_counts(&[1.0; 8], &[5]), None);
        assert_eq!(in_counts(&[1.0; 4], &[5]), Some(vec![1.0, 1.0, 1.0, 1.0, 0.0]));
        let mut padded = vec![1.0; 8];
        padded.resize(12, 0.0);
        assert_eq!(in_counts(&padded, &counts), Some(vec![1.0; 8]));
        padded[11] = 0.5;
        assert_eq!(in_counts(&padded, &counts), None);
    }
}
