//! Legendre's incomplete elliptic integrals by the arithmetic–geometric mean.
//!
//!   F(φ, k) = ∫₀^φ dt / √(1 − k² sin² t)   ·   E(φ, k) = ∫₀^φ √(1 − k² sin² t) dt   ·   k′ = √(1 − k²)

/// `(F, E)` at amplitude φ ≥ 0, radians, for the modulus given by its square k² < 1 and its complement k′.
pub fn incomplete(phi: f64, k2: f64, k_complement: f64) -> (f64, f64) {
    let (mut a, mut b, mut angle) = (1.0_f64, k_complement, phi);
    let (mut power, mut sum_c2, mut sum_sin) = (0.5, 0.5 * k2, 0.0);
    loop {
        let c = 0.5 * (a - b);
        // tan(φₙ₊₁ − φₙ) = (b/a) tan φₙ, on the branch next to φₙ.
        let turns = (angle / std::f64::consts::PI).round();
        let (sin, cos) = (angle - turns * std::f64::consts::PI).sin_cos();
        angle += (b * sin).atan2(a * cos) + turns * std::f64::consts::PI;
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        power *= 2.0;
        sum_c2 += power * c * c;
        sum_sin += c * angle.sin();
        // The mean converges quadratically: the next c would be below 1e-17 a.
        if c.abs() <= 1e-8 * a {
            break;
        }
    }
    let f = angle / (2.0 * power * a);
    (f, f * (1.0 - sum_c2) + sum_sin)
}
