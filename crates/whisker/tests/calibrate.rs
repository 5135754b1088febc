//! A rig that is wrong in every way at once is put right by its own sweeps, over simulated objects.
//!
//! That the simulator is right, `simulate.rs` says; the recorded sets are in `calibrate_sets.rs`, drift in `drift.rs`.

use crate::calibrate_support::*;
use nalgebra::{Vector2, Vector3};
use resight_whisker::calibrate::{
    Calibration, Covariance, Gravity, Object, Options, Parameter, Priors, Role, UnknownReason, Values,
    calibrate, tare, unit_weight,
};
use resight_whisker::contact::Method;
use resight_whisker::estimate::Mode;
use resight_whisker::friction::{FrictionAngle, constrain};
use resight_whisker::simulate::Motion;
use resight_whisker::{Error, Rod, Sample, Shape};

/// Rounding of a product or two.
#[test]
fn meaning_undoes_reading() {
    let record = ideal(&steel(), &circle(), 0.3);
    let mut all = wrong();
    for (parameter, value) in
        [(Parameter::ForceGain, -0.02), (Parameter::CellOriginX, 2e-3), (Parameter::CellOriginY, -1e-3)]
    {
        all[parameter.index()] = value;
    }
    let calibration = Calibration { values: all, ..Calibration::ideal(&record.rod) };
    for sample in &record.samples {
        let meant = calibration.apply(&as_read(&all, sample));
        let (a, b) = (meant.load.to_vector(), sample.load.to_vector());
        assert!((a - b).norm() <= 1e-14 * (1.0 + b.norm()), "{a} {b}");
        assert!((meant.world_from_hub.angle_rad - sample.world_from_hub.angle_rad).abs() < 1e-14);
        assert!((meant.world_from_hub.x_m - sample.world_from_hub.x_m).abs() < 1e-16);
    }
}

/// Errors of the parameters are what their covariance says, object known, known in part, or unknown: 20 records each. The mean of
/// n χ² of k degrees of freedom has σ √(2/(n k)) per degree, 0.12 or less here; tested at 4 σ.
#[test]
fn parameters_scatter_as_their_covariance_says() {
    let (rod, cell) = (steel(), cell());
    let options = Options::of_a_new_rig(&cell);
    for (shape, mu, object, without) in [
        (circle(), 0.0, Object::Known(circle()), &HUB[..0]),
        (square(30.0), 0.0, Object::Known(square(30.0)), &HUB[..0]),
        (circle(), 0.3, Object::KnownClass(circle()), &HUB[1..]),
        (square(0.0), 0.0, Object::Unknown, &HUB[..]),
    ] {
        let record = ideal(&rod, &shape, mu);
        let mut truth = wrong();
        truth[Parameter::FrictionAngle.index()] = mu.atan();
        let (mut sum, mut count, mut chi2, mut degrees_of_freedom) = (0.0, 0.0, 0.0, 0.0);
        for seed in 1..=20 {
            let samples = read(&truth, &record.samples, &cell, seed);
            let found = calibrate(&rod, &cell, &samples, &object, &options).expect("a calibration");
            let (nees, k) = nees(&found, &truth, &free_but(&found.priors, without));
            (sum, count) = (sum + nees, count + k);
            (chi2, degrees_of_freedom) =
                (chi2 + found.chi2, degrees_of_freedom + found.degrees_of_freedom as f64);
        }
        println!(
            "{object:?}: NEES per parameter {:.3}, chi2 per dof {:.4}",
            sum / count,
            chi2 / degrees_of_freedom
        );
        assert!((sum / count - 1.0).abs() < 4.0 * (2.0 / count).sqrt(), "NEES {:.3}", sum / count);
        assert!((chi2 / degrees_of_freedom - 1.0).abs() < 0.03, "chi2 {:.4}", chi2 / degrees_of_freedom);
    }
}

