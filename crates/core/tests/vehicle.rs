//! A camera on a vehicle: accurate, with standard deviations that hold, and what a drive does not determine is named.

use crate::common::Rng;
use crate::common::drives::{Body, Drive, Mounting, Stretch, drive, motions, street};
use nalgebra::{Vector2, Vector3};
use resight_core::budget::ErrorSource;
use resight_core::multiview::two_view::{BearingPair, TwoViewConfig, refine_two_view, two_view};
use resight_core::temporal::vehicle::{
    Contradiction, FrameMotion, LensVariation, Undetermined, VehicleAlarm, VehicleAlarmConfig, VehicleConfig,
    VehicleEstimate, ground_plane, vehicle, vehicle_alarm,
};
use resight_core::{Bearing, Pose};

/// Pairs of frames a quarter of a second apart.
const FRAME_S: f64 = 0.25;
const SIGMA_RAD: f64 = 0.5 / 900.0;

/// A minute with two curves to each side.
const MINUTE: [Stretch; 9] = [
    (10.0, 14.0, 0.0),
    (5.0, 8.0, 0.3),
    (10.0, 14.0, 0.0),
    (5.0, 8.0, -0.3),
    (10.0, 14.0, 0.0),
    (4.0, 8.0, -0.35),
    (7.0, 14.0, 0.0),
    (4.0, 8.0, 0.35),
    (10.0, 14.0, 0.0),
];

fn some_mounting(rng: &mut Rng) -> Mounting {
    Mounting::new(rng.uniform(-8.0, 8.0), rng.uniform(-6.0, 6.0), rng.uniform(-5.0, 5.0))
}

fn measured(rng: &mut Rng, drive: &Drive) -> Vec<FrameMotion> {
    motions(rng, drive, 0.002, 0.0002)
}

fn solved(motions: &[FrameMotion]) -> VehicleEstimate {
    vehicle(motions, &[], &VehicleConfig::default()).expect("motions")
}

/// 120 draws with correlated pitch: mean errors of yaw and pitch below 0.05°, NEES of each number within 0.8 to 1.25 of what it should be, no verdict
/// against a right answer; roll from the curves alone.
#[test]
fn vehicle_standard_deviations_hold() {
    let mut rng = Rng::new(0x7e1);
    let (runs, mut off, mut nees, mut rolls, mut sigmas, mut wrong) =
        (120, Vector2::zeros(), 0.0, 0.0, Vector3::zeros(), 0);
    for _ in 0..runs {
        let mounting = some_mounting(&mut rng);
        let drive = drive(&mut rng, &MINUTE, FRAME_S, &Body::USUAL, |_| mounting);
        let found = solved(&measured(&mut rng, &drive));
        let travel = found.travel.expect("yaw and pitch");
        let roll = found.roll.expect("roll");
        let error = Vector2::new(travel.yaw_rad - mounting.yaw_rad, travel.pitch_rad - mounting.pitch_rad);
        off += error.abs() / f64::from(runs);
        nees +=
            error.dot(&travel.covariance.cholesky().expect("a covariance").solve(&error)) / f64::from(runs);
        rolls += ((roll.roll_rad - mounting.roll_rad) / roll.sigma_rad).powi(2) / f64::from(runs);
        let sigma = travel.covariance.diagonal().map(f64::sqrt);
        sigmas += Vector3::new(sigma.x, sigma.y, roll.sigma_rad) / f64::from(runs);
        wrong += usize::from(!found.contradictions.is_empty());
    }
    let [off, sigmas] = [Vector3::new(off.x, off.y, 0.0), sigmas].map(|v| v.map(f64::to_degrees));
    println!(
        "errors {off:.4?} °, stated {sigmas:.4?} °, NEES {nees:.2} (2), roll {rolls:.2} (1), contradicted {wrong}"
    );
    assert!(off.x < 0.05 && off.y < 0.05, "{off}");
    assert!((1.6..2.5).contains(&nees), "{nees}");
    assert!((0.5..1.3).contains(&rolls), "{rolls}");
    assert_eq!(wrong, 0);
}

