//! Bad numbers into the solvers that know something of the rotation, and those of lines: an answer in finite numbers or a named error,
//! never a panic. What good numbers give, the other suites say.

use crate::common::{Rng, views};
use nalgebra::{Matrix3, Unit, Vector3};
use resight_core::line::{ImageLine, LineCorrespondence};
use resight_core::locate::known_rotation::{Known, KnownRotation, position_with_rotation};
use resight_core::locate::lines::locate_lines;
use resight_core::locate::prior::Prior;
use resight_core::locate::problem::Problem;
use resight_core::solve::line_rotation::line_rotation;
use resight_core::solve::pure_rotation::{DirectionPair, pure_rotation};
use resight_core::solve::upright_p2p::upright_p2p;
use resight_core::solve::vanishing::{rotations, vanishing_point};
use resight_core::{Pixel, Pose};

/// Mostly ordinary, often zero, equal, huge, tiny or no number at all.
fn number(rng: &mut Rng) -> f64 {
    match rng.index(14) {
        0 => 0.0,
        1 => 1.0,
        2 => -1.0,
        3 => rng.normal() * 10f64.powf(rng.uniform(-300.0, 300.0)),
        4 => [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e-320][rng.index(4)],
        _ => rng.normal(),
    }
}

fn vector(rng: &mut Rng) -> Vector3<f64> {
    Vector3::new(number(rng), number(rng), number(rng))
}

/// A unit vector, or what passes for one.
fn direction(rng: &mut Rng) -> Unit<Vector3<f64>> {
    match rng.index(4) {
        0 => Unit::new_unchecked(vector(rng)),
        1 => [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()][rng.index(3)],
        _ => Unit::new_normalize(rng.unit_vector()),
    }
}

fn is_whole(pose: &Pose) -> bool {
    (pose.rotation.sum() + pose.translation.sum()).is_finite()
}

#[test]
fn rotations_and_two_point_poses_survive_bad_numbers() {
    let mut rng = Rng::new(1);
    let mut answered = 0;
    for _ in 0..100_000 {
        let bearings = [direction(&mut rng), direction(&mut rng)];
        let points = [vector(&mut rng), vector(&mut rng)];
        if let Ok(poses) = upright_p2p(&bearings, &points, &direction(&mut rng), &direction(&mut rng)) {
            assert!(poses.iter().all(is_whole), "{bearings:?} {points:?} {poses:?}");
            answered += 1;
        }
        let pair = |rng: &mut Rng| DirectionPair {
            in_first: direction(rng),
            in_second: direction(rng),
            sigma_rad: number(rng).abs() * 0.01,
        };
        let pairs: Vec<_> = (0..rng.index(5)).map(|_| pair(&mut rng)).collect();
        for found in pure_rotation(&pairs).into_iter().chain(rotations(&pairs).into_iter().flatten()) {
            let sum = found.second_from_first.sum() + found.covariance.sum() + found.chi2;
            assert!(sum.is_finite(), "{pairs:?} {found:?}");
            answered += 1;
        }
    }
    assert!(20_000 < answered, "{answered}");
}

#[test]
fn lines_and_places_survive_bad_numbers() {
    let mut rng = Rng::new(2);
    let camera = views::camera();
    let (mut answered, mut tried) = (0, 0);
    for _ in 0..10_000 {
        let pixel = |rng: &mut Rng| Pixel::new(320.0 + 200.0 * number(rng), 240.0 + 200.0 * number(rng));
        let lines: Vec<_> = (0..4)
            .filter_map(|_| {
                let seen =
                    ImageLine::new(&camera, [pixel(&mut rng), pixel(&mut rng)], number(&mut rng).abs())
                        .ok()?;
                let point_in_target = (rng.index(4) != 0).then(|| vector(&mut rng));
                Some(LineCorrespondence { point_in_target, direction_in_target: direction(&mut rng), seen })
            })
            .collect();
        let seen: Vec<_> = views::seen_from(&views::oblique(), &views::general()[..rng.index(3)], 0.5)
            .into_iter()
            .map(|mut c| {
                if rng.index(3) == 0 {
                    c.x_in_target = vector(&mut rng);
                }
                c
            })
            .collect();
        tried += 1;
        if let Ok(found) = vanishing_point(&lines.iter().map(|l| l.seen).collect::<Vec<_>>()) {
            assert!((found.direction.sum() + found.covariance.sum() + found.chi2).is_finite(), "{lines:?}");
        }
        if let [a, b, c, ..] = lines[..] {
            let found =
                line_rotation(&[a, b, c].map(|l| l.seen.normal()), &[a, b, c].map(|l| l.direction_in_target));
            assert!(found.iter().all(|r| r.sum().is_finite()), "{lines:?}");
        }
        let height = Prior::Height {
            normal_in_target: direction(&mut rng).into_inner(),
            offset_m: number(&mut rng),
            height_m: number(&mut rng),
            sigma_m: number(&mut rng).abs(),
        };
        let priors = [height];
        let problem = Problem { priors: &priors[..rng.index(2)], ..Problem::new(&seen, &camera) };
        if let Ok(found) = locate_lines(&lines, &problem) {
            assert!(
                is_whole(&found.cam_from_target) && (found.covariance.sum() + found.chi2).is_finite(),
                "{lines:?}"
            );
            answered += 1;
        }
        let known = [
            Known::Distance {
                point: rng.index(3),
                distance_m: number(&mut rng),
                sigma_m: number(&mut rng).abs(),
            },
            Known::Place {
                origin_in_target: vector(&mut rng),
                covariance_m2: Matrix3::from_diagonal(&vector(&mut rng)),
            },
        ];
        let rotation = KnownRotation {
            cam_from_target: if rng.index(5) == 0 {
                Matrix3::repeat(number(&mut rng))
            } else {
                rng.rotation()
            },
            covariance: Matrix3::identity() * number(&mut rng).abs(),
        };
        if let Ok(found) = position_with_rotation(&rotation, &seen, &lines, &camera, &known[..rng.index(3)]) {
            assert!(
                is_whole(&found.cam_from_target) && (found.covariance.sum() + found.chi2).is_finite(),
                "{known:?}"
            );
            answered += 1;
        }
    }
    println!("{answered} answers to {tried} twice");
    assert!(100 < answered, "{answered}");
    assert!(vanishing_point(&[]).is_err());
}
