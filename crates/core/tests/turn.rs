//! The rotation since a reference: exact, efficient, as sure as it says, distinguished from what moves by itself.

use crate::common::Rng;
use crate::common::rooms::{barrel, pinhole};
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};
use resight_core::temporal::relative_rotation::{
    Landmark, RelativeRotation, RelativeRotationConfig, relative_rotation,
};
use resight_core::{Bearing, Camera, Error};

/// A grid of landmarks 20° to each side, each with an error ellipse of its own; `noise` scales what is drawn of it.
fn landmarks(rng: &mut Rng, camera: &Camera, r: &Matrix3<f64>, n: usize, noise: f64) -> Vec<Landmark> {
    let mut seen = Vec::new();
    while seen.len() < n {
        let (x, y) = (rng.uniform(-0.36, 0.36), rng.uniform(-0.27, 0.27));
        let in_reference = Bearing::new_normalize(Vector3::new(x, y, 1.0));
        let Some(pixel) = camera.project(&(r * in_reference.into_inner())) else { continue };
        let root =
            Matrix2::new(rng.uniform(0.02, 0.1), 0.0, rng.uniform(-0.03, 0.03), rng.uniform(0.02, 0.1));
        let drawn = root * Vector2::new(rng.normal(), rng.normal()) * noise;
        let cell = |z: f64, half: f64, cells: f64| ((z + half) / (2.0 * half) * cells) as u32;
        let neighbourhood = 4 * cell(y, 0.27, 3.0) + cell(x, 0.36, 4.0);
        seen.push(Landmark {
            in_reference,
            pixel: pixel + drawn,
            covariance_px2: root * root.transpose(),
            neighbourhood,
            bent_px: Vector2::zeros(),
            unobserved_px: Matrix2::zeros(),
        });
    }
    seen
}

fn some_turn(rng: &mut Rng, size_rad: f64) -> Matrix3<f64> {
    Rotation3::new(rng.unit_vector() * size_rad).into_inner()
}

/// Left rotation vector from `found` to `truth`.
fn error(truth: &Matrix3<f64>, found: &RelativeRotation) -> Vector3<f64> {
    Rotation3::from_matrix_unchecked(truth * found.now_from_reference.transpose()).scaled_axis()
}

fn nees(truth: &Matrix3<f64>, found: &RelativeRotation) -> f64 {
    let e = error(truth, found);
    e.dot(&found.covariance.cholesky().expect("a covariance").solve(&e))
}

fn config() -> RelativeRotationConfig {
    RelativeRotationConfig::with_threshold_px(1.0)
}

#[test]
fn exact_pixels_give_the_exact_turn() {
    let mut rng = Rng::new(0x7a1);
    for camera in [pinhole(900.0), barrel(700.0)] {
        for size_rad in [0.0, 1e-6, 0.01, 0.3] {
            let truth = some_turn(&mut rng, size_rad);
            let seen = landmarks(&mut rng, &camera, &truth, 60, 0.0);
            let found = relative_rotation(&seen, &camera, None, &config()).expect("a turn");
            assert!(error(&truth, &found).norm() < 1e-10, "{size_rad}: {}", error(&truth, &found).norm());
            assert_eq!(found.used.len(), 60);
        }
    }
}

/// A camera that turns to the right has what it saw ahead on its left, and one that looks up has it below.
#[test]
fn the_signs_are_those_of_the_conventions() {
    let camera = pinhole(900.0);
    let mut rng = Rng::new(0x7a2);
    let old_from_new = Rotation3::new(Vector3::new(0.01, 0.02, 0.0));
    let truth = old_from_new.inverse().into_inner();
    let ahead = camera.project(&Vector3::z()).expect("ahead");
    let now = camera.project(&(truth * Vector3::z())).expect("now");
    assert!(now.x < ahead.x - 10.0 && ahead.y + 5.0 < now.y, "{ahead} {now}");
    let seen = landmarks(&mut rng, &camera, &truth, 60, 0.0);
    let (vector, _) = relative_rotation(&seen, &camera, None, &config()).expect("a turn").old_from_new();
    assert!((vector - old_from_new.scaled_axis()).norm() < 1e-10, "{vector}");
}

