//! Caliscope `charuco.toml`. Its squares fill the printed sheet unless a measured edge overrides them.

use super::document::{Document, Fault};
use super::{Format, TargetFormat};
use crate::core::Target;
use crate::core::target::Charuco;

pub(super) const FORMAT: TargetFormat = TargetFormat {
    format: Format::CaliscopeCharuco,
    recognises: |document| {
        document.root.get("aruco_scale").is_some() && document.root.get("dictionary").is_some()
    },
    read,
    traps: &["columns and rows count squares, not corners; the printed and measured edge \
            (square_size_override_cm) is in centimetres."],
};

fn read(document: &Document) -> Result<(Target, Vec<String>), Fault> {
    let root = document.entry();
    let measured = root.get("square_size_override_cm").or_else(|| root.get("square_size_overide_cm"));
    let Some(edge) = measured else {
        return Err(root.fault(
            "the key `square_size_override_cm` is missing: measure a printed square and \
            state its edge in centimetres",
        ));
    };
    let scale = root.need("aruco_scale")?;
    let ratio = scale.number()?;
    if !(0.0 < ratio && ratio < 1.0) {
        return Err(
            scale.fault(format!("is {ratio}; a marker's edge over its square's lies between 0 and 1"))
        );
    }
    let square_m = edge.number()? / 100.0;
    let mut warnings = Vec::new();
    if root.get("inverted").map(|i| i.flag()).transpose()? == Some(true) {
        warnings.push("the board is printed inverted (white on black); the detector must be reported".into());
    }
    let board = Charuco {
        rows: root.need("rows")?.side(2)?,
        columns: root.need("columns")?.side(2)?,
        square_m,
        marker_m: square_m * ratio,
        dictionary: root.need("dictionary")?.text()?.to_owned(),
        legacy_pattern: root.get("legacy_pattern").map(|l| l.flag()).transpose()?.unwrap_or(false),
    };
    Ok((Target::Charuco(board), warnings))
}
