//! `demo`: the whole path on shipped images whose truth is known.

mod first_pose;
mod photographs;
mod shipped;

use super::locate::LocatedImage;
use crate::args::OutputArgs;
use crate::output::{Outcome, Printer, error, print};
use anyhow::{Context, Result, bail};
use clap::Args;
use resight::answer::SchemaNumber;
use resight::core::locate::PoseEstimate;
use resight::core::locate::choose::{Ambiguity, Hypothesis};
use resight::core::{Matrix6, Pose};
use resight::locate::{ImageLocator, LocateOptions};
use resight::report::html::Page;
use resight::report::truth::{self, CHI2_6_99, point_covariance};
use resight::report::verdict::{Status, figures};
use resight::report::words::{
    coordinate, degrees, length, percent, position_sigma_m, position_with_sigma_m, with_sigma,
};
use schemars::JsonSchema;
use serde::Serialize;
use shipped::Truth;
use std::path::{Path, PathBuf};

pub use first_pose::FirstPose;

/// Shows the main job on images that come with the program, without any arguments.
///
/// It takes seconds. Two cameras see four dots and a grid of tags, and their true poses are known. The demo shows detection, poses with error bars beside the truth, the relative extrinsics of the two cameras, a view with two
/// answers, and a camera file that is wrong; writes images and a page to look at.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  resight demo -o resight-demo\n  resight demo --first-pose -o first-pose\n\n\
    Exit status: 0 when every answer is as the known truth demands, also the two that are shown because they are not `ok`; 1 otherwise."
)]
pub struct Demo {
    /// Folder for images, results and report.html.
    #[arg(short, long, value_name = "DIR", default_value = "resight-demo")]
    output: PathBuf,
    /// Instead follows the guide to a first pose: prints a page, photographs it, estimates the intrinsics, locates the camera.
    ///
    /// The photographs are rendered through a lens that no command knows. Every command is shown as one types it, and the answers stand
    /// beside the truth.
    #[arg(long)]
    first_pose: bool,
    /// Prints JSON Lines on stdout: the answers of each step, then the comparison with the truth.
    #[arg(long)]
    json: bool,
}

/// See `Demo`.
pub fn run(args: &Demo) -> Result<Outcome> {
    if args.first_pose {
        return first_pose::run(&args.output, args.json);
    }
    shipped::unpack(&args.output)?;
    let mut story = Story::new(args)?;
    story.introduction()?;
    let left = story.view("1", "Four dots, left camera", "left", "dots", "left.toml", Status::Ok)?;
    let right = story.view("2", "Four dots, right camera", "right", "dots", "right.toml", Status::Ok)?;
    story.pair("3", "The right camera seen from the left one, by the dots", &left, &right)?;
    let left = story.view("4", "A grid of 16 tags, left camera", "left", "grid", "left.toml", Status::Ok)?;
    let right = story.view("5", "The same grid, right camera", "right", "grid", "right.toml", Status::Ok)?;
    story.pair("6", "The right camera seen from the left one, by the grid", &left, &right)?;
    story.view("7", "A view with two answers", "critical", "dots", "left.toml", Status::Ambiguous)?;
    let forgotten = "left-distortion-forgotten.toml";
    story.view(
        "8",
        "A camera file whose lens distortion was forgotten",
        "left",
        "grid",
        forgotten,
        Status::Inconsistent,
    )?;
    story.finish()
}

/// The demo so far, on stdout and in the page.
struct Story {
    folder: PathBuf,
    json: bool,
    printer: Printer,
    truth: Truth,
    page: Page,
    rows: Vec<Vec<String>>,
    surprises: Vec<String>,
    /// Of the answers that are ok: metres off the truth, and error² in σ².
    worst: Option<f64>,
    worst_squared: Option<f64>,
}

/// Relative extrinsics as JSON.
#[derive(Serialize, JsonSchema)]
pub struct Pair {
    schema: SchemaNumber,
    a: &'static str,
    b: &'static str,
    target: String,
    a_from_b: resight::answer::TransformObject,
    covariance: [[f64; 6]; 6],
    truth_normalized_squared: Option<f64>,
}

