//! OpenCV FileStorage as OpenCV's own YAML and XML readers take it; the emitters are ours because its YAML reader is
//! particular about layout.

use super::emit::{matrix_rows, number};
use super::frames::Frames;
use super::lens::{self, LensNumbers};
use super::{CameraFile, NamedCamera, OutFile, WriteError, Written};

enum Field {
    Text(String),
    Whole(u32),
    /// Rows, columns, numbers row by row.
    Matrix(usize, usize, Vec<f64>),
}

type Fields = Vec<(String, Field)>;

pub(super) fn write_yaml(rig: &CameraFile) -> Written {
    let body: String = fields(rig)?.iter().map(|(key, field)| yaml(key, field)).collect();
    Ok(OutFile::only(file_name(rig, ["camera.yml", "stereo.yml"]), format!("%YAML:1.0\n---\n{body}")))
}

pub(super) fn write_xml(rig: &CameraFile) -> Written {
    let body: String = fields(rig)?.iter().map(|(key, field)| xml(key, field)).collect();
    let text = format!("<?xml version=\"1.0\"?>\n<opencv_storage>\n{body}</opencv_storage>\n");
    Ok(OutFile::only(file_name(rig, ["camera.xml", "stereo.xml"]), text))
}

fn file_name<'n>(rig: &CameraFile, [one, two]: [&'n str; 2]) -> &'n str {
    if rig.cameras.len() == 1 { one } else { two }
}

fn yaml(key: &str, field: &Field) -> String {
    match field {
        Field::Text(text) => format!("{key}: \"{text}\"\n"),
        Field::Whole(n) => format!("{key}: {n}\n"),
        Field::Matrix(rows, columns, data) => format!(
            "{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [{}]\n",
            data.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ")
        ),
    }
}

fn xml(key: &str, field: &Field) -> String {
    match field {
        Field::Text(text) => format!("<{key}>\"{text}\"</{key}>\n"),
        Field::Whole(n) => format!("<{key}>{n}</{key}>\n"),
        Field::Matrix(rows, columns, data) => format!(
            "<{key} type_id=\"opencv-matrix\">\n  <rows>{rows}</rows>\n  <cols>{columns}</cols>\n  <dt>d</dt>\n  \
                <data>\n    {}</data></{key}>\n",
            data.iter().map(|x| number(*x)).collect::<Vec<_>>().join(" ")
        ),
    }
}

/// One camera (`camera_matrix`, …) or two (`M1 D1 M2 D2 R T`).
fn fields(rig: &CameraFile) -> Result<Fields, WriteError> {
    match &rig.cameras[..] {
        [only] => {
            let mut fields = name_and_size("", only)?;
            fields.push(model(&[only])?);
            fields.extend(intrinsics(only, "camera_matrix", "distortion_coefficients")?);
            Ok(fields)
        }
        [first, second] => pair(rig, first, second),
        many => Err(WriteError(format!(
            "an OpenCV file holds one or two cameras, not {}; write kalibr or resight",
            many.len()
        ))),
    }
}

fn pair(rig: &CameraFile, first: &NamedCamera, second: &NamedCamera) -> Result<Fields, WriteError> {
    if first.camera.size != second.camera.size {
        return Err(WriteError("an OpenCV stereo file has one image size; write one file per camera".into()));
    }
    let mut fields = name_and_size("1", first)?;
    fields.push(("camera_name2".into(), Field::Text(plain_name(&second.name)?)));
    fields.push(model(&[first, second])?);
    fields.extend(intrinsics(first, "M1", "D1")?);
    fields.extend(intrinsics(second, "M2", "D2")?);
    if let Some(second_from_first) = Frames::of_rig(rig).between(&second.name, &first.name) {
        let r: Vec<f64> = second_from_first.rotation.transpose().iter().copied().collect();
        fields.push(("R".into(), Field::Matrix(3, 3, r)));
        fields.push(("T".into(), Field::Matrix(3, 1, second_from_first.translation.as_slice().to_vec())));
    }
    Ok(fields)
}

fn plain_name(name: &str) -> Result<String, WriteError> {
    let plain = name.chars().all(|c| c.is_alphanumeric() || "_-. ".contains(c));
    if plain {
        Ok(name.to_owned())
    } else {
        Err(WriteError(format!("camera name `{name}`: only letters, digits, _, - and . can be written")))
    }
}

fn name_and_size(camera_number: &str, camera: &NamedCamera) -> Result<Fields, WriteError> {
    let mut fields = vec![(format!("camera_name{camera_number}"), Field::Text(plain_name(&camera.name)?))];
    if let Some(size) = camera.camera.size {
        fields.push(("image_width".into(), Field::Whole(size.width_px)));
        fields.push(("image_height".into(), Field::Whole(size.height_px)));
    }
    Ok(fields)
}

/// OpenCV's word for the lens, and its coefficients.
fn words(camera: &NamedCamera) -> Result<(&'static str, Vec<f64>), WriteError> {
    match lens::numbers_of(&camera.camera)?.1 {
        LensNumbers::Pinhole => Ok(("plumb_bob", vec![0.0; 5])),
        LensNumbers::BrownConrady(d) if d.len() <= 5 => Ok(("plumb_bob", d)),
        LensNumbers::BrownConrady(d) => Ok(("rational_polynomial", d)),
        LensNumbers::KannalaBrandt(d) => Ok(("fisheye", d.to_vec())),
        other => Err(WriteError(format!("OpenCV has no {} model; write resight or kalibr", other.model()))),
    }
}

/// One word for the file, so an ordinary lens and a fisheye do not go together.
fn model(cameras: &[&NamedCamera]) -> Result<(String, Field), WriteError> {
    let words = cameras.iter().map(|c| Ok(words(c)?.0)).collect::<Result<Vec<_>, WriteError>>()?;
    if words.iter().any(|w| (*w == "fisheye") != (words[0] == "fisheye")) {
        return Err(WriteError(
            "a fisheye and an ordinary lens do not fit one OpenCV file; write one file per camera".into(),
        ));
    }
    Ok(("distortion_model".into(), Field::Text(words[0].to_owned())))
}

fn intrinsics(camera: &NamedCamera, matrix: &str, distortion: &str) -> Result<Fields, WriteError> {
    let (k, _) = lens::numbers_of(&camera.camera)?;
    let (model, d) = words(camera)?;
    let (rows, columns) = if model == "fisheye" { (d.len(), 1) } else { (1, d.len()) };
    Ok(vec![
        (matrix.to_owned(), Field::Matrix(3, 3, matrix_rows(&k).to_vec())),
        (distortion.to_owned(), Field::Matrix(rows, columns, d)),
    ])
}
