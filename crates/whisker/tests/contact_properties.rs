//! What holds for every load: no number that is none, mirrors, scales, invariants, the verdicts at the edges, the line of the bent whisker.

use nalgebra::Vector2;
use proptest::prelude::*;
use resight_whisker::contact::bent::shape_in_hub;
use resight_whisker::contact::{
    BRANCHES, Method, NoZero, closed_form, contact_in_hub, contact_with_derivatives, curved, later_zeros,
};
use resight_whisker::estimate::{Status, choose_branch, estimate};
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::{Cell, Error, HubContact, HubLoad, Rod, Sample};
use std::f64::consts::PI;

const EI_N_M2: f64 = 0.0098;

fn load(fx_n: f64, fy_n: f64, mz_n_m: f64) -> HubLoad {
    HubLoad { fx_n, fy_n, mz_n_m }
}

fn rod(per_m: f64) -> Rod {
    Rod {
        length_m: 0.25,
        stiffness: Stiffness::Uniform { ei_n_m2: EI_N_M2 },
        intrinsic_curvature: IntrinsicCurvature::Constant { per_m },
        diameters_m: [0.001, 0.0006],
    }
}

fn cell() -> Cell {
    Cell { force_sigma_n: 0.003, torque_sigma_n_m: 1.6e-5, hub_xy_sigma_m: 1e-5, ..Cell::default() }
}

/// A force over six decades in any direction, a moment up to where it would never vanish and beyond.
fn any_load() -> impl Strategy<Value = HubLoad> {
    (-4.0..2.0_f64, -PI..PI, -1.1..1.1_f64).prop_map(|(decade, angle, share)| {
        let force = 10.0_f64.powf(decade);
        load(force * angle.cos(), force * angle.sin(), share * 2.0 * (EI_N_M2 * force).sqrt())
    })
}

/// Zero, or any double, subnormals, infinities and NaN among them.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![1 => Just(0.0), 1 => Just(-0.0), 6 => any::<f64>(), 4 => -2.0..2.0_f64]
}

