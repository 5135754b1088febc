//! 95 % intervals by profile likelihood: the values of a quantity for which all constraints can still be met at a χ² at most 3.84 above the
//! least. Unlike value ± 1.96 σ they follow the curvature of the quantity: docs/math/survey.md eqs. (12)–(14).

use super::query::Query;
use super::rows::equations;
use super::state::{Layout, State};
use super::{Adjusted, Constraint, Item};
use crate::Error;
use crate::least_squares::arrow::minimize_on_level;
use nalgebra::DVector;

/// A value with its uncertainty, in metres, radians or square metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The maximum likelihood estimate.
    pub value: f64,
    /// Standard deviation to first order.
    pub sigma: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
    /// Whether the interval is that of the profile likelihood; where that could not be followed to its ends the interval is value ± 1.96 σ.
    pub is_profile: bool,
}

/// Two-sided 95 % point of the standard normal distribution.
pub(crate) const NORMAL_95: f64 = 1.959_963_984_540_054;
/// Tolerance in √Δχ² at which an end of an interval is found.
const NEAR: f64 = 2e-3;
/// Largest number of secant steps towards an end.
const MOST_STEPS: usize = 12;

/// The part of a network that an interval depends on.
struct Part {
    constraints: Vec<Constraint>,
    layout: Layout,
    /// The index in the network of each unknown of the part.
    unknowns: Vec<usize>,
}

impl Adjusted {
    /// Returns the network without the points that the query does not use and that nothing checks: they follow every change of the rest without
    /// adding to χ². docs/math/survey.md eq. (28).
    fn part(&self, query: &Query) -> Part {
        let (members, points) = (self.layout.members(), query.points());
        let is_unchecked = self.unchecked_groups();
        let is_left_out =
            |group: usize| is_unchecked[group] && !members[group].iter().any(|p| points.contains(p));
        let (layout, unknowns) = self.layout.without(is_left_out);
        let constraints = self.used_constraints().into_iter().filter(|f| layout.has(f)).collect();
        Part { constraints, layout, unknowns }
    }

    /// Returns for each group of points whether it has no more residuals than unknowns.
    fn unchecked_groups(&self) -> Vec<bool> {
        let (members, unknowns) = (self.layout.members(), self.layout.arrow().groups());
        let mut group_of = vec![None; self.layout.point.len()];
        for (group, points) in members.iter().enumerate() {
            points.iter().for_each(|p| group_of[*p] = Some(group));
        }
        let mut n_rows = vec![0; members.len()];
        for constraint in self.used_constraints().iter().filter(|f| self.layout.has(f)) {
            if let Some(group) = constraint.points()[0].and_then(|p| group_of[p]) {
                n_rows[group] += constraint.n_rows();
            }
        }
        n_rows.iter().zip(unknowns).map(|(n, unknowns)| *n == unknowns.len()).collect()
    }

    /// Returns for each point whether it has no more residuals than unknowns, so that nothing checks it and no other answer depends on it.
    pub fn points_that_nothing_checks(&self) -> Vec<bool> {
        let mut is = vec![false; self.layout.point.len()];
        let of_groups = self.layout.members().iter().zip(self.unchecked_groups());
        of_groups.filter(|(_, is_unchecked)| *is_unchecked).for_each(|(points, _)| {
            points.iter().for_each(|p| is[*p] = true);
        });
        is
    }

    /// Returns the value of a query with its 95 % interval.
    ///
    /// # Errors
    /// The reason why a point or plane is undetermined; `InvalidSetting` for too few points, or those not in the network.
    pub fn measure(&self, query: &Query) -> Result<Measured, Error> {
        let (linear, by) = self.linear(query)?;
        let Measured { value, sigma, .. } = linear;
        let part = self.part(query);
        let by = DVector::from_iterator(part.layout.n, part.unknowns.iter().map(|i| by[*i]));
        let end = |side: f64| self.end(query, &part, [value, sigma], &by, side);
        let (low, high) = if 0.0 < sigma { (end(-1.0), end(1.0)) } else { (Some(value), Some(value)) };
        let is_profile = low.is_some() && high.is_some();
        Ok(Measured {
            low: low.unwrap_or(linear.low),
            high: high.unwrap_or(linear.high),
            is_profile,
            ..linear
        })
    }

