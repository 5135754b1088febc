//! Sorts names naturally, `cam2` before `cam10`, and equally for any order of the input.

use std::cmp::Ordering;

/// Compares runs of digits by value, everything else by characters; names that differ only in leading zeros, by their text.
pub fn natural(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    loop {
        let (Some(x), Some(y)) = (left.chars().next(), right.chars().next()) else {
            return left.len().cmp(&right.len()).then_with(|| a.cmp(b));
        };
        if x.is_ascii_digit() && y.is_ascii_digit() {
            let ((m, rest_left), (n, rest_right)) = (digits(left), digits(right));
            match m.len().cmp(&n.len()).then_with(|| m.cmp(n)) {
                Ordering::Equal => (left, right) = (rest_left, rest_right),
                unequal => return unequal,
            }
        } else if x == y {
            (left, right) = (&left[x.len_utf8()..], &right[y.len_utf8()..]);
        } else {
            return x.cmp(&y);
        }
    }
}

/// Returns the leading digits without zeros, and the rest.
fn digits(text: &str) -> (&str, &str) {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    (text[..end].trim_start_matches('0'), &text[end..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_count_as_numbers() {
        let mut names = ["cam10", "b", "cam2", "cam02", "cam", "a3x", "a3", "", "a03y", "ü1"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["", "a3", "a3x", "a03y", "b", "cam", "cam02", "cam2", "cam10", "ü1"]);
    }

    /// The order is total; otherwise the result of sorting would depend on the order of the input.
    #[test]
    fn only_equal_names_are_equal() {
        let names = ["1", "01", "001", "1a", "01a", "a", "a0", "a00", "a1"];
        for (i, a) in names.iter().enumerate() {
            for (j, b) in names.iter().enumerate() {
                assert_eq!(natural(a, b) == Ordering::Equal, i == j, "{a} {b}");
                assert_eq!(natural(a, b), natural(b, a).reverse(), "{a} {b}");
            }
        }
    }
}
