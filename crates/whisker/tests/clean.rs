//! The recorded sets without noise: every contact is found, exactly.

use crate::real_support::{Set, sets};
use nalgebra::Vector2;
use resight_whisker::contact::{Method, contact_in_hub};
use resight_whisker::estimate::{Status, estimate};

/// Worst errors of a set: x, y and s as shares of the length; θ, rad; the force in the world as a share of itself.
#[derive(Debug, Default)]
struct Worst {
    place: f64,
    theta_rad: f64,
    force: f64,
    friction_rad: f64,
}

fn worst(set: &Set) -> Worst {
    let mut worst = Worst::default();
    for (sample, truth) in set.clean.iter().zip(&set.truth).filter(|(_, truth)| truth.contact) {
        let at = contact_in_hub(&set.rod, &sample.load, Method::Auto).expect("a contact");
        let contact = estimate(&set.rod, &set.cell, sample, Method::Auto).contact.expect("a contact");
        let place = (contact.x_in_world - Vector2::new(truth.x_m, truth.y_m)).amax();
        worst.place = worst.place.max(place.max((at.s_m - truth.s_m).abs()) / set.rod.length_m);
        let turned = contact.theta_rad - truth.theta_rad;
        worst.theta_rad = worst.theta_rad.max(turned.sin().abs().max(1.0 - turned.cos()));
        let force = Vector2::from(truth.force_world_n);
        let seen = contact.force_in_world_n(sample.load.side());
        worst.force = worst.force.max((seen - force).norm() / force.norm());
        worst.friction_rad = worst.friction_rad.max((at.friction_angle_rad - truth.friction_angle_rad).abs());
    }
    println!("{:20} {worst:?}", set.name);
    worst
}

/// 1e-12 of the whisker's length; the truth itself is good to 1e-13, and angles, forces alike.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn uniform_whiskers_agree_with_the_truth() {
    let sets = sets();
    for set in sets.iter().filter(|set| !set.name.contains("taper")) {
        let worst = worst(set);
        assert!(worst.place < 1e-12, "{}: {worst:?}", set.name);
        // The table's angles and forces have 15 digits; friction angles are arcs of cosines, of forces that have as many.
        assert!(worst.theta_rad < 1e-11 && worst.force < 1e-11, "{}: {worst:?}", set.name);
        assert!(worst.friction_rad < 1e-7, "{}: {worst:?}", set.name);
    }
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn tapered_whiskers_agree_with_the_truth() {
    let sets = sets();
    for set in sets.iter().filter(|set| set.name.contains("taper")) {
        let worst = worst(set);
        assert!(worst.place < 1e-8, "{}: {worst:?}", set.name);
        assert!(worst.theta_rad < 1e-7 && worst.force < 1e-7, "{}: {worst:?}", set.name);
    }
}

/// Contact or none: no row of the truth is missed, none invented.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn contacts_are_those_of_the_truth() {
    let sets = sets();
    for set in &sets {
        for (sample, truth) in set.clean.iter().zip(&set.truth) {
            let found = estimate(&set.rod, &set.cell, sample, Method::Auto);
            assert_eq!(
                found.contact.is_some(),
                truth.contact,
                "{} {} {}",
                set.name,
                sample.sweep,
                sample.sample
            );
            assert_eq!(found.status == Status::NoContact, !truth.contact);
        }
    }
}

/// The seed method on uniform whiskers: the same contacts, by integration.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn integration_agrees_with_the_closed_form() {
    let sets = sets();
    for set in sets.iter().filter(|set| !set.name.contains("taper")) {
        let mut worst = 0.0_f64;
        for (sample, _) in set.clean.iter().zip(&set.truth).filter(|(_, truth)| truth.contact) {
            let of = |method| contact_in_hub(&set.rod, &sample.load, method).expect("a contact");
            let (closed, integrated) = (of(Method::Auto), of(Method::Integrate));
            let apart =
                (closed.x_in_hub - integrated.x_in_hub).norm().max((closed.s_m - integrated.s_m).abs());
            worst = worst.max(apart / set.rod.length_m);
        }
        println!("{:20} {worst:.1e} L", set.name);
        assert!(worst < 1e-11, "{}: {worst:e}", set.name);
    }
}
