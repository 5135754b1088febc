//! COLMAP's text tables. `cameras.txt`: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]; the others are `colmap/model.rs`'s.
//!
//! COLMAP's pixel (0, 0) is the top-left corner of the image, ours the centre of its first pixel: ours = theirs − 0.5.

mod tables;
mod cameras;
mod model;
mod write;

use super::document::{Document, Fault, Syntax};
use super::{CameraFormat, Contents, Format, Reads, Writer};
use cameras::camera_line;
use tables::{Table, lines, table_of};
pub(super) use tables::{is_points_table, is_table_line};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Colmap,
    words: &["colmap"],
    reads: Some(Reads {
        recognises: |document| document.syntax == Syntax::Lines && table_of(&document.text).is_some(),
        read,
        together: Some(model::read),
    }),
    write: Some(Writer::Rig(write::write)),
    traps: &[
        "COLMAP counts pixels from the image's top-left corner; 0.5 px was subtracted from cx and cy.",
        "The poses in images.txt are world → camera (x_cam = R x_world + t, quaternion w x y z); the \
            camera's position is −Rᵀ t. Lengths are arbitrary unless the model was scaled.",
        "rigs.txt holds sensor_from_rig, frames.txt rig_from_world; the rig's frame is its reference sensor's.",
        "Several images may share a CAMERA_ID: one lens, not one place.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    if table_of(&document.text) != Some(Table::Cameras) {
        return model::read_alone(document);
    }
    let mut contents = Contents::default();
    for (line, words) in lines(&document.text) {
        contents.cameras.push(camera_line(line, &words, &mut contents.warnings)?);
    }
    Ok(contents)
}
