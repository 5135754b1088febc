//! Many readings as one: their mean on SE(3), or of turns on SO(3), how they lie about it, and how well a single one is known.
//!
//! ```text
//!   X_i  readings with weights n_i, each itself a mean with scatter S_i   M  mean: Σ n_i ξ_i = 0 with ξ_i = Log(X_i M⁻¹)
//!   S = Σ n_i (S_i + ξ_i ξ_iᵀ) / Σ n_i      to first order in the ξ; exact where every n_i is 1
//! ```
//! Correlated errors from frame to frame do not average out, so the covariance kept is that of a single frame: the mean's own lies between
//! it and its n-th part.

use nalgebra::{SMatrix, SVector, Vector3};
use resight_core::{Pose, Vector6};

/// Newton steps on the mean; each squares the error, which starts at the scatter's square.
const STEPS: usize = 8;

/// A state with small motions of N components, applied on the left.
pub(super) trait Place<const N: usize>: Copy {
    /// Log(self · other⁻¹).
    fn motion_from(&self, other: &Self) -> SVector<f64, N>;
    /// Exp(motion) · self.
    fn moved(&self, motion: &SVector<f64, N>) -> Self;
}

impl Place<6> for Pose {
    fn motion_from(&self, other: &Self) -> Vector6 {
        (*self * other.inverse()).log()
    }

    fn moved(&self, motion: &Vector6) -> Self {
        Pose::moved(self, motion)
    }
}

/// A rotation: a pose that stays where it is. Products and logarithms of such are such.
#[derive(Clone, Copy)]
pub(super) struct Rotation(Pose);

impl Rotation {
    pub fn of(rotation_rad: &Vector3<f64>) -> Self {
        Rotation(Pose::exp(&turning(rotation_rad)))
    }

    pub fn vector_rad(&self) -> Vector3<f64> {
        self.0.log().fixed_rows::<3>(0).into_owned()
    }
}

fn turning(by: &Vector3<f64>) -> Vector6 {
    Vector6::new(by.x, by.y, by.z, 0.0, 0.0, 0.0)
}

impl Place<3> for Rotation {
    fn motion_from(&self, other: &Self) -> Vector3<f64> {
        Rotation(self.0 * other.0.inverse()).vector_rad()
    }

    fn moved(&self, motion: &Vector3<f64>) -> Self {
        Rotation(self.0.moved(&turning(motion)))
    }
}

/// One reading, or the mean of several.
pub(super) struct Reading<P, const N: usize> {
    /// The number of readings that it represents.
    pub weight: f64,
    pub place: P,
    /// Mean covariance of one reading.
    pub covariance: SMatrix<f64, N, N>,
    pub spread: Spread<N>,
}

/// The scatter of readings about their mean; zero for a single one.
pub(super) struct Spread<const N: usize> {
    pub scatter: SMatrix<f64, N, N>,
    pub least: SVector<f64, N>,
    pub most: SVector<f64, N>,
}

impl<const N: usize> Spread<N> {
    pub fn none() -> Self {
        Spread { scatter: SMatrix::zeros(), least: SVector::zeros(), most: SVector::zeros() }
    }
}

/// Combines all readings into one; `None` without readings.
pub(super) fn joined<P: Place<N>, const N: usize>(readings: &[Reading<P, N>]) -> Option<Reading<P, N>> {
    let weight: f64 = readings.iter().map(|one| one.weight).sum();
    let place = mean(readings, weight)?;
    let motion = |one: &Reading<P, N>| one.place.motion_from(&place);
    let average = |of: &dyn Fn(&Reading<P, N>) -> SMatrix<f64, N, N>| {
        readings.iter().map(|one| of(one) * one.weight).sum::<SMatrix<f64, N, N>>() / weight
    };
    let spread = Spread {
        scatter: average(&|one| one.spread.scatter + motion(one) * motion(one).transpose()),
        least: extreme(readings.iter().map(|one| motion(one) + one.spread.least), f64::min),
        most: extreme(readings.iter().map(|one| motion(one) + one.spread.most), f64::max),
    };
    Some(Reading { weight, place, covariance: average(&|one| one.covariance), spread })
}

/// M.
fn mean<P: Place<N>, const N: usize>(readings: &[Reading<P, N>], weight: f64) -> Option<P> {
    let mut mean = readings.first()?.place;
    for _ in 0..STEPS {
        let motion = |one: &Reading<P, N>| one.place.motion_from(&mean) * one.weight;
        let step = readings.iter().map(motion).sum::<SVector<f64, N>>() / weight;
        mean = mean.moved(&step);
        if step.norm() < 1e-14 {
            break;
        }
    }
    Some(mean)
}

fn extreme<const N: usize>(
    motions: impl Iterator<Item = SVector<f64, N>>,
    of: fn(f64, f64) -> f64,
) -> SVector<f64, N> {
    motions.reduce(|a, b| a.zip_map(&b, of)).unwrap_or_else(SVector::zeros)
}
