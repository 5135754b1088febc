//! The unknowns, and their indices in the joint vector.

use super::{Constraint, Item, NetworkProblem, Plane};
use crate::least_squares::arrow::Arrow;
use crate::{Camera, Point, Pose};
use nalgebra::{DMatrix, DVector, SymmetricEigen, Vector3, Vector6};
use std::collections::BTreeSet;
use std::sync::Arc;

/// All poses, positions and planes. Undetermined ones remain in the lists but are unused.
#[derive(Debug, Clone)]
pub(crate) struct State {
    pub(crate) photos: Vec<Pose>,
    pub(crate) points: Vec<Point>,
    pub(crate) planes: Vec<PlaneAt>,
    pub(crate) lenses: Vec<LensAt>,
    pub(crate) camera_of_photo: Vec<usize>,
}

/// A plane: the points with normal · (x − pivot) = height. The pivot is constant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlaneAt {
    pub(crate) normal: Vector3<f64>,
    pub(crate) pivot: Point,
    pub(crate) height_m: f64,
}

/// A camera with intrinsics θ₀ + L z, z unknown with mean 0 and covariance 1.
#[derive(Debug, Clone)]
pub(crate) struct LensAt {
    pub(crate) camera: Camera,
    base: Vec<f64>,
    /// L, with one column for each direction in which the intrinsics are uncertain.
    pub(crate) root: DMatrix<f64>,
    pub(crate) z: DVector<f64>,
}

/// The index of each unknown in the joint vector; none where it is held.
#[derive(Debug, Clone, Default)]
pub(crate) struct Layout {
    /// Index of the first of six unknowns.
    pub(crate) photo: Vec<Option<usize>>,
    pub(crate) point: Vec<[Option<usize>; 3]>,
    /// Index of the first of the two tilts.
    pub(crate) tilt: Vec<Option<usize>>,
    pub(crate) height: Vec<Option<usize>>,
    /// Index of the first of the columns of L.
    pub(crate) lens: Vec<usize>,
    pub(crate) n: usize,
    /// Directions that are undetermined and need not be determined: held by rows of residual 0.
    pub(crate) pins: Vec<DVector<f64>>,
    dropped: BTreeSet<Item>,
    /// The structure of the normal equations: groups of points that constraints join to no other point.
    arrow: Arc<Arrow>,
    /// The points of each group.
    members: Vec<Vec<usize>>,
}

/// Largest number of points, joined by distances and uprights, that form one group.
const LARGEST_GROUP: usize = 4;

/// Relative eigenvalues of the intrinsics' correlation below this are rounding errors.
const LEAST_EIGENVALUE: f64 = 1e-12;

impl LensAt {
    /// Builds a lens from the stated intrinsics, with the factor of their covariance: docs/math/survey.md eq. (3).
    pub(crate) fn new(camera: &Camera, covariance: Option<&[f64]>) -> Self {
        let base: Vec<f64> = camera.parameters().iter().map(|p| p.1).collect();
        let root = covariance.map_or(DMatrix::zeros(base.len(), 0), |c| root_of(c, base.len()));
        LensAt { camera: camera.clone(), z: DVector::zeros(root.ncols()), base, root }
    }

    fn moved(&self, by: &[f64]) -> Option<Self> {
        if by.is_empty() {
            return Some(self.clone());
        }
        let z = &self.z + DVector::from_column_slice(by);
        let change = &self.root * &z;
        let values: Vec<f64> = self.base.iter().zip(change.iter()).map(|(b, c)| b + c).collect();
        let camera = self.camera.with_parameters(&values).ok()?;
        Some(LensAt { camera, base: self.base.clone(), root: self.root.clone(), z })
    }
}

/// Returns L with L Lᵀ = C, by the eigenvectors of the correlation: parameters differ in unit by many orders of magnitude.
fn root_of(covariance: &[f64], n: usize) -> DMatrix<f64> {
    let c = DMatrix::from_row_slice(n, n, covariance);
    let sigma: Vec<f64> = (0..n).map(|i| c[(i, i)].max(0.0).sqrt()).collect();
    let known: Vec<usize> = (0..n).filter(|i| 0.0 < sigma[*i]).collect();
    let correlation = DMatrix::from_fn(known.len(), known.len(), |i, j| {
        c[(known[i], known[j])] / (sigma[known[i]] * sigma[known[j]])
    });
    if known.is_empty() {
        return DMatrix::zeros(n, 0);
    }
    let eigen = SymmetricEigen::new(correlation);
    let kept: Vec<usize> = (0..known.len()).filter(|k| LEAST_EIGENVALUE < eigen.eigenvalues[*k]).collect();
    let mut root = DMatrix::zeros(n, kept.len());
    for (column, k) in kept.iter().enumerate() {
        for (row, i) in known.iter().enumerate() {
            root[(*i, column)] = sigma[*i] * eigen.eigenvectors[(row, *k)] * eigen.eigenvalues[*k].sqrt();
        }
    }
    root
}

