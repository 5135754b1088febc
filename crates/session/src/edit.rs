//! Commands that change the state, each checked before anything is changed.

use crate::command::{Command, GivenLens, MeasuredKind, Template};
use crate::refusal::{Refusal, Step};
use crate::state::{Distance, ImagePoint, Measurement, PhotoState, Position, State};
use crate::{lens, target, texts};

/// Most points of a photograph, distances and measurements of a session, and characters of a name.
const MOST_POINTS: usize = 2000;
const MOST_DISTANCES: usize = 200;
const MOST_MEASUREMENTS: usize = 200;
const MOST_NAME: usize = 60;
/// Standard deviation of a distance where none is stated, in parts of it.
const LENGTH_SIGMA: f64 = 0.01;

type Edited = Result<(), Refusal>;

/// Changes the state. Undo, redo and snap are the session's own.
pub fn edit(state: &mut State, photo: usize, command: Command) -> Edited {
    match command {
        Command::SetLens { lens } => set_lens(photo_of(state, photo)?, lens),
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
            state.distances.retain(|d| !d.joins(&a, &b));
            Ok(())
        }
        Command::SetSigma { sigma_px } => {
            positive("sigma_px", sigma_px, "px")?;
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
        Command::ChoosePose { index } => {
            photo_of(state, photo)?.chosen = Some(index);
            Ok(())
        }
        Command::AddMeasurement { name, what, points } => add_measurement(state, photo, name, what, points),
        Command::MoveMeasurement { name, index, u_px, v_px, .. } => {
            inside(photo_of(state, photo)?, u_px, v_px, Step::Measure)?;
            let found = state.measurements.iter_mut().find(|m| m.name == name);
            let point = found.and_then(|m| m.points.get_mut(index));
            *point
                .ok_or_else(|| measure(format!("There is no measurement {name} with a point {index}.")))? =
                [u_px, v_px];
            Ok(())
        }
        Command::RemoveMeasurement { name } => {
            state.measurements.retain(|m| m.name != name);
            Ok(())
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

fn inside(photo: &PhotoState, u_px: f64, v_px: f64, step: Step) -> Edited {
    let size = photo.photograph.size();
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

fn set_lens(photo: &mut PhotoState, given: GivenLens) -> Edited {
    lens::known(&given, &photo.photograph).map_err(|text| Refusal { step: Step::Lens, text })?;
    photo.lens = Some(given);
    Ok(())
}

fn put_point(photo: &mut PhotoState, put: ImagePoint) -> Edited {
    inside(photo, put.u_px, put.v_px, Step::Points)?;
    named(&put.name)?;
    put.sigma_px.map_or(Ok(()), |sigma_px| positive("The point's standard deviation", sigma_px, "px"))?;
    photo.chosen = None;
    if let Some(point) = photo.points.iter_mut().find(|p| p.name == put.name) {
        *point = put;
        return Ok(());
    }
    if MOST_POINTS <= photo.points.len() {
        return Err(points(texts::too_many("points", MOST_POINTS)));
    }
    photo.points.push(put);
    Ok(())
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
    named(&name)?;
    let Position { x_m, y_m, z_m, sigma_m } = position;
    let limit = |x: f64| x.abs() <= 1e7;
    if ![x_m, y_m, z_m].into_iter().all(limit) {
        return Err(points(format!("({x_m}, {y_m}, {z_m}) m: coordinates up to 10 000 km are needed.")));
    }
    if !(0.0 <= sigma_m && sigma_m.is_finite()) {
        return Err(points(format!("sigma_m is {sigma_m} m; 0 or more is needed.")));
    }
    if MOST_POINTS <= state.positions.len() {
        return Err(points(texts::too_many("positions", MOST_POINTS)));
    }
    state.positions.insert(name, position);
    state.photos.iter_mut().for_each(|photo| photo.chosen = None);
    Ok(())
}

fn set_distance(state: &mut State, a: String, b: String, distance_m: f64, sigma_m: Option<f64>) -> Edited {
    named(&a)?;
    named(&b)?;
    if a == b {
        return Err(points(format!("A distance from {a} to itself says nothing.")));
    }
    positive(&format!("The distance {a}–{b}"), distance_m, "m")?;
    let sigma_m = sigma_m.unwrap_or(LENGTH_SIGMA * distance_m);
    positive("Its standard deviation", sigma_m, "m")?;
    state.photos.iter_mut().for_each(|photo| photo.chosen = None);
    if let Some(known) = state.distances.iter_mut().find(|d| d.joins(&a, &b)) {
        (known.distance_m, known.sigma_m) = (distance_m, sigma_m);
        return Ok(());
    }
    if MOST_DISTANCES <= state.distances.len() {
        return Err(points(texts::too_many("distances", MOST_DISTANCES)));
    }
    state.distances.push(Distance { a, b, distance_m, sigma_m });
    Ok(())
}

fn add_measurement(
    state: &mut State,
    photo: usize,
    name: String,
    what: MeasuredKind,
    pixels: Vec<[f64; 2]>,
) -> Edited {
    named(&name)?;
    for [u, v] in &pixels {
        inside(photo_of(state, photo)?, *u, *v, Step::Measure)?;
    }
    let (least, most) = match what {
        MeasuredKind::Length | MeasuredKind::Height => (2, 2),
        MeasuredKind::Polyline => (2, 200),
        MeasuredKind::Area => (3, 200),
        MeasuredKind::Position => (1, 1),
    };
    if !(least..=most).contains(&pixels.len()) {
        let needed = if least == most { least.to_string() } else { format!("{least} to {most}") };
        return Err(measure(format!("{} points were given; {needed} are needed.", pixels.len())));
    }
    if state.measurements.iter().any(|m| m.name == name) {
        return Err(measure(format!("Another measurement is called {name} already.")));
    }
    if MOST_MEASUREMENTS <= state.measurements.len() {
        return Err(measure(texts::too_many("measurements", MOST_MEASUREMENTS)));
    }
    state.measurements.push(Measurement { name, photo, what, points: pixels });
    Ok(())
}
