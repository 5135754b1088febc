//! The whisker along the hub's path: it touches, slides, changes its kind of contact, and slips off.
//!
//! A step is solved from the last state; where Newton's method does not arrive, or arrives beyond a fold, the step is halved.
//! Where a kind of contact ends inside a step, that place is located and its neighbour carries on (docs/math/whisker_simulate.md
//! section 4).

use super::boundary::{Boundary, boundaries, jumps, neighbour};
use super::equilibrium::{Outline, Solved, State, Touching, least_force_n, wrapped};
use super::free::{cuts, first_contacts, is_blocked, is_deep, is_straight, loaded_line};
use super::{Change, Event};
use crate::{Error, PlanarPose, Rod};
use nalgebra::Vector3;

/// The state of the whisker.
#[derive(Debug, Clone, Copy)]
pub(super) enum Now {
    Free,
    Touching(Solved),
}

pub(super) struct Follower<'a> {
    pub rod: &'a Rod,
    pub outline: &'a Outline<'a>,
    /// atan μ.
    pub limit_rad: f64,
    pub hub: PlanarPose,
    pub now: Now,
    /// Number of the pose that is being left.
    pub pose: usize,
    pub events: Vec<Event>,
}

/// A step shorter than this part of a path's step is a fold.
const SHORTEST: f64 = 1e-7;
/// In shares of a path's step, how close to its turning point a slide is followed.
const TURNED: f64 = 1e-6;
/// Slip below this part of the hub's motion has no direction.
const ROUNDING: f64 = 1e-6;
/// In least forces, what may be left of the force a shortest step before it vanishes.
const WEAK: f64 = 1e4;
/// How close to its end a kind of contact is followed, in shares of a path's step.
const LOCATED: f64 = 1e-13;
/// Changes of contact within one step of the path before it counts as no rest.
const MOST_CHANGES: usize = 24;
/// Such rounds within one step of the path before it counts as no rest: from each the whisker should have moved on.
const MOST_ROUNDS: usize = 16;
/// Solutions within one kind of contact and one step of the path before it counts as no rest; a hard one takes hundreds.
const MOST_SOLUTIONS: usize = 20_000;
/// Depth, in parts of the length, to which a bent line of chords may seem to cut the object.
const CHORD: f64 = 1e-5;

/// A straight piece of the path.
struct Step {
    from: PlanarPose,
    to: PlanarPose,
}

impl Step {
    fn at(&self, share: f64) -> PlanarPose {
        between(&self.from, &self.to, share)
    }

    fn by(&self, share: f64) -> Vector3<f64> {
        let (a, b) = (&self.from, &self.to);
        Vector3::new(b.x_m - a.x_m, b.y_m - a.y_m, b.angle_rad - a.angle_rad) * share
    }
}

/// Coordinates and angle interpolated.
pub(super) fn between(from: &PlanarPose, to: &PlanarPose, share: f64) -> PlanarPose {
    if share == 1.0 {
        return *to;
    }
    let mixed = |a: f64, b: f64| a + share * (b - a);
    PlanarPose {
        x_m: mixed(from.x_m, to.x_m),
        y_m: mixed(from.y_m, to.y_m),
        angle_rad: mixed(from.angle_rad, to.angle_rad),
    }
}

