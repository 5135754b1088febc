//! The places of cameras in a rig: accuracy against the bound, determinism, the paper's own pair.

mod common;

use common::{Rng, rooms};
use resight_core::Pose;
use resight_core::rig::RigConfig;

#[test]
fn exact_pixels_give_the_exact_rig() {
    let mut rng = Rng::new(1);
    let cameras =
        (0..5).map(|i| if i % 2 == 0 { rooms::pinhole(900.0) } else { rooms::barrel(900.0) }).collect();
    let room = rooms::ring_with_board(&mut rng, cameras, rooms::board(6, 5, 0.08), 20, 0.3);
    let solution = room.solve(&room.sightings, &RigConfig::default()).expect("a rig");
    for c in 0..5 {
        let (motion, _) = if c == 0 { continue } else { room.error(&solution, c) };
        assert!(motion.norm() < 1e-10, "camera {c}: {motion}");
    }
    for (found, (_, _, rig_from_body)) in solution.bodies.iter().zip(&room.bodies) {
        let motion = (found.rig_from_body * rig_from_body.inverse()).log();
        assert!(motion.norm() < 1e-10, "{motion}");
    }
    assert_eq!(solution.cameras[0].cam_from_rig, Pose::identity());
    assert_eq!(solution.n_used, solution.n_seen);
}

#[test]
fn try_noise() {
    let mut rng = Rng::new(2);
    let cameras = (0..8).map(|_| rooms::pinhole(900.0)).collect();
    let room = rooms::ring_with_board(&mut rng, cameras, rooms::board(6, 5, 0.08), 100, 0.3);
    let noisy = room.disturbed(&mut rng);
    let t = std::time::Instant::now();
    let solution = room.solve(&noisy, &RigConfig::default()).expect("a rig");
    println!(
        "{:?} steps {} sightings {} used {}/{} chi2/dof {} rms {}",
        t.elapsed(),
        solution.steps,
        noisy.len(),
        solution.n_used,
        solution.n_seen,
        solution.chi2 / solution.degrees_of_freedom as f64,
        solution.rms_px
    );
    for c in 1..8 {
        let (motion, nees) = room.error(&solution, c);
        println!(
            "{c} {:.2e} rad {:.2e} m nees {nees:.2}",
            motion.fixed_rows::<3>(0).norm(),
            motion.fixed_rows::<3>(3).norm()
        );
    }
    println!("{:?} {:?}", solution.weakest_link, solution.scales);
}
