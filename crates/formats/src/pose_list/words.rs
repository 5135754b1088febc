//! The names of conventions of rotations, and of units of length, as options and keys have them.

use crate::core::multiview::hand_eye::{AngleUnit, RotationConvention, RotationOrder};

/// What the numbers of a rotation are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RotationFormat {
    /// A quaternion, its scalar first.
    QuaternionWxyz,
    /// A quaternion, its scalar last.
    QuaternionXyzw,
    /// Three angles, or a rotation vector.
    Angles(RotationConvention),
}

/// The name of a convention.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RotationWord {
    /// The name.
    pub word: &'static str,
    /// What it means.
    pub format: RotationFormat,
    /// The unit of lengths whose columns state none.
    pub length: LengthUnit,
}

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LengthUnit {
    /// Metres.
    Metres,
    /// Centimetres.
    Centimetres,
    /// Millimetres.
    Millimetres,
}

impl LengthUnit {
    /// Returns the unit that `m`, `cm` or `mm` means.
    ///
    /// # Errors
    /// Another word.
    pub fn parse(word: &str) -> Result<Self, String> {
        match word {
            "m" => Ok(LengthUnit::Metres),
            "cm" => Ok(LengthUnit::Centimetres),
            "mm" => Ok(LengthUnit::Millimetres),
            _ => Err(format!("`{word}` is no unit of length here; write m, cm or mm")),
        }
    }

    /// Returns its length in metres.
    pub const fn in_m(self) -> f64 {
        match self {
            LengthUnit::Metres => 1.0,
            LengthUnit::Centimetres => 1e-2,
            LengthUnit::Millimetres => 1e-3,
        }
    }
}

const fn angles(
    word: &'static str,
    order: RotationOrder,
    unit: AngleUnit,
    length: LengthUnit,
) -> RotationWord {
    RotationWord { word, format: RotationFormat::Angles(RotationConvention { order, unit }), length }
}

const fn quaternion(word: &'static str, format: RotationFormat, length: LengthUnit) -> RotationWord {
    RotationWord { word, format, length }
}

use AngleUnit::{Degrees, Radians};
use LengthUnit::{Metres, Millimetres};
use RotationOrder::{FixedXyz, MovingXyz, MovingZyx, MovingZyz, Vector};

/// Controllers state millimetres, except those of Universal Robots; conventions without a maker state metres.
const WORDS: [RotationWord; 18] = [
    quaternion("quaternion-wxyz", RotationFormat::QuaternionWxyz, Metres),
    quaternion("quaternion-xyzw", RotationFormat::QuaternionXyzw, Metres),
    quaternion("abb", RotationFormat::QuaternionWxyz, Millimetres),
    angles("ur", Vector, Radians, Metres),
    angles("rotvec-rad", Vector, Radians, Metres),
    angles("rotvec-deg", Vector, Degrees, Metres),
    angles("rpy-rad", FixedXyz, Radians, Metres),
    angles("rpy-deg", FixedXyz, Degrees, Metres),
    angles("fanuc", FixedXyz, Degrees, Millimetres),
    angles("mitsubishi", FixedXyz, Degrees, Millimetres),
    angles("yaskawa", FixedXyz, Degrees, Millimetres),
    angles("kuka", MovingZyx, Degrees, Millimetres),
    angles("abb-zyx", MovingZyx, Degrees, Millimetres),
    angles("zyx-rad", MovingZyx, Radians, Metres),
    angles("staubli", MovingXyz, Degrees, Millimetres),
    angles("xyz-rad", MovingXyz, Radians, Metres),
    angles("kawasaki", MovingZyz, Degrees, Millimetres),
    angles("zyz-rad", MovingZyz, Radians, Metres),
];

impl RotationWord {
    /// Every word.
    pub const ALL: &'static [RotationWord] = &WORDS;

    /// Returns the convention of this name.
    ///
    /// # Errors
    /// Another word, with those that there are.
    pub fn parse(word: &str) -> Result<Self, String> {
        let found = WORDS.iter().find(|known| known.word == word);
        found
            .copied()
            .ok_or_else(|| format!("`{word}` is no convention of rotations here; {}", choices(|_| true)))
    }
}

/// Names conventions to choose from.
pub(super) fn choices(is_choice: impl Fn(&RotationWord) -> bool) -> String {
    let words: Vec<&str> = WORDS.iter().filter(|known| is_choice(known)).map(|known| known.word).collect();
    format!("choose one of {}", words.join(", "))
}

/// Where a convention can be stated.
pub(super) const WHERE: &str = "state it by `--rotation` (of `--motions`; Python: `rotation=`), by a key `rotation` of a JSON or YAML file, or by names of columns (qw,qx,qy,qz; rotvec_x_rad …; roll_deg,pitch_deg,yaw_deg)";
