//! Quantiles, and the bars that they are held to.

use std::process::ExitCode;

/// Microseconds, counted in bins of 1 %: an hour of frames takes no more memory than a minute.
pub struct Quantiles {
    counts: Vec<u64>,
    n: u64,
    pub max_us: f64,
}

/// Bins of 1 % from 10 ns on.
const FIRST_US: f64 = 0.01;
const RATIO: f64 = 1.01;
const BINS: usize = 3000;

impl Default for Quantiles {
    fn default() -> Self {
        Quantiles { counts: vec![0; BINS], n: 0, max_us: 0.0 }
    }
}

impl Quantiles {
    pub fn add(&mut self, us: f64) {
        let bin = ((us / FIRST_US).max(1.0).ln() / RATIO.ln()) as usize;
        self.counts[bin.min(BINS - 1)] += 1;
        self.n += 1;
        self.max_us = self.max_us.max(us);
    }

    /// The time that this share of all stays below, rounded up to its bin.
    pub fn at(&self, share: f64) -> f64 {
        let needed = (share * self.n as f64).ceil() as u64;
        let mut seen = 0;
        let bin = self.counts.iter().position(|count| {
            seen += count;
            needed <= seen
        });
        bin.map_or(0.0, |bin| (FIRST_US * RATIO.powi(bin as i32 + 1)).min(self.max_us))
    }

    pub fn row(&self, name: &str) {
        let [p50, p99, max] = [self.at(0.5), self.at(0.99), self.max_us].map(|us| us * 1e-3);
        println!("  {name:<16} p50 {p50:9.3} ms   p99 {p99:9.3} ms   max {max:9.3} ms");
    }
}

/// What was promised, and whether it was kept.
#[derive(Default)]
pub struct Bars {
    missed: Vec<String>,
}

impl Bars {
    pub fn at_most(&mut self, name: &str, seen: f64, bar: f64, unit: &str) {
        let is_kept = seen <= bar;
        println!(
            "  {} {name}: {seen:.3} {unit} (bar {bar} {unit})",
            if is_kept { "kept  " } else { "MISSED" }
        );
        if !is_kept {
            self.missed.push(name.to_string());
        }
    }

    pub fn verdict(&self) -> ExitCode {
        match self.missed.is_empty() {
            true => ExitCode::SUCCESS,
            false => {
                println!("\nmissed: {}", self.missed.join(", "));
                ExitCode::FAILURE
            }
        }
    }
}
