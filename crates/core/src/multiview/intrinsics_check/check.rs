//! A test of the given intrinsics: a score (Lagrange multiplier) test over many frames, docs/math/frames.md section 3.
//!
//! Each frame is solved with the intrinsics as given. The score of its residual for them, with the pose eliminated, is
//! summed over the frames: no parameter is changed, so the test also holds where the true intrinsics are far away.
//!
//!   g  score of the intrinsics, poses eliminated   ·   S  its covariance, the reduced information   ·   T = gᵀ S⁻¹ g  ~  χ²ₖ
//!
//! A flat target is flat and true to size as prints are: its shape is eliminated with the poses, so that no bend is taken for a lens.

use super::equations::{equations, every_parameter, pivots};
use super::{
    Group, MAX_RELATIVE_SIGMA, SkippedFrame, View, located, picked, redundancy, restricted, scales, weakest,
};
use crate::camera::Parameters;
use crate::least_squares::PivotedPose;
use crate::least_squares::shared::Reduced;
use crate::locate::consistency::{is_unlikely, noise_scale};
use crate::multiview::flat_target::Shape;
use crate::statistics::chi_square::tail;
use crate::{Camera, Correspondence, Error};
use core::fmt;
use nalgebra::DVector;

/// Probability of a false alarm where the intrinsics are right.
pub const FALSE_ALARM_RATE: f64 = 1e-3;

/// Number of values of a target's shape.
const N_SHAPE: usize = 3;
/// Standard deviation of the stretch of prints along one side: paper in damp air stretches by half of it.
const STRETCH_SIGMA: f64 = 3e-3;
/// Standard deviation of the bends of flat targets, relative to the half width: 1 mm in the middle of a sheet of A4.
const BEND_SIGMA: f64 = 1e-2;

/// The result of the test of the given intrinsics.
#[derive(Debug, Clone, PartialEq)]
pub struct IntrinsicsCheck {
    /// The score statistic, divided by `noise_scale`; χ² with `degrees_of_freedom` for right intrinsics.
    pub statistic: f64,
    /// Number of parameters that the frames determine and that are therefore tested.
    pub degrees_of_freedom: usize,
    /// Probability of a statistic at least this large if the intrinsics are right.
    pub p_value: f64,
    /// The wrong parameters, the most significant first; empty when `p_value` ≥ `FALSE_ALARM_RATE`.
    pub blamed: Vec<Blame>,
    /// Every tested parameter with all others free: the offsets that the frames cannot exclude.
    pub tested: Vec<ParameterOffset>,
    /// Names of the parameters that the frames leave undetermined; they were taken as given.
    pub undetermined: Vec<&'static str>,
    /// Variance of the residuals over the stated one, without the part that the intrinsics explain; 1 where the residuals do not prove it
    /// larger.
    pub noise_scale: f64,
    /// Frames that took part.
    pub n_frames: usize,
    /// Frames that did not take part.
    pub skipped: Vec<SkippedFrame>,
}

/// A kind of parameter that is wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Blame {
    /// Which kind.
    pub group: Group,
    /// Its parameters, estimated with only those of the blamed kinds free.
    pub parameters: Vec<ParameterOffset>,
}

/// The estimated error of a parameter: one Gauss–Newton step, right to first order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterOffset {
    /// Name, as in camera.toml.
    pub name: &'static str,
    /// Value given.
    pub given: f64,
    /// The correction to add.
    pub offset: f64,
    /// Standard deviation of the offset.
    pub sigma: f64,
}

impl IntrinsicsCheck {
    /// Returns whether the frames agree with the given intrinsics.
    pub fn fits(&self) -> bool {
        self.blamed.is_empty()
    }
}

