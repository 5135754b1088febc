//! `solve::line_plus_one` for several problems at once, with the test for weak views and the mirrored start.
//!
//! Derivation: docs/math/line_plus_one.md eqs. (2)–(6), (10). Notation as in `solve/line_plus_one.rs`.

use super::lanes::{Lanes, Mask, Matrix, Vector};
use super::refine::Place;
use crate::solve::line_plus_one::{NEAR_CRITICAL, NEEDED_LENGTH_SIGMA, NEEDED_SEPARATION_SIGMA};
use pulp::Simd;

/// Both candidates, with masks for where each exists and where the view is not weak.
pub(super) struct Candidates<S: Simd> {
    pub places: [Place<S>; 2],
    pub exist: [Mask<S>; 2],
    pub strong: Mask<S>,
}

/// The points relative to their centroid, in order along the line, the one off it last.
struct Layout<S: Simd> {
    b: Vector<S>,
    target_axes: Matrix<S>,
    a: Lanes<S>,
    c: Lanes<S>,
    along: Lanes<S>,
    across: Lanes<S>,
}

impl<S: Simd> Layout<S> {
    #[inline(always)]
    fn of([a, b, c, d]: &[Vector<S>; 4]) -> Self {
        let (a, b, c, d) = (*a, *b, *c, *d);
        let x = (c - a).unit();
        let along = (d - b).dot(x);
        let perpendicular = (d - b) - x * along;
        let across = perpendicular.norm_squared().sqrt();
        let y = perpendicular * across.recip();
        let target_axes = Matrix::from_columns(x, y, x.cross(y));
        Layout { b, target_axes, a: (a - b).dot(x), c: (c - b).dot(x), along, across }
    }

    /// Returns the pose whose fourth point is at a depth on its ray, eq. (6), and whether there is one.
    #[inline(always)]
    fn place(&self, line: &Line<S>, d: Vector<S>, depth: Lanes<S>) -> (Place<S>, Mask<S>) {
        let from_foot = d * depth - line.foot;
        let across = from_foot - line.r1 * line.r1.dot(from_foot);
        let r2 = across.unit();
        let cam_axes = Matrix::from_columns(line.r1, r2, line.r1.cross(r2));
        let rotation = cam_axes.times(&self.target_axes.transpose());
        let exists = depth.above(0.0) & across.norm_squared().above(0.0);
        (Place { rotation, pivot_in_cam: line.b_in_cam - rotation.apply(self.b) }, exists)
    }
}

/// The line in the camera frames.
struct Line<S: Simd> {
    b_in_cam: Vector<S>,
    r1: Vector<S>,
    foot: Vector<S>,
}

/// `sigma_rad` is the standard deviation of the fourth point's bearing.
#[inline(always)]
pub(super) fn candidates<S: Simd>(
    bearings: &[Vector<S>; 4],
    from_pivot: &[Vector<S>; 4],
    sigma_rad: Lanes<S>,
) -> Candidates<S> {
    let layout = Layout::of(from_pivot);
    let [a, b, c, d] = *bearings;
    let n = viewing_plane(a, b, c);
    let squared = n.norm_squared();
    let m = (b * squared - n * n.dot(b)).unit();
    let e = n.cross(m) * squared.sqrt().recip();
    let (pa, qa, pc, qc) = (a.dot(m), a.dot(e), c.dot(m), c.dot(e));
    let depth = layout.a * layout.c * (pa * qc - qa * pc);
    let along_m = qa * pc * layout.c - pa * qc * layout.a;
    let along_e = qa * qc * (layout.c - layout.a);
    let scale = (along_m * along_m + along_e * along_e).sqrt().recip();
    let scale = depth.below(0.0).choose(-scale, scale);
    let (b_in_cam, r1) = (m * (depth * scale), m * (along_m * scale) + e * (along_e * scale));
    let foot = b_in_cam + r1 * layout.along;
    let middle = d.dot(foot);
    let spread = (layout.across * layout.across - d.cross(foot).norm_squared()).max(0.0).sqrt();
    let line = Line { b_in_cam, r1, foot };
    let (first, first_exists) = layout.place(&line, d, middle + spread);
    let (second, second_exists) = layout.place(&line, d, middle - spread);
    let (first_exists, second_exists) = (first_exists & scale.is_finite(), second_exists & scale.is_finite());
    let length_sigma = a.cross(c).norm_squared().sqrt() / sigma_rad;
    let x = (first.rotation.apply(from_pivot[3]) + first.pivot_in_cam).unit();
    let y = (second.rotation.apply(from_pivot[3]) + second.pivot_in_cam).unit();
    let separation_sigma = x.cross(y).norm_squared().sqrt() / sigma_rad;
    let critical = r1.dot(d).abs().below(NEAR_CRITICAL) & separation_sigma.below(NEEDED_SEPARATION_SIGMA);
    let both = first_exists & second_exists;
    let strong = !length_sigma.below(NEEDED_LENGTH_SIGMA) & !(both & critical) & length_sigma.is_finite();
    Candidates { places: [first, second], exist: [first_exists, second_exists], strong }
}

/// docs/math/line_plus_one.md eq. (2).
#[inline(always)]
fn viewing_plane<S: Simd>(a: Vector<S>, b: Vector<S>, c: Vector<S>) -> Vector<S> {
    let (ab, bc, ac) = (a.cross(b), b.cross(c), a.cross(c));
    ab * ab.dot(ac) + bc * bc.dot(ac) + ac * ac.norm_squared()
}

/// Returns the target mirrored in the plane through its centre perpendicular to the line of sight, docs/math/line_plus_one.md eq. (10).
#[inline(always)]
pub(super) fn mirrored<S: Simd>(place: &Place<S>, from_pivot: &[Vector<S>; 4]) -> Place<S> {
    let [a, _, c, d] = *from_pivot;
    let normal = (c - a).cross(d - a).unit();
    let sight = place.pivot_in_cam.unit();
    let normal_in_cam = place.rotation.apply(normal);
    // S_v R S_n = (I − 2vvᵀ)(R − 2 (R n) nᵀ)
    let rows = place.rotation.rows;
    let twice = normal_in_cam * normal_in_cam.x.like(2.0);
    let seen =
        Matrix { rows: [rows[0] - normal * twice.x, rows[1] - normal * twice.y, rows[2] - normal * twice.z] };
    let along = seen.apply_transposed(sight);
    let twice = sight * sight.x.like(2.0);
    let [p, q, r] = seen.rows;
    let rotation = Matrix { rows: [p - along * twice.x, q - along * twice.y, r - along * twice.z] };
    Place { rotation, ..*place }
}
