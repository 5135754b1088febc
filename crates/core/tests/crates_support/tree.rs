//! The modules of a crate, and which file each path leads to.

use super::source::{Import, code, imports, paths};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// A path of re-exports that continues longer than this leads nowhere.
const MAX_STEPS: usize = 20;

type Module = Vec<String>;

struct File {
    name: String,
    imports: Vec<Import>,
    code: String,
}

/// A crate's modules.
pub struct Tree {
    files: BTreeMap<Module, File>,
}

impl Tree {
    /// Of the sources below a folder, without files that only tests use.
    pub fn read(source: &Path) -> Self {
        let (mut files, mut folders) = (Vec::new(), vec![source.to_path_buf()]);
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).expect("a source folder") {
                let path = entry.expect("an entry").path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
                    let name =
                        path.strip_prefix(source).expect("below it").to_string_lossy().replace('\\', "/");
                    files.push((name, fs::read_to_string(&path).expect("a source")));
                }
            }
        }
        Tree::of(files.into_iter())
    }

    /// Of files by their names below the source folder.
    pub fn of(files: impl Iterator<Item = (String, String)>) -> Self {
        let file = |(name, text): (String, String)| {
            let (imports, code) = imports(&code(&text));
            (module(&name), File { name, imports, code })
        };
        Tree { files: files.map(file).collect() }
    }

    /// For every file those that it uses: by an import, or by a path in its code. What a file only passes on (`pub use`) it does not use;
    /// whoever takes it from there uses the file that it comes from.
    pub fn uses(&self) -> BTreeMap<String, BTreeSet<String>> {
        self.files.iter().map(|(module, file)| (file.name.clone(), self.uses_of(module, file))).collect()
    }

    fn uses_of(&self, module: &Module, file: &File) -> BTreeSet<String> {
        let paths = paths(&file.code);
        let is_named = |name: &str| paths.iter().any(|path| path[0] == name);
        let imported = file.imports.iter().filter(|import| !import.is_export || is_named(&import.name));
        // Of a module that is imported, what is taken out of it counts.
        let imported = imported.filter(|import| !self.is_module(module, &import.path));
        let written = paths.iter().filter(|path| 1 < path.len());
        let all = imported.map(|import| &import.path).chain(written);
        let found = all.filter_map(|path| self.file_of(module, path, MAX_STEPS));
        found.filter(|name| *name != file.name && !is_above(name, &file.name)).collect()
    }

    fn is_module(&self, from: &Module, path: &[String]) -> bool {
        self.walk(from, path, MAX_STEPS).is_some_and(|(_, rest)| rest.is_empty())
    }

    /// The file in which what a path names is written.
    fn file_of(&self, from: &Module, path: &[String], steps: usize) -> Option<String> {
        let (module, _) = self.walk(from, path, steps)?;
        self.files.get(&module).map(|file| file.name.clone())
    }

    /// The module that a path leads into, through re-exports, and what is left of the path there.
    fn walk(&self, from: &Module, path: &[String], steps: usize) -> Option<(Module, Vec<String>)> {
        let steps = steps.checked_sub(1)?;
        let (mut module, mut rest) = match path.first()?.as_str() {
            "crate" => (Vec::new(), &path[1..]),
            "self" => (from.clone(), &path[1..]),
            "super" => (from[..from.len().checked_sub(1)?].to_vec(), &path[1..]),
            first if self.child(from, first).is_some() => (from.clone(), path),
            first => {
                let import = self.files.get(from)?.imports.iter().find(|import| import.name == first)?;
                let whole = [&import.path, &path[1..]].concat();
                return (import.path[0] != first).then(|| self.walk(from, &whole, steps))?;
            }
        };
        while let Some(word) = rest.first() {
            if word == "super" {
                module.pop()?;
            } else if let Some(child) = self.child(&module, word) {
                module = child;
            } else {
                return self.exported(&module, rest, steps).unwrap_or_else(|| Some((module, rest.to_vec())));
            }
            rest = &rest[1..];
        }
        Some((module, Vec::new()))
    }

    /// What a module passes on under the first name of `rest`; none inside where that is of another crate.
    fn exported(
        &self,
        module: &Module,
        rest: &[String],
        steps: usize,
    ) -> Option<Option<(Module, Vec<String>)>> {
        let file = self.files.get(module)?;
        if let Some(import) = file.imports.iter().find(|import| import.name == rest[0]) {
            return Some(self.walk(module, &[&import.path, &rest[1..]].concat(), steps));
        }
        let all = file.imports.iter().filter(|import| import.name == "*" && import.is_export);
        let all = all.filter(|_| !defines(&file.code, &rest[0]));
        all.filter_map(|import| {
            let (found, left) = self.walk(module, &import.path[..import.path.len() - 1], steps)?;
            let text = &self.files.get(&found)?.code;
            (left.is_empty() && defines(text, &rest[0])).then(|| Some((found, rest.to_vec())))
        })
        .next()
    }

    fn child(&self, module: &Module, name: &str) -> Option<Module> {
        let child = [module.as_slice(), &[name.to_string()]].concat();
        self.files.contains_key(&child).then_some(child)
    }
}

fn defines(code: &str, name: &str) -> bool {
    ["fn", "struct", "enum", "trait", "type", "const", "static"].iter().any(|kind| {
        code.match_indices(&format!("{kind} {name}")).any(|(at, whole)| {
            !code[at + whole.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_')
        })
    })
}

/// `rig.rs` stands above `rig/job.rs`: a topic's own file may hold what the files below share.
fn is_above(name: &str, below: &str) -> bool {
    let folder = name.trim_end_matches(".rs");
    matches!(folder, "lib" | "main") || below.strip_prefix(folder).is_some_and(|rest| rest.starts_with('/'))
}

/// `rig/job.rs` is `rig::job`; `lib.rs` and `main.rs` are the crate itself.
fn module(name: &str) -> Module {
    match name.trim_end_matches(".rs") {
        "lib" | "main" => Vec::new(),
        other => other.trim_end_matches("/mod").split('/').map(str::to_string).collect(),
    }
}
