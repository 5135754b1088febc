//! Two contacts at once: the load of a whisker that leans on two pegs, integrated here independently of the library, is distinguished from one.

use crate::noise::Chance;
use resight_core::statistics::SplitMix64;
use resight_whisker::contact::Method;
use resight_whisker::estimate::{Mode, Status};
use resight_whisker::events::{EventKind, events, has_several_contacts};
use resight_whisker::friction::{Mu, Record, solve_record};
use resight_whisker::{Cell, HubLoad, Rod, Sample};

const LENGTH_M: f64 = 0.25;
const EI_N_M2: f64 = 9.817_477e-3;

fn cell() -> Cell {
    Cell {
        force_sigma_n: 3.125e-3,
        torque_sigma_n_m: 1.5625e-5,
        force_step_n: 3.125e-3,
        torque_step_n_m: 1.5625e-5,
        ..Cell::default()
    }
}

/// The load at the clamp of a whisker pressed across itself at two places, `[arc length, force]`, the outer one first: EI θ' = M,
/// M' = fx sin θ − fy cos θ from the outer contact back to the clamp, by the classical Runge–Kutta steps.
fn load_of(outer: [f64; 2], inner: [f64; 2]) -> HubLoad {
    load_from(outer[0], [0.0, outer[1]], inner)
}

/// The tip pressed by a force that leans from its normal, and a second contact across the whisker before it.
fn leaning_tip(force_n: f64, lean_rad: f64, inner_m: f64, inner_n: f64) -> HubLoad {
    load_from(LENGTH_M, [force_n * lean_rad.sin(), force_n * lean_rad.cos()], [inner_m, inner_n])
}

