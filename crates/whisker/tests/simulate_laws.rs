//! The forward model against mechanics: what any quasi-static whisker obeys, whoever computes it.

use nalgebra::Vector2;
use resight_whisker::contact::{Method, contact_in_hub};
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::simulate::{
    Change, Motion, Simulated, Spacing, Touching, TruthContact, add_noise, centre_line, record,
    standard_sweeps, sweep,
};
use resight_whisker::{Cell, Error, PlanarPose, Rod, Sample, Shape};
use std::f64::consts::{FRAC_PI_2, TAU};

/// 1 mm of steel, 0.25 m long.
fn wire() -> Rod {
    Rod::uniform(0.25, 9.817e-3).expect("a rod")
}

fn hub(x_m: f64, y_m: f64, angle_rad: f64) -> PlanarPose {
    PlanarPose { x_m, y_m, angle_rad }
}

/// Numbers in 0 … 1 from a literal seed.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Convex objects of every kind, as large as they fit between the standard sweeps.
fn objects(count: usize) -> Vec<Shape> {
    let mut chance = Numbers(7);
    let mut one = |kind: usize| {
        let mut u = || chance.next();
        let angle_rad = u() * FRAC_PI_2;
        let centre_m = Vector2::new((u() - 0.5) * 0.01, 0.165 + (u() - 0.5) * 0.01);
        match kind % 5 {
            0 => Shape::Circle { centre_m, radius_m: 0.01 + 0.04 * u() },
            1 => Shape::Ellipse { centre_m, semi_axes_m: [0.05, 0.015 + 0.03 * u()], angle_rad },
            2 => Shape::square(centre_m, 0.03 + 0.04 * u(), angle_rad),
            3 => Shape::Rectangle { centre_m, sides_m: [0.07, 0.02 + 0.04 * u()], angle_rad },
            _ => {
                let count = 3 + (u() * 4.0) as usize;
                let turn = |i: usize, u: f64| angle_rad + TAU * (i as f64 + 0.3 * u) / count as f64;
                let corner = |a: f64| centre_m + Vector2::new(a.cos(), a.sin()) * 0.035;
                Shape::Polygon { corners_m: (0..count).map(|i| corner(turn(i, u()))).collect() }
            }
        }
    };
    (0..count).map(&mut one).collect()
}

/// All samples of all standard sweeps over an object.
fn swept(rod: &Rod, object: &Shape, mu: f64) -> Vec<Simulated> {
    let motions = standard_sweeps();
    let sweeps = motions.iter().enumerate();
    sweeps
        .flat_map(|(i, motion)| {
            let found = sweep(rod, object, mu, i as u32, motion, &Spacing::default());
            found.unwrap_or_else(|error| panic!("{object:?} {i}: {error}")).samples
        })
        .collect()
}

/// The load alone leads back to the contact, by elliptic integrals from the hub outwards: 1e-10 of the length, as loads of weak
/// contacts carry the place along the whisker to rounding over their share of EI/L² (1e-4).
#[test]
fn readings_lead_back_to_the_contact() {
    let rod = wire();
    let (mut worst, mut contacts) = (0.0_f64, 0);
    for (i, object) in objects(40).iter().enumerate() {
        for row in swept(&rod, object, [0.0, 0.3][i % 2]) {
            let Some(truth) = row.truth.filter(|truth| 1e-4 < truth.force_in_world_n.norm()) else {
                continue;
            };
            let at = contact_in_hub(&rod, &row.sample.load, Method::Auto).expect("a contact");
            let x = row.sample.world_from_hub.apply(at.x_in_hub);
            worst = worst.max((x - truth.x_in_world).norm() / rod.length_m);
            worst = worst.max((at.friction_angle_rad - truth.friction_angle_rad).abs());
            contacts += 1;
        }
    }
    println!("{contacts} contacts, worst {worst:.1e}");
    assert!(9000 < contacts, "{contacts}");
    assert!(worst < 1e-10, "{worst:e}");
}

