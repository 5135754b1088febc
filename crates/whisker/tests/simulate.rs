//! The forward model against independently computed sets, against itself, and against mechanics.

mod real_support;

use nalgebra::Vector2;
use real_support::{Set, Truth, sets};
use resight_whisker::simulate::{Record, record};
use resight_whisker::{Sample, Shape};
use std::path::PathBuf;

fn object_of(name: &str) -> (Shape, f64) {
    let root = PathBuf::from(std::env::var_os("RESIGHT_DATA").expect("set where sets() is some"));
    let text =
        std::fs::read_to_string(root.join("whisker").join(name).join("object_truth.json")).expect("a file");
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let object = &json["object"];
    let number = |v: &serde_json::Value| v.as_f64().expect("a number");
    let pair = |key: &str| [0, 1].map(|i| number(&object[key][i]));
    let centre_m = Vector2::from(pair("centre"));
    let angle_rad = object["angle_deg"].as_f64().unwrap_or(0.0).to_radians();
    let shape = match object["type"].as_str() {
        Some("circle") => Shape::Circle { centre_m, radius_m: number(&object["radius"]) },
        Some("ellipse") => Shape::Ellipse { centre_m, semi_axes_m: pair("semi_axes"), angle_rad },
        Some("square") => Shape::square(centre_m, number(&object["side"]), angle_rad),
        other => panic!("object {other:?}"),
    };
    (shape, number(&json["friction_coefficient"]))
}

fn sweep_of(set: &Set, number: u32) -> (Vec<Sample>, Vec<Truth>) {
    set.clean.iter().zip(&set.truth).filter(|(s, _)| s.sweep == number).map(|(s, t)| (*s, t.clone())).unzip()
}

fn simulated(set: &Set, number: u32) -> (Record, Vec<Sample>, Vec<Truth>) {
    let (object, mu) = object_of(set.name);
    let (samples, truth) = sweep_of(set, number);
    let path: Vec<_> = samples.iter().map(|s| s.world_from_hub).collect();
    let record = record(&set.rod, &object, mu, number, &path).expect("a record");
    (record, samples, truth)
}

#[test]
fn the_shipped_sets_come_out() {
    let Some(sets) = sets() else { return };
    for set in &sets {
        for number in 0..3 {
            let (record, samples, truth) = simulated(set, number);
            println!(
                "{} {number}: {:?}",
                set.name,
                record.events.iter().map(|e| (e.pose, e.change)).collect::<Vec<_>>()
            );
            let (mut worst, mut wrong) = ([0.0_f64; 6], Vec::new());
            for ((found, sample), truth) in record.samples.iter().zip(&samples).zip(&truth) {
                let mode = found.truth.map_or("free".to_string(), |t| t.touching.to_string());
                if mode != truth.mode {
                    wrong.push((sample.sample, mode.clone(), truth.mode.clone()));
                }
                let (Some(t), true) = (found.truth, truth.contact) else { continue };
                if mode != truth.mode {
                    continue;
                }
                let x = (t.x_in_world - Vector2::new(truth.x_m, truth.y_m)).norm() / set.rod.length_m;
                let s = (t.s_m - truth.s_m).abs() / set.rod.length_m;
                let theta = (t.theta_rad - truth.theta_rad).rem_euclid(std::f64::consts::TAU);
                let theta = theta.min(std::f64::consts::TAU - theta);
                let f = (t.force_in_world_n - Vector2::from(truth.force_world_n)).norm()
                    / t.force_in_world_n.norm();
                let load = (found.sample.load.to_vector() - sample.load.to_vector()).norm()
                    / sample.load.to_vector().norm();
                let phi = (t.friction_angle_rad - truth.friction_angle_rad).abs();
                for (w, v) in worst.iter_mut().zip([x, s, theta, f, load, phi]) {
                    *w = w.max(v);
                }
            }
            println!(
                "   x {:.1e} s {:.1e} th {:.1e} F {:.1e} load {:.1e} phi {:.1e}  wrong {} {:?}",
                worst[0],
                worst[1],
                worst[2],
                worst[3],
                worst[4],
                worst[5],
                wrong.len(),
                wrong.iter().take(3).collect::<Vec<_>>()
            );
        }
    }
}
