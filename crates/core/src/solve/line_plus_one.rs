//! Three points on a line and one off it, both planar candidates: own derivation, docs/math/line_plus_one.md.
//!
//! No angles, branches or divisions by coordinates. The layout is F.-Y. Wang's (IEEE T-RA 2004).
//!   a, b, c  bearings of the collinear points in order along the line, d of the fourth  ·  ℓ  abscissae measured from b
//!   n  normal of the plane through the camera and the line  ·  m, e  in-plane axes, m towards b
//!   r₁, r₂, r₃  axes of the target (along the line, across it, normal) in the camera frame
//!   B  the foot of the fourth point on the line, in the camera frame  ·  ρ  its distance from the line

use super::Candidates;
use crate::{Bearing, Point, Pose};
use nalgebra::{Matrix3, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Both poses that put the fourth point on its ray, the one with the farther fourth point first (neither is likelier).
///
/// `bearings` and `points_in_target` belong together, three collinear in order along the line, then the one off it.
/// Empty when the line passes through the camera centre or every root lies behind the camera.
pub fn line_plus_one(bearings: &[Bearing; 4], points_in_target: &[Point; 4]) -> Candidates {
    let layout = Layout::of(points_in_target);
    let Some(line) = Line::seen(bearings, &layout) else { return Candidates::new() };
    let d = bearings[3].into_inner();
    let foot = line.b_in_cam + line.r1 * layout.along;
    let (middle, spread) = ray_meets_sphere(&d, &foot, layout.across);
    let mut candidates = Candidates::new();
    for depth in [middle + spread, middle - spread] {
        if 0.0 < depth
            && let Some(pose) = layout.cam_from_target(&line, &(d * depth - foot))
        {
            candidates.push(pose);
        }
    }
    candidates
}

/// A configuration next to one where the points do not determine the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Weakness {
    /// The camera stands in the plane through the fourth point perpendicular to the line: two poses fit exactly alike.
    /// `separation_sigma` is how far apart the two would be seen, in standard deviations of a pixel.
    CriticalPlane {
        /// See above; below `needed_sigma` the answer is a coin toss.
        separation_sigma: f64,
        /// What is needed to tell the two apart.
        needed_sigma: f64,
    },
    /// The line of three is seen nearly end on: `width_sigma` is its image length in standard deviations of a pixel.
    LineEndOn {
        /// See above.
        length_sigma: f64,
        /// What is needed for a dependable closed form.
        needed_sigma: f64,
    },
}

/// Above this cosine between the fourth ray and the line the camera is away from the critical plane, and two poses that look
/// alike do so because the target is far.
pub(crate) const NEAR_CRITICAL: f64 = 0.1;
/// Two candidates seen closer together than this cannot be distinguished: the ambiguity gate is 3 σ, and refinement closes
/// about half of the gap.
pub(crate) const NEEDED_SEPARATION_SIGMA: f64 = 6.0;
/// A shorter image of the line leaves its direction to chance (measured: docs/math/line_plus_one.md section 5).
pub(crate) const NEEDED_LENGTH_SIGMA: f64 = 15.0;

/// What makes a view weak. `candidates` are those of `line_plus_one`, before any refinement, or two refined poses that fit
/// alike: the line's direction is noisier in the former. `sigma_rad` is the standard deviation of a bearing.
pub fn weakness(
    candidates: &Candidates,
    bearings: &[Bearing; 4],
    points_in_target: &[Point; 4],
    sigma_rad: f64,
) -> Option<Weakness> {
    let length_sigma = bearings[0].cross(&bearings[2]).norm() / sigma_rad;
    if !(NEEDED_LENGTH_SIGMA <= length_sigma) {
        return Some(Weakness::LineEndOn { length_sigma, needed_sigma: NEEDED_LENGTH_SIGMA });
    }
    let [first, second] = candidates.as_slice() else { return None };
    // The angle between the two, not of each from its pixel: noise of the line's direction displaces both alike.
    let [x, y] = [first, second].map(|candidate| (candidate * &points_in_target[3]).normalize());
    let separation_sigma = x.cross(&y).norm() / sigma_rad;
    let line = first.rotation * (points_in_target[2] - points_in_target[0]).normalize();
    let near = line.dot(&bearings[3]).abs() < NEAR_CRITICAL && separation_sigma < NEEDED_SEPARATION_SIGMA;
    near.then_some(Weakness::CriticalPlane { separation_sigma, needed_sigma: NEEDED_SEPARATION_SIGMA })
}

