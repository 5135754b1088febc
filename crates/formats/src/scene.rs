//! Where the cameras of a rig stand and look, in numbers and as a small sketch of letters.

use super::frames::Frames;
use super::{CameraFile, WriteError, cells};
use crate::core::Pose;
use nalgebra::Vector3;

/// One camera's position.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneCamera {
    /// The camera.
    pub name: String,
    /// Its pose in the reference frame; none when no pose joins the two.
    pub reference_from_cam: Option<Pose>,
}

/// The cameras of a rig in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The frame.
    pub reference: String,
    /// Whether it is a camera's (x right, y down, z forward).
    pub reference_is_camera: bool,
    /// In the order of the rig.
    pub scene_cameras: Vec<SceneCamera>,
}

/// The rig in frame `reference`; without one, in the frame its cameras share, else the only one
/// that is no camera, else the first camera.
///
/// Errors when there is no frame of that name; the names there are, are listed.
pub fn scene(rig: &CameraFile, reference: Option<&str>) -> Result<Scene, WriteError> {
    let frames = Frames::of_rig(rig);
    let is_camera = |name: &str| rig.cameras.iter().any(|c| c.name == name);
    let reference = match reference {
        Some(name) if is_camera(name) || frames.names().contains(&name) => name.to_owned(),
        Some(name) => {
            let mut names: Vec<&str> = rig.cameras.iter().map(|c| c.name.as_str()).collect();
            names.extend(frames.names().into_iter().filter(|n| !is_camera(n)));
            return Err(WriteError(format!("no frame `{name}`; there are {}", names.join(", "))));
        }
        None => frames.natural(&rig.cameras).ok_or_else(|| WriteError("no camera".into()))?,
    };
    let station = |name: &String| SceneCamera {
        name: name.clone(),
        reference_from_cam: frames.between(&reference, name),
    };
    let scene_cameras = rig.cameras.iter().map(|c| station(&c.name)).collect();
    Ok(Scene { reference_is_camera: is_camera(&reference), reference, scene_cameras })
}

impl Scene {
    /// Lines of text: each camera's centre (metres) and viewing direction, then the sketch where two or more stand apart.
    pub fn text(&self) -> String {
        let axes = if self.reference_is_camera { " (x right, y down, z forward)" } else { "" };
        let mut out = format!("Cameras in frame `{}`{axes}, metres:\n", self.reference);
        let width = cells::width(self.scene_cameras.iter().map(|s| s.name.as_str())).max(6);
        for (i, station) in self.scene_cameras.iter().enumerate() {
            let (mark, name) = (mark(i), cells::left(&station.name, width));
            match &station.reference_from_cam {
                Some(pose) => {
                    let axis: Vector3<f64> = pose.rotation.column(2).into();
                    out += &format!(
                        "  {mark} {name}  at {}   looks along {}, {}\n",
                        xyz(&pose.translation),
                        xyz(&axis),
                        towards(&axis)
                    );
                }
                None => out += &format!("  {mark} {name}  no pose joins it to `{}`\n", self.reference),
            }
        }
        out + &self.sketch()
    }

    fn sketch(&self) -> String {
        let placed: Vec<(char, Vector3<f64>, Vector3<f64>)> = self
            .scene_cameras
            .iter()
            .enumerate()
            .filter_map(|(i, s)| {
                s.reference_from_cam.map(|p| (mark(i), p.translation, p.rotation.column(2).into()))
            })
            .collect();
        let centres: Vec<Vector3<f64>> = placed.iter().map(|(_, c, _)| *c).collect();
        let looks: Vec<Vector3<f64>> = placed.iter().map(|(_, _, axis)| *axis).collect();
        match Paper::around(&centres, &looks, self.reference_is_camera) {
            Some(paper) => paper.draw(&placed),
            None => String::new(),
        }
    }
}

/// 1 to 9, then letters: which camera a sign in the sketch is.
fn mark(i: usize) -> char {
    const MARKS: &str = "123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ";
    MARKS.chars().nth(i).unwrap_or('*')
}

pub(super) fn xyz(v: &Vector3<f64>) -> String {
    // Adding 0 turns −0 into 0.
    let part = |x: f64| format!("{:.4}", (x * 1e4).round() / 1e4 + 0.0);
    format!("({}, {}, {})", part(v.x), part(v.y), part(v.z))
}

pub(super) fn towards(axis: &Vector3<f64>) -> String {
    let i = axis.iamax();
    let sign = if axis[i] < 0.0 { '−' } else { '+' };
    let off = axis[i].abs().clamp(0.0, 1.0).acos().to_degrees();
    format!("{off:.1}° off that frame's {sign}{} axis", ['x', 'y', 'z'][i])
}

/// The plane of the sketch: two axes of the reference frame, a scale, and the least coordinates.
struct Paper {
    across: usize,
    up: usize,
    /// +1 when the second axis grows upwards on paper.
    up_sign: f64,
    /// Metres a column; a row is two columns high.
    column_m: f64,
    low: [f64; 2],
    rows: usize,
    columns: usize,
}

