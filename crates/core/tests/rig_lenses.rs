//! Rigs whose lenses are adjusted with the poses: against truth, against the bound, and against what was stated.

use crate::common::rooms::{self, Room};
use crate::common::{Rng, rooms::barrel};
use nalgebra::{DMatrix, DVector};
use resight_core::multiview::rig::Observation;
use resight_core::multiview::rig::{
    Cause, RigConfig, RigProblem, RigWithLenses, solve_rig, solve_rig_and_lenses,
};
use resight_core::{Camera, Error};

fn room(rng: &mut Rng, n_views: usize, sigma_px: f64) -> Room {
    let cameras = (0..4).map(|_| barrel(900.0)).collect();
    rooms::ring_with_board(rng, cameras, rooms::board(7, 5, 0.1), n_views, sigma_px)
}

fn solve(
    room: &Room,
    cameras: &[Camera],
    observations: &[Observation],
    config: &RigConfig,
) -> Result<RigWithLenses, Error> {
    let problem =
        RigProblem { cameras, body_of_target: &room.body_of_target, n_views: room.n_views, observations };
    let free: Vec<usize> = (0..cameras.len()).collect();
    solve_rig_and_lenses(&problem, config, &free)
}

fn values(camera: &Camera) -> DVector<f64> {
    DVector::from_iterator(camera.parameters().len(), camera.parameters().iter().map(|(_, value)| *value))
}

/// A camera whose parameters are off by some standard deviations.
fn off(camera: &Camera, by: impl Fn(usize) -> f64) -> Camera {
    let values: Vec<f64> = values(camera).iter().enumerate().map(|(i, value)| value + by(i)).collect();
    camera.with_parameters(&values).expect("a lens")
}

/// Squared errors of poses and lenses together, in units of the joint covariance, and their number.
fn joint_nees(room: &Room, found: &RigWithLenses) -> (f64, usize) {
    let n = 6 * room.cameras.len();
    let mut error = DVector::zeros(found.joint_covariance.nrows());
    for c in 0..room.cameras.len() {
        error.rows_mut(6 * c, 6).copy_from(&room.error(&found.solution, c.max(1)).0);
    }
    let mut at = n;
    for lens in &found.lenses {
        let by = values(&lens.intrinsics) - values(&room.cameras[lens.camera]);
        error.rows_mut(at, by.len()).copy_from(&by);
        at += by.len();
    }
    // The reference has no motion.
    let (error, size) = (error.rows(6, at - 6).into_owned(), at - 6);
    let covariance = found.joint_covariance.view((6, 6), (size, size)).into_owned();
    (error.dot(&covariance.cholesky().expect("a covariance").solve(&error)), size)
}

/// Mean squared errors of poses (of 6), lenses (of 1) and of all together (of 1), from lenses that nobody calibrated: a focal length 4 % off, a
/// centre 12 px off, no distortion.
fn from_rough_values(trials: u64, sigma_px: f64) -> [f64; 3] {
    let (mut of_poses, mut of_lenses, mut together, mut n_together) = (0.0, 0.0, 0.0, 0);
    for seed in 0..trials {
        let mut rng = Rng::new(7100 + seed);
        let room = room(&mut rng, 40, sigma_px);
        let rough = |c: &Camera| {
            let truth = values(c);
            off(c, |i| match i {
                0 | 1 => 0.04 * truth[0],
                2 | 3 => 12.0,
                _ => -truth[i],
            })
        };
        let cameras: Vec<Camera> = room.cameras.iter().map(rough).collect();
        let found = solve(&room, &cameras, &room.disturbed(&mut rng), &RigConfig::default()).expect("a rig");
        assert!(!found.solution.verdict.is_inconsistent, "{:?}", found.solution.verdict);
        for c in 1..4 {
            of_poses += room.error(&found.solution, c).1 / (3 * trials) as f64;
        }
        for lens in &found.lenses {
            let by = values(&lens.intrinsics) - values(&room.cameras[lens.camera]);
            let squared = by.dot(&lens.covariance.clone().cholesky().expect("a covariance").solve(&by));
            of_lenses += squared / (8 * 4 * trials) as f64;
            assert_eq!(lens.from_stated, None);
        }
        let (squared, n) = joint_nees(&room, &found);
        (together, n_together) = (together + squared, n_together + n);
    }
    println!("{sigma_px} px: {of_poses:.2} {of_lenses:.3} {:.3}", together / n_together as f64);
    [of_poses, of_lenses, together / n_together as f64]
}

/// Errors are as large as stated, of each camera's pose and of each lens. All together they are where the noise is small: at 0.3 px a lens error
/// moves poses by its square too, which is small beside their errors but not beside those that remain for a given lens.
#[test]
fn lenses_from_rough_values_have_honest_errors() {
    let [of_poses, of_lenses, _] = from_rough_values(40, 0.3);
    assert!((5.4..6.6).contains(&of_poses), "{of_poses}");
    assert!((0.88..1.15).contains(&of_lenses), "{of_lenses}");
    let [of_poses, of_lenses, together] = from_rough_values(40, 0.03);
    assert!((5.4..6.6).contains(&of_poses), "{of_poses}");
    assert!((0.9..1.1).contains(&of_lenses), "{of_lenses}");
    assert!((0.92..1.08).contains(&together), "{together}");
}

