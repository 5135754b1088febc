//! Constraints as whitened residuals, observed − predicted, with the derivatives of the prediction: docs/math/survey.md eqs. (2)–(8).

use super::Constraint;
use super::state::{Layout, PlaneAt, State};
use crate::least_squares::arrow::ArrowEquations;
use crate::locate::factor::{Factor, factors};
use crate::locate::prior::Prior;
use crate::multiview::triangulate::matrix_of;
use crate::{Matrix6, Point, Pose};
use nalgebra::{Matrix2xX, Vector3};

/// A whitened residual and the derivatives of the prediction by the unknowns.
pub(crate) struct Row {
    pub(crate) residual: f64,
    pub(crate) entries: Vec<(usize, f64)>,
}

impl Row {
    fn new(residual: f64) -> Self {
        Row { residual, entries: Vec::with_capacity(12) }
    }

    fn by_point(mut self, layout: &Layout, point: usize, by: &Vector3<f64>) -> Self {
        for axis in 0..3 {
            self.entries.extend(layout.point[point][axis].map(|at| (at, by[axis])));
        }
        self
    }

    fn by(mut self, at: Option<usize>, values: &[f64]) -> Self {
        if let Some(at) = at {
            self.entries.extend(values.iter().enumerate().map(|(i, x)| (at + i, *x)));
        }
        self
    }
}

/// Returns the rows of one constraint; none where a point leaves its camera's field.
pub(crate) fn rows(constraint: &Constraint, state: &State, layout: &Layout) -> Option<Vec<Row>> {
    Some(match constraint {
        Constraint::ImagePoint { .. } => image_point(constraint, state, layout)?,
        Constraint::Place { point, x_in_world, sigma_m } => {
            let off = x_in_world - state.points[*point];
            let free = (0..3).filter(|axis| 0.0 < sigma_m[*axis]);
            free.map(|axis| {
                let by = Vector3::ith(axis, 1.0 / sigma_m[axis]);
                Row::new(off[axis] / sigma_m[axis]).by_point(layout, *point, &by)
            })
            .collect()
        }
        Constraint::Distance { a, b, distance_m, sigma_m } => {
            let between = state.points[*a] - state.points[*b];
            let direction = between.normalize() / *sigma_m;
            let row = Row::new((distance_m - between.norm()) / sigma_m);
            vec![row.by_point(layout, *a, &direction).by_point(layout, *b, &-direction)]
        }
        Constraint::OnPlane { plane, point, sigma_m } => {
            let (at, x) = (&state.planes[*plane], &state.points[*point]);
            let tilts = at.tangents().map(|b| b.dot(&(x - at.pivot)) / sigma_m);
            let row = Row::new(-at.above_m(x) / sigma_m).by_point(layout, *point, &(at.normal / *sigma_m));
            vec![row.by(layout.tilt[*plane], &tilts).by(layout.height[*plane], &[-1.0 / sigma_m])]
        }
        Constraint::Upright { plane, foot, top, sigma_rad } => {
            upright(&state.planes[*plane], [*foot, *top], *sigma_rad, layout.tilt[*plane], state, layout)
        }
        Constraint::Gravity { .. } => gravity(constraint, state, layout),
        Constraint::Pose { photo, cam_from_world, covariance: Some(covariance) } => {
            of_pose(&state.photos[*photo], cam_from_world, covariance, layout.photo[*photo])
        }
        Constraint::Pose { covariance: None, .. } => Vec::new(),
    })
}

/// Returns the rows of the direction down as a camera measures it; a rotation of the plane's normal moves the predicted direction as a rotation
/// of the camera would.
fn gravity(constraint: &Constraint, state: &State, layout: &Layout) -> Vec<Row> {
    let Constraint::Gravity { plane, photo, down_in_cam, sigma_rad } = constraint else { return Vec::new() };
    let (pose, at) = (&state.photos[*photo], &state.planes[*plane]);
    let prior =
        Prior::Gravity { down_in_target: -at.normal, down_in_cam: *down_in_cam, sigma_rad: *sigma_rad };
    let predicted = -(pose.rotation * at.normal);
    let turns = at.tangents().map(|b| predicted.cross(&-(pose.rotation * b)));
    let with_tilt = |f: &Factor| {
        let tilts = turns.map(|turn| f.by_rotation.dot(&turn));
        by_motion(f, layout.photo[*photo]).by(layout.tilt[*plane], &tilts)
    };
    factors(&prior, pose).iter().map(with_tilt).collect()
}

fn by_motion(f: &Factor, at: Option<usize>) -> Row {
    Row::new(f.residual).by(at, &[f.by_rotation.as_slice(), f.by_translation.as_slice()].concat())
}

fn of_pose(pose: &Pose, expected: &Pose, covariance: &Matrix6, at: Option<usize>) -> Vec<Row> {
    let prior = Prior::Pose { cam_from_target: *expected, covariance: *covariance };
    factors(&prior, pose).iter().map(|f| by_motion(f, at)).collect()
}

