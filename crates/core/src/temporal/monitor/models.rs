//! The models of a bank: shares and time constants of a correlated error on a grid, and what may lie between its points.
//!
//! Derivation: docs/math/monitor.md section 9, eq. (53).

use std::sync::LazyLock;

/// A correlated error: variance in units of a reading's own, time constant in units of the bank's.
#[derive(Debug, Clone, Copy)]
pub(super) struct Model {
    pub share: f64,
    pub time: f64,
}

const fn model(share: f64, time: f64) -> Model {
    Model { share, time }
}

/// White noise alone.
pub(super) const WHITE: usize = 0;
/// Models of a correlated error.
pub(super) const GRID: usize = 52;
/// Models of a diurnal variation.
pub(super) const DAYS: usize = DIURNAL_SHARES.len();
/// All, with the error as it was stated beforehand, which is never excluded.
pub(super) const MODELS: usize = GRID + DAYS + 1;
pub(super) const STATED: usize = MODELS - 1;
/// Variances of a diurnal variation in units of a reading's own.
pub(super) const DIURNAL_SHARES: [f64; 3] = [1.2, 20.0, 300.0];
/// Shares and time constants, a factor of four apart: neighbours differ by thousandths of a nat a reading.
pub(super) const GRID_MODELS: [Model; GRID] = [
    model(0.0, 1.0),
    model(0.3, 2.0),
    model(1.2, 2.0),
    model(5.0, 2.0),
    model(20.0, 2.0),
    model(0.3, 8.0),
    model(1.2, 8.0),
    model(5.0, 8.0),
    model(20.0, 8.0),
    model(0.3, 30.0),
    model(1.2, 30.0),
    model(5.0, 30.0),
    model(20.0, 30.0),
    model(80.0, 30.0),
    model(0.3, 110.0),
    model(1.2, 110.0),
    model(5.0, 110.0),
    model(20.0, 110.0),
    model(80.0, 110.0),
    model(0.3, 400.0),
    model(1.2, 400.0),
    model(5.0, 400.0),
    model(20.0, 400.0),
    model(80.0, 400.0),
    model(0.3, 1500.0),
    model(1.2, 1500.0),
    model(5.0, 1500.0),
    model(20.0, 1500.0),
    model(80.0, 1500.0),
    model(0.3, 5500.0),
    model(0.6, 5500.0),
    model(1.2, 5500.0),
    model(2.5, 5500.0),
    model(5.0, 5500.0),
    model(10.0, 5500.0),
    model(20.0, 5500.0),
    model(40.0, 5500.0),
    model(80.0, 5500.0),
    model(0.3, 20000.0),
    model(0.6, 20000.0),
    model(1.2, 20000.0),
    model(2.5, 20000.0),
    model(5.0, 20000.0),
    model(10.0, 20000.0),
    model(20.0, 20000.0),
    model(40.0, 20000.0),
    model(80.0, 20000.0),
    model(0.3, 93312.0),
    model(1.2, 93312.0),
    model(5.0, 93312.0),
    model(20.0, 93312.0),
    model(80.0, 93312.0),
];

/// A model that is behind the best one by less than this, ln 1000, is not excluded.
pub(super) const EXCLUDED: f64 = 6.9;
/// The models beside one along one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Beside {
    /// White noise where errors would be smaller or shorter than any of the grid; none where the grid has no such neighbour.
    smaller: Option<usize>,
    larger: usize,
}

/// Directions of the grid: larger errors, longer ones, and both.
pub(super) const DIRECTIONS: [(bool, bool); 3] = [(true, false), (false, true), (true, true)];

/// Along each direction; none where no model is further along it.
static BESIDE: LazyLock<[[Option<Beside>; DIRECTIONS.len()]; GRID]> =
    LazyLock::new(|| std::array::from_fn(|of| DIRECTIONS.map(|direction| beside(of, direction))));

fn beside(of: usize, (in_share, in_time): (bool, bool)) -> Option<Beside> {
    let (least, own) = (&GRID_MODELS[1], &GRID_MODELS[of]);
    let is_least = (in_share && own.share <= least.share) || (in_time && own.time <= least.time);
    let larger = nearest(of, (in_share, in_time), false)?;
    let smaller = nearest(of, (in_share, in_time), true).or(is_least.then_some(WHITE));
    (of != WHITE).then_some(Beside { smaller, larger })
}

/// The nearest model that is larger, or smaller, than `of` in the parameters along which to look, and as it is in the others.
fn nearest(of: usize, (in_share, in_time): (bool, bool), is_smaller: bool) -> Option<usize> {
    /// The widest step of the grid.
    const STEP: f64 = 4.7;
    let ratios = |model: usize| {
        let (from, to) = if is_smaller { (model, of) } else { (of, model) };
        let (a, b) = (GRID_MODELS[from], GRID_MODELS[to]);
        (b.share / a.share, b.time / a.time)
    };
    let is_along =
        |ratio: f64, is_looked: bool| if is_looked { 1.0 < ratio && ratio < STEP } else { ratio == 1.0 };
    let is_it = |model: &usize| {
        let (share, time) = ratios(*model);
        is_along(share, in_share) && is_along(time, in_time)
    };
    let distance = |model: &usize| {
        let (share, time) = ratios(*model);
        share * time
    };
    (1..GRID).filter(is_it).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Noise between the best model and the next one of larger or longer errors: a value of it is that of a parabola through those of three.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Between {
    models: [usize; 3],
    weights: [f64; 3],
}

impl Between {
    pub fn of(&self, value: impl Fn(usize) -> f64) -> f64 {
        self.models.iter().zip(self.weights).map(|(model, weight)| weight * value(*model)).sum()
    }

    /// At a share of the way from `best` to the larger one: as far as its likelihood is not excluded, and half of the way at least, because
    /// beyond it the larger model would be the better one.
    fn new(best: usize, Beside { smaller, larger }: Beside, log_likelihoods: &[f64]) -> Self {
        let behind = |model: usize| (log_likelihoods[model] - log_likelihoods[best]).min(0.0);
        let Some(smaller) = smaller else {
            return Between { models: [best, best, larger], weights: [0.0, 0.0, 1.0] };
        };
        let (below, above) = (behind(smaller), behind(larger));
        let (curvature, slope) = (0.5 * (above + below), 0.5 * (above - below));
        let furthest =
            if curvature < 0.0 { -0.5 * slope / curvature + (-EXCLUDED / curvature).sqrt() } else { 1.0 };
        let u = furthest.clamp(HALF_WAY, 1.0);
        let weights = [0.5 * u * (u - 1.0), 1.0 - u * u, 0.5 * u * (u + 1.0)];
        Between { models: [smaller, best, larger], weights }
    }
}

/// Of the way between two models, whose likelihoods are bounded and do not show more after a long record.
const HALF_WAY: f64 = 0.5;

/// The largest errors between the best model and the next ones that are not excluded: the truth is between grid points, and of a long record
/// only one of these is left, whose errors of low frequency may be several times too small.
pub(super) fn between(best: usize, log_likelihoods: &[f64]) -> impl Iterator<Item = Between> {
    let beside = if best < GRID { BESIDE[best] } else { [None; DIRECTIONS.len()] };
    beside.into_iter().flatten().map(move |beside| Between::new(best, beside, log_likelihoods))
}

/// The first of the largest.
pub(super) fn best(of: &[f64]) -> usize {
    let mut best = 0;
    for (i, value) in of.iter().enumerate() {
        if of[best] < *value {
            best = i;
        }
    }
    best
}
