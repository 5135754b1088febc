//! The single loop that takes steps on residuals: Levenberg–Marquardt for any cost that can be evaluated, stepped and moved.
//!
//! Its cost is a [`LeastSquares`]: one pose (`pose`), one point (`point`), a state of any kind with few hundred
//! unknowns (`dense`), many poses and what they share (`shared`), the cameras, targets and bodies of a rig (`rig`). It ends by one rule:
//!
//! ```text
//!   g  gradient Jᵀr   ·   H  JᵀJ   ·   λ  damping   ·   δ = (H + λD)⁻¹g  the step   ·   δᵀg  what it promises
//! ```
//!
//! At λ = 0 the promise gᵀH⁻¹g is both tests at once: the gradient in the metric of the covariance, and the step's squared length in
//! standard deviations. [`Ending`] says how the loop ended. Derivation: docs/math/refine.md section 2.

pub(crate) mod pose;
#[cfg(feature = "std")]
pub(crate) mod point;
#[cfg(feature = "std")]
pub(crate) mod clustered;
#[cfg(feature = "std")]
pub mod dense;
#[cfg(feature = "std")]
pub mod arrow;
#[cfg(feature = "std")]
pub(crate) mod shared;
#[cfg(feature = "std")]
pub(crate) mod rig;

pub(crate) use pose::{NormalEquations, PivotedPose, PoseMinimum, minimize_pose};

#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A cost that the loop lowers.
pub trait LeastSquares {
    /// The values of the unknowns.
    type State;
    /// The Gauss–Newton approximation of the cost at a state.
    type Equations;
    /// A change of the unknowns.
    type Step;
    /// Number of evaluations after which the loop gives up; 99.9 % of refinements from a closed form need fewer than 10.
    const MAX_STEPS: usize = 200;

    /// Returns that number, where it depends on the problem.
    #[inline(always)]
    fn max_steps(&self) -> usize {
        Self::MAX_STEPS
    }

    /// Returns whether the cost has curved valleys whose floor is flatter than the first damping, relative to the diagonal. Damping then begins lower and
    /// is reduced step by step: along the floor a step with the usual damping is too short, and one without too long.
    #[inline(always)]
    fn has_flat_valleys(&self) -> bool {
        false
    }

    /// Returns the cost at a state with its derivatives; `None` where it is undefined, as for a point outside the camera's field.
    fn evaluate(&self, state: &Self::State) -> Option<Self::Equations>;

    /// Returns the sum of squared whitened residuals, or of their losses.
    fn chi2(equations: &Self::Equations) -> f64;

    /// Returns the step for a damping (relative to the diagonal) and the promised decrease of χ²; `None` where the matrix is not positive.
    fn step(&self, equations: &Self::Equations, damping: f64) -> Option<(Self::Step, f64)>;

    /// Returns the state after a step; `None` where there is none.
    fn apply(&self, state: &Self::State, step: &Self::Step) -> Option<Self::State>;

    /// Returns the decrease of the cost between two states. A cost whose weights depend on the state uses those of the first.
    #[inline(always)]
    fn decrease(&self, from: &Self::Equations, to: &Self::Equations) -> f64 {
        Self::chi2(from) - Self::chi2(to)
    }
}

/// The end of the loop.
#[derive(Debug, Clone, Copy)]
pub struct Minimum<S, E> {
    /// The lowest state found, or one vanishing step beyond it.
    pub state: S,
    /// The equations at the lowest state evaluated: at most one vanishing step before `state`.
    pub equations: E,
    /// Number of evaluations.
    pub steps: usize,
    /// How it ended.
    pub ending: Ending,
}

impl<S, E> Minimum<S, E> {
    /// Returns whether the state is an answer: according to the equations, no state nearby has a lower cost.
    #[inline(always)]
    pub fn is_minimum(&self) -> bool {
        self.ending != Ending::NotConverged
    }
}

