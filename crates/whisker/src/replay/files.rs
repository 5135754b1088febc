//! The files of a sweep, distinguished by their contents.

use super::MOST_READINGS;
use crate::files::object::{self, ObjectFile};
use crate::files::{ContactRow, HubRow, TextError, WhiskerFile, contacts, read_hub, whisker};
use serde_json::{Map, Value};

/// What the files hold, each with its name.
#[derive(Default)]
pub(super) struct Given {
    pub whisker: Option<(String, WhiskerFile)>,
    pub readings: Option<(String, Vec<HubRow>)>,
    pub contacts: Option<(String, Vec<ContactRow>)>,
    pub object: Option<(String, ObjectFile)>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Whisker,
    Readings,
    Contacts,
    Object,
}

impl Given {
    pub fn read(files: &[(&str, &str)]) -> Result<Self, TextError> {
        let mut given = Given::default();
        let kinds: Vec<Kind> = files.iter().map(|(_, text)| kind(text)).collect();
        // Readings are read as the whisker file says.
        let first = |kind: &Kind| *kind != Kind::Whisker;
        let mut order: Vec<usize> = (0..files.len()).collect();
        order.sort_by_key(|i| first(&kinds[*i]));
        for i in order {
            given.add(kinds[i], &plain(files[i].0), files[i].1)?;
        }
        Ok(given)
    }

    fn add(&mut self, kind: Kind, name: &str, text: &str) -> Result<(), TextError> {
        let located = |reason: TextError| TextError { line: None, message: format!("{name}: {reason}") };
        let named = |reason: String| TextError::whole(format!("{name}: {reason}"));
        match kind {
            Kind::Whisker => once(name, &mut self.whisker, whisker::read(text).map_err(named)?),
            Kind::Object => once(name, &mut self.object, object::read(text).map_err(named)?),
            Kind::Contacts => {
                let rows = contacts::read(text).map_err(located)?;
                few(name, rows.len())?;
                once(name, &mut self.contacts, rows)
            }
            Kind::Readings => {
                let Some((_, whisker)) = &self.whisker else {
                    let reason =
                        "these are readings, it seems; give the whisker file (whisker.json) with them";
                    return Err(named(reason.to_owned()));
                };
                let rows = read_hub(text, whisker.conventions).map_err(located)?;
                few(name, rows.len())?;
                once(name, &mut self.readings, rows)
            }
        }
    }

    /// Why there is nothing to play.
    pub fn lacking(&self) -> TextError {
        let needed =
            "a whisker file and hub readings are needed, or the contacts that `resight whisker solve` wrote";
        TextError::whole(match (&self.whisker, &self.object) {
            (Some((name, _)), _) => {
                format!("{name} describes a whisker, and there are no readings; {needed}")
            }
            (None, Some((name, _))) => {
                format!("{name} describes an object, and there are no contacts; {needed}")
            }
            (None, None) => format!("no file; {needed}"),
        })
    }

    /// Files that were not used.
    pub fn remarks(&self) -> Option<String> {
        let (name, _) = self.contacts.as_ref().filter(|_| self.readings.is_some())?;
        Some(format!("{name} is not used: the contacts are those of the readings"))
    }
}

fn once<T>(name: &str, place: &mut Option<(String, T)>, read: T) -> Result<(), TextError> {
    if let Some((earlier, _)) = place {
        return Err(TextError::whole(format!("{name} is of the same kind as {earlier}; give one of them")));
    }
    *place = Some((name.to_owned(), read));
    Ok(())
}

fn few(name: &str, n: usize) -> Result<(), TextError> {
    match n {
        n if MOST_READINGS < n => Err(TextError::whole(format!(
            "{name}: {n} rows; {MOST_READINGS} are played at most: give it in parts"
        ))),
        _ => Ok(()),
    }
}

/// A whole JSON object is a whisker or an object; everything else has rows.
fn kind(text: &str) -> Kind {
    let trimmed = text.trim_start_matches('\u{feff}').trim_start();
    if !trimmed.starts_with('{') {
        return if contacts::is_contacts(text) { Kind::Contacts } else { Kind::Readings };
    }
    let keys = |text: &str| serde_json::from_str::<Map<String, Value>>(text).ok();
    let has = |keys: &Map<String, Value>, names: &[&str]| names.iter().any(|name| keys.contains_key(*name));
    // JSON Lines: the first line is a whole object.
    let first = trimmed.lines().next().unwrap_or_default();
    match (keys(first), keys(trimmed)) {
        (Some(row), _) if has(&row, &["side"]) => Kind::Contacts,
        (Some(row), _) if has(&row, &["mz", "hub_x"]) => Kind::Readings,
        (_, Some(whole)) if has(&whole, &["type", "verdict", "object"]) => Kind::Object,
        // Also what is broken: that it begins as a whisker file says what it was meant to be.
        _ => Kind::Whisker,
    }
}

/// A name without folders, and short enough for a message.
fn plain(name: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let kept: String = last.chars().filter(|c| !c.is_control()).take(80).collect();
    if kept.is_empty() { "file".to_owned() } else { kept }
}
