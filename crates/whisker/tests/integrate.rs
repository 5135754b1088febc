//! Contacts by integration from the hub: against recorded truth, closed form, 30-digit solutions and differences.

use crate::real_support::sets;
use nalgebra::Vector2;
use proptest::prelude::*;
use resight_whisker::contact::{HubContact, NoZero, closed_form, curved, integrate};
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::{HubLoad, Rod};

const LENGTH_M: f64 = 0.25;

fn load([fx_n, fy_n, mz_n_m]: [f64; 3]) -> HubLoad {
    HubLoad { fx_n, fy_n, mz_n_m }
}

fn rod(stiffness: Stiffness, per_m: f64) -> Rod {
    let intrinsic_curvature = IntrinsicCurvature::Constant { per_m };
    Rod { length_m: LENGTH_M, stiffness, intrinsic_curvature, diameters_m: [0.0, 0.0] }
}

fn cone(ei_base_n_m2: f64, taper: f64, per_m: f64) -> Rod {
    rod(Stiffness::Taper { ei_base_n_m2, taper }, per_m)
}

fn bumpy() -> Rod {
    let s_m = vec![0.0, 0.07, 0.1, LENGTH_M];
    Rod {
        length_m: LENGTH_M,
        stiffness: Stiffness::Profile { s_m: s_m.clone(), ei_n_m2: vec![0.02, 0.012, 0.015, 0.003] },
        intrinsic_curvature: IntrinsicCurvature::Profile { s_m, per_m: vec![0.0, 1.5, -2.0, 4.0] },
        diameters_m: [0.0, 0.0],
    }
}

fn bent_by(rod: &Rod, step_per_m: f64) -> Rod {
    let mut bent = rod.clone();
    match &mut bent.intrinsic_curvature {
        IntrinsicCurvature::Constant { per_m } => *per_m += step_per_m,
        IntrinsicCurvature::Profile { per_m, .. } => per_m.iter_mut().for_each(|v| *v += step_per_m),
    }
    bent
}

fn stiffer_by(rod: &Rod, factor: f64) -> Rod {
    let mut stiffer = rod.clone();
    match &mut stiffer.stiffness {
        Stiffness::Uniform { ei_n_m2 } => *ei_n_m2 *= factor,
        Stiffness::Taper { ei_base_n_m2, .. } => *ei_base_n_m2 *= factor,
        Stiffness::Profile { ei_n_m2, .. } => ei_n_m2.iter_mut().for_each(|ei| *ei *= factor),
    }
    stiffer
}

fn numbers(at: &HubContact) -> [f64; 5] {
    [at.x_in_hub.x, at.x_in_hub.y, at.theta_rad, at.s_m, at.friction_angle_rad]
}

/// 1e-12 L for uniform whiskers, whose truth is good to 1e-13; 1e-11 L for the taper, whose truth was checked to 2.5e-11.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn the_recorded_sets_without_noise() {
    let sets = sets();
    for set in &sets {
        let (mut worst, mut from_closed_form) = (0.0_f64, 0.0_f64);
        let tapered = set.name.contains("taper");
        for (sample, truth) in set.clean.iter().zip(&set.truth).filter(|(_, truth)| truth.contact) {
            let at = integrate::contact(&set.rod, &sample.load).expect("a contact");
            let x = sample.world_from_hub.apply(at.x_in_hub);
            let off = (x - Vector2::new(truth.x_m, truth.y_m)).norm().max((at.s_m - truth.s_m).abs());
            let turn = sample.world_from_hub.angle_rad + at.theta_rad - truth.theta_rad;
            let turn = (turn - std::f64::consts::TAU * (turn / std::f64::consts::TAU).round()).abs();
            worst = worst.max(off / set.rod.length_m).max(0.1 * turn);
            if !tapered {
                let closed = closed_form::straight(set.rod.ei_base_n_m2(), &sample.load).expect("a contact");
                from_closed_form =
                    from_closed_form.max((closed.x_in_hub - at.x_in_hub).norm() / set.rod.length_m);
            }
        }
        println!("{}: worst {worst:.1e} L, from the closed form {from_closed_form:.1e} L", set.name);
        assert!(worst < if tapered { 1e-11 } else { 1e-12 }, "{}: {worst:e}", set.name);
        assert!(from_closed_form < 1e-12, "{}: {from_closed_form:e}", set.name);
    }
}

