//! Functions k₀ + k₁ cos φ + k₂ sin φ on an arc of φ, as quadratics of a parameter s in [0, 1].
//!
//! On the arc φ₀ ± ψ the direction is (cos φ, sin φ) = (a t² + 2 m s t + b s²)/w, t = 1 − s, w = t² + 2 cos ψ s t + s² > 0,
//! with a and b its ends
//! and m its middle: products of such functions, times powers of w, are Bernstein polynomials with the same zeros.
//! Derivation: docs/math/gp3p.md eq. (9).

use arrayvec::ArrayVec;
use nalgebra::Vector2;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// k₀ + k₁ cos φ + k₂ sin φ.
#[derive(Debug, Clone, Copy)]
pub struct Wave(pub [f64; 3]);

impl Wave {
    /// Its value at the direction (cos φ, sin φ).
    #[inline(always)]
    pub fn at(&self, direction: &Vector2<f64>) -> f64 {
        self.0[0] + self.0[1] * direction.x + self.0[2] * direction.y
    }

    /// Its derivative by φ there.
    #[inline(always)]
    pub fn slope(&self, direction: &Vector2<f64>) -> f64 {
        self.0[2] * direction.x - self.0[1] * direction.y
    }
}

/// An arc of φ, shorter than a circle: from the direction `start` counterclockwise to `end`.
#[derive(Debug, Clone, Copy)]
pub struct Arc {
    start: Vector2<f64>,
    middle: Vector2<f64>,
    end: Vector2<f64>,
    cos_half: f64,
}

impl Arc {
    /// From two different unit vectors.
    #[inline]
    pub fn new(start: Vector2<f64>, end: Vector2<f64>) -> Self {
        // The chord is 2 sin ψ (−sin φ₀, cos φ₀): also for half a circle, where the sum of the ends vanishes.
        let chord = end - start;
        let middle = Vector2::new(chord.y, -chord.x) / chord.norm();
        Arc { start, middle, end, cos_half: middle.dot(&start) }
    }

    /// Coefficients of t², s t, s² of w times the function.
    #[inline(always)]
    pub fn quadratic(&self, wave: &Wave) -> [f64; 3] {
        let [k0, k1, k2] = wave.0;
        let middle = k0 * self.cos_half + k1 * self.middle.x + k2 * self.middle.y;
        [wave.at(&self.start), 2.0 * middle, wave.at(&self.end)]
    }

    /// The direction (cos φ, sin φ) at the parameter s.
    #[inline]
    pub fn direction(&self, s: f64) -> Vector2<f64> {
        let t = 1.0 - s;
        let sum = self.start * (t * t) + self.middle * (2.0 * s * t) + self.end * (s * s);
        sum / sum.norm()
    }
}

/// A set of φ made of disjoint arcs.
pub type Arcs = ArrayVec<Arc, 4>;

/// An arc with a half-width of more than 135° is halved: its parameter would run too unevenly.
const WIDEST: f64 = -0.7;

#[inline]
fn push(arcs: &mut Arcs, start: Vector2<f64>, end: Vector2<f64>) {
    let arc = Arc::new(start, end);
    if arc.cos_half < WIDEST {
        arcs.push(Arc::new(start, arc.middle));
        arcs.push(Arc::new(arc.middle, end));
    } else {
        arcs.push(arc);
    }
}

/// First and last direction with sin φ > `least` (below 1); none where every φ has it.
#[inline]
fn ends(least: f64) -> Option<[Vector2<f64>; 2]> {
    let half_chord = ((1.0 - least) * (1.0 + least)).sqrt();
    (-1.0 < least).then(|| [Vector2::new(half_chord, least), Vector2::new(-half_chord, least)])
}

/// Bounds that coincide up to rounding count as overlapping.
const TOUCHING: f64 = 1e-12;