/// Slope of x, y, θ along the arc length under a load at the hub, in its frame.
fn slope(rod: &Rod, sample: &Sample, s: f64, [x, y, theta]: [f64; 3]) -> [f64; 3] {
    let load = sample.load;
    let moment = load.mz_n_m - (x * load.fy_n - y * load.fx_n);
    let width = match &rod.stiffness {
        Stiffness::Taper { taper, .. } => 1.0 - taper * s / rod.length_m,
        _ => 1.0,
    };
    let own = match &rod.intrinsic_curvature {
        IntrinsicCurvature::Constant { per_m } => *per_m,
        IntrinsicCurvature::Profile { s_m, per_m } => {
            per_m[0] + (per_m[1] - per_m[0]) * (s - s_m[0]) / (s_m[1] - s_m[0])
        }
    };
    [theta.cos(), theta.sin(), own + moment / (rod.ei_base_n_m2() * width.powi(4))]
}

/// From the hub to the arc length of the contact by the classical Runge–Kutta method, 2000 steps: place, direction, moment left.
fn integrated(rod: &Rod, sample: &Sample, s_m: f64) -> ([f64; 3], f64) {
    let (count, mut at) = (2000, [0.0; 3]);
    let h = s_m / f64::from(count);
    let shifted = |a: [f64; 3], b: [f64; 3], h: f64| [0, 1, 2].map(|i| a[i] + h * b[i]);
    for i in 0..count {
        let s = f64::from(i) * h;
        let k1 = slope(rod, sample, s, at);
        let k2 = slope(rod, sample, s + 0.5 * h, shifted(at, k1, 0.5 * h));
        let k3 = slope(rod, sample, s + 0.5 * h, shifted(at, k2, 0.5 * h));
        let k4 = slope(rod, sample, s + h, shifted(at, k3, h));
        at = [0, 1, 2].map(|j| at[j] + h / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]));
    }
    let load = sample.load;
    (at, load.mz_n_m - (at[0] * load.fy_n - at[1] * load.fx_n))
}

/// Whiskers without a closed form: a taper, bent both ways, bent more and more.
fn unusual_rods() -> Vec<Rod> {
    let taper = Stiffness::Taper { ei_base_n_m2: 0.02, taper: 0.6 };
    let constant = |per_m| IntrinsicCurvature::Constant { per_m };
    let profile = IntrinsicCurvature::Profile { s_m: vec![0.0, 0.25], per_m: vec![0.0, 2.0] };
    [(0, constant(0.0)), (1, constant(1.5)), (1, constant(-1.5)), (0, constant(1.0)), (1, profile)]
        .into_iter()
        .map(|(kind, intrinsic_curvature)| {
            let stiffness = if kind == 0 { taper.clone() } else { wire().stiffness };
            Rod { stiffness, intrinsic_curvature, ..wire() }
        })
        .collect()
}

/// Every kind of rod, by an integration from the other end: the moment vanishes at the contact, which lies where it is said to
/// lie, in the direction that is said. 1e-9: 2000 steps of fourth order reach 1e-11, and the taper is three times as stiff.
#[test]
fn every_rod_ends_where_it_touches() {
    let circle = Shape::Circle { centre_m: Vector2::new(0.0, 0.15), radius_m: 0.02 };
    let (mut contacts, mut tips) = ([0, 0, 0, 0, 0], 0);
    for (kind, rod) in unusual_rods().iter().enumerate() {
        for (number, motion) in standard_sweeps().iter().enumerate() {
            let found = match sweep(rod, &circle, 0.1, number as u32, motion, &Spacing::default()) {
                Ok(found) => found,
                // A whisker that curls around the object needs two contacts.
                Err(Error::NoRest { .. }) if kind != 0 => continue,
                Err(error) => panic!("{kind} {number}: {error}"),
            };
            for row in &found.samples {
                let Some(truth) = row.truth else { continue };
                let (at, moment) = integrated(rod, &row.sample, truth.s_m);
                let pose = row.sample.world_from_hub;
                let off = (pose.apply(Vector2::new(at[0], at[1])) - truth.x_in_world).norm() / rod.length_m;
                let turn = (pose.angle_rad + at[2] - truth.theta_rad).sin().abs();
                let left = moment.abs() * rod.length_m / rod.ei_base_n_m2();
                assert!(
                    off < 1e-9 && turn < 1e-9 && left < 1e-9,
                    "{kind} {number}: {off:e} {turn:e} {left:e}"
                );
                contacts[kind] += 1;
                tips += u32::from(truth.touching.is_tip());
            }
        }
    }
    println!("{contacts:?} contacts, {tips} of tips");
    assert!(contacts.iter().all(|&count| 100 < count), "{contacts:?}");
    assert!(10 < tips, "{tips}");
}

