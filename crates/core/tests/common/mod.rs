//! Seeded chance for the property suites: the same problems on every machine.
#![allow(dead_code)] // Each test binary uses its own part.

pub mod rigs;
pub mod hands;
pub mod held;
pub mod sessions;
pub mod outliers;
pub mod accident;
pub mod surveys;
pub mod views;
pub mod rooms;
pub mod recordings;
pub mod sentry;
pub mod rivals;
pub mod conditions;
pub mod carried;
pub mod delay;
pub mod wild;
pub mod drives;
pub mod verdicts;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// PCG XSL RR 128/64 (O'Neill 2014): 128 bits of state, far more than any suite draws.
pub struct Rng {
    state: u128,
}

const MULTIPLIER: u128 = 0x2360_ED05_1FC6_5DA4_4385_DF64_9FCC_F645;
const INCREMENT: u128 = 0x5851_F42D_4C95_7F2D_1405_7B7E_F767_814F;

impl Rng {
    /// A stream of its own for each seed.
    pub fn new(seed: u64) -> Self {
        let mut rng = Rng { state: (u128::from(seed) << 64) ^ INCREMENT };
        rng.next();
        rng.next();
        rng
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_mul(MULTIPLIER).wrapping_add(INCREMENT);
        let folded = (self.state >> 64) as u64 ^ self.state as u64;
        folded.rotate_right((self.state >> 122) as u32)
    }

    /// Uniform on [a, b).
    pub fn uniform(&mut self, a: f64, b: f64) -> f64 {
        let unit = (self.next() >> 11) as f64 * (0.5f64).powi(53);
        a + (b - a) * unit
    }

    /// Uniform on 0..n.
    pub fn index(&mut self, n: usize) -> usize {
        (self.uniform(0.0, n as f64) as usize).min(n - 1)
    }

    /// Standard normal, by Box and Muller.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(0.0, 1.0)).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform(0.0, 1.0)).cos()
    }

    /// Uniform on the sphere.
    pub fn unit_vector(&mut self) -> Vector3<f64> {
        loop {
            let v = Vector3::new(self.normal(), self.normal(), self.normal());
            if 1e-6 < v.norm() {
                return v.normalize();
            }
        }
    }

    /// Uniform on SO(3): a normal quaternion, normalised.
    pub fn rotation(&mut self) -> Matrix3<f64> {
        loop {
            let q = Quaternion::new(self.normal(), self.normal(), self.normal(), self.normal());
            if 1e-6 < q.norm() {
                return UnitQuaternion::from_quaternion(q).to_rotation_matrix().into_inner();
            }
        }
    }
}