/// All φ with sin φ > `least` and sin(φ − γ) > `least_turned`; `turn` = (cos γ, sin γ). Where bounds coincide, some φ beyond
/// them may be
/// held too, or some held twice.
pub fn arcs_above(least: f64, least_turned: f64, turn: &Vector2<f64>) -> Arcs {
    let mut arcs = Arcs::new();
    let is_possible = least < 1.0 && least_turned < 1.0;
    if !is_possible {
        return arcs;
    }
    let turned = |d: Vector2<f64>| Vector2::new(turn.x * d.x - turn.y * d.y, turn.y * d.x + turn.x * d.y);
    let in_first = |d: &Vector2<f64>| least - TOUCHING < d.y;
    let in_second = |d: &Vector2<f64>| least_turned - TOUCHING < turn.x * d.y - turn.y * d.x;
    match (ends(least), ends(least_turned).map(|ends| ends.map(turned))) {
        (None, None) => {
            let (right, left) = (Vector2::new(1.0, 0.0), Vector2::new(-1.0, 0.0));
            push(&mut arcs, right, left);
            push(&mut arcs, left, right);
        }
        (Some([start, end]), None) | (None, Some([start, end])) => push(&mut arcs, start, end),
        (Some([start1, end1]), Some([start2, end2])) => {
            let starts_in = (in_second(&start1), in_first(&start2));
            let first_end = if in_second(&end1) { end1 } else { end2 };
            match starts_in {
                // Two wide arcs overlap at both ends.
                (true, true) => {
                    push(&mut arcs, start1, end2);
                    push(&mut arcs, start2, end1);
                }
                (true, false) => push(&mut arcs, start1, first_end),
                (false, true) => push(&mut arcs, start2, first_end),
                (false, false) => {}
            }
        }
    }
    arcs
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    fn direction(angle_rad: f64) -> Vector2<f64> {
        Vector2::new(angle_rad.cos(), angle_rad.sin())
    }

    /// The parameter runs through exactly the arc, and the quadratic is w times the function, w > 0 up to half-widths of 135°.
    #[test]
    fn quadratic_is_the_function_on_the_arc() {
        let wave = Wave([0.3, -1.2, 0.7]);
        for (from, to) in [(0.2, 1.0), (-1.5, 1.6), (2.0, 2.0 + 4.6), (1.0, 1.0 + core::f64::consts::PI)] {
            let arc = Arc::new(direction(from), direction(to));
            let [a, b, c] = arc.quadratic(&wave);
            let [wa, wb, wc] = arc.quadratic(&Wave([1.0, 0.0, 0.0]));
            for i in 0..=20 {
                let s = f64::from(i) / 20.0;
                let t = 1.0 - s;
                let w = wa * t * t + wb * s * t + wc * s * s;
                let value = (a * t * t + b * s * t + c * s * s) / w;
                assert!(0.0 < w && (value - wave.at(&arc.direction(s))).abs() < 1e-13, "{from} {to} {s}");
                let passed = (arc.direction(s).y.atan2(arc.direction(s).x) - from).rem_euclid(TAU);
                assert!(passed < to - from + 1e-9 || TAU - 1e-9 < passed, "{from} {to} {s}: {passed}");
            }
        }
    }

    /// A direction is on one of the arcs exactly when both conditions hold: on a grid of bounds, turns and directions.
    #[test]
    fn arcs_hold_what_the_conditions_say() {
        let bounds = [-7.0, -0.99, -0.7, -0.2, 0.0, 0.3, 0.9, 1.5];
        for (least, least_turned) in bounds.iter().flat_map(|a| bounds.map(|b| (*a, b))) {
            for rotation_rad in [0.1, 0.9, 1.7, 3.0] {
                let arcs = arcs_above(least, least_turned, &direction(rotation_rad));
                for i in 0..97 {
                    let angle = TAU * f64::from(i) / 97.0 + 0.001;
                    let wanted = least < angle.sin() && least_turned < (angle - rotation_rad).sin();
                    let within = |arc: &Arc| {
                        let place = |d: &Vector2<f64>| d.y.atan2(d.x);
                        let length = (place(&arc.end) - place(&arc.start)).rem_euclid(TAU);
                        (angle - place(&arc.start)).rem_euclid(TAU) < length
                    };
                    let count = arcs.iter().filter(|arc| within(arc)).count();
                    assert_eq!(count, usize::from(wanted), "{least} {least_turned} {rotation_rad} {angle}");
                }
            }
        }
    }
}
