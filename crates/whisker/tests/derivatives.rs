//! Derivatives of contacts by load and whisker, beside central differences. Whether the contacts are right, `golden.rs` says.

use nalgebra::{SVector, Vector2};
use resight_whisker::contact::{
    ByLoad, Method, NoZero, branch_with_derivatives, by_rod, contact_in_hub, contact_with_derivatives,
    later_zeros,
};
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::{HubContact, HubLoad, Rod};

type Five = SVector<f64, 5>;

/// A contact as something is changed by the number given.
type Move<'a> = &'a dyn Fn(f64) -> Result<Five, NoZero>;

fn rod(ei_n_m2: f64, per_m: f64) -> Rod {
    Rod {
        length_m: 3.0,
        stiffness: Stiffness::Uniform { ei_n_m2 },
        intrinsic_curvature: IntrinsicCurvature::Constant { per_m },
        diameters_m: [0.0, 0.0],
    }
}

fn cases() -> Vec<(Rod, HubLoad)> {
    let numbers = |line: &str| line.split(',').map(|v| v.parse().expect("a number")).collect::<Vec<f64>>();
    let load = |v: &[f64]| HubLoad { fx_n: v[0], fy_n: v[1], mz_n_m: v[2] };
    let straight = include_str!("contact_tables/straight.csv").lines().skip(1).map(numbers);
    let curved = include_str!("contact_tables/curved.csv").lines().skip(1).map(numbers);
    straight
        .map(|v| (rod(v[0], 0.0), load(&v[1..])))
        .chain(curved.map(|v| (rod(v[0], v[1]), load(&v[2..]))))
        .filter(|(rod, load)| !on_separatrix(rod, load))
        .collect()
}

/// Between swinging and turning over (k = 1) the derivatives of a curved rod are good to 1e-7 only; the last test has those.
fn on_separatrix(rod: &Rod, load: &HubLoad) -> bool {
    let (kappa, force) = (rod.constant_curvature_per_m().expect("constant"), load.force_n().norm());
    let c = (kappa + load.mz_n_m / rod.ei_base_n_m2()) / (2.0 * (force / rod.ei_base_n_m2()).sqrt());
    let h2 = 0.5 * (1.0 - load.fx_n / force);
    kappa != 0.0 && (h2 - c * c).abs() < 1e-6 * h2
}

/// The derivative of `f` at 0 and how far it may be off: two steps, extrapolated; their difference bounds what is left.
fn difference(f: impl Fn(f64) -> Result<Five, NoZero>, scale: f64) -> Option<(Five, Five)> {
    let slope = |h: f64| Some((f(h).ok()? - f(-h).ok()?) / (2.0 * h));
    let (near, far) = (slope(2e-5 * scale)?, slope(4e-5 * scale)?);
    Some(((near * 4.0 - far) / 3.0, (near - far).abs()))
}

/// Counts how many entries agree where the difference itself is good; panics where one does not.
fn compare(found: &Five, expected: &(Five, Five), size: &Five, rounding: &Five, what: &str) -> usize {
    let mut sharp = 0;
    for i in 0..5 {
        // Differences over 2e-5 keep 1e-11 of the value; a tenth of the extrapolation's correction may be left.
        let allowed = 1e-9 * size[i] + 0.1 * expected.1[i] + rounding[i];
        let error = (found[i] - expected.0[i]).abs();
        assert!(error <= allowed, "{what} row {i}: {} beside {} ± {allowed:e}", found[i], expected.0[i]);
        sharp += usize::from(allowed < 1e-6 * size[i]);
    }
    sharp
}

/// The contact's own size: the arc length, 1 rad.
fn size(at: &HubContact) -> Five {
    Five::from([at.s_m, at.s_m, 1.0, at.s_m, 1.0])
}

/// What the load's last digits leave uncertain of a contact, and a step of 2e-5 of a difference; and what is left of derivatives by
/// loads of unit length √(EI/F) (EI = 1 in all cases) where the contact is much closer to the hub.
fn rounding(by_load: &ByLoad, load: &HubLoad) -> Five {
    let length = 8.0 * f64::EPSILON / load.force_n().norm().sqrt();
    let own = Five::from([length, length, 0.0, length, 0.0]);
    by_load.abs() * load.to_vector().abs() * (4.0 * f64::EPSILON / 2e-5) + own
}

/// A scale at which the contact moves by a tenth of its size or less: near a singular load (axial, or about to lose its zero) a part of
/// `scale`. None where that part is so small that the load's own last digit hides the difference.
fn gentle(scale: f64, by: &Five, size: &Five) -> Option<f64> {
    let moves = by.component_div(size).amax() * scale;
    (moves < 1e4).then(|| scale / (10.0 * moves).max(1.0))
}

#[test]
fn by_load_matches_central_difference() {
    let (mut sharp, mut compared) = (0, 0);
    for (rod, load) in cases() {
        let (at, by_load) = contact_with_derivatives(&rod, &load, Method::Auto).expect("a contact");
        let force = load.force_n().norm();
        for (column, scale) in [force, force, load.mz_n_m.abs()].into_iter().enumerate() {
            let Some(scale) = gentle(scale, &by_load.column(column).into_owned(), &size(&at)) else {
                continue;
            };
            let moved = |by: f64| {
                let mut vector = load.to_vector();
                vector[column] += by;
                contact_in_hub(&rod, &HubLoad::from_vector(&vector), Method::Auto).map(|at| at.to_vector())
            };
            // Close to where the moment no longer vanishes, or leaps, differences say nothing.
            let Some((slope, correction)) = difference(moved, scale) else { continue };
            let scaled = by_load.column(column) * scale;
            let what = format!("{rod:?} {load:?} column {column}");
            sharp += compare(
                &scaled,
                &(slope * scale, correction * scale),
                &size(&at),
                &rounding(&by_load, &load),
                &what,
            );
            compared += 5;
        }
    }
    println!("{sharp} sharp of {compared}");
    assert!(6500 < compared && 0.85 * compared as f64 <= sharp as f64, "{sharp} of {compared}");
}

