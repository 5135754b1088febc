//! How often a session says something: a state that comes and goes with every frame must not fill a disk and an inbox.
//!
//! Every change of a state, and of what moved, passes here. Alarms pass at once, calm (`steady`) after it has lasted, and all of them through a bucket:
//! `BURST` at once, then one every `AGAIN_S`. What must wait is not lost: the newest state is reported when its time has come, or at the end.

use super::{Event, State};
use std::collections::BTreeMap;

/// A state that was in doubt is called steady when it has been so for this long, seconds of capture time.
const CALM_S: f64 = 2.0;
/// Changes of one kind that may follow each other at once,
const BURST: f64 = 10.0;
/// and then one in this time, seconds of capture time.
const AGAIN_S: f64 = 60.0;

/// What was reported of every pair and of what moved, and what waits.
#[derive(Default)]
pub(super) struct Outlet {
    pairs: BTreeMap<(usize, usize), Pair>,
    moved: Moved,
    /// Newest capture time of any camera, seconds: what moved is said of all of them.
    now_s: f64,
}

#[derive(Default)]
struct Pair {
    reported: Option<State>,
    /// Of alarms and of the rest: neither uses up what the other may say.
    buckets: [Bucket; 2],
    waiting: Option<(f64, State)>,
}

#[derive(Default)]
struct Moved {
    bucket: Bucket,
    waiting: Option<Event>,
}

/// A token bucket on the clock of the frames.
struct Bucket {
    tokens: f64,
    last_s: Option<f64>,
}

impl Default for Bucket {
    fn default() -> Self {
        Bucket { tokens: BURST, last_s: None }
    }
}

impl Bucket {
    fn takes(&mut self, t_s: f64) -> bool {
        let elapsed_s = self.last_s.map_or(0.0, |last_s| (t_s - last_s).max(0.0));
        self.tokens = (self.tokens + elapsed_s / AGAIN_S).min(BURST);
        self.last_s = Some(t_s);
        let is_free = 1.0 <= self.tokens;
        self.tokens -= if is_free { 1.0 } else { 0.0 };
        is_free
    }
}

impl Outlet {
    /// What is to be reported now that this has happened.
    pub fn take(&mut self, event: Event) -> Vec<Event> {
        match event {
            Event::StateChanged { camera, target, t_s, state } => {
                let pair = self.pairs.entry((camera, target)).or_default();
                // What waited is overtaken by what is.
                let since_s = match &pair.waiting {
                    Some((since_s, waiting)) if kind(waiting) == kind(&state) => *since_s,
                    _ => t_s,
                };
                pair.waiting = Some((since_s, state));
                pair.due((camera, target), t_s).into_iter().collect()
            }
            Event::Attributed { .. } => {
                self.moved.waiting = Some(event);
                self.moved.due(self.now_s).into_iter().collect()
            }
            Event::Observed { camera, target, observation } => {
                let t_s = observation.capture_s;
                self.now_s = self.now_s.max(t_s);
                let mut reported = vec![Event::Observed { camera, target, observation }];
                reported.extend(self.moved.due(self.now_s));
                let pair = self.pairs.get_mut(&(camera, target));
                reported.extend(pair.and_then(|pair| pair.due((camera, target), t_s)));
                reported
            }
            other => vec![other],
        }
    }

    /// What still waits when all sources have ended.
    pub fn finish(&mut self) -> Vec<Event> {
        let moved = self.moved.waiting.take().into_iter();
        let pairs = self.pairs.iter_mut().filter_map(|(key, pair)| {
            let (t_s, state) = pair.waiting.take()?;
            let is_new = pair.reported.as_ref() != Some(&state);
            is_new.then_some(Event::StateChanged { camera: key.0, target: key.1, t_s, state })
        });
        moved.chain(pairs).collect()
    }
}

impl Moved {
    fn due(&mut self, t_s: f64) -> Option<Event> {
        let is_due = self.waiting.is_some() && self.bucket.takes(t_s);
        if is_due { self.waiting.take() } else { None }
    }
}

