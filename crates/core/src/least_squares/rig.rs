//! The loop for the poses of cameras, of targets on their bodies, and of every body in every view.
//!
//! An observation depends on all three through one pose, cam_from_target, so that its points are summed once, as for a single camera, and the
//! 6×6
//! sum is transformed to each of the three by a motion matrix. A body's pose in a view affects the observations of that view only: its block
//! is eliminated (Schur complement); the remaining system has the size of cameras and targets. Derivation: docs/math/rig.md eqs. (2)–(8).
//!
//!   A  information about one body's pose, 6×6   ·   C  shared block × body's pose, 6×6   ·   a  gradient of a body's pose

mod places;
mod views;

use super::{LeastSquares, Minimum, NormalEquations, PivotedPose, Tolerance, minimize};
use crate::{Matrix6, Vector6};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, SMatrix};
use places::Chain;
pub use places::{RigGraph, RigLink, RigPoses};

/// The Gauss–Newton approximation of the whole cost.
#[derive(Debug, Clone)]
pub struct RigEquations {
    /// Sum of the costs of all residuals.
    pub chi2: f64,
    bodies: Vec<BodyBlock>,
    couplings: Vec<Coupling>,
    /// Information and gradient of each observation's own pose; zero where it takes no part.
    observations: Vec<(Matrix6, Vector6)>,
    /// Lower triangle.
    information: DMatrix<f64>,
    gradient: DVector<f64>,
}

/// A body's pose in one view.
#[derive(Debug, Clone)]
struct BodyBlock {
    information: Matrix6,
    gradient: Vector6,
    /// End of its couplings, which begin where those of the previous body end.
    end: usize,
}

/// The cross term of a shared block and a body's pose.
#[derive(Debug, Clone)]
struct Coupling {
    block: usize,
    shared_body: Matrix6,
}

/// A minimum over all poses.
pub type RigMinimum = Minimum<RigPoses, RigEquations>;

/// A motion of each body in a view, and a change of all shared blocks.
#[derive(Debug)]
pub struct RigStep {
    motions: Vec<Vector6>,
    change: DVector<f64>,
}

/// Fewer targets than this make no chain.
const MANY_TARGETS: usize = 4;

struct RigCost<'a, F> {
    graph: &'a RigGraph,
    evaluate: F,
}

impl<F: Fn(&RigPoses) -> Option<RigEquations>> LeastSquares for RigCost<'_, F> {
    type State = RigPoses;
    type Equations = RigEquations;
    type Step = RigStep;

    fn max_steps(&self) -> usize {
        if self.has_flat_valleys() { 2 * Self::MAX_STEPS } else { Self::MAX_STEPS }
    }

    /// Targets of one body are joined in chains by the views that show several: a chain of forty bends a thousand times more easily than two
    /// neighbours move apart, and its end moves on a circle.
    fn has_flat_valleys(&self) -> bool {
        MANY_TARGETS < self.graph.block_of_target.iter().flatten().count()
    }

    fn evaluate(&self, places: &RigPoses) -> Option<RigEquations> {
        (self.evaluate)(places)
    }

    fn chi2(equations: &RigEquations) -> f64 {
        equations.chi2
    }

    fn step(&self, equations: &RigEquations, damping: f64) -> Option<(RigStep, f64)> {
        equations.step(damping)
    }

    fn apply(&self, places: &RigPoses, step: &RigStep) -> Option<RigPoses> {
        Some(places.moved(&step.motions, &step.change, self.graph))
    }
}

/// Minimises a cost over all poses. `evaluate` returns `None` where a point leaves its camera's field. The loop also ends where a step promises
/// less than `tolerance_relative` of the cost.
pub fn minimize_rig(
    start: RigPoses,
    graph: &RigGraph,
    tolerance_relative: f64,
    evaluate: impl Fn(&RigPoses) -> Option<RigEquations>,
) -> Option<RigMinimum> {
    let tolerance = Tolerance { relative: tolerance_relative, alternative_chi2: None };
    minimize(&RigCost { graph, evaluate }, start, &tolerance)
}

impl RigEquations {
    /// Sums all observations at `places`; `normal` returns the sums of one observation about its target's pivot.
    pub fn new(
        places: &RigPoses,
        graph: &RigGraph,
        normal: impl Fn(usize, &PivotedPose) -> Option<NormalEquations>,
    ) -> Option<Self> {
        let n = 6 * graph.n_blocks;
        let mut sums = RigEquations {
            chi2: 0.0,
            bodies: Vec::with_capacity(places.rig_from_body.len()),
            couplings: Vec::with_capacity(graph.links.len()),
            observations: vec![(Matrix6::zeros(), Vector6::zeros()); graph.links.len()],
            information: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
        };
        for (i, link) in graph.links.iter().enumerate() {
            sums.open_bodies_to(link.body);
            if graph.is_active[link.body] {
                let chain = places.chain(link, graph);
                let normal = normal(i, &chain.place)?;
                sums.observations[i] = (normal.information(), normal.gradient());
                sums.add(link, graph, &chain, &places.cam_from_rig[link.camera].rotation, &normal);
            }
        }
        sums.open_bodies_to(places.rig_from_body.len().saturating_sub(1));
        sums.chi2.is_finite().then_some(sums)
    }

