//! An HTML page taken apart by hand: tags in pairs, attributes in quotes, and what a reader of the page would find.

/// Elements that have no end.
const VOID: [&str; 5] = ["meta", "input", "br", "img", "hr"];

/// What was found in a page.
#[derive(Debug, Default)]
pub struct Parsed {
    /// Element names with their attributes, in order.
    pub elements: Vec<(String, Vec<(String, String)>)>,
    /// Text outside scripts and styles, entities decoded.
    pub text: String,
    /// Contents of scripts: whether it is data, and the text.
    pub scripts: Vec<(bool, String)>,
}

/// Takes a page apart; says where it is not well formed.
pub fn parse(html: &str) -> Result<Parsed, String> {
    let mut parsed = Parsed::default();
    let mut open: Vec<String> = Vec::new();
    let mut rest = html.strip_prefix("<!doctype html>").ok_or("no doctype")?;
    while let Some(at) = rest.find('<') {
        push_text(&mut parsed, &rest[..at])?;
        let end = tag_end(&rest[at..]).ok_or_else(|| format!("tag without end: {}", start(&rest[at..])))?;
        let tag = &rest[at + 1..at + end];
        rest = &rest[at + end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            let opened = open.pop();
            if opened.as_deref() != Some(name) {
                return Err(format!("</{name}> closes {opened:?}"));
            }
            continue;
        }
        let (element, is_closed) = element(tag)?;
        let name = element.0.clone();
        let is_data = element.1.iter().any(|(key, value)| key == "type" && value == "application/json");
        parsed.elements.push(element);
        if name == "script" || name == "style" {
            let close = format!("</{name}>");
            let end = rest.find(&close).ok_or_else(|| format!("{name} without end"))?;
            if name == "script" {
                parsed.scripts.push((is_data, rest[..end].to_string()));
            }
            rest = &rest[end + close.len()..];
        } else if !is_closed && !VOID.contains(&name.as_str()) {
            open.push(name);
        }
    }
    push_text(&mut parsed, rest)?;
    if open.is_empty() { Ok(parsed) } else { Err(format!("never closed: {open:?}")) }
}

/// Enough of a text to find it by.
fn start(text: &str) -> String {
    text.chars().take(60).collect()
}

/// The `>` that ends a tag, not one inside quotes.
fn tag_end(text: &str) -> Option<usize> {
    let mut is_quoted = false;
    text.char_indices().find_map(|(i, c)| {
        is_quoted ^= c == '"';
        (c == '>' && !is_quoted).then_some(i)
    })
}

type Element = (String, Vec<(String, String)>);

fn element(tag: &str) -> Result<(Element, bool), String> {
    let is_closed = tag.ends_with('/');
    let mut rest = tag.trim_end_matches('/');
    let name_end = rest.find(' ').unwrap_or(rest.len());
    let name = rest[..name_end].to_string();
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric()) {
        return Err(format!("no name of an element: <{tag}>"));
    }
    rest = rest[name_end..].trim_start();
    let mut attributes = Vec::new();
    while !rest.is_empty() {
        let end = rest.find([' ', '=']).unwrap_or(rest.len());
        let key = rest[..end].to_string();
        if attributes.iter().any(|(k, _)| *k == key) || key.contains(['"', '<', '\'']) {
            return Err(format!("attribute {key} of <{tag}>"));
        }
        rest = &rest[end..];
        let mut value = String::new();
        if let Some(quoted) = rest.strip_prefix("=\"") {
            let end = quoted.find('"').ok_or_else(|| format!("quote without end in <{tag}>"))?;
            value = decoded(&quoted[..end])?;
            rest = &quoted[end + 1..];
        } else if rest.starts_with('=') {
            return Err(format!("value without quotes in <{tag}>"));
        }
        attributes.push((key, value));
        rest = rest.trim_start();
    }
    Ok(((name, attributes), is_closed))
}

fn push_text(parsed: &mut Parsed, text: &str) -> Result<(), String> {
    if text.contains('>') {
        return Err(format!("a stray > in {text:?}"));
    }
    parsed.text.push_str(&decoded(text)?);
    parsed.text.push('\n');
    Ok(())
}

fn decoded(text: &str) -> Result<String, String> {
    let mut rest = text;
    while let Some(at) = rest.find('&') {
        rest = &rest[at + 1..];
        if !["amp;", "lt;", "gt;", "quot;"].iter().any(|known| rest.starts_with(known)) {
            return Err(format!("a stray & before {:?}", start(rest)));
        }
    }
    Ok(text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&"))
}
