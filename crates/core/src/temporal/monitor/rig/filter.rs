//! What the cameras of a rig do while nothing happens, and the filter that predicts what they see of a target that is hand-held.
//!
//! ```text
//!   y_c = m_c + L_c u_c + w_c + n_c − Ad(cam_from_rig) β     m error of the reference   u correlated error in units of L   w diurnal
//!   z_c = Ad(rig_from_cam) y_c                               β, the target's motion in the rig frame, is the same for all: it
//!   d_c = z_c − z_r                                          drops out of differences with any one camera r of the frame_set
//! ```
//! Derivation: docs/math/monitor.md eqs. (18)–(21).

use super::star::CameraReading;
use crate::temporal::monitor::axis::DAY_S;
use crate::temporal::snapshot::numbers;
use crate::{Error, Matrix6, Pose};
use nalgebra::{DMatrix, DVector, Dyn};

/// The errors of one camera's observations that are no drift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservationNoise {
    /// Variance that is new in every frame, in units of what the pixels' stated sigmas give.
    pub white: f64,
    /// Variance of the error that lasts from frame to frame, in the same units.
    pub correlated: f64,
    /// The time in which that error is forgotten, seconds.
    pub correlated_time_s: f64,
    /// Correlated error besides, whatever the view: covariance of a small motion of the camera frame.
    pub bias: Matrix6,
    /// Covariance of the diurnal variation.
    pub diurnal: Matrix6,
}

impl ObservationNoise {
    /// Pixels as stated, independent from frame to frame.
    pub fn white() -> Self {
        let (bias, diurnal) = (Matrix6::zeros(), Matrix6::zeros());
        ObservationNoise { white: 1.0, correlated: 0.0, correlated_time_s: 1.0, bias, diurnal }
    }

    /// # Errors
    /// `InvalidSetting` for variances and times that are not positive, or matrices that are no covariance.
    pub fn check(&self) -> Result<(), Error> {
        let ObservationNoise { white, correlated, correlated_time_s, bias, diurnal } = self;
        let invalid = |setting, seen, needed| Err(Error::InvalidSetting { setting, seen, needed });
        if !(0.0 < *white
            && 0.0 <= *correlated
            && 0.0 < *correlated_time_s
            && (white + correlated).is_finite())
        {
            return invalid("noise of a sight", *white, "variances and times that are positive");
        }
        let is_covariance =
            |m: &Matrix6| m.iter().all(|v| v.is_finite()) && m.diagonal().iter().all(|v| 0.0 <= *v);
        if !(is_covariance(bias) && is_covariance(diurnal)) {
            return invalid("correlated error of a camera", bias[(0, 0)], "covariances, or zero");
        }
        Ok(())
    }

    /// Covariance of the whole error of an observation.
    pub fn total(&self, reading: &Matrix6) -> Matrix6 {
        reading * (self.white + self.correlated) + self.bias
    }
}

/// m, u, w of each camera.
pub(super) const STATES: usize = 18;
/// Forgotten in this time, a diurnal variation of 24 hours changes as fast as the sun makes it.
const DIURNAL_TIME_S: f64 = DAY_S / std::f64::consts::TAU;

/// The prediction of a frame set.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RigFilter {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    noise: Vec<ObservationNoise>,
    rig_from_cam: Vec<Matrix6>,
    last_s: Option<f64>,
}

/// How far the state is carried by a time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Propagated {
    /// Factor of each state.
    pub factors: DVector<f64>,
    pub elapsed_s: f64,
}

/// A frame set beside what was expected of it.
pub(super) struct Innovation {
    /// Rows of the design: differences against the state.
    pub design: DMatrix<f64>,
    /// ν.
    pub value: DVector<f64>,
    /// Factor of S.
    pub spread: nalgebra::Cholesky<f64, Dyn>,
    /// K.
    pub gain: DMatrix<f64>,
}

impl Innovation {
    /// νᵀ S⁻¹ ν.
    pub fn chi2(&self) -> f64 {
        self.value.dot(&self.spread.solve(&self.value))
    }

