//! The verdict on a rig by the rule of `consistency`: the losses are counted, and the likely cause is found.
//!
//! It uses stated and estimated noise, observations and points lost by each camera, target and view, intrinsics against all cameras
//! (`lens_score`), and sizes of targets against each other (`scale`). docs/math/rig.md section 10.

use super::adjust::Adjusted;
use super::explain::RigExplanation;
use super::layout::Layout;
use super::lens::LensOffset;
use super::lens_score::LensScore;
use super::sighted::{LocatedViews, fits_alone};
use super::uncertain_lens::stated;
use super::views::counts;
use super::{Observation, RejectedObservation, RigConfig, RigSolution, TargetScale};
use crate::budget::{Accounted, ErrorSource, Warning};
use crate::explanation::Weighed;
use crate::locate::consistency::{NOISY_FOCAL, is_inconsistent, loses_too_many};
use crate::locate::loss::Loss;
use crate::{Camera, Point, Vector6};
use nalgebra::DMatrix;

/// The contradictions between the solution and the observations, and the camera or target that is the likely cause. The default has none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RigVerdict {
    /// Whether any entry below contradicts; no pose may then be used before the cause is found.
    pub is_inconsistent: bool,
    /// Whether the residuals of the points used are far above their stated sigmas.
    pub is_noisy: bool,
    /// One entry for each camera.
    pub cameras: Vec<Losses>,
    /// One entry for each target.
    pub targets: Vec<Losses>,
    /// Views that lose more of their observations than a few damaged images explain.
    pub contradicting_views: Vec<usize>,
    /// One entry for each camera: the offset of its intrinsics; none where undetermined.
    pub lens_offsets: Vec<Option<LensOffset>>,
    /// The camera to check first.
    pub worst_camera: Option<usize>,
    /// `counts[a][b]`: views in which both cameras have points that took part; the diagonal holds the views of each.
    pub used_views: Vec<Vec<usize>>,
}

/// The losses of a camera or target, with their cause.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Losses {
    /// Number of observations whose points determine anything.
    pub n_observations: usize,
    /// Number of those that took no part because they contradict the rest.
    pub n_lost: usize,
    /// Number of points of the observations counted.
    pub n_points: usize,
    /// Number of those points that took no part.
    pub n_points_lost: usize,
    /// The likely cause; none where there is no fault.
    pub cause: Option<Cause>,
}

/// The reason why a camera or target does not fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Cause {
    /// The camera's intrinsics: focal length, principal point, distortion or image size.
    Intrinsics,
    /// Its intrinsics, or its images, are exchanged with those of another camera: with the two lenses exchanged, everything agrees.
    ExchangedIntrinsics {
        /// The other camera.
        with: usize,
    },
    /// Its observations fit by themselves and contradict those of the others: mislabelled views, unsynchronised or exchanged cameras, a target
    /// that moved.
    Contradiction,
    /// The target's points differ from its file (kind, rows and columns, labels), or the sigmas of its points are far too small: they fit by
    /// themselves in no camera.
    Target,
    /// The target's size contradicts the other lengths.
    Size,
    /// The stated sigmas of its points are too small, or all points have small errors.
    Noise,
    /// The camera itself fits, but the reference camera, in whose frame it is placed, does not.
    Reference,
}

/// Something that is said against a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RigWarning {
    /// A camera has a fault.
    Camera(usize, Cause),
    /// A target has a fault.
    Target(usize, Cause),
    /// Views contradict themselves, or all residuals are too large.
    Views,
    /// Residuals exceed the stated noise by this factor of standard deviations.
    Residuals(f64),
    /// Neighbouring points of the only view are displaced together; the factor by which that widens every standard deviation.
    Neighbours(f64),
    /// Views contradict each other by this factor of standard deviations more than their points do.
    ViewsApart(f64),
    /// Views agree that intrinsics are off; the largest standard deviation of a position with that, m.
    Lenses(f64),
    /// A target's size differs clearly from the stated one, and too little for a fault.
    Size(usize),
    /// An observation took no part.
    LeftOut(usize),
}

