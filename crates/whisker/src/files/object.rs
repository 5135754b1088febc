//! Objects and hub paths as JSON: `{"object": {"type": "circle", "centre": [0, 0.16], "radius": 0.025}, "friction_coefficient": 0, "sweeps": […]}`.
//! Lengths in metres, angles by their key.

use super::node::Node;
use crate::simulate::Motion;
use crate::{PlanarPose, Shape};
use nalgebra::Vector2;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

/// An object and how rough it is.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectFile {
    /// The outline.
    pub shape: Shape,
    /// Coulomb's μ; none where the file does not say.
    pub friction_coefficient: Option<f64>,
}

/// Reads an object: bare, or below `object` (as `identify` and `simulate` write it).
///
/// # Errors
/// What JSON says, or the key that is missing or wrong.
pub fn read(text: &str) -> Result<ObjectFile, String> {
    let document = parse(text)?;
    let root = Node::root(&document);
    if let Some(verdict) = root.get("verdict")
        && root.get("object").is_none()
    {
        return Err(format!("this file holds no object: its verdict is {}", verdict.value()));
    }
    let object = root.get("object").unwrap_or_else(|| root.clone());
    let friction = root.get("friction_coefficient").map(|node| node.not_negative()).transpose()?;
    Ok(ObjectFile { shape: shape(&object)?, friction_coefficient: friction })
}

fn parse(text: &str) -> Result<Value, String> {
    serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(|reason| format!("no JSON: {reason}"))
}

fn shape(object: &Node) -> Result<Shape, String> {
    let kind = object.need("type")?;
    let centre = || object.need("centre")?.point();
    let angle_rad = angle(object)?.unwrap_or(0.0);
    match kind.word()? {
        "circle" => Ok(Shape::Circle { centre_m: centre()?, radius_m: object.need("radius")?.positive()? }),
        "ellipse" => Ok(ellipse(centre()?, object.need("semi_axes")?.numbers_n()?, angle_rad)),
        "square" => Ok(Shape::square(centre()?, object.need("side")?.positive()?, angle_rad)),
        "rectangle" => {
            let sides_m = object.need("sides")?.numbers_n()?;
            Ok(Shape::Rectangle { centre_m: centre()?, sides_m, angle_rad })
        }
        "polygon" => {
            let corners = object.need("corners")?.list()?;
            let corners_m = corners.iter().map(Node::point).collect::<Result<Vec<_>, _>>()?;
            Ok(Shape::Polygon { corners_m: counter_clockwise(corners_m) })
        }
        _ => Err(kind.complaint("`circle`, `ellipse`, `square`, `rectangle` or `polygon`")),
    }
}

/// The larger semi-axis first.
fn ellipse(centre_m: Vector2<f64>, [a, b]: [f64; 2], angle_rad: f64) -> Shape {
    let quarter = std::f64::consts::FRAC_PI_2;
    match b <= a {
        true => Shape::Ellipse { centre_m, semi_axes_m: [a, b], angle_rad },
        false => Shape::Ellipse { centre_m, semi_axes_m: [b, a], angle_rad: angle_rad + quarter },
    }
}

fn counter_clockwise(mut corners: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    let n = corners.len();
    let area: f64 = (0..n).map(|i| corners[i].perp(&corners[(i + 1) % n])).sum();
    if area < 0.0 {
        corners.reverse();
    }
    corners
}

/// `angle_deg` or `angle_rad`, radians.
fn angle(node: &Node) -> Result<Option<f64>, String> {
    match node.optional(&["angle_rad"])? {
        Some(angle_rad) => Ok(Some(angle_rad)),
        None => Ok(node.optional(&["angle_deg"])?.map(f64::to_radians)),
    }
}

/// The outline of an object in the world, as an object file states it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum OutlineObject {
    /// A disc.
    Circle {
        /// x and y, metres.
        centre: [f64; 2],
        /// Metres.
        radius: f64,
    },
    /// An ellipse that is no circle.
    Ellipse {
        /// x and y, metres.
        centre: [f64; 2],
        /// The larger first, metres.
        semi_axes: [f64; 2],
        /// Direction of the larger semi-axis, counter-clockwise from the world's x axis, degrees.
        angle_deg: f64,
    },
    /// A rectangle of equal sides.
    Square {
        /// x and y, metres.
        centre: [f64; 2],
        /// Metres.
        side: f64,
        /// Direction of a side, counter-clockwise from the world's x axis, degrees.
        angle_deg: f64,
    },
    /// A rectangle that is no square.
    Rectangle {
        /// x and y, metres.
        centre: [f64; 2],
        /// Metres.
        sides: [f64; 2],
        /// Direction of the first side, counter-clockwise from the world's x axis, degrees.
        angle_deg: f64,
    },
    /// A convex polygon.
    Polygon {
        /// x and y, metres, counter-clockwise.
        corners: Vec<[f64; 2]>,
    },
}

