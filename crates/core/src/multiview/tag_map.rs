//! Detections and a target in, the pose out; of a map of tags also which tag is not where the map says.
//!
//! correspond → group the corners of each tag → locate → does every tag agree with the others? → leave out the fewest that do not.
//! Derivation: docs/math/tag_map.md.

mod agreement;
mod displaced;
mod joint;

use crate::budget::{Budget, ErrorSource};
use crate::correspondence::{Detection, Skipped, correspond};
use crate::least_squares::{NormalEquations, PivotedPose};
use crate::locate::consistency::{Consistency, inconsistent_above};
use crate::locate::group::RigidGroup;
use crate::locate::problem::Problem;
use crate::locate::refine::{centroid, normal_equations};
use crate::locate::{Config, PoseEstimate, locate};
use crate::target::{Feature, PrintedScale, TagMap};
use crate::{Camera, Correspondence, Error, Point, Target};
use agreement::{Agreement, agreement, separate};
pub use displaced::DisplacedTag;
use nalgebra::DMatrix;

/// What one view of a target gives.
#[derive(Debug, Clone)]
pub struct TargetPose {
    /// The features that took part, and what the indices of `estimate` count.
    pub features: Vec<Feature>,
    /// Their correspondences, in the same order.
    pub seen: Vec<Correspondence>,
    /// Detections that took no part.
    pub skipped: Vec<Skipped>,
    /// Tags of a map that were left out because they are not where the map says, in ascending order of ids.
    pub left_out: Vec<DisplacedTag>,
    /// Tags of a map that contradict each other where the wrong one cannot be determined; the estimate is then `Inconsistent`.
    pub contradicting: Vec<u32>,
    /// The pose, or why there is none.
    pub estimate: Result<PoseEstimate, Error>,
}

/// The pose of a camera from features of a target found in its image.
///
/// The corners of a tag of a map share one displacement, as large as the map's tolerances say. With three tags or more, those that do
/// not agree with the others are left out and named; with two that contradict each other the answer is `Inconsistent` and names both.
/// `config.groups` and `config.target_scale_sigma` are made here, from the target: what they hold is not used.
pub fn locate_target(
    detections: &[Detection],
    target: &Target,
    camera: &Camera,
    config: &Config,
) -> TargetPose {
    let (mut joined, skipped) = correspond(detections, target, camera);
    let target_scale_sigma = target.printed_scale().map_or([0.0; 2], PrintedScale::relative_sigma);
    let config = &Config { groups: &[], target_scale_sigma, ..*config };
    let Target::TagMap(map) = target.design() else {
        let (features, seen): (Vec<_>, Vec<_>) = joined.into_iter().unzip();
        let estimate = locate(&seen, camera, config);
        return TargetPose {
            features,
            seen,
            skipped,
            left_out: Vec::new(),
            contradicting: Vec::new(),
            estimate,
        };
    };
    joined.sort_by_key(|(feature, _)| *feature);
    let view = TagView::new(&joined, map, target.printed_scale(), camera, config);
    let answer = view.answer();
    let kept = |feature: &Feature| !answer.left_out.iter().any(|tag| tag.id == feature.id);
    let (features, seen): (Vec<_>, Vec<_>) =
        joined.iter().copied().filter(|(feature, _)| kept(feature)).unzip();
    let estimate = answer.estimate.map(|e| {
        let chosen: Vec<usize> = (0..view.tags.len())
            .filter(|i| !answer.left_out.iter().any(|tag| tag.id == view.tags[*i].id))
            .collect();
        PoseEstimate { covariance: e.covariance + joint::of_map(&view, &chosen, &e), ..e }
    });
    TargetPose {
        features,
        seen,
        skipped,
        left_out: answer.left_out,
        contradicting: answer.contradicting,
        estimate,
    }
}