impl Warning for RigWarning {
    fn accounted(&self) -> Accounted {
        match self {
            RigWarning::Camera(_, cause) | RigWarning::Target(_, cause) => match cause {
                Cause::Intrinsics
                | Cause::ExchangedIntrinsics { .. }
                | Cause::Contradiction
                | Cause::Target
                | Cause::Size
                | Cause::Noise
                | Cause::Reference => Accounted::Status,
            },
            RigWarning::Views => Accounted::Status,
            RigWarning::Residuals(_) => Accounted::Parts(&[ErrorSource::Residuals]),
            RigWarning::Neighbours(_) => Accounted::Parts(&[ErrorSource::SharedInView]),
            RigWarning::ViewsApart(_) => {
                Accounted::Parts(&[ErrorSource::SharedInView, ErrorSource::SharedInBlock])
            }
            RigWarning::Lenses(_) => Accounted::Parts(&[ErrorSource::Lens]),
            RigWarning::Size(_) => Accounted::Parts(&[ErrorSource::Target]),
            RigWarning::LeftOut(_) => Accounted::Nothing,
        }
    }
}

impl RigSolution {
    /// Returns what is said against the rig; for one view, `n_views` = 1, displaced neighbours explain a contradiction.
    pub fn warnings(&self, n_views: usize) -> Vec<RigWarning> {
        let verdict = &self.verdict;
        let of = |all: &[Losses]| -> Vec<(usize, Cause)> {
            all.iter().enumerate().filter_map(|(i, losses)| Some((i, losses.cause?))).collect()
        };
        let mut warnings: Vec<RigWarning> =
            of(&verdict.cameras).into_iter().map(|(i, cause)| RigWarning::Camera(i, cause)).collect();
        warnings.extend(of(&verdict.targets).into_iter().map(|(i, cause)| RigWarning::Target(i, cause)));
        warnings.extend((verdict.is_inconsistent && warnings.is_empty()).then_some(RigWarning::Views));
        warnings.extend((1.0 < self.noise_scale).then(|| RigWarning::Residuals(self.noise_scale.sqrt())));
        let apart = self.view_scale.sqrt();
        warnings.extend((1.0 < apart).then_some(match n_views {
            1 => RigWarning::Neighbours(apart),
            _ => RigWarning::ViewsApart(apart),
        }));
        warnings.extend(self.lens_sigma_m.map(RigWarning::Lenses));
        let off = self.scales.iter().enumerate().filter(|(i, scale)| {
            scale.is_clearly_off() && verdict.targets.get(*i).is_some_and(Losses::is_ok)
        });
        warnings.extend(off.map(|(i, _)| RigWarning::Size(i)));
        let left_out = self.observations.iter().enumerate().filter(|(_, o)| o.rejected.is_some());
        warnings.extend(left_out.map(|(i, _)| RigWarning::LeftOut(i)));
        warnings
    }
}

impl Losses {
    /// Returns whether there is no fault.
    pub fn is_ok(&self) -> bool {
        self.cause.is_none()
    }

    /// Returns the share of the points counted that took no part.
    pub fn share_lost(&self) -> f64 {
        self.n_points_lost as f64 / self.n_points.max(1) as f64
    }

    /// Returns whether the losses are too large: whole observations are counted first, then the points of those kept, because a damaged image
    /// loses all of its own.
    fn is_too_much(&self, n_points_kept: usize) -> bool {
        let n_single = n_points_kept.saturating_sub(self.n_points - self.n_points_lost);
        // Lost points of either kind, converted to a number of observations.
        let n_worth = (self.share_lost() * self.n_observations as f64) as usize;
        loses_too_many(self.n_lost, self.n_observations)
            || loses_too_many(n_single, n_points_kept)
            || loses_too_many(n_worth, self.n_observations)
    }
}

