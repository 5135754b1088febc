//! Elliptic integrals in Carlson's symmetric form, and the arc of the pendulum between two of its states.
//!
//! ```text
//!   R_F(x, y, z) = ½ ∫₀^∞ dt / √((t+x)(t+y)(t+z))   ·   R_D(x, y, z) = (3/2) ∫₀^∞ dt / ((t+z) √((t+x)(t+y)(t+z)))
//!   sn, cn, dn Jacobi's functions of u with modulus k   ·   k′² = 1 − k², negative where k > 1
//!   D(u) = ∫₀^u sn² dv = (u − E(u))/k²
//! ```
//! No trigonometric function is called, nothing changes its form at k = 1, and small arguments lose nothing.
//! Derivation: docs/math/whisker_contact.md, sections 4 and 6.

/// Duplication stops where the arguments differ by less than this share of their mean: the eighth power of the
/// largest deviation, the first term the series below leave out, is then under 1e-16.
const SPREAD: f64 = 0.01;

/// Doublings before giving up: normal arguments take four or five, arguments of 1e-300 beside 1 take fifteen.
const MOST_ROUNDS: usize = 40;

/// `(R_F(x, y, z), R_D(x, y, z))`: at most one of x ≥ 0, y ≥ 0 zero, z > 0, otherwise not a number; whisker_contact.md eq. (16)–(19).
pub fn carlson(x: f64, y: f64, z: f64) -> (f64, f64) {
    let (mut x, mut y, mut z) = (x, y, z);
    let (mut power, mut sum) = (1.0, 0.0);
    for _ in 0..MOST_ROUNDS {
        let spread = x.max(y).max(z) - x.min(y).min(z);
        if 3.0 * spread <= SPREAD * (x + y + z) {
            return (power * series_f(x, y, z), 3.0 * sum + power * series_d(x, y, z));
        }
        let (rx, ry, rz) = (x.sqrt(), y.sqrt(), z.sqrt());
        let lambda = rx * (ry + rz) + ry * rz;
        sum += power / (rz * (z + lambda));
        power *= 2.0;
        (x, y, z) = (x + lambda, y + lambda, z + lambda);
    }
    (f64::NAN, f64::NAN)
}

/// R_F of nearly equal arguments, eq. (18).
fn series_f(x: f64, y: f64, z: f64) -> f64 {
    let mean = (x + y + z) / 3.0;
    let scale = 1.0 / mean;
    let (dx, dy) = (1.0 - x * scale, 1.0 - y * scale);
    let dz = -dx - dy;
    let e2 = dx * dy - dz * dz;
    let e3 = dx * dy * dz;
    let tail =
        1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 / 44.0 * e2 * e3 - 5.0 / 208.0 * e2 * e2 * e2
            + 3.0 / 104.0 * e3 * e3
            + e2 * e2 * e3 / 16.0;
    tail * scale.sqrt()
}

/// R_D of nearly equal arguments, eq. (19).
fn series_d(x: f64, y: f64, z: f64) -> f64 {
    let mean = (x + y + 3.0 * z) / 5.0;
    let scale = 1.0 / mean;
    let (dx, dy) = (1.0 - x * scale, 1.0 - y * scale);
    let dz = -(dx + dy) / 3.0;
    let (xy, zz) = (dx * dy, dz * dz);
    let e2 = xy - 6.0 * zz;
    let e3 = (3.0 * xy - 8.0 * zz) * dz;
    let e4 = 3.0 * (xy - zz) * zz;
    let e5 = xy * zz * dz;
    let tail =
        1.0 - 3.0 / 14.0 * e2 + e3 / 6.0 + 9.0 / 88.0 * e2 * e2 - 3.0 / 22.0 * e4 - 9.0 / 52.0 * e2 * e3
            + 3.0 / 26.0 * e5
            - e2 * e2 * e2 / 16.0
            + 3.0 / 40.0 * e3 * e3
            + 3.0 / 20.0 * e2 * e4
            + 45.0 / 272.0 * e2 * e2 * e3
            - 9.0 / 68.0 * (e3 * e4 + e2 * e5);
    tail * scale * scale.sqrt()
}

/// Jacobi's functions of one argument u; their modulus may exceed 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jacobi {
    /// sn u.
    pub sn: f64,
    /// cn u.
    pub cn: f64,
    /// dn u.
    pub dn: f64,
    /// k².
    pub k2: f64,
    /// k′² = 1 − k², given apart because the difference would cancel.
    pub complement2: f64,
}

impl Jacobi {
    /// `(u, D(u))` for u in [0, 4K) where k < 1 and in [0, 2K(1/k)/k) where k > 1; eq. (28).
    pub fn argument_and_d(&self) -> (f64, f64) {
        let half = self.halved();
        let (u, d) = half.up_to_two_k();
        // D(2v) = 2 D(v) + sn(2v) sn² v
        (2.0 * u, 2.0 * d + self.sn * half.sn * half.sn)
    }

    /// The functions of u/2, eq. (28), (29): each sign case in the form that does not cancel.
    fn halved(&self) -> Jacobi {
        let Jacobi { sn, cn, dn, k2, complement2 } = *self;
        let (sn2, cn2, dn2) = if cn < 0.0 {
            let below = (dn - cn) * (1.0 + dn);
            let cn2 = complement2 * sn * sn / below;
            ((1.0 - cn) / (1.0 + dn), cn2, complement2 * (1.0 - cn) / (dn - cn))
        } else if dn < 0.0 {
            let turned = -complement2 / (cn - dn);
            let dn2 = turned * sn * sn / (1.0 + cn);
            ((1.0 - dn) / (k2 * (1.0 + cn)), turned * (1.0 - dn) / k2, dn2)
        } else {
            (sn * sn / ((1.0 + cn) * (1.0 + dn)), (cn + dn) / (1.0 + dn), (cn + dn) / (1.0 + cn))
        };
        // Beyond 2K the half argument lies beyond K, where cn is negative.
        let cn_sign = if sn < 0.0 { -1.0 } else { 1.0 };
        Jacobi { sn: sn2.sqrt(), cn: cn_sign * cn2.sqrt(), dn: dn2.sqrt(), k2, complement2 }
    }

    /// For u in [0, 2K): one duplication with signed roots where cn < 0, eq. (16), (17).
    fn up_to_two_k(&self) -> (f64, f64) {
        let Jacobi { sn, cn, dn, .. } = *self;
        if 0.0 <= cn {
            let (f, d) = carlson(cn * cn, dn * dn, 1.0);
            return (sn * f, sn * sn * sn * d / 3.0);
        }
        let above = sn * sn / (1.0 - cn);
        let together = self.complement2 * sn * sn / (dn - cn);
        let (f, d) = carlson(together * above, together * (1.0 + dn), above * (1.0 + dn));
        (2.0 * sn * f, sn * sn * sn * (2.0 / 3.0 * d + 1.0 / (above * (1.0 + dn))))
    }
}
