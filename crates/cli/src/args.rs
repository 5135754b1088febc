//! Flags; every one that several commands share is defined here once.

use clap::Args;
use resight::core::Target;
use resight::core::explanation::Tolerance;
use resight::detect::{CornerWindow, DetectError, Detector};
use resight::formats::TagOptions;
use resight::locate::{METHODS, Method};
use std::path::PathBuf;

/// How answers leave the program.
#[derive(Debug, Clone, Args)]
pub struct OutputArgs {
    /// Prints JSON Lines on stdout, one object per result and nothing else.
    #[arg(long, help_heading = "Output")]
    pub json: bool,
    /// Writes the results to FILE too, as JSON Lines.
    ///
    /// The file is replaced only when it is complete.
    #[arg(long, short, help_heading = "Output", value_name = "FILE")]
    pub output: Option<PathBuf>,
}

impl OutputArgs {
    /// Refuses a results file that could not be written, before any work is done.
    pub fn check(&self) -> anyhow::Result<()> {
        self.output.as_deref().map_or(Ok(()), crate::files::must_be_writable)
    }
}

/// How corners of squares are refined, for the commands that look into images.
#[derive(Debug, Clone, Args)]
pub struct CornerArgs {
    /// Refines corners of boards in a window of N pixels to each side, as OpenCV's cornerSubPix with winSize N.
    ///
    /// For chessboards and ChArUco boards. The window then ignores neighbouring corners. [default: as far as the neighbours leave room,
    /// which is more accurate]
    #[arg(long, hide_short_help = true, help_heading = "Detection", value_name = "N")]
    corner_window_px: Option<u32>,
}

impl CornerArgs {
    /// The window asked for.
    pub fn window(&self) -> CornerWindow {
        self.corner_window_px.map_or(CornerWindow::Clear, CornerWindow::Half)
    }

    /// The detector for a target, with the window asked for.
    pub fn detector(&self, target: &Target) -> Result<Detector, DetectError> {
        Detector::with_corner_window(target, self.window())
    }
}

/// What the file of a map of tags does not state, for the commands that read one.
#[derive(Debug, Clone, Default, Args)]
pub struct TagArgs {
    /// Family of a tag map's tags [default: tag36h11].
    ///
    /// It is used where the map's file states none, as WPILib field layouts do.
    #[arg(long, hide_short_help = true, help_heading = "Tag maps", value_name = "FAMILY")]
    tag_family: Option<String>,
    /// Outer edge of the black square of a tag map's tags, in metres [default for field layouts: 0.1651].
    ///
    /// It is used where the map's file states none.
    #[arg(long, hide_short_help = true, help_heading = "Tag maps", value_name = "M", allow_negative_numbers = true, value_parser = positive)]
    tag_size_m: Option<f64>,
    /// Standard deviation of each tag's position, in metres [default: 0; field layouts: 0.010].
    ///
    /// It holds along each axis, where a tag map's file states none; 0 means that the map is exact. Field layouts have 0.8° of rotation
    /// besides.
    #[arg(long, hide_short_help = true, help_heading = "Tag maps", value_name = "M", allow_negative_numbers = true, value_parser = not_negative)]
    tag_sigma_m: Option<f64>,
}

impl TagArgs {
    /// As the library takes them.
    pub fn options(&self) -> TagOptions {
        TagOptions { family: self.tag_family.clone(), size_m: self.tag_size_m, sigma_m: self.tag_sigma_m }
    }
}

/// Which differences between poses do not matter, for the commands that judge them.
#[derive(Debug, Clone, Default, Args)]
pub struct ToleranceArgs {
    /// A rotation up to this does not matter [default: only the ± counts].
    #[arg(long, hide_short_help = true, value_name = "DEGREES", allow_negative_numbers = true, value_parser = not_negative)]
    pub tolerance_deg: Option<f64>,
    /// A translation up to this does not matter [default: only the ± counts].
    #[arg(long, hide_short_help = true, value_name = "MM", allow_negative_numbers = true, value_parser = not_negative)]
    pub tolerance_mm: Option<f64>,
}

impl ToleranceArgs {
    /// As the library takes them.
    pub fn tolerance(&self) -> Tolerance {
        Tolerance {
            rotation_rad: self.tolerance_deg.map(f64::to_radians),
            translation_m: self.tolerance_mm.map(|mm| 1e-3 * mm),
        }
    }
}

/// `640x480`, in pixels.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let pair = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    pair.filter(|(w, h)| 0 < *w && 0 < *h)
        .ok_or_else(|| "width and height are needed, e.g. 640x480".to_owned())
}

/// `16.54x8.21`, in metres.
pub fn parse_metres_pair(text: &str) -> Result<(f64, f64), String> {
    let pair = text.split_once(['x', 'X']).and_then(|(a, b)| Some((positive(a).ok()?, positive(b).ok()?)));
    pair.ok_or_else(|| "length and width in metres are needed, e.g. 16.54x8.21".to_owned())
}

/// A number from 0 on.
pub fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if 0.0 <= x && x.is_finite() => Ok(x),
        _ => Err("a number that is zero or positive is needed".to_string()),
    }
}

/// A number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if 0.0 < x && x.is_finite() => Ok(x),
        _ => Err("a positive number is needed".to_string()),
    }
}

/// Seconds, a year at most, which stands for "never".
pub fn seconds(text: &str) -> Result<f64, String> {
    /// Thirty years.
    const MOST_S: f64 = 1e9;
    match positive(text) {
        Ok(s) if s <= MOST_S => Ok(s),
        _ => Err(format!("a positive number of seconds is needed, at most {MOST_S}")),
    }
}

/// Name of a solver: `auto` decides from the configuration of the points.
pub fn parse_method(name: &str) -> Result<Method, String> {
    match METHODS.iter().find(|(known, _)| *known == name) {
        Some((_, method)) => Ok(*method),
        None => Err(resight::input::not_among(name, "method", &METHODS.map(|(known, _)| known.to_owned()))),
    }
}
