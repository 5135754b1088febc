//! Cameras, points and footprints as features of a map: GeoJSON (RFC 7946) and KML 2.2.

use super::earth::{Geographic, LocalFrame};
use super::footprint::footprint;
use crate::Error;
use crate::answer::georeference::GeoreferencedPose;
use crate::answer::pose::PoseAnswer;
use crate::core::{Camera, Point};
use serde_json::{Map, Value, json};
use std::fmt::Write;

/// The limit of a footprint is at least this, m, where none is stated.
const LIMIT_M: f64 = 1000.0;
/// … and so many times the camera's height over the ground.
const LIMIT_HEIGHTS: f64 = 10.0;

/// The ground on which footprints lie.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ground {
    /// Its height, in the heights of the points, m; by default the mean height of the view's points.
    pub height_m: Option<f64>,
    /// How far from the camera a footprint reaches at most, m; by default 1000 m or ten times the camera's height, whichever is more.
    pub limit_m: Option<f64>,
}

/// Features of a map, in WGS 84.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Features {
    list: Vec<Feature>,
    /// What has no feature, and why.
    pub remarks: Vec<String>,
}

#[derive(Debug, Clone, PartialEq)]
struct Feature {
    name: String,
    /// `camera`, `footprint` or `point`.
    kind: &'static str,
    shape: Shape,
    properties: Map<String, Value>,
    camera: Option<GeoreferencedPose>,
}

#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Point(Geographic),
    /// Rings, counter-clockwise, not closed.
    Polygons(Vec<Vec<Geographic>>),
}

/// A point in the local frame, with its name and standard deviation.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPosition {
    /// Its name.
    pub name: String,
    /// Position in the local frame.
    pub x_in_local: Point,
    /// Standard deviations towards the east, the north and upwards, m, where known.
    pub sigma_m: Option<[f64; 3]>,
}

/// Returns the frame, where its points have latitudes and longitudes.
///
/// # Errors
/// Points without a place on the Earth, with what to state.
pub fn on_earth(frame: Option<&LocalFrame>) -> Result<&LocalFrame, Error> {
    match frame {
        Some(frame) if frame.origin().is_some() => Ok(frame),
        Some(frame) => Err(Error::request(format!(
            "GeoJSON and KML have latitudes and longitudes, which are unknown for easting and northing of `{}`; state a UTM zone (column zone or --crs EPSG:32633), or give lat_deg,lon_deg,height_m",
            frame.system
        ))),
        None => Err(Error::request(
            "GeoJSON and KML need points on the Earth: columns lat_deg,lon_deg,height_m or easting_m,northing_m,height_m instead of x_m,y_m,z_m",
        )),
    }
}

impl Features {
    /// Adds the camera of an answer, where it has a pose, and the ground that its image shows. `points` are the view's points, whose mean height
    /// is the ground's where none is stated.
    ///
    /// # Errors
    /// A frame without a place on the Earth.
    pub fn add_view(
        &mut self,
        frame: &LocalFrame,
        answer: &PoseAnswer,
        points: &[Point],
        camera: Option<&Camera>,
        ground: &Ground,
    ) -> Result<(), Error> {
        let origin = on_earth(Some(frame))?.origin().map_or(0.0, |at| at.height_m);
        let (Some(estimate), Some(pose)) = (&answer.estimate, &answer.georeference) else {
            self.remarks.push(format!("view {}: {}", answer.view, answer.verdict.message));
            return Ok(());
        };
        let place = frame.geographic(&estimate.cam_from_target.origin());
        let mut properties = pose_properties(pose);
        properties.insert("status".into(), answer.status().name().into());
        self.push(&answer.view, "camera", place.map(Shape::Point), properties, Some(pose.clone()));
        let Some(camera) = camera else { return Ok(()) };
        let mean_z_m = points.iter().map(|x| x.z).sum::<f64>() / points.len().max(1) as f64;
        let z_m = ground.height_m.map_or(mean_z_m, |height| height - origin);
        let over_ground_m = (estimate.cam_from_target.origin().z - z_m).abs();
        let limit_m = ground.limit_m.unwrap_or_else(|| LIMIT_M.max(LIMIT_HEIGHTS * over_ground_m));
        match footprint(camera, &estimate.cam_from_target, z_m, limit_m) {
            Err(reason) => self.remarks.push(format!("view {}: no footprint: {reason}", answer.view)),
            Ok(found) => {
                let rings =
                    found.rings.iter().map(|ring| ring.iter().filter_map(|x| frame.geographic(x)).collect());
                let mut properties = Map::new();
                properties.insert("ground_height_m".into(), rounded(origin + z_m, 3));
                properties.insert("limit_m".into(), rounded(found.limit_m, 3));
                properties.insert("is_limited".into(), found.is_limited.into());
                self.push(
                    &answer.view,
                    "footprint",
                    Some(Shape::Polygons(rings.collect())),
                    properties,
                    None,
                );
            }
        }
        Ok(())
    }

