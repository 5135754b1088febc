//! `measure`: lengths, positions, angles, areas and heights from photographs, each with its 95 % interval.

use crate::output::{Outcome, print};
use anyhow::{Result, anyhow, bail};
use clap::Args;
use resight::GrayImage;
use resight::core::multiview::network::{Frame, Measured, SurveyStatus};
use resight::measure::{
    Answers, NamedQuery, NamedScene, QueryAnswer, QueryKind, Refusal, birdseye, measure, plan, read_scene,
    rig_scene, table, words,
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Lengths, positions, angles, areas and heights from photographs, each with its 95 % interval.
///
/// SCENE.toml names photographs, cameras, marks (coordinates or known distances), the ground, clicks and questions: docs/measuring.md.
/// With --views the cameras of a rig file look at points from known places instead. The exit status is 0 if the survey and every answer
/// are ok, 1 if anything is not (contradicted, ambiguous, without a value), 2 if the scene file is wrong.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight measure accident.toml -o accident
  resight measure accident.toml --json
  resight measure --views rig.toml --clicks points.csv --sigma-px 0.5")]
pub struct Measure {
    /// The scene file.
    #[arg(value_name = "SCENE.toml", required_unless_present = "views", conflicts_with = "views")]
    scene: Option<PathBuf>,
    /// Rig file whose cameras have places; points are triangulated in its frame.
    #[arg(long, value_name = "RIG.toml", requires = "clicks")]
    views: Option<PathBuf>,
    /// With --views: where each camera saw each point; columns photo (a camera's name), point, u_px, v_px and optionally sigma_px.
    #[arg(long, value_name = "CLICKS.csv", requires = "views")]
    clicks: Option<PathBuf>,
    /// With --views: standard deviation of u and v where the file has no sigma_px [default: 1]
    #[arg(long, value_name = "S", requires = "views", allow_negative_numbers = true, value_parser = crate::args::positive)]
    sigma_px: Option<f64>,
    /// JSON Lines on stdout: one object per question, then one for the whole survey.
    #[arg(long)]
    json: bool,
    /// Folder for table.csv, plan.svg, plan.png and birdseye-PHOTO.png.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// See `Measure`.
pub fn run(args: &Measure) -> Result<Outcome> {
    let (scene, title) = scene(args)?;
    if let Some(folder) = &args.output {
        crate::files::make_folder("-o", folder)?;
    }
    let answers = match measure(&scene) {
        Ok(answers) => answers,
        Err(Refusal { status: None, reason }) => bail!("{title}: {reason}"),
        Err(Refusal { status: Some(status), reason }) => {
            print(&refused(&scene, status, &reason, args.json)?)?;
            return Ok(Outcome::SomeUnanswered);
        }
    };
    let text = if args.json { json(&scene, &answers)? } else { in_words(&scene, &answers) };
    print(&text)?;
    if let Some(folder) = &args.output {
        let written = write_files(folder, &scene, &answers, &title)?;
        if !args.json {
            print(&format!("\nwritten: {}\n", written.join(", ")))?;
        }
    }
    let is_ok = |status: SurveyStatus| status == SurveyStatus::Ok;
    let all = is_ok(answers.status) && answers.answers.iter().all(|a| is_ok(a.status));
    Ok(if all { Outcome::Answered } else { Outcome::SomeUnanswered })
}

/// A survey without any answer: the reason first, then each question without a value.
fn refused(scene: &NamedScene, status: SurveyStatus, reason: &str, as_json: bool) -> Result<String> {
    if !as_json {
        let rows = scene.queries.iter().map(|q| format!("{}  {}  no value\n", q.name, q.kind.name()));
        return Ok(format!("{}: {reason}\n\n{}", status.name(), rows.collect::<String>()));
    }
    let mut out = String::new();
    for query in &scene.queries {
        let object =
            AnswerObject { status: status.name(), message: reason.to_string(), ..base(scene, query) };
        out += &format!("{}\n", serde_json::to_string(&object)?);
    }
    let survey = RefusedObject { kind: "survey", status: status.name(), message: reason };
    Ok(out + &format!("{}\n", serde_json::to_string(&survey)?))
}

fn scene(args: &Measure) -> Result<(NamedScene, String)> {
    let title = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    match (&args.scene, &args.views, &args.clicks) {
        (Some(path), _, _) => {
            crate::files::must_exist(path)?;
            Ok((read_scene(path)?, title(path)))
        }
        (None, Some(rig), Some(clicks)) => {
            crate::files::must_exist(rig)?;
            crate::files::must_exist(clicks)?;
            let warnings = resight::formats::read_cameras(rig)?.warnings;
            warnings.iter().for_each(|w| crate::output::remark(&format!("warning: {}: {w}", rig.display())));
            Ok((rig_scene(rig, clicks, args.sigma_px)?, title(rig)))
        }
        _ => bail!("give a scene file, or --views with --clicks"),
    }
}

/// A table: name, kind, value ± half of its 95 % interval; then how well everything fits.
fn in_words(scene: &NamedScene, answers: &Answers) -> String {
    let width = |text: fn(&QueryAnswer) -> String| {
        answers.answers.iter().map(|a| text(a).chars().count()).max().unwrap_or(0)
    };
    let name_width = width(|a| a.query.name.clone());
    let kind_width = width(|a| a.query.kind.name().to_string());
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
        if a.result.is_ok() && a.status != SurveyStatus::Ok {
            said += &format!("   {}", a.status.name().to_uppercase());
        }
        out += &format!("{:name_width$}  {:kind_width$}  {said}\n", a.query.name, a.query.kind.name());
    }
    let adjusted = &answers.adjusted;
    out += &format!(
        "\n± is half of the 95 % interval. {} photographs, {} points; {}; positions {}.\n",
        (0..scene.photos.len()).filter(|p| adjusted.cam_from_world(*p).is_some()).count(),
        (0..scene.points.len()).filter(|p| adjusted.point(*p).is_some()).count(),
        match adjusted.degrees_of_freedom {
            0 => "nothing left over to check with".to_string(),
            n => format!("χ² {:.1} for {n} degrees of freedom", adjusted.chi2),
        },
        frame_words(scene, adjusted.frame)
    );
    answers.remarks.iter().for_each(|remark| out += &format!("{remark}\n"));
    out
}

fn values_in_words(kind: QueryKind, values: &[Measured]) -> String {
    match values {
        [x, y, z] => {
            let axes = [("x", x), ("y", y), ("z", z)];
            axes.map(|(axis, m)| format!("{axis} {}", words::value(kind, m))).join("   ")
        }
        _ => values.iter().map(|m| words::value(kind, m)).collect(),
    }
}

fn frame_words(scene: &NamedScene, frame: Frame) -> String {
    match frame {
        Frame::Marks([a, b, c]) => {
            let name = |p: usize| &scene.points[p];
            format!("from {}, x towards {}, z up from the plane through {}", name(a), name(b), name(c))
        }
        Frame::Held => "relative to each other only".to_string(),
        Frame::Given => "in the given frame".to_string(),
    }
}

/// One answer. Keys without a value are null; the unit is in the key.
#[derive(Debug, Default, Serialize)]
struct AnswerObject {
    query: String,
    kind: &'static str,
    points: Vec<String>,
    status: &'static str,
    #[serde(flatten)]
    values: serde_json::Map<String, serde_json::Value>,
    message: String,
}

#[derive(Debug, Serialize)]
struct PhotoObject {
    name: String,
    cam_from_world: Option<resight::answer::TransformObject>,
    covariance: Option<Vec<Vec<f64>>>,
}

#[derive(Debug, Serialize)]
struct PointObject {
    name: String,
    is_mark: bool,
    position_m: Option<[f64; 3]>,
    covariance_m2: Option<Vec<Vec<f64>>>,
}

/// A survey without any answer.
#[derive(Debug, Serialize)]
struct RefusedObject<'a> {
    kind: &'static str,
    status: &'static str,
    message: &'a str,
}

