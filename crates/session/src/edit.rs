//! Commands that change the state, each checked before anything is changed.

use crate::command::{Command, GivenLens, MeasuredKind, Template};
use crate::limits::{
    FILES_BYTES, LEAST_SIGMA_PX, MOST_COORDINATE_M, MOST_DISTANCES, MOST_MEASURED_POINTS,
    MOST_MEASURED_TOGETHER, MOST_MEASUREMENTS, MOST_NAME, MOST_PHOTOS, MOST_POINTS, MOST_SIGMA_M,
    MOST_SIGMA_PX,
};
use crate::refusal::{Refusal, Step};
use crate::state::{Distance, ImagePoint, Measurement, PhotoState, Position, State};
use crate::{lens, target, texts};
use resight::core::camera::ImageSize;
use std::collections::BTreeSet;

/// Standard deviation of a distance where none is stated, in parts of it.
const LENGTH_SIGMA: f64 = 0.01;
/// Upper limit for the index of a pose; no configuration of points has as many.
const MOST_POSES: usize = 8;

type Edited = Result<(), Refusal>;

/// Changes the state. Undo, redo and snap are the session's own.
pub fn edit(state: &mut State, photo: usize, command: Command) -> Edited {
    match command {
        Command::SetLens { lens } => set_lens(state, photo, lens),
        Command::SetTemplate { template } => {
            state.template = template;
            Ok(())
        }
        Command::PutPoint { name, u_px, v_px, sigma_px, .. } => {
            put_point(photo_of(state, photo)?, ImagePoint { name, u_px, v_px, sigma_px })
        }
        Command::RemovePoint { name } => remove_point(state, photo, &name),
        Command::RenamePoint { name, to } => rename(state, &name, to),
        Command::SetPosition { name, x_m, y_m, z_m, sigma_m } => {
            set_position(state, name, Position { x_m, y_m, z_m, sigma_m })
        }
        Command::ClearPosition { name } => {
            state.positions.remove(&name).map(|_| ()).ok_or_else(|| points(texts::no_point(&name)))
        }
        Command::SetDistance { a, b, distance_m, sigma_m } => set_distance(state, a, b, distance_m, sigma_m),
        Command::RemoveDistance { a, b } => {
            let at = state.distances.iter().position(|d| d.joins(&a, &b));
            at.map(|at| drop(state.distances.remove(at)))
                .ok_or_else(|| points(format!("There is no distance {a}–{b}.")))
        }
        Command::SetSigma { sigma_px } => {
            check_sigma_px("sigma_px", sigma_px)?;
            state.sigma_px = sigma_px;
            Ok(())
        }
        Command::FindTarget { target } => {
            let found = target::find(&target, &photo_of(state, photo)?.photograph).map_err(points)?;
            state.template = Template::Target;
            state.positions = found.iter().map(|(point, position)| (point.name.clone(), *position)).collect();
            state.distances.clear();
            photo_of(state, photo)?.points = found.into_iter().map(|(point, _)| point).collect();
            Ok(())
        }
        Command::ChoosePose { index } if MOST_POSES <= index => {
            Err(points(format!("There is no pose {index}: they are counted from 0, and a few fit at most.")))
        }
        Command::ChoosePose { index } => {
            photo_of(state, photo)?.chosen = Some(index);
            Ok(())
        }
        Command::AddMeasurement { name, what, points } => add_measurement(state, photo, name, what, points),
        Command::MoveMeasurement { name, index, u_px, v_px, .. } => {
            inside(photo_of(state, photo)?.photograph.size(), u_px, v_px, Step::Measure)?;
            let found = state.measurements.iter_mut().find(|m| m.name == name && m.photo == photo);
            let point = found.and_then(|m| m.points.get_mut(index));
            *point
                .ok_or_else(|| measure(format!("There is no measurement {name} with a point {index}.")))? =
                [u_px, v_px];
            Ok(())
        }
        Command::RemoveMeasurement { name } => {
            let at = state.measurements.iter().position(|m| m.name == name);
            at.map(|at| drop(state.measurements.remove(at)))
                .ok_or_else(|| measure(format!("There is no measurement {name}.")))
        }
        Command::Show { grid, axes } => {
            (state.show_grid, state.show_axes) = (grid, axes);
            Ok(())
        }
        Command::Undo | Command::Redo | Command::Snap { .. } => Ok(()),
    }
}

