//! The elimination behind `p35pf`: own, docs/math/focal.md section 4; equation numbers refer to it.
//!
//! Four quadrics and five cubics in five homogeneous unknowns have ten common points. Twenty-five cubics (the quadrics times each unknown,
//! and the five) hold all that vanishes on them in degree 3; solved for twenty-five of the thirty-five monomials they leave a basis of
//! ten, in which multiplication by the last unknown is a 10×10 matrix.
//!
//!   v₀ … v₄  unknowns; v₀ = 1 where a matrix is meant   ·   p₁, p₂, p₃  rows of the scaled rotation, linear in v

use nalgebra::{Matrix3x5, Matrix5};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Coefficients of vᵢvⱼ, i ≤ j, as `PAIRS` lists them.
pub(super) type Quadric = [f64; 15];
/// Multiplication by v₄ in the basis (v₀, v₁, v₂, v₃, v₄) v₀ and five more products of two.
pub(super) type Action = [[f64; 10]; 10];

type Rows = [[f64; COLUMNS]; ROWS];
const ROWS: usize = 25;
const COLUMNS: usize = 35;
/// A pivot below this (rows of unit size) is rounding: the equations depend on each other.
const MIN_PIVOT: f64 = 1e-14;

const PAIRS: [(usize, usize); 15] = pairs();
/// Where vᵢvⱼ stands in a quadric.
const PLACE: [[usize; 5]; 5] = places();
/// Column of (vᵢvⱼ) vₖ.
const COLUMN: [[usize; 5]; 15] = columns();

const fn pairs() -> [(usize, usize); 15] {
    let (mut pairs, mut at, mut i) = ([(0, 0); 15], 0, 0);
    while i < 5 {
        let mut j = i;
        while j < 5 {
            pairs[at] = (i, j);
            (at, j) = (at + 1, j + 1);
        }
        i += 1;
    }
    pairs
}

const fn places() -> [[usize; 5]; 5] {
    let (mut places, mut at) = ([[0; 5]; 5], 0);
    while at < 15 {
        let (i, j) = PAIRS[at];
        (places[i][j], places[j][i]) = (at, at);
        at += 1;
    }
    places
}

/// Products of three of v₁, v₂, v₃ first; then v₄ times the ten products of two of v₁ … v₄; v₀ times these ten; v₀² times v₁ … v₄; v₀³.
const fn columns() -> [[usize; 5]; 15] {
    let (mut columns, mut at) = ([[0; 5]; 15], 0);
    while at < 15 {
        let (i, j) = PAIRS[at];
        let mut k = 0;
        while k < 5 {
            let (low, middle, high) = sorted(i, j, k);
            columns[at][k] = if 0 < low && high == 4 {
                10 + PLACE[low][middle] - 5
            } else if 0 < low {
                plain_cubic(low, middle, high)
            } else if 0 < middle {
                20 + PLACE[middle][high] - 5
            } else if 0 < high {
                29 + high
            } else {
                34
            };
            k += 1;
        }
        at += 1;
    }
    columns
}

const fn sorted(i: usize, j: usize, k: usize) -> (usize, usize, usize) {
    // i ≤ j already.
    if k < i {
        (k, i, j)
    } else if k < j {
        (i, k, j)
    } else {
        (i, j, k)
    }
}

/// 0 … 9 for 1 ≤ i ≤ j ≤ k ≤ 3.
const fn plain_cubic(i: usize, j: usize, k: usize) -> usize {
    match (i, j) {
        (1, 1) => k - 1,
        (1, 2) => k + 1,
        (1, _) => 5,
        (2, 2) => k + 4,
        (2, _) => 8,
        _ => 9,
    }
}

/// The quadric of a symmetric matrix.
pub(super) fn quadric(s: &Matrix5<f64>) -> Quadric {
    PAIRS.map(|(i, j)| if i == j { s[(i, i)] } else { 2.0 * s[(i, j)] })
}

/// The product of two linear forms.
fn product(a: &[f64; 5], b: &[f64; 5]) -> Quadric {
    PAIRS.map(|(i, j)| if i == j { a[i] * b[i] } else { a[i] * b[j] + a[j] * b[i] })
}

