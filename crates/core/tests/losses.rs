//! Losses: what they cost on good data, what they gain on bad, and that their covariance is true on both.

use crate::common::{Rng, views};
use nalgebra::{Vector2, Vector3};
use resight_core::locate::consistency::Consistency;
use resight_core::locate::loss::Loss;
use resight_core::locate::problem::Problem;
use resight_core::locate::refine::{refine, refine_problem};
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::{Correspondence, Error, Matrix6, Point, Pose, Vector6};

const SIGMA_PX: f64 = 0.5;
const HUBER: Loss = Loss::Huber { sigmas: 1.5 };
const CAUCHY: Loss = Loss::Cauchy { sigmas: 2.5 };
const TRUNCATED: Loss = Loss::Truncated { sigmas: 4.0 };

fn view(rng: &mut Rng, n: usize) -> (Pose, Vec<Point>) {
    let points =
        (0..n).map(|_| Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5)));
    let points = points.collect();
    let z = rng.uniform(2.0, 4.0);
    (
        Pose::new(rng.rotation(), Vector3::new(rng.uniform(-0.1, 0.1) * z, rng.uniform(-0.1, 0.1) * z, z)),
        points,
    )
}

/// Each point is wrong with a chance of `share`: 10–60 px off in any direction.
fn observe(rng: &mut Rng, truth: &Pose, points: &[Point], share: f64) -> Vec<Correspondence> {
    let camera = views::camera();
    let mut see = |x: &Point| {
        let mut pixel = camera.project(&(truth * x)).expect("in view");
        pixel += Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
        if rng.uniform(0.0, 1.0) < share {
            let (sin, cos) = rng.uniform(0.0, std::f64::consts::TAU).sin_cos();
            pixel += Vector2::new(cos, sin) * rng.uniform(10.0, 60.0);
        }
        Correspondence::new(&camera, *x, pixel, SIGMA_PX).expect("in the field")
    };
    points.iter().map(&mut see).collect()
}

/// Mean over problems: squared error over the Cramér–Rao bound of clean data (rotation and place together, each over its own),
/// NEES and coverage.
struct Measured {
    excess: f64,
    nees: f64,
    coverage: f64,
}

/// Refined from a start 0.3° and 0.5 % off: whether a closed form finds one among wrong points is not the question here.
fn measure(n_points: usize, share: f64, loss: Loss, seed: u64) -> Measured {
    let (mut rng, n, camera) = (Rng::new(seed), 3_000, views::camera());
    let (mut excess, mut nees, mut covered) = (0.0, 0.0, 0);
    for _ in 0..n {
        let (truth, points) = view(&mut rng, n_points);
        let seen = observe(&mut rng, &truth, &points, share);
        let off = Vector6::from_fn(|i, _| rng.normal() * if i < 3 { 0.003 } else { 0.005 });
        let start = Pose::exp(&off) * truth;
        let problem = Problem { loss, ..Problem::new(&seen, &camera) };
        let m = refine_problem(&start, &problem).expect("a minimum");
        let error = (m.cam_from_target * truth.inverse()).log();
        let bound = bound(&truth, &points);
        let of = |i: usize| error.fixed_rows::<3>(i).norm_squared() / bound.fixed_view::<3, 3>(i, i).trace();
        excess += 0.5 * (of(0) + of(3));
        let squared = error.dot(&(m.covariance.try_inverse().expect("positive definite") * error));
        nees += squared;
        covered += usize::from(squared < 12.592); // χ²₆ at 95 %
    }
    let per = |x: f64| x / n as f64;
    Measured { excess: per(excess), nees: per(nees), coverage: per(covered as f64) }
}

fn bound(truth: &Pose, points: &[Point]) -> Matrix6 {
    let camera = views::camera();
    let see = |x: &Point| {
        Correspondence::new(&camera, *x, camera.project(&(truth * x)).expect("in view"), SIGMA_PX)
            .expect("in the field")
    };
    let seen: Vec<_> = points.iter().map(see).collect();
    refine(truth, &seen, &camera).expect("a minimum").covariance
}

/// Gaussian noise hardly pays: variance over that of least squares on the same problems at most 1/0.95 for Huber at 1.5 (and 2 %
/// more for chance in 3,000 problems).
#[test]
fn good_data_hardly_pay() {
    for n_points in [10, 100] {
        let squared = measure(n_points, 0.0, Loss::Squared, 71).excess;
        assert!((0.95..1.05).contains(&squared), "{squared}");
        for (loss, efficiency) in [(HUBER, 0.95), (CAUCHY, 0.93), (TRUNCATED, 0.99)] {
            let m = measure(n_points, 0.0, loss, 71);
            println!(
                "{loss:?}, {n_points} points: efficiency {:.3}, NEES {:.3}, 95 % covers {:.4}",
                squared / m.excess,
                m.nees,
                m.coverage
            );
            assert!(m.excess < 1.02 * squared / efficiency, "{loss:?} {n_points}: {}", m.excess);
            assert!(
                (5.6..6.4).contains(&m.nees) && (0.93..0.965).contains(&m.coverage),
                "{loss:?} {}",
                m.nees
            );
        }
    }
}

