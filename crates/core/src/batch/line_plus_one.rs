//! `locate` for three points on a line and one off it, a group of views at a time.

use super::bend::is_straight;
use super::closed_form::{Candidates, candidates, mirrored};
use super::doubtful::{DEGREES_OF_FREEDOM, Doubtful, settle};
use super::group::{Group, Kept, KeptPlace, load};
use super::lanes::{Column, Mask, Vector, WIDTH};
use super::refine::{Minimum, ObservedPoints, Place};
use super::{Answer, Given, Views, alone, geometry_of};
use crate::Point;
use crate::camera::{CameraMatrix, pinhole::R2_MAX};
use crate::least_squares::ALTERNATIVE_MARGIN_CHI2;
use crate::locate::choose::{
    AMBIGUITY_GATE_CHI2, Ambiguity, DUPLICATE_SIGMAS, Hypothesis, Minima, Others, ROUNDING_PX,
};
use crate::locate::consistency::Consistency;
use crate::locate::curvature::range_share;
use crate::locate::multi_start::HOPELESS_CHI2;
use crate::locate::posterior::weights;
use crate::locate::{Method, PoseEstimate};
use crate::solve::configuration::{Configuration, Geometry};
use arrayvec::ArrayVec;
use pulp::{Arch, Simd, WithSimd};

/// See `batch::locate_each`.
pub(super) fn locate_each(views: &Views, take: &mut impl FnMut(usize, Answer)) -> usize {
    let mut doubtful = Vec::new();
    let singly = Arch::new().dispatch(Run { views, take, doubtful: &mut doubtful });
    singly + settle(views, &doubtful, take)
}

struct Run<'a, T> {
    views: &'a Views<'a>,
    /// Takes the answer of a view, but for those in doubt.
    take: &'a mut T,
    doubtful: &'a mut Vec<Doubtful>,
}

impl<T: FnMut(usize, Answer)> WithSimd for Run<'_, T> {
    /// The number of views that took the single path.
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let lanes = S::F64_LANES.min(WIDTH);
        let mut sights = Sights::default();
        let mut found = Found::default();
        let mut singly = 0;
        for first in (0..self.views.pixels.len()).step_by(lanes) {
            sights.gather(self.views, first, lanes);
            sights.locate(simd, &mut found);
            for lane in 0..lanes.min(self.views.pixels.len() - first) {
                let (view, geometry) =
                    (first + lane, sights.geometry[lane].filter(|_| sights.is_pinhole[lane]));
                match geometry.filter(|_| found.paired[lane] != 0.0) {
                    Some(given) if found.sure[lane] != 0.0 && !given.is_between_layouts() => {
                        let centre =
                            sights.points[lane].map_or(Point::zeros(), |x| x.iter().sum::<Point>() / 4.0);
                        (self.take)(view, Ok(found.estimate(lane, geometry, &centre)));
                    }
                    Some(geometry) => self.doubtful.push(found.doubtful(lane, view, geometry)),
                    None => {
                        (self.take)(view, alone(self.views, view));
                        singly += 1;
                    }
                }
            }
        }
        singly
    }
}

/// The camera matrix for a view whose lens model the lanes do not support; that view is solved singly.
const UNIT: CameraMatrix = CameraMatrix { fx_px: 1.0, fy_px: 1.0, cx_px: 0.0, cy_px: 0.0 };

/// The views of a group, and their target.
#[derive(Default)]
struct Sights {
    group: Group<4>,
    /// The target of each view; `None` before the first.
    points: [Option<[Point; 4]>; WIDTH],
    /// The geometry of a target in this configuration, with the order of its points.
    geometry: [Option<Geometry>; WIDTH],
    order: [[usize; 4]; WIDTH],
    /// Whether the lanes support the lens model.
    is_pinhole: [bool; WIDTH],
}

impl Sights {
    /// Collects the views from `first` on; the last one is repeated in the remaining lanes.
    #[inline(always)]
    fn gather(&mut self, views: &Views, first: usize, lanes: usize) {
        for lane in 0..lanes {
            let view = (first + lane).min(views.pixels.len() - 1);
            let is_known = matches!(views.points_in_target, Given::Shared(_)) && self.points[lane].is_some();
            if !is_known && let Some(points) = views.points_in_target.of(view) {
                self.take_target(lane, points);
            }
            let matrix = views.pinhole(view).map(|(_, matrix)| matrix);
            self.is_pinhole[lane] = matrix.is_some();
            self.group.set_matrix(lane, matrix.unwrap_or(&UNIT));
            let Some(sigmas) = views.sigma_px.of(view) else { continue };
            let order = &self.order[lane];
            for k in 0..4 {
                self.group.set_pixel(lane, k, &views.pixels[view][order[k]]);
                self.group.set_sigma(lane, k, sigmas[order[k]]);
            }
        }
    }

