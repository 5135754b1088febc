//! The loop of `least_squares` for several problems at once: the same formulas, with decisions taken lane by lane.
//!
//! Derivation: docs/math/refine.md eqs. (1)–(7). A lane that has ended keeps its pose while the others continue.

use super::lanes::{Lanes, Mask, Matrix, Symmetric, Vector};
use crate::least_squares::{
    ALTERNATIVE_MARGIN_CHI2, FIRST_DAMPING, LAST_DAMPING, LEAST_GAIN, NEAR_CHI2, PREDICTED_CHI2,
    TOLERANCE_CHI2, TOLERANCE_COMPARED, TOLERANCE_RELATIVE,
};
use pulp::Simd;

/// Number of steps after which the remaining lanes are left to the single path: one view in a hundred.
const MAX_STEPS: usize = 16;
/// Squared depth or distance beyond which the single path decides whether a number is usable.
const USABLE: (f64, f64) = (1e-200, 1e200);

/// The observations of each problem: a pinhole camera and N points.
#[derive(Debug, Clone, Copy)]
pub(super) struct ObservedPoints<S: Simd, const N: usize> {
    /// Points relative to their centroid, target frame.
    pub from_pivot: [Vector<S>; N],
    pub pixel: [[Lanes<S>; 2]; N],
    /// 1/σ.
    pub weight: [Lanes<S>; N],
    pub focal: [Lanes<S>; 2],
    pub principal: [Lanes<S>; 2],
}

/// A pose as in `least_squares::PivotedPose`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place<S: Simd> {
    pub rotation: Matrix<S>,
    pub pivot_in_cam: Vector<S>,
}

/// Normal equations as in `least_squares::NormalEquations`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Normal<S: Simd> {
    chi2: Lanes<S>,
    gradient_rotation: Vector<S>,
    gradient_translation: Vector<S>,
    rotation_rotation: Symmetric<S>,
    rotation_translation: Matrix<S>,
    translation_translation: Symmetric<S>,
}

/// Blocks of the covariance of the small left motion, camera frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Covariance<S: Simd> {
    pub rotation: Symmetric<S>,
    /// Rotation (rows) with translation (columns).
    pub cross: Matrix<S>,
    pub translation: Symmetric<S>,
}

/// A minimum as in `choose::Minimum`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Minimum<S: Simd> {
    pub place: Place<S>,
    pub covariance: Covariance<S>,
    pub chi2: Lanes<S>,
    /// Sum of squared residuals, px².
    pub sum: Lanes<S>,
    /// Where a minimum was reached and the points determine it.
    pub found: Mask<S>,
}

impl<S: Simd> Place<S> {
    #[inline(always)]
    pub fn choose(mask: Mask<S>, yes: &Self, no: &Self) -> Self {
        Place {
            rotation: Matrix::choose(mask, &yes.rotation, &no.rotation),
            pivot_in_cam: Vector::choose(mask, &yes.pivot_in_cam, &no.pivot_in_cam),
        }
    }

    /// Applies Cayley's rotation about the pivot, and a shift.
    #[inline(always)]
    fn moved(&self, w: Vector<S>, v: Vector<S>) -> Self {
        let a = w * w.x.like(0.5);
        let s = a.norm_squared();
        let scale = (s + 1.0).recip() * 2.0;
        let [x, y, z] = self.rotation.transpose().rows;
        let rotation =
            Matrix::from_columns(turned(x, a, s, scale), turned(y, a, s, scale), turned(z, a, s, scale));
        Place { rotation, pivot_in_cam: self.pivot_in_cam + v }
    }
}

/// x + `scale` (k + k²) x with k = [a]×: k² x = a (a·x) − s x, s = |a|².
#[inline(always)]
fn turned<S: Simd>(x: Vector<S>, a: Vector<S>, s: Lanes<S>, scale: Lanes<S>) -> Vector<S> {
    let kx = a.times_plus(a.dot(x), a.cross(x));
    x.times_plus(-s, kx).times_plus(scale, x)
}

