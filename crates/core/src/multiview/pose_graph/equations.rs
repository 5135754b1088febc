//! The cost of all pairs and its minimum. Derivation: docs/math/pose_graph.md eqs. (1)–(7).
//!
//! ```text
//!   r = Log(M · P_a · P_b⁻¹)   ·   P_b ← Exp(δ_b) P_b, P_a ← Exp(δ_a) P_a:   r ← r − J δ_b + J Ad δ_a,   Ad that of P_b P_a⁻¹
//! ```

use super::PoseGraph;
use crate::least_squares::dense::{DenseEquations, minimize_dense};
use crate::locate::loss::Loss;
use crate::multiview::relative::residual;
use crate::{Error, Matrix6, Pose, Vector6};
use nalgebra::{DMatrix, DVector};

/// The result of an adjustment.
pub(super) struct Adjustment {
    pub poses: Vec<Pose>,
    /// 6 rows for each camera, zero for the reference camera.
    pub covariance: DMatrix<f64>,
    pub chi2: f64,
    pub steps: usize,
}

/// A pair's residual with its derivatives by both cameras.
pub(super) struct Linearised {
    pub residual: Vector6,
    /// ∂(−r)/∂δ_b.
    pub by_b: Matrix6,
    /// ∂(−r)/∂δ_a.
    pub by_a: Matrix6,
}

/// Returns r and its derivatives, eqs. (1), (4).
pub(super) fn linearised(graph: &PoseGraph, pair: usize, poses: &[Pose]) -> Linearised {
    let pair = &graph.pairs[pair];
    let predicted = poses[pair.b] * poses[pair.a].inverse();
    let (residual, by_b) = residual(&pair.b_from_a, &predicted);
    Linearised { residual, by_b, by_a: -(by_b * predicted.adjoint()) }
}

/// The weights of an adjustment: an information matrix for each pair, zero to leave it out, and a loss.
pub(super) struct Weights<'a> {
    pub information: &'a [Option<Matrix6>],
    pub loss: Loss,
}

/// Finds the minimum next to `start`; the reference camera is constant.
pub(super) fn adjust(
    graph: &PoseGraph,
    reference_camera: usize,
    start: Vec<Pose>,
    weights: &Weights,
) -> Result<Adjustment, Error> {
    if graph.n_cameras == 1 {
        return Ok(Adjustment { poses: start, covariance: DMatrix::zeros(6, 6), chi2: 0.0, steps: 0 });
    }
    let place = place(reference_camera);
    let evaluate = |poses: &Vec<Pose>| Some(equations(graph, poses, weights, place));
    let moved = |poses: &Vec<Pose>, step: &DVector<f64>| {
        let one = |(i, pose): (usize, &Pose)| match place(i) {
            Some(at) => pose.moved(&step.fixed_rows::<6>(at).into_owned()),
            None => *pose,
        };
        Some(poses.iter().enumerate().map(one).collect())
    };
    let solution = minimize_dense(start, evaluate, moved).filter(|solution| solution.is_minimum());
    let solution = solution.ok_or(Error::NotConverged { steps: 0 })?;
    let inverse =
        solution.equations.information.cholesky().ok_or(Error::NotConverged { steps: solution.steps })?;
    let covariance = with_reference_camera(graph.n_cameras, &inverse.inverse(), place);
    let chi2 = equations(graph, &solution.state, weights, place).chi2;
    Ok(Adjustment { poses: solution.state, covariance, chi2, steps: solution.steps })
}

/// Returns the covariance by the equations at given poses.
pub(super) fn covariance_at(
    graph: &PoseGraph,
    reference_camera: usize,
    poses: &[Pose],
    weights: &Weights,
) -> Result<DMatrix<f64>, Error> {
    let place = place(reference_camera);
    let inverse = equations(graph, poses, weights, place).information.cholesky();
    let inverse = inverse.ok_or(Error::NotConverged { steps: 0 })?.inverse();
    Ok(with_reference_camera(graph.n_cameras, &inverse, place))
}

/// The first of a camera's six unknowns; the reference camera has none.
fn place(reference_camera: usize) -> impl Fn(usize) -> Option<usize> + Copy {
    move |camera: usize| {
        (camera != reference_camera).then(|| 6 * (camera - usize::from(reference_camera < camera)))
    }
}

/// Inserts rows and columns of zeros for the reference camera.
fn with_reference_camera(
    n_cameras: usize,
    covariance: &DMatrix<f64>,
    place: impl Fn(usize) -> Option<usize>,
) -> DMatrix<f64> {
    DMatrix::from_fn(6 * n_cameras, 6 * n_cameras, |i, j| match (place(i / 6), place(j / 6)) {
        (Some(row), Some(column)) => covariance[(row + i % 6, column + j % 6)],
        _ => 0.0,
    })
}

fn equations(
    graph: &PoseGraph,
    poses: &[Pose],
    weights: &Weights,
    place: impl Fn(usize) -> Option<usize>,
) -> DenseEquations {
    let mut equations = DenseEquations::new(6 * (graph.n_cameras - 1));
    for (index, information) in weights.information.iter().enumerate() {
        let Some(information) = information else { continue };
        let pair = &graph.pairs[index];
        let Linearised { residual, by_b, by_a } = linearised(graph, index, poses);
        let (cost, slope) = weights.loss.at(residual.dot(&(information * residual)));
        equations.chi2 += cost;
        let sides = [(place(pair.b), by_b), (place(pair.a), by_a)];
        for (row, left) in sides {
            let Some(row) = row else { continue };
            let weighted: Matrix6 = left.transpose() * information * slope;
            let mut gradient = equations.gradient.fixed_rows_mut::<6>(row);
            gradient += weighted * residual;
            for (column, right) in sides {
                let Some(column) = column else { continue };
                let mut block = equations.information.fixed_view_mut::<6, 6>(row, column);
                block += weighted * right;
            }
        }
    }
    equations
}
