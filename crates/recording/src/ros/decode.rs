//! Decodes the bytes of a message to values: CDR of ROS 2 (plain, version 1, either byte order), ROS 1's own layout, and JSON.
//!
//! CDR: OMG DDSI-RTPS 2.3 section 10; four bytes state the byte order, then each number is at a multiple of its size, counted from their end.
//! ROS 1: the same without those four bytes and without gaps, little-endian.

use super::definition::{Count, Definition, Field, Kind};
use super::value::Value;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use base64::{Engine, alphabet};
use std::borrow::Cow;

/// Messages that are nested deeper are not of the types read here.
const MAX_DEPTH: usize = 16;
/// Longest array of anything but bytes: as many values take 32 MB.
const MAX_ELEMENTS: usize = 1 << 20;

/// The layout of the bytes of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// ROS 2.
    Cdr,
    /// ROS 1.
    Ros1,
}

/// Reads a message.
///
/// # Errors
/// Bytes that do not fit the definition, with where and how many are needed.
pub fn decode<'a>(definition: &'a Definition, layout: Layout, data: &'a [u8]) -> Result<Value<'a>, String> {
    let mut reader = match layout {
        Layout::Ros1 => Reader { data, at: 0, is_big_endian: false, is_aligned: false, definition },
        Layout::Cdr => {
            let Some((&[_, kind, _, _], data)) = data.split_first_chunk() else {
                return Err(format!("{} bytes; the header of CDR alone takes 4", data.len()));
            };
            if 1 < kind {
                return Err(format!("CDR of kind {kind}; plain CDR (0 or 1) is read"));
            }
            Reader { data, at: 0, is_big_endian: kind == 0, is_aligned: true, definition }
        }
    };
    reader.message(&definition.root, 0)
}