impl<S: Simd, const N: usize> ObservedPoints<S, N> {
    /// Returns a pixel on the plane z = 1.
    #[inline(always)]
    pub fn on_plane(&self, [u, v]: [Lanes<S>; 2]) -> Vector<S> {
        let (x, y) = ((u - self.principal[0]) / self.focal[0], (v - self.principal[1]) / self.focal[1]);
        Vector::new(x, y, u.like(1.0))
    }

    /// Returns χ² and the sum of squared residuals, px²; infinite where a point leaves the camera's field.
    #[inline(always)]
    pub fn residual_sums(&self, place: &Place<S>) -> (Lanes<S>, Lanes<S>) {
        let zero = self.focal[0].like(0.0);
        let (mut chi2, mut sum) = (zero, zero);
        let mut in_field = zero.below(1.0);
        for k in 0..N {
            let x = place.rotation.apply(self.from_pivot[k]) + place.pivot_in_cam;
            let iz = x.z.recip();
            in_field = in_field & x.z.above(0.0) & x.norm_squared().below(USABLE.1);
            in_field = in_field & (x.z * x.z).above(USABLE.0);
            let eu = self.pixel[k][0] - (self.focal[0] * (x.x * iz) + self.principal[0]);
            let ev = self.pixel[k][1] - (self.focal[1] * (x.y * iz) + self.principal[1]);
            let squared = eu * eu + ev * ev;
            chi2 += squared * (self.weight[k] * self.weight[k]);
            sum += squared;
        }
        let infinite = zero.like(f64::INFINITY);
        (in_field.choose(chi2, infinite), in_field.choose(sum, infinite))
    }

    /// Returns the normal equations, and where every point is in front of the camera.
    #[inline(always)]
    fn normal(&self, place: &Place<S>, zero: &Normal<S>) -> (Normal<S>, Mask<S>) {
        let mut n = *zero;
        let mut usable = n.chi2.below(1.0);
        for k in 0..N {
            let y = place.rotation.apply(self.from_pivot[k]);
            let x = y + place.pivot_in_cam;
            usable = usable & x.z.above(0.0);
            let (iz, w) = (x.z.recip(), self.weight[k]);
            let (xn, yn) = (x.x * iz, x.y * iz);
            let (a, b) = (self.focal[0] * iz * w, self.focal[1] * iz * w);
            let ru = (self.pixel[k][0] - (self.focal[0] * xn + self.principal[0])) * w;
            let rv = (self.pixel[k][1] - (self.focal[1] * yn + self.principal[1])) * w;
            n.add([ru, rv], y, [a, -(a * xn)], [b, -(b * yn)]);
        }
        let usable = usable & n.chi2.is_finite();
        (n, usable)
    }

    /// Refines every lane of `wanted` to its minimum, with covariance, as `refine::refine_against`.
    #[inline(always)]
    pub fn refine(&self, start: &Place<S>, alternative_chi2: Lanes<S>, wanted: Mask<S>) -> Minimum<S> {
        let (place, normal, reached) = self.minimize(start, alternative_chi2, wanted);
        let (covariance, determined) = normal.covariance_at_camera(place.pivot_in_cam);
        let place = Place { rotation: place.rotation.orthonormalized(), ..place };
        let (chi2, sum) = self.residual_sums(&place);
        Minimum { place, covariance, chi2, sum, found: reached & determined & chi2.is_finite() }
    }

    /// Minimises as `least_squares::minimize_pose`. Without a second solution `alternative_chi2` is infinite.
    #[inline(always)]
    fn minimize(
        &self,
        start: &Place<S>,
        alternative_chi2: Lanes<S>,
        wanted: Mask<S>,
    ) -> (Place<S>, Normal<S>, Mask<S>) {
        let zero = Normal::zero(alternative_chi2.like(0.0));
        let (mut place, mut trial, mut normal) = (*start, *start, zero);
        normal.chi2 = normal.chi2.like(f64::INFINITY);
        let mut damping = Damping { value: alternative_chi2.like(0.0), growth: alternative_chi2.like(2.0) };
        let mut promised = alternative_chi2.like(1.0);
        let (mut active, mut reached) = (wanted, wanted & !wanted);
        for _ in 0..MAX_STEPS {
            let (n, usable) = self.normal(&trial, &zero);
            let better = active & usable & n.chi2.less(normal.chi2);
            let lost = !better & (!normal.chi2.is_finite() | !damping.value.below(LAST_DAMPING));
            let gauss_newton = better & damping.value.below(f64::MIN_POSITIVE) & normal.chi2.is_finite();
            let before = gauss_newton.choose(promised, promised.like(0.0));
            damping.follow(better, (normal.chi2 - n.chi2) / promised);
            place = Place::choose(better, &trial, &place);
            normal = Normal::choose(better, &n, &normal);
            let (w, v, promise, positive) = normal.step(damping.value);
            (trial, promised) = (place.moved(w, v), promise);
            active = active & positive & !lost;
            let ends = active & ends(promised, before, normal.chi2, alternative_chi2);
            place = Place::choose(ends, &trial, &place);
            (reached, active) = (reached | ends, active & !ends);
            if !active.any() {
                break;
            }
        }
        (place, normal, reached)
    }
}

