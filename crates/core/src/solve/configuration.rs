//! Which configuration do the points form? Decided before solving.

use crate::{Correspondence, Error};

/// How the target points lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Configuration {
    /// Exactly three points, not on a line.
    Three,
    /// Four points, three of them collinear: indices of those in order along the line, then the one off it.
    LinePlusOne {
        /// See above.
        order: [usize; 4],
    },
    /// At least four points in one plane.
    Planar,
    /// Anything else.
    General,
}

const FLAT: f64 = 1e-6;

/// Classifies, or says what is wrong with the points.
pub fn classify(seen: &[Correspondence]) -> Result<Configuration, Error> {
    let n = seen.len();
    if n < 3 {
        return Err(Error::TooFewPoints { seen: n, needed: 3 });
    }
    for (index, c) in seen.iter().enumerate() {
        if !c.x_in_target.iter().chain(&c.pixel).all(|x| x.is_finite()) {
            return Err(Error::NotFinite { what: "a coordinate", index });
        }
        if !(0.0 < c.sigma_px) {
            return Err(Error::NotPositive { index, seen: c.sigma_px });
        }
    }
    let x = |i: usize| seen[i].x_in_target;
    let scale = (1..n).map(|i| (x(i) - x(0)).norm()).fold(0.0, f64::max);
    for i in 0..n {
        for j in i + 1..n.min(i + 64) {
            if (x(i) - x(j)).norm() <= 1e-9 * scale {
                return Err(Error::Coincident { first: i, second: j, where_: "in the target" });
            }
        }
    }
    let collinear = |i: usize, j: usize, k: usize| {
        let (a, b, c) = (x(j) - x(i), x(k) - x(i), x(k) - x(j));
        let l = a.norm().max(b.norm()).max(c.norm());
        a.cross(&b).norm() / (l * l) < FLAT
    };
    if n == 4 {
        for off in 0..4 {
            let mut line = [0usize; 3];
            let mut m = 0;
            for i in 0..4 {
                if i != off {
                    line[m] = i;
                    m += 1;
                }
            }
            if collinear(line[0], line[1], line[2]) {
                if collinear(line[0], line[1], off) {
                    return Err(Error::Collinear { ratio: 0.0, needed: FLAT });
                }
                let far = |i: usize, j: usize| (x(i) - x(j)).norm();
                let (d01, d02, d12) = (far(line[0], line[1]), far(line[0], line[2]), far(line[1], line[2]));
                let order = if d02 >= d01 && d02 >= d12 {
                    [line[0], line[1], line[2], off]
                } else if d01 >= d12 {
                    [line[0], line[2], line[1], off]
                } else {
                    [line[1], line[0], line[2], off]
                };
                return Ok(Configuration::LinePlusOne { order });
            }
        }
    }
    let k = (1..n).max_by(|a, b| (x(*a) - x(0)).norm().total_cmp(&(x(*b) - x(0)).norm())).unwrap_or(1);
    let area = |i: usize| (x(i) - x(0)).cross(&(x(k) - x(0))).norm();
    let m = (1..n).max_by(|a, b| area(*a).total_cmp(&area(*b))).unwrap_or(2);
    if area(m) / (scale * scale) < FLAT {
        return Err(Error::Collinear { ratio: area(m) / (scale * scale), needed: FLAT });
    }
    if n == 3 {
        return Ok(Configuration::Three);
    }
    let normal = (x(k) - x(0)).cross(&(x(m) - x(0))).normalize();
    let flat = (0..n).all(|i| (x(i) - x(0)).dot(&normal).abs() < FLAT * scale);
    Ok(if flat { Configuration::Planar } else { Configuration::General })
}