    /// Neighbouring views usually have the same target: it is examined only when it changes.
    #[inline(never)]
    fn take_target(&mut self, lane: usize, points: &[Point; 4]) {
        if self.points[lane] == Some(*points) {
            return;
        }
        let beside = self.points.iter().position(|other| *other == Some(*points));
        self.points[lane] = Some(*points);
        self.geometry[lane] = match beside {
            Some(other) => self.geometry[other],
            // Near one line `search` starts from more poses than the lanes do.
            None => geometry_of(points).ok().filter(|g| !g.is_narrow()),
        };
        match self.geometry[lane].map(|g| g.configuration) {
            Some(Configuration::LinePlusOne { order }) => {
                self.order[lane] = order;
                self.group.set_points(lane, &order.map(|k| points[k]));
            }
            _ => self.geometry[lane] = None,
        }
    }

    #[inline(always)]
    fn locate<S: Simd>(&self, simd: S, found: &mut Found) {
        let seen = self.group.seen(simd);
        let sigma_px = seen.weight[3].recip();
        let (bearings, valid) = bearings(&seen);
        let [u, v] = seen.pixel[3];
        let sigma_rad = seen.on_plane([u + sigma_px, v]).unit().cross(bearings[3]).norm_squared().sqrt();
        let candidates = candidates(&bearings, &seen.from_pivot, sigma_rad);
        let pair = two_minima(&seen, &candidates, valid);
        found.keep(&pair, load(simd, &self.group.pivot));
    }
}

/// Returns unit vectors towards the pixels, where the camera has all of them, they are distinct, and each has a sigma.
#[inline(always)]
fn bearings<S: Simd>(seen: &ObservedPoints<S, 4>) -> ([Vector<S>; 4], Mask<S>) {
    let mut bearings = seen.from_pivot;
    let mut valid = seen.focal[0].is_finite();
    for k in 0..4 {
        let q = seen.on_plane(seen.pixel[k]);
        valid = valid & (q.x * q.x + q.y * q.y).below(R2_MAX);
        valid = valid & seen.weight[k].above(0.0) & seen.weight[k].is_finite();
        bearings[k] = q.unit();
        for j in 0..k {
            let ([u, v], [p, q]) = (seen.pixel[k], seen.pixel[j]);
            valid = valid & !(u.equals(p) & v.equals(q));
        }
    }
    (bearings, valid)
}

/// The minima of the closed form's candidates, lowest first.
struct Pair<S: Simd> {
    best: Minimum<S>,
    other: Minimum<S>,
    /// Where there is no second minimum.
    alone: Mask<S>,
    /// Where both starts have led to a minimum.
    paired: Mask<S>,
    /// The remaining start, and where it is tried: only one minimum was found, and it may still be good.
    left_over: Place<S>,
    unsettled: Mask<S>,
    /// Where the likelihood is certainly not bent.
    straight: Mask<S>,
    strong: Mask<S>,
    /// Where the answer is certain.
    sure: Mask<S>,
}

