//! Rods, loads, objects and paths that nobody has: every entry point comes back in time, with an answer or an error, and never with a
//! number that is none.
//!
//! A few seconds by default; `RESIGHT_FUZZ_SECONDS=3600` draws for an hour, `RESIGHT_FUZZ_SEED` chooses other numbers. A failure names
//! its draw, which `RESIGHT_FUZZ_SEED` and the count reproduce.

use nalgebra::{Matrix3, Vector2};
use resight_core::statistics::SplitMix64;
use resight_whisker::contact::{
    Method, branch_with_derivatives, contact_in_hub, contact_with_derivatives, later_zeros,
};
use resight_whisker::estimate::{Mode, Status, estimate};
use resight_whisker::friction::{FrictionAngle, constrain};
use resight_whisker::identify::{Config, Touch, identify};
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::{Cell, HubLoad, PlanarPose, Rod, Sample, Shape, calibrate, files, simulate, sweep};
use std::time::{Duration, Instant};

/// SplitMix64: all 64 bits random, any seed good.
struct Draw(SplitMix64);

impl Draw {
    fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Any 64 bits.
    fn wild(&mut self) -> f64 {
        f64::from_bits(self.bits())
    }

    /// `usual` times something: mostly of its size, often decades off, now and then any bits.
    fn about(&mut self, usual: f64) -> f64 {
        match self.below(16) {
            0 => self.wild(),
            1 => [0.0, -0.0, f64::NAN, f64::INFINITY, -usual, f64::MIN_POSITIVE, f64::MAX, 1.0]
                [self.below(8) as usize],
            2..=4 => usual * 10f64.powf(16.0 * self.unit() - 8.0),
            5..=8 => usual * 10f64.powf(4.0 * self.unit() - 2.0),
            _ => usual * (0.5 + self.unit()),
        }
    }

    fn signed(&mut self, usual: f64) -> f64 {
        let value = self.about(usual);
        if self.below(2) == 0 { value } else { -value }
    }

    fn rod(&mut self) -> Rod {
        let length_m = self.about(0.2);
        let knots = |draw: &mut Self| {
            let n = 2 + draw.below(6) as usize;
            (0..n).map(|i| length_m * i as f64 / (n - 1) as f64).collect::<Vec<f64>>()
        };
        let stiffness = match self.below(4) {
            0 => Stiffness::Uniform { ei_n_m2: self.about(4e-3) },
            1 | 2 => Stiffness::Taper {
                ei_base_n_m2: self.about(4e-3),
                taper: if self.below(3) == 0 { self.signed(0.5) } else { 1.0 - self.about(0.1) },
            },
            _ => {
                let s_m = knots(self);
                let ei_n_m2 = s_m.iter().map(|_| self.about(4e-3)).collect();
                Stiffness::Profile { s_m, ei_n_m2 }
            }
        };
        let intrinsic_curvature = match self.below(4) {
            0 | 1 => IntrinsicCurvature::Constant { per_m: 0.0 },
            2 => IntrinsicCurvature::Constant { per_m: self.signed(2.0) },
            _ => {
                let s_m = knots(self);
                let per_m = s_m.iter().map(|_| self.signed(2.0)).collect();
                IntrinsicCurvature::Profile { s_m, per_m }
            }
        };
        let diameters_m = [(); 2].map(|()| if self.below(2) == 0 { 0.0 } else { self.about(8e-4) });
        Rod { length_m, stiffness, intrinsic_curvature, diameters_m }
    }

    fn load(&mut self) -> HubLoad {
        HubLoad { fx_n: self.signed(0.3), fy_n: self.signed(0.3), mz_n_m: self.signed(0.03) }
    }

    fn pose(&mut self) -> PlanarPose {
        PlanarPose { x_m: self.signed(0.1), y_m: self.signed(0.1), angle_rad: self.signed(1.5) }
    }

    fn cell(&mut self) -> Cell {
        Cell {
            force_sigma_n: self.about(3e-3),
            torque_sigma_n_m: self.about(1.5e-5),
            hub_angle_sigma_rad: self.about(1e-4),
            hub_xy_sigma_m: self.about(1e-5),
            ..Cell::default()
        }
    }

    fn samples(&mut self, n: u64) -> Vec<Sample> {
        let sample = |draw: &mut Self, i: u64| Sample {
            sweep: (i / 8) as u32,
            sample: i as u32,
            t_s: (draw.below(2) == 0).then(|| draw.signed(1.0)),
            world_from_hub: draw.pose(),
            load: draw.load(),
        };
        (0..n).map(|i| sample(self, i)).collect()
    }

