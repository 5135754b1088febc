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
    /// Any profile: EI at increasing arc lengths, the first at 0 and the last at the length. Between them EI^¼, the diameter of a
    /// round whisker, is linear: every piece is a cone.
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
    /// Any shape: κ₀ at increasing arc lengths, the first at 0 and the last at the length, linear between them.
    Profile {
        /// Arc lengths, metres.
        s_m: Vec<f64>,
        /// κ₀ there, 1/m.
        per_m: Vec<f64>,
    },
}

/// Lengths of whiskers, metres: from a mite's hair to a mast.
const LENGTHS_M: [f64; 2] = [1e-5, 100.0];
/// Thickest whisker, as a share of its length: a rod thicker than that shears, which the elastica does not know.
pub(crate) const THICKEST_SHARE: f64 = 0.2;
/// Stiffnesses, N·m²: from the tip of a rat's smallest whisker with room, to a steel mast.
const EI_N_M2: [f64; 2] = [1e-20, 1e8];
/// Softest over stiffest part: a tip of a thousandth of the diameter at the clamp.
const LEAST_EI_RATIO: f64 = 1e-12;
/// Diameter of the tip over that of the base: whiskers grow thinner, rods keep their width; a tip far thicker is a base and a tip exchanged.
const THICKEST_TIP: f64 = 2.0;
/// Most of a rotation that an unloaded whisker is curled up by, radians: two whole turns.
const MOST_TURN_RAD: f64 = 4.0 * std::f64::consts::PI;

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

    /// Refuses what is no rod, or none that the elastica describes: too short, long, soft, stiff, thick, tapered or coiled for any
    /// whisker, as a slipped decimal or another unit makes it.
    pub fn check(&self) -> Result<(), Error> {
        self.check_numbers()?;
        let length_m = self.length_m;
        within("the whisker's length, m", length_m, LENGTHS_M)?;
        let thickest_m = self.diameters_m[0].max(self.diameters_m[1]);
        within("the whisker's diameter, m", thickest_m, [0.0, THICKEST_SHARE * length_m])?;
        let (softest, stiffest) = self.ei_range_n_m2();
        within("the whisker's EI, N·m²", softest, EI_N_M2)?;
        within("the whisker's EI, N·m²", stiffest, EI_N_M2)?;
        within("the whisker's smallest EI over its largest", softest / stiffest, [LEAST_EI_RATIO, 1.0])?;
        if let Stiffness::Taper { taper, .. } = self.stiffness {
            let what = "the tip's diameter over the base's (are the two exchanged?)";
            within(what, 1.0 - taper, [0.0, THICKEST_TIP])?;
        }
        let curvature = match &self.intrinsic_curvature {
            IntrinsicCurvature::Constant { per_m } => per_m.abs(),
            IntrinsicCurvature::Profile { per_m, .. } => per_m.iter().fold(0.0, |most, k| k.abs().max(most)),
        };
        within(
            "the whisker's intrinsic curvature times its length, rad",
            curvature * length_m,
            [0.0, MOST_TURN_RAD],
        )
    }

    /// Smallest and largest EI, N·m².
    fn ei_range_n_m2(&self) -> (f64, f64) {
        match &self.stiffness {
            Stiffness::Uniform { ei_n_m2 } => (*ei_n_m2, *ei_n_m2),
            Stiffness::Taper { ei_base_n_m2, taper } => {
                let tip = ei_base_n_m2 * (1.0 - taper).powi(4);
                (ei_base_n_m2.min(tip), ei_base_n_m2.max(tip))
            }
            Stiffness::Profile { ei_n_m2, .. } => {
                ei_n_m2.iter().fold((f64::INFINITY, 0.0), |(low, high), ei| (ei.min(low), ei.max(high)))
            }
        }
    }

    /// Refuses what is no number, not positive where it must be, or no profile.
    fn check_numbers(&self) -> Result<(), Error> {
        positive("the whisker's length", self.length_m)?;
        self.diameters_m.iter().try_for_each(|d| not_negative("the whisker's diameter", *d))?;
        match &self.stiffness {
            Stiffness::Uniform { ei_n_m2 } => positive("the whisker's EI", *ei_n_m2)?,
            Stiffness::Taper { ei_base_n_m2, taper } => {
                positive("the whisker's EI at the base", *ei_base_n_m2)?;
                positive("the tip's share of the base diameter", 1.0 - taper)?;
            }
            Stiffness::Profile { s_m, ei_n_m2 } => {
                self.check_profile("the profile of EI", s_m, ei_n_m2.len())?;
                ei_n_m2.iter().try_for_each(|ei| positive("the whisker's EI", *ei))?;
            }
        }
        match &self.intrinsic_curvature {
            IntrinsicCurvature::Constant { per_m } => finite(std::slice::from_ref(per_m)),
            IntrinsicCurvature::Profile { s_m, per_m } => {
                self.check_profile("the profile of the intrinsic curvature", s_m, per_m.len())?;
                finite(per_m)
            }
        }
    }

    fn check_profile(&self, what: &'static str, s_m: &[f64], values: usize) -> Result<(), Error> {
        let (first_m, last_m) =
            (s_m.first().copied().unwrap_or(f64::NAN), s_m.last().copied().unwrap_or(f64::NAN));
        let increases = s_m.windows(2).all(|pair| pair[0] < pair[1]);
        // A length in other units and back differs in its last digits.
        let to_the_tip = (last_m - self.length_m).abs() <= 1e-9 * self.length_m;
        if 2 <= s_m.len() && s_m.len() == values && increases && first_m == 0.0 && to_the_tip {
            return Ok(());
        }
        Err(Error::BadProfile { what, knots: s_m.len(), values, first_m, last_m, length_m: self.length_m })
    }

    /// How many knots its profiles have.
    pub(crate) fn knots(&self) -> usize {
        let stiffness = match &self.stiffness {
            Stiffness::Profile { s_m, .. } => s_m.len(),
            _ => 0,
        };
        match &self.intrinsic_curvature {
            IntrinsicCurvature::Profile { s_m, .. } => stiffness + s_m.len(),
            IntrinsicCurvature::Constant { .. } => stiffness,
        }
    }

    /// EI at an arc length, N·m²; past the tip that of the tip.
    pub fn ei_n_m2_at(&self, s_m: f64) -> f64 {
        match &self.stiffness {
            Stiffness::Uniform { ei_n_m2 } => *ei_n_m2,
            Stiffness::Taper { ei_base_n_m2, taper } => {
                ei_base_n_m2 * (1.0 - taper * (s_m / self.length_m).clamp(0.0, 1.0)).powi(4)
            }
            Stiffness::Profile { s_m: knots_m, ei_n_m2 } => {
                interpolated(knots_m, |i| ei_n_m2[i].sqrt().sqrt(), s_m).powi(4)
            }
        }
    }

    /// κ₀ at an arc length, 1/m; past the tip that of the tip.
    pub fn curvature_per_m_at(&self, s_m: f64) -> f64 {
        match &self.intrinsic_curvature {
            IntrinsicCurvature::Constant { per_m } => *per_m,
            IntrinsicCurvature::Profile { s_m: knots_m, per_m } => interpolated(knots_m, |i| per_m[i], s_m),
        }
    }

    /// Diameter at an arc length, metres: linear from clamp to tip, past the tip that of the tip; 0 of a rod without thickness.
    pub fn diameter_m_at(&self, s_m: f64) -> f64 {
        let [base, tip] = self.diameters_m;
        base + (tip - base) * (s_m / self.length_m).clamp(0.0, 1.0)
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

/// Linear between knots, constant outside.
fn interpolated(knots_m: &[f64], value: impl Fn(usize) -> f64, s_m: f64) -> f64 {
    let next = knots_m.partition_point(|knot| *knot <= s_m);
    if next == 0 || next == knots_m.len() {
        return value(next.saturating_sub(1));
    }
    let share = (s_m - knots_m[next - 1]) / (knots_m[next] - knots_m[next - 1]);
    value(next - 1) + share * (value(next) - value(next - 1))
}

fn within(what: &'static str, seen: f64, [least, most]: [f64; 2]) -> Result<(), Error> {
    // A ratio of equal numbers may exceed 1 by its rounding.
    let is_within = least <= seen && seen <= most * (1.0 + 1e-12);
    if is_within { Ok(()) } else { Err(Error::OutOfRange { what, seen, least, most }) }
}

fn finite(per_m: &[f64]) -> Result<(), Error> {
    if per_m.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(Error::NotFinite { what: "the whisker's intrinsic curvature" })
    }
}

fn not_negative(what: &'static str, seen: f64) -> Result<(), Error> {
    if seen.is_finite() && 0.0 <= seen { Ok(()) } else { Err(Error::Negative { what, seen }) }
}

/// NaN is not positive either.
fn positive(what: &'static str, seen: f64) -> Result<(), Error> {
    if seen.is_finite() && 0.0 < seen { Ok(()) } else { Err(Error::NotPositive { what, seen }) }
}
