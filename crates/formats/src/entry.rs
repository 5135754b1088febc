//! One value of a file with the path of keys that leads to it: the typed accessors every format uses.

use super::document::{Fault, Node, Value};
use super::input::{in_metres, nearest};
use nalgebra::DMatrix;

/// A node under its key path, e.g. `cam0.intrinsics`.
#[derive(Debug, Clone)]
pub(super) struct Entry<'a> {
    pub path: String,
    pub node: &'a Node,
    /// Where in the path the last key begins: keys may hold points themselves.
    name_from: usize,
}

impl<'a> Entry<'a> {
    /// A node outside the tree of a document, under what messages call it.
    pub fn called(path: impl Into<String>, node: &'a Node) -> Self {
        Entry { path: path.into(), node, name_from: 0 }
    }

    /// `line: path: reason`.
    pub fn fault(&self, reason: impl std::fmt::Display) -> Fault {
        let reason =
            if self.path.is_empty() { reason.to_string() } else { format!("{}: {reason}", self.path) };
        Fault::at(self.node.line, reason)
    }

    fn child(&self, key: &str, node: &'a Node) -> Entry<'a> {
        let path = if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) };
        Entry { name_from: path.len() - key.len(), path, node }
    }

    /// Last part of the path: the name a table goes by.
    pub fn name(&self) -> &str {
        &self.path[self.name_from..]
    }

    pub fn get(&self, key: &str) -> Option<Entry<'a>> {
        self.node.get(key).filter(|n| n.value != Value::Null).map(|node| self.child(key, node))
    }

    pub fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    /// The first of several spellings that is there.
    pub fn first_of(&self, keys: &[&str]) -> Option<Entry<'a>> {
        keys.iter().find_map(|key| self.get(key))
    }

    pub fn need(&self, key: &str) -> Result<Entry<'a>, Fault> {
        self.get(key).ok_or_else(|| self.fault(format!("the key `{key}` is missing")))
    }

    /// Keys and values of a table, in file order; a fault when it is not a table.
    pub fn entries(&self) -> Result<Vec<Entry<'a>>, Fault> {
        match &self.node.value {
            Value::Map(entries) => Ok(entries.iter().map(|(key, node)| self.child(key, node)).collect()),
            other => Err(self.fault(format!("is {}; a table of keys is needed", other.kind()))),
        }
    }

    /// Elements of a list; `path[i]`.
    pub fn items(&self) -> Result<Vec<Entry<'a>>, Fault> {
        match &self.node.value {
            Value::List(items) => Ok(items
                .iter()
                .enumerate()
                .map(|(i, node)| Entry {
                    path: format!("{}[{i}]", self.path),
                    node,
                    name_from: self.name_from,
                })
                .collect()),
            other => Err(self.fault(format!("is {}; a list is needed", other.kind()))),
        }
    }

    /// A finite number.
    pub fn number(&self) -> Result<f64, Fault> {
        match &self.node.value {
            Value::Number(x) if x.is_finite() => Ok(*x),
            Value::Number(x) => {
                Err(self.fault(format!("is {x}; a finite number is needed (a failed calibration?)")))
            }
            Value::Text(text) => Err(self.fault(not_a_number(text))),
            other => Err(self.fault(format!("is {}; a number is needed", other.kind()))),
        }
    }

    /// A whole number of at least `least` that fits the identifier and size types.
    pub fn count(&self, least: u32) -> Result<u32, Fault> {
        let x = self.number()?;
        if x.fract() != 0.0 || x < f64::from(least) || f64::from(u32::MAX) < x {
            return Err(self.fault(format!("is {x}; a whole number of at least {least} is needed")));
        }
        Ok(x as u32)
    }

    /// Rows or columns of a target: at most 1000, so that their product is a sane number of corners.
    pub fn side(&self, least: u32) -> Result<u32, Fault> {
        self.count_up_to(least, 1000)
    }

    /// Identifier of a tag: at most 10⁹, so that counting on from it cannot overflow.
    pub fn id(&self) -> Result<u32, Fault> {
        self.count_up_to(0, 1_000_000_000)
    }

    fn count_up_to(&self, least: u32, most: u32) -> Result<u32, Fault> {
        match self.count(least)? {
            n if n <= most => Ok(n),
            n => Err(self.fault(format!("is {n}; at most {most} is supported"))),
        }
    }

    pub fn text(&self) -> Result<&'a str, Fault> {
        match &self.node.value {
            Value::Text(text) => Ok(text),
            other => Err(self.fault(format!("is {}; text is needed", other.kind()))),
        }
    }

    /// `true`/`false`, or 0/1 as OpenCV writes it.
    pub fn flag(&self) -> Result<bool, Fault> {
        match &self.node.value {
            Value::Bool(flag) => Ok(*flag),
            Value::Number(x) if *x == 0.0 || *x == 1.0 => Ok(*x == 1.0),
            other => Err(self.fault(format!("is {}; true or false is needed", other.kind()))),
        }
    }

    /// All numbers below, row by row: a flat list, nested rows, `{rows, cols, data}`, or a single number.
    pub fn numbers(&self) -> Result<Vec<f64>, Fault> {
        match &self.node.value {
            Value::Map(_) => self.dense_data(),
            Value::List(_) => {
                let mut all = Vec::new();
                for item in self.items()? {
                    match item.node.value {
                        Value::List(_) => all.extend(item.numbers()?),
                        _ => all.push(item.number()?),
                    }
                }
                Ok(all)
            }
            _ => self.number().map(|x| vec![x]),
        }
    }

    /// OpenCV's and ROS's `{rows, cols, data}`; the count must agree.
    fn dense_data(&self) -> Result<Vec<f64>, Fault> {
        let (rows, cols) = (self.need("rows")?.count(0)?, self.need("cols")?.count(0)?);
        let data = match self.get("data") {
            Some(data) => data.numbers()?,
            None if rows == 0 || cols == 0 => Vec::new(),
            None => return Err(self.fault("the key `data` is missing")),
        };
        if data.len() as u64 != rows as u64 * cols as u64 {
            let seen = data.len();
            return Err(
                self.fault(format!("says {rows}×{cols} but holds {seen} numbers; one of the two is wrong"))
            );
        }
        Ok(data)
    }

    /// Exactly `n` numbers.
    pub fn exactly(&self, n: usize, meaning: &str) -> Result<Vec<f64>, Fault> {
        let numbers = self.numbers()?;
        if numbers.len() != n {
            return Err(self.fault(format!("holds {} numbers; {n} are needed ({meaning})", numbers.len())));
        }
        Ok(numbers)
    }

    /// A rows × columns matrix of finite numbers, in any of the layouts of `numbers`.
    pub fn matrix(&self, rows: usize, columns: usize) -> Result<DMatrix<f64>, Fault> {
        self.check_shape(rows, columns)?;
        let numbers = self.exactly(rows * columns, &format!("a {rows}×{columns} matrix, row by row"))?;
        Ok(DMatrix::from_row_slice(rows, columns, &numbers))
    }

    fn check_shape(&self, rows: usize, columns: usize) -> Result<(), Fault> {
        let seen = match &self.node.value {
            Value::Map(_) => {
                Some((self.need("rows")?.count(0)? as usize, self.need("cols")?.count(0)? as usize))
            }
            Value::List(items) => match items.first().map(|n| &n.value) {
                Some(Value::List(row)) => Some((items.len(), row.len())),
                _ => None,
            },
            _ => None,
        };
        match seen {
            Some((r, c)) if (r, c) != (rows, columns) => {
                Err(self.fault(format!("is a {r}×{c} matrix; {rows}×{columns} is needed")))
            }
            _ => Ok(()),
        }
    }

    /// Refuses keys that our own files do not have, with the nearest one that they do.
    pub fn only(&self, known: &[&str]) -> Result<(), Fault> {
        for entry in self.entries()? {
            let key = entry.name().to_owned();
            if !known.contains(&key.as_str()) {
                return Err(entry.fault(unknown_key(&key, entry.number().ok(), known)));
            }
        }
        Ok(())
    }
}

