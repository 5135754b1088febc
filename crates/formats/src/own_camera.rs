//! Our own camera file: TOML, every key with its unit; one camera at the top level or several as `[[camera]]`.
//!
//! ```toml
//! [[camera]]
//! name = "right"
//! model = "brown_conrady"
//! …
//! intrinsics_covariance = [[0.4], [0.4, 0.4], …]  # lower triangle; order: fx_px, fy_px, cx_px, cy_px, then the lens's own, as `distortion` has them
//! # or, where the errors are independent, by name: intrinsics_sigma = { fx_px = 0.6, fy_px = 0.6 }
//! [camera.placement]      # x_in_b = b_from_a · x_in_a
//! b = "right"
//! a = "left"
//! rotation_wxyz = [1.0, 0.0, 0.0, 0.0]
//! translation_m = [-0.12, 0.0, 0.0]
//!
//! [[relation]]            # between frames of no camera, with the keys of a placement
//! b = "left"
//! …
//!
//! # Before all tables:
//! status = "inconsistent" # or "ok", "implausible"; of the rig whose places these are
//! status_message = "…"    # what contradicts, or which size hardly exists
//!
//! [joint_covariance]      # of the cameras' places together
//! cameras = ["right", "top"]
//! lower = [[…], …]        # row i has its first i + 1 numbers; 6 rows a camera
//! noise_degrees_of_freedom = 9  # where the noise was estimated from so many redundant numbers
//! ```

use super::document::{Document, Fault, Syntax};
use super::emit::{list, number, quoted};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{
    CameraFile, CameraFormat, ClockOffset, Contents, Format, JointCovariance, NamedCamera, OutFile,
    Placement, Reads, WriteError, Writer, Written, checks,
};
use crate::core::camera::{CameraMatrix, ImageSize, PhotogrammetricParameters};
use crate::core::covariance::is_covariance;
use crate::core::{Camera, Lens, Matrix6};
use crate::input::nearest;
use nalgebra::{DMatrix, DVector, RowVector6};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Own,
    words: &["resight", "toml", "own"],
    reads: Some(Reads {
        recognises: |document| {
            let root = document.entry();
            document.syntax == Syntax::Toml
                && ["model", "camera", "fx_px", "relation"].iter().any(|key| root.has(key))
        },
        read,
        together: None,
    }),
    write: Some(Writer::Rig(write)),
    traps: &[],
};

const MODELS: [&str; 8] =
    ["pinhole", "brown_conrady", "kannala_brandt", "photogrammetric", "omni", "double_sphere", "eucm", "fov"];
const COMMON: [&str; 6] =
    ["name", "model", "placement", "clock", "intrinsics_covariance", "intrinsics_sigma"];
const MATRIX: [&str; 6] = ["width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px"];

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    if !root.has("camera") && !root.has("relation") {
        let camera = one_camera(&root, Some(document.stem()), &mut contents.warnings)?;
        contents.clocks.extend(root.get("clock").map(|c| clock(&c, &camera.name)).transpose()?);
        contents.cameras.push(camera);
        return Ok(contents);
    }
    root.only(&["camera", "relation", "joint_covariance", "status", "status_message"])?;
    contents.contradiction = contradiction(&root, &mut contents.warnings)?;
    for entry in root.get("camera").map_or(Ok(Vec::new()), |cameras| cameras.items())? {
        let camera = one_camera(&entry, None, &mut contents.warnings)?;
        contents.clocks.extend(entry.get("clock").map(|c| clock(&c, &camera.name)).transpose()?);
        contents.cameras.push(camera);
    }
    if let Some(relations) = root.get("relation") {
        contents.relations = relations.items()?.iter().map(placement).collect::<Result<_, _>>()?;
    }
    contents.joint = root.get("joint_covariance").map(|joint| joint_covariance(&joint)).transpose()?;
    Ok(contents)
}

