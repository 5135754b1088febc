//! Estimates the accuracy of the gripper's motions: variance components by restricted maximum likelihood.
//!
//! Paper: D. A. Harville, "Maximum likelihood approaches to variance component estimation and to related problems", 1977; small samples:
//! M. G. Kenward and J. H. Roger, "Small sample inference for fixed effects from restricted maximum likelihood", 1997.
//! docs/math/hand_eye.md section 6.
//!
//! ```text
//!   r  residuals of the poses   ·   D  their derivatives by X, Z (and one more effect)   ·   V = Σ + Σₖ θₖ Vₖ   ·   W = V⁻¹
//!   M = DᵀWD, Φ = M⁻¹   ·   Mₖ = DᵀWVₖWD   ·   Qₖₗ = DᵀWVₖWVₗWD   ·   F  information of θ, C = F⁻¹
//! ```

use super::motions::half_rotation;
use super::views::{IN_BASE, KINDS, Known, Poses};
use crate::multiview::relative::residual;
use crate::{Matrix6, Pose, Vector6};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// X, Z and one more effect.
pub(super) const EFFECTS: usize = 13;

pub(super) type Effects = SVector<f64, EFFECTS>;
pub(super) type Normal = SMatrix<f64, EFFECTS, EFFECTS>;
type Design = SMatrix<f64, 6, EFFECTS>;
/// θ.
pub(super) type Variances = [f64; KINDS];

/// One residual of six numbers.
pub(super) struct Row {
    /// r.
    pub residual: Vector6,
    /// D.
    pub design: Design,
    /// Σ, including the gripper's noise where it is stated.
    pub known: Matrix6,
    /// Vₖ; `None` where the gripper's noise is stated.
    pub parts: Option<[Matrix6; KINDS]>,
}

/// Prior knowledge of the effects: a height.
#[derive(Clone)]
pub(super) struct Besides {
    pub information: Normal,
    pub gradient: Effects,
    pub chi2: f64,
}

/// The maximum of the restricted likelihood.
pub(super) struct Reml {
    /// θ.
    pub variances: Variances,
    /// The best effects.
    pub effects: Effects,
    /// Φ.
    pub phi: Normal,
    /// The contribution of each uncertain θₖ to Φ, eqs. (24), (27), (36).
    pub widenings: [Normal; KINDS],
    /// ℓ.
    pub log_likelihood: f64,
}

/// Number of scoring steps: each squares the error; a variance that tends to zero needs a few more.
const MAX_STEPS: usize = 40;
/// A step that promises less in the log-likelihood is the last.
const TOLERANCE: f64 = 1e-8;
/// Number of halvings of a step.
const MAX_HALVINGS: usize = 12;

/// The likelihood at one θ.
pub(super) struct At {
    log_likelihood: f64,
    /// W of every row.
    pub weights: Vec<Matrix6>,
    /// Φ.
    pub phi: Normal,
    /// x̂.
    pub effects: Effects,
}

/// Its derivatives.
struct Slope {
    score: Vector3<f64>,
    /// F.
    information: Matrix3<f64>,
    m: [Normal; KINDS],
}

/// A maximum over some kinds.
struct Maximum {
    variances: Variances,
    at: At,
    slope: Slope,
    kinds: Vec<usize>,
}

/// Maximises the restricted likelihood over θ ≥ 0 by Fisher scoring from `start`, eqs. (19)–(23). `None` where V or M is singular.
///
/// Rotations about the base take part only where they increase the likelihood; elsewhere they would widen the answer.
pub(super) fn reml(rows: &[Row], besides: &Besides, start: &Variances) -> Option<Reml> {
    let without = maximum(rows, besides, &[start[0], 0.0, start[2]], vec![0, 2])?;
    let start = if 0.0 < start[IN_BASE] { *start } else { without.variances };
    let with = maximum(rows, besides, &start, vec![0, IN_BASE, 2]);
    let is_needed = |with: &Maximum| without.at.log_likelihood + NEEDED_GAIN < with.at.log_likelihood;
    let best = with.filter(is_needed).unwrap_or(without);
    let none = maximum(rows, besides, &[0.0; KINDS], Vec::new())?;
    let gain = best.at.log_likelihood - none.at.log_likelihood;
    Some(match () {
        () if gain <= NEEDED_GAIN_OF_ANY => none.concluded([Normal::zeros(); KINDS]),
        () if gain <= NEEDED_GAIN_OF_WEIGHTS => {
            let widenings = doubted(&none, &best.variances);
            none.concluded(widenings)
        }
        () => {
            let widenings = widenings(rows, &best);
            best.concluded(widenings)
        }
    })
}

