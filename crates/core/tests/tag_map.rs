//! Maps of tags that are not quite where the map says: true covariances, and the tag that is out of place.
//!
//! Tags of 165.1 mm, 2–5 m away, f = 800 px, 0.3 px.

use crate::common::{Rng, views};
use nalgebra::{DMatrix, DVector, Vector2, Vector3};
use resight_core::correspondence::{Detection, correspond};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::consistency::Consistency;
use resight_core::locate::group::RigidGroup;
use resight_core::locate::problem::Problem;
use resight_core::locate::refine::refine_problem;
use resight_core::locate::{Config, locate};
use resight_core::multiview::tag_map::{TargetPose, locate_target};
use resight_core::target::{Feature, MapTag, TagMap};
use resight_core::{Camera, Error, Pixel, Point, Pose, Target, Vector6};

const SIZE_M: f64 = 0.1651;
const SIGMA_PX: f64 = 0.3;

/// What is uncertain beside the pixels.
#[derive(Debug, Clone, Copy)]
struct Tolerance {
    sigma_m: f64,
    sigma_rad: f64,
}

const EXACT: Tolerance = Tolerance { sigma_m: 0.0, sigma_rad: 0.0 };
const PLACE: Tolerance = Tolerance { sigma_m: 0.01, sigma_rad: 0.0 };
const BOTH: Tolerance = Tolerance { sigma_m: 0.01, sigma_rad: 0.014 };

fn normal3(rng: &mut Rng) -> Vector3<f64> {
    Vector3::new(rng.normal(), rng.normal(), rng.normal())
}

/// Tags about the origin of the map that face a camera some metres away to within 45°, and the pose of that camera.
fn scene(rng: &mut Rng, n: usize, tolerance: Tolerance) -> (Target, Pose) {
    let towards = rng.unit_vector();
    let cam_from_world = views::looking_at(towards * rng.uniform(2.5, 4.5), Point::zeros());
    let facing = cam_from_world.rotation.transpose();
    let tag = |rng: &mut Rng, id: u32| {
        let angle = (rng.uniform(0.0, std::f64::consts::TAU), rng.uniform(0.3, 0.8));
        let tilt = Vector3::new(angle.0.cos(), angle.0.sin(), 0.0) * angle.1;
        let tilt = Pose::exp(&Vector6::new(tilt.x, tilt.y, tilt.z, 0.0, 0.0, 0.0)).rotation;
        let place = Vector3::new(rng.uniform(-0.8, 0.8), rng.uniform(-0.6, 0.6), rng.uniform(-0.5, 0.5));
        MapTag {
            id,
            size_m: SIZE_M,
            world_from_tag: Pose::new(facing * tilt, facing * place),
            sigma_m: tolerance.sigma_m,
            sigma_rad: tolerance.sigma_rad,
        }
    };
    let tags = (0..n as u32).map(|id| tag(rng, id)).collect();
    (Target::TagMap(TagMap { family: "tag36h11".into(), tags, joint_covariance: None }), cam_from_world)
}

/// The tag moved about its own centre, in the axes of the map.
fn moved(tag: &MapTag, by: &Vector3<f64>, turn: &Vector3<f64>) -> MapTag {
    let turn = Pose::exp(&Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0)).rotation;
    let at = tag.world_from_tag;
    MapTag { world_from_tag: Pose::new(turn * at.rotation, at.translation + by), ..tag.clone() }
}

fn tags_of(target: &Target) -> &[MapTag] {
    match target {
        Target::TagMap(map) => &map.tags,
        _ => unreachable!(),
    }
}

fn corner(tag: &MapTag, corner: u8) -> Point {
    let h = 0.5 * tag.size_m;
    let (x, y) = [(-h, -h), (h, -h), (h, h), (-h, h)][corner as usize];
    tag.world_from_tag * Point::new(x, y, 0.0)
}