/// The evidence for the verdict.
pub(super) struct Evidence<'a> {
    pub(super) layout: &'a Layout<'a>,
    pub(super) located_views: &'a LocatedViews,
    pub(super) adjusted: &'a Adjusted,
    pub(super) lenses: &'a [Option<LensScore>],
    pub(super) config: &'a RigConfig<'a>,
    pub(super) scales: &'a [TargetScale],
    pub(super) chi2: f64,
    pub(super) degrees_of_freedom: usize,
    pub(super) noise_scale: f64,
    /// The same, below 1 where the residuals prove the stated sigmas too large: lenses are tested against it.
    pub(super) measured_noise: f64,
    pub(super) view_scale: f64,
    /// All explanations, the most probable first.
    pub(super) explanations: &'a [Weighed<RigExplanation>],
    /// Covariance of the shared blocks without the share of what the explanations suppose.
    pub(super) unexplained: &'a DMatrix<f64>,
}

/// A camera whose intrinsics explain less than this share of what the worst one's explain is affected by the worst one.
const OWN_FAULT: f64 = 0.4;
/// Relative differences of targets' sizes below this are printing errors.
const SIZE_OFF: f64 = 0.005;
/// Variances by the scatter of views that are so many times the noise, if the errors are also so large over the focal length, are a contradiction:
/// errors four times as large as the noise, or twice as large and clearly larger than those of fair corners. On recordings with right files the
/// largest are 5.9 times and 0.0018 (31 times with sigmas of 0.16 px, which show that the webcams were not synchronised); with the images of one
/// webcam under the names of the next view 14 to 42 times and 0.0022 to 0.0053.
const APART: [(f64, f64); 2] = [(16.0, 0.002), (4.0, 0.003)];

