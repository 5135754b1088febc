//! `demo --first-pose`: the guide docs/first-pose.md run on rendered photographs, each command as one types it, the answers beside the truth.

use super::photographs::Truth;
use super::{error_row, place_row, truth_row, wrapped};
use crate::commands::{intrinsics, locate, print};
use crate::output::{Outcome, error, print as say, print_answer};
use anyhow::{Context, Result, bail};
use clap::{Parser, Subcommand};
use resight::answer::SchemaNumber;
use resight::core::Camera;
use resight::core::locate::PoseEstimate;
use resight::locate::{IntrinsicsCovariance, LocateOptions, locate_image};
use resight::print::{Paper, PrintFormat, PrintRequest, print_target};
use resight::report::truth::{self, CHI2_6_99};
use resight::report::verdict::Status;
use resight::report::words::position_with_sigma_m;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::Path;

/// The board of the guide: it fits A4 and letter, and any part of it may be seen.
const BOARD: &str =
    "--kind charuco --rows 8 --columns 5 --square-m 0.03 --marker-m 0.022 --dictionary DICT_5X5_100";
/// A steel ruler, read with care.
const RULER_SIGMA_MM: f64 = 0.2;
/// How far off in standard deviations a focal length may be: once in ten thousand, were the errors normal.
const MOST_SIGMAS: f64 = 3.9;

/// The first pose beside the truth, as JSON.
#[derive(Debug, Serialize, JsonSchema)]
pub struct FirstPose {
    schema: SchemaNumber,
    /// `ok` where every answer agrees with the truth to within its own error bar; else `error`.
    status: Status,
    /// Commands that were typed.
    commands: Vec<String>,
    /// The camera's position: metres off the truth.
    off_m: f64,
    /// Rotation between the pose found and the true one.
    rotated_rad: f64,
    /// ξᵀ Σ⁻¹ ξ of the pose's error: 6 on average.
    truth_normalized_squared: f64,
    /// Focal length found, its standard deviation, and the true one.
    fx_px: f64,
    fx_sigma_px: f64,
    fx_truth_px: f64,
}

/// One step as it is typed.
#[derive(Parser)]
struct Typed {
    #[command(subcommand)]
    step: Step,
}

#[derive(Subcommand)]
#[allow(clippy::large_enum_variant)] // One at a time.
enum Step {
    Print(print::Print),
    Intrinsics(intrinsics::Intrinsics),
    Locate(locate::Locate),
}

/// The steps so far.
struct Guide<'a> {
    folder: &'a Path,
    json: bool,
    typed: Vec<String>,
    outcome: Outcome,
}

/// Writes everything into the folder.
pub fn run(folder: &Path, json: bool) -> Result<Outcome> {
    crate::files::make_folder("-o", folder)?;
    let mut guide = Guide { folder, json, typed: Vec::new(), outcome: Outcome::Answered };
    guide.tell(
        "From nothing to a pose. A page is printed, 0.4 % too narrow and 0.2 % too high as printers are; 14 photographs of it are rendered through a \
         distorted lens that no command knows. The steps are those of docs/first-pose.md.",
    )?;
    guide.step("1  Print the page", &format!("print {BOARD} -o @/board.pdf"))?;
    let truth = Truth::new()?;
    let board = folder.join("board.toml");
    let design = resight::formats::read_target(&board)?.target;
    let [x, y] = truth.read_off(rulers_mm(&design)?);
    let measured =
        format!("--measured-x-mm {x:.1} --measured-y-mm {y:.1} --measured-sigma-mm {RULER_SIGMA_MM}");
    guide
        .step("2  Measure its rulers", &format!("print --target @/board.toml {measured} -o @/board.toml"))?;
    guide.tell("3  Photograph it from all sides: photos/*.jpg; then from where the camera is to be located: here.jpg")?;
    truth.photograph(&design, folder)?;
    let outputs = "-o @/camera.toml --report @/camera.html";
    guide.step("4  Intrinsics", &format!("intrinsics '@/photos/*.jpg' --target @/board.toml {outputs}"))?;
    let here = "locate @/here.jpg --camera @/camera.toml --target @/board.toml --overlay @/images";
    guide.step("5  The pose", here)?;
    guide.conclude(&truth)
}

/// Lengths of the rulers on the page, as `print` states them.
fn rulers_mm(design: &resight::core::Target) -> Result<[f64; 2]> {
    let request = PrintRequest {
        target: design.clone(),
        paper: Paper::A4,
        format: PrintFormat::Pdf,
        writes_target: false,
        measured: None,
        dot_diameter_m: None,
        name: "board".into(),
    };
    Ok(print_target(&request)?.ruler_mm)
}

