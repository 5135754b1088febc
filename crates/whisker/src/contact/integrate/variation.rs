//! The derivatives of the whisker's shape with respect to the load: the variational equations, docs/math/whisker_integrate.md eqs. (9), (10).

use super::piece::Piece;
use super::series::{Coefficients, ORDER, RECIPROCAL, Series};
use nalgebra::RowVector4;

/// Derivatives of α, M and p at fixed s by α at the clamp, the moment there, the force, and curvature added everywhere.
pub(super) struct Variation {
    pub alpha: RowVector4<f64>,
    pub moment: RowVector4<f64>,
    pub p: RowVector4<f64>,
}

/// One coefficient of the four columns.
type Lanes = [f64; 4];

impl Variation {
    /// At the clamp.
    pub fn identity() -> Self {
        Variation {
            alpha: RowVector4::new(1.0, 0.0, 0.0, 0.0),
            moment: RowVector4::new(0.0, 1.0, 0.0, 0.0),
            p: RowVector4::zeros(),
        }
    }

    /// Carried along the series to t: δα′ = δκ₀ + δM/EI · δM′ = F cos α δα + δF sin α · δp′ = −sin α δα.
    pub fn advance(&mut self, series: &Series, piece: &Piece, force: f64, t: f64) {
        let (mut moment, mut power): (Lanes, f64) = (self.moment.into(), 1.0);
        let mut alpha = [[0.0; 4]; ORDER + 1];
        alpha[0] = self.alpha.into();
        let mut quotients = [[0.0; 4]; 4];
        for n in 0..ORDER {
            let share = RECIPROCAL[n + 1];
            power *= t;
            let [by_cos, by_sin] = products(&alpha, &series.cos, &series.sin, n);
            let bend = divided(&mut quotients, moment, piece.narrowing);
            for lane in 0..4 {
                alpha[n + 1][lane] = piece.compliance * bend[lane] * share;
                moment[lane] = force * by_cos[lane] * share;
            }
            moment[2] += series.sin[n] * share;
            if n == 0 {
                alpha[1][3] += 1.0;
            }
            for column in 0..4 {
                self.alpha[column] += alpha[n + 1][column] * power;
                self.moment[column] += moment[column] * power;
                self.p[column] -= by_sin[column] * share * power;
            }
        }
    }
}

/// The next coefficient of the moment over (1 − ρt)⁴, as in `series::Bending`.
#[inline]
fn divided(quotients: &mut [Lanes; 4], moment: Lanes, narrowing: f64) -> Lanes {
    let mut carried = moment;
    for quotient in quotients {
        for lane in 0..4 {
            carried[lane] += narrowing * quotient[lane];
        }
        *quotient = carried;
    }
    carried
}

/// The coefficients n of `left × a` and `left × b`.
#[inline]
fn products(left: &[Lanes; ORDER + 1], a: &Coefficients, b: &Coefficients, n: usize) -> [Lanes; 2] {
    let mut sums = [[0.0; 4]; 2];
    for (lanes, (a, b)) in left[..=n].iter().zip(a[..=n].iter().rev().zip(b[..=n].iter().rev())) {
        for lane in 0..4 {
            sums[0][lane] += lanes[lane] * a;
            sums[1][lane] += lanes[lane] * b;
        }
    }
    sums
}
