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
    let moment = sample.load.mz_n_m - v(Parameter::CellOriginX) * force.y + v(Parameter::CellOriginY) * force.x;
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
        for object in [Object::Unknown, Object::Known(object_of(set.name)), Object::KnownClass(object_of(set.name))] {
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
                println!("   {:24} {:11.3e} ± {:9.2e}  z {:6.2}", p.name(), value - wrong[p.index()], sigma, (value - wrong[p.index()]) / sigma);
            }
            for u in &result.undetermined {
                println!("   open {:.2} {:?} {}", u.left, u.combination, u.reason);
            }
        }
    }
    let _ = (Rod::uniform(1.0, 1.0), Vector3::<f64>::zeros());
}