/// 600 draws: normalised errors as χ² of three degrees of freedom, 95 of 100 within their ellipsoid, and a scatter as small as the
/// Cramér–Rao bound. Factor two of the noise is unknown to the stated covariances, and found.
#[test]
fn as_sure_as_it_says_and_no_worse_than_possible() {
    let camera = barrel(900.0);
    let mut rng = Rng::new(0x7a3);
    let (runs, noise) = (600, 2.0);
    let (mut sum, mut within, mut scatter, mut bound) = (0.0, 0, 0.0, 0.0);
    for _ in 0..runs {
        let truth = some_turn(&mut rng, 0.02);
        let seen = landmarks(&mut rng, &camera, &truth, 100, noise);
        let found = relative_rotation(&seen, &camera, None, &config()).expect("a turn");
        let nees = nees(&truth, &found);
        sum += nees;
        within += usize::from(nees < 7.815);
        let e = error(&truth, &found);
        scatter += e.norm_squared();
        bound += (noise * noise) * found.covariance.trace() / (found.noise_factor * found.coherence);
    }
    let (mean, coverage) = (sum / runs as f64, within as f64 / runs as f64);
    let efficiency = bound / scatter;
    println!("NEES {mean:.2}, coverage {coverage:.3}, efficiency {efficiency:.3}");
    // Standard deviation of the mean of χ²₃: √6/√600 = 0.1; the widening by κ ≥ 1 makes it smaller than three.
    assert!((2.4..3.3).contains(&mean), "{mean}");
    assert!((0.93..0.99).contains(&coverage), "{coverage}");
    assert!((0.92..1.10).contains(&efficiency), "{efficiency}");
}

/// Four in ten landmarks belong to something that moves by itself: all together, or each its own way.
#[test]
fn what_moves_by_itself_is_left_out() {
    let camera = pinhole(900.0);
    let mut rng = Rng::new(0x7a4);
    for together in [true, false] {
        let mut sum = 0.0;
        for _ in 0..50 {
            let truth = some_turn(&mut rng, 0.02);
            let mut seen = landmarks(&mut rng, &camera, &truth, 100, 1.0);
            for landmark in &mut seen[..40] {
                let away =
                    if together { [6.0, 2.0] } else { [rng.uniform(-30.0, 30.0), rng.uniform(-30.0, 30.0)] };
                landmark.pixel += Vector2::from(away);
            }
            let found = relative_rotation(&seen, &camera, None, &config()).expect("a turn");
            assert!(found.is_consistent() && found.used.iter().filter(|i| **i < 40).count() <= 1);
            sum += nees(&truth, &found);
        }
        assert!(sum / 50.0 < 5.0, "{together}: {}", sum / 50.0);
    }
}

/// An error of all landmarks to the same side, which no residual shows, is in the covariance; a bent tone curve, which shifts each its
/// own way, is estimated. 300 draws: without either the mean would be above ten.
#[test]
fn errors_common_to_all_are_in_the_covariance() {
    let camera = pinhole(900.0);
    let mut rng = Rng::new(0x7a7);
    let (mut unseen, mut bent, runs) = (0.0, 0.0, 300);
    for _ in 0..runs {
        let truth = some_turn(&mut rng, 0.02);
        let seen = landmarks(&mut rng, &camera, &truth, 100, 1.0);
        let (mut shifted, mut curved) = (seen.clone(), seen);
        let amount = Vector2::new(rng.normal(), rng.normal());
        let bend = 3.0 * rng.normal();
        for (shifted, curved) in shifted.iter_mut().zip(&mut curved) {
            shifted.unobserved_px = Matrix2::identity() * 0.03;
            shifted.pixel += shifted.unobserved_px * amount;
            // Bright is mostly above, so that a bend looks like a rotation.
            curved.bent_px = Vector2::new(0.02 * rng.normal(), 0.02 + 0.02 * rng.normal());
            curved.pixel += curved.bent_px * bend;
        }
        let reported = |seen: &[Landmark]| relative_rotation(seen, &camera, None, &config()).expect("a turn");
        unseen += nees(&truth, &reported(&shifted)) / f64::from(runs);
        bent += nees(&truth, &reported(&curved)) / f64::from(runs);
    }
    println!("NEES {unseen:.2} with a common shift, {bent:.2} with a bend");
    assert!((2.3..3.5).contains(&unseen) && (2.3..3.6).contains(&bent), "{unseen} {bent}");
}

