//! Photographs that share lenses, as photogrammetry programs state them: a lens by its key, and a pose for each photograph.

use super::{Contents, NamedCamera, Placement};
use std::collections::HashMap;

/// A photograph that has a pose.
pub(super) struct Shot {
    /// Key of its lens.
    pub lens: String,
    /// Its name, which one of the frames of `placement` has.
    pub name: String,
    pub placement: Placement,
}

/// Adds lenses by their keys, and photographs. A lens of one photograph becomes a camera with that one's name and place; a
/// lens of several stays a camera without a place, and their poses are those of other frames.
pub(super) fn add(contents: &mut Contents, lenses: Vec<(String, NamedCamera)>, shots: Vec<Shot>) {
    let mut of_lens: HashMap<String, Vec<Shot>> = HashMap::new();
    for shot in shots {
        of_lens.entry(shot.lens.clone()).or_default().push(shot);
    }
    for (key, mut camera) in lenses {
        let mut shots = of_lens.remove(&key).unwrap_or_default();
        match shots.pop() {
            Some(only) if shots.is_empty() => {
                (camera.name, camera.placement) = (only.name, Some(only.placement))
            }
            last => contents.relations.extend(shots.into_iter().chain(last).map(|shot| shot.placement)),
        }
        contents.cameras.push(camera);
    }
}
