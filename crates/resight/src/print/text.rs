//! Text on a sheet: its width and its line breaks.

/// Advance widths of Helvetica's printable ASCII, starting with the space, in thousandths of the font size (Adobe's font metrics).
const WIDTHS: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556, 556,
    556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778, 722, 278,
    500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278, 278, 278, 469,
    556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556, 556, 556, 333, 500,
    278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];
/// Width assumed for the few other characters: × ± and letters with accents.
const OTHER_WIDTH: u16 = 611;

/// Returns the width of a line of text.
pub(super) fn width_mm(text: &str, size: f64) -> f64 {
    let width = |c: char| {
        let index = u32::from(c).wrapping_sub(32) as usize;
        f64::from(WIDTHS.get(index).copied().unwrap_or(OTHER_WIDTH))
    };
    text.chars().map(width).sum::<f64>() * size / 1000.0
}

/// Breaks sentences into lines of at most a width; a longer word has a line of its own.
pub(super) fn wrapped(sentences: &[String], size: f64, most_mm: f64) -> Vec<String> {
    let mut lines = Vec::new();
    for sentence in sentences {
        let mut line = String::new();
        for word in sentence.split(' ') {
            let longer = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
            if width_mm(&longer, size) <= most_mm || line.is_empty() {
                line = longer;
            } else {
                lines.push(std::mem::replace(&mut line, word.to_owned()));
            }
        }
        lines.push(line);
    }
    lines
}

/// Converts to Latin 1, which Helvetica without embedding can show; other characters become question marks.
pub(super) fn latin(text: &str) -> String {
    let shown = |c: char| !c.is_control() && u32::from(c) < 256;
    text.chars().map(|c| if shown(c) { c } else { '?' }).collect()
}
