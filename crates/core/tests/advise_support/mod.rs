//! The adviser's word against trial: views drawn with noise, answered by `locate`, compared with what was foretold.

use crate::common::{Rng, views};
use nalgebra::{Matrix6, Vector2, Vector6};
use resight_core::advise::expect::{View, correspondences_in_view};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::{Config, locate};
use resight_core::target::KnownPoint;
use resight_core::{Correspondence, Point, Pose};

/// Points known exactly.
pub fn known(places: &[[f64; 3]]) -> Vec<KnownPoint> {
    places.iter().map(|x| KnownPoint { position: Point::from(*x), sigma_m: 0.0 }).collect()
}

/// What many noisy images of one view gave.
pub struct Trial {
    /// Left motions from the truth to the minimum nearest to it.
    pub errors: Vec<Vector6<f64>>,
    /// The poses of these minima.
    pub poses: Vec<Pose>,
    /// Share of ambiguous answers.
    pub ambiguous: f64,
    /// Share of answers whose first pose is not the one nearest to the truth.
    pub wrong: f64,
}

/// A view's points with noise of their own sigma.
pub fn noisy(rng: &mut Rng, view: &View) -> Vec<Correspondence> {
    let exact = correspondences_in_view(view).expect("in sight");
    let moved = |c: &Correspondence| {
        let by = Vector2::new(rng.normal(), rng.normal()) * c.sigma_px;
        Correspondence::new(view.camera, c.x_in_target, c.pixel + by, c.sigma_px).expect("in the field")
    };
    exact.iter().map(moved).collect()
}

/// `n` images of a view, answered.
pub fn trial(view: &View, n: usize, seed: u64) -> Trial {
    let mut rng = Rng::new(seed);
    let mut t = Trial { errors: Vec::new(), poses: Vec::new(), ambiguous: 0.0, wrong: 0.0 };
    for _ in 0..n {
        // Known to a radian only: refused by name.
        let Ok(answer) = locate(&noisy(&mut rng, view), view.camera, &Config::default()) else { continue };
        let off = |pose: &Pose| pose.angle_to_rad(&view.cam_from_target);
        let nearest = answer
            .minima()
            .map(|h| h.minimum.cam_from_target)
            .min_by(|a, b| off(a).total_cmp(&off(b)))
            .expect("a minimum");
        t.ambiguous += f64::from(matches!(answer.ambiguity, Ambiguity::Ambiguous { .. })) / n as f64;
        t.wrong += f64::from(nearest != answer.cam_from_target) / n as f64;
        t.errors.push((nearest * view.cam_from_target.inverse()).log());
        t.poses.push(nearest);
    }
    assert!(n - t.poses.len() <= n / 50, "{} of {n} refused", n - t.poses.len());
    t
}

impl Trial {
    /// Root of the mean of ξᵀΣ⁻¹ξ/6: the spread over the spread foretold, all directions together. Known to 1/√(12 n).
    pub fn over(&self, covariance: &Matrix6<f64>) -> f64 {
        let inverse = covariance.try_inverse().expect("positive definite");
        let sum: f64 = self.errors.iter().map(|xi| xi.dot(&(inverse * xi))).sum();
        (sum / (6.0 * self.errors.len() as f64)).sqrt()
    }

    /// Greatest spread over that foretold, over all directions.
    pub fn worst_over(&self, covariance: &Matrix6<f64>) -> f64 {
        let n = self.errors.len() as f64;
        let m: Matrix6<f64> = self.errors.iter().map(|xi| xi * xi.transpose()).sum::<Matrix6<f64>>() / n;
        let root = covariance.cholesky().expect("positive definite").l();
        let half = root.solve_lower_triangular(&m).expect("a root");
        let whole = root.solve_lower_triangular(&half.transpose()).expect("a root");
        whole.symmetric_eigenvalues().max().sqrt()
    }
}

/// Root mean square.
pub fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = values.fold((0usize, 0.0), |(n, sum), x| (n + 1, sum + x * x));
    (sum / n as f64).sqrt()
}

/// A camera above a road: f = 800 px, 8 m high, looking 35° down along +y.
pub fn above_the_road() -> Pose {
    views::looking_at_upright(Point::new(0.0, 0.0, 8.0), Point::new(0.5, 12.0, 0.0))
}