impl TargetPose {
    /// The parts of the covariance of `estimate` by their sources; the arguments are those of [`locate_target`].
    ///
    /// # Errors
    /// Why there is no pose; those of [`PoseEstimate::budget`].
    pub fn budget(&self, target: &Target, camera: &Camera, config: &Config) -> Result<Budget, Error> {
        let estimate = self.estimate.as_ref().map_err(Clone::clone)?;
        let target_scale_sigma = target.printed_scale().map_or([0.0; 2], PrintedScale::relative_sigma);
        let config = &Config { groups: &[], target_scale_sigma, ..*config };
        let Target::TagMap(map) = target.design() else { return estimate.budget(&self.seen, camera, config) };
        let joined: Vec<_> = self.features.iter().copied().zip(self.seen.iter().copied()).collect();
        let view = TagView::new(&joined, map, target.printed_scale(), camera, config);
        let all: Vec<usize> = (0..view.tags.len()).collect();
        let (points, of_map) = (view.points(&all), joint::of_map(&view, &all, estimate));
        let own = PoseEstimate { covariance: estimate.covariance - of_map, ..*estimate };
        let mut budget = own.budget(&points.seen, camera, &Config { groups: &points.groups, ..*config })?;
        budget.add(ErrorSource::Target, &of_map);
        Ok(budget)
    }
}

/// A tag of a map as a view shows it.
#[derive(Debug, Clone)]
struct SeenTag {
    id: u32,
    /// Outer edge of the black square.
    size_m: f64,
    corners: Vec<Correspondence>,
    /// Counted from its first corner. Of a map whose tags have a covariance together, it holds what is not common to the tags in view.
    group: RigidGroup,
}

/// The tags of a map in one view.
struct TagView<'a> {
    tags: Vec<SeenTag>,
    /// Covariance of the left motions of these tags together, 6 rows each; none where they are independent.
    joint: Option<DMatrix<f64>>,
    camera: &'a Camera,
    config: &'a Config<'a>,
}

struct Answer {
    left_out: Vec<DisplacedTag>,
    contradicting: Vec<u32>,
    estimate: Result<PoseEstimate, Error>,
}

/// The points of some tags, with their groups.
struct Points {
    seen: Vec<Correspondence>,
    groups: Vec<RigidGroup>,
}

/// The normal equations of some tags about the centroid of their points.
struct Equations {
    pivot_in_cam: Point,
    /// Of all together, with the priors.
    all: NormalEquations,
    /// Of each alone; none where they are not finite.
    of_tags: Vec<Option<NormalEquations>>,
}

impl<'a> TagView<'a> {
    /// `joined` in the order of ids.
    fn new(
        joined: &[(Feature, Correspondence)],
        map: &TagMap,
        printed: Option<&PrintedScale>,
        camera: &'a Camera,
        config: &'a Config<'a>,
    ) -> Self {
        let tags = joined.chunk_by(|a, b| a.0.id == b.0.id).filter_map(|corners| {
            let id = corners[0].0.id;
            let tag = map.tags.iter().find(|tag| tag.id == id)?;
            let group = RigidGroup {
                first: 0,
                n_points: corners.len(),
                centre_in_target: printed.map_or(tag.world_from_tag.translation, |scale| {
                    scale.apply(&tag.world_from_tag.translation)
                }),
                sigma_m: tag.sigma_m,
                sigma_rad: tag.sigma_rad,
            };
            Some(SeenTag {
                id,
                size_m: tag.size_m,
                corners: corners.iter().map(|(_, c)| *c).collect(),
                group,
            })
        });
        let mut tags: Vec<SeenTag> = tags.collect();
        let joint = joint::among(map, &tags);
        if let Some(joint) = &joint {
            joint::make_relative(&mut tags, joint);
        }
        TagView { tags, joint, camera, config }
    }

    /// Of the tags with these indices, ascending.
    fn points(&self, chosen: &[usize]) -> Points {
        let mut points = Points { seen: Vec::new(), groups: Vec::new() };
        for tag in chosen.iter().filter_map(|i| self.tags.get(*i)) {
            // An exact tag needs no group: alone, such maps go the way of every other target.
            if 0.0 < tag.group.sigma_m || 0.0 < tag.group.sigma_rad {
                points.groups.push(RigidGroup { first: points.seen.len(), ..tag.group });
            }
            points.seen.extend(&tag.corners);
        }
        points
    }

    /// Returns the normal equations at an estimate; none where those of all together are not finite.
    fn equations(&self, chosen: &[usize], e: &PoseEstimate) -> Option<Equations> {
        let points = self.points(chosen);
        let pivot = centroid(&points.seen);
        let place = PivotedPose::new(&e.cam_from_target, &pivot);
        let whole = Problem {
            seen: &points.seen,
            camera: self.camera,
            priors: self.config.priors,
            loss: self.config.loss,
            groups: &points.groups,
            weights_at: None,
        };
        let of_tag = |i: &usize| {
            let own = self.points(&[*i]);
            let alone = Problem { seen: &own.seen, priors: &[], groups: &own.groups, ..whole };
            normal_equations(&place, &pivot, &alone)
        };
        let all = normal_equations(&place, &pivot, &whole)?;
        let of_tags = chosen.iter().map(of_tag).collect();
        Some(Equations { pivot_in_cam: place.pivot_in_cam, all, of_tags })
    }

