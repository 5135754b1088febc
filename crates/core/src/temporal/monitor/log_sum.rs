//! Sums of numbers that are known by their logarithms: a gross change has a likelihood ratio beyond any number.

/// f eˣ: what has a small factor beside a large exponent, a likelihood ratio, say, needs no logarithm of its own to be added up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scaled {
    /// x.
    pub exponent: f64,
    /// f, positive.
    pub factor: f64,
}

impl Scaled {
    /// x + ln f.
    pub fn ln(&self) -> f64 {
        self.exponent + self.factor.ln()
    }
}

impl From<f64> for Scaled {
    /// eˣ.
    fn from(exponent: f64) -> Self {
        Scaled { exponent, factor: 1.0 }
    }
}

/// ln Σ f eˣ, term by term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LogSum {
    /// The largest x.
    peak: f64,
    /// Σ f e^(x − peak): no term is larger than its factor, so that nothing overflows.
    sum: f64,
}

impl LogSum {
    pub fn of<T: Into<Scaled>>(terms: impl IntoIterator<Item = T>) -> Self {
        let mut sum = LogSum::nothing();
        terms.into_iter().for_each(|term| sum.add(term.into()));
        sum
    }

    /// Of no terms.
    pub fn nothing() -> Self {
        LogSum { peak: f64::NEG_INFINITY, sum: 0.0 }
    }

    /// What is no number says nothing.
    pub fn add(&mut self, Scaled { exponent, factor }: Scaled) {
        let x = if exponent == f64::INFINITY { f64::MAX } else { exponent };
        if self.peak < x {
            self.sum = self.sum * (self.peak - x).exp() + factor;
            self.peak = x;
        } else if f64::NEG_INFINITY < x {
            self.sum += factor * (x - self.peak).exp();
        }
    }

    /// −∞ of no terms.
    pub fn ln(&self) -> f64 {
        self.peak + self.sum.ln()
    }
}

#[cfg(test)]
mod tests {
    use super::{LogSum, Scaled};

    #[test]
    fn sums_are_right_at_any_size() {
        let plain = LogSum::of([0.0, 2.0_f64.ln(), 3.0_f64.ln()]).ln();
        assert!((plain - 6.0_f64.ln()).abs() < 1e-15, "{plain}");
        for at in [-1e6, 1e6] {
            let far = LogSum::of([at, at + 1.0, at - 900.0]).ln();
            assert!((far - at - (1.0 + 1.0_f64.exp()).ln()).abs() < 1e-9, "{far}");
        }
        assert_eq!(LogSum::of([0.0; 0]).ln(), f64::NEG_INFINITY);
        assert_eq!(LogSum::of([f64::NAN, 5.0, f64::NEG_INFINITY]).ln(), 5.0);
        assert!(LogSum::of([f64::INFINITY, f64::INFINITY]).ln().is_finite());
    }

    #[test]
    fn factors_count_as_their_logarithms() {
        let terms = [(900.0, 1e-9), (880.0, 0.5), (-3.0, 1.0), (910.0, 1e-14)];
        let scaled = LogSum::of(terms.map(|(exponent, factor)| Scaled { exponent, factor })).ln();
        let plain = LogSum::of(terms.map(|(exponent, factor): (f64, f64)| exponent + factor.ln())).ln();
        assert!((scaled - plain).abs() < 1e-12, "{scaled} {plain}");
    }
}
