//! After an alarm: whether errors explain it, the course of the motion, and the return of the camera.
//!
//! ```text
//!   R ≥ A ──► errors scatter more than the model says, and that explains R ──► noise as it was seen, test anew, `Watch::CorrelatedErrors`
//!        └──► moved: measured from where it was known to be before (`base`); course and rate from the means of readings since
//!               └──► back: where it was before is a thousand times likelier than where the alarm found it
//! ```
//! Derivation: docs/math/monitor.md sections 4 and 10.

use super::again::Motions;
use super::drift::{Again, Rate};
use super::gate::{Gate, Passed};
use super::milestones::{Milestone, Milestones};
use super::onsets::Change;
use super::priors::{CONFIRM, MEDIAN, MotionKind, OUTLIER, deflated};
use super::scatter::{Excess, Scatter};
use super::test::{self, SURPRISE, whitening};
use super::trace::{Fitted, Trace};
use super::{Drift, DriftNoise, Monitor, between, is_likely, transients};
use crate::temporal::snapshot::numbers;
use crate::{Matrix6, Pose, Vector6};
use arrayvec::ArrayVec;

/// The knowledge about an alarm besides the test itself.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Aftermath {
    milestones: Milestones,
    scatter: Scatter,
    trace: Trace,
    /// The levels before the drift and at the alarm.
    base: Milestone,
    found: Milestone,
    /// The motion until the last alarm, where that was held: what is reported since may be that much too large.
    held: Vector6,
    /// The level is of readings from then on, seconds.
    since_s: f64,
    /// Whether that was a further alarm, which may have been the way back.
    is_further: bool,
    /// ln R of the alarm.
    log_r: f64,
    /// Of a slow drift.
    rate: Option<Rate>,
    /// When the course was last tested, seconds.
    named_s: f64,
    /// When the errors were last found larger than the model, seconds, and decisions since.
    doubted_s: Option<f64>,
    decisions: u32,
}

/// Odds of another course at which the name is changed, as Δχ²: 400 to 1.
const RENAMED: f64 = 12.0;
/// The same at the alarm, when the name has not been reported yet.
const NAMED: f64 = 4.0;
/// The course is tested again when the motion has lasted longer by this share.
const AGAIN: f64 = 0.1;
/// The beginning of a slow drift is reported again when its ± is smaller by this factor.
const SHARPER: f64 = 0.5;
/// ln of the odds at which a camera is back: 1000 to 1.
const BACK: f64 = 7.0;
/// Errors found larger than the model are reported for this long, seconds, and so many decisions, at least.
const DOUBT_S: f64 = 60.0;
const DOUBT_DECISIONS: u32 = 30;
/// The difference of two neighbouring means over the time in which a correlated error is forgotten, in units of that error: eq. (46).
const OVER_ONE_TIME: f64 = 0.672;
/// Largest share of the motion that may remain where a camera counts as back; less than half, so that half of the way back does not.
const LEFT: f64 = 0.25;
/// The alarm chose its time and its onset: its estimate errs by more than its covariance says (simulated: section 11 of monitor.md).
const FOUND: f64 = 1.5;
/// Decisions before the onset that may be of the motion, and that of the onset.
const ONSET: f64 = 2.0;
/// A slow drift's end is the mean of this share of it.
const END: f64 = 0.05;

impl Aftermath {
    pub fn new(start: Milestone) -> Self {
        Aftermath {
            milestones: Milestones::from(start),
            scatter: Scatter::new(),
            trace: Trace::new(),
            base: start,
            found: start,
            held: Vector6::zeros(),
            since_s: start.t_s,
            is_further: false,
            log_r: 0.0,
            rate: None,
            named_s: start.t_s,
            doubted_s: None,
            decisions: 0,
        }
    }

    pub fn is_sound(&self) -> bool {
        self.milestones.is_sound() && self.trace.is_sound()
    }

    /// Whether errors have lately been found larger than the model.
    pub fn is_doubted(&self, t_s: f64) -> bool {
        let is_recent = |doubted_s| t_s < doubted_s + DOUBT_S || self.decisions < DOUBT_DECISIONS;
        self.doubted_s.is_some_and(is_recent)
    }

