//! Tag families: the positions of the bits of a marker, and the id of each code.
//!
//! The AprilTag families (tables inside the C library) and the ArUco dictionaries of OpenCV (tables from `calib-targets-aruco`) have one form
//! here, that of the AprilTag decoder: cell (0, 0) at the top-left of the black border, x right, y down, white = 1, first listed bit most
//! significant.

use super::DetectError;
use super::apriltag;
pub(super) use super::family::Family;
use calib_targets_aruco::{Dictionary, resolve_dictionary};

/// Names of the AprilTag families, as accepted in target files.
pub const APRILTAG_FAMILIES: [&str; 8] = [
    "tag36h11",
    "tag25h9",
    "tag16h5",
    "tagStandard41h12",
    "tagStandard52h13",
    "tagCircle21h7",
    "tagCircle49h12",
    "tagCustom48h12",
];

/// Names of OpenCV's dictionaries begin and end so.
const DICTIONARIES: [(&str, &[&str]); 5] = [
    ("DICT_4X4_", &SIZES),
    ("DICT_5X5_", &SIZES),
    ("DICT_6X6_", &SIZES),
    ("DICT_7X7_", &SIZES),
    ("DICT_APRILTAG_", &["16h5", "25h9", "36h10", "36h11"]),
];
const SIZES: [&str; 4] = ["50", "100", "250", "1000"];

/// Returns `did you mean …? ` of a name that is none; nothing where none is near.
pub(super) fn meant(name: &str) -> String {
    let begins = |(begin, _): &&(&str, &[&str])| {
        name.to_ascii_uppercase().trim_end_matches('_') == begin.trim_end_matches('_')
    };
    if let Some((begin, ends)) = DICTIONARIES.iter().find(begins) {
        let all: Vec<String> = ends.iter().map(|end| format!("`{begin}{end}`")).collect();
        return format!("did you mean one of {}? ", all.join(", "));
    }
    let of_opencv =
        DICTIONARIES.iter().flat_map(|(begin, ends)| ends.iter().map(move |end| format!("{begin}{end}")));
    let all: Vec<String> = APRILTAG_FAMILIES.iter().map(|name| name.to_string()).chain(of_opencv).collect();
    let ends_so = |known: &&String| 4 < name.len() && known.to_lowercase().ends_with(&name.to_lowercase());
    let ending_so = all.iter().find(ends_so).cloned();
    let near = ending_so.or_else(|| crate::input::nearest(name, all.into_iter()));
    near.map(|near| format!("did you mean `{near}`? ")).unwrap_or_default()
}

impl Family {
    /// Looks a family up by its AprilTag or OpenCV dictionary name.
    pub fn named(name: &str) -> Result<Self, DetectError> {
        if let Some(family) = apriltag::builtin_family(name) {
            return Ok(family);
        }
        resolve_dictionary(name).map(|d| Self::aruco(&d)).ok_or_else(|| unknown(name))
    }

    /// Restricts the family to these ids; an id that it does not have is an error.
    pub fn only(mut self, name: &str, wanted: &[u32]) -> Result<Self, DetectError> {
        let n_codes = self.codes.len();
        let code_of = |id: &u32| match self.codes.get(*id as usize) {
            Some(&code) => Ok(code),
            None => Err(DetectError::UnknownId { family: name.to_string(), id: *id, n_codes }),
        };
        self.codes = wanted.iter().map(code_of).collect::<Result<_, _>>()?;
        self.ids = wanted.to_vec();
        Ok(self)
    }

    /// Returns the same codes inside a black border of two cells, as Kalibr prints its grids.
    pub fn with_double_border(mut self) -> Self {
        self.bit_x.iter_mut().chain(&mut self.bit_y).for_each(|cell| *cell += 1);
        self.border_width += 2;
        self.total_width += 2;
        self
    }

    /// Returns the markers as seen in a mirror (or printed on the back of a board). The reported corners are those of the mirrored image, whose
    /// top-left corner is the marker's top-right.
    pub fn mirrored(self) -> Self {
        let cells: Vec<(i32, i32)> = self.bit_x.iter().copied().zip(self.bit_y.iter().copied()).collect();
        let n_bits = cells.len();
        let source: Vec<usize> = cells
            .iter()
            .map(|&(x, y)| cells.iter().position(|&cell| cell == (self.border_width - 1 - x, y)).unwrap_or(0))
            .collect();
        let mirror =
            |code: &u64| source.iter().fold(0, |word, &bit| word << 1 | (code >> (n_bits - 1 - bit) & 1));
        Family { codes: self.codes.iter().map(mirror).collect(), ..self }
    }

    /// Returns the markers printed white on black.
    pub fn inverted(mut self) -> Self {
        let all_bits = (1u64 << self.bit_x.len()) - 1;
        self.codes.iter_mut().for_each(|code| *code ^= all_bits);
        self.reversed_border = !self.reversed_border;
        self
    }

