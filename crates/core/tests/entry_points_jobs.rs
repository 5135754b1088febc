//! As `entry_points.rs`, for the jobs above a single pose: many views at once, consensus, turns, surveys, advice.

use crate::common::surveys::{Drawn, Known, ring};
use crate::common::wild::{covariance, feed, is_whole, number, pose, seen, spoil};
use crate::common::{Rng, views};
use nalgebra::Matrix2;
use resight_core::advise::expect::{View, expect};
use resight_core::batch::{Given, Views, locate_each, locate_each_of_three};
use resight_core::covariance::is_covariance;
use resight_core::locate::PoseEstimate;
use resight_core::multiview::network::{Constraint, NetworkCamera, NetworkProblem, adjust};
use resight_core::robust::{Config, consensus};
use resight_core::target::KnownPoint;
use resight_core::temporal::relative_rotation::{Landmark, RelativeRotationConfig, relative_rotation};
use resight_core::{Error, Pixel, Point, Pose, Vector6};

fn pixels<const N: usize>(rng: &mut Rng, points: &[Point]) -> [Pixel; N] {
    let near = Pose::exp(&Vector6::from_fn(|_, _| 0.05 * rng.normal())) * views::oblique();
    let mut pixels = [0; N].map(|_| Pixel::zeros());
    for (pixel, x) in pixels.iter_mut().zip(points) {
        *pixel = views::pixel_of(&(near * *x));
        if rng.index(8) == 0 {
            spoil(rng, pixel.as_mut_slice());
        }
    }
    pixels
}

/// Points of a layout, some of them spoilt.
fn places<const N: usize>(rng: &mut Rng, points: &[Point]) -> [Point; N] {
    let mut places = [0; N].map(|_| Point::zeros());
    for (place, x) in places.iter_mut().zip(points) {
        *place = *x;
        if rng.index(12) == 0 {
            spoil(rng, place.as_mut_slice());
        }
    }
    places
}

fn is_sound(answer: &Result<PoseEstimate, Error>) -> bool {
    let Ok(e) = answer else { return true };
    is_whole(&e.cam_from_target)
        && (e.chi2 + e.rms_px + e.probability).is_finite()
        && is_covariance(&e.covariance)
}

#[test]
fn locate_each_answers_in_numbers() {
    let camera = views::camera();
    let mut answers = Vec::new();
    feed("locate_each", 21, |rng| {
        let layout = if rng.index(2) == 0 { views::line_plus_one() } else { views::general() };
        let points: Vec<[Point; 4]> = (0..9).map(|_| places(rng, &layout)).collect();
        let seen: Vec<[Pixel; 4]> = (0..9).map(|_| pixels(rng, &layout)).collect();
        let mut sigma_px = [0.5; 4];
        spoil(rng, &mut sigma_px);
        let points_in_target =
            if rng.index(2) == 0 { Given::Shared(&points[0]) } else { Given::Each(&points) };
        let views = Views {
            camera: Given::Shared(&camera),
            points_in_target,
            pixels: &seen,
            sigma_px: Given::Shared(&sigma_px),
        };
        if locate_each(&views, &mut answers).is_err() {
            return false;
        }
        assert!(answers.iter().all(is_sound), "{views:?} {answers:?}");
        answers.iter().any(Result::is_ok)
    });
}

#[test]
fn locate_each_of_three_answers_in_numbers() {
    let camera = views::camera();
    let mut answers = Vec::new();
    feed("locate_each_of_three", 22, |rng| {
        let points: Vec<[Point; 3]> = (0..9).map(|_| places(rng, &views::three())).collect();
        let seen: Vec<[Pixel; 3]> = (0..9).map(|_| pixels(rng, &views::three())).collect();
        let mut sigma_px = [0.5; 3];
        spoil(rng, &mut sigma_px);
        let points_in_target = Given::Each(&points[..]);
        let views = Views {
            camera: Given::Shared(&camera),
            points_in_target,
            pixels: &seen,
            sigma_px: Given::Shared(&sigma_px),
        };
        if locate_each_of_three(&views, &mut answers).is_err() {
            return false;
        }
        assert!(answers.iter().all(is_sound), "{views:?} {answers:?}");
        answers.iter().any(Result::is_ok)
    });
}

#[test]
fn consensus_answers_in_numbers() {
    let camera = views::camera();
    feed("consensus", 23, |rng| {
        let mut given = seen(rng, &views::oblique());
        given.extend(seen(rng, &views::oblique()));
        let threshold_px = if rng.index(4) == 0 { number(rng) } else { 3.0 };
        let config = Config { max_samples: 50, ..Config::with_threshold_px(threshold_px) };
        let Ok(found) = consensus(&given, &camera, &config) else { return false };
        assert!(is_sound(&Ok(found.estimate)), "{given:?} {found:?}");
        assert!(
            (found.confidence + found.log10_false_alarms + found.truncation).is_finite(),
            "{given:?} {found:?}"
        );
        true
    });
}

