//! The errors of a measurement that would be noticed, and the effect of unnoticed ones on an answer: docs/math/survey.md section 9.
//!
//! ```text
//!   J whitened rows of one constraint  ·  C covariance of the unknowns  ·  R = I − J C Jᵀ its redundancy, ρ, e eigenvalue and eigenvector
//!   κ standard deviations that make a constraint a suspect with a chance of 80 %  ·  ∇ = κ/√ρ the smallest error along e that is noticed
//! ```

use super::rows::rows;
use super::snoop::{LEAST_REDUNDANCY, suspect_above, unit};
use super::{Adjusted, Constraint, Query};
use crate::Error;
use crate::multiview::triangulate::matrix_of;
use nalgebra::{DMatrix, DVector, Vector2};

/// Standard normal quantile of the probability, 80 %, with which the smallest error is noticed.
const POWER: f64 = 0.841_621;
/// Smallest share of an answer's variance for which a constraint matters to the answer.
const LEAST_SHARE: f64 = 0.01;
/// Smallest share of an answer's variance for which a constraint that nothing checks matters, because it may be off by hundreds of its standard
/// deviations. At this share a thousand of them move the answer by one standard deviation of the answer.
const LEAST_SHARE_UNCHECKED: f64 = 1e-6;
/// Names of the parameters that scale an image.
const FOCAL: [&str; 3] = ["f", "fx_px", "fy_px"];

/// A possible source of a single error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ErrorSource {
    /// The constraint with this index.
    Constraint(usize),
    /// The focal length of the camera with this index, beyond its covariance.
    Focal(usize),
}

/// The extent to which an answer is checked.
#[derive(Debug, Clone, PartialEq)]
pub struct QueryReliability {
    /// The largest error that a single wrong constraint or lens puts into the answer without being noticed in four of five cases, in the unit of
    /// the answer; none where the answer depends on something that nothing checks in some direction.
    pub largest_unnoticed_error: Option<f64>,
    /// The largest unnoticed error of all constraints and lenses that are checked, however little the answer depends on them and whatever nothing
    /// checks.
    pub largest_error_of_checked: f64,
    /// The constraint or lens that causes it.
    pub weakest: Option<ErrorSource>,
    /// Constraints and lenses that the answer depends on and that nothing checks.
    pub unchecked: Vec<ErrorSource>,
    /// Constraints that the answer depends on and that are checked in some directions only, as an image point is by one other photograph.
    pub partly_checked: Vec<ErrorSource>,
}

/// A possible error of one source: one standard deviation along a direction of its rows.
struct PossibleError {
    source: ErrorSource,
    redundancy: f64,
    /// Jᵀe, one entry for each unknown.
    pull: Vec<(usize, f64)>,
    /// The error in the source's own unit.
    unit: f64,
}

/// Every possible error of a network.
pub struct NetworkReliability<'a> {
    adjusted: &'a Adjusted,
    all: Vec<PossibleError>,
    kappa: f64,
}

impl Adjusted {
    /// Returns which single errors would be noticed.
    pub fn reliability(&self) -> NetworkReliability<'_> {
        let used = |i: &usize| !self.left_out.contains(i) && self.layout.has(&self.constraints[*i]);
        let used: Vec<usize> = (0..self.constraints.len()).filter(used).collect();
        let mut all: Vec<PossibleError> = used.iter().flat_map(|i| self.of_constraint(*i)).collect();
        all.extend((0..self.state.lenses.len()).filter_map(|camera| self.of_focal(camera, &used)));
        let kappa = suspect_above(used.len()).sqrt() + POWER;
        NetworkReliability { adjusted: self, all, kappa }
    }

    /// Returns the possible errors of a constraint: R = I − J C Jᵀ in its eigenvectors, docs/math/survey.md eq. (29).
    fn of_constraint(&self, index: usize) -> Vec<PossibleError> {
        let constraint = &self.constraints[index];
        let rows = rows(constraint, &self.state, &self.layout).unwrap_or_default();
        if rows.is_empty() {
            return Vec::new(); // Exact, such as a known pose without a covariance.
        }
        let identity = |i: usize, k: usize| f64::from(u8::from(i == k));
        let redundancy = DMatrix::from_fn(rows.len(), rows.len(), |i, k| {
            identity(i, k) - self.scatter(&rows[i].entries, &rows[k].entries)
        });
        let eigen = redundancy.symmetric_eigen();
        let along = |k: usize| {
            let parts = rows.iter().zip(eigen.eigenvectors.column(k).iter().copied().collect::<Vec<f64>>());
            parts.flat_map(|(row, e)| row.entries.iter().map(move |(at, x)| (*at, x * e))).collect()
        };
        let error = |k: usize| PossibleError {
            source: ErrorSource::Constraint(index),
            redundancy: eigen.eigenvalues[k],
            pull: along(k),
            unit: unit(constraint),
        };
        (0..rows.len()).map(error).collect()
    }

    /// Returns aᵀ C b of two sparse rows, with the covariance by the constraints as stated.
    fn scatter(&self, a: &[(usize, f64)], b: &[(usize, f64)]) -> f64 {
        let of =
            |(i, x): &(usize, f64)| b.iter().map(|(k, y)| x * y * self.covariance.at(*i, *k)).sum::<f64>();
        a.iter().map(of).sum::<f64>() / self.noise_scale
    }

    /// Returns the effect of a relative error of the focal length, which moves all image points of its camera together: docs/math/survey.md eq.
    /// (32).
    fn of_focal(&self, camera: usize, used: &[usize]) -> Option<PossibleError> {
        let (mut squared, mut pull) = (0.0, DVector::<f64>::zeros(self.layout.n));
        for index in used {
            let Constraint::ImagePoint { photo, .. } = &self.constraints[*index] else { continue };
            if self.state.camera_of_photo[*photo] != camera {
                continue;
            }
            let moved = self.moved_by_focal(camera, &self.constraints[*index])?;
            squared += moved.norm_squared();
            let rows = rows(&self.constraints[*index], &self.state, &self.layout)?;
            for (row, by) in rows.iter().zip(moved.iter()) {
                row.entries.iter().for_each(|(at, x)| pull[*at] += x * by);
            }
        }
        if !(0.0 < squared && squared.is_finite()) {
            return None;
        }
        let length = squared.sqrt();
        let pull = pull / length;
        let redundancy = 1.0 - pull.dot(&self.covariance.times(&pull)) / self.noise_scale;
        let pull = pull.iter().copied().enumerate().collect();
        Some(PossibleError { source: ErrorSource::Focal(camera), redundancy, pull, unit: 1.0 / length })
    }

    /// Returns the motion of an image point, in its standard deviations, per relative change of the focal length.
    fn moved_by_focal(&self, camera: usize, image_point: &Constraint) -> Option<Vector2<f64>> {
        let Constraint::ImagePoint { photo, point, covariance_px2, .. } = image_point else { return None };
        let lens = &self.state.lenses[camera].camera;
        let parameters = lens.parameters();
        let columns = lens.intrinsics_jacobian(&(self.state.photos[*photo] * self.state.points[*point]))?;
        let of_focal = columns.iter().zip(parameters.iter()).filter(|(_, p)| FOCAL.contains(&p.0));
        let moved: Vector2<f64> = of_focal.map(|(by, p)| by * p.1).sum();
        Some(matrix_of(covariance_px2).cholesky()?.l().try_inverse()? * moved)
    }
}

