//! What the sources of the server promise: nothing that answers requests waits for a lock of the standard library.

use std::path::{Path, PathBuf};

fn sources(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, all);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            all.push(path);
        }
    }
}

/// The bodies of `async fn`, `async {…}` and `async move {…}`, without those of closures that are given to a thread of their own.
fn on_workers(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    for (at, _) in text.match_indices("async ") {
        let rest = &text[at..];
        let Some(open) = rest.find('{') else { continue };
        let mut depth = 0;
        let end = rest[open..].char_indices().find(|(_, c)| {
            depth += match c {
                '{' => 1,
                '}' => -1,
                _ => 0,
            };
            depth == 0
        });
        let Some((end, _)) = end else { continue };
        all.push(without_asides(&rest[open..=open + end]));
    }
    all
}

/// What is given to `aside(…)`, `ask(…)` and `change(…)` runs elsewhere.
fn without_asides(body: &str) -> String {
    let mut rest = body.to_owned();
    for call in ["aside(", "ask(", "change("] {
        while let Some(at) = rest.find(call) {
            let mut depth = 0;
            let end = rest[at..].char_indices().find(|(_, c)| {
                depth += match c {
                    '(' => 1,
                    ')' => -1,
                    _ => 0,
                };
                depth == 0 && *c == ')'
            });
            let end = end.map_or(rest.len(), |(end, _)| at + end + 1);
            rest.replace_range(at..end, "…");
        }
    }
    rest
}

/// A lock that is taken in an `async fn` stops every request of its thread while another thread holds it.
#[test]
fn async_functions_take_no_locks() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(&here.join("src"), &mut files);
    sources(&here.join("../watch/src/web"), &mut files);
    files.push(here.join("../watch/src/web.rs"));
    let mut seen = 0;
    for file in files {
        let text = std::fs::read_to_string(&file).expect("a source");
        let text = text.split("#[cfg(test)]").next().unwrap_or_default();
        for body in on_workers(text) {
            seen += 1;
            for lock in [".lock()", ".read()", ".write()", "locked(", ".board()", ".view()", "blocking_"] {
                // `now` of a shared session is kept brief by the type: it clones an `Arc`.
                assert!(!body.contains(lock), "{}: `{lock}` in\n{body}", file.display());
            }
        }
    }
    assert!(30 < seen, "only {seen} seen");
    let wrong = "async fn f() { let x = aside(move || live.view()); s.lock(); }";
    assert!(on_workers(wrong)[0].contains(".lock()") && !on_workers(wrong)[0].contains(".view()"));
}
