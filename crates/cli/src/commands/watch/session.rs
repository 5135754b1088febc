//! The session file of `watch`. Its keys are the flags, so that the file can say whatever a flag can, and nothing is defined twice:
//! `--false-alarms-per-day 1` is `false_alarms_per_day = 1`. What belongs to one camera or target may stand in a table of its own:
//!
//! ```toml
//! [camera.gate]
//! file = "gate.yaml"
//! source = "rtsp://cam.local/stream1"
//!
//! [target.door]
//! file = "tag.toml"
//! ```

use anyhow::{Context, Result, bail};
use clap::builder::ValueParser;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use resight::input::{Kind, read_text};
use resight_watch::names::split;
use resight_watch::source::stream::is_stream;
use std::any::TypeId;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use toml::{Table, Value};

/// Flags of `[camera.NAME]`; its `file` is `--camera`.
const OF_CAMERA: [&str; 9] = [
    "source",
    "reference",
    "save-reference",
    "landmarks",
    "save-landmarks",
    "ffmpeg-input-options",
    "hfov-deg",
    "focal-mm",
    "sensor-width-mm",
];
/// Flags that are about the file itself.
const OWN: [&str; 3] = ["print-session", "help", "version"];

/// One flag as the command line has it: its name and its value.
type Words = Vec<String>;

/// The command line that a session file and the flags beside it mean; a flag takes the place of the file's key.
///
/// # Errors
/// No such file, no TOML, a key that is no flag (with the nearest that is), a value of another kind than the flag's.
pub fn words(path: &Path, watch: &Command, given: &ArgMatches) -> Result<Words> {
    let shown = path.display();
    if path.is_dir() || (!path.is_file() && is_stream(&shown.to_string())) {
        bail!(
            "{shown} is a source of images, not a session file: give --source {shown} with --camera and --target, or with --hfov-deg and --save-landmarks"
        );
    }
    let text = read_text(path, Kind::Text)?;
    let at = || path.display().to_string();
    let table: Table = toml::from_str(&text).with_context(at)?;
    let mut words = Words::new();
    for (flag, values) in flags(&table, watch).with_context(at)? {
        let arg = arguments(watch).find(|arg| arg.get_long() == Some(&flag));
        let is_given = arg.is_some_and(|arg| is_given(arg, given));
        if !is_given {
            words.extend(values);
        }
    }
    words.extend(of_shell(watch, given).into_iter().flat_map(|(_, words)| words));
    Ok(words)
}

/// The words of each key, by flag.
fn flags(table: &Table, watch: &Command) -> Result<BTreeMap<String, Words>> {
    let mut flags: BTreeMap<String, Words> = BTreeMap::new();
    let mut add = |key: &str, name: Option<&str>, value: &Value| -> Result<()> {
        let arg = argument(watch, key)?;
        let long = arg.get_long().unwrap_or_default().to_string();
        let words = words_of(arg, key, name, value)?;
        flags.entry(long).or_default().extend(words);
        Ok(())
    };
    for (key, value) in table {
        match (key.as_str(), value) {
            ("camera" | "target", Value::Table(named)) => {
                for (name, inner, value) in leaves(named) {
                    if name.is_empty() {
                        bail!("[{key}.{inner}] is no table: write [{key}.{inner}] and below it file = \"…\"");
                    }
                    let flag = if inner == "file" { key.as_str() } else { inner };
                    let is_known = key == "camera" && OF_CAMERA.contains(&dashed(inner).as_str());
                    if inner != "file" && !is_known {
                        bail!("[{key}.{name}] {inner}: {}", not_among(inner, &section_keys(key)));
                    }
                    add(flag, Some(&name), value)?;
                }
            }
            (_, Value::Table(named)) => {
                for (name, inner, value) in leaves(named) {
                    add(key, Some(&joined(&name, inner)), value)?;
                }
            }
            _ => add(key, None, value)?,
        }
    }
    Ok(flags)
}

/// The values of a table that are no tables, each with the name of its table and its key. Tables in tables are one name with dots, which TOML makes
/// several keys where it is not quoted: `[camera.cam.north]` is the camera `cam.north`.
fn leaves(table: &Table) -> Vec<(String, &str, &Value)> {
    let mut found = Vec::new();
    for (key, value) in table {
        match value {
            Value::Table(inner) => {
                let within = leaves(inner).into_iter();
                found.extend(within.map(|(name, leaf, value)| (joined(key, &name), leaf, value)));
            }
            value => found.push((String::new(), key.as_str(), value)),
        }
    }
    found
}

fn joined(first: &str, second: &str) -> String {
    [first, second].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(".")
}

fn section_keys(section: &str) -> Vec<String> {
    let more = if section == "camera" { &OF_CAMERA[..] } else { &[] };
    std::iter::once("file".to_string()).chain(more.iter().map(|flag| underscored(flag))).collect()
}

/// The flag of a key.
fn argument<'a>(watch: &'a Command, key: &str) -> Result<&'a Arg> {
    // Sessions written for version 1 have keys that are aliases of flags now.
    let is_alias = |arg: &&Arg| arg.get_all_aliases().is_some_and(|all| all.contains(&dashed(key).as_str()));
    match arguments(watch).find(|arg| key_of(arg) == key).or_else(|| arguments(watch).find(is_alias)) {
        Some(arg) => Ok(arg),
        None => bail!("{key}: {}", not_among(key, &keys(watch))),
    }
}

fn not_among(key: &str, keys: &[String]) -> String {
    let nearest = resight::input::nearest(key, keys.iter().cloned());
    let hint = nearest.map(|nearest| format!("; did you mean `{nearest}`?")).unwrap_or_default();
    format!("there is no such key{hint} (`resight watch --print-session` lists them)")
}