fn close(a: &HubContact, b: &HubContact, share: f64) -> bool {
    let size = [a.s_m, a.s_m, 1.0, a.s_m, 1.0];
    (0..5).all(|i| (a.to_vector()[i] - b.to_vector()[i]).abs() <= share * size[i])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever the load: numbers, or the reason why there are none; an arc length never negative.
    #[test]
    fn no_load_gives_a_number_that_is_none(fx in any_number(), fy in any_number(), mz in any_number(), per_m in any_number()) {
        let at = load(fx, fy, mz);
        let of = |found: Result<HubContact, NoZero>| found.is_err() || found.is_ok_and(|at| at.is_finite() && 0.0 <= at.s_m);
        prop_assert!(of(closed_form::straight(EI_N_M2, &at)));
        prop_assert!(of(curved::contact(EI_N_M2, per_m, &at)));
        for rod in [rod(0.0), rod(3.0)] {
            if let Ok((_, by_load)) = contact_with_derivatives(&rod, &at, Method::Auto) {
                prop_assert!(by_load.iter().all(|v| v.is_finite()));
            }
            let found = estimate(&rod, &cell(), &Sample { load: at, ..Sample::default() }, Method::Auto);
            if let Some(contact) = found.contact.filter(|_| found.status == Status::Ok) {
                prop_assert!(contact.covariance.iter().all(|v| v.is_finite()));
                prop_assert!(0.0 <= contact.s_sigma_m);
            }
            prop_assert!(found.branches.len() <= BRANCHES);
        }
    }

    /// Left and right exchanged: bit for bit the mirrored contact, and its derivatives.
    #[test]
    fn mirrored_loads_have_mirrored_contacts(at in any_load(), per_m in -10.0..10.0_f64) {
        for per_m in [0.0, per_m] {
            let found = contact_with_derivatives(&rod(per_m), &at, Method::Auto);
            let mirrored = contact_with_derivatives(&rod(-per_m), &at.mirrored(), Method::Auto);
            let Ok((a, by_a)) = found else { prop_assert_eq!(found.err(), mirrored.err()); continue };
            let (b, by_b) = mirrored.expect("the mirrored contact");
            prop_assert_eq!(a.x_in_hub, Vector2::new(b.x_in_hub.x, -b.x_in_hub.y));
            prop_assert_eq!([a.s_m, a.theta_rad, a.friction_angle_rad], [b.s_m, -b.theta_rad, b.friction_angle_rad]);
            for (row, column) in (0..5).flat_map(|row| (0..3).map(move |column| (row, column))) {
                let flips = matches!(row, 1 | 2) != (column != 0);
                prop_assert_eq!(by_a[(row, column)], if flips { -by_b[(row, column)] } else { by_b[(row, column)] });
            }
        }
    }

    /// A whisker n times as long under loads of the same shape bends to the same shape.
    #[test]
    fn contacts_scale(at in any_load(), per_m in -10.0..10.0_f64, n in 0.01..100.0_f64) {
        for per_m in [0.0, per_m] {
            let scaled = load(at.fx_n / (n * n), at.fy_n / (n * n), at.mz_n_m / n);
            let (Ok((a, by_load)), Ok(b)) = (
                contact_with_derivatives(&rod(per_m), &at, Method::Auto),
                contact_in_hub(&rod(per_m / n), &scaled, Method::Auto),
            ) else { continue };
            // The load of the second is rounded: what its last digits move, and as much for the sums.
            let moved = by_load.abs() * at.to_vector().abs();
            let own = [a.s_m, a.s_m, 1.0, a.s_m, 1.0];
            for i in 0..5 {
                let back = if matches!(i, 2 | 4) { 1.0 } else { 1.0 / n };
                let error = (a.to_vector()[i] - b.to_vector()[i] * back).abs();
                prop_assert!(error <= 64.0 * f64::EPSILON * (own[i] + moved[i]), "{} {error:e}", i);
            }
        }
    }

    /// F·t = M₀²/2EI + M₀ κ₀ + fx, and the contact on the force's line of action.
    #[test]
    fn invariants_hold_at_the_contact(at in any_load(), per_m in -10.0..10.0_f64) {
        for per_m in [0.0, per_m] {
            let Ok(found) = contact_in_hub(&rod(per_m), &at, Method::Auto) else { continue };
            let (force, x) = (at.force_n(), found.x_in_hub);
            let tangent = Vector2::new(found.theta_rad.cos(), found.theta_rad.sin());
            let pull = at.mz_n_m * at.mz_n_m / (2.0 * EI_N_M2) + at.mz_n_m * per_m + at.fx_n;
            let size = at.mz_n_m.powi(2) / EI_N_M2 + (at.mz_n_m * per_m).abs() + force.norm();
            prop_assert!((force.dot(&tangent) - pull).abs() <= 1e-14 * size);
            prop_assert!((force.norm() * found.friction_angle_rad.sin() - pull).abs() <= 1e-14 * size);
            let arm = x.x * force.y - x.y * force.x;
            prop_assert!((arm - at.mz_n_m).abs() <= 1e-14 * (at.mz_n_m.abs() + x.norm() * force.norm()));
        }
    }

    /// The integrated line bends to the contact, and is its own length.
    #[test]
    fn the_drawn_line_passes_through_the_contact(at in any_load(), per_m in -5.0..5.0_f64) {
        let rod = rod(per_m);
        let Ok(found) = contact_in_hub(&rod, &at, Method::Auto) else { return Ok(()) };
        // A rod that ends at the contact has it as its last point.
        prop_assume!(1e-3 < found.s_m && found.s_m < 0.3 && at.force_n().norm() * found.s_m.powi(2) < 20.0 * EI_N_M2);
        let line = shape_in_hub(&Rod { length_m: found.s_m, ..rod }, &at, Method::Auto, 100);
        let end = line.last().expect("points");
        prop_assert!((end - found.x_in_hub).norm() < 1e-6 * found.s_m, "{end} {:?}", found);
    }
}

