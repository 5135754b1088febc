//! Normal equations of a chain with one shared unknown: block tridiagonal with a border, solved and inverted where needed
//! in linear time.
//!
//! ```text
//!   nodes i of 4 unknowns, one shared unknown φ ·  H = [Dᵢ on the diagonal, Uᵢ = H(i, i+1), cᵢ = H(i, φ), d = H(φ, φ)]
//! ```
//! Derivation: docs/math/whisker_sweep.md, section 5.

use nalgebra::{Matrix4, Vector4};

/// Unknowns of one node.
pub type Local = Vector4<f64>;

/// The quadratic form ½ zᵀHz + gᵀz by its blocks, and after `eliminate` the factors of its solution.
#[derive(Debug, Clone, Default)]
pub struct Chain {
    diagonal: Vec<Matrix4<f64>>,
    /// Uᵢ between i and i + 1; one fewer than nodes.
    upper: Vec<Matrix4<f64>>,
    border: Vec<Local>,
    gradient: Vec<Local>,
    corner: f64,
    corner_gradient: f64,
}

/// The solution: the step, and the required parts of H⁻¹.
#[derive(Debug, Clone, Default)]
pub struct Solution {
    /// Step of every node.
    pub steps: Vec<Local>,
    /// Step of the shared unknown.
    pub shared_step: f64,
    /// Covariance of every node.
    pub covariances: Vec<Matrix4<f64>>,
    /// Covariance between node i and i + 1.
    pub cross: Vec<Matrix4<f64>>,
    /// Covariance between every node and the shared unknown.
    pub with_shared: Vec<Local>,
    /// Variance of the shared unknown.
    pub shared_variance: f64,
}

/// Of the form, by all unknowns.
#[derive(Debug, Clone)]
pub struct Gradient {
    nodes: Vec<Local>,
    shared: f64,
}

impl Gradient {
    /// Its product with a solution's steps.
    pub fn dot(&self, solution: &Solution) -> f64 {
        let of_nodes: f64 = self.nodes.iter().zip(&solution.steps).map(|(g, step)| g.dot(step)).sum();
        of_nodes + self.shared * solution.shared_step
    }
}

impl Chain {
    /// Empties the form and gives it `nodes` nodes; keeps its memory.
    pub fn reset(&mut self, nodes: usize) {
        for blocks in [&mut self.diagonal, &mut self.upper] {
            blocks.clear();
            blocks.resize(nodes, Matrix4::zeros());
        }
        for vectors in [&mut self.border, &mut self.gradient] {
            vectors.clear();
            vectors.resize(nodes, Local::zeros());
        }
        (self.corner, self.corner_gradient) = (0.0, 0.0);
    }

    /// Adds ½ (r + aᵀzᵢ + b φ)².
    pub fn add_single(&mut self, node: usize, residual: f64, by_node: &Local, by_shared: f64) {
        self.diagonal[node] += by_node * by_node.transpose();
        self.border[node] += by_node * by_shared;
        self.gradient[node] += by_node * residual;
        self.corner += by_shared * by_shared;
        self.corner_gradient += by_shared * residual;
    }

    /// Adds ½ (r + a₁ᵀzᵢ + a₂ᵀzᵢ₊₁ + b φ)².
    pub fn add_pair(&mut self, node: usize, residual: f64, by_nodes: [&Local; 2], by_shared: f64) {
        self.add_single(node, residual, by_nodes[0], by_shared);
        self.diagonal[node + 1] += by_nodes[1] * by_nodes[1].transpose();
        self.border[node + 1] += by_nodes[1] * by_shared;
        self.gradient[node + 1] += by_nodes[1] * residual;
        self.upper[node] += by_nodes[0] * by_nodes[1].transpose();
    }

    /// Adds a whole block to a node: its Hessian, its border, its gradient.
    pub fn add_block(&mut self, node: usize, hessian: &Matrix4<f64>, border: &Local, gradient: &Local) {
        self.diagonal[node] += hessian;
        self.border[node] += border;
        self.gradient[node] += gradient;
    }

    /// The form's gradient, which solving consumes.
    pub fn gradient(&self) -> Gradient {
        Gradient { nodes: self.gradient.clone(), shared: self.corner_gradient }
    }

    /// Adds ½ h φ² + g φ.
    pub fn add_shared(&mut self, hessian: f64, gradient: f64) {
        self.corner += hessian;
        self.corner_gradient += gradient;
    }

    /// Adds `share` of the measurement's own weight (1, whitened) to every unknown: Levenberg's damping.
    pub fn damp(&mut self, share: f64) {
        for block in &mut self.diagonal {
            *block += Matrix4::identity() * share;
        }
        self.corner *= 1.0 + share;
    }

    /// Eliminates the first node, eqs. (11)–(12): what remains of it in the second's block and in the corner.
    /// Nothing happens where the node's block is singular: the weights of its own measurements exclude that.
    pub fn eliminate(&mut self, node: usize) -> Option<Eliminated> {
        let inverse = self.diagonal[node].cholesky()?.inverse();
        let (upper, border, gradient) = (self.upper[node], self.border[node], self.gradient[node]);
        let out = Eliminated {
            inverse,
            by_next: -inverse * upper,
            by_shared: -inverse * border,
            own: -inverse * gradient,
        };
        if node + 1 < self.diagonal.len() {
            self.diagonal[node + 1] += upper.transpose() * out.by_next;
            self.border[node + 1] += upper.transpose() * out.by_shared;
            self.gradient[node + 1] += upper.transpose() * out.own;
        }
        self.corner += border.dot(&out.by_shared);
        self.corner_gradient += border.dot(&out.own);
        Some(out)
    }