    fn open_bodies_to(&mut self, last: usize) {
        while self.bodies.len() <= last {
            let (information, gradient) = (Matrix6::zeros(), Vector6::zeros());
            self.bodies.push(BodyBlock { information, gradient, end: self.couplings.len() });
        }
    }

    fn add(
        &mut self,
        link: &RigLink,
        graph: &RigGraph,
        chain: &Chain,
        cam_rotation: &Matrix3<f64>,
        normal: &NormalEquations,
    ) {
        self.chi2 += normal.chi2;
        let (information, gradient) = (normal.information(), normal.gradient());
        let by_body = chain.by_body(cam_rotation);
        let on_body = information * by_body;
        let camera = graph.block_of_camera[link.camera].map(|block| (block, chain.by_camera()));
        let target = graph.block_of_target[link.target].map(|block| (block, chain.by_target()));
        for (block, by) in camera.iter().chain(&target) {
            self.couplings.push(Coupling { block: *block, shared_body: by.tr_mul(&on_body) });
            self.add_gradient(*block, &by.tr_mul(&gradient));
            self.add_block(*block, *block, &by.tr_mul(&(information * by)));
        }
        if let (Some((row, by_row)), Some((column, by_column))) = (&target, &camera) {
            self.add_block(*row, *column, &by_row.tr_mul(&(information * by_column)));
        }
        let end = self.couplings.len();
        if let Some(body) = self.bodies.last_mut() {
            body.information += by_body.tr_mul(&on_body);
            body.gradient += by_body.tr_mul(&gradient);
            body.end = end;
        }
    }

    fn add_gradient(&mut self, block: usize, by: &Vector6) {
        let mut rows = self.gradient.fixed_rows_mut::<6>(6 * block);
        rows += by;
    }

    fn add_block(&mut self, row: usize, column: usize, by: &Matrix6) {
        add_block(&mut self.information, row, column, by);
    }

    /// Adds one whitened residual that only shared blocks move, with its derivative by each.
    pub fn add_shared(&mut self, residual: f64, by: &[(usize, Vector6)]) {
        self.chi2 += residual * residual;
        for (i, (block, derivative)) in by.iter().enumerate() {
            self.add_gradient(*block, &(derivative * residual));
            self.add_block(*block, *block, &(derivative * derivative.transpose()));
            for (other, before) in &by[..i] {
                self.add_block(*block, *other, &(derivative * before.transpose()));
            }
        }
    }

    fn couplings_of(&self, body: usize) -> &[Coupling] {
        let begin = if body == 0 { 0 } else { self.bodies[body - 1].end };
        &self.couplings[begin..self.bodies[body].end]
    }

    /// Returns whether the observations of a body in a view determine its pose, with cameras and targets fixed: no motion's information
    /// vanishes, except for rounding, once the motions before it are free.
    pub fn determines(&self, body: usize) -> bool {
        const ROUNDING: f64 = 1e-10;
        let information = &self.bodies[body].information;
        let is_left =
            |factor: &Matrix6, i: usize| ROUNDING * information[(i, i)] < factor[(i, i)] * factor[(i, i)];
        information.cholesky().is_some_and(|c| (0..6).all(|i| is_left(c.l_dirty(), i)))
    }

    /// Returns the step and its promise; `None` where the damped equations are not positive.
    fn step(&self, damping: f64) -> Option<(RigStep, f64)> {
        let eliminated = self.eliminated(damping)?;
        let change = eliminated.reduced.solve(&eliminated.gradient);
        let motion = |(body, inverse): (usize, &Matrix6)| {
            let pull = self.couplings_of(body).iter().fold(self.bodies[body].gradient, |pull, c| {
                pull - c.shared_body.tr_mul(&change.fixed_rows::<6>(6 * c.block))
            });
            inverse * pull
        };
        let motions: Vec<Vector6> = eliminated.inverses.iter().enumerate().map(motion).collect();
        let of_bodies: f64 = self.bodies.iter().zip(&motions).map(|(body, m)| body.gradient.dot(m)).sum();
        let promised = of_bodies + self.gradient.dot(&change);
        promised.is_finite().then_some((RigStep { motions, change }, promised))
    }

