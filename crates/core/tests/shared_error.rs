//! Errors that all points of a view share: where they show, the covariance holds them; where there are none, nothing is lost.
//!
//! Boards of three kinds, near and far, with a random smooth displacement of the image. `RESIGHT_SCENES` draws more scenes. What no
//! residual can show (a displacement that the pose takes up whole, or one below the noise) is left out: docs/math/shared_error.md section 4.

use crate::common::{Rng, rooms};
use nalgebra::{DMatrix, DVector, Rotation3, Vector2, Vector3};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::{Config, locate};
use resight_core::{Camera, Correspondence, Pixel, Point, Pose};

fn scenes(default: usize) -> usize {
    std::env::var("RESIGHT_SCENES").ok().and_then(|n| n.parse().ok()).unwrap_or(default)
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Board {
    Chessboard,
    Charuco,
    AprilGrid,
    Twelve,
}

impl Board {
    fn points(self) -> Vec<Point> {
        match self {
            Board::Chessboard => rooms::board(9, 6, 0.03),
            Board::Charuco => rooms::board(4, 6, 0.045),
            Board::Twelve => rooms::board(4, 3, 0.06),
            Board::AprilGrid => {
                let corners = [[0.0, 0.0], [0.044, 0.0], [0.044, 0.044], [0.0, 0.044]];
                let tags = rooms::board(6, 6, 0.0572);
                tags.iter()
                    .flat_map(|tag| corners.map(|[x, y]| tag + Point::new(x - 0.022, y - 0.022, 0.0)))
                    .collect()
            }
        }
    }
}

/// The shared displacement: none, or one of a squared-exponential covariance whose length is half the board, px in one axis of the image.
#[derive(Debug, Clone, Copy)]
struct Scene {
    board: Board,
    /// Distance over the board's width, from and to.
    distance: [f64; 2],
    field_px: f64,
    noise_px: f64,
}

const NEAR: [f64; 2] = [1.1, 1.6];
const FAR: [f64; 2] = [4.0, 7.0];

/// Lower Cholesky factor of the covariance of a displacement of one pixel, over the board.
fn smooth(points: &[Point]) -> DMatrix<f64> {
    let half = points.iter().map(|x| x.xy().amax()).fold(0.0, f64::max);
    let covariance = DMatrix::from_fn(points.len(), points.len(), |i, j| {
        let apart = (points[i] - points[j]).norm() / half;
        (-0.5 * apart * apart).exp() + if i == j { 1e-9 } else { 0.0 }
    });
    covariance.cholesky().expect("positive definite").l()
}

fn pose(rng: &mut Rng, width_m: f64, distance: [f64; 2]) -> Pose {
    let (tilt, azimuth) = (rng.uniform(15.0, 55.0).to_radians(), rng.uniform(0.0, std::f64::consts::TAU));
    let tilted = Rotation3::new(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt);
    let rotation = tilted * Rotation3::new(Vector3::new(0.0, 0.0, rng.uniform(-0.3, 0.3)));
    let z = width_m * rng.uniform(distance[0], distance[1]);
    Pose::new(
        rotation.into_inner(),
        Vector3::new(rng.uniform(-0.15, 0.15) * z, rng.uniform(-0.1, 0.1) * z, z),
    )
}

fn observe(
    rng: &mut Rng,
    camera: &Camera,
    scene: &Scene,
    points: &[Point],
    factor: &DMatrix<f64>,
    truth: &Pose,
) -> Vec<Correspondence> {
    let mut field = || factor * DVector::from_fn(points.len(), |_, _| scene.field_px * rng.normal());
    let (along_u, along_v) = (field(), field());
    let see = |(i, x): (usize, &Point)| {
        let noise = Vector2::new(rng.normal(), rng.normal()) * scene.noise_px;
        let pixel: Pixel =
            camera.project(&(truth * x)).expect("in front") + Vector2::new(along_u[i], along_v[i]) + noise;
        Correspondence::new(camera, *x, pixel, scene.noise_px).expect("in the field")
    };
    points.iter().enumerate().map(see).collect()
}

/// Mean squared errors of poses in units of their covariance: with shared errors, without them, and those of views that were widened.
struct Measured {
    with: f64,
    without: f64,
    widened: f64,
    share: f64,
}

fn measure(scene: &Scene, n: usize, seed: u64) -> Measured {
    let (camera, points, mut rng) = (rooms::pinhole(900.0), scene.board.points(), Rng::new(seed));
    let factor = smooth(&points);
    let width = points.iter().map(|x| x.x).fold(0.0, f64::max) * 2.0;
    let (mut all, mut m) = (0.0, Measured { with: 0.0, without: 0.0, widened: 0.0, share: 0.0 });
    for _ in 0..n {
        let truth = pose(&mut rng, width, scene.distance);
        let seen = observe(&mut rng, &camera, scene, &points, &factor, &truth);
        let solve =
            |shared_errors: bool| locate(&seen, &camera, &Config { shared_errors, ..Config::default() });
        let (Ok(e), Ok(old)) = (solve(true), solve(false)) else { continue };
        if let Ambiguity::Ambiguous { .. } = e.ambiguity {
            continue;
        }
        assert_eq!(e.cam_from_target, old.cam_from_target, "the pose stays where it is");
        assert_eq!(e.consistency, old.consistency, "what is explained is none the less said");
        let more = (e.covariance - old.covariance).symmetric_eigenvalues().min();
        assert!(-1e-9 * old.covariance.norm() <= more, "never smaller in any direction");
        let error = (e.cam_from_target * truth.inverse()).log();
        let nees = rooms::nees(&error, &e.covariance);
        all += 1.0;
        m.with += nees;
        m.without += rooms::nees(&error, &old.covariance);
        if 0.0 < e.shared_error_px {
            m.share += 1.0;
            m.widened += nees;
        }
    }
    let (widened, share) = (m.widened / m.share, m.share / all);
    let m = Measured { with: m.with / all, without: m.without / all, widened, share };
    println!(
        "{scene:?}: NEES {:.2}, without {:.2}; {:.3} of views widened, their NEES {:.2}",
        m.with, m.without, m.share, m.widened
    );
    m
}

/// Without shared errors one view in fifty is widened, and by little in the mean.
#[test]
fn nothing_is_lost_without_them() {
    for board in [Board::Chessboard, Board::Charuco, Board::AprilGrid, Board::Twelve] {
        for distance in [NEAR, FAR] {
            let m = measure(&Scene { board, distance, field_px: 0.0, noise_px: 0.15 }, scenes(150), 7);
            assert!(
                0.95 * m.without < m.with && m.with <= m.without && m.share < 0.06,
                "{board:?} {distance:?}"
            );
        }
    }
}

/// Where they are well above the noise, squared errors are those stated; before they were fifty to three hundred times as large.
#[test]
fn the_covariance_holds_them() {
    for board in [Board::Chessboard, Board::Charuco, Board::AprilGrid] {
        for (distance, field_px) in [(NEAR, 0.3), (NEAR, 0.5), (FAR, 0.3), (FAR, 0.5)] {
            let m = measure(&Scene { board, distance, field_px, noise_px: 0.05 }, scenes(100), 8);
            assert!(
                0.97 < m.share && 3.0 < m.widened && m.widened < 9.0,
                "{board:?} {distance:?} {field_px}"
            );
            assert!(100.0 < m.without);
        }
    }
}

/// At the noise that detectors state, only a part of the views shows them; those that do are honest.
#[test]
fn what_shows_is_in_the_covariance() {
    for board in [Board::Chessboard, Board::Charuco, Board::AprilGrid] {
        for (distance, field_px) in [(NEAR, 0.1), (NEAR, 0.3), (FAR, 0.1), (FAR, 0.3), (FAR, 0.5)] {
            let m = measure(&Scene { board, distance, field_px, noise_px: 0.15 }, scenes(60), 9);
            let is_seen = 0.5 < m.share && m.with < 0.6 * m.without;
            assert!(
                if field_px < 0.2 { m.with <= m.without } else { is_seen },
                "{board:?} {distance:?} {field_px}"
            );
            assert!(m.share < 0.1 || m.widened < 10.0, "{board:?} {distance:?} {field_px}");
        }
    }
}

/// The amplitude reported is that of the displacement as the residuals show it, of the order of the truth.
#[test]
fn its_amplitude_is_reported() {
    let (camera, points, mut rng) = (rooms::pinhole(900.0), Board::AprilGrid.points(), Rng::new(3));
    let factor = smooth(&points);
    let mut amplitudes: Vec<f64> = (0..21)
        .map(|_| {
            let truth = pose(&mut rng, 0.33, NEAR);
            let scene = Scene { board: Board::AprilGrid, distance: NEAR, field_px: 0.4, noise_px: 0.05 };
            let seen = observe(&mut rng, &camera, &scene, &points, &factor, &truth);
            locate(&seen, &camera, &Config::default()).expect("a pose").shared_error_px
        })
        .collect();
    amplitudes.sort_by(f64::total_cmp);
    assert!(0.2 < amplitudes[10] && amplitudes[10] < 0.8, "{amplitudes:?}");
}

/// Eight points show nothing however far they are off together: the answer is the same to the bit.
#[test]
fn few_points_are_left_alone() {
    let (camera, points, mut rng) = (rooms::pinhole(900.0), rooms::board(4, 2, 0.1), Rng::new(4));
    let factor = smooth(&points);
    let scene = Scene { board: Board::Twelve, distance: NEAR, field_px: 2.0, noise_px: 0.05 };
    let truth = pose(&mut rng, 0.3, NEAR);
    let seen = observe(&mut rng, &camera, &scene, &points, &factor, &truth);
    let solve = |shared_errors: bool| locate(&seen, &camera, &Config { shared_errors, ..Config::default() });
    assert_eq!(solve(true), solve(false));
}
