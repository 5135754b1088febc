//! `map`: where the tags of a place are, from one camera that was carried through it.

use crate::args::{parse_metres_pair, positive};
use crate::output::{Outcome, error, print_answer, remark, with_progress};
use crate::text::line;
use anyhow::{Result, bail};
use clap::Args;
use resight::answer::{MapAnswer, SolvedMap, Status};
use resight::core::Target;
use resight::formats::{self, write_atomically};
use resight::input::Kind;
use resight::map::{MapImage, MapRequest, map_from_images, map_from_rows, read_tag_rows};
use resight::report::verdict::figures;
use resight::report::words::{coordinate, counted, degrees};
use std::path::PathBuf;

/// Makes a map of tags: the pose of every tag of a place, from one camera carried through it.
///
/// Views must show two tags or more, each overlapping with the next; nothing needs to be surveyed. The answer is each tag's pose with its
/// covariance in the frame of one tag, or in the world of tags that are known. Tags that were moved, occur twice or have another size are
/// named and left out of the files.
#[derive(Debug, Args)]
#[command(after_help = "Example: resight map 'walk/*.jpg' --camera camera.toml --size-m 0.165 -o map.toml")]
#[command(after_long_help = "Examples:
  resight map 'walk/*.jpg' --camera camera.toml --family tag36h11 --size-m 0.165 -o map.toml
  resight map walk.mp4 --camera camera.toml --size-m 0.165 --known surveyed.toml --field-layout field.json
  resight map --detections corners.csv --camera camera.toml --size-m 0.165 --known map.toml -o map.toml --json

`resight locate`, `watch` and `rig` take the file of -o as --target; `resight map --known` updates it with new images.")]
pub struct Map {
    /// PNG or JPEG images, patterns such as 'walk/*.png', or videos, in the order in which they were taken.
    #[arg(value_name = "IMAGE", required_unless_present = "detections")]
    images: Vec<String>,
    /// Camera file in any supported format; FILE#NAME picks one of several.
    #[arg(long, value_name = "FILE")]
    camera: String,
    /// Family of the tags (tag36h11, DICT_5X5_100, …) [default: that of --known, or tag36h11].
    #[arg(long, value_name = "FAMILY")]
    family: Option<String>,
    /// Outer edge of the black square of the tags, in metres.
    ///
    /// Tags of --known have their own.
    #[arg(long, value_name = "M", allow_negative_numbers = true, value_parser = positive)]
    size_m: Option<f64>,
    /// Size of a single tag that differs, ID=METRES.
    #[arg(long, hide_short_help = true, help_heading = "Tags", value_name = "ID=M", num_args = 1..)]
    tag_size: Vec<String>,
    /// Corners that were found already (CSV), instead of images.
    ///
    /// The columns are view,id,corner,u_px,v_px and optionally sigma_px, in the order in which the views were taken. Where a view shows an id
    /// twice, the first rows of its corners are one tag, the second rows another.
    #[arg(long, value_name = "FILE.csv", conflicts_with = "images")]
    detections: Option<PathBuf>,
    /// Standard deviation of u_px and v_px where the detections have no sigma_px [default: 0.5].
    #[arg(long, hide_short_help = true, help_heading = "Tags", value_name = "S", requires = "detections", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: Option<f64>,
    /// Tags whose poses are known, from a survey or an earlier map: own TOML, or a WPILib field layout.
    ///
    /// They determine the world, with the covariance that the file states; what contradicts the others is named. The answer is the map of
    /// these and of all new tags.
    #[arg(long, help_heading = "World", value_name = "FILE")]
    known: Option<PathBuf>,
    /// The tag whose frame is the world without --known [default: the one that most views show].
    #[arg(long, hide_short_help = true, help_heading = "World", value_name = "ID")]
    reference: Option<u32>,
    /// Prints one JSON object on stdout and nothing else.
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Writes the map to FILE (TOML), which other commands take as --target.
    #[arg(long, short, help_heading = "Output", value_name = "FILE")]
    output: Option<PathBuf>,
    /// Writes the map to FILE as a WPILib field layout (JSON).
    #[arg(long, hide_short_help = true, help_heading = "Output", value_name = "FILE.json")]
    field_layout: Option<PathBuf>,
    /// Length and width of the field for --field-layout, in metres [default: the box around the tags].
    #[arg(long, hide_short_help = true, help_heading = "Output", value_name = "LxW", requires = "field_layout", value_parser = parse_metres_pair)]
    field_size_m: Option<(f64, f64)>,
    /// Adds the covariance of all tags together to the JSON.
    ///
    /// The file of -o always holds it.
    #[arg(long, hide_short_help = true, help_heading = "Output")]
    joint_covariance: bool,
}