/// What the file states to contradict in its rig; a size that hardly exists becomes a warning.
fn contradiction(root: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Option<String>, Fault> {
    let message = root.get("status_message").map(|m| m.text().map(str::to_owned)).transpose()?;
    let Some(status) = root.get("status") else { return Ok(None) };
    let message = || message.unwrap_or_else(|| "no reason is stated".to_owned());
    match status.text()? {
        "ok" => Ok(None),
        "inconsistent" => Ok(Some(message())),
        "implausible" => {
            warnings.push(format!("the lengths of this rig are implausible: {}", message()));
            Ok(None)
        }
        other => Err(status.fault(format!("is `{other}`; a rig is `ok`, `inconsistent` or `implausible`"))),
    }
}

/// The keys by which a file states its rig's status, and why it is not `ok`; they stand before all tables.
pub fn status_keys(status: &str, why: Option<&str>) -> String {
    match why {
        Some(reason) => {
            let reason = quoted(&reason.replace('\n', " "));
            format!("status = \"{status}\" # no place in this file is reliable\nstatus_message = {reason}\n")
        }
        None => format!("status = \"{status}\"\n"),
    }
}

fn one_camera(
    entry: &Entry<'_>,
    stem: Option<String>,
    warnings: &mut Vec<String>,
) -> Result<NamedCamera, Fault> {
    let name = match (entry.get("name"), stem) {
        (Some(name), _) => name.text()?.to_owned(),
        (None, Some(stem)) => stem,
        (None, None) => {
            return Err(entry.fault("the key `name` is missing; several cameras are distinguished by it"));
        }
    };
    let camera = lens_of(entry, warnings)?;
    let placement = entry.get("placement").map(|p| placement(&p)).transpose()?;
    let intrinsics_covariance = intrinsics_covariance(entry, &camera)?;
    Ok(NamedCamera { name, camera, placement, intrinsics_covariance })
}

/// How well the file knows the intrinsics: a lower triangle, or standard deviations by name.
fn intrinsics_covariance(entry: &Entry<'_>, camera: &Camera) -> Result<Option<DMatrix<f64>>, Fault> {
    match (entry.get("intrinsics_covariance"), entry.get("intrinsics_sigma")) {
        (Some(rows), None) => {
            let names: Vec<&str> = camera.parameters().iter().map(|(name, _)| *name).collect();
            let covariance =
                lower_triangle(&rows, names.len(), &format!("one a parameter: {}", names.join(", ")))?;
            if !is_covariance(&covariance) {
                return Err(rows.fault("is no covariance: a direction has a negative variance"));
            }
            Ok(Some(covariance))
        }
        (None, Some(sigmas)) => {
            let parameters = camera.parameters();
            sigmas.only(&parameters.iter().map(|(name, _)| *name).collect::<Vec<_>>())?;
            let variance = |(name, _): &(&str, f64)| -> Result<f64, Fault> {
                let Some(sigma) = sigmas.get(name) else { return Ok(0.0) };
                match sigma.number()? {
                    s if 0.0 <= s => Ok(s * s),
                    s => Err(sigma.fault(format!("is {s}; a standard deviation is not negative"))),
                }
            };
            let variances: Vec<f64> = parameters.iter().map(variance).collect::<Result<_, _>>()?;
            Ok(Some(DMatrix::from_diagonal(&DVector::from_vec(variances))))
        }
        (None, None) => Ok(None),
        (Some(_), Some(sigmas)) => {
            Err(sigmas.fault("and intrinsics_covariance state the same; remove one of them"))
        }
    }
}

/// A symmetric matrix of which row i states its first i + 1 numbers.
fn lower_triangle(entry: &Entry<'_>, n: usize, meaning: &str) -> Result<DMatrix<f64>, Fault> {
    let rows = entry.items()?;
    if rows.len() != n {
        return Err(entry.fault(format!("holds {} rows; {n} are needed ({meaning})", rows.len())));
    }
    let mut matrix = DMatrix::zeros(n, n);
    for (i, row) in rows.iter().enumerate() {
        for (j, value) in row.exactly(i + 1, "covariances")?.into_iter().enumerate() {
            matrix[(i, j)] = value;
            matrix[(j, i)] = value;
        }
    }
    Ok(matrix)
}

fn lens_of(entry: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    let model = entry.need("model")?;
    let word = model.text()?;
    let own_keys: &[&str] = match word {
        "photogrammetric" => return photogrammetric(entry, warnings),
        "pinhole" => &["distortion"],
        "brown_conrady" | "kannala_brandt" => &["distortion"],
        "omni" => &["xi", "distortion"],
        "double_sphere" => &["xi", "alpha"],
        "eucm" => &["alpha", "beta"],
        "fov" => &["w_rad"],
        other => return Err(model.fault(unknown_model(other))),
    };
    entry.only(&[&COMMON[..], &MATRIX[..], own_keys].concat())?;
    let get = |key: &str| entry.need(key)?.number();
    let matrix = CameraMatrix {
        fx_px: get("fx_px")?,
        fy_px: get("fy_px")?,
        cx_px: get("cx_px")?,
        cy_px: get("cy_px")?,
    };
    let size = ImageSize {
        width_px: entry.need("width_px")?.count(1)?,
        height_px: entry.need("height_px")?.count(1)?,
    };
    let numbers = lens_numbers(entry, word)?;
    lens::camera(entry, &numbers, matrix, Some(size), warnings)
}

fn unknown_model(word: &str) -> String {
    let known = || nearest(word, MODELS.iter().map(|model| model.to_string()));
    let suggestion = match word {
        "fisheye" | "equidistant" | "kb4" => Some("kannala_brandt".to_owned()),
        "opencv" | "plumb_bob" | "radtan" | "rational_polynomial" => Some("brown_conrady".to_owned()),
        "ds" => Some("double_sphere".to_owned()),
        _ => known(),
    };
    match suggestion {
        Some(right) => format!("unknown model `{word}`; did you mean `{right}`?"),
        None => format!("unknown model `{word}`; the models are {}", MODELS.join(", ")),
    }
}

fn lens_numbers(entry: &Entry<'_>, model: &str) -> Result<LensNumbers, Fault> {
    let get = |key: &str| entry.need(key)?.number();
    let four = |distortion: &Entry<'_>| {
        <[f64; 4]>::try_from(distortion.numbers()?)
            .map_err(|d| distortion.fault(format!("holds {} coefficients; {model} takes 4", d.len())))
    };
    Ok(match model {
        "brown_conrady" => {
            let distortion = entry.need("distortion")?;
            let d = distortion.numbers()?;
            if ![4, 5, 8, 12, 14].contains(&d.len()) {
                let n = d.len();
                return Err(distortion
                    .fault(format!("holds {n} coefficients; brown_conrady takes 4, 5, 8, 12 or 14")));
            }
            LensNumbers::BrownConrady(d)
        }
        "kannala_brandt" => LensNumbers::KannalaBrandt(four(&entry.need("distortion")?)?),
        "omni" => {
            let k1k2p1p2 = entry.get("distortion").map_or(Ok([0.0; 4]), |d| four(&d))?;
            LensNumbers::Omni { xi: get("xi")?, k1k2p1p2 }
        }
        "double_sphere" => LensNumbers::DoubleSphere { xi: get("xi")?, alpha: get("alpha")? },
        "eucm" => LensNumbers::Eucm { alpha: get("alpha")?, beta: get("beta")? },
        "fov" => LensNumbers::Fov { w_rad: get("w_rad")? },
        _ => {
            if let Some(d) =
                entry.get("distortion").filter(|d| d.numbers().is_ok_and(|d| d.iter().any(|x| *x != 0.0)))
            {
                return Err(d.fault(
                    "has coefficients, but model = \"pinhole\" has none; write model = \"brown_conrady\"",
                ));
            }
            LensNumbers::Pinhole
        }
    })
}

