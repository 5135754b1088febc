//! Which mistakes would be noticed, and what do those that would not do to an answer? docs/math/survey.md section 9.
//!
//! ```text
//!   J rows of one constraint, whitened  ·  C covariance of the unknowns  ·  R = I − J C Jᵀ its redundancy, ρ, e eigenvalue and -vector
//!   κ  what a statistic needs to be a suspect's with a chance of 80 %  ·  ∇ = κ/√ρ  the smallest error along e that is noticed
//! ```

use super::rows::{Row, rows};
use super::snoop::{LEAST_REDUNDANCY, suspect_above, unit};
use super::{Adjusted, Constraint, Query};
use crate::Error;
use crate::multiview::triangulate::matrix_of;
use nalgebra::{DMatrix, DVector, Vector2};

/// Standard normal quantile of the chance, 80 %, with which the smallest error is noticed.
const POWER: f64 = 0.841_621;
/// A constraint matters for an answer from this part of its variance on.
const LEAST_SHARE: f64 = 0.01;
/// The parameters that scale an image.
const FOCAL: [&str; 3] = ["f", "fx_px", "fy_px"];

/// What could be wrong by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// A constraint.
    Constraint(usize),
    /// The focal length of a camera, beyond what its covariance allows.
    Focal(usize),
}

/// How well an answer is checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Reliability {
    /// The largest error that one mistake may put into the answer and not be noticed in four of five cases, in the unit of the answer; none where
    /// the answer rests on something that nothing checks.
    pub smallest_error: Option<f64>,
    /// The mistake that does it.
    pub weakest: Option<Source>,
    /// Constraints and lenses that the answer rests on and nothing checks.
    pub unchecked: Vec<Source>,
}

/// A way in which one source may be wrong: by one whitened unit along a direction of its rows.
struct Mistake {
    source: Source,
    redundancy: f64,
    /// Jᵀe: how it pulls at the unknowns.
    pull: DVector<f64>,
    /// The error in the source's own unit.
    unit: f64,
}

/// All mistakes of a network, and what a statistic needs to be noticed.
pub struct Mistakes<'a> {
    adjusted: &'a Adjusted,
    covariance: DMatrix<f64>,
    all: Vec<Mistake>,
    kappa: f64,
}

