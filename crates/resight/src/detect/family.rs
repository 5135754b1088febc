//! The form of a tag family; [`families`](super::families) has all of them.

/// A tag family as the decoder takes it. Cells are counted from the corner that detection reports (the outer edge
/// of the border), so bits of families with data outside their border have negative coordinates.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Family {
    /// One code per entry of `ids`.
    pub codes: Vec<u64>,
    /// Id of each code; all ids of the family, or only the wanted ones.
    pub ids: Vec<u32>,
    /// Column of each bit, most significant bit first.
    pub bit_x: Vec<i32>,
    /// Row of each bit.
    pub bit_y: Vec<i32>,
    /// Cells along the bordered square whose corners are reported.
    pub border_width: i32,
    /// Cells along the whole marker, with all that the decoder samples.
    pub total_width: i32,
    /// White border on black (the inner square of the `Standard`, `Circle` and `Custom` families).
    pub reversed_border: bool,
    /// Smallest number of bits between two codes (0 when not stated: ArUco).
    pub hamming_distance: u32,
}
