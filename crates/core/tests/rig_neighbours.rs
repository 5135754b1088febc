//! A single view of points that were surveyed one after the other and are displaced together: the covariance of the cameras holds that, and no
//! lens is blamed for it.

use crate::common::rooms::Room;
use crate::common::{Rng, rooms, views};
use nalgebra::{Vector2, Vector3};
use resight_core::multiview::rig::{Observation, RigConfig, RigSolution};
use resight_core::{Correspondence, Point, Pose};

/// Standard deviation of a surveyed point, m.
const SIGMA_M: f64 = 0.01;
const N_POINTS: usize = 240;

fn normal(rng: &mut Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.normal())
}

/// Returns the points of a flight, and their surveyed positions, whose errors keep the share `kept` from one point to the next.
fn flight(rng: &mut Rng, kept: f64) -> (Vec<Point>, Vec<Point>) {
    let (mut at, mut error) = (Vector3::zeros(), normal(rng) * SIGMA_M);
    let point = |_| {
        at = (at + rng.unit_vector() * 0.15).map(|x: f64| x.clamp(-0.5, 0.5));
        error = error * kept + normal(rng) * (SIGMA_M * f64::sqrt(1.0 - kept * kept));
        (Point::from(at), Point::from(at + error))
    };
    (0..N_POINTS).map(point).unzip()
}

/// Three cameras see every point of a flight in one view.
fn solved(rng: &mut Rng, kept: f64) -> (Room, RigSolution) {
    let (points, surveyed) = flight(rng, kept);
    let cameras = (0..3).map(|_| rooms::pinhole(900.0)).collect();
    let mut room = Room::new(cameras, rooms::ring(7, 3.0)[..3].to_vec());
    // The first camera's frame is the rig's.
    let rig_from_world = views::looking_at(Point::new(3.0, 0.4, 0.0), Point::new(0.1, 0.0, -0.1));
    for (camera, lens) in room.cameras.iter().enumerate() {
        let cam_from_world = room.cam_from_rig[camera] * rig_from_world;
        let see = |(x, given): (&Point, &Point)| {
            let noise = Vector2::new(rng.normal(), rng.normal()) * 0.3;
            let pixel = lens.project(&(cam_from_world * *x)).expect("in the field") + noise;
            let seen = Correspondence::new(lens, *given, pixel, 0.3).expect("a point");
            Correspondence { sigma_m: SIGMA_M, ..seen }
        };
        let seen = points.iter().zip(&surveyed).map(see).collect();
        room.observations.push(Observation { camera, view: 0, target: 0, seen });
    }
    room = room.with_target(points, 0, Pose::identity());
    (room.n_views, room.bodies) = (1, vec![(0, 0, rig_from_world)]);
    let solution = room.solve(&room.observations, &RigConfig::default()).expect("a rig");
    (room, solution)
}

#[test]
fn errors_along_a_flight_are_in_the_covariance() {
    const RUNS: u64 = 60;
    // A displaced point displaces its images in all cameras: between cameras a part of that cancels, and the covariance is too wide by it.
    for (kept, range) in [(0.0, 4.0..7.5), (0.8, 3.0..7.5), (0.95, 2.0..7.5)] {
        let (mut nees, mut n_widened, mut n_ok) = (0.0, 0_u64, 0_u64);
        for seed in 0..RUNS {
            let (room, solution) = solved(&mut Rng::new(900 + seed), kept);
            let of_camera = |c: usize| room.error(&solution, c).1;
            nees += 0.5 * (of_camera(1) + of_camera(2)) / RUNS as f64;
            n_widened += u64::from(1.0 < solution.view_scale);
            n_ok += u64::from(!solution.verdict.is_inconsistent);
        }
        println!("kept {kept}: NEES {nees:.2}, widened {n_widened}, ok {n_ok} of {RUNS}");
        assert!(range.contains(&nees), "kept {kept}: NEES {nees}");
        assert!(RUNS - 1 <= n_ok, "kept {kept}: {n_ok}");
        assert!(if kept == 0.0 { n_widened <= 1 } else { n_widened == RUNS }, "{n_widened}");
    }
}
