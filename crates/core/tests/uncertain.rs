//! Uncertain intrinsics and uncertain points together: the covariance is the true one in every layout, and no pose is far off and `ok`.

use crate::common::{Rng, views};
use nalgebra::{Vector2, Vector3, Vector6};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::consistency::Consistency;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::multiview::rig_pose::{RigAmbiguity, RigConsistency, RigView, locate_rig};
use resight_core::{Camera, Correspondence, Error, Point, Pose};

/// The layouts, each made anew for every scene; 1 m wide.
const LAYOUTS: [&str; 7] =
    ["tag", "tags", "plane", "line plus one", "four in space", "few in space", "many in space"];

fn points(layout: &str, rng: &mut Rng) -> Vec<Point> {
    let in_box = |rng: &mut Rng, depth: f64| {
        Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-depth, depth))
    };
    let square = |x: f64, y: f64, half: f64| {
        [[-half, -half], [half, -half], [half, half], [-half, half]]
            .map(|[u, v]| Point::new(x + u, y + v, 0.0))
            .to_vec()
    };
    match layout {
        "tag" => square(0.0, 0.0, 0.5),
        "tags" => [square(-0.3, -0.3, 0.15), square(0.35, 0.1, 0.15), square(-0.2, 0.35, 0.15)].concat(),
        "plane" => (0..5 + rng.index(26)).map(|_| in_box(rng, 0.0)).collect(),
        "line plus one" => {
            let (b, off) = (rng.uniform(0.3, 0.7), [rng.uniform(-0.2, 1.2), rng.uniform(0.4, 1.0)]);
            [[0.0, 0.0], [b, 0.0], [1.0, 0.0], off].map(|[x, y]| Point::new(x, y, 0.0)).to_vec()
        }
        "four in space" => (0..4).map(|_| in_box(rng, 0.5)).collect(),
        "few in space" => (0..5 + rng.index(6)).map(|_| in_box(rng, 0.5)).collect(),
        _ => (0..11 + rng.index(20)).map(|_| in_box(rng, 0.5)).collect(),
    }
}

/// Standard deviations of one scene.
#[derive(Debug, Clone, Copy)]
struct Noise {
    px: f64,
    m: f64,
    f_px: f64,
    c_px: f64,
}

/// 0.1–1 px, points known to 0.3–10 mm, f to 1–16 px of 800, the principal point to 0.5–8 px; all but the pixels `coarse` times that.
fn any_noise(rng: &mut Rng, coarse: f64) -> Noise {
    let mut of = |low: f64, high: f64| low * (high / low).powf(rng.uniform(0.0, 1.0));
    Noise {
        px: of(0.1, 1.0),
        m: coarse * of(3e-4, 1e-2),
        f_px: coarse * of(1.0, 16.0),
        c_px: coarse * of(0.5, 8.0),
    }
}

/// Of the intrinsics: fx and fy share their error.
fn covariance_of(noise: Noise) -> [f64; 16] {
    let (f, c) = (noise.f_px.powi(2), noise.c_px.powi(2));
    [f, f, 0.0, 0.0, f, f, 0.0, 0.0, 0.0, 0.0, c, 0.0, 0.0, 0.0, 0.0, c]
}

fn any_pose(rng: &mut Rng) -> Pose {
    let z = rng.uniform(1.5, 6.0);
    Pose::new(rng.rotation(), Vector3::new(rng.uniform(-0.3, 0.3) * z, rng.uniform(-0.2, 0.2) * z, z))
}

/// The true points by the true camera, labelled as they are known.
fn observe(rng: &mut Rng, pose: &Pose, known: &[Point], noise: Noise) -> Option<Vec<Correspondence>> {
    let (solves, took) = (views::camera(), drawn_lens(rng, noise)?);
    let observed = |x: &Point| {
        let true_x = x + Vector3::new(rng.normal(), rng.normal(), rng.normal()) * noise.m;
        let pixel = took.project(&(pose * &true_x))? + Vector2::new(rng.normal(), rng.normal()) * noise.px;
        let c = Correspondence::new(&solves, *x, pixel, noise.px).ok()?;
        Some(Correspondence { sigma_m: noise.m, ..c })
    };
    known.iter().map(observed).collect()
}

/// What became of the scenes of one layout.
#[derive(Default, Debug)]
struct Tally {
    scenes: usize,
    ok: usize,
    ambiguous: usize,
    /// Mean of those that are `ok`.
    nees: f64,
    covered: usize,
    worst: f64,
}