/// Rigs drawn from the whole of the priors: 10 % of stiffness, half a degree, a millimetre. Every one is put right.
#[test]
fn rigs_as_wrong_as_the_priors_allow_are_put_right() {
    let cell = cell();
    let priors = Priors::of_a_new_rig(&cell);
    for seed in 1..=8_u32 {
        // Quasi-random within ±1.5 σ.
        let mut truth = Values::zeros();
        for parameter in priors.free() {
            let share =
                (0.7548776662 * f64::from(seed) + 0.5698402909 * (parameter.index() as f64 + 1.0)).fract();
            truth[parameter.index()] = priors.sigma(parameter) * (3.0 * share - 1.5);
        }
        let friction = truth[Parameter::FrictionAngle.index()].abs().min(0.4);
        truth[Parameter::FrictionAngle.index()] = friction;
        let stiffness = truth[Parameter::Stiffness.index()].exp();
        let (nominal, own) =
            (steel(), Rod::uniform(0.25, steel().ei_base_n_m2() * stiffness).expect("a rod"));
        let record = ideal(&own, &square(20.0), friction.tan());
        let samples = read(&truth, &record.samples, &cell, u64::from(seed));
        let known = Object::Known(square(20.0));
        let found =
            calibrate(&nominal, &cell, &samples, &known, &Options::of_a_new_rig(&cell)).expect("a rig");
        let (nees, k) = nees(&found, &truth, &free_but(&found.priors, &[]));
        println!("{seed}: NEES {nees:.1} of {k}, p {:.3}, {:?}", found.p_value, found.counts());
        // χ² of 10 exceeds 29.6 once in a thousand.
        assert!(nees < 29.6 && found.is_consistent, "{seed}: {nees} {:?}", found.calibration.values);
    }
}

/// What an unknown object cannot tell is named, keeps its prior uncertainty, and widens every contact; what it can is determined.
#[test]
fn an_unknown_object_leaves_the_hub_open_and_says_so() {
    let (rod, cell) = (steel(), cell());
    let record = ideal(&rod, &square(30.0), 0.0);
    let samples = read(&wrong(), &record.samples, &cell, 7);
    let found = calibrate(&rod, &cell, &samples, &Object::Unknown, &Options::of_a_new_rig(&cell))
        .expect("a calibration");
    let mut named: Vec<Parameter> = found.undetermined.iter().map(|open| open.combination[0].0).collect();
    named.sort();
    assert_eq!(named, HUB);
    for parameter in HUB {
        let (sigma, prior) = (found.calibration.sigma(parameter), found.priors.sigma(parameter));
        assert!((sigma / prior - 1.0).abs() < 1e-6, "{parameter:?}");
    }
    let truth: Vec<Option<Vector2<f64>>> = record.truth.iter().map(|t| t.map(|t| t.x_in_world)).collect();
    let honest = contact_nees(&found.calibration, &cell, &samples, &truth, true);
    let bold = contact_nees(&found.calibration, &cell, &samples, &truth, false);
    println!("contacts: NEES {honest:.2} with the calibration's uncertainty, {bold:.2} without");
    // All contacts share one offset of half a millimetre, half a prior σ: well within. Without, it would be a confident wrong contact.
    assert!(honest < 2.0 && 5.0 < bold, "{honest} {bold}");
}

