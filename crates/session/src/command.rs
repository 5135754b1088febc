//! The actions of a user, one variant each.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One action. A refused one leaves the state as it was, and the view says why.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// States the lens of the photograph.
    SetLens {
        /// What is known of it.
        lens: GivenLens,
    },
    /// Chooses what the points are.
    SetTemplate {
        /// The arrangement.
        template: Template,
    },
    /// Adds a point to the photograph, or moves it.
    PutPoint {
        /// Its name: the same one in each photograph.
        name: String,
        /// Column.
        u_px: f64,
        /// Row.
        v_px: f64,
        /// Still under the hand: all that follow until one is not are undone together.
        #[serde(default)]
        drag: bool,
        /// Standard deviation of u and v where it snapped to something; none where placed by hand.
        #[serde(default)]
        sigma_px: Option<f64>,
    },
    /// Removes a point from the photograph.
    RemovePoint {
        /// Which.
        name: String,
    },
    /// Calls a point something else, in every photograph.
    RenamePoint {
        /// Which.
        name: String,
        /// Its new name.
        to: String,
    },
    /// States where a point is.
    SetPosition {
        /// Which.
        name: String,
        /// Coordinates.
        x_m: f64,
        /// Coordinates.
        y_m: f64,
        /// Coordinates; z points up.
        #[serde(default)]
        z_m: f64,
        /// Standard deviation of each; 0 where exact.
        #[serde(default)]
        sigma_m: f64,
    },
    /// Forgets where a point is.
    ClearPosition {
        /// Which.
        name: String,
    },
    /// States a distance.
    SetDistance {
        /// One end.
        a: String,
        /// The other.
        b: String,
        /// As measured.
        distance_m: f64,
        /// Its standard deviation; 1 % of it where none is given.
        #[serde(default)]
        sigma_m: Option<f64>,
    },
    /// Forgets a distance.
    RemoveDistance {
        /// One end.
        a: String,
        /// The other.
        b: String,
    },
    /// States how exactly points are placed by hand.
    SetSigma {
        /// Standard deviation of u and v.
        sigma_px: f64,
    },
    /// Finds a target or a tag in the photograph; its points take the place of those there.
    FindTarget {
        /// What to find.
        target: GivenTarget,
    },
    /// Chooses among poses that fit.
    ChoosePose {
        /// 0: as answered.
        index: usize,
    },
    /// Asks where a dot, corner or crossing near a pixel is; changes nothing.
    Snap {
        /// Column.
        u_px: f64,
        /// Row.
        v_px: f64,
        /// What to look for.
        to: SnapTo,
    },
    /// Adds something to measure.
    AddMeasurement {
        /// Its name.
        name: String,
        /// What it is.
        what: MeasuredKind,
        /// Its points in the photograph.
        points: Vec<[f64; 2]>,
    },
    /// Moves one of its points.
    MoveMeasurement {
        /// Which measurement.
        name: String,
        /// Which of its points.
        index: usize,
        /// Column.
        u_px: f64,
        /// Row.
        v_px: f64,
        /// As of `put_point`.
        #[serde(default)]
        drag: bool,
    },
    /// Removes it.
    RemoveMeasurement {
        /// Which.
        name: String,
    },
    /// Takes the last change back.
    Undo,
    /// Makes the change taken back last again.
    Redo,
    /// What is drawn.
    Show {
        /// The metric grid on the ground.
        grid: bool,
        /// The axes.
        axes: bool,
    },
}

/// What is known of a lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "by", rename_all = "snake_case", deny_unknown_fields)]
pub enum GivenLens {
    /// A camera file in any supported format.
    File {
        /// Its name; `NAME#CAMERA` picks one of several.
        name: String,
        /// Its contents.
        text: String,
    },
    /// The horizontal field of view.
    FieldOfView {
        /// From the left to the right edge.
        hfov_deg: f64,
    },
    /// What the photograph's EXIF says.
    Exif,
    /// One of the common cameras, by its name.
    Common {
        /// As in the list.
        name: String,
    },
    /// Lines that are parallel in the scene: where they meet says how long the lens is.
    Lines {
        /// Five at least, of two directions at least; a horizon counts as two, and with it two upright ones are enough.
        lines: Vec<GivenLine>,
    },
    /// That of another photograph of the session, which the same camera took without zooming.
    Photograph {
        /// The other photograph.
        name: String,
    },
    /// Nothing: the focal length is estimated from the same points.
    Unknown,
}

/// A straight line of the scene, marked by two of its points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GivenLine {
    /// Which way it runs.
    pub direction: LineDirection,
    /// Column and row of both points.
    pub ends: [[f64; 2]; 2],
}

/// Directions of the scene, each square to the others, and the horizon.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LineDirection {
    /// Level, and away from the camera.
    Along,
    /// Level, and square to that.
    Across,
    /// Upright.
    Up,
    /// Not a line of the scene: the horizon.
    Horizon,
}

/// What the points are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Template {
    /// Three on a line and one off it, on a plane.
    #[default]
    LineAndPost,
    /// Any four or more on a plane.
    FourPoints,
    /// The corners of a rectangle, in order around it.
    Rectangle,
    /// Found in the photograph.
    Target,
    /// With coordinates.
    Own,
}

/// What to find.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "by", rename_all = "snake_case", deny_unknown_fields)]
pub enum GivenTarget {
    /// The target of a file.
    File {
        /// Its name.
        name: String,
        /// Its contents.
        text: String,
    },
    /// One tag of a family, or of `any`.
    Family {
        /// AprilTag family or OpenCV dictionary.
        family: String,
        /// The outer edge of its black square.
        size_m: f64,
    },
}

/// What a point snaps to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SnapTo {
    /// The middle of a dot.
    Dot,
    /// A corner.
    Corner,
    /// Where two lines cross.
    Crossing,
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MeasuredKind {
    /// Between two points of the ground.
    Length,
    /// Along points of the ground.
    Polyline,
    /// Of a polygon on the ground.
    Area,
    /// Of the second point above the first, which is on the ground.
    Height,
    /// Coordinates of a point of the ground.
    Position,
}

impl MeasuredKind {
    /// Returns the word used in JSON and in tables.
    pub fn name(self) -> &'static str {
        match self {
            MeasuredKind::Length => "length",
            MeasuredKind::Polyline => "polyline",
            MeasuredKind::Area => "area",
            MeasuredKind::Height => "height",
            MeasuredKind::Position => "position",
        }
    }
}
