//! Lenses adjusted together with the poses of a rig: docs/math/rig.md section 15.
//!
//! Poses are at their minimum under given lenses, so that a cost of the lenses alone remains (variable projection). Its Gauss–Newton step is that
//! of lenses and poses together, because the poses' gradient is zero:
//!
//! ```text
//!   θ = θ₀ + B z,   K = JᵀWPB,   S = BᵀPᵀWPB − KᵀH⁻¹K + ν Σ aaᵀ      S δ = BᵀPᵀWr + ν Σ a (b − aᵀz)       eqs. (27)–(29)
//!   Σ_z = ν S⁻¹,   Σ_poses = ν H⁻¹ + D Σ_z Dᵀ,   D = −H⁻¹K                                                  eq. (30)
//!   P  derivative of the pixels by the parameters θ   ·   a, b  what is known of z: b − aᵀz has variance 1   ·   ν  variance of the noise
//! ```

use super::adjust::{Adjusted, adjust, keeps_minimum};
use super::answer::answer;
use super::exchanged::seen_through;
use super::layout::Layout;
use super::sighted::{LocatedViews, poses_of_observations};
use super::start::start;
use super::uncertain_lens::{self, ByParameters, Free, by_parameters};
use super::{Cause, Observation, RigConfig, RigProblem, RigSolution};
use crate::least_squares::rig::{Common, RigPoses};
use crate::locate::consistency::is_inconsistent;
use crate::locate::loss::Loss;
use crate::multiview::intrinsics::prior_rows;
use crate::{Camera, Error};
use nalgebra::{DMatrix, DVector};

/// Largest number of evaluations, each a rig under other lenses.
const MAX_EVALUATIONS: usize = 40;
/// The loop ends where a step promises less than this of χ², in units of the noise: a thousandth of a standard deviation.
const SETTLED: f64 = 1e-6;
/// The first damping after a step that failed.
const FIRST_DAMPING: f64 = 1e-3;
/// A parameter with less than this share of the largest stated variance is exact.
const EXACT: f64 = 1e-14;

/// A rig whose lenses were adjusted with it.
#[derive(Debug, Clone, PartialEq)]
pub struct RigWithLenses {
    /// The rig under the adjusted lenses; the lenses' uncertainty is in every covariance.
    pub solution: RigSolution,
    /// The adjusted lenses, in the order of the cameras.
    pub lenses: Vec<AdjustedLens>,
    /// The observations with their bearings under the adjusted lenses.
    pub observations: Vec<Observation>,
    /// Covariance of all cameras' poses (as `RigSolution::joint_covariance`, 6 rows each), followed by the parameters of each adjusted lens in
    /// the order of `Camera::parameters`.
    pub joint_covariance: DMatrix<f64>,
}

/// A lens after the adjustment.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjustedLens {
    /// The index of the camera.
    pub camera: usize,
    /// The adjusted intrinsics.
    pub intrinsics: Camera,
    /// Their covariance, in the order of `Camera::parameters`.
    pub covariance: DMatrix<f64>,
    /// Squared distance from the stated intrinsics in units of what their covariance and the rig's allow, and its degrees of freedom; none where
    /// no covariance was stated.
    pub from_stated: Option<(f64, usize)>,
}

/// Solves for the poses of a rig and the lenses of its `free` cameras together.
///
/// What is known of a free lens beforehand is its covariance in `config.intrinsics`; without one, that pixels are nearly square, the principal
/// point is near the centre, and the distortion is bounded. `problem.cameras` are the initial values, with the lens model.
///
/// # Errors
/// Those of `solve_rig`; `InvalidSetting` under a loss that keeps wrong points, or for a free camera that does not exist.
pub fn solve_rig_and_lenses(
    problem: &RigProblem,
    config: &RigConfig,
    free: &[usize],
) -> Result<RigWithLenses, Error> {
    uncertain_lens::check(config.intrinsics, problem.cameras)?;
    if let Some(index) = free.iter().find(|camera| problem.cameras.len() <= **camera) {
        let needed = "the index of a camera";
        return Err(Error::InvalidSetting { setting: "adjusted lens", seen: *index as f64, needed });
    }
    if !keeps_minimum(config.loss) {
        let needed = "the squared or the truncated loss where lenses are adjusted";
        return Err(Error::InvalidSetting { setting: "loss", seen: f64::NAN, needed });
    }
    let mut free = free.to_vec();
    free.sort_unstable();
    free.dedup();
    let config = &RigConfig { joint_covariance: true, ..*config };
    let mut search = Search::new(problem, config, &free)?;
    search.settle()?;
    let first = search.answer()?;
    search.noise = (first.noise_scale * first.view_scale).max(1.0);
    search.settle()?;
    let solution = search.answer()?;
    search.finish(solution)
}

