//! One sample's contact in the world, with its covariance and a verdict.

use crate::contact::{
    ByLoad, Method, NoZero, branch_with_derivatives, contact_with_derivatives, later_zeros,
};
use crate::{Cell, HubContact, HubLoad, PlanarPose, Rod, Sample};
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

/// χ² of the load, 3 degrees of freedom, up to which nothing is touched: a free whisker exceeds it once in 100,000 samples.
pub const FREE_CHI2: f64 = 25.90;

/// Forces below this many of their own sigmas do not place a contact: the sigma of the arc length, (σ/F) s, is then 8 % of it, and forces that
/// only look larger than they are would pass for contacts nearer to the hub, confidently.
pub const LEAST_FORCE_SIGMAS: f64 = 12.5;

/// Largest sigma along the whisker, as a share of its length, of a contact worth its place.
pub const MOST_ALONG_SHARE: f64 = 0.05;

/// Sigmas beyond which noise does not explain a contact past the tip or a moment that never vanishes: 3e-5, one-sided.
pub const GATE_SIGMAS: f64 = 4.0;

/// The status of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// A contact whose covariance holds.
    Ok,
    /// The load is within the noise: nothing is touched.
    NoContact,
    /// Something is touched, but too lightly to locate it along the whisker.
    LowForce,
    /// The moment never vanishes: several contacts, a distributed one, or a wrong EI. Also a load, a pose of the hub or a noise that is
    /// no number, or too large for its square to be one.
    NoZero,
    /// The moment vanishes beyond the whisker's tip by more than the noise explains.
    BeyondTip,
    /// The load contradicts what is known (friction, envelope, tip) by more than the noise explains.
    Inconsistent,
}

/// Where on the whisker the object touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Nowhere.
    Free,
    /// Between clamp and tip, on a face, a curved outline or a corner: the force is normal to the whisker up to friction.
    Mid,
    /// At the tip: the force is normal to the object up to friction.
    Tip,
}

/// A contact in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The point of the centre line, world, metres.
    pub x_in_world: Vector2<f64>,
    /// Direction of the whisker there, world, radians.
    pub theta_rad: f64,
    /// Arc length from the clamp, metres.
    pub s_m: f64,
    /// Standard deviation of the arc length, metres.
    pub s_sigma_m: f64,
    /// Force of the object on the whisker, across it and away from the object, newtons; not negative.
    pub f_normal_n: f64,
    /// Force along the whisker, positive towards the tip, newtons.
    pub f_tangent_n: f64,
    /// asin(F·t/|F|), radians.
    pub friction_angle_rad: f64,
    /// Standard deviation of the friction angle, radians.
    pub friction_angle_sigma_rad: f64,
    /// (1 + F·t/|F|)/2: k² of the elastica of a straight uniform whisker.
    pub modulus_squared: f64,
    /// Covariance of `[x, y, θ]`, world, m², m·rad, rad².
    pub covariance: Matrix3<f64>,
}

impl Contact {
    /// A contact of the hub frame in the world; `in_hub` is the covariance of its [`HubContact::to_vector`], `sample` where the hub was and the
    /// load taken for true; whisker_contact.md eq. (40).
    pub fn in_world(
        sample: &Sample,
        hub_covariance: &Matrix3<f64>,
        at: &HubContact,
        in_hub: &SMatrix<f64, 5, 5>,
    ) -> Self {
        let (hub, force) = (&sample.world_from_hub, sample.load.force_n().norm());
        let turn = world_from_hub_axes(hub);
        // Turning or shifting the hub moves the contact: by [x, y, angle] of the hub.
        let arm = hub.rotate(at.x_in_hub);
        let by_hub = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 1.0);
        Contact {
            x_in_world: hub.apply(at.x_in_hub),
            theta_rad: hub.angle_rad + at.theta_rad,
            s_m: at.s_m,
            s_sigma_m: in_hub[(3, 3)].sqrt(),
            f_normal_n: force * at.friction_angle_rad.cos(),
            f_tangent_n: force * at.friction_angle_rad.sin(),
            friction_angle_rad: at.friction_angle_rad,
            friction_angle_sigma_rad: in_hub[(4, 4)].sqrt(),
            modulus_squared: at.modulus_squared,
            covariance: turn * in_hub.fixed_view::<3, 3>(0, 0) * turn.transpose()
                + by_hub * hub_covariance * by_hub.transpose(),
        }
    }

    /// Whether every number is one, and the covariance could be one: a pose of the hub or a noise that is no number leaves neither.
    pub fn is_sound(&self) -> bool {
        let place = [
            self.x_in_world.x,
            self.x_in_world.y,
            self.theta_rad,
            self.s_m,
            self.f_normal_n,
            self.f_tangent_n,
        ];
        let covariance = &self.covariance;
        let is_finite =
            place.iter().chain(covariance.iter()).all(|v| v.is_finite()) && self.s_sigma_m.is_finite();
        let minor = |i: usize, j: usize| {
            covariance[(i, j)].powi(2) <= covariance[(i, i)] * covariance[(j, j)] * (1.0 + 1e-9)
        };
        let is_covariance =
            (0..3).all(|i| 0.0 <= covariance[(i, i)]) && minor(0, 1) && minor(0, 2) && minor(1, 2);
        is_finite && is_covariance
    }

    /// Unit vector from the object to the whisker, across the whisker, world: n = sign(M₀)·(−sin θ, cos θ); the sign is
    /// [`HubLoad::side`].
    pub fn normal_in_world(&self, moment_sign: f64) -> Vector2<f64> {
        let (sin, cos) = self.theta_rad.sin_cos();
        Vector2::new(-sin, cos) * moment_sign
    }

    /// Force of the object on the whisker, world axes, newtons.
    pub fn force_in_world_n(&self, moment_sign: f64) -> Vector2<f64> {
        let (sin, cos) = self.theta_rad.sin_cos();
        self.normal_in_world(moment_sign) * self.f_normal_n + Vector2::new(cos, sin) * self.f_tangent_n
    }

    /// The point of the object's outline, world, metres: from the centre line towards the object by the whisker's radius; eq. (42).
    pub fn outline_in_world(&self, rod: &Rod, moment_sign: f64) -> Vector2<f64> {
        self.x_in_world - self.normal_in_world(moment_sign) * (0.5 * rod.diameter_m_at(self.s_m))
    }
}

