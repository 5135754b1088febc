//! The rows of the consistency test: what must vanish, its covariance, its derivatives.

use super::Fault;
use crate::contact::Method;
use crate::estimate::{Mode, Status};
use crate::events::outline::{LocalOutline, OutlinePoint, PRIOR_SLOPE_M_PER_RAD, turned};
use crate::friction::projection::bend;
use crate::friction::{Constraint, FrictionAngle, Projection, Record, project};
use crate::{Cell, Rod, Sample};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, RowVector4, Vector2};
use resight_core::statistics::chi_square;
use std::ops::Range;

/// Contacts tested, at most: more are thinned evenly.
const MOST_CONTACTS: usize = 1000;
/// A mode less sure than this is left out.
const SURE: f64 = 0.95;
/// Contacts of one arc.
const PER_ARC: usize = 10;
/// An arc that fits worse than one right arc in a thousand runs over a kink: it says nothing of the calibration.
const KINKED: f64 = 1e-3;
/// Arcs whose normals have less than this in common are not compared, radians.
const LEAST_OVERLAP_RAD: f64 = 0.02;

/// Two arcs of different sweeps and a normal that both have: there they must have the same support, eq. (16).
#[derive(Debug, Clone, Copy)]
struct Overlap {
    arcs: [usize; 2],
    normal_rad: f64,
}

/// The test's contacts and rows: one constraint row per contact, then one per overlap.
pub(super) struct Rows<'a> {
    rod: &'a Rod,
    cell: &'a Cell,
    method: Method,
    /// Index of the sample, and at the tip or not.
    contacts: Vec<(usize, bool)>,
    /// Runs of neighbouring mid-whisker contacts of one sweep.
    windows: Vec<Range<usize>>,
    arcs: Vec<LocalOutline>,
    overlaps: Vec<Overlap>,
}

/// The constraint of a mode.
pub(super) fn constraint(is_tip: bool, friction: FrictionAngle) -> Constraint {
    if is_tip { Constraint::Tip } else { Constraint::Friction(friction) }
}

impl<'a> Rows<'a> {
    pub(super) fn new(
        rod: &'a Rod,
        cell: &'a Cell,
        samples: &[Sample],
        record: &Record,
        same_object: bool,
        method: Method,
    ) -> Option<Self> {
        let contacts = chosen(samples, record);
        if contacts.len() < 10 {
            return None;
        }
        let (windows, arcs, overlaps) = (Vec::new(), Vec::new(), Vec::new());
        let mut rows = Rows { rod, cell, method, contacts, windows, arcs, overlaps };
        if same_object {
            let projections = rows.projections(samples, record.friction.rad)?;
            let points = rows.outline(samples, &projections, record.friction.rad);
            rows.add_overlaps(samples, &points);
        }
        Some(rows)
    }

    pub(super) fn len(&self) -> usize {
        self.contacts.len() + self.overlaps.len()
    }

    /// Rows of unit variance; overlaps that share an arc are correlated, constraint rows are not: a contact's error is what its constraint
    /// has left.
    pub(super) fn whitened(&self, mut rows: DVector<f64>) -> Option<DVector<f64>> {
        if self.overlaps.is_empty() {
            return Some(rows);
        }
        let factor = self.factor()?;
        let mut tail = rows.rows_mut(self.contacts.len(), self.overlaps.len());
        let whitened = factor.l().solve_lower_triangular(&tail)?;
        tail.copy_from(&whitened);
        Some(rows)
    }

    /// L of the overlaps' covariance, L Lᵀ.
    fn factor(&self) -> Option<Cholesky<f64, Dyn>> {
        let of = |overlap: &Overlap| -> Vec<(usize, RowVector4<f64>)> {
            let signs = [1.0, -1.0];
            let by = |(arc, sign): (&usize, f64)| {
                (*arc, self.arcs[*arc].support_by_arc(overlap.normal_rad) * sign)
            };
            overlap.arcs.iter().zip(signs).map(by).collect()
        };
        let entries: Vec<_> = self.overlaps.iter().map(of).collect();
        let mut covariance = DMatrix::zeros(self.overlaps.len(), self.overlaps.len());
        for (a, of_a) in entries.iter().enumerate() {
            for (b, of_b) in entries.iter().enumerate() {
                for (arc, by_a) in of_a {
                    let shared = of_b.iter().filter(|(other, _)| other == arc);
                    covariance[(a, b)] += shared
                        .map(|(_, by_b)| (by_a * self.arcs[*arc].covariance * by_b.transpose())[0])
                        .sum::<f64>();
                }
            }
        }
        // Overlaps that repeat each other up to rounding: a millionth of a variance more keeps the factor.
        (0..covariance.nrows()).for_each(|i| covariance[(i, i)] *= 1.0 + 1e-6);
        Cholesky::new(covariance)
    }

    /// The rows' values for readings and a friction angle.
    pub(super) fn values(&self, samples: &[Sample], friction_rad: f64) -> Option<DVector<f64>> {
        let projections = self.projections(samples, friction_rad)?;
        let constraints = projections.iter().map(|p| p.innovation_n / p.innovation_variance_n2.sqrt());
        if self.overlaps.is_empty() {
            return Some(DVector::from_iterator(self.len(), constraints));
        }
        let points = self.outline(samples, &projections, friction_rad);
        let arcs: Option<Vec<_>> = self.windows.iter().map(|window| arc(&points[window.clone()])).collect();
        let arcs = arcs?;
        let apart = self.overlaps.iter().map(|Overlap { arcs: [a, b], normal_rad }| {
            let n = Vector2::new(normal_rad.cos(), normal_rad.sin());
            n.dot(&(arcs[*a].arc.at(*normal_rad).0 - arcs[*b].arc.at(*normal_rad).0))
        });
        Some(DVector::from_iterator(self.len(), constraints.chain(apart)))
    }

