//! Cameras, written in a format.

use super::table::writer_of;
use super::{CameraFile, Contents, Format, JointCovariance, NamedCamera, OutFile, WriteError};

/// Writes cameras, with the poses between them where the format has a place for them: one file or several.
///
/// Errors when the format cannot hold a model or the number of cameras: no camera is dropped silently.
pub fn write_cameras(cameras: &[NamedCamera], format: Format) -> Result<Vec<OutFile>, WriteError> {
    let rig = Contents { cameras: cameras.to_vec(), ..Contents::default() };
    write_rig(&rig.into_file(format), format)
}

/// Our own camera file, which is always one text.
pub fn own_file(cameras: &[NamedCamera]) -> Result<String, WriteError> {
    own_rig_file(cameras, None)
}

/// Our own camera file with what the cameras' errors have in common, which a comparison with a later rig needs.
pub fn own_rig_file(cameras: &[NamedCamera], joint: Option<JointCovariance>) -> Result<String, WriteError> {
    let rig = Contents { cameras: cameras.to_vec(), joint, ..Contents::default() };
    Ok(write_rig(&rig.into_file(Format::Own), Format::Own)?.into_iter().map(|file| file.text).collect())
}

/// As `write_cameras`, with poses between other frames and clocks for the formats that have a place for them; the
/// `format` and `warnings` of `rig` play no part.
pub fn write_rig(rig: &CameraFile, format: Format) -> Result<Vec<OutFile>, WriteError> {
    if rig.cameras.is_empty() {
        return Err(WriteError("no camera to write".into()));
    }
    match writer_of(format) {
        Some(writer) => differently_named(writer.run(rig)?),
        None => {
            let words: Vec<&str> =
                Format::writable().filter_map(|(_, words)| words.first().copied()).collect();
            let (name, words) = (format.name(), words.join(", "));
            Err(WriteError(format!("{name} is read, not written; write {words}")))
        }
    }
}

fn differently_named(files: Vec<OutFile>) -> Result<Vec<OutFile>, WriteError> {
    for (i, file) in files.iter().enumerate() {
        if files[..i].iter().any(|earlier| earlier.name.eq_ignore_ascii_case(&file.name)) {
            return Err(WriteError(format!("two cameras would share the file {}; rename one", file.name)));
        }
    }
    Ok(files)
}
