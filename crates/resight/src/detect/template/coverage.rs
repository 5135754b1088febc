//! Computes the white share of a pixel: exactly where one straight edge crosses it, by samples otherwise.
//!
//! Samples on any grid have directions in which few distances occur: 34 points of Fibonacci's lattice show an edge of slope 1 : 4 at two
//! distances, the same two in every pixel, and corners between such edges were 0.02 px off. The crossings of an edge with two sides of the pixel
//! are found by bisection, from two points instead of 34; the part that the edge cuts off is a polygon.

use nalgebra::Vector2;

/// A position in a pixel, relative to its centre.
pub(super) type InPixel = Vector2<f64>;

/// The corners of a pixel, in order around it.
const CORNERS: [InPixel; 4] =
    [InPixel::new(-0.5, -0.5), InPixel::new(0.5, -0.5), InPixel::new(0.5, 0.5), InPixel::new(-0.5, 0.5)];
/// Number of bisections of a side: a crossing is known to ± 1/128 px.
const HALVINGS: usize = 6;
/// At this distance on either side of the chord between both crossings, in pixels, are the two colours, if there is only one edge.
const BESIDE_PX: f64 = 0.06;

/// Number of samples in a pixel with more than one edge, on Fibonacci's lattice (k/34, 21k/34).
const SAMPLES: usize = 34;
const LATTICE: usize = 21;

/// Returns the mean colour of a pixel whose corners, in the order of [`CORNERS`], have these colours; `moved` (two fractions of 1) shifts the
/// samples.
pub(super) fn mean(ink: impl Fn(InPixel) -> f32, corners: [f32; 4], moved: [f64; 2]) -> f32 {
    by_edge(&ink, corners).unwrap_or_else(|| by_samples(&ink, moved))
}

/// Returns the mean by the edge; `None` where anything but one straight edge crosses the pixel.
fn by_edge(ink: &impl Fn(InPixel) -> f32, colours: [f32; 4]) -> Option<f32> {
    let mut crossed = (0..4).filter(|k| colours[*k] != colours[(k + 1) % 4]);
    let (first, second) = (crossed.next()?, crossed.next()?);
    if crossed.next().is_some() {
        return None;
    }
    let [from, to] = [first, second].map(|side| crossing(ink, side, colours[side]));
    // The corners between the two crossings have one colour, the others the other.
    let (inner, outer) = (colours[second], colours[first]);
    let chord = to - from;
    let across = Vector2::new(-chord.y, chord.x) * (BESIDE_PX / chord.norm().max(1e-3));
    let middle = 0.5 * (from + to);
    if ink(middle + across) != outer || ink(middle - across) != inner {
        return None;
    }
    let mut area = 0.0;
    let mut last = from;
    for corner in CORNERS[first + 1..=second].iter().chain([&to, &from]) {
        area += 0.5 * last.perp(corner);
        last = *corner;
    }
    Some(outer + (inner - outer) * area as f32)
}

/// Returns the point where the colour changes along a side that begins with this colour.
fn crossing(ink: &impl Fn(InPixel) -> f32, side: usize, colour: f32) -> InPixel {
    let (begin, end) = (CORNERS[side], CORNERS[(side + 1) % 4]);
    let (mut low, mut step) = (0.0, 0.5);
    for _ in 0..HALVINGS {
        if ink(begin + (end - begin) * (low + step)) == colour {
            low += step;
        }
        step *= 0.5;
    }
    begin + (end - begin) * (low + step)
}

fn by_samples(ink: &impl Fn(InPixel) -> f32, moved: [f64; 2]) -> f32 {
    let within = |x: f64| x - x as i64 as f64 - 0.5;
    let place = |i: usize, moved: f64| within((i as f64 + 0.5) / SAMPLES as f64 + moved);
    let samples =
        (0..SAMPLES).map(|s| ink(InPixel::new(place(s, moved[0]), place(LATTICE * s % SAMPLES, moved[1]))));
    samples.sum::<f32>() / SAMPLES as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean_of(ink: impl Fn(InPixel) -> f32) -> f32 {
        let corners = CORNERS.map(&ink);
        mean(ink, corners, [0.3, 0.8])
    }

    /// Computes the same on a fine grid.
    fn by_grid(ink: impl Fn(InPixel) -> f32) -> f32 {
        let at = |k: usize| (k as f64 + 0.5) / 500.0 - 0.5;
        let sum: f64 = (0..250_000).map(|k| ink(InPixel::new(at(k % 500), at(k / 500))) as f64).sum();
        (sum / 250_000.0) as f32
    }

    /// This holds in every direction, even in those with few distances on a lattice: there 34 samples have an error of 0.1.
    #[test]
    fn an_edge_is_placed_in_every_direction() {
        let mut worst = 0.0f32;
        for k in 0..200 {
            let (s, c) = if k < 20 { (-1.0f64).atan2(4.0) } else { 0.0314 * k as f64 }.sin_cos();
            let offset = 0.6 * ((0.618 * k as f64).fract() - 0.5);
            let ink = |x: InPixel| if s * x.x + c * x.y < offset { -1.0 } else { 1.0 };
            let corners = CORNERS.map(ink);
            if corners.iter().any(|x| *x != corners[0]) {
                worst = worst.max((mean_of(ink) - by_grid(ink)).abs());
            }
        }
        // Colours are two apart, and a crossing is known to 1/128.
        assert!(worst < 0.025, "{worst}");
    }

    #[test]
    fn corners_inside_a_pixel_are_no_edge() {
        for (x0, y0) in [(0.0, 0.0), (0.13, -0.2), (-0.3, 0.1), (0.4, 0.4)] {
            let quarter = |x: InPixel| if x.x < x0 && x.y < y0 { -1.0 } else { 1.0 };
            let saddle = |x: InPixel| if (x.x < x0) == (x.y < y0) { -1.0 } else { 1.0 };
            assert!((mean_of(quarter) - by_grid(quarter)).abs() < 0.12, "{x0} {y0}");
            assert!((mean_of(saddle) - by_grid(saddle)).abs() < 0.12, "{x0} {y0}");
        }
    }
}