impl Evidence<'_> {
    pub(super) fn verdict(&self) -> RigVerdict {
        let is_noisy = self.is_noisy();
        let lens_offsets = self.lens_offsets();
        let mut targets = self.targets(is_noisy);
        let mut cameras = self.cameras(&lens_offsets, &targets);
        let is_apart = self.views_are_apart();
        let worst_camera = self.worst(&cameras, &lens_offsets, is_noisy || is_apart);
        if let Some(worst) = worst_camera.filter(|_| is_noisy || is_apart) {
            cameras[worst].cause.get_or_insert(if is_noisy { Cause::Noise } else { Cause::Contradiction });
        }
        if !cameras[self.layout.reference].is_ok() {
            cameras.iter_mut().for_each(|c| _ = c.cause.get_or_insert(Cause::Reference));
        }
        let blames_cameras = cameras.iter().any(|c| c.cause == Some(Cause::Intrinsics));
        targets
            .iter_mut()
            .filter(|t| blames_cameras && t.cause == Some(Cause::Target))
            .for_each(|t| t.cause = None);
        let torn_views = self.torn_views();
        let is_torn = !torn_views.is_empty();
        let (contradicting_views, n_views) = self.views(torn_views);
        let is_inconsistent = is_noisy
            || cameras.iter().chain(&targets).any(|l| !l.is_ok())
            || is_torn
            || loses_too_many(contradicting_views.len(), n_views);
        RigVerdict {
            is_inconsistent,
            is_noisy,
            cameras,
            targets,
            contradicting_views,
            lens_offsets,
            worst_camera,
            used_views: self.used_views(),
        }
    }

    /// Returns whether the residuals are far above their sigmas and too large for any corners. Smaller ones show only that the sigmas were stated
    /// too small: the covariance has grown by as much. Under a loss that keeps wrong points, the variance of the good points replaces χ².
    fn is_noisy(&self) -> bool {
        let degrees_of_freedom = self.degrees_of_freedom;
        if self.noise_scale * self.mean_variance_over_focal() < NOISY_FOCAL * NOISY_FOCAL {
            return false;
        }
        match self.config.loss {
            Loss::Squared | Loss::Truncated { .. } => is_inconsistent(self.chi2, degrees_of_freedom),
            _ => is_inconsistent(self.noise_scale * degrees_of_freedom as f64, degrees_of_freedom),
        }
    }

    /// Returns whether views contradict each other by far more than the noise explains, as stated or as measured where that is less.
    fn views_are_apart(&self) -> bool {
        let apart = self.noise_scale * self.view_scale;
        let (noise, squared) = (self.measured_noise.min(1.0), apart * self.mean_variance_over_focal());
        let are_far =
            |(times, of_focal): (f64, f64)| times * noise <= apart && of_focal * of_focal <= squared;
        1.0 < self.view_scale && APART.into_iter().any(are_far)
    }

    /// Returns the mean stated variance of the points used, along one axis of the image, over the square of the focal length.
    fn mean_variance_over_focal(&self) -> f64 {
        let cameras = &self.layout.problem.cameras;
        let focal_px = |camera: &Camera| camera.project_with_jacobian(&Point::z()).map(|p| p.1[(0, 0)].abs());
        let (mut sum, mut n) = (0.0, 0.0);
        for (i, observation) in self.layout.observations.iter().enumerate() {
            let Some(focal_px) = focal_px(&cameras[observation.camera]) else { continue };
            let used =
                observation.seen.iter().zip(&self.adjusted.parts.is_used[i]).filter(|(_, used)| **used);
            for (c, _) in used {
                let [uu, _, vv] = c.pixel_covariance();
                sum += 0.5 * (uu + vv) / (focal_px * focal_px);
                n += 1.0;
            }
        }
        sum / f64::max(n, 1.0)
    }

    /// Returns the lens offsets at the minimum of a sum of squares; none under other losses, where wrong points would bias the score of a lens.
    fn lens_offsets(&self) -> Vec<Option<LensOffset>> {
        match self.config.loss {
            Loss::Squared | Loss::Truncated { .. } => {
                let offset = |(camera, lens): (usize, &Option<LensScore>)| {
                    let lens = lens.as_ref()?;
                    lens.offset(self.measured_noise, &self.stated_of_lens(camera, lens.reach()))
                };
                self.lenses.iter().enumerate().map(offset).collect()
            }
            _ => vec![None; self.layout.problem.cameras.len()],
        }
    }

    /// Returns the stated standard deviations of a camera's intrinsics; zeros where they are exact.
    fn stated_of_lens(&self, camera: usize, reach: f64) -> [f64; 3] {
        let covariance = self.config.intrinsics.get(camera).and_then(Option::as_ref);
        covariance.map_or([0.0; 3], |c| stated(&self.layout.problem.cameras[camera], c, reach))
    }

    /// Returns whether a lens or size is a fault of the answer: it is off by more than those of good files are, or a tolerance is stated and no
    /// other explanation is more probable; and it moves a camera by more than its covariance or the tolerance. docs/math/explanations.md eq. (7). Where
    /// targets have places of their own, as on a map, these are off too, and no motion of a camera is asked for.
    fn is_fault(&self, is_off: bool, what: RigExplanation) -> bool {
        let tolerance = &self.config.tolerance;
        let is_best = self.explanations.first().is_some_and(|best| best.what == what);
        let has_places = self.layout.graph.block_of_target.iter().any(Option::is_some);
        if is_off && has_places && !tolerance.is_stated() {
            return true;
        }
        let Some(found) = self.explanations.iter().find(|one| one.what == what) else { return is_off };
        let exceeds = |(camera, motion): (usize, &Vector6)| {
            let block = self.layout.graph.block_of_camera[camera];
            block.is_some_and(|b| {
                let covariance = self.unexplained.fixed_view::<6, 6>(6 * b, 6 * b).into_owned();
                tolerance.is_exceeded(motion, &covariance)
            })
        };
        (is_off || is_best && tolerance.is_stated()) && found.motions.iter().enumerate().any(exceeds)
    }

    fn cameras(&self, lens_offsets: &[Option<LensOffset>], targets: &[Losses]) -> Vec<Losses> {
        let explained = |o: &Option<LensOffset>| o.map_or(0.0, |o| o.explained_chi2);
        let most = lens_offsets.iter().map(explained).fold(0.0, f64::max);
        let camera = |(c, offset): (usize, &Option<LensOffset>)| {
            let (mut losses, n_kept) = self.losses(self.of(|s| s.camera == c));
            let is_own = OWN_FAULT * most <= explained(offset);
            let is_off = is_own && offset.is_some_and(|o| o.is_off());
            let is_off = self.is_fault(is_off, RigExplanation::Lens { camera: c });
            losses.cause = match (is_off, losses.is_too_much(n_kept)) {
                (true, _) => Some(Cause::Intrinsics),
                (false, true) => Some(self.cause_of_loss(c, targets)),
                (false, false) => None,
            };
            losses
        };
        lens_offsets.iter().enumerate().map(camera).collect()
    }

    /// Returns the cause of lost observations: those that fit no pose of their own camera are the lens's fault, or the target's where the target
    /// fits no camera.
    fn cause_of_loss(&self, camera: usize, targets: &[Losses]) -> Cause {
        let lost = self.of(|s| s.camera == camera).filter(|i| 0 < self.n_lost_points(*i));
        let (fit, unfit): (Vec<usize>, Vec<usize>) = lost.partition(|i| self.fits_alone(*i));
        if unfit.len() <= fit.len() {
            return Cause::Contradiction;
        }
        let is_target = |i: &usize| targets[self.layout.observations[*i].target].cause == Some(Cause::Target);
        if unfit.iter().all(is_target) { Cause::Target } else { Cause::Intrinsics }
    }

    fn fits_alone(&self, observation: usize) -> bool {
        let seen = &self.layout.observations[observation].seen;
        fits_alone(&self.located_views[observation], seen, self.layout.camera(observation))
    }

    fn targets(&self, is_noisy: bool) -> Vec<Losses> {
        let target = |t: usize| {
            let (mut losses, n_kept) = self.losses(self.of(|s| s.target == t));
            let scale = &self.scales[t];
            let is_wrong_size = SIZE_OFF < (scale.ratio - 1.0).abs() - 4.0 * scale.sigma;
            let is_wrong_size = self.is_fault(is_wrong_size, RigExplanation::Size { target: t });
            losses.cause =
                match ((is_noisy || losses.is_too_much(n_kept)) && self.fits_no_camera(t), is_wrong_size) {
                    (true, _) => Some(Cause::Target),
                    (false, true) => Some(Cause::Size),
                    (false, false) => None,
                };
            losses
        };
        (0..self.layout.first_target.len()).map(target).collect()
    }

    /// Returns whether most of the target's observations by each of at least two cameras fit no pose by themselves.
    fn fits_no_camera(&self, target: usize) -> bool {
        let of_camera = |camera: usize| {
            let own: Vec<usize> = self.of(|s| s.camera == camera && s.target == target).collect();
            let unfit = own.iter().filter(|i| !self.fits_alone(**i)).count();
            (!own.is_empty()).then_some(own.len() < 2 * unfit)
        };
        let cameras: Vec<bool> = (0..self.layout.problem.cameras.len()).filter_map(of_camera).collect();
        1 < cameras.len() && cameras.iter().all(|unfit| *unfit)
    }

    /// Returns the indices of the observations of a kind, in canonical order.
    fn of(&self, is_one: impl Fn(&Observation) -> bool) -> impl Iterator<Item = usize> {
        let observations = self.layout.observations.iter().enumerate();
        observations.filter(move |(_, s)| is_one(s)).map(|(i, _)| i)
    }

    fn n_lost_points(&self, observation: usize) -> usize {
        self.layout.observations[observation].seen.len() - self.adjusted.parts.n_used(observation)
    }

    /// Returns the losses over some observations, and the number of points of those that were kept. An observation that determines nothing is
    /// not counted.
    fn losses(&self, among: impl Iterator<Item = usize>) -> (Losses, usize) {
        let (mut losses, mut n_points_kept) = (Losses::default(), 0);
        for i in among {
            let n_points = self.layout.observations[i].seen.len();
            match self.adjusted.parts.rejected[i] {
                Some(RejectedObservation::Undetermined(_)) => continue,
                Some(_) => losses.n_lost += 1,
                None => n_points_kept += n_points,
            }
            losses.n_observations += 1;
            losses.n_points += n_points;
            losses.n_points_lost += self.n_lost_points(i);
        }
        (losses, n_points_kept)
    }

    /// Returns the contradicting views with those that lose too many of their observations, and the number of views.
    fn views(&self, mut contradicting: Vec<usize>) -> (Vec<usize>, usize) {
        let mut n_views = 0;
        let mut at = 0;
        for together in self.layout.observations.chunk_by(|a, b| a.view == b.view) {
            let (losses, _) = self.losses(at..at + together.len());
            at += together.len();
            n_views += usize::from(0 < losses.n_observations);
            if loses_too_many(losses.n_lost, losses.n_observations) {
                contradicting.push(together[0].view);
            }
        }
        contradicting.sort_unstable();
        contradicting.dedup();
        (contradicting, n_views)
    }

    /// Returns the views whose body several cameras see and at most one keeps, where one of these cameras shares fewer other views than such ones,
    /// or fewer than two. Two cameras that disagree may lose such views in turn, so that neither of them loses many.
    fn torn_views(&self) -> Vec<usize> {
        let mut of_cameras = vec![(Vec::new(), 0); self.layout.problem.cameras.len()]; // Torn views, and the number of others.
        let mut at = 0;
        for of_body in self.layout.graph.links.chunk_by(|a, b| a.body == b.body) {
            let mut cameras = Vec::new(); // Each with whether it keeps an observation.
            for of_camera in of_body.chunk_by(|a, b| a.camera == b.camera) {
                let (losses, _) = self.losses(at..at + of_camera.len());
                at += of_camera.len();
                if 0 < losses.n_observations {
                    cameras.push((of_camera[0].camera, losses.n_lost < losses.n_observations));
                }
            }
            let is_torn = cameras.iter().filter(|(_, keeps)| *keeps).count() < 2;
            for (camera, _) in cameras.iter().filter(|_| 1 < cameras.len()) {
                match is_torn {
                    true => of_cameras[*camera].0.push(self.layout.observations[at - 1].view),
                    false => of_cameras[*camera].1 += 1,
                }
            }
        }
        of_cameras.retain(|(torn, n_others)| *n_others < torn.len().max(2));
        of_cameras.into_iter().flat_map(|(torn, _)| torn).collect()
    }

    /// Returns the blamed camera whose intrinsics explain most, else the one that lost most; where only noise is at fault, the one with the
    /// largest χ² for each point.
    fn worst(&self, cameras: &[Losses], lens: &[Option<LensOffset>], is_noisy: bool) -> Option<usize> {
        let of_lens = |c: usize| match cameras[c].cause {
            Some(Cause::Intrinsics) => lens[c].filter(LensOffset::is_off).map_or(0.0, |o| o.explained_chi2),
            _ => 0.0,
        };
        let by = |a: &usize, b: &usize| {
            let key = |c: usize| (of_lens(c), cameras[c].share_lost());
            key(*a).partial_cmp(&key(*b)).unwrap_or(core::cmp::Ordering::Equal)
        };
        let blamed = (0..cameras.len()).filter(|c| !cameras[*c].is_ok()).max_by(by);
        let noisiest = || (0..cameras.len()).max_by(|a, b| self.chi2_of(*a).total_cmp(&self.chi2_of(*b)));
        blamed.or_else(|| noisiest().filter(|_| is_noisy))
    }

    /// Returns χ² for each point used of a camera.
    fn chi2_of(&self, camera: usize) -> f64 {
        let (mut sum, mut n) = (0.0, 0.0);
        for i in self.of(|s| s.camera == camera) {
            let used = self.adjusted.residuals[i].points.iter().zip(&self.adjusted.parts.is_used[i]);
            for (_, squared) in used.filter(|(_, u)| **u).filter_map(|(p, _)| p.as_ref()) {
                sum += squared;
                n += 1.0;
            }
        }
        sum / f64::max(n, 1.0)
    }

    fn used_views(&self) -> Vec<Vec<usize>> {
        let body_of = &self.layout.problem.body_of_target;
        let observations = self.layout.observations.iter().enumerate();
        let used = observations.filter(|(i, _)| 0 < self.adjusted.parts.n_used(*i));
        let mut used: Vec<_> = used.map(|(_, s)| (s.view, body_of[s.target], s.camera)).collect();
        used.sort_unstable();
        used.dedup();
        counts(&used, self.layout.problem.cameras.len())
    }
}
