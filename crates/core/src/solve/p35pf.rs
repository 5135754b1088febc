//! Three points, one coordinate of a fourth, and the focal length: own derivation, docs/math/focal.md section 4; equation numbers refer to it.
//!
//! Seven equations for seven unknowns. Depths of the three points and the third column of the scaled rotation are six numbers, one linear
//! equation of the fourth point leaves five, and the rotation four quadrics in them: ten common points besides those without a rotation.
//! They are the eigenvectors of a matrix (p35pf_action.rs), and Newton's steps on the quadrics make the real ones exact.
//!
//!   λᵢ = ℓ + κ·rᵢ  depth over f, rᵢ place in the triangle's plane from its centroid   ·   eᵢ dual vectors of the triangle
//!   a₁ = (α, y), a₂ = (β, z), q = (κ, x)  rows of the scaled rotation, third over f, in the frame of the triangle
//!   bᵢ, h  place of the fourth point: Σ bᵢXᵢ + h n   ·   v  coordinates of (ℓ, κ, y, z, x) on an orthonormal basis N

use super::p35pf_action::{Quadric, action, quadric};
use super::unknown_focal::FocalPose;
use crate::polynomial::eigen::Hessenberg;
use crate::{Pixel, Point, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Matrix3x5, Matrix5, SMatrix, Vector2, Vector3, Vector5, Vector6};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Area of the triangle (twice, over the square of its size) below which its points are on a line.
const MIN_AREA: f64 = 1e-9;
/// κ and x are multiplied by this many sizes of the image: a typical f, so that all unknowns are of like size.
const TYPICAL_FOCAL: f64 = 4.0;
/// With the fourth point nearer to the plane, the elimination loses an equation: it is then solved as if the point were so far off (in parts
/// of the size), and Newton's steps bring it back.
const LEAST_HEIGHT: f64 = 1e-8;
/// Size of the first row (of a solution of unit length) below which there is no rotation.
const MIN_ROWS: f64 = 1e-5;
/// Newton's steps at most; from an eigenvector two or three do.
const MAX_STEPS: usize = 12;
/// A quadric of unit size below this, at a vector of unit length, is rounding.
const ROUNDING: f64 = 1e-15;
/// … and above this it is no solution.
const MAX_DEFECT: f64 = 1e-12;
/// Smallest pivot of Newton's equations: below it they leave a direction open, as for a frontal plane.
const OPEN: f64 = 1e-8;
/// An eigenvalue with an imaginary part above this part of its size belongs to no real solution.
const BLUR: f64 = 1e-2;
/// Two solutions closer than this are one.
const SAME: f64 = 1e-9;
/// Focal lengths, in sizes of the image, beyond which a solution is the limit of no perspective or of all.
const FOCALS: core::ops::RangeInclusive<f64> = 1e-4..=1e4;
/// A candidate misses no coordinate by more than this part of the image.
const MAX_MISS: f64 = 1e-9;

/// Candidates: as many as there are.
pub type ThreeAndAHalfCandidates = ArrayVec<FocalPose, 10>;
type Matrix6x5 = SMatrix<f64, 6, 5>;

/// Poses and focal lengths that put three points onto their pixels and a fourth onto a column of the image, all from the principal point.
///
/// At most ten, in no order; every one reprojects to rounding, with all four points in front and f between 10⁻⁴ and 10⁴ times the size of the
/// image of the three. None for three points (the first three) on a line or on one pixel, for a frontal plane, for what is not finite.
pub fn p35pf(pixels: &[Pixel; 3], u4_px: f64, points_in_target: &[Point; 4]) -> ThreeAndAHalfCandidates {
    let mut found = ThreeAndAHalfCandidates::new();
    let Some(scene) = Scene::new(pixels, u4_px, points_in_target) else { return found };
    for solution in solutions(&scene) {
        if let Some(candidate) = scene.candidate(&solution).filter(|c| scene.is_met(c)) {
            found.push(scene.undone(&candidate));
        }
    }
    found
}

