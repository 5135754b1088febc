//! The session: commands applied, steps undone, and the view of the current state.

use crate::command::Command;
use crate::figures::{Figure, figures};
use crate::lens;
use crate::lines::{Overlay, overlay};
use crate::network::{self, MeasuredNow};
use crate::parts::{distances_view, lens_view, measurement_view, names_elsewhere, photo_view, points_view};
use crate::photograph::Photograph;
use crate::places::{Places, places};
use crate::pose::{Attempt, Solved, solve, without_place};
use crate::refusal::{Refusal, Step};
use crate::snap::snap;
use crate::state::{PhotoState, State};
use crate::view::{BirdseyeView, PhotoView, ShowView, StepText, View};
use crate::{advice, edit, texts};
use resight::core::Pixel;
use std::sync::Arc;

/// Photographs of one session: each is held in memory.
const MOST_PHOTOS: usize = 6;
/// Steps that can be undone.
const MOST_STEPS: usize = 500;

/// A session. Nothing is remembered besides it.
#[derive(Debug, Clone, Default)]
pub struct Session {
    pub(crate) state: State,
    past: Vec<State>,
    future: Vec<State>,
    /// What is under the hand.
    dragged: Option<String>,
    /// The last good answer of each photograph.
    good: Vec<Option<Solved>>,
    version: u64,
}

impl Session {
    /// An empty session.
    pub fn new() -> Self {
        Session::default()
    }

    pub(crate) fn of(state: State) -> Self {
        Session { state, ..Session::default() }
    }

    /// Adds a photograph; one of the same name is replaced.
    ///
    /// # Errors
    /// Too many photographs.
    pub fn add_photograph(&mut self, photograph: Photograph) -> Result<View, Refusal> {
        let before = self.state.clone();
        let known = self.state.photos.iter().position(|p| p.photograph.name == photograph.name);
        let fresh =
            PhotoState { photograph: Arc::new(photograph), lens: None, chosen: None, points: Vec::new() };
        let at = match known {
            Some(at) => {
                self.state.photos[at] = fresh;
                at
            }
            None if self.state.photos.len() < MOST_PHOTOS => {
                self.state.photos.push(fresh);
                self.state.photos.len() - 1
            }
            None => return Err(Refusal::of(Step::Photograph, texts::too_many("photographs", MOST_PHOTOS))),
        };
        self.remember(before);
        Ok(self.view(at))
    }

    /// A photograph by its number.
    pub fn photograph(&self, photo: usize) -> Option<&Arc<Photograph>> {
        self.state.photos.get(photo).map(|p| &p.photograph)
    }

    /// Applies a command to a photograph and returns the current state.
    pub fn apply(&mut self, photo: usize, command: Command) -> View {
        self.version += 1;
        let (mut error, mut snapped) = (None, None);
        match command {
            Command::Undo => error = self.undo(),
            Command::Redo => error = self.redo(),
            Command::Snap { u_px, v_px, to } => {
                let image = self.state.photos.get(photo).map(|p| &p.photograph.image);
                snapped = image.and_then(|image| snap(image, &Pixel::new(u_px, v_px), to));
                if snapped.is_none() {
                    error = Some(Refusal::of(Step::Points, "Nothing to snap to is near."));
                }
            }
            command => error = self.change(photo, command).err(),
        }
        let mut view = self.view(photo);
        (view.snap, view.error) = (snapped, error.map(|e| e.view()));
        view
    }

    fn change(&mut self, photo: usize, command: Command) -> Result<(), Refusal> {
        let before = self.state.clone();
        let dragged = match &command {
            Command::PutPoint { name, drag: true, .. } => Some(format!("point {name}")),
            Command::MoveMeasurement { name, index, drag: true, .. } => {
                Some(format!("measurement {name} {index}"))
            }
            _ => None,
        };
        let goes_on = self.dragged.is_some() && continues(&command, self.dragged.as_deref());
        if let Err(refusal) = edit::edit(&mut self.state, photo, command) {
            self.state = before;
            return Err(refusal);
        }
        self.dragged = dragged;
        if !goes_on {
            self.remember(before);
        }
        Ok(())
    }

    fn remember(&mut self, before: State) {
        if MOST_STEPS <= self.past.len() {
            self.past.remove(0);
        }
        self.past.push(before);
        self.future.clear();
    }

    fn undo(&mut self) -> Option<Refusal> {
        let Some(before) = self.past.pop() else {
            return Some(Refusal::of(Step::Points, texts::NOTHING_TO_UNDO));
        };
        self.future.push(std::mem::replace(&mut self.state, before));
        self.dragged = None;
        None
    }

    fn redo(&mut self) -> Option<Refusal> {
        let Some(after) = self.future.pop() else {
            return Some(Refusal::of(Step::Points, texts::NOTHING_TO_REDO));
        };
        self.past.push(std::mem::replace(&mut self.state, after));
        self.dragged = None;
        None
    }

