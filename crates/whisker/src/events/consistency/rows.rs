//! The rows of the consistency test: what must vanish, its covariance, its derivatives.

use super::Fault;
use crate::contact::Method;
use crate::estimate::{Mode, Status};
use crate::events::outline::{OutlinePoint, turned};
use crate::friction::{Constraint, FrictionAngle, Projection, Record, project};
use crate::{Cell, Rod, Sample};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector2, Vector3};

/// Contacts tested, at most: more are thinned evenly, for the test's time grows with their cube.
const MOST_CONTACTS: usize = 400;
/// A mode less sure than this is left out.
const SURE: f64 = 0.95;
/// Outline rows whose curvature within the step may count more than this share of their sigma are left out: leaps.
const CURVED_SHARE: f64 = 0.3;
/// Neighbouring normals further apart than this do not interpolate an outline, radians.
const WIDEST_RAD: f64 = 0.06;

/// What must vanish.
#[derive(Debug, Clone, Copy)]
enum Row {
    /// The constraint of one contact, in its own sigmas.
    Constraint(usize),
    /// The way from one contact to the next, across the mean of their normals: eq. (16).
    Step(usize, usize),
    /// A contact's distance from another sweep's outline between two of its contacts: eq. (17).
    Across(usize, [usize; 2]),
}

/// The test's contacts and rows.
pub(super) struct Rows<'a> {
    rod: &'a Rod,
    cell: &'a Cell,
    method: Method,
    /// Index of the sample, and at the tip or not.
    contacts: Vec<(usize, bool)>,
    points: Vec<OutlinePoint>,
    rows: Vec<Row>,
    gradients: Vec<Vec<(usize, Vector3<f64>)>>,
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
        let mut rows =
            Rows { rod, cell, method, contacts, points: Vec::new(), rows: Vec::new(), gradients: Vec::new() };
        let projections = rows.projections(samples, record.friction.rad)?;
        if projections.len() < 10 {
            return None;
        }
        rows.points = rows.outline(samples, &projections, record.friction.rad);
        rows.rows = (0..projections.len()).map(Row::Constraint).collect();
        rows.add_steps(samples);
        if same_object {
            rows.add_across(samples);
        }
        rows.gradients = rows.rows.iter().map(|row| rows.gradient(row)).collect();
        Some(rows)
    }

    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// V = L Lᵀ; constraint rows are independent of everything: the contacts' errors are what the constraint has left.
    pub(super) fn factor(&self) -> Option<Cholesky<f64, Dyn>> {
        let mut by_contact: Vec<Vec<(usize, Vector3<f64>)>> = vec![Vec::new(); self.points.len()];
        for (row, entries) in self.gradients.iter().enumerate() {
            entries.iter().for_each(|(contact, by)| by_contact[*contact].push((row, *by)));
        }
        let mut covariance = DMatrix::zeros(self.len(), self.len());
        for (row, _) in self.rows.iter().enumerate().filter(|(_, row)| matches!(row, Row::Constraint(_))) {
            covariance[(row, row)] = 1.0;
        }
        for (point, entries) in self.points.iter().zip(&by_contact) {
            for (a, by_a) in entries {
                for (b, by_b) in entries {
                    covariance[(*a, *b)] += by_a.dot(&(point.covariance * by_b));
                }
            }
        }
        // Rows that repeat each other up to rounding: a millionth of a variance more keeps the factor.
        (0..covariance.nrows()).for_each(|i| covariance[(i, i)] *= 1.0 + 1e-6);
        Cholesky::new(covariance)
    }

    /// The rows' values for readings and a friction angle.
    pub(super) fn values(&self, samples: &[Sample], friction_rad: f64) -> Option<DVector<f64>> {
        let projections = self.projections(samples, friction_rad)?;
        let points = self.outline(samples, &projections, friction_rad);
        let value = |row: &Row| match row {
            Row::Constraint(i) => {
                projections[*i].innovation_n / projections[*i].innovation_variance_n2.sqrt()
            }
            row => outline_value(row, &|i| (points[i].x_in_world, points[i].normal_rad)),
        };
        Some(DVector::from_iterator(self.len(), self.rows.iter().map(value)))
    }

    /// Derivative of the rows by the friction angle.
    pub(super) fn by_friction(&self, samples: &[Sample], friction_rad: f64) -> Option<DVector<f64>> {
        const STEP_RAD: f64 = 1e-5;
        let [plus, minus] = [STEP_RAD, -STEP_RAD].map(|step| self.values(samples, friction_rad + step));
        Some((plus? - minus?) / (2.0 * STEP_RAD))
    }

    /// Derivative of the rows by a fault of the readings.
    pub(super) fn by_fault(
        &self,
        samples: &[Sample],
        friction_rad: f64,
        fault: &Fault,
        cell: &Cell,
    ) -> Option<DVector<f64>> {
        let step = fault.step(cell);
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
        let pairs = self.contacts.iter().zip(projections);
        pairs.map(|((i, _), p)| OutlinePoint::new(self.cell, &samples[*i], p, friction_rad)).collect()
    }

    fn add_steps(&mut self, samples: &[Sample]) {
        for i in 1..self.contacts.len() {
            let same = samples[self.contacts[i - 1].0].sweep == samples[self.contacts[i].0].sweep
                && self.contacts[i - 1].1 == self.contacts[i].1;
            let row = Row::Step(i - 1, i);
            if same && self.is_straight(&row) {
                self.rows.push(row);
            }
        }
    }

    /// Whether what the outline may bend within the row is small next to the row's noise.
    fn is_straight(&self, row: &Row) -> bool {
        let Row::Step(i, j) = row else { return true };
        let (a, b) = (&self.points[*i], &self.points[*j]);
        let turn = turned(b.normal_rad - a.normal_rad).abs();
        let bent = 0.5 * (b.x_in_world - a.x_in_world).norm() * turn;
        bent < CURVED_SHARE * self.sigma(row)
    }

    fn sigma(&self, row: &Row) -> f64 {
        let gradient = self.gradient(row);
        gradient.iter().map(|(i, by)| by.dot(&(self.points[*i].covariance * by))).sum::<f64>().sqrt()
    }

    /// Every mid-whisker contact against each other sweep, where that has neighbours of both sides of its normal.
    fn add_across(&mut self, samples: &[Sample]) {
        let sweep = |contact: usize| samples[self.contacts[contact].0].sweep;
        let mids: Vec<usize> = (0..self.points.len()).filter(|i| !self.contacts[*i].1).collect();
        let pairs: Vec<[usize; 2]> = mids
            .windows(2)
            .filter(|pair| sweep(pair[0]) == sweep(pair[1]))
            .map(|pair| [pair[0], pair[1]])
            .collect();
        let mut found = Vec::new();
        for i in &mids {
            let mut met = Vec::new();
            for pair in &pairs {
                let other = sweep(pair[0]);
                // Each pair of sweeps once, each contact once.
                if sweep(*i) < other && !met.contains(&other) && brackets(&self.points, *i, *pair) {
                    met.push(other);
                    found.push(Row::Across(*i, *pair));
                }
            }
        }
        self.rows.extend(found);
    }

    /// By the contacts' `[x, y, normal]`, by differences: a row has three contacts at most.
    fn gradient(&self, row: &Row) -> Vec<(usize, Vector3<f64>)> {
        const STEP: f64 = 1e-6;
        let contacts = match row {
            Row::Constraint(_) => return Vec::new(),
            Row::Step(i, j) => vec![*i, *j],
            Row::Across(i, [j, k]) => vec![*i, *j, *k],
        };
        let moved = |contact: usize, by: Vector3<f64>| {
            outline_value(row, &|i| {
                let (x, normal) = (self.points[i].x_in_world, self.points[i].normal_rad);
                if i == contact { (x + by.fixed_rows::<2>(0), normal + by.z) } else { (x, normal) }
            })
        };
        let by = |contact: usize| {
            Vector3::from_fn(|entry, _| {
                let step = Vector3::ith(entry, STEP);
                (moved(contact, step) - moved(contact, -step)) / (2.0 * STEP)
            })
        };
        contacts.into_iter().map(|contact| (contact, by(contact))).collect()
    }
}

