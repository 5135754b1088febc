//! Errors that the points of one view share: a bent board, corners all off to one side, a lens not quite known, a rolling shutter. They
//! are estimated from the smoothness of the residuals over the image, and widen the covariance of the pose, which absorbs most of them.
//!
//! A random displacement of the image by polynomials up to the third degree is added to the model, its variance per function falling
//! with the degree. Its evidence is compared with that of no displacement (restricted likelihood, averaged over
//! amplitudes). Derivation: docs/math/shared_error.md.
//!
//!   J, r  whitened derivative and residual   ·   A = JᵀJ   ·   P_d  projector on the polynomials of degree d, orthogonal to lower ones
//!   C_d = JᵀP_dJ,  g_d = JᵀP_dr,  e_d = rᵀP_dr   ·   x_d = θ n λ_d  variance of one function over that of independent noise

use crate::budget::excess;
use crate::least_squares::PivotedPose;
use crate::locate::choose::Minimum;
use crate::locate::loss::Loss;
use crate::locate::problem::Problem;
use crate::locate::refine::{centroid, whitening};
use crate::pose::symmetric;
use crate::{Correspondence, Matrix6, Pixel, Point, Vector6};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Highest degree of the displacement …
const DEGREE: usize = 3;
/// … and how many polynomials of two variables there are up to it.
pub(crate) const FUNCTIONS: usize = 10;
/// What every function is multiplied with: the derivatives of u and of v by the motion, and both residuals.
const COLUMNS: usize = 14;
/// Variance of one function over that of one of the degree below: 0.1 to 0.3 on recorded boards, docs/math/shared_error.md section 5.
const DECAY: f64 = 0.2;
/// Fewest points that distinguish a displacement from noise: three tags, or a board of 3 × 4 corners.
const MIN_POINTS: usize = 12;
/// Variances of the displacement over that of the noise that are tried: 0.02 · √10ᵏ, evenly spaced in the logarithm.
const NODES: usize = 11;
const FIRST_NODE: f64 = 0.02;
/// Probability that there is a displacement, before the residuals are looked at …
const PRIOR: f64 = 0.5;
/// … and afterwards, below which nothing is widened: of views without any, one in fifty is above it.
const PROVEN: f64 = 0.7;
/// A function of which the lower ones leave less than this squared share over the points is not one of its own.
const NEW: f64 = 1e-8;

/// The displacement that the points of a view share, at one minimum.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SharedError {
    /// Its covariance in the pose: small left motion, camera frame.
    field: Matrix6,
    /// Variance of the noise that is left to single points, over the stated one.
    noise: f64,
    /// Root mean square of the displacement along one axis of the image, pixels.
    pub(crate) amplitude_px: f64,
    /// Variance of one orthonormal polynomial of each degree, for those who estimate more than the pose.
    #[cfg_attr(not(feature = "std"), allow(dead_code))]
    of_degree: [f64; DEGREE + 1],
}

/// Offset and scale of the predicted pixels in the polynomials.
#[cfg(feature = "std")]
pub(crate) struct Scale {
    mean: Pixel,
    by: f64,
}

#[cfg(feature = "std")]
impl Scale {
    pub(crate) fn of(seen: &[Correspondence]) -> Self {
        let (mean, by) = mean_and_scale(seen);
        Scale { mean, by }
    }

    /// The polynomials at a predicted pixel, times the root of its weight.
    pub(crate) fn polynomials(&self, pixel: &Pixel, weight: f64) -> [f64; FUNCTIONS] {
        polynomials(&((pixel - self.mean) * self.by), weight.sqrt())
    }
}

impl SharedError {
    /// None where the points are too few to show it, where groups or a robust loss explain the residuals otherwise, or where nothing shows.
    pub(crate) fn at(m: &Minimum, problem: &Problem) -> Option<Self> {
        let is_modelled = problem.groups.iter().any(|g| g.sigma_m != 0.0 || g.sigma_rad != 0.0);
        if problem.seen.len() < MIN_POINTS || problem.loss != Loss::Squared || is_modelled {
            return None;
        }
        shared_error(m, problem)
    }

    /// The variance of each of the polynomials that [`Scale::polynomials`] gives, made orthonormal in their order.
    #[cfg(feature = "std")]
    pub(crate) fn variance_of(&self, function: usize) -> f64 {
        self.of_degree[degree_of(function)]
    }