/// How the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The undamped step promises less than the tolerance: the gradient vanishes, and the step is a vanishing part of a standard deviation.
    Converged,
    /// The gradient does not vanish, but no step that the damping still allows lowers the cost: because of rounding, the edge of the camera's
    /// field, or an edge of the cost itself; or the minimum cannot come near its second solution. The state is the lowest found, or a vanishing
    /// step beyond it.
    NoProgress,
    /// The loop ran out of steps, or no damping makes the matrix positive.
    NotConverged,
}

/// The promise of a step at which the loop ends.
#[derive(Debug, Clone, Copy)]
pub struct Tolerance {
    /// The promise is less than this share of χ²; at least the share of rounding.
    pub relative: f64,
    /// χ² of a minimum that is known already: the loop may end early where it cannot come near it.
    pub alternative_chi2: Option<f64>,
}

/// Ends when a step promises to lower χ² by less than this: such a step is 3·10⁻⁴ standard deviations long.
pub(crate) const TOLERANCE_CHI2: f64 = 1e-7;
/// … or a decrease of less than this share of χ² itself, which is dominated by rounding.
pub(crate) const TOLERANCE_RELATIVE: f64 = 1e-14;
/// Damping (relative to the diagonal) after the first rejected step; before it the steps are Gauss–Newton's.
pub(crate) const FIRST_DAMPING: f64 = 1e-3;
/// … and where the cost has flat valleys.
const FIRST_DAMPING_IN_VALLEYS: f64 = 1e-6;
/// Damping beyond which no step can lower the cost.
pub(crate) const LAST_DAMPING: f64 = 1e12;

/// A minimum that will only be compared with a known, much better one is accurate enough when the step promises less than this share of the
/// difference; the step is still taken, and the remaining error is far smaller.
pub(crate) const TOLERANCE_COMPARED: f64 = 0.2;

/// The loop also ends, without another evaluation, where the step after this one can be predicted to promise less than this (3·10⁻⁵ standard
/// deviations): Gauss–Newton converges at least linearly, so that its promises decrease at least by the last factor again …
pub(crate) const PREDICTED_CHI2: f64 = 1e-9;
/// … and only for a step shorter than 0.03 standard deviations, so that the normal equations before it still give the covariance.
pub(crate) const NEAR_CHI2: f64 = 1e-3;

/// Closer to the second solution than this (far beyond the limit of ambiguity) the loop continues to rounding.
pub(crate) const ALTERNATIVE_MARGIN_CHI2: f64 = 100.0;

impl Tolerance {
    /// Continues to rounding.
    pub const FINE: Tolerance = Tolerance { relative: TOLERANCE_RELATIVE, alternative_chi2: None };

    /// Returns the promised decrease of χ² at which to end.
    #[inline(always)]
    fn at(&self, chi2: f64) -> f64 {
        let excess =
            self.alternative_chi2.map_or(0.0, |alternative| chi2 - alternative - ALTERNATIVE_MARGIN_CHI2);
        TOLERANCE_CHI2 + self.relative.max(TOLERANCE_RELATIVE) * chi2 + TOLERANCE_COMPARED * excess.max(0.0)
    }
}

