//! `print`: targets at exact scale, and the printer's error measured back into the target file.

mod keys;

use crate::args::positive;
use crate::output::{Outcome, print, remark};
use anyhow::{Context, Result, bail};
use clap::Args;
use keys::TargetKeys;
use resight::answer::PrintAnswer;
use resight::core::Target;
use resight::formats::{self, Format};
use resight::print::{MeasuredRulers, Paper, PrintFormat, PrintRequest, print_target};
use std::path::{Path, PathBuf};

/// Prints a target at exact scale as PDF or SVG.
///
/// The target comes from a file, or from its keys as flags, and then its file is written too. Rulers, cut marks and words stand on the sheet; a
/// target larger than the paper comes on several pages. Printers err by tenths of a percent: measure the rulers, give their lengths, and the
/// target file carries the scales of the print with their standard deviation, which every command then uses.
#[derive(Debug, Args)]
#[command(
    override_usage = "resight print (--target FILE | --kind KIND …) -o FILE.pdf [OPTIONS]",
    after_help = "Example:\n  resight print --kind tag --family tag36h11 --id 7 --size-m 0.1 -o tag.pdf",
    after_long_help = "Examples:\n  resight print --kind tag --family tag36h11 --id 7 --size-m 0.1 -o tag.pdf\n  \
        resight print --kind tag --id 0-11 --size-m 0.05 -o tags.svg\n  \
        resight print --kind chessboard --rows 6 --columns 9 --square-m 0.025 --paper letter -o board.pdf\n  \
        resight print --kind circle_grid --rows 11 --columns 4 --spacing-m 0.02 --asymmetric true -o circles.pdf\n  \
        resight print --target grid.yaml --paper 900x900 -o grid.pdf\n  \
        resight print --target board.toml --measured-x-mm 99.7 --measured-y-mm 150.2 -o board.toml"
)]
pub struct Print {
    /// Target file: own TOML, Kalibr YAML or WPILib JSON.
    #[arg(long, value_name = "FILE")]
    target: Option<PathBuf>,
    /// Writes FILE.pdf or FILE.svg, and FILE.toml too for a target from flags or with measured rulers.
    ///
    /// With measured rulers, FILE.toml alone writes the target file and nothing to print. Several pages of SVG are FILE-1.svg, FILE-2.svg, ….
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Paper: A4, A3, A2, A1, A0, letter or WIDTHxHEIGHT in mm.
    #[arg(long, value_name = "PAPER", default_value = "A4", value_parser = |word: &str| Paper::parse(word))]
    paper: Paper,
    #[command(flatten)]
    keys: TargetKeys,
    /// Length of the printed ruler along x, as measured, in mm.
    #[arg(long, help_heading = "Measured print", value_name = "MM", requires = "measured_y_mm", value_parser = positive)]
    measured_x_mm: Option<f64>,
    /// Length of the printed ruler along y, as measured, in mm.
    #[arg(long, help_heading = "Measured print", value_name = "MM", requires = "measured_x_mm", value_parser = positive)]
    measured_y_mm: Option<f64>,
    /// Standard deviation of either length, in mm [default: 0.3].
    ///
    /// 0.3 mm is a good ruler read by eye; 0.1 mm is a steel ruler and a magnifier.
    #[arg(long, hide_short_help = true, help_heading = "Measured print", value_name = "MM", requires = "measured_x_mm", value_parser = positive)]
    measured_sigma_mm: Option<f64>,
    /// Prints one JSON object on stdout.
    ///
    /// {"status", "kind", "files", "paper", "page_size_mm", "n_pages", "tiles", "ruler_mm", "printed_scale", "warnings", "message"}
    #[arg(long)]
    json: bool,
}

/// A ruler with millimetres, read by eye at both ends.
const READ_BY_EYE_MM: f64 = 0.3;

/// See `Print`.
pub fn run(args: &Print) -> Result<Outcome> {
    let (format, name) = output(&args.output, args.measured().is_some())?;
    crate::files::must_be_writable(&args.output)?;
    let target = args.target()?;
    let request = PrintRequest {
        target,
        paper: args.paper,
        format,
        writes_target: args.target.is_none() || args.measured().is_some(),
        measured: args.measured(),
        dot_diameter_m: args.keys.dot_diameter_m,
        name,
    };
    let mut answer = print_target(&request)?;
    write(args, &mut answer)?;
    answer.warnings.iter().for_each(|warning| remark(&format!("warning: {warning}")));
    match args.json {
        true => print(&format!("{}\n", serde_json::to_string(&answer)?))?,
        false => print(&words(&answer))?,
    }
    Ok(Outcome::of([answer.status]))
}

impl Print {
    fn measured(&self) -> Option<MeasuredRulers> {
        let (x_mm, y_mm) = (self.measured_x_mm?, self.measured_y_mm?);
        Some(MeasuredRulers { x_mm, y_mm, sigma_mm: self.measured_sigma_mm.unwrap_or(READ_BY_EYE_MM) })
    }

    fn target(&self) -> Result<Target> {
        let Some(file) = &self.target else { return self.keys.target() };
        if let Some(flag) = self.keys.first_given() {
            bail!(
                "{flag} and --target exclude each other: the file {} states the target's keys",
                file.display()
            );
        }
        Ok(super::target(file, &Default::default(), remark)?.0)
    }
}

/// What is written, by the ending of the file, and the name that all files share.
fn output(path: &Path, is_measured: bool) -> Result<(PrintFormat, String)> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let format = match ending.as_str() {
        "pdf" => PrintFormat::Pdf,
        "svg" => PrintFormat::Svg,
        "toml" if is_measured => PrintFormat::TargetFile,
        "toml" => bail!(
            "-o {}: a target file alone is written with --measured-x-mm and --measured-y-mm; to print give FILE.pdf or FILE.svg",
            path.display()
        ),
        _ => bail!("-o {}: the ending says what is written; give FILE.pdf or FILE.svg", path.display()),
    };
    let stem = path.file_stem().context("-o: a file name is needed")?;
    Ok((format, stem.to_string_lossy().into_owned()))
}

/// Beside each other in the folder of `-o`. A target file that was read is replaced only by the same target with its scale.
fn write(args: &Print, answer: &mut PrintAnswer) -> Result<()> {
    let folder = args.output.parent().unwrap_or(Path::new(""));
    let paths: Vec<PathBuf> = answer.files.iter().map(|name| folder.join(name)).collect();
    for path in &paths {
        if path.is_dir() {
            bail!("-o: {} is a folder, and a file of this name is to be written", path.display());
        }
        let is_input = args.target.as_ref().is_some_and(|target| is_same(target, path));
        if is_input && formats::read_target(path)?.format != Format::OwnTarget {
            bail!("-o {}: this would replace the file it is made from; write elsewhere", path.display());
        }
    }
    for (path, bytes) in paths.iter().zip(&answer.contents) {
        formats::write_atomically(path, bytes)?;
    }
    answer.files = paths.iter().map(|path| path.display().to_string()).collect();
    Ok(())
}

fn is_same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

fn words(answer: &PrintAnswer) -> String {
    let scale = answer.printed_scale.map_or_else(String::new, |scale| {
        let percent = |x: f64, sigma: f64| format!("{:+.3} % ± {:.3} %", 100.0 * (x - 1.0), 100.0 * sigma);
        format!(
            "the print is off by {} along x and {} along y (1σ)\n",
            percent(scale.x, scale.sigma_x),
            percent(scale.y, scale.sigma_y)
        )
    });
    let list: String = answer.files.iter().map(|file| format!("  {file}\n")).collect();
    format!("{}\n{scale}{list}", answer.message)
}
