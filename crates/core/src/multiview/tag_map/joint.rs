//! Maps whose tags have a covariance together, as of a walk: what all tags in view share moves the pose and no residual.
//!
//! ```text
//!   Σ  covariance of the left motions of the tags in view, map frame   ·   E  [I; I; …]   ·   S_t  what is left of tag t's without the common motion
//!   N_t, N  information of tag t, and of all, about the pose's pivot   ·   Q_t  motion of tag t as one of the pose
//! ```
//! docs/math/tag_map.md eqs. (11)–(13).

use super::{SeenTag, TagView};
use crate::least_squares::NormalEquations;
use crate::locate::PoseEstimate;
use crate::pose::symmetric;
use crate::target::TagMap;
use crate::{Matrix6, Point};
use nalgebra::DMatrix;

/// What is exact is taken as known to a micrometre and a microradian, so that every matrix has an inverse.
const EXACT: f64 = 1e-6;

/// Returns the covariance of these tags together; none where they are independent.
pub(super) fn among(map: &TagMap, tags: &[SeenTag]) -> Option<DMatrix<f64>> {
    map.joint_covariance.as_ref()?;
    let index = |tag: &SeenTag| map.tags.iter().position(|known| known.id == tag.id);
    Some(map.covariance_of(&tags.iter().filter_map(index).collect::<Vec<usize>>()))
}

/// Gives each tag the tolerance that remains without the motion that all share: eq. (11).
pub(super) fn make_relative(tags: &mut [SeenTag], joint: &DMatrix<f64>) {
    let n = tags.len();
    let mut regular = joint.clone();
    (0..6 * n).for_each(|i| regular[(i, i)] += EXACT * EXACT);
    let columns = DMatrix::from_fn(6 * n, 6, |i, j| if i % 6 == j { 1.0 } else { 0.0 });
    let common = regular
        .cholesky()
        .and_then(|factor| columns.tr_mul(&factor.solve(&columns)).cholesky())
        .map_or(Matrix6::zeros(), |factor| Matrix6::from_column_slice(factor.inverse().as_slice()));
    for (i, tag) in tags.iter_mut().enumerate() {
        let own: Matrix6 = joint.fixed_view::<6, 6>(6 * i, 6 * i).into();
        let by = about(&tag.group.centre_in_target);
        let left = by * (own - common) * by.transpose();
        let sigma =
            |first: usize| ((0..3).map(|k| left[(first + k, first + k)].max(0.0)).sum::<f64>() / 3.0).sqrt();
        (tag.group.sigma_rad, tag.group.sigma_m) = (sigma(0), sigma(3));
    }
}

/// From the motion about the origin to that about a point: ν + ω × c.
fn about(c: &Point) -> Matrix6 {
    let mut by = Matrix6::identity();
    by.fixed_view_mut::<3, 3>(3, 0).copy_from(&-c.cross_matrix());
    by
}

/// Returns what the map adds to the covariance of a pose that took its tags for independent: eq. (13).
pub(super) fn of_map(view: &TagView, chosen: &[usize], e: &PoseEstimate) -> Matrix6 {
    view.joint.as_ref().and_then(|joint| added(view, joint, chosen, e)).unwrap_or(Matrix6::zeros())
}

fn added(view: &TagView, joint: &DMatrix<f64>, chosen: &[usize], e: &PoseEstimate) -> Option<Matrix6> {
    let equations = view.equations(chosen, e)?;
    let inverse = equations.all.information().cholesky()?.inverse();
    let ad = about(&equations.pivot_in_cam) * e.cam_from_target.adjoint();
    // D_t, the motion of the pose that follows a motion of the tag; the sign does not matter.
    let by_tag = |tag: &Option<NormalEquations>| Some(inverse * tag.as_ref()?.information() * ad);
    let by: Vec<Matrix6> = equations.of_tags.iter().map(by_tag).collect::<Option<_>>()?;
    let mut sum = Matrix6::zeros();
    for (a, by_a) in chosen.iter().zip(&by) {
        for (b, by_b) in chosen.iter().zip(&by) {
            let both: Matrix6 = joint.fixed_view::<6, 6>(6 * a, 6 * b).into();
            sum += by_a * both * by_b.transpose();
        }
        // The estimate holds the tag's own tolerance already.
        let group = &view.tags[*a].group;
        let mut own = Matrix6::identity() * (group.sigma_rad * group.sigma_rad);
        own.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(group.sigma_m * group.sigma_m);
        let origin = about(&-group.centre_in_target);
        sum -= by_a * origin * own * origin.transpose() * by_a.transpose();
    }
    let back = about(&-equations.pivot_in_cam);
    let added = symmetric(&(back * sum * back.transpose()));
    added.sum().is_finite().then_some(added)
}
