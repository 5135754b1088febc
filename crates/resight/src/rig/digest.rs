//! SHA-256 digests, which identify the exact files on which an answer depends.

use crate::FileError;
use sha2::{Digest, Sha256};
use std::io::Read;
use std::path::Path;

/// Returns the digest of bytes, hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    hexadecimal(Sha256::digest(bytes).as_slice())
}

/// Returns the digest of a file, hexadecimal; reads it piece by piece.
pub fn sha256_of_file(path: impl AsRef<Path>) -> Result<String, FileError> {
    let path = path.as_ref();
    let failed = |e: std::io::Error| FileError::of_system(path, &e);
    let mut file = std::fs::File::open(path).map_err(failed)?;
    let (mut digest, mut piece) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        match file.read(&mut piece).map_err(failed)? {
            0 => return Ok(hexadecimal(digest.finalize().as_slice())),
            n => digest.update(&piece[..n]),
        }
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// FIPS 180-4, in one piece and from a file of several.
    #[test]
    fn digests_are_lower_case_and_whole() {
        assert_eq!(sha256(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        let path = std::env::temp_dir().join(format!("resight_digest_{}", std::process::id()));
        let million = vec![b'a'; 1_000_000];
        std::fs::write(&path, &million).expect("a file");
        let of_file = sha256_of_file(&path).expect("a digest");
        std::fs::remove_file(&path).expect("its end");
        assert_eq!(of_file, sha256(&million));
        assert_eq!(of_file, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    }
}