    fn shape(&mut self) -> Shape {
        let centre_m = Vector2::new(self.signed(0.05), self.signed(0.15));
        match self.below(4) {
            0 => Shape::Circle { centre_m, radius_m: self.about(0.02) },
            1 => Shape::Ellipse {
                centre_m,
                semi_axes_m: [self.about(0.02), self.about(0.02)],
                angle_rad: self.signed(1.0),
            },
            2 => Shape::Rectangle {
                centre_m,
                sides_m: [self.about(0.04), self.about(0.04)],
                angle_rad: self.signed(1.0),
            },
            _ => {
                let n = self.below(6);
                Shape::Polygon {
                    corners_m: (0..n).map(|_| Vector2::new(self.signed(0.05), self.signed(0.05))).collect(),
                }
            }
        }
    }

    fn touches(&mut self, n: u64) -> Vec<Touch> {
        let touch = |draw: &mut Self| {
            let diagonal = nalgebra::Vector3::new(draw.about(1e-7), draw.about(1e-7), draw.about(1e-4));
            Touch {
                sweep: draw.below(3) as u32,
                x_in_world: Vector2::new(draw.signed(0.05), draw.signed(0.15)),
                theta_rad: draw.signed(1.0),
                side: if draw.below(2) == 0 { 1.0 } else { -1.0 },
                mode: if draw.below(4) == 0 { Mode::Tip } else { Mode::Mid },
                covariance: Matrix3::from_diagonal(&diagonal),
                status: Status::Ok,
            }
        };
        (0..n).map(|_| touch(self)).collect()
    }
}

fn setting(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

/// Calls `one` with fresh draws until its share of the time is over; each call within the deadline.
fn many(what: &str, deadline: Duration, mut one: impl FnMut(&mut Draw)) {
    // Twelve entry points share the time.
    let seconds = setting("RESIGHT_FUZZ_SECONDS", 6) as f64 / 12.0;
    let seed = setting("RESIGHT_FUZZ_SEED", 15);
    let (began, mut count, mut slowest) = (Instant::now(), 0u64, Duration::ZERO);
    while began.elapsed().as_secs_f64() < seconds || count < 20 {
        let state = seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ count << 8;
        let call = Instant::now();
        let finished =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| one(&mut Draw(SplitMix64::new(state)))));
        let took = call.elapsed();
        assert!(finished.is_ok(), "{what}: draw {count} of seed {seed} panics");
        assert!(took < deadline, "{what}: draw {count} of seed {seed} takes {took:?}");
        slowest = slowest.max(took);
        count += 1;
    }
    println!("{what}: {count} draws, the slowest {slowest:?}, seed {seed}");
}

/// On a loaded machine a millisecond may take some.
const QUICK: Duration = Duration::from_secs(2);
const LONG: Duration = Duration::from_secs(30);

#[test]
fn contacts_of_any_rod_and_load() {
    many("contact_in_hub", QUICK, |draw| {
        let (rod, load) = (draw.rod(), draw.load());
        if rod.check().is_err() {
            return;
        }
        for method in [Method::Auto, Method::Integrate] {
            if let Ok(at) = contact_in_hub(&rod, &load, method) {
                assert!(at.is_finite(), "{rod:?} {load:?} {at:?}");
            }
        }
    });
    many("contact_with_derivatives", QUICK, |draw| {
        let (rod, load) = (draw.rod(), draw.load());
        if rod.check().is_err() {
            return;
        }
        for method in [Method::Auto, Method::Integrate] {
            let Ok((at, by_load)) = contact_with_derivatives(&rod, &load, method) else { continue };
            assert!(at.is_finite(), "{rod:?} {load:?} {at:?}");
            assert!(!by_load.iter().any(|v| v.is_nan()), "{rod:?} {load:?} {by_load}");
            for later in later_zeros(&rod, &load, &at, method) {
                assert!(later.is_finite(), "{rod:?} {load:?} {later:?}");
            }
        }
    });
    many("branch_with_derivatives", QUICK, |draw| {
        let (rod, load) = (draw.rod(), draw.load());
        let branch = if draw.below(8) == 0 { draw.bits() as usize } else { draw.below(6) as usize };
        if rod.check().is_ok() {
            for method in [Method::Auto, Method::Integrate] {
                let _ = branch_with_derivatives(&rod, &load, method, branch);
            }
        }
    });
}

/// A rod that `check` was never asked about comes back too.
#[test]
fn contacts_of_unchecked_rods_end() {
    many("contact of unchecked rods", QUICK, |draw| {
        let (rod, load) = (draw.rod(), draw.load());
        let empty = |s_m: &[f64], values: &[f64]| s_m.is_empty() || values.is_empty();
        if matches!(&rod.stiffness, Stiffness::Profile { s_m, ei_n_m2 } if empty(s_m, ei_n_m2)) {
            return;
        }
        let _ = contact_in_hub(&rod, &load, Method::Auto);
        let _ = contact_with_derivatives(&rod, &load, Method::Integrate);
    });
}

