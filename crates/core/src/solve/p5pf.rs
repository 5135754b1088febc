//! Five points and the focal length: own derivation, docs/math/focal.md section 3; equation numbers refer to it.
//!
//! The direction of a pixel from the principal point depends neither on the focal length nor on the distance (nor on radial distortion):
//! one linear equation a point. Five leave a plane of solutions, in which two conics meet in four points; focal length and distance follow
//! by linear least squares.
//!
//!   (a₁, t₁, a₂, t₂)  first two rows of the scaled rotation and translation   ·   ρ = |(u, v)|
//!   hᵢ  image of Xᵢ in those rows along the direction of its pixel   ·   (1, x, y)  coordinates in the null space

use super::unknown_focal::{Fit, FocalCandidates, Scene, roots_up_to_one};
use crate::{Pixel, Point};
use arrayvec::ArrayVec;
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

type Matrix8x3 = SMatrix<f64, 8, 3>;

/// Smallest pivot of the five equations (rows of unit size) that are independent.
const MIN_PIVOT: f64 = 1e-12;
/// Smallest determinant (relative) of the equations for focal length and distance: below it the plane is frontal.
const MIN_PERSPECTIVE: f64 = 1e-10;

/// Poses and focal lengths that put five points, in space or in a plane, onto five pixels given from the principal point.
///
/// At most four, best first. Ten equations for seven unknowns: noisy pixels are met in the least-squares sense, and a candidate that misses them
/// by more than a twentieth of their spread is dropped. None for a frontal plane, for four points on a line, for what is not finite.
pub fn p5pf(pixels: &[Pixel; 5], points_in_target: &[Point; 5]) -> FocalCandidates {
    let Some(scene) = Scene::new(pixels, points_in_target) else { return FocalCandidates::new() };
    let mut found = ArrayVec::new();
    if let Some(basis) = null_space(&scene) {
        let conics = conics(&basis);
        for (x, y) in intersections(&conics) {
            if let Some(fit) = fit(&(basis * Vector3::new(1.0, x, y)), &scene) {
                scene.admit(fit, &mut found);
            }
        }
    }
    scene.undone(&found)
}

/// Orthonormal basis of what the five directions leave open, eq. (10), turned so that no layout puts a solution on an axis.
fn null_space(scene: &Scene<5>) -> Option<Matrix8x3> {
    let mut m = SMatrix::<f64, 5, 8>::zeros();
    for (i, (x, u)) in scene.points.iter().zip(&scene.pixels).enumerate() {
        let row = [u.y * x.x, u.y * x.y, u.y * x.z, u.y, -u.x * x.x, -u.x * x.y, -u.x * x.z, -u.x];
        m.set_row(i, &SMatrix::<f64, 1, 8>::from(row).normalize());
    }
    let mut columns = [0, 1, 2, 3, 4, 5, 6, 7];
    for step in 0..5 {
        let (mut best, mut at) = (MIN_PIVOT, None);
        for i in step..5 {
            for j in step..8 {
                if best < m[(i, columns[j])].abs() {
                    (best, at) = (m[(i, columns[j])].abs(), Some((i, j)));
                }
            }
        }
        let (row, column) = at?;
        m.swap_rows(step, row);
        columns.swap(step, column);
        let pivot = m.row(step) / m[(step, columns[step])];
        for i in (0..5).filter(|i| *i != step) {
            let reduced = m.row(i) - pivot * m[(i, columns[step])];
            m.set_row(i, &reduced);
        }
        m.set_row(step, &pivot);
    }
    let mut basis = Matrix8x3::zeros();
    for free in 0..3 {
        basis[(columns[5 + free], free)] = 1.0;
        (0..5).for_each(|i| basis[(columns[i], free)] = -m[(i, columns[5 + free])]);
    }
    Some(orthonormal(basis) * generic_turn())
}

/// Gram–Schmidt, twice: once leaves what the first columns' length amplifies.
fn orthonormal(mut basis: Matrix8x3) -> Matrix8x3 {
    for _ in 0..2 {
        for j in 0..3 {
            let mut column: SVector<f64, 8> = basis.column(j).into();
            for i in 0..j {
                column -= basis.column(i) * basis.column(i).dot(&column);
            }
            basis.set_column(j, &column.normalize());
        }
    }
    basis
}

/// A rotation without meaning: of the quaternion (4, 1, 2, 3)/√30.
fn generic_turn() -> Matrix3<f64> {
    Matrix3::new(4.0, -20.0, 22.0, 28.0, 10.0, 4.0, -10.0, 20.0, 20.0) / 30.0
}

/// a₁·a₂ and |a₁|² − |a₂|² in the null space, eq. (11).
fn conics(basis: &Matrix8x3) -> [Matrix3<f64>; 2] {
    let (a1, a2) = (basis.fixed_rows::<3>(0), basis.fixed_rows::<3>(4));
    let product = a1.tr_mul(&a2);
    let forms = [(product + product.transpose()) * 0.5, a1.tr_mul(&a1) - a2.tr_mul(&a2)];
    forms.map(|form| form / form.norm())
}

