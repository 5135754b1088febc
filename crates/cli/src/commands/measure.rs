//! `measure`: lengths, positions, angles, areas and heights from photographs, each with its 95 % interval.

use crate::output::{Outcome, print};
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use resight::GrayImage;
use resight::answer::MeasureAnswer;
use resight::answer::measure::NetworkAnswer;
use resight::formats::cells;
use resight::image::exif;
use resight::input::{self, Kind};
use resight::measure::words::{self, frame_words, values_in_words};
use resight::measure::{Answers, NamedScene, birdseye, map, measure, plan, read_scene, rig_scene, table};
use resight::report::verdict::Status;
use resight::report::words::counted;
use std::path::{Path, PathBuf};

/// Lengths, positions, angles, areas and heights from photographs, each with its 95 % interval.
///
/// SCENE.toml names photographs, cameras, marks (coordinates or known distances), the ground, image points and questions: docs/measuring.md.
/// With --views the cameras of a rig file look at points from known places instead. The exit status is 0 if the network and every answer
/// are ok, 1 if anything is not (contradicted, ambiguous, without a value), 2 if the scene file is wrong.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight measure accident.toml -o accident
  resight measure accident.toml --json
  resight measure --views rig.toml --image-points points.csv --sigma-px 0.5")]
pub struct Measure {
    /// The scene file: photographs, cameras, control points, image points, queries.
    #[arg(value_name = "SCENE.toml", required_unless_present = "views", conflicts_with = "views")]
    scene: Option<PathBuf>,
    /// Triangulates points seen by the cameras of this rig file, in its frame.
    #[arg(long, value_name = "RIG.toml", requires = "image_points")]
    views: Option<PathBuf>,
    /// With --views: where each camera saw each point; columns photo (a camera's name), point, u_px, v_px and optionally sigma_px.
    #[arg(long, alias = "clicks", value_name = "POINTS.csv", requires = "views")]
    image_points: Option<PathBuf>,
    /// With --views: standard deviation of u and v where the file has no sigma_px [default: 1]
    #[arg(long, value_name = "S", requires = "views", allow_negative_numbers = true, value_parser = crate::args::positive)]
    sigma_px: Option<f64>,
    /// Prints JSON Lines on stdout: one object per query, then one for the whole network.
    #[arg(long)]
    json: bool,
    /// Writes table.csv, plan.svg, plan.png, birdseye-PHOTO.png, and of control points on the Earth map.geojson and map.kml into this folder.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// See `Measure`.
pub fn run(args: &Measure) -> Result<Outcome> {
    let (scene, title) = scene(args)?;
    if let Some(folder) = &args.output {
        crate::files::make_folder("-o", folder)?;
    }
    let answer = crate::output::with_progress(|| measure(&scene)).with_context(|| title.clone())?;
    print(&if args.json { json(&answer)? } else { in_words(&scene, &answer) })?;
    if let (Some(folder), Some(solved)) = (&args.output, &answer.solved) {
        let written = write_files(folder, &scene, solved, &title)?;
        if !args.json {
            print(&format!("\nwritten: {}\n", written.join(", ")))?;
        }
    }
    Ok(if answer.is_ok() { Outcome::Answered } else { Outcome::SomeUnanswered })
}

fn json(answer: &MeasureAnswer) -> Result<String> {
    let answers = answer.answers.iter().map(serde_json::to_string);
    let lines = answers.chain([serde_json::to_string(&answer.network)]);
    Ok(lines.collect::<Result<Vec<String>, _>>()?.join("\n") + "\n")
}

fn in_words(scene: &NamedScene, answer: &MeasureAnswer) -> String {
    match (&answer.solved, &answer.network) {
        (Some(solved), _) => solved_in_words(scene, solved),
        (None, NetworkAnswer::Refused(refused)) => {
            let rows = scene.queries.iter().map(|q| format!("{}  {}  no value\n", q.name, q.kind.name()));
            format!("{}: {}\n\n{}", refused.status.name(), refused.message, rows.collect::<String>())
        }
        (None, NetworkAnswer::Solved(_)) => String::new(), // It comes with the solution.
    }
}

fn scene(args: &Measure) -> Result<(NamedScene, String)> {
    let title = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    match (&args.scene, &args.views, &args.image_points) {
        (Some(path), _, _) => {
            crate::files::must_exist(path)?;
            Ok((read_scene(path)?, title(path)))
        }
        (None, Some(rig), Some(image_points)) => {
            crate::files::must_exist(rig)?;
            crate::files::must_exist(image_points)?;
            let warnings = resight::formats::read_cameras(rig)?.warnings;
            warnings.iter().for_each(|w| crate::output::remark(&format!("warning: {}: {w}", rig.display())));
            Ok((rig_scene(rig, image_points, args.sigma_px)?, title(rig)))
        }
        _ => bail!("give a scene file, or --views with --image-points"),
    }
}

/// A table: name, kind, value ± half of its 95 % interval; then how well everything fits.
fn solved_in_words(scene: &NamedScene, answers: &Answers) -> String {
    let name_width = cells::width(answers.answers.iter().map(|a| a.query.name.as_str()));
    let kind_width = cells::width(answers.answers.iter().map(|a| a.query.kind.name()));
    let mut out: String = answers.verdict.iter().map(|line| format!("{line}\n")).collect();
    if !out.is_empty() {
        out += "\n";
    }
    for a in &answers.answers {
        let mut said = match &a.result {
            Ok(values) => values_in_words(a.query.kind, values),
            Err(reason) => format!("no value: {reason}"),
        };
        if let Some(other) = &a.other {
            said += &format!("   or   {}", values_in_words(a.query.kind, other));
        }
        if let Some(text) = words::reliability(scene, a.query.kind, &a.reliability) {
            said += &format!("   ({text})");
        }
        let status = answers.word(a.status);
        if a.result.is_ok() && status != Status::Ok {
            said += &format!("   {}", status.name().to_uppercase());
        }
        let (name, kind) = (&a.query.name, a.query.kind.name());
        out += &format!("{}  {}  {said}\n", cells::left(name, name_width), cells::left(kind, kind_width));
    }
    for a in &answers.answers {
        if let Some(text) = words::budget(&a.budgets) {
            out += &format!("{}  budget  {text}\n", cells::left(&a.query.name, name_width));
        }
    }
    let adjusted = &answers.adjusted;
    out += &format!(
        "\n± is half of the 95 % interval. {}, {}; {}; positions {}.\n",
        counted(
            (0..scene.photos.len()).filter(|p| adjusted.cam_from_world(*p).is_some()).count(),
            "photograph"
        ),
        counted((0..scene.points.len()).filter(|p| adjusted.point(*p).is_some()).count(), "point"),
        match adjusted.degrees_of_freedom {
            0 => "nothing left over to check with".to_string(),
            n => format!("χ² {:.1} for {n} degrees of freedom", adjusted.chi2),
        },
        frame_words(scene, adjusted.frame)
    );
    answers.remarks.iter().for_each(|remark| out += &format!("{remark}\n"));
    out
}

/// Writes the table and the images; the names of the files.
fn write_files(folder: &Path, scene: &NamedScene, answers: &Answers, title: &str) -> Result<Vec<String>> {
    let mut written = Vec::new();
    let mut write = |name: String, bytes: &[u8]| -> Result<()> {
        let path = folder.join(&name);
        resight::formats::write_atomically(&path, bytes)?;
        written.push(path.display().to_string());
        Ok(())
    };
    write("table.csv".into(), table::csv(answers).as_bytes())?;
    if let Some(features) = map::features(scene, answers) {
        write("map.geojson".into(), features.geojson().as_bytes())?;
        write("map.kml".into(), features.kml().as_bytes())?;
    }
    if let Some(drawing) = plan::plan(scene, answers, title) {
        write("plan.svg".into(), drawing.svg().as_bytes())?;
        write("plan.png".into(), &drawing.png().map_err(|reason| anyhow!("plan.png: {reason}"))?)?;
    }
    for (index, photo) in scene.photos.iter().enumerate() {
        let Some(file) = &photo.file else { continue };
        let image = GrayImage::read(file)?;
        let heading = exif::heading(&input::read(file, Kind::Image)?);
        if let Some(canvas) = birdseye::birdseye(scene, answers, index, &image, heading) {
            let png = canvas.png().map_err(|reason| anyhow!("birdseye-{}.png: {reason}", photo.name))?;
            write(format!("birdseye-{}.png", file_name(&photo.name)), &png)?;
        }
    }
    Ok(written)
}

/// A photograph's name as part of a file name.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}