/// All keys.
fn keys(watch: &Command) -> Vec<String> {
    arguments(watch).map(key_of).collect()
}

fn arguments(watch: &Command) -> impl Iterator<Item = &Arg> {
    watch.get_arguments().filter(|arg| arg.get_long().is_some_and(|long| !OWN.contains(&long)))
}

fn key_of(arg: &Arg) -> String {
    underscored(arg.get_long().unwrap_or_default())
}

fn dashed(key: &str) -> String {
    key.replace('_', "-")
}

fn underscored(flag: &str) -> String {
    flag.replace('-', "_")
}

/// A key's value as words of the shell.
fn words_of(arg: &Arg, key: &str, name: Option<&str>, value: &Value) -> Result<Words> {
    let long = arg.get_long().unwrap_or_default();
    let is_switch = matches!(arg.get_action(), ArgAction::SetTrue);
    let one = |value: &Value| -> Result<String> {
        let text = match value {
            Value::String(text) => text.clone(),
            Value::Integer(n) => n.to_string(),
            Value::Float(x) => x.to_string(),
            other => bail!("{key}: a text or a number is needed, not a {}", other.type_str()),
        };
        Ok(match name {
            Some(name) => format!("--{long}={name}={text}"),
            None => format!("--{long}={text}"),
        })
    };
    match value {
        Value::Boolean(is_set) if is_switch => {
            Ok(if *is_set { vec![format!("--{long}")] } else { Vec::new() })
        }
        _ if is_switch => bail!("{key}: true or false is needed"),
        Value::Array(values) if is_list(arg) => values.iter().map(one).collect(),
        Value::Array(_) => bail!("{key}: one value is needed, not a list"),
        value => Ok(vec![one(value)?]),
    }
}

fn is_given(arg: &Arg, given: &ArgMatches) -> bool {
    given.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine)
}

fn is_list(arg: &Arg) -> bool {
    matches!(arg.get_action(), ArgAction::Append)
}

/// The flags given in the shell, as words.
fn of_shell<'a>(watch: &'a Command, given: &ArgMatches) -> Vec<(&'a Arg, Words)> {
    let of = |arg: &'a Arg| {
        let (id, long) = (arg.get_id().as_str(), arg.get_long()?);
        if !is_given(arg, given) {
            return None;
        }
        let words = match arg.get_action() {
            ArgAction::SetTrue => vec![format!("--{long}")],
            _ => given.get_raw(id)?.map(|value| format!("--{long}={}", value.to_string_lossy())).collect(),
        };
        Some((arg, words))
    };
    arguments(watch).filter_map(of).collect()
}

/// The session file that the given flags mean; below it every other key with its default, as comments.
pub fn text(watch: &Command, given: &ArgMatches) -> String {
    let shell = of_shell(watch, given);
    let (mut top, mut sections) = (String::new(), BTreeMap::<String, String>::new());
    for (arg, words) in &shell {
        let long = arg.get_long().unwrap_or_default();
        let values: Vec<&str> =
            words.iter().filter_map(|word| word.strip_prefix(&format!("--{long}="))).collect();
        let is_of_section = long == "camera" || long == "target" || OF_CAMERA.contains(&long);
        let named: Option<Vec<(&str, &str)>> =
            values.iter().map(|value| split(value)).map(|(name, value)| Some((name?, value))).collect();
        match named.filter(|named| is_of_section && named.iter().all(|(name, _)| !name.contains('/'))) {
            Some(named) => {
                let section = if long == "target" { "target" } else { "camera" };
                let key = if long == section { "file".to_string() } else { key_of(arg) };
                for (name, value) in named {
                    let lines = sections.entry(format!("[{section}.{}]", bare(name))).or_default();
                    let _ = writeln!(lines, "{key} = {}", quoted(value));
                }
            }
            None => {
                let _ = writeln!(top, "{} = {}", key_of(arg), value_text(arg, &values));
            }
        }
    }
    let mut out = format!("# A session of `resight watch`: resight watch SESSION.toml\n{top}");
    let others: String = arguments(watch)
        .filter(|arg| !shell.iter().any(|(given, _)| given.get_id() == arg.get_id()))
        .map(comment)
        .collect();
    let _ = write!(out, "\n# Further keys; a value is the default.\n{others}");
    for (head, lines) in sections {
        let _ = write!(out, "\n{head}\n{lines}");
    }
    out
}

fn value_text(arg: &Arg, values: &[&str]) -> String {
    if matches!(arg.get_action(), ArgAction::SetTrue) {
        return "true".to_string();
    }
    let one = |value: &&str| match is_number(arg.get_value_parser()) {
        true => value.to_string(),
        false => quoted(value),
    };
    match is_list(arg) {
        true => format!("[{}]", values.iter().map(one).collect::<Vec<_>>().join(", ")),
        false => values.last().map(one).unwrap_or_default(),
    }
}

fn is_number(parser: &ValueParser) -> bool {
    [TypeId::of::<f64>(), TypeId::of::<usize>(), TypeId::of::<u32>()].iter().any(|id| parser.type_id() == *id)
}

/// `# key = default   what it is`.
fn comment(arg: &Arg) -> String {
    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let defaults: Vec<&str> = arg.get_default_values().iter().filter_map(|value| value.to_str()).collect();
    let value = match (arg.get_action(), &defaults[..]) {
        (ArgAction::SetTrue, _) => "false".to_string(),
        (_, []) => "…".to_string(),
        (_, defaults) => value_text(arg, defaults),
    };
    format!("# {} = {value}   {}\n", key_of(arg), help.replace('\n', " "))
}

fn quoted(text: &str) -> String {
    Value::String(text.to_string()).to_string()
}

/// A key of TOML.
fn bare(name: &str) -> String {
    let is_bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if is_bare { name.to_string() } else { quoted(name) }
}