    /// Returns the number of bits that the decoder may correct. Random 16- and 21-bit squares are decoded too easily; ArUco codes are so close
    /// together that correcting one bit gave 1–3 false ids in 72 tags, and correcting none gave zero.
    pub fn correctable_bits(&self) -> u32 {
        let by_distance = match self.hamming_distance {
            0..=6 => 0,
            7..=8 => 1,
            _ => 2,
        };
        // The decoder's hash table holds every corrected code at 48 bytes; 16 MB keeps building it under 10 ms.
        let entries = |bits: u32| {
            let n = self.bit_x.len() as u64;
            let per_code = [1, 1 + n, 1 + n + n * (n - 1)][bits as usize];
            self.codes.len() as u64 * per_code
        };
        (0..=by_distance).rev().find(|&bits| entries(bits) * 48 <= 16_000_000).unwrap_or(0)
    }

    /// Returns whether the codes are so close together that they arise by chance, in the squares of a chessboard, in letters or in other tags.
    pub fn is_weak(&self) -> bool {
        self.hamming_distance <= WEAK_DISTANCE
    }

    /// Returns the smallest decision margin accepted, grey levels. Without correction, and with codes this close, ArUco squares need a clear
    /// reading: with 30, none of 72 markers was lost and no false id accepted. The true tags of real photographs have 52 and more, so that 15 is
    /// a limit against texture, not against dim light.
    pub fn min_margin_gray(&self) -> f64 {
        if self.hamming_distance <= 6 { 30.0 } else { 15.0 }
    }

    /// Returns the width of the cells outside the square whose corners are reported, in edges of that square.
    pub fn rim_edges(&self) -> f64 {
        0.5 * (self.total_width - self.border_width).max(0) as f64 / self.border_width.max(1) as f64
    }

    /// Converts an OpenCV dictionary. Its tables are row-major, least significant bit first, black = 1; the decoder rotates codes by a quarter
    /// of their bits, so the bits must be listed quadrant by quadrant, each rotated by a quarter turn against the one before.
    fn aruco(dictionary: &Dictionary) -> Self {
        let n = dictionary.marker_size() as i32;
        let cells = quadrant_order(n);
        let white = |code: u64, (x, y): (i32, i32)| 1 ^ (code >> (y * n + x) & 1);
        let listed = |code: u64| cells.iter().fold(0, |word, &cell| word << 1 | white(code, cell));
        Family {
            codes: dictionary.codes().iter().map(|&code| listed(code)).collect(),
            ids: (0..dictionary.codes().len() as u32).collect(),
            bit_x: cells.iter().map(|c| c.0 + 1).collect(),
            bit_y: cells.iter().map(|c| c.1 + 1).collect(),
            border_width: n + 2,
            total_width: n + 4,
            reversed_border: false,
            hamming_distance: stated_distance(dictionary.name()),
        }
    }
}

/// Families with at most this distance have codes that one square in some hundreds bears by chance.
const WEAK_DISTANCE: u32 = 7;

/// Returns the distance stated in the name of OpenCV's copies of AprilTag families (rotated by half a turn against the originals).
fn stated_distance(dictionary: &str) -> u32 {
    let stated = dictionary.strip_prefix("DICT_APRILTAG_").and_then(|name| name.split_once('h'));
    stated.and_then(|(_, distance)| distance.parse().ok()).unwrap_or(0)
}

/// Returns the cells of an n × n square: the top quadrant row by row, then its quarter turns clockwise, the centre last.
fn quadrant_order(n: i32) -> Vec<(i32, i32)> {
    let first: Vec<(i32, i32)> = (0..n / 2).flat_map(|y| (y..n - 1 - y).map(move |x| (x, y))).collect();
    let turn = |(x, y): (i32, i32)| (n - 1 - y, x);
    let mut cells = Vec::with_capacity((n * n) as usize);
    let mut quadrant = first;
    for _ in 0..4 {
        cells.extend_from_slice(&quadrant);
        quadrant.iter_mut().for_each(|cell| *cell = turn(*cell));
    }
    if n % 2 == 1 {
        cells.push((n / 2, n / 2));
    }
    cells
}

fn unknown(name: &str) -> DetectError {
    DetectError::UnknownFamily { name: name.to_string() }
}

/// A marker with one value per cell, as it is printed: the outermost ring is the quiet zone or the family's own data ring.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MarkerPattern {
    /// Cells along the edge of the whole image.
    pub width_cells: usize,
    /// Cells from the image's edge to the square whose edge is `size_m` and whose corners are detected.
    pub inset_cells: usize,
    /// Row by row, true where white.
    pub white: Vec<bool>,
}