    /// The camera is where it was: what comes is compared with `home`.
    fn begin_at(&mut self, home: Milestone) {
        (self.milestones, self.base, self.found) = (Milestones::from(home), home, home);
        (self.held, self.since_s) = (Vector6::zeros(), home.t_s - home.over_s);
        (self.trace, self.rate) = (Trace::new(), None);
        self.scatter.interrupt();
    }
}

impl Monitor {
    /// Processes all readings that come through at once before a decision, because readings that waited together belong together.
    pub(super) fn decide(&mut self, passed: &[Passed]) {
        if let Some(first) = passed.first() {
            self.await_reading(first.t_s);
        }
        let (period_s, threshold) = (self.config.decision_period_s, self.log_threshold());
        let most = (threshold - test::LEAST_EVIDENCE.ln()).exp();
        let (mut log_r, mut motions) = (None, ArrayVec::<Vector6, { CONFIRM + 1 }>::new());
        for joined in passed {
            log_r = Some(self.test.push(joined.t_s, &joined.reading, period_s, most));
            motions.push(self.note(joined));
        }
        let (Some(log_r), Some(last)) = (log_r, passed.last()) else { return };
        // What the noise in use does not explain, other noise may.
        if self.test.passes(log_r, threshold) {
            // What waited together may be of one motion, whichever of it the onset is put at.
            let first_s = passed.first().map_or(last.t_s, |first| first.t_s);
            self.alarmed(last.t_s, log_r, first_s);
        }
        self.rename(last.t_s);
        if self.drift.is_some() {
            self.come_back(last.t_s);
        }
        if !self.whereabouts.is_known() {
            // It is elsewhere: what came before says nothing of now.
            passed.iter().zip(&motions).for_each(|(joined, motion)| self.locate(joined, motion));
        }
        self.compare();
    }

    /// The motion of a reading from the pose of the reference.
    fn note(&mut self, joined: &Passed) -> Vector6 {
        let motion = self.seen_from_reference(&self.test.motion(&joined.reading.value));
        let level = self.level(joined.t_s);
        self.locate(joined, &motion);
        let aftermath = &mut self.aftermath;
        // Where noise is measured the models of the test know of correlated errors.
        match self.test.measured() {
            Some(_) => self.wander.push(&self.test.whitened(&motion, &Matrix6::zeros()).value),
            None => aftermath.scatter.push(joined.t_s, &joined.reading, self.test.noise()),
        }
        aftermath.trace.push(joined.t_s, &motion, self.drift.map(|drift| drift.began_s));
        aftermath.decisions = aftermath.decisions.saturating_add(1);
        match self.drift {
            Some(_) => self.motions.note(level),
            None => aftermath.milestones.push(level),
        }
        motion
    }

    /// A small motion from the level of the test, as one from the reference.
    fn seen_from_reference(&self, motion: &Vector6) -> Vector6 {
        (self.old_from_level * Pose::exp(motion)).log()
    }

    /// The present level.
    fn level(&self, t_s: f64) -> Milestone {
        let (motion, covariance) = self.test.level();
        let over_s = t_s - self.aftermath.since_s;
        Milestone { t_s, motion: self.seen_from_reference(&motion), covariance, over_s }
    }

    /// The level, onset and course of the change that raised the alarm.
    fn changed(&self, t_s: f64) -> Option<(Milestone, Change)> {
        let change = self.test.change()?;
        let (motion, covariance) = self.test.level_after(&change);
        let over_s = t_s - change.onset_s;
        Some((Milestone { t_s, motion: self.seen_from_reference(&motion), covariance, over_s }, change))
    }

    fn alarmed(&mut self, t_s: f64, log_r: f64, first_s: f64) {
        let Some((now, change)) = self.changed(t_s) else { return };
        let before_s = change.onset_s.min(first_s);
        match self.drift {
            None => self.moved(log_r, before_s, &now, &change),
            Some(drift) => self.moved_again(&drift, before_s, &now, &change),
        }
    }

