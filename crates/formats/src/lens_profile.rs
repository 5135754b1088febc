//! Lens profiles of action cameras and photographers: Gyroflow's JSON and lensfun's XML; read only, lenses only.
//!
//! Gyroflow: `fisheye_params` is OpenCV's fisheye model, `calib_params` its standard one, of an image of `calib_dimension`.
//!
//! lensfun: radii are in halves of the short side of the calibration's sensor (36 × 24 mm over `cropfactor`, of `aspect-ratio`), of an image
//! undistorted and then of one distorted: poly3 r (1 − k1 + k1 r²), poly5 r (1 + k1 r² + k2 r⁴), ptlens r (1 − a − b − c + c r + b r² + a r³); acm is
//! Adobe's, in focal lengths, k1 k2 k3 p1 p2. `real-focal` is the focal length, else the nominal one times the factor of r alone (`database.cpp`,
//! `mod-coord.cpp`). The undistorted image is that of the lens's `type`: tan θ (rectilinear), θ (fisheye), 2 sin θ/2 (equisolid), 2 tan θ/2
//! (stereographic). What no model here is, is fitted by Kannala–Brandt's. The image has no pixels there: it is taken as 4000 px wide, from which a
//! camera is scaled to any image of its shape; its middle is the principal point but for `<center>`.

use super::document::{Document, Fault};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::metashape::{below, only};
use super::scalar_keys::number_of;
use super::tf::element_is;
use super::{CameraFormat, Contents, Format, NamedCamera, Reads, checks, opencv};
use crate::core::Camera;
use crate::core::camera::{CameraMatrix, ImageSize};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

pub(super) const GYROFLOW: CameraFormat = CameraFormat {
    format: Format::Gyroflow,
    words: &[],
    reads: Some(Reads {
        recognises: |document| {
            document.root.get("calib_dimension").is_some() && document.root.get("fisheye_params").is_some()
        },
        read: read_gyroflow,
        together: None,
    }),
    write: None,
    traps: &[
        "A profile belongs to one field of view, resolution and stabilisation of the camera: with stabilisation on, the lens changes from frame to frame.",
    ],
};

pub(super) const LENSFUN: CameraFormat = CameraFormat {
    format: Format::Lensfun,
    words: &[],
    reads: Some(Reads {
        recognises: |document| element_is(&document.root, "lensdatabase"),
        read: read_lensfun,
        together: None,
    }),
    write: None,
    traps: &[
        "A profile is that of the type of lens, not of one: expect a per cent of the focal length and some ten pixels of the principal point. \
            Calibrate your own for poses with a meaningful ±.",
        "Sizes are nominal (4000 px wide, with the aspect of the calibration); a camera is scaled to any image of the same shape.",
    ],
};

fn read_gyroflow(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    let flag = |key: &str| root.get(key).map_or(Ok(None), |at| at.flag().map(Some));
    let model = root.get("distortion_model").map(|model| model.text()).transpose()?;
    let is_fisheye = match model.filter(|model| !model.is_empty()) {
        Some("opencv_fisheye") => true,
        Some("opencv_standard") => false,
        Some(other) => {
            return Err(root.need("distortion_model")?.fault(format!(
                "is `{}`; opencv_fisheye and opencv_standard are read",
                other.chars().take(40).collect::<String>()
            )));
        }
        None => flag("use_opencv_fisheye")?.unwrap_or(true) || flag("use_opencv_standard")? != Some(true),
    };
    let params = root.need(if is_fisheye { "fisheye_params" } else { "calib_params" })?;
    let (k, d) = (params.need("camera_matrix")?, params.need("distortion_coeffs")?);
    let lens = match (is_fisheye, d.numbers()?.as_slice()) {
        (true, [k1, k2, k3, k4]) => LensNumbers::KannalaBrandt([*k1, *k2, *k3, *k4]),
        (true, other) => return Err(d.fault(format!("holds {} numbers; a fisheye has 4", other.len()))),
        (false, d_numbers) => opencv::brown_conrady(&d, d_numbers.to_vec())?,
    };
    let size = root.need("calib_dimension")?;
    let size = ImageSize { width_px: size.need("w")?.count(1)?, height_px: size.need("h")?.count(1)? };
    let matrix = checks::camera_matrix(&k)?;
    let camera = lens::camera(&k, &lens, matrix, Some(size), &mut contents.warnings)?;
    contents.cameras.push(NamedCamera::new(document.stem(), camera, None));
    for key in ["input_horizontal_stretch", "input_vertical_stretch"] {
        if let Some(stretch) = number_of(&root, key)?.filter(|stretch| !matches!(*stretch, 0.0 | 1.0)) {
            contents.warnings.push(format!(
                "{key} is {stretch}: the lens is that of images stretched by it, as the profile was made from"
            ));
        }
    }
    Ok(contents)
}

