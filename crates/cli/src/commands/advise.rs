//! `advise`: where to put the next point, target or board, and how sure it will make the answer.

mod board;
mod points;
mod read;
mod say;
mod target;

use crate::args::{TagArgs, positive};
use crate::output::Outcome;
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use resight::advise::heat::{HeatMap, draw};
use resight::core::Camera;
use resight::formats::{self, NamedCamera};
use std::path::{Path, PathBuf};

/// Where to put the next point, target or board for the smallest uncertainty. Nothing has to be photographed yet.
///
/// Three questions, told apart by what is given: --points, marks measured so far (where should the next one go?); --target with one
/// camera (how sure over a volume, and which change of the target helps?); --target with a file of several cameras (where should the
/// next board go?). Every figure is one standard deviation; where a first-order figure does not hold, the answer says so.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight advise --camera camera.toml --points marks.csv --region-m -5,8,5,20 --length-m -1.5,13,2.3,14 -o advice
  resight advise --camera camera.toml --points marks.csv --pose pose.json --candidates places.csv --json
  resight advise --camera camera.toml --target dots.toml --distance-m 0.5..2 --tilt-deg 10..60 -o advice
  resight advise --camera rig.toml --target board.toml --views views.jsonl --distance-m 1..3 -o advice

marks.csv has columns x_m,y_m,z_m and, where the marks were seen already, u_px,v_px (then no --pose is needed); optionally id, sigma_m.
pose.json is a pose object as `solve --json` or `locate --json` prints it; views.jsonl has one object with rig_from_target a line.")]
pub struct Advise {
    /// Camera file; one that holds several cameras with poses is a rig. FILE#NAME picks one.
    #[arg(long, value_name = "FILE")]
    camera: String,
    /// Marks measured so far.
    #[arg(long, value_name = "FILE.csv", required_unless_present = "target", conflicts_with = "target")]
    points: Option<PathBuf>,
    /// The target or board.
    #[arg(long, value_name = "FILE")]
    target: Option<PathBuf>,
    /// Standard deviation of u and v.
    #[arg(long, value_name = "S", default_value = "0.5", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: f64,
    /// Points: about where the camera is, where the marks have no pixels yet.
    #[arg(long, value_name = "FILE.json", requires = "points")]
    pose: Option<PathBuf>,
    /// Points: the places to choose from, columns x_m,y_m,z_m and optionally id, sigma_m [default: a grid over the region]
    #[arg(long, value_name = "FILE.csv", requires = "points", conflicts_with = "region_m")]
    candidates: Option<PathBuf>,
    /// Points: height of the ground in the target frame.
    #[arg(long, value_name = "Z", default_value = "0", allow_negative_numbers = true, value_parser = number)]
    ground_z_m: f64,
    /// Points: where on the ground the next one may go [default: around the marks]
    #[arg(long, value_name = "X0,Y0,X1,Y1", requires = "points", allow_hyphen_values = true, value_parser = region)]
    region_m: Option<[f64; 4]>,
    /// Points: ends of a length that will be measured on the ground.
    #[arg(long, value_name = "X1,Y1,X2,Y2", requires = "points", allow_hyphen_values = true, value_parser = four)]
    length_m: Option<[f64; 4]>,
    /// Points: what to make sure of [default: length where one is given, else place]
    #[arg(long, value_name = "AIM", requires = "points")]
    minimise: Option<AimName>,
    /// Target: how far the camera or the boards are from it.
    #[arg(long, value_name = "A..B", requires = "target", allow_hyphen_values = true, value_parser = range)]
    distance_m: Option<[f64; 2]>,
    /// Target: how far off its front the camera stands.
    #[arg(long, value_name = "A..B", requires = "target", default_value = "0..60", allow_hyphen_values = true, value_parser = tilts)]
    tilt_deg: [f64; 2],
    /// Target: in which direction around it, from its x axis (0) towards its y axis (90).
    #[arg(long, value_name = "A..B", requires = "target", default_value = "-180..180", allow_hyphen_values = true, value_parser = directions)]
    direction_deg: [f64; 2],
    /// Rig: boards seen so far, one object with rig_from_target a line.
    #[arg(long, value_name = "FILE.jsonl", requires = "target")]
    views: Option<PathBuf>,
    /// Rig: how many boards to plan, each with those before it taken as seen.
    #[arg(long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u8).range(1..=50))]
    next: u8,
    /// Rig: what to make small.
    #[arg(long, value_name = "WHAT", default_value = "worst")]
    criterion: CriterionName,
    /// Rig: the camera whose frame is the rig's [default: the first]
    #[arg(long, value_name = "NAME", requires = "target")]
    reference: Option<String>,
    /// JSON Lines on stdout, one object a suggestion, and nothing else.
    #[arg(long)]
    json: bool,
    /// Folder for pictures (PNG).
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// What is to become sure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum AimName {
    /// The camera's place, worst direction.
    Place,
    /// Its rotation, worst axis.
    Rotation,
    /// The length of --length-m.
    Length,
}

