//! Rigid motions of the plane of bending.

use nalgebra::{Rotation3, Vector2, Vector3};
use resight_core::Pose;

/// Where the hub is: origin at the clamp, x along the clamped whisker, y to its left. Maps hub coordinates to world coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlanarPose {
    /// The clamp point in the world, metres.
    pub x_m: f64,
    /// The clamp point in the world, metres.
    pub y_m: f64,
    /// Direction of the clamped whisker, counter-clockwise from the world's x axis, radians.
    pub angle_rad: f64,
}

impl PlanarPose {
    /// A vector of the hub frame in world axes (a force, a direction).
    pub fn rotate(&self, in_hub: Vector2<f64>) -> Vector2<f64> {
        let (sin, cos) = self.angle_rad.sin_cos();
        Vector2::new(cos * in_hub.x - sin * in_hub.y, sin * in_hub.x + cos * in_hub.y)
    }

    /// A vector of the world in hub axes.
    pub fn rotate_back(&self, in_world: Vector2<f64>) -> Vector2<f64> {
        let (sin, cos) = self.angle_rad.sin_cos();
        Vector2::new(cos * in_world.x + sin * in_world.y, -sin * in_world.x + cos * in_world.y)
    }

    /// A point of the hub frame in the world, metres.
    pub fn apply(&self, x_in_hub: Vector2<f64>) -> Vector2<f64> {
        self.rotate(x_in_hub) + Vector2::new(self.x_m, self.y_m)
    }

    /// A point of the world in the hub frame, metres.
    pub fn apply_inverse(&self, x_in_world: Vector2<f64>) -> Vector2<f64> {
        self.rotate_back(x_in_world - Vector2::new(self.x_m, self.y_m))
    }

    /// The same motion of space, z out of the plane.
    pub fn to_world_from_hub(&self) -> Pose {
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), self.angle_rad);
        Pose::new(*rotation.matrix(), Vector3::new(self.x_m, self.y_m, 0.0))
    }
}
