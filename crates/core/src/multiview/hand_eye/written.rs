//! Rotations as robots write them, in three numbers: Euler angles of several orders and rotation vectors, in degrees or radians. docs/math/hand_eye.md
//! eq. (29).

use crate::{Pose, Vector6};
use core::fmt;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// The axes about which three numbers rotate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RotationOrder {
    /// Axis times angle.
    Vector,
    /// R = Rz(third) Ry(second) Rx(first): about fixed axes x, y, z.
    FixedXyz,
    /// R = Rz(first) Ry(second) Rx(third): about moving axes z, y′, x″.
    MovingZyx,
    /// R = Rx(first) Ry(second) Rz(third): about moving axes x, y′, z″.
    MovingXyz,
    /// R = Rz(first) Ry(second) Rz(third): about moving axes z, y′, z″.
    MovingZyz,
}

/// The unit of angles in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AngleUnit {
    /// Radians.
    Radians,
    /// Degrees.
    Degrees,
}

/// What three numbers of a rotation mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RotationConvention {
    /// The axes.
    pub order: RotationOrder,
    /// The unit of the numbers.
    pub unit: AngleUnit,
}

/// A pose of the gripper as written: three numbers of its rotation, and its translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WrittenPose {
    /// The numbers of the rotation, in the order of the file.
    pub rotation: [f64; 3],
    /// The translation, metres.
    pub translation_m: Vector3<f64>,
    /// What the numbers are read as.
    pub convention: RotationConvention,
    /// Whether the pose is `gripper_from_base`, and not `base_from_gripper`.
    pub is_inverse: bool,
}

impl RotationConvention {
    /// Every convention.
    pub fn all() -> impl Iterator<Item = RotationConvention> {
        let orders = [
            RotationOrder::Vector,
            RotationOrder::FixedXyz,
            RotationOrder::MovingZyx,
            RotationOrder::MovingXyz,
            RotationOrder::MovingZyz,
        ];
        let units = [AngleUnit::Radians, AngleUnit::Degrees];
        orders.into_iter().flat_map(move |order| units.map(|unit| RotationConvention { order, unit }))
    }

    /// Returns the rotation matrix that three numbers mean.
    pub fn rotation(self, numbers: [f64; 3]) -> Matrix3<f64> {
        let [a, b, c] = match self.unit {
            AngleUnit::Radians => numbers,
            AngleUnit::Degrees => numbers.map(f64::to_radians),
        };
        let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle).into_inner();
        let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
        match self.order {
            RotationOrder::Vector => Pose::exp(&Vector6::new(a, b, c, 0.0, 0.0, 0.0)).rotation,
            RotationOrder::FixedXyz => about(z, c) * about(y, b) * about(x, a),
            RotationOrder::MovingZyx => about(z, a) * about(y, b) * about(x, c),
            RotationOrder::MovingXyz => about(x, a) * about(y, b) * about(z, c),
            RotationOrder::MovingZyz => about(z, a) * about(y, b) * about(z, c),
        }
    }
}

impl WrittenPose {
    /// Returns the pose if the rotation's numbers have a convention.
    pub fn base_from_gripper(&self, convention: RotationConvention) -> Pose {
        let written = Pose::new(convention.rotation(self.rotation), self.translation_m);
        if self.is_inverse { written.inverse() } else { written }
    }
}

/// The name of each convention, alone and in a sentence.
macro_rules! names {
    ($($order:ident $unit:ident: $name:literal,)*) => {
        impl fmt::Display for RotationConvention {
            fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str(match (self.order, self.unit) {
                    $((RotationOrder::$order, AngleUnit::$unit) => $name,)*
                })
            }
        }

        impl RotationConvention {
            /// Returns the sentence about views that agree with this convention.
            pub(super) const fn likely(self) -> &'static str {
                match (self.order, self.unit) {
                    $((RotationOrder::$order, AngleUnit::$unit) => {
                        concat!("they agree once the three numbers of each rotation are read as ", $name)
                    })*
                }
            }
        }
    };
}

names! {
    Vector Radians: "a rotation vector in radians (`ur`: Universal Robots, OpenCV's rvec)",
    Vector Degrees: "a rotation vector in degrees (`rotvec-deg`)",
    FixedXyz Radians: "roll, pitch, yaw in radians (`rpy-rad`: URDF, ROS; R = Rz(third) Ry(second) Rx(first))",
    FixedXyz Degrees: "angles about fixed axes X, Y, Z in degrees (`fanuc`: Fanuc's W P R, Yaskawa, Mitsubishi; R = Rz(third) Ry(second) Rx(first))",
    MovingZyx Radians: "angles about Z, Y', X'' in radians (`zyx-rad`; R = Rz(first) Ry(second) Rx(third))",
    MovingZyx Degrees: "angles about Z, Y', X'' in degrees (`kuka`: KUKA's A B C, ABB's EZ EY EX; R = Rz(first) Ry(second) Rx(third))",
    MovingXyz Radians: "angles about X, Y', Z'' in radians (`xyz-rad`; R = Rx(first) Ry(second) Rz(third))",
    MovingXyz Degrees: "angles about X, Y', Z'' in degrees (`staubli`: Stäubli's Rx Ry Rz; R = Rx(first) Ry(second) Rz(third))",
    MovingZyz Radians: "angles about Z, Y', Z'' in radians (`zyz-rad`; R = Rz(first) Ry(second) Rz(third))",
    MovingZyz Degrees: "angles about Z, Y', Z'' in degrees (`kawasaki`: Kawasaki's O A T; R = Rz(first) Ry(second) Rz(third))",
}
