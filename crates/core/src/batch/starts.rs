//! Starts refined side by side, whichever views they belong to.

use super::bend::is_straight;
use super::group::{Group, Kept, load};
use super::lanes::{Column, Lanes, Matrix, Vector, WIDTH};
use super::refine::Place;
use crate::camera::CameraMatrix;
use crate::locate::choose;
use crate::locate::refine::centroid;
use crate::{Correspondence, Pose};
use core::array::from_fn;
use pulp::{Arch, Simd, WithSimd};

/// A pose to refine, and the χ² of the minimum with which it will be compared; infinite where there is none.
pub(super) struct Start<'a, const N: usize> {
    pub seen: &'a [Correspondence; N],
    pub matrix: &'a CameraMatrix,
    pub cam_from_target: Pose,
    pub alternative_chi2: f64,
}

/// The end of a refinement.
pub(super) struct End {
    /// `None` where the lanes reach no minimum: `refine::refine_against` may still reach one, or returns the reason.
    pub minimum: Option<choose::Minimum>,
    /// Whether its likelihood is certainly not bent.
    pub is_straight: bool,
}

/// Refines every start; returns one end for each, in their order.
pub(super) fn refine_all<const N: usize>(starts: &[Start<N>]) -> Vec<End> {
    Arch::new().dispatch(Run { starts })
}

struct Run<'a, const N: usize> {
    starts: &'a [Start<'a, N>],
}

impl<const N: usize> WithSimd for Run<'_, N> {
    type Output = Vec<End>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<End> {
        let lanes = S::F64_LANES.min(WIDTH);
        let (mut places, mut ends) = (Places::default(), Vec::with_capacity(self.starts.len()));
        for starts in self.starts.chunks(lanes) {
            for lane in 0..lanes {
                // The last start is repeated in the remaining lanes.
                places.set(lane, &starts[lane.min(starts.len() - 1)]);
            }
            places.refine(simd);
            for lane in 0..starts.len() {
                ends.push(places.end(lane));
            }
        }
        ends
    }
}

/// The starts of a group, transposed, and their ends.
#[derive(Default)]
struct Places<const N: usize> {
    group: Group<N>,
    rotation: [[Column; 3]; 3],
    pivot_in_cam: [Column; 3],
    alternative_chi2: Column,
    kept: Kept,
    found: Column,
    straight: Column,
}

impl<const N: usize> Places<N> {
    #[inline(always)]
    fn set(&mut self, lane: usize, start: &Start<N>) {
        let pose = &start.cam_from_target;
        self.group.set_matrix(lane, start.matrix);
        self.group.set_points(lane, &from_fn(|k| start.seen[k].x_in_target));
        for k in 0..N {
            self.group.set_pixel(lane, k, &start.seen[k].pixel);
            self.group.set_sigma(lane, k, start.seen[k].sigma_px);
        }
        let pivot_in_cam = pose * &centroid(start.seen);
        for i in 0..3 {
            self.pivot_in_cam[i][lane] = pivot_in_cam[i];
            for j in 0..3 {
                self.rotation[i][j][lane] = pose.rotation[(i, j)];
            }
        }
        self.alternative_chi2[lane] = start.alternative_chi2;
    }

    #[inline(always)]
    fn refine<S: Simd>(&mut self, simd: S) {
        let seen = self.group.seen(simd);
        let [x, y, z] = &self.rotation;
        let rotation = Matrix { rows: [load(simd, x), load(simd, y), load(simd, z)] };
        let start = Place { rotation, pivot_in_cam: load(simd, &self.pivot_in_cam) };
        let every = Lanes::splat(simd, 0.0).is_finite();
        let m = seen.refine(&start, Lanes::load(simd, &self.alternative_chi2), every);
        let pivot: Vector<S> = load(simd, &self.group.pivot);
        let total = self.kept.keep(&m, pivot, N);
        (m.found & total.is_finite()).store(&mut self.found);
        is_straight(&m, &seen).store(&mut self.straight);
    }

    #[inline(always)]
    fn end(&self, lane: usize) -> End {
        let minimum = if self.found[lane] != 0.0 { Some(self.kept.minimum(lane)) } else { None };
        End { minimum, is_straight: self.straight[lane] != 0.0 }
    }
}
