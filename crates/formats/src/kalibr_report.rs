//! Kalibr's text report (`results-cam-….txt`): the intrinsics of `camchain.yaml`, and the standard deviations that only the report holds.
//!
//! ```text
//!   cam0 (/topic):
//!    type: <class 'aslam_cv.libaslam_cv_python.DistortedPinholeCameraGeometry'>
//!    distortion: [k1 k2 p1 p2] +- [its standard deviations]
//!    projection: [fu fv pu pv] +- [its standard deviations]
//! ```
//! Its poses (`baseline T_1_0`) are those of `camchain.yaml` and are read there; so is the size of the images, which the report does not state.

use super::document::{Document, Fault, Node, Syntax, Value};
use super::entry::Entry;
use super::{CameraFormat, Contents, Format, NamedCamera, Reads, kalibr, lens};
use crate::core::Camera;
use nalgebra::{DMatrix, DVector};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::KalibrReport,
    words: &["kalibr-report"],
    reads: Some(Reads {
        recognises: |document| document.syntax == Syntax::Lines && is_report(&document.text),
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "The report states no image size and rounds to eight digits; poses between cameras are in camchain.yaml. The standard deviations are one \
            for each parameter: Kalibr writes no correlations.",
    ],
};

/// Python classes of Kalibr, and the words of `camchain.yaml` for them.
const CLASSES: [(&str, &str, &str); 8] = [
    ("DistortedPinholeCameraGeometry", "pinhole", "radtan"),
    ("EquidistantDistortedPinholeCameraGeometry", "pinhole", "equidistant"),
    ("FovDistortedPinholeCameraGeometry", "pinhole", "fov"),
    ("PinholeCameraGeometry", "pinhole", "none"),
    ("DistortedOmniCameraGeometry", "omni", "radtan"),
    ("OmniCameraGeometry", "omni", "none"),
    ("ExtendedUnifiedCameraGeometry", "eucm", "none"),
    ("DoubleSphereCameraGeometry", "ds", "none"),
];

/// Whether a text is such a report: a projection with its standard deviations stands in it.
pub(super) fn is_report(text: &str) -> bool {
    text.contains("CameraGeometry") && text.lines().any(|line| line.trim_start().starts_with("projection:"))
}

/// What the report says of one camera.
#[derive(Default)]
struct Section {
    line: usize,
    name: String,
    class: String,
    projection: Numbers,
    distortion: Numbers,
}

/// Numbers and their standard deviations, and where they stand.
#[derive(Default)]
struct Numbers {
    line: usize,
    values: Vec<f64>,
    sigmas: Vec<f64>,
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    for section in sections(&document.text)? {
        let camera = section.camera(&mut contents.warnings)?;
        let intrinsics_covariance = section.covariance(&camera)?;
        contents.cameras.push(NamedCamera {
            name: section.name,
            camera,
            placement: None,
            intrinsics_covariance,
        });
    }
    contents.notes.push(
        "The report states neither image sizes nor (as read here) poses: take these from camchain.yaml, the standard deviations from here."
            .into(),
    );
    Ok(contents)
}

fn sections(text: &str) -> Result<Vec<Section>, Fault> {
    let mut sections: Vec<Section> = Vec::new();
    let mut lines = text.lines().zip(1..).peekable();
    while let Some((line, number)) = lines.next() {
        let line = line.trim();
        if let Some((name, _topic)) = line.strip_suffix("):").and_then(|head| head.split_once(" (")) {
            if !name.contains(' ') {
                sections.push(Section { line: number, name: name.to_owned(), ..Section::default() });
            }
            continue;
        }
        let Some(section) = sections.last_mut() else { continue };
        let Some((key, rest)) = line.split_once(':') else { continue };
        if key == "type" {
            section.class =
                rest.trim().trim_end_matches("'>").rsplit('.').next().unwrap_or_default().to_owned();
        }
        if key != "projection" && key != "distortion" {
            continue;
        }
        // Long arrays are broken into lines.
        let mut array = rest.to_owned();
        while array.matches(']').count() < 2
            && let Some((more, _)) = lines.next_if(|(more, _)| !more.contains(':'))
        {
            array.push(' ');
            array.push_str(more);
        }
        let found = numbers(&array, number)?;
        match key {
            "projection" => section.projection = found,
            _ => section.distortion = found,
        }
    }
    Ok(sections)
}

