//! The motion of a camera from its reference now, and the motion that puts it back, which shrinks as that is done.

use resight::core::locate::consistency::is_unlikely;
use resight::core::temporal::monitor::{Drift, Reference, along, rotation_alone};
use resight::core::{Matrix6, Vector6};
use resight::report::turned::parts;
use std::collections::VecDeque;

/// Readings of so long are joined, seconds: a hand that turns a camera sees what it does.
const WITHIN_S: f64 = 0.5;
/// And no more of them than this.
const MOST: usize = 32;
/// Components smaller than this many standard deviations are not stated.
const CLEAR_SIGMAS: f64 = 2.0;

/// The current pose of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Present {
    /// Its pose in its own frame of the reference, `[rotation_rad; translation_m]` about and along x right, y down, z forward.
    pub old_from_new: Vector6,
    /// Its covariance: that of one reading, of the reference, and the scatter of the readings that were averaged, which is large while the
    /// camera moves. Averaging does not reduce it, because the errors of readings may be correlated.
    pub covariance: Matrix6,
}

impl Present {
    /// Returns the motion of a camera from one reference to another.
    pub fn between(old: &Reference, new: &Reference) -> Self {
        Present {
            old_from_new: (old.a_from_b * new.a_from_b.inverse()).log(),
            covariance: old.noise.reference + new.noise.reference,
        }
    }

    /// Standard deviations of the motion.
    pub fn sigma(&self) -> Vector6 {
        self.covariance.diagonal().map(|x| x.max(0.0).sqrt())
    }

    /// `rotated right 0.507° ± 0.010°, …; shifted …`: all six coordinates, as they are.
    pub fn words(&self) -> String {
        let sigma = self.sigma();
        let all =
            [said("rotated", 0, &self.old_from_new, &sigma), said("shifted", 3, &self.old_from_new, &sigma)];
        let all: Vec<String> = all.into_iter().flatten().collect();
        if all.is_empty() { "not moved at all".to_string() } else { all.join("; ") }
    }
}

/// Describes three components of a motion, starting at an index; `None` where all are zero.
fn said(verb: &str, from: usize, motion: &Vector6, sigma: &Vector6) -> Option<String> {
    let own = Vector6::from_fn(|i, _| if (from..from + 3).contains(&i) { motion[i] } else { 0.0 });
    let words = parts(&own, |i| Some(sigma[i]));
    (!words.is_empty()).then(|| format!("{verb} {words}"))
}

/// The motion that returns a camera to its reference.
#[derive(Debug, Clone, PartialEq)]
pub struct WayBack {
    /// `[rotation_rad; translation_m]`; zero where nothing exceeds its error, and where the alarm found no motion.
    pub motion: Vector6,
    /// Standard deviations of the components considered, zero for the others.
    pub sigma: Vector6,
    /// `rotate left 0.507° ± 0.010°`.
    pub words: String,
}

/// The motions of the last moment: none from before a step.
#[derive(Debug, Clone, Default)]
pub struct Recent {
    motions: VecDeque<(f64, Vector6, Matrix6)>,
}

impl Recent {
    /// A reading's motion against the reference, with the covariance of both. Older ones that differ from it are not of where the camera is
    /// now.
    pub fn push(&mut self, t_s: f64, old_from_new: Vector6, covariance: Matrix6) {
        let is_past = |(then_s, motion, of_it): &(f64, Vector6, Matrix6)| {
            !(t_s - WITHIN_S..=t_s).contains(then_s)
                || differ(&(old_from_new - motion), &(covariance + of_it))
        };
        while MOST <= self.motions.len() || self.motions.front().is_some_and(is_past) {
            self.motions.pop_front();
        }
        self.motions.push_back((t_s, old_from_new, covariance));
    }

    /// Returns the mean; `None` before the first reading.
    pub fn present(&self) -> Option<Present> {
        let n = self.motions.len() as f64;
        let mean = self.motions.iter().map(|(_, motion, _)| motion).sum::<Vector6>() / n;
        let scatter = |motion: &Vector6| (motion - mean) * (motion - mean).transpose();
        let covariances = self.motions.iter().map(|(_, motion, covariance)| covariance + scatter(motion));
        (0.0 < n).then(|| Present { old_from_new: mean, covariance: covariances.sum::<Matrix6>() / n })
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.motions.clear();
    }
}

/// Returns whether two motions differ by more than their errors would explain; false where those are unknown.
fn differ(by: &Vector6, covariance: &Matrix6) -> bool {
    covariance.cholesky().is_some_and(|root| is_unlikely(by.dot(&root.solve(by)), 6))
}

/// Returns the motion that returns a camera to its reference. The alarm states the kind of motion (about one axis, a rotation alone, all six
/// components); the other components are taken as zero, as in the alarm.
pub fn way_back(drift: &Drift, now: &Present) -> WayBack {
    let (motion, sigma) = as_found(drift, now);
    let is_clear = |i: usize| CLEAR_SIGMAS * sigma[i] < motion[i].abs();
    let back = Vector6::from_fn(|i, _| if is_clear(i) { -motion[i] } else { 0.0 });
    WayBack { motion: back, sigma, words: words(&back, &sigma) }
}