    fn moved(&mut self, log_r: f64, before_s: f64, now: &Milestone, change: &Change) {
        let base = self.aftermath.milestones.before(before_s);
        (self.aftermath.base, self.aftermath.log_r) = (base, log_r);
        if let Some(excess) = self.explanation(now.t_s - change.onset_s) {
            return self.doubt(now.t_s, &excess);
        }
        let drift = drift(&base, now, change);
        if drift.matters(&self.config) {
            self.motions = Motions::none(base);
            self.aftermath.is_further = false;
            self.hold(&drift, now.t_s, true);
            self.reported(drift, base, now);
        }
    }

    /// An alarm of the test around where it was last reported to be.
    fn moved_again(&mut self, before: &Drift, before_s: f64, now: &Milestone, change: &Change) {
        let (base, own) = (self.aftermath.base, self.reference.noise);
        let from = self.motions.before(before_s);
        let (away, was_away) = (between(&base.motion, &now.motion), between(&base.motion, &from.motion));
        let at_home = now.covariance + base.covariance + own.bias + own.diurnal;
        if is_likely(&away, &at_home) && along(&away, &was_away, &at_home).abs() < LEFT {
            return self.is_home(now.t_s, change.onset_s);
        }
        let own = drift(&from, now, change);
        if !own.matters(&self.config) {
            return;
        }
        // A ramp continues, as its rate states.
        let ramp = self.fitted().filter(|fitted| {
            fitted.course == MotionKind::Ramp && (before.course == fitted.course || RENAMED < fitted.lead)
        });
        if let Some(ramp) = ramp {
            if before.course == MotionKind::Step {
                self.is_named(before, &ramp);
            }
            return self.goes_on(now, change.onset_s);
        }
        let whole = drift(&base, now, change);
        if self.is_recurring(before, &from, &own, now.t_s) {
            self.hold(&whole, now.t_s, true);
            // It may have been the way back.
            (self.aftermath.is_further, self.aftermath.decisions) = (true, 0);
            return self.goes_on(now, change.onset_s);
        }
        self.aftermath.trace.forget_before(before.began_s);
        if self.is_held(now.t_s) {
            self.aftermath.held = between(&base.motion, &from.motion);
        }
        (self.aftermath.is_further, self.aftermath.rate) = (true, None);
        self.hold(&whole, now.t_s, false);
        self.reported(whole, from, now);
    }

    /// The motion that was reported last continues to here.
    fn goes_on(&mut self, now: &Milestone, onset_s: f64) {
        self.aftermath.found = *now;
        let found = self.begin_around(now, onset_s);
        self.motions.goes_on(found);
    }

    /// Whether a further motion, `own`, is one of those that come back by themselves. The last one is one of them where this does not continue it.
    fn is_recurring(&mut self, before: &Drift, from: &Milestone, own: &Drift, t_s: f64) -> bool {
        let (last, reading) = (self.motions.last(from), &self.reference.noise.reading);
        if along(&own.old_from_new, &last, reading) < LEFT {
            self.transients.add_small(before.began_s, own.began_s, transients::size(&last, reading));
        }
        let size = transients::size(&own.old_from_new, reading);
        self.test.measured().is_some() && self.transients.may_last_until(t_s, size).is_some()
    }

    /// Further readings are compared with what is reported.
    fn reported(&mut self, drift: Drift, from: Milestone, now: &Milestone) {
        self.drift = Some(drift);
        (self.aftermath.found, self.aftermath.decisions) = (*now, 0);
        self.aftermath.named_s = drift.began_s;
        let found = self.begin_around(now, drift.began_s);
        self.motions.add(drift.began_s, from, found);
        self.whereabouts.forget();
    }

    /// Starts the next stage from the estimate of the alarm; the present level is learned anew. It may have moved by as much again already, in any
    /// direction: readings then outweigh what is expected, so that no share of the motion stays in the level.
    fn begin_around(&mut self, now: &Milestone, onset_s: f64) -> Milestone {
        let own = self.reference.noise;
        let covariance = now.covariance + own.reading + own.bias + own.reference;
        let chi2 = transients::size(&between(&self.aftermath.base.motion, &now.motion), &own.reading);
        self.test_from(&now.motion, covariance + own.reading * chi2, onset_s, false);
        self.aftermath.since_s = onset_s;
        Milestone { covariance, ..*now }
    }

