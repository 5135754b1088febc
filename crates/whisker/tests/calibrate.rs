//! Rigs that are wrong in every way at once are put right by their own sweeps.

mod real_support;

use nalgebra::{Matrix2, Vector2, Vector3};
use real_support::sets;
use resight_whisker::calibrate::{Object, Options, Parameter, Values, calibrate};
use resight_whisker::{HubLoad, PlanarPose, Rod, Sample, Shape};

/// What a rig with errors `wrong` reads where an ideal one reads `sample`: docs/math/whisker_calibrate.md (1)–(3) backwards.
fn as_read(wrong: &Values, sample: &Sample) -> Sample {
    let v = |p: Parameter| wrong[p.index()];
    let force = sample.load.force_n();
    let moment =
        sample.load.mz_n_m - v(Parameter::CellOriginX) * force.y + v(Parameter::CellOriginY) * force.x;
    let (sin, cos) = v(Parameter::CellAngle).sin_cos();
    let in_cell = Matrix2::new(cos, sin, -sin, cos) * force / v(Parameter::ForceGain).exp();
    let hub = sample.world_from_hub;
    Sample {
        load: HubLoad {
            fx_n: in_cell.x + v(Parameter::ForceXZero),
            fy_n: in_cell.y + v(Parameter::ForceYZero),
            mz_n_m: moment / v(Parameter::TorqueGain).exp() + v(Parameter::TorqueZero),
        },
        world_from_hub: PlanarPose {
            x_m: hub.x_m - v(Parameter::HubX),
            y_m: hub.y_m - v(Parameter::HubY),
            angle_rad: hub.angle_rad - v(Parameter::HubAngle),
        },
        ..*sample
    }
}

fn object_of(name: &str) -> Shape {
    let degrees = f64::to_radians;
    match name {
        "f1_square_00" => Shape::square(Vector2::new(0.0, 0.165), 0.06, 0.0),
        "f2_square_30" => Shape::square(Vector2::new(0.0, 0.165), 0.06, degrees(30.0)),
        "f5_taper_ellipse" => Shape::Ellipse {
            centre_m: Vector2::new(0.0, 0.16),
            semi_axes_m: [0.05, 0.02],
            angle_rad: degrees(20.0),
        },
        "f6_slipoff_peg" => Shape::Circle { centre_m: Vector2::new(0.0, 0.22), radius_m: 0.003 },
        _ => Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.025 },
    }
}

#[test]
fn explore() {
    let Some(sets) = sets() else { return };
    for set in sets.iter().filter(|set| !set.name.contains("taper")) {
        for object in
            [Object::Unknown, Object::Known(object_of(set.name)), Object::KnownClass(object_of(set.name))]
        {
            let mut wrong = Values::zeros();
            for (p, v) in [
                (Parameter::Stiffness, 0.0),
                (Parameter::ForceXZero, 0.01),
                (Parameter::ForceYZero, -0.006),
                (Parameter::TorqueZero, 5e-5),
                (Parameter::TorqueGain, 0.01),
                (Parameter::CellAngle, -0.0035),
                (Parameter::HubAngle, 0.0035),
                (Parameter::HubX, 0.0005),
                (Parameter::HubY, -0.0003),
                (Parameter::FrictionAngle, if set.name.contains("mu03") { 0.3_f64.atan() } else { 0.0 }),
            ] {
                wrong[p.index()] = v;
            }
            let read: Vec<Sample> = set.noisy.iter().map(|s| as_read(&wrong, s)).collect();
            let options = Options::of_a_new_rig(&set.cell);
            let now = std::time::Instant::now();
            let result = calibrate(&set.rod, &set.cell, &read, &object, &options).unwrap();
            println!(
                "{} {:?}: chi2 {:.1}/{} p {:.3} {:?} {:.0?}",
                set.name,
                result.object,
                result.chi2,
                result.degrees_of_freedom,
                result.p_value,
                result.counts(),
                now.elapsed()
            );
            for p in Parameter::ALL.into_iter().filter(|p| 0.0 < result.calibration.sigma(*p)) {
                let (value, sigma) = (result.calibration.value(p), result.calibration.sigma(p));
                println!(
                    "   {:24} {:11.3e} ± {:9.2e}  z {:6.2}",
                    p.name(),
                    value - wrong[p.index()],
                    sigma,
                    (value - wrong[p.index()]) / sigma
                );
            }
            for u in &result.undetermined {
                println!("   open {:.2} {:?} {}", u.left, u.combination, u.reason);
            }
        }
    }
    let _ = (Rod::uniform(1.0, 1.0), Vector3::<f64>::zeros());
}

