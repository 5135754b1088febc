//! Paths of the hub, and sweeps laid out as a measurement would be.

use super::follow::between;
use super::{Change, Event, Record, Simulated, record};
use crate::{Error, PlanarPose, Rod, Shape};

/// A motion of the hub over t = 0 … 1 s.
#[derive(Debug, Clone, PartialEq)]
pub enum Motion {
    /// From one pose straight to another; with equal places a rotation about the clamp, with equal angles a translation.
    Between {
        /// At t = 0.
        from: PlanarPose,
        /// At t = 1 s.
        to: PlanarPose,
    },
    /// Through every pose in turn, at equal times.
    Through {
        /// At least one.
        poses: Vec<PlanarPose>,
    },
}

impl Motion {
    /// A translation of the hub at a fixed angle.
    pub fn translate(from_m: [f64; 2], to_m: [f64; 2], angle_rad: f64) -> Self {
        let at = |[x_m, y_m]: [f64; 2]| PlanarPose { x_m, y_m, angle_rad };
        Motion::Between { from: at(from_m), to: at(to_m) }
    }

    /// A rotation of the hub about its clamp.
    pub fn rotate(at_m: [f64; 2], from_rad: f64, to_rad: f64) -> Self {
        let at = |angle_rad| PlanarPose { x_m: at_m[0], y_m: at_m[1], angle_rad };
        Motion::Between { from: at(from_rad), to: at(to_rad) }
    }

    /// Times of the poses that it passes through, where it may bend.
    fn bends_s(&self) -> Result<Vec<f64>, Error> {
        match self {
            Motion::Between { .. } => Ok(Vec::new()),
            Motion::Through { poses } if poses.is_empty() => {
                let way_out = "name the poses that the hub passes through";
                Err(Error::TooFew { what: "poses", seen: 0, needed: 1, way_out })
            }
            Motion::Through { poses } => {
                let last = (poses.len() - 1).max(1) as f64;
                Ok((0..poses.len()).map(|i| i as f64 / last).collect())
            }
        }
    }

    /// The pose at a time; the motion continues beyond t = 1 s as before.
    pub fn at(&self, t_s: f64) -> PlanarPose {
        match self {
            Motion::Between { from, to } => between(from, to, t_s),
            Motion::Through { poses } => {
                let Some(last) = poses.len().checked_sub(1).filter(|last| 0 < *last) else {
                    return poses.first().copied().unwrap_or_default();
                };
                let place = t_s * last as f64;
                let i = place.floor().clamp(0.0, (last - 1) as f64) as usize;
                between(&poses[i], &poses[i + 1], place - i as f64)
            }
        }
    }
}

/// The three sweeps that surround an object near (0, 0.165 m): over it along +x and −x with the whisker upright, and a rotation from
/// 150° to 10° beside it.
pub fn standard_sweeps() -> [Motion; 3] {
    let upright = std::f64::consts::FRAC_PI_2;
    [
        Motion::translate([-0.14, 0.0], [0.26, 0.0], upright),
        Motion::translate([0.14, 0.0], [-0.26, 0.0], upright),
        Motion::rotate([-0.06, 0.0], 150_f64.to_radians(), 10_f64.to_radians()),
    ]
}

/// The number of samples of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spacing {
    /// Free samples up to and including the touch.
    pub before: u32,
    /// Samples from the touch to t = 1 s, of which slip-off takes the last.
    pub after_touch: u32,
    /// Free samples from the slip-off on.
    pub after_slip_off: u32,
}

/// Most samples of a sweep: a minute's work.
pub const MOST_SAMPLES: u32 = 100_000;

impl Spacing {
    fn check(&self) -> Result<(), Error> {
        let counts = [self.before, self.after_touch, self.after_slip_off];
        let all: f64 = counts.iter().map(|count| f64::from(*count)).sum();
        let most = f64::from(MOST_SAMPLES) + 100.0; // With the free ones before and after.
        let after = f64::from(self.after_touch);
        if after < 1.0 || most < all {
            let seen = if after < 1.0 { after } else { all };
            return Err(Error::OutOfRange {
                what: "the number of samples of a sweep",
                seen,
                least: 1.0,
                most,
            });
        }
        Ok(())
    }
}

impl Default for Spacing {
    /// 21, 120 and 20.
    fn default() -> Self {
        Spacing { before: 21, after_touch: 120, after_slip_off: 20 }
    }
}

/// Poses per motion while the touch is looked for.
const SEARCH: u32 = 256;

