//! Contacts in space against an independent Kirchhoff rod: integrated in three dimensions with torsion, from the contact back to the hub.

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3, Vector6};
use resight_core::statistics::SplitMix64;
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::spatial::{self, FALSE_ALARM, SpatialLoad, Verdict};
use resight_whisker::{Cell, Rod};

const LENGTH_M: f64 = 0.25;
const EI_N_M2: f64 = 0.0098;
/// GJ = EI/(1 + ν) of a round wire, ν = 0.3.
const TORSION: f64 = EI_N_M2 / 1.3;

fn rod(stiffness: Stiffness, per_m: f64) -> Rod {
    let intrinsic_curvature = IntrinsicCurvature::Constant { per_m };
    Rod { length_m: LENGTH_M, stiffness, intrinsic_curvature, diameters_m: [0.0, 0.0] }
}

fn straight() -> Rod {
    rod(Stiffness::Uniform { ei_n_m2: EI_N_M2 }, 0.0)
}

/// A load cell of 1/320 N and 1/64 N·mm.
fn noise() -> Matrix6<f64> {
    spatial::load_covariance(&Cell {
        force_sigma_n: 1.0 / 320.0,
        torque_sigma_n_m: 1.0 / 64e3,
        ..Cell::default()
    })
}

/// A force at a point of a whisker (curved about the hub's z axis), in axes of the whisker there.
struct Touch {
    rod: Rod,
    s_m: f64,
    force_n: Vector3<f64>,
    /// Moment at the contact: friction at the surface.
    moment_n_m: Vector3<f64>,
}

/// The frame of the cross-section, the place, the moment.
#[derive(Clone, Copy)]
struct Section {
    frame: Matrix3<f64>,
    x: Vector3<f64>,
    moment: Vector3<f64>,
}

impl Touch {
    /// r′ = t · t = R e₁ · R′ = R [ω]ₓ, ω = (M·t/GJ, M·d₂/EI, M·d₃/EI + κ₀) · M′ = −t × f
    fn slope(&self, at: &Section, s_m: f64) -> Section {
        let stiffness = self.rod.ei_n_m2_at(s_m);
        let own = at.frame.transpose() * at.moment;
        let curvature = self.rod.curvature_per_m_at(s_m);
        let torsion = TORSION * stiffness / EI_N_M2;
        let turn = Vector3::new(own.x / torsion, own.y / stiffness, own.z / stiffness + curvature);
        let tangent = at.frame.column(0).into_owned();
        Section { frame: at.frame * turn.cross_matrix(), x: tangent, moment: -tangent.cross(&self.force_n) }
    }

    /// Contact and load in the hub frame: RK4 in 1000 steps back from the contact, 1e-12 of the length.
    fn at_hub(&self) -> (Vector3<f64>, SpatialLoad) {
        let steps = 1000;
        let h = -self.s_m / f64::from(steps);
        let moved = |at: &Section, by: &Section, h: f64| Section {
            frame: at.frame + by.frame * h,
            x: at.x + by.x * h,
            moment: at.moment + by.moment * h,
        };
        let mut at = Section { frame: Matrix3::identity(), x: Vector3::zeros(), moment: self.moment_n_m };
        for i in 0..steps {
            let s = self.s_m + h * f64::from(i);
            let a = self.slope(&at, s);
            let b = self.slope(&moved(&at, &a, 0.5 * h), s + 0.5 * h);
            let c = self.slope(&moved(&at, &b, 0.5 * h), s + 0.5 * h);
            let d = self.slope(&moved(&at, &c, h), s + h);
            for (slope, weight) in [(a, 1.0), (b, 2.0), (c, 2.0), (d, 1.0)] {
                at = moved(&at, &slope, weight * h / 6.0);
            }
        }
        let back = at.frame.transpose();
        (back * -at.x, SpatialLoad { force_n: back * self.force_n, moment_n_m: back * at.moment })
    }
}