/// A stated covariance counts as much as the pixels do: the lenses move within it, and errors are smaller than of either alone.
#[test]
fn stated_lenses_are_weighed_against_the_pixels() {
    const TRIALS: u64 = 24;
    let sigma = [4.0, 4.0, 3.0, 3.0, 0.004, 0.01, 2e-4, 2e-4];
    let stated = DMatrix::from_diagonal(&DVector::from_iterator(8, sigma.iter().map(|s| s * s)));
    let (mut of_poses, mut of_lenses, mut moved, mut smaller) = (0.0, 0.0, 0.0, 0.0);
    for seed in 0..TRIALS {
        let mut rng = Rng::new(7300 + seed);
        let room = room(&mut rng, 40, 0.3);
        let draws: Vec<f64> = (0..32).map(|_| rng.normal()).collect();
        let cameras: Vec<Camera> =
            (0..4).map(|c| off(&room.cameras[c], |i| sigma[i] * draws[8 * c + i])).collect();
        let intrinsics = vec![Some(stated.clone()); 4];
        let config = RigConfig { intrinsics: &intrinsics, ..RigConfig::default() };
        let found = solve(&room, &cameras, &room.disturbed(&mut rng), &config).expect("a rig");
        assert!(!found.solution.verdict.is_inconsistent, "{:?}", found.solution.verdict);
        for c in 1..4 {
            of_poses += room.error(&found.solution, c).1 / (3 * TRIALS) as f64;
        }
        for lens in &found.lenses {
            let by = values(&lens.intrinsics) - values(&room.cameras[lens.camera]);
            let inverse = lens.covariance.clone().cholesky().expect("a covariance").inverse();
            of_lenses += by.dot(&(inverse * &by)) / (8 * 4 * TRIALS) as f64;
            let (chi2, n) = lens.from_stated.expect("a covariance was stated");
            moved += chi2 / (n * 4 * TRIALS as usize) as f64;
            smaller += lens.covariance[(0, 0)] / stated[(0, 0)] / (4 * TRIALS) as f64;
        }
    }
    println!(
        "poses {of_poses:.2} of 6, lenses {of_lenses:.3}, moved {moved:.3}, variance of fx {smaller:.3}"
    );
    assert!((5.2..6.8).contains(&of_poses), "{of_poses}");
    assert!((0.88..1.12).contains(&of_lenses), "{of_lenses}");
    assert!((0.85..1.15).contains(&moved), "{moved}");
    assert!(smaller < 0.5, "{smaller}");
}

/// The file of another lens with a small stated covariance is contradicted; without one it is replaced.
#[test]
fn a_lens_far_from_what_was_stated_is_named() {
    let mut rng = Rng::new(7500);
    let room = room(&mut rng, 40, 0.3);
    let mut cameras = room.cameras.clone();
    cameras[2] = off(&cameras[2], |i| if i < 2 { 25.0 } else { 0.0 });
    let sigma = [2.0, 2.0, 1.0, 1.0, 0.002, 0.005, 1e-4, 1e-4];
    let stated = DMatrix::from_diagonal(&DVector::from_iterator(8, sigma.iter().map(|s: &f64| s * s)));
    let observations = room.disturbed(&mut rng);
    let intrinsics = vec![Some(stated); 4];
    let config = RigConfig { intrinsics: &intrinsics, ..RigConfig::default() };
    let verdict = solve(&room, &cameras, &observations, &config).expect("a rig").solution.verdict;
    assert!(verdict.is_inconsistent && verdict.worst_camera == Some(2), "{verdict:?}");
    assert_eq!(verdict.cameras[2].cause, Some(Cause::Intrinsics));
    let found = solve(&room, &cameras, &observations, &RigConfig::default()).expect("a rig");
    assert!(!found.solution.verdict.is_inconsistent);
    let focal_px = found.lenses[2].intrinsics.matrix().expect("a matrix").fx_px;
    assert!((focal_px - 900.0).abs() < 4.0 * found.lenses[2].covariance[(0, 0)].sqrt(), "{focal_px}");
}

/// With nothing free the answer is that of `solve_rig`; with exact lenses free, nothing moves.
#[test]
fn exact_lenses_stay() {
    let mut rng = Rng::new(7600);
    let room = room(&mut rng, 40, 0.3);
    let observations = room.disturbed(&mut rng);
    let problem = RigProblem {
        cameras: &room.cameras,
        body_of_target: &room.body_of_target,
        n_views: room.n_views,
        observations: &observations,
    };
    let held =
        solve_rig(&problem, &RigConfig { joint_covariance: true, ..RigConfig::default() }).expect("a rig");
    let none = solve_rig_and_lenses(&problem, &RigConfig::default(), &[]).expect("a rig");
    assert_eq!(none.solution.cameras, held.cameras);
    assert!(none.lenses.is_empty());
    let exact = vec![Some(DMatrix::zeros(8, 8)); 4];
    let config = RigConfig { intrinsics: &exact, ..RigConfig::default() };
    let found = solve_rig_and_lenses(&problem, &config, &[0, 1, 2, 3]).expect("a rig");
    assert!(found.lenses.iter().all(|lens| lens.intrinsics == room.cameras[lens.camera]));
    assert!((found.solution.cameras[2].covariance - held.cameras[2].covariance).norm() < 1e-12);
    assert!(matches!(solve_rig_and_lenses(&problem, &config, &[4]), Err(Error::InvalidSetting { .. })));
}