    /// What is added to a covariance for what is shared: with it, that is in no direction less than independent noise as large as estimated,
    /// `pixels` per stated variance, and the displacement together. `others` is what else is uncertain, and is in `least`.
    pub(crate) fn excess(&self, least: &Matrix6, pixels: &Matrix6, others: &Matrix6) -> Matrix6 {
        let whole = pixels * self.noise + self.field + others;
        excess(&whole, least).unwrap_or(self.field)
    }
}

/// Out of line: few points never come here.
#[inline(never)]
fn shared_error(m: &Minimum, problem: &Problem) -> Option<SharedError> {
    let pivot = centroid(problem.seen);
    let place = PivotedPose::new(&m.cam_from_target, &pivot);
    let products = Products::of(&place, &pivot, problem)?;
    let fit = Fit::new(&at_pivot(m, &place), m.chi2, &products, problem)?;
    let variances = fit.variances()?;
    let amplitude = (0..=DEGREE).map(|d| variances.of_function[d] * fit.degrees[d].n).sum::<f64>();
    let amplitude_px = (amplitude / products.weight / 2.0).sqrt();
    let mut field = Matrix6::zeros();
    for (degree, variance) in fit.degrees.iter().zip(variances.of_function) {
        field += degree.information * variance;
    }
    let about_pivot = fit.unscaled(&(fit.inverse * field * fit.inverse));
    let transport = to_camera(&place.pivot_in_cam);
    let field = symmetric(&(transport * about_pivot * transport.transpose()));
    let is_finite = field.sum().is_finite() && amplitude_px.is_finite() && variances.noise.is_finite();
    is_finite.then_some(SharedError {
        field,
        noise: variances.noise,
        amplitude_px,
        of_degree: variances.of_function,
    })
}

/// Small motions about a pivot as left motions of the camera frame: ν_left = ν + c × ω.
fn to_camera(pivot_in_cam: &Point) -> Matrix6 {
    let mut transport = Matrix6::identity();
    transport.fixed_view_mut::<3, 3>(3, 0).copy_from(&pivot_in_cam.cross_matrix());
    transport
}

/// A⁻¹ about the pivot, where rotation and translation hardly depend on each other.
fn at_pivot(m: &Minimum, place: &PivotedPose) -> Matrix6 {
    let back = to_camera(&-place.pivot_in_cam);
    symmetric(&(back * m.covariance * back.transpose()))
}

/// The polynomials multiplied over all points with each other, with the derivatives and with the residuals.
struct Products {
    gram: [[f64; FUNCTIONS]; FUNCTIONS],
    columns: [[f64; COLUMNS]; FUNCTIONS],
    /// Sum of the points' weights, 1/σ² where noise is the same in u and v.
    weight: f64,
}

impl Products {
    fn of(place: &PivotedPose, pivot: &Point, problem: &Problem) -> Option<Self> {
        let seen = problem.seen;
        let (mean, scale) = mean_and_scale(seen);
        let mut sums = Products {
            gram: [[0.0; FUNCTIONS]; FUNCTIONS],
            columns: [[0.0; COLUMNS]; FUNCTIONS],
            weight: 0.0,
        };
        for c in seen {
            let y = place.rotation * (c.x_in_target - pivot);
            let (pixel, jacobian) = problem.camera.project_with_jacobian(&(y + place.pivot_in_cam))?;
            let (a, b, d) = whitening(c, &jacobian);
            let (ju, jv) = (jacobian.row(0).transpose(), jacobian.row(1).transpose());
            let (ju, jv) = (ju * a + jv * b, jv * d);
            let (tu, tv, e) = (y.cross(&ju), y.cross(&jv), c.pixel - pixel);
            let (ru, rv) = (a * e.x + b * e.y, d * e.y);
            let row = [tu.x, tu.y, tu.z, ju.x, ju.y, ju.z, tv.x, tv.y, tv.z, jv.x, jv.y, jv.z, ru, rv];
            let weight = a * d;
            sums.weight += weight;
            // Of the predicted pixel: functions of the observed one hold its noise, and with the derivatives would explain it.
            sums.add(&polynomials(&((pixel - mean) * scale), weight.sqrt()), &row);
        }
        sums.weight.is_finite().then_some(sums)
    }