    /// Adds points.
    ///
    /// # Errors
    /// A frame without a place on the Earth.
    pub fn add_points(
        &mut self,
        frame: &LocalFrame,
        points: impl IntoIterator<Item = NamedPosition>,
    ) -> Result<(), Error> {
        on_earth(Some(frame))?;
        for point in points {
            let place = frame.geographic(&point.x_in_local);
            let mut properties = Map::new();
            for (key, sigma_m) in SIGMAS.into_iter().zip(point.sigma_m.into_iter().flatten()) {
                properties.insert(key.into(), rounded(sigma_m, 5));
            }
            self.push(&point.name, "point", place.map(Shape::Point), properties, None);
        }
        Ok(())
    }

    /// Adds the camera of a photograph without a footprint.
    pub fn add_camera(&mut self, name: &str, pose: &GeoreferencedPose) {
        let place = pose.lat_deg.zip(pose.lon_deg);
        let place = place.map(|(lat_deg, lon_deg)| Geographic { lat_deg, lon_deg, height_m: pose.height_m });
        self.push(name, "camera", place.map(Shape::Point), pose_properties(pose), Some(pose.clone()));
    }

    fn push(
        &mut self,
        name: &str,
        kind: &'static str,
        shape: Option<Shape>,
        properties: Map<String, Value>,
        camera: Option<GeoreferencedPose>,
    ) {
        let Some(shape) = shape else { return };
        self.list.push(Feature { name: name.to_string(), kind, shape, properties, camera });
    }

    /// Writes a FeatureCollection of RFC 7946: longitude, latitude, height; rings closed and counter-clockwise, cut at the antimeridian.
    pub fn geojson(&self) -> String {
        let feature = |feature: &Feature| {
            let mut properties = Map::new();
            properties.insert("name".into(), feature.name.clone().into());
            properties.insert("kind".into(), feature.kind.into());
            properties.extend(feature.properties.clone());
            let geometry = match &feature.shape {
                Shape::Point(at) => json!({ "type": "Point", "coordinates": position(at) }),
                Shape::Polygons(rings) => {
                    let rings: Vec<Vec<Value>> =
                        rings.iter().flat_map(|ring| cut(ring)).map(|ring| closed(&ring)).collect();
                    match <[Vec<Value>; 1]>::try_from(rings) {
                        Ok([ring]) => json!({ "type": "Polygon", "coordinates": [ring] }),
                        Err(rings) => {
                            let polygons: Vec<[Vec<Value>; 1]> =
                                rings.into_iter().map(|ring| [ring]).collect();
                            json!({ "type": "MultiPolygon", "coordinates": polygons })
                        }
                    }
                }
            };
            json!({ "type": "Feature", "geometry": geometry, "properties": properties })
        };
        let features: Vec<String> = self.list.iter().map(|f| feature(f).to_string()).collect();
        format!("{{\"type\":\"FeatureCollection\",\"features\":[\n{}\n]}}\n", features.join(",\n"))
    }

