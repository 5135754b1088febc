//! The error type: what is wrong, the number seen, the number needed, the way out.

mod focal;

pub use focal::FocalRemedy;
use focal::undetermined_focal;
use thiserror::Error;

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A coordinate, sigma or parameter is NaN or infinite.
    #[error("{what} of point {index} is not a finite number; remove the row or correct it")]
    NotFinite {
        /// The quantity.
        what: &'static str,
        /// Index of the point, counted from 0.
        index: usize,
    },
    /// A standard deviation that is not positive.
    #[error("sigma of point {index} is {seen}; it must be positive")]
    NotPositive {
        /// Index of the point, counted from 0.
        index: usize,
        /// The value given.
        seen: f64,
    },
    /// A matrix that is not a covariance of a pixel.
    #[error(
        "the pixel covariance of point {index} is not positive definite (least eigenvalue {seen:.1e} px²); correct it or give sigma_px alone"
    )]
    CovarianceNotPositive {
        /// Index of the point, counted from 0.
        index: usize,
        /// Its least eigenvalue, px².
        seen: f64,
    },
    /// Too few points for any method.
    #[error("{seen} points given, {needed} needed; add points whose position in the target is known")]
    TooFewPoints {
        /// Number of points given.
        seen: usize,
        /// How many the method needs.
        needed: usize,
    },
    /// A layout, or a number of points, that the method does not accept.
    #[error("{method} does not fit these points: {reason}; use method auto")]
    WrongLayout {
        /// The method.
        method: &'static str,
        /// What is wrong with the layout.
        reason: &'static str,
    },
    /// Two correspondences share a target point (or a pixel).
    #[error("points {first} and {second} coincide {where_}; remove one of them")]
    Coincident {
        /// Index of the first.
        first: usize,
        /// Index of the second.
        second: usize,
        /// `in the target` or `in the image`.
        where_: &'static str,
    },
    /// The target points lie on one line, about which the rotation is not observable.
    #[error(
        "all points lie on one line (width/length {ratio:.1e}, need {needed:.0e}); add a point off the line"
    )]
    Collinear {
        /// Extent across over extent along.
        ratio: f64,
        /// The smallest ratio accepted.
        needed: f64,
    },
    /// A list with another number of entries than views.
    #[error("{seen} {what} given for {needed} views; give one for each view, or one for all")]
    CountMismatch {
        /// The list.
        what: &'static str,
        /// Its length.
        seen: usize,
        /// The number of views.
        needed: usize,
    },
    /// The images of the points do not determine a pose, although the target would.
    #[error("degenerate view: {reason} (metric {metric:.1e}, need {needed:.0e})")]
    DegenerateView {
        /// The configuration, in words, with the way out.
        reason: &'static str,
        /// The number seen.
        metric: f64,
        /// The number needed.
        needed: f64,
    },
    /// A pixel outside the part of the image where the lens model is one-to-one.
    #[error(
        "pixel ({u_px:.1}, {v_px:.1}) is outside the valid field of the {model} model ({limit} {limit_at:.6}); check the distortion coefficients or mask the corner"
    )]
    OutsideField {
        /// Column.
        u_px: f64,
        /// Row.
        v_px: f64,
        /// Lens model.
        model: &'static str,
        /// What bounds the field, in words.
        limit: &'static str,
        /// The bound.
        limit_at: f64,
    },
    /// Impossible camera parameters.
    #[error("camera parameter {parameter} is {seen}; {needed}")]
    InvalidCamera {
        /// Parameter name, as in camera.toml.
        parameter: &'static str,
        /// The value seen.
        seen: f64,
        /// What it must be.
        needed: &'static str,
    },
    /// Wrong number of distortion coefficients.
    #[error("{model} takes {needed} distortion coefficients, {seen} given")]
    CoefficientCount {
        /// Lens model.
        model: &'static str,
        /// Counts accepted.
        needed: &'static str,
        /// Count given.
        seen: usize,
    },
    /// Impossible target dimensions.
    #[error("target {parameter} is {seen}; {needed}")]
    InvalidTarget {
        /// Key, as in target.toml.
        parameter: &'static str,
        /// The value seen.
        seen: f64,
        /// What it must be.
        needed: &'static str,
    },
    /// A prior with an impossible value.
    #[error("{parameter} of prior {prior} is wrong ({seen}): {needed}")]
    InvalidPrior {
        /// Index of the prior, counted from 0.
        prior: usize,
        /// Its field.
        parameter: &'static str,
        /// The value seen, or a measure of its fault.
        seen: f64,
        /// What it must be.
        needed: &'static str,
    },
    /// A loss whose threshold is not positive and finite.
    #[error("the threshold of the loss is {seen} standard deviations; it must be positive and finite")]
    InvalidLoss {
        /// The value given.
        seen: f64,
    },
    /// A rig without a camera.
    #[error("the rig has no camera; give at least one view")]
    EmptyRig,
    /// Views of which none shows two targets.
    #[error(
        "none of {n_views} views with {n_observations} observations shows two targets, so that nothing relates their poses; take views that show two or more at a time, each overlapping with the next"
    )]
    EmptyMap {
        /// Number of views.
        n_views: usize,
        /// Number of observations.
        n_observations: usize,
    },
    /// A camera of a rig with an impossible pose.
    #[error("camera {camera} of the rig: {what} is {seen}; {needed}")]
    InvalidRig {
        /// Index of the camera, counted from 0.
        camera: usize,
        /// The quantity.
        what: &'static str,
        /// The value seen.
        seen: f64,
        /// What it must be.
        needed: &'static str,
    },
    /// A point observed by a camera of a rig, with an impossible number.
    #[error(
        "{what} of point {point} seen by camera {camera} of the rig {needed}; remove the row or correct it"
    )]
    InvalidRigPoint {
        /// Index of the camera, counted from 0.
        camera: usize,
        /// Index of its point, counted from 0.
        point: usize,
        /// The quantity.
        what: &'static str,
        /// What it must be.
        needed: &'static str,
    },
    /// No candidate pose has every point in front of the camera.
    #[error(
        "no pose puts all {n_points} points in front of the camera; check that target points and pixels belong together"
    )]
    NoSolution {
        /// Number of points that took part.
        n_points: usize,
    },
    /// The refinement did not reach a minimum.
    #[error(
        "refinement stopped after {steps} steps without reaching a minimum; check that target points and pixels belong together"
    )]
    NotConverged {
        /// Steps taken.
        steps: usize,
    },
    /// Too few frames with a pose.
    #[error("{seen} frames have a pose, {needed} needed; add frames in which the target is seen well")]
    TooFewFrames {
        /// Number of frames with a pose.
        seen: usize,
        /// Number of frames needed.
        needed: usize,
    },
    /// Points of one view that do not determine focal length and distance separately.
    #[error("{}", undetermined_focal(*relative_sigma, *needed, remedy))]
    UndeterminedFocal {
        /// Standard deviation of the focal length divided by the focal length; infinite where it is not determined at all.
        relative_sigma: f64,
        /// The largest accepted.
        needed: f64,
        /// What the layout lacks.
        remedy: FocalRemedy,
    },
    /// A best-fitting focal length that no lens has.
    #[error(
        "the points fit best with a focal length of {focal_px:.0} px, a horizontal field of view of {:.1}°; one of 2° to 130° is needed: check that points and pixels are in the same order, the units of both, and the image size", field_of_view_rad.to_degrees()
    )]
    ImpossibleFocal {
        /// The focal length.
        focal_px: f64,
        /// The horizontal field of view that it corresponds to.
        field_of_view_rad: f64,
    },
    /// An intrinsic parameter that the frames hardly determine.
    #[error(
        "the frames leave {parameter} undetermined (relative standard deviation {seen:.1e}, need {needed:.0e} or less); add views tilted by 30° or more and at several distances, or hold it"
    )]
    UndeterminedIntrinsics {
        /// Parameter name, as in camera.toml.
        parameter: &'static str,
        /// Its standard deviation relative to its scale: docs/math/frames.md eq. (9).
        seen: f64,
        /// The largest accepted.
        needed: f64,
    },
    /// A measured pose, or its covariance, with an impossible number.
    #[error("{what} of {item} {index} is {seen}; {needed}")]
    InvalidPose {
        /// `view` or `pair`.
        item: &'static str,
        /// Index of the item, counted from 0.
        index: usize,
        /// The quantity.
        what: &'static str,
        /// The value seen.
        seen: f64,
        /// What it must be.
        needed: &'static str,
    },
    /// Too few views with a known motion.
    #[error(
        "{seen} views have both a known motion and a pose of the target, {needed} needed; add views between which the hand turns about different axes"
    )]
    TooFewMotions {
        /// Number of such views.
        seen: usize,
        /// Number of views needed.
        needed: usize,
    },
    /// Views of a target and motions of a gripper that agree with no pose of the camera.
    #[error("the views and the poses of the hand agree in no way: {likely}")]
    ViewsDisagree {
        /// The likely cause.
        likely: &'static str,
    },
    /// Motions that do not determine a part of the answer.
    #[error("{reason} (metric {metric:.1e} rad, need {needed:.0e} rad); {way_out}")]
    DegenerateMotion {
        /// What the motions have in common.
        reason: &'static str,
        /// Root mean square rotation about the weakest of the required axes.
        metric: f64,
        /// The least rotation accepted.
        needed: f64,
        /// The way out.
        way_out: &'static str,
    },
    /// Cameras that no chain of pairs connects.
    #[error(
        "the pairs leave {groups} groups: nothing joins camera {a} to camera {b}; add a pair between the groups, or solve each alone"
    )]
    Disconnected {
        /// Number of groups.
        groups: usize,
        /// A camera of the first group.
        a: usize,
        /// A camera of another.
        b: usize,
    },
    /// Too few correspondences agree with any single pose to exclude chance.
    #[error(
        "no pose agrees with enough of the {n} {what}: {best} at best, {needed} needed to rule out chance ({samples} samples tried); check that labels and camera belong to this view, keep the threshold at three to five standard deviations of the noise, or add {what}"
    )]
    NoConsensus {
        /// The largest number that agreed with one pose; the number that a pose fits by construction if none was better.
        best: usize,
        /// Number of correspondences or groups.
        n: usize,
        /// Number that must agree.
        needed: usize,
        /// `points`, or `groups`.
        what: &'static str,
        /// Number of samples tried.
        samples: usize,
    },
    /// Rays to a point that cannot be distinguished from parallel rays: the point may be infinitely distant.
    #[error(
        "the rays to the point are too nearly parallel: the angle between them is {parallax_rad:.1e} rad ± {sigma_rad:.1e}, and {needed} times its standard deviation is needed; add a photograph from farther aside"
    )]
    ParallaxTooSmall {
        /// Angle between the rays, positive if they converge towards the point, negative if they diverge.
        parallax_rad: f64,
        /// Its standard deviation.
        sigma_rad: f64,
        /// Number of standard deviations needed.
        needed: f64,
    },
    /// A point that would be behind a camera that sees it.
    #[error(
        "the point would lie behind view {view} ({depth_m:.3} m along its ray); the views are mixed up or the pixels belong to different points"
    )]
    BehindView {
        /// Index of the view, counted from 0.
        view: usize,
        /// Distance along the ray, negative.
        depth_m: f64,
    },
    /// A view of a point with an impossible number.
    #[error("view {view} of the point: {what} is {seen}; {needed}")]
    InvalidView {
        /// Index of the view, counted from 0.
        view: usize,
        /// The quantity.
        what: &'static str,
        /// The value seen.
        seen: f64,
        /// What it must be.
        needed: &'static str,
    },
    /// A constraint of a network with an impossible number.
    #[error("fact {constraint} of the survey: {what} is {seen}; {needed}")]
    InvalidConstraint {
        /// Index of the constraint, counted from 0.
        constraint: usize,
        /// The quantity.
        what: &'static str,
        /// The value seen.
        seen: f64,
        /// What it must be.
        needed: &'static str,
    },
    /// A network without any known length.
    #[error(
        "no length is known, so nothing can be measured in metres; give a known distance or the coordinates of two marks"
    )]
    NoLength,
    /// A part of a network that its constraints leave undetermined.
    #[error("{what} {index} is undetermined: {reason} (metric {metric:.2}, need {needed:.2})")]
    Undetermined {
        /// `photo`, `point` or `plane`.
        what: &'static str,
        /// Its index, counted from 0.
        index: usize,
        /// The reason, with the way out.
        reason: &'static str,
        /// The number seen.
        metric: f64,
        /// The number needed.
        needed: f64,
    },
    /// The control points of a network are on one line: a rotation of everything about it is hardly observable.
    #[error(
        "the control points are nearly on one line: from point {a} to point {b} are {length_m:.2} m, and no control point is farther off their line than {width_m:.3} m (need {needed_m:.3} m); a rotation about that line can hardly be seen, so add a mark well off it"
    )]
    ControlPointsOnLine {
        /// The control point at one end, counted from 0.
        a: usize,
        /// The control point at the other end.
        b: usize,
        /// Distance of these two, metres.
        length_m: f64,
        /// Distance from their line of the control point farthest from it, metres.
        width_m: f64,
        /// The distance needed, metres.
        needed_m: f64,
    },
    /// Known distances that no positions of the points satisfy.
    #[error(
        "the known distances contradict each other: fact {constraint} is off by {off_m:.4} m, {sigmas:.1} times its standard deviation; measure it again or give it a larger sigma_m"
    )]
    InconsistentDistances {
        /// Index of the constraint that fits the others worst, counted from 0.
        constraint: usize,
        /// The stated value minus the prediction of the others, metres.
        off_m: f64,
        /// The same difference divided by its standard deviation.
        sigmas: f64,
    },
    /// A setting with an impossible value.
    #[error("{setting} is {seen}; {needed}")]
    InvalidSetting {
        /// Name of the setting.
        setting: &'static str,
        /// The value seen.
        seen: f64,
        /// What it must be.
        needed: &'static str,
    },
    /// An observation of a rig with impossible data.
    #[cfg(feature = "std")]
    #[error("camera {camera}, view {view}, target {target}: {reason}")]
    InvalidObservation {
        /// Its camera.
        camera: usize,
        /// Its view.
        view: usize,
        /// Its target.
        target: usize,
        /// What is wrong with it.
        reason: Box<Error>,
    },
    /// An observation names a camera, view or target that does not exist.
    #[error(
        "observation {observation} names {what} {seen}, but there are {n} (counted from 0); correct the index"
    )]
    NoSuchIndex {
        /// Index of the observation, in the order given.
        observation: usize,
        /// `camera`, `view` or `target`.
        what: &'static str,
        /// The index given.
        seen: usize,
        /// Number of cameras, views or targets.
        n: usize,
    },
    /// A camera without usable observations.
    #[error(
        "camera {camera} has {n_observations} observations and none gives a pose; add views in which it sees a target with four or more points, or leave it out"
    )]
    CameraNotObserved {
        /// Index of the camera.
        camera: usize,
        /// Number of its observations.
        n_observations: usize,
    },
    /// Cameras that no chain of shared views connects.
    #[cfg(feature = "std")]
    #[error("cameras {} and {} are not connected{}; {needed}", list(first), list(second), after(*n_rejected))]
    CamerasUnconnected {
        /// One group.
        first: Vec<usize>,
        /// All others.
        second: Vec<usize>,
        /// Number of observations rejected before, because they contradict the others or give no pose.
        n_rejected: usize,
        /// What would connect them.
        needed: &'static str,
    },
    /// A target whose pose on its body no observation determines.
    #[error(
        "target {target} is never seen together with another target of body {body}; add a view in which one camera sees both, or make it a body of its own"
    )]
    TargetUnconnected {
        /// Index of the target.
        target: usize,
        /// Index of its body.
        body: usize,
    },
    /// A snapshot of another version.
    #[error("the snapshot has version {seen}, this program reads version {needed}; begin anew")]
    SnapshotVersion {
        /// Its version.
        seen: u32,
        /// The version read here.
        needed: u32,
    },
    /// Data that are not a snapshot.
    #[error(
        "the {seen} numbers of the snapshot are no state ({unread} of them could not be used); begin anew"
    )]
    SnapshotNumbers {
        /// Length of the data.
        seen: usize,
        /// Number of numbers that were not read.
        unread: usize,
    },
}

/// Lists numbers: `0, 2, 5`.
#[cfg(feature = "std")]
fn list(numbers: &[usize]) -> String {
    let words: Vec<String> = numbers.iter().map(usize::to_string).collect();
    words.join(", ")
}

#[cfg(feature = "std")]
fn after(n_rejected: usize) -> String {
    match n_rejected {
        0 => String::new(),
        n => format!(" once {n} observations that contradict the others or give no pose are set aside"),
    }
}