/// What landmarks say of a bend counts beside what is expected of it, zero give or take one: where they know it to one as well, half of it is
/// believed.
#[test]
fn a_bend_that_hardly_shows_is_held_for_small() {
    let camera = pinhole(900.0);
    let mut rng = Rng::new(0x7a9);
    let truth = some_turn(&mut rng, 0.02);
    let mut seen = landmarks(&mut rng, &camera, &truth, 4000, 0.0);
    for landmark in &mut seen {
        // To either side by chance, so that no rotation looks like it: together they know the bend to one.
        let side = Vector2::new(rng.normal(), rng.normal());
        let whitened = landmark.covariance_px2.cholesky().expect("a covariance").solve(&side);
        landmark.bent_px = side / (side.dot(&whitened) * 4000.0).sqrt();
        landmark.pixel += landmark.bent_px;
    }
    let found = relative_rotation(&seen, &camera, None, &config()).expect("a turn");
    assert!((found.bend - 0.5).abs() < 0.01, "{}", found.bend);
}

/// Neighbourhoods that err together by a tenth of a pixel, four times what their landmarks do on average: the covariance says so.
#[test]
fn common_errors_widen_the_covariance() {
    let camera = pinhole(900.0);
    let mut rng = Rng::new(0x7a5);
    let (mut widened, mut alone, runs) = (0.0, 0.0, 300);
    for _ in 0..runs {
        let truth = some_turn(&mut rng, 0.02);
        let mut seen = landmarks(&mut rng, &camera, &truth, 200, 1.0);
        let common: Vec<Vector2<f64>> =
            (0..12).map(|_| Vector2::new(rng.normal(), rng.normal()) * 0.1).collect();
        seen.iter_mut().for_each(|l| l.pixel += common[l.neighbourhood as usize]);
        let found = relative_rotation(&seen, &camera, None, &config()).expect("a turn");
        widened += nees(&truth, &found) / runs as f64;
        alone += nees(&truth, &found) * found.coherence / runs as f64;
    }
    println!("NEES {widened:.2}, {alone:.2} without");
    assert!(widened < 6.0 && 15.0 < alone, "{widened} {alone}");
}

/// A rotation that is near is taken where most landmarks agree with it, and is no more than a start: one that is far off is left.
#[test]
fn near_is_a_start_and_no_answer() {
    let camera = barrel(900.0);
    let mut rng = Rng::new(0x7a8);
    for _ in 0..20 {
        let truth = some_turn(&mut rng, 0.3);
        let mut seen = landmarks(&mut rng, &camera, &truth, 60, 0.0);
        seen[..15].iter_mut().for_each(|l| l.pixel.x += 25.0);
        let beside = some_turn(&mut rng, 2e-4) * truth;
        let far = some_turn(&mut rng, 0.3) * truth;
        for near in [truth, beside, far, truth.transpose()] {
            let found = relative_rotation(&seen, &camera, Some(&near), &config()).expect("a turn");
            assert!(error(&truth, &found).norm() < 1e-9, "{}", error(&truth, &found));
            assert!(found.used.iter().copied().eq(15..60), "{:?}", found.used);
        }
        // With a rotation that most agree with nothing is drawn.
        let none = RelativeRotationConfig { max_samples: 0, ..config() };
        assert!(relative_rotation(&seen, &camera, Some(&beside), &none).is_ok());
        assert!(
            relative_rotation(&seen, &camera, Some(&far), &none).is_err()
                && relative_rotation(&seen, &camera, None, &none).is_err()
        );
    }
}

