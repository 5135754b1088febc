//! Simulated trials.
mod identify_support;

use identify_support::{Chance, How, felt, object, readings};
use resight_whisker::Shape;
use resight_whisker::friction::Mu;
use resight_whisker::identify::{Class, Config, Identification, Verdict, identify};

fn errors(found: &Identification, truth: &Shape) -> Vec<(&'static str, f64, f64)> {
    let value = |name: &str| found.parameters.iter().find(|p| p.name == name).map(|p| (p.value, p.sigma)).unwrap_or((f64::NAN, f64::NAN));
    let e = |name: &'static str, truth: f64| { let (v, s) = value(name); (name, v - truth, s) };
    let turn = |a: f64, period: f64| a - period * (a / period).round();
    let pi = std::f64::consts::PI;
    match truth {
        Shape::Circle { centre_m, radius_m } => vec![e("centre_x_m", centre_m.x), e("centre_y_m", centre_m.y), e("radius_m", *radius_m)],
        Shape::Ellipse { centre_m, semi_axes_m, angle_rad } => {
            let (_, a, s) = e("angle_rad", *angle_rad);
            vec![e("centre_x_m", centre_m.x), e("centre_y_m", centre_m.y), e("semi_axis_a_m", semi_axes_m[0]), e("semi_axis_b_m", semi_axes_m[1]), ("angle_rad", turn(a, pi), s)]
        }
        Shape::Rectangle { centre_m, sides_m, angle_rad } if sides_m[0] == sides_m[1] => {
            let (_, a, s) = e("angle_rad", *angle_rad);
            vec![e("centre_x_m", centre_m.x), e("centre_y_m", centre_m.y), e("side_m", sides_m[0]), ("angle_rad", turn(a, 0.5 * pi), s)]
        }
        Shape::Rectangle { centre_m, sides_m, angle_rad } => {
            let (_, a, s) = e("angle_rad", *angle_rad);
            vec![e("centre_x_m", centre_m.x), e("centre_y_m", centre_m.y), e("side_a_m", sides_m[0]), e("side_b_m", sides_m[1]), ("angle_rad", turn(a, pi), s)]
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
            let how = match std::env::var("HOW").as_deref() { Ok("raw") => How::Raw, Ok("known") => How::Constrained(Mu::Known(mu)), _ => How::Constrained(Mu::Auto) };
            let (mut sim, mut ident) = (0.0, 0.0);
            let mut tally = [[0_u32; 3]; 4];
            let mut sums: Vec<(&str, f64, f64, f64, f64)> = Vec::new();
            let mut failed = 0;
            for trial in 0..n {
                let truth = object(class, &mut chance);
                let t0 = std::time::Instant::now();
                let sweeps = match readings(&truth, mu) { Ok(s) => s, Err(e) => { if verbose { println!("   sim: {e}"); } failed += 1; continue } };
                sim += t0.elapsed().as_secs_f64();
                for (k, which) in [&[0, 1, 2][..], &[0], &[1], &[2]].iter().enumerate() {
                    let samples: Vec<_> = which.iter().flat_map(|i: &usize| sweeps[*i].clone()).collect();
                    let touches = felt(&samples, how, u64::from(trial) * 7 + k as u64);
                    let t0 = std::time::Instant::now();
                    let found = identify(&touches, &config).unwrap();
                    ident += t0.elapsed().as_secs_f64();
                    let outcome = match found.verdict { Verdict::Is(c) if c == class => 0, Verdict::Is(_) => 1, _ => 2 };
                    tally[k][outcome] += 1;
                    if verbose && (outcome == 1 || k == 0 && outcome != 0) {
                        println!("   {class:?} mu {mu} trial {trial} sweeps {which:?}: {:?} {:?} {:?}", found.verdict, found.reason, truth);
                        for s in found.scores.iter().take(6) { println!("        {:?} chi2 {:.1} {:.2} out {} bic {:.1}", s.model, s.chi2, s.chi2_per_dof, s.n_outliers, s.bic); }
                        println!("        {:?}", found.shape);
                    }
                    if k == 0 && outcome == 0 {
                        for (i, (name, error, sigma)) in errors(&found, &truth).into_iter().enumerate() {
                            if sums.len() <= i { sums.push((name, 0.0, 0.0, 0.0, 0.0)); }
                            sums[i].1 += error * error; sums[i].2 += (error / sigma).powi(2); sums[i].3 = error.abs().max(sums[i].3); sums[i].4 += error;
                        }
                    }
                }
            }
            println!("{class:?} mu {mu}: right/wrong/insufficient 3 sweeps {:?} singles {:?}, sim failed {failed}; {:.1} s (sim {sim:.1}, identify {ident:.2})", tally[0], &tally[1..], begin.elapsed().as_secs_f64());
            let right = f64::from(tally[0][0].max(1));
            for (name, e2, z2, worst, mean) in &sums { print!("   {name} rms {:.1e} mean {:.1e} worst {worst:.1e} nees {:.2}", (e2 / right).sqrt(), mean / right, z2 / right); }
            println!();
        }
    }
}

