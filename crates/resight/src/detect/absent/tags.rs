//! Single tags and maps of tags that were not found.

use super::{INVERTED, MIRRORED, inverted, mirrored};
use crate::GrayImage;
use crate::detect::every_tag::{EveryTagFinder, FamilyTags};
use resight_core::target::{Tag, TagMap};

/// Largest number of ids named in a sentence.
const MOST_NAMED: usize = 8;

/// The tags that are searched for, and their names in the file.
pub(super) struct Wanted<'a> {
    pub family: &'a str,
    pub ids: Vec<u32>,
    /// The name of the ids: `id 7`.
    pub named: String,
    /// How to state another family in the file.
    pub way_out: &'static str,
}

impl<'a> Wanted<'a> {
    pub fn of_tag(tag: &'a Tag) -> Self {
        let named = format!("id {}", tag.id);
        Wanted { family: &tag.family, ids: vec![tag.id], named, way_out: "correct `family`" }
    }

    pub fn of_map(map: &'a TagMap) -> Self {
        Wanted {
            family: &map.family,
            ids: map.tags.iter().map(|tag| tag.id).collect(),
            named: "an id of the map".to_owned(),
            way_out: "state the family in the map, or with --tag-family",
        }
    }
}

/// Looks for tags of the family with other ids, for the wanted tags mirrored or inverted, and else for tags of another family.
pub(super) fn instead(wanted: &Wanted, image: &GrayImage) -> Option<String> {
    let family = wanted.family;
    let mut finder = EveryTagFinder::new(family).ok()?;
    if let Some(own) = finder.find(image).first() {
        return Some(format!("tags of {family} are there, but none with {}: {}", wanted.named, named(own)));
    }
    of_whole_image(wanted, &mut finder, image).or_else(|| other_family(wanted, image))
}

/// Checks whether the mirrored or inverted image shows tags of the family.
pub(super) fn of_whole_image(
    wanted: &Wanted,
    finder: &mut EveryTagFinder,
    image: &GrayImage,
) -> Option<String> {
    for (changed, what) in [(mirrored(image), MIRRORED), (inverted(image), INVERTED)] {
        let Some(own) = finder.find(&changed).into_iter().next() else { continue };
        let is_wanted = own.tags.iter().any(|tag| wanted.ids.contains(&tag.id));
        return Some(match is_wanted {
            true => what.to_owned(),
            false => format!("tags of {} are there, but {}: {}", own.family, reversed(what), named(&own)),
        });
    }
    None
}

fn reversed(what: &str) -> &'static str {
    if what == MIRRORED { "mirrored, and with other ids" } else { "inverted, and with other ids" }
}

/// Looks for tags of another family, and checks whether they have the wanted ids.
fn other_family(wanted: &Wanted, image: &GrayImage) -> Option<String> {
    let found = EveryTagFinder::new("any").ok()?.find(image);
    let other = found.first()?;
    let has_wanted = other.tags.iter().any(|tag| wanted.ids.contains(&tag.id));
    let way_out = if has_wanted { wanted.way_out.to_owned() } else { format!("none has {}", wanted.named) };
    Some(format!(
        "no tag of {} is there, but tags of {} are: {}; {way_out}",
        wanted.family,
        other.family,
        named(other),
    ))
}

/// Names a few of the ids.
pub(super) fn named(family: &FamilyTags) -> String {
    let mut ids: Vec<u32> = family.tags.iter().map(|tag| tag.id).collect();
    ids.sort_unstable();
    ids.dedup();
    let named: Vec<String> = ids.iter().take(MOST_NAMED).map(u32::to_string).collect();
    let more = if MOST_NAMED < ids.len() { ", …" } else { "" };
    format!("{}{more}", named.join(", "))
}