    /// Errors that scatter more than the model says, over times like that of the change, where they explain the alarm.
    fn explanation(&self, duration_s: f64) -> Option<Excess> {
        let excess = self.aftermath.scatter.excess(2.0 * duration_s)?;
        let log_r = deflated(self.aftermath.log_r, excess.factor);
        (log_r < self.log_threshold()).then_some(excess)
    }

    /// Errors may prove to be larger than the model only after the alarm; a motion that they explain then is taken back.
    fn take_back(&mut self, drift: &Drift, t_s: f64) -> bool {
        let Some(excess) = self.explanation(t_s - drift.began_s) else { return false };
        let reported = self.refined(drift);
        let chi2 = reported
            .covariance
            .cholesky()
            .map(|factor| reported.old_from_new.dot(&factor.solve(&reported.old_from_new)));
        let is_explained = chi2.is_some_and(|chi2| chi2 < SURPRISE * excess.factor);
        if is_explained {
            self.drift = None;
            self.doubt(t_s, &excess);
        }
        is_explained
    }

    /// From here on the test asks whether it moves away from this motion, known so well; what it has read since `onset_s` is noise only
    /// where it `came_back`.
    fn test_from(&mut self, motion: &Vector6, covariance: Matrix6, onset_s: f64, came_back: bool) {
        let noise = DriftNoise { reference: covariance, ..self.reference.noise };
        let Some(test) = self.test.restarted(&noise, onset_s, came_back) else { return };
        (self.test, self.old_from_level) = (test, Pose::exp(motion));
        self.gate = Gate::new(self.config.decision_period_s);
        self.aftermath.scatter.interrupt();
    }

    /// The camera is back where it was, which is known as well as before the motion.
    fn is_home(&mut self, t_s: f64, onset_s: f64) {
        let home = self.aftermath.base;
        if let Some(was) = self.drift.take().filter(|_| self.test.measured().is_some()) {
            let reading = &self.reference.noise.reading;
            let size = transients::size(&was.old_from_new, reading);
            self.transients.add(was.began_s, onset_s, size);
            let is_long = transients::LONGEST_S < onset_s - was.began_s;
            if size < OUTLIER && (is_long || self.transients.known(t_s).is_some()) {
                self.wander.count();
            }
            self.wander.forget();
            if is_long {
                let motion = between(&home.motion, &self.motions.before(onset_s).motion);
                self.regimes.add((was.began_s, onset_s), &motion, reading);
            }
        }
        let home = Milestone { t_s, ..home };
        self.held_until_s = None;
        self.test_from(&home.motion, home.covariance, onset_s, true);
        self.aftermath.begin_at(home);
        self.motions = Motions::none(home);
        self.whereabouts.forget();
    }

    /// Errors explain the alarm: from now on errors of that size and correlation time are expected.
    fn doubt(&mut self, t_s: f64, excess: &Excess) {
        let own = &mut self.reference.noise;
        let Some((_, back)) = whitening(&(own.reading + own.bias)) else { return };
        let variance = excess.variance / OVER_ONE_TIME;
        let correlated = back * Matrix6::from_diagonal(&variance) * back.transpose();
        own.bias += 0.5 * (correlated + correlated.transpose());
        own.bias_time_s = own.bias_time_s.max(excess.over_s);
        let base = self.aftermath.base;
        let independent = (0.5 * (base.t_s - self.aftermath.began_s()) / own.bias_time_s).max(1.0);
        let home = Milestone { t_s, covariance: base.covariance + own.bias / independent, ..base };
        self.test_from(&home.motion, home.covariance, t_s, true);
        self.aftermath.begin_at(home);
        self.aftermath.scatter = Scatter::new();
        (self.aftermath.doubted_s, self.aftermath.decisions) = (Some(t_s), 0);
    }

    /// A step or a ramp, and at which rate: looked at again whenever it has gone on by a tenth.
    fn rename(&mut self, t_s: f64) {
        let Some(drift) = self.drift else { return };
        let gone_s = (self.aftermath.named_s - drift.began_s).max(0.0);
        if t_s < self.aftermath.named_s + AGAIN * gone_s {
            return;
        }
        self.aftermath.named_s = t_s;
        if self.take_back(&drift, t_s) {
            return;
        }
        let Some(fitted) = self.fitted() else { return };
        let needed = if gone_s == 0.0 { NAMED } else { RENAMED };
        if fitted.course == drift.course || needed < fitted.lead {
            self.is_named(&drift, &fitted);
        }
    }

