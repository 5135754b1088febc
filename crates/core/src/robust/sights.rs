//! What a pose is tested against, laid out for speed: docs/math/robust.md section 1.
//!
//! ```text
//!   e = (U x, V x) / (D x),  x = R X + t     residual, px, to first order in e; exact for a pinhole, eqs. (1)–(3)
//!   U, V  rows of Π, the derivative of the projection at the bearing b   ·   D = bᵀ, for a pinhole (0, 0, 1/b_z)
//! ```
//! Four points stand side by side, so that the compiler works on several at a time.

use crate::least_squares::{NormalEquations, PivotedPose};
use crate::{Camera, Correspondence, Lens, Point, Pose};
use nalgebra::Vector3;

const LANES: usize = 4;
type Rows = [[f64; LANES]; 3];

/// Four points: place in the target, the three rows, the weight 1/σ².
struct Block {
    x: Rows,
    u: Rows,
    v: Rows,
    d: Rows,
    weight: [f64; LANES],
}

/// Residuals of a block: px, and whether the point lies in front.
struct Residuals {
    e: [[f64; LANES]; 2],
    /// D x; not positive behind the camera.
    depth: [f64; LANES],
    x_in_cam: Rows,
}

/// Points and their rays, in an order of chance.
pub(super) struct ObservationBlocks {
    blocks: Vec<Block>,
    n: usize,
}

/// Wald's sequential test of "this pose agrees with a share `good` of the points" against "only with a share `bad`".
#[derive(Debug, Clone, Copy)]
pub(super) struct Wald {
    per_miss: f64,
    per_hit: f64,
}

/// A good pose is given up once in a hundred at most, eq. (8).
const GIVE_UP_RATIO: f64 = 4.605_170_185_988_091;

impl Wald {
    pub(super) fn new(good: f64, bad: f64) -> Self {
        Wald { per_miss: ((1.0 - bad) / (1.0 - good)).ln(), per_hit: (bad / good).ln() }
    }
}

impl Block {
    fn empty() -> Self {
        let rows = [[0.0; LANES]; 3];
        Block { x: rows, u: rows, v: rows, d: rows, weight: [0.0; LANES] }
    }

    fn set(&mut self, lane: usize, c: &Correspondence, camera: &Camera) {
        self.weight[lane] = 1.0 / (c.sigma_px * c.sigma_px);
        let Some((_, j)) = camera.project_with_jacobian(&c.bearing) else { return };
        let depth = match camera.lens {
            Lens::Pinhole(_) => Vector3::new(0.0, 0.0, 1.0 / c.bearing.z),
            _ => c.bearing.into_inner(),
        };
        for i in 0..3 {
            self.x[i][lane] = c.x_in_target[i];
            self.u[i][lane] = j[(0, i)];
            self.v[i][lane] = j[(1, i)];
            self.d[i][lane] = depth[i];
        }
    }

    /// The points in the camera frame.
    #[inline(always)]
    fn in_cam(&self, r: &[f64; 9], t: &[f64; 3]) -> Rows {
        let axis = |k: usize| {
            let (a, b, c, d) = (r[k], r[3 + k], r[6 + k], t[k]);
            lanes(|i| a * self.x[0][i] + b * self.x[1][i] + c * self.x[2][i] + d)
        };
        [axis(0), axis(1), axis(2)]
    }

    /// How many lie within a limit, px². No division, and each step for all lanes before the next: so it is vectorised.
    #[inline(always)]
    fn hits(&self, r: &[f64; 9], t: &[f64; 3], limit_squared: f64) -> u32 {
        let x = self.in_cam(r, t);
        let (u, v, d) = (along(&self.u, &x), along(&self.v, &x), along(&self.d, &x));
        let bound = lanes(|i| limit_squared * (d[i] * d[i]));
        let squared = lanes(|i| u[i] * u[i] + v[i] * v[i]);
        (0..LANES).map(|i| u32::from((0.0 < d[i]) & (squared[i] < bound[i]))).sum()
    }

    #[inline(always)]
    fn residuals(&self, r: &[f64; 9], t: &[f64; 3]) -> Residuals {
        let x_in_cam = self.in_cam(r, t);
        let depth = along(&self.d, &x_in_cam);
        let e = [&self.u, &self.v].map(|rows| {
            let across = along(rows, &x_in_cam);
            lanes(|i| across[i] / depth[i])
        });
        Residuals { e, depth, x_in_cam }
    }
}

#[inline(always)]
fn lanes(each: impl Fn(usize) -> f64) -> [f64; LANES] {
    let mut out = [0.0; LANES]; // `array::from_fn` and `map` are left as calls here, and then nothing is vectorised.
    for (i, lane) in out.iter_mut().enumerate() {
        *lane = each(i);
    }
    out
}

/// The product of each lane's row with its point.
#[inline(always)]
fn along(rows: &Rows, x: &Rows) -> [f64; LANES] {
    lanes(|i| rows[0][i] * x[0][i] + rows[1][i] * x[1][i] + rows[2][i] * x[2][i])
}