/// Uniform numbers of [0, 1) and normal ones, from a literal seed.
struct Chance(SplitMix64);

impl Chance {
    fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    fn noisy(&mut self, load: &SpatialLoad, covariance: &Matrix6<f64>) -> SpatialLoad {
        let factor = covariance.cholesky().expect("a covariance").l();
        let seen = load.to_vector() + factor * Vector6::from_fn(|_, _| self.normal());
        let [force_n, moment_n_m] = [0, 3].map(|i| Vector3::new(seen[i], seen[i + 1], seen[i + 2]));
        SpatialLoad { force_n, moment_n_m }
    }
}

/// A touch on a straight whisker in any direction, friction along and across included.
fn touch(chance: &mut Chance, rod: Rod, size_n: f64) -> Touch {
    let around = std::f64::consts::TAU * chance.uniform();
    let (sin, cos) = around.sin_cos();
    let along = 0.3 * (chance.uniform() - 0.3);
    Touch {
        rod,
        s_m: LENGTH_M * (0.4 + 0.5 * chance.uniform()),
        force_n: Vector3::new(along, cos, sin) * size_n,
        moment_n_m: Vector3::zeros(),
    }
}

/// Whatever the direction of the force, friction included: one plane, no torsion, the planar contact.
#[test]
fn one_force_bends_a_straight_round_whisker_in_one_plane() {
    let mut chance = Chance(SplitMix64::new(1));
    let taper = Stiffness::Taper { ei_base_n_m2: EI_N_M2, taper: 0.5 };
    for i in 0..60 {
        let rod = if i % 2 == 0 { straight() } else { rod(taper.clone(), 0.0) };
        let size = if i % 2 == 0 { 0.6 } else { 0.2 };
        let truth = touch(&mut chance, rod.clone(), size * (0.1 + chance_share(i)));
        let (x, load) = truth.at_hub();
        let got = spatial::estimate(&rod, &load, &noise()).expect("numbers");
        assert_eq!(got.verdict, Verdict::Planar);
        let contact = got.contact.expect("a contact");
        assert!((contact.x_in_hub - x).norm() < 1e-10 * LENGTH_M, "{:e}", (contact.x_in_hub - x).norm());
        assert!((contact.in_plane.s_m - truth.s_m).abs() < 1e-10 * LENGTH_M);
        // The torsion M·t vanishes with the moment about the clamp axis.
        assert!(load.moment_n_m.x.abs() < 1e-12 && got.reduction.expect("a plane").chi2 < 1e-6);
    }
}

fn chance_share(i: i32) -> f64 {
    f64::from(i % 10) / 10.0
}

/// NEES of 3 degrees of freedom and the rate of false alarms over 20000 noisy readings.
#[test]
fn covariance_and_false_alarms_are_as_stated() {
    let mut chance = Chance(SplitMix64::new(2));
    // Unequal and correlated noise: nothing of the estimate relies on equal axes.
    let turn = Rotation3::from_euler_angles(0.3, -0.5, 0.8);
    let mut covariance = noise();
    let force = covariance.fixed_view::<3, 3>(0, 0) * Matrix3::from_diagonal(&Vector3::new(2.0, 1.0, 0.5));
    covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&(turn * force * turn.transpose()));
    let (mut nees, mut count, mut alarms) = (0.0, 0.0, 0.0);
    for _ in 0..200 {
        let size = 0.25 + 0.5 * chance.uniform();
        let truth = touch(&mut chance, straight(), size);
        let (x, load) = truth.at_hub();
        for _ in 0..100 {
            let seen = chance.noisy(&load, &covariance);
            let got = spatial::estimate(&straight(), &seen, &covariance).expect("numbers");
            count += 1.0;
            if got.reduction.expect("a plane").p_value < 0.01 {
                alarms += 1.0;
            }
            let contact = got.contact.expect("a contact");
            let off = contact.x_in_hub - x;
            nees += off.dot(&(contact.covariance.cholesky().expect("a covariance").inverse() * off));
        }
    }
    // The mean of 20000 χ² of 3 degrees of freedom has a deviation of √(6/20000) = 0.017; curvature of the problem adds to it.
    assert!((nees / count - 3.0).abs() < 0.12, "NEES {}", nees / count);
    // 200 alarms expected, deviation 14.
    assert!((alarms - 0.01 * count).abs() < 5.0 * 14.0, "{alarms} alarms of {count}");
}