/// How a contact moves with every parameter, raw and under the constraints of mid and tip, against central differences: where one
/// parameter alone is uncertain, the systematic covariance is that slope times itself. Readings without noise, so that the constraints
/// hold and first order is exact.
#[test]
fn contacts_move_with_parameters_as_differences_say() {
    let (rod, cell, h) = (steel(), cell(), 1e-6);
    let record = ideal(&rod, &square(30.0), 0.2);
    let mut values = wrong();
    values[Parameter::FrictionAngle.index()] = 0.2_f64.atan();
    let at = |values: &Values, sample: &Sample, mode: Mode| {
        let c = Calibration { values: *values, ..Calibration::ideal(&rod) };
        let friction = FrictionAngle { rad: c.value(Parameter::FrictionAngle), sigma_rad: 0.0 };
        let (own, meant) = (c.apply_to_cell(&cell), c.apply(sample));
        let seen = constrain(&c.rod(), &own, &meant, mode, friction, Method::Auto).expect("a contact");
        let contact = seen.contact.expect("a contact");
        Vector3::new(contact.x_in_world.x, contact.x_in_world.y, contact.theta_rad)
    };
    let is_tip = |i: &usize| record.truth[*i].is_some_and(|t| 1.0 - 1e-9 < t.s_m / rod.length_m);
    let is_left = |i: &usize| record.samples[*i].load.mz_n_m < -0.02;
    let tip = (0..record.truth.len()).find(is_tip).expect("a tip contact") + 3;
    let left = (0..record.truth.len()).find(is_left).expect("a contact on the left");
    for (index, mode) in [(40, Mode::Free), (40, Mode::Mid), (left, Mode::Mid), (tip, Mode::Tip)] {
        let (truth, sample) =
            (record.truth[index].expect("a contact"), as_read(&values, &record.samples[index]));
        assert_eq!(mode == Mode::Tip, (truth.s_m / rod.length_m - 1.0).abs() < 1e-9, "{truth:?}");
        for parameter in Parameter::ALL.into_iter().filter(|p| !matches!(p, Parameter::Weight)) {
            let moved = |by: f64| {
                let mut moved = values;
                moved[parameter.index()] += by;
                at(&moved, &sample, mode)
            };
            let slope = (moved(h) - moved(-h)) / (2.0 * h);
            let mut covariance = Covariance::zeros();
            covariance[(parameter.index(), parameter.index())] = 1.0;
            let alone = Calibration { values, covariance, ..Calibration::ideal(&rod) };
            let seen = alone.systematic_covariance(&cell, &sample, mode).expect("a contact");
            let expected = slope * slope.transpose();
            // The cell's own rotation is left out of the noise that the projection weighs by: 1e-3 of what the constraint moves.
            let error = (seen - expected).norm();
            assert!(error < 5e-3 * expected.norm() + 1e-9, "{mode:?} {parameter:?}: {seen} {expected}");
        }
    }
}

/// With the object known the contacts are back where they are.
#[test]
fn errors_are_calibrated_away() {
    let (rod, cell) = (steel(), cell());
    let truth_of = |record: &Ideal| -> Vec<Option<Vector2<f64>>> {
        record.truth.iter().map(|t| t.map(|t| t.x_in_world)).collect()
    };
    for (shape, object) in [(circle(), Object::Known(circle())), (square(30.0), Object::Known(square(30.0)))]
    {
        let record = ideal(&rod, &shape, 0.0);
        let samples = read(&wrong(), &record.samples, &cell, 11);
        let truth = truth_of(&record);
        let before = contact_nees(&Calibration::ideal(&rod), &cell, &samples, &truth, true);
        let found =
            calibrate(&rod, &cell, &samples, &object, &Options::of_a_new_rig(&cell)).expect("a calibration");
        let after = contact_nees(&found.calibration, &cell, &samples, &truth, true);
        println!("contacts: NEES {before:.1} as read, {after:.2} calibrated");
        // About 300 contacts: σ of the mean 0.12.
        assert!(10.0 < before && (after - 2.0).abs() < 0.5, "{before} {after}");
    }
}

/// One and the same object, of which nothing else is known: its class is found, its size measured, and the hub's angle with it.
#[test]
fn an_object_of_unknown_class_calibrates_too() {
    let (rod, cell) = (steel(), cell());
    for (shape, size_m) in [(circle(), 0.025), (square(30.0), 0.06)] {
        let record = ideal(&rod, &shape, 0.0);
        let samples = read(&wrong(), &record.samples, &cell, 3);
        let found = calibrate(&rod, &cell, &samples, &Object::Unclassified, &Options::of_a_new_rig(&cell))
            .expect("a calibration");
        let size = match (&found.object, &shape) {
            (Some(Shape::Circle { radius_m, .. }), Shape::Circle { .. }) => *radius_m,
            (Some(Shape::Rectangle { sides_m, .. }), Shape::Rectangle { .. }) => sides_m[0].min(sides_m[1]),
            (found, _) => panic!("{found:?}"),
        };
        let (nees, _) = nees(&found, &wrong(), &free_but(&found.priors, &HUB[1..]));
        println!("size {:.3} mm, NEES {nees:.1} of 8", 1e3 * size);
        // χ² of 8 exceeds 26.1 once in a thousand; sizes are good to some 0.02 mm along faces seen on both sides.
        assert!((size - size_m).abs() < 1e-4 && nees < 26.1, "{size} {nees}");
    }
}

