//! Cameras of MATLAB's Computer Vision Toolbox: `cameraParameters`, `cameraIntrinsics` and `stereoParameters` as JSON or YAML (`toStruct`,
//! `jsonencode`), or as MATLAB displays them; read only.
//!
//! MATLAB counts pixels from 1: the centre of the first pixel is (1, 1), so 1 is subtracted from the principal point, as
//! `cameraIntrinsicsToOpenCV` does. `IntrinsicMatrix` is the transpose of `K`: which of the two a matrix is shows where 0 0 1 stands.
//! Coefficients are OpenCV's: k1 k2 p1 p2 k3 are RadialDistortion(1), (2), TangentialDistortion(1), (2), RadialDistortion(3). `ImageSize` is
//! rows, columns. `RotationOfCamera2` multiplies row vectors, x₂ = x₁ R + t, so that second_from_first is its transpose; `PoseCamera2`
//! multiplies columns. Translations are in `WorldUnits`, millimetres where none is stated.

use super::document::{Document, Fault, Node, Syntax, Value};
use super::entry::Entry;
use super::lens;
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks, opencv};
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::{Camera, Pose};
use nalgebra::Matrix3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Matlab,
    words: &[],
    reads: Some(Reads { recognises, read, together: None }),
    write: None,
    traps: &[
        "MATLAB counts pixels from 1: cx and cy are one larger there than in OpenCV, and 1 is subtracted.",
        "IntrinsicMatrix is K transposed, with cx, cy in its last row; K (since R2022b) is not.",
        "RotationOfCamera2 multiplies row vectors (x₂ = x₁ R + t): OpenCV's R is its transpose. PoseCamera2.R is OpenCV's R.",
        "Lengths are in WorldUnits, millimetres by default; metres here.",
    ],
};

const KINDS: [&str; 5] =
    ["cameraParameters", "cameraIntrinsics", "stereoParameters", "fisheyeParameters", "fisheyeIntrinsics"];
const PROPERTIES: &str = " with properties:";

/// Lines of a display that are looked at before its first.
const HEAD_LINES: usize = 12;

/// The text that MATLAB displays of a camera, which people save or keep as a comment.
pub(super) fn is_display(text: &str) -> bool {
    text.lines().take(HEAD_LINES).any(|line| kind(line).is_some())
}

fn kind(line: &str) -> Option<&'static str> {
    let line = uncommented(line).strip_suffix(PROPERTIES)?;
    KINDS.into_iter().find(|kind| *kind == line)
}

fn uncommented(line: &str) -> &str {
    line.trim_start_matches(|c: char| c.is_whitespace() || c == '%' || c == '#').trim_end()
}

/// A display as a tree: numbers in brackets and single ones, of the other properties nothing. Of several cameras the first.
pub(super) fn parse_display(text: &str) -> Result<Node, Fault> {
    let mut entries: Vec<(String, Node)> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = uncommented(line);
        let Some((key, value)) = line.split_once(':') else { continue };
        let is_name = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric());
        if !is_name || entries.iter().any(|(known, _)| known == key) {
            continue;
        }
        let line = i + 1;
        let value = value.trim();
        let words = value.trim_matches(['[', ']']).split_whitespace();
        let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
        let node = |value| Node { line, value };
        let value = match numbers {
            Some(numbers) if value.starts_with('[') => {
                Value::List(numbers.into_iter().map(|x| node(Value::Number(x))).collect())
            }
            Some(numbers) if numbers.len() == 1 => Value::Number(numbers[0]),
            _ => Value::Text(value.trim_matches('\'').trim_matches('"').to_owned()),
        };
        entries.push((key.to_owned(), node(value)));
    }
    super::tree::map_of(1, entries)
}

fn recognises(document: &Document) -> bool {
    let root = unwrapped(document);
    document.syntax == Syntax::Display
        || root.has("CameraParameters1") && root.has("CameraParameters2")
        || is_camera(&root)
        || root.has("MappingCoefficients") && root.has("StretchMatrix")
}

fn is_camera(at: &Entry<'_>) -> bool {
    let at = at.get("Intrinsics").filter(is_table).unwrap_or_else(|| at.clone());
    at.has("RadialDistortion") && ["IntrinsicMatrix", "K", "FocalLength"].iter().any(|key| at.has(key))
}

fn is_table(at: &Entry<'_>) -> bool {
    matches!(at.node.value, Value::Map(_))
}

