//! The accuracy of a target over a volume: poses at every distance, tilt, roll and image position.
//! docs/math/advise.md section 5.

use super::expect::{ALLOWED_BEND, Expectation, Optics, View, correspondences_in_view, expect, worst_sigmas};
use crate::locate::choose::Ambiguity;
use crate::locate::locate;
use crate::statistics::SplitMix64;
use crate::target::{KnownPoint, Target};
use crate::{Camera, Correspondence, Pixel, Point, Pose, Vector6};
use nalgebra::{Unit, UnitQuaternion, Vector2, Vector3};

/// The volume in which the camera may be, relative to the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Volume {
    /// Least and greatest distance from the target's centre.
    pub distance_m: [f64; 2],
    /// Least and greatest angle between the target's front normal and the direction to the camera, 0 to π/2.
    pub tilt_rad: [f64; 2],
    /// Least and greatest direction of the camera around the target, from the target's x axis towards its y axis; −π to π is the full circle.
    pub direction_rad: [f64; 2],
}

/// The points of a target and its front.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Its points.
    pub points: Vec<KnownPoint>,
    /// Unit normal of its front, target frame: the camera is on that side. ±z.
    pub front_in_target: Vector3<f64>,
    /// Whether parts of the target can be identified, so that it need not be completely in the image.
    pub works_in_part: bool,
}

impl Shape {
    /// Converts a target. Flat targets face −z (an AprilGrid +z); surveyed points and tag maps are assumed to be seen from above (+z).
    pub fn of(target: &Target) -> Self {
        let points = target.features().iter().filter_map(|f| target.point(*f)).collect();
        let up = matches!(target.design(), Target::AprilGrid(_) | Target::TagMap(_) | Target::Points(_));
        let works_in_part = up || matches!(target.design(), Target::Charuco(_));
        Shape { points, front_in_target: Vector3::z() * if up { 1.0 } else { -1.0 }, works_in_part }
    }

    /// Returns the centroid of its points.
    pub fn centre(&self) -> Point {
        self.points.iter().map(|p| p.position).sum::<Point>() / self.points.len().max(1) as f64
    }

    /// Returns the pose in which its centre is at `centre_in_cam`, the camera is `tilt_rad` off its front normal in the direction
    /// `direction_rad` around it (from its x axis towards its y axis), and the camera is then rolled by `roll_rad` about the line of sight.
    pub fn cam_from_target(
        &self,
        centre_in_cam: &Point,
        tilt_rad: f64,
        direction_rad: f64,
        roll_rad: f64,
    ) -> Pose {
        let line_of_sight = centre_in_cam.try_normalize(0.0).unwrap_or(Vector3::z());
        let around = Vector3::new(direction_rad.cos(), direction_rad.sin(), 0.0);
        let to_camera = self.front_in_target * tilt_rad.cos() + around * tilt_rad.sin();
        let w = line_of_sight * roll_rad;
        let roll = Pose::exp(&Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)).rotation;
        let turned = roll * turn_between(&to_camera, &-line_of_sight);
        Pose::new(turned, centre_in_cam - turned * self.centre())
    }
}

/// Returns the smallest rotation from one unit vector to another; opposite ones are rotated about x.
fn turn_between(from: &Vector3<f64>, to: &Vector3<f64>) -> nalgebra::Matrix3<f64> {
    let half_rotation =
        || UnitQuaternion::from_axis_angle(&Unit::new_normalize(Vector3::x()), core::f64::consts::PI);
    UnitQuaternion::rotation_between(from, to).unwrap_or_else(half_rotation).to_rotation_matrix().into_inner()
}

/// Returns a point of Roberts' additive recurrence in six dimensions (powers of 1/φ, φ⁷ = φ + 1), which fills a box evenly for any number of
/// points.
pub(crate) fn even(index: usize) -> [f64; 6] {
    const PHI: f64 = 1.112_775_684_278_705_5;
    core::array::from_fn(|k| (0.5 + (index + 1) as f64 * PHI.powi(-(k as i32 + 1))).fract())
}