/// The estimate of one sample.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactEstimate {
    /// The verdict.
    pub status: Status,
    /// Where on the whisker.
    pub mode: Mode,
    /// Probability of that mode; 1 where it was not in question.
    pub mode_probability: f64,
    /// The contact, wherever the load has one: also with a status other than ok.
    pub contact: Option<Contact>,
    /// Further zeros of the moment on the whisker (S-shaped states), by arc length.
    pub branches: Vec<HubContact>,
}

impl ContactEstimate {
    /// A sample without a contact.
    pub fn without_contact(status: Status) -> Self {
        let mode = Mode::Free;
        ContactEstimate { status, mode, mode_probability: 1.0, contact: None, branches: Vec::new() }
    }
}

/// Sample by sample, no constraint used. Never fails: a load without a contact says why in its status.
pub fn estimate(rod: &Rod, cell: &Cell, sample: &Sample, method: Method) -> ContactEstimate {
    let load_covariance = cell.load_covariance();
    if load_chi2(&sample.load, &load_covariance) <= FREE_CHI2 {
        return ContactEstimate::without_contact(Status::NoContact);
    }
    match contact_with_derivatives(rod, &sample.load, method) {
        Err(why) => ContactEstimate::without_contact(without_zero(rod, &sample.load, &load_covariance, why)),
        Ok((at, by_load)) => ContactEstimate {
            branches: later_zeros(rod, &sample.load, &at, method).to_vec(),
            ..at_zero(rod, cell, sample, method, 0, (at, by_load))
        },
    }
}

/// Of an S-shaped whisker the first zero of the moment need not be the contact: the estimate at the zero nearest in arc length to
/// `previous_s_m`, where the last sample's contact was, metres. Returns which zero that is: 0 the first, n for `branches[n − 1]`. The object
/// lies on the other side of every second zero: its moment sign there is (−1)ⁿ [`HubLoad::side`].
pub fn choose_branch(
    rod: &Rod,
    cell: &Cell,
    sample: &Sample,
    method: Method,
    first: ContactEstimate,
    previous_s_m: f64,
) -> (usize, ContactEstimate) {
    let Some(contact) = first.contact else { return (0, first) };
    let zeros = std::iter::once(contact.s_m).chain(first.branches.iter().map(|at| at.s_m));
    let away = |s_m: f64| (s_m - previous_s_m).abs();
    let nearest = zeros.enumerate().min_by(|(_, a), (_, b)| away(*a).total_cmp(&away(*b)));
    match nearest {
        Some((branch, _)) if 0 < branch => match branch_with_derivatives(rod, &sample.load, method, branch) {
            Ok(found) => {
                let chosen = at_zero(rod, cell, sample, method, branch, found);
                (branch, ContactEstimate { branches: first.branches, ..chosen })
            }
            Err(_) => (0, first),
        },
        _ => (0, first),
    }
}

/// The estimate that takes a given zero of the moment for the contact.
fn at_zero(
    rod: &Rod,
    cell: &Cell,
    sample: &Sample,
    method: Method,
    branch: usize,
    (at, by_load): (HubContact, ByLoad),
) -> ContactEstimate {
    let covariance = cell.load_covariance();
    let again = |load: &HubLoad| match branch {
        0 => contact_with_derivatives(rod, load, method),
        _ => branch_with_derivatives(rod, load, method, branch),
    };
    let in_hub = second_order(&sample.load, &covariance, &by_load, |load| Some(again(load).ok()?.1));
    let contact = Contact::in_world(sample, &cell.hub_covariance(), &at, &in_hub);
    let (status, mode, mode_probability) = verdict(rod, &sample.load, &covariance, &contact);
    ContactEstimate { status, mode, mode_probability, contact: Some(contact), branches: Vec::new() }
}

