//! An order of the points by chance that does not depend on the order of the rows.

use crate::Correspondence;
use crate::statistics::random::{GOLDEN, mixed};

/// Row numbers, shuffled by a hash of each row's own numbers: the same rows in another order give the same sequence of points,
/// so that the answer does not depend on how a file is sorted. Rows alike in every number keep their order.
pub(super) fn shuffled(seen: &[Correspondence], seed: u64) -> Vec<u32> {
    let mut keyed: Vec<(u64, u32)> = seen.iter().zip(0..).map(|(c, row)| (hash(c, seed), row)).collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, row)| row).collect()
}

fn hash(c: &Correspondence, seed: u64) -> u64 {
    let numbers = c.x_in_target.iter().chain(c.pixel.iter());
    // Adding zero makes −0 and 0 alike.
    numbers.fold(mixed(seed), |key, x| mixed(key.wrapping_add(GOLDEN) ^ (x + 0.0).to_bits()))
}
