//! Four points and the focal length: own derivation, docs/math/focal.md section 2; equation numbers refer to it.
//!
//! Eight equations for seven unknowns. Three of the points span a plane; the unknowns are the third column of the scaled rotation in that
//! plane's frame and one scale. Four quadrics in them hold for points in space and in a plane alike, without a number that grows as the
//! fourth point nears the plane. Elimination leaves a polynomial of degree 6.
//!
//!   h  height of the fourth point   ·   k  Σ kᵢ = 0, Σ kᵢ Xᵢ = h n   ·   λᵢ  depth over f   ·   λ* depths if h were 0
//!   a₁, a₂  first rows of the scaled rotation, q  third over f   ·   ξ = (ω, x, y, z): λ = ω λ* + …, x = q_n, y = a₁_n, z = a₂_n

use super::unknown_focal::{Fit, FocalCandidates, Scene, roots_up_to_one};
use crate::{Pixel, Point};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Matrix3x4, Matrix4, RowVector4, SMatrix, Vector3, Vector4};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Area of the largest triangle (twice, over the square of the size) below which the points are on a line.
const MIN_AREA: f64 = 1e-9;
/// Four points of a plane, three of which are on a line to this part of their size, determine no homography.
const MIN_OPENING: f64 = 1e-9;
/// Largest coefficient of the polynomial, for rows of unit size, below which it is zero: a frontal plane.
const MIN_POLYNOMIAL: f64 = 1e-13;
/// Smallest part of the perspective in a solution that shows a focal length: below it the plane is frontal.
const MIN_PERSPECTIVE: f64 = 1e-7;

/// Poses and focal lengths that put four points onto four pixels given from the principal point.
///
/// At most four, best first; with exact pixels nearly always one. Noisy pixels are met in the least-squares sense; a candidate that misses
/// them by more than a twentieth of their spread is dropped. None for points on a line, for four points of a plane three of which are on a
/// line, for a frontal plane (f and distance cannot be separated), for what is not finite.
pub fn p4pf(pixels: &[Pixel; 4], points_in_target: &[Point; 4]) -> FocalCandidates {
    let Some(scene) = Scene::new(pixels, points_in_target) else { return FocalCandidates::new() };
    let mut found = ArrayVec::new();
    for order in larger_triangles_first(&scene.points) {
        if let Some(frame) = Frame::new(&scene, &order) {
            solve(&scene, &frame, &mut found);
        }
        if found.first().is_some_and(|best: &Fit| scene.is_good(best)) {
            break;
        }
    }
    scene.undone(&found)
}

fn solve(scene: &Scene<4>, frame: &Frame, found: &mut ArrayVec<Fit, 4>) {
    let quadrics = frame.quadrics();
    let Some(system) = System::new(&quadrics) else { return };
    let sextic = system.sextic();
    if sextic.iter().all(|c| c.abs() < MIN_POLYNOMIAL) {
        return;
    }
    let mut reversed = sextic;
    reversed.reverse();
    let beyond = roots_up_to_one(&reversed).into_iter().filter(|x| *x != 0.0).map(|x| 1.0 / x);
    for x in roots_up_to_one(&sextic).into_iter().chain(beyond) {
        let fit = system.unknowns(x).and_then(|xi| frame.fit(&polished(xi, &quadrics), scene));
        if let Some(fit) = fit {
            scene.admit(fit, found);
        }
    }
}

/// Orders of the points: the first three span a triangle, the largest comes first. One is enough but for one problem in ten thousand.
fn larger_triangles_first(x: &[Point; 4]) -> [[usize; 4]; 2] {
    let area = |o: &[usize; 4]| (x[o[1]] - x[o[0]]).cross(&(x[o[2]] - x[o[0]])).norm_squared();
    let mut orders = [[0, 1, 2, 3], [0, 1, 3, 2], [0, 2, 3, 1], [1, 2, 3, 0]];
    orders.sort_unstable_by(|a, b| area(b).total_cmp(&area(a)));
    [orders[0], orders[1]]
}

/// What the points and pixels say, in the frame of the plane of the first three.
struct Frame {
    /// Axes of the plane and its normal, target frame.
    axes: Matrix3<f64>,
    /// λ = T ξ, in the order of the scene's points.
    depths: Matrix4<f64>,
    /// a₁, a₂, q as linear maps of ξ, eq. (5).
    rows: [Matrix3x4<f64>; 3],
}