/// … for any noise at all in the covariance: half of all exact robots would otherwise seem noisy.
const NEEDED_GAIN_OF_ANY: f64 = 1.0;
/// … and in the weights: weighting an exact gripper by random residuals costs a twentieth of the efficiency with eight views.
const NEEDED_GAIN_OF_WEIGHTS: f64 = 3.0;

/// Returns what the noise that an exact gripper seems to have adds to the covariance of its weights, eq. (27).
fn doubted(exact: &Maximum, seeming: &Variances) -> [Normal; KINDS] {
    let phi = exact.at.phi;
    core::array::from_fn(|k| symmetric(&(phi * exact.slope.m[k] * phi * seeming[k])))
}

fn symmetric(matrix: &Normal) -> Normal {
    (matrix + matrix.transpose()) * 0.5
}

/// The gain in the log-likelihood that one more kind of noise must give: by chance this happens once in forty.
const NEEDED_GAIN: f64 = 2.0;

/// Maximises over some kinds, with the others fixed at the start.
fn maximum(rows: &[Row], besides: &Besides, start: &Variances, kinds: Vec<usize>) -> Option<Maximum> {
    let mut variances = *start;
    let mut at = evaluate(rows, besides, &variances)?;
    let mut slope = slope(rows, &at);
    for _ in 0..MAX_STEPS {
        let (step, promised) = scoring_step(&slope, &variances, &kinds);
        if promised < TOLERANCE {
            break;
        }
        let mut length = 1.0;
        let trial = (0..MAX_HALVINGS).find_map(|_| {
            let trial = core::array::from_fn(|k| f64::max(0.0, variances[k] + length * step[k]));
            length *= 0.5;
            let better = evaluate(rows, besides, &trial)?;
            (at.log_likelihood < better.log_likelihood).then_some((trial, better))
        });
        let Some((trial, better)) = trial else { break };
        let gain = better.log_likelihood - at.log_likelihood;
        (variances, at) = (trial, better);
        slope = self::slope(rows, &at);
        if gain < TOLERANCE {
            break;
        }
    }
    Some(Maximum { variances, at, slope, kinds })
}

/// Returns the variances that may change: those above zero, and those for which the likelihood increases away from it.
fn free(slope: &Slope, variances: &Variances, kinds: &[usize]) -> Vec<usize> {
    let moves =
        |k: &usize| 0.0 < slope.information[(*k, *k)] && (0.0 < variances[*k] || 0.0 < slope.score[*k]);
    kinds.iter().copied().filter(moves).collect()
}

/// Returns the inverse of F for some variances, zero elsewhere; scaled, because rad² and m² differ by orders of magnitude.
fn inverse_of(information: &Matrix3<f64>, free: &[usize]) -> Matrix3<f64> {
    let scale = |k: usize| information[(k, k)].sqrt().recip();
    let mut scaled = Matrix3::identity();
    for i in free {
        for j in free {
            scaled[(*i, *j)] = information[(*i, *j)] * scale(*i) * scale(*j);
        }
    }
    let inverse = scaled.cholesky().map_or_else(Matrix3::identity, |c| c.inverse());
    let entry = |i: usize, j: usize| match free.contains(&i) && free.contains(&j) {
        true => inverse[(i, j)] * scale(i) * scale(j),
        false => 0.0,
    };
    Matrix3::from_fn(entry)
}

/// Returns F⁻¹ times the score, and its promise. A variance that the step would make negative is set to zero, and the others are solved again.
fn scoring_step(slope: &Slope, variances: &Variances, kinds: &[usize]) -> (Vector3<f64>, f64) {
    let mut free = free(slope, variances, kinds);
    loop {
        let step = inverse_of(&slope.information, &free) * slope.score;
        match free.iter().position(|k| variances[*k] == 0.0 && step[*k] < 0.0) {
            Some(below) => drop(free.remove(below)),
            None => return (step, step.dot(&slope.score)),
        }
    }
}

impl Maximum {
    fn concluded(self, widenings: [Normal; KINDS]) -> Reml {
        let Maximum { variances, at: At { effects, phi, log_likelihood, .. }, .. } = self;
        Reml { variances, effects, phi, widenings, log_likelihood }
    }
}

/// Returns the contribution of each uncertain θₖ to Φ: that of all, eq. (24), in proportion to those of single ones, eq. (36).
fn widenings(rows: &[Row], best: &Maximum) -> [Normal; KINDS] {
    let (variances, phi) = (&best.variances, best.at.phi);
    let information = &best.slope.information;
    let is_inside = |k: &usize| 0.0 < variances[*k] && 0.0 < information[(*k, *k)];
    let inside: Vec<usize> = best.kinds.iter().copied().filter(is_inside).collect();
    let all = inverse_of(information, &inside);
    // Within its own standard deviation of zero, the expansion about a variance is meaningless.
    let free: Vec<usize> =
        inside.into_iter().filter(|k| all[(*k, *k)] < variances[*k] * variances[*k]).collect();
    let covariance = inverse_of(information, &free);
    let whole = symmetric(&(phi * uncertain(rows, best, &covariance) * phi));
    let alone = |k: usize| {
        let mut own = Matrix3::zeros();
        own[(k, k)] = covariance[(k, k)];
        phi.tr_dot(&uncertain(rows, best, &own))
    };
    let alone: Variances = core::array::from_fn(alone);
    let sum = alone.iter().sum::<f64>();
    alone.map(|alone| if 0.0 < alone { whole * (alone / sum) } else { Normal::zeros() })
}