/// Returns where the loop ends: the step promises little, or the one after it will.
#[inline(always)]
fn ends<S: Simd>(
    promised: Lanes<S>,
    before: Lanes<S>,
    chi2: Lanes<S>,
    alternative_chi2: Lanes<S>,
) -> Mask<S> {
    let predicted = promised.below(NEAR_CHI2) & !(before * PREDICTED_CHI2).less(promised * promised);
    let excess = (chi2 - alternative_chi2 - ALTERNATIVE_MARGIN_CHI2).max(0.0);
    let tolerance = chi2 * TOLERANCE_RELATIVE + excess * TOLERANCE_COMPARED + TOLERANCE_CHI2;
    predicted | !tolerance.less(promised)
}

/// Damping as in `least_squares::Damping`.
struct Damping<S: Simd> {
    value: Lanes<S>,
    growth: Lanes<S>,
}

impl<S: Simd> Damping<S> {
    /// Reduces the damping after an accepted step that achieved `gain` of its promise, and raises it after a rejected one.
    #[inline(always)]
    fn follow(&mut self, accepted: Mask<S>, gain: Lanes<S>) {
        let excess = gain * 2.0 - 1.0;
        let eased = self.value * (excess.like(1.0) - excess * excess * excess).max(1.0 / 3.0);
        let vanishes = eased.below(1e-9) | (gain.above(0.9) & eased.below(1e-3));
        let eased = vanishes.choose(eased.like(0.0), eased);
        let leaps = gain.below(LEAST_GAIN);
        let eased = leaps.choose((self.value * 2.0).max(FIRST_DAMPING), eased);
        let raised = (self.growth * self.value).max(FIRST_DAMPING);
        self.value = accepted.choose(eased, raised);
        self.growth = accepted.choose(gain.like(2.0), self.growth * 2.0);
    }
}

impl<S: Simd> Normal<S> {
    #[inline(always)]
    fn zero(zero: Lanes<S>) -> Self {
        let v = Vector::new(zero, zero, zero);
        let symmetric = Symmetric([zero; 6]);
        Normal {
            chi2: zero,
            gradient_rotation: v,
            gradient_translation: v,
            rotation_rotation: symmetric,
            rotation_translation: Matrix { rows: [v; 3] },
            translation_translation: symmetric,
        }
    }

    /// Adds a point as `NormalEquations::add_pinhole`.
    #[inline(always)]
    fn add(&mut self, [ru, rv]: [Lanes<S>; 2], y: Vector<S>, [a, s]: [Lanes<S>; 2], [b, t]: [Lanes<S>; 2]) {
        self.chi2 = ru.times_plus(ru, rv.times_plus(rv, self.chi2));
        let u = Vector::new(y.y * s, y.z.times_plus(a, -(y.x * s)), -(y.y * a));
        let v = Vector::new(y.y.times_plus(t, -(y.z * b)), -(y.x * t), y.x * b);
        self.gradient_rotation = u.times_plus(ru, v.times_plus(rv, self.gradient_rotation));
        let g = &mut self.gradient_translation;
        (g.x, g.y) = (a.times_plus(ru, g.x), b.times_plus(rv, g.y));
        g.z = s.times_plus(ru, t.times_plus(rv, g.z));
        self.rotation_rotation.add_square(u);
        self.rotation_rotation.add_square(v);
        for (row, (u, v)) in (0..3).zip([(u.x, v.x), (u.y, v.y), (u.z, v.z)]) {
            let r = &mut self.rotation_translation.rows[row];
            (r.x, r.y) = (u.times_plus(a, r.x), v.times_plus(b, r.y));
            r.z = u.times_plus(s, v.times_plus(t, r.z));
        }
        let tt = &mut self.translation_translation.0;
        (tt[0], tt[2]) = (a.times_plus(a, tt[0]), a.times_plus(s, tt[2]));
        (tt[3], tt[4]) = (b.times_plus(b, tt[3]), b.times_plus(t, tt[4]));
        tt[5] = s.times_plus(s, t.times_plus(t, tt[5]));
    }

