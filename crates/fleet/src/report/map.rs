//! The map of the cameras: a dot for each position, in the colour of the most urgent verdict there.

use super::class;
use crate::assess::{Assessment, CameraVerdict, Found};
use crate::cameras::{Cameras, Site};
use resight::report::html::escaped;
use std::collections::BTreeMap;
use std::fmt::Write;

const WIDTH: f64 = 900.0;
const MARGIN: f64 = 24.0;

struct Place<'a> {
    east_north: [f64; 2],
    worst: Found,
    cameras: Vec<&'a CameraVerdict>,
    site: &'a Site,
}

/// Returns the map; empty where no camera states its position.
pub(super) fn svg(fleet: &Assessment, cameras: &Cameras) -> Option<String> {
    let places = places(fleet, cameras);
    let bounds = |axis: usize| {
        let all = places.iter().map(|place| place.east_north[axis]);
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
    };
    let ((west, east), (south, north)) = (bounds(0), bounds(1));
    if !(west <= east && south <= north) {
        return None;
    }
    // Degrees of longitude are shorter than those of latitude; metres are equal.
    let is_degrees = west.abs().max(east.abs()) <= 180.0 && south.abs().max(north.abs()) <= 90.0;
    let shorter = if is_degrees { (0.5 * (south + north)).to_radians().cos().max(0.01) } else { 1.0 };
    let scale = (WIDTH - 2.0 * MARGIN) / ((east - west) * shorter).max(1e-9);
    let height = ((north - south) * scale).clamp(120.0, 1200.0) + 2.0 * MARGIN;
    let scale = scale.min((height - 2.0 * MARGIN) / (north - south).max(1e-9));
    let mut svg = format!(
        "<figure><svg viewBox=\"0 0 {WIDTH} {height:.0}\" role=\"img\" aria-label=\"map of sites\"><rect x=\"1\" y=\"1\" width=\"{}\" height=\"{:.0}\" fill=\"none\" class=\"axis\"/>",
        WIDTH - 2.0,
        height - 2.0
    );
    for place in places.iter().rev() {
        let x = MARGIN + (place.east_north[0] - west) * shorter * scale;
        let y = height - MARGIN - (place.east_north[1] - south) * scale;
        let radius = if place.worst == Found::Steady { 3.0 } else { 6.0 };
        let _ = write!(
            svg,
            "<circle class=\"{}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\"><title>{}</title></circle>",
            class(place.worst),
            escaped(&title(place))
        );
    }
    svg += "</svg><figcaption>Red: a camera moved. Ochre: wrong map. Grey: dead. Purple: clock. Blue: moves to and fro, or too few poses. Green: steady. \
            Point at a dot for its cameras.</figcaption></figure>";
    Some(svg)
}

/// Returns the positions, the most urgent first.
fn places<'a>(fleet: &'a Assessment, cameras: &'a Cameras) -> Vec<Place<'a>> {
    let mut places: BTreeMap<[u64; 2], Place> = BTreeMap::new();
    for verdict in &fleet.cameras {
        let site = cameras.number(&verdict.camera).and_then(|number| cameras.site(number));
        let Some((site, east_north)) = site.and_then(|site| Some((site, site.east_north?))) else { continue };
        let place = places.entry(east_north.map(f64::to_bits)).or_insert_with(|| Place {
            east_north,
            worst: Found::Steady,
            cameras: Vec::new(),
            site,
        });
        place.worst = place.worst.min(verdict.found);
        place.cameras.push(verdict);
    }
    let mut places: Vec<Place> = places.into_values().collect();
    places.sort_by_key(|place| place.worst);
    places
}

fn title(place: &Place) -> String {
    let mut text = place.site.name.clone();
    for verdict in &place.cameras {
        let _ = write!(text, "\n{}: {}", verdict.camera, verdict.found.name().replace('_', " "));
    }
    text
}