/// Returns what stands between Φ and Φ in eq. (24) for a covariance of θ: Qₖₗ needs the rows once more.
fn uncertain(rows: &[Row], Maximum { at, slope, .. }: &Maximum, covariance: &Matrix3<f64>) -> Normal {
    let pairs =
        || (0..KINDS).flat_map(|k| (0..KINDS).map(move |l| (k, l))).filter(|kl| covariance[*kl] != 0.0);
    let mut sum = Normal::zeros();
    for (row, w) in rows.iter().zip(&at.weights) {
        let (Some(parts), wd) = (&row.parts, w * row.design) else { continue };
        let mut between = Matrix6::zeros();
        for (k, l) in pairs() {
            between += parts[k] * w * parts[l] * (2.0 * covariance[(k, l)]);
        }
        sum += wd.tr_mul(&(between * wd));
    }
    for (k, l) in pairs() {
        sum -= slope.m[k] * at.phi * slope.m[l] * covariance[(k, l)];
    }
    sum
}

/// Evaluates eqs. (19), (20).
pub(super) fn evaluate(rows: &[Row], besides: &Besides, variances: &Variances) -> Option<At> {
    let mut weights = Vec::with_capacity(rows.len());
    let (mut m, mut b, mut log_det, mut rr) = (besides.information, besides.gradient, 0.0, besides.chi2);
    for row in rows {
        let v = total(row, variances).cholesky()?;
        log_det += 2.0 * v.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        let w = v.inverse();
        m += row.design.tr_mul(&(w * row.design));
        b += row.design.tr_mul(&(w * row.residual));
        rr += row.residual.dot(&(w * row.residual));
        weights.push(w);
    }
    // An effect on which nothing depends stays zero.
    if m[(EFFECTS - 1, EFFECTS - 1)] == 0.0 {
        m[(EFFECTS - 1, EFFECTS - 1)] = 1.0;
    }
    let factor = m.cholesky()?;
    log_det += 2.0 * factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
    let (phi, effects) = (factor.inverse(), factor.solve(&b));
    let log_likelihood = -0.5 * (log_det + rr - b.dot(&effects));
    log_likelihood.is_finite().then_some(At { log_likelihood, weights, phi, effects })
}

/// Evaluates eqs. (21), (22).
fn slope(rows: &[Row], at: &At) -> Slope {
    let mut slope =
        Slope { score: Vector3::zeros(), information: Matrix3::zeros(), m: [Normal::zeros(); KINDS] };
    for (row, w) in rows.iter().zip(&at.weights) {
        let Some(parts) = &row.parts else { continue };
        let we = w * (row.residual - row.design * at.effects);
        let wd = w * row.design;
        let by_effects = wd * at.phi * wd.transpose();
        let wv = parts.map(|part| w * part);
        let shared = wv.map(|wv| wv * by_effects);
        for k in 0..KINDS {
            slope.score[k] += 0.5 * (we.dot(&(parts[k] * we)) - wv[k].trace());
            slope.m[k] += wd.tr_mul(&(parts[k] * wd));
            for l in 0..KINDS {
                // tr_dot is the trace of a product.
                slope.information[(k, l)] += 0.5 * wv[k].tr_dot(&wv[l]) - parts[k].tr_dot(&shared[l]);
            }
        }
    }
    let phi_m = slope.m.map(|m| at.phi * m);
    for k in 0..KINDS {
        slope.score[k] += 0.5 * phi_m[k].trace();
        for l in 0..KINDS {
            slope.information[(k, l)] += 0.5 * phi_m[k].tr_dot(&phi_m[l]);
        }
    }
    slope
}

/// Returns V.
fn total(row: &Row, variances: &Variances) -> Matrix6 {
    let Some(parts) = &row.parts else { return row.known };
    parts.iter().zip(variances).fold(row.known, |sum, (part, variance)| sum + part * *variance)
}

/// Sets the gripper's noise of every view that does not state it.
pub(super) fn assume(known: &mut [Known], variances: &Variances) {
    for view in known {
        if let Some(parts) = &view.parts {
            view.covariance =
                Some(parts.iter().zip(variances).fold(Matrix6::zeros(), |sum, (part, x)| sum + part * *x));
            view.variances = *variances;
        }
    }
}