    /// ln |S|.
    pub(crate) fn log_volume(&self) -> f64 {
        self.spread.l_dirty().diagonal().iter().map(|root| 2.0 * root.ln()).sum()
    }

    /// The same where all variances are so many times as large.
    pub fn scaled(self, scale: f64) -> Self {
        let spread = nalgebra::Cholesky::pack_dirty(self.spread.unpack_dirty() * scale.sqrt());
        Innovation { spread, ..self }
    }

    pub fn degrees_of_freedom(&self) -> usize {
        self.value.len()
    }
}

impl RigFilter {
    /// `reference`: covariance of all m, 6 rows a camera.
    pub fn new(cam_from_rig: &[Pose], reference: &DMatrix<f64>, noise: &[ObservationNoise]) -> Self {
        let n = cam_from_rig.len();
        let mut covariance = DMatrix::zeros(STATES * n, STATES * n);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let block = reference.fixed_view::<6, 6>(6 * i, 6 * j);
            covariance.fixed_view_mut::<6, 6>(STATES * i, STATES * j).copy_from(&block);
        }
        for (i, noise) in noise.iter().enumerate() {
            covariance.fixed_view_mut::<6, 6>(STATES * i + 6, STATES * i + 6).copy_from(&Matrix6::identity());
            covariance.fixed_view_mut::<6, 6>(STATES * i + 12, STATES * i + 12).copy_from(&noise.diurnal);
        }
        RigFilter {
            mean: DVector::zeros(STATES * n),
            covariance,
            noise: noise.to_vec(),
            rig_from_cam: cam_from_rig.iter().map(|place| place.inverse().adjoint()).collect(),
            last_s: None,
        }
    }

    /// Whether it is such as a rig of this many cameras makes: numbers of a file may be any.
    pub fn is_sound(&self, cameras: usize) -> bool {
        let states = STATES * cameras;
        self.mean.len() == states
            && self.covariance.shape() == (states, states)
            && [self.noise.len(), self.rig_from_cam.len()] == [cameras; 2]
            && self.noise.iter().all(|noise| noise.check().is_ok())
    }

    /// F and Q over the time since the last frame set.
    pub fn predict(&mut self, t_s: f64) -> Propagated {
        let elapsed_s = self.last_s.map_or(0.0, |last_s| (t_s - last_s).max(0.0));
        self.last_s = Some(self.last_s.map_or(t_s, |last_s| last_s.max(t_s)));
        let mut factors = DVector::from_element(self.mean.len(), 1.0);
        for (camera, noise) in self.noise.iter().enumerate() {
            factors.rows_mut(STATES * camera + 6, 6).fill((-elapsed_s / noise.correlated_time_s).exp());
            factors.rows_mut(STATES * camera + 12, 6).fill((-elapsed_s / DIURNAL_TIME_S).exp());
        }
        self.mean.component_mul_assign(&factors);
        let n = factors.len();
        for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
            self.covariance[(i, j)] *= factors[i] * factors[j];
        }
        for (camera, noise) in self.noise.iter().enumerate() {
            let (u, w) = (STATES * camera + 6, STATES * camera + 12);
            let (correlated, diurnal) = (1.0 - factors[u].powi(2), 1.0 - factors[w].powi(2));
            let mut block = self.covariance.fixed_view_mut::<6, 6>(u, u);
            block += Matrix6::identity() * correlated;
            let mut block = self.covariance.fixed_view_mut::<6, 6>(w, w);
            block += noise.diurnal * diurnal;
        }
        Propagated { factors, elapsed_s }
    }

    /// What the stars of a frame set say; none where a covariance is no covariance, or no star has two cameras.
    pub fn innovation(&self, stars: &[Vec<CameraReading>]) -> Option<Innovation> {
        let rows: usize = stars.iter().map(|star| 6 * star.len().saturating_sub(1)).sum();
        if rows == 0 {
            return None;
        }
        let mut design = DMatrix::zeros(rows, self.mean.len());
        let (mut value, mut noise) = (DVector::zeros(rows), DMatrix::zeros(rows, rows));
        let mut row = 0;
        for star in stars {
            let Some((base, others)) = star.split_first() else { continue };
            let n = others.len();
            for (i, reading) in others.iter().enumerate() {
                let at = row + 6 * i;
                let mut own = value.fixed_rows_mut::<6>(at);
                own += self.rig_from_cam[reading.camera] * reading.motion
                    - self.rig_from_cam[base.camera] * base.motion;
                self.put(&mut design, at, reading, 1.0)?;
                self.put(&mut design, at, base, -1.0)?;
                noise.fixed_view_mut::<6, 6>(at, at).copy_from(&self.white(reading));
            }
            let shared = self.white(base);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let mut block = noise.fixed_view_mut::<6, 6>(row + 6 * i, row + 6 * j);
                block += shared;
            }
            row += 6 * n;
        }
        let carried = &self.covariance * design.transpose();
        let spread = factor(&design * &carried + noise)?;
        value -= &design * &self.mean;
        let gain = spread.solve(&carried.transpose()).transpose();
        Some(Innovation { design, value, spread, gain })
    }

    pub fn update(&mut self, innovation: &Innovation) {
        self.mean += &innovation.gain * &innovation.value;
        self.covariance -= &innovation.gain * (&innovation.design * &self.covariance);
        self.covariance = (&self.covariance + self.covariance.transpose()) * 0.5;
    }

    /// Mean and covariance of m of a camera.
    pub fn level(&self, camera: usize) -> (crate::Vector6, Matrix6) {
        let at = STATES * camera;
        (self.mean.fixed_rows::<6>(at).into(), self.covariance.fixed_view::<6, 6>(at, at).into())
    }

    /// White noise of an observation in the rig frame.
    fn white(&self, reading: &CameraReading) -> Matrix6 {
        let ad = &self.rig_from_cam[reading.camera];
        ad * reading.covariance * ad.transpose() * self.noise[reading.camera].white
    }

    /// Adds ± Ad (m + L u + w) of an observation to six rows.
    fn put(&self, design: &mut DMatrix<f64>, row: usize, reading: &CameraReading, sign: f64) -> Option<()> {
        let (camera, noise) = (reading.camera, &self.noise[reading.camera]);
        let ad = self.rig_from_cam[camera] * sign;
        let correlated = reading.covariance * noise.correlated + noise.bias;
        let mut add = |offset: usize, block: Matrix6| {
            let mut own = design.fixed_view_mut::<6, 6>(row, STATES * camera + offset);
            own += block;
        };
        add(0, ad);
        add(12, ad);
        if correlated.iter().any(|v| *v != 0.0) {
            add(6, ad * root(&correlated));
        }
        Some(())
    }
}

