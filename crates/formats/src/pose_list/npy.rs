//! NumPy's `.npy`: little-endian floating-point arrays in C order.

use super::arrays::Array;
use crate::document::{Fault, Node};
use crate::entry::Entry;
use crate::syntax::literal;

pub(super) const MAGIC: &[u8] = b"\x93NUMPY";
/// Longest header accepted, bytes; NumPy pads its own to 128 or 192.
const MAX_HEADER: usize = 4096;
/// Most dimensions: pairs of matrices have four.
const MAX_DIMENSIONS: usize = 8;

/// Reads the array of a file.
pub(super) fn array(bytes: &[u8]) -> Result<Array, Fault> {
    let (header, data) = split(bytes)?;
    let root = literal::parse_python(header.trim())?;
    let header = Entry::called("the header of the array", &root);
    let size = item_size(&header.need("descr")?)?;
    let shape = header.need("shape")?.items()?;
    if MAX_DIMENSIONS < shape.len() {
        return Err(header.fault(format!("states {} dimensions; three are needed: (n, 4, 4)", shape.len())));
    }
    let shape: Vec<usize> =
        shape.iter().map(|side| Ok(side.count(0)? as usize)).collect::<Result<_, Fault>>()?;
    if header.need("fortran_order")?.flag()? && 1 < shape.len() {
        return Err(header.fault(
            "states Fortran order; save the array in C order: numpy.save(FILE, numpy.ascontiguousarray(poses))",
        ));
    }
    let needed = shape.iter().try_fold(size, |bytes, side| bytes.checked_mul(*side));
    if needed != Some(data.len()) {
        let seen = data.len();
        return Err(header.fault(format!(
            "states the shape {shape:?} of {size} bytes each, but {seen} bytes follow; the file is damaged or incomplete"
        )));
    }
    let number = |item: &[u8]| match *item {
        [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => f64::NAN,
    };
    Ok(Array { shape, data: data.chunks_exact(size).map(number).collect(), lines: Vec::new() })
}

/// Splits a file into the text of its header and the bytes of its numbers.
fn split(bytes: &[u8]) -> Result<(&str, &[u8]), Fault> {
    let short = || Fault::new("a NumPy array (.npy) that ends within its header; the file is incomplete");
    let (length, from) = match bytes.get(MAGIC.len()).ok_or_else(short)? {
        1 => match bytes.get(8..10).ok_or_else(short)? {
            [a, b] => (usize::from(u16::from_le_bytes([*a, *b])), 10),
            _ => return Err(short()),
        },
        2 | 3 => match bytes.get(8..12).ok_or_else(short)? {
            [a, b, c, d] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 12),
            _ => return Err(short()),
        },
        version => {
            return Err(Fault::new(format!("a NumPy array of version {version}; versions 1 to 3 are read")));
        }
    };
    if MAX_HEADER < length {
        return Err(Fault::new(format!(
            "a NumPy array whose header has {length} bytes; at most {MAX_HEADER} are read, and an array of poses needs 118"
        )));
    }
    let header = bytes.get(from..from + length).ok_or_else(short)?;
    let text =
        std::str::from_utf8(header).map_err(|_| Fault::new("a NumPy array whose header is no text"))?;
    Ok((text, &bytes[from + length..]))
}

/// Returns the number of bytes of a number.
fn item_size(descr: &Entry<'_>) -> Result<usize, Fault> {
    let seen = match &descr.node {
        Node { value: crate::document::Value::Text(text), .. } => text.as_str(),
        _ => "a structure",
    };
    match seen {
        "<f8" => Ok(8),
        "<f4" => Ok(4),
        "|O" => Err(descr.fault(
            "is Python objects, which are not run here; save numbers: numpy.save(FILE, numpy.asarray(poses, dtype=float))",
        )),
        other => {
            let other: String = other.chars().take(20).collect();
            Err(descr.fault(format!(
                "is `{other}`; little-endian floating point (<f8 or <f4) is needed: numpy.save(FILE, poses.astype(\"<f8\"))"
            )))
        }
    }
}