/// Points of a street, three in ten of them on traffic that moves by itself, half a pixel of noise: a minute's yaw and pitch to 0.05°, roll by the
/// ground, height by the speed.
#[test]
fn vehicle_from_points_of_a_street() {
    let mut rng = Rng::new(0x7e2);
    let mounting = Mounting::new(3.0, -2.0, 1.5);
    let drive = drive(&mut rng, &MINUTE, FRAME_S, &Body::USUAL, |_| mounting);
    let points = street(&mut rng, &drive, 60_000);
    let mut motions = Vec::new();
    let mut refused = 0;
    for i in 0..drive.t_s.len() - 1 {
        let (first, second) = (drive.world_from_cam[i].inverse(), drive.world_from_cam[i + 1].inverse());
        let mut pairs = seen(&mut rng, &points, &first, &second);
        let n = pairs.len();
        for pair in &mut pairs[..n * 3 / 10] {
            let off = Vector3::new(rng.uniform(-0.03, 0.03), rng.uniform(-0.01, 0.01), 0.0);
            pair.second = Bearing::new_normalize(pair.second.into_inner() + off);
        }
        let t_s = 0.5 * (drive.t_s[i] + drive.t_s[i + 1]);
        match two_view(&pairs, None, &TwoViewConfig::default()) {
            Ok(view) if !view.is_ambiguous() => {
                let mut motion = FrameMotion::new(t_s, drive.t_s[i + 1] - drive.t_s[i], &view);
                motion.speed_m_s = Some(drive.speed_m_s[i + 1]);
                motion.ground = ground_plane(&pairs, &view, true);
                motions.push(motion);
            }
            _ => refused += 1,
        }
    }
    let grounds = motions.iter().filter(|motion| motion.ground.is_some()).count();
    let found = solved(&motions);
    let (travel, roll, height) =
        (found.travel.expect("travel"), found.roll.expect("roll"), found.height.expect("height"));
    let truth_m = 0.3 + height_of(&mounting);
    println!(
        "{} pairs, {refused} refused, {grounds} with ground; yaw {:.3} pitch {:.3} roll {:.3} ± {:.3} (curves {:?}) height {:.3} ± {:.3}, {truth_m:.3}",
        motions.len(),
        travel.yaw_rad.to_degrees(),
        travel.pitch_rad.to_degrees(),
        roll.roll_rad.to_degrees(),
        roll.sigma_rad.to_degrees(),
        roll.by_curves.map(|s| (s.roll_rad.to_degrees(), s.sigma_rad.to_degrees())),
        height.height_m,
        height.sigma_m
    );
    assert!((travel.yaw_rad - mounting.yaw_rad).abs().to_degrees() < 0.05, "{travel:?}");
    assert!((travel.pitch_rad - mounting.pitch_rad).abs().to_degrees() < 0.08, "{travel:?}");
    assert!(
        refused < 12 && 100 < grounds && found.contradictions.is_empty(),
        "{refused} {grounds} {:?}",
        found.contradictions
    );
    assert!(
        (roll.roll_rad - mounting.roll_rad).abs() < 2.5 * roll.sigma_rad && roll.by_ground.is_some(),
        "{roll:?}"
    );
    assert!((height.height_m - truth_m).abs() < 2.5 * height.sigma_m && height.sigma_m < 0.05, "{height:?}");
    let rotation = resight_core::temporal::vehicle::VehicleEstimate {
        travel: Ok(travel),
        roll: Ok(roll),
        ..solved(&motions)
    };
    let off =
        rotation.cam_from_vehicle_rotation().expect("a rotation") * mounting.cam_from_vehicle().transpose();
    assert!((off - nalgebra::Matrix3::identity()).norm() < 0.02, "{off}");
}

fn height_of(mounting: &Mounting) -> f64 {
    mounting.lever_m[2]
}

/// Up to 150 points in the field of 45° to each side, from 2 to 60 m.
fn seen(rng: &mut Rng, points: &[nalgebra::Vector3<f64>], first: &Pose, second: &Pose) -> Vec<BearingPair> {
    let mut pairs = Vec::new();
    let begin = rng.index(points.len());
    for k in 0..points.len() {
        let x = points[(begin + k) % points.len()];
        let (a, b) = (*first * x, *second * x);
        let inside = |x: &Vector3<f64>| 2.0 < x.z && x.z < 60.0 && x.x.abs() < x.z && x.y.abs() < 0.7 * x.z;
        if inside(&a) && inside(&b) {
            let mut noisy = |x: Vector3<f64>| {
                let off = Vector3::new(rng.normal(), rng.normal(), rng.normal()) * SIGMA_RAD;
                Bearing::new_normalize(x.normalize() + off)
            };
            let (first, second) = (noisy(a), noisy(b));
            pairs.push(BearingPair {
                first,
                second,
                sigma_first_rad: SIGMA_RAD,
                sigma_second_rad: SIGMA_RAD,
            });
        }
        if pairs.len() == 150 {
            break;
        }
    }
    pairs
}