/// Returns `n` poses that fill a volume evenly: uniform in distance, tilt, direction, the camera's roll, and the centre's position in the image,
/// which is moved towards the image's centre as far as visibility requires. `None` for poses in which the target is not visible even there.
pub fn poses(shape: &Shape, camera: &Camera, volume: &Volume, n: usize) -> Vec<Option<Pose>> {
    let between = |[a, b]: [f64; 2], t: f64| a + (b - a) * t;
    let one = |i: usize| {
        let [d, t, a, r, u, v] = even(i);
        let (distance_m, tilt_rad) = (between(volume.distance_m, d), between(volume.tilt_rad, t));
        let (direction_rad, roll_rad) = (between(volume.direction_rad, a), r * core::f64::consts::TAU);
        [1.0, 0.8, 0.6, 0.4, 0.2, 0.0].iter().find_map(|outwards| {
            let pixel = pixel_of_image_share(camera, 0.5 + (u - 0.5) * outwards, 0.5 + (v - 0.5) * outwards);
            let centre_in_cam = camera.bearing(&pixel).ok()?.into_inner() * distance_m;
            let cam_from_target = shape.cam_from_target(&centre_in_cam, tilt_rad, direction_rad, roll_rad);
            let optics = Optics { camera, sigma_px: 1.0, intrinsics_covariance: None };
            let view = optics.view(cam_from_target, &shape.points);
            correspondences_in_view(&view).map(|_| cam_from_target)
        })
    };
    (0..n).map(one).collect()
}

/// Returns a pixel from shares of width and height; for a camera without an image size always its centre.
pub(crate) fn pixel_of_image_share(camera: &Camera, u: f64, v: f64) -> Pixel {
    match camera.size {
        Some(size) => Vector2::new(u * f64::from(size.width_px) - 0.5, v * f64::from(size.height_px) - 0.5),
        None => camera.project(&Point::z()).unwrap_or_else(Vector2::zeros),
    }
}

/// Median, 95th percentile and largest value of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Value below which half of the views are.
    pub median: f64,
    /// Value that one view in twenty exceeds.
    pub p95: f64,
    /// The worst view.
    pub worst: f64,
}

/// The accuracy of a target over a set of views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlook {
    /// Number of views tried.
    pub n_views: usize,
    /// Number of views in which the target is not completely in the image.
    pub n_out_of_view: usize,
    /// Number of views in which its points do not determine a pose.
    pub n_undetermined: usize,
    /// Greatest standard deviation of rotation, radians, as `locate` will state it; `None` where no view has a pose.
    pub rotation_rad: Option<Spread>,
    /// Greatest standard deviation of the camera's position, metres.
    pub position_m: Option<Spread>,
    /// The same for exact intrinsics; `None` where they are exact.
    pub position_exact_intrinsics_m: Option<Spread>,
    /// Share of the answers, 0 to 1, that will be `ambiguous`.
    pub ambiguous: f64,
    /// Share of the answers whose first pose will be wrong.
    pub wrong: f64,
    /// Share of the views in which the first-order figures do not hold within 5 %.
    pub first_order_fails: f64,
}

/// Number of images simulated for a view whose likelihood is bent, because no formula gives its shares.
const DRAWS: usize = 12;

/// Computes the accuracy of a target over views; `None` stands for a view in which it is not visible.
///
/// Images of views with a bent likelihood are simulated with the stated lens, whose uncertainty is part of the covariance.
pub fn outlook(shape: &Shape, optics: &Optics, views: &[Option<Pose>]) -> Outlook {
    let mut chance = SplitMix64::scattered(0x5EED);
    let (mut tally, mut n_out_of_view, mut n_undetermined) = (Tally::default(), 0, 0);
    for pose in views {
        let view = pose.map(|cam_from_target| optics.view(cam_from_target, &shape.points));
        let Some((view, seen)) = view.and_then(|view| Some((view, correspondences_in_view(&view)?))) else {
            n_out_of_view += 1;
            continue;
        };
        match expect(&view) {
            Ok(e) => {
                let exact = worst_sigmas(&e.exact_intrinsics_covariance).1;
                tally.exact_places.extend(optics.intrinsics_covariance.map(|_| (exact, 1.0)));
                match e.bend_ratio <= ALLOWED_BEND {
                    true => tally.predicted(&e),
                    false => tally.tried(&view, &seen, &mut chance),
                }
            }
            Err(_) => n_undetermined += 1,
        }
    }
    tally.outlook(views.len(), n_out_of_view, n_undetermined)
}