/// Numerical Recipes' 64-bit generator with Box and Muller's normals: seeded, so that every run draws the same.
struct Dice(u64);

impl Dice {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let (a, b) = (self.uniform(), self.uniform());
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}

fn rounded(value: f64, step: f64) -> f64 {
    if step == 0.0 { value } else { (value / step).round() * step }
}

fn noisy(dice: &mut Dice, cell: &resight_whisker::Cell, clean: &Sample) -> Sample {
    let mut s = *clean;
    let l = &mut s.load;
    l.fx_n = rounded(l.fx_n + cell.force_sigma_n * dice.normal(), cell.force_step_n);
    l.fy_n = rounded(l.fy_n + cell.force_sigma_n * dice.normal(), cell.force_step_n);
    l.mz_n_m = rounded(l.mz_n_m + cell.torque_sigma_n_m * dice.normal(), cell.torque_step_n_m);
    let h = &mut s.world_from_hub;
    h.x_m += cell.hub_xy_sigma_m * dice.normal();
    h.y_m += cell.hub_xy_sigma_m * dice.normal();
    h.angle_rad = rounded(h.angle_rad, cell.hub_angle_step_rad);
    s
}

#[test]
fn monte() {
    let Some(sets) = sets() else { return };
    let name = std::env::var("SET").unwrap_or("f2_square_30".into());
    let n: u64 = std::env::var("N").ok().and_then(|n| n.parse().ok()).unwrap_or(40);
    let set = sets.iter().find(|set| set.name == name).unwrap();
    let mut wrong = Values::zeros();
    if name.contains("mu03") {
        wrong[Parameter::FrictionAngle.index()] = 0.3_f64.atan();
    }
    for object in [Object::Unknown, Object::Known(object_of(set.name))] {
        let (mut sum, mut sum2, mut chi, mut dof, mut nees, mut sig) =
            (Values::zeros(), Values::zeros(), 0.0, 0.0, 0.0, Values::zeros());
        for seed in 0..n {
            let mut dice = Dice(0x9E3779B97F4A7C15 ^ (seed + 1) * 7919);
            let read: Vec<Sample> =
                set.clean.iter().map(|s| as_read(&wrong, &noisy(&mut dice, &set.cell, s))).collect();
            let options = Options::of_a_new_rig(&set.cell);
            let r = calibrate(&set.rod, &set.cell, &read, &object, &options).unwrap();
            chi += r.chi2;
            dof += r.degrees_of_freedom as f64;
            let free: Vec<usize> = r
                .priors
                .free()
                .into_iter()
                .map(|p| p.index())
                .filter(|i| object != Object::Unknown || ![7, 8, 9].contains(i))
                .collect();
            let e = nalgebra::DVector::from_iterator(
                free.len(),
                free.iter().map(|i| r.calibration.values[*i] - wrong[*i]),
            );
            let c = nalgebra::DMatrix::from_fn(free.len(), free.len(), |i, j| {
                r.calibration.covariance[(free[i], free[j])]
            });
            nees += e.dot(&c.cholesky().unwrap().solve(&e)) / free.len() as f64;
            for i in free {
                let s = r.calibration.covariance[(i, i)].sqrt();
                let z = (r.calibration.values[i] - wrong[i]) / s;
                sum[i] += z;
                sum2[i] += z * z;
                sig[i] += s;
            }
        }
        let n = n as f64;
        println!("{name} chi2/dof {:.4} (dof {:.0}) nees/n {:.3}", chi / dof, dof / n, nees / n);
        for p in Parameter::ALL {
            let i = p.index();
            if sum2[i] > 0.0 {
                println!(
                    "   {:24} mean z {:6.2} rms z {:5.2} sigma {:.2e}",
                    p.name(),
                    sum[i] / n,
                    (sum2[i] / n).sqrt(),
                    sig[i] / n
                );
            }
        }
    }
}