/// No drawn whisker cuts the object by more than the sagitta of its chords, 48 to the contact: κ h²/8 with κ L below 8.
#[test]
fn no_whisker_cuts_the_object() {
    let rod = wire();
    let sagitta = 8.0 / (8.0 * 48.0 * 48.0) * rod.length_m;
    for (i, object) in objects(20).iter().enumerate() {
        for row in swept(&rod, object, [0.0, 0.3][i % 2]) {
            let line = centre_line(&rod, &row);
            let cut = line.windows(2).any(|pair| object.is_cut_by(pair[0], pair[1], 0.02 * sagitta));
            assert!(!cut, "{object:?} {row:?}");
            let start = Vector2::new(row.sample.world_from_hub.x_m, row.sample.world_from_hub.y_m);
            assert!((line[0] - start).norm() < 1e-6, "{:?} {start:?}", line[0]);
        }
    }
}

/// Sliding friction pulls against the slip, at its limit; none is felt without it; the tip obeys the outline's normal.
#[test]
fn friction_is_at_its_limit_and_against_the_slip() {
    let rod = wire();
    for mu in [0.0, 0.2, 0.5] {
        for object in objects(15) {
            let rows = swept(&rod, &object, mu);
            for pair in rows.windows(2) {
                let (Some(before), Some(after)) = (pair[0].truth, pair[1].truth) else { continue };
                if before.touching != after.touching || after.touching.is_tip() || after.sticks {
                    continue;
                }
                assert!((after.friction_angle_rad.abs() - mu.atan()).abs() < 1e-12, "{after:?}");
                let tangent = Vector2::new(after.theta_rad.cos(), after.theta_rad.sin());
                let slip = (after.x_in_world - before.x_in_world).dot(&tangent) - (after.s_m - before.s_m);
                // Second order in the step, where a slide has just begun.
                assert!(slip * after.friction_angle_rad < 1e-5, "{slip:e} {after:?}");
            }
        }
    }
}

/// What the hub does on a whisker over a path, by the trapezoidal rule, joules.
fn work_j(rows: &[Simulated]) -> f64 {
    let power = |row: &Simulated, by: [f64; 3]| {
        let force = row.sample.world_from_hub.rotate(row.sample.load.force_n());
        -(force.x * by[0] + force.y * by[1] + row.sample.load.mz_n_m * by[2])
    };
    rows.windows(2)
        .map(|pair| {
            let [a, b] = [pair[0].sample.world_from_hub, pair[1].sample.world_from_hub];
            let by = [b.x_m - a.x_m, b.y_m - a.y_m, b.angle_rad - a.angle_rad];
            0.5 * (power(&pair[0], by) + power(&pair[1], by))
        })
        .sum()
}

/// Bending energy ∫ M²/2EI of a uniform whisker from its load, by Simpson's rule along the integrated line, joules.
fn energy_j(rod: &Rod, row: &Simulated) -> f64 {
    let Some(truth) = row.truth else { return 0.0 };
    let count = 40;
    let moment2 = |i: usize| {
        let s = truth.s_m * i as f64 / count as f64;
        let (_, moment) =
            if i == 0 { ([0.0; 3], row.sample.load.mz_n_m) } else { integrated(rod, &row.sample, s) };
        moment * moment
    };
    let weight = |i: usize| if i == 0 || i == count { 1.0 } else { 2.0 + 2.0 * (i % 2) as f64 };
    let sum: f64 = (0..=count).map(|i| weight(i) * moment2(i)).sum();
    sum * truth.s_m / (3.0 * count as f64) / (2.0 * rod.ei_base_n_m2())
}

