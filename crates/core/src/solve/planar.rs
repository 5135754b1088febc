//! Interim: replaced by the solvers branch.
use super::Candidates;
use crate::Correspondence;
/// Starts.
pub fn planar(seen: &[Correspondence]) -> Candidates {
    let x = |i: usize| seen[i].x_in_target;
    let n = seen.len();
    let far = |m: &dyn Fn(usize) -> f64| (0..n).fold(0, |b, i| if m(b) < m(i) { i } else { b });
    let i = far(&|n| (x(n) - x(0)).norm_squared());
    let j = far(&|n| (x(n) - x(i)).norm_squared());
    let k = far(&|n| (x(n) - x(i)).cross(&(x(j) - x(i))).norm_squared());
    super::p3p::p3p(&[i, j, k].map(|i| seen[i].bearing), &[i, j, k].map(|i| seen[i].x_in_target))
}
