//! Paper: H. Stewénius, C. Engels, D. Nistér, "Recent developments on direct relative orientation", ISPRS Journal 60, 2006.
//! Five pairs of bearings to the essential matrices that fit them: docs/math/two_view.md section 2, whose equations are cited.
//!
//! ```text
//!   E = x X + y Y + z Z + w W  in the null space of the five conditions   ·   monomials in x, y, z, w with w = 1
//!   A  ten cubics, solved for the ten monomials without w   ·   M  multiplication by x among the ten others
//! ```

use crate::polynomial::eigen::Hessenberg;
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, SMatrix, Vector3};

/// Up to ten essential matrices, each of unit norm.
pub(super) type Candidates = ArrayVec<Matrix3<f64>, 10>;

/// A form of degree 1, 2 or 3 in x, y, z, w: coefficients of `w`'s powers last.
type Linear = [f64; 4];
type Quadric = [f64; 10];
type Cubic = [f64; 20];

const QUADS: [[usize; 2]; 10] =
    [[0, 0], [0, 1], [0, 2], [0, 3], [1, 1], [1, 2], [1, 3], [2, 2], [2, 3], [3, 3]];
/// Ten monomials without w (number 3), then those with it; x, y, z, w times w² first.
const CUBES: [[usize; 3]; 20] = [
    [0, 0, 0],
    [0, 0, 1],
    [0, 0, 2],
    [0, 1, 1],
    [0, 1, 2],
    [0, 2, 2],
    [1, 1, 1],
    [1, 1, 2],
    [1, 2, 2],
    [2, 2, 2],
    [0, 3, 3],
    [1, 3, 3],
    [2, 3, 3],
    [3, 3, 3],
    [0, 0, 3],
    [0, 1, 3],
    [0, 2, 3],
    [1, 1, 3],
    [1, 2, 3],
    [2, 2, 3],
];
/// Monomials without w.
const PURE: usize = 10;
/// A pivot below this (rows of unit size) is rounding: the pairs depend on each other.
const MIN_PIVOT: f64 = 1e-12;
/// Imaginary part of an eigenvalue, in parts of one plus its size, that rounding gives to a double root.
const REAL: f64 = 1e-7;

const QUAD_OF: [[usize; 4]; 4] = quad_of();
const CUBE_OF: [[usize; 4]; 10] = cube_of();

const fn quad_of() -> [[usize; 4]; 4] {
    let (mut of, mut q) = ([[0; 4]; 4], 0);
    while q < 10 {
        let [i, j] = QUADS[q];
        of[i][j] = q;
        of[j][i] = q;
        q += 1;
    }
    of
}

const fn cube_of() -> [[usize; 4]; 10] {
    let (mut of, mut q) = ([[0; 4]; 10], 0);
    while q < 10 {
        let mut k = 0;
        while k < 4 {
            of[q][k] = place(QUADS[q], k);
            k += 1;
        }
        q += 1;
    }
    of
}

/// Where the product of a sorted pair and another unknown stands.
const fn place([i, j]: [usize; 2], k: usize) -> usize {
    let sorted = if k < i {
        [k, i, j]
    } else if k < j {
        [i, k, j]
    } else {
        [i, j, k]
    };
    let mut at = 0;
    while CUBES[at][0] != sorted[0] || CUBES[at][1] != sorted[1] || CUBES[at][2] != sorted[2] {
        at += 1;
    }
    at
}

/// The essential matrices E with bᵀ E a = 0 for five pairs (a, b) of bearings.
pub(super) fn five_point(pairs: &[(Vector3<f64>, Vector3<f64>); 5]) -> Candidates {
    let Some(basis) = null_space(pairs) else { return Candidates::new() };
    let Some(rows) = solved(cubics(&basis)) else { return Candidates::new() };
    let hessenberg = Hessenberg::<PURE, 4>::new(&multiplication_by_x(&rows));
    let mut found = Candidates::new();
    for [value, imaginary] in hessenberg.eigenvalues() {
        if REAL * (1.0 + value.abs()) < imaginary {
            continue;
        }
        let v = hessenberg.vector(value);
        let e = basis.iter().zip(v).map(|(matrix, x)| matrix * x).sum::<Matrix3<f64>>();
        let norm = e.norm();
        if 0.0 < norm && norm.is_finite() && !found.is_full() {
            found.push(e / norm);
        }
    }
    found
}

