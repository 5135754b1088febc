//! Slip-off predicted: the further motion of the hub until the whisker has no equilibrium.
//!
//! The arc under the last contacts and the hub's motion are continued; the equilibrium is followed along it, between clamp and tip,
//! then at the tip, until its Jacobian is singular: the fold. Near it the determinant falls as the square root of the travel left,
//! so that its square is extrapolated to zero, docs/math/whisker_events.md eqs. (9)–(14).

use super::equilibrium::{Equilibrium, Problem};
use super::outline::{Arc, CIRCLE, LocalOutline, OutlinePoint, PRIOR_SLOPE_M_PER_RAD};
use crate::contact::Method;
use crate::estimate::{Mode, Status};
use crate::friction::{Constraint, FrictionAngle, Projection, project, sound};
use crate::{Cell, ContactEstimate, HubLoad, PlanarPose, Rod, Sample};
use nalgebra::{Vector2, Vector3};

/// How the contact will end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// No equilibrium any more: the whisker slips off.
    Fold,
    /// The load fades: the hub lets go.
    Release,
}

/// The end of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ending {
    /// Which.
    pub end: End,
    /// Hub steps until then; one step is the hub's mean motion per sample.
    pub steps: f64,
    /// Standard deviation of `steps`: the outline's and the friction angle's covariance, and what a circle and an arc of changing radius
    /// differ by. What is not touched yet may still be otherwise: a corner, the end of a face.
    pub steps_sigma: f64,
    /// Where the hub then is.
    pub world_from_hub: PlanarPose,
}

/// The prediction of a contact if the hub's motion continues.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// L − s, metres: what is left of the whisker beyond the contact.
    pub margin_m: f64,
    /// Its standard deviation, metres; 0 at the tip.
    pub margin_sigma_m: f64,
    /// Least singular value of the equilibrium's Jacobian now, in units of the whisker; 0 at the fold.
    pub stability: f64,
    /// Hub steps until the contact reaches the tip; 0 at the tip, none where it ends or the horizon comes before.
    pub steps_to_tip: Option<f64>,
    /// How and when it ends; none beyond [`HORIZON`].
    pub ending: Option<Ending>,
    /// The arc it is predicted on.
    pub outline: LocalOutline,
}

/// Contacts that make the arc, at most.
pub const WINDOW: usize = 40;
/// Hub steps looked ahead.
pub const HORIZON: f64 = 300.0;
/// Samples that the hub's motion is averaged over.
const PACE: usize = 10;
/// The fold is approached to this share of a hub step before the last bit is extrapolated.
const NEAREST: f64 = 1e-3;
/// Equilibria followed before the end counts as beyond the horizon; a slip-off takes tens.
const MOST_SOLUTIONS: usize = 4000;
/// Newton may correct Euler's step by this share of it; more, and the stride is halved: another branch may have been met.
const CORRECTION: f64 = 0.2;
/// Corrections below this, in the whisker's units, are rounding.
const EXACT: f64 = 1e-8;
/// A force below this many standard deviations is let go.
const GONE: f64 = 2.0;

/// What lies ahead of the last of `samples`, which are those of one contact phase with their estimates under constraints
/// ([`solve_record`](crate::friction::solve_record)). None with fewer than three usable contacts, a hub at rest, or a last contact
/// that is not ok.
pub fn predict(
    rod: &Rod,
    cell: &Cell,
    samples: &[Sample],
    estimates: &[ContactEstimate],
    friction: FrictionAngle,
    method: Method,
) -> Option<Prediction> {
    let cell = sound(rod, cell);
    let (last_sample, last) = (samples.last()?, estimates.last()?);
    if last.status != Status::Ok {
        return None;
    }
    let from = samples.len().saturating_sub(WINDOW);
    let touched = projections(rod, &cell, &samples[from..], &estimates[from..], friction, method);
    let points: Vec<_> =
        touched.iter().map(|(sample, p)| OutlinePoint::new(&cell, sample, p, friction.rad)).collect();
    let (_, now) = touched.last()?;
    let ahead = Ahead { rod, cell, hub: last_sample.world_from_hub, twist: twist(samples)?, method };
    let start = Start { load: now.load, is_tip: last.mode == Mode::Tip };
    let predicted = ahead.best(&points, friction, start)?;
    Some(Prediction {
        margin_m: rod.length_m - now.at.s_m,
        margin_sigma_m: if start.is_tip { 0.0 } else { now.s_sigma_m() },
        stability: predicted.path.stability,
        steps_to_tip: predicted.path.steps_to_tip,
        ending: predicted.path.end.map(|(steps, end)| Ending {
            end,
            steps,
            steps_sigma: predicted.sigma.min(HORIZON),
            world_from_hub: ahead.hub_after(steps),
        }),
        outline: predicted.outline,
    })
}