/// The outer force by its components along and across the whisker at its contact.
fn load_from(outer_m: f64, mut force: [f64; 2], inner: [f64; 2]) -> HubLoad {
    const STEPS: usize = 200;
    let slope = |[theta, moment]: [f64; 2], [fx, fy]: [f64; 2]| {
        [moment / EI_N_M2, fx * theta.sin() - fy * theta.cos()]
    };
    let along = |mut state: [f64; 2], force: [f64; 2], length: f64| {
        let h = -length / STEPS as f64;
        for _ in 0..STEPS {
            let moved = |k: [f64; 2], share: f64| [state[0] + share * h * k[0], state[1] + share * h * k[1]];
            let k1 = slope(state, force);
            let k2 = slope(moved(k1, 0.5), force);
            let k3 = slope(moved(k2, 0.5), force);
            let k4 = slope(moved(k3, 1.0), force);
            for i in 0..2 {
                state[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
        }
        state
    };
    let at_inner = along([0.0, 0.0], force, outer_m - inner[0]);
    force[0] -= inner[1] * at_inner[0].sin();
    force[1] += inner[1] * at_inner[0].cos();
    let [theta, moment] = along(at_inner, force, inner[0]);
    let (sin, cos) = theta.sin_cos();
    HubLoad { fx_n: cos * force[0] + sin * force[1], fy_n: -sin * force[0] + cos * force[1], mz_n_m: moment }
}

/// The loads themselves: without the inner force they are those of one frictionless contact.
#[test]
fn one_contact_is_found_where_it_is() {
    let rod = Rod::uniform(LENGTH_M, EI_N_M2).expect("a rod");
    let load = load_of([0.2, 0.5], [0.1, 0.0]);
    let at = resight_whisker::contact::contact_in_hub(&rod, &load, Method::Auto).expect("a contact");
    assert!((at.s_m - 0.2).abs() < 1e-9 && at.friction_angle_rad.abs() < 1e-8, "{at:?}");
}

/// However many they are, contacts without friction between clamp and tip look like one without friction: M²/2EI + F·t passes a force
/// across the whisker unchanged. One load does not tell them apart; this is why a leap is an event of its own.
#[test]
fn contacts_without_friction_conserve_h() {
    let rod = Rod::uniform(LENGTH_M, EI_N_M2).expect("a rod");
    for (force, inner_m) in [(0.3, 0.1), (0.8, 0.05), (0.2, 0.15)] {
        let load = load_of([0.2, 0.5], [inner_m, force]);
        let at = resight_whisker::contact::contact_in_hub(&rod, &load, Method::Auto).expect("a contact");
        assert!(at.friction_angle_rad.abs() < 1e-7 && at.s_m < 0.199, "{at:?}");
    }
}

/// Forty samples of one contact, then twenty of two: the record.
fn second_contact(loads: impl Fn(usize) -> HubLoad, mu: Mu, chance: &mut Chance) -> (Vec<Sample>, Record) {
    let rod = Rod::uniform(LENGTH_M, EI_N_M2).expect("a rod");
    let samples: Vec<Sample> = (0..60)
        .map(|i| Sample { load: chance.load(&loads(i), &cell()), sample: i as u32, ..Sample::default() })
        .collect();
    let record = solve_record(&rod, &cell(), &samples, mu, Method::Auto).expect("a record");
    (samples, record)
}

/// A second peg takes a share of the load: the contact leaps at that sample, and at no other.
#[test]
fn a_second_contact_without_friction_is_a_leap() {
    let mut chance = Chance(SplitMix64::new(21));
    for (share, inner_m) in [(0.5, 0.1), (1.0, 0.1), (1.0, 0.15)] {
        let (mut found, mut other) = (0, 0);
        for _ in 0..50 {
            let force = |i: usize| 0.2 + 0.01 * i as f64;
            let loads = |i| load_of([0.2, force(i)], [inner_m, if i < 40 { 0.0 } else { share * force(i) }]);
            let (samples, record) = second_contact(loads, Mu::Auto, &mut chance);
            for event in events(&cell(), &samples, &record) {
                found += i32::from(event.kind == EventKind::Leap && event.index == 40);
                other += i32::from(event.kind == EventKind::Leap && event.index != 40);
            }
        }
        println!(
            "inner force {share} of the outer at {inner_m} m: {found} of 50 leaps found, {other} elsewhere"
        );
        assert!(45 <= found && other <= 1, "{share} {inner_m}: {found} {other}");
    }
}

/// The tip on one object, the whisker on another, and no friction: neither constraint holds, and every such sample is flagged. (Where
/// the coefficient of friction is unknown too, a whisker that sticks explains the load as well.)
#[test]
fn a_second_contact_before_the_tip_is_flagged() {
    let mut chance = Chance(SplitMix64::new(23));
    let (mut single, mut double) = (0, 0);
    for _ in 0..10 {
        let force = |i: usize| 0.3 + 0.01 * i as f64;
        // At the tip the force is normal to the object: it leans back by 0.3 rad.
        let loads = |i| match i {
            0..40 => load_of([0.2, force(i)], [0.1, 0.0]),
            _ => leaning_tip(force(i), -0.3, 0.12, 0.5 * force(i)),
        };
        let (_, record) = second_contact(loads, Mu::Known(0.0), &mut chance);
        let several = |range: std::ops::Range<usize>| {
            range.filter(|i| has_several_contacts(&record.estimates[*i], record.tests[*i].as_ref())).count()
        };
        single += several(0..40);
        double += several(40..60);
    }
    println!("{double} of 200 flagged, {single} of 400 single ones");
    // One right sample in 10 000 is contradicted by the constraints.
    assert!(195 <= double && single <= 1, "{double} {single}");
}

/// Nothing breaks the record: no number, no load, no sense.
#[test]
fn hostile_rows_keep_their_place() {
    let rod = Rod::uniform(LENGTH_M, EI_N_M2).expect("a rod");
    let loads = [
        [f64::NAN, 0.1, 0.01],
        [0.0, 0.0, 0.0],
        [f64::INFINITY, 0.0, 0.0],
        [1e300, -1e300, 1e300],
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 0.0, 0.02],
        [0.0, 0.5, 0.0],
        [-0.1, 0.3, 0.04],
        [1e-300, 1e-300, 1e-300],
    ];
    let samples: Vec<Sample> = loads
        .iter()
        .map(|[fx_n, fy_n, mz_n_m]| Sample {
            load: HubLoad { fx_n: *fx_n, fy_n: *fy_n, mz_n_m: *mz_n_m },
            ..Sample::default()
        })
        .collect();
    for cell in [cell(), Cell::default()] {
        for mu in [Mu::Auto, Mu::Known(0.0), Mu::Known(0.4)] {
            let record = solve_record(&rod, &cell, &samples, mu, Method::Auto).expect("a record");
            assert_eq!(record.estimates.len(), samples.len());
            assert!(record.mu.is_finite() && record.mu_sigma.is_finite());
            for (i, estimate) in record.estimates.iter().enumerate() {
                assert!(estimate.mode_probability.is_finite(), "{i}: {estimate:?}");
                let Some(contact) = &estimate.contact else { continue };
                if estimate.status == Status::Ok {
                    assert!(contact.x_in_world.iter().all(|v| v.is_finite()), "{i}: {estimate:?}");
                    assert!(contact.covariance.iter().all(|v| v.is_finite()), "{i}: {estimate:?}");
                }
            }
            assert_ne!(record.estimates[0].mode, Mode::Tip);
        }
    }
    let refused = solve_record(&rod, &cell(), &samples, Mu::Known(f64::NAN), Method::Auto);
    assert!(refused.is_err());
    assert!(solve_record(&rod, &cell(), &samples, Mu::Known(-0.1), Method::Auto).is_err());
}

/// A whisker that slides out, sticks and slides back: both directions and sticking are found, and the coefficient with them.
#[test]
fn both_directions_of_slip_are_found() {
    let rod = Rod::uniform(LENGTH_M, EI_N_M2).expect("a rod");
    let mut chance = Chance(SplitMix64::new(22));
    let angle = 0.3_f64.atan();
    let samples: Vec<Sample> = (0..90)
        .map(|i| {
            let force = 0.5;
            let lean = match i {
                0..40 => angle,
                40..50 => angle * (1.0 - 0.2 * f64::from(i - 40)),
                _ => -angle,
            };
            Sample {
                load: chance.load(&leaning(0.17, force, lean), &cell()),
                sample: i as u32,
                ..Sample::default()
            }
        })
        .collect();
    let record = solve_record(&rod, &cell(), &samples, Mu::Auto, Method::Auto).expect("a record");
    println!("mu {:.4} ± {:.4}, {} states", record.mu, record.mu_sigma, record.states.len());
    assert_eq!(record.states.len(), 4);
    // Three sigmas; the estimate of the record is that good.
    assert!((record.mu - 0.3).abs() < 3.0 * record.mu_sigma && record.mu_sigma < 0.003);
    let sticking = |i: usize| record.tests[i].expect("in contact").stick_probability;
    assert!(0.9 < sticking(45) && sticking(20) < 0.1 && sticking(70) < 0.1);
    let inconsistent = record.estimates.iter().filter(|e| e.status == Status::Inconsistent).count();
    assert_eq!(inconsistent, 0);
}

/// One contact whose force leans from the whisker's normal towards its tip.
fn leaning(s_m: f64, force_n: f64, lean_rad: f64) -> HubLoad {
    load_from(s_m, [force_n * lean_rad.sin(), force_n * lean_rad.cos()], [0.0, 0.0])
}

/// Mode probabilities are frequencies: modes drawn by the very prior that is stated, near the tip and near no lean, where loads fit both.
#[test]
fn mode_probabilities_are_frequencies() {
    const DRAWS: u32 = 20_000;
    let rod = Rod::uniform(LENGTH_M, EI_N_M2).expect("a rod");
    let mut chance = Chance(SplitMix64::new(24));
    // Prior masses: mid 0.9 × a tenth of the length, tip 0.1 × 0.2 rad of the half turn.
    let (mid, tip) = (0.9 * 0.1, 0.1 * 0.2 / std::f64::consts::PI);
    let mut is_tip = Vec::new();
    let samples: Vec<Sample> = (0..DRAWS)
        .map(|sweep| {
            is_tip.push(chance.uniform() < tip / (mid + tip));
            let load = match is_tip.last() {
                Some(true) => leaning(LENGTH_M, 0.3, 0.2 * chance.uniform() - 0.1),
                _ => leaning(LENGTH_M * (0.9 + 0.1 * chance.uniform()), 0.3, 0.0),
            };
            // Every sample a sweep of its own: nothing but the load tells.
            Sample { load: chance.load(&load, &cell()), sweep, ..Sample::default() }
        })
        .collect();
    let record = solve_record(&rod, &cell(), &samples, Mu::Known(0.0), Method::Auto).expect("a record");
    let in_doubt = record.tests.iter().zip(&is_tip).filter_map(|(tests, is_tip)| {
        let p = tests.expect("in contact").tip_probability;
        (0.02 < p && p < 0.98).then_some((p, f64::from(*is_tip)))
    });
    let (mut count, mut expected, mut seen, mut variance) = (0, 0.0, 0.0, 0.0);
    for (p, is_tip) in in_doubt {
        count += 1;
        expected += p;
        seen += is_tip;
        variance += p * (1.0 - p);
    }
    println!("{count} in doubt: {expected:.1} tips expected, {seen} seen, sigma {:.1}", f64::sqrt(variance));
    assert!(300 < count);
    // Four sigmas, and a tenth for what the evidence leaves out: curvature of the surfaces, the ends of the ranges.
    assert!((expected - seen).abs() < 4.0 * f64::sqrt(variance) + 0.1 * seen, "{expected} {seen}");
}