impl Frame {
    /// None where the points are on a line, or in a plane with three on a line.
    fn new(scene: &Scene<4>, order: &[usize; 4]) -> Option<Self> {
        let (x, u) = (order.map(|i| scene.points[i]), order.map(|i| scene.pixels[i]));
        let (first, second, off) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let normal = first.cross(&second);
        let area = normal.norm();
        if !(MIN_AREA < area) {
            return None;
        }
        let (n, e) = (normal / area, first.normalize());
        let axes = Matrix3::from_columns(&[e, n.cross(&e), n]);
        // Dual of the triangle: the gradient of a linear field in the plane is the sum of value times dual.
        let (d1, d2) = (second.cross(&n) / area, n.cross(&first) / area);
        let dual = [-d1 - d2, d1, d2].map(|d| axes.tr_mul(&d).xy());
        let k = Vector4::new(d1.dot(&off) + d2.dot(&off) - 1.0, -d1.dot(&off), -d2.dot(&off), 1.0);
        if !(MIN_OPENING < k.amin().max(n.dot(&off).abs())) {
            return None; // three on a line, and the fourth in their plane
        }
        let depths = depth_basis(&k, &u, n.dot(&off))?;
        let row = |weight: &dyn Fn(usize) -> f64, normal_part: usize| {
            let mut row = Matrix3x4::zeros();
            for i in 0..3 {
                row.fixed_rows_mut::<2>(0)
                    .iter_mut()
                    .zip((dual[i] * (depths.row(i) * weight(i))).iter())
                    .for_each(|(a, b)| *a += b);
            }
            row[(2, normal_part)] = 1.0;
            row
        };
        let rows = [row(&|i| u[i].x, 2), row(&|i| u[i].y, 3), row(&|_| 1.0, 1)];
        let mut of_scene = Matrix4::zeros();
        order.iter().enumerate().for_each(|(at, i)| of_scene.set_row(*i, &depths.row(at)));
        Some(Frame { axes, depths: of_scene, rows })
    }

    /// a₁·a₂, |a₁|² − |a₂|², a₁·q, a₂·q as quadratic forms of ξ, eq. (6).
    fn quadrics(&self) -> [Matrix4<f64>; 4] {
        let [a1, a2, q] = &self.rows;
        let mixed = |a: &Matrix3x4<f64>, b: &Matrix3x4<f64>| {
            let product = a.tr_mul(b);
            (product + product.transpose()) * 0.5
        };
        [mixed(a1, a2), a1.tr_mul(a1) - a2.tr_mul(a2), mixed(a1, q), mixed(a2, q)]
    }

    /// Focal length and pose, eq. (9); none for depths of both signs, for a reflection, for a frontal plane.
    fn fit(&self, xi: &Vector4<f64>, scene: &Scene<4>) -> Option<Fit> {
        let depths = self.depths * xi;
        let sign = depths[0].signum();
        let depths = depths * sign;
        let [a1, a2, q] = self.rows.map(|row| row * xi * sign);
        if !depths.iter().all(|depth| 0.0 < *depth)
            || !(MIN_PERSPECTIVE * q.norm() < q.xy().norm() + depths.max() - depths.min())
        {
            return None;
        }
        let focal = (0.5 * (a1.norm_squared() + a2.norm_squared()) / q.norm_squared()).sqrt();
        let scaled = Matrix3::from_rows(&[a1.transpose(), a2.transpose(), q.transpose() * focal]);
        if !(0.0 < scaled.determinant() && focal.is_finite()) {
            return None;
        }
        let scale = scaled.norm() / 3.0f64.sqrt();
        let centre = (0..4).map(|i| scene.pixels[i].push(focal) * depths[i]).sum::<Vector3<f64>>() / 4.0;
        let rotation = crate::pose::orthonormalized(&scaled) * self.axes.transpose();
        Some(Fit::new(rotation, centre / scale, focal))
    }
}

/// T with λ = T ξ of docs/math/focal.md, after eq. (5): its first column is λ*, the others vanish with h.
fn depth_basis(k: &Vector4<f64>, u: &[Pixel; 4], h: f64) -> Option<Matrix4<f64>> {
    let u = u.map(|u| u.push(1.0));
    let triple = |a: usize, b: usize, c: usize| u[a].dot(&u[b].cross(&u[c]));
    // Σ mᵢ (u, v, 1)ᵢ = 0, and λ*ᵢ = mᵢ/kᵢ.
    let m = [triple(1, 2, 3), -triple(0, 2, 3), triple(0, 1, 3), -triple(0, 1, 2)];
    let others = |i: usize| (0..4).filter(|j| *j != i).map(|j| k[j]).product::<f64>();
    let star = Vector4::from_fn(|i, _| m[i] * others(i)).try_normalize(f64::MIN_POSITIVE)?;
    let form = |of: &dyn Fn(usize) -> f64| RowVector4::from_fn(|_, i| k[i] * of(i));
    let forms = Matrix4::from_rows(&[star.transpose(), form(&|_| 1.0), form(&|i| u[i].x), form(&|i| u[i].y)]);
    Some(forms.try_inverse()? * Matrix4::from_diagonal(&Vector4::new(1.0, h, h, h)))
}

