//! Tests the intrinsics of each camera against all observations of the rig, by a score test at the minimum.
//!
//! A single camera hardly shows its focal length on small boards, because the distance of the board absorbs it. In a rig the other cameras
//! determine that distance. docs/math/rig.md eqs. (14)–(18).
//!
//!   d  a pixel from the principal point, in focal lengths   ·   columns: d (focal length), 1 0, 0 1 (principal point), d |d|² (distortion)

use super::adjust::Adjusted;
use super::layout::Layout;
use super::lens::LensOffset;
use crate::least_squares::rig::{Common, Eliminated};
use crate::locate::refine::whitening;
use crate::{Camera, Correspondence, Point, Vector6};
use nalgebra::{Matrix4, SMatrix, SVector, Vector2, Vector4};

/// A parameter that nothing shows keeps only this share of its information, by rounding.
const NOTHING_LEFT: f64 = 1e-10;

/// JᵀWP, PᵀWP and PᵀWr of a camera's four columns P, in one observation.
struct Sums {
    by_motion: SMatrix<f64, 6, 4>,
    own: Matrix4<f64>,
    pull: Vector4<f64>,
    /// Σ |d|⁶ and the number of points.
    sixth: f64,
    n: f64,
}

/// The information of one view on a camera's parameters after elimination of the poses, docs/math/rig.md eq. (17).
struct OfView {
    left: Matrix4<f64>,
    pull: Vector4<f64>,
}

/// The information of a camera's residuals on its four parameters, every pose free.
pub(super) struct LensScore {
    /// Information of the parameters by themselves, and with all poses free, eq. (15).
    own: Matrix4<f64>,
    left: Matrix4<f64>,
    pull: Vector4<f64>,
    of_views: Vec<OfView>,
    /// H⁻¹K for each parameter; its part for bodies only where requested.
    pub(super) following: [Common; 4],
    /// Root mean square of |d|³.
    reach: f64,
}

/// Returns one entry for each camera; none where its optical axis cannot be projected. With `with_bodies` the entries contain the derivatives of
/// every body in every view.
pub(super) fn scores(
    layout: &Layout,
    adjusted: &Adjusted,
    eliminated: &Eliminated,
    with_bodies: bool,
) -> Vec<Option<LensScore>> {
    let n = layout.problem.cameras.len();
    (0..n).map(|camera| score(camera, layout, adjusted, eliminated, with_bodies)).collect()
}

fn score(
    camera: usize,
    layout: &Layout,
    adjusted: &Adjusted,
    eliminated: &Eliminated,
    with_bodies: bool,
) -> Option<LensScore> {
    let (places, graph) = (&adjusted.places, &adjusted.graph);
    let observations = observations(camera, layout, adjusted)?;
    let mut commons = [(); 4].map(|()| Common::new(graph));
    let mut total = Sums::zero();
    for (i, sums) in &observations {
        for (common, by_motion) in commons.iter_mut().zip(sums.by_motion.column_iter()) {
            common.add(places, graph, &graph.links[*i], &by_motion.into_owned());
        }
        total.merge(sums);
    }
    let mut following =
        commons.each_ref().map(|common| adjusted.equations.following(eliminated, common, with_bodies));
    let lost = Matrix4::from_fn(|i, j| commons[i].dot(&following[j]));
    let of_views =
        observations.chunk_by(|a, b| layout.observations[a.0].view == layout.observations[b.0].view);
    let of_views = of_views.map(|own| of_view(own, adjusted, &following)).collect();
    if !with_bodies {
        following.iter_mut().for_each(|f| f.bodies = Vec::new());
    }
    let reach = (total.sixth / total.n.max(1.0)).sqrt();
    Some(LensScore { own: total.own, left: total.own - lost, pull: total.pull, of_views, following, reach })
}

