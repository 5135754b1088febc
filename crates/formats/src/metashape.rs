//! Agisoft Metashape's XML: exported cameras (`<document><chunk>`) and an exported calibration (`<calibration>`); read only.
//!
//! Metashape User Manual, appendix "Camera models": x′ = x (1 + K1 r² + K2 r⁴ + K3 r⁶ + K4 r⁸) + P1 (r² + 2 x²) + 2 P2 x y,
//! y′ = y (…) + P2 (r² + 2 y²) + 2 P1 x y, u = w / 2 + cx + x′ f + x′ B1 + y′ B2, v = h / 2 + cy + y′ f. So P1 is OpenCV's p2 and P2 its
//! p1, fx = f + B1, and B2 is a skew. The centre of the first pixel is (0.5, 0.5) there and (0, 0) here. A `fisheye` has x = X θ / ρ and
//! y = Y θ / ρ with ρ² = X² + Y² in the same polynomial: OpenCV's fisheye where P1 and P2 are zero.
//!
//! `<transform>` of a camera is chunk_from_cam, axes x right, y down, z forward. `<transform>` of the chunk rotates, scales and moves it into
//! its reference system, or that of a component; of these the scale alone is applied, so that lengths are metres where there is one. B2,
//! and K4 of a frame camera, have no counterpart here and are refused where they are not zero.

use super::document::{Document, Fault, Syntax};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::shots::{self, Shot};
use super::tf::element_is;
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks, opencv};
use crate::core::camera::ImageSize;
use crate::core::{Camera, Pose};
use nalgebra::{DMatrix, Matrix3, Vector3};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Metashape,
    words: &[],
    reads: Some(Reads {
        recognises: |document| {
            document.syntax == Syntax::Xml
                && ["document", "calibration"].iter().any(|name| element_is(&document.root, name))
        },
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "P1 and P2 are OpenCV's p2 and p1: they are exchanged here.",
        "cx and cy count from the middle of the image, b1 is fx - fy, b2 a skew.",
        "transform of a camera maps its points into the chunk (x right, y down, z forward); its last column is the camera's position.",
        "Positions are in the chunk's own axes. Metres only where the chunk has a scale; its rotation and translation into the reference \
            system (often Earth-centred, millions of metres) are not applied.",
    ],
};

const CHUNK: &str = "chunk";
/// The way out where a coefficient has no counterpart.
const FIX: &str = "fix it at zero in Metashape (Optimize Cameras) and export again";

fn read(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    if element_is(&document.root, "calibration") {
        let camera = camera(&root, None, &mut contents.warnings)?;
        contents.cameras.push(named(document.stem(), camera));
        return Ok(contents);
    }
    let chunks: Vec<Entry<'_>> = below(&root, "chunk")?;
    let chunk = match chunks.as_slice() {
        [chunk] => chunk,
        [] => return Err(root.fault("an XML document without a <chunk>; export the cameras of Metashape (File, Export, Export Cameras)")),
        many => return Err(root.fault(format!("holds {} chunks; export one", many.len()))),
    };
    let mut lenses: Vec<(String, NamedCamera)> = Vec::new();
    let sensors = only(chunk, "sensors")?.map_or(Ok(Vec::new()), |all| below(&all, "sensor"))?;
    for sensor in sensors {
        let (id, label) = (text(&sensor, "@id")?, sensor.get("@label").map_or(Ok(""), |l| l.text())?);
        let taken = lenses.iter().any(|(_, camera)| camera.name == label);
        let name = if taken || label.is_empty() { format!("{label}_{id}") } else { label.to_owned() };
        if let Some(camera) = of_sensor(&sensor, &mut contents.warnings)? {
            lenses.push((id.to_owned(), named(name, camera)));
        } else {
            contents
                .warnings
                .push(format!("sensor {name} was never calibrated (no <calibration>); it is left out"));
        }
    }
    let components = components(chunk)?;
    let all = only(chunk, "cameras")?.map_or(Ok(Vec::new()), |all| cameras(&all))?;
    let mut shots = Vec::new();
    let mut unscaled = false;
    for entry in &all {
        let Some(at) = only(entry, "transform")? else { continue };
        let component = components.of(entry)?;
        unscaled |= component.scale.is_none();
        shots.push(shot(entry, &at, component)?);
    }
    if unscaled {
        contents.warnings.push("the chunk has no scale: lengths are in a unit of its own, not metres".into());
    }
    shots::add(&mut contents, lenses, shots);
    Ok(contents)
}

