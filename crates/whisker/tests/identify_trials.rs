//! Simulated trials.
mod identify_support;

use identify_support::{Chance, constrained, object, readings};
use resight_whisker::Shape;
use resight_whisker::identify::{Class, Config, Identification, Verdict, identify};

fn errors(found: &Identification, truth: &Shape) -> Vec<(&'static str, f64, f64)> {
    let value = |name: &str| {
        found
            .parameters
            .iter()
            .find(|p| p.name == name)
            .map(|p| (p.value, p.sigma))
            .unwrap_or((f64::NAN, f64::NAN))
    };
    let e = |name: &'static str, truth: f64| {
        let (v, s) = value(name);
        (name, v - truth, s)
    };
    let turn = |a: f64, period: f64| a - period * (a / period).round();
    let pi = std::f64::consts::PI;
    match truth {
        Shape::Circle { centre_m, radius_m } => {
            vec![e("centre_x_m", centre_m.x), e("centre_y_m", centre_m.y), e("radius_m", *radius_m)]
        }
        Shape::Ellipse { centre_m, semi_axes_m, angle_rad } => {
            let (_, a, s) = e("angle_rad", *angle_rad);
            vec![
                e("centre_x_m", centre_m.x),
                e("centre_y_m", centre_m.y),
                e("semi_axis_a_m", semi_axes_m[0]),
                e("semi_axis_b_m", semi_axes_m[1]),
                ("angle_rad", turn(a, pi), s),
            ]
        }
        Shape::Rectangle { centre_m, sides_m, angle_rad } if sides_m[0] == sides_m[1] => {
            let (_, a, s) = e("angle_rad", *angle_rad);
            vec![
                e("centre_x_m", centre_m.x),
                e("centre_y_m", centre_m.y),
                e("side_m", sides_m[0]),
                ("angle_rad", turn(a, 0.5 * pi), s),
            ]
        }
        Shape::Rectangle { centre_m, sides_m, angle_rad } => {
            let (_, a, s) = e("angle_rad", *angle_rad);
            vec![
                e("centre_x_m", centre_m.x),
                e("centre_y_m", centre_m.y),
                e("side_a_m", sides_m[0]),
                e("side_b_m", sides_m[1]),
                ("angle_rad", turn(a, pi), s),
            ]
        }
        Shape::Polygon { .. } => vec![],
    }
}

#[test]
fn trials() {
    let n: u32 = std::env::var("TRIALS").ok().and_then(|t| t.parse().ok()).unwrap_or(3);
    let verbose = std::env::var_os("VERBOSE").is_some();
    let mut chance = Chance(1);
    let config = Config::default();
    for class in [Class::Circle, Class::Ellipse, Class::Square, Class::Rectangle, Class::Polygon] {
        for mu in [0.0, 0.3] {
            let begin = std::time::Instant::now();
            let (mut sim, mut ident) = (0.0, 0.0);
            let mut tally = [[0_u32; 3]; 4];
            let mut sums: Vec<(&str, f64, f64, f64)> = Vec::new();
            let mut failed = 0;
            for trial in 0..n {
                let truth = object(class, &mut chance);
                let t0 = std::time::Instant::now();
                let sweeps = match readings(&truth, mu) {
                    Ok(s) => s,
                    Err(e) => {
                        if verbose {
                            println!("   sim: {e}");
                        }
                        failed += 1;
                        continue;
                    }
                };
                sim += t0.elapsed().as_secs_f64();
                for (k, which) in [&[0, 1, 2][..], &[0], &[1], &[2]].iter().enumerate() {
                    let samples: Vec<_> = which.iter().flat_map(|i: &usize| sweeps[*i].clone()).collect();
                    let touches = constrained(&samples, u64::from(trial) * 7 + k as u64);
                    let t0 = std::time::Instant::now();
                    let found = identify(&touches, &config).unwrap();
                    ident += t0.elapsed().as_secs_f64();
                    let outcome = match found.verdict {
                        Verdict::Is(c) if c == class => 0,
                        Verdict::Is(_) => 1,
                        _ => 2,
                    };
                    tally[k][outcome] += 1;
                    if verbose && (outcome == 1 || k == 0 && outcome != 0) {
                        println!(
                            "   {class:?} mu {mu} trial {trial} sweeps {which:?}: {:?} {:?} {:?}",
                            found.verdict, found.reason, truth
                        );
                        for s in found.scores.iter().take(6) {
                            println!(
                                "        {:?} chi2 {:.1} {:.2} out {} bic {:.1}",
                                s.model, s.chi2, s.chi2_per_dof, s.n_outliers, s.bic
                            );
                        }
                        println!("        {:?}", found.shape);
                    }
                    if k == 0 && outcome == 0 {
                        for (i, (name, error, sigma)) in errors(&found, &truth).into_iter().enumerate() {
                            if sums.len() <= i {
                                sums.push((name, 0.0, 0.0, 0.0));
                            }
                            sums[i].1 += error * error;
                            sums[i].2 += (error / sigma).powi(2);
                            sums[i].3 = error.abs().max(sums[i].3);
                        }
                    }
                }
            }
            println!(
                "{class:?} mu {mu}: right/wrong/insufficient 3 sweeps {:?} singles {:?}, sim failed {failed}; {:.1} s (sim {sim:.1}, identify {ident:.2})",
                tally[0],
                &tally[1..],
                begin.elapsed().as_secs_f64()
            );
            let right = f64::from(tally[0][0].max(1));
            for (name, e2, z2, worst) in &sums {
                print!("   {name} rms {:.1e} worst {worst:.1e} nees {:.2}", (e2 / right).sqrt(), z2 / right);
            }
            println!();
        }
    }
}
