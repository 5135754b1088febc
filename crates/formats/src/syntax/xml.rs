//! XML, through `roxmltree` (no DTD, so no entity bombs): OpenCV's FileStorage, URDF, ROS launch files, Metashape's cameras and lensfun's profiles.

use crate::tree::{Fault, MAX_DEPTH, Node, Value, map_of};

/// The tree below `<opencv_storage>` as OpenCV means it; of the others each element is a table of `element`
/// (its name), `@NAME` (attributes), `text` where it holds some, and `children` (a list).
pub(crate) fn parse(text: &str) -> Result<Node, Fault> {
    let options = roxmltree::ParsingOptions { allow_dtd: false, nodes_limit: 1 << 16, ..Default::default() };
    let text = without_doctype(text);
    let document = roxmltree::Document::parse_with_options(&text, options)
        .map_err(|e| Fault::at(e.pos().row as usize, format!("not valid XML: {e}")))?;
    let root = document.root_element();
    match root.tag_name().name() {
        "opencv_storage" => node_of(&document, root, MAX_DEPTH),
        "robot" | "launch" | "document" | "calibration" | "lensdatabase" => {
            element(&document, root, MAX_DEPTH)
        }
        name => Err(Fault::at(
            1,
            format!(
                "XML of `{name}`; of XML OpenCV's `opencv_storage`, URDF's `robot`, ROS's `launch`, Metashape's `document` and \
                    `calibration` and lensfun's `lensdatabase` are read"
            ),
        )),
    }
}

/// A declaration that names a DTD elsewhere changes nothing, and is blanked; one that holds a DTD stays, and is refused.
fn without_doctype(text: &str) -> std::borrow::Cow<'_, str> {
    let declared = text.find("<!DOCTYPE").and_then(|from| Some((from, from + text[from..].find('>')? + 1)));
    match declared {
        Some((from, to)) if !text[from..to].contains('[') => {
            let blank: String = text[from..to].chars().map(|c| if c == '\n' { c } else { ' ' }).collect();
            [&text[..from], &blank, &text[to..]].concat().into()
        }
        _ => text.into(),
    }
}

fn element(
    document: &roxmltree::Document<'_>,
    element_node: roxmltree::Node<'_, '_>,
    depth: usize,
) -> Result<Node, Fault> {
    let line = line_of(document, element_node);
    if depth == 0 {
        return Err(too_deep(line));
    }
    let name = Value::Text(element_node.tag_name().name().to_owned());
    let mut entries = vec![("element".to_owned(), Node { line, value: name })];
    for attribute in element_node.attributes() {
        let at = document.text_pos_at(attribute.range().start).row as usize;
        let value = Value::Text(attribute.value().to_owned());
        entries.push((format!("@{}", attribute.name()), Node { line: at, value }));
    }
    if let Some(text) = element_node.text().map(str::trim).filter(|text| !text.is_empty()) {
        entries.push(("text".to_owned(), Node { line, value: Value::Text(text.to_owned()) }));
    }
    let children = element_node.children().filter(roxmltree::Node::is_element);
    let children = children.map(|c| element(document, c, depth - 1)).collect::<Result<Vec<_>, Fault>>()?;
    entries.push(("children".to_owned(), Node { line, value: Value::List(children) }));
    map_of(line, entries)
}

fn line_of(document: &roxmltree::Document<'_>, element: roxmltree::Node<'_, '_>) -> usize {
    document.text_pos_at(element.range().start).row as usize
}

fn too_deep(line: usize) -> Fault {
    Fault::at(line, format!("nested deeper than {MAX_DEPTH} levels"))
}

fn node_of(
    document: &roxmltree::Document<'_>,
    element: roxmltree::Node<'_, '_>,
    depth: usize,
) -> Result<Node, Fault> {
    let line = line_of(document, element);
    if depth == 0 {
        return Err(too_deep(line));
    }
    let children: Vec<_> = element.children().filter(roxmltree::Node::is_element).collect();
    if children.is_empty() {
        return Ok(Node { line, value: leaf(element.text().unwrap_or_default(), line) });
    }
    let mut entries = Vec::with_capacity(children.len());
    for child in children {
        entries.push((child.tag_name().name().to_owned(), node_of(document, child, depth - 1)?));
    }
    if entries.iter().all(|(name, _)| name == "_") {
        return Ok(Node { line, value: Value::List(entries.into_iter().map(|(_, node)| node).collect()) });
    }
    map_of(line, entries)
}

/// Several numbers are a list, one is a number, anything else is text (quoted or not).
fn leaf(text: &str, line: usize) -> Value {
    let words: Vec<&str> = text.split_whitespace().collect();
    let numbers: Option<Vec<f64>> = words.iter().map(|w| number(w)).collect();
    match numbers.as_deref() {
        _ if words.is_empty() => Value::Null,
        Some([x]) => Value::Number(*x),
        Some(many) => Value::List(many.iter().map(|x| Node { line, value: Value::Number(*x) }).collect()),
        None => Value::Text(text.trim().trim_matches('"').to_owned()),
    }
}

/// OpenCV spells the non-finite ones `.Nan` and `.Inf`.
fn number(word: &str) -> Option<f64> {
    let lower = word.to_ascii_lowercase();
    match lower.as_str() {
        ".nan" => Some(f64::NAN),
        ".inf" => Some(f64::INFINITY),
        "-.inf" => Some(f64::NEG_INFINITY),
        _ => word.parse().ok(),
    }
}
