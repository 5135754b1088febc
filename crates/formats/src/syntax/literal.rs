//! JSON and Python literals with their lines. `serde_json` keeps no lines, and mrcal's `.cameramodel` is a Python
//! dictionary, so both go through this small recursive descent; the tests hold it to `serde_json`.

use crate::tree::{Fault, MAX_DEPTH, Node, Value, map_of};

/// Values accepted: 80 MB of tree, while 16 MiB of observations at full precision have about 1.2 million numbers.
const MAX_NODES: usize = 2_000_000;

/// Strict JSON.
pub(crate) fn parse_json(text: &str) -> Result<Node, Fault> {
    Parser { text, at: 0, line: 1, nodes_left: MAX_NODES, python: false }.document()
}

/// A Python literal: also comments, single quotes, byte strings, tuples, trailing commas, `None`, `True`, `False`.
pub(crate) fn parse_python(text: &str) -> Result<Node, Fault> {
    Parser { text, at: 0, line: 1, nodes_left: MAX_NODES, python: true }.document()
}

struct Parser<'t> {
    text: &'t str,
    at: usize,
    line: usize,
    nodes_left: usize,
    python: bool,
}

impl<'t> Parser<'t> {
    fn document(mut self) -> Result<Node, Fault> {
        let root = self.value(MAX_DEPTH)?;
        self.skip_blank();
        match self.peek() {
            None => Ok(root),
            Some(c) => Err(self.fault(format!("`{c}` after the end of the document"))),
        }
    }

    fn fault(&self, reason: impl std::fmt::Display) -> Fault {
        let kind = if self.python { "a Python literal" } else { "JSON" };
        Fault::at(self.line, format!("not valid {kind}: {reason}"))
    }

    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    fn bump(&mut self) -> Option<char> {
        let c = self.peek()?;
        self.at += c.len_utf8();
        self.line += usize::from(c == '\n');
        Some(c)
    }

    fn skip_blank(&mut self) {
        while let Some(c) = self.peek() {
            match c {
                ' ' | '\t' | '\r' | '\n' => drop(self.bump()),
                '#' if self.python => while self.bump().is_some_and(|c| c != '\n') {},
                _ => return,
            }
        }
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        if found {
            self.bump();
        }
        found
    }

    fn value(&mut self, depth: usize) -> Result<Node, Fault> {
        self.skip_blank();
        let line = self.line;
        if depth == 0 {
            return Err(self.fault(format!("nested deeper than {MAX_DEPTH} levels")));
        }
        self.nodes_left = match self.nodes_left.checked_sub(1) {
            Some(left) => left,
            None => return Err(self.fault(format!("more than {MAX_NODES} values"))),
        };
        let value = match self.peek() {
            None => return Err(self.fault("the file ends too early (truncated?)")),
            Some('{') => return self.map(depth),
            Some('[') => self.list(']', depth)?,
            Some('(') if self.python => self.list(')', depth)?,
            Some('"') => Value::Text(self.quoted()?),
            Some('\'') if self.python => Value::Text(self.quoted()?),
            Some(_) => self.word()?,
        };
        Ok(Node { line, value })
    }

    fn map(&mut self, depth: usize) -> Result<Node, Fault> {
        let start = self.line;
        self.bump();
        let mut entries = Vec::new();
        loop {
            self.skip_blank();
            if (entries.is_empty() || self.python) && self.take('}') {
                return map_of(start, entries);
            }
            let line = self.line;
            match self.peek() {
                Some('"') => {}
                Some('\'') if self.python => {}
                _ => return Err(self.expected("a quoted key")),
            }
            let key = self.quoted()?;
            self.skip_blank();
            if !self.take(':') {
                return Err(self.expected("`:`"));
            }
            entries.push((key, Node { line, ..self.value(depth - 1)? }));
            self.skip_blank();
            if !self.take(',') {
                return if self.take('}') {
                    map_of(start, entries)
                } else {
                    Err(self.expected("`,` or `}`"))
                };
            }
        }
    }