/// Returns a camera's observations that take part.
fn observations(camera: usize, layout: &Layout, adjusted: &Adjusted) -> Option<Vec<(usize, Sums)>> {
    let (places, graph) = (&adjusted.places, &adjusted.graph);
    let lens = &layout.problem.cameras[camera];
    let axis = lens.project_with_jacobian(&Point::new(0.0, 0.0, 1.0))?;
    let (centre, focal_px) = (axis.0, axis.1[(0, 0)].abs());
    let of_link = |i: usize| {
        let link = &graph.links[i];
        let place = places.of_link(link, graph);
        let pivot = &layout.pivot_in_target[link.target];
        let mut sums = Sums::zero();
        for (c, _) in layout.observations[i].seen.iter().zip(&adjusted.parts.is_used[i]).filter(|(_, u)| **u)
        {
            let arm = place.rotation * (c.x_in_target - pivot);
            sums.add_point(c, lens, &arm, &place.pivot_in_cam, (&centre, focal_px));
        }
        (i, sums)
    };
    let own = graph.links.iter().enumerate().filter(|(_, l)| l.camera == camera && graph.is_active[l.body]);
    Some(own.map(|(i, _)| of_link(i)).filter(|(_, sums)| 0.0 < sums.n).collect())
}

fn of_view(observations: &[(usize, Sums)], adjusted: &Adjusted, following: &[Common; 4]) -> OfView {
    let mut sum = OfView { left: Matrix4::zeros(), pull: Vector4::zeros() };
    for (i, sums) in observations {
        let link = &adjusted.graph.links[*i];
        let (moved, _) = adjusted.equations.moved(&adjusted.places, &adjusted.graph, link, following);
        let (information, gradient) = adjusted.equations.of_observation(*i);
        let rest = sums.by_motion - information * moved;
        sum.left += sums.own - moved.tr_mul(&sums.by_motion) - rest.tr_mul(&moved);
        sum.pull += sums.pull - moved.tr_mul(gradient);
    }
    sum
}

/// A step of some of the parameters, with all poses free.
pub(super) struct LensStep<const N: usize> {
    pub(super) x: SVector<f64, N>,
    /// Σ of the squared changes of the step without one view.
    pub(super) of_views: SMatrix<f64, N, N>,
    /// Covariance from single points, and from the scatter of views; none where there are too few views.
    pub(super) by_points: SMatrix<f64, N, N>,
    pub(super) by_views: Option<SMatrix<f64, N, N>>,
    /// Number of views with information.
    pub(super) n_views: usize,
    chi2: f64,
}

impl LensScore {
    /// Returns the root mean square of |d|³, docs/math/rig.md eq. (14): the displacement that distortion causes.
    pub(super) fn reach(&self) -> f64 {
        self.reach
    }

    /// Returns the offset of the first three parameters with distortion held, then of distortion with all four free: distortion correlates with
    /// the principal point where few points are far from it. `stated` are the prior standard deviations of focal length, principal point and
    /// distortion: they widen those of the offset.
    pub(super) fn offset(&self, variance: f64, stated: &[f64; 3]) -> Option<LensOffset> {
        let [focal, centre, distortion_stated] = *stated;
        let three = self.three(variance)?;
        let (sigma, four) = (three.sigma(), self.four(variance));
        let (distortion, sigma_distortion) = match &four {
            Some(four) => (self.reach * four.x[3], self.reach * four.sigma()[3]),
            None => (0.0, f64::INFINITY),
        };
        Some(LensOffset {
            focal: three.x[0],
            sigma_focal: sigma[0].hypot(focal),
            centre: [three.x[1], three.x[2]],
            sigma_centre: [sigma[1].hypot(centre), sigma[2].hypot(centre)],
            distortion,
            sigma_distortion: sigma_distortion.hypot(distortion_stated),
            explained_chi2: four.map_or(three.chi2, |four| four.chi2),
        })
    }

    /// Returns the step of focal length and principal point, distortion held.
    pub(super) fn three(&self, variance: f64) -> Option<LensStep<3>> {
        self.step(variance)
    }

    /// Returns the step of all four parameters.
    pub(super) fn four(&self, variance: f64) -> Option<LensStep<4>> {
        self.step(variance)
    }

    /// Returns the step of the first N parameters, docs/math/rig.md eqs. (16), (18); none where the equations leave one undetermined.
    pub(super) fn step<const N: usize>(&self, variance: f64) -> Option<LensStep<N>> {
        let left: SMatrix<f64, N, N> = self.left.fixed_view::<N, N>(0, 0).into();
        let pull: SVector<f64, N> = self.pull.fixed_rows::<N>(0).into();
        let inverse = inverse_of_known(&left, &self.own)?;
        let (x, by_points) = (inverse * pull, inverse * variance);
        let chi2 = x.dot(&pull);
        let n_views = self.of_views.len();
        let of_views = self.scatter(&x, &inverse);
        let by_views = (2 * N <= n_views).then_some(of_views);
        let numbers = x.iter().chain(by_points.iter()).chain(of_views.iter());
        let is_right = numbers.into_iter().all(|v| v.is_finite()) && 0.0 <= chi2;
        is_right.then_some(LensStep { x, by_points, of_views, by_views, n_views, chi2 })
    }

