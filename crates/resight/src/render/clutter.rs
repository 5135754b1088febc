//! Spots that are not part of a target.

use super::Pcg;
use resight_core::Pixel;

/// An elliptical spot in the image; thin ones look like strokes of letters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blob {
    /// Centre, pixels.
    pub centre: Pixel,
    /// Semi-axes, pixels.
    pub radii_px: [f64; 2],
    /// Direction of the first semi-axis, from u towards v.
    pub angle_rad: f64,
    /// Grey, 0 to 255.
    pub grey: f64,
}

/// Returns `n` random roundish dots over the image, with radii from `radius_px[0]` to `radius_px[1]`, elongated by up to 2:1.
pub fn dots(n: usize, size_px: [u32; 2], radius_px: [f64; 2], grey: f64, seed: u64) -> Vec<Blob> {
    let mut pcg = Pcg::new(seed);
    (0..n)
        .map(|_| {
            let radius = pcg.between(radius_px[0], radius_px[1]);
            Blob {
                centre: Pixel::new(pcg.between(0.0, size_px[0] as f64), pcg.between(0.0, size_px[1] as f64)),
                radii_px: [radius, radius * pcg.between(0.5, 1.0)],
                angle_rad: pcg.between(0.0, std::f64::consts::PI),
                grey,
            }
        })
        .collect()
}

/// Returns lines of letter-like strokes: `n` words of short thin strokes with dots between them.
pub fn words(n: usize, size_px: [u32; 2], letter_px: f64, grey: f64, seed: u64) -> Vec<Blob> {
    let mut pcg = Pcg::new(seed);
    let mut strokes = Vec::new();
    for _ in 0..n {
        let start = Pixel::new(pcg.between(0.0, size_px[0] as f64), pcg.between(0.0, size_px[1] as f64));
        let letters = 3 + (pcg.next_u32() % 8) as usize;
        for letter in 0..letters {
            let middle = start + Pixel::new(letter as f64 * letter_px, 0.0);
            for _ in 0..1 + pcg.next_u32() % 3 {
                let jitter = Pixel::new(pcg.between(-0.3, 0.3), pcg.between(-0.4, 0.4)) * letter_px;
                let dot = pcg.uniform() < 0.2;
                let length = if dot { 0.12 } else { pcg.between(0.2, 0.5) };
                strokes.push(Blob {
                    centre: middle + jitter,
                    radii_px: [length * letter_px, 0.12 * letter_px],
                    angle_rad: (pcg.next_u32() % 4) as f64 * std::f64::consts::FRAC_PI_4,
                    grey,
                });
            }
        }
    }
    strokes
}

/// Paints each blob over the image, with 4×4 samples per pixel.
pub(super) fn draw(blobs: &[Blob], grey: &mut [f32], width: usize, height: usize) {
    const SAMPLES: u32 = 4;
    for blob in blobs {
        let reach = blob.radii_px[0].max(blob.radii_px[1]) + 1.0;
        let span =
            |x: f64, n: usize| ((x - reach).max(0.0) as usize)..(((x + reach).max(0.0) as usize + 1).min(n));
        let (sin, cos) = blob.angle_rad.sin_cos();
        for v in span(blob.centre.y, height) {
            for u in span(blob.centre.x, width) {
                let offset = |i: u32| (i as f64 + 0.5) / SAMPLES as f64 - 0.5;
                let inside = |(i, j): (u32, u32)| {
                    let (x, y) = (u as f64 + offset(i) - blob.centre.x, v as f64 + offset(j) - blob.centre.y);
                    let (a, b) =
                        ((cos * x + sin * y) / blob.radii_px[0], (cos * y - sin * x) / blob.radii_px[1]);
                    a * a + b * b < 1.0
                };
                let all = (0..SAMPLES).flat_map(|i| (0..SAMPLES).map(move |j| (i, j)));
                let covered = all.filter(|ij| inside(*ij)).count() as f32 / (SAMPLES * SAMPLES) as f32;
                let pixel = &mut grey[v * width + u];
                *pixel += covered * (blob.grey as f32 - *pixel);
            }
        }
    }
}
