//! The lowest value of a function of one number.

/// Refines a minimum between `middle` ± `width` by golden section: each step leaves 0.618 of the range. Returns (lowest value, where).
pub(crate) fn golden_section(middle: f64, width: f64, steps: usize, f: impl Fn(f64) -> f64) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let (mut low, mut high) = (middle - width, middle + width);
    let (mut a, mut b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut at_a, mut at_b) = (f(a), f(b));
    for _ in 0..steps {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - GOLDEN * (high - low);
            at_a = f(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + GOLDEN * (high - low);
            at_b = f(b);
        }
    }
    if at_a < at_b { (at_a, a) } else { (at_b, b) }
}