/// What a camera sees of tags where they really are.
fn detections(rng: &mut Rng, camera: &Camera, cam_from_world: &Pose, tags: &[MapTag]) -> Vec<Detection> {
    let of_tag = |tag: &MapTag, k: u8, noise: Vector2<f64>| -> Detection {
        let pixel: Pixel = camera.project(&(cam_from_world * &corner(tag, k))).expect("in the field") + noise;
        Detection {
            feature: Feature { id: tag.id, corner: k },
            pixel,
            sigma_px: SIGMA_PX,
            lens_sigma_px: 0.0,
            covariance_px2: None,
        }
    };
    let mut found = Vec::new();
    for tag in tags {
        for k in 0..4 {
            let noise = Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
            found.push(of_tag(tag, k, noise));
        }
    }
    found
}

fn drawn(rng: &mut Rng, target: &Target, tolerance: Tolerance) -> Vec<MapTag> {
    let draw = |tag: &MapTag| {
        let (by, turn) = (normal3(rng) * tolerance.sigma_m, normal3(rng) * tolerance.sigma_rad);
        moved(tag, &by, &turn)
    };
    tags_of(target).iter().map(draw).collect()
}

fn is_ok(found: &TargetPose) -> bool {
    let fits = |e: &resight_core::locate::PoseEstimate| matches!(e.consistency, Consistency::Consistent);
    found.left_out.is_empty() && found.contradicting.is_empty() && found.estimate.as_ref().is_ok_and(fits)
}

fn nees(found: &Pose, truth: &Pose, covariance: &resight_core::Matrix6) -> f64 {
    let error = (*found * truth.inverse()).log();
    error.dot(&(covariance.try_inverse().expect("positive definite") * error))
}

/// Mean NEES of the unique answers, the share of refused ones, and the same for the map taken as exact.
fn honest(name: &str, n_tags: usize, stated: Tolerance, seed: u64) {
    const N: usize = 3000;
    let (mut rng, camera) = (Rng::new(seed), views::camera());
    let (mut n, mut sum, mut sum_exact, mut refused, mut refused_exact) = (0, 0.0, 0.0, 0, 0);
    for _ in 0..N {
        let (target, truth) = scene(&mut rng, n_tags, stated);
        let real = drawn(&mut rng, &target, stated);
        let seen = detections(&mut rng, &camera, &truth, &real);
        let found = locate_target(&seen, &target, &camera, &Config::default());
        refused += usize::from(!is_ok(&found));
        let e = found.estimate.expect("a pose");
        if matches!(e.ambiguity, Ambiguity::Ambiguous { .. }) {
            continue;
        }
        (n, sum) = (n + 1, sum + nees(&e.cam_from_target, &truth, &e.covariance));
        let points: Vec<_> = correspond(&seen, &target, &camera).0.into_iter().map(|(_, c)| c).collect();
        let exact = locate(&points, &camera, &Config::default()).expect("a pose");
        refused_exact += usize::from(!matches!(exact.consistency, Consistency::Consistent));
        sum_exact += nees(&exact.cam_from_target, &truth, &exact.covariance);
    }
    let (mean, mean_exact) = (sum / n as f64, sum_exact / n as f64);
    println!(
        "{name}, {n_tags} tags: {n} unique, NEES {mean:.3}, {refused} not ok; taken as exact {mean_exact:.1}, {refused_exact} not ok"
    );
    assert!((5.7..6.3).contains(&mean), "{name}, {n_tags} tags: NEES {mean}");
    assert!(refused <= N / 500, "{name}, {n_tags} tags: {refused} of {N} good views are refused");
    assert!(n_tags == 1 || 8.0 < mean_exact, "the displacement does not matter here: {mean_exact}");
}

#[test]
fn covariance_is_true_for_one_tag() {
    honest("displaced", 1, PLACE, 41);
}

#[test]
fn covariance_is_true_for_displaced_tags() {
    for n_tags in [2, 3, 6] {
        honest("displaced", n_tags, PLACE, 42 + n_tags as u64);
    }
}

