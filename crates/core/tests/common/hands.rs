//! Made-up hands: a camera or a target on an arm, what is measured of it, and the information in that.

use super::{Rng, views};
use nalgebra::{Matrix6, SMatrix, Vector3, Vector6};
use resight_core::Pose;
use resight_core::multiview::hand_eye::{Candidate, HandEye, HandEyeConfig, HandEyeView, Mounting};

pub type Vector12 = SMatrix<f64, 12, 1>;
pub type Matrix12 = SMatrix<f64, 12, 12>;

/// X, Z and robot poses, all exact.
#[derive(Clone)]
pub struct World {
    pub mounting: Mounting,
    pub cam_from_carrier: Pose,
    pub holder_from_target: Pose,
    pub base_from_gripper: Vec<Pose>,
}

impl World {
    pub fn carrier_from_holder(&self, base_from_gripper: &Pose) -> Pose {
        match self.mounting {
            Mounting::CameraOnGripper => base_from_gripper.inverse(),
            Mounting::TargetOnGripper => *base_from_gripper,
        }
    }

    pub fn cam_from_target(&self, view: usize) -> Pose {
        let h = self.carrier_from_holder(&self.base_from_gripper[view]);
        self.cam_from_carrier * h * self.holder_from_target
    }

    /// Stations from which the camera sees the target as `cam_from_target` says.
    pub fn standing(mounting: Mounting, x: Pose, z: Pose, cam_from_target: &[Pose]) -> World {
        let station = |t: &Pose| {
            let h = x.inverse() * *t * z.inverse();
            if mounting == Mounting::CameraOnGripper { h.inverse() } else { h }
        };
        let base_from_gripper = cam_from_target.iter().map(station).collect();
        World { mounting, cam_from_carrier: x, holder_from_target: z, base_from_gripper }
    }

    /// A robot cell: the target seen from all over a cap of 45°, 0.6 to 1.2 m away.
    pub fn cell(rng: &mut Rng, mounting: Mounting, n: usize) -> World {
        let x = Pose::new(rng.rotation(), rng.unit_vector() * 0.15);
        let z = Pose::new(rng.rotation(), Vector3::new(0.8, -0.3, 0.2));
        let seen = |rng: &mut Rng| {
            let (tilt, turn) = (rng.uniform(0.0, 0.8), rng.uniform(0.0, std::f64::consts::TAU));
            let away = Vector3::new(tilt.sin() * turn.cos(), tilt.sin() * turn.sin(), -tilt.cos());
            let centre = away * rng.uniform(0.6, 1.2);
            let roll = Vector6::new(0.0, 0.0, rng.uniform(-1.0, 1.0), 0.0, 0.0, 0.0);
            Pose::exp(&roll) * views::looking_at(centre, Vector3::zeros())
        };
        let seen: Vec<Pose> = (0..n).map(|_| seen(rng)).collect();
        World::standing(mounting, x, z, &seen)
    }

    pub fn motion_error(&self, found: &HandEye) -> Vector12 {
        let x = (found.cam_from_carrier * self.cam_from_carrier.inverse()).log();
        let z = (found.holder_from_target * self.holder_from_target.inverse()).log();
        Vector12::from_fn(|i, _| if i < 6 { x[i] } else { z[i - 6] })
    }

    pub fn config(&self) -> HandEyeConfig {
        HandEyeConfig { mounting: self.mounting, ..HandEyeConfig::default() }
    }
}

/// A random covariance with standard deviations around the two given, strongly correlated.
pub fn covariance(rng: &mut Rng, sigma_rad: f64, sigma_m: f64) -> Matrix6<f64> {
    let root = Matrix6::from_fn(|i, j| if i == j { 1.0 } else { 0.4 * rng.normal() });
    let scale = Matrix6::from_fn(|i, j| match (i == j, i < 3) {
        (true, true) => sigma_rad,
        (true, false) => sigma_m,
        _ => 0.0,
    });
    scale * root * root.transpose() * scale
}

pub fn drawn(rng: &mut Rng, covariance: &Matrix6<f64>) -> Vector6<f64> {
    covariance.cholesky().unwrap().l() * Vector6::from_fn(|_, _| rng.normal())
}

/// What a simulated view states.
#[derive(Clone)]
pub struct Stated {
    pub seen: Matrix6<f64>,
    pub hand: Option<Matrix6<f64>>,
}