    /// The current state.
    pub fn view(&mut self, photo: usize) -> View {
        let places = places(&self.state);
        let current = self.solve_all(&places);
        let now = self.now(photo, &places, &current);
        let state = &self.state;
        let shown = self.good.get(photo).and_then(Option::as_ref);
        let is_old = shown.is_some() && !current.get(photo).is_some_and(|c| matches!(c, Some(Ok(_))));
        let measured = self.measured(&places);
        let advice = match self.dragged.is_none() && !is_old {
            true => shown.and_then(|solved| advice::advice(solved, state.sigma_px)),
            false => None,
        };
        let (figures, overlay): (Vec<Figure>, Option<Overlay>) =
            shown.map_or((Vec::new(), None), |solved| (figures(solved), Some(overlay(state, solved))));
        let photos: Vec<PhotoView> = state.photos.iter().map(photo_view).collect();
        View {
            version: self.version,
            photo_index: photo,
            photo: photos.get(photo).cloned(),
            photos,
            lens: state.photos.get(photo).and_then(|p| lens_view(p, shown)),
            template: state.template,
            sigma_px: state.sigma_px,
            points: state
                .photos
                .get(photo)
                .map(|p| points_view(state, p, &places, shown.filter(|_| !is_old), &measured))
                .unwrap_or_default(),
            names_elsewhere: names_elsewhere(state, photo),
            distances: distances_view(state, &places),
            missing: now.missing,
            error: None,
            answer: now.answer.or_else(|| shown.map(|solved| solved.answer.json())),
            is_old,
            refusal: now.refusal,
            chosen_pose: state.photos.get(photo).and_then(|p| p.chosen).unwrap_or(0),
            figures,
            overlay,
            advice,
            measurements: state.measurements.iter().map(|m| measurement_view(m, &measured)).collect(),
            birdseye: shown.filter(|_| !is_old).map(|_| BirdseyeView { version: self.version }),
            snap: None,
            show: ShowView { grid: state.show_grid, axes: state.show_axes },
            can_undo: !self.past.is_empty(),
            can_redo: !self.future.is_empty(),
        }
    }

    /// Every photograph that can be solved; the last good answers are kept.
    fn solve_all(&mut self, places: &Places) -> Vec<Option<Result<(), Refused>>> {
        self.good.resize(self.state.photos.len(), None);
        let mut all = Vec::new();
        for (i, photo) in self.state.photos.iter().enumerate() {
            let known = photo.lens.as_ref().and_then(|given| lens::known(given, &photo.photograph).ok());
            let attempt = known.map(|lens| solve(&self.state, photo, &lens, places));
            all.push(match attempt {
                Some(Attempt::Solved(solved)) => {
                    self.good[i] = Some(*solved);
                    Some(Ok(()))
                }
                Some(Attempt::Refused(answer)) => Some(Err(Refused(answer))),
                Some(Attempt::Incomplete) | None => None,
            });
            if photo.points.len() < 3 || photo.lens.is_none() {
                self.good[i] = None;
            }
        }
        all
    }

    fn now(&self, photo: usize, places: &Places, current: &[Option<Result<(), Refused>>]) -> Now {
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
        let placed = shown.points.len() - without_place(shown, places).len();
        if shown.points.len() < needed {
            miss(Step::Points, texts::points_missing(shown.points.len(), needed));
        } else if placed < needed {
            miss(Step::Points, texts::places_missing(&without_place(shown, places)));
        } else if self.state.measurements.is_empty()
            && current.get(photo).is_some_and(|c| matches!(c, Some(Ok(()))))
        {
            miss(Step::Measure, texts::NO_MEASUREMENT.to_owned());
        }
        now.refusal = places.contradiction.clone().map(|text| StepText { step: Step::Points.name(), text });
        if let Some(Some(Err(Refused(answer)))) = current.get(photo) {
            now.refusal
                .get_or_insert(StepText { step: Step::Points.name(), text: answer.verdict.message.clone() });
            if self.good.get(photo).is_none_or(Option::is_none) {
                now.answer = Some(answer.json());
            }
        }
        now
    }

    fn measured(&self, places: &Places) -> MeasuredNow {
        let is_open = self.state.photos.len() > 1;
        if self.state.measurements.is_empty() && !is_open {
            return None;
        }
        let scene = network::scene(&self.state, &self.good, places, false)?;
        if scene.queries.is_empty() {
            return None;
        }
        Some(network::measured(&scene).map(|(answers, _)| (scene, answers)))
    }

    /// The ground from straight above, as PNG; none where there is nothing to show.
    pub fn birdseye_png(&mut self, photo: usize) -> Option<Vec<u8>> {
        let places = places(&self.state);
        self.solve_all(&places);
        let scene = network::scene(&self.state, &self.good, &places, true)?;
        let (answers, _) = network::measured(&scene).ok()?;
        let at = self.good.iter().take(photo).filter(|solved| solved.is_some()).count();
        self.good.get(photo)?.as_ref()?;
        let Photograph { image, heading, .. } = &*self.state.photos.get(photo)?.photograph;
        resight::measure::birdseye::birdseye(&scene, &answers, at, image, *heading)?.png().ok()
    }

    /// The pose of a photograph that is not old.
    pub(crate) fn solved(&mut self, photo: usize) -> Option<Solved> {
        let places = places(&self.state);
        let current = self.solve_all(&places);
        matches!(current.get(photo), Some(Some(Ok(())))).then(|| self.good[photo].clone())?
    }
}

struct Refused(Box<resight::PoseAnswer>);

struct Now {
    missing: Vec<StepText>,
    answer: Option<resight::answer::PoseObject>,
    refusal: Option<StepText>,
}

fn continues(command: &Command, dragged: Option<&str>) -> bool {
    let what = match command {
        Command::PutPoint { name, .. } => format!("point {name}"),
        Command::MoveMeasurement { name, index, .. } => format!("measurement {name} {index}"),
        _ => return false,
    };
    dragged == Some(what.as_str())
}
