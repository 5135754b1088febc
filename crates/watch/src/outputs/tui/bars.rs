//! Values as bars of block characters.

/// Returns bars of the values over `rows` lines, the top one first; the tallest bar is `most`. Unknown values are blank.
pub fn bars(values: &[Option<f64>], most: f64, rows: usize) -> Vec<String> {
    const EIGHTHS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let eighths = |value: f64| ((value / most * (8 * rows) as f64).round() as usize).clamp(1, 8 * rows);
    let heights: Vec<usize> = values.iter().map(|value| value.map_or(0, eighths)).collect();
    let line = |row: usize| {
        let below = 8 * (rows - 1 - row);
        heights.iter().map(|height| EIGHTHS[height.saturating_sub(below).min(8)]).collect()
    };
    (0..rows).map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_as_tall_as_their_values() {
        assert_eq!(bars(&[Some(0.0), None, Some(4.0), Some(8.0)], 8.0, 1), ["▁ ▄█"]);
        assert_eq!(bars(&[Some(2.0), Some(6.0), Some(8.0)], 8.0, 2), [" ▄█", "▄██"]);
    }
}