impl Residuals {
    /// Squared length where it is below the limit and the point in front.
    #[inline(always)]
    fn is_within(&self, i: usize, limit_squared: f64) -> bool {
        let squared = self.e[0][i] * self.e[0][i] + self.e[1][i] * self.e[1][i];
        0.0 < self.depth[i] && squared < limit_squared
    }
}

fn parts(cam_from_target: &Pose) -> ([f64; 9], [f64; 3]) {
    let r: [f64; 9] = core::array::from_fn(|i| cam_from_target.rotation[i]);
    (r, cam_from_target.translation.into())
}

impl ObservationBlocks {
    /// In the given order of rows. A bearing that the lens does not project agrees with no pose.
    pub(super) fn new(seen: &[Correspondence], order: &[u32], camera: &Camera) -> Self {
        let mut blocks = Vec::with_capacity(order.len().div_ceil(LANES));
        for rows in order.chunks(LANES) {
            let mut block = Block::empty();
            rows.iter().enumerate().for_each(|(lane, row)| block.set(lane, &seen[*row as usize], camera));
            blocks.push(block);
        }
        ObservationBlocks { blocks, n: order.len() }
    }

    /// How many points there are.
    pub(super) fn n_points(&self) -> usize {
        self.n
    }

    /// How many blocks there are: where a count may begin.
    pub(super) fn n_blocks(&self) -> usize {
        self.blocks.len()
    }

    /// How many points a pose agrees with; none as soon as the test gives it up. Counting starts at a block of chance: from one
    /// and the same block, an unlucky start would give up every good pose alike.
    #[inline]
    pub(super) fn count(
        &self,
        cam_from_target: &Pose,
        limit_squared: f64,
        first_block: usize,
        test: &Wald,
    ) -> Option<usize> {
        let (r, t) = parts(cam_from_target);
        let (mut count, mut ratio) = (0, 0.0);
        let (before, from) = self.blocks.split_at(first_block);
        for block in from.iter().chain(before) {
            let hits = block.hits(&r, &t, limit_squared);
            count += hits;
            ratio += test.per_miss * f64::from(LANES as u32 - hits) + test.per_hit * f64::from(hits);
            if GIVE_UP_RATIO < ratio {
                return None;
            }
        }
        Some(count as usize)
    }

    /// Which points a pose agrees with, in the order of the sights.
    pub(super) fn within(&self, cam_from_target: &Pose, limit_squared: f64) -> Vec<bool> {
        let (r, t) = parts(cam_from_target);
        let mut is_in = Vec::with_capacity(LANES * self.blocks.len());
        for block in &self.blocks {
            let residuals = block.residuals(&r, &t);
            is_in.extend((0..LANES).map(|i| residuals.is_within(i, limit_squared)));
        }
        is_in.truncate(self.n);
        is_in
    }

    /// The truncated cost Σ min(|e|², T²)/σ² and its normal equations, eq. (10): beyond T a point costs T² and pulls nowhere.
    pub(super) fn normal_equations(
        &self,
        place: &PivotedPose,
        pivot: &Point,
        limit_squared: f64,
    ) -> Option<NormalEquations> {
        let c = place.pivot_in_cam;
        let (r, t) = parts(&Pose::new(place.rotation, c - place.rotation * pivot));
        let mut normal = NormalEquations::zero();
        for block in &self.blocks {
            let residuals = block.residuals(&r, &t);
            for i in 0..LANES {
                if residuals.is_within(i, limit_squared) {
                    block.add(&mut normal, &residuals, i, &c);
                } else {
                    normal.chi2 += limit_squared * block.weight[i];
                }
            }
        }
        normal.chi2.is_finite().then_some(normal)
    }

    /// How often a point's image falls within the limit of the pixel of *another* unit, as a share of the pairs looked at, less
    /// three standard deviations: what a pose owes to the layout of the image rather than to the labels, eq. (7).
    pub(super) fn chance_of_others(
        &self,
        cam_from_target: &Pose,
        limit_squared: f64,
        n_pairs: usize,
        is_same_unit: impl Fn(usize, usize) -> bool,
    ) -> f64 {
        let (r, t) = parts(cam_from_target);
        let shifts = (n_pairs / self.n.max(1)).clamp(1, self.n.saturating_sub(1).max(1));
        let (mut hits, mut pairs) = (0u32, 0u32);
        for i in 0..self.n {
            let rows = self.blocks[i / LANES].in_cam(&r, &t);
            let x = [rows[0], rows[1], rows[2]].map(|lanes| lanes[i % LANES]);
            for j in (1..=shifts).map(|shift| (i + shift) % self.n).filter(|j| !is_same_unit(i, *j)) {
                pairs += 1;
                hits += u32::from(self.sees(j, &x, limit_squared));
            }
        }
        // The square root of a Poisson variable has standard deviation 1/2.
        (f64::from(hits).sqrt() - 1.5).max(0.0).powi(2) / f64::from(pairs.max(1))
    }