/// What slips against friction over a path, joules: the force along a mid-whisker contact times the slip, by the trapezoidal rule.
fn dissipated_j(rows: &[Simulated]) -> f64 {
    rows.windows(2)
        .map(|pair| {
            let (Some(a), Some(b)) = (pair[0].truth, pair[1].truth) else { return 0.0 };
            let middle = 0.5 * (a.theta_rad + b.theta_rad);
            let tangent = Vector2::new(middle.cos(), middle.sin());
            let slip = (b.x_in_world - a.x_in_world).dot(&tangent) - (b.s_m - a.s_m);
            let pull = |t: &TruthContact| t.force_in_world_n.norm() * t.friction_angle_rad.sin();
            -0.5 * (pull(&a) + pull(&b)) * slip
        })
        .sum()
}

fn there(count: usize) -> Vec<PlanarPose> {
    (0..=count).map(|i| hub(-0.07 + 0.15 * i as f64 / count as f64, 0.0, FRAC_PI_2)).collect()
}

fn there_and_back(count: usize) -> Vec<PlanarPose> {
    let there = there(count);
    there.iter().chain(there.iter().rev().skip(1)).copied().collect()
}

/// Virtual work: without friction the hub's work is all in the whisker, over face, corner and curve; a wrong force, moment or
/// place by 1 % would show as 1 %. The trapezoidal rule over 2000 steps errs by 1e-6 of it.
#[test]
fn without_friction_the_work_is_stored() {
    let rod = wire();
    for object in [
        Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.025 },
        Shape::square(Vector2::new(0.0, 0.165), 0.05, 0.4),
    ] {
        let rows = record(&rod, &object, 0.0, 0, &there(2000)).expect("a record").samples;
        let (work, energy) = (work_j(&rows), energy_j(&rod, &rows[2000]));
        println!("work {work:.6e} J, stored {energy:.6e} J");
        assert!(1e-3 < energy && (work - energy).abs() < 1e-5 * energy, "{work} {energy}");
    }
}

/// Back along the same path: without friction the same rows, and in the end a free whisker.
#[test]
fn without_friction_the_way_back_is_the_way_there() {
    let square = Shape::square(Vector2::new(0.0, 0.165), 0.05, 0.4);
    let rows = record(&wire(), &square, 0.0, 0, &there_and_back(150)).expect("a record").samples;
    for i in 0..=150 {
        let (there, back) = (&rows[i], &rows[300 - i]);
        assert_eq!(there.truth.map(|t| t.touching), back.truth.map(|t| t.touching), "row {i}");
        let off = (there.sample.load.to_vector() - back.sample.load.to_vector()).norm();
        assert!(off < 1e-9, "row {i}: {off:e}");
    }
}

