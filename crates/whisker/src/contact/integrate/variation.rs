//! How the whisker moves with the load: the variational equations, docs/math/whisker_integrate.md eqs. (9), (10).

use super::piece::Piece;
use super::series::{Bending, ORDER, RECIPROCAL, Series};
use nalgebra::RowVector3;

/// Derivatives of α, M and p at fixed s by α at the clamp, the moment there and the force.
pub(super) struct Variation {
    pub alpha: RowVector3<f64>,
    pub moment: RowVector3<f64>,
    pub p: RowVector3<f64>,
}

impl Variation {
    /// At the clamp.
    pub fn identity() -> Self {
        Variation {
            alpha: RowVector3::new(1.0, 0.0, 0.0),
            moment: RowVector3::new(0.0, 1.0, 0.0),
            p: RowVector3::zeros(),
        }
    }

    /// Carried along the series to t.
    pub fn advance(&mut self, series: &Series, piece: &Piece, force: f64, t: f64) {
        for column in 0..3 {
            let by_force = if column == 2 { 1.0 } else { 0.0 };
            let start = [self.alpha[column], self.moment[column], self.p[column]];
            [self.alpha[column], self.moment[column], self.p[column]] =
                column_at(series, piece, [force, by_force], start, t);
        }
    }
}

/// δα′ = δM/EI · δM′ = F cos α δα + δF sin α · δp′ = −sin α δα
fn column_at(
    series: &Series,
    piece: &Piece,
    [force, by_force]: [f64; 2],
    start: [f64; 3],
    t: f64,
) -> [f64; 3] {
    let mut alpha = [0.0; ORDER + 1];
    let [mut alpha_at, mut moment_at, mut p_at] = start;
    alpha[0] = start[0];
    let (mut bent, mut moment, mut power) = (Bending::new(piece), start[1], 1.0);
    for n in 0..ORDER {
        let share = RECIPROCAL[n + 1];
        let [by_cos, by_sin] = super::series::product(&alpha, &series.cos, &series.sin, n);
        alpha[n + 1] = bent.next(moment) * share;
        moment = (force * by_cos + by_force * series.sin[n]) * share;
        power *= t;
        alpha_at += alpha[n + 1] * power;
        moment_at += moment * power;
        p_at -= by_sin * share * power;
    }
    [alpha_at, moment_at, p_at]
}
