//! `convert`: camera files from one format to another, poses of other files merged in.

mod layout;

use crate::output::{Outcome, print};
use anyhow::{Result, bail};
use clap::Args;
use resight::core::Pose;
use resight::formats::{self, CameraFile, Conversion, Format, Scene};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Writes cameras and their poses in another program's format, and says where each stands and what could not be kept.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  resight convert camchain.yaml --to opencv -o stereo.yml\n  \
    resight convert left.yaml right.yaml robot.urdf --to kalibr -o camchain.yaml\n  \
    resight convert rig.toml --to tf --reference base_link -o cameras.launch.py\n  \
    resight convert tags.toml --to wpilib --field-size-m 16.541x8.069 -o field.json")]
pub struct Convert {
    /// Camera files, or folders of them (a tag map for `--to wpilib`); FILE#NAME is one camera. Poses of one file join the cameras of another by name.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The format to write.
    #[arg(long, value_name = "FORMAT", value_parser = parse_format)]
    to: To,
    /// The file to write, or a folder where the format takes several files.
    #[arg(long, short, value_name = "OUT")]
    output: PathBuf,
    /// The frame that cameras are placed in, a camera or any other frame of the files [default: the one they share]
    #[arg(long, value_name = "NAME")]
    reference: Option<String>,
    /// Image size of the cameras whose files state none, in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    image_size_px: Option<(u32, u32)>,
    /// Length and width of the field, for `--to wpilib` and `--to wpilib-2027` [default: those of the layout read]
    #[arg(long, value_name = "LENGTHxWIDTH", value_parser = layout::parse_field_size)]
    field_size_m: Option<(f64, f64)>,
    /// One JSON object on stdout: {"reference", "cameras", "files", "lost", "warnings", "checked"}.
    #[arg(long)]
    json: bool,
    /// No remarks on stderr; errors are still told.
    #[arg(long, short)]
    quiet: bool,
}

/// What is written.
#[derive(Debug, Clone, Copy)]
enum To {
    /// Cameras and their poses.
    Cameras(Format),
    /// A map of tags as a WPILib field layout.
    Layout { keys_of_2027: bool },
}

impl To {
    fn name(self) -> &'static str {
        match self {
            To::Cameras(format) => format.name(),
            To::Layout { .. } => Format::WpilibLayout.name(),
        }
    }
}

