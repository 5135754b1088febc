//! Columns of Arrow as slices of numbers and names: existing values are borrowed, missing ones become NaN.

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type,
    TimestampMicrosecondType, TimestampMillisecondType, TimestampNanosecondType, TimestampSecondType,
    UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef};
use arrow_schema::{DataType, TimeUnit};
use std::borrow::Cow;

/// Numbers of a column.
pub fn numbers(array: &dyn Array) -> Cow<'_, [f64]> {
    match array.data_type() {
        DataType::Float64 => {
            let values = array.as_primitive::<Float64Type>();
            match values.null_count() {
                0 => Cow::Borrowed(&values.values()[..]),
                _ => Cow::Owned(values.iter().map(|x| x.unwrap_or(f64::NAN)).collect()),
            }
        }
        DataType::Float32 => converted::<Float32Type>(array, f64::from),
        DataType::Int8 => converted::<Int8Type>(array, f64::from),
        DataType::Int16 => converted::<Int16Type>(array, f64::from),
        DataType::Int32 => converted::<Int32Type>(array, f64::from),
        DataType::Int64 => converted::<Int64Type>(array, |x| x as f64),
        DataType::UInt8 => converted::<UInt8Type>(array, f64::from),
        DataType::UInt16 => converted::<UInt16Type>(array, f64::from),
        DataType::UInt32 => converted::<UInt32Type>(array, f64::from),
        DataType::UInt64 => converted::<UInt64Type>(array, |x| x as f64),
        DataType::Timestamp(TimeUnit::Second, _) => converted::<TimestampSecondType>(array, |x| x as f64),
        DataType::Timestamp(TimeUnit::Millisecond, _) => {
            converted::<TimestampMillisecondType>(array, |x| x as f64 / 1e3)
        }
        DataType::Timestamp(TimeUnit::Microsecond, _) => {
            converted::<TimestampMicrosecondType>(array, |x| x as f64 / 1e6)
        }
        DataType::Timestamp(TimeUnit::Nanosecond, _) => {
            converted::<TimestampNanosecondType>(array, |x| x as f64 / 1e9)
        }
        _ => Cow::Owned(vec![f64::NAN; array.len()]),
    }
}

fn converted<T: ArrowPrimitiveType>(
    array: &dyn Array,
    number: impl Fn(T::Native) -> f64,
) -> Cow<'static, [f64]> {
    Cow::Owned(array.as_primitive::<T>().iter().map(|x| x.map_or(f64::NAN, &number)).collect())
}

/// Numbers of a column of lists, nested or not, and where each row begins; a missing list is empty.
pub fn lists(array: &dyn Array) -> (Cow<'_, [f64]>, Vec<usize>) {
    let n = array.len();
    match array.data_type() {
        DataType::FixedSizeList(_, _) => {
            let list = array.as_fixed_size_list();
            let width = list.value_length() as usize;
            below(
                list.values(),
                (0..n).map(|i| if list.is_null(i) { 0..0 } else { i * width..(i + 1) * width }),
            )
        }
        DataType::LargeList(_) => {
            let list = array.as_list::<i64>();
            let of = |i: usize| list.value_offsets()[i] as usize..list.value_offsets()[i + 1] as usize;
            below(list.values(), (0..n).map(|i| if list.is_null(i) { 0..0 } else { of(i) }))
        }
        DataType::List(_) => {
            let list = array.as_list::<i32>();
            let of = |i: usize| list.value_offsets()[i] as usize..list.value_offsets()[i + 1] as usize;
            below(list.values(), (0..n).map(|i| if list.is_null(i) { 0..0 } else { of(i) }))
        }
        _ => (Cow::Owned(Vec::new()), vec![0; n + 1]),
    }
}

/// The numbers of each row, side by side, whatever lies between them in the array.
fn below(
    values: &ArrayRef,
    rows: impl Iterator<Item = std::ops::Range<usize>>,
) -> (Cow<'static, [f64]>, Vec<usize>) {
    let is_nested = values.data_type().is_nested();
    let (inner, starts) = match is_nested {
        true => lists(values),
        false => (numbers(values), Vec::new()),
    };
    let (mut out, mut offsets) = (Vec::with_capacity(inner.len()), vec![0]);
    for row in rows {
        let range = if is_nested && !row.is_empty() { starts[row.start]..starts[row.end] } else { row };
        out.extend_from_slice(inner.get(range).unwrap_or(&[]));
        offsets.push(out.len());
    }
    (Cow::Owned(out), offsets)
}

/// Names of a column: the different ones, and which of them each row has; `u32::MAX` where it is missing.
pub fn names(array: &dyn Array) -> (Vec<String>, Vec<u32>) {
    let mut known = Known::default();
    let rows: Vec<u32> = match array.data_type() {
        DataType::Dictionary(_, _) => return of_dictionary(array),
        DataType::Utf8 => array.as_string::<i32>().iter().map(|name| known.number(name)).collect(),
        DataType::LargeUtf8 => array.as_string::<i64>().iter().map(|name| known.number(name)).collect(),
        DataType::Utf8View => array.as_string_view().iter().map(|name| known.number(name)).collect(),
        _ => {
            let text = |x: &f64| (!x.is_nan()).then(|| format!("{x}"));
            numbers(array).iter().map(|x| known.number(text(x).as_deref())).collect()
        }
    };
    (known.names, rows)
}

fn of_dictionary(array: &dyn Array) -> (Vec<String>, Vec<u32>) {
    let dictionary = array.as_any_dictionary();
    let (names, of_value) = names(dictionary.values().as_ref());
    let keys = dictionary.normalized_keys();
    let number = |(i, key): (usize, usize)| match array.is_null(i) {
        true => u32::MAX,
        false => of_value.get(key).copied().unwrap_or(u32::MAX),
    };
    (names, keys.into_iter().enumerate().map(number).collect())
}

#[derive(Default)]
struct Known {
    names: Vec<String>,
    number: std::collections::HashMap<String, u32>,
    last: Option<u32>,
}

impl Known {
    fn number(&mut self, name: Option<&str>) -> u32 {
        let Some(name) = name else { return u32::MAX };
        if let Some(last) = self.last.filter(|last| self.names[*last as usize] == name) {
            return last;
        }
        let number = match self.number.get(name) {
            Some(number) => *number,
            None => {
                let number = self.names.len() as u32;
                self.names.push(name.to_string());
                self.number.insert(name.to_string(), number);
                number
            }
        };
        self.last = Some(number);
        number
    }
}