impl PlaneAt {
    pub(crate) fn known(normal: &Vector3<f64>, offset_m: f64) -> Self {
        PlaneAt { normal: *normal, pivot: normal * offset_m, height_m: 0.0 }
    }

    /// Returns the signed distance of a point, positive on the side of the normal.
    pub(crate) fn above_m(&self, x: &Point) -> f64 {
        self.normal.dot(&(x - self.pivot)) - self.height_m
    }

    /// Returns two unit vectors perpendicular to the normal: the directions of its two unknowns.
    pub(crate) fn tangents(&self) -> [Vector3<f64>; 2] {
        let first = self.normal.cross(&Vector3::ith(self.normal.iamin(), 1.0)).normalize();
        [first, self.normal.cross(&first).normalize()]
    }
}

impl State {
    /// Returns the state after a change of the unknowns; none where the intrinsics make no camera.
    pub(crate) fn moved(&self, layout: &Layout, by: &DVector<f64>) -> Option<State> {
        let mut state = self.clone();
        for (pose, at) in state.photos.iter_mut().zip(&layout.photo) {
            if let Some(at) = at {
                *pose = pose.moved(&Vector6::from_fn(|i, _| by[at + i]));
            }
        }
        for (x, at) in state.points.iter_mut().zip(&layout.point) {
            for axis in 0..3 {
                x[axis] += at[axis].map_or(0.0, |at| by[at]);
            }
        }
        for (index, plane) in state.planes.iter_mut().enumerate() {
            if let Some(at) = layout.tilt[index] {
                let [a, b] = plane.tangents();
                plane.normal = (plane.normal + a * by[at] + b * by[at + 1]).normalize();
            }
            plane.height_m += layout.height[index].map_or(0.0, |at| by[at]);
        }
        for (lens, at) in state.lenses.iter_mut().zip(&layout.lens) {
            *lens = lens.moved(&by.as_slice()[*at..at + lens.z.len()])?;
        }
        Some(state)
    }
}

/// Returns the groups of points joined by constraints; points that are held or joined to many others belong to no group.
fn groups(network: &NetworkProblem, layout: &Layout) -> Vec<Vec<usize>> {
    let mut group_of: Vec<usize> = (0..network.n_points).collect();
    let mut members: Vec<Vec<usize>> = (0..network.n_points).map(|p| vec![p]).collect();
    for constraint in network.constraints.iter().filter(|f| layout.has(f)) {
        let [Some(a), Some(b)] = constraint.points() else { continue };
        let (a, b) = (group_of[a], group_of[b]);
        if a != b {
            let joined = core::mem::take(&mut members[b]);
            joined.iter().for_each(|p| group_of[*p] = a);
            members[a].extend(joined);
        }
    }
    let is_free = |p: &usize| layout.point[*p].iter().any(Option::is_some);
    let is_group = |points: &Vec<usize>| {
        !points.is_empty() && points.len() <= LARGEST_GROUP && points.iter().any(is_free)
    };
    members.retain(is_group);
    members
}