/// fx = fy, cx and cy of a pinhole camera, px.
type Lens = [f64; 3];

/// The pair of the same pixels through another lens.
fn through(pair: &BearingPair, from: &Lens, to: &Lens) -> BearingPair {
    let [first, second] = [pair.first, pair.second].map(|bearing| {
        let x = bearing.into_inner() / bearing.z;
        let at = |i: usize| (from[0] * x[i] + from[i + 1] - to[i + 1]) / to[0];
        Bearing::new_normalize(Vector3::new(at(0), at(1), 1.0))
    });
    BearingPair { first, second, ..*pair }
}

/// Yaw and pitch of the direction of a pixel.
fn yaw_pitch(pixel: [f64; 2], lens: &Lens) -> Vector2<f64> {
    let (x, y) = ((pixel[0] - lens[1]) / lens[0], (pixel[1] - lens[2]) / lens[0]);
    Vector2::new(x.atan(), -(y / x.hypot(1.0)).atan())
}

/// Twenty seconds straight ahead, 4 px of the principal point and 2 % of the focal length uncertain: the direction of travel keeps its pixel, whatever the
/// lens is, which eq. (17) says, and the drive through a lens between moves by what its columns say.
#[test]
fn vehicle_intrinsics_move_the_direction_of_travel_at_its_pixel() {
    let mut rng = Rng::new(0x7e7);
    let mounting = Mounting::new(6.0, -4.0, 0.0);
    let drive = drive(&mut rng, &[(20.0, 14.0, 0.0)], FRAME_S, &Body::USUAL, |_| mounting);
    let points = street(&mut rng, &drive, 20_000);
    let stated: Lens = [500.0, 320.0, 240.0];
    let columns = [[0.0, 4.0, 0.0], [10.0, 0.0, 0.0]];
    let moved = |column: &Lens, by: f64| [0, 1, 2].map(|i| stated[i] + by * column[i]);
    let between = [0, 1, 2].map(|i| stated[i] + 0.5 * columns[0][i] - 0.5 * columns[1][i]);
    let lenses = [
        moved(&columns[0], 1.0),
        moved(&columns[0], -1.0),
        moved(&columns[1], 1.0),
        moved(&columns[1], -1.0),
        between,
    ];
    let (mut own, mut others) = (Vec::new(), vec![Vec::new(); lenses.len()]);
    for i in 0..drive.t_s.len() - 1 {
        let (first, second) = (drive.world_from_cam[i].inverse(), drive.world_from_cam[i + 1].inverse());
        let pairs = seen(&mut rng, &points, &first, &second);
        let times = (0.5 * (drive.t_s[i] + drive.t_s[i + 1]), drive.t_s[i + 1] - drive.t_s[i]);
        let Ok(view) = two_view(&pairs, None, &TwoViewConfig::default()) else { continue };
        own.push(FrameMotion::new(times.0, times.1, &view));
        for (lens, motions) in lenses.iter().zip(&mut others) {
            let pairs: Vec<BearingPair> = pairs.iter().map(|pair| through(pair, &stated, lens)).collect();
            let view = refine_two_view(&pairs, &view.second_from_first, &TwoViewConfig::default());
            motions.push(FrameMotion::new(times.0, times.1, &view.expect("a pose nearby")));
        }
    }
    let between = solved(&others.pop().expect("five lenses")).travel.expect("a direction");
    let mut sides = others.into_iter();
    let mut variation =
        || LensVariation { plus: sides.next().expect("a side"), minus: sides.next().expect("a side") };
    let variations = [variation(), variation()];
    let exact = solved(&own).travel.expect("a direction");
    let found =
        vehicle(&own, &variations, &VehicleConfig::default()).expect("motions").travel.expect("a direction");
    let part =
        found.budget.parts().iter().find(|part| part.source == ErrorSource::Lens).expect("a part").covariance;
    assert!((found.covariance - exact.covariance - part).norm() < 1e-12, "{}", found.covariance);

    let d = found.in_cam;
    let pixel = [0, 1].map(|i| stated[0] * d[i] / d.z + stated[i + 1]);
    let by = columns.map(|column| {
        0.5 * (yaw_pitch(pixel, &moved(&column, 1.0)) - yaw_pitch(pixel, &moved(&column, -1.0)))
    });
    let expected: nalgebra::Matrix2<f64> = by.iter().map(|c| c * c.transpose()).sum();
    println!(
        "lens {:.4?}°, eq. (17) {:.4?}°",
        part.diagonal().map(|v| v.sqrt().to_degrees()),
        expected.diagonal().map(|v| v.sqrt().to_degrees())
    );
    assert!((part - expected).norm() < 0.1 * expected.norm(), "{part} {expected}");
    let shift = Vector2::new(between.yaw_rad - found.yaw_rad, between.pitch_rad - found.pitch_rad);
    assert!((shift - 0.5 * (by[0] - by[1])).norm() < 0.1 * shift.norm(), "{shift} {by:?}");
}