/// Every pose disturbed by its own covariance.
pub fn measured(rng: &mut Rng, world: &World, stated: &[Stated]) -> Vec<HandEyeView<'static>> {
    let view = |(i, stated): (usize, &Stated)| {
        let exact = world.base_from_gripper[i];
        let base_from_gripper = match &stated.hand {
            Some(covariance) => Pose::exp(&drawn(rng, covariance)) * exact,
            None => exact,
        };
        let cam_from_target = Pose::exp(&drawn(rng, &stated.seen)) * world.cam_from_target(i);
        HandEyeView {
            base_from_gripper,
            gripper_covariance: stated.hand,
            written: None,
            candidates: vec![Candidate { cam_from_target, covariance: stated.seen, delta_chi2: 0.0 }],
            seen: &[],
        }
    };
    stated.iter().enumerate().map(view).collect()
}

pub fn all_stated(rng: &mut Rng, n: usize, with_hand: bool) -> Vec<Stated> {
    let one = |rng: &mut Rng| Stated {
        seen: covariance(rng, 1e-3, 1e-3),
        hand: with_hand.then(|| covariance(rng, 5e-4, 5e-4)),
    };
    (0..n).map(|_| one(rng)).collect()
}

pub fn exact(world: &World) -> Vec<HandEyeView<'static>> {
    let covariance = Matrix6::from_diagonal_element(1e-6);
    let view = |i: usize| HandEyeView {
        base_from_gripper: world.base_from_gripper[i],
        gripper_covariance: None,
        written: None,
        candidates: vec![Candidate {
            cam_from_target: world.cam_from_target(i),
            covariance,
            delta_chi2: 0.0,
        }],
        seen: &[],
    };
    (0..world.base_from_gripper.len()).map(view).collect()
}

/// Fisher information of both motions at the truth: derivatives by central differences of the predicted poses, the gripper's noise by
/// differences too. Shares nothing with the product but Exp and Log.
pub fn information(world: &World, stated: &[Stated]) -> Matrix12 {
    linearised(world, stated).iter().map(|(by_both, weight)| by_both.transpose() * weight * by_both).sum()
}

/// The error of both motions that the best linear estimator makes on the same measurements, who knows every covariance: on average six in units of
/// its covariance for each, whatever is measured. What another estimator has more than it on the same data says more than its own mean.
pub fn best_linear(world: &World, linearised: &[Linearised], views: &[HandEyeView]) -> Vector12 {
    let (mut sum, mut right) = (Matrix12::zeros(), Vector12::zeros());
    for ((by_both, weight), view) in linearised.iter().zip(views) {
        let h = world.carrier_from_holder(&view.base_from_gripper);
        let expected = world.cam_from_carrier * h * world.holder_from_target;
        let r = (view.candidates[0].cam_from_target * expected.inverse()).log();
        sum += by_both.transpose() * weight * by_both;
        right += by_both.transpose() * (weight * r);
    }
    sum.cholesky().unwrap().solve(&right)
}

/// Of a view: the derivative of its pose by both motions, and its weight.
pub type Linearised = (SMatrix<f64, 6, 12>, Matrix6<f64>);

pub fn linearised(world: &World, stated: &[Stated]) -> Vec<Linearised> {
    const STEP: f64 = 1e-5;
    let one = |(i, stated): (usize, &Stated)| {
        let truth = world.cam_from_target(i);
        let seen = |by: &Vector12, hand: &Vector6<f64>| {
            let x = Pose::exp(&by.fixed_rows::<6>(0).into_owned()) * world.cam_from_carrier;
            let z = Pose::exp(&by.fixed_rows::<6>(6).into_owned()) * world.holder_from_target;
            let h = world.carrier_from_holder(&(Pose::exp(hand) * world.base_from_gripper[i]));
            (x * h * z * truth.inverse()).log()
        };
        let still = Vector6::zeros();
        let by_both = SMatrix::<f64, 6, 12>::from_fn(|row, column| {
            let h = Vector12::ith(column, STEP);
            (seen(&h, &still) - seen(&-h, &still))[row] / (2.0 * STEP)
        });
        let by_hand = Matrix6::from_fn(|row, column| {
            let h = Vector6::ith(column, STEP);
            (seen(&Vector12::zeros(), &h) - seen(&Vector12::zeros(), &-h))[row] / (2.0 * STEP)
        });
        let hand = stated.hand.map_or(Matrix6::zeros(), |c| by_hand * c * by_hand.transpose());
        (by_both, (stated.seen + hand).try_inverse().unwrap())
    };
    stated.iter().enumerate().map(one).collect()
}

pub fn block(m: &Matrix12, at: usize) -> Matrix6<f64> {
    m.fixed_view::<6, 6>(at, at).into()
}

pub fn part(v: &Vector12, at: usize) -> Vector6<f64> {
    v.fixed_rows::<6>(at).into()
}

pub fn squared(error: &Vector6<f64>, covariance: &Matrix6<f64>) -> f64 {
    error.dot(&covariance.cholesky().unwrap().solve(error))
}
