//! The projection onto a constraint, for rods of every kind: derivatives by differences, the minimum by search.

use nalgebra::Vector3;
use resight_whisker::contact::{Method, contact_with_derivatives};
use resight_whisker::friction::{Constraint, FrictionAngle, project};
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::{Cell, HubLoad, Rod, Sample};

fn rods() -> Vec<Rod> {
    let straight = Rod::uniform(0.25, 9.817e-3).expect("a rod");
    let curved =
        Rod { intrinsic_curvature: IntrinsicCurvature::Constant { per_m: -0.8 }, ..straight.clone() };
    let taper =
        Rod { stiffness: Stiffness::Taper { ei_base_n_m2: 2.036e-2, taper: 2.0 / 3.0 }, ..straight.clone() };
    vec![straight, curved, taper]
}

fn cell() -> Cell {
    Cell { force_sigma_n: 3.2e-3, torque_sigma_n_m: 1.6e-5, ..Cell::default() }
}

const LOADS: [[f64; 3]; 4] =
    [[-0.05, 0.2, 0.03], [-0.3, 0.4, 0.075], [-0.05, -0.2, -0.03], [-0.02, 0.15, 0.035]];

fn load(values: &Vector3<f64>) -> HubLoad {
    HubLoad::from_vector(values)
}

fn constraints() -> [Constraint; 3] {
    let friction = |rad, sigma_rad| Constraint::Friction(FrictionAngle { rad, sigma_rad });
    [friction(0.0, 0.0), friction(0.2, 0.05), Constraint::Tip]
}

#[test]
fn gradients_match_differences() {
    for rod in rods() {
        for values in LOADS {
            let at = Vector3::from(values);
            for constraint in constraints() {
                let value = |x: &Vector3<f64>| {
                    let found = contact_with_derivatives(&rod, &load(x), Method::Auto).expect("a contact");
                    constraint.residual_n(&rod, &load(x), &found.0)
                };
                let (found, by_load) =
                    contact_with_derivatives(&rod, &load(&at), Method::Auto).expect("a contact");
                let gradient = constraint.gradient(&rod, &load(&at), &found, &by_load);
                for (i, scale) in [0.1, 0.1, 0.01].into_iter().enumerate() {
                    let step = Vector3::ith(i, 6e-6 * scale);
                    let difference = (value(&(at + step)) - value(&(at - step))) / (2.0 * step[i]);
                    let off = (difference - gradient[i]).abs();
                    assert!(off < 1e-7 * (1.0 + gradient.amax()), "{constraint:?} {i}: {off:e}");
                }
            }
        }
    }
}

/// No load on the constraint is nearer: steps along its surface, in the metric of the noise, all lead away.
#[test]
fn the_projection_is_the_nearest_load() {
    let cell = cell();
    let sigma = cell.load_covariance().diagonal().map(f64::sqrt);
    for rod in rods() {
        for (values, constraint) in LOADS.iter().zip(constraints().into_iter().cycle()) {
            let measured = Vector3::from(*values);
            let sample = Sample { load: load(&measured), ..Sample::default() };
            let projection = project(&rod, &cell, &sample, constraint, Method::Auto).expect("a contact");
            // The whole cost: distance, and the friction angle's own pull.
            let cost = |x: &Vector3<f64>| {
                let found = contact_with_derivatives(&rod, &load(x), Method::Auto).expect("a contact").0;
                let g = constraint.residual_n(&rod, &load(x), &found);
                // A hard constraint as a stiff spring: a thousandth of a newton's noise.
                let variance = constraint.variance_n2(&projection.load).max((1e-3 * sigma[0]).powi(2));
                (measured - x).component_div(&sigma).norm_squared() + g * g / variance
            };
            let best = projection.load.to_vector();
            let least = cost(&best);
            assert!((least - projection.chi2).abs() < 1e-3 * (1.0 + least), "{least} {}", projection.chi2);
            for i in 0..26 {
                let direction =
                    Vector3::new(f64::from(i % 3) - 1.0, f64::from(i / 3 % 3) - 1.0, f64::from(i / 9) - 1.0);
                let step = direction.component_mul(&sigma) * 0.05;
                // 1e-4: the stiff spring's own slack.
                assert!(least < cost(&(best + step)) + 1e-4 * (1.0 + least), "{constraint:?} {i}");
            }
        }
    }
}

/// The constraint holds, to rounding, and the covariance has lost exactly its direction.
#[test]
fn the_constraint_holds() {
    let cell = cell();
    for rod in rods() {
        for values in LOADS {
            let sample = Sample { load: load(&Vector3::from(values)), ..Sample::default() };
            let tip = project(&rod, &cell, &sample, Constraint::Tip, Method::Auto).expect("a contact");
            assert!((tip.at.s_m - rod.length_m).abs() < 1e-7 * rod.length_m, "{}", tip.at.s_m);
            assert!(tip.s_sigma_m() < 1e-6 * rod.length_m);
            let angle = FrictionAngle { rad: 0.1, sigma_rad: 0.0 };
            let mid =
                project(&rod, &cell, &sample, Constraint::Friction(angle), Method::Auto).expect("a contact");
            assert!((mid.at.friction_angle_rad - 0.1).abs() < 1e-7, "{}", mid.at.friction_angle_rad);
        }
    }
}