/// An axial push with a moment: half the elastica of a column; without one the moment is zero everywhere.
#[test]
fn axial_forces() {
    // Small moment: a quarter period of the column, s = π/2 √(EI/F).
    let at = closed_form::straight(EI_N_M2, &load(-1.0, 0.0, 1e-9)).expect("a contact");
    assert!((at.s_m - 0.5 * PI * EI_N_M2.sqrt()).abs() < 1e-12);
    assert_eq!(closed_form::straight(EI_N_M2, &load(-1.0, 0.0, 0.0)), Err(NoZero::Axial));
    assert_eq!(closed_form::straight(EI_N_M2, &load(1.0, 0.0, 0.0)), Err(NoZero::Axial));
    assert_eq!(closed_form::straight(EI_N_M2, &load(1.0, 0.0, 1e-3)), Err(NoZero::NeverVanishes));
    assert_eq!(closed_form::straight(EI_N_M2, &load(1.0, -0.0, -1e-3)), Err(NoZero::NeverVanishes));
}

#[test]
fn no_moment_is_a_contact_at_the_clamp() {
    for fy in [0.5, -0.5] {
        for per_m in [0.0, 2.0, -2.0] {
            let at = contact_in_hub(&rod(per_m), &load(0.1, fy, 0.0), Method::Auto).expect("a contact");
            assert_eq!([at.s_m, at.x_in_hub.x, at.x_in_hub.y, at.theta_rad], [0.0; 4], "{per_m} {fy}");
        }
    }
    // And a moment of almost none: M₀/fy.
    let at = closed_form::straight(EI_N_M2, &load(0.1, 0.5, 1e-14)).expect("a contact");
    assert!((at.s_m / 2e-14 - 1.0).abs() < 1e-12);
}

/// A moment against the force bends the whisker over: the zero lies half a period further out.
#[test]
fn moment_against_the_force_has_a_far_zero() {
    let (with, against) = (load(-0.1, 0.5, 1e-6), load(-0.1, -0.5, 1e-6));
    let near = closed_form::straight(EI_N_M2, &with).expect("a contact");
    let far = closed_form::straight(EI_N_M2, &against).expect("a contact");
    assert!(near.s_m < 1e-5 && 0.2 < far.s_m, "{} {}", near.s_m, far.s_m);
    // The next zero of the one is the first of the other, to within the little arc before it.
    let long = Rod { length_m: 1.0, ..rod(0.0) };
    let later = later_zeros(&long, &with, &near, Method::Auto);
    assert!((later[0].s_m - near.s_m - far.s_m).abs() < 1e-5);
}

/// Zeros repeat every half period, 2K/λ, where the moment is zero by integration as well.
#[test]
fn later_zeros_are_zeros_of_the_integrated_moment() {
    for per_m in [0.0, 1.5, -1.5, 12.0, -12.0] {
        let long = Rod { length_m: 1.0, ..rod(per_m) };
        let at = load(-0.4, 1.1, 0.05);
        let first = contact_in_hub(&long, &at, Method::Auto).expect("a contact");
        let later = later_zeros(&long, &at, &first, Method::Auto);
        let integrated = resight_whisker::contact::integrate::zeros(&long, &at, 100);
        assert_eq!(integrated.len().min(BRANCHES + 1), later.len() + 1, "{per_m}");
        assert!(1 < integrated.len(), "{per_m}");
        for (closed, by_steps) in std::iter::once(&first).chain(&later).zip(&integrated) {
            assert!(close(closed, by_steps, 1e-9), "{per_m}: {closed:?} {by_steps:?}");
        }
    }
}

/// The previous contact decides between zeros; covariance and side are those of the chosen one.
#[test]
fn the_branch_near_the_previous_contact_is_chosen() {
    let (long, at) = (Rod { length_m: 0.6, ..rod(0.0) }, load(-0.4, 1.1, 0.05));
    let sample = Sample { load: at, ..Sample::default() };
    let first = estimate(&long, &cell(), &sample, Method::Auto);
    let second_s_m = first.branches[0].s_m;
    let (branch, kept) = choose_branch(&long, &cell(), &sample, Method::Auto, first.clone(), 0.04);
    assert_eq!((branch, &kept), (0, &first));
    let (branch, chosen) =
        choose_branch(&long, &cell(), &sample, Method::Auto, first.clone(), second_s_m - 0.02);
    assert_eq!(branch, 1);
    let contact = chosen.contact.expect("a contact");
    assert_eq!(contact.s_m, second_s_m);
    assert!(first.contact.expect("a contact").s_sigma_m != contact.s_sigma_m);
    assert_eq!(chosen.branches, first.branches);
}

