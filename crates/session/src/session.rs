//! The session: it applies commands, undoes steps, and returns the current view.
//!
//! A change solves again what depends on it: the poses of the photographs whose points, lens or positions it changed. Measurements depend on all
//! of them and take longer: they are a separate task ([`Measuring`]), and until it is finished the view has the earlier values.

use crate::command::{Command, MeasuredKind};
use crate::figures::{Figure, figures};
use crate::history::History;
use crate::lines::{Overlay, overlay};
use crate::measuring::{Measured, Measuring, Numbered};
use crate::network::{self, Scene};
use crate::parts::{distances_view, lens_view, measurement_view, names_elsewhere, photo_view, points_view};
use crate::photograph::Photograph;
use crate::places::{Places, places};
use crate::pose::{Attempt, Solved, foot_first, without_place};
use crate::refusal::{Refusal, Step};
use crate::snap::snap;
use crate::solving::Solving;
use crate::state::{PhotoState, State};
use crate::view::{BirdseyeView, PhotoView, ShowView, StepText, View};
use crate::{advice, edit, lens, texts};
use resight::core::Pixel;
use std::sync::Arc;

/// Memory that a measured point takes in its scene and in what was measured, bytes: a session of 3200 grew by 26 MB.
const MEASURED_POINT_BYTES: usize = 8 << 10;

/// A session. There is no other state; a copy is cheap, because photographs and answers are shared.
#[derive(Debug, Clone, Default)]
pub struct Session {
    pub(crate) state: State,
    history: History,
    /// The item that is being dragged.
    dragged: Option<String>,
    pub(crate) solving: Solving,
    pub(crate) places: Arc<Places>,
    /// The last measurements.
    measured: Option<Arc<Measured>>,
    /// The present scene, where it differs from that one.
    unmeasured: Option<Numbered>,
    /// Number of the last scene, and of the last one that was measured provisionally.
    n_scenes: u64,
    n_tried: u64,
    version: u64,
    /// Counts the changes of measurements and of their values.
    n_measured: u64,
}

impl Session {
    /// An empty session.
    pub fn new() -> Self {
        Session::default()
    }

    pub(crate) fn of(state: State) -> Self {
        let mut session = Session { state, ..Session::default() };
        session.solve();
        session.measure();
        session
    }

    /// Adds a photograph; another of the same name is replaced, and the same file again changes nothing.
    ///
    /// # Errors
    /// Too many photographs, or files that are too large together.
    pub fn add_photograph(&mut self, photograph: Photograph) -> Result<View, Refusal> {
        let known = self.state.photos.iter().position(|p| p.photograph.name == photograph.name);
        if let Some(at) = known.filter(|at| *self.state.photos[*at].photograph == photograph) {
            return Ok(self.view(at));
        }
        let kept = self.state.photos.iter().enumerate().filter(|(at, _)| Some(*at) != known);
        let files_bytes = photograph.bytes.len() + kept.map(|(_, p)| p.photograph.bytes.len()).sum::<usize>();
        edit::check_photographs(self.state.photos.len() + usize::from(known.is_none()), files_bytes)?;
        let before = self.state.clone();
        let fresh =
            PhotoState { photograph: Arc::new(photograph), lens: None, chosen: None, points: Vec::new() };
        let at = known.unwrap_or(self.state.photos.len());
        match self.state.photos.get_mut(at) {
            Some(photo) => *photo = fresh,
            None => self.state.photos.push(fresh),
        }
        self.history.remember(before, &self.state);
        self.version += 1;
        self.solve();
        Ok(self.view(at))
    }

    /// A photograph by its number.
    pub fn photograph(&self, photo: usize) -> Option<&Arc<Photograph>> {
        self.state.photos.get(photo).map(|p| &p.photograph)
    }

    /// Returns the number of photographs.
    pub fn n_photographs(&self) -> usize {
        self.state.photos.len()
    }

    /// Files of all photographs together, bytes.
    pub fn files_bytes(&self) -> usize {
        self.state.photos.iter().map(|p| p.photograph.bytes.len()).sum()
    }

