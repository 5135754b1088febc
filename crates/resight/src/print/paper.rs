//! The paper.

use crate::error::Error;

/// A paper format, upright.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paper {
    /// Width, millimetres.
    pub width_mm: f64,
    /// Height, millimetres.
    pub height_mm: f64,
}

const NAMED: [(&str, Paper); 6] = [
    ("A4", Paper { width_mm: 210.0, height_mm: 297.0 }),
    ("A3", Paper { width_mm: 297.0, height_mm: 420.0 }),
    ("A2", Paper { width_mm: 420.0, height_mm: 594.0 }),
    ("A1", Paper { width_mm: 594.0, height_mm: 841.0 }),
    ("A0", Paper { width_mm: 841.0, height_mm: 1189.0 }),
    ("letter", Paper { width_mm: 215.9, height_mm: 279.4 }),
];

/// Narrower paper has no room for a ruler beside a target.
const LEAST_MM: f64 = 50.0;
/// PDF readers take pages of up to 14,400 points.
const MOST_MM: f64 = 5000.0;

impl Paper {
    /// A4.
    pub const A4: Paper = NAMED[0].1;
    /// A3.
    pub const A3: Paper = NAMED[1].1;
    /// US letter.
    pub const LETTER: Paper = NAMED[5].1;

    /// Parses `A4`, `A3`, … , `letter`, or `WIDTHxHEIGHT` in millimetres.
    ///
    /// # Errors
    /// The known formats, or the allowed sides.
    pub fn parse(word: &str) -> Result<Paper, Error> {
        if let Some((_, paper)) = NAMED.iter().find(|(name, _)| name.eq_ignore_ascii_case(word)) {
            return Ok(*paper);
        }
        let sides = word.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
        let Some((width_mm, height_mm)) = sides else {
            let names: Vec<&str> = NAMED.iter().map(|(name, _)| *name).collect();
            return Err(Error::request(format!(
                "no such paper: `{word}`; give {} or WIDTHxHEIGHT in mm, e.g. 600x400",
                names.join(", ")
            )));
        };
        let paper = Paper { width_mm, height_mm };
        paper.check().map(|()| paper)
    }

    /// Returns its name, or its sides in millimetres.
    pub fn name(&self) -> String {
        match NAMED.iter().find(|(_, paper)| paper == self) {
            Some((name, _)) => (*name).to_owned(),
            None => format!("{} × {} mm", self.width_mm, self.height_mm),
        }
    }

    /// Returns the sides upright, then rotated by a quarter turn.
    pub(super) fn both_ways(&self) -> [[f64; 2]; 2] {
        [[self.width_mm, self.height_mm], [self.height_mm, self.width_mm]]
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        match [self.width_mm, self.height_mm].into_iter().find(|side| !(LEAST_MM..=MOST_MM).contains(side)) {
            Some(side) => Err(Error::request(format!(
                "the paper is {} × {} mm; a side of {side} mm cannot be printed on: {LEAST_MM} to {MOST_MM} mm are possible",
                self.width_mm, self.height_mm
            ))),
            None => Ok(()),
        }
    }
}
