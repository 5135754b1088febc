//! Roll, pitch, yaw as ROS and URDF mean them: R = R_z(yaw) · R_y(pitch) · R_x(roll), about fixed axes x, y, z.

use nalgebra::Matrix3;

/// R of the angles, radians.
pub(super) fn rotation_of_rpy([roll, pitch, yaw]: [f64; 3]) -> Matrix3<f64> {
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
}

/// The angles of R, radians, pitch within ±π/2.
///
/// Roll is measured after yaw has been turned back, so that at pitch ±π/2, where only their sum is determined, an
/// arbitrary yaw and this roll still give R.
pub(super) fn rpy_of_rotation(r: &Matrix3<f64>) -> [f64; 3] {
    let pitch = (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)]));
    let yaw = r[(1, 0)].atan2(r[(0, 0)]);
    let (sy, cy) = yaw.sin_cos();
    let roll = (sy * r[(0, 2)] - cy * r[(1, 2)]).atan2(cy * r[(1, 1)] - sy * r[(0, 1)]);
    [roll, pitch, yaw]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// The optical frame of a camera that looks along its link's x: x right = −y, y down = −z, z forward = x.
    #[test]
    fn optical_frames_are_minus_90_0_minus_90() {
        let r = rotation_of_rpy([-FRAC_PI_2, 0.0, -FRAC_PI_2]);
        let expected = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        assert!((r - expected).amax() < 1e-15);
    }

    /// Products of three elementary rotations, in the order that the name states.
    #[test]
    fn angles_turn_about_x_then_y_then_z() {
        let turn = |axis, angle| nalgebra::Rotation3::from_axis_angle(&axis, angle).into_inner();
        use nalgebra::Vector3;
        let expected =
            turn(Vector3::z_axis(), 0.3) * turn(Vector3::y_axis(), -0.7) * turn(Vector3::x_axis(), 1.1);
        assert!((rotation_of_rpy([1.1, -0.7, 0.3]) - expected).amax() < 1e-15);
    }

    #[test]
    fn angles_round_trip_where_pitch_is_vertical_too() {
        for pitch in [0.0, 0.4, -1.2, FRAC_PI_2, -FRAC_PI_2, FRAC_PI_2 - 1e-9, -FRAC_PI_2 + 1e-12] {
            for (roll, yaw) in [(0.0, 0.0), (1.0, -2.0), (PI, 0.5), (-3.0, 3.0)] {
                let r = rotation_of_rpy([roll, pitch, yaw]);
                assert!((rotation_of_rpy(rpy_of_rotation(&r)) - r).amax() < 1e-14, "{roll} {pitch} {yaw}");
            }
        }
    }
}
