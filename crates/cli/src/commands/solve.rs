//! `solve`: poses from known correspondences.

use crate::args::{OutputArgs, parse_method, positive};
use crate::gravity::GravityArgs;
use crate::intrinsics::IntrinsicsArgs;
use crate::output::{Outcome, Printer};
use crate::points::{self, Row, View};
use crate::robust::RobustArgs;
use anyhow::{Result, bail};
use clap::Args;
use resight::core::{Camera, Correspondence, Lens, Pixel, Point};
use resight::locate::{Method, NamedPoint, PointsOptions, is_contradicted_by_priors, locate_points};
use resight::{PoseAnswer, Status};
use std::path::PathBuf;

/// The pose of the camera from points you already have.
///
/// Columns by name, in any order: x_m,y_m,z_m,u_px,v_px (with --normalized: x_m,y_m,z_m,xn,yn) and optionally view, id,
/// sigma_px (of u and v), sigma_m (of x, y, z; 0 when exact). One pose per view, in file order; rows of a view need not be adjacent.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight solve points.csv --camera camera.toml --sigma-px 0.3
  resight solve matches.csv --camera camera.toml --sigma-px 1 --robust 4
  resight solve points.csv --normalized --sigma-normalized 0.0005 --method line_plus_one --json")]
pub struct Solve {
    /// CSV file with a header line.
    #[arg(value_name = "POINTS.csv")]
    points: PathBuf,
    /// Camera file in any supported format; FILE#NAME picks one of several.
    #[arg(long, value_name = "FILE", required_unless_present = "normalized", conflicts_with = "normalized")]
    camera: Option<String>,
    /// Columns xn,yn are undistorted coordinates on the plane z = 1; no camera is needed.
    #[arg(long)]
    normalized: bool,
    /// auto, wang2004, line_plus_one, p3p, planar, sqpnp or upright (2 points and --gravity).
    #[arg(long, default_value = "auto", value_parser = parse_method)]
    method: Method,
    /// Standard deviation of u and v where the file has no sigma_px [default: 0.5; photogrammetric camera: f / 2000, in its unit]
    #[arg(long, value_name = "S", conflicts_with = "normalized", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: Option<f64>,
    /// Standard deviation of xn and yn where the file has no sigma_px [default: 0.0005]
    #[arg(long, value_name = "S", requires = "normalized", allow_negative_numbers = true, value_parser = positive)]
    sigma_normalized: Option<f64>,
    #[command(flatten)]
    robust: RobustArgs,
    #[command(flatten)]
    gravity: GravityArgs,
    #[command(flatten)]
    intrinsics: IntrinsicsArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// Squares of larger numbers, and their products, leave the range of numbers.
const LARGEST: f64 = 1e60;

/// Two rows of a view with one name: corners of one tag, or a slip.
fn warn_of_twins(views: &[View], remark: impl Fn(&str)) {
    for view in views {
        let mut seen = std::collections::HashMap::new();
        let twins = view.rows.iter().find_map(|row| seen.insert(&row.name, row.line).map(|line| (row, line)));
        if let Some((row, line)) = twins {
            let (view, name, second) = (&view.name, &row.name, row.line);
            remark(&format!(
                "warning: view {view}: lines {line} and {second} both have id `{name}`; right for the corners of one tag, else one is mislabelled"
            ));
            return; // One such line is told; a file of tags has thousands.
        }
    }
}

/// Coordinates that are hardly metres: of the file as a whole, for a unit is that of a column.
fn unit_remarks(views: &[View]) -> Vec<String> {
    let rows = views.iter().flat_map(|view| &view.rows);
    let points: Vec<Point> = rows.map(|row| Point::from(row.x_in_target)).collect();
    resight::formats::plausible::of_points(&points).into_iter().collect()
}

/// What the rows of a file are solved with.
struct Setting {
    camera: Camera,
    sigma: f64,
    sigma_is_assumed: bool,
    /// Names of the two image columns.
    columns: [&'static str; 2],
    options: PointsOptions,
}

/// See `Solve`.
pub fn run(args: &Solve) -> Result<Outcome> {
    args.output.check()?;
    let setting = setting(args)?;
    crate::files::must_exist(&args.points)?;
    let views = points::read(&args.points, args.normalized)?;
    let mut printer = Printer::new(&args.output, views.len());
    warn_of_twins(&views, |text| printer.remark(text));
    let remarks = unit_remarks(&views);
    remarks.iter().for_each(|text| printer.remark(&format!("warning: {}: {text}", args.points.display())));
    resight::parallel::in_order(
        &views,
        |view| setting.answer(view),
        |answer: PoseAnswer| {
            let answer = PoseAnswer { remarks: remarks.clone(), ..answer };
            printer.result(&answer, &crate::text::describe(&answer), answer.status())
        },
    )?;
    printer.finish()
}

fn setting(args: &Solve) -> Result<Setting> {
    let camera = match &args.camera {
        Some(argument) => super::camera(argument)?,
        None => Camera::normalized(),
    };
    let (unit, assumed, columns) = match &camera.lens {
        _ if args.normalized => ("normalized", 5e-4, ["xn", "yn"]),
        Lens::Photogrammetric(model) => ("unit of f", model.table().f / 2000.0, ["u_px", "v_px"]),
        _ => ("px", 0.5, ["u_px", "v_px"]),
    };
    let stated = if args.normalized { args.sigma_normalized } else { args.sigma_px };
    let (sigma, sigma_is_assumed) = (stated.unwrap_or(assumed), stated.is_none());
    if args.normalized && args.intrinsics.given() {
        bail!("--intrinsics-sigma needs a camera; coordinates given with --normalized have none");
    }
    let intrinsics = args.intrinsics.check(&camera, args.method)?;
    let priors = args.gravity.check(args.method)?;
    let robust_threshold_px = args.robust.threshold_px();
    let options =
        PointsOptions { method: args.method, intrinsics, priors, robust_threshold_px, image_unit: unit };
    Ok(Setting { camera, sigma, sigma_is_assumed, columns, options })
}

impl Setting {
    fn answer(&self, view: &View) -> PoseAnswer {
        let PointsOptions { image_unit, .. } = self.options;
        let points = match view.rows.iter().map(|row| self.point(row)).collect::<Result<Vec<_>, String>>() {
            Ok(points) => points,
            Err(reason) => {
                let answer = PoseAnswer::without_pose(view.name.clone(), Status::Error, reason);
                return PoseAnswer { n_points: view.rows.len(), image_unit, ..answer };
            }
        };
        let mut answer = locate_points(view.name.clone(), &points, &self.camera, &self.options);
        if is_contradicted_by_priors(&answer) {
            // The one prior of this command, by the name of its flags.
            answer.verdict.message =
                "--gravity and --target-down contradict the points, which agree with their sigmas without them; check both \
                 directions and --gravity-sigma-deg before using this pose"
                    .into();
        }
        let is_assumed = self.sigma_is_assumed && view.rows.iter().any(|row| row.sigma.is_none());
        if is_assumed && answer.estimate.is_some() {
            let flag = if self.columns[0] == "xn" { "--sigma-normalized" } else { "--sigma-px" };
            answer.verdict.message +=
                &format!("; σ {} {image_unit} is assumed, state yours with {flag}", self.sigma);
        }
        answer
    }

