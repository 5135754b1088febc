//! Describes the solver's results with the names of the scene, and numbers with the digits that their intervals justify.

use super::scene::{NamedScene, QueryKind};
use crate::core::Error;
use crate::core::budget::{self, Budget};
use crate::core::multiview::network::{
    Constraint, ErrorSource, Exchange, Frame, Item, Measured, NetworkReliability, OnLine, QueryReliability,
    Suspect,
};
use crate::report::words::{all_share_words, shares};
use nalgebra::Matrix1;

/// Names an item: `point P`, `photo north`, `the plane`.
pub fn item(scene: &NamedScene, item: Item) -> String {
    match item {
        Item::Photo(i) => format!("photo {}", scene.photos[i].name),
        Item::Point(i) => format!("point {}", scene.points[i]),
        Item::Plane(0) if scene.has_ground => "the plane".to_string(),
        Item::Plane(_) => "the level plane".to_string(),
    }
}

/// Names a constraint: `the image_point of P in north`, `the distance A–B`.
pub fn constraint(scene: &NamedScene, constraint: &Constraint) -> String {
    let point = |p: usize| scene.points[p].as_str();
    match constraint {
        Constraint::ImagePoint { photo, point: p, .. } => {
            format!("the image point of {} in {}", point(*p), scene.photos[*photo].name)
        }
        Constraint::Place { point: p, .. } => format!("the coordinates of {}", point(*p)),
        Constraint::Distance { a, b, distance_m, .. } => {
            format!("the distance {}–{} of {distance_m} m", point(*a), point(*b))
        }
        Constraint::OnPlane { point: p, .. } => format!("{} lying on the plane", point(*p)),
        Constraint::Upright { foot, top, .. } => format!("{} standing above {}", point(*top), point(*foot)),
        Constraint::Gravity { photo, .. } => format!("down_in_cam of {}", scene.photos[*photo].name),
        Constraint::Pose { photo, .. } => format!("the pose of {}", scene.photos[*photo].name),
    }
}

/// Describes what looks exchanged: `B and C in east look exchanged`.
pub fn exchange(scene: &NamedScene, exchange: &Exchange) -> String {
    let photo = |photo: usize| &scene.photos[photo].name;
    match *exchange {
        Exchange::Labels { photo: i, a, b } => {
            format!("{} and {} in {} look exchanged", scene.points[a], scene.points[b], photo(i))
        }
        Exchange::Columns { photo: i } => format!(
            "u and v of all points in {} look exchanged (u_px counts columns from the left, v_px rows from the top)",
            photo(i)
        ),
        Exchange::TopAndBottom { photo: i } => format!(
            "v of all points in {} looks counted from the bottom (v_px counts rows from the top: height − 1 − v)",
            photo(i)
        ),
        Exchange::ControlPoints => {
            "x and y of the control points look exchanged (northing and easting?)".to_owned()
        }
    }
}

/// Describes a suspect: `the image_point of P in north is off by about 12.3 px (9.1 σ)`.
pub fn suspect(scene: &NamedScene, suspect: &Suspect) -> String {
    let named = &scene.constraints[suspect.constraint];
    if let (Constraint::Distance { a, b, distance_m, .. }, Some(slip)) = (named, &suspect.slip) {
        let places = decimals(slip.sigma_m);
        let [a, b] = [a, b].map(|p| scene.points[*p].as_str());
        return format!(
            "the distance {a}–{b} of {distance_m} m has a slipped decimal point: the others say {:.places$} ± {:.places$} m (1σ), about {distance_m} {}",
            slip.expected_m,
            slip.sigma_m,
            match slip.power_of_ten {
                p if 0 < p => format!("divided by {}", 10u32.pow(p as u32)),
                p => format!("times {}", 10u32.pow(p.unsigned_abs())),
            }
        );
    }
    let off = match named {
        Constraint::ImagePoint { .. } => format!("{:.1} px", suspect.off.abs()),
        Constraint::Upright { .. } | Constraint::Gravity { .. } => {
            format!("{:.1}°", suspect.off.to_degrees())
        }
        Constraint::Pose { .. } => format!("{:.1} of its standard deviations", suspect.off),
        _ => format!("{:.3} m", suspect.off.abs()),
    };
    let is = if matches!(named, Constraint::Place { .. }) { "are" } else { "is" };
    format!("{} {is} off by about {off} ({:.1} σ)", constraint(scene, named), suspect.sigmas)
}