impl Follower<'_> {
    /// Moves the hub.
    pub fn advance(&mut self, to: &PlanarPose) -> Result<(), Error> {
        let step = Step { from: self.hub, to: *to };
        let (mut share, mut changes, mut rounds) = (0.0, 0, 0);
        while share < 1.0 {
            share = match self.now {
                Now::Free => self.go_free(&step, share)?,
                Now::Touching(solved) => self.go_touching(&step, share, solved)?,
            };
            changes += 1;
            if MOST_CHANGES < changes {
                self.slip_off(&step, share)?;
                changes = 0;
                rounds += 1;
                if MOST_ROUNDS < rounds {
                    return Err(Error::NoRest { pose: self.pose });
                }
                if share < 1.0 {
                    share = self.go_free(&step, share)?;
                }
            }
        }
        self.hub = *to;
        self.pose += 1;
        Ok(())
    }

    fn note(&mut self, step: &Step, share: f64, change: Change) {
        self.events.push(Event { pose: self.pose as f64 + share, world_from_hub: step.at(share), change });
    }

    /// Free until the whisker meets the object, or to the end of the step.
    fn go_free(&mut self, step: &Step, start: f64) -> Result<f64, Error> {
        match self.meeting(step, start) {
            None => Ok(1.0),
            Some(clear) => self.touch(step, clear),
        }
    }

    /// Moves a free whisker on to where it meets the object: the number of the pose; None at the end of the step.
    pub fn next_touch(&mut self, to: &PlanarPose) -> Option<f64> {
        let step = Step { from: self.hub, to: *to };
        let touch = self.meeting(&step, 0.0).map(|share| self.pose as f64 + share);
        self.hub = *to;
        self.pose += 1;
        touch
    }

    /// The last share of the step at which the whisker is free.
    fn meeting(&self, step: &Step, start: f64) -> Option<f64> {
        let count = self.looks(step).ceil().clamp(1.0, MOST_LOOKS);
        let mut clear = start;
        for i in 1..=count as usize {
            let share = start + (1.0 - start) * i as f64 / count;
            if is_blocked(self.rod, self.outline, &step.at(share)) {
                return Some(self.sharpened(step, clear, share));
            }
            clear = share;
        }
        None
    }

    /// Looks per step so that the whisker cannot pass over the object unseen.
    fn looks(&self, step: &Step) -> f64 {
        let by = step.by(1.0);
        let farthest = by.x.hypot(by.y) + by.z.abs() * self.rod.length_m;
        4.0 * farthest / self.outline.shape.width_m()
    }

    fn sharpened(&self, step: &Step, mut clear: f64, mut blocked: f64) -> f64 {
        while SHARP < blocked - clear {
            let middle = 0.5 * (clear + blocked);
            if is_blocked(self.rod, self.outline, &step.at(middle)) {
                blocked = middle;
            } else {
                clear = middle;
            }
        }
        clear
    }

    /// The contact that begins where the whisker is just free.
    fn touch(&mut self, step: &Step, clear: f64) -> Result<f64, Error> {
        for state in self.first_states(&step.at(clear)) {
            let Some(solved) = state.at_touch(self.rod, self.outline) else { continue };
            let mut ahead = 1.0 - clear;
            while 1e-6 < ahead {
                let guess = solved.moved(self.outline, &step.by(ahead));
                let found = guess.solve(self.rod, self.outline, &step.at(clear + ahead));
                if let Some(found) = found.filter(|found| self.is_valid(found) && !self.turns(step, found)) {
                    self.note(step, clear, Change::Touch { touching: state.touching });
                    self.now = Now::Touching(found);
                    return Ok(clear + ahead);
                }
                ahead *= 0.25;
            }
        }
        // A graze: too weak to be a contact before the step ends.
        if is_deep(self.rod, self.outline, &step.to) {
            Err(Error::NoRest { pose: self.pose })
        } else {
            Ok(1.0)
        }
    }

    /// Ways to begin: sliding towards the hub, sliding towards the tip, sticking.
    fn first_states(&self, hub: &PlanarPose) -> Vec<State> {
        let found = first_contacts(self.rod, self.outline, hub);
        if self.limit_rad == 0.0 {
            return found;
        }
        let ways = [(self.limit_rad, false), (-self.limit_rad, false), (0.0, true)];
        let with = |(friction_rad, sticks), state: &State| State { friction_rad, sticks, ..*state };
        ways.iter().flat_map(|way| found.iter().map(|state| with(*way, state))).collect()
    }

    /// Whether the whisker slides the way that its friction pulls, which friction never allows.
    fn turns(&self, step: &Step, solved: &Solved) -> bool {
        let by = step.by(1.0);
        // As the force vanishes so does the slip, down to rounding.
        let rounding = ROUNDING * (by.x.hypot(by.y) + by.z.abs() * self.rod.length_m);
        let friction_rad = solved.state.friction_rad;
        friction_rad != 0.0 && rounding < solved.slip_m(self.outline, &by) * friction_rad.signum()
    }

    fn is_valid(&self, solved: &Solved) -> bool {
        boundaries(self.rod, self.outline, self.limit_rad, &solved.state)
            .iter()
            .all(|(_, value)| -1e-12 <= *value)
            && !self.penetrates(&solved.state)
    }

    /// A whisker without curvature of its own that is touched mid-way lies beyond its tangent: it cuts nothing convex.
    fn penetrates(&self, state: &State) -> bool {
        if !state.touching.is_tip() && is_straight(self.rod) {
            return false;
        }
        cuts(
            self.outline,
            &loaded_line(self.rod, &state.truth(self.rod, self.outline)),
            CHORD * self.rod.length_m,
        )
    }

    /// In contact until the kind of contact changes, or to the end of the step.
    fn go_touching(&mut self, step: &Step, start: f64, mut solved: Solved) -> Result<f64, Error> {
        let (mut share, mut stride) = (start, 1.0 - start);
        for _ in 0..MOST_SOLUTIONS {
            let next = if 1.0 - share <= stride { 1.0 } else { share + stride };
            let guess = solved.moved(self.outline, &step.by(next - share));
            let found = guess.solve(self.rod, self.outline, &step.at(next));
            let Some(found) = found.filter(|found| self.follows(&solved, &guess, found)) else {
                stride *= 0.5;
                if stride < SHORTEST {
                    return self.let_go(step, share, solved);
                }
                continue;
            };
            if self.turns(step, &found) {
                if self.turns(step, &solved) || stride < TURNED {
                    return self.stick(solved, share);
                }
                stride *= 0.5;
                continue;
            }
            if let Some((boundary, _)) = self.crossed(&solved, &found) {
                return self.change(step, (share, solved), (next, found), boundary);
            }
            (solved, share) = (found, next);
            stride *= 2.0;
            if share == 1.0 {
                if self.penetrates(&solved.state) {
                    return self.jump_or_slip_off(step, 1.0, solved, self.body_contacts(&solved.state));
                }
                self.now = Now::Touching(solved);
                return Ok(1.0);
            }
        }
        Err(Error::NoRest { pose: self.pose })
    }

    /// No contact continues this one. The formulas end where the force does: that is no fold, the whisker lifts off.
    fn let_go(&mut self, step: &Step, share: f64, last: Solved) -> Result<f64, Error> {
        if last.state.unknowns.x < WEAK * least_force_n(self.rod) {
            return self.carry_on(step, share, last, Boundary::NoForce);
        }
        self.slip_off(step, share)?;
        Ok(share)
    }

    /// The whisker stands still on the object; its friction is free below the limit.
    fn stick(&mut self, mut solved: Solved, share: f64) -> Result<f64, Error> {
        solved.state.sticks = true;
        let Some(solved) = solved.state.derivatives(self.rod, self.outline) else {
            return Err(Error::NoRest { pose: self.pose });
        };
        self.now = Now::Touching(solved);
        Ok(share)
    }

    /// Whether a solution continues the last one: no fold between them, and no leap to another branch.
    fn follows(&self, last: &Solved, guess: &State, found: &Solved) -> bool {
        let leap = found.state.unknowns - guess.unknowns;
        let scale = self.rod.length_m;
        let place = match found.state.touching {
            Touching::Face(_) | Touching::TipOnFace(_) => leap.z / scale,
            _ => leap.z,
        };
        let arc = if found.state.touching.is_tip() { leap.y } else { leap.y / scale };
        found.orientation == last.orientation && place.abs() < LEAP && arc.abs() < LEAP
    }

    /// The first boundary passed between two solutions, and where if all were straight.
    fn crossed(&self, last: &Solved, found: &Solved) -> Option<(Boundary, f64)> {
        let before = boundaries(self.rod, self.outline, self.limit_rad, &last.state);
        let after = boundaries(self.rod, self.outline, self.limit_rad, &found.state);
        let passed = before.iter().zip(&after).filter(|(_, after)| after.1 < 0.0);
        passed
            .map(|(before, after)| (after.0, before.1.max(0.0) / (before.1.max(0.0) - after.1)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Locates the boundary between two solutions by regula falsi (Illinois), and carries on beyond it.
    fn change(
        &mut self,
        step: &Step,
        (mut low, mut last): (f64, Solved),
        (mut high, beyond): (f64, Solved),
        boundary: Boundary,
    ) -> Result<f64, Error> {
        let value = |solved: &Solved| {
            let all = boundaries(self.rod, self.outline, self.limit_rad, &solved.state);
            all.iter().find(|(b, _)| *b == boundary).map_or(0.0, |(_, value)| *value)
        };
        let (mut at_low, mut at_high) = (value(&last).max(0.0), value(&beyond));
        let mut kept = 0;
        for _ in 0..MOST_NARROWINGS {
            if !(LOCATED < high - low && 1e-13 < at_low) {
                break;
            }
            let share = low + (high - low) * (at_low / (at_low - at_high)).clamp(1e-3, 1.0 - 1e-3);
            let guess = last.moved(self.outline, &step.by(share - low));
            let found = guess.solve(self.rod, self.outline, &step.at(share));
            let at = found.as_ref().map_or(at_high, value);
            if let Some(found) = found.filter(|_| 0.0 <= at) {
                (low, last, at_low) = (share, found, at);
                at_high *= if kept == 1 { 0.5 } else { 1.0 };
                kept = 1;
            } else {
                (high, at_high) = (share, at);
                at_low *= if kept == -1 { 0.5 } else { 1.0 };
                kept = -1;
            }
        }
        self.carry_on(step, low, last, boundary)
    }

    fn carry_on(&mut self, step: &Step, share: f64, last: Solved, boundary: Boundary) -> Result<f64, Error> {
        if boundary == Boundary::NoForce {
            self.note(step, share, Change::LiftOff);
            self.now = Now::Free;
            return Ok(share);
        }
        let mut state = last.state;
        if boundary == Boundary::SlideBack || boundary == Boundary::SlideOn {
            self.note(step, share, Change::Slide);
            state.friction_rad = self.limit_rad.copysign(state.friction_rad);
        }
        let next = neighbour(self.rod, self.outline, &state, boundary);
        if let Some(solved) = next.and_then(|state| state.derivatives(self.rod, self.outline)) {
            self.now = Now::Touching(solved);
            return Ok(share);
        }
        self.jump_or_slip_off(step, share, last, jumps(self.rod, self.outline, &state, boundary))
    }

    /// The contacts that a whisker whose body cuts the object may fall back to.
    fn body_contacts(&self, state: &State) -> Vec<State> {
        let line = loaded_line(self.rod, &state.truth(self.rod, self.outline));
        let corner_state = |i: usize| {
            let corner = self.outline.corners[i];
            let nearest =
                line.windows(2).min_by(|a, b| (a[0] - corner).norm().total_cmp(&(b[0] - corner).norm()))?;
            let along = nearest[1] - nearest[0];
            let normal_rad = along.y.atan2(along.x) + state.side * std::f64::consts::FRAC_PI_2;
            let parameter = wrapped(normal_rad - self.outline.normals_rad[self.outline.before(i)]);
            let index = line.iter().position(|p| p == &nearest[0])?;
            let s = self.rod.length_m * (index as f64 / (line.len() - 1) as f64).max(0.02);
            let unknowns =
                Vector3::new(state.unknowns.x, s, parameter.clamp(0.0, self.outline.rotation_rad(i)));
            Some(State { touching: Touching::Corner(i), unknowns, ..*state })
        };
        (0..self.outline.count()).filter_map(corner_state).collect()
    }

    /// Takes the first of the proposed states that holds at this pose; otherwise the whisker slips off.
    fn jump_or_slip_off(
        &mut self,
        step: &Step,
        share: f64,
        last: Solved,
        jumps: Vec<State>,
    ) -> Result<f64, Error> {
        for state in jumps {
            let found = state.solve(self.rod, self.outline, &step.at(share));
            if let Some(found) = found.filter(|found| self.is_valid(found)) {
                self.note(step, share, Change::Jump { from: last.state.touching, to: found.state.touching });
                self.now = Now::Touching(found);
                return Ok(share);
            }
        }
        self.slip_off(step, share)?;
        Ok(share)
    }

    /// The whisker lets go and straightens.
    fn slip_off(&mut self, step: &Step, share: f64) -> Result<(), Error> {
        self.note(step, share, Change::SlipOff);
        self.now = Now::Free;
        if !is_blocked(self.rod, self.outline, &step.at(share)) {
            return Ok(());
        }
        Err(Error::NoRest { pose: self.pose })
    }
}

/// Looks at the free whisker per step of the path, at most.
const MOST_LOOKS: f64 = 4096.0;
/// Steps of the regula falsi; it takes about ten.
const MOST_NARROWINGS: usize = 400;
/// A touch is located to this share of a step.
const SHARP: f64 = 1e-15;
/// Largest correction of a prediction, rad or parts of the length, that still counts as the same branch.
const LEAP: f64 = 0.2;