impl Story {
    fn new(args: &Demo) -> Result<Self> {
        let output = OutputArgs { json: args.json, output: Some(args.output.join("results.jsonl")) };
        Ok(Story {
            folder: args.output.clone(),
            json: args.json,
            printer: Printer::new(&output, 0),
            truth: Truth::read(&args.output)?,
            page: Page::new("Resight demo"),
            rows: Vec::new(),
            surprises: Vec::new(),
            worst: None,
            worst_squared: None,
        })
    }

    fn introduction(&mut self) -> Result<()> {
        let text = "Two cameras look at a wall with a card of four dots and a grid of tags. The images were drawn by \
                    this project from known poses, so every answer below stands beside the truth.";
        self.page.paragraph(text);
        self.say(&format!("Resight demo\n{}\n\n", wrapped(text)))
    }

    /// One image through the whole path.
    fn view(
        &mut self,
        number: &str,
        title: &str,
        image: &str,
        target: &str,
        camera: &str,
        expected: Status,
    ) -> Result<LocatedImage> {
        let path = self.folder.join(format!("{image}.png"));
        let target_file = resight::formats::read_target(self.folder.join(format!("{target}.toml")))?.target;
        let camera_path = self.folder.join(camera);
        let camera_file = resight::formats::read_camera(camera_path)?.camera;
        let options = LocateOptions::default();
        let seen = LocatedImage::look(&mut ImageLocator::new(&camera_file, &target_file, &options)?, &path);
        let status = seen.located.answer.verdict.status;
        if status != expected {
            self.surprises.push(format!("{number}: expected {}, got {}", expected.name(), status.name()));
        }
        let truth = self.truth.pose(&format!("{image}_from_{target}"))?;
        let words = reported(&seen, &truth);
        let picture = self.picture(&seen, number, &target_file)?;
        self.page.heading(&format!("{number}  {title}"));
        self.page.pictures(&[(&picture, &format!("{image}.png, {target}, {camera}"))]).preformatted(&words);
        self.row(number, title, &seen, &truth);
        let heading = format!("{number}  {title}   [{image}.png, {camera}]\n{words}");
        self.printer.result(&seen.located.answer, &heading, as_expected(status == expected))?;
        Ok(seen)
    }

    fn picture(&self, seen: &LocatedImage, number: &str, target: &resight::core::Target) -> Result<Vec<u8>> {
        let Some(image) = &seen.image else { bail!("{}", seen.located.answer.verdict.message) };
        let png = seen.png(image, target)?;
        let stem = Path::new(&seen.located.answer.view)
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let pictures = self.folder.join("pictures");
        std::fs::create_dir_all(&pictures)?;
        resight::formats::write_atomically(pictures.join(format!("{number}-{stem}.png")), &png)?;
        Ok(png)
    }

    fn row(&mut self, number: &str, title: &str, seen: &LocatedImage, truth: &Pose) {
        let answer = &seen.located.answer;
        let mut cells = vec![format!("{number}  {title}"), answer.verdict.status.name().to_string()];
        if let Some(e) = &answer.estimate {
            let check = truth::check(&e.cam_from_target, &e.covariance, truth);
            if answer.verdict.status == Status::Ok && check.is_none_or(|c| CHI2_6_99 < c.normalized_squared) {
                self.surprises.push(format!("{number}: further from the truth than its error bar allows"));
            }
            if let Some(c) = check.filter(|_| answer.verdict.status == Status::Ok) {
                self.is_off(c.distance_m, c.normalized_squared);
            }
            let off =
                check.map(|c| (length(c.distance_m), degrees(c.angle_rad), figures(c.normalized_squared)));
            let (distance, angle, squared) = off.unwrap_or_default();
            cells.extend([figures(e.rms_px) + " px", distance, angle, squared]);
        }
        self.rows.push(cells);
    }

    fn is_off(&mut self, distance_m: f64, squared: f64) {
        self.worst = Some(self.worst.map_or(distance_m, |worst| worst.max(distance_m)));
        self.worst_squared = Some(self.worst_squared.map_or(squared, |worst| worst.max(squared)));
    }