    /// Writes KML 2.2: placemarks, those of cameras with the view of the camera.
    pub fn kml(&self) -> String {
        let mut out = String::from(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml xmlns=\"http://www.opengis.net/kml/2.2\">\n<Document>\n",
        );
        for feature in &self.list {
            // Writing to a String cannot fail.
            let _ = write!(out, "<Placemark><name>{}</name>", escaped(&feature.name));
            out += &feature.camera.as_ref().and_then(kml_camera).unwrap_or_default();
            let _ = write!(out, "<ExtendedData><Data name=\"kind\"><value>{}</value></Data>", feature.kind);
            for (key, value) in &feature.properties {
                let text = value.as_str().map_or_else(|| value.to_string(), str::to_string);
                let _ = write!(out, "<Data name=\"{key}\"><value>{}</value></Data>", escaped(&text));
            }
            out += "</ExtendedData>";
            match &feature.shape {
                Shape::Point(at) => {
                    let _ = write!(
                        out,
                        "<Point><altitudeMode>absolute</altitudeMode><coordinates>{}</coordinates></Point>",
                        kml_position(at)
                    );
                }
                Shape::Polygons(rings) => {
                    out += "<MultiGeometry>";
                    for ring in rings.iter().flat_map(|ring| cut(ring)) {
                        let corners: Vec<String> =
                            ring.iter().chain(ring.first()).map(kml_position).collect();
                        let _ = write!(
                            out,
                            "<Polygon><outerBoundaryIs><LinearRing><coordinates>{}</coordinates></LinearRing></outerBoundaryIs></Polygon>",
                            corners.join(" ")
                        );
                    }
                    out += "</MultiGeometry>";
                }
            }
            out += "</Placemark>\n";
        }
        out + "</Document>\n</kml>\n"
    }
}

const SIGMAS: [&str; 3] = ["east_sigma_m", "north_sigma_m", "height_sigma_m"];

/// Degrees in properties, because programs for maps show and turn symbols by degrees.
fn pose_properties(pose: &GeoreferencedPose) -> Map<String, Value> {
    let degrees = |x: Option<f64>| x.map_or(Value::Null, |x| rounded(x.to_degrees(), 6));
    let metres = |x: f64| rounded(x, 5);
    let entries = [
        (SIGMAS[0], metres(pose.east_sigma_m)),
        (SIGMAS[1], metres(pose.north_sigma_m)),
        (SIGMAS[2], metres(pose.height_sigma_m)),
        ("heading_deg", degrees(pose.heading_rad)),
        ("heading_sigma_deg", degrees(pose.heading_sigma_rad)),
        ("tilt_deg", degrees(Some(pose.tilt_rad))),
        ("tilt_sigma_deg", degrees(Some(pose.tilt_sigma_rad))),
        ("roll_deg", degrees(pose.roll_rad)),
        ("roll_sigma_deg", degrees(pose.roll_sigma_rad)),
        ("image_up_heading_deg", degrees(pose.image_up_heading_rad)),
    ];
    entries.into_iter().map(|(key, value)| (key.to_string(), value)).collect()
}

fn rounded(x: f64, decimals: i32) -> Value {
    let scale = 10_f64.powi(decimals);
    // Adding zero removes the sign of −0.
    ((x * scale).round() / scale + 0.0).into()
}

/// Longitude and latitude to 0.1 mm, height to 0.1 mm.
fn position(at: &Geographic) -> Value {
    json!([rounded(within_180(at.lon_deg), 9), rounded(at.lat_deg, 9), rounded(at.height_m, 4)])
}

/// Keeps 180 as it is: a ring that is cut there ends there.
fn within_180(lon_deg: f64) -> f64 {
    if (-180.0..=180.0).contains(&lon_deg) { lon_deg } else { (lon_deg + 180.0).rem_euclid(360.0) - 180.0 }
}

fn closed(ring: &[Geographic]) -> Vec<Value> {
    ring.iter().chain(ring.first()).map(position).collect()
}

/// Cuts a ring at the antimeridian, RFC 7946 section 3.1.9.
fn cut(ring: &[Geographic]) -> Vec<Vec<Geographic>> {
    let Some(first) = ring.first() else { return Vec::new() };
    let unwrapped: Vec<Geographic> = ring
        .iter()
        .map(|at| Geographic { lon_deg: first.lon_deg + within_180(at.lon_deg - first.lon_deg), ..*at })
        .collect();
    [-360.0, 0.0, 360.0]
        .into_iter()
        .map(|shift| {
            let shifted =
                unwrapped.iter().map(|at| Geographic { lon_deg: at.lon_deg + shift, ..*at }).collect();
            clip(&clip(&shifted, 1.0), -1.0)
        })
        .filter(|part| 2 < part.len())
        .collect()
}