/// With friction the whisker first sticks on the way back: its friction falls from the limit to the opposite limit while the same
/// point of it stays on the corner; then it slides; the path takes the work that slips against friction.
#[test]
fn with_friction_the_whisker_sticks_before_it_slides_back() {
    let square = Shape::square(Vector2::new(0.0, 0.165), 0.06, 0.0);
    let (mu, count) = (0.3_f64, 3000);
    let found = record(&wire(), &square, mu, 0, &there_and_back(count)).expect("a record");
    let rows = &found.samples;
    let stuck: Vec<_> = rows.iter().filter_map(|row| row.truth.filter(|t| t.sticks)).collect();
    assert!(5 < stuck.len(), "{}", stuck.len());
    for pair in stuck.windows(2) {
        assert!((pair[1].s_m - pair[0].s_m).abs() < 1e-12, "{pair:?}");
        assert!(pair[1].friction_angle_rad < pair[0].friction_angle_rad, "{pair:?}");
    }
    let back = rows[count + 1 + stuck.len()..].iter().filter_map(|row| row.truth);
    let sliding: Vec<_> = back.filter(|truth| !truth.sticks).collect();
    assert!(50 < sliding.len(), "{}", sliding.len());
    assert!(sliding.iter().all(|t| (t.friction_angle_rad + mu.atan()).abs() < 1e-9), "{:?}", sliding[0]);
    assert!(rows.last().is_some_and(|row| row.truth.is_none()), "still in contact");
    assert!(found.events.iter().any(|e| e.change == Change::Slide), "{:?}", found.events);
    let without =
        work_j(&record(&wire(), &square, 0.0, 0, &there_and_back(count)).expect("a record").samples);
    let work = work_j(rows);
    let lost = dissipated_j(rows);
    println!("work of a closed path: {work:.6e} J with friction, {lost:.6e} J slip; {without:.3e} J without");
    // The trapezoidal rule across the few steps in which a slide begins.
    assert!((work - lost).abs() < 1e-4 * work, "{work} {lost}");
    assert!(1e-3 < work && without.abs() < 1e-7, "{work} {without}");
}

/// The same where the path's poses fall on the place where the force vanishes, and slip loses its direction in rounding.
#[test]
fn a_whisker_lifts_off_at_a_pose_of_the_path() {
    let circle = Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.025 };
    let there = |i: usize| hub(-0.04 + 0.12 * i as f64 / 600.0, 0.0, FRAC_PI_2);
    let path: Vec<_> = (0..=600).map(there).chain((0..600).rev().map(there)).collect();
    let found = record(&wire(), &circle, 0.3, 0, &path).expect("a record");
    assert_eq!(found.events.last().map(|event| event.change), Some(Change::LiftOff));
}

/// A smooth outline is rolled along while the whisker sticks: as much of the whisker as of the outline.
#[test]
fn a_sticking_whisker_rolls_on_a_circle() {
    let circle = Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.025 };
    let rows = record(&wire(), &circle, 0.3, 0, &there_and_back(3000)).expect("a record").samples;
    let stuck: Vec<_> = rows.iter().filter_map(|row| row.truth.filter(|t| t.sticks)).collect();
    assert!(5 < stuck.len(), "{}", stuck.len());
    for pair in stuck.windows(2) {
        // Object on the right: the normal's direction is θ + 90°, and the outline runs against the whisker.
        let outline = 0.025 * (pair[1].theta_rad - pair[0].theta_rad);
        assert!((pair[1].s_m - pair[0].s_m + outline).abs() < 1e-12, "{pair:?}");
    }
}

/// The state does not depend on how finely the path was given.
#[test]
fn finer_paths_give_the_same_rows() {
    for (object, mu) in objects(10).iter().zip([0.0, 0.3].iter().cycle()) {
        let rows = |count| record(&wire(), object, *mu, 0, &there(count));
        let (Ok(coarse), Ok(fine)) = (rows(30), rows(390)) else { panic!("{object:?}") };
        for (i, row) in coarse.samples.iter().enumerate() {
            let same = &fine.samples[13 * i];
            let off = (row.sample.load.to_vector() - same.sample.load.to_vector()).norm();
            assert!(off < 1e-9, "{object:?} row {i}: {off:e}");
        }
    }
}

/// A sweep begins free up to the touch itself, then touches at once, on time.
#[test]
fn a_sweep_starts_at_its_touch() {
    for object in objects(25) {
        for (number, motion) in standard_sweeps().iter().enumerate() {
            let found =
                sweep(&wire(), &object, 0.0, number as u32, motion, &Spacing::default()).expect("a sweep");
            assert!(found.samples[..=20].iter().all(|row| row.truth.is_none()), "{object:?} {number}");
            assert!(found.samples[21].truth.is_some(), "{object:?} {number}");
            let touch = found.events[0];
            assert!(matches!(touch.change, Change::Touch { .. }), "{touch:?}");
            let at = found.samples[20].sample.t_s.expect("a time");
            assert!((touch.pose - at).abs() < 1e-6, "{} {at}", touch.pose);
        }
    }
}