/// Lengths in one unit, that of f; so no image size.
fn photogrammetric(entry: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    entry.only(&[&COMMON[..], &["f", "xp", "yp", "k", "p", "a"]].concat())?;
    let get = |key: &str| entry.need(key)?.number();
    fn fixed<const N: usize>(entry: &Entry<'_>, key: &str) -> Result<[f64; N], Fault> {
        let Some(found) = entry.get(key) else { return Ok([0.0; N]) };
        <[f64; N]>::try_from(found.numbers()?)
            .map_err(|v| found.fault(format!("holds {} numbers; {N} are needed", v.len())))
    }
    let table = PhotogrammetricParameters {
        f: get("f")?,
        xp: get("xp")?,
        yp: get("yp")?,
        k: fixed(entry, "k")?,
        p: fixed(entry, "p")?,
        a: fixed(entry, "a")?,
    };
    let unused = CameraMatrix { fx_px: 1.0, fy_px: 1.0, cx_px: 0.0, cy_px: 0.0 };
    lens::camera(entry, &LensNumbers::Photogrammetric(table), unused, None, warnings)
}

fn placement(entry: &Entry<'_>) -> Result<Placement, Fault> {
    entry.only(&["b", "a", "rotation_wxyz", "translation_m", "covariance"])?;
    let rotation = entry.need("rotation_wxyz")?;
    let q = rotation.exactly(4, "w, x, y, z")?;
    let translation = checks::vector3(&entry.need("translation_m")?)?;
    let b_from_a = checks::quaternion_pose(&rotation, [q[0], q[1], q[2], q[3]], translation)?;
    let (b, a) = (entry.need("b")?.text()?.to_owned(), entry.need("a")?.text()?.to_owned());
    let covariance = entry.get("covariance").map(|c| covariance(&c)).transpose()?;
    Ok(Placement { b, a, b_from_a, covariance })
}