/// L of a covariance = L Lᵀ, by Cholesky; coordinates that it holds for exactly known (a bias stated of turns alone) stay so.
fn root(covariance: &Matrix6) -> Matrix6 {
    /// Share of a variance that rounding leaves where nothing is left.
    const NOTHING: f64 = 1e-12;
    let mut lower = Matrix6::zeros();
    for j in 0..6 {
        let explained: f64 = (0..j).map(|k| lower[(j, k)] * lower[(j, k)]).sum();
        let left = covariance[(j, j)] - explained;
        if left <= NOTHING * covariance[(j, j)] {
            continue;
        }
        lower[(j, j)] = left.sqrt();
        for i in j + 1..6 {
            let shared: f64 = (0..j).map(|k| lower[(i, k)] * lower[(j, k)]).sum();
            lower[(i, j)] = (covariance[(i, j)] - shared) / lower[(j, j)];
        }
    }
    lower
}

/// Cholesky's factor of S; none where it is no covariance.
fn factor(spread: DMatrix<f64>) -> Option<nalgebra::Cholesky<f64, Dyn>> {
    if !spread.iter().all(|v| v.is_finite()) {
        return None;
    }
    ((&spread + spread.transpose()) * 0.5).cholesky()
}

numbers!(ObservationNoise { white, correlated, correlated_time_s, bias, diurnal });
numbers!(RigFilter { mean, covariance, noise, rig_from_cam, last_s });