/// Speeds of another drive.
#[test]
fn vehicle_speeds_that_contradict_the_frames_are_named() {
    let mut rng = Rng::new(0x7e8);
    let mounting = Mounting::new(2.0, 1.0, 0.0);
    let drive = drive(&mut rng, &[(20.0, 14.0, 0.0), (20.0, 0.0, 0.0)], FRAME_S, &Body::USUAL, |_| mounting);
    let mut motions = measured(&mut rng, &drive);
    let n = motions.len();
    motions.iter_mut().enumerate().for_each(|(i, m)| m.speed_m_s = Some(if i < n / 2 { 0.0 } else { 14.0 }));
    let found = solved(&motions);
    assert!(matches!(found.contradictions[..], [Contradiction::Speeds { .. }]), "{found:?}");
    motions.iter_mut().enumerate().for_each(|(i, m)| m.speed_m_s = Some(if i < n / 2 { 14.0 } else { 0.0 }));
    assert!(solved(&motions).contradictions.is_empty());
}

#[test]
fn vehicle_names_what_is_not_determined() {
    let mut rng = Rng::new(0x7e3);
    let mounting = Mounting::new(2.0, 1.0, -1.0);
    let mut of = |stretches: &[Stretch]| {
        let drive = drive(&mut rng, stretches, FRAME_S, &Body::USUAL, |_| mounting);
        (solved(&measured(&mut rng, &drive)), drive)
    };
    let (standing, _) = of(&[(60.0, 0.0, 0.0)]);
    assert!(matches!(standing.travel, Err(Undetermined::Standing { .. })), "{standing:?}");
    assert!(matches!(standing.roll, Err(Undetermined::NoDirection)), "{standing:?}");
    let (curves, _) = of(&[(60.0, 8.0, 0.2)]);
    assert!(matches!(curves.travel, Err(Undetermined::TooLittleStraight { .. })), "{curves:?}");
    let (straight, _) = of(&[(60.0, 14.0, 0.0)]);
    assert!(straight.travel.is_ok(), "{straight:?}");
    assert!(
        matches!(straight.roll, Err(Undetermined::NoCurve { .. } | Undetermined::Uncertain { .. })),
        "{straight:?}"
    );
    assert!(matches!(straight.height, Err(Undetermined::NoGround)), "{straight:?}");
    assert_eq!(straight.cam_from_vehicle_rotation(), None);
    let (short, _) = of(&[(55.0, 0.0, 0.0), (5.0, 14.0, 0.0)]);
    assert!(matches!(short.travel, Err(Undetermined::Standing { .. })), "{short:?}");
    // Forth and back without a speed: which way is forward is not known.
    let back: Vec<Stretch> = vec![(30.0, 8.0, 0.0), (30.0, -8.0, 0.0)];
    let (both, drive) = of(&back);
    assert!(matches!(both.travel, Err(Undetermined::ForwardSign { .. })), "{both:?}");
    let mut signed = measured(&mut rng, &drive);
    signed.iter_mut().zip(&drive.speed_m_s[1..]).for_each(|(motion, speed)| motion.speed_m_s = Some(*speed));
    let travel = solved(&signed).travel.expect("the sign of the speed tells");
    assert!((travel.yaw_rad - mounting.yaw_rad).abs() < 4.0 * travel.covariance[(0, 0)].sqrt(), "{travel:?}");
}

