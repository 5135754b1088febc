//! Conversion of a colour mosaic to grey, for any of the four patterns.
//!
//! The weights 1 2 1 in each direction give every pixel a quarter red, a half green and a quarter blue, at any position in the pattern, and are
//! symmetric, so that no corner moves. The cost is a blur of 0.7 px.

/// Converts `mosaic`, row by row, width × height.
pub(super) fn gray(mosaic: &[u8], width: usize, height: usize) -> Vec<u8> {
    // First across, then down; sums of 16 weights.
    let across: Vec<u16> = mosaic.chunks_exact(width).flat_map(|row| weighted(row, width)).collect();
    let at = |u: usize, v: usize| u32::from(across[v * width + u]);
    let pixel = |u: usize, v: usize| {
        let (above, below) = neighbours(v, height);
        ((at(u, above) + 2 * at(u, v) + at(u, below) + 8) / 16) as u8
    };
    (0..height).flat_map(|v| (0..width).map(move |u| (u, v))).map(|(u, v)| pixel(u, v)).collect()
}

fn weighted(row: &[u8], width: usize) -> impl Iterator<Item = u16> + '_ {
    (0..width).map(move |u| {
        let (left, right) = neighbours(u, width);
        u16::from(row[left]) + 2 * u16::from(row[u]) + u16::from(row[right])
    })
}

/// Returns the two neighbours, mirrored about an edge pixel, which keeps the alternation of colours.
fn neighbours(at: usize, length: usize) -> (usize, usize) {
    let before = if at == 0 { 1.min(length - 1) } else { at - 1 };
    let after = if at + 1 == length { length.saturating_sub(2) } else { at + 1 };
    (before, after)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One colour gives the same grey everywhere, also at edges, in every phase of the pattern.
    #[test]
    fn a_uniform_colour_is_a_uniform_grey() {
        let (red, green, blue) = (200, 100, 20);
        for (du, dv) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let color = |u: usize, v: usize| match ((u + du) % 2, (v + dv) % 2) {
                (0, 0) => red,
                (1, 1) => blue,
                _ => green,
            };
            let mosaic: Vec<u8> = (0..6 * 5).map(|i| color(i % 6, i / 6)).collect();
            assert_eq!(gray(&mosaic, 6, 5), [105; 30]);
        }
    }

    #[test]
    fn a_spot_stays_where_it_is() {
        let mut mosaic = vec![0; 49];
        mosaic[3 * 7 + 3] = 160;
        let seen = gray(&mosaic, 7, 7);
        assert_eq!((seen[24], seen[23], seen[25], seen[17], seen[31]), (40, 20, 20, 20, 20));
    }

    #[test]
    fn a_single_pixel_is_a_picture() {
        assert_eq!((gray(&[7], 1, 1), gray(&[8, 8], 2, 1)), (vec![7], vec![8, 8]));
    }
}
