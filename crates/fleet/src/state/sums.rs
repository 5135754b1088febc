//! Sums of poses over a period, as whole numbers.

use nalgebra::{Matrix3, Matrix4, Matrix4x3, SymmetricEigen, Vector3, Vector4};
use resight::core::Pose;

/// Units a metre: rounding is 2⁻²⁷ m, 7 nm, and 2²⁴ positions of 8 km fit.
const PER_METRE: f64 = (1_u64 << 26) as f64;
/// Units of a product of quaternion components, which is at most one: rounding is 2⁻⁴⁰, and 2²⁴ of them fit.
const PER_PRODUCT: f64 = (1_u64 << 39) as f64;
/// Positions farther off, metres, are not summed.
pub const FARTHEST_M: f64 = 8192.0;
/// Rows of a period beyond which its sums say nothing any more.
pub const MOST_ROWS: u64 = (1 << 24) - 1;

/// Rows of a period: how many, where the camera stood, which way it looked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sums {
    /// Rows that are summed, and rows of any status, no more than 2³² − 1: what saturates does so in every order.
    n: u32,
    rows: u32,
    /// Σ of the camera's position in the target frame.
    position: [i64; 3],
    /// Σ of q qᵀ, upper triangle, of the quaternion of cam_from_target; its sign does not matter.
    products: [i64; 10],
}

impl Sums {
    /// Whole numbers that it is made of.
    pub(super) const PARTS: usize = 15;

    /// All of them, in a fixed order.
    pub(super) fn parts(&self) -> [u64; Sums::PARTS] {
        let sums = self.position.iter().chain(&self.products);
        let mut parts = [0; Sums::PARTS];
        (parts[0], parts[1]) = (u64::from(self.n), u64::from(self.rows));
        parts[2..].iter_mut().zip(sums).for_each(|(part, sum)| *part = *sum as u64);
        parts
    }

    /// Made of them again; none of counts that no sums have.
    pub(super) fn of_parts(parts: [u64; Sums::PARTS]) -> Option<Self> {
        let part = |i: usize| parts[i] as i64;
        Some(Sums {
            n: u32::try_from(parts[0]).ok()?,
            rows: u32::try_from(parts[1]).ok()?,
            position: std::array::from_fn(|i| part(2 + i)),
            products: std::array::from_fn(|i| part(5 + i)),
        })
    }

    /// Rows that are summed: those that are `ok`.
    pub fn n(&self) -> u64 {
        self.n.into()
    }

    /// Rows of any status.
    pub fn rows(&self) -> u64 {
        self.rows.into()
    }

    /// Counts a row of any status.
    #[inline]
    pub fn count(&mut self) {
        self.rows = self.rows.saturating_add(1);
    }

    /// Adds a pose; false where it lies too far off.
    #[inline]
    pub fn add(&mut self, quaternion: [f64; 4], translation: [f64; 3]) -> bool {
        let [w, x, y, z] = quaternion;
        let t = Vector3::from(translation);
        // −Rᵀt without the matrix: v + 2w(v × t) …, with the conjugate.
        let v = -Vector3::new(x, y, z);
        let cross = v.cross(&t) * 2.0;
        let position = -(t + cross * w + v.cross(&cross));
        if !(position.amax() <= FARTHEST_M) {
            return false;
        }
        self.n = self.n.saturating_add(1);
        for i in 0..3 {
            self.position[i] = self.position[i].wrapping_add(whole(position[i] * PER_METRE));
        }
        let q = [w, x, y, z];
        let mut k = 0;
        for i in 0..4 {
            for j in i..4 {
                self.products[k] = self.products[k].wrapping_add(whole(q[i] * q[j] * PER_PRODUCT));
                k += 1;
            }
        }
        true
    }

    /// Of both.
    pub fn merge(&mut self, other: &Sums) {
        self.n = self.n.saturating_add(other.n);
        self.rows = self.rows.saturating_add(other.rows);
        for (mine, theirs) in self.position.iter_mut().zip(other.position) {
            *mine = mine.wrapping_add(theirs);
        }
        for (mine, theirs) in self.products.iter_mut().zip(other.products) {
            *mine = mine.wrapping_add(theirs);
        }
    }