    fn list(&mut self, close: char, depth: usize) -> Result<Value, Fault> {
        self.bump();
        let mut items = Vec::new();
        loop {
            self.skip_blank();
            if (items.is_empty() || self.python) && self.take(close) {
                return Ok(Value::List(items));
            }
            items.push(self.value(depth - 1)?);
            self.skip_blank();
            if !self.take(',') {
                let wanted = format!("`,` or `{close}`");
                return if self.take(close) { Ok(Value::List(items)) } else { Err(self.expected(&wanted)) };
            }
        }
    }

    fn expected(&self, wanted: &str) -> Fault {
        match self.peek() {
            Some(c) => self.fault(format!("{wanted} expected, `{c}` found")),
            None => self.fault(format!("{wanted} expected, but the file ends (truncated?)")),
        }
    }

    fn quoted(&mut self) -> Result<String, Fault> {
        let quote = self.bump();
        let mut text = String::new();
        loop {
            match self.bump() {
                None => return Err(self.fault("a string without its closing quote (truncated?)")),
                c if c == quote => return Ok(text),
                Some('\\') => text.push(self.escape()?),
                Some(c) if c < ' ' => {
                    return Err(self.fault("a control character or line end inside a string"));
                }
                Some(c) => text.push(c),
            }
        }
    }

    fn escape(&mut self) -> Result<char, Fault> {
        match self.bump() {
            Some('n') => Ok('\n'),
            Some('t') => Ok('\t'),
            Some('r') => Ok('\r'),
            Some('b') => Ok('\u{8}'),
            Some('f') => Ok('\u{c}'),
            Some(c @ ('"' | '\\' | '/')) => Ok(c),
            Some('\'') if self.python => Ok('\''),
            Some('u') => self.unicode(),
            Some('x') if self.python => self.hex(2).map(|code| char::from(code as u8)),
            _ => Err(self.fault("an unknown escape in a string")),
        }
    }

    /// `\u` and four hexadecimal digits, two of them for characters beyond the basic plane.
    fn unicode(&mut self) -> Result<char, Fault> {
        let high = self.hex(4)?;
        let code = if (0xd800..0xdc00).contains(&high) && self.take('\\') && self.take('u') {
            let low = self.hex(4)?;
            0x10000 + ((high - 0xd800) << 10) + low.wrapping_sub(0xdc00) % 0x400
        } else {
            high
        };
        char::from_u32(code).ok_or_else(|| self.fault("half a surrogate pair in a string"))
    }

    fn hex(&mut self, digits: usize) -> Result<u32, Fault> {
        let mut code = 0;
        for _ in 0..digits {
            let digit = self.bump().and_then(|c| c.to_digit(16));
            code = 16 * code + digit.ok_or_else(|| self.fault("a bad hexadecimal escape"))?;
        }
        Ok(code)
    }

    fn word(&mut self) -> Result<Value, Fault> {
        let rest = &self.text[self.at..];
        let end =
            rest.find(|c: char| !(c.is_ascii_alphanumeric() || "+-._".contains(c))).unwrap_or(rest.len());
        let word = &rest[..end];
        if self.python && word == "b" && rest[end..].starts_with(['\'', '"']) {
            self.at += end;
            return self.quoted().map(Value::Text);
        }
        let value = match (word, self.python) {
            ("true", false) | ("True", true) => Value::Bool(true),
            ("false", false) | ("False", true) => Value::Bool(false),
            ("null", false) | ("None", true) => Value::Null,
            _ => Value::Number(self.number(word)?),
        };
        self.at += end;
        Ok(value)
    }