/// The tip first: an object that only the tip reaches, from the side.
#[test]
fn the_tip_alone_can_touch() {
    let circle = Shape::Circle { centre_m: Vector2::new(0.0, 0.255), radius_m: 0.02 };
    let found = record(&wire(), &circle, 0.0, 0, &there(100)).expect("a record");
    let first = found.samples.iter().find_map(|row| row.truth).expect("a contact");
    assert_eq!(first.touching, Touching::Tip);
    assert!((first.s_m - 0.25).abs() < 1e-15);
    let out = (first.x_in_world - Vector2::new(0.0, 0.255)).normalize();
    let along = first.force_in_world_n.normalize();
    assert!((out - along).norm() < 1e-12, "{out:?} {along:?}");
}

/// Nothing in reach: a record without contact.
#[test]
fn an_object_out_of_reach_is_never_touched() {
    let circle = Shape::Circle { centre_m: Vector2::new(0.0, 0.4), radius_m: 0.05 };
    for (number, motion) in standard_sweeps().iter().enumerate() {
        let found =
            sweep(&wire(), &circle, 0.0, number as u32, motion, &Spacing::default()).expect("a sweep");
        assert!(found.samples.iter().all(|row| row.truth.is_none()) && found.events.is_empty());
        assert_eq!(found.samples.len(), 121);
    }
}

/// A thin peg between two poses is not passed unseen.
#[test]
fn a_thin_peg_is_met_between_two_poses() {
    let peg = Shape::Circle { centre_m: Vector2::new(0.0, 0.15), radius_m: 2e-4 };
    let path = [hub(-0.02, 0.0, FRAC_PI_2), hub(0.02, 0.0, FRAC_PI_2)];
    let found = record(&wire(), &peg, 0.0, 0, &path).expect("a record");
    assert_eq!(found.samples[1].truth.map(|t| t.touching), Some(Touching::Tangent));
}

/// What makes no sense is refused by name.
#[test]
fn nonsense_is_refused_by_name() {
    let circle = Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.025 };
    let free = hub(-0.1, 0.0, FRAC_PI_2);
    let error = |object: &Shape, mu: f64, path: &[PlanarPose]| {
        record(&wire(), object, mu, 0, path).expect_err("an error")
    };
    assert!(matches!(error(&circle, -0.1, &[free]), Error::Negative { .. }));
    assert!(matches!(error(&circle, f64::NAN, &[free]), Error::NotFinite { .. }));
    assert!(matches!(error(&circle, 0.0, &[hub(f64::NAN, 0.0, 0.0)]), Error::NotFinite { .. }));
    assert!(matches!(error(&circle, 0.0, &[hub(0.0, 0.0, FRAC_PI_2)]), Error::StartsInside));
    assert!(matches!(error(&circle, 0.0, &[free, hub(0.0, 0.16, 0.0)]), Error::HubInside { pose: 1 }));
    let flat = Shape::Circle { centre_m: Vector2::zeros(), radius_m: 0.0 };
    assert!(matches!(error(&flat, 0.0, &[free]), Error::NotPositive { .. }));
    assert_eq!(record(&wire(), &circle, 0.0, 0, &[]).expect("nothing").samples.len(), 0);
    for error in [Error::StartsInside, Error::HubInside { pose: 3 }, Error::NoRest { pose: 4 }] {
        assert!(error.to_string().contains("path"), "{error}");
    }
}

fn nano17() -> Cell {
    Cell {
        force_sigma_n: 1.0 / 320.0,
        torque_sigma_n_m: 1.0 / 64_000.0,
        hub_xy_sigma_m: 1e-5,
        force_step_n: 1.0 / 320.0,
        torque_step_n_m: 1.0 / 64_000.0,
        hub_angle_step_rad: TAU / 16384.0,
        ..Cell::default()
    }
}