#[test]
fn samples_of_any_rod_cell_and_load() {
    let sound = |status: Status, contact: &Option<resight_whisker::estimate::Contact>, what: &str| {
        let Some(contact) = contact.as_ref().filter(|_| status == Status::Ok) else { return };
        assert!(
            contact.s_m.is_finite() && contact.x_in_world.iter().all(|v| v.is_finite()),
            "{what} {contact:?}"
        );
        let variances = contact.covariance.diagonal();
        assert!(variances.iter().all(|v| 0.0 <= *v && v.is_finite()), "{what}: ok with {contact:?}");
    };
    many("estimate", QUICK, |draw| {
        let (rod, cell, samples) = (draw.rod(), draw.cell(), draw.samples(1));
        if rod.check().is_err() {
            return;
        }
        let found = estimate(&rod, &cell, &samples[0], Method::Auto);
        sound(found.status, &found.contact, &format!("{rod:?} {cell:?} {samples:?}"));
    });
    many("constrain", QUICK, |draw| {
        let (rod, cell, samples) = (draw.rod(), draw.cell(), draw.samples(1));
        let friction = FrictionAngle { rad: draw.signed(0.2), sigma_rad: draw.about(0.05) };
        let mode = [Mode::Free, Mode::Mid, Mode::Tip][draw.below(3) as usize];
        if rod.check().is_err() {
            return;
        }
        if let Ok(found) = constrain(&rod, &cell, &samples[0], mode, friction, Method::Auto) {
            sound(
                found.status,
                &found.contact,
                &format!("{rod:?} {cell:?} {samples:?} {mode:?} {friction:?}"),
            );
        }
    });
}

#[test]
fn records_of_any_rod_object_and_path() {
    many("simulate::record", LONG, |draw| {
        let (rod, shape, mu) = (draw.rod(), draw.shape(), draw.about(0.2));
        let path = [draw.pose(), draw.pose(), draw.pose()];
        if let Ok(record) = simulate::record(&rod, &shape, mu, 0, &path) {
            let loads = record.samples.iter().map(|simulated| simulated.sample.load);
            loads.for_each(|load| assert!(load.is_finite(), "{rod:?} {shape:?} {mu} {path:?} {load:?}"));
        }
    });
    many("simulate::sweep", LONG, |draw| {
        let (rod, shape, mu) = (draw.rod(), draw.shape(), draw.about(0.2));
        let motion = simulate::Motion::Between { from: draw.pose(), to: draw.pose() };
        let count = |draw: &mut Draw| match draw.below(8) {
            0 => draw.bits() as u32,
            _ => draw.below(20) as u32,
        };
        let spacing =
            simulate::Spacing { before: count(draw), after_touch: count(draw), after_slip_off: count(draw) };
        let _ = simulate::sweep(&rod, &shape, mu, 0, &motion, &spacing);
    });
}

#[test]
fn sweeps_objects_and_calibrations_of_anything() {
    many("sweep::smooth", LONG, |draw| {
        let n = draw.below(12);
        let (rod, cell, samples) = (draw.rod(), draw.cell(), draw.samples(n));
        let _ = sweep::smooth(&rod, &cell, &samples, &sweep::Options::default());
    });
    many("identify", LONG, |draw| {
        let n = draw.below(24);
        let _ = identify(&draw.touches(n), &Config::default());
    });
    many("calibrate", LONG, |draw| {
        let n = draw.below(16);
        let (rod, cell, samples) = (draw.rod(), draw.cell(), draw.samples(n));
        let options = calibrate::Options::of_a_new_rig(&cell);
        let _ = calibrate::calibrate(&rod, &cell, &samples, &calibrate::Object::Unknown, &options);
    });
}

/// A steel whisker whose diameter was given in another unit.
#[test]
fn a_slipped_decimal_is_named() {
    let text = |base: &str| {
        format!(
            r#"{{"whisker": {{"length_m": 0.25, "youngs_modulus_Pa": 2.0e11, "diameter_base_m": {base},
                "diameter_tip_m": 0.001}}}}"#
        )
    };
    assert!(files::whisker::read(&text("0.001")).is_ok());
    let refused = files::whisker::read(&text("0.2219")).expect_err("no whisker");
    assert!(refused.contains("0.2219") && refused.contains("0.25") && refused.contains("units"), "{refused}");
}

/// Its tip is a ten-thousandth as stiff as its clamp: the moment has billions of zeros.
#[test]
fn a_rod_that_coils_up_has_few_zeros_looked_at() {
    let rod = Rod {
        length_m: 0.25,
        stiffness: Stiffness::Taper { ei_base_n_m2: 1e-9, taper: 0.5 },
        intrinsic_curvature: IntrinsicCurvature::Constant { per_m: 0.0 },
        diameters_m: [0.0; 2],
    };
    let load = HubLoad { fx_n: -1e9, fy_n: 1e9, mz_n_m: 1e-3 };
    let zeros = resight_whisker::contact::integrate::zeros(&rod, &load, 5);
    assert!(zeros.len() <= 5, "{}", zeros.len());
}
