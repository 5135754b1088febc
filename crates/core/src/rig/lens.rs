//! Do the intrinsics of each camera agree with everything that the rig saw? A score test at the minimum, nothing is solved again.
//!
//! Alone a camera hardly shows its focal length on small boards: the distance of the board takes it up. In a rig the other cameras know
//! that distance. docs/math/rig.md eqs. (14)–(16).
//!
//!   d  a pixel from the principal point, in focal lengths   ·   columns: d (focal length), 1 0, 0 1 (principal point), d |d|² (distortion)

use super::adjust::Adjusted;
use super::layout::Layout;
use crate::least_squares::rig::{Common, Eliminated};
use crate::refine::whitening;
use crate::{Camera, Correspondence, Point, Vector6};
use nalgebra::{Matrix4, SMatrix, SVector, Vector2, Vector4};

/// By how much a camera's intrinsics seem to be off, all else free: one Gauss–Newton step, in focal lengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensOffset {
    /// Relative error of the focal length (what to add, over the value given), with the principal point free.
    pub focal: f64,
    /// Its standard deviation.
    pub sigma_focal: f64,
    /// Error of the principal point over the focal length: right and down.
    pub centre: [f64; 2],
    /// Its standard deviations.
    pub sigma_centre: [f64; 2],
    /// By how much distortion is off at its points (root mean square over the focal length), the others free.
    pub distortion: f64,
    /// Its standard deviation.
    pub sigma_distortion: f64,
    /// χ² that these four explain.
    pub explained_chi2: f64,
}

/// Standard deviations taken off an offset before it is called too large: errors that whole sightings share make it up to twice as
/// uncertain as single points say.
const SIGMAS: f64 = 4.0;
/// Focal length or principal point off by more than this share of the focal length. On recordings with right files 0.005 is left of it
/// (webcams calibrated elsewhere, not synchronised; 0.0144 ± 0.0023), with a focal length 10 % off 0.046 to 0.09, with a principal point
/// 40 px off 0.023 to 0.07.
const OFF: f64 = 0.015;
/// Distortion, as the displacement it makes. Of right files 0 to 0.0005 is left in a rig of four and up to 0.002 in pairs of the same
/// webcams; of forgotten distortion 0.003 to 0.014.
const DISTORTION_OFF: f64 = 0.0025;
/// Of its information, what nothing shows keeps only rounding.
const NOTHING_LEFT: f64 = 1e-10;

impl LensOffset {
    /// Each beyond what its uncertainty explains, over what is allowed: focal length, principal point, distortion.
    fn excess(&self) -> [f64; 3] {
        let beyond = |x: f64, sigma: f64| x.abs() - SIGMAS * sigma;
        let [right, down] = [0, 1].map(|i| beyond(self.centre[i], self.sigma_centre[i]));
        [
            beyond(self.focal, self.sigma_focal) / OFF,
            right.max(down) / OFF,
            beyond(self.distortion, self.sigma_distortion) / DISTORTION_OFF,
        ]
    }

    /// Whether focal length, principal point or distortion is off by more than real lens files of a fair calibration are.
    pub fn is_off(&self) -> bool {
        self.excess().into_iter().any(|x| 1.0 < x)
    }

    /// What is off most, in words.
    pub fn worst(&self) -> &'static str {
        let [focal, centre, distortion] = self.excess();
        match () {
            () if distortion <= focal && centre <= focal => "focal length",
            () if distortion <= centre => "principal point",
            () => "distortion",
        }
    }
}

/// JᵀWP, PᵀWP and PᵀWr of a camera's four columns P.
struct Sums {
    by_motion: [Vector6; 4],
    own: Matrix4<f64>,
    pull: Vector4<f64>,
    /// Σ |d|⁶ and the number of points.
    sixth: f64,
    n: f64,
}