/// `[a b] +- [c d]`, with or without commas.
fn numbers(text: &str, line: usize) -> Result<Numbers, Fault> {
    let needed = || {
        Fault::at(line, "holds no `[numbers] +- [standard deviations]`; copy the line from the report whole")
    };
    let list = |part: &str| -> Result<Vec<f64>, Fault> {
        let inner = part.trim().strip_prefix('[').and_then(|p| p.strip_suffix(']')).ok_or_else(needed)?;
        let words = inner.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
        words.map(|word| word.parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(needed)).collect()
    };
    let (values, sigmas) = text.split_once("+-").ok_or_else(needed)?;
    let found = Numbers { line, values: list(values)?, sigmas: list(sigmas)? };
    let (n, m) = (found.values.len(), found.sigmas.len());
    if n != m {
        return Err(Fault::at(line, format!("holds {n} numbers and {m} standard deviations")));
    }
    if let Some(bad) = found.sigmas.iter().find(|sigma| **sigma < 0.0) {
        return Err(Fault::at(line, format!("holds {bad}; a standard deviation is not negative")));
    }
    Ok(found)
}

impl Section {
    /// By the reader of `camchain.yaml`, from the same camera as that file has it.
    fn camera(&self, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
        let Some((_, model, distortion)) = CLASSES.iter().find(|(class, _, _)| *class == self.class) else {
            let known = CLASSES.map(|(class, _, _)| class).join(", ");
            let (line, class) = (self.line, &self.class);
            return Err(Fault::at(
                line,
                format!("camera {} is of type `{class}`; read are {known}", self.name),
            ));
        };
        let text = |word: &str| Node { line: self.line, value: Value::Text(word.to_owned()) };
        let list = |of: &Numbers| Node {
            line: of.line,
            value: Value::List(
                of.values.iter().map(|x| Node { line: of.line, value: Value::Number(*x) }).collect(),
            ),
        };
        let entries = [
            ("camera_model", text(model)),
            ("intrinsics", list(&self.projection)),
            ("distortion_model", text(distortion)),
            ("distortion_coeffs", list(&self.distortion)),
        ];
        let entries = entries.map(|(key, node)| (key.to_owned(), node)).to_vec();
        let node = Node { line: self.line, value: Value::Map(entries) };
        let entry = Entry::called(self.name.clone(), &node);
        let (intrinsics, lens, matrix) = kalibr::lens_of(&entry, "distortion_coeffs")?;
        lens::camera(&intrinsics, &lens, matrix, None, warnings)
    }

    /// Independent of one another: the report says nothing of their correlations. None where it holds no standard deviation at all.
    fn covariance(&self, camera: &Camera) -> Result<Option<DMatrix<f64>>, Fault> {
        let (p, d) = (&self.projection, &self.distortion);
        // fu, fv, pu, pv come last in Kalibr and first here.
        let first = p.values.len().saturating_sub(4);
        let in_our_order = |of: &dyn Fn(&Numbers) -> Vec<f64>| -> Vec<f64> {
            let projection = of(p);
            [&projection[first..], &projection[..first], &of(d)].concat()
        };
        let (values, sigmas) = (in_our_order(&|n| n.values.clone()), in_our_order(&|n| n.sigmas.clone()));
        let sigma_of = |value: f64| {
            let mut same = values.iter().zip(&sigmas).filter(|(v, _)| **v == value);
            same.next().map(|(_, sigma)| *sigma)
        };
        let parameters = camera.parameters();
        let aligned = parameters.len() <= values.len()
            && parameters.iter().zip(&values).all(|((_, mine), theirs)| mine == theirs);
        let found: Option<Vec<f64>> = match aligned {
            true => Some(sigmas[..parameters.len()].to_vec()),
            // A model whose parameters stand in another order here; each is known by its number.
            false => parameters.iter().map(|(_, value)| sigma_of(*value)).collect(),
        };
        let Some(found) = found else {
            return Err(Fault::at(
                p.line,
                "its standard deviations belong to other parameters than this lens model has",
            ));
        };
        if found.iter().all(|sigma| *sigma == 0.0) {
            return Ok(None);
        }
        Ok(Some(DMatrix::from_diagonal(&DVector::from_vec(found.iter().map(|s| s * s).collect()))))
    }
}
