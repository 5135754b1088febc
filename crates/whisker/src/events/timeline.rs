//! A record as a list of events and a label per sample.

use super::outline::{CIRCLE, Label, LocalOutline, OutlinePoint};
use super::touch::{Change, TouchDetector};
use crate::contact::Method;
use crate::estimate::{ContactEstimate, Mode, Status};
use crate::friction::{Constraint, Record, Tests, project, sound};
use crate::{Cell, Rod, Sample};
use resight_core::statistics::chi_square;

/// The event at a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventKind {
    /// The whisker touched.
    Touch,
    /// The contact reached the whisker's tip.
    TipReached,
    /// The hub let go.
    Release,
    /// The whisker slipped off.
    SlipOff,
    /// The contact is suddenly elsewhere on the whisker: it went over to another corner, or a second contact came or went.
    Leap,
    /// No single contact explains the load, though the samples before were explained.
    SeveralContacts,
}

/// An event and the index of its sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Event {
    /// Index into the samples given.
    pub index: usize,
    /// What.
    pub kind: EventKind,
}

/// Whether a touch is none that one contact explains: the moment never vanishes or vanishes beyond the tip, or both the friction and the
/// tip constraint are contradicted. In a record that agrees with itself this means several contacts or a distributed one.
pub fn has_several_contacts(estimate: &ContactEstimate, tests: Option<&Tests>) -> bool {
    tests.is_some() && matches!(estimate.status, Status::NoZero | Status::BeyondTip | Status::Inconsistent)
}

/// The events of a record, in the order of its samples.
pub fn events(cell: &Cell, samples: &[Sample], record: &Record) -> Vec<Event> {
    let mut detector = TouchDetector::new(cell);
    let mut events = Vec::new();
    let (mut was_tip, mut was_several) = (false, false);
    let mut way = Way::default();
    for (index, sample) in samples.iter().enumerate() {
        let estimate = &record.estimates[index];
        let kind = match detector.push(sample) {
            Change::None => None,
            Change::Touch => Some(EventKind::Touch),
            Change::Release => Some(EventKind::Release),
            Change::SlipOff => Some(EventKind::SlipOff),
        };
        events.extend(kind.map(|kind| Event { index, kind }));
        let is_tip = detector.is_touching() && estimate.mode == Mode::Tip && estimate.status == Status::Ok;
        let is_several =
            detector.is_touching() && has_several_contacts(estimate, record.tests[index].as_ref());
        if is_tip && !was_tip {
            events.push(Event { index, kind: EventKind::TipReached });
        }
        if is_several && !was_several {
            events.push(Event { index, kind: EventKind::SeveralContacts });
        }
        if way.leaps(sample, estimate, detector.is_touching()) {
            events.push(Event { index, kind: EventKind::Leap });
        }
        (was_tip, was_several) = (is_tip, is_several);
    }
    events
}

/// A leap is this many sigmas of both arc lengths: one pair of right samples in two million.
const LEAP_SIGMAS: f64 = 5.0;
/// And this many times the longest of the steps before: a contact that runs along a face does not leap.
const LEAP_STEPS: f64 = 3.0;
/// And this share of the last arc length: a small leap hardly differs from a slide.
const LEAP_SHARE: f64 = 0.04;
/// Steps remembered.
const REMEMBERED: usize = 4;

/// How the contact has been moving along the whisker.
#[derive(Debug, Default)]
struct Way {
    sweep: Option<u32>,
    last: Option<[f64; 2]>,
    steps_m: Vec<f64>,
}

impl Way {
    /// Takes the next sample; whether the contact has leapt to it.
    fn leaps(&mut self, sample: &Sample, estimate: &ContactEstimate, is_touching: bool) -> bool {
        if self.sweep != Some(sample.sweep) || !is_touching {
            *self = Way { sweep: Some(sample.sweep), ..Way::default() };
        }
        let Some(contact) = estimate.contact.as_ref().filter(|_| estimate.status == Status::Ok) else {
            return false;
        };
        let here = [contact.s_m, contact.s_sigma_m];
        let Some([s_m, sigma_m]) = self.last.replace(here) else { return false };
        let step_m = (here[0] - s_m).abs();
        let usual_m = self.steps_m.iter().copied().fold(0.0, f64::max);
        let leaps = LEAP_SIGMAS * here[1].hypot(sigma_m) < step_m
            && LEAP_STEPS * usual_m < step_m
            && LEAP_SHARE * s_m < step_m
            && self.steps_m.len() == REMEMBERED;
        if leaps {
            self.steps_m.clear();
        } else {
            if self.steps_m.len() == REMEMBERED {
                self.steps_m.remove(0);
            }
            self.steps_m.push(step_m);
        }
        leaps
    }
}

/// An arc that fits worse than one right arc in a thousand is none.
const KINKED: f64 = 1e-3;
/// Contacts before and after a sample that its label rests on.
const AROUND: usize = 8;

/// The feature that every sample touches: the tip by its mode, corner or tangent by the arc through the mid-whisker contacts around it. None where
/// nothing is touched or the contact is not ok.
pub fn labels(
    rod: &Rod,
    cell: &Cell,
    samples: &[Sample],
    record: &Record,
    method: Method,
) -> Vec<Option<Label>> {
    let cell = sound(rod, cell);
    let point = |i: usize| -> Option<OutlinePoint> {
        let estimate = &record.estimates[i];
        let is_mid = estimate.mode == Mode::Mid && estimate.status == Status::Ok;
        let constraint = Constraint::Friction(record.friction);
        let projection =
            is_mid.then(|| project(rod, &cell, &samples[i], constraint, method).ok()).flatten()?;
        Some(OutlinePoint::new(&cell, &samples[i], &projection, record.friction.rad))
    };
    let points: Vec<Option<OutlinePoint>> = (0..samples.len()).map(point).collect();
    (0..samples.len()).map(|i| label(samples, record, &points, i)).collect()
}

fn label(samples: &[Sample], record: &Record, points: &[Option<OutlinePoint>], i: usize) -> Option<Label> {
    let estimate = &record.estimates[i];
    match (estimate.status, estimate.mode) {
        (Status::Ok, Mode::Tip) => return Some(Label::Tip),
        (Status::Ok, Mode::Mid) => {}
        _ => return None,
    }
    let same = |j: &usize| samples[*j].sweep == samples[i].sweep;
    let window = (i.saturating_sub(AROUND)..(i + AROUND + 1).min(samples.len())).filter(same);
    let around: Vec<OutlinePoint> = window.filter_map(|j| points[j].clone()).collect();
    // No one circle through a kink or a leap: nothing is said of it.
    let arc = LocalOutline::fit(&around, CIRCLE)
        .filter(|arc| KINKED < chi_square::tail(arc.degrees_of_freedom, arc.chi2));
    Some(arc.map_or(Label::Undecided, |arc| arc.label()))
}
