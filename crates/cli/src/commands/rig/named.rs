//! Cameras and targets under the names they were given.

use super::Collected;
use crate::args::TagArgs;
use anyhow::{Result, bail};
use resight::core::Target;
use resight::formats::{self, NamedCamera};
use resight::rig::NamedTarget;
use std::path::{Path, PathBuf};

/// `NAME=REST`; a file whose own name has an equals sign is no name.
pub fn split(argument: &str) -> (Option<&str>, &str) {
    match argument.split_once('=') {
        Some((name, rest)) if !name.is_empty() && !Path::new(argument).exists() => (Some(name), rest),
        _ => (None, argument),
    }
}

/// The cameras of `--camera` and what is unusual about their files, for a command without observations.
pub fn cameras_alone(arguments: &[String]) -> Result<(Vec<NamedCamera>, Vec<String>)> {
    let mut collected = Collected::default();
    let cameras = cameras(arguments, &mut collected)?;
    Ok((cameras, collected.remarks))
}

/// The cameras of `--camera`, as they come.
pub(super) fn cameras(arguments: &[String], collected: &mut Collected) -> Result<Vec<NamedCamera>> {
    let mut cameras: Vec<NamedCamera> = Vec::new();
    for argument in arguments {
        let (name, file) = split(argument);
        crate::files::camera_must_exist(file)?;
        for camera in cameras_of(name, file, collected)? {
            if cameras.iter().any(|earlier| earlier.name == camera.name) {
                bail!("two cameras are called `{}`; give each a name: --camera NAME=FILE", camera.name);
            }
            cameras.push(camera);
        }
    }
    Ok(cameras)
}

fn cameras_of(name: Option<&str>, file: &str, collected: &mut Collected) -> Result<Vec<NamedCamera>> {
    let picked = file.rsplit_once('#').filter(|_| !Path::new(file).exists());
    let path = PathBuf::from(picked.map_or(file, |(path, _)| path));
    if name.is_some() || picked.is_some() {
        let camera = formats::read_camera(file)?;
        collected.files.push(path);
        return Ok(vec![NamedCamera { name: name.map_or(camera.name, str::to_string), ..camera }]);
    }
    let read = formats::read_cameras(&path)?;
    collected.remarks.extend(read.warnings.iter().map(|w| format!("warning: {}: {w}", path.display())));
    collected.files.push(path);
    Ok(read.cameras)
}

/// The targets of `--target`, each a body of its own.
pub(super) fn targets(arguments: &[String], collected: &mut Collected) -> Result<Vec<NamedTarget>> {
    let mut targets: Vec<NamedTarget> = Vec::new();
    for argument in arguments {
        let (name, file) = split(argument);
        let path = Path::new(file);
        let remark = |warning: &str| collected.remarks.push(warning.to_string());
        let (target, _) = super::super::target(path, &TagArgs::default(), remark)?;
        collected.remarks.extend(tolerance_remark(path, &target));
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let name = name.map_or(stem, str::to_string);
        if targets.iter().any(|earlier| earlier.name == name) {
            bail!("two targets are called `{name}`; give each a name: --target NAME=FILE");
        }
        targets.push(NamedTarget { name, target: Some(target), body: targets.len() });
        collected.files.push(path.to_path_buf());
    }
    Ok(targets)
}

/// Tolerances of a map are not part of a rig's answer.
fn tolerance_remark(path: &Path, target: &Target) -> Option<String> {
    let Target::TagMap(map) = target else { return None };
    let widest_m = map.tags.iter().map(|tag| tag.sigma_m).fold(0.0, f64::max);
    (0.0 < widest_m).then(|| {
        format!(
            "warning: {}: a rig takes a map of tags as one rigid target that is known exactly; its tolerance of {:.1} mm is not in the answer's ±",
            path.display(),
            1e3 * widest_m
        )
    })
}

/// Puts the targets of each list on one body.
pub fn fix_together(lists: &[String], targets: &mut [NamedTarget]) -> Result<()> {
    for list in lists {
        let names: Vec<&str> = list.split(',').map(str::trim).filter(|name| !name.is_empty()).collect();
        if names.len() < 2 {
            bail!("--fixed-together {list}: two names or more are needed, separated by commas");
        }
        let first = target_number(targets, names[0], "--fixed-together")?;
        for name in &names[1..] {
            let other = target_number(targets, name, "--fixed-together")?;
            join(targets, first, other);
        }
    }
    Ok(())
}

/// Makes the bodies of two targets one.
pub fn join(targets: &mut [NamedTarget], a: usize, b: usize) {
    let (kept, gone) = (targets[a].body, targets[b].body);
    targets.iter_mut().filter(|target| target.body == gone).for_each(|target| target.body = kept);
}

/// The target of this name, index.
pub fn target_number(targets: &[NamedTarget], name: &str, flag: &str) -> Result<usize> {
    match targets.iter().position(|target| target.name == name) {
        Some(found) => Ok(found),
        None => {
            let names: Vec<String> = targets.iter().map(|target| target.name.clone()).collect();
            bail!("{flag} {name}: {}", not_among(name, "target", &names))
        }
    }
}

/// What to say about a name that nobody has.
pub fn not_among(name: &str, kind: &str, names: &[String]) -> String {
    let hint = crate::files::nearest(name, names.iter().cloned());
    let hint = hint.map(|nearest| format!("; did you mean `{nearest}`?")).unwrap_or_default();
    format!("there is no {kind} `{name}`; the {kind}s are {}{hint}", names.join(", "))
}
