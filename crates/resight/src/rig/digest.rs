//! SHA-256 (FIPS 180-4), which names the exact bytes an answer rests on.

use crate::FileError;
use std::io::Read;
use std::path::Path;

/// Of bytes, hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    let mut state = State::new();
    state.add(bytes);
    state.finish()
}

/// Of a file, hexadecimal, read piece by piece.
pub fn sha256_of_file(path: &Path) -> Result<String, FileError> {
    let told = |e: std::io::Error| FileError::new(path, e.to_string());
    let mut file = std::fs::File::open(path).map_err(told)?;
    let (mut state, mut piece) = (State::new(), vec![0; 1 << 16]);
    loop {
        match file.read(&mut piece).map_err(told)? {
            0 => return Ok(state.finish()),
            n => state.add(&piece[..n]),
        }
    }
}

struct State {
    hash: [u32; 8],
    /// Bytes that do not fill a block yet.
    rest: Vec<u8>,
    n_bytes: u64,
}

/// Round constants and start: the first 32 bits of the fractional parts of cube roots (square roots) of the first primes.
fn fraction_bits(prime: u32, root: fn(f64) -> f64) -> u32 {
    (root(f64::from(prime)).fract() * 4_294_967_296.0) as u32
}

fn primes() -> impl Iterator<Item = u32> {
    (2..).filter(|n| (2..*n).all(|d| n % d != 0))
}

/// Double precision holds 52 bits of a root below 8 (the 64th prime is 311): 32 bits of its fraction are exact.
fn round_constants() -> [u32; 64] {
    let mut constants = [0; 64];
    constants.iter_mut().zip(primes()).for_each(|(k, prime)| *k = fraction_bits(prime, f64::cbrt));
    constants
}

impl State {
    fn new() -> Self {
        let mut hash = [0; 8];
        hash.iter_mut().zip(primes()).for_each(|(h, prime)| *h = fraction_bits(prime, f64::sqrt));
        State { hash, rest: Vec::new(), n_bytes: 0 }
    }

    fn add(&mut self, bytes: &[u8]) {
        self.n_bytes += bytes.len() as u64;
        let mut all = std::mem::take(&mut self.rest);
        all.extend_from_slice(bytes);
        let constants = round_constants();
        let blocks = all.chunks_exact(64);
        self.rest = blocks.remainder().to_vec();
        blocks.for_each(|block| self.compress(block, &constants));
    }

    fn finish(mut self) -> String {
        let n_bits = 8 * self.n_bytes;
        let n_zeros = (119 - self.n_bytes % 64) % 64;
        let mut padding = vec![0x80];
        padding.resize(1 + n_zeros as usize, 0);
        padding.extend_from_slice(&n_bits.to_be_bytes());
        self.add(&padding);
        self.hash.iter().map(|word| format!("{word:08x}")).collect()
    }

    fn compress(&mut self, block: &[u8], constants: &[u32; 64]) {
        let mut w = [0u32; 64];
        for (word, bytes) in w.iter_mut().zip(block.chunks_exact(4)) {
            *word = u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        }
        for t in 16..64 {
            let s0 = w[t - 15].rotate_right(7) ^ w[t - 15].rotate_right(18) ^ (w[t - 15] >> 3);
            let s1 = w[t - 2].rotate_right(17) ^ w[t - 2].rotate_right(19) ^ (w[t - 2] >> 10);
            w[t] = w[t - 16].wrapping_add(s0).wrapping_add(w[t - 7]).wrapping_add(s1);
        }
        let [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h] = self.hash;
        for t in 0..64 {
            let s1 = e.rotate_right(6) ^ e.rotate_right(11) ^ e.rotate_right(25);
            let choice = (e & f) ^ (!e & g);
            let t1 = h.wrapping_add(s1).wrapping_add(choice).wrapping_add(constants[t]).wrapping_add(w[t]);
            let s0 = a.rotate_right(2) ^ a.rotate_right(13) ^ a.rotate_right(22);
            let majority = (a & b) ^ (a & c) ^ (b & c);
            (h, g, f, e) = (g, f, e, d.wrapping_add(t1));
            (d, c, b, a) = (c, b, a, t1.wrapping_add(s0.wrapping_add(majority)));
        }
        let added = [a, b, c, d, e, f, g, h];
        self.hash.iter_mut().zip(added).for_each(|(hash, x)| *hash = hash.wrapping_add(x));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the standard (NIST, FIPS 180-4), and lengths around a block's end against each other.
    #[test]
    fn examples_of_the_standard() {
        let empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let two_blocks = "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1";
        let million = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";
        assert_eq!(sha256(b""), empty);
        assert_eq!(sha256(b"abc"), abc);
        assert_eq!(sha256(b"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"), two_blocks);
        assert_eq!(sha256(&vec![b'a'; 1_000_000]), million);
    }

    #[test]
    fn pieces_do_not_matter() {
        let bytes: Vec<u8> = (0..300u32).map(|i| (i * 7) as u8).collect();
        for n in [0, 1, 55, 56, 63, 64, 65, 119, 120, 128, 300] {
            let mut state = State::new();
            bytes[..n].chunks(13).for_each(|piece| state.add(piece));
            assert_eq!(state.finish(), sha256(&bytes[..n]), "{n}");
        }
    }
}