/// An object that is not what it is said to be contradicts the record, instead of bending the rig.
#[test]
fn a_wrong_object_is_inconsistent() {
    let (rod, cell) = (steel(), cell());
    let record = ideal(&rod, &circle(), 0.0);
    let samples = read(&wrong(), &record.samples, &cell, 5);
    let options = Options::of_a_new_rig(&cell);
    for reported in [Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.026 }, square(0.0)] {
        let found = calibrate(&rod, &cell, &samples, &Object::Known(reported), &options).expect("an answer");
        println!("p {:.1e}, {:?}", found.p_value, found.counts());
        assert!(!found.is_consistent);
    }
}

/// Two objects in one record are not one.
#[test]
fn two_objects_are_not_taken_for_one() {
    let (rod, cell) = (steel(), cell());
    let mut samples = ideal(&rod, &circle(), 0.0).samples;
    let other = Shape::Circle { centre_m: Vector2::new(0.01, 0.17), radius_m: 0.02 };
    let more = ideal(&rod, &other, 0.0).samples;
    samples.extend(more.into_iter().map(|s| Sample { sweep: s.sweep + 3, ..s }));
    let samples = read(&wrong(), &samples, &cell, 5);
    let found = calibrate(&rod, &cell, &samples, &Object::Unclassified, &Options::of_a_new_rig(&cell))
        .expect("a rig");
    assert!(matches!(found.unknown_reason, Some(UnknownReason::NoShapeFits { .. })), "{:?}", found.object);
    assert!(found.object.is_none() && found.is_consistent);
    assert!(HUB.iter().all(|p| found.calibration.sigma(*p) == found.priors.sigma(*p)));
}

/// Cell origin, intrinsic curvature and both gains, where asked for: found, or named as the gauge they are.
#[test]
fn further_parameters_are_found_where_asked_for() {
    let (rod, cell) = (steel(), cell());
    let record = ideal(&rod, &square(30.0), 0.0);
    let truth = values(&[(Parameter::CellOriginX, 8e-4), (Parameter::CellOriginY, -5e-4)]);
    let samples = read(&truth, &record.samples, &cell, 3);
    let mut options = Options::of_a_new_rig(&cell);
    options.priors = options
        .priors
        .with(Parameter::CellOriginX, 2e-3)
        .with(Parameter::CellOriginY, 2e-3)
        .with(Parameter::Curvature, 0.2);
    let known = Object::Known(square(30.0));
    let found = calibrate(&rod, &cell, &samples, &known, &options).expect("a calibration");
    let (squared, k) = nees(&found, &truth, &free_but(&found.priors, &[]));
    println!("NEES {squared:.1} of {k}; open {:?}", found.undetermined);
    // χ² of 13 exceeds 34.5 once in a thousand.
    assert!(squared < 34.5 && found.undetermined.is_empty());
    assert!(found.calibration.sigma(Parameter::Curvature) < 0.02);

    let gauge = Options { priors: options.priors.with(Parameter::ForceGain, 0.03), ..options };
    let found = calibrate(&rod, &cell, &samples, &known, &gauge).expect("a calibration");
    let open = &found.undetermined[0];
    let named: Vec<Parameter> = open.combination.iter().map(|(p, _)| *p).collect();
    assert!(named.contains(&Parameter::ForceGain) && open.reason.contains("common factor"), "{open:?}");
}

/// The weight of the whisker, from free air at several hub angles, by tare and by calibration.
#[test]
fn weight_is_reported_from_zeros_where_the_hub_turns() {
    let cell = cell();
    let gravity = Gravity { direction_rad: -std::f64::consts::FRAC_PI_2, lever_m: 0.125 };
    let free: Vec<Sample> = (0..200)
        .map(|i| {
            let mut sample = Sample { sample: i, ..Sample::default() };
            sample.world_from_hub.angle_rad = 0.02 * f64::from(i);
            let load = unit_weight(&gravity, sample.world_from_hub.angle_rad) * 0.015;
            sample.load = resight_whisker::HubLoad::from_vector(&load);
            sample
        })
        .collect();
    let zero = values(&[(Parameter::ForceXZero, 0.01), (Parameter::TorqueZero, 5e-5)]);
    let samples = read(&zero, &free, &cell, 1);
    let tare = tare(&cell, &samples, Some(&gravity)).expect("a tare");
    let weight_sigma = tare.covariance[(3, 3)].sqrt();
    println!("weight {:.5} ± {weight_sigma:.5} N", tare.weight_n);
    assert!((tare.weight_n - 0.015).abs() < 4.0 * weight_sigma && weight_sigma < 1e-3);
    assert!((tare.zeros.x - 0.01).abs() < 4.0 * tare.covariance[(0, 0)].sqrt());
    let still = tare_of_still(&cell, &samples);
    assert_eq!(still.weight_n, 0.0);
}

