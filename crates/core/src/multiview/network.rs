//! Measurement in photographs: one joint maximum-likelihood adjustment of photographs, points, planes and intrinsics to all constraints.
//!
//! The input are constraints (image points, coordinates, distances, planes, uprights, gravity, poses, each with its sigma). The output are all
//! positions and poses with one joint covariance, and from them lengths, angles, areas and heights with their 95 % intervals. Derivation:
//! docs/math/survey.md.
//!
//! starts → adjust → drop what is undetermined → check → explain a contradiction. Each step is one file.

mod check;
mod state;
mod rows;
mod query;
mod trilaterate;
mod gauge;
mod segments;
mod spread;
mod starts;
mod snoop;
mod solve;
mod arrange;
mod exchange;
mod blunder;
mod verdict;
mod interval;
mod ground;
mod reliability;
mod budget;

use crate::correspondence::PixelCovariance;
use crate::least_squares::arrow::ArrowInverse;
use crate::{Camera, Error, Matrix6, Pixel, Point, Pose};
use arrange::Depth;
use nalgebra::{Matrix3, Vector3};

pub use budget::NetworkBudgets;
pub use exchange::Exchange;
pub use interval::Measured;
pub use query::Query;
pub use reliability::{ErrorSource, NetworkReliability, QueryReliability};
pub use snoop::{DecimalSlip, Suspect};
pub use spread::OnLine;
pub use verdict::{NetworkStatus, NetworkWarning};

/// A camera and the covariance of its intrinsics; photographs of one camera share its errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetworkCamera<'a> {
    /// Lens as calibrated.
    pub camera: &'a Camera,
    /// Covariance of the intrinsic parameters, row by row, in the order of `Camera::parameters`; none where exact.
    pub intrinsics_covariance: Option<&'a [f64]>,
}

/// A plane that points may lie on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Plane {
    /// The points with normal · x = offset.
    Known {
        /// Unit normal, world frame.
        normal_in_world: Vector3<f64>,
        /// Its offset along the normal.
        offset_m: f64,
    },
    /// A plane found from the points on it; its normal points to the side of the cameras.
    Unknown,
}

/// A constraint on the scene. Points, photographs and planes are named by their index.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // A network has a few hundred constraints; a box would take away Copy.
pub enum Constraint {
    /// A point observed at a pixel of a photograph.
    ImagePoint {
        /// Which photograph.
        photo: usize,
        /// Which point.
        point: usize,
        /// Its pixel, px.
        pixel: Pixel,
        /// Covariance of the pixel, px².
        covariance_px2: PixelCovariance,
    },
    /// The point's coordinates.
    Place {
        /// Which point.
        point: usize,
        /// Coordinates, m.
        x_in_world: Point,
        /// Their standard deviations, m; 0 where exact.
        sigma_m: Vector3<f64>,
    },
    /// The distance between two points.
    Distance {
        /// One point.
        a: usize,
        /// The other point.
        b: usize,
        /// The measured distance.
        distance_m: f64,
        /// Its standard deviation.
        sigma_m: f64,
    },
    /// The point lies on a plane.
    OnPlane {
        /// Which plane.
        plane: usize,
        /// Which point.
        point: usize,
        /// Standard deviation of the distance from the plane, m: its flatness.
        sigma_m: f64,
    },
    /// One point is above another, along the plane's normal.
    Upright {
        /// The plane that is level.
        plane: usize,
        /// The lower point.
        foot: usize,
        /// The upper point.
        top: usize,
        /// Standard deviation of the inclination about each axis.
        sigma_rad: f64,
    },
    /// The plane is level, and down was measured in a photograph's camera frame.
    Gravity {
        /// The level plane.
        plane: usize,
        /// Which photograph.
        photo: usize,
        /// Unit vector, camera frame.
        down_in_cam: Vector3<f64>,
        /// Its standard deviation about each axis across it.
        sigma_rad: f64,
    },
    /// The pose of a photograph.
    Pose {
        /// Which photograph.
        photo: usize,
        /// x_in_cam = cam_from_world · x_in_world.
        cam_from_world: Pose,
        /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, positive definite; none where exact.
        covariance: Option<Matrix6>,
    },
}

/// The input of an adjustment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetworkProblem<'a> {
    /// The cameras.
    pub cameras: &'a [NetworkCamera<'a>],
    /// The camera that took each photograph.
    pub camera_of_photo: &'a [usize],
    /// The number of points.
    pub n_points: usize,
    /// The planes.
    pub planes: &'a [Plane],
    /// The constraints, in any order.
    pub constraints: &'a [Constraint],
}

