//! Derives the name of each image's view from file names.

use crate::error::Error;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// An image of a camera.
pub(super) struct ImageFile {
    /// Index of the camera.
    pub camera: usize,
    /// The text matched by the wildcards of its pattern; `None` where it was given as a path.
    pub wild: Option<String>,
    /// The file.
    pub path: PathBuf,
}

/// Returns each image's view, and remarks: the file's name without its extension where cameras share such names, else the text matched by the
/// patterns' wildcards, else the name without the part that denotes the camera. Where time stamps decide, names only need to differ within a
/// camera.
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
    let others = [
        (wild, "what the patterns' * stands for"),
        (without_camera(images, &stems), "what the file names of all cameras share"),
    ];
    for (names, what) in others {
        let fits =
            |names: &Vec<String>| self::duplicates(images, names).is_none() && are_shared(images, names);
        if let Some(names) = names.filter(fits) {
            let example = images.first().map(|p| p.path.display().to_string()).unwrap_or_default();
            let remark = format!("views are named by {what}: {example} is view {}", names[0]);
            return Ok((names, Some(remark)));
        }
    }
    match duplicates {
        Some((a, b)) if a == b => {
            Err(Error::request(format!("{} is given twice; leave one out", a.display())))
        }
        Some((a, b)) => Err(Error::request(format!(
            "{} and {} are of one camera and would be one view; give folders by a pattern (NAME='*/image*.png') or rename them",
            a.display(),
            b.display()
        ))),
        None => Ok((stems, None)),
    }
}

/// Finds two images of one camera with the same name.
fn duplicates<'a>(images: &'a [ImageFile], names: &[String]) -> Option<(&'a Path, &'a Path)> {
    let mut seen = BTreeMap::new();
    let mut pairs = images.iter().zip(names);
    pairs.find_map(|(p, name)| seen.insert((p.camera, name), &p.path).map(|earlier| (&**earlier, &*p.path)))
}

/// Returns whether any name occurs for images of two cameras.
fn are_shared(images: &[ImageFile], names: &[String]) -> bool {
    let mut cameras: BTreeMap<&str, BTreeSet<usize>> = BTreeMap::new();
    for (image, name) in images.iter().zip(names) {
        cameras.entry(name).or_default().insert(image.camera);
    }
    cameras.values().any(|cameras| 1 < cameras.len())
}

/// Removes the parts that denote the camera: those that are equal in all images of a camera and differ between cameras, such as `left` and
/// `right` of `left01` and `right01`. `None` where the names have different structures, or where a camera has a single image, whose number is
/// the same in all of its images too.
fn without_camera(images: &[ImageFile], stems: &[String]) -> Option<Vec<String>> {
    let parts: Vec<Vec<&str>> = stems.iter().map(|stem| parts(stem)).collect();
    let n_parts = parts.first()?.len();
    let mut of_camera: BTreeMap<usize, Vec<&Vec<&str>>> = BTreeMap::new();
    images
        .iter()
        .zip(&parts)
        .for_each(|(image, parts)| of_camera.entry(image.camera).or_default().push(parts));
    if of_camera.values().any(|names| names.len() < 2) || parts.iter().any(|parts| parts.len() != n_parts) {
        return None;
    }
    let is_of_camera = |i: &usize| {
        let is_constant = |names: &Vec<&Vec<&str>>| names.iter().all(|parts| parts[*i] == names[0][*i]);
        parts.iter().any(|other| other[*i] != parts[0][*i]) && of_camera.values().all(is_constant)
    };
    let kept: Vec<usize> = (0..n_parts).filter(|i| !is_of_camera(i)).collect();
    let name = |parts: &Vec<&str>| {
        let text: String = kept.iter().map(|i| parts[*i]).collect();
        text.trim_matches(|c: char| !c.is_alphanumeric()).to_string()
    };
    let names: Vec<String> = parts.iter().map(name).collect();
    names.iter().all(|name| !name.is_empty()).then_some(names)
}

/// Splits a name into runs of letters, of digits and of other characters.
fn parts(name: &str) -> Vec<&str> {
    let kind = |c: char| (c.is_ascii_digit(), c.is_alphabetic());
    let mut parts = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let end = rest.find(|c| kind(c) != kind(first)).unwrap_or(rest.len());
        parts.push(&rest[..end]);
        rest = &rest[end..];
    }
    parts
}

/// Returns the text that the wildcards of a pattern match in a path, folder by folder from the end; `None` without wildcards.
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

/// Returns the text that `*`, `?` and `[…]` match; `None` where the pattern does not match.
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

    /// Names of lists of paths, one letter a camera.
    fn of_lists(list: &[(usize, &str)]) -> (Vec<String>, Option<String>) {
        let list: Vec<_> = list.iter().map(|(camera, path)| (*camera, *path, *path)).collect();
        names(&images(&list), false).unwrap()
    }

    #[test]
    fn the_part_that_stands_for_the_camera_is_left_out() {
        let sided = of_lists(&[(0, "left01.jpg"), (0, "left12.jpg"), (1, "right12.jpg"), (1, "right03.jpg")]);
        assert_eq!(sided.0, ["01", "12", "12", "03"]);
        assert!(sided.1.is_some_and(|remark| remark.contains("left01.jpg is view 01")));
        let numbered =
            [(0, "a/cam0_2024-01-02_7.png"), (0, "a/cam0_2024-01-02_8.png"), (1, "a/cam1_2024-01-02_8.png")];
        assert_eq!(of_lists(&numbered).0[2], "cam1_2024-01-02_8", "a camera of one image says nothing");
        let numbered = [&numbered[..], &[(1, "a/cam1_2024-01-02_9.png")]].concat();
        assert_eq!(of_lists(&numbered).0[2], "cam_2024-01-02_8");
    }

    /// Left01 and right04 are not the same view, whichever parts are removed.
    #[test]
    fn names_that_share_nothing_stay_as_they_are() {
        for other in [["right04.jpg", "right05.jpg"], ["r_a.jpg", "r_b.jpg"], ["x.jpg", "y.jpg"]] {
            let list = [(0, "left01.jpg"), (0, "left02.jpg"), (1, other[0]), (1, other[1])];
            let (names, remark) = of_lists(&list);
            assert_eq!((names[0].as_str(), remark), ("left01", None), "{other:?}");
        }
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
