//! A plane on which only separate lengths are known, such as the dashes of a lane: its pose in one photograph from three or more of them.
//!
//! ```text
//!   r ray of a image_point, camera frame  ·  ν = n/h normal over height: the plane is ν·x = 1, a point of it X = r/(ν·r)
//!   m = rᵢ × rⱼ,  |Xᵢ − Xⱼ| = |ν × m|/((ν·rᵢ)(ν·rⱼ))                                 docs/math/survey.md eqs. (19)–(22)
//! ```

use super::trilaterate::{Places, lengths, plane_of};
use super::{Constraint, NetworkProblem};
use crate::least_squares::point::{PointEquations, minimize_point};
use crate::{Error, Point};
use nalgebra::{Matrix3, Vector3};

/// Smallest number of lengths: the plane has three unknowns.
const LEAST_SEGMENTS: usize = 3;
/// Number of directions on the hemisphere from which the search for normals starts: 5° apart.
const DIRECTIONS: usize = 900;
/// Largest number of normals that are followed.
const MOST_NORMALS: usize = 6;
/// Width over length below which points count as a line.
const LEAST_WIDTH: f64 = 0.05;
/// Relative misfit that counts as one standard deviation: the descent ends three thousandths of a part in ten million from a minimum.
const SIGMA: f64 = 1e-7;
/// Angle below which two normals are the same, rad.
const SAME_RAD: f64 = 1e-3;
/// A minimum is followed where the lengths fit it to this many times the best one's misfit, or to a tenth.
const FOLLOWED: f64 = 30.0;
const GOOD_MISFIT: f64 = 0.1;

/// A known length between two points of the plane that one photograph shows.
struct Segment {
    ends: [Vector3<f64>; 2],
    length_m: f64,
}

/// The image of one plane in one photograph.
struct View {
    segments: Vec<Segment>,
    /// Indices and rays of the points of the plane.
    rays: Vec<(usize, Vector3<f64>)>,
}

/// Returns positions of the points of a plane by the lengths between them, from the photograph with the most of them; several where the lengths
/// fit equally well, none below three lengths. The plane is z = 0, the camera above it.
pub(super) fn by_segments(network: &NetworkProblem) -> Vec<Places> {
    let Some(best) = best_view(network) else { return Vec::new() };
    normals(&best).into_iter().map(|nu| laid(&best, &nu, network.n_points)).collect()
}

/// Returns the error that separate lengths lie on one line, judged in the photograph with the most of them: their rays lie in one plane.
pub(super) fn line_of_segments(network: &NetworkProblem) -> Option<Error> {
    let best = best_view(network)?;
    let ends: Vec<Vector3<f64>> = best.segments.iter().flat_map(|s| s.ends).collect();
    let scatter: Matrix3<f64> = ends.iter().map(|r| r * r.transpose()).sum();
    let mut sizes: Vec<f64> = scatter.symmetric_eigenvalues().iter().copied().collect();
    sizes.sort_by(f64::total_cmp);
    let ratio = (sizes[0].max(0.0) / sizes[1]).sqrt();
    let of = |ray: &Vector3<f64>| best.rays.iter().find(|r| r.1 == *ray).map(|r| r.0);
    let farthest =
        |from: &Vector3<f64>| ends.iter().copied().min_by(|a, b| a.dot(from).total_cmp(&b.dot(from)));
    let a = farthest(&ends[0])?;
    let b = farthest(&a)?;
    let length_m = best.segments.iter().map(|s| s.length_m).sum::<f64>();
    let needed_m = LEAST_WIDTH * length_m;
    let refusal =
        Error::ControlPointsOnLine { a: of(&a)?, b: of(&b)?, length_m, width_m: ratio * length_m, needed_m };
    (ratio < LEAST_WIDTH).then_some(refusal)
}

fn best_view(network: &NetworkProblem) -> Option<View> {
    let views = (0..network.planes.len())
        .flat_map(|plane| (0..network.camera_of_photo.len()).map(move |photo| view(network, plane, photo)));
    views.max_by_key(|v| v.segments.len()).filter(|v| LEAST_SEGMENTS <= v.segments.len())
}

fn view(network: &NetworkProblem, plane: usize, photo: usize) -> View {
    let planes = plane_of(network);
    let camera = network.cameras[network.camera_of_photo[photo]].camera;
    let ray = |constraint: &Constraint| match constraint {
        Constraint::ImagePoint { photo: p, point, pixel, .. }
            if *p == photo && planes[*point] == Some(plane) =>
        {
            Some((*point, camera.bearing(pixel).ok()?.into_inner()))
        }
        _ => None,
    };
    let rays: Vec<(usize, Vector3<f64>)> = network.constraints.iter().filter_map(ray).collect();
    let of = |point: usize| rays.iter().find(|r| r.0 == point).map(|r| r.1);
    let known = lengths(network)
        .into_iter()
        .filter_map(|(_, l)| Some(Segment { ends: [of(l.ends[0])?, of(l.ends[1])?], length_m: l.length_m }));
    View { segments: known.collect(), rays }
}

/// Returns ln of the length that ν gives over the known one, and its gradient: eqs. (20), (21).
fn misfit(segment: &Segment, nu: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
    let [a, b] = &segment.ends;
    let (m, by_a, by_b) = (a.cross(b), nu.dot(a), nu.dot(b));
    let across = nu.cross(&m).norm_squared();
    let value = 0.5 * across.ln() - by_a.ln() - by_b.ln() - segment.length_m.ln();
    let gradient = (nu * m.norm_squared() - m * m.dot(nu)) / across - a / by_a - b / by_b;
    (value.is_finite() && gradient.sum().is_finite()).then_some((value, gradient))
}

