//! Which of COLMAP's text tables a file is, and its lines.

/// The tables of a text model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Table {
    Cameras,
    Images,
    Rigs,
    Frames,
    Points,
}

/// By the first line that is no comment; points by the comment above them, because their lines are numbers only.
pub(super) fn table_of(text: &str) -> Option<Table> {
    if is_points_table(text) {
        return Some(Table::Points);
    }
    lines(text).next().and_then(|(_, words)| table_of_line(&words))
}

/// `points3D.txt`: no part of a calibration.
pub(crate) fn is_points_table(text: &str) -> bool {
    text.starts_with("# 3D point list")
}

fn table_of_line(words: &[&str]) -> Option<Table> {
    let whole =
        |i: usize| words.get(i).is_some_and(|w| !w.is_empty() && w.bytes().all(|b| b.is_ascii_digit()));
    let numbers = |from: usize, to: usize| {
        words.get(from..to).is_some_and(|all| all.iter().all(|w| w.parse::<f64>().is_ok()))
    };
    let sensor = |i: usize| words.get(i).is_some_and(|w| matches!(*w, "CAMERA" | "IMU"));
    let capital = |w: &&str| {
        w.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_')
            && w.bytes().any(|b| b.is_ascii_uppercase())
    };
    if !whole(0) {
        None
    } else if words.get(1).is_some_and(capital) && whole(2) {
        Some(Table::Cameras)
    } else if whole(1) && sensor(2) && whole(3) {
        Some(Table::Rigs)
    } else if whole(1) && numbers(2, 9) && whole(9) && sensor(10) {
        Some(Table::Frames)
    } else if numbers(1, 8) && whole(8) && 10 <= words.len() && words[9].parse::<f64>().is_err() {
        Some(Table::Images)
    } else {
        None
    }
}

/// Does this line open one of the tables?
pub(crate) fn is_table_line(line: &str) -> bool {
    table_of_line(&line.split_whitespace().collect::<Vec<_>>()).is_some()
}

/// Lines that are neither blank nor comments, with their numbers, as words.
pub(super) fn lines<'a>(text: &'a str) -> impl Iterator<Item = (usize, Vec<&'a str>)> {
    let words = |(i, line): (usize, &'a str)| (i + 1, line.split_whitespace().collect::<Vec<_>>());
    text.lines()
        .enumerate()
        .map(words)
        .filter(|(_, words)| words.first().is_some_and(|w| !w.starts_with('#')))
}