    /// The course of the last motion by the trace; none where it is not one motion.
    fn fitted(&self) -> Option<Fitted> {
        let own = &self.reference.noise;
        let typical = own.reading + own.bias;
        let correlated = (own.bias.trace() / typical.trace()).clamp(0.0, 1.0);
        self.aftermath.trace.fitted(&typical, correlated)
    }

    /// The last motion is a step or a ramp, as the trace says; it is reported again where that is another name or a much sharper beginning.
    fn is_named(&mut self, drift: &Drift, fitted: &Fitted) {
        let is_ramp = fitted.course == MotionKind::Ramp;
        let rate = Rate { per_s: fitted.rate, covariance: fitted.rate_covariance };
        self.aftermath.rate = is_ramp.then_some(rate);
        let is_sharper = is_ramp && fitted.onset_sigma_s < SHARPER * drift.began_sigma_s;
        if fitted.course != drift.course || is_sharper {
            self.drift = Some(Drift {
                began_s: fitted.onset_s,
                began_sigma_s: fitted.onset_sigma_s,
                course: fitted.course,
                course_probability: 1.0 / (1.0 + (-0.5 * fitted.lead).exp()),
                ..*drift
            });
        }
    }

    /// A camera that came back while nothing was decided, or never moved: its level says so by itself.
    fn come_back(&mut self, t_s: f64) {
        let (now, Aftermath { base, found, .. }) = (self.level(t_s), &self.aftermath);
        let at_home = now.covariance + base.covariance;
        let at_found = now.covariance + found.covariance;
        let from = |place: &Milestone, covariance: &Matrix6| {
            let away = between(&place.motion, &now.motion);
            covariance.cholesky().map(|factor| away.dot(&factor.solve(&away)))
        };
        let odds = from(found, &at_found).zip(from(base, &at_home)).map(|(found, base)| found - base);
        let is_near = from(base, &at_home).is_some_and(|chi2| chi2 < MEDIAN);
        // Where a further alarm, or one that is held, put it near its old place, the two are hardly distinguished: that it stays there must do.
        let may_be_home = self.aftermath.is_further || self.held_until_s.is_some();
        let stays = may_be_home && DOUBT_DECISIONS <= self.aftermath.decisions;
        if is_near && (stays || odds.is_some_and(|odds| 2.0 * BACK < odds)) {
            self.is_home(t_s, t_s);
        }
    }

    /// A motion like others that came back by themselves is not reported yet.
    fn hold(&mut self, moved: &Drift, t_s: f64, is_first: bool) {
        let Some(measured) = self.test.measured() else { return };
        let (motion, began_s, reading) = (&moved.old_from_new, moved.began_s, &self.reference.noise.reading);
        let may_be = [
            self.transients.may_last_until(t_s, transients::size(motion, reading)),
            self.regimes.may_last_until(began_s, motion, reading),
        ];
        let may_be = may_be.into_iter().flatten().reduce(f64::max);
        self.held_until_s = if is_first { may_be } else { self.held_until_s.and(may_be) };
        match self.held_until_s {
            Some(_) => self.wander.count(),
            None => self.wander.set_aside((t_s - began_s) / measured.between_s() + ONSET),
        }
    }

    /// The size, with all readings since the alarm, as honest as readings that wander allow.
    pub(super) fn refined(&self, drift: &Drift) -> Drift {
        let Aftermath { base, held, .. } = &self.aftermath;
        let now = self.reached(drift);
        let by_models = self.by_models(drift);
        let covariance = self.wandering(&by_models.covariance, &[base, &now]) + held * held.transpose();
        let honest = |again: Again| Again {
            covariance: self.wandering(&again.covariance, &[self.motions.from(), &now]),
            ..again
        };
        Drift { covariance, again: by_models.again.map(honest), ..by_models }
    }