/// `{ reference, offset_s }`: time of the reference = the camera's time stamp + offset.
fn clock(entry: &Entry<'_>, camera: &str) -> Result<ClockOffset, Fault> {
    entry.only(&["reference", "offset_s"])?;
    Ok(ClockOffset {
        camera: camera.to_owned(),
        reference: entry.need("reference")?.text()?.to_owned(),
        offset_s: entry.need("offset_s")?.number()?,
    })
}

/// Six rows of six numbers, `[rotation_rad; translation_m]`, frame b.
fn covariance(entry: &Entry<'_>) -> Result<Matrix6, Fault> {
    let rows = entry.items()?;
    if rows.len() != 6 {
        return Err(entry.fault(format!("holds {} rows; a covariance of a pose has 6", rows.len())));
    }
    let mut matrix = Matrix6::zeros();
    for (i, row) in rows.iter().enumerate() {
        matrix.set_row(i, &RowVector6::from_row_slice(&row.exactly(6, "covariances")?));
    }
    let defect = (matrix - matrix.transpose()).amax();
    let least = matrix.symmetric_eigenvalues().min();
    if 1e-9 * matrix.amax() < defect || least < -1e-9 * matrix.amax() {
        return Err(entry.fault("is no covariance: it must be symmetric, without negative eigenvalues"));
    }
    Ok(matrix)
}

/// The lower triangle, row by row.
fn joint_covariance(entry: &Entry<'_>) -> Result<JointCovariance, Fault> {
    entry.only(&["cameras", "lower", "noise_degrees_of_freedom"])?;
    let names = entry.need("cameras")?.items()?;
    let cameras: Vec<String> =
        names.iter().map(|n| Ok(n.text()?.to_owned())).collect::<Result<_, Fault>>()?;
    let covariance = lower_triangle(&entry.need("lower")?, 6 * cameras.len(), "6 a camera")?;
    let noise_degrees_of_freedom = entry.get("noise_degrees_of_freedom").map(|e| degrees(&e)).transpose()?;
    Ok(JointCovariance { cameras, covariance, noise_degrees_of_freedom })
}

fn degrees(entry: &Entry<'_>) -> Result<f64, Fault> {
    let degrees = entry.number()?;
    match 0.0 < degrees && degrees.is_finite() {
        true => Ok(degrees),
        false => Err(entry.fault(format!("is {degrees}; it must be positive"))),
    }
}

fn joint_text(joint: &JointCovariance) -> String {
    let names: Vec<String> = joint.cameras.iter().map(|name| quoted(name)).collect();
    let rows = lower_rows(&joint.covariance);
    let degrees = joint.noise_degrees_of_freedom.map_or_else(String::new, |degrees| {
        format!(
            "noise_degrees_of_freedom = {} # the noise was estimated from so many redundant numbers\n",
            number(degrees)
        )
    });
    format!(
        "\n[joint_covariance] # of the cameras' places together: what they have in common; lower triangle, 6 rows a camera\n\
         cameras = [{}]\nlower = [\n{rows}]\n{degrees}",
        names.join(", ")
    )
}

/// A row a line, each up to the diagonal.
fn lower_rows(matrix: &DMatrix<f64>) -> String {
    let row = |i: usize| (0..=i).map(|j| matrix[(i, j)]).collect::<Vec<f64>>();
    (0..matrix.nrows()).map(|i| format!("  {},\n", list(&row(i)))).collect()
}

