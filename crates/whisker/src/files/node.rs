//! A JSON document walked by key, so that every complaint names its key.

use super::quoted;
use nalgebra::Vector2;
use serde_json::Value;

/// A value and how it was reached.
#[derive(Debug, Clone)]
pub struct Node<'a> {
    path: String,
    value: &'a Value,
}

impl<'a> Node<'a> {
    /// The document itself.
    pub fn root(value: &'a Value) -> Self {
        Node { path: String::new(), value }
    }

    /// The JSON itself.
    pub fn value(&self) -> &'a Value {
        self.value
    }

    fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_string() } else { format!("{}.{key}", self.path) }
    }

    /// What is below a key; none where it is missing or null.
    pub fn get(&self, key: &str) -> Option<Node<'a>> {
        let value = self.value.get(key).filter(|value| !value.is_null())?;
        Some(Node { path: self.path_of(key), value })
    }

    /// What is below the first of several spellings that is there.
    pub fn any(&self, keys: &[&str]) -> Option<Node<'a>> {
        keys.iter().find_map(|key| self.get(key))
    }

    /// As `get`, where it must be there.
    pub fn need(&self, key: &str) -> Result<Node<'a>, String> {
        self.get(key).ok_or_else(|| {
            let keys = self.value.as_object().map(|o| o.keys().map(String::as_str).collect::<Vec<_>>());
            let there =
                keys.filter(|keys| !keys.is_empty()).map(|keys| format!("; there are {}", keys.join(", ")));
            format!("`{}` is missing{}", self.path_of(key), there.unwrap_or_default())
        })
    }

    /// `KEY is SEEN; NEEDED is needed`.
    pub fn complaint(&self, needed: &str) -> String {
        format!("`{}` is {}; {needed} is needed", self.path, quoted(&self.value.to_string()))
    }

    /// A finite number.
    pub fn number(&self) -> Result<f64, String> {
        self.value.as_f64().filter(|x| x.is_finite()).ok_or_else(|| self.complaint("a number"))
    }

    /// A number above 0.
    pub fn positive(&self) -> Result<f64, String> {
        self.number().ok().filter(|x| 0.0 < *x).ok_or_else(|| self.complaint("a positive number"))
    }

    /// A number not below 0.
    pub fn not_negative(&self) -> Result<f64, String> {
        self.number().ok().filter(|x| 0.0 <= *x).ok_or_else(|| self.complaint("a number not below 0"))
    }

    /// A word.
    pub fn word(&self) -> Result<&'a str, String> {
        self.value.as_str().ok_or_else(|| self.complaint("a word"))
    }

    /// The entries of a list.
    pub fn list(&self) -> Result<Vec<Node<'a>>, String> {
        let entries = self.value.as_array().ok_or_else(|| self.complaint("a list"))?;
        let node = |(i, value): (usize, &'a Value)| Node { path: format!("{}[{i}]", self.path), value };
        Ok(entries.iter().enumerate().map(node).collect())
    }

    /// A list of numbers.
    pub fn numbers(&self) -> Result<Vec<f64>, String> {
        self.list()?.iter().map(Node::number).collect()
    }

    /// A list of so many numbers.
    pub fn numbers_n<const N: usize>(&self) -> Result<[f64; N], String> {
        self.numbers()?.try_into().map_err(|_| self.complaint(&format!("a list of {N} numbers")))
    }

    /// `[x, y]`.
    pub fn point(&self) -> Result<Vector2<f64>, String> {
        self.numbers_n::<2>().map(Vector2::from)
    }

    /// The number below the first of several spellings, where there is one.
    pub fn optional(&self, keys: &[&str]) -> Result<Option<f64>, String> {
        self.any(keys).map(|node| node.number()).transpose()
    }
}
