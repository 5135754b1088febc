//! The rate of reports of a session: a state that alternates with every frame must not fill a disk and an inbox.
//!
//! Every change of a state, and of what moved, passes here. Alarms pass at once. A state that recurs after it was reported, and the calm
//! (`steady`) after it, must last `CALM_S`, twice as long after each recurrence, at most `LONGEST_S`. So an event causes one message and one
//! correction, and an alternating state is reported a few times, then at most once an hour. All reports also pass a token bucket: `BURST` at
//! once, then one every `AGAIN_S`. What must wait is not lost: the newest state is reported when it is due, or at the end.

use super::{CheckingReason, Event, State};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A doubtful state is reported as steady when it has been so for this long, seconds of capture time;
const CALM_S: f64 = 2.0;
/// twice as long after each recurrence of the doubt, up to this.
const LONGEST_S: f64 = 3600.0;
/// One recurrence is no longer counted after this long, seconds.
const FORGOTTEN_S: f64 = 6.0 * 3600.0;
/// Largest number of changes of one kind in immediate succession,
const BURST: f64 = 10.0;
/// and then one in this time, seconds of capture time.
const AGAIN_S: f64 = 60.0;
/// Two start times that differ by more than this many of their combined standard deviations belong to two motions.
const APART: f64 = 3.0;
/// After this long without events, the clock of this machine continues that of the frames.
const SILENT: Duration = Duration::from_secs(1);

/// The last reports of every pair and of what moved, and the waiting ones.
#[derive(Default)]
pub(super) struct Outlet {
    pairs: BTreeMap<(usize, usize), Pair>,
    moved: Moved,
    /// Newest capture time of any camera, seconds: a report of what moved concerns all of them.
    now_s: f64,
    /// Time of the last event.
    heard: Option<Instant>,
}

#[derive(Default)]
struct Pair {
    reported: Option<State>,
    /// One bucket for alarms and one for the rest: neither uses up the tokens of the other.
    buckets: [Bucket; 2],
    waiting: Option<(f64, State)>,
    flicker: Flicker,
    /// Start of the motion that was last reported and its standard deviation, seconds; whether it has been corrected.
    motion: Option<(f64, f64)>,
    is_corrected: bool,
}

/// The recent recurrences of doubtful states.
#[derive(Default)]
struct Flicker {
    /// Kinds of states, and when they were last reported.
    reported_s: Vec<(Kind, f64)>,
    /// Number of recurrences, less those no longer counted at `at_s`.
    times: f64,
    at_s: f64,
}

type Kind = std::mem::Discriminant<State>;

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

impl Flicker {
    fn times(&self, t_s: f64) -> f64 {
        (self.times - (t_s - self.at_s).max(0.0) / FORGOTTEN_S).max(0.0)
    }

    fn goes_on(&self, t_s: f64) -> bool {
        0.5 < self.times(t_s)
    }

    /// Returns how long a recurring change, or one that ends it, must last, seconds.
    fn patience_s(&self, t_s: f64) -> f64 {
        (CALM_S * self.times(t_s).exp2()).min(LONGEST_S)
    }

    /// Returns whether a state of this kind has been reported within an hour, or while states alternated.
    fn is_known(&self, kind: Kind, t_s: f64) -> bool {
        let is_recent = |at_s: f64| self.goes_on(t_s) || t_s - at_s < LONGEST_S;
        self.reported_s.iter().any(|(known, at_s)| *known == kind && is_recent(*at_s))
    }

    fn report(&mut self, kind: Kind, t_s: f64) {
        let again = f64::from(u8::from(self.is_known(kind, t_s)));
        (self.times, self.at_s) = ((self.times(t_s) + again).min((LONGEST_S / CALM_S).log2()), t_s);
        self.reported_s.retain(|(known, _)| *known != kind);
        self.reported_s.push((kind, t_s));
    }
}