    fn point(&self, row: &Row) -> Result<NamedPoint, String> {
        Ok(NamedPoint { name: row.name.clone(), line: Some(row.line), seen: self.correspondence(row)? })
    }

    fn correspondence(&self, row: &Row) -> Result<Correspondence, String> {
        let [u, v] = self.columns;
        let cells = [("x_m", row.x_in_target[0]), ("y_m", row.x_in_target[1]), ("z_m", row.x_in_target[2])];
        let cells = cells.into_iter().chain([(u, row.image[0]), (v, row.image[1])]);
        let (sigma, sigma_m) = (row.sigma.unwrap_or(self.sigma), row.sigma_m.unwrap_or(0.0));
        for (column, x) in cells.chain([("sigma_px", sigma), ("sigma_m", sigma_m)]) {
            if LARGEST < x.abs() {
                return Err(format!(
                    "line {}: column `{column}` is {x:e}; the largest number accepted is {LARGEST:e}, check the unit",
                    row.line
                ));
            }
            if !x.is_finite() {
                return Err(format!(
                    "line {}: column `{column}` is {x}; remove the row or correct it",
                    row.line
                ));
            }
        }
        if sigma <= 0.0 {
            return Err(format!("line {}: column `sigma_px` is {sigma}; it must be positive", row.line));
        }
        if sigma_m < 0.0 {
            return Err(format!("line {}: column `sigma_m` is {sigma_m}; it must not be negative", row.line));
        }
        if 0.0 < sigma_m && self.options.method == Method::Wang2004 {
            let reason =
                "method wang2004 is the printed procedure, which takes the points as exact; use auto";
            return Err(format!("line {}: column `sigma_m` is {sigma_m}, but {reason}", row.line));
        }
        Correspondence::new(&self.camera, Point::from(row.x_in_target), Pixel::from(row.image), sigma)
            .map(|c| Correspondence { sigma_m, ..c })
            .map_err(|reason| format!("line {}: {reason}", row.line))
    }
}