/// Every model and every pose.
fn write(rig: &CameraFile) -> Written {
    let header = "# Resight camera file. Pixel (0, 0) is the centre of the top-left pixel; x right, y \
        down, z forward.\n";
    if let ([only], [], []) = (&rig.cameras[..], &rig.relations[..], &rig.clocks[..])
        && only.placement.is_none()
    {
        return Ok(OutFile::only("camera.toml", format!("{header}{}", camera_text(only)?)));
    }
    let mut out =
        rig.contradiction.as_deref().map(|c| status_keys("inconsistent", Some(c))).unwrap_or_default()
            + header;
    for camera in &rig.cameras {
        out += &format!("\n[[camera]]\n{}", camera_text(camera)?);
        if let Some(clock) = rig.clocks.iter().find(|c| c.camera == camera.name) {
            let (reference, offset_s) = (quoted(&clock.reference), number(clock.offset_s));
            out += &format!("clock = {{ reference = {reference}, offset_s = {offset_s} }}\n");
        }
        if let Some(p) = &camera.placement {
            out += &format!("[camera.placement] # x_in_b = b_from_a · x_in_a\n{}", placement_text(p));
        }
    }
    for relation in &rig.relations {
        out += &format!("\n[[relation]] # x_in_b = b_from_a · x_in_a\n{}", placement_text(relation));
    }
    out += &rig.joint.as_ref().map(joint_text).unwrap_or_default();
    Ok(OutFile::only("rig.toml", out))
}

fn camera_text(camera: &NamedCamera) -> Result<String, WriteError> {
    let head = format!("name = {}\nmodel = \"{}\"\n", quoted(&camera.name), camera.camera.model_name());
    if let Lens::Photogrammetric(model) = &camera.camera.lens {
        let t = model.table();
        let scalars: String =
            [("f", t.f), ("xp", t.xp), ("yp", t.yp)].map(|(k, x)| format!("{k} = {}\n", number(x))).concat();
        let lists = format!("k = {}\np = {}\na = {}\n", list(&t.k), list(&t.p), list(&t.a));
        return Ok(format!("{head}{scalars}{lists}{}", intrinsics_covariance_text(camera)));
    }
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    let size = camera.camera.size.ok_or_else(|| {
        WriteError(format!("{}: our own file needs the image size, which this camera has not", camera.name))
    })?;
    let size = format!("width_px = {}\nheight_px = {}\n", size.width_px, size.height_px);
    let matrix: String = [("fx_px", k.fx_px), ("fy_px", k.fy_px), ("cx_px", k.cx_px), ("cy_px", k.cy_px)]
        .map(|(key, x)| format!("{key} = {}\n", number(x)))
        .concat();
    Ok(format!("{head}{size}{matrix}{}{}", model_text(&numbers), intrinsics_covariance_text(camera)))
}

fn intrinsics_covariance_text(camera: &NamedCamera) -> String {
    camera.intrinsics_covariance.as_ref().map_or_else(String::new, |covariance| {
        let names: Vec<&str> = camera.camera.parameters().iter().map(|(name, _)| *name).collect();
        format!(
            "intrinsics_covariance = [ # lower triangle; {}\n{}]\n",
            names.join(", "),
            lower_rows(covariance)
        )
    })
}

fn model_text(numbers: &LensNumbers) -> String {
    let line = |key: &str, x: f64| format!("{key} = {}\n", number(x));
    match numbers {
        LensNumbers::Pinhole | LensNumbers::Photogrammetric(_) => String::new(),
        LensNumbers::BrownConrady(d) => format!("distortion = {}\n", list(d)),
        LensNumbers::KannalaBrandt(d) => format!("distortion = {}\n", list(d)),
        LensNumbers::Omni { xi, k1k2p1p2 } => line("xi", *xi) + &format!("distortion = {}\n", list(k1k2p1p2)),
        LensNumbers::Eucm { alpha, beta } => line("alpha", *alpha) + &line("beta", *beta),
        LensNumbers::DoubleSphere { xi, alpha } => line("xi", *xi) + &line("alpha", *alpha),
        LensNumbers::Fov { w_rad } => line("w_rad", *w_rad),
    }
}

fn placement_text(p: &Placement) -> String {
    let covariance = p.covariance.as_ref().map_or_else(String::new, |covariance| {
        let rows: String = covariance
            .row_iter()
            .map(|row| format!("  {},\n", list(&row.iter().copied().collect::<Vec<_>>())))
            .collect();
        format!(
            "covariance = [ # of [rotation_rad; translation_m], small motion on the left, frame b\n{rows}]\n"
        )
    });
    let pose = format!(
        "b = {}\na = {}\nrotation_wxyz = {}\ntranslation_m = {}\n",
        quoted(&p.b),
        quoted(&p.a),
        list(&p.b_from_a.quaternion_wxyz()),
        list(p.b_from_a.translation.as_slice())
    );
    pose + &covariance
}
