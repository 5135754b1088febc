//! A stroke font drawn for this project: letters are polylines, so they are sharp at any size.
//!
//! Grid: x to the right, y up; baseline at 4, lower-case height 12, capitals 16, descenders 0. Each point is two
//! characters, x then y, in base 36; blanks separate points of one stroke, `|` separates strokes.

use super::canvas::Path;
use nalgebra::Vector2;

/// Height of a capital in grid units.
const CAPITAL: f64 = 12.0;
/// Baseline in grid units.
const BASELINE: f64 = 4.0;
/// Blank between two letters, grid units.
const GAP: f64 = 4.2;

/// A letter's strokes and its width in grid units.
type Glyph = (char, f64, &'static str);

#[rustfmt::skip]
const GLYPHS: &[Glyph] = &[
    ('0', 8.0, "2g 6g 8e 86 64 24 06 0e 2g"), ('1', 6.0, "0d 3g 34|04 64"), ('2', 8.0, "0e 2g 6g 8e 8c 04 84"),
    ('3', 8.0, "0e 2g 6g 8e 8c 6a 88 86 64 24 06|3a 6a"), ('4', 8.0, "64 6g 08 88"),
    ('5', 8.0, "8g 1g 0a 2b 6b 89 86 64 24 06"), ('6', 8.0, "7f 6g 3g 1e 0b 06 24 64 86 88 6a 2a 08"),
    ('7', 8.0, "0g 8g 34"), ('8', 8.0, "2a 0c 0e 2g 6g 8e 8c 6a 2a 08 06 24 64 86 88 6a"),
    ('9', 8.0, "15 24 54 76 89 8e 6g 2g 0e 0c 2a 6a 8c"),
    ('A', 8.0, "04 4g 84|17 77"), ('B', 8.0, "04 0g 6g 8e 8c 6a 0a|6a 88 86 64 04"), ('C', 8.0, "8e 6g 2g 0e 06 24 64 86"),
    ('D', 8.0, "04 0g 5g 8d 87 54 04"), ('E', 7.0, "7g 0g 04 74|0a 6a"), ('F', 7.0, "7g 0g 04|0a 6a"),
    ('G', 8.0, "8e 6g 2g 0e 06 24 64 86 8a 5a"), ('H', 8.0, "04 0g|84 8g|0a 8a"), ('I', 4.0, "0g 4g|2g 24|04 44"),
    ('J', 6.0, "6g 66 44 24 06"), ('K', 8.0, "0g 04|8g 08|3b 84"), ('L', 7.0, "0g 04 74"), ('M', 9.0, "04 0g 49 59 9g 94"),
    ('N', 8.0, "04 0g 84 8g"), ('O', 8.0, "2g 6g 8e 86 64 24 06 0e 2g"), ('P', 8.0, "04 0g 6g 8e 8b 69 09"),
    ('Q', 8.0, "2g 6g 8e 86 64 24 06 0e 2g|57 83"), ('R', 8.0, "04 0g 6g 8e 8b 69 09|49 84"),
    ('S', 8.0, "8e 6g 2g 0e 0c 2a 6a 88 86 64 24 06"), ('T', 8.0, "0g 8g|4g 44"), ('U', 8.0, "0g 06 24 64 86 8g"),
    ('V', 8.0, "0g 44 8g"), ('W', 10.0, "0g 24 5d 84 ag"), ('X', 8.0, "0g 84|04 8g"), ('Y', 8.0, "0g 4a 8g|4a 44"),
    ('Z', 8.0, "0g 8g 04 84"),
    ('a', 7.0, "1c 5c 7a 74|79 29 07 06 24 54 76"), ('b', 7.0, "0g 04|0a 2c 5c 7a 76 54 24 06"),
    ('c', 7.0, "7a 5c 2c 0a 06 24 54 76"), ('d', 7.0, "7g 74|7a 5c 2c 0a 06 24 54 76"),
    ('e', 7.0, "08 78 7a 5c 2c 0a 06 24 54 75"), ('f', 5.0, "5g 4g 2e 24|0c 4c"),
    ('g', 7.0, "7c 72 50 20 01|7a 5c 2c 0a 06 24 54 76"), ('h', 7.0, "0g 04|0a 2c 5c 7a 74"), ('i', 0.5, "0c 04|0f 0g"),
    ('j', 2.0, "2c 22 00|2f 2g"), ('k', 7.0, "0g 04|6c 07|29 74"), ('l', 2.0, "0g 06 24"),
    ('m', 10.0, "04 0c|0a 2c 4c 5a 54|5a 7c 9c aa a4"), ('n', 7.0, "04 0c|0a 2c 5c 7a 74"),
    ('o', 7.0, "2c 5c 7a 76 54 24 06 0a 2c"), ('p', 7.0, "0c 00|0a 2c 5c 7a 76 54 24 06"),
    ('q', 7.0, "7c 70|7a 5c 2c 0a 06 24 54 76"), ('r', 5.0, "0c 04|0a 2c 4c 5b"),
    ('s', 6.0, "6b 5c 1c 0b 0a 18 58 67 65 54 14 05"), ('t', 5.0, "2g 26 44 54|0c 5c"), ('u', 7.0, "0c 06 24 54 76|7c 74"),
    ('v', 6.0, "0c 34 6c"), ('w', 8.0, "0c 24 4c 64 8c"), ('x', 6.0, "0c 64|04 6c"), ('y', 6.0, "0c 34|6c 20 00"),
    ('z', 6.0, "0c 6c 04 64"),
    ('.', 0.5, "04 05"), (',', 1.0, "14 02"), (':', 0.5, "05 06|0b 0c"), (';', 1.0, "14 02|1a 1b"), ('-', 5.0, "0a 5a"),
    ('+', 6.0, "0a 6a|3d 37"), ('=', 6.0, "0c 6c|08 68"), ('/', 6.0, "03 6g"), ('(', 3.0, "3h 1e 16 33"),
    (')', 3.0, "0h 2e 26 03"), ('[', 3.0, "3h 0h 03 33"), (']', 3.0, "0h 3h 33 03"), ('_', 7.0, "03 73"),
    ('%', 8.0, "04 8g|0g 2g 2d 0d 0g|67 87 84 64 67"), ('\'', 0.5, "0g 0d"), ('!', 0.5, "0g 08|04 05"),
    ('?', 7.0, "0e 2g 5g 7e 7c 39 38|34 35"), ('#', 8.0, "3g 24|6g 54|0c 8c|08 78"), ('<', 6.0, "6d 09 65"),
    ('>', 6.0, "0d 69 05"), ('|', 0.5, "0h 02"), ('\\', 6.0, "0g 63"), ('–', 7.0, "0a 7a"), ('…', 8.0, "04 05|44 45|84 85"), ('*', 6.0, "3d 37|0c 68|08 6c"), ('µ', 7.0, "0c 00|06 24 54 76|7c 74"), ('±', 6.0, "0b 6b|3e 38|05 65"),
    ('×', 6.0, "0c 66|06 6c"), ('°', 3.0, "1g 2g 3f 3e 2d 1d 0e 0f 1g"), ('σ', 8.0, "8c 2c 0a 06 24 54 76 7a 5c"),
    ('χ', 6.0, "0c 60|00 6c"), ('²', 3.0, "0f 1g 2g 3f 3e 0b 3b"), ('→', 8.0, "0a 8a|5d 8a 57"), ('·', 0.5, "09 0a"),
];

/// Shown for characters without a glyph.
const UNKNOWN: Glyph = ('\u{fffd}', 6.0, "0c 6c 64 04 0c");

/// Returns the strokes of a line of text whose baseline starts at `origin` (canvas pixels), with capitals `height` pixels tall.
pub fn strokes(text: &str, origin: Vector2<f64>, height: f64) -> Vec<Path> {
    let unit = height / CAPITAL;
    let mut pen = 0.0;
    let mut paths = Vec::new();
    for letter in text.chars() {
        let (_, width, code) = glyph(letter);
        for stroke in code.split('|').filter(|stroke| !stroke.is_empty()) {
            let at = |(x, y): (f64, f64)| origin + Vector2::new(pen + x, BASELINE - y) * unit;
            paths.push(stroke.split(' ').filter_map(point).map(at).collect());
        }
        pen += width + GAP;
    }
    paths
}

/// Returns the width of a line of text, pixels, for capitals of `height` pixels.
pub fn width(text: &str, height: f64) -> f64 {
    let units: f64 = text.chars().map(|letter| glyph(letter).1 + GAP).sum();
    (units - GAP).max(0.0) * height / CAPITAL
}

fn glyph(letter: char) -> Glyph {
    match letter {
        ' ' => (' ', 4.0, ""),
        _ => GLYPHS.iter().find(|g| g.0 == letter).copied().unwrap_or(UNKNOWN),
    }
}

fn point(code: &str) -> Option<(f64, f64)> {
    let mut digits = code.chars().map(|c| c.to_digit(36));
    let (x, y) = (digits.next()??, digits.next()??);
    Some((x as f64, y as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_glyph_stays_inside_its_box() {
        for (letter, width, code) in GLYPHS {
            for code in code.split(['|', ' ']) {
                let (x, y) = point(code).unwrap();
                assert!(x <= width.max(1.0) && y <= 17.0, "{letter}");
            }
        }
    }

    #[test]
    fn width_is_where_the_last_stroke_ends() {
        let right = strokes("H0H", Vector2::zeros(), 24.0).concat().iter().map(|p| p.x).fold(0.0, f64::max);
        assert!((right - width("H0H", 24.0)).abs() < 1e-9);
    }

    #[test]
    fn every_printable_ascii_letter_and_digit_has_a_picture() {
        for letter in ('0'..='9').chain('a'..='z').chain('A'..='Z').chain("±×°σχ²→·µ".chars()) {
            assert_ne!(glyph(letter).0, UNKNOWN.0, "{letter}");
        }
    }
}