fn as_found(drift: &Drift, now: &Present) -> (Vector6, Vector6) {
    let Present { old_from_new, covariance } = now;
    let one_axis = drift.alone().and_then(|alone| along(old_from_new, covariance, alone.axis));
    if let Some(alone) = one_axis {
        return (Vector6::ith(alone.axis, alone.size), Vector6::ith(alone.axis, alone.sigma));
    }
    let rotation = drift.pure_rotation().and_then(|_| rotation_alone(old_from_new, covariance));
    if let Some((r, covariance)) = rotation {
        let sigma = covariance.diagonal().map(|x| x.max(0.0).sqrt());
        return (
            Vector6::new(r.x, r.y, r.z, 0.0, 0.0, 0.0),
            Vector6::new(sigma.x, sigma.y, sigma.z, 0.0, 0.0, 0.0),
        );
    }
    (*old_from_new, covariance.diagonal().map(|x| x.max(0.0).sqrt()))
}

fn words(back: &Vector6, sigma: &Vector6) -> String {
    let all = [said("rotate", 0, back, sigma), said("shift", 3, back, sigma)];
    let all: Vec<String> = all.into_iter().flatten().collect();
    if all.is_empty() { within(sigma) } else { all.join("; ") }
}

fn within(sigma: &Vector6) -> String {
    let most = |from: usize| sigma.fixed_rows::<3>(from).max() * CLEAR_SIGMAS;
    let (angle, shift) = (most(0).to_degrees(), 1e3 * most(3));
    let limits = [(angle, "°"), (shift, " mm")].into_iter().filter(|(limit, _)| 0.0 < *limit);
    let limits: Vec<String> = limits.map(|(limit, unit)| format!("{limit:.3}{unit}")).collect();
    format!("where it was, within {}", limits.join(" and "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight::core::temporal::monitor::MotionKind;

    fn drift(old_from_new: Vector6) -> Drift {
        Drift {
            old_from_new,
            covariance: Matrix6::identity() * 1e-8,
            began_s: 10.0,
            began_sigma_s: 0.1,
            course: MotionKind::Step,
            course_probability: 0.99,
            rate: None,
            again: None,
        }
    }

    fn present(old_from_new: Vector6) -> Present {
        Present { old_from_new, covariance: Matrix6::identity() * 1e-8 }
    }

    /// Rotated right by 0.5°: left puts it back, by less the further it is back already, and at last by nothing.
    #[test]
    fn the_way_back_shrinks_as_the_camera_is_put_back() {
        let right = |deg: f64| Vector6::new(0.0, deg.to_radians(), 0.0, 0.0, 0.0, 0.0);
        let found = drift(right(0.5));
        let back = |deg: f64| way_back(&found, &present(right(deg)));
        assert_eq!(back(0.5).words, "rotate left 0.500° ± 0.006°");
        assert_eq!(back(0.2).words, "rotate left 0.200° ± 0.006°");
        assert_eq!(back(-0.1).words, "rotate right 0.100° ± 0.006°", "turned too far");
        assert_eq!(back(0.005).words, "where it was, within 0.011°");
        assert_eq!(back(0.005).motion, Vector6::zeros());
        assert!((back(0.2).motion[1] + 0.2_f64.to_radians()).abs() < 1e-12);
    }

    #[test]
    fn a_shift_and_a_rotation_are_both_named() {
        let both = Vector6::new(0.01, 0.02, 0.0, 0.03, 0.0, -0.04);
        let said = way_back(&drift(both), &present(both)).words;
        assert!(said.starts_with("rotate down 0.573°"), "{said}");
        assert!(said.contains("; shift left 30.000 mm") && said.contains("forward 40.000 mm"), "{said}");
    }

    #[test]
    fn the_present_is_of_the_last_half_second() {
        let mut recent = Recent::default();
        assert_eq!(recent.present(), None);
        for i in 0..100 {
            let motion = Vector6::ith(1, if i < 80 { 1.0 } else { 0.0 });
            recent.push(0.1 * f64::from(i), motion, Matrix6::identity());
        }
        let now = recent.present().expect("readings");
        assert_eq!((now.old_from_new, now.covariance), (Vector6::zeros(), Matrix6::identity()));
        recent.push(0.0, Vector6::ith(0, 1.0), Matrix6::identity()); // A clock that was set back.
        assert_eq!(recent.present().map(|now| now.old_from_new), Some(Vector6::ith(0, 1.0)));
    }
    /// A step by ten standard deviations: the first reading after it is where the camera is, not the mean of before and after.
    #[test]
    fn no_reading_of_before_a_step_is_joined() {
        let mut recent = Recent::default();
        let at = |i: i32, step: f64| (0.03 * f64::from(i), Vector6::ith(1, step + 0.5 * f64::from(i % 2)));
        for i in 0..10 {
            let (t_s, motion) = at(i, 0.0);
            recent.push(t_s, motion, Matrix6::identity());
        }
        for i in 10..14 {
            let (t_s, motion) = at(i, 10.0);
            recent.push(t_s, motion, Matrix6::identity());
            let now = recent.present().expect("readings");
            assert!((now.old_from_new[1] - 10.25).abs() <= 0.25 + 1e-12, "{now:?}");
        }
    }

    /// A camera that is rotated by a tenth of a standard deviation a reading: the mean lags, and its ± holds the lag.
    #[test]
    fn the_error_amid_a_motion_holds_what_the_mean_lags() {
        let mut recent = Recent::default();
        for i in 0..60 {
            recent.push(0.02 * f64::from(i), Vector6::ith(1, 0.1 * f64::from(i)), Matrix6::identity() * 0.04);
            let now = recent.present().expect("readings");
            let lag = 0.1 * f64::from(i) - now.old_from_new[1];
            assert!(lag <= 2.0 * now.sigma()[1], "{lag} {now:?}");
            assert!(i < 10 || 0.2 < lag, "it lags: {lag}");
        }
    }
}