/// Printed by docs/math/check/whisker_integrate.py: mpmath's integration of the hub-frame equations at 30 digits.
#[test]
#[allow(clippy::excessive_precision)]
fn thirty_digit_solutions() {
    let uniform = rod(Stiffness::Uniform { ei_n_m2: 0.0098 }, 0.0);
    let table = [
        (
            "uniform",
            uniform,
            [-0.4, 0.47, 0.0885],
            [
                0.13162476909190564218,
                0.066590896317010870444,
                0.70447066957840246831,
                0.15084356256017616105,
                -0.00064067853602936592874,
            ],
        ),
        (
            "taper",
            cone(0.02, 0.625, 0.0),
            [-0.2, 0.45, 0.08],
            [
                0.15074566283765616277,
                0.060822258615273633771,
                0.71002540007753745554,
                0.16671320719516399007,
                0.29180107049830835434,
            ],
        ),
        (
            "taper, right",
            cone(0.02, 0.625, 0.0),
            [-0.9, -0.35, -0.1375],
            [
                0.10663809985095110962,
                -0.11130740561351901292,
                -1.5518411325684070346,
                0.17502761579493712617,
                0.35193609458617278666,
            ],
        ),
        (
            "taper, curved",
            cone(0.02, 0.5, 2.5),
            [-0.1, 0.3, 0.045],
            [
                0.134447221315041787,
                0.046658336054874639,
                0.62175463388799634904,
                0.14478044806831576874,
                0.30000407949135415564,
            ],
        ),
        (
            "profile",
            bumpy(),
            [-0.15, 0.4, 0.055],
            [
                0.1287435941883317499,
                0.023350415497782000274,
                0.24114991036007646699,
                0.13136239229105309727,
                -0.1176207599104957454,
            ],
        ),
    ];
    for (name, rod, hub_load, want) in table {
        let got = numbers(&integrate::contact(&rod, &load(hub_load)).expect("a contact"));
        for (got, want) in got.iter().zip(want) {
            // Lengths of 0.1 m and angles of 1 rad alike to 1e-12: the stated error of the series.
            assert!((got - want).abs() < 1e-12, "{name}: {got} instead of {want}");
        }
    }
}

/// Truncation h² and rounding ε/h of the differences leave 1e-7 of the largest derivative of a row.
#[test]
fn derivatives_match_central_differences() {
    let cases = [
        (rod(Stiffness::Uniform { ei_n_m2: 0.0098 }, 0.0), [-0.4, 0.47, 0.0885]),
        (cone(0.02, 0.625, 0.0), [-0.2, 0.45, 0.08]),
        (cone(0.02, 0.625, 0.0), [-0.9, -0.35, -0.1375]),
        (cone(0.02, 0.5, 2.5), [-0.1, 0.3, 0.045]),
        (cone(0.02, 0.5, 0.0), [-0.01, 0.1, 0.0255]), // Beyond the tip.
        (bumpy(), [-0.15, 0.4, 0.055]),
    ];
    for (rod, at) in cases {
        let (contact, by_load) = integrate::contact_with_derivatives(&rod, &load(at)).expect("a contact");
        assert_eq!(contact, integrate::contact(&rod, &load(at)).expect("a contact"));
        for column in 0..3 {
            let step = 1e-5 * if column == 2 { 0.1 } else { 0.5 };
            let ends = [step, -step].map(|step| {
                let mut moved = at;
                moved[column] += step;
                numbers(&integrate::contact(&rod, &load(moved)).expect("a contact"))
            });
            for row in 0..5 {
                let difference = (ends[0][row] - ends[1][row]) / (2.0 * step);
                let off = (by_load[(row, column)] - difference).abs() / by_load.row(row).amax();
                assert!(off < 2e-7, "{at:?}, row {row}, column {column}: {off:e}");
            }
        }
        let by_curvature = integrate::derivatives(&rod, &load(at), 0).expect("a contact").2;
        let ends = [1e-5, -1e-5]
            .map(|step| numbers(&integrate::contact(&bent_by(&rod, step), &load(at)).expect("a contact")));
        for row in 0..5 {
            let difference = (ends[0][row] - ends[1][row]) / 2e-5;
            assert!((by_curvature[row] - difference).abs() < 1e-6 * by_curvature.amax(), "{at:?}, row {row}");
        }
        // A common factor on load and stiffness changes nothing: −by_load · load is the derivative by ln EI.
        let stiffer = [1e-5, -1e-5].map(|step: f64| {
            numbers(&integrate::contact(&stiffer_by(&rod, step.exp()), &load(at)).expect("a contact"))
        });
        for row in 0..5 {
            let by_ln_ei = -(by_load.row(row) * load(at).to_vector())[0];
            let difference = (stiffer[0][row] - stiffer[1][row]) / 2e-5;
            assert!((by_ln_ei - difference).abs() < 1e-6, "{at:?}, row {row}");
        }
    }
}

