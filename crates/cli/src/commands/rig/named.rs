//! Cameras and targets as the command line names them.

use anyhow::Result;
use resight::rig::RigRequest;
use std::path::Path;

/// `NAME=REST`; a file whose own name has an equals sign is no name.
pub fn split(argument: &str) -> (Option<&str>, &str) {
    match argument.split_once('=') {
        Some((name, rest)) if !name.is_empty() && !Path::new(argument).exists() => (Some(name), rest),
        _ => (None, argument),
    }
}

/// Reads the cameras of `--camera` and the targets of `--target`.
pub fn request(cameras: &[String], targets: &[String]) -> Result<RigRequest> {
    let mut request = RigRequest::default();
    for argument in cameras {
        let (name, file) = split(argument);
        crate::files::camera_must_exist(file)?;
        request.read_camera(name, file)?;
    }
    for argument in targets {
        let (name, file) = split(argument);
        crate::files::must_exist(file.as_ref())?;
        request.read_target(name, file)?;
    }
    Ok(request)
}
