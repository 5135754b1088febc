//! Errors that neighbouring views share, as of a robot whose accuracy depends on where it is: docs/math/hand_eye.md section 7.

use super::noise::{At, Effects, Normal, Row};
use crate::Pose;
use crate::multiview::shared_blocks::{LEAST_PROBABILITY, MOST, ODDS, inflated, numbers_of_blocks};
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};

/// Fewer views do not show what neighbours share.
const SHOWING_VIEWS: usize = 12;
/// Directions in which a block has less than this part of the information are not its own.
const LEAST_PART: f64 = 1e-9;

/// Returns by which factors the covariances of X and of Z of independent views are too small, eqs. (32)–(34): 1 where blocks of views differ by no more
/// than their noise, be they neighbours in time, in the orientation of the gripper or in its position. `noise_scale` is the factor of the variances that
/// the views show already.
pub(super) fn factors(rows: &[Row], at: &At, hands: &[Pose], noise_scale: f64) -> [f64; 2] {
    if rows.len() < SHOWING_VIEWS {
        return [1.0; 2];
    }
    let counts: Vec<usize> = numbers_of_blocks(rows.len()).collect();
    let orders = [(0..rows.len()).collect(), along(&rotations(hands)), along(&positions(hands))];
    let odds = ODDS / (counts.len() * orders.len()) as f64;
    let phi = at.phi.fixed_view::<12, 12>(0, 0).into_owned();
    let both = DMatrix::identity(12, 12);
    let parts = [0, 6].map(|part| onto(&phi, part));
    let [Some(x), Some(z)] = parts else { return [1.0; 2] };
    let (mut sums, mut weight) = ([1.0; 2], 1.0);
    for (order, count) in orders.iter().flat_map(|order| counts.iter().map(move |count| (order, *count))) {
        let blocks = blocks(rows, at, order, count);
        let inflation = |onto| {
            let (chi2, degrees_of_freedom) = disagreement(&blocks, &phi, onto)?;
            inflated(chi2 / noise_scale, degrees_of_freedom)
        };
        let (Some((evidence, _)), Some((_, of_x)), Some((_, of_z))) =
            (inflation(&both), inflation(&x), inflation(&z))
        else {
            continue;
        };
        weight += odds * evidence;
        sums = [sums[0] + odds * evidence * of_x, sums[1] + odds * evidence * of_z];
    }
    sums.map(|sum| match sum / weight {
        _ if weight < 1.0 / (1.0 - LEAST_PROBABILITY) => 1.0,
        scale if scale.is_finite() => scale,
        _ => MOST,
    })
}

/// Returns the rotations from the first hand to each.
fn rotations(hands: &[Pose]) -> Vec<Vector3<f64>> {
    let from_first = |hand: &Pose| (*hand * hands[0].inverse()).log().fixed_rows::<3>(0).into_owned();
    hands.iter().map(from_first).collect()
}

fn positions(hands: &[Pose]) -> Vec<Vector3<f64>> {
    hands.iter().map(|hand| hand.translation).collect()
}

/// Returns the order of places along the axis on which they are farthest apart.
fn along(places: &[Vector3<f64>]) -> Vec<usize> {
    let mean = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
    let spread: Matrix3<f64> = places.iter().map(|x| (x - mean) * (x - mean).transpose()).sum();
    let eigen = spread.symmetric_eigen();
    let axis = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|a, b| axis.dot(&places[*a]).total_cmp(&axis.dot(&places[*b])));
    order
}

/// The information of the views of a block about X and Z, and their pull.
type Block = (SMatrix<f64, 12, 12>, SVector<f64, 12>);

fn blocks(rows: &[Row], at: &At, order: &[usize], n_blocks: usize) -> Vec<Block> {
    let block = |block: usize| {
        let range = block * order.len() / n_blocks..(block + 1) * order.len() / n_blocks;
        let (mut information, mut pull) = (Normal::zeros(), Effects::zeros());
        for (row, w) in order[range].iter().map(|i| (&rows[*i], &at.weights[*i])) {
            let weighted = row.design.transpose() * w;
            information += weighted * row.design;
            pull += weighted * (row.residual - row.design * at.effects);
        }
        (information.fixed_view::<12, 12>(0, 0).into_owned(), pull.fixed_rows::<12>(0).into_owned())
    };
    (0..n_blocks).map(block).collect()
}

/// Returns what maps the pull on X and Z to that on X (`part` 0) or Z (6) with the other eliminated.
fn onto(phi: &SMatrix<f64, 12, 12>, part: usize) -> Option<DMatrix<f64>> {
    let own = phi.fixed_view::<6, 6>(part, part).into_owned().try_inverse()?;
    let onto = own * phi.fixed_view::<6, 12>(part, 0);
    Some(DMatrix::from_fn(6, 12, |i, j| onto[(i, j)]))
}

/// Returns χ² of what the blocks want, and its mean, eq. (32); `None` where a number is not finite.
fn disagreement(blocks: &[Block], phi: &SMatrix<f64, 12, 12>, onto: &DMatrix<f64>) -> Option<(f64, f64)> {
    // In units of the standard deviations: radians and metres differ.
    let unit = |i: usize| (onto.row(i) * phi * onto.row(i).transpose())[0].sqrt().recip();
    let onto = DMatrix::from_fn(onto.nrows(), 12, |i, j| onto[(i, j)] * unit(i));
    let (mut chi2, mut mean) = (0.0, 0.0);
    for (information, pull) in blocks {
        let pull = &onto * pull;
        let covariance = &onto * (information - information * phi * information) * onto.transpose();
        let information = &onto * information * onto.transpose();
        if !information.iter().all(|x| x.is_finite()) {
            return None;
        }
        let eigen = information.symmetric_eigen();
        let least = LEAST_PART * eigen.eigenvalues.max();
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if least < *value {
                chi2 += vector.dot(&pull).powi(2) / value;
                mean += vector.dot(&(&covariance * vector)) / value;
            }
        }
    }
    Some((chi2, mean))
}