/// An outline and where it leads.
struct Predicted {
    outline: LocalOutline,
    path: Path,
    sigma: f64,
}

fn projections<'a>(
    rod: &Rod,
    cell: &Cell,
    samples: &'a [Sample],
    estimates: &[ContactEstimate],
    friction: FrictionAngle,
    method: Method,
) -> Vec<(&'a Sample, Projection)> {
    let usable = samples.iter().zip(estimates).filter(|(_, estimate)| estimate.status == Status::Ok);
    usable
        .filter_map(|(sample, estimate)| {
            let constraint = match estimate.mode {
                Mode::Tip => Constraint::Tip,
                _ => Constraint::Friction(friction),
            };
            Some((sample, project(rod, cell, sample, constraint, method).ok()?))
        })
        .collect()
}

#[derive(Debug, Clone, Copy)]
struct Start {
    load: HubLoad,
    is_tip: bool,
}

/// The path of the hub, and the whisker on it.
struct Ahead<'a> {
    rod: &'a Rod,
    cell: Cell,
    hub: PlanarPose,
    /// Motion per step, hub axes: `[m, m, rad]`.
    twist: Vector3<f64>,
    method: Method,
}

/// Where an equilibrium leads.
#[derive(Debug, Clone, Copy)]
struct Path {
    stability: f64,
    steps_to_tip: Option<f64>,
    end: Option<(f64, End)>,
}

/// The equilibria followed so far.
#[derive(Debug, Clone, Copy)]
struct Followed {
    steps: f64,
    now: Equilibrium,
    before: Option<(f64, Equilibrium)>,
}

