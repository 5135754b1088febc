//! Converts the covariance of a camera's pose to that of `geometry_msgs/PoseWithCovariance`.
//!
//! Ours is of ξ = [ω; ν] with cam_from_target ← Exp(ξ) · cam_from_target. ROS's is of the pose of the camera in the target frame:
//! (x, y, z, turns about the fixed axes x, y, z of that frame), target_from_cam ← rotated by θ about its own origin, shifted by δ. Now
//!
//! (Exp(ξ) · cam_from_target)⁻¹ = target_from_cam · Exp(−ξ), and with R the rotation of target_from_cam
//!
//! * its place becomes p − R ν, so δ = −R ν (a rotation about the camera's own centre moves no centre);
//! * its rotation becomes R exp(−[ω]) = exp(−[R ω]) R, so θ = −R ω.
//!
//! [δ; θ] = −[0 R; R 0] ξ: both blocks change places and are turned into the target's axes; the sign is lost in the square.

use resight_core::{Matrix6, Pose};

/// Returns the covariance of (x, y, z, rotations about x, y, z) of the camera's pose in the target frame, from that of `cam_from_target` (left
/// motion `[rotation_rad; translation_m]` in the camera frame).
pub fn pose_covariance(target_from_cam: &Pose, covariance: &Matrix6) -> Matrix6 {
    let mut to_ros = Matrix6::zeros();
    to_ros.fixed_view_mut::<3, 3>(0, 3).copy_from(&-target_from_cam.rotation);
    to_ros.fixed_view_mut::<3, 3>(3, 0).copy_from(&-target_from_cam.rotation);
    to_ros * covariance * to_ros.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight_core::Vector6;

    fn poses() -> (Pose, Matrix6) {
        let cam_from_target = Pose::exp(&Vector6::new(0.7, -1.1, 0.4, 0.3, -0.2, 1.5));
        let root =
            Matrix6::from_fn(
                |i, j| if i == j { 1.0 + i as f64 } else { 0.3 * (i as f64 - 2.0 * j as f64).sin() },
            );
        (cam_from_target, root)
    }

    /// What ROS would read off a pose beside another: place, and the rotation about fixed axes (small).
    fn difference(target_from_cam: &Pose, now: &Pose) -> Vector6 {
        let turn = Pose::new(now.rotation * target_from_cam.rotation.transpose(), Default::default()).log();
        let shift = now.translation - target_from_cam.translation;
        Vector6::new(shift.x, shift.y, shift.z, turn[0], turn[1], turn[2])
    }

    /// Each column of the conversion against a small motion along one coordinate.
    #[test]
    fn conversion_matches_central_difference() {
        let (cam_from_target, root) = poses();
        let covariance = root * root.transpose();
        let target_from_cam = cam_from_target.inverse();
        let h = 1e-5;
        let columns: Vec<Vector6> = (0..6)
            .map(|i| {
                let mut step = Vector6::zeros();
                step[i] = h;
                let [plus, minus] = [step, -step].map(|xi| cam_from_target.moved(&xi).inverse());
                (difference(&target_from_cam, &plus) - difference(&target_from_cam, &minus)) / (2.0 * h)
            })
            .collect();
        let jacobian = Matrix6::from_columns(&columns);
        let expected = jacobian * covariance * jacobian.transpose();
        // h² = 1e-10 of truncation, times the largest entry.
        assert!((pose_covariance(&target_from_cam, &covariance) - expected).amax() < 1e-8 * expected.amax());
    }
}