/// Real solutions of the quadrics as (ℓ, κ, y, z, x). Complex ones come in pairs: an odd number of real ones says that one was lost.
fn solutions(scene: &Scene) -> ArrayVec<Vector6<f64>, 10> {
    let mut found = ArrayVec::<Vector6<f64>, 10>::new();
    for mirror in MIRRORS {
        let system = System::new(scene, &scene.column, &mirror);
        let lifted = scene.lifted().map(|column| System::new(scene, &column, &mirror));
        let starts = lifted.as_ref().unwrap_or(&system).starts();
        // In a plane, the mirror image of a solution is one.
        let mirrored = starts.iter().filter(|_| lifted.is_some()).map(mirrored);
        for start in starts.iter().copied().chain(mirrored) {
            let Some(zeta) = system.polished(system.basis.tr_mul(&start)).map(|v| system.basis * v) else {
                continue;
            };
            let is_duplicate = |other: &Vector6<f64>| 1.0 - SAME < other.dot(&zeta).abs();
            if !found.is_full() && !found.iter().any(is_duplicate) && scene.is_rotation(&zeta) {
                found.push(zeta);
            }
        }
        if found.len() % 2 == 0 && !found.is_empty() {
            break;
        }
    }
    found
}

fn mirrored(zeta: &Vector6<f64>) -> Vector6<f64> {
    Vector6::new(zeta[0], zeta[1], zeta[2], -zeta[3], -zeta[4], -zeta[5])
}

/// Reflections without meaning, so that no layout puts a solution at v₀ = 0.
const MIRRORS: [[f64; 5]; 2] = [[0.55, -0.35, 0.45, 0.25, 0.5], [-0.2, 0.5, 0.3, -0.6, 0.45]];

/// The quadrics in five unknowns.
struct System {
    basis: Matrix6x5,
    rows: [Matrix3x5<f64>; 3],
    quadrics: [Matrix5<f64>; 4],
}

impl System {
    /// Eqs. (15), (16).
    fn new(scene: &Scene, column: &Vector6<f64>, mirror: &[f64; 5]) -> Self {
        let basis = null_space(column) * reflection(&Vector5::from(*mirror));
        let rows = scene.rows.map(|row| row * basis);
        let [a1, a2, q] = &rows;
        let forms = [a1.tr_mul(a2), a1.tr_mul(a1) - a2.tr_mul(a2), a1.tr_mul(q), a2.tr_mul(q)];
        let quadrics = forms.map(|m| (m + m.transpose()).normalize());
        System { basis, rows, quadrics }
    }

    /// Vectors (ℓ, κ, y, z, x) on which the quadrics are zero but for the rounding of the elimination.
    fn starts(&self) -> ArrayVec<Vector6<f64>, 10> {
        let quadrics: [Quadric; 4] = self.quadrics.each_ref().map(quadric);
        let Some(action) = action(&quadrics, &self.rows) else { return ArrayVec::new() };
        let matrix = Hessenberg::<10, 5>::new(&action);
        let is_real = |e: &[f64; 2]| e[1] <= BLUR * (1.0 + e[0].abs());
        let values = matrix.eigenvalues().into_iter().filter(is_real);
        values.map(|e| self.basis * Vector5::from(matrix.vector(e[0]))).collect()
    }

    /// Newton's steps on the four quadrics and the length; none where they end on a line of solutions.
    fn polished(&self, start: Vector5<f64>) -> Option<Vector5<f64>> {
        let mut v = start.normalize();
        let (mut best, mut least, mut least_pivot) = (v, f64::INFINITY, 0.0);
        for _ in 0..MAX_STEPS {
            let slopes = self.quadrics.each_ref().map(|s| s * v);
            let defects = slopes.map(|slope| slope.dot(&v));
            let size = defects.iter().fold(0.0, |most: f64, d| most.max(d.abs()));
            if !size.is_finite() || (least < MAX_DEFECT && least <= size) {
                break;
            }
            let [a, b, c, d] = slopes.map(|slope| slope.transpose() * 2.0);
            let lu = Matrix5::from_rows(&[a, b, c, d, v.transpose()]).lu();
            if size < least {
                (best, least) = (v, size);
                least_pivot = lu.u().diagonal().amin();
            }
            let right = Vector5::new(defects[0], defects[1], defects[2], defects[3], 0.0);
            let Some(step) = lu.solve(&right).filter(|_| ROUNDING < size) else { break };
            v = (v - step).normalize();
        }
        (least < MAX_DEFECT && OPEN < least_pivot).then_some(best)
    }
}