    fn locate(&self, chosen: &[usize]) -> Result<PoseEstimate, Error> {
        let points = self.points(chosen);
        locate(&points.seen, self.camera, &Config { groups: &points.groups, ..*self.config })
    }

    fn answer(&self) -> Answer {
        let all: Vec<usize> = (0..self.tags.len()).collect();
        let estimate = self.locate(&all);
        let found = match &estimate {
            Ok(e) if 1 < all.len() => agreement(self, &all, e),
            // A tag far away from where the map says may leave no pose at all.
            Err(_) if 2 < all.len() => Agreement::Doubtful { excess: vec![0.0; all.len()] },
            _ => Agreement::All,
        };
        match found {
            Agreement::All => Answer { left_out: Vec::new(), contradicting: Vec::new(), estimate },
            Agreement::Doubtful { excess } => match separate(self, &excess) {
                Some((kept, e)) => self.leave_out(&all, &kept, e, estimate),
                None => self.contradicting(&excess, estimate),
            },
        }
    }

    /// Without the tags that are displaced. One that agrees only if left out, but is where it should be, is out of shape: lens or
    /// detection, not the map. It stays, and what its corners say of the noise counts; it does not shield those that are displaced.
    fn leave_out(
        &self,
        all: &[usize],
        kept: &[usize],
        e: PoseEstimate,
        estimate: Result<PoseEstimate, Error>,
    ) -> Answer {
        let doubtful = all.iter().filter(|i| !kept.contains(i));
        let wrong: Vec<(usize, DisplacedTag)> = doubtful
            .map(|i| (*i, displaced::displaced(self, *i, &e)))
            .filter(|(_, tag)| tag.is_proven())
            .collect();
        let rest: Vec<usize> = all.iter().copied().filter(|i| !wrong.iter().any(|(k, _)| k == i)).collect();
        let estimate = match rest.len() {
            n if n == all.len() => estimate,
            n if n == kept.len() => Ok(e),
            _ => self.locate(&rest),
        };
        Answer {
            left_out: wrong.into_iter().map(|(_, tag)| tag).collect(),
            contradicting: Vec::new(),
            estimate,
        }
    }

    /// The wrong tag cannot be determined. Where each fits by itself the tags contradict each other; where they do not fit by
    /// themselves either, intrinsics or detections are wrong, and the estimate says so alone.
    fn contradicting(&self, excess: &[f64], estimate: Result<PoseEstimate, Error>) -> Answer {
        let fits =
            |i: usize| self.locate(&[i]).is_ok_and(|e| matches!(e.consistency, Consistency::Consistent));
        let n_fit = (0..self.tags.len()).filter(|i| fits(*i)).count();
        if 2 * n_fit <= self.tags.len() {
            return Answer { left_out: Vec::new(), contradicting: Vec::new(), estimate };
        }
        let largest = excess.iter().copied().fold(0.0, f64::max);
        let estimate = estimate.map(|e| contradicted(e, largest));
        Answer { left_out: Vec::new(), contradicting: self.tags.iter().map(|tag| tag.id).collect(), estimate }
    }
}

/// The estimate of tags that contradict each other, widened by as much as the worst of them exceeds what it may.
fn contradicted(e: PoseEstimate, excess: f64) -> PoseEstimate {
    let (worst_point, worst_px) = (0, e.rms_px);
    let chi2_per_degree_of_freedom = match e.consistency {
        Consistency::Inconsistent { .. } => return e,
        Consistency::Consistent => (excess / agreement::DEGREES_OF_FREEDOM as f64)
            .max(inconsistent_above(e.degrees_of_freedom) / e.degrees_of_freedom.max(1) as f64),
    };
    let applied = crate::locate::consistency::noise_scale(e.chi2, e.degrees_of_freedom);
    let widening = (chi2_per_degree_of_freedom / applied).max(1.0);
    PoseEstimate {
        covariance: e.covariance * widening,
        consistency: Consistency::Inconsistent {
            chi2_per_degree_of_freedom,
            worst_point,
            worst_px,
            worst_prior: None,
        },
        ..e
    }
}