impl Tally {
    fn count(&mut self, answer: &Result<PoseEstimate, Error>, truth: &Pose) {
        self.scenes += 1;
        let Ok(e) = answer else { return };
        self.ambiguous += usize::from(matches!(e.ambiguity, Ambiguity::Ambiguous { .. }));
        if !matches!(e.ambiguity, Ambiguity::Unique { .. }) || e.consistency != Consistency::Consistent {
            return;
        }
        let error = (e.cam_from_target * truth.inverse()).log();
        let inverse = e.covariance.cholesky().expect("positive definite");
        let nees = error.dot(&inverse.solve(&error));
        self.ok += 1;
        self.nees += (nees - self.nees) / self.ok as f64;
        self.covered += usize::from(nees < 12.592); // χ²₆ at 95 %
        self.worst = self.worst.max(nees);
    }

    fn coverage(&self) -> f64 {
        self.covered as f64 / self.ok as f64
    }
}

fn tally(layout: &str, n: usize, coarse: f64, seed: u64) -> Tally {
    let mut rng = Rng::new(seed);
    let mut tally = Tally::default();
    while tally.scenes < n {
        let (pose, known) = (any_pose(&mut rng), points(layout, &mut rng));
        let noise = any_noise(&mut rng, coarse);
        let Some(seen) = observe(&mut rng, &pose, &known, noise) else { continue };
        let covariance = covariance_of(noise);
        let config = Config { intrinsics_covariance: Some(&covariance), ..Config::default() };
        tally.count(&locate(&seen, &views::camera(), &config), &pose);
    }
    tally
}

/// How the lenses of a rig are known.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Lenses {
    Exact,
    /// Each off by a draw of its own from the covariance that is stated, or that is not.
    Stated,
    Unstated,
}

/// The camera that took the images: f and the principal point off by as much as they are uncertain.
fn drawn_lens(rng: &mut Rng, noise: Noise) -> Option<Camera> {
    let f = rng.normal() * noise.f_px;
    let by = [f, f, rng.normal() * noise.c_px, rng.normal() * noise.c_px];
    let known = views::camera();
    let values: Vec<f64> = known.parameters().iter().zip(by).map(|((_, value), by)| value + by).collect();
    known.with_parameters(&values).ok()
}

/// Two cameras half a metre and 0.3 rad apart; each sees every other point.
fn observe_by_two(
    rng: &mut Rng,
    pose: &Pose,
    known: &[Point],
    noise: Noise,
    lenses: Lenses,
) -> Option<[Vec<Correspondence>; 2]> {
    let camera = views::camera();
    let took = match lenses {
        Lenses::Exact => [camera.clone(), camera.clone()],
        _ => [drawn_lens(rng, noise)?, drawn_lens(rng, noise)?],
    };
    let mut seen = [Vec::new(), Vec::new()];
    for (i, x) in known.iter().enumerate() {
        let true_x = x + Vector3::new(rng.normal(), rng.normal(), rng.normal()) * noise.m;
        let pixel = took[i % 2].project(&(cam_from_rig(i % 2) * *pose * true_x))?;
        let pixel = pixel + Vector2::new(rng.normal(), rng.normal()) * noise.px;
        let c = Correspondence::new(&camera, *x, pixel, noise.px).ok()?;
        seen[i % 2].push(Correspondence { sigma_m: noise.m, ..c });
    }
    Some(seen)
}

fn cam_from_rig(camera: usize) -> Pose {
    let along = camera as f64;
    Pose::exp(&Vector6::new(0.0, 0.3 * along, 0.0, -0.5 * along, 0.0, 0.1 * along))
}

/// What became of a rig's scenes: answers, those that are `ok`, and the NEES of these, mean and largest.
#[derive(Debug, Default)]
struct RigTally {
    answers: usize,
    inconsistent: usize,
    ok: usize,
    nees: f64,
    worst: f64,
}

fn rig_nees(layout: &str, n: usize, coarse: f64, lenses: Lenses, seed: u64) -> RigTally {
    let (mut rng, camera) = (Rng::new(seed), views::camera());
    let (mut scenes, mut tally) = (0, RigTally::default());
    while scenes < n {
        let (pose, known) = (any_pose(&mut rng), points(layout, &mut rng));
        let noise = any_noise(&mut rng, coarse);
        let Some(seen) = observe_by_two(&mut rng, &pose, &known, noise, lenses) else { continue };
        scenes += 1;
        let stated = covariance_of(noise);
        let view = |i: usize| RigView {
            camera: &camera,
            cam_from_rig: cam_from_rig(i),
            cam_from_rig_covariance: None,
            intrinsics_covariance: (lenses == Lenses::Stated).then_some(&stated),
            seen: &seen[i],
        };
        let Ok(e) = locate_rig(&[view(0), view(1)]) else { continue };
        tally.answers += 1;
        tally.inconsistent += usize::from(e.consistency != RigConsistency::Consistent);
        let is_unique = matches!(e.ambiguity, RigAmbiguity::Unique { .. });
        if !is_unique || e.consistency != RigConsistency::Consistent {
            continue;
        }
        let error = (e.rig_from_target * pose.inverse()).log();
        let nees = error.dot(&e.covariance.cholesky().expect("positive definite").solve(&error));
        tally.ok += 1;
        tally.nees += (nees - tally.nees) / tally.ok as f64;
        tally.worst = f64::max(tally.worst, nees);
    }
    tally
}