/// One entry a camera; none where its sightings leave them open.
pub(super) fn offsets(
    layout: &Layout,
    adjusted: &Adjusted,
    eliminated: &Eliminated,
    variance: f64,
) -> Vec<Option<LensOffset>> {
    let n = layout.problem.cameras.len();
    (0..n).map(|camera| offset(camera, layout, adjusted, eliminated, variance)).collect()
}

fn offset(
    camera: usize,
    layout: &Layout,
    adjusted: &Adjusted,
    eliminated: &Eliminated,
    variance: f64,
) -> Option<LensOffset> {
    let (places, graph) = (&adjusted.places, &adjusted.graph);
    let lens = &layout.problem.cameras[camera];
    let axis = lens.project_with_jacobian(&Point::new(0.0, 0.0, 1.0))?;
    let (centre, focal_px) = (axis.0, axis.1[(0, 0)].abs());
    let mut commons = [(); 4].map(|()| Common::new(graph));
    let mut total = Sums::zero();
    for (i, link) in graph.links.iter().enumerate() {
        if link.camera != camera || !graph.is_active[link.body] {
            continue;
        }
        let place = places.of_link(link, graph);
        let pivot = &layout.pivot_in_target[link.target];
        let mut sums = Sums::zero();
        for (c, _) in layout.sightings[i].seen.iter().zip(&adjusted.parts.is_used[i]).filter(|(_, u)| **u) {
            let arm = place.rotation * (c.x_in_target - pivot);
            sums.add_point(c, lens, &arm, &place.pivot_in_cam, (&centre, focal_px));
        }
        for (common, by_motion) in commons.iter_mut().zip(&sums.by_motion) {
            common.add(places, graph, link, by_motion);
        }
        total.merge(&sums);
    }
    let left = total.own - adjusted.equations.lost_by_several(eliminated, commons.each_ref());
    total.offset(&left, variance)
}

impl Sums {
    fn zero() -> Self {
        let by_motion = [Vector6::zeros(); 4];
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
        for (sum, p) in self.by_motion.iter_mut().zip(p.iter()) {
            *sum += by * *p;
        }
        self.own += p * p.transpose();
        self.pull += p * residual;
    }

    /// The first three alone, then all four: distortion trades with the principal point where few points lie far out.
    fn offset(&self, left: &Matrix4<f64>, variance: f64) -> Option<LensOffset> {
        let known = |i: usize| NOTHING_LEFT * self.own[(i, i)] < left[(i, i)];
        if !(0..3).all(known) {
            return None;
        }
        let three: SMatrix<f64, 3, 3> = left.fixed_view::<3, 3>(0, 0).into();
        let (x, sigma, chi2) = step(&three, &self.pull.fixed_rows::<3>(0).into(), variance)?;
        let reach = (self.sixth / self.n.max(1.0)).sqrt();
        let (distortion, sigma_distortion, chi2) = match step(left, &self.pull, variance).filter(|_| known(3))
        {
            Some((x, sigma, chi2)) => (reach * x[3], reach * sigma[3], chi2),
            None => (0.0, f64::INFINITY, chi2),
        };
        Some(LensOffset {
            focal: x[0],
            sigma_focal: sigma[0],
            centre: [x[1], x[2]],
            sigma_centre: [sigma[1], sigma[2]],
            distortion,
            sigma_distortion,
            explained_chi2: chi2,
        })
    }
}

/// Offsets, their standard deviations and the χ² they explain; none where the equations leave some open.
fn step<const N: usize>(
    left: &SMatrix<f64, N, N>,
    pull: &SVector<f64, N>,
    variance: f64,
) -> Option<(SVector<f64, N>, SVector<f64, N>, f64)> {
    let inverse = left.try_inverse()?;
    let x = inverse * pull;
    let sigma: SVector<f64, N> = inverse.diagonal().map(|v| (v * variance).sqrt());
    let chi2 = x.dot(pull);
    let is_right = x.iter().chain(sigma.iter()).all(|v| v.is_finite()) && 0.0 <= chi2;
    is_right.then_some((x, sigma, chi2))
}