    #[inline(always)]
    fn add(&mut self, functions: &[f64; FUNCTIONS], row: &[f64; COLUMNS]) {
        for (k, f) in functions.iter().enumerate() {
            // The whole square: a loop of fixed length goes two numbers at a time.
            for (sum, other) in self.gram[k].iter_mut().zip(functions) {
                *sum += f * other;
            }
            for (sum, entry) in self.columns[k].iter_mut().zip(row) {
                *sum += f * entry;
            }
        }
    }

    /// The products with functions made orthonormal over the points, each to all before it (Gram and Schmidt, by the Cholesky factor of
    /// the Gram matrix); rows of zeros where a function is no new one.
    fn orthonormal(&self) -> ([[f64; COLUMNS]; FUNCTIONS], [bool; FUNCTIONS]) {
        let mut factor = [[0.0; FUNCTIONS]; FUNCTIONS];
        let mut columns = self.columns;
        let mut is_new = [false; FUNCTIONS];
        for k in 0..FUNCTIONS {
            let mut left = self.gram[k][k];
            for j in (0..k).filter(|j| is_new[*j]) {
                let known: f64 = (0..j).map(|i| factor[k][i] * factor[j][i]).sum();
                factor[k][j] = (self.gram[k][j] - known) / factor[j][j];
                left -= factor[k][j] * factor[k][j];
            }
            is_new[k] = NEW * self.gram[k][k] < left;
            let (before, rest) = columns.split_at_mut(k);
            let row = &mut rest[0];
            if !is_new[k] {
                *row = [0.0; COLUMNS];
                continue;
            }
            factor[k][k] = left.sqrt();
            for (by, other) in factor[k].iter().zip(&*before) {
                row.iter_mut().zip(other).for_each(|(x, o)| *x -= by * o);
            }
            row.iter_mut().for_each(|x| *x /= factor[k][k]);
        }
        (columns, is_new)
    }
}

/// Of the pixels: their mean, and one over how far they spread about it.
fn mean_and_scale(seen: &[Correspondence]) -> (Pixel, f64) {
    let mean = seen.iter().map(|c| c.pixel).sum::<Pixel>() / seen.len() as f64;
    let spread = seen.iter().map(|c| (c.pixel - mean).norm_squared()).sum::<f64>() / seen.len() as f64;
    (mean, 1.0 / spread.sqrt())
}

/// In the order of their degrees, so that `degree_of` tells them apart.
#[inline(always)]
fn polynomials(at: &Pixel, weight: f64) -> [f64; FUNCTIONS] {
    let (s, t) = (at.x, at.y);
    let (ss, st, tt) = (s * s, s * t, t * t);
    [1.0, s, t, ss, st, tt, ss * s, ss * t, s * tt, tt * t].map(|f| f * weight)
}

fn degree_of(function: usize) -> usize {
    [0, 1, 1, 2, 2, 2, 3, 3, 3, 3][function]
}

/// What the polynomials of one degree hold, those of lower degrees taken out.
#[derive(Clone, Copy)]
struct Degree {
    /// C_d.
    information: Matrix6,
    /// g_d.
    gradient: Vector6,
    /// e_d.
    chi2: f64,
    /// Functions times two coordinates.
    n: f64,
    /// n λ_d: the variance of one function, per θ.
    variance: f64,
}

/// Everything that the likelihood depends on; motions are scaled to their standard deviations.
struct Fit {
    degrees: [Degree; DEGREE + 1],
    information: Matrix6,
    inverse: Matrix6,
    scale: Vector6,
    chi2: f64,
    /// Residuals less unknowns.
    n: f64,
}

/// Of the noise, over the stated one, and of one function of each degree, whitened.
struct Variances {
    noise: f64,
    of_function: [f64; DEGREE + 1],
}