fn not_a_number(text: &str) -> String {
    let comma = text.contains(',') && text.replace(',', ".").trim().parse::<f64>().is_ok();
    if comma {
        return format!("`{text}` has a decimal comma; write a point: {}", text.replace(',', "."));
    }
    let short: String = text.chars().take(40).collect();
    match text.trim().parse::<f64>() {
        Ok(_) => format!("`{short}` is text; write it without quotes"),
        Err(_) => format!("`{short}` is not a number"),
    }
}

/// Names of single coefficients that other programs give keys of their own.
pub(super) const COEFFICIENTS: [&str; 8] = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"];

/// Whether a key is the length of which another is the ratio: `tag_spacing_m` of `tag_spacing_ratio`.
fn is_length_of(key: &str, ratio: &str) -> bool {
    let stem = ratio.strip_suffix("ratio").unwrap_or(ratio);
    key.strip_prefix(stem).is_some_and(|unit| ["m", "mm", "cm"].contains(&unit))
        || key == stem.trim_end_matches('_')
}

fn unknown_key(key: &str, value: Option<f64>, known: &[&str]) -> String {
    if let Some(wanted) = in_metres(key, value, |wanted| known.contains(&wanted)) {
        return format!("unknown key: the unit is part of the name here; write {wanted}");
    }
    if let Some(wanted) = known.iter().find(|known| known.ends_with("_ratio") && is_length_of(key, known)) {
        return format!("unknown key; write `{wanted}`, the gap between tags over the edge of a tag");
    }
    if COEFFICIENTS.contains(&key) && known.contains(&"distortion") {
        return "unknown key: coefficients stand in one list; write `distortion = [k1, k2, p1, p2]` with all of them, in OpenCV's order".into();
    }
    if let Some(stem @ ("fx" | "fy" | "f")) = key.strip_suffix("_mm") {
        let wanted = format!("{stem}_px");
        if known.contains(&wanted.as_str()) {
            return format!(
                "unknown key: focal lengths are in pixels; write `{wanted}`, the millimetres times width_px over the width of the sensor in millimetres"
            );
        }
    }
    for unit in ["_m", "_px"] {
        let with_unit = format!("{key}{unit}");
        if let Some(right) = known.iter().find(|k| **k == with_unit) {
            let words = if unit == "_m" { "metres" } else { "pixels" };
            return format!("unknown key: the unit is part of the name here; write `{right}` ({words})");
        }
    }
    if key.contains("quat") || key == "rotation" || key == "rotation_xyzw" {
        return "the order of a quaternion must be in its name; write `rotation_wxyz = [w, x, y, z]`".into();
    }
    match nearest(key, known.iter().map(|known| known.to_string())) {
        Some(right) => format!("unknown key; did you mean `{right}`?"),
        None => format!("unknown key; the keys here are {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_left_out_is_named() {
        assert!(unknown_key("size", None, &["size_m", "id"]).contains("`size_m` (metres)"));
        assert!(unknown_key("size_mm", Some(160.0), &["size_m", "id"]).contains("`size_m = 0.16` (metres)"));
        assert!(unknown_key("fx", None, &["fx_px"]).contains("`fx_px` (pixels)"));
        assert!(unknown_key("k1", None, &["distortion"]).contains("`distortion = [k1, k2, p1, p2]`"));
        assert!(unknown_key("distorsion", None, &["distortion"]).contains("did you mean `distortion`"));
        assert!(unknown_key("quaternion", None, &["rotation_wxyz"]).contains("[w, x, y, z]"));
    }
}
