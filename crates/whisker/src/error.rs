//! One error type: the fault, the number seen, the number needed, the remedy.

use thiserror::Error;

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A quantity is NaN or infinite.
    #[error("{what} is not a finite number; correct it or leave the row empty")]
    NotFinite {
        /// Which quantity.
        what: &'static str,
    },
    /// A quantity that must be positive is not.
    #[error("{what} is {seen}; it must be positive")]
    NotPositive {
        /// Which quantity.
        what: &'static str,
        /// The value given.
        seen: f64,
    },
    /// A quantity that must not be negative is, or is no number.
    #[error("{what} is {seen}; it must be zero or positive")]
    Negative {
        /// Which quantity.
        what: &'static str,
        /// The value given.
        seen: f64,
    },
    /// A quantity that no whisker has: in another unit, or with a slipped decimal.
    #[error(
        "{what} is {seen:.6e}; {least:.3e} to {most:.3e} is possible here; check its unit and its decimals"
    )]
    OutOfRange {
        /// Which quantity, with its unit.
        what: &'static str,
        /// The value given.
        seen: f64,
        /// The least that is taken.
        least: f64,
        /// The most that is taken.
        most: f64,
    },
    /// A profile whose knots do not run from the clamp to the tip.
    #[error(
        "{what} has {knots} knots and {values} values, from {first_m} m to {last_m} m; as many values as knots are needed, at increasing arc lengths from 0 to the whisker's length {length_m} m"
    )]
    BadProfile {
        /// Which profile.
        what: &'static str,
        /// Arc lengths given.
        knots: usize,
        /// Values given.
        values: usize,
        /// The first arc length, metres; NaN where there is none.
        first_m: f64,
        /// The last arc length, metres.
        last_m: f64,
        /// The whisker's length, metres.
        length_m: f64,
    },
    /// Too few samples in contact for the question asked.
    #[error("{seen} {what} given, {needed} needed; {way_out}")]
    TooFew {
        /// Of what.
        what: &'static str,
        /// The number given.
        seen: usize,
        /// The number needed.
        needed: usize,
        /// What to do.
        way_out: &'static str,
    },
    /// A fit that does not settle.
    #[error("{what} does not settle; {way_out}")]
    NoFit {
        /// Which fit.
        what: &'static str,
        /// What to do.
        way_out: &'static str,
    },
    /// A polygon is not convex, or its corners run clockwise.
    #[error(
        "corner {corner} of the polygon turns by {rotation_rad:.3e} rad; name the corners of a convex polygon counter-clockwise, none twice and none on a straight line"
    )]
    NotConvex {
        /// Which corner, from 0.
        corner: usize,
        /// By how much the outline turns left there, radians.
        rotation_rad: f64,
    },
    /// The whisker cuts through the object before anything has moved.
    #[error("the unloaded whisker cuts the object at the first pose; start the path where it is free")]
    StartsInside,
    /// The path leads the clamp into the object.
    #[error("the hub is inside the object at pose {pose}; move the path away from the object")]
    HubInside {
        /// Which pose, from 0.
        pose: usize,
    },
    /// Neither free nor in quasi-static contact at a single point.
    #[error(
        "pose {pose}: the whisker is neither free nor at rest against a single point of the object; shorten the path or change it"
    )]
    NoRest {
        /// Which pose, from 0.
        pose: usize,
    },
    /// A request that contradicts itself, or the files it comes with.
    #[error("{reason}")]
    Request {
        /// The fault, and the number needed.
        reason: String,
    },
}

impl Error {
    /// The fault of a request.
    pub fn request(reason: impl Into<String>) -> Self {
        Error::Request { reason: reason.into() }
    }
}