/// One equation in z², y, z, 1 with polynomials of x, constant first: w, p, q, r.
#[derive(Clone, Copy)]
struct Row {
    w: f64,
    p: [f64; 2],
    q: [f64; 2],
    r: [f64; 3],
}

/// The quadrics solved for y² and yz, and two more, one of which is without z², eq. (7).
struct System {
    yy: Row,
    yz: Row,
    flat: Row,
    other: Row,
}

/// A product of polynomials: the first three of (z², y, z, 1) have one degree, the last one more.
struct Raised {
    w: [f64; 2],
    p: [f64; 3],
    q: [f64; 3],
    r: [f64; 4],
}

impl System {
    fn new(quadrics: &[Matrix4<f64>; 4]) -> Option<Self> {
        // Columns: y², yz, z², yx, y, zx, z, x², x, 1.
        let mut m = SMatrix::<f64, 4, 10>::zeros();
        for (row, s) in quadrics.iter().enumerate() {
            let two = |i: usize, j: usize| 2.0 * s[(i, j)];
            let squares = [s[(2, 2)], two(2, 3), s[(3, 3)]];
            let rest = [two(1, 2), two(0, 2), two(1, 3), two(0, 3), s[(1, 1)], two(0, 1), s[(0, 0)]];
            squares.iter().chain(&rest).enumerate().for_each(|(column, entry)| m[(row, column)] = *entry);
        }
        for pivot in 0..2 {
            let best = (pivot..4)
                .fold(pivot, |best, i| if m[(best, pivot)].abs() < m[(i, pivot)].abs() { i } else { best });
            m.swap_rows(pivot, best);
            let scaled = m.row(pivot) / m[(pivot, pivot)];
            m.set_row(pivot, &scaled);
            for row in (0..4).filter(|row| *row != pivot) {
                let reduced = m.row(row) - scaled * m[(row, pivot)];
                m.set_row(row, &reduced);
            }
        }
        let [s, t] = [2, 3].map(|i| m.row(i) / m.row(i).norm());
        let size = s[2].hypot(t[2]);
        let (c, d) = if size < f64::MIN_POSITIVE { (1.0, 0.0) } else { (t[2] / size, s[2] / size) };
        let (flat, other) = (s * c - t * d, s * d + t * c);
        let row = |m: &SMatrix<f64, 1, 10>, sign: f64| {
            let m = m * sign;
            Row { w: m[2], p: [m[4], m[3]], q: [m[6], m[5]], r: [m[9], m[8], m[7]] }
        };
        let whole = m.iter().all(|x| x.is_finite());
        let [yy, yz] = [0, 1].map(|i| row(&m.row(i).into_owned(), -1.0));
        whole.then(|| System { yy, yz, flat: row(&flat, 1.0), other: row(&other, 1.0) })
    }

    /// The equation without z², times y and times z, eq. (8).
    fn raised(&self) -> [Raised; 2] {
        let (System { yy, yz, flat: Row { p, q, r, .. }, .. }, [p0, p1]) = (self, self.flat.p);
        let [q0, q1] = *q;
        let times_y = Raised {
            w: [yy.w * p0 + yz.w * q0, yy.w * p1 + yz.w * q1],
            p: sum(sum(product(&yy.p, p), product(&yz.p, q)), *r),
            q: sum(product(&yy.q, p), product(&yz.q, q)),
            r: sum(product(&yy.r, p), product(&yz.r, q)),
        };
        let times_z = Raised {
            w: [yz.w * p0 + q0, yz.w * p1 + q1],
            p: product(&yz.p, p),
            q: sum(product(&yz.q, p), *r),
            r: product(&yz.r, p),
        };
        [times_y, times_z]
    }

