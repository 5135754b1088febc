//! The keys of a target as flags: what its file would state.

use crate::args::positive;
use anyhow::{Context, Result, bail};
use clap::Args;
use resight::core::Target;
use resight::formats;
use resight::print::sheet_of_tags;
use std::fmt::Write as _;
use std::path::Path;

/// A target without a file. Kinds have the keys that docs/files.md lists.
#[derive(Debug, Args)]
#[command(next_help_heading = "Target without a file")]
pub struct TargetKeys {
    /// Kind: tag, aprilgrid, chessboard, charuco, circle_grid or line_plus_one; --help lists the keys of each.
    #[arg(long, value_name = "KIND")]
    kind: Option<String>,
    /// Family of tags, such as tag36h11 or DICT_4X4_50 [default: tag36h11].
    #[arg(long, value_name = "FAMILY")]
    family: Option<String>,
    /// Id of a tag; FIRST-LAST prints a sheet of tags, which is a tag_map.
    #[arg(long, value_name = "ID")]
    id: Option<String>,
    /// Outer edge of a tag's square, in metres.
    #[arg(long, value_name = "M", value_parser = positive)]
    size_m: Option<f64>,
    /// Rows: of tags, of inner corners (chessboard), of squares (charuco) or of circles (circle_grid).
    #[arg(long, value_name = "N", hide_short_help = true)]
    rows: Option<u32>,
    /// Columns, likewise.
    #[arg(long, value_name = "N", hide_short_help = true)]
    columns: Option<u32>,
    /// Edge of a square, in metres.
    #[arg(long, value_name = "M", hide_short_help = true, value_parser = positive)]
    square_m: Option<f64>,
    /// Edge of a marker of a ChArUco board, in metres.
    #[arg(long, value_name = "M", hide_short_help = true, value_parser = positive)]
    marker_m: Option<f64>,
    /// Dictionary of a ChArUco board, such as DICT_5X5_100.
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    dictionary: Option<String>,
    /// The ChArUco pattern of OpenCV before 4.6.
    #[arg(long, hide_short_help = true)]
    legacy_pattern: bool,
    /// Edge of an AprilGrid's tags, in metres.
    #[arg(long, value_name = "M", hide_short_help = true, value_parser = positive)]
    tag_size_m: Option<f64>,
    /// Gap between tags over their edge, for an AprilGrid and a sheet of tags.
    #[arg(long, value_name = "RATIO", hide_short_help = true, value_parser = positive)]
    tag_spacing_ratio: Option<f64>,
    /// Id of an AprilGrid's first tag [default: 0].
    #[arg(long, value_name = "ID", hide_short_help = true)]
    first_id: Option<u32>,
    /// Distance between rows of circles, in metres; circles of one row of an asymmetric grid are twice as far apart.
    #[arg(long, value_name = "M", hide_short_help = true, value_parser = positive)]
    spacing_m: Option<f64>,
    /// Diameter of circles, in metres [default: half the distance between neighbours].
    #[arg(long, value_name = "M", hide_short_help = true, value_parser = positive)]
    diameter_m: Option<f64>,
    /// Whether every second row of circles is shifted, as in OpenCV's asymmetric grid.
    #[arg(long, value_name = "true|false", hide_short_help = true)]
    asymmetric: Option<bool>,
    /// Abscissae of three dots on a line, in metres: A,B,C.
    #[arg(long, value_name = "M,M,M", hide_short_help = true, value_parser = numbers, allow_negative_numbers = true)]
    line_m: Option<String>,
    /// The fourth dot along and across the line, in metres: ALONG,ACROSS.
    #[arg(long, value_name = "M,M", hide_short_help = true, value_parser = numbers, allow_negative_numbers = true)]
    off_m: Option<String>,
    /// Diameter of dots or circles, in metres, also of a target from a file [default: a third of the smallest distance; of circles --diameter-m].
    #[arg(long, value_name = "M", hide_short_help = true, value_parser = positive)]
    pub dot_diameter_m: Option<f64>,
}

/// The keys that each kind needs, with an example of each.
const NEEDED: [(&str, &[(&str, &str)]); 6] = [
    ("tag", &[("id", "7"), ("size_m", "0.1")]),
    ("aprilgrid", &[("rows", "6"), ("columns", "6"), ("tag_size_m", "0.024"), ("tag_spacing_ratio", "0.3")]),
    ("chessboard", &[("rows", "6"), ("columns", "9"), ("square_m", "0.025")]),
    (
        "charuco",
        &[
            ("rows", "8"),
            ("columns", "5"),
            ("square_m", "0.03"),
            ("marker_m", "0.022"),
            ("dictionary", "DICT_5X5_100"),
        ],
    ),
    ("circle_grid", &[("rows", "11"), ("columns", "4"), ("spacing_m", "0.02"), ("asymmetric", "true")]),
    ("line_plus_one", &[("line_m", "0,0.1,0.15"), ("off_m", "0,0.1")]),
];