#[test]
fn covariance_is_true_for_displaced_and_rotated_tags() {
    for n_tags in [2, 3, 6] {
        honest("displaced and rotated", n_tags, BOTH, 52 + n_tags as u64);
    }
}

/// With uncertain intrinsics too: both shares are in the covariance, and neither is taken for a tag out of place.
#[test]
fn covariance_is_true_with_uncertain_intrinsics() {
    const N: usize = 2000;
    let (mut rng, known) = (Rng::new(61), views::camera());
    let (f, c) = (4.0f64, 2.0f64);
    let covariance = DMatrix::from_diagonal(&DVector::from_vec(vec![f * f, f * f, c * c, c * c]));
    let config = Config { intrinsics_covariance: Some(covariance.as_slice()), ..Config::default() };
    let (mut n, mut sum, mut refused) = (0, 0.0, 0);
    for _ in 0..N {
        let by = [f, f, c, c].map(|sigma| sigma * rng.normal());
        let values: Vec<f64> = known.parameters().iter().zip(by).map(|((_, v), by)| v + by).collect();
        let took = known.with_parameters(&values).expect("a camera");
        let (target, truth) = scene(&mut rng, 3, BOTH);
        let real = drawn(&mut rng, &target, BOTH);
        let seen = detections(&mut rng, &took, &truth, &real);
        let found = locate_target(&seen, &target, &known, &config);
        refused += usize::from(!is_ok(&found));
        let e = found.estimate.expect("a pose");
        if let Ambiguity::Unique { .. } = e.ambiguity {
            (n, sum) = (n + 1, sum + nees(&e.cam_from_target, &truth, &e.covariance));
        }
    }
    println!("with intrinsics: {n} unique, NEES {:.3}, {refused} not ok", sum / n as f64);
    assert!((5.7..6.3).contains(&(sum / n as f64)), "NEES {}", sum / n as f64);
    assert!(refused <= N / 500, "{refused}");
}

/// χ² of the groups is rᵀ (1 + J S Jᵀ)⁻¹ r, summed densely, with derivatives taken by central differences.
#[test]
fn chi2_is_that_of_the_whole_covariance() {
    let (mut rng, camera) = (Rng::new(71), views::camera());
    let (target, truth) = scene(&mut rng, 2, BOTH);
    let real = drawn(&mut rng, &target, BOTH);
    let seen = detections(&mut rng, &camera, &truth, &real);
    let points: Vec<_> = correspond(&seen, &target, &camera).0.into_iter().map(|(_, c)| c).collect();
    let group = |k: usize| RigidGroup {
        first: 4 * k,
        n_points: 4,
        centre_in_target: tags_of(&target)[k].world_from_tag.translation,
        sigma_m: BOTH.sigma_m,
        sigma_rad: BOTH.sigma_rad,
    };
    let groups = [group(0), group(1)];
    let problem = Problem { groups: &groups, ..Problem::new(&points, &camera) };
    let m = refine_problem(&truth, &problem).expect("a minimum");
    let (mut chi2, mut information) = (0.0, resight_core::Matrix6::zeros());
    for (g, tag) in groups.iter().zip(tags_of(&target)) {
        let pixels = |tag: &MapTag, pose: &Pose| -> DVector<f64> {
            DVector::from_iterator(
                8,
                (0..4).flat_map(|k| {
                    let p = camera.project(&(pose * &corner(tag, k))).expect("in the field");
                    [p.x, p.y]
                }),
            )
        };
        let here = &m.cam_from_target;
        let own = &points[g.first..g.end()];
        let observed = DVector::from_iterator(8, own.iter().flat_map(|c| [c.pixel.x, c.pixel.y]));
        let r = (observed - pixels(tag, here)) / SIGMA_PX;
        let (mut j_tag, mut j_pose) = (DMatrix::zeros(8, 6), DMatrix::zeros(8, 6));
        for i in 0..6 {
            let h = 1e-6;
            let side = |s: f64| {
                let xi = Vector6::ith(i, s * h);
                let (turn, by) = (xi.fixed_rows::<3>(0).into_owned(), xi.fixed_rows::<3>(3).into_owned());
                (pixels(&moved(tag, &by, &turn), here), pixels(tag, &(Pose::exp(&xi) * *here)))
            };
            let ((tag_up, pose_up), (tag_down, pose_down)) = (side(1.0), side(-1.0));
            j_tag.set_column(i, &((tag_up - tag_down) / (2.0 * h * SIGMA_PX)));
            j_pose.set_column(i, &((pose_up - pose_down) / (2.0 * h * SIGMA_PX)));
        }
        let (w, t) = (BOTH.sigma_rad.powi(2), BOTH.sigma_m.powi(2));
        let s = DMatrix::from_diagonal(&DVector::from_vec(vec![w, w, w, t, t, t]));
        let inverse = (DMatrix::identity(8, 8) + &j_tag * s * j_tag.transpose()).try_inverse().unwrap();
        chi2 += r.dot(&(&inverse * &r));
        let share = j_pose.transpose() * inverse * j_pose;
        information += resight_core::Matrix6::from_fn(|i, k| share[(i, k)]);
    }
    assert!((m.chi2 / chi2 - 1.0).abs() < 1e-6, "{} {chi2}", m.chi2);
    let product = information * m.covariance;
    assert!((product - resight_core::Matrix6::identity()).amax() < 1e-4, "{product}");
}