    /// The mean pose: the mean position, and the rotation nearest to all (docs/math/fleet.md eq. (4)). None of no row, or of more than the
    /// sums hold.
    pub fn mean(&self) -> Option<Pose> {
        let q = mean_of(&self.mean_products()?);
        let position = Vector3::from(self.position.map(|sum| sum as f64 / (PER_METRE * f64::from(self.n))));
        let rotation = Pose::from_quaternion_wxyz(q.into(), Vector3::zeros()).rotation;
        Some(Pose { rotation, translation: -(rotation * position) })
    }

    /// The mean of sin²(θ/2) u uᵀ over the rotations by θ about u from the mean, in the camera frame. None where there is no mean.
    pub fn scatter(&self) -> Option<Matrix3<f64>> {
        let products = self.mean_products()?;
        let q = mean_of(&products);
        let (w, v) = (q[0], Vector3::new(q[1], q[2], q[3]));
        let along = |k: usize| {
            let unit = Vector3::ith(k, 1.0);
            let rotated = unit * w + unit.cross(&v);
            Vector4::new(-unit.dot(&v), rotated.x, rotated.y, rotated.z)
        };
        let basis = Matrix4x3::from_columns(&[along(0), along(1), along(2)]);
        Some(basis.transpose() * products * basis)
    }

    /// The mean of q qᵀ.
    fn mean_products(&self) -> Option<Matrix4<f64>> {
        if self.n == 0 || MOST_ROWS < self.n() {
            return None;
        }
        let n = f64::from(self.n);
        let mut products = Matrix4::zeros();
        let mut k = 0;
        for i in 0..4 {
            for j in i..4 {
                products[(i, j)] = self.products[k] as f64 / (PER_PRODUCT * n);
                products[(j, i)] = products[(i, j)];
                k += 1;
            }
        }
        Some(products)
    }
}

/// The quaternion with the largest qᵀ Σ q.
fn mean_of(products: &Matrix4<f64>) -> Vector4<f64> {
    let eigen = SymmetricEigen::new(*products);
    eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned()
}

/// To the nearest whole number, ties to the even one, of what is below 2⁵¹: near 1.5 · 2⁵² doubles are whole numbers and their bits count them.
#[inline]
fn whole(x: f64) -> i64 {
    const MIDDLE: f64 = 6_755_399_441_055_744.0;
    (x + MIDDLE).to_bits().wrapping_sub(MIDDLE.to_bits()) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rotations by 12° about an axis of the camera in 3 of 5 rows scatter by s(1 − s) sin²(6°) about that axis, and by nothing about the others.
    #[test]
    fn scatter_is_that_of_the_rotations_of_a_period() {
        let base = Pose::exp(&resight::core::Vector6::new(0.4, -1.0, 0.7, 0.0, 0.0, 0.0));
        let mut sums = Sums::default();
        for row in 0..5 {
            let angle = if row < 3 { 12.0_f64.to_radians() } else { 0.0 };
            let pose = Pose::exp(&resight::core::Vector6::new(0.0, angle, 0.0, 0.0, 0.0, 0.0)) * base;
            assert!(sums.add(pose.quaternion_wxyz(), [1.0, 2.0, 3.0]));
        }
        let scatter = sums.scatter().expect("a mean");
        // The larger eigenvalue of the two half-angle vectors, exactly: (1 − R)/2 with R the mean resultant length.
        let resultant = (1.0 - 4.0 * 0.6 * 0.4 * 6.0_f64.to_radians().sin().powi(2)).sqrt();
        assert!((scatter[(1, 1)] - 0.5 * (1.0 - resultant)).abs() < 1e-10, "{scatter}");
        assert!((0..9).filter(|i| *i != 4).all(|i| scatter[i].abs() < 1e-10), "{scatter}");
    }

    #[test]
    fn numbers_are_rounded_as_they_should_be() {
        let large = FARTHEST_M * PER_METRE;
        for x in [
            0.0,
            -0.0,
            0.5,
            1.5,
            2.5,
            -0.5,
            -1.5,
            -2.5,
            0.49999999999999994,
            1e9 + 0.5,
            large,
            -large,
            large - 0.5,
            PER_PRODUCT,
        ] {
            assert_eq!(whole(x), x.round_ties_even() as i64, "{x}");
        }
    }
}