/// Returns whether the noise of any view is unknown.
pub(super) fn is_open(known: &[Known]) -> bool {
    known.iter().any(|view| view.parts.is_some())
}

/// A tenth of a degree, in rad.
const NOMINAL_RAD: f64 = 1.7e-3;

/// Returns initial variances: a tenth of a degree, and the corresponding share of the target's distance or the gripper's travel, whichever is
/// larger.
pub(super) fn nominal(known: &[Known]) -> Variances {
    let distance2 =
        |view: &Known| view.candidates.first().map_or(0.0, |c| c.cam_from_target.translation.norm_squared());
    let sum = |f: &dyn Fn(&Known) -> f64| known.iter().map(f).sum::<f64>() / known.len().max(1) as f64;
    let reach2 = f64::max(sum(&distance2), sum(&|view| view.gripper_in_base().norm_squared()));
    let turn = NOMINAL_RAD * NOMINAL_RAD;
    [turn, 0.0, turn * f64::max(reach2, f64::MIN_POSITIVE)]
}

/// Median of χ² with three degrees of freedom.
const MEDIAN_CHI2: f64 = 2.366;

/// Estimates orientation and position noise from the middle residuals: correct with up to half of the views wrong, accurate to a third with ten.
/// `candidate` selects a view's pose, `place` the index among the ascending residuals.
pub(super) fn from_middle(
    known: &[Known],
    poses: &Poses,
    candidate: impl Fn(&Known) -> usize,
    place: usize,
) -> Variances {
    let (mut turns, mut shifts) = (Vec::new(), Vec::new());
    for view in known.iter().filter(|view| view.parts.is_some()) {
        let [turn, shift] = of_one(view, candidate(view), poses);
        turns.push(turn);
        shifts.push(shift);
    }
    let middle = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        let at = all.len().min(place + 1).saturating_sub(1);
        all.get(at).map_or(0.0, |x| f64::max(0.0, *x))
    };
    [middle(turns), 0.0, middle(shifts)]
}

/// Returns the variances of orientation and position for one view as the median, less what the camera's noise explains.
fn of_one(view: &Known, candidate: usize, poses: &Poses) -> [f64; 2] {
    let candidate = &view.candidates[candidate];
    let back = poses.cam_from_carrier.inverse();
    let by_camera = back * candidate.cam_from_target * poses.holder_from_target.inverse();
    let ad = back.adjoint();
    let carried = ad * candidate.covariance * ad.transpose();
    let (by_camera, covariance, by_hand) = view.in_base(&by_camera, &carried);
    let mut about_hand = Matrix6::identity();
    let cross: Matrix3<f64> = -by_camera.translation.cross_matrix();
    about_hand.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross);
    let own = about_hand * covariance * about_hand.transpose();
    let share = |at: usize| own.fixed_view::<3, 3>(at, at).trace() / 3.0;
    let turn =
        half_rotation(&Pose::new(by_camera.rotation * by_hand.rotation.transpose(), Vector3::zeros())) * 2.0;
    let shift = by_camera.translation - by_hand.translation;
    [turn.norm_squared() / MEDIAN_CHI2 - share(0), shift.norm_squared() / MEDIAN_CHI2 - share(3)]
}

/// Returns rows of the views used, linear in small motions of X and Z. `shared` holds by which motion the measured pose of each of them follows an error
/// that all views share, the thirteenth effect, eq. (25).
pub(super) fn rows(
    poses: &Poses,
    known: &[Known],
    used: &[(usize, usize)],
    shared: Option<&[Vector6]>,
) -> Vec<Row> {
    let ad = poses.cam_from_carrier.adjoint();
    let row = |(at, &(view, candidate)): (usize, &(usize, usize))| {
        let (view, candidate) = (&known[view], &known[view].candidates[candidate]);
        let (r, jacobian) = residual(&candidate.cam_from_target, &poses.cam_from_target(view));
        let mut design = Design::zeros();
        design.fixed_view_mut::<6, 6>(0, 0).copy_from(&jacobian);
        let by_holder = (poses.cam_from_carrier * view.carrier_from_holder).adjoint();
        design.fixed_view_mut::<6, 6>(0, 6).copy_from(&(jacobian * by_holder));
        if let Some(motion) = shared.and_then(|motions| motions.get(at)) {
            design.fixed_view_mut::<6, 1>(0, EFFECTS - 1).copy_from(&-motion);
        }
        let carried = |part: &Matrix6| ad * part * ad.transpose();
        let stated = if view.parts.is_none() { view.covariance.as_ref().map(carried) } else { None };
        Row {
            residual: r,
            design,
            known: stated.map_or(candidate.covariance, |stated| candidate.covariance + stated),
            parts: view.parts_in_camera(poses),
        }
    };
    used.iter().enumerate().map(row).collect()
}