/// Orthonormal basis of what one equation leaves open: five columns of a reflection.
fn null_space(equation: &Vector6<f64>) -> Matrix6x5 {
    let mut v = equation.normalize();
    let largest = v.iamax();
    v[largest] += 1f64.copysign(v[largest]);
    let reflection = SMatrix::<f64, 6, 6>::identity() - v * v.transpose() * (2.0 / v.norm_squared());
    reflection.remove_column(largest)
}

fn reflection(v: &Vector5<f64>) -> Matrix5<f64> {
    Matrix5::identity() - v * v.transpose() * (2.0 / v.norm_squared())
}

/// Points from the centroid of the first three in the frame of their plane, pixels from the principal point, both of unit size.
struct Scene {
    points: [Point; 4],
    pixels: [Pixel; 3],
    u4: f64,
    axes: Matrix3<f64>,
    centre: Point,
    size_m: f64,
    size_px: f64,
    /// a₁, a₂, q·F as linear forms of (ℓ, F κ, y, z, F x), F the typical focal length.
    rows: [SMatrix<f64, 3, 6>; 3],
    /// The fourth point's equation on them.
    column: Vector6<f64>,
}

impl Scene {
    fn new(pixels: &[Pixel; 3], u4: f64, points: &[Point; 4]) -> Option<Self> {
        let centre = (points[0] + points[1] + points[2]) / 3.0;
        let mean = (pixels[0] + pixels[1] + pixels[2]) / 3.0;
        let size_m = points[..3].iter().map(|x| (x - centre).norm()).sum::<f64>() / 3.0;
        let size_px = pixels.iter().map(|u| (u - mean).norm()).sum::<f64>() / 3.0;
        let local = points.map(|x| (x - centre) / size_m);
        let (first, second) = (local[1] - local[0], local[2] - local[0]);
        let normal = first.cross(&second);
        let area = normal.norm();
        let is_usable = |x: f64| 0.0 < x && x.is_finite();
        let numbers =
            [size_m, size_px, 1.0 / size_m, 1.0 / size_px, area, 1.0 + local[3].norm(), 1.0 + u4.abs()];
        if !(numbers.into_iter().all(is_usable) && MIN_AREA < area) {
            return None;
        }
        let (n, e) = (normal / area, first.normalize());
        let axes = Matrix3::from_columns(&[e, n.cross(&e), n]);
        let points = local.map(|x| axes.tr_mul(&x));
        let (rows, column) = (Default::default(), Vector6::zeros());
        let (pixels, u4) = (pixels.map(|u| u / size_px), u4 / size_px);
        let mut scene = Scene { points, pixels, u4, axes, centre, size_m, size_px, rows, column };
        scene.set_linear_forms(area);
        (scene.column.norm().is_finite() && 0.0 < scene.column.norm()).then_some(scene)
    }

    /// Eqs. (14), (15).
    fn set_linear_forms(&mut self, area: f64) {
        let x = &self.points;
        let across = |v: Vector3<f64>| Vector2::new(-v.y, v.x) / area;
        let dual = [across(x[2] - x[1]), across(x[0] - x[2]), across(x[1] - x[0])];
        let inverse = 1.0 / TYPICAL_FOCAL;
        let (mut rows, mut column) = ([SMatrix::<f64, 3, 6>::zeros(); 3], Vector6::zeros());
        for i in 0..3 {
            let depth = [1.0, x[i].x * inverse, x[i].y * inverse];
            let b = 1.0 / 3.0 + dual[i].dot(&x[3].xy());
            for (k, d) in depth.into_iter().enumerate() {
                for (row, weight) in rows[..2].iter_mut().zip([self.pixels[i].x, self.pixels[i].y]) {
                    row[(0, k)] += d * weight * dual[i].x;
                    row[(1, k)] += d * weight * dual[i].y;
                }
                column[k] += b * d * (self.pixels[i].x - self.u4);
            }
        }
        (rows[0][(2, 3)], rows[1][(2, 4)]) = (1.0, 1.0);
        (rows[2][(0, 1)], rows[2][(1, 2)], rows[2][(2, 5)]) = (1.0, 1.0, 1.0);
        (column[3], column[5]) = (x[3].z, -x[3].z * self.u4 * inverse);
        (self.rows, self.column) = (rows, column);
    }

