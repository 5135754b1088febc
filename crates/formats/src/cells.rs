//! Cells of tables for people. Names come from foreign files and may be of any length; a column may not, and `format!` takes no width above 65,535.

/// Characters of the widest column; longer names lose their middle.
pub const WIDEST: usize = 60;

/// Characters that a column of these names takes.
pub fn width<'a>(names: impl IntoIterator<Item = &'a str>) -> usize {
    names.into_iter().map(|name| name.chars().take(WIDEST).count()).max().unwrap_or(0)
}

/// A name to the left of a column `width` characters wide.
pub fn left(name: &str, width: usize) -> String {
    let (name, width) = (shortened(name), width.min(WIDEST));
    format!("{name:<width$}")
}

/// The same to the right.
pub fn right(name: &str, width: usize) -> String {
    let (name, width) = (shortened(name), width.min(WIDEST));
    format!("{name:>width$}")
}

/// A name whole, or its beginning and end.
fn shortened(name: &str) -> String {
    if name.chars().nth(WIDEST).is_none() {
        return name.to_string();
    }
    let half = WIDEST / 2;
    let end = name.char_indices().rev().nth(WIDEST - half - 2).map_or(0, |(at, _)| at);
    name.chars().take(half).chain(['…']).chain(name[end..].chars()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_any_length_fit() {
        assert_eq!((left("u0_px", 8), right("3", 3)), ("u0_px   ".to_string(), "  3".to_string()));
        let long = format!("v1{}é9", "x".repeat(70_000));
        let width = width(["a", &long]);
        let cell = left(&long, width);
        assert_eq!((width, cell.chars().count()), (WIDEST, WIDEST));
        assert!(cell.starts_with("v1xx") && cell.contains('…') && cell.ends_with("xé9"), "{cell}");
        assert_eq!(right("a", usize::MAX).chars().count(), WIDEST);
    }
}