/// Width of the images that lensfun's cameras are given, px.
const NOMINAL_WIDTH_PX: f64 = 4000.0;
/// Diagonal of the sensor of crop factor 1, mm.
const FULL_FRAME_MM: f64 = 43.266_615_305_567_87;
/// A fit may be off by so much, of an image 4000 px wide. Of 6425 profiles in lensfun's database 98.8 % are fitted closer, half of them to 0.1 px; the
/// rest are ptlens far beyond the fields of view it is meant for.
const MAX_FIT_PX: f64 = 2.0;

fn read_lensfun(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    let (mut n_fits, mut worst_px, mut left_out) = (0, 0.0_f64, Vec::<Fault>::new());
    let mut names = BTreeMap::new();
    for lens in below(&document.entry(), "lens")? {
        let model = words(&lens, "model")?.unwrap_or("lens");
        let Some(calibration) = only(&lens, "calibration")? else { continue };
        for distortion in below(&calibration, "distortion")? {
            let read = Profile::of(&lens, &calibration, &distortion).and_then(|profile| {
                Ok((profile.nominal_mm, profile.camera(&distortion, &mut contents.warnings)?))
            });
            match read {
                Ok((nominal_mm, (camera, off_px))) => {
                    let name = free_name(&mut names, model, nominal_mm);
                    contents.cameras.push(NamedCamera::new(name, camera, None));
                    n_fits += usize::from(0.0 < off_px);
                    worst_px = worst_px.max(off_px);
                }
                Err(fault) => left_out.push(fault),
            }
        }
    }
    if 0 < n_fits {
        contents.warnings.push(format!(
            "{n_fits} of {} lenses are fitted by a Kannala–Brandt model, at most {worst_px:.2} px off (of 4000 px)",
            contents.cameras.len()
        ));
    }
    match (left_out.first(), contents.cameras.is_empty()) {
        (Some(first), true) => Err(first.clone()),
        (None, true) => Err(document.entry().fault("no lens with a <distortion>; it states no focal length")),
        (Some(first), false) => {
            let line = first.line.map_or_else(String::new, |line| format!("line {line}: "));
            let remark = format!("{} lenses are left out, the first: {line}{}", left_out.len(), first.reason);
            contents.warnings.push(remark);
            Ok(contents)
        }
        (None, false) => Ok(contents),
    }
}

/// As a name of a file, and not that of another camera; `names` has the last number given to each.
fn free_name(names: &mut BTreeMap<String, usize>, model: &str, focal_mm: f64) -> String {
    let plain = |c: char| if c.is_alphanumeric() || matches!(c, '.' | '-') { c } else { '_' };
    let stem: String = format!("{model} {focal_mm}mm").chars().take(80).map(plain).collect();
    let mut n = names.get(&stem).map_or(1, |last| last + 1);
    let name = loop {
        let name = if n == 1 { stem.clone() } else { format!("{stem}_{n}") };
        if !names.contains_key(&name) {
            break name;
        }
        n += 1;
    };
    names.insert(stem, n);
    names.entry(name.clone()).or_insert(1);
    name
}

