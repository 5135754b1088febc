//! The steps that can be undone and redone, limited in number and in memory.

use crate::state::State;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Number of steps that can be undone.
const MOST_STEPS: usize = 500;
/// Memory of all steps together, bytes: photographs that were replaced, camera files, lists of points. The oldest steps go.
pub const HISTORY_BYTES: usize = 128 << 20;

/// States before and after the present one.
#[derive(Debug, Clone, Default)]
pub struct History {
    past: VecDeque<Arc<State>>,
    future: Vec<Arc<State>>,
    weight_bytes: usize,
}

impl History {
    /// Keeps the state that a change began with; nothing can be made again after it.
    pub fn remember(&mut self, before: State, now: &State) {
        self.past.push_back(Arc::new(before));
        self.future.clear();
        self.weigh(now);
        while MOST_STEPS < self.past.len() || (HISTORY_BYTES < self.weight_bytes && !self.past.is_empty()) {
            self.past.pop_front();
            self.weigh(now);
        }
    }

    /// Takes the last change back; whether there was one.
    pub fn undo(&mut self, now: &mut State) -> bool {
        let Some(before) = self.past.pop_back() else { return false };
        self.future.push(Arc::new(std::mem::replace(now, (*before).clone())));
        self.weigh(now);
        true
    }

    /// Makes the change taken back last again; whether there was one.
    pub fn redo(&mut self, now: &mut State) -> bool {
        let Some(after) = self.future.pop() else { return false };
        self.past.push_back(Arc::new(std::mem::replace(now, (*after).clone())));
        self.weigh(now);
        true
    }

    /// Returns whether there is a step to undo, and one to redo.
    pub fn steps(&self) -> (bool, bool) {
        (!self.past.is_empty(), !self.future.is_empty())
    }

    /// Forgets every step.
    pub fn clear(&mut self) {
        *self = History::default();
    }

    /// Memory that the steps take besides the present state.
    pub fn weight_bytes(&self) -> usize {
        self.weight_bytes
    }

    /// Photographs are shared by the steps: each counts once, and not where the present state has it too.
    fn weigh(&mut self, now: &State) {
        let all = || self.past.iter().chain(&self.future);
        let mut photographs: BTreeMap<_, usize> = BTreeMap::new();
        for photo in all().flat_map(|state| &state.photos) {
            photographs.insert(Arc::as_ptr(&photo.photograph), photo.photograph.weight_bytes());
        }
        now.photos.iter().for_each(|photo| {
            photographs.remove(&Arc::as_ptr(&photo.photograph));
        });
        self.weight_bytes =
            photographs.values().sum::<usize>() + all().map(|state| state.weight_bytes()).sum::<usize>();
    }
}