impl Fit {
    fn new(covariance: &Matrix6, chi2: f64, products: &Products, problem: &Problem) -> Option<Self> {
        let scale: Vector6 = covariance.diagonal().map(|x| x.sqrt());
        let inverse = covariance.component_div(&(scale * scale.transpose()));
        let information = inverse.cholesky()?.inverse();
        let of_all: f64 = (0..=DEGREE).map(|d| (d + 1) as f64 * DECAY.powi(d as i32)).sum();
        let zero = Degree {
            information: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            chi2: 0.0,
            n: 0.0,
            variance: 0.0,
        };
        let mut degrees = [zero; DEGREE + 1];
        let (columns, is_new) = products.orthonormal();
        for k in (0..FUNCTIONS).filter(|k| is_new[*k]) {
            let degree = &mut degrees[degree_of(k)];
            for (motion, residual) in [(0, 12), (6, 13)] {
                let by = Vector6::from_row_slice(&columns[k][motion..motion + 6]).component_mul(&scale);
                let e = columns[k][residual];
                degree.information += by * by.transpose();
                degree.gradient += by * e;
                degree.chi2 += e * e;
                degree.n += 1.0;
            }
        }
        for (d, degree) in degrees.iter_mut().enumerate() {
            degree.variance = problem.seen.len() as f64 * DECAY.powi(d as i32) / of_all;
        }
        let n = problem.degrees_of_freedom() as f64;
        Some(Fit { degrees, information, inverse, scale, chi2, n })
    }

    fn unscaled(&self, motion: &Matrix6) -> Matrix6 {
        motion.component_mul(&(self.scale * self.scale.transpose()))
    }

    /// Whether residuals along the polynomials exceed those across them at all: the derivative of the likelihood by θ at zero,
    /// docs/math/shared_error.md eq. (6). Where it falls there, nothing is proven farther off.
    fn grows(&self) -> bool {
        let noise = self.chi2 / self.n;
        let excess = |d: &Degree| {
            let absorbed = self.inverse.component_mul(&d.information).sum();
            d.variance * (d.chi2 - noise * (d.n - absorbed))
        };
        0.0 < self.degrees.iter().map(excess).sum()
    }

    /// Minus twice the logarithm of the restricted likelihood over that at θ = 0, the noise's variance integrated out, and the mean of
    /// that variance: docs/math/shared_error.md eqs. (4), (5).
    fn likelihood(&self, theta: f64) -> Option<(f64, f64)> {
        let (mut information, mut gradient) = (self.information, Vector6::zeros());
        let (mut chi2, mut log_determinant) = (self.chi2, 0.0);
        for degree in &self.degrees {
            let x = theta * degree.variance;
            let share = x / (1.0 + x);
            information -= degree.information * share;
            gradient -= degree.gradient * share;
            chi2 -= degree.chi2 * share;
            log_determinant += degree.n * (1.0 + x).ln();
        }
        let factor = information.cholesky()?;
        chi2 -= gradient.dot(&factor.solve(&gradient));
        log_determinant += 2.0 * factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum::<f64>();
        let cost = log_determinant + self.n * (chi2 / self.chi2).ln();
        (0.0 < chi2 && cost.is_finite()).then_some((cost, chi2 / (self.n - 2.0)))
    }

    /// Means over all amplitudes; none where the residuals do not prove that there is any, docs/math/shared_error.md eqs. (7), (8).
    fn variances(&self) -> Option<Variances> {
        if !self.grows() {
            return None;
        }
        let (none, noise) = self.likelihood(0.0)?;
        let mut sums = Variances { noise: 0.0, of_function: [0.0; DEGREE + 1] };
        let mut weight = 0.0;
        for k in 0..NODES {
            let theta = FIRST_NODE * 10f64.powf(0.5 * k as f64);
            let Some((cost, noise)) = self.likelihood(theta) else { continue };
            // Beyond e³⁰⁰ the single weights are no numbers any more, and what is compared is certain.
            let odds = (0.5 * (none - cost)).min(300.0).exp() * PRIOR / NODES as f64;
            weight += odds;
            sums.noise += odds * noise;
            for (sum, degree) in sums.of_function.iter_mut().zip(&self.degrees) {
                *sum += odds * noise * theta * degree.variance;
            }
        }
        let whole = weight + 1.0 - PRIOR;
        if !(PROVEN * whole <= weight) {
            return None;
        }
        sums.noise = (sums.noise + (1.0 - PRIOR) * noise) / whole;
        sums.of_function.iter_mut().for_each(|v| *v /= whole);
        Some(sums)
    }
}
