//! The typical noise of each camera's observations, which sets the size of motion that is tested for.

use super::ObservationNoise;
use super::held::ReadingSet;
use crate::Matrix6;
use crate::temporal::snapshot::numbers;
use nalgebra::DVector;

/// Of each camera.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Typical {
    /// Mean of 1/σ² of each coordinate, 6 a camera.
    information: DVector<f64>,
    counts: Vec<f64>,
    variances: DVector<f64>,
}

/// Before a camera has been seen: 1° and 1 cm.
const UNSEEN_VARIANCES: [f64; 2] = [3e-4, 1e-4];
/// Sights over which the mean is taken.
const TYPICAL_OVER: f64 = 100.0;

impl Typical {
    pub fn new(cameras: usize) -> Self {
        let variance = |i: usize, _| UNSEEN_VARIANCES[usize::from(3 <= i % 6)];
        Typical {
            information: DVector::zeros(6 * cameras),
            counts: vec![0.0; cameras],
            variances: DVector::from_fn(6 * cameras, variance),
        }
    }

    /// Whether it is such as a rig of this many cameras makes: numbers of a file may be any.
    pub fn is_sound(&self, cameras: usize) -> bool {
        let n = 6 * cameras;
        let all = || self.information.iter().chain(&self.variances).chain(&self.counts);
        [self.information.len(), self.variances.len(), self.counts.len()] == [n, n, cameras]
            && all().all(|number| 0.0 <= *number)
    }

    pub fn variances(&self) -> &DVector<f64> {
        &self.variances
    }

    pub fn spread(&self, camera: usize) -> Matrix6 {
        Matrix6::from_diagonal(&self.variances.fixed_rows::<6>(6 * camera).into_owned())
    }

    pub fn add(&mut self, frame_set: &ReadingSet, noise: &[ObservationNoise]) {
        for reading in frame_set.stars.iter().flatten() {
            let variances = noise[reading.camera].total(&reading.covariance).diagonal();
            let count = &mut self.counts[reading.camera];
            *count = (*count + 1.0).min(TYPICAL_OVER);
            for (i, variance) in variances.iter().enumerate().filter(|(_, variance)| 0.0 < **variance) {
                let at = 6 * reading.camera + i;
                self.information[at] += (1.0 / variance - self.information[at]) / *count;
                self.variances[at] = 1.0 / self.information[at];
            }
        }
    }
}

numbers!(Typical { information, counts, variances });