/// Names the source of an error: `the image point of P in north`, `the focal length of north, south`.
pub fn source(scene: &NamedScene, source: ErrorSource) -> String {
    match source {
        ErrorSource::Constraint(i) => constraint(scene, &scene.constraints[i]),
        ErrorSource::Focal(camera) => {
            let photos = scene.photos.iter().zip(&scene.camera_of_photo).filter(|(_, of)| **of == camera);
            let names: Vec<&str> = photos.map(|(photo, _)| photo.name.as_str()).collect();
            format!("the focal length of {}", names.join(", "))
        }
    }
}

/// Returns the names of the measurements on which an answer depends and which nothing checks.
pub fn unchecked(scene: &NamedScene, reliability: &[QueryReliability]) -> Vec<String> {
    named(scene, reliability.iter().flat_map(|r| &r.unchecked))
}

/// Returns the names of the measurements on which an answer depends and which are checked in some directions only.
pub fn partly_checked(scene: &NamedScene, reliability: &[QueryReliability]) -> Vec<String> {
    named(scene, reliability.iter().flat_map(|r| &r.partly_checked))
}

fn named<'a>(scene: &NamedScene, sources: impl Iterator<Item = &'a ErrorSource>) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for name in sources.map(|of| source(scene, *of)) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// Returns the largest error that stays unnoticed in an answer, in its own unit; `None` where something is not checked. For a position, the
/// largest of the three.
pub fn largest_unnoticed_error(reliability: &[QueryReliability]) -> Option<f64> {
    reliability.iter().map(|r| r.largest_unnoticed_error).reduce(|a, b| Some(a?.max(b?))).flatten()
}

/// Returns the largest error that a source that is checked puts into an answer unnoticed, in its own unit. For a position, the largest of the three.
pub fn largest_error_of_checked(reliability: &[QueryReliability]) -> f64 {
    reliability.iter().map(|r| r.largest_error_of_checked).fold(0.0, f64::max)
}

/// Largest number of names in the text of one answer.
const MOST_NAMED: usize = 3;

/// Describes the reliability: `a single error may go unnoticed up to 0.12 m`, or what nothing checks; `None` for an answer without values.
pub fn reliability(scene: &NamedScene, kind: QueryKind, reliability: &[QueryReliability]) -> Option<String> {
    let listed = |names: &[String]| {
        let more = names.len().saturating_sub(MOST_NAMED);
        let more = if more == 0 { String::new() } else { format!(" and {more} more") };
        format!("{}{more}", names[..names.len().min(MOST_NAMED)].join(", "))
    };
    match (unchecked(scene, reliability), partly_checked(scene, reliability)) {
        (names, _) if !names.is_empty() => return Some(format!("nothing checks {}", listed(&names))),
        (_, names) if !names.is_empty() => {
            return Some(format!("checked in one direction only: {}", listed(&names)));
        }
        _ => {}
    }
    let largest = largest_unnoticed_error(reliability).filter(|x| x.is_finite())?;
    let value = if kind == QueryKind::Angle { largest.to_degrees() } else { largest };
    let (places, unit) = (decimals(value), unit(kind));
    let gap = if kind == QueryKind::Angle { "" } else { " " };
    Some(format!("a single error may go unnoticed up to {value:.places$}{gap}{unit}"))
}

/// A focal length counts as hardly checked where a relative error of more than this goes unnoticed.
const HARDLY_CHECKED: f64 = 0.05;

/// Returns the remarks about focal lengths that are not checked, or hardly.
pub(super) fn hardly_checked_lenses(scene: &NamedScene, reliability: &NetworkReliability<'_>) -> Vec<String> {
    let is_lens = |of: &ErrorSource| matches!(of, ErrorSource::Focal(_));
    let remark = |of: ErrorSource| match reliability.smallest_noticed_error(of) {
        None => Some(format!("nothing checks {}: a wrong one goes unnoticed", source(scene, of))),
        Some(error) if HARDLY_CHECKED < error => Some(format!(
            "{} is hardly checked: an error of up to {:.0} % goes unnoticed",
            source(scene, of),
            100.0 * error
        )),
        Some(_) => None,
    };
    reliability.sources().into_iter().filter(is_lens).filter_map(remark).collect()
}

/// Writes what the variance of an answer, of a position the sum of the three, consists of: `pixels 62 %, distances 38 %`; `None` where one
/// source is all there is.
pub fn budget(budgets: &[Budget<Matrix1<f64>>]) -> Option<String> {
    let of = |source: budget::ErrorSource| -> f64 {
        let parts = budgets.iter().flat_map(Budget::parts).filter(|part| part.source == source);
        parts.map(|part| part.covariance.x).sum()
    };
    let all = budget::ErrorSource::ALL.map(|source| (source, of(source)));
    let whole: f64 = all.iter().map(|(_, variance)| variance).sum();
    all_share_words(shares(all.into_iter().map(|(source, variance)| (source, variance / whole))))
}

