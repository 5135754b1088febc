//! `whisker identify`: the object behind the contacts, or what is missing to name it.

use super::{answer, input, picture};
use crate::output::{Outcome, print};
use anyhow::{Result, bail};
use clap::Args;
use resight::formats::write_atomically;
use resight::report::verdict::Status;
use resight_whisker::files::identification::{
    IdentificationObject, model_name, parse_class, reason_in_words, touch, verdict_name,
};
use resight_whisker::files::{ContactRow, contacts};
use resight_whisker::identify::{Class, Config, Identification, Parameter, Touch, Verdict, identify};
use std::path::PathBuf;

/// The simplest convex object that explains the contacts, or what is missing to say it.
///
/// Contacts between clamp and tip give supporting lines of the object, contacts at the tip points of its outline. The verdict is
/// circle, ellipse, square, rectangle, polygon, or insufficient_coverage with its reason and the sweep that would decide.
#[derive(Debug, Args)]
pub struct Identify {
    /// What `whisker solve` wrote, CSV or JSON Lines.
    #[arg(value_name = "CONTACTS.csv")]
    contacts: PathBuf,
    /// The answer as JSON; the file is replaced only when complete. --object of `solve` and --known of `calibrate` take it.
    #[arg(short, long, value_name = "OBJECT.json")]
    output: Option<PathBuf>,
    /// Classes that may be answered.
    #[arg(long, value_name = "CLASS,…", value_delimiter = ',', value_parser = class)]
    models: Vec<Class>,
    /// Image of contacts and outline; SVG or PNG by its ending.
    #[arg(long, value_name = "OUT.svg|.png", value_parser = picture::path)]
    picture: Option<PathBuf>,
    /// One JSON object on stdout.
    #[arg(long)]
    json: bool,
}

fn class(word: &str) -> Result<Class, String> {
    parse_class(word).ok_or("circle, ellipse, square, rectangle or polygon is needed".to_string())
}

/// See `Identify`.
pub fn run(args: &Identify) -> Result<Outcome> {
    for path in args.output.iter().chain(&args.picture) {
        crate::files::must_be_writable(path)?;
    }
    let text = input::text(&args.contacts)?;
    let rows = contacts::read(&text).map_err(|e| input::located(&args.contacts, &e))?;
    if rows.iter().any(|row| row.spatial.is_some()) {
        bail!(
            "{}: contacts in space (column `roll`); outlines are identified in the plane",
            args.contacts.display()
        );
    }
    let touches: Vec<Touch> = rows.iter().filter_map(touch).collect();
    let mut config = Config::default();
    if !args.models.is_empty() {
        config.classes.clone_from(&args.models);
    }
    let answer = identify(&touches, &config)?;
    let written = write(args, &rows, &answer)?;
    match args.json {
        true => print(&answer::line(IdentificationObject::from(&answer))?)?,
        false => print(&words(args, &answer, &written))?,
    }
    let is_named = matches!(answer.verdict, Verdict::Is(_));
    Ok(Outcome::of([if is_named { Status::Ok } else { Status::Undecided }]))
}

fn write(args: &Identify, rows: &[ContactRow], answer: &Identification) -> Result<Vec<String>> {
    let mut written = Vec::new();
    if let Some(path) = &args.output {
        let text = serde_json::to_string_pretty(&IdentificationObject::from(answer))? + "\n";
        write_atomically(path, text.as_bytes())?;
        written.push(path.display().to_string());
    }
    if let Some(path) = &args.picture {
        picture::write(path, &picture::contacts(rows, answer.shape.as_ref(), &notes(answer)))?;
        written.push(path.display().to_string());
    }
    Ok(written)
}

/// For the image: verdict and parameters.
fn notes(answer: &Identification) -> Vec<String> {
    let mut notes = vec![verdict_name(answer.verdict).replace('_', " ")];
    if matches!(answer.verdict, Verdict::Is(_)) && answer.parameters.len() <= 6 {
        notes.extend(answer.parameters.iter().map(parameter));
    }
    notes
}

/// `radius 25.012 ± 0.018 mm`.
fn parameter(p: &Parameter) -> String {
    let name = p.name.trim_end_matches("_rad").trim_end_matches("_m").replace('_', " ");
    match p.unit {
        "rad" => format!("{name} {:.3} ± {:.3} °", p.value.to_degrees(), p.sigma.to_degrees()),
        _ => format!("{name} {:.3} ± {:.3} mm", 1e3 * p.value, 1e3 * p.sigma),
    }
}

fn words(args: &Identify, answer: &Identification, written: &[String]) -> String {
    let mut out = format!(
        "{}   {}\n",
        args.contacts.display(),
        verdict_name(answer.verdict).to_uppercase().replace('_', " ")
    );
    let mut line = |label: &str, text: &str| crate::text::line(&mut out, label, text);
    if let Some(reason) = &answer.reason {
        line("because", &reason_in_words(reason));
    }
    if !answer.advice.is_empty() {
        line("advice", &answer.advice);
    }
    if matches!(answer.verdict, Verdict::Is(_)) {
        answer.parameters.iter().for_each(|p| line("", &parameter(p)));
    }
    let scores = answer.scores.iter().take(5);
    let scores: Vec<String> = scores.map(|s| format!("{} {:.1}", model_name(s.model), s.bic)).collect();
    line("scores", &format!("BIC {}", scores.join(", ")));
    line("coverage", &coverage(answer));
    if !written.is_empty() {
        line("written", &written.join(", "));
    }
    out
}

fn coverage(answer: &Identification) -> String {
    let c = &answer.coverage;
    let range = match c.normals_range_rad {
        Some([from, to]) => format!("normals over {:.0}°", (to - from).to_degrees()),
        None => "no normals".to_string(),
    };
    format!(
        "{range}, {} contacts used ({} at the tip), {} not; {} corners and {} faces seen",
        c.used,
        c.tip_contacts,
        c.gated,
        c.corners_seen.len(),
        c.faces_seen
    )
}