/// A free lens, and what is known of it.
struct Lens {
    camera: usize,
    /// θ₀ and B.
    origin: DVector<f64>,
    basis: DMatrix<f64>,
    /// a and b of every known value.
    known: Vec<(DVector<f64>, f64)>,
    is_stated: bool,
}

impl Lens {
    /// `own` is the information of the pixels on each parameter, with all else held.
    fn new(camera: usize, lens: &Camera, stated: Option<&DMatrix<f64>>, own: &DMatrix<f64>) -> Self {
        let origin = parameters(lens);
        let n = origin.len();
        if let Some(covariance) = stated {
            let eigen = symmetric(covariance).symmetric_eigen();
            let largest = eigen.eigenvalues.amax();
            let uncertain: Vec<usize> = (0..n).filter(|i| EXACT * largest < eigen.eigenvalues[*i]).collect();
            let basis = DMatrix::from_fn(n, uncertain.len(), |i, k| {
                eigen.eigenvectors[(i, uncertain[k])] * eigen.eigenvalues[uncertain[k]].sqrt()
            });
            let unit = |k: usize| DVector::from_fn(uncertain.len(), |i, _| f64::from(u8::from(i == k)));
            let known = (0..uncertain.len()).map(|k| (unit(k), 0.0)).collect();
            return Lens { camera, origin, basis, known, is_stated: true };
        }
        // Parameters differ by many orders of magnitude: each has the unit in which the pixels know it.
        let unit = |i: usize| if 0.0 < own[(i, i)] { own[(i, i)].sqrt().recip() } else { 1.0 };
        let basis = DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| unit(i)));
        let known =
            prior_rows(lens).into_iter().map(|(a, b)| (basis.tr_mul(&a), b - a.dot(&origin))).collect();
        Lens { camera, origin, basis, known, is_stated: false }
    }

    fn n(&self) -> usize {
        self.basis.ncols()
    }
}

fn symmetric(m: &DMatrix<f64>) -> DMatrix<f64> {
    (m + m.transpose()) * 0.5
}

fn parameters(lens: &Camera) -> DVector<f64> {
    DVector::from_iterator(lens.parameters().len(), lens.parameters().iter().map(|(_, value)| *value))
}

/// The rig under the lenses of a moment.
struct State {
    z: DVector<f64>,
    cameras: Vec<Camera>,
    observations: Vec<Observation>,
    located_views: LocatedViews,
    adjusted: Adjusted,
}

impl State {
    fn new(
        problem: &RigProblem,
        config: &RigConfig,
        (z, cameras): (DVector<f64>, Vec<Camera>),
        from: Option<&RigPoses>,
    ) -> Result<Self, Error> {
        let observations = problem.observations.iter().map(|s| seen_through(s, &cameras[s.camera]));
        let observations: Option<Vec<Observation>> = observations.collect();
        let observations = observations.ok_or(Error::NotConverged { steps: 0 })?;
        let now = RigProblem { cameras: &cameras, observations: &observations, ..*problem };
        let layout = Layout::new(&now, config)?;
        let located_views = poses_of_observations(&layout);
        let places = match from {
            Some(places) => places.clone(),
            None => start(&layout, &located_views)?,
        };
        let adjusted = adjust(&layout, &located_views, places, config)?;
        Ok(State { z, cameras, observations, located_views, adjusted })
    }

    fn problem<'a>(&'a self, stated: &RigProblem<'a>) -> RigProblem<'a> {
        RigProblem { cameras: &self.cameras, observations: &self.observations, ..*stated }
    }