/// Each lens of a rig has an error of its own: stated, it is in the covariance and the verdict, whatever the layout; not stated, poses are
/// far off and `ok`, or the rig is called inconsistent.
#[test]
fn a_rig_of_two_cameras_is_as_sure_as_it_says_where_lenses_are_uncertain() {
    let n = scenes() / 5;
    for (k, layout) in LAYOUTS.iter().enumerate() {
        let t = rig_nees(layout, n, 1.0, Lenses::Stated, 431 + k as u64);
        println!("{layout}, lenses uncertain: {t:?}");
        assert!((5.7..6.3).contains(&t.nees) && t.worst < 1000.0, "{layout}: {t:?}");
        let least_ok = if *layout == "line plus one" { 0.35 } else { 0.75 };
        assert!(least_ok * n as f64 <= t.ok as f64 && 400 * t.inconsistent <= t.answers, "{layout}: {t:?}");
        let t = rig_nees(layout, n / 8, 1.0, Lenses::Unstated, 431 + k as u64);
        println!("{layout}, not stated: {t:?}");
        assert!(20.0 < t.nees, "{layout}: {t:?}");
    }
}

#[test]
fn a_rig_of_two_cameras_is_as_sure_as_it_says_where_points_are_uncertain() {
    let n = scenes() / 2;
    for (k, layout) in LAYOUTS.iter().enumerate() {
        let RigTally { ok, nees: mean, worst, .. } = rig_nees(layout, n, 1.0, Lenses::Exact, 231 + k as u64);
        println!("{layout}: {ok} of {n} ok, NEES {mean:.3}, worst {worst:.0}");
        assert!(0.75 * n as f64 <= ok as f64, "{layout}: {ok} of {n}");
        assert!((5.7..6.3).contains(&mean) && worst < 1000.0, "{layout}: {mean} {worst}");
        let RigTally { ok, nees: mean, worst, .. } = rig_nees(layout, n, 4.0, Lenses::Exact, 331 + k as u64);
        println!("{layout}, four times as uncertain: {ok} of {n} ok, NEES {mean:.3}, worst {worst:.0}");
        assert!(worst < 1000.0, "{layout}: {worst}");
    }
}

/// Scenes of a layout; `RESIGHT_SCENES` says otherwise.
fn scenes() -> usize {
    std::env::var("RESIGHT_SCENES").ok().and_then(|n| n.parse().ok()).unwrap_or(4000)
}

#[test]
fn covariance_is_true_where_points_and_intrinsics_are_uncertain() {
    for (k, layout) in LAYOUTS.iter().enumerate() {
        let t = tally(layout, scenes(), 1.0, 31 + k as u64);
        println!("{layout}: {t:?}, {:.4} covered", t.coverage());
        assert!((5.7..6.3).contains(&t.nees), "{layout}: {t:?}");
        assert!((0.94..0.96).contains(&t.coverage()), "{layout}: {t:?}");
        assert!(t.worst < 1000.0, "{layout}: {t:?}");
        let least_ok = if *layout == "line plus one" { 0.75 } else { 0.95 };
        assert!(least_ok * t.scenes as f64 <= t.ok as f64, "{layout}: {t:?}");
    }
}

/// Four times as uncertain: first-order covariances are coarse there, but no pose that is `ok` is another one.
#[test]
fn no_pose_is_far_off_and_ok_where_points_and_intrinsics_are_badly_known() {
    for (k, layout) in LAYOUTS.iter().enumerate() {
        let t = tally(layout, scenes(), 4.0, 131 + k as u64);
        println!("{layout}, four times as uncertain: {t:?}, {:.4} covered", t.coverage());
        assert!(t.worst < 1000.0, "{layout}: {t:?}");
        assert!(0.2 * t.scenes as f64 <= t.ok as f64, "{layout}: {t:?}");
    }
}