/// Checked here, passed on as the text of a list.
fn numbers(text: &str) -> Result<String, String> {
    let is_number = |x: &str| x.trim().parse::<f64>().is_ok_and(|x| x.is_finite());
    match text.split(',').all(is_number) {
        // A list of whole numbers is one of numbers in TOML too.
        true => Ok(format!("[{text}]")),
        false => Err("numbers separated by commas are needed, e.g. 0,0.1,0.15".to_owned()),
    }
}

impl TargetKeys {
    /// Each key that was given, as its file has it.
    fn given(&self) -> Vec<(&'static str, String)> {
        let text = |value: &Option<String>| value.as_ref().map(|v| toml_text(v));
        let number = |value: Option<f64>| value.map(|v| format!("{v:?}"));
        let count = |value: Option<u32>| value.map(|v| v.to_string());
        let all = [
            ("kind", text(&self.kind)),
            ("family", text(&self.family)),
            ("id", self.id.clone()),
            ("size_m", number(self.size_m)),
            ("rows", count(self.rows)),
            ("columns", count(self.columns)),
            ("square_m", number(self.square_m)),
            ("marker_m", number(self.marker_m)),
            ("dictionary", text(&self.dictionary)),
            ("legacy_pattern", self.legacy_pattern.then(|| "true".to_owned())),
            ("tag_size_m", number(self.tag_size_m)),
            ("tag_spacing_ratio", number(self.tag_spacing_ratio)),
            ("first_id", count(self.first_id)),
            ("spacing_m", number(self.spacing_m)),
            ("diameter_m", number(self.diameter_m)),
            ("asymmetric", self.asymmetric.map(|flag| flag.to_string())),
            ("line_m", self.line_m.clone()),
            ("off_m", self.off_m.clone()),
        ];
        all.into_iter().filter_map(|(key, value)| Some((key, value?))).collect()
    }

    /// The flag of the first key that was given.
    pub fn first_given(&self) -> Option<String> {
        self.given().first().map(|(key, _)| flag(key))
    }

    /// Refuses a kind of which keys are missing, all of them at once.
    fn must_be_whole(&self, kind: &str) -> Result<()> {
        let given = self.given();
        let needed = NEEDED.iter().find(|(known, _)| *known == kind).map_or(&[][..], |(_, keys)| keys);
        let is_missing = |(key, _): &&(&str, &str)| given.iter().all(|(known, _)| known != key);
        let missing: Vec<&(&str, &str)> = needed.iter().filter(is_missing).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let flags: Vec<String> = missing.iter().map(|(key, _)| flag(key)).collect();
        let example: Vec<String> =
            missing.iter().map(|(key, value)| format!("{} {value}", flag(key))).collect();
        bail!("--kind {kind} needs {}, e.g. {}", flags.join(", "), example.join(" "))
    }

    /// The target that the keys make, read as if they stood in a file.
    pub fn target(&self) -> Result<Target> {
        if self.kind.is_none() {
            bail!(
                "a target is needed: --target FILE, or --kind with the keys of a target, e.g. --kind tag --id 7 --size-m 0.1"
            );
        }
        let (kind, range) = (self.kind.as_deref().unwrap_or_default(), self.range()?);
        self.must_be_whole(kind)?;
        if let ("tag", Some((first, last))) = (kind, range) {
            return self.sheet(first, last);
        }
        let mut text = String::new();
        // A range is no number of a file.
        for (key, value) in self.given().into_iter().filter(|(key, _)| *key != "id" || range.is_none()) {
            let _ = writeln!(text, "{key} = {value}");
        }
        let file = Path::new("the target's flags");
        let read = formats::read_target_from_bytes(file, text.into_bytes())?;
        read.warnings.iter().for_each(|warning| crate::output::remark(&format!("warning: {warning}")));
        Ok(read.target)
    }

    /// `FIRST-LAST`; none for a single id.
    fn range(&self) -> Result<Option<(u32, u32)>> {
        let Some(id) = &self.id else { return Ok(None) };
        let number = |text: &str| {
            text.trim().parse::<u32>().ok().with_context(|| {
                format!("--id {id}: a whole number of 0 or more is needed, or a range such as 0-11")
            })
        };
        match id.split_once('-') {
            Some((first, last)) => Ok(Some((number(first)?, number(last)?))),
            None => number(id).map(|_| None),
        }
    }

    fn sheet(&self, first: u32, last: u32) -> Result<Target> {
        let known = ["kind", "family", "id", "size_m", "columns", "tag_spacing_ratio"];
        if let Some((key, _)) = self.given().into_iter().find(|(key, _)| !known.contains(key)) {
            bail!("{} does not go with a sheet of tags; it has {}", flag(key), known.map(flag).join(", "));
        }
        let size_m =
            self.size_m.context("a sheet of tags needs --size-m, the outer edge of the black square")?;
        let family = self.family.as_deref().unwrap_or("tag36h11");
        Ok(sheet_of_tags(family, (first, last), size_m, self.columns, self.tag_spacing_ratio)?)
    }
}

/// The flag of a key.
fn flag(key: &str) -> String {
    format!("--{}", key.replace('_', "-"))
}

/// A string as TOML has it.
fn toml_text(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
