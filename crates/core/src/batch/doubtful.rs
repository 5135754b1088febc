//! Solves views of which the lanes know the closed form's minima, but cannot exclude another one, or whose likelihood is bent: `search`
//! continues from these minima, with the remaining start and those of P3P, and of SQPnP where nothing fits, for many views side by side.

use super::starts::{End, Start, refine_all};
use super::{Answer, Views, alone, correspondences};
use crate::camera::CameraMatrix;
use crate::locate::Method;
use crate::locate::answer::conclude;
use crate::locate::choose::{Minima, Minimum, insert};
use crate::locate::classify::{Allowed, View};
use crate::locate::consistency::is_unlikely;
use crate::locate::curvature;
use crate::locate::minima::Found;
use crate::locate::multi_start::{is_in_doubt, of_method, three_of};
use crate::locate::problem::Problem;
use crate::locate::refine::refine_against;
use crate::solve::Candidates;
use crate::solve::configuration::Geometry;
use crate::solve::line_plus_one::Weakness;
use crate::solve::sqpnp::sqpnp;
use crate::{Camera, Correspondence, Pose};
use arrayvec::ArrayVec;

/// A view with its known minima.
pub(super) struct Doubtful {
    pub view: usize,
    pub geometry: Geometry,
    /// The minima of the closed form's candidates, lowest first.
    pub minima: ArrayVec<Minimum, 2>,
    /// The remaining start, where both that were tried led to one minimum.
    pub left_over: Option<Pose>,
    /// Whether the likelihood at the lowest is certainly not bent.
    pub is_straight: bool,
    /// Whether the closed form reports no weakness.
    pub is_strong: bool,
}

/// For four points.
pub(super) const DEGREES_OF_FREEDOM: usize = 2;
/// Number of views processed together, so that their data stay in the cache.
const AT_ONCE: usize = 32;

/// Answers every doubtful view. Returns the number that took the single path from the beginning.
pub(super) fn settle(views: &Views, doubtful: &[Doubtful], take: &mut impl FnMut(usize, Answer)) -> usize {
    let mut singly = 0;
    for some in doubtful.chunks(AT_ONCE) {
        let mut cases = Vec::with_capacity(some.len());
        for known in some {
            match Case::of(views, known) {
                Some(case) => cases.push(case),
                None => {
                    take(known.view, alone(views, known.view));
                    singly += 1;
                }
            }
        }
        let starts: Vec<Start<4>> = cases.iter().flat_map(Case::starts).collect();
        let mut ends = &refine_all(&starts)[..];
        for case in &cases {
            let (own, others) = ends.split_at(case.starts.len());
            take(case.known.view, case.answer(own));
            ends = others;
        }
    }
    singly
}

/// A doubtful view with its further starts: the remaining one, then SQPnP's poses where nothing fits, then P3P's.
struct Case<'a> {
    known: &'a Doubtful,
    camera: &'a Camera,
    matrix: &'a CameraMatrix,
    seen: [Correspondence; 4],
    starts: ArrayVec<Pose, 9>,
    n_of_sqpnp: usize,
    weakness: Option<Weakness>,
}

impl<'a> Case<'a> {
    /// Returns `None` where no minimum is known.
    fn of(views: &Views<'a>, known: &'a Doubtful) -> Option<Self> {
        let (seen, _) = correspondences(views, known.view).ok()?;
        let (camera, matrix) = views.pinhole(known.view)?;
        let fits = !is_unlikely(known.minima.first()?.chi2, DEGREES_OF_FREEDOM);
        let problem = &Problem::new(&seen, camera);
        let weakness = match known.is_strong {
            true => None,
            false => of_method(Method::LinePlusOne, &known.geometry.configuration, problem).1,
        };
        let of_sqpnp = if fits { Candidates::new() } else { sqpnp(&seen) };
        let n_of_sqpnp = of_sqpnp.len();
        let starts = known.left_over.into_iter().chain(of_sqpnp).chain(three_of(&seen)).collect();
        Some(Case { known, camera, matrix, seen, starts, n_of_sqpnp, weakness })
    }

    fn lowest_chi2(&self) -> f64 {
        self.known.minima.first().map_or(f64::INFINITY, |m| m.chi2)
    }

    fn starts(&self) -> impl Iterator<Item = Start<'_, 4>> {
        self.starts.iter().map(|start| Start {
            seen: &self.seen,
            matrix: self.matrix,
            cam_from_target: *start,
            alternative_chi2: self.lowest_chi2(),
        })
    }

    /// Concludes as `search` and `locate` do; `ends` are those of this view's starts.
    fn answer(&self, ends: &[End]) -> Answer {
        let problem = &Problem::new(&self.seen, self.camera);
        let mut found = Found::default();
        let minima = &mut found.minima;
        minima.extend(self.known.minima.iter().copied());
        let (starts, n_left_over) = (&self.starts, usize::from(self.known.left_over.is_some()));
        self.follow(&starts[..n_left_over], &ends[..n_left_over], problem, minima);
        let is_known = minima.first().map(|m| m.chi2) == Some(self.lowest_chi2());
        let straight_chi2 = minima.first().map(|m| m.chi2);
        let is_bent = !(is_known && self.known.is_straight)
            && minima.first().is_some_and(|m| curvature::is_bent(m, problem));
        let is_between_layouts = self.known.geometry.is_between_layouts();
        if minima.first().is_none_or(|m| is_unlikely(m.chi2, DEGREES_OF_FREEDOM)) {
            self.follow(&starts[n_left_over..], &ends[n_left_over..], problem, minima);
        } else if is_between_layouts || self.weakness.is_some() || is_bent || is_in_doubt(minima) {
            let first = n_left_over + self.n_of_sqpnp;
            self.follow(&starts[first..], &ends[first..], problem, minima);
        }
        let view = View {
            problem: *problem,
            geometry: Some(self.known.geometry),
            method: Method::LinePlusOne,
            allowed: Allowed::default(),
        };
        found.weakness = self.weakness;
        // Another minimum may have taken the first place.
        found.bends[0] = Some(is_bent).filter(|_| found.minima.first().map(|m| m.chi2) == straight_chi2);
        conclude(&view, &mut found)
    }

    /// Continues as `multi_start::refine_each` after the refinements.
    fn follow(&self, starts: &[Pose], ends: &[End], problem: &Problem, minima: &mut Minima) {
        for (start, end) in starts.iter().zip(ends) {
            let alternative_chi2 = minima.first().map(|m| m.chi2);
            // Once a start has led below the known minima, the following ones are compared with its minimum.
            let known = end.minimum.filter(|_| alternative_chi2 == Some(self.lowest_chi2()));
            if let Some(minimum) = known.or_else(|| refine_against(start, alternative_chi2, problem).ok()) {
                insert(minima, minimum);
            }
        }
    }
}
