//! Frame sets far from their prediction wait until three agree on which camera moved: a flipped pose, a hand in the image or a frame of
//! another time is alone, a camera that moved suddenly stays where it is.

use super::SURPRISE;
use super::evidence::{Onset, Then};
use super::filter::{Innovation, RigFilter};
use super::star::CameraReading;
use super::which::{explained, which};
use crate::statistics::chi_square::tail;
use crate::temporal::monitor::priors::CONFIRM;
use crate::temporal::snapshot::numbers;
use nalgebra::DVector;

/// What the cameras saw at one time, a star for each target.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ReadingSet {
    pub t_s: f64,
    pub stars: Vec<Vec<CameraReading>>,
}

impl ReadingSet {
    pub fn cameras(&self) -> impl Iterator<Item = usize> + '_ {
        self.stars.iter().flatten().map(|reading| reading.camera)
    }
}

/// Share of χ² that one motion may leave of frame sets that agree: they differ by less than a third of it, as frames do that were not taken at
/// quite one time. Of three outliers that have nothing to do with each other their mean leaves two thirds.
const SCATTER: f64 = 0.1;

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Held {
    waiting: Vec<(ReadingSet, Vec<usize>)>,
    /// Cameras of which three frame sets agreed that they moved: surprises of theirs pass.
    confirmed: Vec<usize>,
}

impl Held {
    /// Cameras that waiting frame sets speak against.
    pub fn suspects(&self) -> impl Iterator<Item = usize> + '_ {
        self.waiting.iter().flat_map(|(_, suspects)| suspects.iter().copied())
    }

    /// Whether it is such as a rig of this many cameras makes: numbers of a file may be any.
    pub fn is_sound(&self, cameras: usize) -> bool {
        let waiting = self.waiting.iter().all(|(frame_set, suspects)| {
            frame_set.cameras().chain(suspects.iter().copied()).all(|camera| camera < cameras)
        });
        waiting && self.waiting.len() < CONFIRM && self.confirmed.iter().all(|camera| *camera < cameras)
    }

    /// Clears every suspect that a usual frame set contains; returns how many waiting frame sets are dropped with their last suspect.
    pub fn clear(&mut self, frame_set: &ReadingSet) -> u64 {
        let before = self.waiting.len();
        let is_in = |camera: &usize| frame_set.cameras().any(|seen| seen == *camera);
        for (_, suspects) in &mut self.waiting {
            suspects.retain(|suspect| !is_in(suspect));
        }
        self.waiting.retain(|(_, suspects)| !suspects.is_empty());
        (before - self.waiting.len()) as u64
    }

    /// A surprising frame set: what passes now, and how many are given up. `filter` is as the last frame set that passed left it.
    pub fn push(
        &mut self,
        frame_set: ReadingSet,
        (filter, scale): (&RigFilter, f64),
        innovation: &Innovation,
        typical: &DVector<f64>,
    ) -> (Vec<ReadingSet>, u64) {
        let mut onset = Onset::new(frame_set.t_s, 1.0, typical, Then::default());
        onset.add(innovation);
        let attribution = which(onset.gathered(0), 1);
        let mut suspects: Vec<usize> = attribution.moved.iter().map(|moved| moved.node).collect();
        suspects.extend(attribution.alternatives.iter().flatten());
        suspects.sort_unstable();
        suspects.dedup();
        if suspects.iter().any(|suspect| self.confirmed.contains(suspect)) {
            return (vec![frame_set], 0);
        }
        let before = self.waiting.len();
        self.waiting.retain(|(_, others)| others.iter().any(|other| suspects.contains(other)));
        let mut dropped = (before - self.waiting.len()) as u64;
        self.waiting.push((frame_set, suspects));
        if self.waiting.len() < CONFIRM {
            return (Vec::new(), dropped);
        }
        match self.agreed((filter, scale), typical) {
            Some(confirmed) => {
                self.confirmed = confirmed;
                let passed = self.waiting.drain(..).map(|(frame_set, _)| frame_set).collect();
                (passed, dropped)
            }
            None => {
                self.waiting.remove(0);
                dropped += 1;
                (Vec::new(), dropped)
            }
        }
    }

    /// The cameras whose one motion explains all waiting frame sets together.
    fn agreed(&self, (filter, scale): (&RigFilter, f64), typical: &DVector<f64>) -> Option<Vec<usize>> {
        let (mut filter, mut onset) = (filter.clone(), Onset::new(0.0, 1.0, typical, Then::default()));
        let (mut chi2, mut degrees_of_freedom) = (0.0, 0);
        for (frame_set, _) in &self.waiting {
            onset.predict(&filter.predict(frame_set.t_s));
            let innovation = filter.innovation(&frame_set.stars)?.scaled(scale);
            chi2 += innovation.chi2();
            degrees_of_freedom += innovation.degrees_of_freedom();
            onset.add(&innovation);
            filter.update(&innovation);
        }
        let attribution = which(onset.gathered(0), 1);
        let mut cameras: Vec<usize> = attribution.moved.iter().map(|moved| moved.node).collect();
        let left = chi2 - explained(onset.gathered(0), &cameras);
        let is_one_motion = left < SCATTER * chi2
            || SURPRISE < tail(degrees_of_freedom.saturating_sub(6 * cameras.len()).max(1), left.max(0.0));
        cameras.extend(attribution.alternatives.iter().flatten());
        (attribution.is_explained && is_one_motion).then_some(cameras)
    }
}

numbers!(ReadingSet { t_s, stars });
numbers!(Held { waiting, confirmed });