    /// Memory that it takes, bytes: photographs as files and as pixels, texts, what is measured, and the steps that can be undone.
    pub fn weight_bytes(&self) -> usize {
        let photographs = self.state.photos.iter().map(|p| p.photograph.weight_bytes()).sum::<usize>();
        let measured =
            self.state.measurements.iter().map(|m| MEASURED_POINT_BYTES * m.points.len()).sum::<usize>();
        photographs + measured + self.state.weight_bytes() + self.history.weight_bytes()
    }

    /// Forgets the steps that could be undone: where memory is short.
    pub fn forget_steps(&mut self) {
        self.history.clear();
    }

    /// Returns whether something is being dragged: the next change is likely to come within milliseconds.
    pub fn is_dragging(&self) -> bool {
        self.dragged.is_some()
    }

    /// Counts the changes.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Counts the changes of measurements and of their values.
    pub fn n_measured(&self) -> u64 {
        self.n_measured
    }

    /// Applies a command to a photograph, measures, and returns the present view.
    pub fn apply(&mut self, photo: usize, command: Command) -> View {
        let answered = self.change(photo, command);
        if !answered.is_measuring {
            return answered;
        }
        self.measure();
        View { snap: answered.snap, error: answered.error, ..self.view(photo) }
    }

    /// Applies a command to a photograph and returns the present view; its measurements are the earlier ones where [`View::is_measuring`].
    pub fn change(&mut self, photo: usize, command: Command) -> View {
        let (mut error, mut snapped) = (None, None);
        match command {
            Command::Snap { u_px, v_px, to } => {
                let image = self.state.photos.get(photo).map(|p| &p.photograph.image);
                snapped = image.and_then(|image| snap(image, &Pixel::new(u_px, v_px), to));
                if snapped.is_none() {
                    error = Some(Refusal::of(Step::Points, "Nothing to snap to is near."));
                }
            }
            command => error = self.edit(photo, command).err(),
        }
        let mut view = self.view(photo);
        (view.snap, view.error) = (snapped, error.map(|e| e.view()));
        view
    }

    fn edit(&mut self, photo: usize, command: Command) -> Result<(), Refusal> {
        let measurements = self.state.measurements.clone();
        self.edit_state(photo, command)?;
        self.n_measured += u64::from(self.state.measurements != measurements);
        self.version += 1;
        self.solve();
        Ok(())
    }

    fn edit_state(&mut self, photo: usize, command: Command) -> Result<(), Refusal> {
        match command {
            Command::Undo => self.step(History::undo, texts::NOTHING_TO_UNDO),
            Command::Redo => self.step(History::redo, texts::NOTHING_TO_REDO),
            command => {
                let command = self.understood(photo, command);
                let before = self.state.clone();
                let dragged = dragged(&command);
                let continues = dragged_end(&command).is_some() && dragged_end(&command) == self.dragged;
                if let Err(refusal) = edit::edit(&mut self.state, photo, command) {
                    self.state = before;
                    return Err(refusal);
                }
                self.dragged = dragged;
                if !continues {
                    self.history.remember(before, &self.state);
                }
                Ok(())
            }
        }
    }

    /// Swaps the two points of a height whose top was clicked before its foot.
    fn understood(&self, photo: usize, command: Command) -> Command {
        match (command, self.solved(photo)) {
            (Command::AddMeasurement { name, what: MeasuredKind::Height, points }, Some(solved)) => {
                let points = match <[_; 2]>::try_from(points) {
                    Ok(two) => foot_first(&solved, two).to_vec(),
                    Err(points) => points,
                };
                Command::AddMeasurement { name, what: MeasuredKind::Height, points }
            }
            (command, _) => command,
        }
    }

    fn step(&mut self, step: fn(&mut History, &mut State) -> bool, none: &str) -> Result<(), Refusal> {
        self.dragged = None;
        match step(&mut self.history, &mut self.state) {
            true => Ok(()),
            false => Err(Refusal::of(Step::Points, none)),
        }
    }

    /// Poses again what a change touched, and finds out whether anything is to be measured again.
    fn solve(&mut self) {
        self.places = Arc::new(places(&self.state));
        self.solving.solve(&self.state, &self.places, self.is_dragging());
        let scene = self.scene();
        if scene.is_none() && self.measured.take().is_some() {
            self.n_measured += 1;
        }
        let is_whole = |m: &&Measured| !m.is_provisional;
        let known = self.measured.as_deref().filter(is_whole);
        let is_known = |scene: &Scene| known.is_some_and(|m| *m.scene.scene == *scene);
        self.unmeasured = match scene.filter(|scene| !is_known(scene)) {
            Some(scene) => {
                let same = self.unmeasured.take().filter(|known| *known.scene == scene);
                self.n_scenes += u64::from(same.is_none());
                same.or_else(|| Some(Numbered { number: self.n_scenes, scene: Arc::new(scene) }))
            }
            None => None,
        };
    }