/// Curves to one side only: the lean of the body is in the roll, and its standard deviation says so. 60 draws.
#[test]
fn vehicle_roll_of_curves_to_one_side_is_stated_widely() {
    let mut rng = Rng::new(0x7e4);
    let left: Vec<Stretch> = (0..4).flat_map(|_| [(12.0, 14.0, 0.0), (5.0, 8.0, 0.3)]).collect();
    let (mut nees, mut sigma) = (0.0, 0.0);
    for _ in 0..60 {
        let mounting = some_mounting(&mut rng);
        let body = Body { lean_rad: 0.013 * rng.normal(), ..Body::USUAL };
        let drive = drive(&mut rng, &left, FRAME_S, &body, |_| mounting);
        let roll = solved(&measured(&mut rng, &drive)).roll.expect("roll");
        assert!(roll.by_curves.expect("curves").one_sided);
        nees += ((roll.roll_rad - mounting.roll_rad) / roll.sigma_rad).powi(2) / 60.0;
        sigma += roll.sigma_rad.to_degrees() / 60.0;
    }
    println!("roll of one-sided curves: NEES {nees:.2} (1), ± {sigma:.2}°");
    assert!((0.3..1.3).contains(&nees) && (1.5..3.0).contains(&sigma), "{nees} {sigma}");
}

/// A mounting that rotates by 0.5° amid a straight drive.
#[test]
fn vehicle_a_mounting_that_rotates_is_an_alarm_within_ten_seconds() {
    let mut rng = Rng::new(0x7e5);
    let (mut delays, mut missed, mut contradicted) = (Vec::new(), 0, 0);
    for draw in 0..20 {
        let before = some_mounting(&mut rng);
        let angle = 0.5f64.to_radians();
        let after = match draw % 2 {
            0 => Mounting { yaw_rad: before.yaw_rad + angle, ..before },
            _ => Mounting { pitch_rad: before.pitch_rad - angle, ..before },
        };
        let drive = drive(&mut rng, &[(90.0, 14.0, 0.0)], FRAME_S, &Body::USUAL, |t_s| {
            if t_s < 60.0 { before } else { after }
        });
        let motions = measured(&mut rng, &drive);
        let found = solved(&motions);
        let travel = found.travel.expect("a direction");
        contradicted +=
            usize::from(found.contradictions.iter().any(|c| matches!(c, Contradiction::Halves(_))));
        match vehicle_alarm(&motions, &travel, &VehicleAlarmConfig::default()).expect("readings") {
            VehicleAlarm::Moved { drift, alarm_s } => {
                delays.push(alarm_s - 60.0);
                assert!((drift.began_s - 60.0).abs() < 5.0, "{drift:?}");
                let rotation = drift.old_from_new.fixed_rows::<2>(0).norm().to_degrees();
                assert!((rotation - 0.5).abs() < 0.25, "{drift:?}");
            }
            other => {
                missed += 1;
                println!("{draw}: {other:?}");
            }
        }
    }
    println!("alarms after {delays:.1?} s, {missed} missed, {contradicted} with halves that disagree");
    assert_eq!(missed, 0);
    let soon = delays.iter().filter(|delay| **delay < 10.0).count();
    assert!(19 <= soon && delays.iter().all(|delay| (0.0..15.0).contains(delay)), "{delays:?}");
}

/// Three hours of driving straight in pieces of six minutes, and nothing moves: no alarm.
#[test]
fn vehicle_hours_without_a_false_alarm() {
    let mut rng = Rng::new(0x7e6);
    let mut alarms = 0;
    for _ in 0..30 {
        let mounting = some_mounting(&mut rng);
        let drive = drive(&mut rng, &[(360.0, 14.0, 0.0)], FRAME_S, &Body::USUAL, |_| mounting);
        let motions = measured(&mut rng, &drive);
        let found = solved(&motions);
        let travel = found.travel.expect("a direction");
        let alarm = vehicle_alarm(&motions, &travel, &VehicleAlarmConfig::default()).expect("readings");
        alarms += usize::from(!matches!(alarm, VehicleAlarm::Steady { .. }));
        assert!(found.contradictions.is_empty(), "{:?}", found.contradictions);
    }
    assert_eq!(alarms, 0);
}