/// Explains what follows from control points on one line.
pub fn on_line(scene: &NamedScene, line: &OnLine) -> String {
    let [a, b] = line.ends.map(|p| scene.points[p].as_str());
    format!(
        "the control points stand nearly on one line, from {a} to {b} ({:.2} m), none farther off it than {:.3} m ({:.3} m needed); a rotation about that line can hardly be seen, so add a control point well off it",
        line.length_m, line.width_m, line.needed_m
    )
}

/// Describes an error of the solver with names instead of indices.
pub fn error(scene: &NamedScene, error: &Error) -> String {
    match error {
        Error::Undetermined { what, index, reason, .. } => {
            let name = match *what {
                "point" => item(scene, Item::Point(*index)),
                "photo" => item(scene, Item::Photo(*index)),
                "plane" => item(scene, Item::Plane(*index)),
                _ => return reason.to_string(),
            };
            format!("{name} is undetermined: {reason}")
        }
        Error::InconsistentDistances { constraint: index, off_m, sigmas } => format!(
            "the known distances contradict each other; worst is {}, off by about {off_m:.3} m ({sigmas:.1} σ): measure it again, or give it a larger sigma_m",
            constraint(scene, &scene.constraints[*index])
        ),
        Error::ControlPointsOnLine { a, b, length_m, width_m, needed_m } => on_line(
            scene,
            &OnLine { ends: [*a, *b], length_m: *length_m, width_m: *width_m, needed_m: *needed_m },
        ),
        Error::InvalidConstraint { constraint: index, what, seen, needed } => {
            format!("{}: {what} is {seen}; {needed}", constraint(scene, &scene.constraints[*index]))
        }
        other => other.to_string(),
    }
}

/// Returns the number of decimals that shows two figures of an uncertainty.
fn decimals(uncertainty: f64) -> usize {
    match uncertainty {
        u if 0.0 < u && u.is_finite() => (1.0 - u.log10().floor()).clamp(0.0, 6.0) as usize,
        _ => 4,
    }
}

/// Returns the printed unit of a kind of query.
pub fn unit(kind: QueryKind) -> &'static str {
    match kind {
        QueryKind::Angle => "°",
        QueryKind::Area => "m²",
        _ => "m",
    }
}

/// Converts value, low and high to the printed unit.
pub fn printed(kind: QueryKind, m: &Measured) -> Measured {
    let scale = if kind == QueryKind::Angle { 180.0 / std::f64::consts::PI } else { 1.0 };
    Measured {
        value: m.value * scale,
        sigma: m.sigma * scale,
        low: m.low * scale,
        high: m.high * scale,
        ..*m
    }
}

/// Writes a value: `5.023 ± 0.031 m`, or, where the interval is asymmetric by more than a tenth, `22.4 m (20.1 … 25.6)`. Both are 95 %.
pub fn value(kind: QueryKind, measured: &Measured) -> String {
    let m = printed(kind, measured);
    let (below, above) = (m.value - m.low, m.high - m.value);
    let half = 0.5 * (below + above);
    let places = decimals(half);
    let unit = match unit(kind) {
        "°" => "°".to_string(),
        unit => format!(" {unit}"),
    };
    if (above - below).abs() <= 0.2 * half {
        format!("{:.places$} ± {half:.places$}{unit}", m.value)
    } else {
        format!("{:.places$}{unit} ({:.places$} … {:.places$})", m.value, m.low, m.high)
    }
}

/// Writes one value, or three with their axes.
pub fn values_in_words(kind: QueryKind, values: &[Measured]) -> String {
    match values {
        [x, y, z] => {
            let axes = [("x", x), ("y", y), ("z", z)];
            axes.map(|(axis, m)| format!("{axis} {}", value(kind, m))).join("   ")
        }
        _ => values.iter().map(|m| value(kind, m)).collect(),
    }
}

/// Names the frame of the positions.
pub fn frame_words(scene: &NamedScene, frame: Frame) -> String {
    match frame {
        Frame::ControlPoints([a, b, c]) => {
            let name = |p: usize| &scene.points[p];
            format!("from {}, x towards {}, z up from the plane through {}", name(a), name(b), name(c))
        }
        Frame::Held => "relative to each other only".to_string(),
        Frame::Given => match scene.frame.as_ref().and_then(|frame| frame.origin()) {
            Some(at) => {
                format!("in metres east and north of {:.7}°, {:.7}°, and heights", at.lat_deg, at.lon_deg)
            }
            None => "in the given frame".to_string(),
        },
    }
}