impl Guide<'_> {
    /// Shows a command and runs it; `@` stands for the folder.
    fn step(&mut self, title: &str, words: &str) -> Result<()> {
        let line = format!("resight {}", words.replace('@', &self.folder.display().to_string()));
        self.tell(&format!("{title}\n    {line}"))?;
        let place = |word: &str| word.trim_matches('\'').replace('@', &self.folder.display().to_string());
        let mut all: Vec<String> =
            std::iter::once("resight".into()).chain(words.split(' ').map(place)).collect();
        all.extend(self.json.then(|| "--json".to_string()));
        let outcome = match Typed::try_parse_from(all).with_context(|| line.clone())?.step {
            Step::Print(args) => print::run(&args),
            Step::Intrinsics(args) => intrinsics::run(&args),
            Step::Locate(args) => locate::run(&args),
        }?;
        self.typed.push(line);
        self.outcome = self.outcome.and(outcome);
        Ok(())
    }

    fn tell(&self, text: &str) -> Result<()> {
        if self.json {
            return Ok(());
        }
        let lines: Vec<String> = text
            .lines()
            .map(|line| if line.starts_with(' ') { line.into() } else { wrapped(line) })
            .collect();
        say(&format!("{}{}\n\n", if self.typed.is_empty() { "" } else { "\n" }, lines.join("\n")))
    }

    /// The answers beside the truth, from the files that the commands wrote.
    fn conclude(self, truth: &Truth) -> Result<Outcome> {
        let (found, fx_sigma_px, estimate) = self.answers()?;
        let [fx_px, fx_truth_px] = [&found, &truth.camera].map(|camera| camera.parameters()[0].1);
        let Some(check) =
            truth::check(&estimate.cam_from_target, &estimate.covariance, &truth.cam_from_target)
        else {
            bail!("the covariance of the pose cannot be inverted");
        };
        let agrees =
            check.normalized_squared < CHI2_6_99 && (fx_px - fx_truth_px).abs() < MOST_SIGMAS * fx_sigma_px;
        let (place, sigma) = position_with_sigma_m(&estimate);
        let mut words = String::from("\nBeside the truth\n");
        crate::text::line(
            &mut words,
            "focal",
            &format!("{fx_px:.2} ± {fx_sigma_px:.2} px, in truth {fx_truth_px:.2} px"),
        );
        crate::text::line(&mut words, "camera at", &place_row(&place, &sigma));
        crate::text::line(&mut words, "truth", &truth_row(&truth.cam_from_target.origin(), &sigma));
        crate::text::line(&mut words, "error", &error_row(check));
        let f = self.folder.display();
        words += &format!(
            "\nLook at {f}/images/here.png (the board drawn over the photograph) and {f}/camera.html (how good the intrinsics are).\n\
             Then type the four commands again, or do the same with a printer and a camera of your own.\n"
        );
        let status = if agrees { Status::Ok } else { Status::Error };
        let object = FirstPose {
            schema: SchemaNumber,
            status,
            commands: self.typed,
            off_m: check.distance_m,
            rotated_rad: check.angle_rad,
            truth_normalized_squared: check.normalized_squared,
            fx_px,
            fx_sigma_px,
            fx_truth_px,
        };
        print_answer(self.json, &object, &words, status)?;
        if !agrees {
            error("error: an answer is further from the truth than its error bar allows");
        }
        Ok(self.outcome.and(Outcome::of([status])))
    }

    /// The camera found, the standard deviation of its focal length, and the pose.
    fn answers(&self) -> Result<(Camera, f64, PoseEstimate)> {
        let path = |name: &str| self.folder.join(name);
        let named = resight::formats::read_camera(path("camera.toml"))?;
        let intrinsics = IntrinsicsCovariance::of(&named).context("camera.toml states no covariance")?;
        let sigma_px = intrinsics.sigmas().get("fx_px").copied().context("camera.toml states no fx_px")?;
        let target = resight::formats::read_target(path("board.toml"))?.target;
        let image = resight::GrayImage::read(path("here.jpg"))?;
        let options = LocateOptions { intrinsics: Some(intrinsics), ..LocateOptions::default() };
        let answer = locate_image(&image, &named.camera, &target, &options)?;
        let estimate = answer.estimate.with_context(|| answer.verdict.message.clone())?;
        Ok((named.camera, sigma_px, estimate))
    }
}