impl Adjusted {
    /// The mistakes that could have been made, one at a time.
    pub fn mistakes(&self) -> Mistakes<'_> {
        let covariance = &self.covariance / self.noise_scale;
        let used = |i: &usize| !self.left_out.contains(i) && self.layout.has(&self.constraints[*i]);
        let used: Vec<usize> = (0..self.constraints.len()).filter(used).collect();
        let mut all: Vec<Mistake> = used.iter().flat_map(|i| self.of_constraint(*i, &covariance)).collect();
        all.extend(
            (0..self.state.lenses.len()).filter_map(|camera| self.of_focal(camera, &used, &covariance)),
        );
        let kappa = suspect_above(used.len()).sqrt() + POWER;
        Mistakes { adjusted: self, covariance, all, kappa }
    }

    /// R = I − J C Jᵀ in its eigenvectors, docs/math/survey.md eq. (25).
    fn of_constraint(&self, index: usize, covariance: &DMatrix<f64>) -> Vec<Mistake> {
        let constraint = &self.constraints[index];
        let rows = rows(constraint, &self.state, &self.layout).unwrap_or_default();
        let pulls: Vec<DVector<f64>> = rows.iter().map(|row| self.dense(row)).collect();
        let redundancy = DMatrix::from_fn(rows.len(), rows.len(), |i, k| {
            f64::from(u8::from(i == k)) - pulls[i].dot(&(covariance * &pulls[k]))
        });
        let eigen = redundancy.symmetric_eigen();
        let mistake = |k: usize| Mistake {
            source: Source::Constraint(index),
            redundancy: eigen.eigenvalues[k],
            pull: pulls.iter().zip(eigen.eigenvectors.column(k).iter()).map(|(pull, e)| pull * *e).sum(),
            unit: unit(constraint),
        };
        (0..rows.len()).map(mistake).collect()
    }

    fn dense(&self, row: &Row) -> DVector<f64> {
        let mut pull = DVector::zeros(self.layout.n);
        row.entries.iter().for_each(|(at, x)| pull[*at] += x);
        pull
    }

    /// A focal length that is off by a part of itself moves all image points of the camera together (docs/math/survey.md eq. (28)).
    fn of_focal(&self, camera: usize, used: &[usize], covariance: &DMatrix<f64>) -> Option<Mistake> {
        let lens = &self.state.lenses[camera].camera;
        let parameters = lens.parameters();
        let (mut squared, mut pull) = (0.0, DVector::zeros(self.layout.n));
        for index in used {
            let Constraint::ImagePoint { photo, point, covariance_px2, .. } = &self.constraints[*index]
            else {
                continue;
            };
            if self.state.camera_of_photo[*photo] != camera {
                continue;
            }
            let columns =
                lens.intrinsics_jacobian(&(self.state.photos[*photo] * self.state.points[*point]))?;
            let of_focal = columns.iter().zip(parameters.iter()).filter(|(_, p)| FOCAL.contains(&p.0));
            let moved: Vector2<f64> = of_focal.map(|(by, p)| by * p.1).sum();
            let moved = matrix_of(covariance_px2).cholesky()?.l().try_inverse()? * moved;
            squared += moved.norm_squared();
            for (row, by) in
                rows(&self.constraints[*index], &self.state, &self.layout)?.iter().zip(moved.iter())
            {
                pull += self.dense(row) * *by;
            }
        }
        (0.0 < squared).then(|| {
            let length = squared.sqrt();
            let pull = pull / length;
            let redundancy = 1.0 - pull.dot(&(covariance * &pull));
            Mistake { source: Source::Focal(camera), redundancy, pull, unit: 1.0 / length }
        })
    }
}

impl Mistakes<'_> {
    /// The smallest error of a source that would be noticed in four of five cases, in its own unit (px, m, rad; of a focal length its part) (docs/math/survey.md eq. (26));
    /// none where nothing checks it, or some direction of it.
    pub fn smallest_error(&self, source: Source) -> Option<f64> {
        let of_source = self.all.iter().filter(|m| m.source == source);
        let least = of_source.min_by(|a, b| a.redundancy.total_cmp(&b.redundancy))?;
        let is_checked = LEAST_REDUNDANCY < least.redundancy;
        is_checked.then(|| self.kappa * least.unit / least.redundancy.sqrt())
    }

    /// Whether a source took part.
    pub fn has(&self, source: Source) -> bool {
        self.all.iter().any(|m| m.source == source)
    }

    /// How well the answer to a question is checked: docs/math/survey.md eq. (27).
    ///
    /// # Errors
    /// Those of [`Adjusted::measure`].
    pub fn of_query(&self, query: &Query) -> Result<Reliability, Error> {
        self.adjusted.check(query)?;
        let (_, gradient) = query.value(&self.adjusted.state, &self.adjusted.layout);
        let by = &self.covariance * &gradient;
        let variance = gradient.dot(&by);
        let mut found = Reliability { smallest_error: Some(0.0), weakest: None, unchecked: Vec::new() };
        for mistake in &self.all {
            let influence = by.dot(&mistake.pull);
            if influence * influence < LEAST_SHARE * variance {
                continue;
            }
            if mistake.redundancy <= LEAST_REDUNDANCY {
                found.unchecked.push(mistake.source);
                continue;
            }
            let error = self.kappa * influence.abs() / mistake.redundancy.sqrt();
            if found.smallest_error.is_some_and(|largest| largest < error) {
                (found.smallest_error, found.weakest) = (Some(error), Some(mistake.source));
            }
        }
        found.unchecked.dedup();
        if !found.unchecked.is_empty() {
            (found.smallest_error, found.weakest) = (None, None);
        }
        Ok(found)
    }
}
