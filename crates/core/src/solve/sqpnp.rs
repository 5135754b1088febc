//! Any n ≥ 3 points: the minima of the object-space error over all rotations. Derivation: docs/math/sqpnp.md.
//!
//! The cost is that of Terzakis and Lourakis, "A consistently fast and globally optimal solution to the perspective-n-point
//! problem", ECCV 2020: the squared distances of the points from their rays, the translation eliminated, is rᵀ Ω r. Differs from the paper:
//! Newton's method runs on the rotation itself, three unknowns instead of nine with six constraints, and starts
//! from the 24 rotations of the cube, whose costs are sums of six numbers each, instead of from eigenvectors.
//!
//!   P = w (I − b bᵀ)  squared distance from the ray   ·   r = vec(R), row by row   ·   X  centred, scaled target point
//!   S = Σ P, B = Σ P ⊗ Xᵀ, Q = Σ P ⊗ X Xᵀ   ·   t = −S⁻¹ B r   ·   Ω = Q − Bᵀ S⁻¹ B

use super::Candidates;
use super::p3p::p3p;
use crate::pose::orthonormalized;
use crate::{Correspondence, Point, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

type Matrix9 = SMatrix<f64, 9, 9>;
type Matrix3x9 = SMatrix<f64, 3, 9>;
type Vector9 = SVector<f64, 9>;

/// Starts followed to their minimum, best first. Evidence: docs/math/sqpnp.md, table 1.
const MAX_STARTS: usize = 6;
/// The widest triple is sought among about so many points.
const TRIPLE_FROM: usize = 24;
/// Newton steps from one start; a minimum is reached in 4 to 7.
const MAX_STEPS: usize = 25;
/// A step below this ends the descent: the next would be its square.
const LAST_STEP_RAD: f64 = 1e-5;
/// Longest step.
const MAX_STEP_RAD: f64 = 0.7;
/// Steps below this are taken on the gradient's word.
const SMALL_STEP_RAD: f64 = 1e-3;
/// A descent this close (chordal) to a known minimum ends there too.
const NEAR_KNOWN: f64 = 0.02;
/// Minima closer than this (chordal) are one.
const SAME_ROTATION: f64 = 1e-3;

/// The local minima found, best first, each with most of the points in front of the camera; none for fewer than 3 points
/// or when the rays are all parallel.
pub fn sqpnp(points: &[Correspondence]) -> Candidates {
    let mut poses = Candidates::new();
    let Some(frame) = Normalization::new(points) else { return poses };
    let sums = Sums::new(points, |c| frame.apply(&c.x_in_target), |c| c.bearing.into_inner());
    let Some(cost) = Cost::new(&sums) else { return poses };
    for r in minima(&cost, &sums, &triple_rotations(points, &frame)) {
        poses.push(frame.undo(r, cost.translation(&r)));
    }
    poses
}

/// Centre and size of the target: the solvers work where both are 0 and 1.
pub(super) struct Normalization {
    pub(super) centroid: Point,
    pub(super) scale: f64,
    inverse_scale: f64,
}

impl Normalization {
    /// None for fewer than three points, a target without extent, or numbers out of range.
    pub(super) fn new(points: &[Correspondence]) -> Option<Self> {
        let n = points.len() as f64;
        let first = points.first()?.x_in_target; // sums of differences keep the digits of far coordinates
        let centroid = first + points.iter().map(|c| c.x_in_target - first).sum::<Vector3<f64>>() / n;
        let size = points.iter().map(|c| (c.x_in_target - centroid).amax()).fold(0.0, f64::max);
        let usable = 3 <= points.len() && size.is_normal() && (1.0 / size).is_normal();
        usable.then_some(Normalization { centroid, scale: size, inverse_scale: 1.0 / size })
    }

    pub(super) fn apply(&self, x: &Point) -> Point {
        (x - self.centroid) * self.inverse_scale
    }

    /// Pose in the caller's frame and unit.
    pub(super) fn undo(&self, rotation: Matrix3<f64>, translation: Vector3<f64>) -> Pose {
        Pose { rotation, translation: translation * self.scale - rotation * self.centroid }
    }
}

/// S, B, Q of the head of this file, summed in one pass.
pub(super) struct Sums {
    pub(super) s: Matrix3<f64>,
    pub(super) b: Matrix3x9,
    pub(super) q: Matrix9,
    /// Σ w b ⊗ X and Σ w b: their inner product with (r, t) is the sum of the depths.
    pub(super) depth_r: Matrix3<f64>,
    pub(super) depth_t: Vector3<f64>,
}

/// Pairs (i ≤ j) of a symmetric 3×3 matrix.
const TERMS: usize = 10;
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

impl Sums {
    /// `place` gives X and `ray` the unit vector of a correspondence; weights are (σ₁/σ)².
    pub(super) fn new(
        points: &[Correspondence],
        place: impl Fn(&Correspondence) -> Vector3<f64>,
        ray: impl Fn(&Correspondence) -> Vector3<f64>,
    ) -> Self {
        let reference = points.first().map_or(1.0, |c| c.sigma_px);
        // sums[k][m]: the k-th entry of P times the m-th of (X Xᵀ, X, 1). Four points at a time, so that the sums, too many for
        // the registers, are loaded and stored once for four.
        let mut sums = [[0.0; TERMS]; 6];
        let (mut depth_r, mut depth_t) = (Matrix3::zeros(), Vector3::zeros());
        for four in points.chunks(4) {
            let (mut distance, mut terms) = ([[0.0; 6]; 4], [[0.0; TERMS]; 4]);
            for (l, c) in four.iter().enumerate() {
                let (x, y) = (place(c), ray(c));
                let weight = (reference / c.sigma_px) * (reference / c.sigma_px);
                distance[l] = PAIRS.map(|(i, j)| weight * (if i == j { 1.0 } else { 0.0 } - y[i] * y[j]));
                let xx = PAIRS.map(|(i, j)| x[i] * x[j]);
                terms[l] = [xx[0], xx[1], xx[2], xx[3], xx[4], xx[5], x.x, x.y, x.z, 1.0];
                let y = y * weight;
                depth_r += y * x.transpose();
                depth_t += y;
            }
            for k in 0..6 {
                let p = [distance[0][k], distance[1][k], distance[2][k], distance[3][k]];
                for m in 0..TERMS {
                    sums[k][m] +=
                        (p[0] * terms[0][m] + p[1] * terms[1][m]) + (p[2] * terms[2][m] + p[3] * terms[3][m]);
                }
            }
        }
        Sums {
            s: Matrix3::from_fn(|i, j| sums[pair(i, j)][9]),
            b: Matrix3x9::from_fn(|i, col| sums[pair(i, col / 3)][6 + col % 3]),
            q: Matrix9::from_fn(|row, col| sums[pair(row / 3, col / 3)][pair(row % 3, col % 3)]),
            depth_r,
            depth_t,
        }
    }

    /// −S⁻¹ B: the translation as a linear function of the rotation. None when all rays are parallel.
    pub(super) fn translation_from_rotation(&self) -> Option<Matrix3x9> {
        let product = -(self.s.cholesky()?.solve(&self.b));
        product.iter().all(|x| x.is_finite()).then_some(product)
    }

    /// Sum of the depths along the rays.
    pub(super) fn depth(&self, r: &Matrix3<f64>, t: &Vector3<f64>) -> f64 {
        self.depth_r.dot(r) + self.depth_t.dot(t)
    }
}

fn pair(i: usize, j: usize) -> usize {
    let (i, j) = (i.min(j), i.max(j));
    i * (5 - i) / 2 + j
}

fn vec_of(r: &Matrix3<f64>) -> Vector9 {
    Vector9::from_fn(|k, _| r[(k / 3, k % 3)])
}

/// A local minimum of the object-space error.
#[derive(Clone, Copy)]
pub(super) struct Minimum {
    pub(super) rotation: Matrix3<f64>,
    pub(super) value: f64,
}

/// rᵀ Ω r, the object-space error of a rotation.
pub(super) struct Cost {
    omega: Matrix9,
    t_from_r: Matrix3x9,
}

impl Cost {
    pub(super) fn new(sums: &Sums) -> Option<Self> {
        let t_from_r = sums.translation_from_rotation()?;
        let omega = sums.q + sums.b.tr_mul(&t_from_r);
        let omega = (omega + omega.transpose()) * 0.5;
        omega.iter().all(|x| x.is_finite()).then_some(Cost { omega, t_from_r })
    }

    pub(super) fn translation(&self, r: &Matrix3<f64>) -> Vector3<f64> {
        self.t_from_r * vec_of(r)
    }

    /// A rotation and its cost, as it is.
    pub(super) fn at(&self, rotation: Matrix3<f64>) -> Minimum {
        let r = vec_of(&rotation);
        Minimum { rotation, value: r.dot(&(self.omega * r)) }
    }

    /// Cost of a signed permutation: six products.
    fn of_cube_rotation(&self, cube: &CubeRotation) -> f64 {
        let at = |i: usize| 3 * i + cube.column[i];
        let o = |i: usize, j: usize| self.omega[(at(i), at(j))] * cube.sign[i] * cube.sign[j];
        o(0, 0) + o(1, 1) + o(2, 2) + 2.0 * (o(0, 1) + o(0, 2) + o(1, 2))
    }

    /// Newton's method on the rotation, eqs. (5)–(7), damped where the cost is not convex; none when it comes upon a known minimum.
    pub(super) fn descend(&self, mut r: Matrix3<f64>, known: &[Minimum]) -> Option<Minimum> {
        let mut omega_r = self.omega * vec_of(&r);
        let mut value = omega_r.dot(&vec_of(&r));
        let mut damping = 0.0;
        for _ in 0..MAX_STEPS {
            let (gradient, hessian) = self.slope(&r, &omega_r);
            let Some(step) = newton_step(&gradient, &hessian, damping) else { break };
            let next = orthonormalized(&(small_rotation(&step) * r));
            let omega_next = self.omega * vec_of(&next);
            let next_value = omega_next.dot(&vec_of(&next));
            let length = step.norm();
            // Close to the minimum the gradient still has digits when the value has none left.
            if next_value <= value || (damping == 0.0 && length < SMALL_STEP_RAD) {
                (r, omega_r, value) = (next, omega_next, next_value);
                damping = if damping < 1e-6 * hessian.norm() { 0.0 } else { 0.03 * damping };
            } else {
                damping = 10.0 * damping.max(1e-3 * hessian.norm());
            }
            if length < LAST_STEP_RAD {
                break;
            }
            if known.iter().any(|other| (other.rotation - r).norm() < NEAR_KNOWN) {
                return None;
            }
        }
        let is_known = known.iter().any(|other| (other.rotation - r).norm() < SAME_ROTATION);
        (!is_known).then_some(Minimum { rotation: r, value })
    }

    /// Half the gradient and half the Hessian by a left rotation, eqs. (5), (6).
    fn slope(&self, r: &Matrix3<f64>, gradient_of_r: &Vector9) -> (Vector3<f64>, Matrix3<f64>) {
        let m = Matrix3::from_fn(|i, j| gradient_of_r[3 * i + j]);
        let w = m * r.transpose();
        let gradient = Vector3::new(w[(2, 1)] - w[(1, 2)], w[(0, 2)] - w[(2, 0)], w[(1, 0)] - w[(0, 1)]);
        let turns = [0, 1, 2].map(|k| vec_of(&(Vector3::ith(k, 1.0).cross_matrix() * r)));
        let omega_turns = turns.map(|turn| self.omega * turn);
        let curvature = Matrix3::from_fn(|k, l| turns[k].dot(&omega_turns[l]));
        (gradient, curvature + (w + w.transpose()) * 0.5 - Matrix3::identity() * w.trace())
    }
}

/// −(H + λI)⁻¹ g, at most 0.7 rad long; λ just large enough for a descent, so that a long valley is followed at its own scale.
fn newton_step(gradient: &Vector3<f64>, hessian: &Matrix3<f64>, damping: f64) -> Option<Vector3<f64>> {
    let damped = |damping: f64| (hessian + Matrix3::identity() * damping).cholesky();
    let factor = damped(damping)
        .or_else(|| damped(damping.max(-2.0 * smallest_eigenvalue(hessian)) + 1e-9 * hessian.norm()))?;
    let step = -factor.solve(gradient);
    let length = step.norm();
    // A long step leaves the region in which the quadratic model means anything.
    length.is_finite().then(|| if MAX_STEP_RAD < length { step * (MAX_STEP_RAD / length) } else { step })
}

/// Of a symmetric 3×3 matrix, by the trigonometric solution of its characteristic cubic.
fn smallest_eigenvalue(h: &Matrix3<f64>) -> f64 {
    let mean = h.trace() / 3.0;
    let deviator = h - Matrix3::identity() * mean;
    let size = (deviator.norm_squared() / 6.0).sqrt();
    let cosine = 0.5 * deviator.determinant() / size.powi(3).max(f64::MIN_POSITIVE);
    let angle = (cosine.clamp(-1.0, 1.0).acos() + core::f64::consts::TAU) / 3.0;
    mean + 2.0 * size * angle.cos()
}

/// Rotation by a vector of at most 0.7 rad, by Cayley's formula on half of it (third order exact: Newton needs second).
fn small_rotation(step: &Vector3<f64>) -> Matrix3<f64> {
    let k = (step * 0.5).cross_matrix();
    let k2 = k * k;
    let norm2 = 0.25 * step.norm_squared();
    Matrix3::identity() + (k + k2) * (2.0 / (1.0 + norm2))
}

/// A rotation of the cube: row i has `sign[i]` in column `column[i]`.
struct CubeRotation {
    column: [usize; 3],
    sign: [f64; 3],
}

impl CubeRotation {
    fn all() -> impl Iterator<Item = CubeRotation> {
        const ORDERS: [([usize; 3], f64); 6] = [
            ([0, 1, 2], 1.0),
            ([1, 2, 0], 1.0),
            ([2, 0, 1], 1.0),
            ([0, 2, 1], -1.0),
            ([2, 1, 0], -1.0),
            ([1, 0, 2], -1.0),
        ];
        const SIGNS: [(f64, f64); 4] = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        ORDERS.into_iter().flat_map(|(column, parity)| {
            SIGNS.into_iter().map(move |(a, b)| CubeRotation { column, sign: [a, b, parity * a * b] })
        })
    }

    fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| if self.column[i] == j { self.sign[i] } else { 0.0 })
    }
}