    /// Eqs. (13), (14) of the paper: R12 = R1 R2ᵀ, p12 = p1 − R12 p2, in one product; no absolute place is needed.
    fn pair(&mut self, number: &str, title: &str, left: &LocatedImage, right: &LocatedImage) -> Result<()> {
        let (l, r) = (estimate(left)?, estimate(right)?);
        let left_from_right = l.cam_from_target * r.cam_from_target.inverse();
        let target_covariance = r.cam_from_target.inverse_covariance(&r.covariance);
        let covariance = l.cam_from_target.product_covariance(&l.covariance, &target_covariance);
        let truth = self.truth.pose("left_from_right")?;
        let words = reported_pair(&left_from_right, &covariance, &truth);
        let check = truth::check(&left_from_right, &covariance, &truth);
        if check.is_none_or(|c| CHI2_6_99 < c.normalized_squared) {
            self.surprises.push(format!("{number}: further from the truth than its error bar allows"));
        }
        self.page.heading(&format!("{number}  {title}")).preformatted(&words);
        if let Some(c) = check {
            let off = (left_from_right.translation - truth.translation).norm();
            self.is_off(off, c.normalized_squared);
            let squared = figures(c.normalized_squared);
            self.rows.push(vec![
                format!("{number}  {title}"),
                "ok".into(),
                "–".into(),
                length(off),
                degrees(c.angle_rad),
                squared,
            ]);
        }
        let pair = Pair {
            schema: SchemaNumber,
            a: "left",
            b: "right",
            target: title.rsplit(' ').next().unwrap_or_default().to_string(),
            a_from_b: left_from_right.into(),
            covariance: resight::answer::pose::rows(&covariance),
            truth_normalized_squared: check.map(|c| c.normalized_squared),
        };
        self.printer.result(&pair, &format!("{number}  {title}\n{words}"), Status::Ok)
    }

    fn finish(mut self) -> Result<Outcome> {
        self.page.heading("All together");
        self.page.paragraph(
            "Error² in σ² weighs all six numbers of a pose by the covariance that came with it: 6 on average, above 16.8 once \
             in a hundred. Answer 7 is given with a second pose; answer 8 says itself that it must not be trusted.",
        );
        let head = ["", "status", "rms", "off by", "rotated by", "error² in σ²"];
        self.page.table(&head, &self.rows);
        let status = as_expected(self.surprises.is_empty());
        let (sentence, figures) = self.verdict();
        self.page.verdict(status, &sentence, &figures);
        let report = self.folder.join("report.html");
        resight::formats::write_atomically(&report, self.page.html().as_bytes())?;
        self.say(&closing(&self.folder, &report))?;
        for surprise in &self.surprises {
            error(&format!("error: {surprise}"));
        }
        let outcome = self.printer.finish()?;
        Ok(outcome.and(Outcome::of([status])))
    }

