//! Solves for pose and focal length together, from points of one view without a camera.

use super::{PoseAnswer, mean_square_root, point_sigma_m};
use crate::answer::{EstimatedFocal, Status};
use crate::report::verdict::{self, Verdict};
use resight_core::locate::consistency::Consistency;
use resight_core::locate::observability::Observability;
use resight_core::locate::unknown_focal::{LensPrior, estimate_focal_of};
use resight_core::{Camera, Correspondence};

/// Returns the answer, and the camera found with it.
pub(super) fn with_unknown_focal(
    view: &str,
    seen: &[Correspondence],
    lens: &LensPrior,
    target_scale_sigma: [f64; 2],
    name_of: impl Fn(usize) -> String,
) -> (PoseAnswer, Option<Camera>) {
    let found = estimate_focal_of(seen, lens, target_scale_sigma);
    let answer = PoseAnswer::without_pose(view.to_owned(), Status::Error, "");
    let answer = PoseAnswer {
        n_points: seen.len(),
        sigma_px: mean_square_root(seen.iter().map(|c| c.sigma_px)),
        point_sigma_m: point_sigma_m(seen),
        names: (0..seen.len()).map(&name_of).collect(),
        ..answer
    };
    let found = match found {
        Ok(found) => found,
        Err(reason) => return (PoseAnswer { verdict: verdict::of_error(&reason), ..answer }, None),
    };
    let answer = PoseAnswer {
        verdict: verdict_of(&found.estimate, name_of),
        observability: Some(Observability::of(&found.estimate, seen)),
        estimated_focal: Some(EstimatedFocal::of(&found, lens.size.width_px)),
        estimate: Some(found.estimate),
        ..answer
    };
    (answer, Some(found.camera))
}

/// Returns the verdict; a contradiction cannot be due to a camera file, as there is none.
fn verdict_of(pose: &resight_core::PoseEstimate, name_of: impl Fn(usize) -> String) -> Verdict {
    match pose.consistency {
        Consistency::Inconsistent { chi2_per_degree_of_freedom, worst_point, worst_px, .. } => Verdict {
            status: Status::Inconsistent,
            message: format!(
                "with no focal length is the residual as small as the stated noise (χ²/dof {chi2_per_degree_of_freedom:.1}, expected 1; worst is {}, {} px \
                 off); check that points and pixels are in the same order, their units, and whether the lens is a fisheye, which has to be calibrated",
                name_of(worst_point),
                verdict::figures(worst_px)
            ),
        },
        Consistency::Consistent => verdict::of_estimate(pose, name_of, "px"),
    }
}