/// Mean and variance of 20 000 disturbed readings: σ² + step²/12 within 4 standard deviations (of a variance, √(2/n)).
#[test]
fn noise_is_as_the_cell_says() {
    let count = 20_000;
    let still = vec![Sample { world_from_hub: hub(0.1, 0.2, 1.0), ..Sample::default() }; count];
    let noisy = add_noise(&still, &nano17(), 5);
    let check = |values: Vec<f64>, mean: f64, variance: f64| {
        let n = count as f64;
        let seen = values.iter().sum::<f64>() / n;
        let spread = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n;
        assert!((seen - mean).abs() < 4.0 * (variance / n).sqrt(), "{seen} {mean}");
        assert!((spread / variance - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{spread} {variance}");
    };
    let load = nano17().load_covariance();
    check(noisy.iter().map(|s| s.load.fx_n).collect(), 0.0, load[(0, 0)]);
    check(noisy.iter().map(|s| s.load.mz_n_m).collect(), 0.0, load[(2, 2)]);
    check(noisy.iter().map(|s| s.world_from_hub.x_m).collect(), 0.1, 1e-10);
    for sample in &noisy {
        let steps = sample.load.fy_n * 320.0;
        assert!((steps - steps.round()).abs() < 1e-9, "{steps}");
        assert!((sample.world_from_hub.angle_rad - 1.0).abs() < TAU / 16384.0);
    }
    let pairs = noisy.windows(2).map(|w| w[0].load.mz_n_m * w[1].load.mz_n_m).sum::<f64>() / count as f64;
    assert!(pairs.abs() < 4.0 * load[(2, 2)] / (count as f64).sqrt(), "{pairs}");
}

/// The same seed, the same noise; another seed, other noise.
#[test]
fn noise_is_seeded() {
    let still = vec![Sample::default(); 50];
    assert_eq!(add_noise(&still, &nano17(), 9), add_noise(&still, &nano17(), 9));
    assert_ne!(add_noise(&still, &nano17(), 9), add_noise(&still, &nano17(), 10));
}

/// A bend of the motion between two samples is not cut short: into the object's reach and back within one step.
#[test]
fn a_bend_between_samples_is_followed() {
    let circle = Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.025 };
    let poses = vec![hub(-0.05, 0.0, FRAC_PI_2), hub(0.0, 0.0, FRAC_PI_2), hub(-0.05, 0.0, FRAC_PI_2)];
    let spacing = Spacing { before: 1, after_touch: 1, after_slip_off: 0 };
    let found = sweep(&wire(), &circle, 0.0, 0, &Motion::Through { poses }, &spacing).expect("a sweep");
    assert_eq!(found.samples.len(), 2);
    let changes: Vec<_> = found.events.iter().map(|event| event.change).collect();
    assert!(matches!(changes[..], [Change::Touch { .. }, Change::LiftOff]), "{changes:?}");
    assert!((found.events[0].pose - 0.25).abs() < 1e-6 && (found.events[1].pose - 0.75).abs() < 1e-6);
    let nowhere = sweep(&wire(), &circle, 0.0, 0, &Motion::Through { poses: vec![] }, &Spacing::default());
    assert!(matches!(nowhere, Err(Error::TooFew { .. })));
}

/// Motions: ends, and what lies between.
#[test]
fn motions_pass_through_their_poses() {
    let motion = Motion::Through { poses: vec![hub(0.0, 0.0, 0.0), hub(1.0, 0.0, 1.0), hub(1.0, 1.0, 1.0)] };
    assert_eq!(motion.at(0.5), hub(1.0, 0.0, 1.0));
    assert_eq!(motion.at(0.25), hub(0.5, 0.0, 0.5));
    assert_eq!(motion.at(1.0), hub(1.0, 1.0, 1.0));
    let turn = Motion::rotate([0.1, 0.2], 1.0, 3.0);
    assert_eq!(turn.at(0.5), hub(0.1, 0.2, 2.0));
}