    /// Returns the equations of the shared blocks alone; `None` where they, or a body that takes part, are undetermined.
    pub fn eliminated(&self, damping: f64) -> Option<Eliminated> {
        let (mut information, mut gradient) = (self.information.clone(), self.gradient.clone());
        for i in 0..gradient.len() {
            information[(i, i)] *= 1.0 + damping;
        }
        let mut inverses = Vec::with_capacity(self.bodies.len());
        for (index, body) in self.bodies.iter().enumerate() {
            let couplings = self.couplings_of(index);
            let unused = body.information == Matrix6::zeros();
            let inverse = if unused { Matrix6::zeros() } else { inverse_of(&body.information, damping)? };
            for (i, c) in couplings.iter().enumerate() {
                let solved = c.shared_body * inverse;
                let mut rows = gradient.fixed_rows_mut::<6>(6 * c.block);
                rows -= solved * body.gradient;
                for (j, other) in couplings[..=i].iter().enumerate() {
                    let by = -solved * other.shared_body.transpose();
                    add_block(&mut information, c.block, other.block, &by);
                    if i != j && c.block == other.block {
                        add_block(&mut information, c.block, other.block, &by.transpose());
                    }
                }
            }
            inverses.push(inverse);
        }
        Some(Eliminated { reduced: information.cholesky()?, gradient, inverses })
    }

    /// Returns the covariance that errors give to the shared blocks, where `pull` holds the covariance of their pull on all poses in place of the
    /// information, over the same graph; `inverse` is the inverse of the reduced matrix. docs/math/budget.md eq. (8).
    pub(crate) fn scatter(
        &self,
        eliminated: &Eliminated,
        inverse: &DMatrix<f64>,
        pull: &RigEquations,
    ) -> DMatrix<f64> {
        let mut middle = pull.information.clone();
        middle.fill_upper_triangle_with_lower_triangle();
        for (body, solved) in eliminated.inverses.iter().enumerate() {
            let of_pull = &pull.bodies[body].information;
            let each = || self.couplings_of(body).iter().zip(pull.couplings_of(body));
            for (row, pull_row) in each() {
                let by_row = row.shared_body * solved;
                for (column, pull_column) in each() {
                    let by_column = (column.shared_body * solved).transpose();
                    let by = by_row * of_pull * by_column
                        - by_row * pull_column.shared_body.transpose()
                        - pull_row.shared_body * by_column;
                    let mut view = middle.fixed_view_mut::<6, 6>(6 * row.block, 6 * column.block);
                    view += by;
                }
            }
        }
        inverse * middle * inverse
    }

    /// Returns the covariance of the motion of each body about its pivot, given the `covariance` of the shared blocks; zero where it takes no
    /// part.
    pub fn body_covariances(&self, eliminated: &Eliminated, covariance: &DMatrix<f64>) -> Vec<Matrix6> {
        let of_body = |(body, inverse): (usize, &Matrix6)| {
            let couplings = self.couplings_of(body);
            let solved: Vec<Matrix6> = couplings.iter().map(|c| c.shared_body * inverse).collect();
            let mut total = *inverse;
            for (left, solved_left) in couplings.iter().zip(&solved) {
                for (right, solved_right) in couplings.iter().zip(&solved) {
                    let shared = covariance.fixed_view::<6, 6>(6 * left.block, 6 * right.block);
                    total += solved_left.tr_mul(&(shared * solved_right));
                }
            }
            total
        };
        eliminated.inverses.iter().enumerate().map(of_body).collect()
    }

    /// Returns hᵀH⁻¹h, where h couples one more parameter with all poses: the information that the parameter loses when these are free too.
    pub fn lost_to_poses(&self, eliminated: &Eliminated, common: &Common) -> f64 {
        common.dot(&self.following(eliminated, common, false))
    }

    /// Returns H⁻¹h, where h couples one more parameter with all poses: the negated motions of all poses that follow a change of the parameter.
    /// Unless `all_bodies` is set, of coupled bodies only: the others are many, and rarely needed.
    pub fn following(&self, eliminated: &Eliminated, common: &Common, all_bodies: bool) -> Common {
        let mut solved = self.without_bodies(eliminated, common);
        solved.shared = eliminated.reduced.solve(&solved.shared);
        for (body, (motion, inverse)) in solved.bodies.iter_mut().zip(&eliminated.inverses).enumerate() {
            let is_asked_for = all_bodies || common.bodies[body] != Vector6::zeros();
            if is_asked_for && *inverse != Matrix6::zeros() {
                let by_shared = self.couplings_of(body).iter().fold(Vector6::zeros(), |sum, c| {
                    sum + c.shared_body.tr_mul(&solved.shared.fixed_rows::<6>(6 * c.block))
                });
                *motion -= inverse * by_shared;
            }
        }
        solved
    }

