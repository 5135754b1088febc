//! `locate` for three points, many views at a time: P3P for each view, with the poses refined and their covariances computed side by side.
//!
//! P3P's poses fit exactly, so that one step of the refinement is enough, and their order by χ² is determined by rounding, here as in `locate`.
//! (P3P takes about a seventh of the time of an answer, so that lanes for its quartic could not gain more than that.)

use super::starts::{End, Start, refine_all};
use super::{Answer, Given, Views, alone, correspondences, geometry_of};
use crate::camera::CameraMatrix;
use crate::locate::Method;
use crate::locate::answer::conclude;
use crate::locate::choose::{Minima, Minimum, insert};
use crate::locate::classify::{Allowed, View};
use crate::locate::minima::Found;
use crate::locate::multi_start::three_of;
use crate::locate::problem::Problem;
use crate::locate::refine::refine_against;
use crate::solve::Candidates;
use crate::solve::configuration::{Configuration, Geometry, check_numbers};
use crate::{Camera, Correspondence, Point};

/// Number of views processed together, so that their data stay in the cache.
const AT_ONCE: usize = 32;

/// See `batch::locate_each_of_three`.
pub(super) fn locate_each(views: &Views<3>, take: &mut impl FnMut(usize, Answer)) -> usize {
    let (mut target, mut singly, count) = (Target::default(), 0, views.pixels.len());
    for first in (0..count).step_by(AT_ONCE) {
        let some = first..count.min(first + AT_ONCE);
        let cases: Vec<Option<Case>> = some.clone().map(|view| Case::of(views, view, &mut target)).collect();
        let starts: Vec<Start<3>> = cases.iter().flatten().flat_map(Case::starts).collect();
        let mut ends = &refine_all(&starts)[..];
        for (view, case) in some.zip(&cases) {
            let (own, others) = ends.split_at(case.as_ref().map_or(0, |case| case.starts.len()));
            ends = others;
            let mut found = Found::default();
            match case.as_ref().filter(|case| case.find(own, &mut found.minima)) {
                Some(case) => take(view, case.answer(own, &mut found)),
                None => {
                    take(view, alone(views, view));
                    singly += 1;
                }
            }
        }
    }
    singly
}

/// The target of the previous view: neighbouring views usually have the same.
#[derive(Default)]
struct Target {
    points: Option<[Point; 3]>,
    geometry: Option<Geometry>,
}

impl Target {
    fn geometry(&mut self, points: &Given<[Point; 3]>, view: usize) -> Option<Geometry> {
        let points = *points.of(view)?;
        if self.points != Some(points) {
            // Near one line `search` starts from more poses than P3P's.
            let is_wide = |g: &Geometry| g.configuration == Configuration::Three && !g.is_narrow();
            (self.points, self.geometry) = (Some(points), geometry_of(&points).ok().filter(is_wide));
        }
        self.geometry
    }
}

/// A view with the poses that P3P finds for it.
struct Case<'a> {
    camera: &'a Camera,
    matrix: &'a CameraMatrix,
    seen: [Correspondence; 3],
    geometry: Geometry,
    starts: Candidates,
}

impl<'a> Case<'a> {
    /// Returns `None` where the view is invalid or no pose fits: `locate` returns the reason.
    fn of(views: &Views<'a, 3>, view: usize, target: &mut Target) -> Option<Self> {
        let geometry = target.geometry(&views.points_in_target, view)?;
        let (camera, matrix) = views.pinhole(view)?;
        let (seen, _) = correspondences(views, view).ok()?;
        let [a, b, c] = [seen[0].pixel, seen[1].pixel, seen[2].pixel];
        let is_sound = check_numbers(&seen).is_ok() && a != b && b != c && c != a;
        let starts = if is_sound { three_of(&seen) } else { Candidates::new() };
        (!starts.is_empty()).then_some(Case { camera, matrix, seen, geometry, starts })
    }

    fn starts(&self) -> impl Iterator<Item = Start<'_, 3>> {
        let alternative_chi2 = f64::INFINITY; // they fit exactly: none ends early
        self.starts.iter().map(move |start| Start {
            seen: &self.seen,
            matrix: self.matrix,
            cam_from_target: *start,
            alternative_chi2,
        })
    }

    /// Continues as `multi_start::refine_each` after the refinements. Returns whether any start led to a minimum.
    fn find(&self, ends: &[End], minima: &mut Minima) -> bool {
        for (start, end) in self.starts.iter().zip(ends) {
            match end.minimum {
                Some(minimum) => insert(minima, minimum),
                None => {
                    let alternative_chi2 = minima.first().map(|m| m.chi2);
                    let problem = &Problem::new(&self.seen, self.camera);
                    if let Ok(minimum) = refine_against(start, alternative_chi2, problem) {
                        insert(minima, minimum);
                    }
                }
            }
        }
        !minima.is_empty()
    }

    /// Concludes as `locate` does.
    fn answer(&self, ends: &[End], found: &mut Found) -> Answer {
        let leads_to = |end: &End, m: &Minimum| {
            end.minimum.as_ref().is_some_and(|n| n.cam_from_target == m.cam_from_target)
        };
        for (bend, m) in found.bends.iter_mut().zip(found.minima.iter()) {
            *bend = ends.iter().any(|end| end.is_straight && leads_to(end, m)).then_some(false);
        }
        let problem = Problem::new(&self.seen, self.camera);
        let geometry = Some(self.geometry);
        conclude(&View { problem, geometry, method: Method::P3p, allowed: Allowed::default() }, found)
    }
}