    fn scene(&self) -> Option<Scene> {
        if self.state.measurements.is_empty() && self.state.photos.len() < 2 {
            return None;
        }
        network::scene(&self.state, &self.solving.good, &self.places, false)
            .filter(|scene| !scene.queries.is_empty())
    }

    /// Returns what is to be measured again; `None` where the whole view is up to date.
    pub fn measuring(&self) -> Option<Measuring> {
        let (scene, before) = (self.unmeasured.clone()?, self.measured.clone());
        Some(Measuring { scene, before, is_provisional: false })
    }

    /// Returns what is to be measured while something is dragged, in a fraction of the time, until [`Session::measuring`] follows; `None` where that
    /// is done, and where a photograph contradicts its points, from which nothing can be measured.
    pub fn measuring_provisionally(&self) -> Option<Measuring> {
        let scene = self.unmeasured.clone()?;
        let is_done = self.n_tried == scene.number || !self.solving.is_consistent();
        (!is_done).then_some(Measuring { scene, before: None, is_provisional: true })
    }

    /// Takes what was measured: of now, or of a state before, until that of now is there.
    pub fn take(&mut self, measured: Measured) {
        let Some(awaited) = &self.unmeasured else { return };
        let is_current = awaited.number == measured.scene.number && !measured.is_provisional;
        if measured.is_provisional {
            self.n_tried = measured.scene.number;
            // The values before stay until the whole answer is there.
            if measured.found.is_err() {
                return;
            }
        }
        self.measured = Some(Arc::new(measured));
        self.n_measured += 1;
        if is_current {
            self.unmeasured = None;
        }
    }

    pub(crate) fn measure(&mut self) {
        if let Some(task) = self.measuring() {
            self.take(task.run());
        }
    }

    /// Returns the current view.
    pub fn view(&self, photo: usize) -> View {
        let (state, places) = (&self.state, &*self.places);
        let now = self.now(photo);
        let shown = self.solving.good.get(photo).and_then(Option::as_deref);
        let is_old = shown.is_some() && !self.solving.is_solved(photo);
        let measured = self.measured.as_deref();
        let advice = match self.dragged.is_none() && !is_old {
            true => shown.and_then(|solved| advice::advice(solved, state.sigma_px)),
            false => None,
        };
        let (figures, overlay): (Vec<Figure>, Option<Overlay>) =
            shown.map_or((Vec::new(), None), |solved| (figures(solved), Some(overlay(state, solved))));
        let lends_lens = |i: usize| lens::lender(state, i).is_none() && self.solving.has_lens(i);
        let photos: Vec<PhotoView> =
            state.photos.iter().enumerate().map(|(i, p)| photo_view(p, lends_lens(i))).collect();
        let lens = self.solving.lens(photo);
        let (can_undo, can_redo) = self.history.steps();
        View {
            version: self.version,
            photo_index: photo,
            photo: photos.get(photo).cloned(),
            photos,
            lens: lens.map(|known| lens_view(known, shown, is_old)),
            template: state.template,
            sigma_px: state.sigma_px,
            points: state
                .photos
                .get(photo)
                .map(|p| points_view(state, p, places, shown.filter(|_| !is_old), measured))
                .unwrap_or_default(),
            names_elsewhere: names_elsewhere(state, photo),
            distances: distances_view(state, places),
            missing: now.missing,
            error: None,
            answer: now.answer.or_else(|| shown.map(|solved| solved.answer.json())),
            is_old,
            refusal: now.refusal,
            chosen_pose: state.photos.get(photo).and_then(|p| p.chosen).unwrap_or(0),
            figures,
            overlay,
            advice,
            measurements: state.measurements.iter().map(|m| measurement_view(m, measured)).collect(),
            n_measured: self.n_measured,
            is_measuring: self.unmeasured.is_some(),
            birdseye: shown.filter(|_| !is_old).map(|_| BirdseyeView { version: self.version }),
            snap: None,
            show: ShowView { grid: state.show_grid, axes: state.show_axes },
            can_undo,
            can_redo,
        }
    }

