//! Parses definitions of messages: `ros2msg` and `ros1msg`, the message itself first, then the types that it contains, each below a line of `=`
//! and `MSG: package/Type`.

use std::collections::BTreeMap;

/// A longer text is not a definition.
const MAX_TEXT_BYTES: usize = 1 << 20;

/// The type of a field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// `bool`.
    Bool,
    /// A signed integer with this number of bytes.
    Signed(usize),
    /// An unsigned integer with this number of bytes.
    Unsigned(usize),
    /// A float with this number of bytes.
    Float(usize),
    /// `string`.
    Text,
    /// ROS 1's `time` or `duration`: seconds and nanoseconds.
    Time,
    /// Another message, by its full name.
    Message(String),
}

/// The number of values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Count {
    /// One value.
    One,
    /// An array of known length.
    Fixed(usize),
    /// A sequence with a stored length.
    Sequence,
}

/// A field of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Type of the field.
    pub kind: Kind,
    /// Number of values.
    pub count: Count,
}

/// A message and all that it is made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Definition {
    /// Its full name, `package/Type`.
    pub root: String,
    types: BTreeMap<String, Vec<Field>>,
}

impl Definition {
    /// Reads a definition of `name` (`sensor_msgs/msg/Image`, or without `msg`).
    ///
    /// # Errors
    /// What the text holds that is no definition, with its line.
    pub fn parse(name: &str, text: &str) -> Result<Self, String> {
        if MAX_TEXT_BYTES < text.len() {
            return Err(format!("a definition of {} bytes; the limit is {MAX_TEXT_BYTES}", text.len()));
        }
        let root = full_name(name, "");
        let mut types = BTreeMap::new();
        let (mut current, mut fields) = (root.clone(), Vec::new());
        for (i, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if let Some(next) = line.strip_prefix("MSG:") {
                types.insert(std::mem::replace(&mut current, full_name(next.trim(), "")), fields);
                fields = Vec::new();
            } else if !line.is_empty() && !line.bytes().all(|b| b == b'=') {
                let field = field(line, &current);
                fields.extend(
                    field.map_err(|reason| format!("definition of {name}, line {}: {reason}", i + 1))?,
                );
            }
        }
        types.insert(current, fields);
        // Writers leave out what every ROS knows.
        for (known, parts) in [("builtin_interfaces/Time", TIME), ("builtin_interfaces/Duration", TIME)] {
            let fields = || parts.iter().map(|(name, kind)| Field::one(name, kind.clone())).collect();
            types.entry(known.to_string()).or_insert_with(fields);
        }
        Ok(Definition { root, types })
    }

    /// The fields of a message by its full name.
    pub fn fields(&self, name: &str) -> Option<&[Field]> {
        self.types.get(name).map(Vec::as_slice)
    }
}

const TIME: &[(&str, Kind)] = &[("sec", Kind::Signed(4)), ("nanosec", Kind::Unsigned(4))];

impl Field {
    fn one(name: &str, kind: Kind) -> Self {
        Field { name: name.to_string(), kind, count: Count::One }
    }
}

/// `package/Type`; a name alone belongs to the package of `beside`.
fn full_name(name: &str, beside: &str) -> String {
    match (name.split_once('/'), name.rsplit_once('/')) {
        (Some((package, _)), Some((_, kind))) => format!("{package}/{kind}"),
        _ if name == "Header" => "std_msgs/Header".to_string(),
        _ => match beside.split_once('/') {
            Some((package, _)) => format!("{package}/{name}"),
            None => name.to_string(),
        },
    }
}

/// A line that is no comment; none for a constant.
fn field(line: &str, message: &str) -> Result<Option<Field>, String> {
    let (kind, rest) = line.split_once(char::is_whitespace).ok_or_else(|| format!("`{line}` has no name"))?;
    let rest = rest.trim_start();
    let name = rest.split(|c: char| c.is_whitespace() || c == '=').next().unwrap_or_default();
    if rest[name.len()..].trim_start().starts_with('=') {
        return Ok(None);
    }
    let (base, count) = match kind.split_once('[') {
        None => (kind, Count::One),
        Some((base, "]")) => (base, Count::Sequence),
        Some((base, bound)) if bound.starts_with("<=") && bound.ends_with(']') => (base, Count::Sequence),
        Some((base, length)) => {
            let length = length.strip_suffix(']').and_then(|n| n.parse().ok());
            (base, Count::Fixed(length.ok_or_else(|| format!("`{kind}` is no type"))?))
        }
    };
    let kind = kind_of(base.split("<=").next().unwrap_or(base), message)?;
    Ok(Some(Field { name: name.to_string(), kind, count }))
}

fn kind_of(name: &str, message: &str) -> Result<Kind, String> {
    Ok(match name {
        "bool" => Kind::Bool,
        "int8" => Kind::Signed(1),
        "uint8" | "byte" | "char" => Kind::Unsigned(1),
        "int16" => Kind::Signed(2),
        "uint16" => Kind::Unsigned(2),
        "int32" => Kind::Signed(4),
        "uint32" => Kind::Unsigned(4),
        "int64" => Kind::Signed(8),
        "uint64" => Kind::Unsigned(8),
        "float32" => Kind::Float(4),
        "float64" => Kind::Float(8),
        "string" => Kind::Text,
        "time" | "duration" => Kind::Time,
        "wstring" => return Err("`wstring` is not read".to_string()),
        other => Kind::Message(full_name(other, message)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_arrays_constants_and_neighbours_are_reported_apart() {
        let text = "# comment\nuint8 RED=1\nstring NAME = \"a # b\"\nHeader header\nfloat64[9] k  # row by row\nuint8[] data\n\
            string<=8 short\nint32[<=4] few\nint32 with_default 5\nPart[2] parts\n====\nMSG: other/msg/Part\nPiece piece\n\
            ===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
        let read = Definition::parse("my_msgs/msg/Thing", text).unwrap();
        let names: Vec<&str> =
            read.fields("my_msgs/Thing").unwrap().iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["header", "k", "data", "short", "few", "with_default", "parts"]);
        let field = |i: usize| read.fields(&read.root).unwrap()[i].clone();
        assert_eq!((field(1).kind, field(1).count), (Kind::Float(8), Count::Fixed(9)));
        assert_eq!((field(3).kind, field(4).count), (Kind::Text, Count::Sequence));
        assert_eq!(field(6).kind, Kind::Message("my_msgs/Part".into()));
        assert_eq!(read.fields("other/Part").unwrap()[0].kind, Kind::Message("other/Piece".into()));
        assert_eq!(read.fields("builtin_interfaces/Time").unwrap().len(), 2);
    }

    #[test]
    fn what_is_no_definition_is_reported_with_its_line() {
        for text in ["uint8 a\nnothing", "uint8[x] a", "wstring a"] {
            let error = Definition::parse("a/B", text).unwrap_err();
            assert!(error.contains("a/B, line"), "{error}");
        }
    }
}
