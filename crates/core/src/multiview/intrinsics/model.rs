//! The lens models that are tried, and the order in which their coefficients are freed: docs/math/intrinsics.md section 3.

use crate::camera::{
    BrownConrady, Camera, DoubleSphere, Eucm, Fov, ImageSize, KannalaBrandt, Omni, Parameters, Pinhole,
};
use crate::multiview::intrinsics_check::{Direction, Group};
use crate::{CameraMatrix, Error, Lens};

/// A lens model with its estimated coefficients; the others are zero (or have the default of the model).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LensChoice {
    /// The model's name, as in camera.toml.
    pub model: &'static str,
    /// The coefficients that are estimated besides focal lengths and principal point.
    pub coefficients: &'static [&'static str],
}

/// The lens models that are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Models {
    /// Pinhole, Brown–Conrady and Kannala–Brandt, each with as many coefficients as the evidence supports.
    #[default]
    ByEvidence,
    /// The models with this name, with as many coefficients as the evidence supports.
    Named(&'static str),
    /// One model with these coefficients.
    Only(LensChoice),
}

/// All choices, those of one family in the order in which coefficients are added.
pub const CHOICES: [LensChoice; 15] = [
    LensChoice { model: Pinhole::NAME, coefficients: &[] },
    LensChoice { model: BrownConrady::NAME, coefficients: &["k1"] },
    LensChoice { model: BrownConrady::NAME, coefficients: &["k1", "k2"] },
    LensChoice { model: BrownConrady::NAME, coefficients: &["k1", "k2", "p1", "p2"] },
    LensChoice { model: BrownConrady::NAME, coefficients: &["k1", "k2", "p1", "p2", "k3"] },
    LensChoice { model: BrownConrady::NAME, coefficients: &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"] },
    LensChoice { model: KannalaBrandt::NAME, coefficients: &["k1"] },
    LensChoice { model: KannalaBrandt::NAME, coefficients: &["k1", "k2"] },
    LensChoice { model: KannalaBrandt::NAME, coefficients: &["k1", "k2", "k3"] },
    LensChoice { model: KannalaBrandt::NAME, coefficients: &["k1", "k2", "k3", "k4"] },
    LensChoice { model: Fov::NAME, coefficients: &["w"] },
    LensChoice { model: Eucm::NAME, coefficients: &["alpha", "beta"] },
    LensChoice { model: DoubleSphere::NAME, coefficients: &["xi", "alpha"] },
    LensChoice { model: Omni::NAME, coefficients: &["xi"] },
    LensChoice { model: Omni::NAME, coefficients: &["xi", "k1", "k2", "p1", "p2"] },
];

/// Names of the models that can be asked for.
pub fn model_names() -> Vec<&'static str> {
    let mut names: Vec<&'static str> = CHOICES.iter().map(|choice| choice.model).collect();
    names.dedup();
    names
}

impl Models {
    /// Returns the choices by family: a pinhole is a Brown–Conrady lens without coefficients.
    pub(super) fn families(self) -> Vec<Vec<LensChoice>> {
        let of = |names: &[&str]| -> Vec<LensChoice> {
            CHOICES.iter().filter(|choice| names.contains(&choice.model)).copied().collect()
        };
        match self {
            Models::ByEvidence => vec![of(&[Pinhole::NAME, BrownConrady::NAME]), of(&[KannalaBrandt::NAME])],
            Models::Named(name) => vec![of(&[name])],
            Models::Only(choice) => vec![vec![choice]],
        }
    }
}

impl Models {
    /// Returns the largest choice of each family that is tried by evidence and was not asked for.
    pub(super) fn not_asked_for(self) -> Vec<LensChoice> {
        if self == Models::ByEvidence {
            return Vec::new();
        }
        let families = Models::ByEvidence.families();
        families
            .iter()
            .filter_map(|family| family.iter().rev().find(|choice| choice.coefficients.len() <= 5).copied())
            .collect()
    }
}

impl LensChoice {
    /// Returns the camera of this choice nearest to `from`: its camera matrix, and its coefficients where names and model agree.
    pub(super) fn camera(&self, from: &Camera) -> Result<Camera, Error> {
        let matrix = from.matrix().unwrap_or(CameraMatrix { fx_px: 1.0, fy_px: 1.0, cx_px: 0.0, cy_px: 0.0 });
        let new = Camera { lens: self.lens(matrix)?, size: from.size };
        if from.model_name() != self.model {
            return Ok(new);
        }
        let known = from.parameters();
        let value = |(name, default): &(&'static str, f64)| {
            let is_used = self.is_free(name);
            known.iter().find(|(other, _)| is_used && other == name).map_or(*default, |(_, value)| *value)
        };
        let values: Vec<f64> = new.parameters().iter().map(value).collect();
        new.with_parameters(&values)
    }

    /// Returns the model with a camera matrix, and coefficients with which a search can start.
    pub(super) fn lens(&self, matrix: CameraMatrix) -> Result<Lens, Error> {
        Ok(match self.model {
            BrownConrady::NAME => {
                let n = [4, 5, 8].into_iter().find(|n| self.coefficients.len() <= *n).unwrap_or(8);
                BrownConrady::new(matrix, &[0.0; 8][..n])?.into()
            }
            KannalaBrandt::NAME => KannalaBrandt::new(matrix, &[0.0; 4])?.into(),
            Fov::NAME => Fov::new(matrix, 0.7)?.into(),
            Eucm::NAME => Eucm::new(matrix, 0.5, 1.0)?.into(),
            DoubleSphere::NAME => DoubleSphere::new(matrix, 0.0, 0.5)?.into(),
            Omni::NAME if self.coefficients.len() == 1 => Omni::new(matrix, 0.7, &[])?.into(),
            Omni::NAME => Omni::new(matrix, 0.7, &[0.0; 4])?.into(),
            _ => Pinhole::new(matrix)?.into(),
        })
    }

    /// Returns whether a parameter of the model is estimated.
    pub(super) fn is_free(&self, parameter: &str) -> bool {
        Group::of(parameter) != Group::Distortion || self.coefficients.contains(&parameter)
    }

    /// Returns the directions of all estimated parameters.
    pub(super) fn directions(&self, camera: &Camera) -> Vec<Direction> {
        single(&camera.parameters(), |name| self.is_free(name))
    }

    /// Describes the choice in words: `brown_conrady k1 k2`.
    pub fn label(&self) -> String {
        let mut words = vec![self.model];
        words.extend(self.coefficients);
        words.join(" ")
    }
}

/// Returns a direction for each wanted parameter.
pub(super) fn single(parameters: &Parameters, wanted: impl Fn(&str) -> bool) -> Vec<Direction> {
    let indices = (0..parameters.len()).filter(|i| wanted(parameters[*i].0));
    indices.map(|i| Direction::from_iter([(i, 1.0)])).collect()
}

/// Returns the direction of fx and fy in proportion, per unit of fx.
pub(super) fn common_focal(parameters: &Parameters) -> Direction {
    let first = parameters[0].1;
    (0..2).map(|i| (i, parameters[i].1 / first)).collect()
}

/// Returns the matrix with square pixels and the principal point at the image's centre.
pub(super) fn central_matrix(size: ImageSize, focal_px: f64) -> CameraMatrix {
    let (width, height) = (f64::from(size.width_px), f64::from(size.height_px));
    CameraMatrix { fx_px: focal_px, fy_px: focal_px, cx_px: 0.5 * (width - 1.0), cy_px: 0.5 * (height - 1.0) }
}