/// Searches as `search::search` and `search::refine_pair` do for views without ambiguity.
#[inline(always)]
fn two_minima<S: Simd>(seen: &ObservedPoints<S, 4>, candidates: &Candidates<S>, valid: Mask<S>) -> Pair<S> {
    let [a, b] = &candidates.places;
    let [has_a, has_b] = candidates.exist;
    let infinite = seen.focal[0].like(f64::INFINITY);
    let (chi2_a, chi2_b) = (seen.residual_sums(a).0, seen.residual_sums(b).0);
    let swap = has_b & (!has_a | chi2_b.less(chi2_a));
    let (start, second) = (Place::choose(swap, b, a), Place::choose(swap, a, b));
    let first = seen.refine(&start, infinite, valid & (has_a | has_b));
    let mirror = mirrored(&first.place, &seen.from_pivot);
    let chi2_second = (has_a & has_b).choose(swap.choose(chi2_a, chi2_b), infinite);
    let chi2_mirror = seen.residual_sums(&mirror).0;
    let is_second = chi2_second.less(chi2_mirror);
    let other = seen.refine(&Place::choose(is_second, &second, &mirror), first.chi2, first.found);
    let left_over = Place::choose(is_second, &mirror, &second);
    let (paired, alone, strong) = (other.found, are_duplicates(&first, &other), candidates.strong);
    let unsettled = alone & chi2_mirror.below(HOPELESS_CHI2) & chi2_second.below(HOPELESS_CHI2);
    let swap = !alone & other.chi2.less(first.chi2);
    let (best, other) = (Minimum::choose(swap, &other, &first), Minimum::choose(swap, &first, &other));
    let rivalled = !alone & (other.chi2 - best.chi2).below(AMBIGUITY_GATE_CHI2);
    let fits = best.chi2.below(AMBIGUITY_GATE_CHI2) & !rivalled;
    let straight = is_straight(&best, seen);
    let sure = paired & strong & fits & straight & !unsettled;
    Pair { best, other, alone, paired, left_over, unsettled, straight, strong, sure }
}

/// Decides as `choose::are_duplicates`.
#[inline(always)]
fn are_duplicates<S: Simd>(a: &Minimum<S>, b: &Minimum<S>) -> Mask<S> {
    let [x, y, z] = a.place.rotation.minus(&b.place.rotation).rows;
    let angle_squared = (x.norm_squared() + y.norm_squared() + z.norm_squared()) * 0.5;
    let scale = DUPLICATE_SIGMAS * DUPLICATE_SIGMAS;
    let ([xx, _, _, yy, _, zz], [uu, _, _, vv, _, ww]) = (a.covariance.rotation.0, b.covariance.rotation.0);
    angle_squared.less((xx + yy + zz) * scale) & angle_squared.less((uu + vv + ww) * scale)
}

/// The results of a group, transposed.
#[derive(Default)]
struct Found {
    best: Kept,
    other: Kept,
    left_over: KeptPlace,
    unsettled: Column,
    strong: Column,
    alone: Column,
    paired: Column,
    straight: Column,
    sure: Column,
    ratio: Column,
}

impl Found {
    #[inline(always)]
    fn keep<S: Simd>(&mut self, pair: &Pair<S>, pivot: Vector<S>) {
        let total = self.best.keep(&pair.best, pivot, 4) + self.other.keep(&pair.other, pivot, 4);
        let floor = 4.0 * ROUNDING_PX * ROUNDING_PX;
        (pair.other.sum.max(floor) / pair.best.sum.max(floor)).store(&mut self.ratio);
        pair.alone.store(&mut self.alone);
        pair.straight.store(&mut self.straight);
        pair.strong.store(&mut self.strong);
        pair.unsettled.store(&mut self.unsettled);
        self.left_over.keep(&pair.left_over, pivot);
        (pair.paired & total.is_finite()).store(&mut self.paired);
        (pair.sure & total.is_finite()).store(&mut self.sure);
    }

    #[inline(always)]
    fn estimate(&self, lane: usize, geometry: Option<Geometry>, centre: &Point) -> PoseEstimate {
        let best = self.best.minimum(lane);
        let (probability, others) = self.others(lane);
        PoseEstimate {
            cam_from_target: best.cam_from_target,
            covariance: best.covariance + range_share(&best, centre),
            rms_px: best.rms_px,
            chi2: best.chi2,
            shared_error_px: 0.0,
            log_determinant: 0.0,
            delta_chi2: 0.0,
            degrees_of_freedom: DEGREES_OF_FREEDOM,
            n_points: 4,
            method: Method::LinePlusOne,
            ambiguity: Ambiguity::Unique { ratio: (self.alone[lane] == 0.0).then_some(self.ratio[lane]) },
            consistency: Consistency::Consistent,
            probability,
            others,
            weakness: None,
            geometry,
        }
    }

    /// Returns the weight of the lowest minimum, and the other minimum.
    #[inline(always)]
    fn others(&self, lane: usize) -> (f64, Others) {
        if self.alone[lane] != 0.0 {
            return (1.0, Others::default());
        }
        let minimum = self.other.minimum(lane);
        let delta_chi2 = minimum.chi2 - self.best.chi2[lane];
        let [first, probability] =
            if delta_chi2 < ALTERNATIVE_MARGIN_CHI2 { self.weights(lane) } else { [1.0, 0.0] };
        (first, [Some(Hypothesis { minimum, delta_chi2, probability, is_alternative: false }), None, None])
    }