/// The survey behind the answers.
#[derive(Debug, Serialize)]
struct SurveyObject {
    kind: &'static str,
    status: &'static str,
    /// What is wrong; empty where nothing is.
    message: String,
    frame: String,
    chi2: f64,
    degrees_of_freedom: usize,
    noise_scale: f64,
    rival_delta_chi2: Option<f64>,
    photos: Vec<PhotoObject>,
    points: Vec<PointObject>,
    suspects: Vec<String>,
    remarks: Vec<String>,
}

fn json(scene: &NamedScene, answers: &Answers) -> Result<String> {
    let mut out = String::new();
    for answer in &answers.answers {
        out += &format!("{}\n", serde_json::to_string(&answer_object(scene, answer))?);
    }
    Ok(out + &format!("{}\n", serde_json::to_string(&survey_object(scene, answers))?))
}

fn answer_object(scene: &NamedScene, answer: &QueryAnswer) -> AnswerObject {
    let suffix = match answer.query.kind {
        QueryKind::Angle => "rad",
        QueryKind::Area => "m2",
        _ => "m",
    };
    let base = base(scene, &answer.query);
    let status = answer.status.name();
    match &answer.result {
        Ok(values) => {
            let mut entries = entries(values, suffix);
            let mut message = values_in_words(answer.query.kind, values);
            if let Some(other) = &answer.other {
                message += &format!(" or {}", values_in_words(answer.query.kind, other));
                entries.insert("other".to_string(), self::entries(other, suffix).into());
            }
            AnswerObject { status, values: entries, message, ..base }
        }
        Err(reason) => AnswerObject { status, message: reason.clone(), ..base },
    }
}