    fn now(&self, photo: usize) -> Now {
        let mut now = Now { missing: Vec::new(), answer: None, refusal: None };
        let mut miss = |step: Step, text: String| now.missing.push(StepText { step: step.name(), text });
        let Some(shown) = self.state.photos.get(photo) else {
            miss(Step::Photograph, texts::NO_PHOTOGRAPH.to_owned());
            return now;
        };
        if shown.lens.is_none() {
            miss(Step::Lens, texts::NO_LENS.to_owned());
        }
        let needed = if matches!(shown.lens, Some(crate::GivenLens::Unknown)) { 4 } else { 3 };
        let placed = shown.points.len() - without_place(shown, &self.places).len();
        if shown.points.len() < needed {
            miss(Step::Points, texts::points_missing(shown.points.len(), needed));
        } else if placed < needed {
            miss(Step::Points, texts::places_missing(&without_place(shown, &self.places)));
        } else if self.state.measurements.is_empty() && self.solving.is_solved(photo) {
            miss(Step::Measure, texts::NO_MEASUREMENT.to_owned());
        }
        now.refusal =
            self.places.contradiction.clone().map(|text| StepText { step: Step::Points.name(), text });
        if let Some(Attempt::Refused(answer)) = self.solving.attempt(photo) {
            let is_unknown = matches!(shown.lens, Some(crate::GivenLens::Unknown));
            let (step, text) = match is_unknown {
                true => (Step::Lens, texts::unknown_next(&answer.verdict.message)),
                false => (Step::Points, answer.verdict.message.clone()),
            };
            now.refusal.get_or_insert(StepText { step: step.name(), text });
            if self.solving.good.get(photo).is_none_or(Option::is_none) {
                now.answer = Some(answer.json());
            }
        }
        now
    }

    /// Returns the ground from straight above, as PNG; `None` where nothing can be shown.
    pub fn birdseye_png(&self, photo: usize) -> Option<Vec<u8>> {
        let good = &self.solving.good;
        let scene = network::scene(&self.state, good, &self.places, true)?;
        let answers = network::measured(&scene).ok()?;
        let at = good.iter().take(photo).filter(|solved| solved.is_some()).count();
        good.get(photo)?.as_ref()?;
        let Photograph { image, heading, .. } = &*self.state.photos.get(photo)?.photograph;
        resight::measure::birdseye::birdseye(&scene, &answers, at, image, *heading)?.png().ok()
    }

    /// The pose of a photograph that is not old.
    pub(crate) fn solved(&self, photo: usize) -> Option<Arc<Solved>> {
        self.solving.good.get(photo)?.clone().filter(|_| self.solving.is_solved(photo))
    }
}

struct Now {
    missing: Vec<StepText>,
    answer: Option<resight::answer::PoseObject>,
    refusal: Option<StepText>,
}

/// Returns the item that a command drags; `None` for other commands.
fn dragged(command: &Command) -> Option<String> {
    match command {
        Command::PutPoint { drag: true, .. } | Command::MoveMeasurement { drag: true, .. } => {
            dragged_end(command)
        }
        _ => None,
    }
}

/// Returns the item that a command moves, during or at the end of a drag.
fn dragged_end(command: &Command) -> Option<String> {
    match command {
        Command::PutPoint { name, .. } => Some(format!("point {name}")),
        Command::MoveMeasurement { name, index, .. } => Some(format!("measurement {name} {index}")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A value that is no number differs from itself; what was measured of its scene is taken all the same, and nothing is measured for ever.
    #[test]
    fn a_scene_without_numbers_is_measured_once() {
        let scene = Scene { sigma_px: f64::NAN, ..network::empty(1.0, 1.0) };
        assert!(scene != scene.clone());
        let numbered = Numbered { number: 1, scene: Arc::new(scene) };
        let mut session = Session { unmeasured: Some(numbered), n_scenes: 1, ..Session::default() };
        let task = session.measuring().expect("something to measure");
        let found = Err("nothing to measure".to_owned());
        session.take(Measured { scene: task.scene, found, is_provisional: false });
        assert!(session.measuring().is_none() && !session.view(0).is_measuring);
    }
}