    /// Computes the step as `NormalEquations::step`: rotation, shift, promise, and where the damped matrix is positive.
    #[inline(always)]
    fn step(&self, damping: Lanes<S>) -> (Vector<S>, Vector<S>, Lanes<S>, Mask<S>) {
        let (tt, positive) = self.translation_translation.damped(damping).inverse_without_xy();
        let gain = self.rotation_translation.times(&tt.full());
        let reduced = self.rotation_rotation.damped(damping).minus_product(&gain, &self.rotation_translation);
        let (ww, also) = reduced.inverse();
        let w = ww.apply(self.gradient_rotation - gain.apply(self.gradient_translation));
        let v = tt.apply(self.gradient_translation - self.rotation_translation.apply_transposed(w));
        let promised = w.dot(self.gradient_rotation) + v.dot(self.gradient_translation);
        (w, v, promised, positive & also & promised.is_finite())
    }

    /// Computes the covariance as `NormalEquations::covariance_at_camera`, and where the points determine the pose.
    #[inline(always)]
    fn covariance_at_camera(&self, pivot_in_cam: Vector<S>) -> (Covariance<S>, Mask<S>) {
        let (tt, positive) = self.translation_translation.inverse_without_xy();
        let gain = self.rotation_translation.times(&tt.full());
        let (ww, also) = self.rotation_rotation.minus_product(&gain, &self.rotation_translation).inverse();
        let m = Matrix::cross(pivot_in_cam).minus(&gain.transpose());
        let cross = ww.full().times(&m.transpose());
        let place = m.times(&cross);
        let [x, y, z] = place.rows;
        let t = tt.0;
        let translation = Symmetric([t[0] + x.x, t[1] + x.y, t[2] + x.z, t[3] + y.y, t[4] + y.z, t[5] + z.z]);
        (Covariance { rotation: ww, cross, translation }, positive & also)
    }

    #[inline(always)]
    fn choose(mask: Mask<S>, yes: &Self, no: &Self) -> Self {
        Normal {
            chi2: mask.choose(yes.chi2, no.chi2),
            gradient_rotation: Vector::choose(mask, &yes.gradient_rotation, &no.gradient_rotation),
            gradient_translation: Vector::choose(mask, &yes.gradient_translation, &no.gradient_translation),
            rotation_rotation: Symmetric::choose(mask, &yes.rotation_rotation, &no.rotation_rotation),
            rotation_translation: Matrix::choose(mask, &yes.rotation_translation, &no.rotation_translation),
            translation_translation: Symmetric::choose(
                mask,
                &yes.translation_translation,
                &no.translation_translation,
            ),
        }
    }
}

impl<S: Simd> Minimum<S> {
    #[inline(always)]
    pub fn choose(mask: Mask<S>, yes: &Self, no: &Self) -> Self {
        let (y, n) = (&yes.covariance, &no.covariance);
        Minimum {
            place: Place::choose(mask, &yes.place, &no.place),
            covariance: Covariance {
                rotation: Symmetric::choose(mask, &y.rotation, &n.rotation),
                cross: Matrix::choose(mask, &y.cross, &n.cross),
                translation: Symmetric::choose(mask, &y.translation, &n.translation),
            },
            chi2: mask.choose(yes.chi2, no.chi2),
            sum: mask.choose(yes.sum, no.sum),
            found: yes.found,
        }
    }
}