/// What every answer begins with.
fn base(scene: &NamedScene, query: &NamedQuery) -> AnswerObject {
    AnswerObject {
        query: query.name.clone(),
        kind: query.kind.name(),
        points: query.points.iter().map(|p| scene.points[*p].clone()).collect(),
        ..AnswerObject::default()
    }
}

/// Value, sigma and interval; one number each, or three for a position.
fn entries(values: &[Measured], suffix: &str) -> serde_json::Map<String, serde_json::Value> {
    let one_or_three = |of: fn(&Measured) -> f64| match values {
        [one] => serde_json::Value::from(of(one)),
        many => serde_json::Value::from(many.iter().map(of).collect::<Vec<f64>>()),
    };
    let entries = [
        ("value", one_or_three(|m| m.value)),
        ("sigma", one_or_three(|m| m.sigma)),
        ("low_95", one_or_three(|m| m.low)),
        ("high_95", one_or_three(|m| m.high)),
    ];
    entries.map(|(key, value)| (format!("{key}_{suffix}"), value)).into_iter().collect()
}

fn survey_object(scene: &NamedScene, answers: &Answers) -> SurveyObject {
    let adjusted = &answers.adjusted;
    let photo = |(i, photo): (usize, &resight::measure::ScenePhoto)| PhotoObject {
        name: photo.name.clone(),
        cam_from_world: adjusted.cam_from_world(i).map(resight::answer::TransformObject::from),
        covariance: adjusted
            .photo_covariance(i)
            .map(|c| c.row_iter().map(|r| r.iter().copied().collect()).collect()),
    };
    let point = |(i, name): (usize, &String)| PointObject {
        name: name.clone(),
        is_mark: scene.is_mark[i],
        position_m: adjusted.point(i).map(|x| (x + scene.origin_m).into()),
        covariance_m2: adjusted
            .point_covariance_m2(i)
            .map(|c| c.row_iter().map(|r| r.iter().copied().collect()).collect()),
    };
    SurveyObject {
        kind: "survey",
        status: answers.status.name(),
        message: answers.verdict.join("; "),
        frame: frame_words(scene, adjusted.frame),
        chi2: adjusted.chi2,
        degrees_of_freedom: adjusted.degrees_of_freedom,
        noise_scale: adjusted.noise_scale,
        rival_delta_chi2: adjusted.rival_delta_chi2,
        photos: scene.photos.iter().enumerate().map(photo).collect(),
        points: scene.points.iter().enumerate().map(point).collect(),
        suspects: adjusted.suspects.iter().map(|s| words::suspect(scene, s)).collect(),
        remarks: answers.verdict.iter().chain(&answers.remarks).cloned().collect(),
    }
}

/// Writes the table and the pictures; the names of the files.
fn write_files(folder: &Path, scene: &NamedScene, answers: &Answers, title: &str) -> Result<Vec<String>> {
    let mut written = Vec::new();
    let mut write = |name: String, bytes: &[u8]| -> Result<()> {
        let path = folder.join(&name);
        resight::formats::write_atomically(&path, bytes)?;
        written.push(path.display().to_string());
        Ok(())
    };
    write("table.csv".into(), table::csv(answers).as_bytes())?;
    if let Some(drawing) = plan::plan(scene, answers, title) {
        write("plan.svg".into(), drawing.svg().as_bytes())?;
        write("plan.png".into(), &drawing.png().map_err(|reason| anyhow!("plan.png: {reason}"))?)?;
    }
    for (index, photo) in scene.photos.iter().enumerate() {
        let Some(file) = &photo.file else { continue };
        let image = GrayImage::read(file)?;
        if let Some(canvas) = birdseye::birdseye(scene, answers, index, &image) {
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
