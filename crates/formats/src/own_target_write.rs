//! Our own target file, written: what `own_target.rs` reads.

use super::emit::{list, number, quoted};
use super::own_target::{JOINT, PRINTED};
use crate::core::Target;
use crate::core::target::{CircleGrid, MapTag, NamedPoint, PrintedScale, TagMap};
use nalgebra::DMatrix;
use std::fmt::Write as _;

/// A target as the text of our own file, which reads back to the same numbers. `comment` stands above it, each line behind a `#`.
pub fn own_target_file(target: &Target, comment: &str) -> String {
    let mut text: String = comment.lines().map(|line| format!("# {line}\n")).collect();
    let _ = writeln!(text, "kind = {}", quoted(target.kind()));
    let mut tables = String::new();
    for (key, value) in keys(target.design(), &mut tables) {
        let _ = writeln!(text, "{key} = {value}");
    }
    if let Some(scale) = target.printed_scale() {
        text += &printed_text(scale);
    }
    text + &tables
}

type Keys = Vec<(&'static str, String)>;

/// Keys of one line each; lists of tables, which must come after them, go to `tables`.
fn keys(design: &Target, tables: &mut String) -> Keys {
    match design {
        Target::LinePlusOne(t) => vec![("line_m", list(&t.line_m)), ("off_m", list(&t.off_m))],
        Target::Tag(t) => {
            vec![("family", quoted(&t.family)), ("id", t.id.to_string()), ("size_m", number(t.size_m))]
        }
        Target::AprilGrid(t) => vec![
            ("family", quoted(&t.family)),
            ("rows", t.rows.to_string()),
            ("columns", t.columns.to_string()),
            ("tag_size_m", number(t.tag_size_m)),
            ("tag_spacing_ratio", number(t.tag_spacing_ratio)),
            ("first_id", t.first_id.to_string()),
        ],
        Target::Chessboard(t) => vec![
            ("rows", t.rows.to_string()),
            ("columns", t.columns.to_string()),
            ("square_m", number(t.square_m)),
        ],
        Target::Charuco(t) => vec![
            ("rows", t.rows.to_string()),
            ("columns", t.columns.to_string()),
            ("square_m", number(t.square_m)),
            ("marker_m", number(t.marker_m)),
            ("dictionary", quoted(&t.dictionary)),
            ("legacy_pattern", t.legacy_pattern.to_string()),
        ],
        Target::CircleGrid(t) => circle_grid(t),
        Target::TagMap(t) => {
            tables.extend(t.tags.iter().map(tag_text));
            tag_map(t)
        }
        Target::Points(points) => {
            tables.extend(points.iter().map(point_text));
            Vec::new()
        }
        // A print has a design; any other kind has no file yet.
        _ => Vec::new(),
    }
}

fn circle_grid(grid: &CircleGrid) -> Keys {
    let diameter = grid.diameter_m.map(|diameter_m| ("diameter_m", number(diameter_m)));
    let keys = vec![
        ("rows", grid.rows.to_string()),
        ("columns", grid.columns.to_string()),
        ("asymmetric", grid.asymmetric.to_string()),
        ("spacing_m", number(grid.spacing_m)),
    ];
    keys.into_iter().chain(diameter).collect()
}

fn tag_map(map: &TagMap) -> Keys {
    let joint = map.joint_covariance.as_ref().map(|joint| (JOINT, lower_rows(joint)));
    std::iter::once(("family", quoted(&map.family))).chain(joint).collect()
}

/// The rows of a symmetric matrix up to the diagonal, one a line, to nine digits: what they leave out of a covariance of metres is micrometres.
fn lower_rows(matrix: &DMatrix<f64>) -> String {
    let nine = |x: f64| format!("{x:.8e}").parse().unwrap_or(x);
    let row = |i: usize| {
        let numbers: Vec<String> = (0..=i).map(|j| number(nine(matrix[(i, j)]))).collect();
        format!("    [{}],\n", numbers.join(", "))
    };
    format!("[\n{}]", (0..matrix.nrows()).map(row).collect::<String>())
}

fn tag_text(tag: &MapTag) -> String {
    let MapTag { id, size_m, world_from_tag, sigma_m, sigma_rad } = tag;
    let (rotation, translation) = (world_from_tag.quaternion_wxyz(), world_from_tag.translation);
    let mut text = format!(
        "\n[[tag]]\nid = {id}\nsize_m = {}\nworld_from_tag = {{ rotation_wxyz = {}, translation_m = {} }}\n",
        number(*size_m),
        list(&rotation),
        list(translation.as_slice())
    );
    for (key, sigma) in [("sigma_m", *sigma_m), ("sigma_rad", *sigma_rad)] {
        if sigma != 0.0 {
            let _ = writeln!(text, "{key} = {}", number(sigma));
        }
    }
    text
}

fn point_text(point: &NamedPoint) -> String {
    let sigma = match point.sigma_m {
        0.0 => String::new(),
        sigma => format!("sigma_m = {}\n", number(sigma)),
    };
    let position = list(point.position.as_slice());
    format!("\n[[point]]\nname = {}\nposition_m = {position}\n{sigma}", quoted(&point.name))
}

fn printed_text(scale: &PrintedScale) -> String {
    let [x, y] = scale.ratio.map(number);
    let [sigma_x, sigma_y] = scale.sigma.map(number);
    format!(
        "# Printed length over designed length, and its standard deviation, as measured on the rulers of the sheet.\n{PRINTED} = {{ x = {x}, y = {y}, \
         sigma_x = {sigma_x}, sigma_y = {sigma_y} }}\n"
    )
}
