//! YAML, through `serde-saphyr`: it reads OpenCV's `%YAML:1.0` header and `!!opencv-matrix` tags unmodified, spells
//! `.Nan` as OpenCV does, and has budgets against documents that expand beyond their size.

use crate::tree::{Fault, MAX_DEPTH, Node, Value, map_of};
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Spanned;

/// Nodes accepted; a 1 MiB file of numbers has about half as many.
const MAX_NODES: usize = 1 << 19;

/// The tree of a YAML text with one document.
pub(crate) fn parse(text: &str) -> Result<Node, Fault> {
    // `ros2 topic echo` ends each message with a separator that would open a second, empty document.
    let text = text.trim_end().trim_end_matches("---");
    // OpenVINS takes OpenCV's header without the `---` that YAML wants after it; as a comment it does no harm.
    let headless = text.strip_prefix("%YAML").map(|rest| format!("#YAML{rest}"));
    let text = headless.as_deref().unwrap_or(text);
    let raw: Spanned<Raw> = serde_saphyr::from_str_with_options(text, options()).map_err(fault_of)?;
    node_of(raw)
}

fn options() -> serde_saphyr::Options {
    serde_saphyr::options! {
        budget: serde_saphyr::budget! {
            max_depth: MAX_DEPTH,
            max_nodes: MAX_NODES,
            max_events: 2 * MAX_NODES,
            max_aliases: 64,
            max_anchors: 64,
            max_documents: 1,
        },
        // The largest honest use of aliases is one board or matrix named twice.
        alias_limits: serde_saphyr::alias_limits! {
            max_total_replayed_events: 4096,
            max_replay_stack_depth: 8,
            max_alias_expansions_per_anchor: 16,
        },
        // A failed calibration writes `.Nan`; the refusal with the key's name comes later.
        non_finite_float_policy: serde_saphyr::NonFiniteFloatPolicy::PassThrough,
        with_snippet: false,
    }
}

fn fault_of(error: serde_saphyr::Error) -> Fault {
    let line = error.location().map_or(0, |at| at.line() as usize);
    let message = error.to_string();
    let first = message.lines().next().unwrap_or_default();
    Fault::at(line, format!("not valid YAML: {first}"))
}

/// Any value, its children with their places.
enum Raw {
    Null,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Spanned<Raw>>),
    Map(Vec<(Spanned<String>, Spanned<Raw>)>),
}

fn node_of(raw: Spanned<Raw>) -> Result<Node, Fault> {
    let line = raw.referenced.line() as usize;
    let value = match raw.value {
        Raw::Null => Value::Null,
        Raw::Bool(flag) => Value::Bool(flag),
        Raw::Number(x) => Value::Number(x),
        Raw::Text(text) => Value::Text(text),
        Raw::List(items) => Value::List(items.into_iter().map(node_of).collect::<Result<_, _>>()?),
        Raw::Map(entries) => {
            let entries = entries.into_iter().map(|(key, value)| {
                let at = key.referenced.line() as usize;
                node_of(value).map(|node| (key.value, Node { line: at, ..node }))
            });
            return map_of(line, entries.collect::<Result<_, _>>()?);
        }
    };
    Ok(Node { line, value })
}

impl<'de> Deserialize<'de> for Raw {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(RawVisitor)
    }
}

struct RawVisitor;

impl<'de> Visitor<'de> for RawVisitor {
    type Value = Raw;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("any YAML value")
    }

    fn visit_unit<E>(self) -> Result<Raw, E> {
        Ok(Raw::Null)
    }

    fn visit_none<E>(self) -> Result<Raw, E> {
        Ok(Raw::Null)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Raw, D::Error> {
        Raw::deserialize(deserializer)
    }

    fn visit_bool<E>(self, flag: bool) -> Result<Raw, E> {
        Ok(Raw::Bool(flag))
    }

    fn visit_i64<E>(self, x: i64) -> Result<Raw, E> {
        Ok(Raw::Number(x as f64))
    }

    fn visit_u64<E>(self, x: u64) -> Result<Raw, E> {
        Ok(Raw::Number(x as f64))
    }

    fn visit_i128<E>(self, x: i128) -> Result<Raw, E> {
        Ok(Raw::Number(x as f64))
    }

    fn visit_u128<E>(self, x: u128) -> Result<Raw, E> {
        Ok(Raw::Number(x as f64))
    }

    fn visit_f64<E>(self, x: f64) -> Result<Raw, E> {
        Ok(Raw::Number(x))
    }

    fn visit_str<E>(self, text: &str) -> Result<Raw, E> {
        Ok(Raw::Text(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Raw, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(Raw::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Raw, A::Error> {
        let mut map = Vec::new();
        while let Some(entry) = entries.next_entry()? {
            map.push(entry);
        }
        Ok(Raw::Map(map))
    }
}