impl Layout {
    /// Numbers all unknowns of a network except those of `dropped` items and of coordinates that are `held`.
    pub(crate) fn new(
        network: &NetworkProblem,
        state: &State,
        dropped: &[Item],
        held: &[(usize, usize)],
    ) -> Self {
        let mut layout = Layout { dropped: dropped.iter().copied().collect(), ..Layout::default() };
        let mut n = 0;
        let mut take = |many: usize| {
            n += many;
            n - many
        };
        let exact = |photo: usize| {
            let is = |f: &Constraint| matches!(f, Constraint::Pose { photo: p, covariance: None, .. } if *p == photo);
            network.constraints.iter().any(is)
        };
        for photo in 0..network.camera_of_photo.len() {
            let free = !dropped.contains(&Item::Photo(photo)) && !exact(photo);
            layout.photo.push(free.then(|| take(6)));
        }
        for point in 0..network.n_points {
            let fixed = |axis: usize| held.contains(&(point, axis));
            let free = !dropped.contains(&Item::Point(point));
            layout.point.push([0, 1, 2].map(|axis| (free && !fixed(axis)).then(|| take(1))));
        }
        for (index, plane) in network.planes.iter().enumerate() {
            let free = *plane == Plane::Unknown && !dropped.contains(&Item::Plane(index));
            let has_points =
                layout.uses(network, |f| matches!(f, Constraint::OnPlane { plane, .. } if *plane == index));
            layout.tilt.push(free.then(|| take(2)));
            layout.height.push((free && has_points).then(|| take(1)));
        }
        for lens in &state.lenses {
            layout.lens.push(take(lens.z.len()));
        }
        layout.n = n;
        layout.members = groups(network, &layout);
        layout.arrange();
        layout
    }

    /// Holds directions that are undetermined. Their rows join all unknowns, so that no groups remain.
    pub(crate) fn pin(&mut self, pins: Vec<DVector<f64>>) {
        if !pins.is_empty() {
            self.members.clear();
            self.arrange();
        }
        self.pins = pins;
    }

    fn arrange(&mut self) {
        let unknowns = |points: &Vec<usize>| points.iter().flat_map(|p| self.point[*p]).flatten().collect();
        self.arrow = Arc::new(Arrow::new(self.n, self.members.iter().map(unknowns).collect()));
    }

    /// Returns the structure of the normal equations.
    pub(crate) fn arrow(&self) -> &Arc<Arrow> {
        &self.arrow
    }

    /// Returns the points of each group.
    pub(crate) fn members(&self) -> &[Vec<usize>] {
        &self.members
    }

    /// Returns the layout without some groups, and the old index of each of its unknowns.
    pub(crate) fn without(&self, is_left_out: impl Fn(usize) -> bool) -> (Layout, Vec<usize>) {
        let mut rest = self.clone();
        let out: Vec<usize> = (0..self.members.len())
            .filter(|g| is_left_out(*g))
            .flat_map(|g| self.members[g].clone())
            .collect();
        let gone: BTreeSet<usize> = out.iter().flat_map(|p| self.point[*p]).flatten().collect();
        let kept: Vec<usize> = (0..self.n).filter(|i| !gone.contains(i)).collect();
        let mut now = vec![None; self.n];
        kept.iter().enumerate().for_each(|(k, was)| now[*was] = Some(k));
        let moved = |at: &mut Option<usize>| *at = at.and_then(|at| now[at]);
        rest.photo.iter_mut().chain(&mut rest.tilt).chain(&mut rest.height).for_each(moved);
        rest.point.iter_mut().flatten().for_each(moved);
        // A lens without unknowns has the index at which the next one begins.
        let first = |at: usize| kept.iter().position(|was| at <= *was).unwrap_or(kept.len());
        rest.lens.iter_mut().for_each(|at| *at = first(*at));
        rest.n = kept.len();
        rest.dropped.extend(out.into_iter().map(Item::Point));
        rest.members =
            (0..self.members.len()).filter(|g| !is_left_out(*g)).map(|g| self.members[g].clone()).collect();
        rest.arrange();
        (rest, kept)
    }

    fn uses(&self, network: &NetworkProblem, is: impl Fn(&Constraint) -> bool) -> bool {
        network.constraints.iter().any(|f| is(f) && self.has(f))
    }

    pub(crate) fn has_photo(&self, photo: usize) -> bool {
        photo < self.photo.len() && !self.dropped.contains(&Item::Photo(photo))
    }

    pub(crate) fn has_point(&self, point: usize) -> bool {
        point < self.point.len() && !self.dropped.contains(&Item::Point(point))
    }

    pub(crate) fn has_plane(&self, plane: usize) -> bool {
        plane < self.tilt.len() && !self.dropped.contains(&Item::Plane(plane))
    }

    /// Returns whether all points, photographs and planes of a constraint are determined.
    pub(crate) fn has(&self, constraint: &Constraint) -> bool {
        let is_dropped = |item: Item| self.dropped.contains(&item);
        !(constraint.points().into_iter().flatten().any(|p| is_dropped(Item::Point(p)))
            || constraint.photo().is_some_and(|p| is_dropped(Item::Photo(p)))
            || constraint.plane().is_some_and(|p| is_dropped(Item::Plane(p))))
    }
}
