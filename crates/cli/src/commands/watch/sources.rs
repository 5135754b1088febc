//! `[NAME=]VALUE` arguments of several cameras, and the sources they name.

use anyhow::{Context, Result, bail};
use resight::source::pictures::{Clock, Film, Folder, Pictures};
use resight::source::{Source, lines, video};
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// The cameras' names: those given, `cam0` and so on otherwise.
pub fn names(cameras: &[String]) -> Vec<String> {
    let name = |(i, camera): (usize, &String)| match split(camera) {
        (Some(name), _) => name.to_string(),
        (None, _) => format!("cam{i}"),
    };
    cameras.iter().enumerate().map(name).collect()
}

/// NAME and VALUE; no name where what stands before `=` is a path.
fn split(argument: &str) -> (Option<&str>, &str) {
    match argument.split_once('=') {
        Some((name, value)) if !name.is_empty() && !name.contains(['/', '\\', '*', ':']) => {
            (Some(name), value)
        }
        _ => (None, argument),
    }
}

/// The values of one flag, one place for each camera.
pub fn by_name(flag: &str, arguments: &[String], names: &[String]) -> Result<Vec<Option<String>>> {
    let mut values = vec![None; names.len()];
    for (i, argument) in arguments.iter().enumerate() {
        let (name, value) = split(argument);
        let place = match name {
            Some(name) => names.iter().position(|known| known == name),
            None if i < names.len() => Some(i),
            None => None,
        };
        let place = place.with_context(|| {
            format!("{flag} {argument}: there is no such camera; there are {}", names.join(", "))
        })?;
        if values[place].replace(value.to_string()).is_some() {
            bail!("{flag} is given twice for camera {}; once is needed", names[place]);
        }
    }
    Ok(values)
}

/// A source for each camera. `-` on its own serves all of them. `once`: a folder ends with what is in it.
pub fn open(
    arguments: &[String],
    names: &[String],
    period_s: Option<f64>,
    once: bool,
) -> Result<Vec<Box<dyn Source>>> {
    if arguments.iter().any(|argument| split(argument).1 == "-") {
        if arguments.len() != 1 {
            bail!("--source - serves all cameras; give it alone");
        }
        let all = lines::sources(BufReader::new(std::io::stdin()), names);
        return Ok(all.into_iter().map(|source| Box::new(source) as Box<dyn Source>).collect());
    }
    let clock = period_s.map_or(Clock::Modified, Clock::Every);
    let given = by_name("--source", arguments, names)?;
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
    let pictures: Vec<PathBuf> = crate::files::expand(&[value.to_string()])?;
    Ok(Box::new(Pictures::new(pictures, clock)))
}