fn points(text: impl Into<String>) -> Refusal {
    Refusal { step: Step::Points, text: text.into() }
}

fn measure(text: impl Into<String>) -> Refusal {
    Refusal { step: Step::Measure, text: text.into() }
}

/// The photograph of this number.
pub fn photo_of(state: &mut State, photo: usize) -> Result<&mut PhotoState, Refusal> {
    state
        .photos
        .get_mut(photo)
        .ok_or_else(|| Refusal { step: Step::Photograph, text: texts::NO_PHOTOGRAPH.to_owned() })
}

fn positive(what: &str, seen: f64, unit: &str) -> Edited {
    match 0.0 < seen && seen.is_finite() {
        true => Ok(()),
        false => Err(points(texts::not_positive(what, seen, unit))),
    }
}

fn check_sigma_px(what: &str, seen: f64) -> Edited {
    positive(what, seen, "px")?;
    match (LEAST_SIGMA_PX..=MOST_SIGMA_PX).contains(&seen) {
        true => Ok(()),
        false => Err(points(texts::not_between(what, seen, [LEAST_SIGMA_PX, MOST_SIGMA_PX], "px"))),
    }
}

fn inside(size: ImageSize, u_px: f64, v_px: f64, step: Step) -> Edited {
    let is_in = |x: f64, n: u32| -0.5 <= x && x <= f64::from(n) - 0.5;
    match is_in(u_px, size.width_px) && is_in(v_px, size.height_px) {
        true => Ok(()),
        false => Err(Refusal { step, text: texts::not_inside(u_px, v_px, size) }),
    }
}

fn named(name: &str) -> Edited {
    match name.trim().is_empty() || MOST_NAME < name.chars().count() || name.chars().any(char::is_control) {
        true => Err(points(format!("A name has 1 to {MOST_NAME} characters."))),
        false => Ok(()),
    }
}

fn set_lens(state: &mut State, photo: usize, given: GivenLens) -> Edited {
    let refuse = |text: String| Refusal { step: Step::Lens, text };
    let own = photo_of(state, photo)?;
    if !matches!(given, GivenLens::Photograph { .. }) {
        lens::known(&given, &own.photograph).map_err(refuse)?;
    }
    own.lens = Some(given);
    check_lenders(state)
}

/// Checks that a photograph which lends its lens has one of its own.
fn check_lenders(state: &State) -> Edited {
    let mut lenders = (0..state.photos.len()).filter_map(|i| lens::lender(state, i));
    lenders.try_for_each(|lender| lender.map(|_| ())).map_err(|text| Refusal { step: Step::Lens, text })
}

fn put_point(photo: &mut PhotoState, put: ImagePoint) -> Edited {
    check_point(photo.photograph.size(), &put)?;
    photo.chosen = None;
    if let Some(point) = photo.points.iter_mut().find(|p| p.name == put.name) {
        *point = put;
        return Ok(());
    }
    room("points", photo.points.len(), MOST_POINTS)?;
    photo.points.push(put);
    Ok(())
}

fn room(what: &str, n: usize, most: usize) -> Edited {
    if n < most { Ok(()) } else { Err(points(texts::too_many(what, most))) }
}

fn check_point(size: ImageSize, point: &ImagePoint) -> Edited {
    inside(size, point.u_px, point.v_px, Step::Points)?;
    named(&point.name)?;
    point.sigma_px.map_or(Ok(()), |sigma_px| check_sigma_px("The point's standard deviation", sigma_px))
}