/// The poses of a wide triple, which start in the right minima when there are many narrow ones (few points, thin targets).
fn triple_rotations(points: &[Correspondence], frame: &Normalization) -> ArrayVec<Matrix3<f64>, 4> {
    let step = 1 + points.len() / TRIPLE_FROM;
    let place = |c: &Correspondence| frame.apply(&c.x_in_target);
    let farthest = |measure: &dyn Fn(Point) -> f64| {
        let larger =
            |a: &&Correspondence, b: &&Correspondence| measure(place(a)).total_cmp(&measure(place(b)));
        points.iter().step_by(step).max_by(larger)
    };
    let triple = || {
        let a = farthest(&|x| x.norm_squared())?;
        let b = farthest(&|x| (x - place(a)).norm_squared())?;
        let along = place(b) - place(a);
        let c = farthest(&|x| along.cross(&(x - place(a))).norm_squared())?;
        Some([a, b, c])
    };
    let Some(triple) = triple() else { return ArrayVec::new() };
    p3p(&triple.map(|c| c.bearing), &triple.map(|c| c.x_in_target)).iter().map(|pose| pose.rotation).collect()
}

/// Distinct minima in front of the camera, best first.
fn minima(cost: &Cost, sums: &Sums, first: &[Matrix3<f64>]) -> ArrayVec<Matrix3<f64>, 4> {
    let mut starts: ArrayVec<(f64, Matrix3<f64>), 24> =
        CubeRotation::all().map(|cube| (cost.of_cube_rotation(&cube), cube.matrix())).collect();
    starts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let cubes = starts.iter().map(|(_, start)| start).take(MAX_STARTS);
    let mut found: ArrayVec<Minimum, { MAX_STARTS + 4 }> = ArrayVec::new();
    for start in first.iter().chain(cubes) {
        found.extend(cost.descend(*start, &found));
    }
    found.sort_unstable_by(|a, b| a.value.total_cmp(&b.value));
    let in_front = |r: &Matrix3<f64>| 0.0 < sums.depth(r, &cost.translation(r));
    found.into_iter().map(|minimum| minimum.rotation).filter(in_front).take(4).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;

    fn some_cost() -> Cost {
        let camera = Camera::normalized();
        let places =
            [[0.1, 0.9, -0.3], [1.0, -0.2, 0.4], [-0.7, 0.3, 0.8], [0.2, -1.0, -0.6], [-0.5, -0.4, 0.1]];
        let seen = |(i, x): (usize, &[f64; 3])| {
            let pixel = crate::Pixel::new(0.2 * x[0] - 0.03 * i as f64, 0.15 * x[1] + 0.05 * x[2]);
            Correspondence::new(&camera, Point::from(*x), pixel, 1.0 + 0.1 * i as f64).unwrap()
        };
        let points: Vec<Correspondence> = places.iter().enumerate().map(seen).collect();
        Cost::new(&Sums::new(&points, |c| c.x_in_target, |c| c.bearing.into_inner())).unwrap()
    }

    /// Half of each, as `slope` gives them. Truncation h² and rounding ε/h² balance near h = 1e-4.
    #[test]
    fn slope_matches_central_difference() {
        let cost = some_cost();
        let turned = |r: &Matrix3<f64>, k: usize, by: f64, l: usize, then: f64| {
            let turn = Vector3::ith(k, by) + Vector3::ith(l, then);
            cost.at(Pose::exp(&crate::Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0)).rotation * r).value
        };
        let h = 1e-4;
        for cube in CubeRotation::all() {
            let r = small_rotation(&Vector3::new(0.2, -0.3, 0.4)) * cube.matrix();
            let (gradient, hessian) = cost.slope(&r, &(cost.omega * vec_of(&r)));
            for k in 0..3 {
                let numeric = (turned(&r, k, h, k, 0.0) - turned(&r, k, -h, k, 0.0)) / (4.0 * h);
                assert!(
                    (gradient[k] - numeric).abs() < 1e-6 * hessian.norm(),
                    "{k} {} {numeric}",
                    gradient[k]
                );
                for l in 0..3 {
                    let mixed = turned(&r, k, h, l, h) + turned(&r, k, -h, l, -h)
                        - turned(&r, k, h, l, -h)
                        - turned(&r, k, -h, l, h);
                    let numeric = mixed / (8.0 * h * h);
                    assert!((hessian[(k, l)] - numeric).abs() < 1e-5 * hessian.norm(), "{k} {l}");
                }
            }
        }
    }

    #[test]
    fn every_descent_ends_where_the_slope_vanishes_and_the_cost_curves_up() {
        let cost = some_cost();
        for cube in CubeRotation::all() {
            assert!((cost.of_cube_rotation(&cube) - cost.at(cube.matrix()).value).abs() < 1e-12);
            let minimum = cost.descend(cube.matrix(), &[]).unwrap();
            let (gradient, hessian) =
                cost.slope(&minimum.rotation, &(cost.omega * vec_of(&minimum.rotation)));
            assert!(gradient.norm() < 1e-9 * hessian.norm() && -1e-9 < smallest_eigenvalue(&hessian));
            assert!(minimum.value <= cost.at(cube.matrix()).value);
        }
    }
}
