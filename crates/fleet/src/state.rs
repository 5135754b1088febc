//! What is kept of the cameras of a fleet: exact sums over periods of time, which merge in any order to the same bits.
//!
//! Sums of rounded numbers depend on their order. These are whole numbers (fixed point), so that threads, machines and restarts may add
//! rows and merge states as they please: docs/math/fleet.md eqs. (1)–(5).

mod bytes;
mod camera;
mod sums;

pub use camera::{CameraState, MOST_PERIODS, SAMPLES, Sample};
pub use sums::Sums;

use crate::batch::SolvedRows;
use resight::core::statistics::random::mixed;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::{Mutex, PoisonError};

/// Locks of a state that threads share.
const SHARDS: usize = 64;

/// The cameras of a fleet.
#[derive(Debug)]
pub struct FleetState {
    /// Rows of so many seconds are joined, counted from time 0.
    period_s: f64,
    shards: Vec<Mutex<HashMap<String, CameraState>>>,
    /// Rows that name no camera, by status as in `CameraState::counts`.
    unnamed: Mutex<[u64; 6]>,
}

impl FleetState {
    /// Without any row.
    pub fn new(period_s: f64) -> Self {
        let shards = (0..SHARDS).map(|_| Mutex::default()).collect();
        FleetState { period_s, shards, unnamed: Mutex::default() }
    }

    /// Seconds that are joined.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Adds solved rows. Threads may add at once; the order does not matter, to the last bit.
    pub fn add(&self, rows: &SolvedRows) {
        let mut unnamed = [0; 6];
        // Where the rows of each name begin in `order`, in which they keep their own order.
        let mut ends = vec![0_u32; rows.names.len() + 1];
        for (row, name) in rows.camera.iter().enumerate() {
            match ends.get_mut(*name as usize + 1) {
                Some(n) => *n += 1,
                None => unnamed[camera::kind(rows.answers.status[row])] += 1,
            }
        }
        for i in 1..ends.len() {
            ends[i] += ends[i - 1];
        }
        let mut order = vec![0_u32; ends[rows.names.len()] as usize];
        for (row, name) in
            rows.camera.iter().enumerate().filter(|(_, name)| (**name as usize) < rows.names.len())
        {
            let at = &mut ends[*name as usize];
            order[*at as usize] = row as u32;
            *at += 1;
        }
        self.add_unnamed(unnamed);
        let mut first = 0;
        for (name, end) in rows.names.iter().zip(ends) {
            let own = &order[first..end as usize];
            first = end as usize;
            if own.is_empty() {
                continue;
            }
            let mut shard = self.shards[shard_of(name)].lock().unwrap_or_else(PoisonError::into_inner);
            // Most names are known: no copy is made to look for one.
            let state = match shard.get_mut(name) {
                Some(state) => state,
                None => shard.entry(name.clone()).or_default(),
            };
            for row in own {
                state.add(rows, *row as usize, self.period_s);
            }
        }
    }

    /// A camera that should be there, whether it was seen or not.
    pub fn expect(&self, name: &str) {
        self.enter(name.to_string(), CameraState::default());
    }

    fn enter(&self, name: String, state: CameraState) {
        let mut shard = self.shards[shard_of(&name)].lock().unwrap_or_else(PoisonError::into_inner);
        match shard.entry(name) {
            Entry::Occupied(mut known) => known.get_mut().merge(&state),
            Entry::Vacant(free) => {
                free.insert(state);
            }
        }
    }

    /// Each camera's name with the first and last time of its rows, seconds; sorted by name.
    pub fn spans(&self) -> Vec<(String, Option<(f64, f64)>)> {
        let mut spans = Vec::new();
        for shard in &self.shards {
            let shard = shard.lock().unwrap_or_else(PoisonError::into_inner);
            spans.extend(shard.iter().map(|(name, camera)| (name.clone(), camera.span_s)));
        }
        spans.sort_by(|a, b| a.0.cmp(&b.0));
        spans
    }

    fn add_unnamed(&self, counts: [u64; 6]) {
        let mut unnamed = self.unnamed.lock().unwrap_or_else(PoisonError::into_inner);
        unnamed.iter_mut().zip(counts).for_each(|(all, n)| *all += n);
    }

    /// Rows of each status: ok, ambiguous, degenerate, inconsistent, implausible, anything else.
    pub fn counts(&self) -> [u64; 6] {
        let mut counts = *self.unnamed.lock().unwrap_or_else(PoisonError::into_inner);
        for shard in &self.shards {
            for camera in shard.lock().unwrap_or_else(PoisonError::into_inner).values() {
                counts.iter_mut().zip(camera.counts).for_each(|(all, n)| *all += n);
            }
        }
        counts
    }

    /// Of both. Associative and commutative to the last bit.
    ///
    /// # Errors
    /// The other state, where its periods are of another length: such states do not mix.
    pub fn merge(self, other: FleetState) -> Result<FleetState, Box<FleetState>> {
        self.absorb(other).map(|()| self)
    }

    /// The same in place.
    ///
    /// # Errors
    /// As `merge`.
    pub fn absorb(&self, other: FleetState) -> Result<(), Box<FleetState>> {
        if self.period_s != other.period_s {
            return Err(Box::new(other));
        }
        self.add_unnamed(*other.unnamed.lock().unwrap_or_else(PoisonError::into_inner));
        for (name, state) in other.into_cameras() {
            self.enter(name, state);
        }
        Ok(())
    }

    /// Every camera with its name, sorted by name.
    pub fn into_cameras(self) -> Vec<(String, CameraState)> {
        let shards = self.shards.into_iter();
        let mut cameras: Vec<(String, CameraState)> =
            shards.flat_map(|shard| shard.into_inner().unwrap_or_else(PoisonError::into_inner)).collect();
        cameras.sort_by(|a, b| a.0.cmp(&b.0));
        cameras
    }
}

fn shard_of(name: &str) -> usize {
    let bits = name.bytes().fold(0_u64, |bits, byte| mixed(bits ^ u64::from(byte)));
    (bits % SHARDS as u64) as usize
}