    /// Returns Σ of the squared changes of the step without one view, docs/math/rig.md eq. (18): the view's residual gradient, corrected for its
    /// leverage on the parameters. The leverage of views on cameras is not corrected, so that the result is slightly too small.
    fn scatter<const N: usize>(
        &self,
        x: &SVector<f64, N>,
        inverse: &SMatrix<f64, N, N>,
    ) -> SMatrix<f64, N, N> {
        let one = SMatrix::<f64, N, N>::identity();
        self.of_views.iter().fold(SMatrix::zeros(), |sum, view| {
            let rest = (one - view.left_of::<N>() * inverse).try_inverse().unwrap_or(one);
            let change = inverse * rest * (view.pull.fixed_rows::<N>(0) - view.left_of::<N>() * x);
            sum + change * change.transpose()
        })
    }
}

impl OfView {
    fn left_of<const N: usize>(&self) -> SMatrix<f64, N, N> {
        self.left.fixed_view::<N, N>(0, 0).into()
    }
}

/// Returns the inverse of the information that remains with all poses free; none where a parameter keeps only rounding once those before it are
/// free.
fn inverse_of_known<const N: usize>(
    left: &SMatrix<f64, N, N>,
    own: &Matrix4<f64>,
) -> Option<SMatrix<f64, N, N>> {
    // Row by row, N ≤ 4: the squared diagonal of Cholesky's factor.
    let mut reduced = *left;
    for k in 0..N {
        if !(NOTHING_LEFT * own[(k, k)] < reduced[(k, k)]) {
            return None;
        }
        let (column, pivot) = (reduced.column(k).into_owned(), reduced[(k, k)]);
        reduced -= column * column.transpose() / pivot;
    }
    left.try_inverse()
}

impl<const N: usize> LensStep<N> {
    /// Returns the larger of the two standard deviations of each parameter.
    fn sigma(&self) -> SVector<f64, N> {
        let by_views = self.by_views.unwrap_or_else(SMatrix::zeros);
        SVector::from_fn(|i, _| self.by_points[(i, i)].max(by_views[(i, i)]).max(0.0).sqrt())
    }
}

impl Sums {
    fn zero() -> Self {
        let by_motion = SMatrix::zeros();
        Sums { by_motion, own: Matrix4::zeros(), pull: Vector4::zeros(), sixth: 0.0, n: 0.0 }
    }

    fn merge(&mut self, other: &Sums) {
        self.own += other.own;
        self.pull += other.pull;
        self.sixth += other.sixth;
        self.n += other.n;
    }

    fn add_point(
        &mut self,
        c: &Correspondence,
        lens: &Camera,
        arm: &Point,
        pivot_in_cam: &Point,
        (centre, focal_px): (&Vector2<f64>, f64),
    ) {
        let Some((pixel, jacobian)) = lens.project_with_jacobian(&(arm + pivot_in_cam)) else { return };
        let (from_centre, e) = (pixel - centre, c.pixel - pixel);
        let square = from_centre.norm_squared() / (focal_px * focal_px);
        let u = Vector4::new(from_centre.x, focal_px, 0.0, from_centre.x * square);
        let v = Vector4::new(from_centre.y, 0.0, focal_px, from_centre.y * square);
        let (a, b, d) = whitening(c, &jacobian);
        let (ju, jv) = (jacobian.row(0).transpose(), jacobian.row(1).transpose());
        self.add(a * e.x + b * e.y, &(u * a + v * b), arm, &(ju * a + jv * b));
        self.add(d * e.y, &(v * d), arm, &(jv * d));
        self.sixth += square * square * square;
        self.n += 1.0;
    }

    fn add(&mut self, residual: f64, p: &Vector4<f64>, arm: &Point, j: &Point) {
        let turn = arm.cross(j);
        let by = Vector6::new(turn.x, turn.y, turn.z, j.x, j.y, j.z);
        self.by_motion += by * p.transpose();
        self.own += p * p.transpose();
        self.pull += p * residual;
    }
}