    /// The size by the models of the noise.
    pub(super) fn by_models(&self, drift: &Drift) -> Drift {
        let (base, now) = (&self.aftermath.base, self.reached(drift));
        let again = self.motions.again(&now);
        let between_places =
            |again: Again| Again { covariance: self.between_places(&again.covariance), ..again };
        Drift {
            old_from_new: between(&base.motion, &now.motion),
            covariance: self.between_places(&(now.covariance + base.covariance)),
            rate: self.aftermath.rate,
            again: again.map(between_places),
            ..*drift
        }
    }

    /// Where the camera is now.
    fn reached(&self, drift: &Drift) -> Milestone {
        let (found, now) = (&self.aftermath.found, self.level(self.last_s));
        let typical = self.reference.noise.reading.diagonal();
        let size = |covariance: &Matrix6| covariance.diagonal().component_div(&typical).sum();
        // Right after the alarm its own estimate is the better one.
        let chosen = Milestone { covariance: found.covariance * FOUND, ..*found };
        let now = if size(&chosen.covariance) < size(&now.covariance) { chosen } else { now };
        self.end_of(drift).unwrap_or(now)
    }

    /// The covariance of a motion between two places, at least as large as readings wander over the times for which both were observed.
    fn wandering(&self, covariance: &Matrix6, places: &[&Milestone; 2]) -> Matrix6 {
        let Some(measured) = self.test.measured() else { return *covariance };
        let variance = |place: &&Milestone| self.wander.variance(place.over_s / measured.between_s());
        let known = self.test.whitened(&Vector6::zeros(), covariance).variance;
        let beyond = (places.iter().map(variance).sum::<Vector6>() - known).map(|beyond| beyond.max(0.0));
        covariance + self.test.spread(&beyond)
    }

    /// Where a slow drift has come to: the test's level is the mean since its last alarm, and behind.
    fn end_of(&self, drift: &Drift) -> Option<Milestone> {
        let rate = self.aftermath.rate.filter(|_| drift.course == MotionKind::Ramp)?;
        let own = &self.reference.noise;
        let over_s = END * (self.last_s - drift.began_s).max(0.0);
        let (t_s, motion, readings) = self.aftermath.trace.end(over_s)?;
        let since_s = self.last_s - t_s;
        let covariance = own.reading / readings + own.bias + rate.covariance * since_s.powi(2);
        let motion = motion + rate.per_s * since_s;
        Some(Milestone { t_s: self.last_s, motion, covariance, over_s })
    }

    /// Returns the jump of frame a since `onset_s` and its covariance, with or without an alarm, as `attribute` needs it.
    pub fn jump_since(&self, onset_s: f64) -> Option<(Vector6, Matrix6)> {
        if let Some(drift) = self.drift.map(|drift| self.refined(&drift)) {
            return Some((drift.old_from_new, drift.covariance));
        }
        let before = self.aftermath.milestones.before(onset_s);
        let (motion, covariance) = self.test.level_after_jump(onset_s)?;
        let now = self.seen_from_reference(&motion);
        Some((between(&before.motion, &now), covariance + before.covariance))
    }
}

/// The motion from one place to where a change put it.
fn drift(from: &Milestone, now: &Milestone, change: &Change) -> Drift {
    Drift {
        old_from_new: between(&from.motion, &now.motion),
        covariance: now.covariance + from.covariance,
        began_s: change.onset_s,
        began_sigma_s: change.onset_sigma_s,
        course: change.course,
        course_probability: change.course_probability,
        rate: None,
        again: None,
    }
}

/// Returns the share of `whole` that a motion is, by weighted least squares.
fn along(motion: &Vector6, whole: &Vector6, covariance: &Matrix6) -> f64 {
    let share = |factor: nalgebra::Cholesky<f64, nalgebra::U6>| {
        let weighted = factor.solve(whole);
        motion.dot(&weighted) / whole.dot(&weighted)
    };
    covariance.cholesky().map_or(0.0, share)
}

impl Aftermath {
    fn began_s(&self) -> f64 {
        self.milestones.before(f64::NEG_INFINITY).t_s
    }
}

numbers!(Aftermath {
    milestones,
    scatter,
    trace,
    base,
    found,
    held,
    since_s,
    is_further,
    log_r,
    rate,
    named_s,
    doubted_s,
    decisions
});