/// One point in ten wrong by 20–120 standard deviations: what least squares loses, and what is left of it.
#[test]
fn wrong_points_pull_little() {
    let squared = measure(100, 0.1, Loss::Squared, 72);
    println!("squared: variance/CRB {:.1}, NEES {:.1}", squared.excess, squared.nees);
    for (loss, limit) in [(HUBER, 2.5), (CAUCHY, 1.4), (TRUNCATED, 1.2)] {
        let m = measure(100, 0.1, loss, 72);
        println!(
            "{loss:?}: variance/CRB {:.2}, {:.0} times less, NEES {:.3}, 95 % covers {:.4}",
            m.excess,
            squared.excess / m.excess,
            m.nees,
            m.coverage
        );
        assert!(m.excess < limit && 20.0 * m.excess < squared.excess, "{loss:?}: {}", m.excess);
        assert!((5.2..6.8).contains(&m.nees) && (0.92..0.98).contains(&m.coverage), "{loss:?}: {}", m.nees);
    }
}

/// The whole answer under a loss: wrong points do not make it inconsistent, wrong sigmas do.
#[test]
fn the_verdict_sets_single_wrong_points_apart() {
    let mut rng = Rng::new(73);
    let solve = |seen: &[Correspondence], loss| -> PoseEstimate {
        locate(seen, &views::camera(), &Config { loss, ..Config::default() }).expect("a pose")
    };
    let (mut called, mut missed) = (0, 0);
    for _ in 0..200 {
        let (truth, points) = view(&mut rng, 40);
        let seen = observe(&mut rng, &truth, &points, 0.05);
        let e = solve(&seen, HUBER);
        called += usize::from(e.consistency != Consistency::Consistent);
        assert!(e.cam_from_target.angle_to_rad(&truth) < 0.02);
        let proud: Vec<_> = seen.iter().map(|c| Correspondence { sigma_px: 0.05, ..*c }).collect();
        missed += usize::from(solve(&proud, HUBER).consistency == Consistency::Consistent);
    }
    println!(
        "of 200: {called} called inconsistent for single wrong points, {missed} sigmas ten times too small missed"
    );
    assert!(called == 0 && missed == 0);
}

/// The loss falls from step to step, so its value at the minimum is below that at the start, and no lower nearby.
#[test]
fn the_minimum_is_one_of_the_loss() {
    let (mut rng, camera) = (Rng::new(74), views::camera());
    for loss in [HUBER, CAUCHY, TRUNCATED] {
        for _ in 0..50 {
            let (truth, points) = view(&mut rng, 20);
            let seen = observe(&mut rng, &truth, &points, 0.1);
            let problem = Problem { loss, ..Problem::new(&seen, &camera) };
            let m = refine_problem(&truth, &problem).expect("a minimum");
            let cost = |pose: &Pose| -> f64 {
                seen.iter()
                    .map(|c| {
                        let r =
                            (c.pixel - camera.project(&(*pose * c.x_in_target)).expect("in view")) / SIGMA_PX;
                        let s = r.norm_squared();
                        match loss {
                            Loss::Huber { sigmas: k } if k * k < s => 2.0 * k * s.sqrt() - k * k,
                            Loss::Cauchy { sigmas: k } => k * k * (s / (k * k)).ln_1p(),
                            Loss::Truncated { sigmas: k } => s.min(k * k),
                            _ => s,
                        }
                    })
                    .sum()
            };
            assert!((m.chi2 - cost(&m.cam_from_target)).abs() < 1e-9 * (1.0 + m.chi2));
            assert!(m.chi2 <= cost(&truth) + 1e-9);
            for k in 0..6 {
                for side in [-1.0, 1.0] {
                    let step = Vector6::ith(k, side * 0.3 * m.covariance[(k, k)].sqrt());
                    assert!(m.chi2 < cost(&(Pose::exp(&step) * m.cam_from_target)), "{loss:?}");
                }
            }
        }
    }
}

#[test]
fn a_threshold_that_is_none_is_refused() {
    let mut rng = Rng::new(75);
    let (truth, points) = view(&mut rng, 8);
    let seen = observe(&mut rng, &truth, &points, 0.0);
    for sigmas in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for loss in [Loss::Huber { sigmas }, Loss::Cauchy { sigmas }, Loss::Truncated { sigmas }] {
            let answer = locate(&seen, &views::camera(), &Config { loss, ..Config::default() });
            assert!(matches!(answer, Err(Error::InvalidLoss { .. })), "{answer:?}");
        }
    }
}