/// Landmarks found where the lens has no direction, a fisheye's dark corners for one: they are left out, the others keep their numbers.
#[test]
fn landmarks_outside_the_field_are_left_out() {
    let camera = barrel(900.0);
    let mut rng = Rng::new(0x7a9);
    let outside = Vector2::new(40_000.0, -30_000.0);
    assert!(camera.bearing(&outside).is_err());
    let truth = some_turn(&mut rng, 0.05);
    let all = landmarks(&mut rng, &camera, &truth, 60, 1.0);
    let mut seen = all.clone();
    for i in [0, 7, 31, 59] {
        seen[i].pixel = outside;
    }
    let found = relative_rotation(&seen, &camera, None, &config()).expect("a turn");
    let without: Vec<Landmark> = seen.iter().copied().filter(|l| l.pixel != outside).collect();
    let wanted = relative_rotation(&without, &camera, None, &config()).expect("a turn");
    assert!(error(&wanted.now_from_reference, &found).norm() < 1e-9);
    assert!((found.covariance - wanted.covariance).norm() < 1e-6 * wanted.covariance.norm());
    assert_eq!(found.given, 56);
    let pixels = |relative_rotation: &RelativeRotation, of: &[Landmark]| {
        relative_rotation.used.iter().map(|i| of[*i].pixel).collect::<Vec<_>>()
    };
    assert_eq!(pixels(&found, &seen), pixels(&wanted, &without));
    seen[10..].iter_mut().for_each(|l| l.pixel = outside);
    let refused = relative_rotation(&seen, &camera, None, &config());
    assert!(matches!(refused, Err(Error::TooFewPoints { seen: 8, needed: 15 })), "{refused:?}");
}

#[test]
fn most_against_it_is_inconsistent() {
    let camera = pinhole(900.0);
    let mut rng = Rng::new(0x7a6);
    let mut seen = landmarks(&mut rng, &camera, &Matrix3::identity(), 100, 1.0);
    for landmark in &mut seen[..70] {
        landmark.pixel += Vector2::new(rng.uniform(-20.0, 20.0), rng.uniform(-20.0, 20.0));
    }
    let found = relative_rotation(&seen, &camera, None, &config()).expect("thirty agree");
    assert!(!found.is_consistent() && found.used.len() < 50);
}

#[test]
fn what_cannot_be_is_named() {
    let camera = pinhole(900.0);
    let mut rng = Rng::new(0x7a7);
    let seen = landmarks(&mut rng, &camera, &Matrix3::identity(), 40, 1.0);
    let refused = |seen: &[Landmark]| relative_rotation(seen, &camera, None, &config()).expect_err("no turn");
    assert!(matches!(refused(&seen[..10]), Error::TooFewPoints { seen: 10, needed: 15 }));
    let mut broken = seen.clone();
    broken[3].pixel.x = f64::NAN;
    assert!(matches!(refused(&broken), Error::NotFinite { index: 3, .. }));
    let mut flat = seen.clone();
    flat[5].covariance_px2 = Matrix2::new(1.0, 1.0, 1.0, 1.0);
    assert!(matches!(refused(&flat), Error::CovarianceNotPositive { index: 5, .. }));
    let mut chance = seen.clone();
    chance.iter_mut().for_each(|l| l.pixel = Vector2::new(rng.uniform(0.0, 640.0), rng.uniform(0.0, 480.0)));
    assert!(matches!(refused(&chance), Error::NoConsensus { needed: 15, .. }));
    let same = vec![seen[0]; 30];
    assert!(relative_rotation(&same, &camera, None, &config()).is_err());
}
