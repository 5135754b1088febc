//! A message as a tree of values, whatever bytes it came in.

use std::borrow::Cow;

/// A value of a message.
#[derive(Debug, Clone, PartialEq)]
pub enum Value<'a> {
    /// Any number or truth value.
    Number(f64),
    /// A text.
    Text(Cow<'a, str>),
    /// An array of bytes.
    Bytes(Cow<'a, [u8]>),
    /// An array of other numbers.
    Numbers(Vec<f64>),
    /// An array of texts or messages.
    List(Vec<Value<'a>>),
    /// A message.
    Message(Vec<(Cow<'a, str>, Value<'a>)>),
}

impl<'a> Value<'a> {
    /// A field, or a field of a field: `header.stamp`.
    pub fn get(&self, path: &str) -> Option<&Value<'a>> {
        path.split('.').try_fold(self, |value, name| match value {
            Value::Message(fields) => fields.iter().find(|(key, _)| key == name).map(|(_, value)| value),
            _ => None,
        })
    }

    fn need<T>(
        &self,
        path: &str,
        what: &str,
        read: impl FnOnce(&Value<'a>) -> Option<T>,
    ) -> Result<T, String> {
        let value = self.get(path).ok_or_else(|| format!("the message has no field `{path}`"))?;
        read(value).ok_or_else(|| format!("`{path}` is not {what}"))
    }

    /// A number.
    ///
    /// # Errors
    /// No such field, or another kind of value; also below.
    pub fn number(&self, path: &str) -> Result<f64, String> {
        self.need(path, "a number", |value| match value {
            Value::Number(x) => Some(*x),
            _ => None,
        })
    }

    /// Returns a whole number that is a size.
    ///
    /// # Errors
    /// The errors of `number`.
    pub fn count(&self, path: &str) -> Result<u32, String> {
        let x = self.number(path)?;
        match 0.0 <= x && x <= f64::from(u32::MAX) && x.fract() == 0.0 {
            true => Ok(x as u32),
            false => Err(format!("`{path}` is {x}; a whole number from 0 is needed")),
        }
    }

    /// Returns a text.
    ///
    /// # Errors
    /// The errors of `number`.
    pub fn text(&self, path: &str) -> Result<&str, String> {
        match self.get(path) {
            Some(Value::Text(text)) => Ok(text),
            Some(_) => Err(format!("`{path}` is not a text")),
            None => Err(format!("the message has no field `{path}`")),
        }
    }

    /// Returns bytes.
    ///
    /// # Errors
    /// The errors of `number`.
    pub fn bytes(&self, path: &str) -> Result<&[u8], String> {
        match self.get(path) {
            Some(Value::Bytes(bytes)) => Ok(bytes),
            Some(_) => Err(format!("`{path}` is not an array of bytes")),
            None => Err(format!("the message has no field `{path}`")),
        }
    }

    /// Returns a list of messages.
    ///
    /// # Errors
    /// The errors of `number`.
    pub fn list(&self, path: &str) -> Result<&[Value<'a>], String> {
        match self.get(path) {
            Some(Value::List(list)) => Ok(list),
            // A list of nothing has no kind in JSON.
            Some(Value::Numbers(none)) if none.is_empty() => Ok(&[]),
            Some(_) => Err(format!("`{path}` is not a list of messages")),
            None => Err(format!("the message has no field `{path}`")),
        }
    }

    /// Returns the time of the message's content, seconds; `None` where it is missing or 0.
    pub fn stamp_s(&self) -> Option<f64> {
        let stamp = ["header.stamp", "timestamp"].iter().find_map(|path| self.get(path))?;
        let nanosecond = ["nanosec", "nsec"].iter().find_map(|name| stamp.number(name).ok())?;
        let t_s = stamp.number("sec").ok()? + nanosecond / 1e9;
        (t_s != 0.0).then_some(t_s)
    }
}
