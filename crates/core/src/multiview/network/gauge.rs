//! The frame of the positions: the part that the constraints determine, and the part that must be held. docs/math/survey.md, section 4.

use super::state::{Layout, State};
use super::{Constraint, Frame, Item, NetworkProblem, Plane, rows};
use crate::{Point, Pose, Vector6};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, SymmetricEigen, Vector3};

/// Smallest height over longest side of the triangle that spans the frame.
const LEAST_HEIGHT: f64 = 0.05;
/// A motion of everything is free if its information, relative to that of the best known motion, is below this.
const FREE: f64 = 1e-10;

/// Returns the first control point, the second, and the first one far enough from the line through them.
pub(super) fn frame_control_points(places: &[Option<Point>]) -> Option<[usize; 3]> {
    let control_points: Vec<usize> = (0..places.len()).filter(|p| places[*p].is_some()).collect();
    let at = |p: usize| places[p].unwrap_or_default();
    let (a, b) = (*control_points.first()?, *control_points.get(1)?);
    let ab = at(b) - at(a);
    let off = |c: usize| {
        let ac = at(c) - at(a);
        let height = ab.cross(&ac).norm() / ab.norm();
        LEAST_HEIGHT * ab.norm().max(ac.norm()) < height
    };
    control_points.into_iter().skip(2).find(|c| off(*c)).map(|c| [a, b, c])
}

/// Returns whether coordinates, poses or known planes determine any part of the frame.
pub(super) fn is_given(network: &NetworkProblem) -> bool {
    let speaks = |f: &Constraint| match f {
        Constraint::Place { .. } | Constraint::Pose { .. } => true,
        Constraint::OnPlane { plane, .. } | Constraint::Upright { plane, .. } => {
            network.planes[*plane] != Plane::Unknown
        }
        _ => false,
    };
    network.constraints.iter().any(speaks)
}

/// Returns the layout of the unknowns in the frame, and the frame.
pub(super) fn layout(
    network: &NetworkProblem,
    state: &State,
    dropped: &[Item],
    control_points: Option<[usize; 3]>,
) -> (Layout, Frame) {
    let mut held = exact_coordinates(network);
    if let (Some([a, b, c]), false) = (control_points, is_given(network)) {
        held.extend([(a, 0), (a, 1), (a, 2), (b, 1), (b, 2), (c, 2)]);
        return (Layout::new(network, state, dropped, &held), Frame::ControlPoints([a, b, c]));
    }
    let mut layout = Layout::new(network, state, dropped, &held);
    layout.pin(free_motions(network, state, &layout));
    let frame = if layout.pins.is_empty() { Frame::Given } else { Frame::Held };
    (layout, frame)
}

/// Returns the same state rotated by half a turn about an axis of the frame, and with normals reversed, where the adjustment moved the cameras
/// to the other side of the plane, or the second control point to the negative x axis; none where neither happened.
pub(super) fn facing_cameras(
    network: &NetworkProblem,
    state: &State,
    layout: &Layout,
    frame: Frame,
) -> Option<State> {
    let centres: Vec<Point> =
        (0..state.photos.len()).filter(|p| layout.has_photo(*p)).map(|p| state.photos[p].origin()).collect();
    let mut turned = state.clone();
    let mut is_turned = false;
    if let Frame::ControlPoints([a, b, _]) = frame {
        let is_below = centres.iter().map(|c| c.z - state.points[a].z).sum::<f64>() < 0.0;
        let is_back = state.points[b].x < state.points[a].x;
        let sign = |is: bool| if is { -1.0 } else { 1.0 };
        let (x, z) = (sign(is_back), sign(is_below));
        // A rotation, never a mirror image: y follows from the two others.
        let half = Pose::new(Matrix3::from_diagonal(&Vector3::new(x, x * z, z)), Point::zeros());
        turned.points.iter_mut().for_each(|x| *x = half * *x);
        turned.photos.iter_mut().for_each(|pose| *pose = *pose * half);
        turned.planes.iter_mut().for_each(|plane| {
            (plane.normal, plane.pivot) = (half.rotation * plane.normal, half * plane.pivot);
        });
        is_turned = is_below || is_back;
    }
    for (index, plane) in network.planes.iter().enumerate() {
        let is_level = network
            .constraints
            .iter()
            .any(|f| matches!(f, Constraint::Gravity { plane, .. } if *plane == index));
        let at = state.planes[index];
        let side: f64 = centres.iter().map(|c| at.above_m(c)).sum();
        if *plane == Plane::Unknown && layout.has_plane(index) && !is_level && side < 0.0 {
            let found = &mut turned.planes[index];
            (found.normal, found.height_m) = (-found.normal, -found.height_m);
            is_turned = true;
        }
    }
    is_turned.then_some(turned)
}

