//! `locate` of three points on a line and one off it, a group of views at a time.

use super::bend::is_straight;
use super::closed_form::{Candidates, candidates, mirrored};
use super::lanes::{Column, Lanes, Mask, Vector, WIDTH};
use super::refine::{Minimum, Place, Seen};
use super::{Views, alone, order_of};
use crate::camera::{CameraMatrix, pinhole::R2_MAX};
use crate::choose::{AMBIGUITY_GATE_CHI2, Ambiguity, ROUNDING_PX, TWIN_SIGMAS};
use crate::consistency::Consistency;
use crate::locate::{Method, PoseEstimate};
use crate::search::HOPELESS_CHI2;
use crate::{Error, Matrix6, Point, Pose};
use nalgebra::{Matrix3, Vector3};
use pulp::{Arch, Simd, WithSimd};

/// See `batch::locate_each`.
pub(super) fn locate_each(
    views: &Views,
    matrix: &CameraMatrix,
    answers: &mut Vec<Result<PoseEstimate, Error>>,
) -> usize {
    Arch::new().dispatch(Run { views, matrix, answers })
}

struct Run<'a> {
    views: &'a Views<'a>,
    matrix: &'a CameraMatrix,
    answers: &'a mut Vec<Result<PoseEstimate, Error>>,
}

impl WithSimd for Run<'_> {
    /// How many views went to the single path.
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        let lanes = S::F64_LANES.min(WIDTH);
        let mut group = Group::default();
        let mut found = Found::default();
        let mut doubtful = 0;
        for first in (0..self.views.pixels.len()).step_by(lanes) {
            group.gather(self.views, first, lanes);
            group.locate(simd, self.matrix, &mut found);
            for lane in 0..lanes.min(self.views.pixels.len() - first) {
                let sure = group.in_layout[lane] && found.sure[lane] != 0.0;
                doubtful += usize::from(!sure);
                let answer = if sure { Ok(found.estimate(lane)) } else { alone(self.views, first + lane) };
                self.answers.push(answer);
            }
        }
        doubtful
    }
}

/// The views of a group, transposed: a column holds one number of each.
#[derive(Default)]
struct Group {
    points: [Point; 4],
    order: Option<[usize; 4]>,
    in_layout: [bool; WIDTH],
    pivot: [Column; 3],
    from_pivot: [[Column; 3]; 4],
    pixel: [[Column; 2]; 4],
    sigma_px: [Column; 4],
}

impl Group {
    /// The views from `first` on; beyond the last it stands again.
    #[inline(always)]
    fn gather(&mut self, views: &Views, first: usize, lanes: usize) {
        for lane in 0..lanes {
            let view = (first + lane).min(views.pixels.len() - 1);
            let (Some(points), Some(sigmas)) = (views.points_in_target.of(view), views.sigma_px.of(view))
            else {
                continue;
            };
            if self.points != *points {
                self.take_target(points);
            }
            let Some(order) = self.order else {
                self.in_layout[lane] = false;
                continue;
            };
            self.in_layout[lane] = true;
            let centroid = (points[0] + points[1] + points[2] + points[3]) / 4.0;
            for i in 0..3 {
                self.pivot[i][lane] = centroid[i];
            }
            for k in 0..4 {
                let (x, pixel) = (points[order[k]] - centroid, &views.pixels[view][order[k]]);
                for i in 0..3 {
                    self.from_pivot[k][i][lane] = x[i];
                }
                (self.pixel[k][0][lane], self.pixel[k][1][lane]) = (pixel.x, pixel.y);
                self.sigma_px[k][lane] = sigmas[order[k]];
            }
        }
    }

    /// Neighbouring views mostly show the same target: it is classified when it changes.
    #[inline(never)]
    fn take_target(&mut self, points: &[Point; 4]) {
        (self.points, self.order) = (*points, order_of(points));
    }

    #[inline(always)]
    fn locate<S: Simd>(&self, simd: S, matrix: &CameraMatrix, found: &mut Found) {
        let seen = self.seen(simd, matrix);
        let sigma_px = Lanes::load(simd, &self.sigma_px[3]);
        let (bearings, valid) = bearings(&seen);
        let [u, v] = seen.pixel[3];
        let sigma_rad = seen.on_plane([u + sigma_px, v]).unit().cross(bearings[3]).norm_squared().sqrt();
        let candidates = candidates(&bearings, &seen.from_pivot, sigma_rad);
        let pair = two_minima(&seen, &candidates, valid & candidates.strong);
        found.keep(&pair, load(simd, &self.pivot));
    }