/// Cameras stand in groups too.
fn cameras<'a>(at: &Entry<'a>) -> Result<Vec<Entry<'a>>, Fault> {
    let mut all = below(at, "camera")?;
    for group in below(at, "group")? {
        all.extend(below(&group, "camera")?);
    }
    Ok(all)
}

fn named(name: String, camera: Camera) -> NamedCamera {
    NamedCamera::new(name, camera, None)
}

/// Elements of a name inside one.
pub(super) fn below<'a>(at: &Entry<'a>, name: &str) -> Result<Vec<Entry<'a>>, Fault> {
    let children = at.need("children")?.items()?;
    let named = children.into_iter().filter(|child| element_is(child.node, name));
    Ok(named.map(|child| Entry::called(name, child.node)).collect())
}

pub(super) fn only<'a>(at: &Entry<'a>, name: &str) -> Result<Option<Entry<'a>>, Fault> {
    Ok(below(at, name)?.into_iter().next())
}

fn text<'a>(at: &Entry<'a>, key: &str) -> Result<&'a str, Fault> {
    at.need(key)?.text()
}

/// Numbers that an element holds, separated by blanks.
fn numbers(at: &Entry<'_>, n: usize) -> Result<Vec<f64>, Fault> {
    let words: Vec<&str> = at.get("text").map_or(Ok(""), |t| t.text())?.split_whitespace().collect();
    let numbers: Vec<f64> =
        words.iter().filter_map(|w| w.parse().ok()).filter(|x: &f64| x.is_finite()).collect();
    match numbers.len() == words.len() && numbers.len() == n {
        true => Ok(numbers),
        false => Err(at.fault(format!(
            "holds {} finite numbers of {} words; {n} are needed",
            numbers.len(),
            words.len()
        ))),
    }
}

/// The number of an element that may be missing.
fn number(at: &Entry<'_>, name: &str) -> Result<Option<f64>, Fault> {
    only(at, name)?.map(|found| Ok(numbers(&found, 1)?[0])).transpose()
}

fn count(at: &Entry<'_>, key: &str) -> Result<u32, Fault> {
    let word = text(at, key)?;
    word.parse().ok().filter(|n| 0 < *n).ok_or_else(|| {
        let short: String = word.chars().take(40).collect();
        at.fault(format!("{key} is `{short}`; a whole number of pixels is needed"))
    })
}

/// The adjusted calibration; the one before adjustment where there is no other.
fn of_sensor(sensor: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Option<Camera>, Fault> {
    let all = below(sensor, "calibration")?;
    let adjusted = all.iter().find(|c| c.get("@class").is_some_and(|class| class.text() == Ok("adjusted")));
    let Some(calibration) = adjusted.or(all.first()) else { return Ok(None) };
    let size = match only(sensor, "resolution")? {
        Some(at) => Some(ImageSize { width_px: count(&at, "@width")?, height_px: count(&at, "@height")? }),
        None => None,
    };
    camera(calibration, size, warnings).map(Some)
}

fn camera(at: &Entry<'_>, size: Option<ImageSize>, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    let size = match (only(at, "resolution")?, number(at, "width")?, number(at, "height")?, size) {
        (Some(stated), ..) => {
            ImageSize { width_px: count(&stated, "@width")?, height_px: count(&stated, "@height")? }
        }
        (None, Some(w), Some(h), _) => ImageSize { width_px: whole(at, w)?, height_px: whole(at, h)? },
        (None, _, _, Some(size)) => size,
        _ => return Err(at.fault("states no size of its images (<resolution>, or <width> and <height>)")),
    };
    let value = |name: &str| Ok(number(at, name)?.unwrap_or(0.0));
    let f = number(at, "f")?.ok_or_else(|| at.fault("<f> is missing"))?;
    let (b1, b2) = (value("b1")?, value("b2")?);
    let middle = |side: u32, offset: f64| f64::from(side) / 2.0 + offset - 0.5;
    let (cx_px, cy_px) = (middle(size.width_px, value("cx")?), middle(size.height_px, value("cy")?));
    let k = checks::without_skew(at, &Matrix3::new(f + b1, b2, cx_px, 0.0, f, cy_px, 0.0, 0.0, 1.0))
        .map_err(|fault| Fault { reason: format!("{} (b2; {FIX})", fault.reason), ..fault })?;
    let lens = lens_numbers(at)?;
    lens::camera(at, &lens, k, Some(size), warnings)
}