fn exact_coordinates(network: &NetworkProblem) -> Vec<(usize, usize)> {
    let of = |f: &Constraint| match f {
        Constraint::Place { point, sigma_m, .. } => {
            let (point, sigma_m) = (*point, *sigma_m);
            (0..3).filter(|axis| sigma_m[*axis] == 0.0).map(|axis| (point, axis)).collect()
        }
        _ => Vec::new(),
    };
    network.constraints.iter().flat_map(of).collect()
}

/// Returns the motions of everything that no constraint resists, as directions of the unknowns.
fn free_motions(network: &NetworkProblem, state: &State, layout: &Layout) -> Vec<DVector<f64>> {
    let Some(equations) = rows::equations(network.constraints, state, layout) else { return Vec::new() };
    // An exact pose fixes the frame, but the information matrix does not show it.
    let held = layout.photo.iter().enumerate().any(|(i, at)| at.is_none() && layout.has_photo(i));
    if held {
        return Vec::new();
    }
    let (centre, size) = middle(state, layout);
    let exact: Vec<(usize, usize)> = exact_coordinates(network);
    let generators = DMatrix::from_columns(&[0, 1, 2, 3, 4, 5].map(|k| {
        let unit = Vector3::ith(k % 3, 1.0);
        // Rotations about the middle, of a size that moves the farthest point by one unit, as a translation does.
        let (turn, shift) =
            if k < 3 { (unit / size, centre.cross(&unit) / size) } else { (Vector3::zeros(), unit) };
        generator(state, layout, &Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z))
    }));
    let along: Vec<DVector<f64>> =
        generators.column_iter().map(|column| equations.times(&column.into_owned())).collect();
    let resisted = Matrix6::from_fn(|i, j| generators.column(i).dot(&along[j]));
    let exact_part = resistance_of_exact(state, &exact, &centre, size);
    let eigen = SymmetricEigen::new(resisted + exact_part * resisted.amax().max(1.0));
    let most = eigen.eigenvalues.amax();
    let weight = equations.diagonal().iter().sum::<f64>() / layout.n.max(1) as f64;
    let is_free = |k: &usize| eigen.eigenvalues[*k] < FREE * most;
    let pin = |k: usize| {
        let direction = &generators * eigen.eigenvectors.column(k);
        let length = direction.norm();
        direction * (weight.sqrt() / length)
    };
    (0..6).filter(is_free).map(pin).collect()
}

/// Returns the resistance of coordinates held exactly, each counted as if it were known to one metre.
fn resistance_of_exact(state: &State, exact: &[(usize, usize)], centre: &Point, size: f64) -> Matrix6<f64> {
    let mut sum = Matrix6::zeros();
    for (point, axis) in exact {
        let x = state.points[*point] - centre;
        let by = Vector6::from_fn(|k, _| {
            let unit = Vector3::ith(k % 3, 1.0);
            if k < 3 { unit.cross(&x)[*axis] / size } else { unit[*axis] }
        });
        sum += by * by.transpose();
    }
    sum
}

fn middle(state: &State, layout: &Layout) -> (Point, f64) {
    let points: Vec<Point> =
        (0..state.points.len()).filter(|p| layout.has_point(*p)).map(|p| state.points[p]).collect();
    let centre = points.iter().sum::<Point>() / points.len().max(1) as f64;
    let size = points.iter().map(|x| (x - centre).norm()).fold(0.0, f64::max);
    (centre, if 0.0 < size { size } else { 1.0 })
}

/// Returns the change of the unknowns when everything moves by ξ in the world frame: docs/math/survey.md eq. (11).
fn generator(state: &State, layout: &Layout, motion: &Vector6) -> DVector<f64> {
    let (turn, shift) =
        (Vector3::new(motion[0], motion[1], motion[2]), Vector3::new(motion[3], motion[4], motion[5]));
    let mut change = DVector::zeros(layout.n);
    for (pose, at) in state.photos.iter().zip(&layout.photo) {
        if let Some(at) = at {
            change.rows_mut(*at, 6).copy_from(&-(pose.adjoint() * motion));
        }
    }
    for (x, at) in state.points.iter().zip(&layout.point) {
        let moved = turn.cross(x) + shift;
        for axis in 0..3 {
            if let Some(at) = at[axis] {
                change[at] = moved[axis];
            }
        }
    }
    for (index, plane) in state.planes.iter().enumerate() {
        let on_it = plane.pivot + plane.normal * plane.height_m;
        if let Some(at) = layout.tilt[index] {
            for (k, b) in plane.tangents().iter().enumerate() {
                change[at + k] = b.dot(&turn.cross(&plane.normal));
            }
        }
        if let Some(at) = layout.height[index] {
            change[at] = plane.normal.dot(&(turn.cross(&on_it) + shift));
        }
    }
    change
}
