//! Eigenvalues of a small real matrix, and the vectors of the real ones: Hessenberg form, then the double-shifted QR steps of
//! Francis (The Computer Journal 4, 1961); vectors by inverse iteration. For systems of polynomials solved by an action matrix.
//!
//!   A = Q H Qᵀ, H zero below the subdiagonal   ·   K  first components of a vector that are wanted, so rows of Q that are kept

use arrayvec::ArrayVec;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A matrix in Hessenberg form, with the first K rows of the rotation that brought it there.
#[derive(Debug, Clone)]
pub struct Hessenberg<const N: usize, const K: usize> {
    h: [[f64; N]; N],
    q: [[f64; N]; K],
}

/// Steps for one eigenvalue at most; every tenth shifts elsewhere, which breaks the rare cycle.
const MAX_STEPS: usize = 40;
/// Such a step's shifts, in parts of the last subdiagonal: any numbers would do.
const ELSEWHERE: [f64; 2] = [1.5, 1.0];

impl<const N: usize, const K: usize> Hessenberg<N, K> {
    /// By Householder's reflections. The matrix must be finite.
    pub fn new(a: &[[f64; N]; N]) -> Self {
        let mut q = [[0.0; N]; K];
        (0..K).for_each(|i| q[i][i] = 1.0);
        let mut this = Hessenberg { h: *a, q };
        for column in 0..N.saturating_sub(2) {
            this.reflect(column);
        }
        this
    }

    /// Clears what is below the subdiagonal in one column.
    fn reflect(&mut self, column: usize) {
        let h = &mut self.h;
        let mut v = [0.0; N];
        (column + 1..N).for_each(|i| v[i] = h[i][column]);
        let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        v[column + 1] += norm.copysign(v[column + 1]);
        let square: f64 = v.iter().map(|x| x * x).sum();
        if !(0.0 < square) {
            return;
        }
        let scale = 2.0 / square;
        let mut across = [0.0; N];
        for i in column + 1..N {
            (0..N).for_each(|j| across[j] += v[i] * h[i][j]);
        }
        for i in column + 1..N {
            let part = scale * v[i];
            (0..N).for_each(|j| h[i][j] -= part * across[j]);
        }
        for row in h.iter_mut().chain(&mut self.q) {
            let part = scale * (0..N).map(|j| row[j] * v[j]).sum::<f64>();
            (0..N).for_each(|j| row[j] -= part * v[j]);
        }
    }

    /// Real and imaginary parts; fewer than N only where the steps do not converge. Of a complex pair one is given, with the
    /// imaginary part positive.
    pub fn eigenvalues(&self) -> ArrayVec<[f64; 2], N> {
        let (mut h, mut found, mut high, mut steps) = (self.h, ArrayVec::new(), N, 0);
        while 0 < high && steps < MAX_STEPS {
            let low = (1..high).rev().find(|i| is_split(&h, *i)).unwrap_or(0);
            match high - low {
                1 => found.push([h[low][low], 0.0]),
                2 => found.extend(pair(&h, low)),
                _ => {
                    steps += 1;
                    double_step(&mut h, low, high, steps % 10 == 0);
                    continue;
                }
            }
            (high, steps) = (low, 0);
        }
        found
    }

    /// First K components of the vector of a real eigenvalue, unit length as a whole, by inverse iteration from the vector of ones.
    pub fn vector(&self, eigenvalue: f64) -> [f64; K] {
        let (mut u, mut x) = (self.h, [1.0; N]);
        (0..N).for_each(|i| u[i][i] -= eigenvalue);
        let least =
            f64::EPSILON * self.h.iter().flatten().fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()));
        for i in 0..N - 1 {
            if u[i][i].abs() < u[i + 1][i].abs() {
                u.swap(i, i + 1);
            }
            let part = u[i + 1][i] / nonzero(u[i][i], least);
            (i..N).for_each(|j| u[i + 1][j] -= part * u[i][j]);
        }
        // Ones stand for L⁻¹ of a start that favours no eigenvector.
        for i in (0..N).rev() {
            let known: f64 = (i + 1..N).map(|j| u[i][j] * x[j]).sum();
            x[i] = (x[i] - known) / nonzero(u[i][i], least);
        }
        let largest = x.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        x.iter_mut().for_each(|x| *x /= largest);
        let norm = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        self.q.map(|row| (0..N).map(|j| row[j] * x[j]).sum::<f64>() / norm)
    }
}

/// A pivot is never smaller than rounding.
fn nonzero(x: f64, least: f64) -> f64 {
    if x.abs() < least { least.copysign(x) } else { x }
}

/// Whether the subdiagonal entry before row i is rounding.
fn is_split<const N: usize>(h: &[[f64; N]; N], i: usize) -> bool {
    h[i][i - 1].abs() <= f64::EPSILON * (h[i - 1][i - 1].abs() + h[i][i].abs()).max(f64::MIN_POSITIVE)
}

/// Eigenvalues of the block of two at `low`.
fn pair<const N: usize>(h: &[[f64; N]; N], low: usize) -> ArrayVec<[f64; 2], 2> {
    let (a, b, c, d) = (h[low][low], h[low][low + 1], h[low + 1][low], h[low + 1][low + 1]);
    let half = 0.5 * (a - d);
    let square = half * half + b * c;
    let mut pair = ArrayVec::new();
    if square < 0.0 {
        pair.push([0.5 * (a + d), (-square).sqrt()]);
    } else {
        // The one farther from d without cancellation, the other by the product of their distances.
        let far = half + square.sqrt().copysign(half);
        pair.push([d + far, 0.0]);
        pair.push([if far == 0.0 { d } else { d - b * c / far }, 0.0]);
    }
    pair
}