fn remove_point(state: &mut State, photo: usize, name: &str) -> Edited {
    let photo = photo_of(state, photo)?;
    let before = photo.points.len();
    photo.points.retain(|p| p.name != name);
    photo.chosen = None;
    if photo.points.len() == before {
        return Err(points(texts::no_point(name)));
    }
    Ok(())
}

fn rename(state: &mut State, name: &str, to: String) -> Edited {
    named(&to)?;
    let is_there = |wanted: &str| state.photos.iter().any(|p| p.points.iter().any(|q| q.name == wanted));
    if !is_there(name) {
        return Err(points(texts::no_point(name)));
    }
    if is_there(&to) || state.positions.contains_key(&to) {
        return Err(points(format!("Another point is called {to} already.")));
    }
    for point in state.photos.iter_mut().flat_map(|p| &mut p.points).filter(|p| p.name == name) {
        point.name.clone_from(&to);
    }
    if let Some(position) = state.positions.remove(name) {
        state.positions.insert(to.clone(), position);
    }
    for end in state.distances.iter_mut().flat_map(|d| [&mut d.a, &mut d.b]).filter(|end| *end == name) {
        end.clone_from(&to);
    }
    Ok(())
}

fn set_position(state: &mut State, name: String, position: Position) -> Edited {
    check_position(&name, &position)?;
    if !state.positions.contains_key(&name) {
        room("positions", state.positions.len(), MOST_POINTS)?;
    }
    state.positions.insert(name, position);
    state.photos.iter_mut().for_each(|photo| photo.chosen = None);
    Ok(())
}

fn check_position(name: &str, Position { x_m, y_m, z_m, sigma_m }: &Position) -> Edited {
    named(name)?;
    if ![x_m, y_m, z_m].into_iter().all(|x| x.abs() <= MOST_COORDINATE_M) {
        return Err(points(format!("({x_m}, {y_m}, {z_m}) m: coordinates up to 10 000 km are needed.")));
    }
    match 0.0 <= *sigma_m && *sigma_m <= MOST_SIGMA_M {
        true => Ok(()),
        false => Err(points(format!("sigma_m is {sigma_m} m; 0 or more is needed, up to 10 000 km."))),
    }
}

fn set_distance(state: &mut State, a: String, b: String, distance_m: f64, sigma_m: Option<f64>) -> Edited {
    let stated = Distance { sigma_m: sigma_m.unwrap_or(LENGTH_SIGMA * distance_m), a, b, distance_m };
    check_distance(&stated)?;
    state.photos.iter_mut().for_each(|photo| photo.chosen = None);
    if let Some(known) = state.distances.iter_mut().find(|d| d.joins(&stated.a, &stated.b)) {
        (known.distance_m, known.sigma_m) = (stated.distance_m, stated.sigma_m);
        return Ok(());
    }
    room("distances", state.distances.len(), MOST_DISTANCES)?;
    state.distances.push(stated);
    Ok(())
}

fn check_distance(Distance { a, b, distance_m, sigma_m }: &Distance) -> Edited {
    named(a)?;
    named(b)?;
    if a == b {
        return Err(points(format!("A distance from {a} to itself says nothing.")));
    }
    positive(&format!("The distance {a}–{b}"), *distance_m, "m")?;
    if MOST_COORDINATE_M < *distance_m {
        return Err(points(format!("The distance {a}–{b} is {distance_m} m; 10 000 km is the most.")));
    }
    positive("Its standard deviation", *sigma_m, "m")?;
    match *sigma_m <= MOST_SIGMA_M {
        true => Ok(()),
        false => Err(points(format!("Its standard deviation is {sigma_m} m; 10 000 km is the most."))),
    }
}

