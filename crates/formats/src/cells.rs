//! Cells of text tables. A name from another program's file may have any length; a column may not, and `format!` panics at a width above
//! 65,535.

/// Width of the widest column, characters; a longer name loses its middle.
pub const WIDEST: usize = 60;

/// Returns the width of a column of these names, characters: at most [`WIDEST`].
pub fn width<'a>(names: impl IntoIterator<Item = &'a str>) -> usize {
    names.into_iter().map(|name| name.chars().take(WIDEST).count()).max().unwrap_or(0)
}

/// Returns a name at the left of a column of `width` characters.
pub fn left(name: &str, width: usize) -> String {
    let (name, width) = (shortened(name), width.min(WIDEST));
    format!("{name:<width$}")
}

/// Returns a name at the right of a column of `width` characters.
pub fn right(name: &str, width: usize) -> String {
    let (name, width) = (shortened(name), width.min(WIDEST));
    format!("{name:>width$}")
}

/// Returns the whole name where it fits, else its beginning and end.
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
