//! All nodes at once: the loop of `least_squares` on the chain, then the covariances.

use super::chain::{Chain, Eliminated, Local, Solution};
use super::envelope::{self, Pair};
use super::node::{Instrument, Linear, Node, Role};
use nalgebra::{Matrix4, Vector4};
use resight_core::least_squares::{LeastSquares, Tolerance, minimize};
use std::cell::RefCell;

/// How far the contact may move along the tangent between touch and first contact, as a share of the length: generous, an
/// outline of radius L/5 turning by 3°.
pub const TOUCH_SLIDE: f64 = 0.01;

/// The prior of the friction angle.
#[derive(Debug, Clone, Copy)]
pub struct Prior {
    /// Its expected value, radians.
    pub angle_rad: f64,
    /// Its standard deviation, radians.
    pub sigma_rad: f64,
}

/// A chain of nodes with its unknowns.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    /// The whisker and its instruments.
    pub with: &'a Instrument,
    /// The nodes in order of time, sweep after sweep.
    pub nodes: Vec<Node>,
    /// Whether the envelope condition holds between node i and i + 1.
    pub linked: Vec<bool>,
    /// The unknowns of every node.
    pub states: Vec<Local>,
    /// The shared friction angle, radians.
    pub shared_rad: f64,
    /// Its prior.
    pub prior: Prior,
}

/// The minimum.
#[derive(Debug, Clone, Default)]
pub struct Smoothed {
    /// Every node at its minimum.
    pub linear: Vec<Linear>,
    /// Steps' covariances.
    pub solution: Solution,
    /// Sum of squares at the minimum.
    pub chi2: f64,
    /// Steps taken.
    pub iterations: usize,
}

/// The unknowns of all nodes and the friction angle that they share, radians.
#[derive(Debug, Clone)]
struct State {
    nodes: Vec<Local>,
    shared_rad: f64,
}

/// The chain at a state.
#[derive(Debug, Clone)]
struct Linearised {
    state: State,
    linear: Vec<Linear>,
    /// Standard deviations of the envelope's residuals there.
    sigmas: Vec<f64>,
    /// By those.
    chi2: f64,
}

/// A step of every node and of the shared unknown.
struct Step {
    nodes: Vec<Local>,
    shared_rad: f64,
}

/// Memory of a minimisation.
#[derive(Debug, Default)]
struct Work {
    chain: Chain,
    factors: Vec<Eliminated>,
    solution: Solution,
}

struct Cost<'p, 'a> {
    problem: &'p Problem<'a>,
    work: RefCell<Work>,
}

impl LeastSquares for Cost<'_, '_> {
    type State = State;
    type Equations = Linearised;
    type Step = Step;
    /// A record needs five to ten.
    const MAX_STEPS: usize = 40;

    fn evaluate(&self, state: &State) -> Option<Linearised> {
        self.problem.linearised(state)
    }

    fn chi2(at: &Linearised) -> f64 {
        at.chi2
    }

    /// The envelope's standard deviations are held while a step is judged.
    fn decrease(&self, from: &Linearised, to: &Linearised) -> f64 {
        from.chi2 - self.problem.chi2(to, &from.sigmas)
    }

    fn step(&self, at: &Linearised, damping: f64) -> Option<(Step, f64)> {
        let Work { chain, factors, solution } = &mut *self.work.borrow_mut();
        self.problem.fill(chain, at);
        chain.damp(damping);
        let gradient = chain.gradient();
        chain.solve(factors, solution)?;
        let promised = -gradient.dot(solution);
        let step = Step { nodes: solution.steps.clone(), shared_rad: solution.shared_step };
        promised.is_finite().then_some((step, promised))
    }

    fn apply(&self, state: &State, step: &Step) -> Option<State> {
        let nodes = state.nodes.iter().zip(&step.nodes).map(|(z, step)| z + step);
        Some(State { nodes: nodes.collect(), shared_rad: state.shared_rad + step.shared_rad })
    }
}