    /// The determinant of the four equations in z², y, z, 1.
    fn sextic(&self) -> [f64; 7] {
        let [ty, tz] = &self.raised();
        let (l, m) = (&self.flat, &self.other);
        let cross_yz: ([f64; 6], [f64; 6], [f64; 5]) = (
            difference(product(&ty.q, &tz.r), product(&ty.r, &tz.q)),
            difference(product(&ty.r, &tz.p), product(&ty.p, &tz.r)),
            difference(product(&ty.p, &tz.q), product(&ty.q, &tz.p)),
        );
        let cross_ml: ([f64; 4], [f64; 4], [f64; 3]) = (
            difference(product(&m.q, &l.r), product(&m.r, &l.q)),
            difference(product(&m.r, &l.p), product(&m.p, &l.r)),
            difference(product(&m.p, &l.q), product(&m.q, &l.p)),
        );
        let whole: [f64; 7] =
            sum(sum(product(&cross_yz.0, &l.p), product(&cross_yz.1, &l.q)), product(&cross_yz.2, &l.r));
        let with = |t: &Raised| -> [f64; 6] {
            sum(sum(product(&cross_ml.0, &t.p), product(&cross_ml.1, &t.q)), product(&cross_ml.2, &t.r))
        };
        let parts: [f64; 7] = difference(product(&with(tz), &ty.w), product(&with(ty), &tz.w));
        sum(whole.map(|c| c * m.w), parts)
    }

    /// ξ at a root, the scale ω being 1.
    fn unknowns(&self, x: f64) -> Option<Vector4<f64>> {
        let at = |c: &[f64]| c.iter().rev().fold(0.0, |sum, c| sum * x + c);
        let plain = |row: &Row| RowVector4::new(row.w, at(&row.p), at(&row.q), at(&row.r));
        let raised = self.raised().map(|t| RowVector4::new(at(&t.w), at(&t.p), at(&t.q), at(&t.r)));
        let rows = [plain(&self.flat), plain(&self.other), raised[0], raised[1]];
        let null = null_vector(rows.map(|row| row.normalize()))?;
        Some(Vector4::new(1.0, x, null[1] / null[3], null[2] / null[3]))
    }
}

/// The vector a singular 4×4 matrix sends to zero, by elimination with whole pivots.
fn null_vector(mut rows: [RowVector4<f64>; 4]) -> Option<Vector4<f64>> {
    let mut columns = [0, 1, 2, 3];
    for step in 0..3 {
        let (mut best, mut at) = (0.0, (step, step));
        for i in step..4 {
            for j in step..4 {
                if best < rows[i][columns[j]].abs() {
                    (best, at) = (rows[i][columns[j]].abs(), (i, j));
                }
            }
        }
        if best == 0.0 {
            return None;
        }
        rows.swap(step, at.0);
        columns.swap(step, at.1);
        let pivot = rows[step] / rows[step][columns[step]];
        for i in (0..4).filter(|i| *i != step) {
            rows[i] -= pivot * rows[i][columns[step]];
        }
        rows[step] = pivot;
    }
    let mut null = Vector4::zeros();
    (0..3).for_each(|i| null[columns[i]] = -rows[i][columns[3]]);
    null[columns[3]] = 1.0;
    Some(null)
}

fn product<const A: usize, const B: usize, const C: usize>(a: &[f64; A], b: &[f64; B]) -> [f64; C] {
    let mut product = [0.0; C];
    for (i, a) in a.iter().enumerate() {
        b.iter().enumerate().for_each(|(j, b)| product[i + j] += a * b);
    }
    product
}

fn sum<const A: usize>(a: [f64; A], b: [f64; A]) -> [f64; A] {
    core::array::from_fn(|i| a[i] + b[i])
}

fn difference<const A: usize>(a: [f64; A], b: [f64; A]) -> [f64; A] {
    core::array::from_fn(|i| a[i] - b[i])
}

/// Gauss–Newton on the four quadrics: undoes the rounding of the elimination.
fn polished(xi: Vector4<f64>, quadrics: &[Matrix4<f64>; 4]) -> Vector4<f64> {
    let mut best = xi;
    for _ in 0..2 {
        let rows = quadrics.map(|s| s * best);
        let (mut normal, mut gradient) = (Matrix3::zeros(), Vector3::zeros());
        for row in rows {
            let slope = row.fixed_rows::<3>(1) * 2.0;
            gradient += slope * best.dot(&row);
            normal += slope * slope.transpose();
        }
        let Some(step) = normal.cholesky().map(|c| c.solve(&gradient)) else { break };
        best -= Vector4::new(0.0, step.x, step.y, step.z);
    }
    best
}