/// Common points (x, y) of two conics (1, x, y) Q (1, x, y)ᵀ = 0 by the quartic of eq. (12).
fn intersections(conics: &[Matrix3<f64>; 2]) -> ArrayVec<(f64, f64), 16> {
    let mut found = ArrayVec::new();
    let quartic = quartic(conics);
    let mut reversed = quartic;
    reversed.reverse();
    let beyond = roots_up_to_one(&reversed).into_iter().filter(|x| *x != 0.0).map(|x| 1.0 / x);
    for x in roots_up_to_one(&quartic).into_iter().chain(beyond) {
        for y in partners(conics, x) {
            let _ = found.try_push(polished(conics, x, y));
        }
    }
    found
}

/// (A, B(x), C(x)) of A y² + B y + C, constants first.
fn by_y(q: &Matrix3<f64>) -> (f64, [f64; 2], [f64; 3]) {
    (q[(2, 2)], [2.0 * q[(0, 2)], 2.0 * q[(1, 2)]], [q[(0, 0)], 2.0 * q[(0, 1)], q[(1, 1)]])
}

/// (A₁C₂ − A₂C₁)² − (A₁B₂ − A₂B₁)(B₁C₂ − B₂C₁).
fn quartic(conics: &[Matrix3<f64>; 2]) -> [f64; 5] {
    let [(a1, b1, c1), (a2, b2, c2)] = [by_y(&conics[0]), by_y(&conics[1])];
    let ac: [f64; 3] = core::array::from_fn(|i| a1 * c2[i] - a2 * c1[i]);
    let ab: [f64; 2] = core::array::from_fn(|i| a1 * b2[i] - a2 * b1[i]);
    let mut bc = [0.0; 4];
    for i in 0..2 {
        for j in 0..3 {
            bc[i + j] += b1[i] * c2[j] - b2[i] * c1[j];
        }
    }
    let mut quartic = [0.0; 5];
    for i in 0..3 {
        (0..3).for_each(|j| quartic[i + j] += ac[i] * ac[j]);
    }
    for i in 0..2 {
        (0..4).for_each(|j| quartic[i + j] -= ab[i] * bc[j]);
    }
    quartic
}

/// The y that go with x: the one both conics share, or both of the first where their difference leaves y open.
fn partners(conics: &[Matrix3<f64>; 2], x: f64) -> ArrayVec<f64, 2> {
    let at = |c: &[f64]| c.iter().rev().fold(0.0, |sum, c| sum * x + c);
    let [(a1, b1, c1), (a2, b2, c2)] = [by_y(&conics[0]), by_y(&conics[1])];
    let (b1, b2, c1, c2) = (at(&b1), at(&b2), at(&c1), at(&c2));
    let (slope, constant) = (a1 * b2 - a2 * b1, a1 * c2 - a2 * c1);
    let mut found = ArrayVec::new();
    let size = (a1 * b2).abs() + (a2 * b1).abs();
    if 1e-6 * size < slope.abs() {
        found.push(-constant / slope);
    } else {
        let (half, root) = (-0.5 * b1 / a1, (0.25 * b1 * b1 / (a1 * a1) - c1 / a1).max(0.0).sqrt());
        found.extend([half + root, half - root]);
    }
    found
}

/// Newton's steps towards both conics.
fn polished(conics: &[Matrix3<f64>; 2], x: f64, y: f64) -> (f64, f64) {
    let mut place = Vector3::new(1.0, x, y);
    for _ in 0..3 {
        let [f, g] = conics.map(|q| q * place);
        let slope = Matrix2::new(f.y, f.z, g.y, g.z) * 2.0;
        let Some(inverse) = slope.try_inverse() else { break };
        let step = inverse * Vector2::new(f.dot(&place), g.dot(&place));
        place -= Vector3::new(0.0, step.x, step.y);
    }
    (place.y, place.z)
}

/// Focal length and pose, eq. (13); none where the focal length is not positive or a frontal plane leaves it open.
fn fit(rows: &SVector<f64, 8>, scene: &Scene<5>) -> Option<Fit> {
    let scale =
        (0.5 * rows.fixed_rows::<3>(0).norm_squared() + 0.5 * rows.fixed_rows::<3>(4).norm_squared()).sqrt();
    let image = |x: &Point, u: &Pixel| {
        let along = |i: usize| rows.fixed_rows::<3>(i).dot(x) + rows[i + 3];
        (along(0) * u.x + along(4) * u.y) / scale
    };
    let towards: f64 = scene.points.iter().zip(&scene.pixels).map(|(x, u)| image(x, u)).sum();
    let sign = towards.signum() / scale;
    let (r1, r2) = (rows.fixed_rows::<3>(0) * sign, rows.fixed_rows::<3>(4) * sign);
    let r3 = r1.cross(&r2);
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (x, u) in scene.points.iter().zip(&scene.pixels) {
        // ρ (h f − ρ t₃ = ρ r₃·X): no division where a pixel is the principal point.
        let row = Vector2::new(image(x, u) * towards.signum(), -u.norm_squared());
        normal += row * row.transpose();
        right += row * (u.norm_squared() * r3.dot(x));
    }
    let determinant = normal.determinant();
    if !(MIN_PERSPECTIVE * normal[(0, 0)] * normal[(1, 1)] < determinant) {
        return None;
    }
    let found = normal.try_inverse()? * right;
    let rotation =
        crate::pose::orthonormalized(&Matrix3::from_rows(&[r1.transpose(), r2.transpose(), r3.transpose()]));
    let centre = Vector3::new(rows[3] * sign, rows[7] * sign, found.y);
    (0.0 < found.x).then(|| Fit::new(rotation, centre, found.x))
}