/// A file often holds the variable: `{"cameraParams": {…}}`.
fn unwrapped(document: &Document) -> Entry<'_> {
    let root = document.entry();
    let inner = ["cameraParams", "stereoParams", "params", "intrinsics"];
    root.first_of(&inner).filter(|at| is_table(at) && !root.has("RadialDistortion")).unwrap_or(root)
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (unwrapped(document), Contents::default());
    if root.has("MappingCoefficients") {
        return Err(root.fault(
            "a fisheyeParameters of MATLAB (Scaramuzza's polynomial), which no lens model here has; calibrate from the images: `resight intrinsics`",
        ));
    }
    if let (Some(first), Some(second)) = (root.get("CameraParameters1"), root.get("CameraParameters2")) {
        for (name, at) in [("camera1", first), ("camera2", second)] {
            if !is_table(&at) {
                return Err(at.fault(
                    "is not shown; save jsonencode(stereoParams.toStruct()), which holds all numbers",
                ));
            }
            let camera = camera(&at, &mut contents.warnings)?;
            contents.cameras.push(NamedCamera::new(name, camera, None));
        }
        contents.cameras[1].placement = Some(second_from_first(&root)?);
    } else {
        let camera = camera(&root, &mut contents.warnings)?;
        contents.cameras.push(NamedCamera::new(document.stem(), camera, None));
    }
    if document.syntax == Syntax::Display {
        contents.warnings.push(
            "MATLAB displays five digits of each number (principal point and focal length to about 0.1 px); jsonencode(params.toStruct()) has all"
                .into(),
        );
    }
    Ok(contents)
}

fn camera(at: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    let at = at.get("Intrinsics").filter(is_table).unwrap_or_else(|| at.clone());
    let matrix = matrix(&at)?;
    let radial = at.need("RadialDistortion")?;
    let tangential = at.get("TangentialDistortion").map_or(Ok(vec![0.0; 2]), |t| t.exactly(2, "p1, p2"))?;
    let d = match radial.numbers()?.as_slice() {
        [k1, k2] => vec![*k1, *k2, tangential[0], tangential[1]],
        [k1, k2, k3] => vec![*k1, *k2, tangential[0], tangential[1], *k3],
        other => return Err(radial.fault(format!("holds {} numbers; MATLAB has 2 or 3", other.len()))),
    };
    let lens = opencv::brown_conrady(&radial, d)?;
    lens::camera(&at, &lens, matrix, size(&at)?, warnings)
}

/// `ImageSize` is rows, columns; empty where the images were not known.
fn size(at: &Entry<'_>) -> Result<Option<ImageSize>, Fault> {
    let Some(size) = at.get("ImageSize") else { return Ok(None) };
    match (&size.node.value, size.numbers()?.len()) {
        (_, 0) => Ok(None),
        (Value::List(_), 2) => {
            let numbers = size.items()?;
            Ok(Some(ImageSize { width_px: numbers[1].count(1)?, height_px: numbers[0].count(1)? }))
        }
        (_, n) => Err(size.fault(format!("holds {n} numbers; rows and columns are needed"))),
    }
}

/// From pixels counted from 1.
fn matrix(at: &Entry<'_>) -> Result<CameraMatrix, Fault> {
    let whole = at.first_of(&["IntrinsicMatrix", "K"]).filter(|k| matches!(k.node.value, Value::List(_)));
    let k = match &whole {
        Some(k) => {
            let numbers = k.exactly(9, "a 3×3 matrix")?;
            let m = Matrix3::from_row_slice(&numbers);
            // 0 0 1 in the last column, and not in the last row.
            let is_transposed =
                m.column(2).iter().eq(&[0.0, 0.0, 1.0]) && !m.row(2).iter().eq(&[0.0, 0.0, 1.0]);
            if is_transposed { m.transpose() } else { m }
        }
        None => {
            let f = at.need("FocalLength")?.exactly(2, "fx, fy")?;
            let c = at.need("PrincipalPoint")?.exactly(2, "cx, cy")?;
            let skew = at.get("Skew").map_or(Ok(0.0), |s| s.number())?;
            Matrix3::new(f[0], skew, c[0], 0.0, f[1], c[1], 0.0, 0.0, 1.0)
        }
    };
    let blamed = whole.unwrap_or_else(|| at.clone());
    let k = checks::without_skew(&blamed, &k)?;
    Ok(CameraMatrix { cx_px: k.cx_px - 1.0, cy_px: k.cy_px - 1.0, ..k })
}

fn second_from_first(root: &Entry<'_>) -> Result<Placement, Fault> {
    let unit = metres_per_unit(root)?;
    let (rotation, t) = match root.get("PoseCamera2").filter(is_table) {
        Some(pose) => (checks::rotation_matrix(&pose.need("R")?)?, pose.need("Translation")?),
        None => {
            let rotation = checks::rotation_matrix(&root.need("RotationOfCamera2")?)?;
            (rotation.transpose(), root.need("TranslationOfCamera2")?)
        }
    };
    let b_from_a = Pose::new(rotation, checks::vector3(&t)? * unit);
    Ok(Placement { b: "camera2".into(), a: "camera1".into(), b_from_a, covariance: None })
}

/// `WorldUnits`, which the two cameras state where the pair does not.
fn metres_per_unit(root: &Entry<'_>) -> Result<f64, Fault> {
    let first = root.get("CameraParameters1");
    let Some(unit) = root.get("WorldUnits").or_else(|| first?.get("WorldUnits")) else { return Ok(1e-3) };
    match unit.text()? {
        "mm" | "millimeters" => Ok(1e-3),
        "cm" | "centimeters" => Ok(1e-2),
        "m" | "meters" => Ok(1.0),
        "in" | "inches" => Ok(0.0254),
        other => {
            Err(unit.fault(format!("is `{other}`; millimeters, centimeters, meters and inches are read")))
        }
    }
}