    /// Derivative of the rows by the friction angle.
    pub(super) fn by_friction(&self, samples: &[Sample], friction_rad: f64) -> Option<DVector<f64>> {
        const STEP_RAD: f64 = 1e-4;
        let [plus, minus] = [STEP_RAD, -STEP_RAD].map(|step| self.values(samples, friction_rad + step));
        Some((plus? - minus?) / (2.0 * STEP_RAD))
    }

    /// Derivative of the rows by a fault of the readings.
    pub(super) fn by_fault(
        &self,
        samples: &[Sample],
        friction_rad: f64,
        fault: Fault,
    ) -> Option<DVector<f64>> {
        let step = fault.step(self.cell);
        // A fault in the readings does what taking off its opposite does.
        let [plus, minus] = [-step, step].map(|size| {
            let changed: Vec<Sample> = samples.iter().map(|sample| fault.taken_off(sample, size)).collect();
            self.values(&changed, friction_rad)
        });
        Some((plus? - minus?) / (2.0 * step))
    }

    fn projections(&self, samples: &[Sample], friction_rad: f64) -> Option<Vec<Projection>> {
        let friction = FrictionAngle { rad: friction_rad, sigma_rad: 0.0 };
        let of = |(i, is_tip): &(usize, bool)| {
            project(self.rod, self.cell, &samples[*i], constraint(*is_tip, friction), self.method).ok()
        };
        self.contacts.iter().map(of).collect()
    }

    fn outline(
        &self,
        samples: &[Sample],
        projections: &[Projection],
        friction_rad: f64,
    ) -> Vec<OutlinePoint> {
        let point = |((i, _), projection): (&(usize, bool), &Projection)| {
            let mut point = OutlinePoint::new(self.cell, &samples[*i], projection, friction_rad);
            if let Some(bend) = bend(self.rod, projection, self.method) {
                let bend = samples[*i].world_from_hub.rotate(bend.fixed_rows::<2>(0).into_owned());
                let mut place = point.covariance.fixed_view_mut::<2, 2>(0, 0);
                place += bend * bend.transpose() * 0.75;
            }
            point
        };
        self.contacts.iter().zip(projections).map(point).collect()
    }

    fn add_overlaps(&mut self, samples: &[Sample], points: &[OutlinePoint]) {
        let sweep = |contact: usize| samples[self.contacts[contact].0].sweep;
        let is_one = |window: &Range<usize>| {
            window.clone().all(|i| !self.contacts[i].1 && sweep(i) == sweep(window.start))
        };
        let starts = (0..self.contacts.len() / PER_ARC).map(|i| i * PER_ARC);
        let fits = starts.map(|start| start..start + PER_ARC).filter(is_one).filter_map(|window| {
            let arc = arc(&points[window.clone()])?;
            (KINKED < chi_square::tail(arc.degrees_of_freedom, arc.chi2)).then_some((window, arc))
        });
        let (windows, arcs): (Vec<_>, Vec<_>) = fits.unzip();
        for b in 0..windows.len() {
            for a in (0..b).filter(|a| sweep(windows[*a].start) != sweep(windows[b].start)) {
                let ranges = [a, b].map(|arc| range(&points[windows[arc].clone()], points[0].normal_rad));
                if let Some(middle) = middle(ranges) {
                    let normal_rad = points[0].normal_rad + middle;
                    self.overlaps.push(Overlap { arcs: [a, b], normal_rad });
                }
            }
        }
        (self.windows, self.arcs) = (windows, arcs);
    }
}

fn arc(points: &[OutlinePoint]) -> Option<LocalOutline> {
    LocalOutline::fit(points, PRIOR_SLOPE_M_PER_RAD)
}

/// Least and greatest normal, from a reference.
fn range(points: &[OutlinePoint], reference_rad: f64) -> [f64; 2] {
    let first = turned(points[0].normal_rad - reference_rad);
    let angles = points.iter().map(|point| first + turned(point.normal_rad - points[0].normal_rad));
    angles.fold([first, first], |[least, most], angle| [least.min(angle), most.max(angle)])
}

/// The middle of what two ranges have in common.
fn middle([a, b]: [[f64; 2]; 2]) -> Option<f64> {
    let (from, to) = (a[0].max(b[0]), a[1].min(b[1]));
    (LEAST_OVERLAP_RAD < to - from).then_some(0.5 * (from + to))
}

/// The samples whose status is ok and whose mode is sure, thinned evenly.
fn chosen(samples: &[Sample], record: &Record) -> Vec<(usize, bool)> {
    let sure = |i: &usize| {
        let estimate = &record.estimates[*i];
        estimate.status == Status::Ok && SURE < estimate.mode_probability && record.tests[*i].is_some()
    };
    let all: Vec<usize> = (0..samples.len()).filter(sure).collect();
    let every = all.len().div_ceil(MOST_CONTACTS).max(1);
    all.into_iter().step_by(every).map(|i| (i, record.estimates[i].mode == Mode::Tip)).collect()
}