/// The samples whose status is ok and whose mode is sure, thinned evenly to what a dense factorisation bears.
fn chosen(samples: &[Sample], record: &Record) -> Vec<(usize, bool)> {
    let sure = |i: &usize| {
        let estimate = &record.estimates[*i];
        estimate.status == Status::Ok && SURE < estimate.mode_probability && record.tests[*i].is_some()
    };
    let all: Vec<usize> = (0..samples.len()).filter(sure).collect();
    let every = all.len().div_ceil(MOST_CONTACTS).max(1);
    all.into_iter().step_by(every).map(|i| (i, record.estimates[i].mode == Mode::Tip)).collect()
}

/// Whether the normal of `i` lies between those of a pair of neighbours, both near.
fn brackets(points: &[OutlinePoint], i: usize, [j, k]: [usize; 2]) -> bool {
    let span = turned(points[k].normal_rad - points[j].normal_rad);
    let at = turned(points[i].normal_rad - points[j].normal_rad);
    let is_near = span.abs() < WIDEST_RAD;
    // Normals closer than their noise do not say which is first: 0.001 rad.
    is_near && 1e-3 < span.abs() && 0.0 <= at / span && at / span <= 1.0
}

/// An outline row, metres.
fn outline_value(row: &Row, at: &dyn Fn(usize) -> (Vector2<f64>, f64)) -> f64 {
    match row {
        Row::Constraint(_) => 0.0,
        Row::Step(i, j) => {
            let ((x_i, normal_i), (x_j, normal_j)) = (at(*i), at(*j));
            0.5 * (unit(normal_i) + unit(normal_j)).dot(&(x_j - x_i))
        }
        Row::Across(i, [j, k]) => {
            let ((x, normal), (x_j, normal_j), (x_k, normal_k)) = (at(*i), at(*j), at(*k));
            // n = a n_j + b n_k: then the corner in which both support lines meet has the support a h_j + b h_k.
            let span = (normal_k - normal_j).sin();
            let (a, b) = ((normal_k - normal).sin() / span, (normal - normal_j).sin() / span);
            a * unit(normal_j).dot(&(x - x_j)) + b * unit(normal_k).dot(&(x - x_k))
        }
    }
}

fn unit(angle_rad: f64) -> Vector2<f64> {
    Vector2::new(angle_rad.cos(), angle_rad.sin())
}