/// Minimises a cost from `start`; `None` where the start has no cost.
#[inline]
pub fn minimize<P: LeastSquares>(
    problem: &P,
    start: P::State,
    tolerance: &Tolerance,
) -> Option<Minimum<P::State, P::Equations>> {
    let mut trial = start;
    // It starts without a state, so that the start is accepted like any better trial: `evaluate` is called, and inlined, only once in the loop.
    let mut lowest: Option<(P::State, P::Equations)> = None;
    let (mut damping, mut promised) = (Damping::none(problem.has_flat_valleys()), 1.0);
    for steps in 1..=problem.max_steps() {
        // The promise of the previous step, where both are Gauss–Newton steps.
        let mut before = 0.0;
        let found = problem.evaluate(&trial);
        let decrease = found.as_ref().map_or(f64::NAN, |to| match &lowest {
            Some((_, from)) => problem.decrease(from, to),
            None => f64::INFINITY - P::chi2(to),
        });
        match found {
            Some(better) if 0.0 < decrease => {
                before = if damping.value == 0.0 && decrease < f64::INFINITY { promised } else { 0.0 };
                damping.ease(decrease / promised);
                lowest = Some((trial, better));
            }
            _ if damping.value < LAST_DAMPING => damping.raise(),
            _ => {
                let (state, equations) = lowest?;
                return Some(Minimum { state, equations, steps, ending: Ending::NoProgress });
            }
        }
        let (state, equations) = lowest.as_ref()?;
        let Some((next, promise)) = next_trial(problem, state, equations, &mut damping) else {
            let (state, equations) = lowest?;
            return Some(Minimum { state, equations, steps, ending: Ending::NotConverged });
        };
        (trial, promised) = (next, promise);
        // promised · (promised / before) is the promise of the next step, docs/math/refine.md section 2.
        let predicted = promised < NEAR_CHI2 && promised * promised <= PREDICTED_CHI2 * before;
        let tolerance = tolerance.at(P::chi2(equations));
        if predicted || promised <= tolerance {
            let vanishes = damping.value == 0.0 || undamped_promise(problem, equations) <= tolerance;
            let ending = if vanishes { Ending::Converged } else { Ending::NoProgress };
            let (_, equations) = lowest?;
            return Some(Minimum { state: trial, equations, steps, ending });
        }
    }
    let (state, equations) = lowest?;
    Some(Minimum { state, equations, steps: problem.max_steps(), ending: Ending::NotConverged })
}

/// Returns the next state and the promise of the step to it, at the least damping from `damping` on that makes the matrix positive; `None` when
/// no damping does.
#[inline(always)]
fn next_trial<P: LeastSquares>(
    problem: &P,
    state: &P::State,
    equations: &P::Equations,
    damping: &mut Damping,
) -> Option<(P::State, f64)> {
    loop {
        if let Some((step, promise)) = problem.step(equations, damping.value)
            && let Some(next) = problem.apply(state, &step)
        {
            return Some((next, promise));
        }
        if !(damping.value < LAST_DAMPING) {
            return None;
        }
        damping.raise();
    }
}

/// Returns the promise without damping: a damped step that promises little may only be short.
#[cold]
fn undamped_promise<P: LeastSquares>(problem: &P, equations: &P::Equations) -> f64 {
    problem.step(equations, 0.0).map_or(f64::INFINITY, |(_, promise)| promise)
}

/// Gauss–Newton steps that gain less than this share of their promise jump from side to side of a minimum that is flatter than JᵀJ predicts, as
/// where two minima are about to separate. Damping ends that.
pub(crate) const LEAST_GAIN: f64 = 0.1;

/// Levenberg and Marquardt's damping, relative to the diagonal, and the factor by which the next rejection raises it.
#[derive(Debug, Clone, Copy)]
struct Damping {
    value: f64,
    growth: f64,
    /// After a rejected step without damping.
    first: f64,
    /// After a step that achieved its promise, less than this is set to zero.
    needless: f64,
}

impl Damping {
    #[inline(always)]
    fn none(has_flat_valleys: bool) -> Self {
        let (first, needless) =
            if has_flat_valleys { (FIRST_DAMPING_IN_VALLEYS, 0.0) } else { (FIRST_DAMPING, FIRST_DAMPING) };
        Damping { value: 0.0, growth: 2.0, first, needless }
    }

    fn raise(&mut self) {
        self.value = f64::max(self.growth * self.value, self.first);
        self.growth *= 2.0;
    }