/// A tag moved by 80–200 mm in any direction: with three tags and more it alone is left out, its distance is said, and the pose is that of
/// the others. Along the line of sight 80 mm are within what tolerance and noise allow once in ten thousand (a T of 32): where such a tag passes,
/// the pose is no worse off than by that.
#[test]
fn tag_out_of_place_is_left_out_and_named() {
    let (mut rng, camera) = (Rng::new(81), views::camera());
    for (n_tags, tolerance) in [(3, EXACT), (3, BOTH), (4, BOTH), (8, PLACE)] {
        const N: usize = 300;
        let (mut named, mut undecided, mut unnoticed, mut wrong) = (0, 0, 0, 0);
        let (mut sum, mut sum_unnoticed, mut off) = (0.0, 0.0, 0.0f64);
        for _ in 0..N {
            let (target, truth) = scene(&mut rng, n_tags, tolerance);
            let mut real = drawn(&mut rng, &target, tolerance);
            let by = rng.unit_vector() * rng.uniform(0.08, 0.2);
            real[1] = moved(&real[1], &by, &Vector3::zeros());
            let seen = detections(&mut rng, &camera, &truth, &real);
            let found = locate_target(&seen, &target, &camera, &Config::default());
            let e = found.estimate.as_ref().expect("a pose");
            let squared = nees(&e.cam_from_target, &truth, &e.covariance);
            let consistent = matches!(e.consistency, Consistency::Consistent);
            match found.left_out.as_slice() {
                [tag] if tag.id == 1 => {
                    (named, sum) = (named + 1, sum + squared);
                    assert!(consistent && found.features.iter().all(|f| f.id != 1));
                    let (distance, limit) = (tag.distance_m.unwrap(), tag.limit_m.unwrap());
                    assert!(limit <= distance, "{distance} {limit}");
                    off += (distance - by.norm()).abs();
                }
                [] if !consistent => undecided += 1,
                [] => (unnoticed, sum_unnoticed) = (unnoticed + 1, sum_unnoticed + squared),
                _ => wrong += 1,
            }
        }
        let (mean, off) = (sum / named as f64, 1e3 * off / named as f64);
        let mean_unnoticed = sum_unnoticed / unnoticed.max(1) as f64;
        println!(
            "{n_tags} tags, {tolerance:?}: named {named}, inconsistent {undecided}, another {wrong}, unnoticed {unnoticed} of {N}; NEES {mean:.2}, unnoticed {mean_unnoticed:.1}; distance off by {off:.1} mm"
        );
        assert!(N * 17 / 20 <= named, "named {named}");
        assert!(wrong <= N / 100, "another tag is blamed in {wrong}");
        assert!((5.0..7.0).contains(&mean), "NEES {mean}");
        assert!(mean_unnoticed < 32.0 + 6.0, "NEES where it is not noticed {mean_unnoticed}");
    }
}