    /// Returns χ² of all points, each with at most `most`.
    fn chi2(&self, most: f64) -> f64 {
        let points = self.adjusted.residuals.iter().flat_map(|r| &r.points);
        points.map(|point| point.as_ref().map_or(most, |p| p.1.min(most))).sum()
    }
}

/// The information of the pixels on the lenses, in the coordinates z, with all poses free.
struct Reduced {
    information: DMatrix<f64>,
    pull: DVector<f64>,
    /// H⁻¹K, a column for each coordinate of z.
    following: Vec<Common>,
}

struct Search<'a> {
    problem: &'a RigProblem<'a>,
    config: &'a RigConfig<'a>,
    lenses: Vec<Lens>,
    state: State,
    /// The most that a point adds to χ².
    most: f64,
    noise: f64,
    evaluations: usize,
}

impl<'a> Search<'a> {
    fn new(problem: &'a RigProblem<'a>, config: &'a RigConfig<'a>, free: &[usize]) -> Result<Self, Error> {
        let state = State::new(problem, config, (DVector::zeros(0), problem.cameras.to_vec()), None)?;
        let now = state.problem(problem);
        let layout = Layout::new(&now, config)?;
        let lens = |camera: &usize| {
            let own = by_parameters(*camera, &layout, &state.adjusted).own;
            let stated = config.intrinsics.get(*camera).and_then(Option::as_ref);
            Lens::new(*camera, &problem.cameras[*camera], stated, &own)
        };
        let lenses: Vec<Lens> = free.iter().map(lens).collect();
        let most = match config.loss {
            Loss::Truncated { sigmas } => sigmas * sigmas * state.adjusted.variance,
            _ => f64::MAX.sqrt(),
        };
        let z = DVector::zeros(lenses.iter().map(Lens::n).sum());
        Ok(Search { problem, config, lenses, state: State { z, ..state }, most, noise: 1.0, evaluations: 1 })
    }

    /// Returns every lens with the index of its first coordinate.
    fn placed(&self) -> impl Iterator<Item = (usize, &Lens)> {
        self.lenses.iter().scan(0, |at, lens| {
            let begin = *at;
            *at += lens.n();
            Some((begin, lens))
        })
    }