fn whole(at: &Entry<'_>, x: f64) -> Result<u32, Fault> {
    match x.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&x) {
        true => Ok(x as u32),
        false => Err(at.fault(format!("has a side of {x} px; a whole number is needed"))),
    }
}

fn lens_numbers(at: &Entry<'_>) -> Result<LensNumbers, Fault> {
    let value = |name: &str| Ok(number(at, name)?.unwrap_or(0.0));
    let [k1, k2, k3, k4] = [value("k1")?, value("k2")?, value("k3")?, value("k4")?];
    let (p1, p2) = (value("p1")?, value("p2")?);
    for name in ["p3", "p4"] {
        refuse(at, name, value(name)?)?;
    }
    let stated = at.get("@type").map(|t| t.text()).transpose()?;
    let projection = match (stated, only(at, "projection")?) {
        (Some(word), _) => word,
        (None, Some(element)) => text(&element, "text")?.trim(),
        (None, None) => "frame",
    };
    match projection {
        "frame" => {
            refuse(at, "k4", k4)?;
            let count = if k3 == 0.0 { 4 } else { 5 };
            opencv::brown_conrady(at, [k1, k2, p2, p1, k3][..count].to_vec())
        }
        "fisheye" | "equidistant_fisheye" => {
            refuse(at, "p1", p1)?;
            refuse(at, "p2", p2)?;
            Ok(LensNumbers::KannalaBrandt([k1, k2, k3, k4]))
        }
        other => Err(at.fault(format!("type `{other}` is not supported; frame and fisheye are read"))),
    }
}

fn refuse(at: &Entry<'_>, name: &str, value: f64) -> Result<(), Fault> {
    match value == 0.0 {
        true => Ok(()),
        false => Err(at.fault(format!("{name} is {value}, which no lens model here has; {FIX}"))),
    }
}

/// Cameras that were aligned together, and metres to one of their units.
struct Component {
    id: String,
    frame: String,
    scale: Option<f64>,
}

struct Components(Vec<Component>);

/// Version 2 states a transform for each component; before, one for the chunk.
fn components(chunk: &Entry<'_>) -> Result<Components, Fault> {
    let all = only(chunk, "components")?.map_or(Ok(Vec::new()), |all| below(&all, "component"))?;
    let of_chunk = scale(chunk)?;
    let mut components = Vec::new();
    for entry in &all {
        let id = text(entry, "@id")?.to_owned();
        let frame = if all.len() == 1 { CHUNK.to_owned() } else { format!("component_{id}") };
        components.push(Component { id, frame, scale: scale(entry)?.or(of_chunk) });
    }
    if components.is_empty() {
        components.push(Component { id: String::new(), frame: CHUNK.to_owned(), scale: of_chunk });
    }
    Ok(Components(components))
}

impl Components {
    /// Where the camera stands; a file of one component need not say so.
    fn of(&self, camera: &Entry<'_>) -> Result<&Component, Fault> {
        let id = camera.get("@component_id").map(|id| id.text()).transpose()?;
        match (self.0.as_slice(), id) {
            ([only], _) => Ok(only),
            (many, Some(id)) => many
                .iter()
                .find(|component| component.id == id)
                .ok_or_else(|| camera.fault(format!("component_id {id} is no component of the file"))),
            (many, None) => Err(camera.fault(format!("states none of {} components", many.len()))),
        }
    }
}

fn scale(at: &Entry<'_>) -> Result<Option<f64>, Fault> {
    let Some(transform) = only(at, "transform")? else { return Ok(None) };
    match number(&transform, "scale")? {
        Some(scale) if scale <= 0.0 => {
            Err(transform.fault(format!("has scale {scale}; a positive number is needed")))
        }
        scale => Ok(scale),
    }
}

fn shot(entry: &Entry<'_>, at: &Entry<'_>, component: &Component) -> Result<Shot, Fault> {
    let m = DMatrix::from_row_slice(4, 4, &numbers(at, 16)?);
    let r = checks::rotation(at, &Matrix3::from_fn(|i, j| m[(i, j)]))?;
    let scale = component.scale.unwrap_or(1.0);
    let b_from_a = Pose::new(r, scale * Vector3::new(m[(0, 3)], m[(1, 3)], m[(2, 3)]));
    let name = text(entry, "@label")?.to_owned();
    let placement = Placement { b: component.frame.clone(), a: name.clone(), b_from_a, covariance: None };
    Ok(Shot { lens: text(entry, "@sensor_id")?.to_owned(), name, placement })
}