/// A tag whose corners do not fit each other and another 150 mm off, across the line of sight: the one out of shape does not shield the one
/// out of place.
#[test]
fn tag_out_of_shape_does_not_shield_the_one_out_of_place() {
    let (mut rng, camera) = (Rng::new(97), views::camera());
    const N: usize = 200;
    let (mut named, mut shielded) = (0, 0);
    for _ in 0..N {
        let (target, truth) = scene(&mut rng, 6, BOTH);
        let mut real = drawn(&mut rng, &target, BOTH);
        let by = truth.rotation.transpose() * Vector3::new(0.15, 0.0, 0.0);
        real[1] = moved(&real[1], &by, &Vector3::zeros());
        let mut seen = detections(&mut rng, &camera, &truth, &real);
        // By turns to the left and to the right: hardly what a tilt does.
        for d in seen.iter_mut().filter(|d| d.feature.id == 0) {
            d.pixel.x += if d.feature.corner % 2 == 0 { 1.0 } else { -1.0 };
        }
        let found = locate_target(&seen, &target, &camera, &Config::default());
        let consistent =
            found.estimate.as_ref().is_ok_and(|e| matches!(e.consistency, Consistency::Consistent));
        named += usize::from(found.left_out.iter().any(|tag| tag.id == 1));
        shielded += usize::from(consistent && found.features.iter().any(|f| f.id == 1));
    }
    println!("named {named}, used in a good answer {shielded} of {N}");
    assert!(N * 19 / 20 <= named, "{named}");
    assert_eq!(shielded, 0);
}

/// Two tags of which one is out of place: nobody can say which, and both are named.
#[test]
fn two_tags_that_contradict_are_both_named() {
    let (mut rng, camera) = (Rng::new(91), views::camera());
    for tolerance in [EXACT, BOTH] {
        const N: usize = 300;
        let mut named = 0;
        for _ in 0..N {
            let (target, truth) = scene(&mut rng, 2, tolerance);
            let mut real = drawn(&mut rng, &target, tolerance);
            let by = truth.rotation.transpose() * Vector3::new(0.0, 0.2, 0.0);
            real[0] = moved(&real[0], &by, &Vector3::zeros());
            let seen = detections(&mut rng, &camera, &truth, &real);
            let found = locate_target(&seen, &target, &camera, &Config::default());
            assert!(found.left_out.is_empty(), "{:?}", found.left_out);
            let e = found.estimate.as_ref().expect("a pose");
            let is_said =
                found.contradicting == [0, 1] && matches!(e.consistency, Consistency::Inconsistent { .. });
            named += usize::from(is_said);
        }
        println!("two tags, {tolerance:?}: contradiction said in {named} of {N}");
        assert!(N * 9 / 10 <= named, "{named}");
    }
}

/// Labels of two tags exchanged among five: both are left out; the pose is that of the other three.
#[test]
fn swapped_tags_are_left_out() {
    let (mut rng, camera) = (Rng::new(101), views::camera());
    const N: usize = 200;
    let (mut named, mut lied) = (0, 0);
    for _ in 0..N {
        let (target, truth) = scene(&mut rng, 5, BOTH);
        let real = drawn(&mut rng, &target, BOTH);
        let mut seen = detections(&mut rng, &camera, &truth, &real);
        for detection in &mut seen {
            detection.feature.id = [3, 1, 2, 0, 4][detection.feature.id as usize];
        }
        let found = locate_target(&seen, &target, &camera, &Config::default());
        let ids: Vec<u32> = found.left_out.iter().map(|tag| tag.id).collect();
        let e = found.estimate.as_ref().expect("a pose");
        named += usize::from(ids == [0, 3]);
        lied += usize::from(
            matches!(e.consistency, Consistency::Consistent)
                && 30.0 < nees(&e.cam_from_target, &truth, &e.covariance),
        );
    }
    println!("swapped: named {named} of {N}, {lied} wrong and called consistent");
    assert!(N * 9 / 10 <= named, "{named}");
    assert_eq!(lied, 0);
}