/// Tests the intrinsics of `camera` against many frames, each the correspondences of one view.
///
/// Bearings are derived anew from the pixels. Frames without a pose are skipped and named.
///
/// # Errors
/// `TooFewFrames` when no frame has a pose with redundancy; `UndeterminedIntrinsics` when the frames determine no parameter at all.
pub fn check_intrinsics<F: AsRef<[Correspondence]>>(
    frames: &[F],
    camera: &Camera,
) -> Result<IntrinsicsCheck, Error> {
    let (views, skipped) = located(frames, camera);
    let too_few = Error::TooFewFrames { seen: views.len(), needed: 1 };
    let [flat, shaped] = reduced(&views, camera).ok_or(too_few)?;
    let parameters = camera.parameters();
    let (keep, undetermined) = determined(&flat.0, &scales(&views, camera), &parameters)?;
    let n_left = redundancy(&views).saturating_sub(keep.len());
    let test = |(reduced, chi2): &'_ (Reduced, f64)| {
        let raw = statistic(reduced, &keep);
        Test {
            raw,
            noise_scale: noise_scale(chi2 - raw, n_left),
            reduced: reduced.clone(),
            parameters: &parameters,
        }
    };
    let explained = (flat.1 - shaped.1) / noise_scale(shaped.1, n_left);
    let (flat, shaped) = (test(&flat), test(&shaped));
    let p_value = |test: &Test| test.p_value(test.raw, keep.len());
    // The intrinsics fit if they do so with the target as given, or with a bent one where it is bent beyond chance.
    let is_bent = is_unlikely(explained, N_SHAPE);
    let test = if is_bent && p_value(&flat) < p_value(&shaped) { shaped } else { flat };
    let (p_value, raw, noise_scale) = (p_value(&test), test.raw, test.noise_scale);
    let blamed = if p_value < FALSE_ALARM_RATE { test.blame(&keep) } else { Vec::new() };
    Ok(IntrinsicsCheck {
        statistic: raw / noise_scale,
        degrees_of_freedom: keep.len(),
        p_value,
        blamed,
        tested: test.offsets(&keep),
        undetermined,
        noise_scale,
        n_frames: views.len(),
        skipped,
    })
}

/// Returns the score and the information of all intrinsics at the poses found, and χ² there: for a target as given, and with its shape eliminated,
/// χ² less what that explains.
fn reduced(views: &[View], camera: &Camera) -> Option<[(Reduced, f64); 2]> {
    if views.is_empty() {
        return None;
    }
    let pivots = pivots(views);
    let placed = views.iter().zip(&pivots);
    let places: Vec<PivotedPose> =
        placed.map(|(view, pivot)| PivotedPose::new(&view.minimum.cam_from_target, pivot)).collect();
    let (every, shape) = (every_parameter(camera), Shape::of(views.iter().flat_map(|view| &view.seen)));
    let mut equations = equations(views, &pivots, &places, camera, &every, shape.as_ref())?;
    let chi2 = equations.chi2;
    let all = equations.reduced()?;
    let of_lens: Vec<usize> = (0..every.len()).collect();
    let information = restricted(&all.information, &of_lens);
    let flat = Reduced { information, gradient: picked(&all.gradient, &of_lens) };
    let Some(Shape { half_m: [x, y], .. }) = shape else {
        return Some([(flat.clone(), chi2), (flat, chi2)]);
    };
    let variance = noise_scale(chi2, redundancy(views));
    for (i, sigma) in [STRETCH_SIGMA, BEND_SIGMA * x, BEND_SIGMA * y].into_iter().enumerate() {
        let by_shared = DVector::from_fn(equations.n_shared(), |k, _| f64::from(k == every.len() + i));
        equations.add_known(0.0, variance / (sigma * sigma), &by_shared);
    }
    let (shaped, explained) = equations.reduced()?.first(every.len())?;
    Some([(flat, chi2), (shaped, chi2 - explained)])
}

/// Returns the parameters that the frames determine, and the names of the others: the least determined one is held until the rest is determined.
fn determined(
    reduced: &Reduced,
    scales: &[f64],
    parameters: &Parameters,
) -> Result<(Vec<usize>, Vec<&'static str>), Error> {
    let (mut keep, mut held): (Vec<usize>, Vec<&'static str>) = ((0..scales.len()).collect(), Vec::new());
    loop {
        let of_kept: Vec<f64> = keep.iter().map(|i| scales[*i]).collect();
        let (worst, seen) = weakest(&restricted(&reduced.information, &keep), &of_kept).unwrap_or((0, 0.0));
        if seen <= MAX_RELATIVE_SIGMA {
            return Ok((keep, held));
        }
        let parameter = parameters[keep.remove(worst)].0;
        if keep.is_empty() {
            return Err(Error::UndeterminedIntrinsics { parameter, seen, needed: MAX_RELATIVE_SIGMA });
        }
        held.push(parameter);
    }
}

/// Returns T of some parameters with the others held, docs/math/frames.md eq. (8).
fn statistic(reduced: &Reduced, keep: &[usize]) -> f64 {
    let score = picked(&reduced.gradient, keep);
    let solved = restricted(&reduced.information, keep).cholesky().map(|c| c.solve(&score));
    solved.map_or(0.0, |solved| score.dot(&solved).max(0.0))
}

/// The inputs of every statistic of the test.
struct Test<'a> {
    reduced: Reduced,
    parameters: &'a Parameters,
    /// T before it is divided by `noise_scale`.
    raw: f64,
    noise_scale: f64,
}

