//! The name of each image's view, from file names.

use crate::error::Error;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// An image of a camera.
pub(super) struct ImageFile {
    /// Which camera.
    pub camera: usize,
    /// The text that matched the wildcards of its pattern; none where it was given as a path.
    pub wild: Option<String>,
    /// The file.
    pub path: PathBuf,
}

/// Each image's view, and what to say about it: the file's name without its ending where cameras share such names, else what
/// the patterns' wildcards stand for. Where time stamps decide, names need only differ within a camera.
pub(super) fn names(images: &[ImageFile], are_timed: bool) -> Result<(Vec<String>, Option<String>), Error> {
    let stems: Vec<String> = images
        .iter()
        .map(|p| p.path.file_stem().unwrap_or_default().to_string_lossy().into_owned())
        .collect();
    let duplicates = duplicates(images, &stems);
    if duplicates.is_none() && (are_timed || are_shared(images, &stems)) {
        return Ok((stems, None));
    }
    let wild: Option<Vec<String>> = images.iter().map(|p| p.wild.clone()).collect();
    if let Some(wild) =
        wild.filter(|wild| self::duplicates(images, wild).is_none() && are_shared(images, wild))
    {
        let example = images.first().map(|p| p.path.display().to_string()).unwrap_or_default();
        let remark =
            format!("views are named by what the patterns' * stands for: {example} is view {}", wild[0]);
        return Ok((wild, Some(remark)));
    }
    match duplicates {
        Some((a, b)) => Err(Error::request(format!(
            "{} and {} are of one camera and would be one view; give folders by a pattern (NAME='*/image*.png') or rename them",
            a.display(),
            b.display()
        ))),
        None => Ok((stems, None)),
    }
}

/// Two images of one camera with the same name.
fn duplicates<'a>(images: &'a [ImageFile], names: &[String]) -> Option<(&'a Path, &'a Path)> {
    let mut seen = BTreeMap::new();
    let mut pairs = images.iter().zip(names);
    pairs.find_map(|(p, name)| seen.insert((p.camera, name), &p.path).map(|earlier| (&**earlier, &*p.path)))
}

/// Whether any name is that of images of two cameras.
fn are_shared(images: &[ImageFile], names: &[String]) -> bool {
    let mut cameras: BTreeMap<&str, BTreeSet<usize>> = BTreeMap::new();
    for (image, name) in images.iter().zip(names) {
        cameras.entry(name).or_default().insert(image.camera);
    }
    cameras.values().any(|cameras| 1 < cameras.len())
}

/// The text that matches the wildcards of a pattern in a path, folder by folder from the end; none without wildcards.
pub(super) fn wild_part(pattern: &str, path: &Path) -> Option<String> {
    let mut parts = Vec::new();
    let folders = Path::new(pattern).components().rev().zip(path.components().rev());
    for (pattern, name) in folders {
        let (pattern, name) = (pattern.as_os_str().to_string_lossy(), name.as_os_str().to_string_lossy());
        if pattern == "**" {
            break;
        }
        let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
        let stands_for = captured(&pattern, &name).unwrap_or_default();
        if !stands_for.is_empty() {
            parts.push(stands_for);
        }
    }
    parts.reverse();
    (!parts.is_empty()).then(|| parts.join("/"))
}

/// The letters that `*`, `?` and `[…]` stand for; none where the pattern does not fit.
fn captured(pattern: &[char], name: &[char]) -> Option<String> {
    match (pattern, name) {
        ([], []) => Some(String::new()),
        (['*', rest @ ..], _) => (0..=name.len()).find_map(|n| {
            let after = captured(rest, &name[n..])?;
            Some(name[..n].iter().collect::<String>() + &after)
        }),
        (['?', rest @ ..], [letter, after @ ..]) => Some(format!("{letter}{}", captured(rest, after)?)),
        (['[', class @ ..], [letter, after @ ..]) => {
            // A closing bracket right after the opening one (or its !) belongs to the class.
            let first = 1 + usize::from(class.first() == Some(&'!'));
            let close = (first..class.len()).find(|i| class[*i] == ']')?;
            Some(format!("{letter}{}", captured(&class[close + 1..], after)?))
        }
        ([expected, rest @ ..], [letter, after @ ..]) if expected == letter => captured(rest, after),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn images(list: &[(usize, &str, &str)]) -> Vec<ImageFile> {
        let image = |(camera, pattern, path): &(usize, &str, &str)| ImageFile {
            camera: *camera,
            wild: wild_part(pattern, Path::new(path)),
            path: PathBuf::from(path),
        };
        list.iter().map(image).collect()
    }

    #[test]
    fn wildcards_stand_for_what_differs() {
        for (pattern, path, part) in [
            ("left*.jpg", "left01.jpg", Some("01")),
            ("./a/left*.jpg", "a/left01.jpg", Some("01")),
            ("*/x?.png", "day2/x7.png", Some("day2/7")),
            ("a[0-9]b*.png", "a3b.png", Some("3")),
            ("a[]]*.png", "a]4.png", Some("]4")),
            ("*-*.png", "12-3.png", Some("123")),
            ("plain.png", "plain.png", None),
        ] {
            assert_eq!(wild_part(pattern, Path::new(path)).as_deref(), part, "{pattern}");
        }
    }

    #[test]
    fn names_that_cameras_share_name_the_view() {
        let same = images(&[(0, "a/*.png", "a/1.png"), (1, "b/*.png", "b/1.png"), (1, "b/*.png", "b/2.png")]);
        assert_eq!(names(&same, false).unwrap().0, ["1", "1", "2"]);
        let sided = images(&[(0, "l*.png", "l1.png"), (1, "r*.png", "r1.png")]);
        assert_eq!(names(&sided, false).unwrap().0, ["1", "1"]);
        assert_eq!(names(&sided, true).unwrap().0, ["l1", "r1"]);
        let paths = images(&[(0, "l1.png", "l1.png"), (1, "r1.png", "r1.png")]);
        assert_eq!(names(&paths, false).unwrap().0, ["l1", "r1"]);
    }

    #[test]
    fn folders_tell_recordings_apart() {
        let days =
            [(0, "d*/l*.png", "d1/l1.png"), (0, "d*/l*.png", "d2/l1.png"), (1, "d*/r*.png", "d2/r1.png")];
        assert_eq!(names(&images(&days), false).unwrap().0, ["1/1", "2/1", "2/1"]);
        let flat = images(&[(0, "d1/l1.png", "d1/l1.png"), (0, "d2/l1.png", "d2/l1.png")]);
        let reason = names(&flat, false).unwrap_err().to_string();
        assert!(reason.contains("would be one view"), "{reason}");
    }
}