/// A plane that is none is found: a second contact across the first, torsion by friction at the surface, a curved whisker taken
/// for a straight one.
#[test]
fn wrong_reductions_are_found() {
    let mut chance = Chance(SplitMix64::new(3));
    let share_found = |chance: &mut Chance, load: &SpatialLoad| {
        let found = (0..500).filter(|_| {
            let seen = chance.noisy(load, &noise());
            spatial::estimate(&straight(), &seen, &noise()).expect("numbers").verdict == Verdict::OutOfPlane
        });
        found.count() as f64 / 500.0
    };
    let one = |force_n, moment_n_m, per_m| {
        let rod = rod(Stiffness::Uniform { ei_n_m2: EI_N_M2 }, per_m);
        Touch { rod, s_m: 0.15, force_n, moment_n_m }.at_hub().1
    };
    let none = Vector3::zeros();
    let sound = one(Vector3::new(0.0, 0.4, 0.1), none, 0.0);
    assert!(share_found(&mut chance, &sound) < 10.0 * FALSE_ALARM);
    // A second force of 0.05 N out of the plane, 8 cm from the clamp.
    let second = Vector3::new(0.0, 0.0, 0.05);
    let moment_n_m = sound.moment_n_m + Vector3::new(0.08, 0.01, 0.0).cross(&second);
    let several = SpatialLoad { force_n: sound.force_n + second, moment_n_m };
    assert!(share_found(&mut chance, &several) > 0.95);
    // 0.12 N of friction across, at the surface of a wire of 1.2 mm: 72 µN·m of torsion, 4.6 deviations.
    let torsion = one(Vector3::new(0.0, 0.4, 0.12), Vector3::new(72e-6, 0.0, 0.0), 0.0);
    assert!(share_found(&mut chance, &torsion) > 0.7);
    // A whisker with a bend of 2/m (7 mm of sag), touched across it.
    let curved = one(Vector3::new(0.0, 0.05, 0.4), none, 2.0);
    assert!(share_found(&mut chance, &curved) > 0.95);
    let reported = rod(Stiffness::Uniform { ei_n_m2: EI_N_M2 }, 2.0);
    let verdict = spatial::estimate(&reported, &curved, &noise()).expect("numbers").verdict;
    assert_eq!(verdict, Verdict::CurvedWhisker);
}

#[test]
fn weak_and_broken_signals_are_named() {
    let of = |force: [f64; 3], moment: [f64; 3]| {
        let load = SpatialLoad { force_n: force.into(), moment_n_m: moment.into() };
        spatial::estimate(&straight(), &load, &noise())
    };
    assert_eq!(of([0.0; 3], [0.0; 3]).expect("numbers").verdict, Verdict::TooWeak);
    assert_eq!(of([0.0, 0.003, 0.001], [0.0, 1e-5, 2e-5]).expect("numbers").verdict, Verdict::TooWeak);
    assert!(matches!(
        of([0.1, 0.0, 0.01], [0.0, 0.0, 0.3]).expect("numbers").verdict,
        Verdict::NoContact(_) | Verdict::OutOfPlane
    ));
    assert!(of([f64::NAN, 0.1, 0.0], [0.0; 3]).is_err());
    let load = SpatialLoad::default();
    assert!(spatial::estimate(&straight(), &load, &Matrix6::zeros()).is_err());
}