/// An id that the map does not have takes no part and is reported; a map in millimetres contradicts itself as soon as two tags are seen.
#[test]
fn foreign_ids_and_units_are_reported() {
    let (mut rng, camera) = (Rng::new(111), views::camera());
    let (target, truth) = scene(&mut rng, 3, BOTH);
    let mut seen = detections(&mut rng, &camera, &truth, tags_of(&target));
    for detection in seen.iter_mut().take(4) {
        detection.feature.id = 99;
    }
    let found = locate_target(&seen, &target, &camera, &Config::default());
    assert_eq!(found.skipped.len(), 4);
    assert!(found.skipped.iter().all(|s| s.feature.id == 99 && s.reason.is_none()));
    assert!(is_ok(&found));

    let Target::TagMap(mut map) = target else { unreachable!() };
    for tag in &mut map.tags {
        tag.world_from_tag.translation *= 1000.0;
    }
    let found = locate_target(&seen, &Target::TagMap(map), &camera, &Config::default());
    assert!(!is_ok(&found), "{found:?}");
}

/// The same answer in every order of the detections, and that of `locate` where the map is exact.
#[test]
fn order_does_not_matter_and_exact_maps_are_as_before() {
    let (mut rng, camera) = (Rng::new(121), views::camera());
    for tolerance in [EXACT, BOTH] {
        let (target, truth) = scene(&mut rng, 4, tolerance);
        let real = drawn(&mut rng, &target, tolerance);
        let seen = detections(&mut rng, &camera, &truth, &real);
        let found = locate_target(&seen, &target, &camera, &Config::default());
        let mut turned = seen.clone();
        turned.reverse();
        turned.swap(3, 11);
        let again = locate_target(&turned, &target, &camera, &Config::default());
        assert_eq!(found.estimate, again.estimate);
        if tolerance.sigma_m == 0.0 {
            let points: Vec<_> = correspond(&seen, &target, &camera).0.into_iter().map(|(_, c)| c).collect();
            assert_eq!(found.estimate, locate(&points, &camera, &Config::default()));
        }
    }
}

/// Groups that cannot be are refused, not indexed with.
#[test]
fn groups_that_cannot_be_are_refused() {
    let (mut rng, camera) = (Rng::new(131), views::camera());
    let (target, truth) = scene(&mut rng, 1, EXACT);
    let seen = detections(&mut rng, &camera, &truth, tags_of(&target));
    let points: Vec<_> = correspond(&seen, &target, &camera).0.into_iter().map(|(_, c)| c).collect();
    let good =
        RigidGroup { first: 0, n_points: 4, centre_in_target: Point::zeros(), sigma_m: 0.01, sigma_rad: 0.0 };
    let refused = |groups: &[RigidGroup]| {
        let answer = locate(&points, &camera, &Config { groups, ..Config::default() });
        matches!(answer, Err(Error::InvalidSetting { setting: "groups", .. }))
    };
    assert!(!refused(&[good]));
    assert!(refused(&[RigidGroup { n_points: 5, ..good }]));
    assert!(refused(&[RigidGroup { n_points: usize::MAX, first: 1, ..good }]));
    assert!(refused(&[RigidGroup { n_points: 0, ..good }]));
    assert!(refused(&[good, good]));
    assert!(refused(&[RigidGroup { sigma_m: -1.0, ..good }]));
    assert!(refused(&[RigidGroup { sigma_rad: f64::NAN, ..good }]));
    assert!(refused(&[RigidGroup { centre_in_target: Point::new(f64::NAN, 0.0, 0.0), ..good }]));
}