    /// Whether a place in the camera frame falls within the limit of the pixel of point `j`.
    fn sees(&self, j: usize, x: &[f64; 3], limit_squared: f64) -> bool {
        let (block, i) = (&self.blocks[j / LANES], j % LANES);
        let along = |rows: &Rows| rows[0][i] * x[0] + rows[1][i] * x[1] + rows[2][i] * x[2];
        let (u, v, d) = (along(&block.u), along(&block.v), along(&block.d));
        0.0 < d && u * u + v * v < limit_squared * d * d
    }
}

impl Block {
    /// One point's two residuals (observed − predicted = −e) and their derivatives (Π − e D)/(D x), eq. (11).
    #[inline(always)]
    fn add(&self, normal: &mut NormalEquations, residuals: &Residuals, i: usize, c: &Point) {
        let row = |rows: &Rows| Vector3::new(rows[0][i], rows[1][i], rows[2][i]);
        let (y, d, w) = (row(&residuals.x_in_cam) - c, row(&self.d), self.weight[i].sqrt());
        let scale = w / residuals.depth[i];
        for (rows, e) in [&self.u, &self.v].into_iter().zip([residuals.e[0][i], residuals.e[1][i]]) {
            let by_place = (row(rows) - d * e) * scale;
            normal.add(-e * w, &y.cross(&by_place), &by_place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{KannalaBrandt, Pinhole};
    use crate::locate::refine::residual_px;
    use crate::{CameraMatrix, Pixel, Vector6};

    const MATRIX: CameraMatrix = CameraMatrix { fx_px: 500.0, fy_px: 510.0, cx_px: 320.0, cy_px: 240.0 };

    fn cameras() -> [Camera; 2] {
        let fisheye = KannalaBrandt::new(MATRIX, &[0.01, -0.002, 0.0, 0.0]).expect("a lens");
        [Lens::Pinhole(Pinhole { matrix: MATRIX }), Lens::KannalaBrandt(fisheye)]
            .map(|lens| Camera { lens, size: None })
    }

    /// Ten points 2–3 m in front, seen up to 3 px beside where they are; the pose in question is the identity.
    fn seen(camera: &Camera) -> Vec<Correspondence> {
        let point = |i: usize| {
            let a = i as f64;
            let x = Point::new((0.7 * a).sin(), (1.9 * a).cos(), 2.0 + 0.1 * a);
            let pixel =
                camera.project(&x).expect("in front") + Pixel::new((3.1 * a).sin(), (2.3 * a).cos()) * 2.0;
            Correspondence::new(camera, x, pixel, 0.5 + 0.05 * a).expect("in the field")
        };
        (0..10).map(point).collect()
    }

    fn blocks_of_observations(seen: &[Correspondence], camera: &Camera) -> ObservationBlocks {
        let order: Vec<u32> = (0..).take(seen.len()).collect();
        ObservationBlocks::new(seen, &order, camera)
    }

    /// To rounding for a pinhole; for a fisheye to the square of the residual over the focal length, (3 px)²/500 px = 0.02 px.
    #[test]
    fn residuals_are_those_of_the_lens() {
        for (camera, tolerance_px) in cameras().iter().zip([1e-11, 0.02]) {
            let seen = seen(camera);
            let blocks_of_observations = blocks_of_observations(&seen, camera);
            let (r, t) = parts(&Pose::identity());
            for (i, c) in seen.iter().enumerate() {
                let residuals = blocks_of_observations.blocks[i / LANES].residuals(&r, &t);
                let e = residual_px(&Pose::identity(), c, camera).expect("in the field");
                let off = (e.x + residuals.e[0][i % LANES]).hypot(e.y + residuals.e[1][i % LANES]);
                assert!(off < tolerance_px, "{} {i}: {off}", camera.model_name());
            }
        }
    }

    /// Jᵀr is −½ ∂χ²/∂ξ of the truncated cost; steps of 1e-5, cost some 10², so differences carry 1e-9 of rounding.
    #[test]
    fn jacobian_matches_central_difference() {
        let pivot = Point::new(0.1, -0.2, 2.4);
        for camera in &cameras() {
            let blocks_of_observations = blocks_of_observations(&seen(camera), camera);
            let start = PivotedPose::new(&Pose::identity(), &pivot);
            let at = |place: &PivotedPose| {
                blocks_of_observations.normal_equations(place, &pivot, 5.0).expect("a cost")
            };
            let normal = at(&start);
            // Turned and moved about the pivot: the gradient at a camera that stands in it.
            let gradient = normal.gradient_at_camera(&Point::zeros());
            for i in 0..6 {
                let moved = |step: f64| {
                    let mut motion = Vector6::zeros();
                    motion[i] = step;
                    at(&start.moved(&motion)).chi2
                };
                let slope = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                let off = (slope + 2.0 * gradient[i]).abs();
                assert!(
                    off < 1e-4 * (1.0 + slope.abs()),
                    "{} {i}: {slope} {}",
                    camera.model_name(),
                    gradient[i]
                );
            }
        }
    }
}
