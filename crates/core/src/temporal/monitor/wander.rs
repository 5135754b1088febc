//! How far the readings of a camera that stays wander: lamps that flicker, rain, key frames of a video. A mean of readings errs by that, whatever
//! the model in use makes of it.
//!
//! ```text
//!   ȳ  means of blocks of 2ʲ decisions    d  difference of the two halves of the next longer block    a_j  mean of d²
//!   V(n) = ¼ Σ a_j over 2ʲ ≥ n            mean square by which means of n decisions differ from the mean of all
//! ```
//! Whitened coordinates, one at a time, from the reference. Derivation: docs/math/monitor.md eqs. (115)–(117).

use super::scatter::{NEGLIGIBLE, surely};
use crate::Vector6;
use crate::temporal::snapshot::numbers;
use arrayvec::ArrayVec;

/// Lengths of blocks: 2⁰ to 2²³ decisions.
const OCTAVES: usize = 24;
/// Differences that do not count yet: a gross motion is reported at the third reading, which ends the second pair.
const HELD: usize = 2;

/// Blocks of one length.
#[derive(Debug, Clone, PartialEq, Default)]
struct Octave {
    /// The first half of the next longer block.
    half: Option<Vector6>,
    /// d² of the last ones: the motion that an alarm is about may be in them.
    held: ArrayVec<Vector6, { HELD + 1 }>,
    /// Differences so far, and the mean of their squares.
    n: f64,
    square: Vector6,
}

type Octaves = Box<ArrayVec<Octave, OCTAVES>>;

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Wander {
    octaves: Octaves,
    /// Decisions so far, since blocks began anew.
    decisions: u64,
    /// As it was before a motion that is reported: it counts again unless the motion proves to be none.
    before: Option<Octaves>,
}

impl Wander {
    pub fn push(&mut self, value: &Vector6) {
        self.decisions += 1;
        let mut next = Some(*value);
        for octave in 0..OCTAVES {
            let Some(block) = next else { return };
            if self.octaves.len() == octave {
                self.octaves.push(Octave::default());
            }
            next = self.octaves[octave].push(block);
        }
    }

    /// A motion of the last so many decisions is reported: what it adds is not counted.
    pub fn set_aside(&mut self, last: f64) {
        if self.before.is_none() {
            let mut before = self.octaves.clone();
            for (j, octave) in before.iter_mut().enumerate() {
                // Pairs end at multiples of their length.
                let length = 2_u64 << j;
                let since_end = self.decisions % length;
                let of_motion = ((last - since_end as f64) / length as f64).ceil().max(0.0);
                octave.interrupt(of_motion as usize);
            }
            self.before = Some(before);
        }
    }

    /// It is an error that comes back.
    pub fn count(&mut self) {
        self.before = None;
    }

    /// It was a motion.
    pub fn forget(&mut self) {
        if let Some(before) = self.before.take() {
            (self.octaves, self.decisions) = (before, 0);
        }
    }

    /// The present pose becomes the reference: blocks are of readings from there.
    pub fn accept(&mut self) {
        self.set_aside(0.0);
        self.forget();
    }

    /// V of a mean of `n` decisions; zero where nothing but white noise shows.
    pub fn variance(&self, n: f64) -> Vector6 {
        let octaves = self.before.as_ref().unwrap_or(&self.octaves);
        let first = n.max(1.0).log2().ceil() as usize;
        let Some(white) = octaves.first().map(|octave| octave.square) else { return Vector6::zeros() };
        Vector6::from_fn(|axis, _| {
            let (mut sum, mut shows) = (0.0, false);
            for (j, octave) in octaves.iter().enumerate().skip(first) {
                let white = white[axis] / (1_u32 << j) as f64;
                let is_more = NEGLIGIBLE * white < octave.square[axis] * surely(octave.n);
                sum += 0.25 * if is_more { octave.square[axis] } else { white };
                shows |= is_more;
            }
            if shows { sum } else { 0.0 }
        })
    }

    /// Whether its variances are some: numbers of a file may be any.
    pub fn is_sound(&self) -> bool {
        let mut all = self.octaves.iter().chain(self.before.iter().flat_map(|before| before.iter()));
        all.all(|octave| 0.0 <= octave.n && 0.0 <= octave.square.min())
    }
}

impl Octave {
    /// Takes in a block; the longer one that it completes.
    fn push(&mut self, block: Vector6) -> Option<Vector6> {
        let Some(first) = self.half.take() else {
            self.half = Some(block);
            return None;
        };
        let difference = block - first;
        self.held.push(difference.component_mul(&difference));
        if HELD < self.held.len() {
            self.count();
        }
        Some(0.5 * (first + block))
    }

    fn count(&mut self) {
        self.n += 1.0;
        self.square += (self.held.remove(0) - self.square) / self.n;
    }

    /// Blocks begin anew; the last differences, so many, are not counted.
    fn interrupt(&mut self, not_counted: usize) {
        while not_counted < self.held.len() {
            self.count();
        }
        self.half = None;
        self.held.clear();
    }
}

numbers!(Octave { half, held, n, square });
numbers!(Wander { octaves, decisions, before });

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::SplitMix64;

    /// A lamp is on for 20 and off for 40 readings in the mean, and shifts one coordinate by a standard deviation of a reading.
    fn lamp(readings: u32, shift: f64) -> Wander {
        let (mut chance, mut wander, mut is_on) = (SplitMix64::new(7), Wander::default(), false);
        for _ in 0..readings {
            is_on ^= chance.uniform() < if is_on { 1.0 / 20.0 } else { 1.0 / 40.0 };
            let mut value = Vector6::from_fn(|_, _| chance.normal());
            value[2] += if is_on { shift } else { 0.0 };
            wander.push(&value);
        }
        wander
    }

    #[test]
    fn white_noise_does_not_wander_and_a_lamp_does() {
        let (white, lit) = (lamp(100_000, 0.0), lamp(100_000, 1.0));
        for n in [1.0, 3.0, 60.0, 1000.0] {
            assert_eq!(white.variance(n), Vector6::zeros(), "{n}");
        }
        // p (1 − p) of a state that lasts, beside the error of three readings; of means over a minute and more what is left: 2τ/n with τ = 13.
        for (n, variance) in [(4.0, 0.22 + 0.25), (256.0, 0.22 * 26.7 / 256.0 + 1.0 / 256.0)] {
            let seen = lit.variance(n);
            assert!((0.7..1.3).contains(&(seen[2] / variance)), "{n}: {seen}");
            assert_eq!(seen[0], 0.0);
        }
    }

    /// What a motion adds counts only where it proves to be an error.
    #[test]
    fn a_motion_that_is_reported_does_not_count() {
        let still = lamp(1000, 0.0);
        let mut moved = still.clone();
        (0..2).for_each(|_| moved.push(&Vector6::repeat(100.0)));
        moved.set_aside(2.0);
        (0..1000).for_each(|_| moved.push(&Vector6::repeat(100.0)));
        assert_eq!(moved.variance(3.0), Vector6::zeros());
        let mut error = moved.clone();
        error.count();
        assert!(50.0 < error.variance(3.0).min());
        moved.forget();
        assert_eq!(moved.variance(3.0), Vector6::zeros());
        assert!(moved.octaves.iter().all(|octave| octave.half.is_none() && octave.held.is_empty()));
    }
}