    /// The blocks of one node, as they stand: Hessian, border, gradient.
    pub fn block(&self, node: usize) -> (Matrix4<f64>, Local, Local) {
        (self.diagonal[node], self.border[node], self.gradient[node])
    }

    /// Hessian and gradient of the shared unknown, as they stand.
    pub fn shared(&self) -> (f64, f64) {
        (self.corner, self.corner_gradient)
    }

    /// The minimum of the form with the covariances of section 5; consumes the form's content.
    /// None where a block is not positive definite.
    pub fn solve(&mut self, factors: &mut Vec<Eliminated>, out: &mut Solution) -> Option<()> {
        let nodes = self.diagonal.len();
        factors.clear();
        for node in 0..nodes {
            factors.push(self.eliminate(node)?);
        }
        if !(0.0 < self.corner) {
            return None;
        }
        out.resize(nodes);
        out.shared_variance = 1.0 / self.corner;
        out.shared_step = -self.corner_gradient / self.corner;
        for node in (0..nodes).rev() {
            out.back_substitute(node, &factors[node]);
        }
        Some(())
    }
}

/// A node in terms of the next and the shared unknown: zᵢ = own + by_next zᵢ₊₁ + by_shared φ, covariance `inverse` given those.
#[derive(Debug, Clone, Copy)]
pub struct Eliminated {
    inverse: Matrix4<f64>,
    by_next: Matrix4<f64>,
    by_shared: Local,
    own: Local,
}

impl Solution {
    fn resize(&mut self, nodes: usize) {
        self.steps.resize(nodes, Local::zeros());
        self.with_shared.resize(nodes, Local::zeros());
        self.covariances.resize(nodes, Matrix4::zeros());
        self.cross.resize(nodes, Matrix4::zeros());
    }

    /// Eqs. (13)–(14): from the last node to the first.
    fn back_substitute(&mut self, node: usize, f: &Eliminated) {
        let variance = self.shared_variance;
        let (mut step, mut with_shared) = (f.own + f.by_shared * self.shared_step, f.by_shared * variance);
        let mut covariance = f.inverse + f.by_shared * f.by_shared.transpose() * variance;
        if node + 1 < self.steps.len() {
            let (next, next_shared) = (self.covariances[node + 1], self.with_shared[node + 1]);
            step += f.by_next * self.steps[node + 1];
            with_shared += f.by_next * next_shared;
            let mixed = f.by_next * next_shared * f.by_shared.transpose();
            covariance += f.by_next * next * f.by_next.transpose() + mixed + mixed.transpose();
            self.cross[node] = f.by_next * next + f.by_shared * next_shared.transpose();
        }
        self.steps[node] = step;
        self.with_shared[node] = with_shared;
        self.covariances[node] = 0.5 * (covariance + covariance.transpose());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// The same form, dense; whether its blocks are the right ones for a whisker, tests/sweep.rs says.
    #[test]
    fn solution_and_covariances_are_those_of_the_dense_inverse() {
        let nodes = 5;
        let size = 4 * nodes + 1;
        let mut chain = Chain::default();
        chain.reset(nodes);
        let (mut dense, mut gradient) = (DMatrix::<f64>::zeros(size, size), DVector::<f64>::zeros(size));
        let mut seed = 0.1_f64;
        let mut next = || {
            seed = (seed * 997.13 + 0.37).fract();
            seed - 0.5
        };
        for round in 0..60 {
            let node = round % nodes;
            let a = Local::from_fn(|_, _| next());
            let b = Local::from_fn(|_, _| next());
            let (residual, shared) = (next(), next());
            let mut row = DVector::<f64>::zeros(size);
            row.rows_mut(4 * node, 4).copy_from(&a);
            row[size - 1] = shared;
            if node + 1 < nodes && round % 2 == 0 {
                row.rows_mut(4 * node + 4, 4).copy_from(&b);
                chain.add_pair(node, residual, [&a, &b], shared);
            } else {
                chain.add_single(node, residual, &a, shared);
            }
            dense += &row * row.transpose();
            gradient += row * residual;
        }
        let inverse = dense.try_inverse().expect("positive definite");
        let step = -&inverse * gradient;
        let mut out = Solution::default();
        chain.solve(&mut Vec::new(), &mut out).expect("positive definite");
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{a} {b}");
        near(out.shared_step, step[size - 1]);
        near(out.shared_variance, inverse[(size - 1, size - 1)]);
        for node in 0..nodes {
            for i in 0..4 {
                near(out.steps[node][i], step[4 * node + i]);
                near(out.with_shared[node][i], inverse[(4 * node + i, size - 1)]);
                for j in 0..4 {
                    near(out.covariances[node][(i, j)], inverse[(4 * node + i, 4 * node + j)]);
                    if node + 1 < nodes {
                        near(out.cross[node][(i, j)], inverse[(4 * node + i, 4 * node + 4 + j)]);
                    }
                }
            }
        }
    }
}