/// Covariance of a contact to second order in the noise of the load, its bias included: weak forces move the contact along a curve, not a
/// line; whisker_contact.md eq. (39). Where `by_load_at` has no answer beside the load, to first order.
pub fn second_order(
    load: &HubLoad,
    load_covariance: &Matrix3<f64>,
    by_load: &ByLoad,
    by_load_at: impl Fn(&HubLoad) -> Option<ByLoad>,
) -> SMatrix<f64, 5, 5> {
    /// In sigmas: short against the curve, long against the rounding of derivatives.
    const STEP: f64 = 0.1;
    let root = square_root(load_covariance);
    let straight = by_load * root;
    let mut covariance = straight * straight.transpose();
    let mut bent = [[SVector::<f64, 5>::zeros(); 3]; 3];
    for i in 0..3 {
        let moved = load.to_vector() + root.column(i) * STEP;
        let Some(by_load) = by_load_at(&HubLoad::from_vector(&moved)) else { return covariance };
        let change = (by_load * root - straight) / STEP;
        (0..3).for_each(|j| bent[i][j] = change.column(j).into_owned());
    }
    let mut bias = SVector::<f64, 5>::zeros();
    for i in 0..3 {
        bias += bent[i][i] * 0.5;
        for j in 0..3 {
            covariance += bent[i][j] * bent[i][j].transpose() * 0.5;
        }
    }
    covariance + bias * bias.transpose()
}

/// S with S Sᵀ = `covariance`, of one that may be zero in parts.
fn square_root(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    covariance
        .cholesky()
        .map_or_else(|| Matrix3::from_diagonal(&covariance.diagonal().map(|v| v.max(0.0).sqrt())), |c| c.l())
}

/// The one place where a zero of the moment becomes a status, and what the arc length alone says of the mode: `Tip` beyond the length,
/// and even odds within three sigmas of it.
fn verdict(rod: &Rod, load: &HubLoad, covariance: &Matrix3<f64>, contact: &Contact) -> (Status, Mode, f64) {
    let beyond_m = contact.s_m - rod.length_m;
    let status = if !contact.is_sound() {
        Status::NoZero
    } else if GATE_SIGMAS * contact.s_sigma_m < beyond_m {
        Status::BeyondTip
    } else if MOST_ALONG_SHARE * rod.length_m < contact.s_sigma_m || is_weak(load, covariance) {
        Status::LowForce
    } else {
        Status::Ok
    };
    let mode = if 0.0 < beyond_m { Mode::Tip } else { Mode::Mid };
    let in_question = beyond_m.abs() <= 3.0 * contact.s_sigma_m;
    (status, mode, if in_question { 0.5 } else { 1.0 })
}

/// The one place where the absence of a zero becomes a status: too light a force, or a load no single contact explains.
fn without_zero(rod: &Rod, load: &HubLoad, covariance: &Matrix3<f64>, why: NoZero) -> Status {
    match why {
        NoZero::Free => Status::NoContact,
        NoZero::NotFinite => Status::NoZero,
        NoZero::Axial => Status::LowForce,
        NoZero::NeverVanishes if is_weak(load, covariance) => Status::LowForce,
        NoZero::NeverVanishes if pull_within_noise(rod, load, covariance) => Status::LowForce,
        NoZero::NeverVanishes => Status::NoZero,
    }
}

/// Whether the force is too small for its direction to be known.
fn is_weak(load: &HubLoad, covariance: &Matrix3<f64>) -> bool {
    let sigma = covariance[(0, 0)].max(covariance[(1, 1)]).sqrt();
    load.force_n().norm() < LEAST_FORCE_SIGMAS * sigma
}

/// Whether the share of the force along the whisker at the contact, (M₀²/2EI + M₀ κ₀ + fx)/F, exceeds 1 by no more than the noise does; eq. (41).
fn pull_within_noise(rod: &Rod, load: &HubLoad, covariance: &Matrix3<f64>) -> bool {
    let (ei, curvature) = (rod.ei_base_n_m2(), rod.curvature_per_m_at(0.0));
    let HubLoad { fx_n, fy_n, mz_n_m } = *load;
    let force = load.force_n().norm();
    let pull = (mz_n_m * (0.5 * mz_n_m / ei + curvature) + fx_n) / force;
    let gradient =
        Vector3::new(1.0 - pull * fx_n / force, -pull * fy_n / force, mz_n_m / ei + curvature) / force;
    let sigma = (gradient.transpose() * covariance * gradient)[(0, 0)].sqrt();
    pull - 1.0 < GATE_SIGMAS * sigma
}

/// χ² of a load against none, 3 degrees of freedom; an exact instrument calls every load but none a contact.
pub fn load_chi2(load: &HubLoad, covariance: &Matrix3<f64>) -> f64 {
    let share = |i: usize, value: f64| if value == 0.0 { 0.0 } else { value * value / covariance[(i, i)] };
    load.to_vector().iter().enumerate().map(|(i, value)| share(i, *value)).sum()
}

/// Turns `[x, y, θ]` of the hub frame into world axes.
fn world_from_hub_axes(hub: &PlanarPose) -> Matrix3<f64> {
    let (sin, cos) = hub.angle_rad.sin_cos();
    Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
}