/// X, Y, Z, W of eq. (4): an orthonormal basis of what the five conditions leave.
fn null_space(pairs: &[(Vector3<f64>, Vector3<f64>); 5]) -> Option<[Matrix3<f64>; 4]> {
    // Rows of zeros make the matrix square, so that all nine right singular vectors are given.
    let mut conditions = SMatrix::<f64, 9, 9>::zeros();
    for (row, (a, b)) in pairs.iter().enumerate() {
        let condition = b * a.transpose();
        (0..9).for_each(|i| conditions[(row, i)] = condition[(i / 3, i % 3)]);
    }
    let svd = conditions.try_svd(false, true, f64::EPSILON, 200)?;
    let (vectors, values) = (svd.v_t?, svd.singular_values);
    let mut order: [usize; 9] = core::array::from_fn(|i| i);
    order.sort_by(|i, j| values[*i].total_cmp(&values[*j]));
    let matrix = |row: usize| Matrix3::from_fn(|i, j| vectors[(row, 3 * i + j)]);
    Some([0, 1, 2, 3].map(|k| matrix(order[k])))
}

fn quadric(a: &Linear, b: &Linear) -> Quadric {
    let mut product = [0.0; 10];
    for i in 0..4 {
        for j in 0..4 {
            product[QUAD_OF[i][j]] += a[i] * b[j];
        }
    }
    product
}

fn add_cubic(sum: &mut Cubic, a: &Quadric, b: &Linear, factor: f64) {
    for q in 0..10 {
        for k in 0..4 {
            sum[CUBE_OF[q][k]] += factor * a[q] * b[k];
        }
    }
}

/// The nine cubics of eq. (5) and the one of eq. (6).
fn cubics(basis: &[Matrix3<f64>; 4]) -> [Cubic; 10] {
    let entry = |i: usize, j: usize| -> Linear { core::array::from_fn(|k| basis[k][(i, j)]) };
    let mut square = [[[0.0; 10]; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                let term = quadric(&entry(i, k), &entry(j, k));
                square[i][j].iter_mut().zip(term).for_each(|(sum, x)| *sum += x);
            }
        }
    }
    let half_trace: Quadric =
        core::array::from_fn(|q| 0.5 * (square[0][0][q] + square[1][1][q] + square[2][2][q]));
    for (i, row) in square.iter_mut().enumerate() {
        row[i].iter_mut().zip(half_trace).for_each(|(sum, x)| *sum -= x);
    }
    let mut rows = [[0.0; 20]; 10];
    for i in 0..3 {
        for j in 0..3 {
            (0..3).for_each(|k| add_cubic(&mut rows[3 * i + j], &square[i][k], &entry(k, j), 1.0));
        }
    }
    for (a, b, c) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let (minor, other) = (quadric(&entry(1, b), &entry(2, c)), quadric(&entry(1, c), &entry(2, b)));
        let minor: Quadric = core::array::from_fn(|q| minor[q] - other[q]);
        add_cubic(&mut rows[9], &minor, &entry(0, a), 1.0);
    }
    rows
}

/// Gauss–Jordan: each row gives one monomial without w by the ten others; `None` where the cubics depend on each other.
fn solved(mut rows: [Cubic; 10]) -> Option<[Cubic; 10]> {
    for row in &mut rows {
        let norm = row.iter().map(|x| x * x).sum::<f64>().sqrt();
        row.iter_mut().for_each(|x| *x /= norm.max(f64::MIN_POSITIVE));
    }
    for step in 0..PURE {
        let best = (step..PURE).max_by(|i, j| rows[*i][step].abs().total_cmp(&rows[*j][step].abs()))?;
        rows.swap(step, best);
        let pivot = rows[step];
        if !(MIN_PIVOT < pivot[step].abs()) {
            return None;
        }
        let pivot = pivot.map(|x| x / pivot[step]);
        for (i, row) in rows.iter_mut().enumerate() {
            let part = if i == step { 0.0 } else { row[step] };
            row.iter_mut().zip(pivot).for_each(|(x, p)| *x -= part * p);
        }
        rows[step] = pivot;
    }
    Some(rows)
}

/// M of eq. (7).
fn multiplication_by_x(rows: &[Cubic; 10]) -> [[f64; 10]; 10] {
    core::array::from_fn(|b| {
        let [i, j, _] = CUBES[PURE + b];
        let product = place([i, j], 0);
        match product < PURE {
            true => core::array::from_fn(|c| -rows[product][PURE + c]),
            false => core::array::from_fn(|c| f64::from(u8::from(PURE + c == product))),
        }
    })
}