/// A cone given as a table is the same cone, whatever knots divide it: knots cost no accuracy.
#[test]
fn knots_cost_no_accuracy() {
    let whole = cone(0.02, 0.625, 1.0);
    let s_m: Vec<f64> = (0..=13).map(|i| LENGTH_M * (f64::from(i) / 13.0).powf(1.3)).collect();
    let ei_n_m2 = s_m.iter().map(|s| whole.ei_n_m2_at(*s)).collect();
    let table = Rod { stiffness: Stiffness::Profile { s_m, ei_n_m2 }, ..whole.clone() };
    table.check().expect("a rod");
    for at in [[-0.2, 0.45, 0.08], [-0.05, -0.15, -0.02], [-0.01, 0.1, 0.0255]] {
        let [a, b] =
            [&whole, &table].map(|rod| numbers(&integrate::contact(rod, &load(at)).expect("a contact")));
        for (a, b) in a.iter().zip(b) {
            // Two errors of 1e-12, at the most sensitive load fivefold.
            assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
    }
}

/// A contact just beyond the tip is found where the whisker would go on, and moves smoothly with the load.
#[test]
fn beyond_the_tip_the_whisker_goes_on() {
    let rod = cone(0.02, 2.0 / 3.0, 0.0);
    let s_m = |share: f64| {
        let at = load([-1e-5, 0.004, 0.004 * share * LENGTH_M]);
        integrate::contact(&rod, &at).expect("a contact").s_m
    };
    // The bend shortens the lever by a thousandth or two, so the tip is met a little before the moment is F L.
    let step = 1e-4;
    let [before, behind] = [0.9984, 1.001].map(|share| (s_m(share + step) - s_m(share)) / (step * LENGTH_M));
    assert!(s_m(0.9984) < LENGTH_M && LENGTH_M < s_m(1.001), "{} {}", s_m(0.9984), s_m(1.001));
    assert!((behind / before - 1.0).abs() < 0.01, "{before} {behind}");
    let without_force = load([0.0, 1e-5, 0.0011]);
    assert_eq!(integrate::contact(&rod, &without_force), Err(NoZero::NeverVanishes));
}

/// Pulled along itself, the whisker waves: the moment vanishes again and again, half a wave apart.
#[test]
fn later_zeros_of_a_wave() {
    let rod = rod(Stiffness::Uniform { ei_n_m2: 0.0098 }, 0.0);
    // u = K(k) − F(φ₀) at the first zero; 2K(k) between zeros: here k is small, and 2K is π (1 + k²/4).
    let pushed = load([-5.0, 0.0, 0.002]);
    let zeros = integrate::zeros(&rod, &pushed, 100);
    let closed = closed_form::straight(0.0098, &pushed).expect("a contact");
    assert!((zeros[0].x_in_hub - closed.x_in_hub).norm() < 1e-12 * LENGTH_M);
    let spacing = std::f64::consts::PI * (0.0098_f64 / 5.0).sqrt() * (1.0 + closed.modulus_squared / 4.0);
    assert_eq!(zeros.len(), 2);
    assert!((zeros[1].s_m - zeros[0].s_m - spacing).abs() < 1e-5 * spacing);
    assert!(integrate::zeros(&rod, &load([-0.4, 0.47, 0.0885]), 100).len() == 1);
    let (second, by_load, _) = integrate::derivatives(&rod, &pushed, 1).expect("a second zero");
    assert_eq!(second, zeros[1]);
    let ends = [1e-7, -1e-7].map(|step| integrate::zeros(&rod, &load([-5.0, step, 0.002]), 100)[1].s_m);
    let difference = (ends[0] - ends[1]) / 2e-7;
    assert!((by_load[(3, 1)] - difference).abs() < 1e-6 * difference.abs(), "{difference} {by_load}");
}

#[test]
fn loads_without_a_contact_say_why() {
    let rod = cone(0.02, 0.625, 0.0);
    let of = |at| integrate::contact(&rod, &load(at));
    assert_eq!(of([0.0, 0.0, 0.0]), Err(NoZero::Free));
    assert_eq!(of([0.0, 0.0, 0.01]), Err(NoZero::NeverVanishes));
    assert_eq!(of([0.1, -0.1, 0.01]), Err(NoZero::NeverVanishes));
    assert_eq!(of([f64::NAN, 0.1, 0.01]), Err(NoZero::NotFinite));
    assert_eq!(of([f64::INFINITY, 0.1, 0.01]), Err(NoZero::NotFinite));
}

/// EI and κ₀ between knots: the fourth root of EI is linear, and so is κ₀.
#[test]
fn profiles_between_knots() {
    let rod = bumpy();
    let middle = 0.5 * (0.012_f64.powf(0.25) + 0.015_f64.powf(0.25));
    assert!((rod.ei_n_m2_at(0.085) - middle.powi(4)).abs() < 1e-15);
    assert!((rod.curvature_per_m_at(0.085) + 0.25).abs() < 1e-14);
    assert!((rod.ei_n_m2_at(0.4) - 0.003).abs() < 1e-15);
    assert_eq!(rod.curvature_per_m_at(0.4), 4.0);
}

#[test]
fn tables_that_are_no_profile_are_refused() {
    for (s_m, ei_n_m2) in [
        (vec![], vec![]),
        (vec![0.0], vec![0.01]),
        (vec![0.0, 0.1], vec![0.01, 0.01]),
        (vec![0.01, 0.25], vec![0.01, 0.01]),
        (vec![0.0, 0.1, 0.1, 0.25], vec![0.01; 4]),
        (vec![0.0, 0.25], vec![0.01, 0.01, 0.01]),
        (vec![0.0, f64::NAN, 0.25], vec![0.01; 3]),
        (vec![0.0, 0.25], vec![0.01, -0.01]),
    ] {
        assert!(rod(Stiffness::Profile { s_m, ei_n_m2 }, 0.0).check().is_err());
    }
    assert!(bumpy().check().is_ok());
    assert!(cone(0.02, 0.5, f64::NAN).check().is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, rng_seed: proptest::test_runner::RngSeed::Fixed(20041), ..ProptestConfig::default() })]

    /// The same contact, and the same refusals, as the closed form: any direction, either side, far beyond the tip. Errors grow
    /// with the arc and with the nearness to the modulus 1, where a zero moves away for ever.
    #[test]
    fn uniform_whiskers_as_by_elliptic_integrals(angle in -3.1..3.1_f64, size in -2.0..1.3_f64, c in -1.1..1.1_f64) {
        let (ei, force) = (0.0098, 10_f64.powf(size));
        let at = load([force * angle.cos(), force * angle.sin(), 2.0 * c * (ei * force).sqrt()]);
        let closed = closed_form::straight(ei, &at);
        let got = integrate::contact(&rod(Stiffness::Uniform { ei_n_m2: ei }, 0.0), &at);
        match closed {
            Ok(closed) if closed.s_m < 8.0 * LENGTH_M && closed.modulus_squared < 0.999 => {
                let got = got.expect("a contact");
                let scale = LENGTH_M.max(closed.s_m) / (1.0 - closed.modulus_squared);
                prop_assert!((got.x_in_hub - closed.x_in_hub).norm() < 1e-11 * scale, "{got:?} {closed:?}");
                prop_assert!((got.s_m - closed.s_m).abs() < 1e-11 * scale);
            }
            Ok(_) => {}
            Err(why) => prop_assert_eq!(got, Err(why)),
        }
    }

    /// A constant curvature, rods that keep turning included: as by elliptic integrals where those find the zero within 8 lengths,
    /// and no zero within 8 lengths where they find none.
    #[test]
    fn curved_whiskers_as_by_elliptic_integrals(
        angle in -3.1..3.1_f64, size in -2.0..1.0_f64, c in -2.5..2.5_f64, bend in -12.0..12.0_f64,
    ) {
        let (ei, force) = (0.0098, 10_f64.powf(size));
        let at = load([force * angle.cos(), force * angle.sin(), 2.0 * c * (ei * force).sqrt()]);
        let got = integrate::contact(&rod(Stiffness::Uniform { ei_n_m2: ei }, bend), &at);
        match curved::contact(ei, bend, &at) {
            // At a zero that the moment nearly grazes (F·t = ±F) an error of the load is one of its root in s.
            Ok(closed) if closed.s_m < 8.0 * LENGTH_M && closed.friction_angle_rad.abs() < 1.5 => {
                let got = got.expect("a contact");
                let off = (got.x_in_hub - closed.x_in_hub).norm().max((got.s_m - closed.s_m).abs());
                prop_assert!(off < 1e-9 * LENGTH_M.max(closed.s_m), "{got:?} {closed:?}");
            }
            Ok(_) => {}
            Err(_) => prop_assert!(got.is_err() || 8.0 * LENGTH_M < got.unwrap().s_m, "{got:?}"),
        }
    }

    /// Whatever the load: an answer of numbers or a reason.
    #[test]
    fn any_load_has_an_answer(exponents in [-320.0..308.0_f64, -320.0..308.0, -320.0..308.0], signs in 0..8_u8) {
        let entry = |i: usize| 10_f64.powf(exponents[i]) * if signs >> i & 1 == 0 { 1.0 } else { -1.0 };
        let at = load([entry(0), entry(1), entry(2)]);
        for rod in [rod(Stiffness::Uniform { ei_n_m2: 0.0098 }, 0.0), cone(0.02, 0.9, -3.0), bumpy()] {
            if let Ok((contact, by_load)) = integrate::contact_with_derivatives(&rod, &at) {
                prop_assert!(numbers(&contact).iter().all(|v| v.is_finite()));
                prop_assert!(by_load.iter().all(|v| v.is_finite()));
            }
        }
    }
}