#[test]
fn turn_answers_in_numbers() {
    let camera = views::camera();
    feed("turn", 24, |rng| {
        let turned = Pose::exp(&Vector6::new(
            0.02 * rng.normal(),
            0.02 * rng.normal(),
            0.02 * rng.normal(),
            0.0,
            0.0,
            0.0,
        ));
        let landmarks: Vec<Landmark> = (0..24)
            .filter_map(|i| {
                let place = Pixel::new(rng.uniform(40.0, 600.0), rng.uniform(40.0, 440.0));
                let in_reference = camera.bearing(&place).ok()?;
                let now = turned.rotation * in_reference.into_inner();
                let mut pixel = views::pixel_of(&now) + Pixel::new(rng.normal(), rng.normal()) * 0.2;
                let mut covariance_px2 = Matrix2::identity() * 0.04;
                let mut unobserved_px = Matrix2::identity() * 0.01;
                if rng.index(20) == 0 {
                    spoil(rng, pixel.as_mut_slice());
                    spoil(rng, covariance_px2.as_mut_slice());
                    spoil(rng, unobserved_px.as_mut_slice());
                }
                let bent_px = Pixel::new(0.01, 0.0);
                Some(Landmark {
                    in_reference,
                    pixel,
                    covariance_px2,
                    neighbourhood: i / 4,
                    bent_px,
                    unobserved_px,
                })
            })
            .collect();
        let config =
            RelativeRotationConfig { max_samples: 50, ..RelativeRotationConfig::with_threshold_px(2.0) };
        let Ok(t) = relative_rotation(&landmarks, &camera, None, &config) else { return false };
        assert!(
            t.now_from_reference.sum().is_finite() && is_covariance(&t.covariance),
            "{landmarks:?} {t:?}"
        );
        assert!((t.bend + t.noise_factor + t.coherence + t.rms_px).is_finite(), "{landmarks:?} {t:?}");
        true
    });
}

/// The numbers of one fact spoilt.
fn spoil_constraint(rng: &mut Rng, constraint: &mut Constraint) {
    match constraint {
        Constraint::ImagePoint { pixel, .. } => spoil(rng, pixel.as_mut_slice()),
        Constraint::Place { x_in_world, sigma_m, .. } => {
            spoil(rng, x_in_world.as_mut_slice());
            spoil(rng, sigma_m.as_mut_slice());
        }
        Constraint::Distance { distance_m, sigma_m, .. } => {
            *distance_m = number(rng);
            *sigma_m = if rng.index(2) == 0 { number(rng) } else { *sigma_m };
        }
        Constraint::OnPlane { sigma_m, .. } => *sigma_m = number(rng),
        Constraint::Upright { sigma_rad, .. } => *sigma_rad = number(rng),
        Constraint::Gravity { down_in_cam, sigma_rad, .. } => {
            spoil(rng, down_in_cam.as_mut_slice());
            *sigma_rad = number(rng);
        }
        Constraint::Pose { cam_from_world, covariance, .. } => {
            *cam_from_world = pose(rng);
            *covariance = Some(self::covariance(rng));
        }
    }
}

#[test]
fn adjust_answers_in_numbers() {
    let mut scenes = Rng::new(250);
    let drawn: Vec<Drawn> = (0..20)
        .map(|i| {
            let known = if i % 2 == 0 { Known::Tapes(5) } else { Known::Coordinates };
            Drawn::new(&mut scenes, 1 + i % 3, &known, 6.0, |rng| ring(rng, 4))
        })
        .collect();
    feed("adjust", 25, |rng| {
        let scene = &drawn[rng.index(drawn.len())];
        let mut constraints = scene.constraints.clone();
        for _ in 0..rng.index(3) {
            let i = rng.index(constraints.len());
            spoil_constraint(rng, &mut constraints[i]);
        }
        let cameras = [NetworkCamera { camera: &scene.camera, intrinsics_covariance: None }];
        let network = NetworkProblem {
            cameras: &cameras,
            camera_of_photo: &scene.camera_of_photo,
            n_points: scene.points.len(),
            planes: &scene.planes,
            constraints: &constraints,
        };
        let Ok(adjusted) = adjust(&network) else { return false };
        assert!((adjusted.chi2 + adjusted.noise_scale).is_finite(), "{constraints:?}");
        for i in 0..scene.points.len() {
            let (place, covariance) = (adjusted.point(i), adjusted.point_covariance_m2(i));
            assert!(place.is_none_or(|x| x.sum().is_finite()), "{constraints:?} point {i}: {place:?}");
            assert!(
                covariance.is_none_or(|c| c.sum().is_finite() && (0..3).all(|k| 0.0 <= c[(k, k)])),
                "{constraints:?} point {i}: {covariance:?}"
            );
        }
        for i in 0..scene.photos.len() {
            assert!(
                adjusted.cam_from_world(i).is_none_or(|p| is_whole(&p)),
                "{constraints:?} photograph {i}"
            );
        }
        true
    });
}

#[test]
fn expect_answers_in_numbers() {
    let camera = views::camera();
    feed("expect", 26, |rng| {
        let (_, points) = views::all()[rng.index(4)].clone();
        let mut points: Vec<KnownPoint> =
            points.into_iter().map(|position| KnownPoint { position, sigma_m: 0.0 }).collect();
        if rng.index(3) == 0 {
            let i = rng.index(points.len());
            spoil(rng, points[i].position.as_mut_slice());
            points[i].sigma_m = number(rng).abs();
        }
        let near = Pose::exp(&Vector6::from_fn(|_, _| 0.2 * rng.normal()));
        let cam_from_target = if rng.index(3) == 0 { pose(rng) } else { near } * views::oblique();
        let sigma_px = if rng.index(4) == 0 { number(rng) } else { 0.3 };
        let view =
            View { camera: &camera, cam_from_target, points: &points, sigma_px, intrinsics_covariance: None };
        let Ok(e) = expect(&view) else { return false };
        assert!(is_covariance(&e.covariance) && is_covariance(&e.stated_covariance), "{view:?} {e:?}");
        let chances = [e.chance_ambiguous(), e.chance_wrong()];
        assert!(
            e.bend_ratio.is_finite() && chances.iter().all(|p| (0.0..=1.0).contains(p)),
            "{view:?} {e:?}"
        );
        true
    });
}