fn add_measurement(
    state: &mut State,
    photo: usize,
    name: String,
    what: MeasuredKind,
    points: Vec<[f64; 2]>,
) -> Edited {
    let added = Measurement { name, photo, what, points };
    check_measurement(state, &added)?;
    if state.measurements.iter().any(|m| m.name == added.name) {
        return Err(measure(format!("Another measurement is called {} already.", added.name)));
    }
    if MOST_MEASUREMENTS <= state.measurements.len() {
        return Err(measure(texts::too_many("measurements", MOST_MEASUREMENTS)));
    }
    check_measured_points(state.measurements.iter().chain([&added]))?;
    state.measurements.push(added);
    Ok(())
}

fn check_measurement(state: &State, m: &Measurement) -> Edited {
    named(&m.name)?;
    let photo = state.photos.get(m.photo);
    let size = photo.ok_or_else(|| measure(texts::NO_PHOTOGRAPH))?.photograph.size();
    m.points.iter().try_for_each(|[u, v]| inside(size, *u, *v, Step::Measure))?;
    let (least, most) = match m.what {
        MeasuredKind::Length | MeasuredKind::Height => (2, 2),
        MeasuredKind::Polyline => (2, MOST_MEASURED_POINTS),
        MeasuredKind::Area => (3, MOST_MEASURED_POINTS),
        MeasuredKind::Position => (1, 1),
    };
    match (least..=most).contains(&m.points.len()) {
        true => Ok(()),
        false => {
            let needed = if least == most { least.to_string() } else { format!("{least} to {most}") };
            Err(measure(format!("{} points were given; {needed} are needed.", m.points.len())))
        }
    }
}

fn check_measured_points<'a>(all: impl Iterator<Item = &'a Measurement>) -> Edited {
    match all.map(|m| m.points.len()).sum::<usize>() <= MOST_MEASURED_TOGETHER {
        true => Ok(()),
        false => Err(measure(texts::too_many("points of measurements", MOST_MEASURED_TOGETHER))),
    }
}

/// Checks that this number of photographs, with files of this total size, fits in a session.
pub fn check_photographs(n: usize, files_bytes: usize) -> Edited {
    let refuse = |text: String| Err(Refusal { step: Step::Photograph, text });
    match (MOST_PHOTOS < n, FILES_BYTES < files_bytes) {
        (true, _) => refuse(texts::too_many("photographs", MOST_PHOTOS)),
        (_, true) => refuse(texts::too_large(files_bytes, FILES_BYTES)),
        _ => Ok(()),
    }
}

/// Checks a whole state, which a person may have written by hand, as the commands that would have made it.
pub fn check(state: &State) -> Edited {
    let files_bytes = state.photos.iter().map(|p| p.photograph.bytes.len()).sum();
    check_photographs(state.photos.len(), files_bytes)?;
    check_sigma_px("sigma_px", state.sigma_px)?;
    for photo in &state.photos {
        room("points", photo.points.len(), MOST_POINTS + 1)?;
        let size = photo.photograph.size();
        photo.points.iter().try_for_each(|point| check_point(size, point))?;
        no_twice("points", photo.points.iter().map(|p| p.name.as_str()))?;
    }
    check_lenders(state)?;
    room("positions", state.positions.len(), MOST_POINTS + 1)?;
    state.positions.iter().try_for_each(|(name, position)| check_position(name, position))?;
    room("distances", state.distances.len(), MOST_DISTANCES + 1)?;
    state.distances.iter().try_for_each(check_distance)?;
    room("measurements", state.measurements.len(), MOST_MEASUREMENTS + 1)?;
    state.measurements.iter().try_for_each(|m| check_measurement(state, m))?;
    check_measured_points(state.measurements.iter())?;
    no_twice("measurements", state.measurements.iter().map(|m| m.name.as_str()))
}

fn no_twice<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Edited {
    let mut known = BTreeSet::new();
    match names.into_iter().find(|name| !known.insert(*name)) {
        Some(name) => Err(points(format!("Two {what} are called {name}; names must differ."))),
        None => Ok(()),
    }
}
