//! Rust source without what is not code: comments, texts, and what is for tests only.

/// The code alone; comments and what stands in quotes become blanks.
pub fn code(text: &str) -> String {
    let all: Vec<char> = text.chars().collect();
    let (mut code, mut i) = (String::new(), 0);
    while i < all.len() {
        let end = skipped(&all, i);
        if end == i {
            code.push(all[i]);
            i += 1;
        } else {
            code.push(' ');
            i = end;
        }
    }
    without_tests(&code)
}

/// Where the comment or text that begins at `i` ends; `i` itself where none begins.
fn skipped(all: &[char], i: usize) -> usize {
    let starts = |at: usize, word: &str| word.chars().enumerate().all(|(k, c)| all.get(at + k) == Some(&c));
    let find = |from: usize, word: &str| (from..all.len()).find(|at| starts(*at, word)).unwrap_or(all.len());
    let is_start = i == 0 || !(all[i - 1].is_alphanumeric() || all[i - 1] == '_');
    if starts(i, "//") {
        return find(i, "\n");
    }
    if starts(i, "/*") {
        return find(i, "*/") + 2;
    }
    let raw = if starts(i, "br") { i + 2 } else { i + 1 };
    if is_start && (starts(i, "r\"") || starts(i, "r#") || starts(i, "br\"") || starts(i, "br#")) {
        let hashes = (raw..all.len()).take_while(|at| all[*at] == '#').count();
        if all.get(raw + hashes) == Some(&'"') {
            let end = format!("\"{}", "#".repeat(hashes));
            return find(raw + hashes + 1, &end) + end.len();
        }
    }
    match all[i] {
        '"' => quoted(all, i, '"'),
        // A lifetime has no second quote.
        '\'' if all.get(i + 1) == Some(&'\\') => quoted(all, i, '\''),
        '\'' if all.get(i + 2) == Some(&'\'') => i + 3,
        _ => i,
    }
}

fn quoted(all: &[char], from: usize, quote: char) -> usize {
    let mut at = from + 1;
    while at < all.len() && all[at] != quote {
        at += if all[at] == '\\' { 2 } else { 1 };
    }
    at + 1
}

/// Without the items that `#[cfg(test)]` marks.
fn without_tests(code: &str) -> String {
    let (mut kept, mut rest) = (String::new(), code);
    while let Some((before, after)) = rest.split_once("#[cfg(test)]") {
        kept.push_str(before);
        let mut depth = 0;
        let end = after.char_indices().find(|(_, c)| {
            depth += i32::from(*c == '{') - i32::from(*c == '}');
            depth == 0 && (*c == ';' || *c == '}')
        });
        rest = end.map_or("", |(at, _)| &after[at + 1..]);
    }
    kept + rest
}

/// An import: what it is called here, and the path it stands for. `*` for all of a module.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    pub name: String,
    pub path: Vec<String>,
    /// `pub`, or `pub(…)`.
    pub is_export: bool,
}

/// The imports of a file, and its code without them.
pub fn imports(code: &str) -> (Vec<Import>, String) {
    let (mut imports, mut rest, mut others) = (Vec::new(), code, String::new());
    while let Some(at) = next_use(rest) {
        let (before, after) = (&rest[..at], &rest[at + "use ".len()..]);
        let item = before.rsplit([';', '}', '{', ']']).next().unwrap_or("").trim();
        let is_export = item.starts_with("pub");
        others.push_str(before);
        let (tree, behind) = after.split_once(';').unwrap_or((after, ""));
        expand(tree.trim(), &[], is_export, &mut imports);
        rest = behind;
    }
    (imports, without_modules(&(others + rest)))
}

/// Without `mod name;`, which names a file but does not use it.
fn without_modules(code: &str) -> String {
    code.split_inclusive(';')
        .map(|part| {
            part.rfind("mod ").map_or(part, |at| {
                let name = part[at + 4..].trim_end_matches(';').trim();
                let is_name = name.chars().all(|c| c.is_alphanumeric() || c == '_');
                if is_name && part.ends_with(';') { &part[..at] } else { part }
            })
        })
        .collect()
}

fn next_use(code: &str) -> Option<usize> {
    code.match_indices("use ").map(|(at, _)| at).find(|at| {
        let before = code[..*at].chars().next_back();
        before.is_none_or(|c| c.is_whitespace() || c == ';' || c == '}' || c == '{')
    })
}

fn expand(tree: &str, before: &[String], is_export: bool, imports: &mut Vec<Import>) {
    if let Some(list) = tree.strip_prefix('{') {
        let list = list.trim_end().strip_suffix('}').unwrap_or(list);
        split_list(list).into_iter().for_each(|item| expand(item, before, is_export, imports));
        return;
    }
    match tree.split_once("::") {
        Some((first, rest)) if !first.contains(' ') => {
            let path = [before, &[first.trim().to_string()]].concat();
            expand(rest.trim(), &path, is_export, imports);
        }
        _ => {
            let (last, name) =
                tree.split_once(" as ").map_or((tree, None), |(last, name)| (last, Some(name)));
            let (last, mut path) = (last.trim(), before.to_vec());
            if last.is_empty() {
                return;
            }
            if last != "self" || path.is_empty() {
                path.push(last.to_string());
            }
            let name =
                name.map_or_else(|| path.last().cloned().unwrap_or_default(), |n| n.trim().to_string());
            imports.push(Import { name, path, is_export });
        }
    }
}

fn split_list(list: &str) -> Vec<&str> {
    let (mut items, mut depth, mut from) = (Vec::new(), 0, 0);
    for (at, c) in list.char_indices() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if c == ',' && depth == 0 {
            items.push(list[from..at].trim());
            from = at + 1;
        }
    }
    items.push(list[from..].trim());
    items.retain(|item| !item.is_empty());
    items
}

/// Every path of two words and more in code without imports, and every single word with a capital or after none.
pub fn paths(code: &str) -> Vec<Vec<String>> {
    let (mut found, mut path, mut word) = (Vec::new(), Vec::new(), String::new());
    let all: Vec<char> = code.chars().chain([' ']).collect();
    let mut i = 0;
    while i < all.len() {
        if all[i].is_alphanumeric() || all[i] == '_' {
            word.push(all[i]);
        } else if all[i] == ':' && all.get(i + 1) == Some(&':') && !word.is_empty() {
            path.push(std::mem::take(&mut word));
            i += 1;
        } else {
            if !word.is_empty() {
                path.push(std::mem::take(&mut word));
            }
            if !path.is_empty() {
                found.push(std::mem::take(&mut path));
            }
        }
        i += 1;
    }
    found
}
