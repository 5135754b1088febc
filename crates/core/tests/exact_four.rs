//! Four points whose pixels are exact: the truth has χ² = 0, so that no other pose may be called the only one.

use crate::common::Rng;
use nalgebra::Vector3;
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::consistency::Consistency;
use resight_core::locate::refine::refine;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::solve::{p3p::p3p, planar::planar, sqpnp::sqpnp};
use resight_core::{Correspondence, Point, Pose};

const LAYOUTS: [&str; 5] =
    ["in space", "in a plane", "line plus one", "nearly collinear", "nearly collinear and flat"];

fn points(layout: &str, rng: &mut Rng) -> Vec<Point> {
    let any = |rng: &mut Rng, y: f64, z: f64| {
        Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5) * y, rng.uniform(-0.5, 0.5) * z)
    };
    let narrow = |rng: &mut Rng| 10f64.powf(rng.uniform(-3.0, -0.5));
    let mut points: Vec<Point> = match layout {
        "in space" => (0..4).map(|_| any(rng, 1.0, 1.0)).collect(),
        "in a plane" => (0..4).map(|_| any(rng, 1.0, 0.0)).collect(),
        "line plus one" => {
            let off = [rng.uniform(-0.7, 0.7), rng.uniform(0.05, 1.0)];
            [[-0.5, 0.0], [rng.uniform(-0.4, 0.4), 0.0], [0.5, 0.0], off]
                .map(|[x, y]| Point::new(x, y, 0.0))
                .to_vec()
        }
        "nearly collinear" => {
            let (y, z) = (narrow(rng), narrow(rng));
            (0..4).map(|_| any(rng, y, z)).collect()
        }
        _ => {
            let y = narrow(rng);
            (0..4).map(|_| any(rng, y, 0.0)).collect()
        }
    };
    for i in (1..4).rev() {
        points.swap(i, rng.index(i + 1));
    }
    points
}

struct Scene {
    truth: Pose,
    seen: Vec<Correspondence>,
}

fn scene(layout: &str, rng: &mut Rng) -> Option<Scene> {
    let points = points(layout, rng);
    let z = rng.uniform(1.2, 10.0);
    let truth =
        Pose::new(rng.rotation(), Vector3::new(rng.uniform(-0.3, 0.3) * z, rng.uniform(-0.2, 0.2) * z, z));
    let sigma_px = 10f64.powf(rng.uniform(-1.5, 0.0));
    let camera = crate::common::views::camera();
    let seen = |x: &Point| Correspondence::new(&camera, *x, camera.project(&(&truth * x))?, sigma_px).ok();
    let seen = points.iter().map(seen).collect::<Option<_>>()?;
    Some(Scene { truth, seen })
}

/// Called unique and consistent, and beyond what its covariance admits once in ten thousand.
fn is_wrong(e: &PoseEstimate, truth: &Pose) -> bool {
    let error = (e.cam_from_target * truth.inverse()).log();
    let squared = e.covariance.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)));
    matches!(e.ambiguity, Ambiguity::Unique { .. })
        && e.consistency == Consistency::Consistent
        && 27.86 < squared
}

fn explain(layout: &str, s: &Scene, e: &PoseEstimate) {
    let camera = crate::common::views::camera();
    let error = (e.cam_from_target * s.truth.inverse()).log();
    let nees = e.covariance.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)));
    let at_truth = refine(&s.truth, &s.seen, &camera);
    println!(
        "{layout}: {:?} nees {nees:.3e} chi2 {:.4} rms {:.4} sigma {:.3} weight {} error {:?} geometry {:?}",
        e.method,
        e.chi2,
        e.rms_px,
        s.seen[0].sigma_px,
        e.probability,
        error.as_slice(),
        e.geometry.map(|g| (
            g.configuration,
            g.width.ratio,
            g.line_height.map(|m| m.ratio),
            g.thickness.map(|m| m.ratio)
        ))
    );
    println!(
        "  sigmas {:?}; others {:?}",
        e.covariance.diagonal().map(f64::sqrt).as_slice(),
        e.others
            .iter()
            .flatten()
            .map(|h| (h.delta_chi2, h.minimum.cam_from_target.angle_to_rad(&s.truth)))
            .collect::<Vec<_>>()
    );
    match at_truth {
        Ok(m) => println!(
            "  truth: chi2 {:.3e} sigmas {:?} moved {:.1e}",
            m.chi2,
            m.covariance.diagonal().map(f64::sqrt).as_slice(),
            m.cam_from_target.angle_to_rad(&s.truth)
        ),
        Err(reason) => println!("  truth: {reason}"),
    }
    let report = |name: String, starts: Vec<Pose>| {
        for start in starts {
            let end = refine(&start, &s.seen, &camera);
            let off = start.angle_to_rad(&s.truth);
            println!(
                "  {name}: start off {off:.2e}, {}",
                match end {
                    Ok(m) => format!(
                        "ends chi2 {:.3e} off {:.1e} rad",
                        m.chi2,
                        m.cam_from_target.angle_to_rad(&s.truth)
                    ),
                    Err(r) => r.to_string(),
                }
            );
        }
    };
    report("sqpnp".into(), sqpnp(&s.seen).to_vec());
    report("planar".into(), planar(&s.seen).to_vec());
    for skipped in 0..4 {
        let three: Vec<&Correspondence> = (0..4).filter(|i| *i != skipped).map(|i| &s.seen[i]).collect();
        report(
            format!("p3p without {skipped}"),
            p3p(&[0, 1, 2].map(|i| three[i].bearing), &[0, 1, 2].map(|i| three[i].x_in_target)).to_vec(),
        );
    }
}

/// Scenes of each layout; `RESIGHT_SCENES` says otherwise.
fn scenes() -> usize {
    std::env::var("RESIGHT_SCENES").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000)
}

#[test]
fn no_pose_of_exact_pixels_is_unique_and_wrong() {
    let mut total = 0;
    for (k, layout) in LAYOUTS.iter().enumerate() {
        let mut rng = Rng::new(471 + k as u64);
        let (mut unique, mut refused, mut wrong) = (0, 0, 0);
        for _ in 0..scenes() {
            let Some(s) = scene(layout, &mut rng) else { continue };
            let Ok(e) = locate(&s.seen, &crate::common::views::camera(), &Config::default()) else {
                refused += 1;
                continue;
            };
            unique += usize::from(matches!(e.ambiguity, Ambiguity::Unique { .. }));
            if is_wrong(&e, &s.truth) {
                wrong += 1;
                if wrong < 60 {
                    explain(layout, &s, &e);
                }
            }
        }
        println!(
            "{layout}: {} scenes, {unique} unique, {refused} refused, {wrong} unique and wrong",
            scenes()
        );
        total += wrong;
    }
    assert_eq!(total, 0, "unique and wrong");
}