    /// Returns the value of a query with the interval value ± 1.96 σ.
    ///
    /// # Errors
    /// Those of [`Adjusted::measure`].
    pub fn measure_to_first_order(&self, query: &Query) -> Result<Measured, Error> {
        Ok(self.linear(query)?.0)
    }

    /// Returns the value of a query to first order, and by how much a unit of its multiplier moves all unknowns.
    fn linear(&self, query: &Query) -> Result<(Measured, DVector<f64>), Error> {
        self.check(query)?;
        let (value, gradient) = query.value(&self.state, &self.layout);
        let by = self.covariance.times(&gradient);
        let sigma = gradient.dot(&by).max(0.0).sqrt();
        if !(value.is_finite() && sigma.is_finite()) {
            return Err(Error::NotFinite { what: "the value asked for", index: 0 });
        }
        let end = |side: f64| value + side * NORMAL_95 * sigma;
        Ok((Measured { value, sigma, low: end(-1.0), high: end(1.0), is_profile: false }, by))
    }

    pub(super) fn check(&self, query: &Query) -> Result<(), Error> {
        let points = query.points();
        if points.len() < query.least_points() {
            let needed = "a polyline needs two points and an area three";
            return Err(Error::InvalidSetting {
                setting: "points of the query",
                seen: points.len() as f64,
                needed,
            });
        }
        let needed = "it must be one of the network's";
        let unknown =
            |setting, index: usize| Err(Error::InvalidSetting { setting, seen: index as f64, needed });
        let why = |item: Item| self.undetermined.iter().find(|u| u.0 == item).map(|u| u.1.clone());
        for point in points {
            if self.layout.point.len() <= point {
                return unknown("point of the query", point);
            }
            why(Item::Point(point)).map_or(Ok(()), Err)?;
        }
        match query {
            Query::Height { plane, .. } if self.state.planes.len() <= *plane => {
                unknown("plane of the query", *plane)
            }
            Query::Height { plane, .. } => why(Item::Plane(*plane)).map_or(Ok(()), Err),
            Query::Coordinate { axis, .. } if 2 < *axis => unknown("axis of the query", *axis),
            _ => Ok(()),
        }
    }

    /// Returns the value at which √(Δχ²/scale) reaches 1.96 on one side, by the secant method starting at 1.96 σ.
    fn end(
        &self,
        query: &Query,
        Part { constraints, layout, .. }: &Part,
        [value, sigma]: [f64; 2],
        by: &DVector<f64>,
        side: f64,
    ) -> Option<f64> {
        let mut state = self.state.clone();
        let (mut at, mut aim) = (value, value + side * NORMAL_95 * sigma);
        let mut reached = 0.0;
        for _ in 0..MOST_STEPS {
            // A first-order step along the line of constrained minima; the iteration on the level corrects it.
            state = state.moved(layout, &(by * ((aim - at) / (sigma * sigma))))?;
            let level = |s: &State| {
                let (value, gradient) = query.value(s, layout);
                Some((value - aim, gradient))
            };
            let found = minimize_on_level(
                &state,
                level,
                |s| equations(constraints, s, layout),
                |s, by| s.moved(layout, by),
            )?;
            let root = ((found.equations.chi2 - self.chi2) / self.noise_scale).max(0.0).sqrt();
            if (root - NORMAL_95).abs() < NEAR {
                return Some(aim);
            }
            let slope = (root - reached) / (aim - at);
            let next = aim + (NORMAL_95 - root) / slope;
            // The step must stay on this side of the value and within 20 σ: the interval of a flat profile has no end.
            let is_usable = next.is_finite() && side * (next - value) > 0.0;
            if !is_usable || 20.0 * sigma < (next - value).abs() {
                return None;
            }
            (at, aim, reached, state) = (aim, next, root, found.state);
        }
        None
    }
}