/// Keeps what has side · longitude ≤ 180 (Sutherland and Hodgman).
#[allow(clippy::ptr_arg)] // Both calls have a list.
fn clip(ring: &Vec<Geographic>, side: f64) -> Vec<Geographic> {
    let over = |at: &Geographic| side * at.lon_deg - 180.0;
    let mut kept = Vec::with_capacity(ring.len() + 2);
    for (i, b) in ring.iter().enumerate() {
        let a = &ring[(i + ring.len() - 1) % ring.len()];
        if (over(a) <= 0.0) != (over(b) <= 0.0) {
            let part = over(a) / (over(a) - over(b));
            kept.push(Geographic {
                lat_deg: a.lat_deg + part * (b.lat_deg - a.lat_deg),
                lon_deg: side * 180.0,
                height_m: a.height_m + part * (b.height_m - a.height_m),
            });
        }
        if over(b) <= 0.0 {
            kept.push(*b);
        }
    }
    kept
}

fn kml_position(at: &Geographic) -> String {
    format!("{:.9},{:.9},{:.4}", within_180(at.lon_deg), at.lat_deg, at.height_m)
}

/// KML tilts from straight down, and rolls anticlockwise as seen from behind the camera.
fn kml_camera(pose: &GeoreferencedPose) -> Option<String> {
    let (lat, lon) = pose.lat_deg.zip(pose.lon_deg)?;
    // Of a camera that looks straight down only the direction of the image's top is determined.
    let (heading, roll) = match (pose.heading_rad, pose.roll_rad) {
        (Some(heading), Some(roll)) => (heading, roll),
        _ => (pose.image_up_heading_rad?, 0.0),
    };
    Some(format!(
        "<Camera><longitude>{:.9}</longitude><latitude>{lat:.9}</latitude><altitude>{:.4}</altitude><heading>{:.6}</heading><tilt>{:.6}</tilt><roll>{:.6}</roll><altitudeMode>absolute</altitudeMode></Camera>",
        within_180(lon),
        pose.height_m,
        heading.to_degrees(),
        90.0 - pose.tilt_rad.to_degrees(),
        -roll.to_degrees()
    ))
}

fn escaped(text: &str) -> String {
    let is_allowed = |c: &char| !c.is_control() || matches!(c, '\t' | '\n' | '\r');
    let text: String = text.chars().filter(is_allowed).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(lat_deg: f64, lon_deg: f64) -> Geographic {
        Geographic { lat_deg, lon_deg, height_m: 1.0 }
    }

    #[test]
    fn a_ring_across_the_antimeridian_is_two() {
        let ring = [at(0.0, 179.9), at(0.0, -179.8), at(0.1, -179.8), at(0.1, 179.9)];
        let parts = cut(&ring);
        assert_eq!(parts.len(), 2);
        for part in &parts {
            assert!(part.iter().all(|x| (-180.0..=180.0).contains(&x.lon_deg)), "{part:?}");
            assert!(part.iter().any(|x| x.lon_deg.abs() == 180.0));
        }
        assert_eq!(cut(&[at(0.0, 10.0), at(0.0, 11.0), at(1.0, 11.0)]).len(), 1);
    }

    #[test]
    fn names_are_escaped() {
        let mut features = Features::default();
        let frame = LocalFrame::at(super::super::CoordinateSystem::Geographic, at(52.5, 13.4));
        let name = "a <b> & \"c\"\u{1}".to_string();
        let point = NamedPosition { name, x_in_local: Point::zeros(), sigma_m: None };
        features.add_points(&frame, [point]).expect("on the Earth");
        let kml = features.kml();
        let read = roxmltree::Document::parse(&kml).expect("XML");
        let name = read.descendants().find(|n| n.has_tag_name("name")).and_then(|n| n.text());
        assert_eq!(name, Some("a <b> & \"c\""));
        let json: Value = serde_json::from_str(&features.geojson()).expect("JSON");
        assert_eq!(json["features"][0]["geometry"]["coordinates"], json!([13.4, 52.5, 1.0]));
    }
}