    /// The fourth point's equation with that point lifted off the triangle's plane, where it is too near.
    fn lifted(&self) -> Option<Vector6<f64>> {
        let h = self.points[3].z;
        let lift = LEAST_HEIGHT.copysign(h) - h;
        let lifted = self.column + Vector6::new(0.0, 0.0, 0.0, 1.0, 0.0, -self.u4 / TYPICAL_FOCAL) * lift;
        (h.abs() < LEAST_HEIGHT).then_some(lifted)
    }

    /// Whether the first two rows are not zero: a plane has such a solution, x alone, twice.
    fn is_rotation(&self, zeta: &Vector6<f64>) -> bool {
        MIN_ROWS < (self.rows[0] * zeta).norm()
    }

    /// Rotation from the triangle's frame, place of its centroid and focal length in the scene's units, eq. (19).
    fn candidate(&self, zeta: &Vector6<f64>) -> Option<Fit> {
        let x = &self.points;
        let depth = |i: usize| zeta[0] + (zeta[1] * x[i].x + zeta[2] * x[i].y) / TYPICAL_FOCAL;
        let [a1, a2, q] = self.rows.map(|row| row * zeta);
        let scale = (0.5 * (a1.norm_squared() + a2.norm_squared())).sqrt();
        let focal = TYPICAL_FOCAL * scale / q.norm();
        let sign = depth(0).signum() / scale;
        let rows = [a1 * sign, a2 * sign, q * (sign * focal / TYPICAL_FOCAL)];
        let rotation = crate::pose::orthonormalized(&Matrix3::from_rows(&rows.map(|row| row.transpose())));
        let is_right_handed = 0.0 < rows[2].dot(&rotation.row(2).transpose());
        let at = |i: usize| self.pixels[i].push(focal) * (depth(i) * sign);
        let centre_in_cam = (at(0) + at(1) + at(2)) / 3.0;
        (is_right_handed && FOCALS.contains(&focal)).then_some(Fit { rotation, centre_in_cam, focal })
    }

    /// Whether all points are in front and on their coordinates.
    fn is_met(&self, fit: &Fit) -> bool {
        let size = self.pixels.iter().fold(self.u4.abs(), |most, u| most.max(u.amax()));
        let (mut miss, mut is_in_front) = (0.0, true);
        for (i, x) in self.points.iter().enumerate() {
            let x = fit.rotation * x + fit.centre_in_cam;
            let (u, v) = (fit.focal * x.x / x.z, fit.focal * x.y / x.z);
            is_in_front &= 0.0 < x.z;
            miss += if i < 3 {
                (u - self.pixels[i].x).abs() + (v - self.pixels[i].y).abs()
            } else {
                (u - self.u4).abs()
            };
        }
        is_in_front && miss < MAX_MISS * size
    }

    /// Back to metres and pixels.
    fn undone(&self, fit: &Fit) -> FocalPose {
        let rotation = crate::pose::orthonormalized(&(fit.rotation * self.axes.transpose()));
        let translation = fit.centre_in_cam * self.size_m - rotation * self.centre;
        FocalPose { cam_from_target: Pose::new(rotation, translation), focal_px: fit.focal * self.size_px }
    }
}

/// A candidate in the scene's units.
struct Fit {
    rotation: Matrix3<f64>,
    centre_in_cam: Point,
    focal: f64,
}
