//! Writes the wire format of Protocol Buffers, as far as the messages of a scene need it.
//!
//! Format: protobuf.dev/programming-guides/encoding. A field is its number and wire type, then its value; fields with their default value (0,
//! false, empty) are left out, as in proto3.

/// A message under construction.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Message {
    bytes: Vec<u8>,
}

const VARINT: u64 = 0;
const EIGHT_BYTES: u64 = 1;
const WITH_LENGTH: u64 = 2;
const FOUR_BYTES: u64 = 5;

impl Message {
    /// Creates an empty message.
    pub fn new() -> Self {
        Message::default()
    }

    /// Returns the encoded bytes.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Writes an int32, int64, uint32, bool or enum; a scene has no negative values.
    pub fn integer(mut self, field: u64, value: u64) -> Self {
        if value != 0 {
            self.key(field, VARINT);
            self.varint(value);
        }
        self
    }

    /// Writes a bool.
    pub fn flag(self, field: u64, value: bool) -> Self {
        self.integer(field, value.into())
    }

    /// Writes a double, rounded to 1e-9 (a nanometre, a nanoradian) so that the file does not depend on the last bits of a library's sines.
    pub fn double(mut self, field: u64, value: f64) -> Self {
        let value = rounded(value);
        if value != 0.0 {
            self.key(field, EIGHT_BYTES);
            self.bytes.extend(value.to_le_bytes());
        }
        self
    }

    /// Writes a fixed32.
    pub fn fixed(mut self, field: u64, value: u32) -> Self {
        if value != 0 {
            self.key(field, FOUR_BYTES);
            self.bytes.extend(value.to_le_bytes());
        }
        self
    }

    /// Writes packed repeated doubles without rounding: intrinsics are given, not computed.
    pub fn doubles(self, field: u64, values: &[f64]) -> Self {
        let packed: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.bytes(field, &packed)
    }

    /// Writes a string.
    pub fn text(self, field: u64, value: &str) -> Self {
        self.bytes(field, value.as_bytes())
    }

    /// Writes bytes.
    pub fn bytes(mut self, field: u64, value: &[u8]) -> Self {
        if !value.is_empty() {
            self.with_length(field, value);
        }
        self
    }

    /// Writes a message in a field, even when it is empty, because a present message differs from none.
    pub fn message(mut self, field: u64, value: &Message) -> Self {
        self.with_length(field, &value.bytes);
        self
    }

    /// Writes several messages in a repeated field.
    pub fn messages(self, field: u64, values: impl IntoIterator<Item = Message>) -> Self {
        values.into_iter().fold(self, |whole, part| whole.message(field, &part))
    }

    fn with_length(&mut self, field: u64, value: &[u8]) {
        self.key(field, WITH_LENGTH);
        self.varint(value.len() as u64);
        self.bytes.extend(value);
    }

    fn key(&mut self, field: u64, wire_type: u64) {
        self.varint(field << 3 | wire_type);
    }

    /// Writes seven bits per byte, the lowest first; the top bit means that more bytes follow.
    fn varint(&mut self, mut value: u64) {
        while 0x7f < value {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }
}

/// Rounds to 1e-9; a number that is not finite cannot be drawn and becomes 0.
pub(super) fn rounded(value: f64) -> f64 {
    let rounded = (value * 1e9).round() / 1e9;
    if rounded.is_finite() { rounded + 0.0 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The two examples of the encoding guide: `a = 150` is 08 96 01, `b = "testing"` is 12 07 74 65 73 74 69 6e 67.
    #[test]
    fn bytes_are_those_of_the_encoding_guide() {
        assert_eq!(Message::new().integer(1, 150).into_bytes(), [0x08, 0x96, 0x01]);
        let testing = [0x12, 0x07, 0x74, 0x65, 0x73, 0x74, 0x69, 0x6e, 0x67];
        assert_eq!(Message::new().text(2, "testing").into_bytes(), testing);
        let inner = Message::new().integer(1, 150);
        assert_eq!(Message::new().message(3, &inner).into_bytes(), [0x1a, 0x03, 0x08, 0x96, 0x01]);
    }

    #[test]
    fn defaults_take_no_room_and_no_number_is_not_one() {
        let empty =
            Message::new().integer(1, 0).flag(2, false).double(3, 0.0).text(4, "").double(5, f64::NAN);
        assert!(empty.into_bytes().is_empty());
        assert_eq!(Message::new().double(1, 1.0).into_bytes(), [0x09, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
        assert_eq!(rounded(0.123456789123), 0.123456789);
    }
}
