//! The pose of a rig among wrong points: found, with its covariance; chance is refused. Rigs of `common::rigs`, 0.5 px.

use crate::common::rigs::{FAMILIES, SIGMA_PX, Scene, views_of};
use crate::common::{Rng, views};
use resight_core::multiview::rig_pose::rig_consensus;
use resight_core::{Correspondence, Error, Pixel};

const THRESHOLD_PX: f64 = 4.0 * SIGMA_PX;

/// Noise on every pixel, and a share of the points seen somewhere else in their camera's image; which ones are good.
fn spoilt(scene: &Scene, rng: &mut Rng, share: f64) -> (Vec<crate::common::rigs::Made>, Vec<(usize, usize)>) {
    let mut cameras = scene.disturbed(rng);
    let mut good = Vec::new();
    for (view, made) in cameras.iter_mut().enumerate() {
        for (point, c) in made.seen.iter_mut().enumerate() {
            if rng.uniform(0.0, 1.0) < share {
                let pixel = Pixel::new(rng.uniform(0.0, 1279.0), rng.uniform(0.0, 959.0));
                *c = Correspondence::new(&views::camera(), c.x_in_target, pixel, SIGMA_PX)
                    .expect("in the image");
            } else {
                good.push((view, point));
            }
        }
    }
    (cameras, good)
}

/// 40 % wrong of 30 points in three cameras, ten a camera: those that agree are the good ones (a wrong one may lie within the threshold by
/// accident, a good one beyond it), and the error is as the covariance says.
#[test]
fn the_pose_is_found_among_wrong_points() {
    let mut rng = Rng::new(5);
    let (mut nees, mut n, mut lost, mut all) = (0.0, 0, 0, 0);
    for (name, family) in FAMILIES {
        for _ in 0..40 {
            let scene = family(&mut rng, 3, 30);
            let (cameras, good) = spoilt(&scene, &mut rng, 0.4);
            let found = rig_consensus(&views_of(&cameras, &views::camera(), None), THRESHOLD_PX);
            let found = found.unwrap_or_else(|reason| panic!("{name}: {reason}"));
            let wrong = found.inliers.iter().filter(|p| !good.contains(p)).count();
            assert!(wrong <= 1, "{name}: {wrong} wrong ones agree");
            lost += good.iter().filter(|p| !found.inliers.contains(p)).count();
            all += good.len();
            let error = scene.error(&found.estimate.rig_from_target);
            let inverse = found.estimate.covariance.try_inverse().expect("a covariance");
            nees += (error.transpose() * inverse * error)[(0, 0)];
            n += 1;
        }
    }
    let mean = nees / f64::from(n);
    // Six expected; 80 scenes of six numbers: ± 0.4. A wrong one that agrees by accident adds a little.
    assert!((4.8..7.6).contains(&mean), "{mean}");
    assert!(lost * 50 < all, "{lost} of {all} good ones thrown out");
}

/// Points that belong to nothing: no pose is made of them.
#[test]
fn chance_is_refused() {
    let mut rng = Rng::new(6);
    for (name, family) in FAMILIES {
        for _ in 0..5 {
            let scene = family(&mut rng, 3, 18);
            let (cameras, _) = spoilt(&scene, &mut rng, 1.1);
            let found = rig_consensus(&views_of(&cameras, &views::camera(), None), THRESHOLD_PX);
            assert!(matches!(found, Err(Error::NoConsensus { .. })), "{name}: {found:?}");
        }
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let scene = FAMILIES[0].1(&mut Rng::new(7), 2, 6);
    let camera = views::camera();
    let views = views_of(&scene.cameras, &camera, None);
    for threshold_px in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(rig_consensus(&views, threshold_px), Err(Error::InvalidSetting { .. })));
    }
    assert!(matches!(rig_consensus(&[], 1.0), Err(Error::EmptyRig)));
    let two = FAMILIES[0].1(&mut Rng::new(8), 2, 2);
    let refused = rig_consensus(&views_of(&two.cameras, &camera, None), 1.0);
    assert!(matches!(refused, Err(Error::TooFewPoints { seen: 2, needed: 3 })), "{refused:?}");
}
