//! All nodes at once: Levenberg–Marquardt on the chain, then the covariances.

use super::chain::{Chain, Eliminated, Local, Solution};
use super::envelope::{self, Pair};
use super::node::{Instrument, Linear, Node, Role};
use nalgebra::{Matrix4, Vector4};

/// Steps at most; a record needs five to ten.
const STEPS: usize = 40;
/// Done when no unknown moves by more than this share of its standard deviation of measurement.
const SMALL_STEP: f64 = 1e-4;
/// How far the contact may move along the tangent between touch and first contact, as a share of the length: generous, an
/// outline of radius L/5 turning by 3°.
pub const TOUCH_SLIDE: f64 = 0.01;

/// Damping of the first step, as a share of the measurements' own weight.
const FIRST_DAMPING: f64 = 1e-2;
/// Dampings tried per step.
const TRIES: usize = 10;

/// What is known of the friction angle beforehand.
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
    /// What was known of it.
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

/// Memory of a minimisation.
#[derive(Debug, Default)]
struct Work {
    chain: Chain,
    factors: Vec<Eliminated>,
    sigmas: Vec<f64>,
    damping: f64,
}

impl Problem<'_> {
    fn linearise(&self, states: &[Local], shared_rad: f64) -> Option<Vec<Linear>> {
        self.nodes.iter().zip(states).map(|(node, z)| node.linear(self.with, z, shared_rad)).collect()
    }

    /// Standard deviations of the envelope's residuals.
    fn envelope_sigmas(&self, linear: &[Linear]) -> Vec<f64> {
        linear.windows(2).map(|pair| envelope::sigma_m(&pair[0], &pair[1])).collect()
    }

    fn chi2(&self, work: &Work, linear: &[Linear], states: &[Local], shared_rad: f64) -> f64 {
        let own: f64 = self.nodes.iter().zip(states).map(|(node, z)| node.deviation(z).norm_squared()).sum();
        let constraints: f64 = linear.iter().filter_map(|l| l.constraint).map(|(r, ..)| r * r).sum();
        let mut pairs = 0.0;
        for i in (0..work.sigmas.len()).filter(|&i| self.linked[i]) {
            pairs += (Pair::envelope(&linear[i], &linear[i + 1]).residual_m / work.sigmas[i]).powi(2);
            if let Some((slide, sigma)) = self.touch_slide(i, linear) {
                pairs += (slide.residual_m / sigma).powi(2);
            }
        }
        let prior = (shared_rad - self.prior.angle_rad) / self.prior.sigma_rad;
        own + constraints + pairs + prior * prior
    }

    fn touch_slide(&self, i: usize, linear: &[Linear]) -> Option<(Pair, f64)> {
        self.is_touch(i)
            .then(|| (Pair::slide(&linear[i], &linear[i + 1]), TOUCH_SLIDE * self.with.rod.length_m))
    }

    fn fill(&self, work: &mut Work, linear: &[Linear]) {
        let Work { chain, sigmas, .. } = work;
        chain.reset(self.nodes.len());
        for (i, node) in self.nodes.iter().enumerate() {
            let deviation = node.deviation(&self.states[i]);
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
        chain.add_shared(weight, weight * (self.shared_rad - self.prior.angle_rad));
    }

    /// Minimises from the states as they stand and leaves them at the minimum; none where the start has no contact.
    pub fn minimise(&mut self) -> Option<Smoothed> {
        let linear = self.linearise(&self.states, self.shared_rad)?;
        let (mut work, mut out) = (Work::default(), Smoothed { linear, ..Default::default() });
        work.damping = FIRST_DAMPING;
        self.descend(&mut work, &mut out);
        work.sigmas = self.envelope_sigmas(&out.linear);
        out.chi2 = self.chi2(&work, &out.linear, &self.states, self.shared_rad);
        self.fill(&mut work, &out.linear);
        work.chain.solve(&mut work.factors, &mut out.solution)?;
        Some(out)
    }

    /// Steps until none helps or all are small.
    fn descend(&mut self, work: &mut Work, out: &mut Smoothed) {
        for _ in 0..STEPS {
            out.iterations += 1;
            // Held while a step is judged.
            work.sigmas = self.envelope_sigmas(&out.linear);
            match self.step(work, out) {
                Some(moved) if SMALL_STEP <= moved => {}
                _ => break,
            }
        }
    }

    /// One step that does not raise the sum of squares; the largest move of an unknown, none where no step helps.
    fn step(&mut self, work: &mut Work, out: &mut Smoothed) -> Option<f64> {
        let before = self.chi2(work, &out.linear, &self.states, self.shared_rad);
        for _ in 0..TRIES {
            self.fill(work, &out.linear);
            work.chain.damp(work.damping);
            work.chain.solve(&mut work.factors, &mut out.solution)?;
            let states: Vec<Local> =
                self.states.iter().zip(&out.solution.steps).map(|(z, step)| z + step).collect();
            let shared_rad = self.shared_rad + out.solution.shared_step;
            if let Some(linear) = self.linearise(&states, shared_rad)
                && self.chi2(work, &linear, &states, shared_rad) <= before * (1.0 + 1e-9)
            {
                (self.states, self.shared_rad, out.linear) = (states, shared_rad, linear);
                work.damping *= 0.1;
                return Some(out.solution.steps.iter().map(|s| s.amax()).fold(0.0, f64::max));
            }
            work.damping = work.damping * 10.0 + 1e-6;
        }
        None
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
