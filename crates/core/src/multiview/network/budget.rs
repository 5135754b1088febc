//! The error budgets of measurements, points and photographs: docs/math/budget.md section 6.
//!
//!   C covariance of the unknowns by the constraints as stated  ·  v = J C gᵀ  what a row's error does to the answers with the gradients g

use super::rows::{Row, lens_rows, pin_rows, rows};
use super::{Adjusted, Constraint, Query};
use crate::budget::{Budget, ErrorSource};
use crate::{Error, Matrix6};
use nalgebra::{DVector, Matrix1, Matrix3, SMatrix, SVector};

/// The whitened rows of a network by their sources, from which every budget follows.
pub struct NetworkBudgets<'a> {
    adjusted: &'a Adjusted,
    rows: Vec<(ErrorSource, Row)>,
}

impl Constraint {
    /// Returns the source of its error.
    fn source(&self) -> ErrorSource {
        match self {
            Constraint::ImagePoint { .. } => ErrorSource::Pixels,
            Constraint::Place { .. } => ErrorSource::ControlPoints,
            Constraint::Distance { .. } => ErrorSource::Distances,
            Constraint::Pose { .. } => ErrorSource::CameraPoses,
            Constraint::OnPlane { .. } | Constraint::Upright { .. } | Constraint::Gravity { .. } => {
                ErrorSource::Priors
            }
        }
    }
}

impl Adjusted {
    /// Returns the rows from which the budgets of measurements, points and photographs follow.
    pub fn budgets(&self) -> NetworkBudgets<'_> {
        let (state, layout) = (&self.state, &self.layout);
        let used = self.used_constraints().into_iter().filter(|constraint| layout.has(constraint));
        let of = |constraint: Constraint| {
            let rows = rows(&constraint, state, layout).unwrap_or_default().into_iter();
            rows.map(move |row| (constraint.source(), row))
        };
        let mut all: Vec<(ErrorSource, Row)> = used.flat_map(of).collect();
        all.extend(lens_rows(state, layout).into_iter().map(|row| (ErrorSource::Lens, row)));
        all.extend(pin_rows(layout).map(|row| (ErrorSource::Priors, row)));
        NetworkBudgets { adjusted: self, rows: all }
    }
}

impl NetworkBudgets<'_> {
    /// Returns the parts of the variance of a measurement.
    ///
    /// # Errors
    /// The errors of [`Adjusted::measure`].
    pub fn of_query(&self, query: &Query) -> Result<Budget<Matrix1<f64>>, Error> {
        self.adjusted.check(query)?;
        let (_, gradient) = query.value(&self.adjusted.state, &self.adjusted.layout);
        Ok(self.of([Some(gradient)]))
    }

    /// Returns the parts of the covariance of a point's position, m²; none where it is undetermined.
    pub fn of_point(&self, point: usize) -> Option<Budget<Matrix3<f64>>> {
        let layout = &self.adjusted.layout;
        let at = layout.has_point(point).then(|| layout.point[point])?;
        Some(self.of(at.map(|at| at.map(|at| self.unit(at)))))
    }

    /// Returns the parts of the covariance of a photograph's pose; none where it is undetermined.
    pub fn of_photo(&self, photo: usize) -> Option<Budget<Matrix6>> {
        let layout = &self.adjusted.layout;
        let at = layout.has_photo(photo).then(|| layout.photo[photo])?;
        Some(self.of([0, 1, 2, 3, 4, 5].map(|i| at.map(|at| self.unit(at + i)))))
    }

    fn unit(&self, at: usize) -> DVector<f64> {
        DVector::from_fn(self.adjusted.layout.n, |i, _| f64::from(i == at))
    }

    /// Returns the parts for answers with these gradients by the unknowns; a missing one has no variance.
    fn of<const N: usize>(&self, gradients: [Option<DVector<f64>>; N]) -> Budget<SMatrix<f64, N, N>> {
        let Adjusted { covariance, noise_scale, .. } = self.adjusted;
        let by = gradients.map(|gradient| gradient.map(|g| covariance.times(&g) / *noise_scale));
        let mut sums = ErrorSource::ALL.map(|source| (source, SMatrix::<f64, N, N>::zeros()));
        for (source, row) in &self.rows {
            let influence = |by: &Option<DVector<f64>>| {
                by.as_ref().map_or(0.0, |by| row.entries.iter().map(|(at, x)| x * by[*at]).sum())
            };
            let v = SVector::<f64, N>::from_fn(|i, _| influence(&by[i]));
            if let Some((_, sum)) = sums.iter_mut().find(|(known, _)| known == source) {
                *sum += v * v.transpose();
            }
        }
        let mut budget = Budget::default();
        sums.iter().for_each(|(source, sum)| budget.add(*source, sum));
        let stated: SMatrix<f64, N, N> = sums.iter().map(|(_, sum)| *sum).sum();
        budget.add(ErrorSource::Residuals, &(stated * (noise_scale - 1.0)));
        budget
    }
}