/// Returns the marker of a family (AprilTag name or OpenCV dictionary) with an id, upright. Fails on unknown families and ids.
pub fn marker_pattern(family: &str, id: u32) -> Result<MarkerPattern, DetectError> {
    let layout = Family::named(family)?.only(family, &[id])?;
    Ok(draw(&layout, layout.codes[0]))
}

pub(super) fn draw(family: &Family, code: u64) -> MarkerPattern {
    let width = family.total_width as usize;
    let inset = ((family.total_width - family.border_width) / 2) as usize;
    // The ring just outside the border (inside it for reversed families) gives the edge its contrast.
    let ring = if family.reversed_border { inset } else { inset - 1 };
    let mut white = vec![false; width * width];
    for k in ring..width - ring {
        for cell in
            [ring * width + k, (width - 1 - ring) * width + k, k * width + ring, k * width + width - 1 - ring]
        {
            white[cell] = true;
        }
    }
    for (bit, (x, y)) in family.bit_x.iter().zip(&family.bit_y).enumerate() {
        let cell = (y + inset as i32) as usize * width + (x + inset as i32) as usize;
        white[cell] = code >> (family.bit_x.len() - 1 - bit) & 1 == 1;
    }
    MarkerPattern { width_cells: width, inset_cells: inset, white }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrant_order_covers_every_cell_once() {
        for n in 3..=8 {
            let mut cells = quadrant_order(n);
            cells.sort_unstable();
            cells.dedup();
            assert_eq!(cells.len(), (n * n) as usize, "n = {n}");
        }
    }

    /// A marker rotated by a quarter turn has the code rotated by a quarter of its bits, as the decoder assumes.
    #[test]
    fn turning_the_cells_rotates_the_code() {
        for n in [4, 5, 6, 7] {
            let cells = quadrant_order(n);
            let quarter = cells.len() / 4;
            for k in 0..quarter * 4 {
                let (x, y) = cells[k];
                assert_eq!(cells[(k + quarter) % (quarter * 4)], (n - 1 - y, x), "n = {n}, k = {k}");
            }
        }
    }

    #[test]
    fn unknown_names_and_ids_are_named() {
        assert!(matches!(Family::named("tag99h1"), Err(DetectError::UnknownFamily { .. })));
        let error = marker_pattern("tag36h11", 587).unwrap_err();
        assert_eq!(error, DetectError::UnknownId { family: "tag36h11".into(), id: 587, n_codes: 587 });
    }

    /// DICT_4X4_50 id 0 as OpenCV prints it.
    #[test]
    fn aruco_marker_is_drawn_as_opencv_draws_it() {
        let pattern = marker_pattern("DICT_4X4_50", 0).unwrap();
        let rows: Vec<String> = pattern
            .white
            .chunks(pattern.width_cells)
            .map(|row| row.iter().map(|&white| if white { '#' } else { '.' }).collect())
            .collect();
        let printed =
            ["########", "#......#", "#.#.##.#", "#..#.#.#", "#...##.#", "#...#..#", "#......#", "########"];
        assert_eq!(rows, printed);
    }

    /// The codes are equal, but "upright" differs by half a turn: a target file must state which of the two was printed.
    #[test]
    fn opencv_turns_apriltags_by_half() {
        let (opencv, original) = ("DICT_APRILTAG_36h11", "tag36h11");
        assert_eq!(Family::named(opencv).unwrap().hamming_distance, 11);
        for id in [0, 7, 586] {
            let mut turned = marker_pattern(opencv, id).unwrap();
            turned.white.reverse();
            assert_eq!(turned, marker_pattern(original, id).unwrap(), "id {id}");
        }
    }

    /// A mirror swaps left and right of the image.
    #[test]
    fn mirrored_and_inverted_families_draw_so() {
        for name in ["DICT_5X5_50", "tag36h11"] {
            let family = Family::named(name).unwrap();
            let plain = draw(&family, family.codes[3]);
            let mirrored = family.clone().mirrored();
            let mut seen = draw(&mirrored, mirrored.codes[3]);
            seen.white.chunks_mut(plain.width_cells).for_each(|row| row.reverse());
            assert_eq!(seen, plain, "{name}");
            let negative = family.clone().inverted();
            assert_eq!(negative.reversed_border, !family.reversed_border);
            assert_eq!(negative.codes[3] ^ family.codes[3], (1 << family.bit_x.len()) - 1);
        }
    }

    #[test]
    fn every_family_is_found_by_name() {
        for name in APRILTAG_FAMILIES {
            let family = Family::named(name).unwrap();
            assert_eq!(family.codes.len(), family.ids.len(), "{name}");
            assert!(!family.codes.is_empty(), "{name}");
        }
        for name in ["DICT_4X4_50", "DICT_5X5_100", "DICT_6X6_250", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL"] {
            assert!(!Family::named(name).unwrap().codes.is_empty(), "{name}");
        }
    }
}