    #[inline(always)]
    fn seen<S: Simd>(&self, simd: S, matrix: &CameraMatrix) -> Seen<S, 4> {
        let zero = Lanes::splat(simd, 0.0);
        let mut seen = Seen {
            from_pivot: [Vector::new(zero, zero, zero); 4],
            pixel: [[zero; 2]; 4],
            weight: [zero; 4],
            focal: [Lanes::splat(simd, matrix.fx_px), Lanes::splat(simd, matrix.fy_px)],
            principal: [Lanes::splat(simd, matrix.cx_px), Lanes::splat(simd, matrix.cy_px)],
        };
        for k in 0..4 {
            seen.from_pivot[k] = load(simd, &self.from_pivot[k]);
            seen.pixel[k] = [Lanes::load(simd, &self.pixel[k][0]), Lanes::load(simd, &self.pixel[k][1])];
            seen.weight[k] = Lanes::load(simd, &self.sigma_px[k]).recip();
        }
        seen
    }
}

#[inline(always)]
fn load<S: Simd>(simd: S, [x, y, z]: &[Column; 3]) -> Vector<S> {
    Vector::new(Lanes::load(simd, x), Lanes::load(simd, y), Lanes::load(simd, z))
}

/// Unit vectors towards the pixels, and where the camera has them all, apart from each other, with a sigma each.
#[inline(always)]
fn bearings<S: Simd>(seen: &Seen<S, 4>) -> ([Vector<S>; 4], Mask<S>) {
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

/// The best minimum, the residuals of the other, where there is no other, and where nothing is left to doubt.
struct Pair<S: Simd> {
    best: Minimum<S>,
    other_sum: Lanes<S>,
    alone: Mask<S>,
    sure: Mask<S>,
}

/// As `search::search` and `search::refine_pair` for views without doubt.
#[inline(always)]
fn two_minima<S: Simd>(seen: &Seen<S, 4>, candidates: &Candidates<S>, sure: Mask<S>) -> Pair<S> {
    let [a, b] = &candidates.places;
    let [has_a, has_b] = candidates.exist;
    let infinite = seen.focal[0].like(f64::INFINITY);
    let (chi2_a, chi2_b) = (seen.residual_sums(a).0, seen.residual_sums(b).0);
    let swap = has_b & (!has_a | chi2_b.less(chi2_a));
    let (start, second) = (Place::choose(swap, b, a), Place::choose(swap, a, b));
    let first = seen.refine(&start, infinite, sure & (has_a | has_b));
    let mirror = mirrored(&first.place, &seen.from_pivot);
    let chi2_second = (has_a & has_b).choose(swap.choose(chi2_a, chi2_b), infinite);
    let chi2_mirror = seen.residual_sums(&mirror).0;
    let start = Place::choose(chi2_second.less(chi2_mirror), &second, &mirror);
    let other = seen.refine(&start, first.chi2, first.found);
    // The start left over is tried where only one minimum was found and it is not hopeless: left to the single path.
    let alone = are_twins(&first, &other);
    let settled = !alone | !chi2_mirror.below(HOPELESS_CHI2) | !chi2_second.below(HOPELESS_CHI2);
    let swap = !alone & other.chi2.less(first.chi2);
    let best = Minimum::choose(swap, &other, &first);
    let (higher, other_sum) = (swap.choose(first.chi2, other.chi2), swap.choose(first.sum, other.sum));
    let rivalled = !alone & (higher - best.chi2).below(AMBIGUITY_GATE_CHI2);
    let fits = best.chi2.below(AMBIGUITY_GATE_CHI2) & higher.is_finite() & !rivalled;
    let sure = other.found & settled & fits & is_straight(&best, seen);
    Pair { best, other_sum, alone, sure }
}

/// As `choose::are_twins`.
#[inline(always)]
fn are_twins<S: Simd>(a: &Minimum<S>, b: &Minimum<S>) -> Mask<S> {
    let [x, y, z] = a.place.rotation.minus(&b.place.rotation).rows;
    let angle_squared = (x.norm_squared() + y.norm_squared() + z.norm_squared()) * 0.5;
    let scale = TWIN_SIGMAS * TWIN_SIGMAS;
    let ([xx, _, _, yy, _, zz], [uu, _, _, vv, _, ww]) = (a.covariance.rotation.0, b.covariance.rotation.0);
    angle_squared.less((xx + yy + zz) * scale) & angle_squared.less((uu + vv + ww) * scale)
}

/// What a group found, transposed.
#[derive(Default)]
struct Found {
    sure: Column,
    rotation: [[Column; 3]; 3],
    translation: [Column; 3],
    rotation_rotation: [Column; 6],
    rotation_translation: [[Column; 3]; 3],
    translation_translation: [Column; 6],
    chi2: Column,
    rms_px: Column,
    alone: Column,
    ratio: Column,
}

impl Found {
    #[inline(always)]
    fn keep<S: Simd>(&mut self, pair: &Pair<S>, pivot: Vector<S>) {
        let Minimum { place, covariance, chi2, sum, .. } = &pair.best;
        let translation = place.pivot_in_cam - place.rotation.apply(pivot);
        let floor = ROUNDING_PX * ROUNDING_PX;
        let (mean, other_mean) = (*sum * 0.25, pair.other_sum * 0.25);
        let total = translation.norm_squared() + covariance.translation.0[5] + mean + other_mean;
        (pair.sure & total.is_finite()).store(&mut self.sure);
        for i in 0..3 {
            store(&place.rotation.rows[i], &mut self.rotation[i]);
            store(&covariance.cross.rows[i], &mut self.rotation_translation[i]);
        }
        store(&translation, &mut self.translation);
        for i in 0..6 {
            covariance.rotation.0[i].store(&mut self.rotation_rotation[i]);
            covariance.translation.0[i].store(&mut self.translation_translation[i]);
        }
        pair.alone.store(&mut self.alone);
        chi2.store(&mut self.chi2);
        mean.sqrt().store(&mut self.rms_px);
        (other_mean.max(floor) / mean.max(floor)).store(&mut self.ratio);
    }

    #[inline(always)]
    fn estimate(&self, lane: usize) -> PoseEstimate {
        let rotation = Matrix3::from_fn(|i, j| self.rotation[i][j][lane]);
        let translation = Vector3::from_fn(|i, _| self.translation[i][lane]);
        PoseEstimate {
            cam_from_target: Pose { rotation, translation },
            covariance: self.covariance(lane),
            rms_px: self.rms_px[lane],
            chi2: self.chi2[lane],
            degrees_of_freedom: 2,
            n_points: 4,
            method: Method::LinePlusOne,
            ambiguity: Ambiguity::Unique { ratio: (self.alone[lane] == 0.0).then_some(self.ratio[lane]) },
            consistency: Consistency::Consistent,
            weight: 1.0,
            others: Default::default(),
            weakness: None,
            geometry: None,
        }
    }

    #[inline(always)]
    fn covariance(&self, lane: usize) -> Matrix6 {
        /// Where (i, j) stands in the upper triangle.
        const PLACE: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
        let mut covariance = Matrix6::zeros();
        for i in 0..3 {
            for j in 0..3 {
                covariance[(i, j)] = self.rotation_rotation[PLACE[i][j]][lane];
                covariance[(3 + i, 3 + j)] = self.translation_translation[PLACE[i][j]][lane];
                covariance[(i, 3 + j)] = self.rotation_translation[i][j][lane];
                covariance[(3 + j, i)] = self.rotation_translation[i][j][lane];
            }
        }
        covariance
    }
}

#[inline(always)]
fn store<S: Simd>(v: &Vector<S>, columns: &mut [Column; 3]) {
    v.x.store(&mut columns[0]);
    v.y.store(&mut columns[1]);
    v.z.store(&mut columns[2]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::Given;
    use crate::{Camera, Lens, Pixel};

    /// Views along a path, with a disturbance of the size of their sigma.
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

    fn assert_same(answers: &[Result<PoseEstimate, Error>], single: &[PoseEstimate]) {
        assert_eq!(answers.len(), single.len());
        for (e, s) in answers.iter().zip(single) {
            let e = e.as_ref().expect("a pose");
            let off = e.cam_from_target.rotation - s.cam_from_target.rotation;
            // Rounding (1e-16) times the condition of the normal equations (1e4) and of the steps on the way.
            assert!(off.amax() < 1e-11 && (e.chi2 - s.chi2).abs() < 1e-9);
            assert!((e.covariance - s.covariance).amax() < 1e-9 * s.covariance.amax());
            assert_eq!(e.weakness, s.weakness);
        }
    }

    /// Machines without the vectors of this one, down to single numbers, give the same answers and leave as few views to the single
    /// path; which of them the dispatch takes elsewhere is pulp's to say.
    #[test]
    fn every_width_gives_the_same_answers() {
        let camera = Camera::normalized();
        let Lens::Pinhole(model) = &camera.lens else { return };
        let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0]].map(|[x, y]| Point::new(x, y, 0.0));
        let pixels = pixels(&points);
        let (points_in_target, sigma_px) = (Given::Shared(&points), Given::Shared(&[3e-4; 4]));
        let views = &Views { camera: &camera, points_in_target, pixels: &pixels, sigma_px };
        let single: Vec<_> = (0..pixels.len()).filter_map(|view| alone(views, view).ok()).collect();
        let (mut answers, matrix) = (Vec::new(), &model.matrix);
        let doubtful = Run { views, matrix, answers: &mut answers }.with_simd(pulp::Scalar);
        assert_same(&answers, &single);
        assert!(doubtful < pixels.len() / 2, "{doubtful}");
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            let mut answers = Vec::new();
            let run = Run { views, matrix, answers: &mut answers };
            assert_eq!(Simd::vectorize(simd, run), doubtful);
            assert_same(&answers, &single);
        }
        let mut answers = Vec::new();
        assert_eq!(locate_each(views, matrix, &mut answers), doubtful);
        assert_same(&answers, &single);
    }
}