impl From<&Shape> for OutlineObject {
    fn from(shape: &Shape) -> Self {
        match shape {
            Shape::Circle { centre_m, radius_m } => {
                OutlineObject::Circle { centre: (*centre_m).into(), radius: *radius_m }
            }
            Shape::Ellipse { centre_m, semi_axes_m, angle_rad } => OutlineObject::Ellipse {
                centre: (*centre_m).into(),
                semi_axes: *semi_axes_m,
                angle_deg: angle_rad.to_degrees(),
            },
            Shape::Rectangle { centre_m, sides_m: [a, b], angle_rad } if a == b => OutlineObject::Square {
                centre: (*centre_m).into(),
                side: *a,
                angle_deg: angle_rad.to_degrees(),
            },
            Shape::Rectangle { centre_m, sides_m, angle_rad } => OutlineObject::Rectangle {
                centre: (*centre_m).into(),
                sides: *sides_m,
                angle_deg: angle_rad.to_degrees(),
            },
            Shape::Polygon { corners_m } => {
                OutlineObject::Polygon { corners: corners_m.iter().map(|corner| (*corner).into()).collect() }
            }
        }
    }
}

/// How the hub moves during one sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepPath {
    /// Its number.
    pub sweep: u32,
    /// The motion.
    pub motion: Motion,
    /// How many readings at equal times, where the file says; else they are laid around touch and slip-off.
    pub n_samples: Option<usize>,
}

/// Reads the `sweeps` of a path: `translate` (x0, x1, y, psi_deg), `rotate` (hx, hy, psi0_deg, psi1_deg) or `poses` (a list of
/// [x, y, angle in radians]).
///
/// # Errors
/// What JSON says, or the key that is missing or wrong.
pub fn read_path(text: &str) -> Result<Vec<SweepPath>, String> {
    let document = parse(text)?;
    let sweeps = Node::root(&document).need("sweeps")?.list()?;
    if sweeps.is_empty() {
        return Err("`sweeps` is empty; one sweep at least is needed".to_string());
    }
    sweeps.iter().enumerate().map(|(i, node)| sweep(i, node)).collect()
}

/// Most readings of a sweep.
const MOST_SAMPLES: f64 = crate::simulate::MOST_SAMPLES as f64;

fn sweep(index: usize, node: &Node) -> Result<SweepPath, String> {
    let number = |key: &str| node.need(key)?.number();
    let kind = node.need("kind")?;
    let motion = match kind.word()? {
        "translate" => {
            let (angle_rad, y) = (number("psi_deg")?.to_radians(), number("y")?);
            let pose = |x_m: f64, y_m: f64| PlanarPose { x_m, y_m, angle_rad };
            let y1 = node.optional(&["y1"])?.unwrap_or(y);
            Motion::Between { from: pose(number("x0")?, y), to: pose(number("x1")?, y1) }
        }
        "rotate" => {
            let (x_m, y_m) = (number("hx")?, number("hy")?);
            let pose = |degrees: f64| PlanarPose { x_m, y_m, angle_rad: degrees.to_radians() };
            Motion::Between { from: pose(number("psi0_deg")?), to: pose(number("psi1_deg")?) }
        }
        "poses" => Motion::Through { poses: poses(&node.need("poses")?)? },
        _ => return Err(kind.complaint("`translate`, `rotate` or `poses`")),
    };
    let count = |node: Node| match node.positive()? {
        n if n.fract() == 0.0 && (2.0..=MOST_SAMPLES).contains(&n) => Ok(n as usize),
        _ => Err(node.complaint("a whole number from 2 to 100,000")),
    };
    let n_samples = node.get("samples").map(count).transpose()?;
    let sweep = node.optional(&["sweep"])?.map_or(index as u32, |n| n as u32);
    Ok(SweepPath { sweep, motion, n_samples })
}

fn poses(node: &Node) -> Result<Vec<PlanarPose>, String> {
    let pose = |entry: &Node| {
        let [x_m, y_m, angle_rad] = entry.numbers_n()?;
        Ok::<_, String>(PlanarPose { x_m, y_m, angle_rad })
    };
    let poses: Vec<PlanarPose> = node.list()?.iter().map(pose).collect::<Result<_, _>>()?;
    if poses.is_empty() { Err(node.complaint("one pose at least")) } else { Ok(poses) }
}
