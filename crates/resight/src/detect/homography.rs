//! Homographies from a plane to the image: accurate enough to predict where a corner is, never used as the measurement itself.

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
use resight_core::Pixel;

/// A point of a flat target.
pub(super) type PlanePoint = Vector2<f64>;

/// Rounds down; faster than `floor`, which is a function call.
#[inline]
pub(super) fn floor(x: f64) -> i32 {
    let towards_zero = x as i32;
    towards_zero - i32::from(x < towards_zero as f64)
}

/// Maps a plane to the image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Homography(Matrix3<f64>);

impl Homography {
    /// Fits by least squares to four or more pairs (algebraic error, coordinates scaled to unit size); `None` when the pairs do not determine
    /// the homography.
    pub fn fit(pairs: &[(PlanePoint, Pixel)]) -> Option<Self> {
        let plane = unit_scale(pairs.iter().map(|p| p.0))?;
        let image = unit_scale(pairs.iter().map(|p| p.1))?;
        let mut normal = SMatrix::<f64, 8, 8>::zeros();
        let mut right = SVector::<f64, 8>::zeros();
        for (x, u) in pairs {
            let (x, u) = (apply(&plane, x), apply(&image, u));
            let rows = [
                (SVector::<f64, 8>::from([x.x, x.y, 1.0, 0.0, 0.0, 0.0, -u.x * x.x, -u.x * x.y]), u.x),
                (SVector::<f64, 8>::from([0.0, 0.0, 0.0, x.x, x.y, 1.0, -u.y * x.x, -u.y * x.y]), u.y),
            ];
            for (row, value) in rows {
                normal += row * row.transpose();
                right += row * value;
            }
        }
        let h = normal.lu().solve(&right)?;
        let scaled = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
        let map = image.try_inverse()? * scaled * plane;
        (map.iter().all(|x| x.is_finite()) && 4 <= pairs.len()).then_some(Homography(map))
    }

    /// Returns the map from the image back to the plane; `None` for a plane seen edge on.
    pub fn inverse(&self) -> Option<Self> {
        self.0.try_inverse().filter(|map| map.iter().all(|x| x.is_finite())).map(Homography)
    }

    /// Returns the image of a point in homogeneous coordinates, before the division by the third.
    pub fn homogeneous(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        [0, 1, 2].map(|i: usize| self.0[(i, 0)] * x + self.0[(i, 1)] * y + self.0[(i, 2)])
    }

    /// Returns the gradients of both coordinates of the image `p` of a point; `per_z` is one over its third homogeneous coordinate.
    pub fn gradients(&self, p: [f64; 2], per_z: f64) -> [[f64; 2]; 2] {
        let of = |i: usize, k: usize| (self.0[(i, k)] - p[i] * self.0[(2, k)]) * per_z;
        [[of(0, 0), of(0, 1)], [of(1, 0), of(1, 1)]]
    }

    /// Returns the polynomial coefficients of a covariance mapped from the plane to one coordinate of the image: times z², the third homogeneous
    /// coordinate, the variance is a + b p + c p², where p is that coordinate.
    pub fn scatter(&self, axis: usize, covariance: &Matrix2<f64>) -> [f64; 3] {
        let row = |i: usize| Vector2::new(self.0[(i, 0)], self.0[(i, 1)]);
        let product = |i: usize, k: usize| row(i).dot(&(covariance * row(k)));
        [product(axis, axis), -2.0 * product(axis, 2), product(2, 2)]
    }

    /// Returns the image of a point of the plane.
    pub fn at(&self, x: &PlanePoint) -> Pixel {
        apply(&self.0, x)
    }
}

fn apply(map: &Matrix3<f64>, x: &Vector2<f64>) -> Vector2<f64> {
    let y = map * Vector3::new(x.x, x.y, 1.0);
    Vector2::new(y.x / y.z, y.y / y.z)
}

/// Returns the map that moves the mean to the origin and scales the root mean square distance to 1.
fn unit_scale(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let n = points.clone().count() as f64;
    let mean = points.clone().sum::<Vector2<f64>>() / n;
    let size = (points.map(|p| (p - mean).norm_squared()).sum::<f64>() / n).sqrt();
    let s = 1.0 / size;
    s.is_finite().then(|| Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn homography_reproduces_a_perspective_map() {
        let map = Matrix3::new(310.0, 21.0, 400.0, -14.0, 290.0, 300.0, 0.2, -0.1, 1.0);
        let points =
            [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.3, 0.8)].map(|(x, y)| PlanePoint::new(x, y));
        let pairs = points.map(|x| (x, apply(&map, &x)));
        let fitted = Homography::fit(&pairs).unwrap();
        let elsewhere = PlanePoint::new(2.0, -1.0);
        assert!((fitted.at(&elsewhere) - apply(&map, &elsewhere)).norm() < 1e-8 * 400.0);
    }

    #[test]
    fn gradients_are_those_of_the_map() {
        let matrix = Matrix3::new(310.0, 21.0, 400.0, -14.0, 290.0, 300.0, 0.2, -0.1, 1.0);
        let (map, x, h) = (Homography(matrix), PlanePoint::new(0.4, -0.7), 1e-6);
        let [u, v, z] = map.homogeneous([x.x, x.y]);
        let p = [u / z, v / z];
        assert_eq!(Pixel::new(p[0], p[1]), map.at(&x));
        let gradients = map.gradients(p, 1.0 / z);
        for (k, step) in [PlanePoint::x() * h, PlanePoint::y() * h].into_iter().enumerate() {
            let difference = (map.at(&(x + step)) - map.at(&(x - step))) / (2.0 * h);
            (0..2).for_each(|i| assert!((gradients[i][k] - difference[i]).abs() < 1e-6 * 400.0));
        }
    }

    #[test]
    fn a_scatter_is_that_of_the_gradients() {
        let map = Homography(Matrix3::new(310.0, 21.0, 400.0, -14.0, 290.0, 300.0, 0.2, -0.1, 1.0));
        let covariance = Matrix2::new(0.3, 0.1, 0.1, 0.2);
        let [u, v, z] = map.homogeneous([0.4, -0.7]);
        let p = [u / z, v / z];
        for (axis, gradient) in map.gradients(p, 1.0 / z).map(Vector2::from).into_iter().enumerate() {
            let [a, b, c] = map.scatter(axis, &covariance);
            let (scatter, expected) =
                ((a + p[axis] * (b + p[axis] * c)) / (z * z), gradient.dot(&(covariance * gradient)));
            assert!((scatter / expected - 1.0).abs() < 1e-12, "{scatter} {expected}");
        }
    }

    #[test]
    fn the_fast_floor_is_the_floor() {
        for x in [-2.5, -2.0, -1e-9, 0.0, 0.3, 1.0, 7.9] {
            assert_eq!(floor(x) as f64, x.floor());
        }
        assert_eq!(floor(f64::NAN), 0);
    }

    #[test]
    fn collinear_points_give_no_homography() {
        let pairs = [0.0, 1.0, 2.0, 3.0].map(|x| (PlanePoint::new(x, 0.0), Pixel::new(10.0 * x, 5.0)));
        let same = [(PlanePoint::new(0.0, 0.0), Pixel::new(1.0, 1.0)); 4];
        assert!(Homography::fit(&same).is_none());
        assert!(Homography::fit(&pairs).is_none_or(|h| h.0.iter().all(|x| x.is_finite())));
    }
}
