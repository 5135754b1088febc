//! `resight_target`: what is looked for in images.

use crate::call::{done, guarded};
use crate::message::Message;
use crate::pointer::{Out, free, path, text};
use crate::status::Status;
use resight::core;
use resight::detect::absent::Explainer;
use resight::formats::{self, TargetFile};
use std::ffi::c_char;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// What is looked for in images: points whose positions are known. Threads may share it.
///
/// The first image without the target is searched for what it shows instead, which its message states; later ones are not.
pub struct Target {
    pub(crate) target: core::Target,
    pub(crate) warnings: Vec<String>,
    explainer: Mutex<Explainer>,
}

impl From<TargetFile> for Target {
    fn from(file: TargetFile) -> Self {
        Target { target: file.target, warnings: file.warnings, explainer: Mutex::default() }
    }
}

impl Target {
    /// Explains with what earlier images left to explain.
    pub(crate) fn with_explainer(&self, explain: impl FnOnce(&mut Explainer)) {
        explain(&mut self.explainer.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// Reads the target of a file: Resight's own TOML, Kalibr's YAML or WPILib's JSON.
///
/// Gives RESIGHT_STATUS_FILE where the file is missing or wrong: the message names line and key.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_target_read(
    file: *const c_char,
    target: *mut *mut Target,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (target, file) = unsafe { (Out::handle("target", target)?, path(file)?) };
        target.give(formats::read_target(file)?.into());
        Ok(())
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Reads a target from the text of a file of any format that resight_target_read takes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_target_parse(
    content: *const c_char,
    target: *mut *mut Target,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (target, content) = unsafe { (Out::handle("target", target)?, text("content", content)?) };
        let bytes = content.as_bytes().to_vec();
        target.give(formats::read_target_from_bytes(Path::new("target"), bytes)?.into());
        Ok(())
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Frees a target; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_target_free(target: *mut Target) {
    // SAFETY: what callers promise of handles.
    guarded((), || unsafe { free(target) });
}
