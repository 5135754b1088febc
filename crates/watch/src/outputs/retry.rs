//! The pauses before another try, and its messages in the log: one for each change, not for each try.

use super::super::log::Log;
use super::outbox::Outbox;
use resight::core::statistics::SplitMix64;
use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::time::{Duration, Instant};

/// First pause, seconds.
const FIRST_S: f64 = 0.5;
/// Longest pause without a request of the receiver, seconds.
const LONGEST_S: f64 = 60.0;
/// Longest pause that a receiver may request, seconds.
const LONGEST_ASKED_S: f64 = 3600.0;

/// Pauses that double after each failure. Each is shortened at random, to as little as half, so that a hundred sessions that lost the same
/// receiver do not return at the same time.
pub struct Backoff {
    next_s: f64,
    chance: SplitMix64,
    /// Whether the end of the session has been noticed.
    is_hurried: bool,
}

impl Backoff {
    pub fn new() -> Self {
        Backoff { next_s: FIRST_S, chance: SplitMix64::new(random()), is_hurried: false }
    }

    /// Returns the next pause; at least what the receiver requested.
    pub fn pause(&mut self, asked: Option<Duration>) -> Duration {
        let share = self.chance.uniform();
        let own_s = self.next_s * (0.5 + 0.5 * share);
        self.next_s = (2.0 * self.next_s).min(LONGEST_S);
        let asked_s = asked.map_or(0.0, |asked| asked.as_secs_f64().min(LONGEST_ASKED_S));
        Duration::from_secs_f64(own_s.max(asked_s))
    }

    /// Pauses. A pause is cut short by the end of the session, after which little time is left, and later ones start small again.
    pub async fn rest<T>(&mut self, outbox: &Outbox<T>, asked: Option<Duration>) {
        if outbox.is_closed() && !self.is_hurried {
            self.is_hurried = true;
            self.reset();
        }
        outbox.rest(self.pause(asked)).await;
    }

    /// Resets the pauses after a success.
    pub fn reset(&mut self) {
        self.next_s = FIRST_S;
    }
}

/// Returns an unpredictable number: the standard library draws its hash keys from the operating system.
pub fn random() -> u64 {
    let mut hasher = RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    hasher.finish()
}

/// The state of the delivery to one receiver.
pub struct Standing {
    log: Log,
    part: &'static str,
    receiver: String,
    trouble: Option<Trouble>,
    /// The reason last reported; none once something else was accepted.
    refusal: Option<String>,
    was_reached: bool,
}

struct Trouble {
    reason: String,
    since: Instant,
    tries: u32,
}

impl Standing {
    /// `receiver` appears in the log, so that it must not contain secrets.
    pub fn new(log: &Log, part: &'static str, receiver: &str) -> Self {
        Standing {
            log: log.clone(),
            part,
            receiver: receiver.to_string(),
            trouble: None,
            refusal: None,
            was_reached: false,
        }
    }

    /// Reports a failed try that will be repeated.
    pub fn failed(&mut self, reason: &str) {
        match &mut self.trouble {
            Some(trouble) => {
                trouble.tries += 1;
                if trouble.reason != reason {
                    trouble.reason = reason.to_string();
                    self.say(&format!("now {reason}; still trying"));
                }
            }
            None => {
                self.trouble = Some(Trouble { reason: reason.to_string(), since: Instant::now(), tries: 1 });
                self.say(&format!("{reason}; trying again, what is to be reported waits"));
            }
        }
    }

    /// Reports a success; `dropped` items were dropped until the queue was empty.
    pub fn delivered(&mut self, dropped: u64) {
        self.refusal = None;
        self.answered(dropped);
    }

    fn answered(&mut self, dropped: u64) {
        let lost = if dropped == 0 { String::new() } else { format!("; {dropped} were dropped meanwhile") };
        match self.trouble.take() {
            Some(trouble) => {
                let (since_s, tries) = (trouble.since.elapsed().as_secs_f64(), trouble.tries);
                self.say(&format!("answers again after {since_s:.1} s and {tries} failed tries{lost}"));
            }
            None if dropped != 0 => {
                self.say(&format!("has caught up; {dropped} were dropped while too many waited"));
            }
            None => {}
        }
    }

    /// Reports that a receiver rejects an item; again only when its reason changes.
    pub fn refused(&mut self, dropped: u64, reason: &str) {
        self.answered(dropped);
        if self.refusal.as_deref() != Some(reason) {
            self.say(reason);
            self.refusal = Some(reason.to_string());
        }
    }

    /// Reports a connection: the first time, and after each failure.
    pub fn reached(&mut self) {
        if self.trouble.is_none() && !self.was_reached {
            self.say("connected");
        }
        self.was_reached = true;
        self.answered(0);
    }

    /// Writes one line to the log.
    pub fn say(&self, text: &str) {
        self.log.say(self.part, &format!("{}: {text}", self.receiver));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_within_their_bounds() {
        let mut backoff = Backoff::new();
        for i in 0..12 {
            let whole_s = (FIRST_S * 2_f64.powi(i)).min(LONGEST_S);
            let pause_s = backoff.pause(None).as_secs_f64();
            assert!((0.5 * whole_s..=whole_s).contains(&pause_s), "{i}: {pause_s} s of {whole_s} s");
        }
        backoff.reset();
        assert!(backoff.pause(None).as_secs_f64() <= FIRST_S);
    }

    /// The pause ends long before a minute, whether the session ends before or during it.
    #[test]
    fn no_long_pause_outlasts_the_session() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().expect("a runtime");
        for is_closed_before in [true, false] {
            let (outbox, mut backoff) = (Outbox::<u32>::new(1), Backoff::new());
            (0..12).for_each(|_| assert!(!backoff.pause(None).is_zero()));
            let started = Instant::now();
            runtime.block_on(async {
                if is_closed_before {
                    outbox.close();
                }
                tokio::join!(backoff.rest(&outbox, None), async { outbox.close() });
            });
            assert!(started.elapsed() < Duration::from_secs(25), "{:?}", started.elapsed());
        }
    }

    #[test]
    fn a_receiver_may_ask_for_more_but_not_for_ever() {
        let asked = |s| Backoff::new().pause(Some(Duration::from_secs(s))).as_secs();
        assert_eq!((asked(7), asked(1_000_000)), (7, LONGEST_ASKED_S as u64));
    }

    #[test]
    fn pauses_of_two_sessions_differ() {
        let pauses = |mut backoff: Backoff| (0..4).map(|_| backoff.pause(None)).collect::<Vec<_>>();
        assert_ne!(pauses(Backoff::new()), pauses(Backoff::new()));
    }
}