/// Returns the sum of the misfits, with ν in the place of a point's three unknowns; none where a ray does not meet the plane in front of the
/// camera.
fn cost(view: &View, nu: &Vector3<f64>) -> Option<PointEquations> {
    if !view.rays.iter().all(|(_, r)| 0.0 < nu.dot(r)) {
        return None;
    }
    let mut sum = PointEquations::zero();
    for segment in &view.segments {
        let (value, gradient) = misfit(segment, nu)?;
        let (value, gradient) = (value / SIGMA, gradient / SIGMA);
        sum.chi2 += value * value;
        sum.gradient -= gradient * value;
        sum.information += gradient * gradient.transpose();
    }
    Some(sum)
}

/// Returns the ν that fit the lengths, best first: minima from every direction in which all points are visible.
fn normals(view: &View) -> Vec<Vector3<f64>> {
    let mut found: Vec<(f64, Vector3<f64>)> = Vec::new();
    for n in directions().filter_map(|n| scaled(view, &n)) {
        let Some((misfit, nu)) = descended(view, n) else { continue };
        let is_new = found.iter().all(|(_, other)| SAME_RAD < other.angle(&nu));
        if is_new {
            found.push((misfit, nu));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let least = found.first().map_or(0.0, |f| f.0);
    found.retain(|(misfit, _)| *misfit <= (FOLLOWED * FOLLOWED * least).max(GOOD_MISFIT * GOOD_MISFIT));
    found.into_iter().take(MOST_NORMALS).map(|f| f.1).collect()
}

/// Returns directions spread evenly over the half of the sphere before and around the camera, along Fibonacci's spiral.
fn directions() -> impl Iterator<Item = Vector3<f64>> {
    let golden = core::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..DIRECTIONS).map(move |i| {
        // z goes down to −0.5: the normal of a road is perpendicular to the axis of a level camera.
        let z = 1.0 - 1.5 * (i as f64 + 0.5) / DIRECTIONS as f64;
        let (across, angle) = ((1.0 - z * z).sqrt(), golden * i as f64);
        Vector3::new(across * angle.cos(), across * angle.sin(), z)
    })
}

/// Returns the normal scaled by the height that fits best, which is a mean: ln of a length falls by ln s when ν grows by s, eq. (22).
fn scaled(view: &View, n: &Vector3<f64>) -> Option<Vector3<f64>> {
    cost(view, n)?;
    let all: Option<Vec<f64>> = view.segments.iter().map(|s| misfit(s, n).map(|m| m.0)).collect();
    let all = all?;
    Some(n * (all.iter().sum::<f64>() / all.len() as f64).exp())
}

/// Returns the mean squared misfit and ν at the minimum reached from a direction.
fn descended(view: &View, start: Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
    let found = minimize_point(&start, |nu| cost(view, nu))?;
    Some((found.equations.chi2 * SIGMA * SIGMA / view.segments.len() as f64, found.state))
}

/// Returns the points where their rays meet the plane, in a frame whose z axis points from the plane to the camera.
fn laid(view: &View, nu: &Vector3<f64>, n_points: usize) -> Places {
    let z = -nu.normalize();
    let x = z.cross(&Vector3::ith(z.iamin(), 1.0)).normalize();
    let rotation = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    let foot = nu / nu.norm_squared();
    let mut places: Places = vec![None; n_points];
    for (point, ray) in &view.rays {
        let at: Point = ray / nu.dot(ray);
        places[*point] = Some(rotation * (at - foot));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the dashes of two lanes, as observed by a pitched and rolled camera that looks along the road.
    fn made(nu: &Vector3<f64>, ends: &[[[f64; 2]; 2]]) -> View {
        let at = |[x, y]: [f64; 2]| Vector3::new(x, y, 1.0).normalize();
        let segments = ends.iter().map(|[a, b]| {
            let ends = [at(*a), at(*b)];
            let [p, q] = ends.map(|r| r / nu.dot(&r));
            Segment { ends, length_m: (p - q).norm() }
        });
        let segments: Vec<Segment> = segments.collect();
        let rays = segments.iter().flat_map(|s| s.ends).enumerate().collect();
        View { segments, rays }
    }

    const ENDS: [[[f64; 2]; 2]; 5] = [
        [[-0.4, 0.30], [-0.3, 0.22]],
        [[-0.22, 0.16], [-0.17, 0.12]],
        [[0.5, 0.32], [0.35, 0.2]],
        [[0.24, 0.15], [0.18, 0.11]],
        [[0.02, 0.4], [0.01, 0.25]],
    ];

    #[test]
    fn the_plane_of_five_segments_is_found() {
        let nu = Vector3::new(0.05, 0.97, 0.2).normalize() / 1.6;
        let view = made(&nu, &ENDS);
        let found = normals(&view);
        assert!((found[0] - nu).norm() < 1e-8, "{found:?} {nu}");
    }

    /// Central differences err by h².
    #[test]
    fn gradients_match_central_differences() {
        const STEP: f64 = 1e-6;
        let nu = Vector3::new(0.05, 0.6, 0.2);
        let view = made(&Vector3::new(0.0, 0.6, 0.1), &ENDS);
        for segment in &view.segments {
            let (_, gradient) = misfit(segment, &nu).unwrap();
            for k in 0..3 {
                let at = |by: f64| misfit(segment, &(nu + Vector3::ith(k, by))).unwrap().0;
                let numeric = (at(STEP) - at(-STEP)) / (2.0 * STEP);
                assert!((numeric - gradient[k]).abs() < 1e-7, "{numeric} {}", gradient[k]);
            }
        }
    }
}