    /// Whether every answer is what the truth demands, and how far off the worst `ok` one is.
    fn verdict(&self) -> (String, [(&'static str, String); 4]) {
        let sentence = match self.surprises.as_slice() {
            [] => "Every answer agrees with the known truth to within its own error bar, and the two that must not be trusted say so.".into(),
            several => format!("Not as the known truth demands: {}.", several.join("; ")),
        };
        let figures = [
            ("answers", self.rows.len().to_string()),
            (
                "answers that are ok",
                self.rows.iter().filter(|row| row[1] == Status::Ok.name()).count().to_string(),
            ),
            ("farthest of them from the truth", self.worst.map(length).unwrap_or_default()),
            ("greatest error² in σ² (6 expected)", self.worst_squared.map(figures).unwrap_or_default()),
        ];
        (sentence, figures)
    }

    fn say(&self, text: &str) -> Result<()> {
        if self.json { Ok(()) } else { print(text) }
    }
}

/// The demo's own result is whether the program answers images of known truth as it must: two of the answers are shown because they are
/// not `ok`, and a demo that shows them so has succeeded. Their own statuses are printed.
fn as_expected(is_as_expected: bool) -> Status {
    if is_as_expected { Status::Ok } else { Status::Error }
}

fn estimate(seen: &LocatedImage) -> Result<&PoseEstimate> {
    seen.located.answer.estimate.as_ref().with_context(|| seen.located.answer.verdict.message.clone())
}

/// A view in words: status, place beside the truth, and what follows.
fn reported(seen: &LocatedImage, truth: &Pose) -> String {
    let verdict = &seen.located.answer.verdict;
    let mut out = String::new();
    crate::text::line(&mut out, "status", &verdict.status.name().to_uppercase());
    let Some(e) = &seen.located.answer.estimate else {
        crate::text::line(&mut out, "why", &verdict.message);
        return out;
    };
    let (place, sigma) = position_with_sigma_m(e);
    let fitting: Vec<Hypothesis> = e.minima().filter(|h| h.is_alternative).collect();
    for (i, fits) in fitting.iter().enumerate() {
        let pose = &fits.minimum.cam_from_target;
        let row = place_row(&pose.origin(), &position_sigma_m(pose, &fits.minimum.covariance));
        let label = if i == 0 { "camera at" } else { "or at" };
        let chance =
            if 1 < fitting.len() { format!("   ({})", percent(fits.probability)) } else { String::new() };
        crate::text::line(&mut out, label, &(row + &chance));
    }
    crate::text::line(&mut out, "truth", &truth_row(&truth.origin(), &sigma));
    crate::text::line(
        &mut out,
        "fit",
        &format!(
            "{} points, rms {} px, by {}",
            e.n_points,
            figures(e.rms_px),
            resight::locate::method_name(e.method)
        ),
    );
    if let Ambiguity::Ambiguous { other, .. } = &e.ambiguity {
        let nearer =
            (other.cam_from_target.origin() - truth.origin()).norm() < (place - truth.origin()).norm();
        let which = if nearer { "second" } else { "first" };
        let text = format!(
            "the true one is the {which}; the image alone does not decide, and the answer states that"
        );
        crate::text::line(&mut out, "in truth", &text);
    }
    match truth::check(&e.cam_from_target, &e.covariance, truth) {
        Some(c) if verdict.status == Status::Ok => crate::text::line(&mut out, "error", &error_row(c)),
        _ => crate::text::line(&mut out, "why", &verdict.message),
    }
    out
}

fn reported_pair(left_from_right: &Pose, covariance: &Matrix6, truth: &Pose) -> String {
    let mut out = String::new();
    let place = left_from_right.translation;
    let spread = point_covariance(&place, covariance);
    let sigma = spread.diagonal().map(|x| x.max(0.0).sqrt());
    let along = place.normalize();
    let sigma_m = (along.transpose() * spread * along)[(0, 0)].max(0.0).sqrt();
    crate::text::line(&mut out, "right is at", &place_row(&place, &sigma));
    crate::text::line(&mut out, "truth", &truth_row(&truth.translation, &sigma));
    let apart = format!("{}, in truth {:.5} m", with_sigma(place.norm(), sigma_m), truth.translation.norm());
    crate::text::line(&mut out, "baseline", &apart);
    if let Some(c) = truth::check(left_from_right, covariance, truth) {
        let c = truth::TruthCheck { distance_m: (place - truth.translation).norm(), ..c };
        crate::text::line(&mut out, "error", &error_row(c));
    }
    out
}

fn error_row(check: truth::TruthCheck) -> String {
    format!(
        "off by {}, rotated by {}; error² in σ² {} (6 expected, above 16.8 once in a hundred)",
        length(check.distance_m),
        degrees(check.angle_rad),
        figures(check.normalized_squared)
    )
}

type Vector3 = resight::core::Point;

fn place_row(place: &Vector3, sigma: &Vector3) -> String {
    let axes = ["x", "y", "z"].iter().enumerate();
    axes.map(|(i, name)| format!("{name} {:<21}", coordinate(place[i], sigma[i])))
        .collect::<String>()
        .trim_end()
        .to_string()
}

fn truth_row(place: &Vector3, sigma: &Vector3) -> String {
    let number = |i: usize| {
        let decimals = resight::report::words::decimals(sigma[i] * 1e3);
        format!("{:+.decimals$}", place[i] * 1e3 + 0.0)
    };
    let axes = ["x", "y", "z"].iter().enumerate();
    axes.map(|(i, name)| format!("{name} {:<21}", number(i))).collect::<String>().trim_end().to_string()
        + " mm"
}

fn closing(folder: &Path, report: &Path) -> String {
    let f = folder.display();
    format!(
        "\nLook at {} (one file, no network needed) or at the images in {f}/pictures.\n\
         Then try it by hand:\n  resight locate {f}/left.png --camera {f}/left.toml --target {f}/dots.toml --overlay {f}/mine\n  \
         resight explain {f}/left.toml\n",
        report.display()
    )
}

/// Breaks a paragraph at 100 columns.
fn wrapped(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().filter(|line| line.is_empty() || line.len() + word.len() < 100);
        match line {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) => *line = format!("{line} {word}"),
            None => lines.push(word.to_string()),
        }
    }
    lines.join("\n")
}
