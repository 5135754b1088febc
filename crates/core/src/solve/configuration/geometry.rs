//! What was measured on the points of a target, and the layout it decided: docs/math/configuration.md.

/// Layouts that need different closed forms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Configuration {
    /// Three points, not on a line: up to four poses.
    Three,
    /// Four points, three of them on a line.
    LinePlusOne {
        /// Indices: the three in order along the line, then the one off it.
        order: [usize; 4],
    },
    /// Four or more points in one plane that determine a homography.
    Planar,
    /// Anything else, also all points but one on a line when there are more than four.
    General,
}

/// A ratio of lengths and what it was compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    /// As measured.
    pub ratio: f64,
    /// Where the decision changes.
    pub threshold: f64,
}

/// What was measured on the points in the target before anything was solved, and what it decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    /// What it decided.
    pub configuration: Configuration,
    /// Distance of two far points, at least half of the largest there is, metres.
    pub length_m: f64,
    /// Width over length; at or below the threshold the points are one line, which determines no pose.
    pub width: Measure,
    /// How far all points but one are off one line, over its length; up to the threshold they are a line and one point off it.
    /// None for three points.
    pub line_height: Option<Measure>,
    /// Thickness over width; up to the threshold the points are one plane. None where `line_height` has decided.
    pub thickness: Option<Measure>,
}

/// Up to here the three points of a line-plus-one layout are on their line to the rounding of survey coordinates: the closed form,
/// which takes them for exactly straight, then misses no pose (none in 2,000,000 exact views; bent by 4·10⁻⁴ the first are missed).
const STRAIGHT: f64 = 1e-9;
/// Four points narrower than this, or three of them on a line to this, are nearly collinear: docs/math/configuration.md, table 3.
const NARROW: f64 = 0.1;
/// Four points thicker than this that count as flat are not flat enough for the plane's closed form alone: the same table.
const THICK: f64 = 0.01;

impl Geometry {
    /// Returns whether all points are near one line: narrower than a tenth of their length.
    pub fn is_narrow(&self) -> bool {
        self.width.ratio < NARROW
    }

    /// Of four points: whether they are so nearly on one line or in one plane, or three of them nearly but not quite on one line, that
    /// the closed form of the layout may lead to a wrong minimum only.
    pub(crate) fn is_between_layouts(&self) -> bool {
        let height = self.line_height.map_or(f64::INFINITY, |measure| measure.ratio);
        let is_bulging =
            self.thickness.is_some_and(|measure| THICK < measure.ratio && measure.ratio <= measure.threshold);
        match self.configuration {
            Configuration::LinePlusOne { .. } => STRAIGHT < height,
            _ => height < NARROW || self.is_narrow() || is_bulging,
        }
    }
}
