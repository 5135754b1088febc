//! The recorded sets without noise: every contact is found, exactly.

mod real_support;

use nalgebra::Vector2;
use real_support::sets;
use resight_whisker::contact::{Method, contact_in_hub};

/// 1e-12 of the whisker's length; the truth itself is good to 1e-13.
#[test]
fn uniform_whiskers_agree_with_the_truth() {
    let Some(sets) = sets() else { return };
    for set in sets.iter().filter(|set| !set.name.contains("taper")) {
        let mut worst = 0.0_f64;
        for (sample, truth) in set.clean.iter().zip(&set.truth).filter(|(_, truth)| truth.contact) {
            let at = contact_in_hub(&set.rod, &sample.load, Method::Auto).expect("a contact");
            let x = sample.world_from_hub.apply(at.x_in_hub);
            worst = worst.max((x - Vector2::new(truth.x_m, truth.y_m)).norm() / set.rod.length_m);
            worst = worst.max((at.s_m - truth.s_m).abs() / set.rod.length_m);
        }
        println!("{}: worst {worst:.1e} L", set.name);
        assert!(worst < 1e-12, "{}: {worst:e}", set.name);
    }
}