impl Test<'_> {
    fn p_value(&self, raw: f64, degrees_of_freedom: usize) -> f64 {
        tail(degrees_of_freedom, raw / self.noise_scale)
    }

    /// Adds the group that explains most until the rest explains no more than chance would, docs/math/frames.md eq. (11).
    fn blame(&self, keep: &[usize]) -> Vec<Blame> {
        let whole = statistic(&self.reduced, keep);
        let of = |groups: &[Group]| -> Vec<usize> {
            keep.iter().copied().filter(|i| groups.contains(&Group::of(self.parameters[*i].0))).collect()
        };
        let with = |groups: &[Group], one: Group| of(&[groups, &[one]].concat());
        let mut groups: Vec<Group> = Vec::new();
        loop {
            let explained = of(&groups);
            let rest = whole - statistic(&self.reduced, &explained);
            if FALSE_ALARM_RATE <= self.p_value(rest, keep.len() - explained.len()) {
                break;
            }
            // Akaike's penalty: a kind with many parameters explains more by chance.
            let gain = |one: Group| {
                let more = with(&groups, one);
                statistic(&self.reduced, &more) / self.noise_scale - 2.0 * more.len() as f64
            };
            let candidates = Group::ALL.into_iter().filter(|one| explained.len() < with(&groups, *one).len());
            let best =
                candidates.map(|one| (one, gain(one))).fold(None, |best: Option<(Group, f64)>, next| {
                    best.filter(|best| next.1 <= best.1).or(Some(next))
                });
            let Some((best, _)) = best else { break };
            groups.push(best);
        }
        let offsets = self.offsets(&of(&groups));
        let belongs = |group: Group| offsets.iter().copied().filter(move |d| Group::of(d.name) == group);
        groups.iter().map(|&group| Blame { group, parameters: belongs(group).collect() }).collect()
    }

    /// Returns one Gauss–Newton step of some parameters with the others held, docs/math/frames.md eq. (10).
    fn offsets(&self, keep: &[usize]) -> Vec<ParameterOffset> {
        let Some(cholesky) = restricted(&self.reduced.information, keep).cholesky() else {
            return Vec::new();
        };
        let step: DVector<f64> = cholesky.solve(&picked(&self.reduced.gradient, keep));
        let covariance = cholesky.inverse() * self.noise_scale;
        let doubt = |(at, i): (usize, &usize)| {
            let (name, given) = self.parameters[*i];
            ParameterOffset { name, given, offset: step[at], sigma: covariance[(at, at)].sqrt() }
        };
        keep.iter().enumerate().map(doubt).collect()
    }
}

impl fmt::Display for IntrinsicsCheck {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let IntrinsicsCheck { statistic, degrees_of_freedom, p_value, n_frames, .. } = self;
        let evidence = format!(
            "χ² {statistic:.1} at {degrees_of_freedom} degrees of freedom over {n_frames} frames, p = {p_value:.1e}"
        );
        if self.fits() {
            write!(f, "the intrinsics fit ({evidence})")?;
        } else {
            write!(f, "the intrinsics do not fit ({evidence})")?;
        }
        for blame in &self.blamed {
            write!(f, "; the {} is off:", blame.group.name())?;
            for (i, ParameterOffset { name, given, offset, sigma }) in blame.parameters.iter().enumerate() {
                let comma = if i == 0 { "" } else { "," };
                write!(f, "{comma} {name} {given} by {offset:+.3} ± {sigma:.3}")?;
            }
        }
        match self.undetermined.as_slice() {
            [] => Ok(()),
            held => write!(f, "; not tested, since the frames leave it open: {}", held.join(", ")),
        }
    }
}
