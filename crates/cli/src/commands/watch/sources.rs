//! Where frames come from.

use super::names::{by_name, split};
use anyhow::{Context, Result, bail};
use clap::Args;
use resight::recording::is_recording;
use resight::source::mcap::McapTopic;
use resight::source::pictures::{Clock, Film, Folder, Pictures};
use resight::source::{Source, lines, video};
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// The sources.
#[derive(Debug, Args)]
pub struct SourceArgs {
    /// Where frames come from: a folder that fills up, pictures ('night/*.png'), a video file, a recording (run.mcap, or
    /// run.mcap#/topic where several topics show something), or - for detections as JSON Lines on stdin. NAME=SOURCE where there are several cameras.
    #[arg(long, required = true, value_name = "[NAME=]SOURCE")]
    source: Vec<String>,
    /// Pictures are this far apart [default: as their files' times say].
    #[arg(long, value_name = "SECONDS", value_parser = crate::args::positive)]
    period_s: Option<f64>,
}

/// A source for each camera. With `once` a folder ends with what it holds.
pub fn open(args: &SourceArgs, names: &[String], once: bool) -> Result<Vec<Box<dyn Source>>> {
    if args.source.iter().any(|argument| split(argument).1 == "-") {
        if args.source.len() != 1 {
            bail!("--source - serves all cameras; give it alone");
        }
        let all = lines::sources(BufReader::new(std::io::stdin()), names);
        return Ok(all.into_iter().map(|source| Box::new(source) as Box<dyn Source>).collect());
    }
    let clock = args.period_s.map_or(Clock::Modified, Clock::Every);
    let given = by_name("--source", &args.source, names)?;
    let source = |(value, name): (Option<String>, &String)| {
        let value =
            value.with_context(|| format!("camera {name} has no --source; give --source {name}=…"))?;
        one(&value, clock, once)
    };
    given.into_iter().zip(names).map(source).collect()
}

fn one(value: &str, clock: Clock, once: bool) -> Result<Box<dyn Source>> {
    let path = Path::new(value);
    if path.is_dir() {
        let folder = Folder::open(path, clock)?;
        return Ok(Box::new(if once { folder.as_it_is() } else { folder }));
    }
    if path.is_file() && video::is_video(path) {
        return Ok(Box::new(Film::open(path)?));
    }
    if let Some((file, topic)) = recording(value) {
        let topic = McapTopic::open(file, topic)?;
        return Ok(Box::new(if once { topic.as_it_is() } else { topic }));
    }
    let pictures: Vec<PathBuf> = crate::files::expand(&[value.to_string()])?;
    Ok(Box::new(Pictures::new(pictures, clock)))
}

/// A recording and its topic; a `#` belongs to the file's name where there is a file of that whole name.
fn recording(value: &str) -> Option<(&Path, Option<&str>)> {
    let parts = match value.rsplit_once('#') {
        Some((file, topic)) if !Path::new(value).exists() => (Path::new(file), Some(topic)),
        _ => (Path::new(value), None),
    };
    is_recording(parts.0).then_some(parts)
}
