//! What the detector tests share: images of known geometry, and the tables beside real ones.

use nalgebra::{Matrix3, Vector3};
use resight::GrayImage;
use resight::core::Pixel;
use resight::detect::families::{MarkerPattern, marker_pattern};

/// Plane to image.
pub struct View(pub Matrix3<f64>);

impl View {
    /// A plane seen by a pinhole camera of 900 px focal length: turned in the image by `roll_deg`, tilted by
    /// `tilt_deg`, `scale_px` pixels per unit, plane origin at `centre`.
    pub fn new(centre: Pixel, scale_px: f64, roll_deg: f64, tilt_deg: f64) -> Self {
        let focal = 900.0;
        let (s, c) = roll_deg.to_radians().sin_cos();
        let (ts, tc) = tilt_deg.to_radians().sin_cos();
        let roll = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
        let tilt = Matrix3::new(tc, 0.0, ts, 0.0, 1.0, 0.0, -ts, 0.0, tc);
        let rotation = tilt * roll;
        let mut plane = rotation;
        plane.set_column(2, &Vector3::new(0.0, 0.0, focal / scale_px));
        View(Matrix3::new(focal, 0.0, centre.x, 0.0, focal, centre.y, 0.0, 0.0, 1.0) * plane)
    }

    pub fn at(&self, x: f64, y: f64) -> Pixel {
        let p = self.0 * Vector3::new(x, y, 1.0);
        Pixel::new(p.x / p.z, p.y / p.z)
    }
}

/// Photographs a plane: `light` gives its grey value, none where there is no plane (background 120). 4 × 4 samples a
/// pixel, blur of 0.8 px, noise of two grey levels.
pub fn photograph(
    width: u32,
    height: u32,
    view: &View,
    light: impl Fn(f64, f64) -> Option<f64>,
) -> GrayImage {
    let inverse = view.0.try_inverse().unwrap();
    let sample = |u: f64, v: f64| {
        let x = inverse * Vector3::new(u, v, 1.0);
        light(x.x / x.z, x.y / x.z).unwrap_or(120.0)
    };
    let mut values: Vec<f64> = (0..width * height)
        .map(|k| {
            let (u, v) = ((k % width) as f64, (k / width) as f64);
            (0..16)
                .map(|s| sample(u + (s % 4) as f64 / 4.0 - 0.375, v + (s / 4) as f64 / 4.0 - 0.375))
                .sum::<f64>()
                / 16.0
        })
        .collect();
    blur(&mut values, width as usize, 1);
    blur(&mut values, width as usize, width as usize);
    let mut state = 0x2545_f491_4f6c_dd1du64;
    let mut uniform = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    // The sum of twelve uniform numbers has unit variance.
    let mut noise = || 2.0 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
    let data = values.iter().map(|x| (x + noise()).round().clamp(0.0, 255.0) as u8).collect();
    GrayImage { width_px: width, height_px: height, data }
}

/// Five-tap blur of variance 0.64 px² along a stride; the border keeps its values.
fn blur(values: &mut [f64], width: usize, stride: usize) {
    let weights = [-2.0f64, -1.0, 0.0, 1.0, 2.0].map(|x| (-x * x / (2.0 * 0.64)).exp());
    let total: f64 = weights.iter().sum();
    let source = values.to_vec();
    let n = values.len();
    for k in 2 * width..n - 2 * width {
        values[k] = (0..5).map(|j| weights[j] * source[k + j * stride - 2 * stride]).sum::<f64>() / total;
    }
}

/// Ink of a marker at (x, y) in units of its black square, centred; none outside its printed image.
pub fn marker_ink(pattern: &MarkerPattern, x: f64, y: f64) -> Option<f64> {
    let square_cells = (pattern.width_cells - 2 * pattern.inset_cells) as f64;
    let cell = |x: f64| (x + 0.5) * square_cells + pattern.inset_cells as f64;
    let (column, row) = (cell(x), cell(y));
    let inside = 0.0 <= column && 0.0 <= row;
    let (column, row) = (column as usize, row as usize);
    let inside = inside && column < pattern.width_cells && row < pattern.width_cells;
    inside.then(|| if pattern.white[row * pattern.width_cells + column] { WHITE } else { BLACK })
}

pub const WHITE: f64 = 210.0;
pub const BLACK: f64 = 40.0;

/// A marker alone on white paper.
pub fn lone_marker(family: &str, id: u32) -> impl Fn(f64, f64) -> Option<f64> {
    let pattern = marker_pattern(family, id).unwrap();
    move |x, y| {
        let on_paper = x.abs() < 1.4 && y.abs() < 1.4;
        marker_ink(&pattern, x, y).or(on_paper.then_some(WHITE))
    }
}

/// Black where `black` says so for the square (column, row) of a board of unit squares.
pub fn board_ink(
    rows: i32,
    columns: i32,
    black: impl Fn(i32, i32) -> bool,
) -> impl Fn(f64, f64) -> Option<f64> {
    move |x, y| {
        let (column, row) = (x.floor() as i32, y.floor() as i32);
        let on_board = (0..columns).contains(&column) && (0..rows).contains(&row);
        let on_paper = -0.8 < x && -0.8 < y && x < columns as f64 + 0.8 && y < rows as f64 + 0.8;
        on_paper.then(|| if on_board && black(column, row) { BLACK } else { WHITE })
    }
}

/// Root mean square over coordinates.
pub fn rms_px(differences: &[Pixel]) -> f64 {
    (differences.iter().map(|d| d.norm_squared()).sum::<f64>() / (2 * differences.len()).max(1) as f64).sqrt()
}

/// Rows of a CSV file as maps from column name to text.
pub fn table(path: &std::path::Path) -> Vec<std::collections::HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(|row| row.unwrap()).collect()
}