/// The frame that positions are given in. Lengths, angles and areas do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// The frame of the given coordinates, poses and planes.
    Given,
    /// First control point at the origin, second on the x axis, third in the xy-plane, z towards the side of the cameras.
    ControlPoints([usize; 3]),
    /// The frame of the given coordinates; what they leave free (a rotation, a translation) is held at the initial values.
    Held,
}

/// A photograph, point or plane of a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Item {
    /// A photograph.
    Photo(usize),
    /// A point.
    Point(usize),
    /// A plane.
    Plane(usize),
}

/// The adjusted network, with the joint covariance.
#[derive(Debug, Clone)]
pub struct Adjusted {
    /// The adjusted poses, positions and planes.
    pub(crate) state: state::State,
    /// The index of each unknown in the joint vector.
    pub(crate) layout: state::Layout,
    /// The network's own copy of the data that queries need.
    pub(crate) constraints: Vec<Constraint>,
    /// Covariance of all unknowns, widened by `noise_scale`.
    pub(crate) covariance: ArrowInverse,
    /// Sum of squared residuals over their variances.
    pub chi2: f64,
    /// Number of residuals less number of unknowns.
    pub degrees_of_freedom: usize,
    /// Factor by which every variance was widened because the residuals prove the sigmas too small; 1 where they agree.
    pub noise_scale: f64,
    /// Whether the constraints disagree by more than their sigmas explain (once in ten thousand).
    pub is_inconsistent: bool,
    /// Constraints that contradict the others, the worst first.
    pub suspects: Vec<Suspect>,
    /// The constraint that took no part because it alone contradicts the rest; all positions are those of the rest.
    pub left_out: Vec<usize>,
    /// What was exchanged, if that alone explains a contradiction: one exchange, or two of which nothing shows which it is. All positions are
    /// those with the first corrected.
    pub exchanged: Vec<Exchange>,
    /// The line that contains all control points, if there is one.
    pub on_line: Option<OnLine>,
    /// Whether a control point that a photograph shows has no position, so that the constraints on it took no part.
    pub has_lost_control_points: bool,
    /// The points and photographs that the constraints do not determine, with the reason; the constraints on them took no part.
    pub undetermined: Vec<(Item, Error)>,
    /// χ² of the second best arrangement of photographs and control points less that of the best; none where no other was found.
    pub alternative_delta_chi2: Option<f64>,
    /// The second best arrangement.
    pub alternative: Option<Box<Adjusted>>,
    /// The frame of the positions.
    pub frame: Frame,
    /// Number of steps of the adjustment.
    pub steps: usize,
}

/// A second arrangement closer than this in χ² cannot be distinguished from the best.
pub const ALTERNATIVE_GATE_CHI2: f64 = 9.0;

/// Adjusts the network: solves for the poses of photographs, the positions of points and the planes.
///
/// # Errors
/// `InvalidConstraint` and `InvalidCamera` for numbers that cannot be right; `NoLength` where no length is known; `ControlPointsOnLine` where the control points
/// stand on one line; `InconsistentDistances` where the distances between control points contradict each other and no single constraint explains it; `Undetermined` where nothing at all can be
/// placed. Single points and photographs that cannot be placed are listed in [`Adjusted::undetermined`].
pub fn adjust(network: &NetworkProblem) -> Result<Adjusted, Error> {
    network.check()?;
    if let Some(on_line) = spread::of_coordinates(network) {
        return Err(on_line);
    }
    let found = blunder::explained(network, blunder::attempt(network, Depth::Together));
    let mut adjusted = found.map_err(|reason| match reason {
        Error::NoLength | Error::InconsistentDistances { .. } => reason,
        reason => spread::of_lengths(network).unwrap_or(reason),
    })?;
    let has_lost_control_points = adjusted.lost_control_points(network).next().is_some();
    adjusted.has_lost_control_points = has_lost_control_points;
    // Positions from contradictory constraints do not show where the control points are.
    let is_consistent = !adjusted.is_inconsistent && adjusted.suspects.is_empty();
    adjusted.on_line = is_consistent.then(|| spread::of_adjusted(network, &adjusted)).flatten();
    Ok(adjusted)
}

/// Adjusts the network as its first arrangement has it: neither another one nor the cause of a contradiction is sought. For an answer that the next
/// one replaces within a moment, such as while a point is dragged.
///
/// # Errors
/// Those of [`adjust`], and `NotConverged` for constraints that contradict each other so much that the adjustment would take long.
pub fn adjust_provisionally(network: &NetworkProblem) -> Result<Adjusted, Error> {
    network.check()?;
    blunder::attempt(network, Depth::First)
}