fn parse_format(word: &str) -> Result<To, String> {
    if let Some(keys_of_2027) = layout::keys_of_2027(word) {
        return Ok(To::Layout { keys_of_2027 });
    }
    Format::to_write(word).map(To::Cameras).ok_or_else(|| {
        let words = || Format::writable().flat_map(|(_, words)| words.iter().map(|w| (*w).to_owned()));
        let hint = resight::input::nearest(word, words())
            .map(|w| format!("did you mean `{w}`? "))
            .unwrap_or_default();
        let first = |(_, words): (_, &[&'static str])| words.first().copied();
        let list: Vec<&str> = Format::writable().filter_map(first).collect();
        format!("no such format; {hint}There are {}, and wpilib, wpilib-2027 for tag maps", list.join(", "))
    })
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let pair = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    pair.filter(|(w, h)| 0 < *w && 0 < *h)
        .ok_or_else(|| "width and height are needed, e.g. 640x480".to_owned())
}

/// See `Convert`.
pub fn run(args: &Convert) -> Result<Outcome> {
    match args.to {
        To::Cameras(format) => cameras(args, format),
        To::Layout { keys_of_2027 } => layout::run(args, keys_of_2027),
    }
}

fn cameras(args: &Convert, to: Format) -> Result<Outcome> {
    let rig = read(args)?;
    let reference = args.reference.as_deref();
    let scene = formats::scene(&rig, reference)?;
    let conversion = match formats::convert(&rig, to, reference) {
        Ok(conversion) => conversion,
        Err(reason) => return refused(args, &reason.to_string()),
    };
    let paths = paths(&args.output, &conversion)?;
    spare_inputs(args, &paths)?;
    for (path, file) in paths.iter().zip(&conversion.files) {
        formats::write_atomically(path, file.text.as_bytes())?;
    }
    if !args.quiet {
        rig.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        conversion.lost.iter().for_each(|lost| eprintln!("warning: not kept: {lost}"));
    }
    print(&if args.json {
        json(&rig, &scene, &conversion, &paths)?
    } else {
        words(args, &scene, &conversion, &paths)
    })?;
    Ok(Outcome::Answered)
}

/// The files were read, but the format cannot hold them.
fn refused(args: &Convert, reason: &str) -> Result<Outcome> {
    eprintln!("error: {} cannot hold this: {reason}", args.to.name());
    if args.json {
        print(&format!("{}\n", serde_json::json!({ "error": reason })))?;
    }
    Ok(Outcome::of([resight::report::verdict::Status::Error]))
}

fn read(args: &Convert) -> Result<CameraFile> {
    for file in args.files.iter().filter(|f| !f.is_dir()) {
        crate::files::camera_must_exist(&file.to_string_lossy())?;
    }
    let mut rig = formats::read_rig(&args.files)?;
    for camera in rig.cameras.iter_mut().filter(|c| c.camera.size.is_none() && c.camera.matrix().is_some()) {
        if let Some((w, h)) = args.image_size_px {
            camera.camera = formats::check_image_size(&camera.camera, w, h).map_err(anyhow::Error::msg)?;
        }
    }
    Ok(rig)
}

/// OUT itself for one file, unless it is a folder; below OUT for several. Folders are made.
fn paths(out: &Path, conversion: &Conversion) -> Result<Vec<PathBuf>> {
    let paths: Vec<PathBuf> = match conversion.files.as_slice() {
        [_] if !out.is_dir() && !out.as_os_str().to_string_lossy().ends_with('/') => {
            crate::files::must_be_writable(out)?;
            vec![out.to_path_buf()]
        }
        files => {
            crate::files::make_folder("-o", out)?;
            files.iter().map(|f| out.join(&f.name)).collect()
        }
    };
    for folder in paths.iter().filter_map(|p| p.parent()).filter(|p| !p.as_os_str().is_empty()) {
        crate::files::make_folder("-o", folder)?;
    }
    if let Some(taken) = paths.iter().find(|p| p.is_dir()) {
        bail!("-o: {} is a folder, and a file of this name is to be written", taken.display());
    }
    Ok(paths)
}

/// A file that was read is never replaced: what a format cannot hold would be gone.
fn spare_inputs(args: &Convert, paths: &[PathBuf]) -> Result<()> {
    let same = |a: &Path, b: &Path| matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b);
    match paths.iter().find(|path| args.files.iter().any(|input| same(input, path))) {
        Some(path) => {
            bail!("-o {}: this would replace the file it is made from; write elsewhere", path.display())
        }
        None => Ok(()),
    }
}

fn words(args: &Convert, scene: &Scene, conversion: &Conversion, paths: &[PathBuf]) -> String {
    let list: String = paths.iter().map(|p| format!("  {}\n", p.display())).collect();
    let checked = match conversion.checked {
        true => "read back and compared with what was meant",
        false => "Resight only writes this format, so the files were not read back",
    };
    format!("{}\n{}, {checked}:\n{list}", scene.text(), args.to.name())
}

#[derive(Serialize)]
struct Report {
    reference: String,
    cameras: BTreeMap<String, Option<Place>>,
    files: Vec<String>,
    lost: Vec<String>,
    warnings: Vec<String>,
    checked: bool,
}

#[derive(Serialize)]
struct Place {
    centre_m: [f64; 3],
    looks_along: [f64; 3],
    rotation_wxyz: [f64; 4],
}

impl From<&Pose> for Place {
    fn from(reference_from_cam: &Pose) -> Self {
        Place {
            centre_m: reference_from_cam.translation.into(),
            looks_along: reference_from_cam.rotation.column(2).into_owned().into(),
            rotation_wxyz: reference_from_cam.quaternion_wxyz(),
        }
    }
}

fn json(rig: &CameraFile, scene: &Scene, conversion: &Conversion, paths: &[PathBuf]) -> Result<String> {
    let place = |s: &formats::Station| (s.name.clone(), s.reference_from_cam.as_ref().map(Place::from));
    let report = Report {
        reference: scene.reference.clone(),
        cameras: scene.stations.iter().map(place).collect(),
        files: paths.iter().map(|p| p.display().to_string()).collect(),
        lost: conversion.lost.clone(),
        warnings: rig.warnings.clone(),
        checked: conversion.checked,
    };
    Ok(serde_json::to_string(&report)? + "\n")
}