impl Ahead<'_> {
    /// On the outline that explains the contacts: a face, a circle, or an arc of changing radius where that change is beyond doubt. How
    /// the outline continues is not known: what circle and arc differ by counts as uncertain, eq. (14).
    fn best(&self, points: &[OutlinePoint], friction: FrictionAngle, start: Start) -> Option<Predicted> {
        let circle = LocalOutline::of_last(points, WINDOW, CIRCLE)?;
        let face = LocalOutline::flat_of_last(points, WINDOW);
        if let Some(face) = face.filter(|face| circle.contacts <= face.contacts) {
            return self.on(face, friction, start);
        }
        let circle = self.on(circle, friction, start);
        let arc = LocalOutline::of_last(points, WINDOW, PRIOR_SLOPE_M_PER_RAD)
            .and_then(|arc| self.on(arc, friction, start));
        let (Some(circle), Some(arc)) = (circle, arc) else { return None };
        let apart = match (circle.path.end, arc.path.end) {
            (Some((one, _)), Some((other, _))) => one - other,
            _ => HORIZON,
        };
        let slope = (arc.outline.arc.radius_slope_m_per_rad, arc.outline.covariance[(3, 3)].sqrt());
        if slope.0.abs() < 3.0 * slope.1 {
            // A change of radius within its noise: the arc only repeats the circle with more freedom.
            return Some(circle);
        }
        Some(Predicted { sigma: arc.sigma.hypot(apart), ..arc })
    }

    fn on(&self, outline: LocalOutline, friction: FrictionAngle, start: Start) -> Option<Predicted> {
        let path = self.follow(&outline.arc, friction.rad, start)?;
        let sigma = self.sigma(&outline, friction, start, &path);
        Some(Predicted { outline, path, sigma })
    }

    fn hub_after(&self, steps: f64) -> PlanarPose {
        moved(&self.hub, &(self.twist * steps))
    }

    /// Follows the equilibrium to the tip, then at the tip, to its end.
    fn follow(&self, arc: &Arc, friction_rad: f64, start: Start) -> Option<Path> {
        let friction = Constraint::Friction(FrictionAngle { rad: friction_rad, sigma_rad: 0.0 });
        let problem =
            |constraint| Problem { rod: self.rod, arc: *arc, constraint, friction_rad, method: self.method };
        let first = problem(if start.is_tip { Constraint::Tip } else { friction });
        let now = first.solve(&self.hub, &start.load)?;
        let stability = now.stability();
        let (reached, end) = self.run(&first, Followed { steps: 0.0, now, before: None });
        if end.is_some() || start.is_tip || HORIZON <= reached.steps {
            return Some(Path { stability, steps_to_tip: start.is_tip.then_some(0.0), end });
        }
        let at_tip = problem(Constraint::Tip);
        let steps_to_tip = Some(reached.steps);
        // Where the determinant changes its sign with the constraint, the branch at the tip leads back in the hub's travel, and forward every
        // load is inadmissible: the fold is here, eq. (11).
        let at_tip_now = at_tip.solve(&self.hub_after(reached.steps), &reached.now.load);
        let Some(now) = at_tip_now else {
            return Some(Path { stability, steps_to_tip, end: Some((reached.steps, End::Fold)) });
        };
        let (_, end) = self.run(&at_tip, Followed { before: None, now, ..reached });
        Some(Path { stability, steps_to_tip, end })
    }

    /// Follows until the end, the tip (no end) or the horizon (no end).
    fn run(&self, problem: &Problem, mut at: Followed) -> (Followed, Option<(f64, End)>) {
        let mut stride = 1.0;
        for _ in 0..MOST_SOLUTIONS {
            if HORIZON <= at.steps {
                break;
            }
            if at.now.load.force_n().norm() < GONE * self.cell.load_covariance()[(0, 0)].sqrt() {
                return (at, Some((at.steps, End::Release)));
            }
            match self.advanced(problem, &at, stride) {
                Some(next)
                    if problem.constraint != Constraint::Tip && self.rod.length_m < next.now.at.s_m =>
                {
                    let share = (self.rod.length_m - at.now.at.s_m) / (next.now.at.s_m - at.now.at.s_m);
                    if stride < NEAREST || share <= 0.0 {
                        return (next, None);
                    }
                    stride *= share.clamp(0.1, 0.999);
                }
                Some(next) => {
                    at = next;
                    stride = (1.5 * stride).min(1.0);
                }
                None if stride < NEAREST => return (at, Some((fold(&at), End::Fold))),
                None => stride *= 0.5,
            }
        }
        (at, None)
    }

    /// The next equilibrium on the same branch: the determinant keeps its sign, and the load goes where its derivative points.
    fn advanced(&self, problem: &Problem, at: &Followed, stride: f64) -> Option<Followed> {
        let steps = at.steps + stride;
        let hub = self.hub_after(steps);
        let load = at.now.load.to_vector();
        let (off, _) = problem.evaluate(&hub, &load)?;
        let euler = -at.now.jacobian.lu().solve(&off)?;
        let start = load + euler.component_mul(&problem.load_units());
        let now = problem.solve(&hub, &HubLoad::from_vector(&start))?;
        let corrected = (now.load.to_vector() - start).component_div(&problem.load_units());
        let follows = corrected.norm() <= CORRECTION * euler.norm() + EXACT;
        let same_branch = 0.0 < now.determinant() * at.now.determinant();
        (follows && same_branch && problem.is_admissible(&now)).then_some(Followed {
            steps,
            now,
            before: Some((at.steps, at.now)),
        })
    }

    /// Eq. (13): the spread of the end over the arc's principal axes and the friction angle, each by its standard deviation.
    fn sigma(&self, outline: &LocalOutline, friction: FrictionAngle, start: Start, path: &Path) -> f64 {
        let Some((steps, _)) = path.end else { return HORIZON };
        let end =
            |arc: Arc, rad: f64| self.follow(&arc, rad, start).and_then(|path| path.end).map(|(s, _)| s);
        let spread = |plus: Option<f64>, minus: Option<f64>| match (plus, minus) {
            (Some(plus), Some(minus)) => 0.5 * (plus - minus),
            (Some(one), None) | (None, Some(one)) => one - steps,
            // Neither neighbour ends within the horizon: the end is not known at all.
            (None, None) => HORIZON,
        };
        let eigen = outline.covariance.symmetric_eigen();
        let mut variance = 0.0;
        for axis in 0..4 {
            let by = eigen.eigenvectors.column(axis) * eigen.eigenvalues[axis].max(0.0).sqrt();
            let [plus, minus] = [by, -by].map(|by| end(outline.arc.moved(&by), friction.rad));
            variance += spread(plus, minus).powi(2);
        }
        let [plus, minus] = [1.0, -1.0].map(|k| end(outline.arc, friction.rad + k * friction.sigma_rad));
        (variance + spread(plus, minus).powi(2)).sqrt()
    }
}