impl NetworkReliability<'_> {
    /// Returns the smallest error of a source that is noticed in four of five cases, in its own unit (px, m, rad; for a focal length its
    /// relative error): docs/math/survey.md eq. (30). None where nothing checks the source or some direction of it.
    pub fn smallest_noticed_error(&self, source: ErrorSource) -> Option<f64> {
        let least = self.of(source).iter().min_by(|a, b| a.redundancy.total_cmp(&b.redundancy))?;
        let is_checked = LEAST_REDUNDANCY < least.redundancy;
        is_checked.then(|| self.kappa * least.unit / least.redundancy.sqrt())
    }

    /// The possible errors of a source: all are sorted by source.
    fn of(&self, source: ErrorSource) -> &[PossibleError] {
        let from = self.all.partition_point(|error| error.source < source);
        let n = self.all[from..].partition_point(|error| error.source == source);
        &self.all[from..from + n]
    }

    fn is_checked_in_some_direction(&self, source: ErrorSource) -> bool {
        self.of(source).iter().any(|error| LEAST_REDUNDANCY < error.redundancy)
    }

    /// Returns every constraint and lens that took part.
    pub fn sources(&self) -> Vec<ErrorSource> {
        let mut sources: Vec<ErrorSource> = self.all.iter().map(|error| error.source).collect();
        sources.dedup();
        sources
    }

    /// Returns how well the answer to a query is checked: docs/math/survey.md eq. (31).
    ///
    /// # Errors
    /// The errors of [`Adjusted::measure`].
    pub fn of_query(&self, query: &Query) -> Result<QueryReliability, Error> {
        self.adjusted.check(query)?;
        let (_, gradient) = query.value(&self.adjusted.state, &self.adjusted.layout);
        let by = self.adjusted.covariance.times(&gradient) / self.adjusted.noise_scale;
        let variance = gradient.dot(&by);
        let (mut largest, mut largest_error_of_checked, mut weakest, mut open) =
            (0.0, 0.0f64, None, Vec::new());
        for error in &self.all {
            let influence: f64 = error.pull.iter().map(|(at, x)| x * by[*at]).sum();
            let matters = |share: f64| share * variance <= influence * influence;
            if !(LEAST_REDUNDANCY < error.redundancy) {
                open.extend(matters(LEAST_SHARE_UNCHECKED).then_some(error.source));
                continue;
            }
            let unnoticed = self.kappa * influence.abs() / error.redundancy.sqrt();
            largest_error_of_checked = largest_error_of_checked.max(unnoticed);
            if matters(LEAST_SHARE) && largest < unnoticed {
                (largest, weakest) = (unnoticed, Some(error.source));
            }
        }
        open.dedup();
        let is_checked = open.is_empty();
        let (partly_checked, unchecked): (Vec<_>, Vec<_>) =
            open.into_iter().partition(|source| self.is_checked_in_some_direction(*source));
        Ok(QueryReliability {
            largest_unnoticed_error: is_checked.then_some(largest),
            largest_error_of_checked,
            weakest: weakest.filter(|_| is_checked),
            unchecked,
            partly_checked,
        })
    }
}