#[test]
fn every_verdict_is_reached() {
    let status = |at: HubLoad| {
        estimate(&rod(0.0), &cell(), &Sample { load: at, ..Sample::default() }, Method::Auto).status
    };
    assert_eq!(status(load(-0.01, 0.5, 0.08)), Status::Ok);
    assert_eq!(status(load(0.003, -0.004, 2e-5)), Status::NoContact);
    // 7 sigmas of force.
    assert_eq!(status(load(0.0, 0.02, 0.003)), Status::LowForce);
    // 20 sigmas, but a long lever: 6 % of the length along the whisker.
    assert_eq!(status(load(-0.001, 0.035, 0.0082)), Status::LowForce);
    assert_eq!(status(load(0.3, 0.5, 0.14)), Status::NoZero);
    assert_eq!(status(load(f64::NAN, 0.5, 0.14)), Status::NoZero);
    // A pull along the whisker, its moment within the noise of vanishing.
    assert_eq!(status(load(0.5, 0.002, 0.00015)), Status::LowForce);
    assert_eq!(status(load(-0.1837, 0.02, 0.06)), Status::BeyondTip);
}

/// The outline lies a radius beside the centre line, on the object's side.
#[test]
fn the_outline_is_a_radius_away() {
    for side in [1.0, -1.0] {
        let at = load(-0.01, side * 0.5, side * 0.08);
        let sample = Sample { load: at, ..Sample::default() };
        let contact = estimate(&rod(0.0), &cell(), &sample, Method::Auto).contact.expect("a contact");
        let outline = contact.outline_in_world(&rod(0.0), at.side());
        let radius = 0.5 * (0.001 - 0.0004 * contact.s_m / 0.25);
        assert!(((outline - contact.x_in_world).norm() - radius).abs() < 1e-15);
        // The object pushes the whisker away from itself.
        assert!(contact.force_in_world_n(at.side()).dot(&(outline - contact.x_in_world)) < 0.0);
        assert!((contact.force_in_world_n(at.side()) - at.force_n()).norm() < 1e-14);
    }
}

#[test]
fn a_free_whisker_is_drawn_in_its_natural_shape() {
    let straight = shape_in_hub(&rod(0.0), &HubLoad::default(), Method::Auto, 5);
    assert_eq!(straight.len(), 5);
    assert!((straight[4] - Vector2::new(0.25, 0.0)).norm() < 1e-15);
    // An arc of radius 1/κ₀.
    let arc = shape_in_hub(&rod(4.0), &HubLoad::default(), Method::Auto, 50);
    assert!((arc[49] - Vector2::new(1.0_f64.sin(), 1.0 - 1.0_f64.cos()) / 4.0).norm() < 1e-9);
    // Beyond the contact a bent straight rod continues straight.
    let bent = shape_in_hub(&rod(0.0), &load(-0.01, 0.5, 0.04), Method::Auto, 101);
    let (a, b, c) = (bent[80], bent[90], bent[100]);
    assert!(((b - a) - (c - b)).norm() < 1e-12 && 0.01 < bent[100].y.abs());
}

#[test]
fn rods_that_are_none_are_refused() {
    assert!(matches!(Rod { length_m: f64::NAN, ..rod(0.0) }.check(), Err(Error::NotPositive { .. })));
    assert!(matches!(Rod { diameters_m: [0.001, -0.1], ..rod(0.0) }.check(), Err(Error::Negative { .. })));
    assert!(matches!(Rod { diameters_m: [f64::NAN, 0.0], ..rod(0.0) }.check(), Err(Error::Negative { .. })));
    assert!(rod(f64::INFINITY).check().is_err());
    let taper = |taper| Rod { stiffness: Stiffness::Taper { ei_base_n_m2: 1.0, taper }, ..rod(0.0) }.check();
    assert!(taper(1.0).is_err() && taper(f64::NAN).is_err() && taper(0.9).is_ok() && taper(-0.5).is_ok());
    let exchanged = taper(1.0 - 0.8 / 0.034).expect_err("a tip 24 times as thick as the base");
    assert!(exchanged.to_string().contains("are the two exchanged?"), "{exchanged}");
}