/// Figures of views, each with its weight.
#[derive(Default)]
struct Tally {
    turns: Vec<(f64, f64)>,
    places: Vec<(f64, f64)>,
    exact_places: Vec<(f64, f64)>,
    ambiguous: f64,
    wrong: f64,
    first_order_fails: f64,
    n: f64,
}

impl Tally {
    /// Adds a view for which the first-order figures hold: docs/math/advise.md eqs. (4)–(5).
    fn predicted(&mut self, e: &Expectation) {
        self.ambiguous += e.chance_ambiguous();
        self.wrong += e.chance_wrong();
        self.first_order_fails += f64::from(u8::from(!e.first_order_limits().is_empty()));
        self.n += 1.0;
        self.sigmas(&e.stated_covariance, 1.0);
    }

    /// Adds a view whose likelihood is bent, from simulated images.
    fn tried(&mut self, view: &View, exact: &[Correspondence], chance: &mut SplitMix64) {
        const PART: f64 = 1.0 / DRAWS as f64;
        self.first_order_fails += 1.0;
        self.n += 1.0;
        for _ in 0..DRAWS {
            let Some(seen) = disturbed(view, exact, chance) else { continue };
            let Ok(answer) = locate(&seen, view.camera, &view.config()) else { continue };
            let off = |pose: &Pose| pose.angle_to_rad(&view.cam_from_target);
            let nearer = |pose: &Pose| off(pose) < off(&answer.cam_from_target);
            let is_wrong = answer.minima().any(|h| nearer(&h.minimum.cam_from_target));
            let is_ambiguous = matches!(answer.ambiguity, Ambiguity::Ambiguous { .. });
            self.wrong += if is_wrong { PART } else { 0.0 };
            self.ambiguous += if is_ambiguous { PART } else { 0.0 };
            self.sigmas(&answer.covariance, PART);
        }
    }

    fn sigmas(&mut self, covariance: &crate::Matrix6, part: f64) {
        let (rotation_rad, position_m) = worst_sigmas(covariance);
        self.turns.push((rotation_rad, part));
        self.places.push((position_m, part));
    }

    fn outlook(self, n_views: usize, n_out_of_view: usize, n_undetermined: usize) -> Outlook {
        let share = |sum: f64| if 0.0 < self.n { (sum / self.n).clamp(0.0, 1.0) } else { 0.0 };
        let [ambiguous, wrong, first_order_fails] =
            [self.ambiguous, self.wrong, self.first_order_fails].map(share);
        let (rotation_rad, position_m) = (spread(self.turns), spread(self.places));
        Outlook {
            n_views,
            n_out_of_view,
            n_undetermined,
            rotation_rad,
            position_m,
            position_exact_intrinsics_m: spread(self.exact_places),
            ambiguous,
            wrong,
            first_order_fails,
        }
    }
}

/// Returns the spread of weighted values.
fn spread(mut values: Vec<(f64, f64)>) -> Option<Spread> {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (worst, total) = (values.last()?.0, values.iter().map(|v| v.1).sum::<f64>());
    let at = |share: f64| {
        let mut below = 0.0;
        let reached = values.iter().find(|v| {
            below += v.1;
            share * total <= below
        });
        reached.map_or(worst, |v| v.0)
    };
    Some(Spread { median: at(0.5), p95: at(0.95), worst })
}

/// Returns one simulated image of a view, with noise.
fn disturbed(view: &View, exact: &[Correspondence], chance: &mut SplitMix64) -> Option<Vec<Correspondence>> {
    let one = |c: &Correspondence| {
        let pixel = c.pixel + Vector2::new(chance.normal(), chance.normal()) * c.sigma_px;
        let moved = Correspondence::new(view.camera, c.x_in_target, pixel, c.sigma_px).ok()?;
        Some(Correspondence { sigma_m: c.sigma_m, ..moved })
    };
    exact.iter().map(one).collect()
}