/// The text of an element that may be missing.
fn words<'a>(at: &Entry<'a>, name: &str) -> Result<Option<&'a str>, Fault> {
    let Some(element) = only(at, name)? else { return Ok(None) };
    match element.get("text") {
        Some(text) => text.text().map(|text| Some(text.trim())),
        None => Ok(None),
    }
}

/// A number that lengths and ratios may be.
fn positive(at: &Entry<'_>, what: &str, word: &str) -> Result<f64, Fault> {
    match word.trim().parse::<f64>() {
        Ok(x) if 1e-3 < x && x < 1e5 => Ok(x),
        _ => {
            let short: String = word.chars().take(40).collect();
            Err(at.fault(format!("{what} is `{short}`; a positive number is needed")))
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Projection {
    Rectilinear,
    Equidistant,
    Equisolid,
    Stereographic,
}

impl Projection {
    /// The angle from the axis at a radius in focal lengths.
    fn angle_rad(self, r: f64) -> f64 {
        match self {
            Projection::Rectilinear => r.atan(),
            Projection::Equidistant => r,
            Projection::Equisolid => 2.0 * (0.5 * r).clamp(-1.0, 1.0).asin(),
            Projection::Stereographic => 2.0 * (0.5 * r).atan(),
        }
    }

    /// The largest radius that an angle has.
    fn reach(self) -> f64 {
        match self {
            Projection::Equisolid => 2.0,
            Projection::Equidistant => std::f64::consts::PI,
            _ => f64::INFINITY,
        }
    }
}

/// One `<distortion>`, radii in focal lengths: r (1 + c1 r + c2 r² + c3 r³ + c4 r⁴ + c6 r⁶) and the tangential pair.
struct Profile {
    projection: Projection,
    nominal_mm: f64,
    focal_mm: f64,
    /// Half the diagonal of the sensor.
    corner_mm: f64,
    aspect: f64,
    centre: [f64; 2],
    terms: [f64; 6],
    tangential: [f64; 2],
}

impl Profile {
    fn of(lens: &Entry<'_>, calibration: &Entry<'_>, distortion: &Entry<'_>) -> Result<Self, Fault> {
        let crop = match (calibration.get("@cropfactor"), words(lens, "cropfactor")?) {
            (Some(own), _) => positive(&own, "the crop factor", own.text()?)?,
            (None, Some(word)) => positive(lens, "the crop factor", word)?,
            (None, None) => {
                return Err(
                    lens.fault("<cropfactor> is missing, without which no focal length is known in pixels")
                );
            }
        };
        let aspect = match (calibration.get("@aspect-ratio"), words(lens, "aspect-ratio")?) {
            (Some(own), _) => aspect(&own, own.text()?)?,
            (None, Some(word)) => aspect(lens, word)?,
            (None, None) => 1.5,
        };
        let projection = match words(lens, "type")?.unwrap_or("rectilinear") {
            "rectilinear" => Projection::Rectilinear,
            "fisheye" => Projection::Equidistant,
            "equisolid" => Projection::Equisolid,
            "stereographic" => Projection::Stereographic,
            other => {
                let short: String = other.chars().take(40).collect();
                return Err(lens.fault(format!(
                    "<type> is `{short}`; rectilinear, fisheye, equisolid and stereographic are read"
                )));
            }
        };
        let nominal = distortion.need("@focal")?;
        let nominal_mm = positive(&nominal, "the focal length", nominal.text()?)?;
        let (alone, hugin, tangential) = terms(distortion)?;
        let focal_mm = match distortion.get("@real-focal") {
            Some(real) => positive(&real, "the focal length", real.text()?)?,
            None => nominal_mm * alone,
        };
        let corner_mm = 0.5 * FULL_FRAME_MM / crop;
        // Lensfun's radius 1 in focal lengths of the undistorted image, whose own is `focal_mm / alone`.
        let is_adobe = distortion.need("@model")?.text()? == "acm";
        let per_radius = if is_adobe { 1.0 } else { focal_mm / alone / (corner_mm / aspect.hypot(1.0)) };
        let powers = [1, 2, 3, 4, 5, 6];
        let mut terms = hugin;
        for (term, power) in terms.iter_mut().zip(powers) {
            *term *= per_radius.powi(power) / alone;
        }
        let mut centre = [0.0; 2];
        if let Some(at) = only(lens, "center")? {
            for (value, key) in centre.iter_mut().zip(["@x", "@y"]) {
                *value = attribute(&at, key)?;
            }
        }
        Ok(Profile { projection, nominal_mm, focal_mm, corner_mm, aspect, centre, terms, tangential })
    }

    /// The distorted radius of an undistorted one.
    fn distorted(&self, r: f64) -> f64 {
        let [c1, c2, c3, c4, c5, c6] = self.terms;
        r * (1.0 + r * (c1 + r * (c2 + r * (c3 + r * (c4 + r * (c5 + r * c6))))))
    }

    /// The camera, and by how many pixels it is off where it is fitted.
    fn camera(&self, at: &Entry<'_>, warnings: &mut Vec<String>) -> Result<(Camera, f64), Fault> {
        let height_px = (NOMINAL_WIDTH_PX / self.aspect).round();
        let size = ImageSize { width_px: NOMINAL_WIDTH_PX as u32, height_px: height_px as u32 };
        let per_mm = NOMINAL_WIDTH_PX.hypot(NOMINAL_WIDTH_PX / self.aspect) / (2.0 * self.corner_mm);
        let [c1, c2, c3, c4, c5, c6] = self.terms;
        let is_even = [c1, c3, c5] == [0.0; 3];
        let [p1, p2] = self.tangential;
        let (scale, numbers, off_px) = match self.projection {
            Projection::Rectilinear if is_even => {
                (1.0, opencv::brown_conrady(at, vec![c2, c4, p1, p2, c6])?, 0.0)
            }
            Projection::Equidistant if is_even && self.tangential == [0.0; 2] => {
                (1.0, LensNumbers::KannalaBrandt([c2, c4, c6, 0.0]), 0.0)
            }
            _ if self.tangential != [0.0; 2] => {
                return Err(at.fault("has tangential distortion on a fisheye, which no lens model here has"));
            }
            _ => {
                let (scale, k, off) = self
                    .fitted()
                    .ok_or_else(|| at.fault("bends back before half of its image: no lens is so"))?;
                (scale, LensNumbers::KannalaBrandt(k), off * self.focal_mm * per_mm)
            }
        };
        if !(off_px <= MAX_FIT_PX) {
            return Err(at.fault(format!(
                "is off by {off_px:.1} px of {NOMINAL_WIDTH_PX} in the nearest model here; at most {MAX_FIT_PX} px are accepted"
            )));
        }
        let f_px = scale * self.focal_mm * per_mm;
        let half = 0.5 * (height_px.min(NOMINAL_WIDTH_PX) - 1.0);
        let [cx_px, cy_px] = [(NOMINAL_WIDTH_PX, self.centre[0]), (height_px, self.centre[1])]
            .map(|(side, centre)| 0.5 * (side - 1.0) + half * centre);
        let matrix = CameraMatrix { fx_px: f_px, fy_px: f_px, cx_px, cy_px };
        let mut remarks = Vec::new();
        let camera = lens::camera(at, &numbers, matrix, Some(size), &mut remarks)?;
        warnings.extend(remarks);
        Ok((camera, off_px))
    }

    /// Kannala–Brandt's model nearest to the profile up to the corner, or as far as it does not bend back: the factor of its focal length, k1 to k4,
    /// and the largest deviation in focal lengths.
    fn fitted(&self) -> Option<(f64, [f64; 4], f64)> {
        let corner = self.corner_mm / self.focal_mm;
        let step = corner / 200.0;
        let mut end = 0.0;
        while self.distorted(end) < corner && end + step < self.projection.reach() {
            if self.distorted(end + step) <= self.distorted(end) {
                break;
            }
            end += step;
            if 50.0 * corner < end {
                return None;
            }
        }
        if !(0.5 * corner..f64::INFINITY).contains(&self.distorted(end)) {
            return None;
        }
        let radius = |i: usize, n: usize| end * (i as f64 + 1.0) / n as f64;
        let sample = |n: usize| {
            let angles = DVector::from_fn(n, |i, _| self.projection.angle_rad(radius(i, n)));
            let design = DMatrix::from_fn(n, 5, |i, j| angles[i].powi(2 * j as i32 + 1));
            (design, DVector::from_fn(n, |i, _| self.distorted(radius(i, n))))
        };
        let (design, seen) = sample(64);
        let x = design.svd(true, true).solve(&seen, 1e-12).ok()?;
        let (fine, seen) = sample(256);
        let off = (fine * &x - seen).amax();
        let is_good = 0.0 < x[0] && x.iter().all(|value| value.is_finite());
        is_good.then(|| (x[0], [1, 2, 3, 4].map(|i| x[i] / x[0]), off))
    }
}

fn attribute(at: &Entry<'_>, key: &str) -> Result<f64, Fault> {
    let Some(found) = at.get(key) else { return Ok(0.0) };
    match found.text()?.trim().parse::<f64>() {
        Ok(x) if x.abs() < 1e3 => Ok(x),
        _ => {
            let short: String = found.text()?.chars().take(40).collect();
            Err(found.fault(format!("is `{short}`; a number is needed")))
        }
    }
}

/// The factor of r alone, the factors of r², r³ … r⁷, and p1, p2.
fn terms(at: &Entry<'_>) -> Result<(f64, [f64; 6], [f64; 2]), Fault> {
    let n = |key: &str| attribute(at, key);
    let model = at.need("@model")?;
    let (alone, terms, tangential) = match model.text()? {
        "poly3" => (1.0 - n("@k1")?, [0.0, n("@k1")?, 0.0, 0.0, 0.0, 0.0], [0.0; 2]),
        "poly5" => (1.0, [0.0, n("@k1")?, 0.0, n("@k2")?, 0.0, 0.0], [0.0; 2]),
        "ptlens" => {
            let [a, b, c] = [n("@a")?, n("@b")?, n("@c")?];
            (1.0 - a - b - c, [c, b, a, 0.0, 0.0, 0.0], [0.0; 2])
        }
        "acm" => (1.0, [0.0, n("@k1")?, 0.0, n("@k2")?, 0.0, n("@k3")?], [n("@k4")?, n("@k5")?]),
        other => {
            let short: String = other.chars().take(40).collect();
            return Err(model.fault(format!("is `{short}`; poly3, poly5, ptlens and acm are read")));
        }
    };
    match 0.05 < alone {
        true => Ok((alone, terms, tangential)),
        false => Err(at.fault(format!("scales the middle of the image by {alone:.3}, which no lens does"))),
    }
}

/// `4:3` or a number.
fn aspect(at: &Entry<'_>, word: &str) -> Result<f64, Fault> {
    let parts: Vec<&str> = word.split(':').collect();
    let ratio = match parts.as_slice() {
        [w, h] => positive(at, "the aspect ratio", w)? / positive(at, "the aspect ratio", h)?,
        _ => positive(at, "the aspect ratio", word)?,
    };
    match (0.1..=10.0).contains(&ratio) {
        true => Ok(ratio),
        false => Err(at.fault(format!("an aspect ratio of {ratio}; 0.1 to 10 are accepted"))),
    }
}
