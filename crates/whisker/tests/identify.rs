//! Identification on the recorded sets.

mod real_support;

use real_support::{Set, sets};
use resight_whisker::contact::Method;
use resight_whisker::friction::record::{Mu, solve_record};
use resight_whisker::identify::{Config, Touch, identify};

fn touches(set: &Set, sweeps: &[u32]) -> Vec<Touch> {
    let samples: Vec<_> = set.noisy.iter().filter(|s| sweeps.contains(&s.sweep)).copied().collect();
    let record = solve_record(&set.rod, &set.cell, &samples, Mu::Auto, Method::Auto).unwrap();
    let mut list = Vec::new();
    for (sample, e) in samples.iter().zip(&record.estimates) {
        list.extend(Touch::from_estimate(sample.sweep, sample.load.mz_n_m, e, &set.rod));
    }
    list
}

#[test]
fn print_sets() {
    let Some(sets) = sets() else { return };
    for set in &sets {
        for sweeps in [&[0, 1, 2][..], &[0], &[1], &[2]] {
            let list = touches(set, sweeps);
            let begin = std::time::Instant::now();
            let found = identify(&list, &Config::default()).unwrap();
            let ms = begin.elapsed().as_secs_f64() * 1e3;
            println!(
                "{} {sweeps:?} n {} {:?} {:?} chi2/dof {:.2} {ms:.1} ms",
                set.name,
                list.len(),
                found.verdict,
                found.reason,
                found.chi2_per_dof
            );
            for p in &found.parameters {
                print!("  {} {:.5}±{:.5}", p.name, p.value, p.sigma);
            }
            println!("\n   {:?}", found.coverage);
            for s in &found.scores {
                println!(
                    "     {:?} k {} chi2 {:.1} {:.2} out {} bic {:.1}",
                    s.model, s.n_parameters, s.chi2, s.chi2_per_dof, s.n_outliers, s.bic
                );
            }
        }
    }
}