/// The four points in the target's own axes: everything that does not depend on the view.
struct Layout {
    b_in_target: Point,
    /// Columns: along the line, across it, normal.
    target_axes: Matrix3<f64>,
    /// Abscissae of a and c, measured from b.
    a: f64,
    c: f64,
    /// The fourth point along and across the line, measured from b.
    along: f64,
    across: f64,
}

impl Layout {
    fn of(points: &[Point; 4]) -> Self {
        let [a, b, c, d] = points;
        let x = unit(&(c - a));
        let along = (d - b).dot(&x);
        let perpendicular = (d - b) - x * along;
        let across = perpendicular.norm();
        let y = perpendicular * across.recip();
        let target_axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
        Layout { b_in_target: *b, target_axes, a: (a - b).dot(&x), c: (c - b).dot(&x), along, across }
    }

    /// The pose whose line is `line` and whose fourth point stands at `from_foot`, made orthogonal to the line.
    fn cam_from_target(&self, line: &Line, from_foot: &Vector3<f64>) -> Option<Pose> {
        let across = from_foot - line.r1 * line.r1.dot(from_foot);
        let length = across.norm();
        if !(0.0 < length) {
            return None;
        }
        let r2 = across * length.recip();
        let cam_axes = Matrix3::from_columns(&[line.r1, r2, line.r1.cross(&r2)]);
        let rotation = cam_axes * self.target_axes.transpose();
        Some(Pose { rotation, translation: line.b_in_cam - rotation * self.b_in_target })
    }
}

/// The line as the camera sees it: the place of its middle point and its direction.
struct Line {
    b_in_cam: Point,
    r1: Vector3<f64>,
}

impl Line {
    fn seen(bearings: &[Bearing; 4], layout: &Layout) -> Option<Self> {
        let [a, b, c] = [bearings[0].into_inner(), bearings[1].into_inner(), bearings[2].into_inner()];
        let n = viewing_plane(&a, &b, &c);
        let squared = n.norm_squared();
        // m = b − n (n·b)/|n|², scaled: its root and that of |n|² are taken side by side.
        let m = unit(&(b * squared - n * n.dot(&b)));
        let e = n.cross(&m) * squared.sqrt().recip();
        let (pa, qa, pc, qc) = (a.dot(&m), a.dot(&e), c.dot(&m), c.dot(&e));
        // Null vector of the two conditions "a, c on their rays", docs/math/line_plus_one.md eq. (4): depth of b, then r₁ along m and e.
        let depth = layout.a * layout.c * (pa * qc - qa * pc);
        let along_m = qa * pc * layout.c - pa * qc * layout.a;
        let along_e = qa * qc * (layout.c - layout.a);
        let scale = (along_m * along_m + along_e * along_e).sqrt().recip() * depth.signum();
        let line = Line { b_in_cam: m * (depth * scale), r1: m * (along_m * scale) + e * (along_e * scale) };
        scale.is_finite().then_some(line)
    }
}

/// Least-squares normal of the plane through three bearings: pairs weigh by the squared sine between them,
/// docs/math/line_plus_one.md eq. (2).
fn viewing_plane(a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>) -> Vector3<f64> {
    let (ab, bc, ac) = (a.cross(b), b.cross(c), a.cross(c));
    ab * ab.dot(&ac) + bc * bc.dot(&ac) + ac * ac.norm_squared()
}

/// One division where `normalize` makes three.
#[inline(always)]
fn unit(v: &Vector3<f64>) -> Vector3<f64> {
    v * v.norm_squared().sqrt().recip()
}

/// Depths λ with |λ d − B| = ρ as (middle, half difference); a ray that misses the sphere by noise touches it:
/// docs/math/line_plus_one.md eq. (5).
fn ray_meets_sphere(d: &Vector3<f64>, centre: &Point, radius: f64) -> (f64, f64) {
    let middle = d.dot(centre);
    // |B|² − (d·B)² without cancellation.
    let miss_squared = d.cross(centre).norm_squared();
    (middle, (radius * radius - miss_squared).max(0.0).sqrt())
}
