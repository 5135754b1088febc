//! Spoilt copies of shipped files: bytes, words, numbers, structure and sizes, from a seed that is printed and given again.

use resight_core::statistics::SplitMix64;
use std::path::{Path, PathBuf};

/// SplitMix64.
#[derive(Debug, Clone)]
pub struct Draw(pub SplitMix64);

impl Draw {
    /// Of one case of a run.
    pub fn of(seed: u64, case: u64) -> Self {
        let mut draw = Draw(SplitMix64::new(seed ^ case.wrapping_mul(0x2545_f491_4f6c_dd1d)));
        draw.bits();
        draw
    }

    pub fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n.max(1) as u64) as usize
    }
}

pub fn setting(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

/// Every file below a folder, in order.
pub fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() { folders.push(path) } else { all.push(path) }
        }
    }
    all.sort();
    all
}

/// What a number may become.
const NUMBERS: [&str; 28] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "1e-300",
    "1e300",
    "-1e300",
    "1e308",
    "1e999",
    "nan",
    "NaN",
    ".nan",
    "inf",
    "-inf",
    ".inf",
    "1e-12",
    "1e12",
    "0.2219",
    "4294967295",
    "4294967296",
    "-2147483649",
    "9223372036854775808",
    "1e5",
    "100000",
    "0x10",
    "1_000",
    "",
];

/// What may stand anywhere.
const PIECES: [&str; 20] = [
    "[", "]", "{", "}", "\"", "'", ",", ":", "=", "\n", "\t", "\0", "#", "- ", "null", "true", "\u{feff}",
    "&a", "*a", "é",
];

/// A copy spoilt in one to four ways.
pub fn spoilt(original: &[u8], other: &[u8], draw: &mut Draw) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for _ in 0..1 + draw.below(4) {
        spoil(&mut bytes, other, draw);
    }
    bytes.truncate(2 << 20);
    bytes
}

fn spoil(bytes: &mut Vec<u8>, other: &[u8], draw: &mut Draw) {
    let n = bytes.len();
    match draw.below(12) {
        0 if 0 < n => {
            let (at, bit) = (draw.below(n), draw.below(8));
            bytes[at] ^= 1 << bit;
        }
        1 if 0 < n => {
            let at = draw.below(n);
            bytes[at] = draw.bits() as u8;
        }
        2 => bytes.truncate(draw.below(n + 1)),
        3 => {
            // A stretch twice, or many times.
            let (from, length) = (draw.below(n), 1 + draw.below(200));
            let piece = bytes[from.min(n)..(from + length).min(n)].to_vec();
            let times = if draw.below(8) == 0 { 200 } else { 1 };
            let at = draw.below(n + 1);
            bytes.splice(at..at, piece.repeat(times));
        }
        4 => {
            let (from, length) = (draw.below(n), draw.below(200));
            bytes.drain(from.min(n)..(from + length).min(n));
        }
        5 => {
            let piece = PIECES[draw.below(PIECES.len())];
            let times = if draw.below(6) == 0 { 1 + draw.below(3000) } else { 1 };
            let at = draw.below(n + 1);
            bytes.splice(at..at, piece.repeat(times).into_bytes());
        }
        6 => {
            let (from, length) = (draw.below(other.len()), draw.below(400));
            let piece = other[from.min(other.len())..(from + length).min(other.len())].to_vec();
            let at = draw.below(n + 1);
            bytes.splice(at..at, piece);
        }
        7 => swap_lines(bytes, draw),
        // Numbers most of all: what is read is then a file like any other.
        _ => change_number(bytes, draw),
    }
}

fn swap_lines(bytes: &mut Vec<u8>, draw: &mut Draw) {
    let mut lines: Vec<Vec<u8>> = bytes.split_inclusive(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    if lines.is_empty() {
        return;
    }
    let (a, b) = (draw.below(lines.len()), draw.below(lines.len()));
    match draw.below(3) {
        0 => lines.swap(a, b),
        1 => {
            lines.remove(a);
        }
        _ => {
            let line = lines[a].clone();
            lines.insert(b, line);
        }
    }
    *bytes = lines.concat();
}

fn change_number(bytes: &mut Vec<u8>, draw: &mut Draw) {
    let is_part = |b: u8| b.is_ascii_digit() || b".+-eE".contains(&b);
    let mut spans: Vec<(usize, usize)> = Vec::new();
    let mut at = 0;
    while at < bytes.len() && spans.len() < 20_000 {
        if bytes[at].is_ascii_digit() {
            let end = (at..bytes.len()).find(|i| !is_part(bytes[*i])).unwrap_or(bytes.len());
            spans.push((at, end));
            at = end;
        }
        at += 1;
    }
    if spans.is_empty() {
        return;
    }
    let (from, to) = spans[draw.below(spans.len())];
    let text = String::from_utf8_lossy(&bytes[from..to]).into_owned();
    let new = match (draw.below(4), text.parse::<f64>()) {
        (0, Ok(value)) => format!("{}", value * 10f64.powi(draw.below(13) as i32 - 6)),
        (1, Ok(value)) => format!("{}", value * (0.5 + draw.below(1000) as f64 / 1000.0)),
        (2, Ok(value)) => format!("{}", -value),
        _ => NUMBERS[draw.below(NUMBERS.len())].to_string(),
    };
    bytes.splice(from..to, new.into_bytes());
}