/// What is to become small in a rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum CriterionName {
    /// The place of the camera known worst.
    Worst,
    /// The sum of the variances of all places.
    Trace,
    /// The volume of the whole uncertainty.
    Determinant,
}

/// See `Advise`.
pub fn run(args: &Advise) -> Result<Outcome> {
    if let Some(folder) = &args.output {
        crate::files::make_folder("-o", folder)?;
    }
    let cameras = cameras(&args.camera)?;
    match (&args.points, cameras.as_slice()) {
        (Some(file), [one]) => points::run(args, &one.camera, file),
        (Some(_), several) => bail!(
            "{}: holds {} cameras; marks are seen by one, pick it: {}#{}",
            args.camera,
            several.len(),
            args.camera,
            several[0].name
        ),
        (None, [one]) => target::run(args, &one.camera),
        (None, several) => board::run(args, several),
    }
}

/// All cameras of a file, or the one named.
fn cameras(argument: &str) -> Result<Vec<NamedCamera>> {
    crate::files::camera_must_exist(argument)?;
    match Path::new(argument).exists() {
        true => Ok(formats::read_cameras(Path::new(argument))?.cameras),
        false => Ok(vec![formats::read_camera(argument)?]),
    }
}

impl Advise {
    /// The target file, its warnings told.
    fn target(&self) -> Result<resight::core::Target> {
        let Some(path) = &self.target else { bail!("--target FILE is needed") };
        Ok(super::target(path, &TagArgs::default(), |text| self.remark(text))?.0)
    }

    fn remark(&self, text: &str) {
        crate::output::remark(text);
    }

    /// Writes a map; says where.
    fn picture(&self, name: &str, map: Option<HeatMap>) -> Result<()> {
        let (Some(folder), Some(map)) = (&self.output, map) else { return Ok(()) };
        let png = draw(&map).png().map_err(|reason| anyhow::anyhow!("{name}: {reason}"))?;
        let path = folder.join(name);
        formats::write_atomically(&path, &png)?;
        self.remark(&format!("written: {}", path.display()));
        Ok(())
    }
}

/// Unit of image coordinates matters here: the figures are of pixels.
fn must_have_image(camera: &Camera, argument: &str) -> Result<()> {
    if camera.size.is_none() {
        bail!(
            "{argument}: the camera file has no image size; add width_px and height_px, or nobody knows what it can see"
        );
    }
    Ok(())
}

fn numbers<const N: usize>(text: &str, separator: &str, needed: &str) -> Result<[f64; N], String> {
    let parts: Result<Vec<f64>, _> = text.split(separator).map(|part| part.trim().parse::<f64>()).collect();
    let all = parts.ok().and_then(|p| <[f64; N]>::try_from(p).ok()).ok_or(needed)?;
    if all.iter().all(|x| x.is_finite()) { Ok(all) } else { Err(needed.to_string()) }
}

fn number(text: &str) -> Result<f64, String> {
    Ok(numbers::<1>(text, ",", "a number is needed")?[0])
}

fn four(text: &str) -> Result<[f64; 4], String> {
    numbers(text, ",", "four numbers are needed, e.g. -1.5,13,2.3,14")
}

fn region(text: &str) -> Result<[f64; 4], String> {
    let [x0, y0, x1, y1] = numbers(text, ",", "four numbers X0,Y0,X1,Y1 are needed, e.g. -5,8,5,20")?;
    let is_box = x0 < x1 && y0 < y1;
    if is_box { Ok([x0, y0, x1, y1]) } else { Err("X0 < X1 and Y0 < Y1 are needed".to_string()) }
}

fn range(text: &str) -> Result<[f64; 2], String> {
    let needed = "a range A..B of positive numbers is needed, e.g. 0.5..3";
    let [a, b] = numbers(text, "..", needed)?;
    let is_range = 0.0 < a && a <= b;
    if is_range { Ok([a, b]) } else { Err(needed.to_string()) }
}

fn tilts(text: &str) -> Result<[f64; 2], String> {
    let needed = "a range A..B of degrees from 0 to 85 is needed, e.g. 10..60";
    let [a, b] = numbers(text, "..", needed)?;
    let is_range = 0.0 <= a && a <= b && b <= 85.0;
    if is_range { Ok([a, b]) } else { Err(needed.to_string()) }
}

fn directions(text: &str) -> Result<[f64; 2], String> {
    let needed = "a range A..B of degrees, A ≤ B, each from -360 to 360, is needed, e.g. 60..120";
    let [a, b] = numbers(text, "..", needed)?;
    let is_range = -360.0 <= a && a <= b && b <= 360.0;
    if is_range { Ok([a, b]) } else { Err(needed.to_string()) }
}