impl Problem<'_> {
    fn linearised(&self, state: &State) -> Option<Linearised> {
        let of_node = |(node, z): (&Node, &Local)| node.linear(self.with, z, state.shared_rad);
        let linear: Vec<Linear> = self.nodes.iter().zip(&state.nodes).map(of_node).collect::<Option<_>>()?;
        let sigmas = self.envelope_sigmas(&linear);
        let mut at = Linearised { state: state.clone(), linear, sigmas, chi2: 0.0 };
        at.chi2 = self.chi2(&at, &at.sigmas);
        Some(at)
    }

    /// Standard deviations of the envelope's residuals.
    fn envelope_sigmas(&self, linear: &[Linear]) -> Vec<f64> {
        linear.windows(2).map(|pair| envelope::sigma_m(&pair[0], &pair[1])).collect()
    }

    fn chi2(&self, at: &Linearised, sigmas: &[f64]) -> f64 {
        let Linearised { state, linear, .. } = at;
        let all = self.nodes.iter().zip(&state.nodes);
        let own: f64 = all.map(|(node, z)| node.deviation(z).norm_squared()).sum();
        let constraints: f64 = linear.iter().filter_map(|l| l.constraint).map(|(r, ..)| r * r).sum();
        let mut pairs = 0.0;
        for i in (0..sigmas.len()).filter(|&i| self.linked[i]) {
            pairs += (Pair::envelope(&linear[i], &linear[i + 1]).residual_m / sigmas[i]).powi(2);
            if let Some((slide, sigma)) = self.touch_slide(i, linear) {
                pairs += (slide.residual_m / sigma).powi(2);
            }
        }
        let prior = (state.shared_rad - self.prior.angle_rad) / self.prior.sigma_rad;
        own + constraints + pairs + prior * prior
    }

    fn touch_slide(&self, i: usize, linear: &[Linear]) -> Option<(Pair, f64)> {
        self.is_touch(i)
            .then(|| (Pair::slide(&linear[i], &linear[i + 1]), TOUCH_SLIDE * self.with.rod.length_m))
    }

    fn fill(&self, chain: &mut Chain, at: &Linearised) {
        let Linearised { state, linear, sigmas, .. } = at;
        chain.reset(self.nodes.len());
        for (i, node) in self.nodes.iter().enumerate() {
            let deviation = node.deviation(&state.nodes[i]);
            chain.add_block(i, &Matrix4::identity(), &Vector4::zeros(), &deviation);
            if let Some((residual, by, by_shared)) = &linear[i].constraint {
                chain.add_single(i, *residual, by, *by_shared);
            }
        }
        for i in (0..sigmas.len()).filter(|&i| self.linked[i]) {
            add_pair(chain, i, &Pair::envelope(&linear[i], &linear[i + 1]), sigmas[i]);
            if let Some((slide, sigma)) = self.touch_slide(i, linear) {
                add_pair(chain, i, &slide, sigma);
            }
        }
        let weight = self.prior.sigma_rad.powi(-2);
        chain.add_shared(weight, weight * (state.shared_rad - self.prior.angle_rad));
    }

    /// Minimises from the states as they stand and leaves them at the minimum; none where the start has no contact.
    pub fn minimise(&mut self) -> Option<Smoothed> {
        let start = State { nodes: self.states.clone(), shared_rad: self.shared_rad };
        let cost = Cost { problem: self, work: RefCell::default() };
        let found = minimize(&cost, start, &Tolerance::FINE)?;
        // Where the last step leads out of what can be solved, the state before it is as good.
        let at = self.linearised(&found.state).unwrap_or(found.equations);
        let Work { mut chain, mut factors, mut solution } = cost.work.into_inner();
        self.fill(&mut chain, &at);
        chain.solve(&mut factors, &mut solution)?;
        let Linearised { state, linear, chi2, .. } = at;
        (self.states, self.shared_rad) = (state.nodes, state.shared_rad);
        Some(Smoothed { linear, solution, chi2, iterations: found.steps })
    }

    /// Conditions less unknowns: every reading brings its own unknown, so what is left are the constraints, the links and
    /// what is known of friction against the friction angle.
    pub fn degrees_of_freedom(&self, linear: &[Linear]) -> usize {
        let links = self.linked.iter().filter(|linked| **linked).count();
        let touches = (0..self.nodes.len()).filter(|&i| self.linked[i] && self.is_touch(i)).count();
        links + touches + linear.iter().filter(|l| l.constraint.is_some()).count()
    }

    fn is_touch(&self, i: usize) -> bool {
        matches!(self.nodes[i].role, Role::Touch { .. })
    }

    /// Of every envelope condition, its residual over the deviation it should have given all else, eq. (15); 0 where broken.
    pub fn envelope_tests(&self, smoothed: &Smoothed) -> Vec<f64> {
        let sigmas = self.envelope_sigmas(&smoothed.linear);
        (0..sigmas.len()).map(|i| self.test(smoothed, i, sigmas[i])).collect()
    }

    fn test(&self, smoothed: &Smoothed, i: usize, sigma: f64) -> f64 {
        let pair = Pair::envelope(&smoothed.linear[i], &smoothed.linear[i + 1]);
        if self.linked[i] { envelope_test(&pair, &smoothed.solution, i, sigma) } else { 0.0 }
    }
}

/// Eq. (15) for the pair of nodes `i` and `i + 1`.
pub fn envelope_test(pair: &Pair, s: &Solution, i: usize, sigma: f64) -> f64 {
    let known = (pair.by[0].transpose() * s.covariances[i] * pair.by[0])[0]
        + (pair.by[1].transpose() * s.covariances[i + 1] * pair.by[1])[0]
        + 2.0 * (pair.by[0].transpose() * s.cross[i] * pair.by[1])[0];
    let shared = pair.by_shared
        * (2.0 * (pair.by[0].dot(&s.with_shared[i]) + pair.by[1].dot(&s.with_shared[i + 1]))
            + pair.by_shared * s.shared_variance);
    // Rounding leaves the difference uncertain to about 1e-9 of σ².
    let left = (sigma * sigma - known - shared).max(1e-8 * sigma * sigma);
    pair.residual_m / left.sqrt()
}

/// Adds a residual between two nodes to the normal equations.
pub fn add_pair(chain: &mut Chain, node: usize, pair: &Pair, sigma: f64) {
    let by = pair.by.map(|b| b / sigma);
    chain.add_pair(node, pair.residual_m / sigma, [&by[0], &by[1]], pair.by_shared / sigma);
}