/// The axis to look along: that in which the cameras differ and look least; from above when it is close, which is along a
/// camera's y and another frame's z.
fn least_telling_axis(extent: &Vector3<f64>, looks: &[Vector3<f64>], camera_axes: bool) -> usize {
    let vertical = if camera_axes { 1 } else { 2 };
    let reported = |i: usize| {
        let looked: f64 = looks.iter().map(|axis| axis[i].abs()).sum::<f64>() / looks.len() as f64;
        let preferred = if i == vertical { 0.3 } else { 0.0 };
        extent[i] / extent.amax() + looked - preferred
    };
    (0..3).fold(0, |least, i| if reported(i) < reported(least) { i } else { least })
}

/// Room around the outermost cameras for their arrows, characters.
const MARGIN: usize = 3;
const COLUMNS: f64 = 48.0;
const ROWS: f64 = 14.0;

impl Paper {
    /// None when all centres coincide.
    fn around(centres: &[Vector3<f64>], looks: &[Vector3<f64>], camera_axes: bool) -> Option<Paper> {
        let low = centres.iter().copied().reduce(|a, b| a.inf(&b))?;
        let extent = centres.iter().copied().reduce(|a, b| a.sup(&b))? - low;
        if !(f64::MIN_POSITIVE..).contains(&extent.amax()) || !extent.amax().is_finite() {
            return None;
        }
        let dropped = least_telling_axis(&extent, looks, camera_axes);
        let kept: Vec<usize> = (0..3).filter(|i| *i != dropped).collect();
        let (across, up) = (kept[0], kept[1]);
        let column_m = (extent[across] / COLUMNS).max(extent[up] / (2.0 * ROWS));
        let cells = |extent_m: f64, cell_m: f64| (extent_m / cell_m).round() as usize + 1 + 2 * MARGIN;
        Some(Paper {
            across,
            up,
            up_sign: if camera_axes && up == 1 { -1.0 } else { 1.0 },
            column_m,
            low: [low[across], low[up]],
            rows: cells(extent[up], 2.0 * column_m) - 2 * (MARGIN - 1),
            columns: cells(extent[across], column_m),
        })
    }

    fn draw(&self, cameras: &[(char, Vector3<f64>, Vector3<f64>)]) -> String {
        let mut grid = vec![vec![' '; self.columns]; self.rows];
        for (_, centre, axis) in cameras {
            let (row, column) = self.cell(centre);
            let ([dx, dy], arrow) = self.arrow(axis);
            let at = |base: usize, step: i32| base.saturating_add_signed(step as isize);
            if let Some(cell) = grid.get_mut(at(row, -dy)).and_then(|r| r.get_mut(at(column, 2 * dx))) {
                *cell = arrow;
            }
        }
        for (mark, centre, _) in cameras {
            let (row, column) = self.cell(centre);
            grid[row][column] = if grid[row][column].is_alphanumeric() { '*' } else { *mark };
        }
        let names = ['x', 'y', 'z'];
        let (across, up) = (names[self.across], names[self.up]);
        let direction = if self.up_sign < 0.0 { "down" } else { "up" };
        let lines: String =
            grid.iter().map(|row| format!("  |{}\n", row.iter().collect::<String>().trim_end())).collect();
        format!(
            "Sketch: {across} to the right, {up} {direction}; a column is {:.3} m, a row {:.3} m; * is several; o \
                looks along the line of sight of this sketch.\n{lines}",
            self.column_m,
            2.0 * self.column_m
        )
    }

    fn cell(&self, centre: &Vector3<f64>) -> (usize, usize) {
        let column = ((centre[self.across] - self.low[0]) / self.column_m).round() as usize + MARGIN;
        let down = ((centre[self.up] - self.low[1]) / (2.0 * self.column_m)).round() as usize + 1;
        let row = if self.up_sign < 0.0 { down } else { self.rows.saturating_sub(1 + down) };
        (row.min(self.rows - 1), column.min(self.columns - 1))
    }

    /// Step to the cell of the arrow (columns, rows up) and the arrow.
    fn arrow(&self, axis: &Vector3<f64>) -> ([i32; 2], char) {
        let (x, y) = (axis[self.across], self.up_sign * axis[self.up]);
        if x.hypot(y) < 0.5 {
            return ([1, 0], 'o');
        }
        const ARROWS: [([i32; 2], char); 8] = [
            ([1, 0], '→'),
            ([1, 1], '↗'),
            ([0, 1], '↑'),
            ([-1, 1], '↖'),
            ([-1, 0], '←'),
            ([-1, -1], '↙'),
            ([0, -1], '↓'),
            ([1, -1], '↘'),
        ];
        let eighth = (y.atan2(x) / std::f64::consts::FRAC_PI_4).round() as i32;
        ARROWS[eighth.rem_euclid(8) as usize]
    }
}