/// Returns the rows of a pixel by pose, point and intrinsics, whitened by the inverse of Cholesky's factor of the pixel covariance.
fn image_point(constraint: &Constraint, state: &State, layout: &Layout) -> Option<Vec<Row>> {
    let Constraint::ImagePoint { photo, point, pixel, covariance_px2 } = constraint else {
        return Some(Vec::new());
    };
    let pose = &state.photos[*photo];
    let camera = state.camera_of_photo[*photo];
    let lens = &state.lenses[camera];
    let x = pose * &state.points[*point];
    let (predicted, by_point) = lens.camera.project_with_jacobian(&x)?;
    let whitening = matrix_of(covariance_px2).cholesky()?.l().try_inverse()?;
    let residual = whitening * (pixel - predicted);
    let by_x = whitening * by_point;
    let (by_turn, by_world) = (by_x * -x.cross_matrix(), by_x * pose.rotation);
    let by_z = if lens.z.is_empty() {
        Matrix2xX::zeros(0)
    } else {
        let columns = lens.camera.intrinsics_jacobian(&x)?;
        whitening * Matrix2xX::from_columns(&columns) * &lens.root
    };
    let row = |i: usize| {
        let motion: [f64; 6] =
            core::array::from_fn(|k| if k < 3 { by_turn[(i, k)] } else { by_x[(i, k - 3)] });
        let by_lens: Vec<f64> = by_z.row(i).iter().copied().collect();
        Row::new(residual[i])
            .by(layout.photo[*photo], &motion)
            .by_point(layout, *point, &by_world.row(i).transpose())
            .by(Some(layout.lens[camera]), &by_lens)
    };
    Some(vec![row(0), row(1)])
}

/// Returns the rows of the inclination of top over foot about the plane's two tangents, as sines.
fn upright(
    plane: &PlaneAt,
    [foot, top]: [usize; 2],
    sigma_rad: f64,
    tilt: Option<usize>,
    state: &State,
    layout: &Layout,
) -> Vec<Row> {
    let between: Point = state.points[top] - state.points[foot];
    let length = between.norm();
    let d = between / length;
    let lean = |k: usize, b: &Vector3<f64>| {
        let by_top = (b - d * d.dot(b)) / (length * sigma_rad);
        let mut tilts = [0.0; 2];
        tilts[k] = -plane.normal.dot(&d) / sigma_rad;
        let row = Row::new(-b.dot(&d) / sigma_rad);
        row.by_point(layout, top, &by_top).by_point(layout, foot, &-by_top).by(tilt, &tilts)
    };
    plane.tangents().iter().enumerate().map(|(k, b)| lean(k, b)).collect()
}

/// Returns the prior z ~ N(0, 1) of each uncertain direction of the intrinsics.
pub(crate) fn lens_rows(state: &State, layout: &Layout) -> Vec<Row> {
    let of = |(lens, at): (&super::state::LensAt, &usize)| {
        let at = *at;
        let z: Vec<f64> = lens.z.iter().copied().collect();
        z.into_iter().enumerate().map(move |(i, z)| Row::new(-z).by(Some(at + i), &[1.0])).collect::<Vec<_>>()
    };
    state.lenses.iter().zip(&layout.lens).flat_map(of).collect()
}

/// Returns the rows that hold the unknowns that the frame leaves free.
pub(crate) fn pin_rows(layout: &Layout) -> impl Iterator<Item = Row> {
    layout.pins.iter().map(|pin| Row::new(0.0).by(Some(0), pin.as_slice()))
}

/// Returns the equations of all constraints at a state.
pub(crate) fn equations(
    constraints: &[Constraint],
    state: &State,
    layout: &Layout,
) -> Option<ArrowEquations> {
    let mut sum = ArrowEquations::new(layout.arrow());
    for constraint in constraints.iter().filter(|f| layout.has(f)) {
        for row in rows(constraint, state, layout)? {
            sum.add(row.residual, &row.entries);
        }
    }
    for row in lens_rows(state, layout).into_iter().chain(pin_rows(layout)) {
        sum.add(row.residual, &row.entries);
    }
    sum.chi2.is_finite().then_some(sum)
}

/// Returns the number of residuals.
pub(crate) fn n_rows(constraints: &[Constraint], state: &State, layout: &Layout) -> usize {
    let of_constraints = constraints.iter().filter(|f| layout.has(f)).filter_map(|f| rows(f, state, layout));
    of_constraints.map(|rows| rows.len()).sum::<usize>() + lens_rows(state, layout).len() + layout.pins.len()
}

#[cfg(test)]
mod tests {
    use super::super::state::LensAt;
    use super::super::{NetworkProblem, Plane, Query};
    use super::*;
    use crate::camera::BrownConrady;
    use crate::multiview::triangulate::isotropic;
    use crate::{Camera, CameraMatrix, Vector6};
    use nalgebra::DVector;

