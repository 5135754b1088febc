//! The sentence that a call ends with, in memory of the caller.

use std::ffi::c_char;

/// Size of `resight_message`, bytes.
pub const RESIGHT_MESSAGE_SIZE: usize = 1024;

/// The sentence that a call ends with: what was seen, what is needed, what to do. It is UTF-8 and ends with a zero, empty where nothing is to be
/// said; a longer one ends with "…" (the JSON of an answer holds it whole). Every call takes a null pointer in its place.
#[repr(C)]
pub struct Message {
    /// The sentence.
    pub text: [c_char; RESIGHT_MESSAGE_SIZE],
}

const CUT: &str = "…";

impl Message {
    /// Holds this sentence.
    pub(crate) fn new(sentence: &str) -> Self {
        let mut text = [0; RESIGHT_MESSAGE_SIZE];
        let most = RESIGHT_MESSAGE_SIZE - 1; // The zero.
        let (kept, end) = match sentence.len() <= most {
            true => (sentence, ""),
            false => (&sentence[..sentence.floor_char_boundary(most - CUT.len())], CUT),
        };
        // A zero would end it early.
        let bytes = kept.bytes().chain(end.bytes()).map(|byte| if byte == 0 { b' ' } else { byte });
        for (into, byte) in text.iter_mut().zip(bytes) {
            *into = byte as c_char;
        }
        Message { text }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(sentence: &str) -> String {
        let bytes: Vec<u8> = Message::new(sentence).text.iter().map(|c| *c as u8).collect();
        let end = bytes.iter().position(|byte| *byte == 0).expect("a zero");
        String::from_utf8(bytes[..end].to_vec()).expect("UTF-8")
    }

    #[test]
    fn sentences_end_with_a_zero_and_whole_characters() {
        assert_eq!((held("").as_str(), held("σ 0.5\0 px").as_str()), ("", "σ 0.5  px"));
        for length in RESIGHT_MESSAGE_SIZE - 8..RESIGHT_MESSAGE_SIZE + 8 {
            let (one, two) = ("x".repeat(length), format!("x{}", "σ".repeat(length / 2)));
            for sentence in [one, two] {
                let held = held(&sentence);
                let is_whole = sentence.len() < RESIGHT_MESSAGE_SIZE;
                assert!(held == sentence || !is_whole && held.ends_with(CUT), "{length}: {held}");
                assert!(RESIGHT_MESSAGE_SIZE - 3 <= held.len() || is_whole, "{}", held.len());
            }
        }
    }
}
