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
                        "{} {:+.2} | {} sweep {sweep} at {share}: true {truth:.2}, foreseen {:?} ± {:.2} ({:?}), tip in {:?}, margin {:.1} ± {:.1} mm, stability {:.3}, rho {:.2} ± {:.2} mm, dof {} label {:?}",
                        if (a.ending.map_or(1e9, |e| e.steps) - truth).abs()
                            < 1.0 + 3.0 * a.ending.map_or(0.0, |e| e.steps_sigma)
                        {
                            "ok"
                        } else {
                            "BAD"
                        },
                        a.ending.map_or(1e9, |e| e.steps) - truth,
                        set.name,
                        a.ending.map(|e| e.steps),
                        a.ending.map_or(0.0, |e| e.steps_sigma),
                        a.ending.map(|e| e.end),
                        a.steps_to_tip,
                        1e3 * a.margin_m,
                        1e3 * a.margin_sigma_m,
                        a.stability,
                        1e3 * a.outline.arc.radius_m,
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

#[test]
fn zz_consistency() {
    use resight_whisker::events::consistency::{mark, widen};
    use resight_whisker::events::{Fault, consistency};
    let Some(sets) = sets() else { return };
    for set in &sets {
        for (name, fault, size) in [
            ("none", Fault::ForceGain, 0.0),
            ("F gain", Fault::ForceGain, 0.01),
            ("M gain", Fault::TorqueGain, 0.01),
            ("hub angle", Fault::HubAngle, 0.2_f64.to_radians()),
            ("cell angle", Fault::CellAngle, 0.2_f64.to_radians()),
            ("hub ahead", Fault::HubAhead, 5e-4),
            ("hub aside", Fault::HubAside, 5e-4),
        ] {
            let samples: Vec<_> = set.noisy.iter().map(|s| fault.taken_off(s, -size)).collect();
            let mut record =
                solve_record(&set.rod, &set.cell, &samples, Mu::Auto, Method::Auto).expect("a record");
            let start = std::time::Instant::now();
            let Some(v) = consistency(&set.rod, &set.cell, &samples, &record, true, Method::Auto) else {
                println!("{} {name}: none", set.name);
                continue;
            };
            let took = start.elapsed();
            let nees = |record: &resight_whisker::friction::Record| {
                let (mut sum, mut n) = (0.0, 0.0);
                for (t, e) in set.truth.iter().zip(&record.estimates) {
                    if !t.contact
                        || e.status != resight_whisker::estimate::Status::Ok
                        || t.force_world_n[0].hypot(t.force_world_n[1]) < 0.1
                    {
                        continue;
                    }
                    let c = e.contact.as_ref().unwrap();
                    let d = c.x_in_world - nalgebra::Vector2::new(t.x_m, t.y_m);
                    sum += (d.transpose()
                        * c.covariance.fixed_view::<2, 2>(0, 0).into_owned().try_inverse().unwrap()
                        * d)[0];
                    n += 1.0;
                }
                (sum / n, n)
            };
            let before = nees(&record);
            let marked = mark(&set.rod, &set.cell, &samples, &mut record, &v, Mu::Auto, Method::Auto);
            let after = nees(&record);
            widen(
                &set.rod,
                &set.cell,
                &samples,
                &mut record,
                &v,
                &Fault::ALL.map(|f| f.tolerance(&set.cell)),
                Method::Auto,
            );
            println!("   widened {:?}", nees(&record));

            let top: Vec<String> = v
                .suspicions
                .iter()
                .take(4)
                .map(|s| format!("{:?} {:.2e}±{:.1e} chi2 {:.1}", s.fault, s.size, s.sigma, s.chi2))
                .collect();
            println!(
                "{} {name}: {} chi2 {:.0}/{} p {:.1e} mu {:.4} nees {:.2} of {} -> marked {marked}, {:.2} of {} | {} ({took:?})",
                set.name,
                if v.is_inconsistent { "INCONSISTENT" } else { "consistent" },
                v.chi2,
                v.degrees_of_freedom,
                v.p_value,
                record.mu,
                before.0,
                before.1,
                after.0,
                after.1,
                top.join("; ")
            );
        }
    }
}