    /// Returns b − aᵀz for everything known, with the first coordinate of a.
    fn known<'s>(&'s self, z: &'s DVector<f64>) -> impl Iterator<Item = (usize, &'s DVector<f64>, f64)> {
        self.placed().flat_map(move |(begin, lens)| {
            lens.known.iter().map(move |(a, b)| (begin, a, b - a.dot(&z.rows(begin, lens.n()))))
        })
    }

    fn cost(&self, state: &State) -> f64 {
        let known: f64 = self.known(&state.z).map(|(_, _, residual)| residual * residual).sum();
        state.chi2(self.most) + self.noise * known
    }

    /// Returns the cameras under other coordinates; none where a lens cannot have them.
    fn cameras(&self, z: &DVector<f64>) -> Option<Vec<Camera>> {
        let mut cameras = self.problem.cameras.to_vec();
        for (begin, lens) in self.placed() {
            let values = &lens.origin + &lens.basis * z.rows(begin, lens.n());
            cameras[lens.camera] = cameras[lens.camera].with_parameters(values.as_slice()).ok()?;
        }
        Some(cameras)
    }

    fn reduced(&self) -> Result<Reduced, Error> {
        let now = self.state.problem(self.problem);
        let layout = Layout::new(&now, self.config)?;
        let adjusted = &self.state.adjusted;
        let eliminated = adjusted.equations.eliminated(0.0);
        let eliminated = eliminated.ok_or(Error::NotConverged { steps: self.evaluations })?;
        let n = self.state.z.len();
        let (mut information, mut pull) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let (mut couplings, mut following) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for (begin, lens) in self.placed() {
            let ByParameters { common, own, pull: of_lens } = by_parameters(lens.camera, &layout, adjusted);
            let m = lens.n();
            information.view_mut((begin, begin), (m, m)).copy_from(&(lens.basis.tr_mul(&own) * &lens.basis));
            pull.rows_mut(begin, m).copy_from(&lens.basis.tr_mul(&of_lens));
            for column in lens.basis.column_iter() {
                let coupling = Common::weighted(&common, column.iter().copied(), &adjusted.graph);
                following.push(adjusted.equations.following(&eliminated, &coupling, true));
                couplings.push(coupling);
            }
        }
        let lost = DMatrix::from_fn(n, n, |i, j| couplings[i].dot(&following[j]));
        information -= symmetric(&lost);
        Ok(Reduced { information, pull, following })
    }

    /// Adds what is known to the information of the pixels.
    fn with_known(&self, reduced: &Reduced) -> (DMatrix<f64>, DVector<f64>) {
        let (mut information, mut pull) = (reduced.information.clone(), reduced.pull.clone());
        for (begin, a, residual) in self.known(&self.state.z) {
            let mut block = information.view_mut((begin, begin), (a.len(), a.len()));
            block += a * a.transpose() * self.noise;
            let mut rows = pull.rows_mut(begin, a.len());
            rows += a * (self.noise * residual);
        }
        (information, pull)
    }

    /// Steps until nothing is left to gain.
    fn settle(&mut self) -> Result<(), Error> {
        let mut damping = 0.0;
        let mut cost = self.cost(&self.state);
        let (mut information, mut pull) = self.with_known(&self.reduced()?);
        while self.evaluations < MAX_EVALUATIONS {
            let mut damped = information.clone();
            (0..damped.nrows()).for_each(|i| damped[(i, i)] *= 1.0 + damping);
            if let Some(factor) = damped.cholesky() {
                let step = factor.solve(&pull);
                if step.dot(&pull) <= SETTLED * self.noise {
                    return Ok(());
                }
                self.evaluations += 1;
                if let Some(state) = self.moved(&step)
                    && self.cost(&state) < cost
                {
                    (cost, damping) = (self.cost(&state), 0.1 * damping);
                    self.state = state;
                    (information, pull) = self.with_known(&self.reduced()?);
                    continue;
                }
                // The points that take part change from state to state: what is left of such a step is their doing.
                if step.dot(&pull) <= 1e3 * SETTLED * self.noise {
                    return Ok(());
                }
            }
            damping = f64::max(10.0 * damping, FIRST_DAMPING);
        }
        Err(Error::NotConverged { steps: self.evaluations })
    }

    fn moved(&self, step: &DVector<f64>) -> Option<State> {
        let z = &self.state.z + step;
        let cameras = self.cameras(&z)?;
        State::new(self.problem, self.config, (z, cameras), Some(&self.state.adjusted.places)).ok()
    }

    /// Returns Σ_z, and the number of coordinates that the pixels determine.
    fn covariance(&self, reduced: &Reduced) -> Option<(DMatrix<f64>, f64)> {
        let inverse = self.with_known(reduced).0.cholesky()?.inverse();
        let determined = (&reduced.information * &inverse).trace();
        Some((inverse * self.noise, determined))
    }

    /// Returns B of all lenses together.
    fn basis(&self) -> DMatrix<f64> {
        let n_parameters = self.lenses.iter().map(|lens| lens.origin.len()).sum();
        let mut basis = DMatrix::zeros(n_parameters, self.state.z.len());
        let mut row = 0;
        for (begin, lens) in self.placed() {
            basis.view_mut((row, begin), lens.basis.shape()).copy_from(&lens.basis);
            row += lens.origin.len();
        }
        basis
    }

    /// Returns the answer under the present lenses.
    fn answer(&self) -> Result<RigSolution, Error> {
        let undetermined = || Error::NotConverged { steps: self.evaluations };
        let (of_z, determined) = self.covariance(&self.reduced()?).ok_or_else(undetermined)?;
        let basis = self.basis();
        let covariance = symmetric(&(&basis * of_z * basis.transpose()));
        let mut intrinsics = self.config.intrinsics.to_vec();
        intrinsics.resize(self.problem.cameras.len(), None);
        let mut row = 0;
        for lens in &self.lenses {
            let n = lens.origin.len();
            intrinsics[lens.camera] = Some(covariance.view((row, row), (n, n)).into_owned());
            row += n;
        }
        let cameras = self.lenses.iter().map(|lens| lens.camera).collect();
        let free = Free { cameras, covariance, n_determined: determined.round() as usize };
        let now = self.state.problem(self.problem);
        let layout = Layout::new(&now, self.config)?;
        let config = RigConfig { intrinsics: &intrinsics, ..*self.config };
        answer(&layout, &self.state.located_views, self.state.adjusted.clone(), &config, Some(&free))
    }

    /// Returns the distance of a lens from what was stated of it, eq. (31); none where nothing was.
    fn distance_from_stated(
        &self,
        (begin, lens): (usize, &Lens),
        of_z: &DMatrix<f64>,
    ) -> Option<(f64, usize)> {
        let m = lens.n();
        if !lens.is_stated || m == 0 {
            return None; // Exact parameters do not move.
        }
        let z = self.state.z.rows(begin, m);
        let moved = DMatrix::identity(m, m) - of_z.view((begin, begin), (m, m));
        let eigen = symmetric(&moved).symmetric_eigen();
        // What the pixels do not show does not move.
        let shown: Vec<usize> = (0..m).filter(|i| 1e-6 < eigen.eigenvalues[*i]).collect();
        let along = |i: &usize| eigen.eigenvectors.column(*i).dot(&z).powi(2) / eigen.eigenvalues[*i];
        Some((shown.iter().map(along).sum(), shown.len()))
    }

    fn finish(&self, mut solution: RigSolution) -> Result<RigWithLenses, Error> {
        let reduced = self.reduced()?;
        let undetermined = || Error::NotConverged { steps: self.evaluations };
        let (of_z, _) = self.covariance(&reduced).ok_or_else(undetermined)?;
        let basis = self.basis();
        let of_lenses = symmetric(&(&basis * &of_z * basis.transpose()));
        let poses = solution.joint_covariance.take().unwrap_or_default();
        let (n, n_lenses) = (poses.nrows(), of_lenses.nrows());
        let mut joint = DMatrix::zeros(n + n_lenses, n + n_lenses);
        joint.view_mut((0, 0), (n, n)).copy_from(&poses);
        joint.view_mut((n, n), (n_lenses, n_lenses)).copy_from(&of_lenses);
        let mut by_z = DMatrix::zeros(n, of_z.nrows());
        for (camera, block) in self.state.adjusted.graph.block_of_camera.iter().enumerate() {
            let Some(block) = block else { continue };
            for (k, following) in reduced.following.iter().enumerate() {
                by_z.view_mut((6 * camera, k), (6, 1)).copy_from(&-following.shared.rows(6 * block, 6));
            }
        }
        let between = by_z * &of_z * basis.transpose();
        joint.view_mut((0, n), (n, n_lenses)).copy_from(&between);
        joint.view_mut((n, 0), (n_lenses, n)).copy_from(&between.transpose());
        solution.joint_covariance = Some(poses);
        let mut row = 0;
        let lens = |(begin, lens): (usize, &Lens)| {
            let size = lens.origin.len();
            let covariance = of_lenses.view((row, row), (size, size)).into_owned();
            row += size;
            AdjustedLens {
                camera: lens.camera,
                intrinsics: self.state.cameras[lens.camera].clone(),
                covariance,
                from_stated: self.distance_from_stated((begin, lens), &of_z),
            }
        };
        let lenses: Vec<AdjustedLens> = self.placed().map(lens).collect();
        let contradicts =
            |lens: &&AdjustedLens| lens.from_stated.is_some_and(|(chi2, n)| is_inconsistent(chi2, n));
        let furthest = lenses.iter().filter(contradicts).max_by(|a, b| {
            let of = |lens: &AdjustedLens| lens.from_stated.map_or(0.0, |(chi2, n)| chi2 / n as f64);
            of(a).total_cmp(&of(b))
        });
        if let Some(lens) = furthest {
            solution.verdict.is_inconsistent = true;
            solution.verdict.cameras[lens.camera].cause.get_or_insert(Cause::Intrinsics);
            solution.verdict.worst_camera.get_or_insert(lens.camera);
        }
        let observations = self.state.observations.clone();
        Ok(RigWithLenses { solution, lenses, observations, joint_covariance: joint })
    }
}
