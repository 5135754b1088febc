//! Contacts by integration from the hub.

mod real_support;

use nalgebra::Vector2;
use real_support::sets;
use resight_whisker::contact::{closed_form, integrate};

#[test]
fn the_recorded_sets_without_noise() {
    let Some(sets) = sets() else { return };
    for set in &sets {
        let mut worst = [0.0_f64; 4];
        let length = set.rod.length_m;
        for (sample, truth) in set.clean.iter().zip(&set.truth).filter(|(_, truth)| truth.contact) {
            let at = integrate::contact(&set.rod, &sample.load).expect("a contact");
            let x = sample.world_from_hub.apply(at.x_in_hub);
            worst[0] = worst[0].max((x - Vector2::new(truth.x_m, truth.y_m)).norm() / length);
            worst[1] = worst[1].max((at.s_m - truth.s_m).abs() / length);
            let theta = sample.world_from_hub.angle_rad + at.theta_rad - truth.theta_rad;
            worst[2] =
                worst[2].max((theta - std::f64::consts::TAU * (theta / std::f64::consts::TAU).round()).abs());
            if !set.name.contains("taper") {
                let closed = closed_form::straight(set.rod.ei_base_n_m2(), &sample.load).expect("a contact");
                worst[3] = worst[3].max((closed.x_in_hub - at.x_in_hub).norm() / length);
            }
        }
        println!(
            "{}: x {:.1e} L, s {:.1e} L, θ {:.1e}, closed form {:.1e} L",
            set.name, worst[0], worst[1], worst[2], worst[3]
        );
    }
}
