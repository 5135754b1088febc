//! The positions of the points, from what was typed: coordinates, or distances that determine them.

use crate::command::Template;
use crate::state::{PhotoState, Position, State};
use crate::texts;
use resight::core::{Pixel, Point};
use resight::layout::{Layout, Shape, TypedDistance, lay_out};
use std::collections::BTreeMap;

/// A point with its position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    pub x_m: Point,
    pub sigma_m: f64,
}

/// The positions of the points, and the consistency of the distances.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Places {
    pub by_name: BTreeMap<String, Place>,
    /// One value for each distance, in order.
    pub computed_m: Vec<Option<f64>>,
    /// Why the distances cannot all be right.
    pub contradiction: Option<String>,
}

impl From<&Position> for Place {
    fn from(p: &Position) -> Self {
        Place { x_m: Point::new(p.x_m, p.y_m, p.z_m), sigma_m: p.sigma_m }
    }
}

/// Computes the positions from the state; the first photograph decides on which side of a line a point is.
pub fn places(state: &State) -> Places {
    let stated = || state.positions.iter().map(|(name, p)| (name.clone(), Place::from(p))).collect();
    let shape = match state.template {
        Template::LineAndPost => Shape::LineOfThree,
        Template::FourPoints => Shape::Plane,
        Template::Rectangle => Shape::Rectangle,
        Template::Target | Template::Own => {
            return Places {
                by_name: stated(),
                computed_m: vec![None; state.distances.len()],
                contradiction: None,
            };
        }
    };
    let Some(photo) = state.photos.first() else { return Places::default() };
    laid_out(state, photo, shape)
}

fn laid_out(state: &State, photo: &PhotoState, shape: Shape) -> Places {
    let pixels: Vec<Pixel> = photo.points.iter().map(|p| Pixel::new(p.u_px, p.v_px)).collect();
    let number = |name: &str| photo.points.iter().position(|p| p.name == name).unwrap_or(usize::MAX);
    let distances: Vec<TypedDistance> = state
        .distances
        .iter()
        .map(|d| TypedDistance {
            a: number(&d.a),
            b: number(&d.b),
            distance_m: d.distance_m,
            sigma_m: d.sigma_m,
        })
        .collect();
    let Layout { points, computed_m, contradiction } = lay_out(&pixels, shape, &distances);
    let named = photo.points.iter().zip(&points).filter_map(|(point, laid)| {
        let laid = laid.as_ref()?;
        Some((point.name.clone(), Place { x_m: laid.position_m, sigma_m: laid.sigma_m }))
    });
    // A typed position of a further point is added to those from the distances.
    let mut by_name: BTreeMap<String, Place> =
        state.positions.iter().map(|(name, p)| (name.clone(), Place::from(p))).collect();
    by_name.extend(named);
    let contradiction =
        contradiction.map(|c| texts::contradicting_distance(&state.distances[c.distance], &c));
    Places { by_name, computed_m, contradiction }
}