impl Outlet {
    /// Returns the events to report after this one.
    pub fn take(&mut self, event: Event) -> Vec<Event> {
        self.heard = Some(Instant::now());
        match event {
            Event::StateChanged { camera, target, t_s, state } => {
                self.now_s = self.now_s.max(t_s);
                let pair = self.pairs.entry((camera, target)).or_default();
                // A waiting state is replaced by the current one.
                let since_s = match &pair.waiting {
                    Some((since_s, waiting)) if pair.continues(waiting, &state) => *since_s,
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

    /// Returns the events to report without a new event: a camera without frames has no capture times that show how long that lasts.
    pub fn idle(&mut self, now: Instant) -> Vec<Event> {
        let silent = self.heard.map(|heard| now.saturating_duration_since(heard));
        let Some(silent) = silent.filter(|silent| SILENT < *silent) else { return Vec::new() };
        let t_s = self.now_s + silent.as_secs_f64();
        let pairs = self.pairs.iter_mut().filter_map(|(key, pair)| pair.due(*key, t_s));
        pairs.collect()
    }

    /// Returns the events that still wait when all sources have ended.
    pub fn finish(&mut self) -> Vec<Event> {
        let moved = self.moved.waiting.take().into_iter();
        let pairs = self.pairs.iter_mut().filter_map(|(key, pair)| {
            let (t_s, state) = pair.waiting.take()?;
            let is_new = pair.reported.as_ref().is_none_or(|reported| !is_same(reported, &state));
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
        if self.reported.as_ref().is_some_and(|reported| is_same(reported, state)) {
            self.waiting = None;
            return None;
        }
        if self.reported.as_ref().is_some_and(is_away) && is_away(state) {
            return None; // return None; // Its distance is reported again at the end.
        }
        let was_drifted = matches!(self.reported, Some(State::Drifted(_)));
        let is_known = self.is_known_motion(state);
        if was_drifted && is_known && self.is_corrected {
            return None; // return None; // Its final estimate is reported at the end.
        }
        if t_s < since_s + self.patience_s(state, t_s)
            || !self.buckets[usize::from(is_alarm(state))].takes(t_s)
        {
            return None;
        }
        let (since_s, state) = self.waiting.take()?;
        match &state {
            State::Drifted(drift) => {
                self.is_corrected = is_known && (was_drifted || self.is_corrected);
                self.motion = Some((drift.began_s, drift.began_sigma_s));
            }
            state if is_doubt(state) => self.flicker.report(kind(state), t_s),
            _ => self.motion = None,
        }
        self.reported = Some(state.clone());
        Some(Event::StateChanged { camera, target, t_s: since_s, state })
    }

    /// Returns whether the waiting state is the same, though estimated otherwise: a further motion is a different one.
    fn continues(&self, waiting: &State, now: &State) -> bool {
        kind(waiting) == kind(now) && (!matches!(now, State::Drifted(_)) || self.is_known_motion(now))
    }

    /// Returns whether this is the motion that was last reported, perhaps with a better estimate: it began no later.
    fn is_known_motion(&self, state: &State) -> bool {
        let (Some((began_s, sigma_s)), State::Drifted(now)) = (self.motion, state) else { return false };
        now.began_s - began_s <= APART * now.began_sigma_s.hypot(sigma_s)
    }

    /// Returns how long this state must have lasted before it is reported, seconds.
    fn patience_s(&self, state: &State, t_s: f64) -> f64 {
        let was_in_doubt = self.reported.as_ref().is_some_and(is_doubt);
        let is_return = match state {
            State::Drifted(_) => was_in_doubt && self.is_known_motion(state),
            _ => matches!(state, State::Steady | State::Tracking),
        };
        let came_again = match self.reported {
            // After the first alarm the return is reported at once, because the doubt may have been none.
            Some(State::Checking(_)) if is_return => true,
            _ if is_return => was_in_doubt && self.flicker.goes_on(t_s),
            // From a calm state an alarm passes at once, however often it has recurred.
            _ => is_doubt(state) && was_in_doubt && self.flicker.is_known(kind(state), t_s),
        };
        if came_again { self.flicker.patience_s(t_s) } else { 0.0 }
    }
}

/// Returns whether a state contains nothing that was not reported.
fn is_same(reported: &State, now: &State) -> bool {
    match (reported, now) {
        (State::Stale { .. }, State::Stale { .. }) | (State::Learning { .. }, State::Learning { .. }) => true,
        (reported, now) => reported == now,
    }
}

fn is_away(state: &State) -> bool {
    matches!(state, State::Checking(CheckingReason::Away(_)))
}

fn is_doubt(state: &State) -> bool {
    matches!(state, State::Checking(_) | State::Stale { .. } | State::Inconsistent)
}

fn is_alarm(state: &State) -> bool {
    matches!(state, State::Drifted(_) | State::Stale { .. } | State::Inconsistent)
}

fn kind(state: &State) -> Kind {
    std::mem::discriminant(state)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::Observation;
    use resight_core::temporal::monitor::{Drift, MotionKind};
    use resight_core::{Matrix6, Vector6};

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

    /// An alarm that recurs every five seconds for a day: no more reports than stated, and the last one is reported.
    #[test]
    fn no_output_exceeds_its_stated_rate() {
        let (mut outlet, mut reported) = (Outlet::default(), Vec::new());
        let day_s = 86_400;
        for t_s in (0..day_s).step_by(5) {
            let is_unseen = t_s / 5 % 2 == 1;
            let now = if is_unseen { State::Stale { for_s: 1.0, reason: None } } else { State::Steady };
            reported.extend(states(outlet.take(frame(f64::from(t_s)))));
            reported.extend(states(outlet.take(state(f64::from(t_s), now))));
        }
        // Until a calm period of five seconds is too short, and again when the recurrences are no longer counted.
        assert!((6..=26).contains(&reported.len()), "{} told", reported.len());
        reported.extend(states(outlet.finish()));
        assert!(matches!(reported.last(), Some((_, State::Stale { .. }))), "{:?}", reported.last());
    }

    /// Doubts do not delay an alarm that follows them.
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

    fn moved(began_s: f64, began_sigma_s: f64) -> State {
        State::Drifted(Box::new(Drift {
            old_from_new: Vector6::zeros(),
            covariance: Matrix6::identity(),
            began_s,
            began_sigma_s,
            course: MotionKind::Step,
            course_probability: 1.0,
            rate: None,
            again: None,
        }))
    }

    /// One motion causes one message, one correction and the final estimate at the end; another motion causes another message.
    #[test]
    fn a_motion_is_corrected_once() {
        let (mut outlet, mut reported) = (Outlet::default(), Vec::new());
        for (t_s, began_s) in [(100.0, 100.0), (130.0, 99.0), (160.0, 98.0), (190.0, 97.0), (230.0, 230.0)] {
            reported
                .extend(states(outlet.take(state(t_s, moved(began_s, 1.0)))).into_iter().map(|(t_s, _)| t_s));
        }
        reported.extend(states(outlet.take(state(300.0, moved(229.0, 1.0)))).into_iter().map(|(t_s, _)| t_s));
        assert!(states(outlet.take(state(400.0, moved(228.0, 1.0)))).is_empty());
        assert_eq!(reported, [100.0, 130.0, 230.0, 300.0]);
        assert_eq!(states(outlet.finish()), [(400.0, moved(228.0, 1.0))]);
    }

    /// Three states that alternate at random, some seconds each, for a day: a few messages at first, then no more than one doubt and one calm an
    /// hour. The last state is reported at the end.
    #[test]
    fn what_flickers_is_reported_seldom() {
        let (mut outlet, mut reported, mut chance) = (Outlet::default(), Vec::new(), 1u32);
        let mut t_s = 0.0;
        while t_s < 86_400.0 {
            chance = chance.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let now = match chance >> 30 {
                0 => State::Inconsistent,
                1 => State::Stale { for_s: 6.0, reason: None },
                2 => State::Checking(CheckingReason::Different),
                _ => State::Steady,
            };
            t_s += 1.0 + f64::from(chance >> 24 & 31);
            reported.extend(states(outlet.take(state(t_s, now))));
            reported.extend(states(outlet.take(frame(t_s + 0.5))));
        }
        let (early, late): (Vec<_>, Vec<_>) = reported.iter().partition(|(t_s, _)| *t_s < 7200.0);
        assert!((3..=36).contains(&early.len()), "{} in two hours", early.len());
        assert!(late.len() <= 44, "{} in 22 hours", late.len());
    }

    /// A camera that moved and is observed only at times: the motion is reported a few times, a further one at once.
    #[test]
    fn a_motion_that_is_seen_now_and_then_is_not_repeated() {
        let (mut outlet, mut reported) = (Outlet::default(), Vec::new());
        let stale = State::Stale { for_s: 5.0, reason: None };
        for i in 0..4000 {
            let now = if i % 2 == 0 { moved(0.0, 1.0) } else { stale.clone() };
            reported.extend(states(outlet.take(state(20.0 * f64::from(i), now))));
            reported.extend(states(outlet.take(frame(20.0 * f64::from(i) + 10.0))));
        }
        assert!((4..=24).contains(&reported.len()), "{} in 22 hours", reported.len());
        let further = moved(80_000.0, 1.0);
        assert_eq!(states(outlet.take(state(80_002.0, further.clone()))), [(80_002.0, further)]);
    }

    /// After alternating states the cable is cut: no event arrives any more, and that is reported when it has lasted.
    #[test]
    fn a_silence_after_a_flicker_is_reported() {
        let (mut outlet, stale) = (Outlet::default(), State::Stale { for_s: 5.0, reason: None });
        let flicker = [State::Inconsistent, stale.clone(), State::Inconsistent, State::Steady, stale.clone()];
        for (i, now) in flicker.into_iter().enumerate() {
            outlet.take(state(600.0 * i as f64, now.clone()));
            outlet.take(frame(600.0 * i as f64 + 500.0));
        }
        outlet.take(state(3000.0, State::Inconsistent));
        assert_eq!(states(outlet.take(frame(3500.0))), [(3000.0, State::Inconsistent)], "it has lasted");
        assert!(states(outlet.take(state(3600.0, stale.clone()))).is_empty(), "not at once");
        let now = Instant::now();
        assert!(states(outlet.idle(now)).is_empty(), "nor while the clock of the frames goes");
        assert_eq!(states(outlet.idle(now + Duration::from_secs(3700))), [(3600.0, stale)]);
    }

    /// Darkness every night: no return is delayed by more than seconds, for months.
    #[test]
    fn nights_are_no_flicker() {
        let mut outlet = Outlet::default();
        for night in 0..100 {
            let dusk_s = 86_400.0 * f64::from(night);
            let dark = State::Stale { for_s: 5.0, reason: None };
            assert_eq!(states(outlet.take(state(dusk_s, dark))).len(), 1, "night {night}");
            assert_eq!(
                states(outlet.take(state(dusk_s + 36_000.0, State::Steady))).len(),
                1,
                "morning {night}"
            );
        }
    }
}
