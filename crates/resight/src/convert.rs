//! The jobs on camera and target files: conversion to another program's format, and explanation in sentences.

use crate::answer::files::{CameraPosition, ConvertAnswer, Explanation};
use crate::answer::{SchemaNumber, Status};
use crate::core::Target;
use crate::core::target::{MapTag, TagMap};
use crate::formats::{self, CameraFile, Conversion, Field, Format, Scene, WriteError};
use crate::{Error, FileError};
use std::path::{Path, PathBuf};

/// Explains a file in sentences: which frame maps to which, directions, units, quaternion order, camera centre.
///
/// # Errors
/// What is wrong with the file, and where.
pub fn explain(file: impl AsRef<Path>) -> Result<Explanation, Error> {
    let file = file.as_ref();
    Ok(Explanation {
        schema: SchemaNumber,
        status: Status::Ok,
        text: formats::explain(file)?.trim_end().to_owned(),
        remarks: formats::remarks(file),
        file: file.display().to_string(),
    })
}

/// A request for a conversion.
#[derive(Debug, Clone)]
pub struct ConvertRequest {
    /// Camera files, or folders of them; `FILE#NAME` selects one camera. The poses of one file and the cameras of another are matched by name.
    /// For [`ConvertTo::FieldLayout`], a map of tags.
    pub files: Vec<PathBuf>,
    /// The format to write.
    pub to: ConvertTo,
    /// The frame in which the cameras are placed; by default the one that they share.
    pub reference: Option<String>,
    /// Width and height of the images of cameras whose files state none, pixels.
    pub image_size_px: Option<(u32, u32)>,
}

/// The kind of file to write.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ConvertTo {
    /// Cameras and their poses.
    Cameras(Format),
    /// A map of tags as a WPILib field layout.
    FieldLayout {
        /// Whether the keys are spelled as in 2027 and later.
        keys_of_2027: bool,
        /// Length and width of the field, metres; by default those of the layout read.
        field_size_m: Option<(f64, f64)>,
    },
}

impl ConvertTo {
    /// Returns the name of the format.
    pub fn name(self) -> &'static str {
        match self {
            ConvertTo::Cameras(format) => format.name(),
            ConvertTo::FieldLayout { .. } => Format::WpilibLayout.name(),
        }
    }
}

/// Converts cameras and their poses to another program's format, and reports where each camera is and what could not be kept.
///
/// # Errors
/// What is wrong with a file or with the request. If the format cannot hold the cameras, the answer's status says so.
pub fn convert(request: &ConvertRequest) -> Result<ConvertAnswer, Error> {
    match request.to {
        ConvertTo::Cameras(format) => cameras(request, format),
        ConvertTo::FieldLayout { keys_of_2027, field_size_m } => {
            field_layout(request, keys_of_2027, field_size_m)
        }
    }
}

fn cameras(request: &ConvertRequest, to: Format) -> Result<ConvertAnswer, Error> {
    let rig = read(request)?;
    let reference = request.reference.as_deref();
    let scene = formats::scene(&rig, reference)?;
    Ok(match formats::convert(&rig, to, reference) {
        Ok(conversion) => ConvertAnswer {
            reference: Some(scene.reference.clone()),
            cameras: positions(&scene),
            warnings: rig.warnings,
            message: scene.text(),
            ..converted(conversion)
        },
        Err(reason) => refused(request.to, &reason),
    })
}

fn positions(scene: &Scene) -> std::collections::BTreeMap<String, Option<CameraPosition>> {
    let one =
        |s: &formats::SceneCamera| (s.name.clone(), s.reference_from_cam.as_ref().map(CameraPosition::from));
    scene.scene_cameras.iter().map(one).collect()
}

fn converted(conversion: Conversion) -> ConvertAnswer {
    let Conversion { files, lost, checked } = conversion;
    let (files, contents) = files.into_iter().map(|file| (file.name, file.text)).unzip();
    ConvertAnswer {
        schema: SchemaNumber,
        status: Status::Ok,
        reference: None,
        cameras: Default::default(),
        files,
        lost,
        warnings: Vec::new(),
        checked,
        message: String::new(),
        contents,
    }
}

/// Returns the answer for files that were read but that the format cannot hold.
fn refused(to: ConvertTo, reason: &WriteError) -> ConvertAnswer {
    ConvertAnswer {
        status: Status::Error,
        message: format!("{} cannot hold this: {reason}", to.name()),
        ..converted(Conversion { files: Vec::new(), lost: Vec::new(), checked: false })
    }
}

fn read(request: &ConvertRequest) -> Result<CameraFile, Error> {
    let mut rig = formats::read_rig(&request.files)?;
    for camera in rig.cameras.iter_mut().filter(|c| c.camera.size.is_none() && c.camera.matrix().is_some()) {
        if let Some((w, h)) = request.image_size_px {
            camera.camera = formats::check_image_size(&camera.camera, w, h).map_err(Error::request)?;
        }
    }
    Ok(rig)
}

/// Writes one tag map; the size of the field is taken from the request, else from the layout that was read.
fn field_layout(
    request: &ConvertRequest,
    keys_of_2027: bool,
    field_size_m: Option<(f64, f64)>,
) -> Result<ConvertAnswer, Error> {
    let [input] = request.files.as_slice() else {
        return Err(Error::request(format!(
            "--to wpilib takes one target file, a tag map; {} given",
            request.files.len()
        )));
    };
    let read = formats::read_target(input)?;
    let (length_m, width_m) = match (field_size_m, formats::read_field(input)) {
        (Some(size), _) => size,
        (None, Ok(field)) => (field.length_m, field.width_m),
        (None, Err(_)) => {
            let reason = "states no field; give --field-size-m LENGTHxWIDTH, e.g. 16.541x8.069";
            return Err(FileError::new(input, reason).into());
        }
    };
    let field = Field { length_m, width_m, keys_of_2027 };
    let (target, lost) = match read.target {
        Target::TagMap(map) => {
            let one = of_one_tolerance(&map);
            let is_same = one.joint_covariance == map.joint_covariance && one.tags == map.tags;
            let lost = "the tolerances of single tags and what they have in common; every tag has the root mean square of all";
            (Target::TagMap(one), (!is_same).then(|| lost.to_owned()).into_iter().collect())
        }
        other => (other, Vec::new()),
    };
    Ok(match formats::write_field_layout(&target, &field) {
        Ok(file) => ConvertAnswer {
            warnings: read.warnings,
            message: format!("WPILib field layout, {length_m} m by {width_m} m"),
            ..converted(Conversion { files: vec![file], lost, checked: false })
        },
        Err(reason) => refused(request.to, &reason),
    })
}

/// Returns a map as a WPILib field layout can hold it: every tag has the root mean square of all tolerances.
pub(crate) fn of_one_tolerance(map: &TagMap) -> TagMap {
    let first = map.tags.first().map(|tag| (tag.sigma_m, tag.sigma_rad));
    let rms = |of: fn(&MapTag) -> f64| {
        (map.tags.iter().map(|tag| of(tag).powi(2)).sum::<f64>() / map.tags.len().max(1) as f64).sqrt()
    };
    let is_one = map.tags.iter().all(|tag| Some((tag.sigma_m, tag.sigma_rad)) == first);
    let of_all = (rms(|tag| tag.sigma_m), rms(|tag| tag.sigma_rad));
    let (sigma_m, sigma_rad) = first.filter(|_| is_one).unwrap_or(of_all);
    let tags = map.tags.iter().map(|tag| MapTag { sigma_m, sigma_rad, ..tag.clone() }).collect();
    TagMap { family: map.family.clone(), tags, joint_covariance: None }
}