    fn number(&self, word: &str) -> Result<f64, Fault> {
        match word.to_ascii_lowercase().trim_start_matches(['-', '+', '.']) {
            // Written by Python and by OpenCV although no standard has them; refused later with the key's name.
            "nan" => return Ok(f64::NAN),
            "inf" | "infinity" => return Ok(f64::INFINITY),
            _ => {}
        }
        let strict = self.python || is_json_number(word);
        match word.parse::<f64>() {
            Ok(x) if strict && x.is_finite() => Ok(x),
            _ if word.is_empty() => Err(self.expected("a value")),
            _ => Err(self
                .fault(format!("`{}` is neither a number nor a word it knows", &word[..word.len().min(40)]))),
        }
    }
}

/// No leading zeros or plus, digits on both sides of the point. OpenCV's `1.` is let through.
fn is_json_number(word: &str) -> bool {
    let digits = word.strip_prefix('-').unwrap_or(word);
    let mantissa = digits.split(['e', 'E']).next().unwrap_or_default();
    let whole = mantissa.split('.').next().unwrap_or_default();
    digits.starts_with(|c: char| c.is_ascii_digit()) && (whole == "0" || !whole.starts_with('0'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn same(node: &Node, json: &serde_json::Value) -> bool {
        match (&node.value, json) {
            (Value::Null, serde_json::Value::Null) => true,
            (Value::Bool(a), serde_json::Value::Bool(b)) => a == b,
            (Value::Number(a), serde_json::Value::Number(b)) => b.as_f64() == Some(*a),
            (Value::Text(a), serde_json::Value::String(b)) => a == b,
            (Value::List(a), serde_json::Value::Array(b)) => {
                a.len() == b.len() && a.iter().zip(b).all(|(x, y)| same(x, y))
            }
            (Value::Map(a), serde_json::Value::Object(b)) => {
                a.len() == b.len() && a.iter().all(|(k, x)| b.get(k).is_some_and(|y| same(x, y)))
            }
            _ => false,
        }
    }

    fn any_json() -> impl Strategy<Value = serde_json::Value> {
        let leaf = prop_oneof![
            Just(serde_json::Value::Null),
            any::<bool>().prop_map(Into::into),
            any::<i32>().prop_map(Into::into),
            (-1e300..1e300).prop_map(|x: f64| serde_json::json!(x)),
            any::<String>().prop_map(Into::into),
        ];
        leaf.prop_recursive(4, 32, 4, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..4).prop_map(Into::into),
                prop::collection::hash_map(any::<String>(), inner, 0..4)
                    .prop_map(|m| serde_json::Value::Object(m.into_iter().collect())),
            ]
        })
    }

    proptest! {
        /// Compact and indented spellings of any document mean what serde_json says they mean.
        #[test]
        fn agrees_with_serde_json(json in any_json()) {
            for text in [json.to_string(), serde_json::to_string_pretty(&json).unwrap()] {
                prop_assert!(same(&parse_json(&text).unwrap(), &json), "{}", text);
            }
        }

        /// What serde_json refuses is refused, except the numbers of OpenCV and Python.
        #[test]
        fn accepts_nothing_more_than_serde_json(text in "[\\[\\]{},:\"a0-9.e\\- ]{0,24}") {
            if parse_json(&text).is_ok() && !text.contains('.') {
                prop_assert!(serde_json::from_str::<serde_json::Value>(&text).is_ok(), "{}", text);
            }
        }
    }

    #[test]
    fn python_dictionary_of_mrcal_is_read() {
        let text = "# made by hand\n{\n 'a': [1., -2,],\n 'b': b'ab\\'c', # end\n 'c': (None, True),\n}\n";
        let root = parse_python(text).unwrap();
        assert_eq!(root.get("a").unwrap().line, 3);
        assert_eq!(root.get("b").unwrap().value, Value::Text("ab'c".into()));
        assert!(parse_json(text).is_err());
    }

    #[test]
    fn truncation_is_named() {
        for text in ["{\"a\": [1, 2", "{\"a\": \"x", "{\"a\"", "{"] {
            assert!(parse_json(text).unwrap_err().reason.contains("truncated"), "{text}");
        }
    }
}
