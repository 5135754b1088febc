//! `convert`: camera files from one format to another, poses of other files merged in.

use crate::output::{Outcome, error, print, remark};
use anyhow::{Result, bail};
use clap::Args;
use resight::answer::ConvertAnswer;
use resight::convert::{ConvertRequest, ConvertTo, convert};
use resight::formats::{self, Format};
use resight::report::verdict::Status;
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
    /// Names the format to write.
    #[arg(long, value_name = "FORMAT", value_parser = parse_format)]
    to: ConvertTo,
    /// Writes this file, or into this folder where the format takes several files.
    #[arg(long, short, value_name = "OUT")]
    output: PathBuf,
    /// Places the cameras in this frame: a camera or any other frame of the files [default: the one they share]
    #[arg(long, value_name = "NAME")]
    reference: Option<String>,
    /// States the image size of cameras whose files state none, in pixels
    #[arg(long, value_name = "WxH", value_parser = crate::args::parse_size)]
    image_size_px: Option<(u32, u32)>,
    /// States the length and width of the field, for `--to wpilib` and `--to wpilib-2027` [default: those of the layout read]
    #[arg(long, value_name = "LENGTHxWIDTH", value_parser = parse_field_size)]
    field_size_m: Option<(f64, f64)>,
    /// Prints one JSON object on stdout: {"status", "reference", "cameras", "files", "lost", "warnings", "checked", "message"}.
    #[arg(long)]
    json: bool,
}

fn parse_format(word: &str) -> Result<ConvertTo, String> {
    if matches!(word, "wpilib" | "wpilib-2027") {
        return Ok(ConvertTo::FieldLayout { keys_of_2027: word == "wpilib-2027", field_size_m: None });
    }
    Format::to_write(word).map(ConvertTo::Cameras).ok_or_else(|| {
        let first = |(_, words): (_, &[&'static str])| words.first().copied();
        let names = Format::writable().filter_map(first).chain(["wpilib", "wpilib-2027"]);
        let names: Vec<String> = names.map(str::to_owned).collect();
        resight::input::not_among(word, "format", &names)
    })
}

/// Length and width of the field, `16.541x8.069`.
fn parse_field_size(text: &str) -> Result<(f64, f64), String> {
    let side = |x: &str| x.parse::<f64>().ok().filter(|x| 0.0 < *x && x.is_finite());
    let pair = text.split_once(['x', 'X']).and_then(|(length, width)| Some((side(length)?, side(width)?)));
    pair.ok_or_else(|| "length and width of the field in metres are needed, e.g. 16.541x8.069".to_owned())
}

/// See `Convert`.
pub fn run(args: &Convert) -> Result<Outcome> {
    for file in args.files.iter().filter(|f| !f.is_dir()) {
        crate::files::camera_must_exist(&file.to_string_lossy())?;
    }
    let mut answer = convert(&args.request())?;
    if answer.status == Status::Ok {
        let paths = paths(&args.output, &answer.files)?;
        spare_inputs(args, &paths)?;
        for (path, text) in paths.iter().zip(&answer.contents) {
            formats::write_atomically(path, text.as_bytes())?;
        }
        answer.files = paths.iter().map(|path| path.display().to_string()).collect();
    } else {
        error(&format!("error: {}", answer.message));
    }
    answer.warnings.iter().for_each(|warning| remark(&format!("warning: {warning}")));
    answer.lost.iter().for_each(|lost| remark(&format!("warning: not kept: {lost}")));
    match (args.json, answer.status) {
        (true, _) => print(&format!("{}\n", serde_json::to_string(&answer)?))?,
        (false, Status::Ok) => print(&words(args, &answer))?,
        (false, _) => {}
    }
    Ok(Outcome::of([answer.status]))
}

impl Convert {
    fn request(&self) -> ConvertRequest {
        let to = match self.to {
            ConvertTo::FieldLayout { keys_of_2027, .. } => {
                ConvertTo::FieldLayout { keys_of_2027, field_size_m: self.field_size_m }
            }
            cameras => cameras,
        };
        ConvertRequest {
            files: self.files.clone(),
            to,
            reference: self.reference.clone(),
            image_size_px: self.image_size_px,
        }
    }
}

/// OUT itself for one file, unless it is a folder; below OUT for several. Folders are made.
fn paths(out: &Path, names: &[String]) -> Result<Vec<PathBuf>> {
    let paths: Vec<PathBuf> = match names {
        [_] if !out.is_dir() && !out.as_os_str().to_string_lossy().ends_with('/') => {
            crate::files::must_be_writable(out)?;
            vec![out.to_path_buf()]
        }
        names => {
            crate::files::make_folder("-o", out)?;
            names.iter().map(|name| out.join(name)).collect()
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

fn words(args: &Convert, answer: &ConvertAnswer) -> String {
    let list: String = answer.files.iter().map(|file| format!("  {file}\n")).collect();
    if let ConvertTo::FieldLayout { .. } = args.to {
        return format!("{}:\n{list}", answer.message);
    }
    let checked = match answer.checked {
        true => "read back and compared with what was meant",
        false => "Resight only writes this format, so the files were not read back",
    };
    format!("{}\n{}, {checked}:\n{list}", answer.message, args.to.name())
}