    /// Reduces the damping after an accepted step that achieved `gain` of its promise (Nielsen 1999, "Damping parameter in Marquardt's method");
    /// vanishing damping is set to zero, so that the loop ends with Gauss–Newton steps.
    fn ease(&mut self, gain: f64) {
        if gain < LEAST_GAIN {
            (self.value, self.growth) = (f64::max(2.0 * self.value, self.first), 2.0);
            return;
        }
        let eased = self.value * f64::max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0).powi(3));
        let vanishes = eased < 1e-9 || 0.9 < gain && eased < self.needless;
        (self.value, self.growth) = (if vanishes { 0.0 } else { eased }, 2.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals of two unknowns: Rosenbrock's valley, undefined beyond an edge.
    struct Valley {
        edge: f64,
        bend: f64,
    }

    impl LeastSquares for Valley {
        type State = [f64; 2];
        /// χ², gradient, information.
        type Equations = (f64, [f64; 2], [f64; 3]);
        type Step = [f64; 2];

        fn evaluate(&self, [x, y]: &[f64; 2]) -> Option<Self::Equations> {
            let (a, b) = (1.0 - x, 10.0 * (y - self.bend * x * x));
            let (ax, bx, by) = (-1.0, -20.0 * self.bend * x, 10.0);
            let gradient = [-(ax * a + bx * b), -(by * b)];
            (*x <= self.edge).then_some((a * a + b * b, gradient, [ax * ax + bx * bx, bx * by, by * by]))
        }

        fn chi2(equations: &Self::Equations) -> f64 {
            equations.0
        }

        fn step(
            &self,
            (_, [gx, gy], [xx, xy, yy]): &Self::Equations,
            damping: f64,
        ) -> Option<([f64; 2], f64)> {
            let (xx, yy) = (xx * (1.0 + damping), yy * (1.0 + damping));
            let determinant = xx * yy - xy * xy;
            let step = [(yy * gx - xy * gy) / determinant, (xx * gy - xy * gx) / determinant];
            (0.0 < determinant).then_some((step, step[0] * gx + step[1] * gy))
        }

        fn apply(&self, state: &[f64; 2], step: &[f64; 2]) -> Option<[f64; 2]> {
            Some([state[0] + step[0], state[1] + step[1]])
        }
    }

    /// A curved valley is followed to its end.
    #[test]
    fn the_end_of_a_valley_is_converged() {
        let found =
            minimize(&Valley { edge: 9.0, bend: 1.0 }, [-1.2, 1.0], &Tolerance::FINE).expect("a cost");
        assert_eq!(found.ending, Ending::Converged);
        assert!((found.state[0] - 1.0).abs() < 1e-4 && (found.state[1] - 1.0).abs() < 2e-4, "{found:?}");
        assert!(found.is_minimum() && found.steps < 60, "{found:?}");
    }

    /// Where the cost is undefined before the end of the valley, the edge is the answer, but the gradient is not reported as vanishing.
    #[test]
    fn an_edge_is_no_progress() {
        let found = minimize(&Valley { edge: 0.5, bend: 0.0 }, [0.5, 0.0], &Tolerance::FINE).expect("a cost");
        assert_eq!(found.ending, Ending::NoProgress);
        assert!(found.is_minimum() && (found.state[0] - 0.5).abs() < 1e-3, "{found:?}");
    }

    /// Costs without a start, without a positive matrix, and with NaN.
    #[test]
    fn what_cannot_be_lowered_is_not_called_a_minimum() {
        assert!(minimize(&Valley { edge: 0.0, bend: 1.0 }, [1.0, 1.0], &Tolerance::FINE).is_none());
        assert!(minimize(&Valley { edge: 9.0, bend: 1.0 }, [f64::NAN, 1.0], &Tolerance::FINE).is_none());
        struct Flat;
        impl LeastSquares for Flat {
            type State = f64;
            type Equations = f64;
            type Step = f64;
            fn evaluate(&self, x: &f64) -> Option<f64> {
                Some(x * x)
            }
            fn chi2(cost: &f64) -> f64 {
                *cost
            }
            fn step(&self, _: &f64, _: f64) -> Option<(f64, f64)> {
                None
            }
            fn apply(&self, x: &f64, step: &f64) -> Option<f64> {
                Some(x + step)
            }
        }
        let found = minimize(&Flat, 3.0, &Tolerance::FINE).expect("a cost");
        assert_eq!((found.ending, found.is_minimum(), found.state), (Ending::NotConverged, false, 3.0));
    }
}
