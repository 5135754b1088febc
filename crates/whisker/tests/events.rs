//! Touch, slip-off, labels on the records, where RESIGHT_DATA names them.

mod real_support;

use real_support::{Set, sets};
use resight_whisker::contact::Method;
use resight_whisker::events::{Foresight, foresee};
use resight_whisker::friction::{Mu, solve_record};

/// When each sweep of a set slips off, in seconds; none where it does not.
fn slip_off_times(set: &Set) -> Vec<Option<f64>> {
    let root = std::path::PathBuf::from(std::env::var_os("RESIGHT_DATA").expect("set"));
    let path = root.join("whisker").join(set.name).join("object_truth.json");
    let text = std::fs::read_to_string(path).expect("object_truth.json");
    let truth: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    truth["sweeps"].as_array().expect("sweeps").iter().map(|sweep| sweep["t_slip_off"].as_f64()).collect()
}

#[test]
fn slip_off_is_foreseen() {
    let Some(sets) = sets() else { return };
    for set in &sets {
        for (sweep, t_off) in slip_off_times(set).into_iter().enumerate() {
            let Some(t_off) = t_off else { continue };
            let samples: Vec<_> = set
                .noisy
                .iter()
                .zip(&set.truth)
                .filter(|(sample, truth)| sample.sweep == sweep as u32 && truth.contact)
                .map(|(sample, _)| *sample)
                .collect();
            let record =
                solve_record(&set.rod, &set.cell, &samples, Mu::Auto, Method::Auto).expect("a record");
            for share in [0.5, 0.7, 0.8, 0.9, 0.95, 0.99] {
                let now = (share * samples.len() as f64) as usize;
                let step_s = samples[1].t_s.unwrap() - samples[0].t_s.unwrap();
                let truth = (t_off - samples[now].t_s.unwrap()) / step_s;
                let ahead: Option<Foresight> = foresee(
                    &set.rod,
                    &set.cell,
                    &samples[..=now],
                    &record.estimates[..=now],
                    record.friction,
                    Method::Auto,
                );
                match ahead {
                    Some(a) => println!(
                        "{} sweep {sweep} at {share}: true {truth:.2}, foreseen {:?} ± {:.2} ({:?}), tip in {:?}, margin {:.1} ± {:.1} mm, stability {:.3}, rho {:.2} ± {:.2} mm, dof {} label {:?}",
                        set.name,
                        a.steps,
                        a.steps_sigma,
                        a.end,
                        a.steps_to_tip,
                        1e3 * a.margin_m,
                        1e3 * a.margin_sigma_m,
                        a.stability,
                        1e3 * a.outline.radius_m,
                        1e3 * a.outline.radius_sigma_m(),
                        a.outline.degrees_of_freedom,
                        a.outline.label()
                    ),
                    None => println!(
                        "{} sweep {sweep} at {share}: nothing foreseen, {:?}",
                        set.name, record.estimates[now].status
                    ),
                }
            }
        }
    }
}