fn tare_of_still(cell: &resight_whisker::Cell, samples: &[Sample]) -> resight_whisker::calibrate::Tare {
    let gravity = Gravity { direction_rad: 0.0, lever_m: 0.125 };
    let still: Vec<Sample> =
        samples.iter().map(|s| Sample { world_from_hub: Default::default(), ..*s }).collect();
    tare(cell, &still, Some(&gravity)).expect("a tare")
}

/// Nothing but air: zeros, and everything else named as open.
#[test]
fn free_air_alone_gives_the_zeros_and_nothing_else() {
    let (rod, cell) = (steel(), cell());
    let samples = read(&wrong(), &vec![Sample::default(); 50], &cell, 9);
    let found = calibrate(&rod, &cell, &samples, &Object::Unknown, &Options::of_a_new_rig(&cell))
        .expect("a calibration");
    assert_eq!(found.counts().free, 50);
    let zero = (found.calibration.value(Parameter::ForceXZero) - 0.01)
        / found.calibration.sigma(Parameter::ForceXZero);
    assert!(zero.abs() < 4.0, "{zero}");
    assert_eq!(found.undetermined.len(), found.priors.free().len() - 3);
}

/// Hostile input has a named error or is left out, never a panic or a NaN.
#[test]
fn hostile_records_are_answered() {
    let (rod, cell) = (steel(), cell());
    let options = Options::of_a_new_rig(&cell);
    let none = calibrate(&rod, &cell, &[], &Object::Unknown, &options);
    assert!(matches!(none, Err(Error::TooFew { seen: 0, .. })), "{none:?}");
    let bad = Options { priors: options.priors.with(Parameter::HubX, -1.0), ..options.clone() };
    assert!(matches!(calibrate(&rod, &cell, &[], &Object::Unknown, &bad), Err(Error::Negative { .. })));
    let negative = Options { mu: Some(-0.1), ..options.clone() };
    assert!(matches!(calibrate(&rod, &cell, &[], &Object::Unknown, &negative), Err(Error::Negative { .. })));

    let motion = Motion::translate([-0.14, 0.0], [0.26, 0.0], std::f64::consts::FRAC_PI_2);
    let record = ideal_along(&rod, &circle(), 0.0, &[motion]);
    let mut samples = read(&wrong(), &record.samples, &cell, 4);
    for (i, sample) in samples.iter_mut().enumerate() {
        match i % 10 {
            3 => sample.load.fx_n = f64::NAN,
            6 => sample.world_from_hub.angle_rad = f64::INFINITY,
            8 => sample.load.mz_n_m *= -3.0,
            _ => {}
        }
    }
    let found = calibrate(&rod, &cell, &samples, &Object::Unknown, &options).expect("a calibration");
    println!("{:?} p {:.2}", found.counts(), found.p_value);
    let (squared, k) = nees(&found, &wrong(), &free_but(&found.priors, &HUB));
    // χ² of 7 exceeds 24.3 once in a thousand.
    assert!(squared < 24.3 && found.is_consistent, "{squared} of {k}");
    assert!(found.calibration.values.iter().all(|v| v.is_finite()));
    assert!(found.roles.iter().zip(&samples).all(|(role, s)| s.load.is_finite() || *role == Role::Unused));
    let known = calibrate(&rod, &cell, &samples, &Object::Known(circle()), &options).expect("a calibration");
    assert!(known.calibration.covariance.iter().all(|v| v.is_finite()));
}
