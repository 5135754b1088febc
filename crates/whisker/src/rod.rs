//! The whisker itself: an inextensible, unshearable rod clamped at s = 0.

use crate::Error;

/// Bending stiffness EI along the arc length.
#[derive(Debug, Clone, PartialEq)]
pub enum Stiffness {
    /// The same everywhere, N·m².
    Uniform {
        /// EI, N·m².
        ei_n_m2: f64,
    },
    /// A cone: EI(s) = EI₀ (1 − τ s/L)⁴.
    Taper {
        /// EI₀, at the clamp, N·m².
        ei_base_n_m2: f64,
        /// τ = 1 − tip diameter / base diameter; below 1.
        taper: f64,
    },
    /// Any profile: EI at increasing arc lengths, interpolated between them, the first at 0 and the last at the length.
    Profile {
        /// Arc lengths, metres.
        s_m: Vec<f64>,
        /// EI there, N·m².
        ei_n_m2: Vec<f64>,
    },
}

/// Curvature of the unloaded whisker, counter-clockwise positive.
#[derive(Debug, Clone, PartialEq)]
pub enum IntrinsicCurvature {
    /// A circular arc (0: straight), 1/m.
    Constant {
        /// κ₀, 1/m.
        per_m: f64,
    },
    /// Any shape: κ₀ at increasing arc lengths, interpolated between them.
    Profile {
        /// Arc lengths, metres.
        s_m: Vec<f64>,
        /// κ₀ there, 1/m.
        per_m: Vec<f64>,
    },
}

/// A whisker.
#[derive(Debug, Clone, PartialEq)]
pub struct Rod {
    /// L, metres.
    pub length_m: f64,
    /// EI(s).
    pub stiffness: Stiffness,
    /// κ₀(s).
    pub intrinsic_curvature: IntrinsicCurvature,
    /// Diameters at clamp and tip, metres; 0 where contacts lie on the centre line.
    pub diameters_m: [f64; 2],
}

impl Rod {
    /// A straight rod of constant stiffness and no thickness.
    pub fn uniform(length_m: f64, ei_n_m2: f64) -> Result<Self, Error> {
        let rod = Rod {
            length_m,
            stiffness: Stiffness::Uniform { ei_n_m2 },
            intrinsic_curvature: IntrinsicCurvature::Constant { per_m: 0.0 },
            diameters_m: [0.0, 0.0],
        };
        rod.check()?;
        Ok(rod)
    }

    /// Refuses what is no rod.
    pub fn check(&self) -> Result<(), Error> {
        positive("the whisker's length", self.length_m)?;
        match &self.stiffness {
            Stiffness::Uniform { ei_n_m2 } => positive("the whisker's EI", *ei_n_m2),
            Stiffness::Taper { ei_base_n_m2, taper } => {
                positive("the whisker's EI at the base", *ei_base_n_m2)?;
                positive("the tip's share of the base diameter", 1.0 - taper)
            }
            Stiffness::Profile { ei_n_m2, .. } => {
                ei_n_m2.iter().try_for_each(|ei| positive("the whisker's EI", *ei))
            }
        }
    }

    /// EI at the clamp, N·m².
    pub fn ei_base_n_m2(&self) -> f64 {
        match &self.stiffness {
            Stiffness::Uniform { ei_n_m2 } => *ei_n_m2,
            Stiffness::Taper { ei_base_n_m2, .. } => *ei_base_n_m2,
            Stiffness::Profile { ei_n_m2, .. } => ei_n_m2[0],
        }
    }

    /// κ₀ where it is constant, 1/m.
    pub fn constant_curvature_per_m(&self) -> Option<f64> {
        match &self.intrinsic_curvature {
            IntrinsicCurvature::Constant { per_m } => Some(*per_m),
            IntrinsicCurvature::Profile { .. } => None,
        }
    }
}

/// NaN is not positive either.
fn positive(what: &'static str, seen: f64) -> Result<(), Error> {
    if seen.is_finite() && 0.0 < seen { Ok(()) } else { Err(Error::NotPositive { what, seen }) }
}