impl Adjusted {
    /// Returns a point's position; none where undetermined.
    pub fn point(&self, point: usize) -> Option<Point> {
        self.layout.has_point(point).then(|| self.state.points[point])
    }

    /// Returns the covariance of a point's position, m².
    pub fn point_covariance_m2(&self, point: usize) -> Option<Matrix3<f64>> {
        let at = self.layout.has_point(point).then(|| self.layout.point[point])?;
        Some(Matrix3::from_fn(|i, j| match (at[i], at[j]) {
            (Some(i), Some(j)) => self.covariance.at(i, j),
            _ => 0.0,
        }))
    }

    /// Returns a photograph's pose, `cam_from_world`; none where undetermined.
    pub fn cam_from_world(&self, photo: usize) -> Option<Pose> {
        self.layout.has_photo(photo).then(|| self.state.photos[photo])
    }

    /// Returns the covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub fn photo_covariance(&self, photo: usize) -> Option<Matrix6> {
        self.layout.has_photo(photo).then(|| match self.layout.photo[photo] {
            Some(at) => Matrix6::from_fn(|i, j| self.covariance.at(at + i, at + j)),
            None => Matrix6::zeros(),
        })
    }

    /// Returns a plane's unit normal and offset (normal · x = offset), world frame; none where undetermined.
    pub fn plane(&self, plane: usize) -> Option<(Vector3<f64>, f64)> {
        let found = self.layout.has_plane(plane).then(|| self.state.planes[plane])?;
        Some((found.normal, found.normal.dot(&found.pivot) + found.height_m))
    }

    /// Returns a camera as the constraints correct it, where its intrinsics were uncertain.
    pub fn camera(&self, camera: usize) -> Option<&Camera> {
        self.state.lenses.get(camera).map(|lens| &lens.camera)
    }
}

impl Constraint {
    /// Returns the points of the constraint.
    pub fn points(&self) -> [Option<usize>; 2] {
        match *self {
            Constraint::ImagePoint { point, .. }
            | Constraint::Place { point, .. }
            | Constraint::OnPlane { point, .. } => [Some(point), None],
            Constraint::Distance { a, b, .. } => [Some(a), Some(b)],
            Constraint::Upright { foot, top, .. } => [Some(foot), Some(top)],
            Constraint::Gravity { .. } | Constraint::Pose { .. } => [None, None],
        }
    }

    /// Replaces the indices of its points; returns whether each of them has a new one.
    pub fn renumber(&mut self, number: impl Fn(usize) -> Option<usize>) -> bool {
        let points: [Option<&mut usize>; 2] = match self {
            Constraint::ImagePoint { point, .. }
            | Constraint::Place { point, .. }
            | Constraint::OnPlane { point, .. } => [Some(point), None],
            Constraint::Distance { a, b, .. } => [Some(a), Some(b)],
            Constraint::Upright { foot, top, .. } => [Some(foot), Some(top)],
            Constraint::Gravity { .. } | Constraint::Pose { .. } => [None, None],
        };
        points.into_iter().flatten().all(|point| match number(*point) {
            Some(number) => {
                *point = number;
                true
            }
            None => false,
        })
    }

    /// Returns the number of its residuals.
    fn n_rows(&self) -> usize {
        match self {
            Constraint::ImagePoint { .. } | Constraint::Upright { .. } | Constraint::Gravity { .. } => 2,
            Constraint::Place { sigma_m, .. } => sigma_m.iter().filter(|sigma| 0.0 < **sigma).count(),
            Constraint::Distance { .. } | Constraint::OnPlane { .. } => 1,
            Constraint::Pose { covariance, .. } => 6 * usize::from(covariance.is_some()),
        }
    }

    /// Returns the photograph of the constraint.
    pub fn photo(&self) -> Option<usize> {
        match *self {
            Constraint::ImagePoint { photo, .. }
            | Constraint::Gravity { photo, .. }
            | Constraint::Pose { photo, .. } => Some(photo),
            _ => None,
        }
    }

    /// Returns the plane of the constraint.
    pub fn plane(&self) -> Option<usize> {
        match *self {
            Constraint::OnPlane { plane, .. }
            | Constraint::Upright { plane, .. }
            | Constraint::Gravity { plane, .. } => Some(plane),
            _ => None,
        }
    }
}
