//! Limits, faults and changes as sentences: the number seen, the number needed, and what to do.

use crate::core::advise::FirstOrderLimit;
use crate::core::advise::change::Change;
use crate::core::advise::layout::LayoutWarning;
use crate::core::solve::line_plus_one::Weakness;
use crate::report::words::{degrees, length};

/// Explains why the figures of a view cannot be trusted.
pub fn first_order_limit(first_order_limit: &FirstOrderLimit) -> String {
    match first_order_limit {
        FirstOrderLimit::Bent { ratio, allowed } => format!(
            "the first-order figure does not hold: the likelihood is bent and the error bar will be up to {ratio:.2} times as long (at most {allowed:.2} for the figure to hold); tilt the target or come closer"
        ),
        FirstOrderLimit::Ambiguous { separation_sigma, needed_sigma } => format!(
            "a second pose shows the points only {separation_sigma:.1} σ apart (need {needed_sigma:.0}): many answers will be ambiguous; add a point away from the others"
        ),
        other => format!("{other:?}"),
    }
}

/// Explains what is wrong with a layout.
pub fn layout_warning(layout_warning: &LayoutWarning) -> String {
    match layout_warning {
        LayoutWarning::NearCollinear { width_ratio, needed } => format!(
            "nearly collinear: width over length {width_ratio:.3}, need {needed:.1}; the rotation about their line is known {:.0} times worse than the rest; put a point to one side",
            1.0 / width_ratio.max(1e-9)
        ),
        LayoutWarning::FarClustered { span_rad, needed_rad } => format!(
            "clustered for the distance: the points span {}, need {}; spread them or come closer",
            degrees(*span_rad),
            degrees(*needed_rad)
        ),
        LayoutWarning::Frontal { tilt_rad, needed_rad } => format!(
            "frontal: the plane of the points is {} off facing the camera, need {}; look from the side or leave the plane with a point",
            tilt(*tilt_rad),
            tilt(*needed_rad)
        ),
        LayoutWarning::EqualRange { spread, needed } => format!(
            "equal ranges: the points differ in distance by {:.2} %, need {:.2} %; put a point nearer or farther",
            100.0 * spread,
            100.0 * needed
        ),
        LayoutWarning::Weak(Weakness::CriticalPlane { separation_sigma, needed_sigma }) => format!(
            "critical plane: the camera stands where the fourth point's ray is square to the line, two poses {separation_sigma:.1} σ apart (need {needed_sigma:.0}); move the fourth point along the line"
        ),
        LayoutWarning::Weak(Weakness::LineEndOn { length_sigma, needed_sigma }) => format!(
            "line end on: its image is {length_sigma:.1} σ long (need {needed_sigma:.0}); turn the line across the sight"
        ),
        other => format!("{other:?}"),
    }
}

fn tilt(angle_rad: f64) -> String {
    format!("{:.1}°", angle_rad.to_degrees())
}

/// Writes a change with its key in the target file: `off_m[0] 0.1 → 0`.
pub fn change(change: &Change) -> String {
    let number = |x: f64| {
        let text = format!("{x:.4}");
        let text = text.trim_end_matches('0').trim_end_matches('.').to_string();
        if text == "-0" { "0".to_string() } else { text }
    };
    let larger = if change.enlarges_target { "  (larger)" } else { "" };
    format!("{} {} → {}{larger}", change.key, number(change.from), number(change.to))
}

/// Writes a standard deviation as a length; "unknown" from 1 km.
pub fn sigma_m(x_m: f64) -> String {
    if x_m < 1e3 { length(x_m) } else { "unknown".into() }
}

/// Writes a standard deviation as an angle; "unknown" from 90°.
pub fn sigma_rad(angle_rad: f64) -> String {
    if angle_rad < std::f64::consts::FRAC_PI_2 { degrees(angle_rad) } else { "unknown".into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::target::{Tag, Target};

    #[test]
    fn sentences_have_the_number_seen_and_the_number_needed() {
        let frontal = layout_warning(&LayoutWarning::Frontal { tilt_rad: 0.02, needed_rad: 0.2 });
        assert!(frontal.contains("1.1°") && frontal.contains("need 11.5°"), "{frontal}");
        let critical = Weakness::CriticalPlane { separation_sigma: 0.4, needed_sigma: 6.0 };
        assert!(layout_warning(&LayoutWarning::Weak(critical)).contains("0.4 σ apart (need 6)"));
        let two =
            first_order_limit(&FirstOrderLimit::Ambiguous { separation_sigma: 2.34, needed_sigma: 6.0 });
        assert!(two.contains("2.3 σ") && two.contains("need 6"), "{two}");
    }

    #[test]
    fn a_change_reads_as_the_file_does() {
        let target = Target::Tag(Tag { family: "tag36h11".into(), id: 0, size_m: 0.3 });
        let made = Change { key: "size_m", from: 0.2, to: 0.3, target, enlarges_target: true };
        assert_eq!(change(&made), "size_m 0.2 → 0.3  (larger)");
        assert_eq!([sigma_m(1e4), sigma_rad(9.0), sigma_m(0.02)], ["unknown", "unknown", "20 mm"]);
    }
}