impl Pair {
    fn due(&mut self, (camera, target): (usize, usize), t_s: f64) -> Option<Event> {
        let (since_s, state) = self.waiting.as_ref()?;
        if self.reported.as_ref() == Some(state) {
            self.waiting = None;
            return None;
        }
        let was_in_doubt = matches!(self.reported, Some(State::Checking(_)));
        if matches!(state, State::Steady) && was_in_doubt && t_s < since_s + CALM_S {
            return None;
        }
        if !self.buckets[usize::from(is_alarm(state))].takes(t_s) {
            return None;
        }
        let (since_s, state) = self.waiting.take()?;
        self.reported = Some(state.clone());
        Some(Event::StateChanged { camera, target, t_s: since_s, state })
    }
}

fn is_alarm(state: &State) -> bool {
    matches!(state, State::Drifted(_) | State::Stale { .. } | State::Inconsistent)
}

fn kind(state: &State) -> std::mem::Discriminant<State> {
    std::mem::discriminant(state)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::{CheckingReason, Observation};

    fn state(t_s: f64, state: State) -> Event {
        Event::StateChanged { camera: 0, target: 0, t_s, state }
    }

    fn frame(t_s: f64) -> Event {
        let observation = Box::new(Observation { capture_s: t_s, ..Observation::default() });
        Event::Observed { camera: 0, target: 0, observation }
    }

    fn states(events: Vec<Event>) -> Vec<(f64, State)> {
        let of = |event| match event {
            Event::StateChanged { t_s, state, .. } => Some((t_s, state)),
            _ => None,
        };
        events.into_iter().filter_map(of).collect()
    }

    /// Thirty frames a second, every third an outlier, for an hour: the doubt is reported once, and calm when it has lasted.
    #[test]
    fn a_state_that_flickers_is_reported_once() {
        let (mut outlet, mut reported) = (Outlet::default(), Vec::new());
        reported.extend(states(outlet.take(state(0.0, State::Steady))));
        for i in 0..108_000 {
            let t_s = f64::from(i) / 30.0;
            let now = if i % 3 == 0 { State::Checking(CheckingReason::Different) } else { State::Steady };
            reported.extend(states(outlet.take(frame(t_s))));
            reported.extend(states(outlet.take(state(t_s, now))));
        }
        assert_eq!(reported.len(), 2, "{reported:?}");
        assert_eq!(states(outlet.finish()).len(), 1, "that it is steady at the end");
    }

    /// What comes and goes every five seconds for a day, an alarm each time: no more than is stated, and the last one is reported.
    #[test]
    fn no_output_exceeds_its_stated_rate() {
        let (mut outlet, mut reported) = (Outlet::default(), Vec::new());
        let day_s = 86_400;
        for t_s in (0..day_s).step_by(5) {
            let is_unseen = t_s / 5 % 2 == 1;
            let now = if is_unseen { State::Stale { for_s: 1.0 } } else { State::Steady };
            reported.extend(states(outlet.take(frame(f64::from(t_s)))));
            reported.extend(states(outlet.take(state(f64::from(t_s), now))));
        }
        let most = 2.0 * (BURST + f64::from(day_s) / AGAIN_S);
        assert!(
            (1000.0..=most).contains(&(reported.len() as f64)),
            "{} told, {most} at most",
            reported.len()
        );
        reported.extend(states(outlet.finish()));
        assert!(matches!(reported.last(), Some((_, State::Stale { .. }))), "{:?}", reported.last());
    }

    /// An alarm is never kept back by the doubts before it.
    #[test]
    fn alarms_pass_at_once() {
        let mut outlet = Outlet::default();
        for i in 0..100 {
            outlet.take(state(0.1 * f64::from(i), State::Checking(CheckingReason::Different)));
            outlet.take(state(0.1 * f64::from(i) + 0.05, State::Learning { readings: 1, needed: 50 }));
        }
        let reported = states(outlet.take(state(10.0, State::Inconsistent)));
        assert_eq!(reported, [(10.0, State::Inconsistent)]);
    }
}