/// A sweep with samples laid around what happens: equal steps from before the touch to t = 1 s, and from the slip-off on equal
/// steps again. Without a touch the same number of steps covers the whole motion. Times are in the samples; events have the
/// time in seconds in place of the pose's number.
///
/// # Errors
/// As [`record`]; a motion without poses; no sample after the touch, or more than [`MOST_SAMPLES`].
pub fn sweep(
    rod: &Rod,
    object: &Shape,
    mu: f64,
    number: u32,
    motion: &Motion,
    spacing: &Spacing,
) -> Result<Record, Error> {
    spacing.check()?;
    let bends_s = motion.bends_s()?;
    let times = match touch_time_s(rod, object, motion, &bends_s)? {
        Some(touch_s) => around(touch_s, spacing),
        None => (0..=spacing.after_touch).map(|i| f64::from(i) / f64::from(spacing.after_touch)).collect(),
    };
    // The path bends between samples too.
    let path = merged(&times, &bends_s);
    let poses: Vec<_> = path.iter().map(|(t_s, _)| motion.at(*t_s)).collect();
    let mut found = record(rod, object, mu, number, &poses)?;
    found.events.iter_mut().for_each(|event| event.pose = time_s(&path, event.pose));
    let with_times = found.samples.into_iter().zip(&path).filter(|(_, (_, is_sample))| *is_sample);
    found.samples = with_times.zip(0..).map(|((row, (t_s, _)), i)| numbered(row, i, *t_s)).collect();
    // Where the whisker touches again, the samples stay as they are.
    if let Some(Event { pose: off_s, change: Change::SlipOff, .. }) = found.events.last() {
        lay_out_the_rest(&mut found.samples, *off_s, motion, spacing);
    }
    Ok(found)
}

/// Both lists in order, the first marked as samples.
fn merged(times_s: &[f64], bends_s: &[f64]) -> Vec<(f64, bool)> {
    let (Some(first), Some(last)) = (times_s.first(), times_s.last()) else { return Vec::new() };
    let inside = bends_s.iter().filter(|t| first < *t && *t < last);
    let mut all: Vec<_> = times_s.iter().map(|t| (*t, true)).chain(inside.map(|t| (*t, false))).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

fn time_s(path: &[(f64, bool)], pose: f64) -> f64 {
    let i = (pose.floor() as usize).min(path.len().saturating_sub(2));
    path[i].0 + (pose - i as f64) * (path[i + 1].0 - path[i].0)
}

fn numbered(mut row: Simulated, sample: u32, t_s: f64) -> Simulated {
    (row.sample.sample, row.sample.t_s) = (sample, Some(t_s));
    row
}

/// When the free whisker meets the object.
fn touch_time_s(rod: &Rod, object: &Shape, motion: &Motion, bends_s: &[f64]) -> Result<Option<f64>, Error> {
    let even: Vec<_> = (0..=SEARCH).map(|i| f64::from(i) / f64::from(SEARCH)).collect();
    let path = merged(&even, bends_s);
    let touch = super::first_touch(rod, object, path.iter().map(|(t_s, _)| motion.at(*t_s)))?;
    Ok(touch.map(|pose| time_s(&path, pose)))
}

/// Equal steps, the touch at sample `before − 1`.
fn around(touch_s: f64, spacing: &Spacing) -> Vec<f64> {
    let step = (1.0 - touch_s) / f64::from(spacing.after_touch);
    let first = -i64::from(spacing.before.saturating_sub(1));
    (first..=i64::from(spacing.after_touch)).map(|i| touch_s + i as f64 * step).collect()
}

/// The free samples after the slip-off start from it anew.
fn lay_out_the_rest(samples: &mut Vec<Simulated>, off_s: f64, motion: &Motion, spacing: &Spacing) {
    let Some(step) = samples.windows(2).last().and_then(|w| Some(w[1].sample.t_s? - w[0].sample.t_s?)) else {
        return;
    };
    samples.retain(|s| s.sample.t_s.is_some_and(|t| t <= off_s));
    let Some(last) = samples.last().map(|s| s.sample) else { return };
    for i in 1..=spacing.after_slip_off {
        let t_s = off_s + f64::from(i) * step;
        let mut sample = last;
        sample.sample += i;
        (sample.t_s, sample.world_from_hub, sample.load) = (Some(t_s), motion.at(t_s), Default::default());
        samples.push(Simulated { sample, truth: None });
    }
}