/// Loads whose second, third … zero lies on the whisker too.
#[test]
fn later_zeros_match_central_difference() {
    let mut compared = 0;
    for (rod, load) in cases() {
        let first = contact_in_hub(&rod, &load, Method::Auto).expect("a contact");
        let force = load.force_n().norm();
        for branch in 1..=later_zeros(&rod, &load, &first, Method::Auto).len() {
            let zero = |load: &HubLoad| branch_with_derivatives(&rod, load, Method::Auto, branch);
            let (at, by_load) = zero(&load).expect("listed");
            for (column, scale) in [force, force, load.mz_n_m.abs()].into_iter().enumerate() {
                let Some(scale) = gentle(scale, &by_load.column(column).into_owned(), &size(&at)) else {
                    continue;
                };
                let moved = |by: f64| {
                    let mut vector = load.to_vector();
                    vector[column] += by;
                    zero(&HubLoad::from_vector(&vector)).map(|(at, _)| at.to_vector())
                };
                let Some((slope, correction)) = difference(moved, scale) else { continue };
                let scaled = by_load.column(column) * scale;
                let what = format!("branch {branch} {rod:?} {load:?} column {column}");
                compare(
                    &scaled,
                    &(slope * scale, correction * scale),
                    &size(&at),
                    &rounding(&by_load, &load),
                    &what,
                );
                compared += 5;
            }
        }
    }
    println!("{compared} compared");
    assert!(300 < compared, "{compared}");
}

#[test]
fn by_rod_matches_central_difference() {
    let mut compared = 0;
    for (rod, load) in cases() {
        let (at, by_load) = contact_with_derivatives(&rod, &load, Method::Auto).expect("a contact");
        let by_rod = by_rod(&rod, &load, &at, &by_load).expect("a uniform rod");
        let (ei, kappa) = (rod.ei_base_n_m2(), rod.constant_curvature_per_m().expect("constant"));
        let length = (ei / load.force_n().norm()).sqrt();
        let solve = |ei: f64, kappa: f64, load: &HubLoad| {
            contact_in_hub(&self::rod(ei, kappa), load, Method::Auto).map(|at| at.to_vector())
        };
        let stiffer = |by: f64| solve(ei * by.exp(), kappa, &load);
        let bent = |by: f64| solve(ei, kappa + by, &load);
        // The whisker turned in the cell's frame: its own frame sees the load turned back.
        let turned = |by: f64| {
            let force = rotated(load.force_n(), -by);
            let load = HubLoad { fx_n: force.x, fy_n: force.y, mz_n_m: load.mz_n_m };
            solve(ei, kappa, &load).map(|v| {
                let x = rotated(Vector2::new(v[0], v[1]), by);
                Five::from([x.x, x.y, v[2] + by, v[3], v[4]])
            })
        };
        let moves: [(Move, f64); 3] = [(&stiffer, 1.0), (&bent, 1.0 / length), (&turned, 1.0)];
        for (column, (moved, scale)) in moves.into_iter().enumerate() {
            let Some(scale) = gentle(scale, &by_rod.column(column).into_owned(), &size(&at)) else {
                continue;
            };
            let Some((slope, correction)) = difference(moved, scale) else { continue };
            let scaled = by_rod.column(column) * scale;
            // The column of κ₀ is a difference of the moment's share and the later zero.
            let lost = by_load.column(2).abs() * (8.0 * f64::EPSILON * scale * ei);
            let what = format!("{rod:?} {load:?} rod column {column}");
            compare(
                &scaled,
                &(slope * scale, correction * scale),
                &size(&at),
                &(rounding(&by_load, &load) + lost),
                &what,
            );
            compared += 5;
        }
    }
    println!("{compared} compared");
    assert!(6500 < compared, "{compared}");
}

fn rotated(v: Vector2<f64>, angle_rad: f64) -> Vector2<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}

/// k = 1 exactly and a part in 10¹⁰ to 10⁸ beside it: κ₀ = 1/m, F = 1 N under 60°, EI = 1 N·m².
#[test]
fn derivatives_pass_from_swinging_to_turning_over() {
    let rod = rod(1.0, 1.0);
    let angle = 2.0 * std::f64::consts::PI / 3.0;
    let at_k1 = 2.0 * (0.5 * angle).sin() - 1.0;
    for beside in [-1e-8, -1e-9, -1e-10, 0.0, 1e-10, 1e-9, 1e-8] {
        let load = HubLoad { fx_n: angle.cos(), fy_n: angle.sin(), mz_n_m: at_k1 + beside };
        let (at, by_load) = contact_with_derivatives(&rod, &load, Method::Auto).expect("a contact");
        for column in 0..3 {
            let moved = |by: f64| {
                let mut vector = load.to_vector();
                vector[column] += by;
                contact_in_hub(&rod, &HubLoad::from_vector(&vector), Method::Auto).map(|at| at.to_vector())
            };
            let (slope, _) = difference(moved, 1.0).expect("contacts on both sides");
            let error = (by_load.column(column) - slope).component_div(&size(&at)).amax();
            println!("{beside:e}: {error:.1e}");
            // A part in 10⁷ beside, times a curvature of some 10.
            assert!(error < 3e-6, "{beside:e} column {column}: {error:e}");
        }
    }
}
