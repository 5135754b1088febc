//! Describes a motion in words: its length, direction and axis, and their uncertainties.

use crate::answer::compare::Motion;
use crate::answer::pose::rows;
use crate::core::temporal::compare::Moved;
use crate::report::verdict::figures;
use crate::report::words::{decimals, degrees, length};

/// Converts a motion with its test.
pub(super) fn motion(moved: &Moved) -> Motion {
    let figures = Figures::of(moved);
    Motion {
        old_from_new: moved.old_from_new.into(),
        covariance: rows(&moved.covariance),
        moved_m: figures.moved_m,
        moved_sigma_m: figures.moved_sigma_m,
        rotation_rad: figures.rotation_rad,
        rotation_sigma_rad: figures.rotation_sigma_rad,
        rotation_axis: figures.axis,
        chi2: moved.chi2,
        degrees_of_freedom: 6,
        p: moved.probability,
    }
}

/// Lengths and angles of a motion with their standard deviations.
struct Figures {
    /// Length of the translation, m.
    moved_m: f64,
    /// Standard deviation of that length, m.
    moved_sigma_m: f64,
    /// Angle of the rotation, rad.
    rotation_rad: f64,
    /// Standard deviation of the angle about its axis, rad.
    rotation_sigma_rad: f64,
    /// Axis of the rotation in the old camera frame; `None` where the angle is less than twice its standard deviation.
    axis: Option<[f64; 3]>,
}

impl Figures {
    /// Computes the figures of a motion.
    fn of(moved: &Moved) -> Self {
        let xi = moved.old_from_new.log();
        let turn = [xi[0], xi[1], xi[2]];
        let shift: [f64; 3] = moved.old_from_new.translation.into();
        let (rotation_rad, rotation_sigma_rad) = along(turn, moved, 0);
        let (moved_m, moved_sigma_m) = along(shift, moved, 3);
        let axis = (2.0 * rotation_sigma_rad < rotation_rad).then(|| turn.map(|x| x / rotation_rad));
        Figures { moved_m, moved_sigma_m, rotation_rad, rotation_sigma_rad, axis }
    }
}

/// Returns the length of a vector and its standard deviation along the vector; over all directions where the length is zero.
fn along(v: [f64; 3], moved: &Moved, first: usize) -> (f64, f64) {
    let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let c = |i: usize, j: usize| moved.covariance[(first + i, first + j)];
    let variance = match 0.0 < norm {
        true => {
            (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).map(|(i, j)| v[i] * v[j] * c(i, j)).sum::<f64>()
                / (norm * norm)
        }
        false => (0..3).map(|i| c(i, i)).fold(0.0, f64::max),
    };
    (norm, variance.max(0.0).sqrt())
}

/// Describes a motion: `moved by 12.3 mm ± 200 µm (…), rotated by 0.42° ± 0.01° (…); χ² 812 …`.
pub(super) fn motion_sentence(moved: &Moved) -> String {
    let f = Figures::of(moved);
    let [x, y, z]: [f64; 3] = moved.old_from_new.translation.into();
    let digits = decimals(1e3 * f.moved_sigma_m);
    // A component that rounds to zero has no direction.
    let way = |x: f64, plus: &str, minus: &str| {
        let shown = format!("{:.digits$}", 1e3 * x.abs());
        let is_nothing = shown.chars().all(|c| c == '0' || c == '.');
        format!("{} {shown}", if x < 0.0 && !is_nothing { minus } else { plus })
    };
    let places = [way(x, "right", "left"), way(y, "down", "up"), way(z, "forward", "back")].join(", ");
    let axis = f.axis.map(|axis| format!(" ({})", rotation_words(axis))).unwrap_or_default();
    format!(
        "moved by {} ± {} ({places} mm in its own old view), rotated by {} ± {}{axis}; {}",
        length(f.moved_m),
        length(f.moved_sigma_m),
        degrees(f.rotation_rad),
        degrees(f.rotation_sigma_rad),
        evidence(moved.chi2, 6, moved.probability)
    )
}

/// Describes the direction of rotation about the camera axis nearest to the rotation's own: x points right, y down, z forward.
fn rotation_words(axis: [f64; 3]) -> String {
    let i = (0..3).fold(0, |best, i| if axis[best].abs() < axis[i].abs() { i } else { best });
    let senses = [["upwards", "downwards"], ["to the right", "to the left"], ["clockwise", "anticlockwise"]];
    let sense = senses[i][usize::from(axis[i] < 0.0)];
    let nearly = if axis[i].abs() < 0.95 { "mostly " } else { "" };
    // Adding zero removes the sign of a rounded −0.
    let [x, y, z] = axis.map(|a| (100.0 * a).round() / 100.0 + 0.0);
    format!("{nearly}{sense}, axis {x:+.2} {y:+.2} {z:+.2}")
}

/// Describes a test: `χ² 20.1 for 18 degrees of freedom, chance 0.33 if nothing moved`.
pub fn evidence(chi2: f64, degrees_of_freedom: usize, p: f64) -> String {
    let chance = match p {
        p if p < 1e-12 => "below 1e-12".to_string(),
        p if p < 1e-3 => format!("{p:.1e}"),
        p => figures(p),
    };
    format!(
        "χ² {} for {degrees_of_freedom} degrees of freedom, chance {chance} if nothing moved",
        figures(chi2)
    )
}
