//! Base64 to bytes (RFC 4648), as JSON carries pictures.

/// The bytes; none where the text is no Base64.
pub(super) fn decode(text: &str) -> Option<Vec<u8>> {
    let text = text.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(text.len() * 3 / 4);
    for group in text.chunks(4) {
        let bits = group.iter().try_fold(0u32, |bits, c| Some(bits << 6 | sextet(*c)?))?;
        let aligned = bits << (6 * (4 - group.len()));
        let whole = (6 * group.len()) / 8;
        if whole == 0 {
            return None;
        }
        bytes.extend(&aligned.to_be_bytes()[1..1 + whole]);
    }
    Some(bytes)
}

fn sextet(c: u8) -> Option<u32> {
    let value = match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => return None,
    };
    Some(value.into())
}

#[cfg(test)]
mod tests {
    /// The vectors of RFC 4648, section 10.
    #[test]
    fn matches_the_rfc_vectors() {
        for (plain, coded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(super::decode(coded), Some(plain.as_bytes().to_vec()));
        }
        for bad in ["Z", "Zg-_", "Zm9v!"] {
            assert_eq!(super::decode(bad), None, "{bad}");
        }
    }
}