    /// A state in which nothing is met exactly, and one constraint of each kind.
    fn made() -> (State, Layout, Vec<Constraint>) {
        let matrix = CameraMatrix { fx_px: 900.0, fy_px: 910.0, cx_px: 320.0, cy_px: 240.0 };
        let lens = BrownConrady::new(matrix, &[-0.2, 0.05, 1e-3, -1e-3]).unwrap();
        let camera = Camera { lens: lens.into(), size: None };
        let covariance: Vec<f64> = (0..64)
            .map(|i| if i % 9 == 0 { [9.0, 8.0, 4.0, 4.0, 1e-4, 1e-4, 1e-6, 1e-6][i / 9] } else { 0.0 })
            .collect();
        let pose = Pose::exp(&Vector6::new(0.2, -0.3, 0.1, 0.3, -0.2, 6.0));
        let normal = Vector3::new(0.1, 0.3, 1.0).normalize();
        let plane = PlaneAt { normal, pivot: Point::new(0.3, 0.1, 0.2), height_m: 0.05 };
        let points = vec![Point::new(0.2, -0.3, 0.4), Point::new(-0.8, 0.5, 0.9), Point::new(0.7, 0.6, -0.5)];
        let lens = LensAt::new(&camera, Some(&covariance));
        let state = State {
            photos: vec![pose],
            points,
            planes: vec![plane],
            lenses: vec![lens],
            camera_of_photo: vec![0],
        };
        let down_in_cam = -(pose.rotation * Vector3::new(0.2, 0.1, 1.0)).normalize();
        let off = Pose::exp(&Vector6::new(0.02, 0.01, -0.03, 0.1, 0.05, -0.1));
        let constraints = vec![
            Constraint::ImagePoint {
                photo: 0,
                point: 0,
                pixel: crate::Pixel::new(300.0, 250.0),
                covariance_px2: crate::correspondence::PixelCovariance { uv_px2: 0.1, ..isotropic(0.7) },
            },
            Constraint::Place { point: 1, x_in_world: Point::zeros(), sigma_m: Vector3::new(0.1, 0.2, 0.3) },
            Constraint::Distance { a: 0, b: 2, distance_m: 1.0, sigma_m: 0.03 },
            Constraint::OnPlane { plane: 0, point: 1, sigma_m: 0.02 },
            Constraint::Upright { plane: 0, foot: 0, top: 1, sigma_rad: 0.05 },
            Constraint::Gravity { plane: 0, photo: 0, down_in_cam, sigma_rad: 0.05 },
            Constraint::Pose {
                photo: 0,
                cam_from_world: off * pose,
                covariance: Some(Matrix6::identity() * 0.04),
            },
        ];
        let network = NetworkProblem {
            cameras: &[],
            camera_of_photo: &[0],
            n_points: 3,
            planes: &[Plane::Unknown],
            constraints: &constraints,
        };
        let layout = Layout::new(&network, &state, &[], &[]);
        (state, layout, constraints)
    }

    /// Central differences err by h² and ε/h; residuals here are up to 100 standard deviations. The tangents of the upright rotate with the
    /// normal, so its rows are compared through their sum of squares, whose derivative is −2 rᵀJ.
    #[test]
    fn rows_match_central_differences() {
        const STEP: f64 = 1e-6;
        let (state, layout, constraints) = made();
        for constraint in &constraints {
            let found = rows(constraint, &state, &layout).unwrap();
            for k in 0..layout.n {
                let at = |by: f64| {
                    let mut change = DVector::zeros(layout.n);
                    change[k] = by;
                    let moved = rows(constraint, &state.moved(&layout, &change).unwrap(), &layout).unwrap();
                    moved.iter().map(|r| r.residual * r.residual).sum::<f64>()
                };
                let numeric = (at(STEP) - at(-STEP)) / (2.0 * STEP);
                let by = |r: &Row| r.entries.iter().filter(|e| e.0 == k).map(|e| e.1).sum::<f64>();
                let exact: f64 = found.iter().map(|r| -2.0 * r.residual * by(r)).sum();
                let size = found.iter().map(|r| r.residual.abs() * (1.0 + by(r).abs())).sum::<f64>();
                assert!(
                    (numeric - exact).abs() < 1e-5 * (1.0 + size),
                    "{constraint:?} by {k}: {numeric} {exact}"
                );
            }
        }
    }

    #[test]
    fn gradients_of_queries_match_central_differences() {
        const STEP: f64 = 1e-6;
        let (state, layout, _) = made();
        for query in [
            Query::Distance { a: 0, b: 1 },
            Query::Polyline { points: vec![0, 1, 2] },
            Query::Angle { a: 0, vertex: 1, b: 2 },
            Query::Area { points: vec![0, 1, 2] },
            Query::Height { plane: 0, point: 2 },
            Query::Coordinate { point: 1, axis: 2 },
        ] {
            let (_, gradient) = query.value(&state, &layout);
            for k in 0..layout.n {
                let at = |by: f64| {
                    let mut change = DVector::zeros(layout.n);
                    change[k] = by;
                    query.value(&state.moved(&layout, &change).unwrap(), &layout).0
                };
                let numeric = (at(STEP) - at(-STEP)) / (2.0 * STEP);
                assert!((numeric - gradient[k]).abs() < 1e-8, "{query:?} by {k}: {numeric} {}", gradient[k]);
            }
        }
    }
}