/// Eq. (12): where the squared determinant, linear near the fold, vanishes.
fn fold(at: &Followed) -> f64 {
    let Some((earlier, before)) = at.before else { return at.steps };
    let (now, then) = (at.now.determinant().powi(2), before.determinant().powi(2));
    let left = if now < then { (at.steps - earlier) * now / (then - now) } else { 0.0 };
    at.steps + left.min(1.0)
}

/// The hub's mean motion per sample over the last samples, hub axes; none where it rests.
fn twist(samples: &[Sample]) -> Option<Vector3<f64>> {
    let count = PACE.min(samples.len().checked_sub(1)?);
    let (now, then) = (samples.last()?.world_from_hub, samples[samples.len() - 1 - count].world_from_hub);
    let turned = now.angle_rad - then.angle_rad;
    let shift = then.rotate_back(Vector2::new(now.x_m - then.x_m, now.y_m - then.y_m));
    // Inverse of the planar exponential: t = V⁻¹ shift, V = [sin ω, −(1 − cos ω); 1 − cos ω, sin ω]/ω.
    let half = 0.5 * turned;
    let cot = if half.abs() < 1e-8 { 1.0 } else { half / half.tan() };
    let t = Vector2::new(cot * shift.x + half * shift.y, cot * shift.y - half * shift.x);
    let twist = Vector3::new(t.x, t.y, turned) / count.max(1) as f64;
    (twist.iter().all(|v| v.is_finite()) && twist.iter().any(|v| *v != 0.0)).then_some(twist)
}

/// A pose after a motion of constant twist in its own axes.
fn moved(pose: &PlanarPose, twist: &Vector3<f64>) -> PlanarPose {
    let w = twist.z;
    let (a, b) = if w.abs() < 1e-8 { (1.0, 0.5 * w) } else { (w.sin() / w, (1.0 - w.cos()) / w) };
    let shift = pose.rotate(Vector2::new(a * twist.x - b * twist.y, b * twist.x + a * twist.y));
    PlanarPose { x_m: pose.x_m + shift.x, y_m: pose.y_m + shift.y, angle_rad: pose.angle_rad + w }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean motion of samples on a screw is the screw: a tenth of the whole, ten times.
    #[test]
    fn twist_inverts_the_motion() {
        let twist_true = Vector3::new(2e-3, -1e-3, 0.02);
        let start = PlanarPose { x_m: 0.3, y_m: -0.1, angle_rad: 0.7 };
        let samples: Vec<Sample> = (0..15)
            .map(|i| Sample {
                world_from_hub: moved(&start, &(twist_true * f64::from(i))),
                ..Sample::default()
            })
            .collect();
        assert!((twist(&samples).expect("it moves") - twist_true).norm() < 1e-15);
        assert!(twist(&samples[..1]).is_none());
    }
}