struct Reader<'a> {
    data: &'a [u8],
    at: usize,
    is_big_endian: bool,
    is_aligned: bool,
    definition: &'a Definition,
}

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let left = self.data.len() - self.at.min(self.data.len());
        if left < n {
            return Err(format!(
                "the message ends after {} bytes where {n} more are needed ({left} left)",
                self.at
            ));
        }
        let taken = &self.data[self.at..self.at + n];
        self.at += n;
        Ok(taken)
    }

    /// The bytes of a number, the least first.
    fn number_bytes(&mut self, size: usize) -> Result<[u8; 8], String> {
        if self.is_aligned {
            self.at = self.at.next_multiple_of(size);
        }
        let mut bytes = [0; 8];
        bytes[..size].copy_from_slice(self.take(size)?);
        if self.is_big_endian {
            bytes[..size].reverse();
        }
        Ok(bytes)
    }

    fn length(&mut self) -> Result<usize, String> {
        Ok(u64::from_le_bytes(self.number_bytes(4)?) as usize)
    }

    fn number(&mut self, kind: &Kind) -> Result<f64, String> {
        Ok(match kind {
            Kind::Signed(size) => {
                let bytes = self.number_bytes(*size)?;
                let shift = 64 - 8 * *size as u32;
                ((i64::from_le_bytes(bytes) << shift) >> shift) as f64
            }
            Kind::Unsigned(size) => u64::from_le_bytes(self.number_bytes(*size)?) as f64,
            Kind::Float(4) => f32::from_bits(u64::from_le_bytes(self.number_bytes(4)?) as u32).into(),
            Kind::Float(_) => f64::from_le_bytes(self.number_bytes(8)?),
            _ => f64::from(self.number_bytes(1)?[0] != 0),
        })
    }

    fn text(&mut self) -> Result<Value<'a>, String> {
        let length = self.length()?;
        let bytes = self.take(length)?;
        // CDR counts a closing zero.
        let bytes = if self.is_aligned { bytes.strip_suffix(&[0]).unwrap_or(bytes) } else { bytes };
        Ok(Value::Text(String::from_utf8_lossy(bytes)))
    }

    fn message(&mut self, name: &str, depth: usize) -> Result<Value<'a>, String> {
        if MAX_DEPTH < depth {
            return Err(format!("messages within messages deeper than {MAX_DEPTH}"));
        }
        let fields =
            self.definition.fields(name).ok_or_else(|| format!("the recording does not define {name}"))?;
        if fields.is_empty() && self.is_aligned {
            self.take(1)?; // ROS 2 writes a byte where there is nothing.
        }
        let read = |field: &'a Field| Ok((Cow::Borrowed(field.name.as_str()), self.field(field, depth)?));
        Ok(Value::Message(fields.iter().map(read).collect::<Result<_, String>>()?))
    }

    fn field(&mut self, field: &'a Field, depth: usize) -> Result<Value<'a>, String> {
        let reported = |reason| format!("{}: {reason}", field.name);
        let length = match field.count {
            Count::One => return self.one(&field.kind, depth).map_err(reported),
            Count::Fixed(length) => length,
            Count::Sequence => self.length().map_err(reported)?,
        };
        self.array(&field.kind, length, depth).map_err(reported)
    }

    fn one(&mut self, kind: &'a Kind, depth: usize) -> Result<Value<'a>, String> {
        match kind {
            Kind::Text => self.text(),
            Kind::Time => {
                let [sec, nanosec] = [(); 2].map(|()| self.number(&Kind::Unsigned(4)));
                Ok(Value::Message(vec![
                    ("sec".into(), Value::Number(sec?)),
                    ("nanosec".into(), Value::Number(nanosec?)),
                ]))
            }
            Kind::Message(name) => self.message(name, depth + 1),
            _ => self.number(kind).map(Value::Number),
        }
    }

    fn array(&mut self, kind: &'a Kind, length: usize, depth: usize) -> Result<Value<'a>, String> {
        if *kind == Kind::Unsigned(1) {
            return self.take(length).map(|bytes| Value::Bytes(bytes.into()));
        }
        // Every element takes a byte at least: a length that cannot be is refused before memory is taken for it.
        let left = self.data.len().saturating_sub(self.at);
        if left < length || MAX_ELEMENTS < length {
            return Err(format!(
                "{length} elements where {left} bytes are left; at most {MAX_ELEMENTS} are read"
            ));
        }
        match kind {
            Kind::Text | Kind::Time | Kind::Message(_) => {
                (0..length).map(|_| self.one(kind, depth)).collect::<Result<_, _>>().map(Value::List)
            }
            _ => (0..length).map(|_| self.number(kind)).collect::<Result<_, _>>().map(Value::Numbers),
        }
    }
}

/// A message written as JSON: arrays of bytes are Base64, as Foxglove has it.
///
/// # Errors
/// No JSON.
pub fn from_json(data: &[u8]) -> Result<Value<'static>, String> {
    let value: serde_json::Value = serde_json::from_slice(data).map_err(|e| format!("not JSON: {e}"))?;
    Ok(json_value(value, ""))
}

/// The bytes of a text in Base64, as JSON carries images; with or without padding.
fn bytes_of(text: &str) -> Option<Vec<u8>> {
    const ANY_PADDING: GeneralPurposeConfig =
        GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    GeneralPurpose::new(&alphabet::STANDARD, ANY_PADDING).decode(text).ok()
}

fn json_value(value: serde_json::Value, name: &str) -> Value<'static> {
    use serde_json::Value as Json;
    match value {
        Json::Number(x) => Value::Number(x.as_f64().unwrap_or(f64::NAN)),
        Json::Bool(flag) => Value::Number(f64::from(u8::from(flag))),
        Json::Null => Value::List(Vec::new()),
        Json::String(text) => match bytes_of(&text).filter(|_| name == "data") {
            Some(bytes) => Value::Bytes(bytes.into()),
            None => Value::Text(text.into()),
        },
        Json::Array(items) if items.iter().all(Json::is_number) => {
            Value::Numbers(items.iter().filter_map(Json::as_f64).collect())
        }
        Json::Array(items) => Value::List(items.into_iter().map(|item| json_value(item, "")).collect()),
        Json::Object(fields) => {
            let read = |(name, value): (String, Json)| {
                let value = json_value(value, &name);
                (Cow::Owned(name), value)
            };
            Value::Message(fields.into_iter().map(read).collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::bytes_of;

    /// Writers leave the padding out or put it in; what is no Base64 stays a text.
    #[test]
    fn bytes_are_read_with_and_without_padding() {
        for coded in ["Zm8=", "Zm8"] {
            assert_eq!(bytes_of(coded).as_deref(), Some(&b"fo"[..]), "{coded}");
        }
        for text in ["Z", "Zg-_", "Zm9v!"] {
            assert_eq!(bytes_of(text), None, "{text}");
        }
    }
}
