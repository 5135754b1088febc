//! Solves for the poses of the photographs: each again where its points, its lens, their positions or the choice among poses changed, and only
//! there.

use crate::command::GivenLens;
use crate::lens::{self, KnownLens};
use crate::photograph::Photograph;
use crate::places::Places;
use crate::pose::{Attempt, Given, Solved, named_points, solve};
use crate::state::{PhotoState, State};
use resight::Status;
use std::sync::Arc;

/// The statement about a lens, and the resulting camera for a photograph: camera files are parsed once.
#[derive(Debug, Clone)]
pub struct StatedLens {
    given: GivenLens,
    photograph: Arc<Photograph>,
    pub known: Result<Arc<KnownLens>, String>,
}

/// One photograph with its last result and the inputs of that.
#[derive(Debug, Clone, Default)]
struct OnePhoto {
    lens: Option<StatedLens>,
    tried: Option<Tried>,
}

/// What was solved last of a photograph.
#[derive(Debug, Clone)]
struct Tried {
    given: Given,
    attempt: Arc<Attempt>,
    /// Whether nothing of the answer waits for the end of a drag.
    is_whole: bool,
}

/// The results of all photographs.
#[derive(Debug, Clone, Default)]
pub struct Solving {
    photos: Vec<OnePhoto>,
    /// The last good answer of each photograph.
    pub good: Vec<Option<Arc<Solved>>>,
    /// Number of poses solved.
    pub n_solved: u64,
}

impl Solving {
    /// Solves what is not solved yet as it is now; the last good answers are kept. While something is dragged the causes of a
    /// contradiction are not sought.
    pub fn solve(&mut self, state: &State, places: &Places, is_dragged: bool) {
        self.photos.resize_with(state.photos.len(), OnePhoto::default);
        self.good.resize(state.photos.len(), None);
        // Photographs that take their lens from another one come after it.
        let (borrowing, own): (Vec<_>, Vec<_>) = (0..state.photos.len())
            .map(|i| (i, lens::lender(state, i)))
            .partition(|(_, lender)| lender.is_some());
        for (i, lender) in own.into_iter().chain(borrowing) {
            let photo = &state.photos[i];
            let lent = lender.map(|lender| self.lent(state, lender?, photo));
            let one = &mut self.photos[i];
            one.state_lens(photo, lent);
            let known = one.lens.as_ref().and_then(|lens| lens.known.as_ref().ok());
            let given = known.map(|lens| Given {
                name: photo.photograph.name.clone(),
                points: named_points(state, photo, lens, places),
                lens: Arc::clone(lens),
                chosen: photo.chosen,
            });
            let is_known = match (&one.tried, &given) {
                (Some(tried), Some(given)) => tried.given == *given && (tried.is_whole || is_dragged),
                (None, None) => true,
                _ => false,
            };
            if !is_known {
                self.n_solved += u64::from(given.is_some());
                one.tried = given.map(|given| {
                    let attempt = Arc::new(solve(&given, is_dragged));
                    let is_whole = attempt.is_whole(is_dragged);
                    Tried { given, attempt, is_whole }
                });
            }
            if let Some(Tried { attempt, .. }) = &one.tried
                && let Attempt::Solved(solved) = &**attempt
            {
                self.good[i] = Some(Arc::clone(solved));
            }
            if photo.points.len() < 3 || photo.lens.is_none() {
                self.good[i] = None;
            }
        }
    }

    /// Returns the lens of one photograph for another one.
    fn lent(&self, state: &State, lender: usize, photo: &PhotoState) -> Result<KnownLens, String> {
        let known = self.lens(lender).and_then(|lens| lens.known.as_deref().ok());
        let estimated_focal = match self.attempt(lender) {
            Some(Attempt::Solved(solved)) => solved.answer.estimated_focal.as_ref(),
            _ => None,
        };
        lens::of_photograph(&state.photos[lender], known, estimated_focal, photo.photograph.size())
    }

    /// Returns the result for a photograph's points; `None` where no lens is known.
    pub fn attempt(&self, photo: usize) -> Option<&Attempt> {
        self.photos.get(photo)?.tried.as_ref().map(|tried| &*tried.attempt)
    }

    /// Returns whether no photograph contradicts its points.
    pub fn is_consistent(&self) -> bool {
        let attempts = self.photos.iter().filter_map(|photo| photo.tried.as_ref());
        attempts.map(|tried| &*tried.attempt).all(|attempt| match attempt {
            Attempt::Incomplete => true,
            Attempt::Refused(_) => false,
            Attempt::Solved(solved) => solved.answer.verdict.status != Status::Inconsistent,
        })
    }

    /// Returns whether a photograph has a pose.
    pub fn is_solved(&self, photo: usize) -> bool {
        matches!(self.attempt(photo), Some(Attempt::Solved(_)))
    }

    /// Returns whether the lens of a photograph is known, as stated or as estimated.
    pub fn has_lens(&self, photo: usize) -> bool {
        match self.lens(photo).and_then(|lens| lens.known.as_deref().ok()) {
            Some(KnownLens::Camera { .. }) => true,
            Some(KnownLens::Unknown(_)) => self.is_solved(photo),
            None => false,
        }
    }

    /// The lens that was stated of a photograph.
    pub fn lens(&self, photo: usize) -> Option<&StatedLens> {
        self.photos.get(photo)?.lens.as_ref()
    }
}

impl OnePhoto {
    /// States the lens of the photograph: its own, or the one `lent` by another photograph.
    fn state_lens(&mut self, photo: &PhotoState, lent: Option<Result<KnownLens, String>>) {
        let Some(given) = &photo.lens else {
            self.lens = None;
            return;
        };
        let is_known =
            |lens: &StatedLens| lens.given == *given && Arc::ptr_eq(&lens.photograph, &photo.photograph);
        if lent.is_some() || !self.lens.as_ref().is_some_and(is_known) {
            let known = lent.unwrap_or_else(|| lens::known(given, &photo.photograph)).map(Arc::new);
            self.lens =
                Some(StatedLens { given: given.clone(), photograph: Arc::clone(&photo.photograph), known });
        }
    }
}