#[test]
fn one() {
    let truth = Shape::Rectangle { centre_m: nalgebra::Vector2::new(0.007020108265241748, 0.1569501062015527), sides_m: [0.0628953617578095, 0.04480467581259727], angle_rad: 0.023935961741480882 };
    for c in truth.corners_m() { println!("corner {:.5} {:.5}", c.x, c.y); }
    let sweeps = readings(&truth, 0.0).unwrap();
    let samples: Vec<_> = sweeps[1].clone();
    let touches = felt(&samples, How::Constrained(Mu::Auto), 12 * 7 + 2);
    let found = identify(&touches, &Config::default()).unwrap();
    for (t, u) in touches.iter().zip(&found.uses) {
        let c = &t.covariance;
        let tt = nalgebra::Vector2::new(t.theta_rad.cos(), t.theta_rad.sin());
        let along = (tt.transpose() * c.fixed_view::<2,2>(0,0) * tt)[0].sqrt();
        println!("{} {:?} {:?} {:?} x {:.5} {:.5} th {:.2} side {} along {:.5} sth {:.5}", t.sweep, u, t.status, t.mode, t.x_in_world.x, t.x_in_world.y, t.theta_rad.to_degrees(), t.side, along, c[(2,2)].sqrt());
    }
    println!("{found:#?}");
}

#[test]
fn bias() {
    use resight_whisker::contact::Method;
    use resight_whisker::friction::{Mu, solve_record};
    use resight_whisker::simulate::{Spacing, add_noise, standard_sweeps, sweep};
    let object = Shape::Circle { centre_m: nalgebra::Vector2::new(0.0, 0.16), radius_m: 0.025 };
    let (rod, cell) = (identify_support::rod(), identify_support::cell());
    for raw in [false, true] {
    for k in 0..3 {
        let rec = sweep(&rod, &object, 0.0, k as u32, &standard_sweeps()[k], &Spacing::default()).unwrap();
        let clean: Vec<_> = rec.samples.iter().map(|s| s.sample).collect();
        let n = clean.len();
        let mut acc = vec![[0.0_f64; 17]; n];
        for seed in 0..100 {
            let noisy = add_noise(&clean, &cell, seed);
            let est = if raw { noisy.iter().map(|s| resight_whisker::estimate::estimate(&rod, &cell, s, Method::Auto)).collect() } else { solve_record(&rod, &cell, &noisy, Mu::Auto, Method::Auto).unwrap().estimates };
            for i in 0..n {
                let (Some(c), Some(t)) = (&est[i].contact, &rec.samples[i].truth) else { continue };
                if est[i].mode != resight_whisker::estimate::Mode::Mid { continue; }
                let tt = nalgebra::Vector2::new(t.theta_rad.cos(), t.theta_rad.sin());
                let nn = nalgebra::Vector2::new(-tt.y, tt.x);
                let d = c.x_in_world - t.x_in_world;
                let dth = c.theta_rad - t.theta_rad;
                let y = nalgebra::Vector3::new(d.x, d.y, dth);
                let nh = nalgebra::Vector2::new(-c.theta_rad.sin(), c.theta_rad.cos());
                let line = nh.dot(&c.x_in_world) - (nh.dot(&t.x_in_world) + (-nh.dot(&nn) * -0.0));
                let cov = c.covariance + nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(1e-12,1e-12,1e-10));
                let inv = cov.try_inverse().unwrap();
                let along2 = (tt.transpose()*c.covariance.fixed_view::<2,2>(0,0)*tt)[0];
                let mut ds = [0.0; 4];
                for (j, (l1, l2)) in [(20.0, 20.0), (10.0, 10.0), (5.0, 20.0), (5.0, 5.0)].into_iter().enumerate() {
                    let p = 1e-10 + (along2 / l1) * (along2 / l1);
                    let q = 4e-8 + along2 / l2 / l2;
                    let c2 = c.covariance + nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(p, p, q));
                    ds[j] = (y.transpose() * c2.try_inverse().unwrap() * y)[0];
                }
                let v = [1.0, d.dot(&tt), d.dot(&nn), dth, d.dot(&nn).powi(2), (nh.transpose()*c.covariance.fixed_view::<2,2>(0,0)*nh)[0], line, line*line, (y.transpose()*inv*y)[0], dth*dth, c.covariance[(2,2)], d.dot(&tt).powi(2), ds[0], ds[1], ds[2], ds[3], along2];
                for j in 0..17 { acc[i][j] += v[j]; }
            }
        }
        println!("raw {raw} sweep {k}");
        for i in (0..40).step_by(2) {
            let m = acc[i][0];
            if m < 20.0 { continue; }
            let a: Vec<f64> = acc[i].iter().map(|v| v / m).collect();
            println!(" {i} n {m} F {:.3}: mean along {:.2e} sd {:.1e} normal {:.2e} ± {:.1e} theta {:.2e} ± {:.1e}; sd normal {:.2e} claimed {:.2e}; D {:.2}; sd th {:.2e} claimed {:.2e} DDDD {:.2} {:.2} {:.2} {:.2} al {:.4}", clean[i].load.force_n().norm(), a[1], a[11].sqrt(), a[2], (a[4]/m).sqrt(), a[3], (a[9]/m).sqrt(), a[4].sqrt(), a[5].sqrt(), a[8], a[9].sqrt(), a[10].sqrt(), a[12], a[13], a[14], a[15], a[16].sqrt());
        }
    }}
}