/// One step on rows and columns low..high: both eigenvalues of the last block of two are the shifts.
fn double_step<const N: usize>(h: &mut [[f64; N]; N], low: usize, high: usize, elsewhere: bool) {
    let (m, n) = (high - 2, high - 1);
    let mut sum = h[m][m] + h[n][n];
    let mut product = h[m][m] * h[n][n] - h[m][n] * h[n][m];
    if elsewhere {
        let size = h[n][m].abs() + h[m][m - 1].abs();
        (sum, product) = (ELSEWHERE[0] * size, ELSEWHERE[1] * size * size);
    }
    let (a, b) = (h[low][low], h[low + 1][low]);
    let mut v = [
        a * (a - sum) + product + h[low][low + 1] * b,
        b * (a + h[low + 1][low + 1] - sum),
        b * h[low + 2][low + 1],
    ];
    for k in low..high - 1 {
        let length = (high - k).min(3);
        if low < k {
            v = [h[k][k - 1], h[k + 1][k - 1], if length == 3 { h[k + 2][k - 1] } else { 0.0 }];
        }
        let norm = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        if norm == 0.0 {
            continue;
        }
        if low < k {
            h[k][k - 1] = -norm.copysign(v[0]);
            (k + 1..k + length).for_each(|i| h[i][k - 1] = 0.0);
        }
        v[0] += norm.copysign(v[0]);
        chase(h, k, length, &v, low, high);
    }
}

/// The reflection I − 2vvᵀ/|v|² of rows and columns k.. from both sides.
fn chase<const N: usize>(
    h: &mut [[f64; N]; N],
    k: usize,
    length: usize,
    v: &[f64; 3],
    low: usize,
    high: usize,
) {
    let scale = 2.0 / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if length == 3 {
        for j in k..high {
            let part = scale * (v[0] * h[k][j] + v[1] * h[k + 1][j] + v[2] * h[k + 2][j]);
            h[k][j] -= part * v[0];
            h[k + 1][j] -= part * v[1];
            h[k + 2][j] -= part * v[2];
        }
        for row in &mut h[low..high.min(k + 4)] {
            let part = scale * (v[0] * row[k] + v[1] * row[k + 1] + v[2] * row[k + 2]);
            row[k] -= part * v[0];
            row[k + 1] -= part * v[1];
            row[k + 2] -= part * v[2];
        }
    } else {
        for j in k..high {
            let part = scale * (v[0] * h[k][j] + v[1] * h[k + 1][j]);
            h[k][j] -= part * v[0];
            h[k + 1][j] -= part * v[1];
        }
        for row in &mut h[low..high] {
            let part = scale * (v[0] * row[k] + v[1] * row[k + 1]);
            row[k] -= part * v[0];
            row[k + 1] -= part * v[1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// P D P⁻¹ with P a product of shears by known numbers, D real numbers and one complex pair.
    fn matrix(real: [f64; 4], [re, im]: [f64; 2]) -> [[f64; 6]; 6] {
        let mut a = [[0.0; 6]; 6];
        (0..4).for_each(|i| a[i][i] = real[i]);
        (a[4][4], a[4][5], a[5][4], a[5][5]) = (re, im, -im, re);
        for step in 0..12 {
            let (i, j, x) = (step % 6, (step * 5 + 1) % 6, 0.3 + 0.1 * step as f64);
            if i != j {
                (0..6).for_each(|k| a[i][k] += x * a[j][k]);
                a.iter_mut().for_each(|row| row[j] -= x * row[i]);
            }
        }
        a
    }

    #[test]
    fn eigenvalues_of_a_known_matrix_are_found() {
        for real in [[-3.0, -1.0, 0.5, 2.0], [1e-3, 1.0, 1e3, 1e4], [0.0, 1.0, 2.0, 2.001]] {
            let a = matrix(real, [0.25, 1.5]);
            let hessenberg = Hessenberg::<6, 6>::new(&a);
            let found = hessenberg.eigenvalues();
            let size = a.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
            assert_eq!(found.len(), 5, "{found:?}");
            assert_eq!(found.iter().filter(|x| x[1] == 0.0).count(), 4);
            for x in real {
                let near = found.iter().find(|y| (y[0] - x).hypot(y[1]) < 1e-11 * size);
                let v = hessenberg.vector(near.expect("an eigenvalue")[0]);
                let miss = |i: usize| (0..6).map(|j| a[i][j] * v[j]).sum::<f64>() - x * v[i];
                assert!((0..6).all(|i| miss(i).abs() < 1e-10 * size), "{x}: {v:?}");
            }
            assert!(found.iter().any(|y| (y[0] - 0.25).hypot(y[1] - 1.5) < 1e-11 * size), "{found:?}");
        }
    }

    /// A cyclic permutation, on which unshifted steps stand still: the roots of unity.
    #[test]
    fn a_permutation_has_the_roots_of_unity() {
        let mut a = [[0.0; 5]; 5];
        (0..5).for_each(|i| a[i][(i + 1) % 5] = 1.0);
        let found = Hessenberg::<5, 5>::new(&a).eigenvalues();
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(found.iter().all(|x| (x[0].hypot(x[1]) - 1.0).abs() < 1e-12), "{found:?}");
    }
}
