//! Sums of numbers that are known by their logarithms: a gross change has a likelihood ratio beyond any number.

/// ln Σ eˣ, term by term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LogSum {
    /// The largest x.
    peak: f64,
    /// Σ e^(x − peak): between one and the count of terms, so that nothing overflows.
    sum: f64,
}

impl LogSum {
    pub fn of(terms: impl IntoIterator<Item = f64>) -> Self {
        let mut sum = LogSum { peak: f64::NEG_INFINITY, sum: 0.0 };
        terms.into_iter().for_each(|x| sum.add(x));
        sum
    }

    /// What is no number says nothing.
    fn add(&mut self, x: f64) {
        let x = if x == f64::INFINITY { f64::MAX } else { x };
        if self.peak < x {
            self.sum = self.sum * (self.peak - x).exp() + 1.0;
            self.peak = x;
        } else if f64::NEG_INFINITY < x {
            self.sum += (x - self.peak).exp();
        }
    }

    /// −∞ of no terms.
    pub fn ln(&self) -> f64 {
        self.peak + self.sum.ln()
    }
}

#[cfg(test)]
mod tests {
    use super::LogSum;

    #[test]
    fn sums_are_right_at_any_size() {
        let plain = LogSum::of([0.0, 2.0_f64.ln(), 3.0_f64.ln()]).ln();
        assert!((plain - 6.0_f64.ln()).abs() < 1e-15, "{plain}");
        for at in [-1e6, 1e6] {
            let far = LogSum::of([at, at + 1.0, at - 900.0]).ln();
            assert!((far - at - (1.0 + 1.0_f64.exp()).ln()).abs() < 1e-9, "{far}");
        }
        assert_eq!(LogSum::of([]).ln(), f64::NEG_INFINITY);
        assert_eq!(LogSum::of([f64::NAN, 5.0, f64::NEG_INFINITY]).ln(), 5.0);
        assert!(LogSum::of([f64::INFINITY, f64::INFINITY]).ln().is_finite());
    }
}