/// Multiplication by v₄ modulo the quadrics and what eq. (17) adds; none where they depend on each other.
pub(super) fn action(quadrics: &[Quadric; 4], rows_of_rotation: &[Matrix3x5<f64>; 3]) -> Option<Action> {
    let mut rows = equations(quadrics, rows_of_rotation);
    let order = eliminate(&mut rows)?;
    // Columns of the basis: v₀³, v₀²vᵢ, the products left.
    let columns = [34, 30, 31, 32, 33, 25, 26, 27, 28, 29];
    let solved = |row: usize| columns.map(|c| -rows[row][c]);
    let unit = |at: usize| core::array::from_fn(|b| f64::from(u8::from(b == at)));
    let mut action = [unit(4); 10];
    for i in 1..5 {
        let at = order.iter().position(|pair| *pair == PLACE[i][4] - 5)?;
        action[i] = if at < 5 { solved(20 + at) } else { unit(at) };
    }
    (5..10).for_each(|i| action[i] = solved(10 + order[i]));
    action.iter().flatten().all(|x| x.is_finite()).then_some(action)
}

/// The twenty-five cubics, rows of unit size.
fn equations(quadrics: &[Quadric; 4], p: &[Matrix3x5<f64>; 3]) -> Rows {
    let mut rows = [[0.0; COLUMNS]; ROWS];
    for (q, quadric) in quadrics.iter().enumerate() {
        for k in 0..5 {
            (0..15).for_each(|at| rows[5 * q + k][COLUMN[at][k]] = quadric[at]);
        }
    }
    let p = p.map(|p| [0, 1, 2].map(|i| [0, 1, 2, 3, 4].map(|k| p[(i, k)])));
    let s = |i: usize, j: usize| -> Quadric {
        let (first, second) = (product(&p[0][i], &p[0][j]), product(&p[1][i], &p[1][j]));
        core::array::from_fn(|at| first[at] + second[at])
    };
    let difference = |a: &Quadric, b: &Quadric| -> Quadric { core::array::from_fn(|at| a[at] - b[at]) };
    let (s00, s11, s22, s01, s02, s12) = (s(0, 0), s(1, 1), s(2, 2), s(0, 1), s(0, 2), s(1, 2));
    let [x, y, z] = p[2];
    // Eq. (17), entries 00, 11, 01, 02, 12 of the symmetric and traceless matrix.
    let mut add = |row: usize, linear: &[f64; 5], quadric: &Quadric, sign: f64| {
        for k in 0..5 {
            (0..15).for_each(|at| rows[row][COLUMN[at][k]] += sign * linear[k] * quadric[at]);
        }
    };
    add(20, &y, &s02, 2.0);
    add(20, &z, &s01, -2.0);
    add(21, &z, &s01, 2.0);
    add(21, &x, &s12, -2.0);
    add(22, &z, &difference(&s00, &s11), 1.0);
    add(22, &y, &s12, 1.0);
    add(22, &x, &s02, -1.0);
    add(23, &y, &difference(&s22, &s00), 1.0);
    add(23, &x, &s01, 1.0);
    add(23, &z, &s12, -1.0);
    add(24, &x, &difference(&s11, &s22), 1.0);
    add(24, &z, &s02, 1.0);
    add(24, &y, &s01, -1.0);
    for row in &mut rows {
        let inverse = 1.0 / row.iter().map(|x| x * x).sum::<f64>().sqrt();
        row.iter_mut().for_each(|x| *x *= inverse);
    }
    rows
}

/// Gauss's elimination: the twenty products without v₀ in their order, then five of the ten with one v₀, the largest pivots first.
/// Rows 10 … 24 end solved. Gives the ten products in the order of their columns then.
fn eliminate(rows: &mut Rows) -> Option<[usize; 10]> {
    let mut order = core::array::from_fn(|i| i);
    for step in 0..ROWS {
        let last = if step < 20 { step + 1 } else { 30 };
        let (mut best, mut at) = (MIN_PIVOT, None);
        for i in step..ROWS {
            for j in step..last {
                if best < rows[i][j].abs() {
                    (best, at) = (rows[i][j].abs(), Some((i, j)));
                }
            }
        }
        let (row, column) = at?;
        rows.swap(step, row);
        if column != step {
            rows.iter_mut().for_each(|row| row.swap(step, column));
            order.swap(step - 20, column - 20);
        }
        let (done, rest) = rows.split_at_mut(step + 1);
        let pivot = &done[step];
        let inverse = 1.0 / pivot[step];
        for row in rest {
            let part = row[step] * inverse;
            row[step..].iter_mut().zip(&pivot[step..]).for_each(|(x, p)| *x -= part * p);
        }
    }
    for step in (10..ROWS).rev() {
        let (above, below) = rows.split_at_mut(step);
        let solved = &mut below[0];
        let inverse = 1.0 / solved[step];
        solved[ROWS..].iter_mut().for_each(|x| *x *= inverse);
        for row in &mut above[10..] {
            let part = row[step];
            row[ROWS..].iter_mut().zip(&solved[ROWS..]).for_each(|(x, s)| *x -= part * s);
        }
    }
    Some(order)
}