    /// Returns the motions of an observation's pose with several `following` at once, about its target's pivot, and its motion with each shared
    /// block.
    pub fn moved<const N: usize>(
        &self,
        places: &RigPoses,
        graph: &RigGraph,
        link: &RigLink,
        following: &[Common; N],
    ) -> (SMatrix<f64, 6, N>, [Option<(usize, Matrix6)>; 2]) {
        let chain = places.chain(link, graph);
        let by_body = chain.by_body(&places.cam_from_rig[link.camera].rotation);
        let camera = graph.block_of_camera[link.camera].map(|block| (block, chain.by_camera()));
        let target = graph.block_of_target[link.target].map(|block| (block, chain.by_target()));
        let moved = following.each_ref().map(|f| {
            let shared = camera.iter().chain(&target);
            shared.fold(by_body * f.bodies[link.body], |sum, (block, by)| {
                sum + by * f.shared.fixed_rows::<6>(6 * block)
            })
        });
        (SMatrix::from_columns(&moved), [camera, target])
    }

    /// Returns information and gradient of an observation's own pose.
    pub fn of_observation(&self, observation: usize) -> &(Matrix6, Vector6) {
        &self.observations[observation]
    }

    /// Returns h with the bodies' poses eliminated, and A⁻¹h for each of these.
    fn without_bodies(&self, eliminated: &Eliminated, common: &Common) -> Common {
        let mut reduced = common.shared.clone();
        let mut bodies = Vec::with_capacity(common.bodies.len());
        for (body, (inverse, h)) in eliminated.inverses.iter().zip(&common.bodies).enumerate() {
            let solved = inverse * h;
            if solved != Vector6::zeros() {
                for c in self.couplings_of(body) {
                    let mut rows = reduced.fixed_rows_mut::<6>(6 * c.block);
                    rows -= c.shared_body * solved;
                }
            }
            bodies.push(solved);
        }
        Common { shared: reduced, bodies }
    }
}

/// JᵀWj of one more parameter with all poses: j is the derivative of the prediction with respect to it.
#[derive(Debug, Clone)]
pub struct Common {
    /// Six rows per shared block.
    pub shared: DVector<f64>,
    /// One entry for each body in a view.
    pub bodies: Vec<Vector6>,
}

impl Common {
    /// Returns the sum of the products of all elements.
    pub fn dot(&self, other: &Common) -> f64 {
        let of_bodies: f64 = self.bodies.iter().zip(&other.bodies).map(|(a, b)| a.dot(b)).sum();
        self.shared.dot(&other.shared) + of_bodies
    }

    /// Returns zeros.
    pub fn new(graph: &RigGraph) -> Self {
        let bodies = vec![Vector6::zeros(); graph.pivot_in_body.len()];
        Common { shared: DVector::zeros(6 * graph.n_blocks), bodies }
    }

    /// Returns the sum of several with weights.
    pub fn weighted(parts: &[Common], weights: impl Iterator<Item = f64>, graph: &RigGraph) -> Self {
        let mut sum = Common::new(graph);
        for (part, weight) in parts.iter().zip(weights).filter(|(_, weight)| *weight != 0.0) {
            sum.shared.axpy(weight, &part.shared, 1.0);
            sum.bodies.iter_mut().zip(&part.bodies).for_each(|(sum, body)| *sum += body * weight);
        }
        sum
    }

    /// Adds the contribution of one observation, `by_motion` = JᵀWj by the small motion of its cam_from_target about the target's pivot.
    pub fn add(&mut self, places: &RigPoses, graph: &RigGraph, link: &RigLink, by_motion: &Vector6) {
        let chain = places.chain(link, graph);
        self.bodies[link.body] += chain.by_body(&places.cam_from_rig[link.camera].rotation).tr_mul(by_motion);
        let camera = graph.block_of_camera[link.camera].map(|block| (block, chain.by_camera()));
        let target = graph.block_of_target[link.target].map(|block| (block, chain.by_target()));
        for (block, by) in camera.iter().chain(&target) {
            let mut rows = self.shared.fixed_rows_mut::<6>(6 * block);
            rows += by.tr_mul(by_motion);
        }
    }
}

/// The equations of the shared blocks alone, with every body's pose eliminated.
#[derive(Debug)]
pub struct Eliminated {
    /// The factored matrix.
    pub reduced: Cholesky<f64, Dyn>,
    gradient: DVector<f64>,
    inverses: Vec<Matrix6>,
}

/// Adds to the lower triangle, whichever way round the blocks come.
fn add_block(information: &mut DMatrix<f64>, row: usize, column: usize, by: &Matrix6) {
    if row < column {
        return add_block(information, column, row, &by.transpose());
    }
    let mut view = information.fixed_view_mut::<6, 6>(6 * row, 6 * column);
    view += by;
}

fn inverse_of(information: &Matrix6, damping: f64) -> Option<Matrix6> {
    let mut damped = *information;
    for i in 0..6 {
        damped[(i, i)] *= 1.0 + damping;
    }
    damped.cholesky().map(|c| c.inverse())
}