/// See `Map`.
pub fn run(args: &Map) -> Result<Outcome> {
    for path in [&args.output, &args.field_layout].into_iter().flatten() {
        crate::files::must_be_writable(path)?;
    }
    let request = request(args)?;
    let answer = match &args.detections {
        Some(path) => {
            crate::files::must_exist(path)?;
            let rows = read_tag_rows(path)?;
            with_progress(|| map_from_rows(&rows, &request))?
        }
        None => {
            let images: Vec<MapImage> =
                crate::files::expand(&args.images)?.into_iter().map(MapImage::File).collect();
            with_progress(|| map_from_images(&images, &request))?
        }
    };
    match answer {
        MapAnswer::Solved(solved) => answered(args, &solved),
        MapAnswer::Unsolved(reason) => {
            print_answer(args.json, &reason, &format!("NO MAP   {}\n", reason.message), reason.status)?;
            error(&format!("error: {}", reason.message));
            Ok(Outcome::of([reason.status]))
        }
    }
}

fn request(args: &Map) -> Result<MapRequest> {
    let (camera, remarks) = formats::read_camera_with_remarks(&args.camera)?;
    remarks.iter().for_each(|text| remark(&format!("warning: {text}")));
    let known = args.known.as_ref().map(|path| -> Result<_> {
        let (target, _) = super::target(path, &crate::args::TagArgs::default(), remark)?;
        match target {
            Target::TagMap(map) => Ok(map),
            other => bail!("--known {}: holds a {}, a map of tags is needed", path.display(), other.kind()),
        }
    });
    let known = known.transpose()?;
    let family = args.family.clone().or_else(|| known.as_ref().map(|map| map.family.clone()));
    let sizes = args.tag_size.iter().map(|text| {
        let parts = text
            .split_once('=')
            .and_then(|(id, size)| Some((id.trim().parse().ok()?, positive(size.trim()).ok()?)));
        parts.ok_or_else(|| {
            anyhow::anyhow!("--tag-size {text}: an id and its size in metres are needed, e.g. 7=0.08")
        })
    });
    Ok(MapRequest {
        size_m: args.size_m,
        sizes_m: sizes.collect::<Result<_>>()?,
        reference: args.reference,
        known,
        sigma_px: args.sigma_px.unwrap_or(0.5),
        joint_covariance: args.joint_covariance,
        ..MapRequest::new(camera, family.unwrap_or_else(|| "tag36h11".to_string()))
    })
}

/// Prints and writes the map.
fn answered(args: &Map, solved: &SolvedMap) -> Result<Outcome> {
    solved.remarks.iter().for_each(|text| remark(text));
    let mut unwritten = Vec::new();
    if let Some(path) = &args.output {
        match solved.file() {
            Some(text) => {
                Kind::Toml.must_hold(path, text.len())?;
                write_atomically(path, text.as_bytes())?;
            }
            None => unwritten.push(path),
        }
    }
    if let Some(path) = &args.field_layout {
        match solved.target() {
            Some(_) => {
                let size_m = args.field_size_m.map(|(length, width)| [length, width]);
                write_atomically(path, solved.field_layout(size_m)?.as_bytes())?;
            }
            None => unwritten.push(path),
        }
    }
    print_answer(args.json, solved, &describe(solved), solved.status())?;
    for path in unwritten {
        error(&format!("error: {} is not written, because the map is not to be relied on", path.display()));
    }
    Ok(Outcome::of([solved.status()]))
}

fn describe(solved: &SolvedMap) -> String {
    let mut out = format!("{}   {}\n", solved.status().name().to_uppercase(), solved.message());
    for (i, id) in solved.ids.iter().enumerate() {
        let tag = &solved.solution.targets[i];
        let status = solved.tag_status(i);
        let mut text = String::new();
        if let Some(pose) = &tag.world_from_target {
            let sigma_m = resight::report::words::translation_sigma_m(pose, &tag.covariance);
            let at: Vec<String> =
                (0..3).map(|axis| coordinate(pose.translation[axis], sigma_m[axis])).collect();
            let (sigma_rad, _) = resight::report::words::sigmas(&tag.covariance);
            let turned = sigma_rad.iter().map(|x| x * x).sum::<f64>().sqrt();
            text = format!(
                "{}   rotation ± {}   {}, {} px",
                at.join("  "),
                degrees(turned),
                counted(tag.n_used, "view"),
                figures(tag.rms_px)
            );
        }
        if status != Status::Ok {
            text = format!("{}   {text}", status.name().to_uppercase());
        }
        line(&mut out, &format!("tag {id}"), text.trim());
        if let Some(message) = solved.tag_message(i) {
            line(&mut out, "", &message);
        }
    }
    let n_left_out = solved.left_out.len();
    if let Some(first) = solved.left_out.first() {
        let text = format!(
            "{}, such as {} of {}: {}",
            counted(n_left_out, "input"),
            first.what,
            first.view,
            first.reason
        );
        line(&mut out, "left out", &text);
    }
    out
}
