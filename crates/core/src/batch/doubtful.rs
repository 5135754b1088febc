//! Views of which the lanes found both minima but cannot exclude a third, or whose likelihood is bent: `search` goes on from there
//! with the P3P starts, here those of many views side by side.

use super::starts::{End, Start, refine_all};
use super::{Views, alone, correspondences};
use crate::camera::CameraMatrix;
use crate::choose::{Minima, Minimum, insert};
use crate::consistency::is_unlikely;
use crate::curvature;
use crate::locate::{Method, PoseEstimate, conclude};
use crate::problem::Problem;
use crate::refine::refine_against;
use crate::search::three_of;
use crate::solve::Candidates;
use crate::solve::configuration::Geometry;
use crate::{Correspondence, Error};
use arrayvec::ArrayVec;

/// A view and what is known about it.
pub(super) struct Doubtful {
    pub view: usize,
    pub geometry: Option<Geometry>,
    /// The minima of the closed form's candidates, lowest first.
    pub minima: ArrayVec<Minimum, 2>,
    /// Whether the likelihood at the lowest is surely not bent.
    pub is_straight: bool,
}

/// Of four points.
pub(super) const DEGREES_OF_FREEDOM: usize = 2;
/// As many views at a time, so that what is known about them stays near.
const AT_ONCE: usize = 64;

/// Answers every doubtful view. Returns how many went to the single path from the beginning.
pub(super) fn settle(
    views: &Views,
    matrix: &CameraMatrix,
    doubtful: &[Doubtful],
    answers: &mut [Result<PoseEstimate, Error>],
) -> usize {
    let mut singly = 0;
    for some in doubtful.chunks(AT_ONCE) {
        let mut cases = Vec::with_capacity(some.len());
        for known in some {
            match Case::of(views, known) {
                Some(case) => cases.push(case),
                None => {
                    answers[known.view] = alone(views, known.view);
                    singly += 1;
                }
            }
        }
        let starts: Vec<Start<4>> = cases.iter().flat_map(Case::starts).collect();
        let mut ends = refine_all(&starts, matrix).into_iter();
        for case in &cases {
            answers[case.known.view] = case.answer(views, &mut ends);
        }
    }
    singly
}

/// A doubtful view, and where else its search starts.
struct Case<'a> {
    known: &'a Doubtful,
    seen: [Correspondence; 4],
    starts: Candidates,
}

impl<'a> Case<'a> {
    /// None where not even the lowest minimum fits: `search` then starts from more than P3P.
    fn of(views: &Views, known: &'a Doubtful) -> Option<Self> {
        let seen = correspondences(views, known.view).ok()?;
        let fits = known.minima.first().is_some_and(|m| !is_unlikely(m.chi2, DEGREES_OF_FREEDOM));
        fits.then(|| Case { known, seen, starts: three_of(&seen) })
    }

    fn lowest_chi2(&self) -> f64 {
        self.known.minima.first().map_or(f64::INFINITY, |m| m.chi2)
    }

    fn starts(&self) -> impl Iterator<Item = Start<'_, 4>> {
        self.starts.iter().map(|start| Start {
            seen: &self.seen,
            cam_from_target: *start,
            rival_chi2: self.lowest_chi2(),
        })
    }

    /// As `search` and `locate` end; `ends` are those of this view's starts and of the views after it.
    fn answer(&self, views: &Views, ends: &mut impl Iterator<Item = End>) -> Result<PoseEstimate, Error> {
        let problem = &Problem::new(&self.seen, views.camera);
        let mut minima: Minima = self.known.minima.iter().copied().collect();
        let is_bent =
            !self.known.is_straight && minima.first().is_some_and(|m| curvature::is_bent(m, problem));
        for (start, end) in self.starts.iter().zip(ends) {
            let rival_chi2 = minima.first().map(|m| m.chi2);
            // Once a start has led below the minima known before, the next are measured by that one.
            match end.minimum.filter(|_| rival_chi2 == Some(self.lowest_chi2())) {
                Some(minimum) => insert(&mut minima, minimum),
                None => {
                    if let Ok(minimum) = refine_against(start, rival_chi2, problem) {
                        insert(&mut minima, minimum);
                    }
                }
            }
        }
        let bends = [Some(is_bent), None, None, None];
        conclude(problem, self.known.geometry, Method::LinePlusOne, None, None, bends, &mut minima)
    }
}