    /// Returns the weights of both minima.
    #[inline(never)]
    fn weights(&self, lane: usize) -> [f64; 2] {
        let minima: Minima = [self.best.minimum(lane), self.other.minimum(lane)].into_iter().collect();
        let weights = weights(&minima, 1.0);
        [weights[0], weights[1]]
    }

    #[inline(never)]
    fn doubtful(&self, lane: usize, view: usize, geometry: Geometry) -> Doubtful {
        let mut minima = ArrayVec::new();
        minima.push(self.best.minimum(lane));
        if self.alone[lane] == 0.0 {
            minima.push(self.other.minimum(lane));
        }
        Doubtful {
            view,
            geometry,
            minima,
            left_over: (self.unsettled[lane] != 0.0).then(|| self.left_over.cam_from_target(lane)),
            is_straight: self.straight[lane] != 0.0,
            is_strong: self.strong[lane] != 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::Given;
    use crate::{Camera, Pixel, Pose};
    use nalgebra::Vector3;

    /// Returns views along a path, with a disturbance of the size of their sigma.
    fn pixels(points: &[Point; 4]) -> Vec<[Pixel; 4]> {
        let view = |i: i32| {
            let i = f64::from(i);
            let turn = Vector3::new(0.4 + 0.02 * i, 0.9 - 0.015 * i, 0.1 * i);
            let cam_from_target =
                Pose::exp(&crate::Vector6::new(turn.x, turn.y, turn.z, 0.1, -0.2, 3.0 + 0.05 * i));
            points.map(|x| {
                let x = cam_from_target * x;
                Pixel::new(x.x / x.z, x.y / x.z) + Pixel::new((7.0 * x.x).sin(), (9.0 * x.y).cos()) * 2e-4
            })
        };
        (0..37).map(view).collect()
    }

    /// Compares the views that were answered; returns their number.
    fn assert_same(answers: &[(usize, Answer)], single: &[PoseEstimate]) -> usize {
        for (e, s) in answers.iter().filter_map(|(view, e)| Some((e.as_ref().ok()?, &single[*view]))) {
            let off = e.cam_from_target.rotation - s.cam_from_target.rotation;
            // The limit is rounding (1e-16) times the condition numbers of the normal equations (1e4) and of the steps.
            assert!(off.amax() < 1e-11 && (e.chi2 - s.chi2).abs() < 1e-9);
            assert!((e.covariance - s.covariance).amax() < 1e-9 * s.covariance.amax());
            assert_eq!((e.weakness.is_some(), e.geometry), (s.weakness.is_some(), s.geometry));
        }
        answers.iter().filter(|(_, answer)| answer.is_ok()).count()
    }

    /// Machines without the vectors of this one, down to single numbers, give the same answers and leave equally few views unsolved; pulp
    /// decides which of them it uses elsewhere.
    #[test]
    fn every_width_gives_the_same_answers() {
        let camera = Camera::normalized();
        let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0]].map(|[x, y]| Point::new(x, y, 0.0));
        let pixels = pixels(&points);
        let (points_in_target, sigma_px) = (Given::Shared(&points), Given::Shared(&[3e-4; 4]));
        let views = &Views { camera: Given::Shared(&camera), points_in_target, pixels: &pixels, sigma_px };
        let single: Vec<_> = (0..pixels.len()).filter_map(|view| alone(views, view).ok()).collect();
        let (mut answers, mut doubtful) = (Vec::new(), Vec::new());
        let take = &mut |view: usize, answer: Answer| answers.push((view, answer));
        assert_eq!(Run { views, take, doubtful: &mut doubtful }.with_simd(pulp::Scalar), 0);
        let sure = assert_same(&answers, &single);
        assert!(pixels.len() / 2 < sure && sure + doubtful.len() == pixels.len(), "{sure}");
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            let mut answers = Vec::new();
            let take = &mut |view: usize, answer: Answer| answers.push((view, answer));
            assert_eq!(Simd::vectorize(simd, Run { views, take, doubtful: &mut Vec::new() }), 0);
            assert_eq!(assert_same(&answers, &single), sure);
        }
        let mut answers = Vec::new();
        assert_eq!(locate_each(views, &mut |view, answer| answers.push((view, answer))), 0);
        assert_eq!(assert_same(&answers, &single), pixels.len());
    }
}
