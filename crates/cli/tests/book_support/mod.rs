//! Pages of the book as data: the commands that they tell the reader to run with the text that they show, and their links.

use crate::support::same;
use std::path::{Path, PathBuf};

/// The root of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// A command line as a shell takes it, and how it ends.
#[derive(Debug, PartialEq)]
pub struct Command {
    pub line: String,
    pub end: End,
}

/// How a command ends, by the remark behind it; without one with status 0.
#[derive(Debug, PartialEq)]
pub enum End {
    /// `# exit status 3`.
    Status(i32),
    /// `# until Ctrl-C`, which ends it with status 0.
    Interrupted,
}

impl Command {
    /// None where the line is for a build tool. `cargo run --release -- demo` is the program itself.
    fn of(line: &str) -> Option<Command> {
        let (line, remark) = line.split_once(" #").unwrap_or((line, ""));
        let line = line.trim().replace("cargo run --release --", "resight");
        let end = match remark.trim() {
            "until Ctrl-C" => End::Interrupted,
            remark => {
                End::Status(remark.strip_prefix("exit status ").map_or(0, |n| n.trim().parse().unwrap()))
            }
        };
        let is_for_tools =
            ["cargo ", "pip ", "git ", "./test.sh", "benches/"].iter().any(|tool| line.starts_with(tool));
        (!line.is_empty() && !is_for_tools).then_some(Command { line, end })
    }

    /// Runs it in a folder; returns what it prints.
    pub fn run(&self, folder: &Path) -> String {
        let program = assert_cmd::cargo::cargo_bin("resight");
        let path = std::env::var("PATH").unwrap_or_default();
        let path = format!("{}:{path}", program.parent().unwrap().display());
        let mut shell = std::process::Command::new("sh");
        let is_interrupted = self.end == End::Interrupted;
        let line = if is_interrupted { format!("exec {}", self.line) } else { self.line.clone() };
        shell.args(["-c", &line]).current_dir(folder).env("PATH", path);
        shell.stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped());
        let process = shell.spawn().unwrap();
        if is_interrupted {
            std::thread::sleep(std::time::Duration::from_secs(3));
            let pid = process.id().to_string();
            std::process::Command::new("kill").args(["-INT", &pid]).status().unwrap();
        }
        let run = process.wait_with_output().unwrap();
        let [said, complaint] = [&run.stdout, &run.stderr].map(|text| String::from_utf8_lossy(text));
        let code = if let End::Status(code) = self.end { code } else { 0 };
        assert_eq!(run.status.code(), Some(code), "{}\n{said}{complaint}", self.line);
        said.into_owned()
    }
}

/// Runs the commands of a page in a folder, where they print what the page shows; returns the numbers of commands and of answers shown.
pub fn follow(page: &str, folder: &Path) -> [usize; 2] {
    let (mut printed, mut runs, mut shown_answers) = (String::new(), 0, 0);
    for piece in pieces(page) {
        match piece {
            Piece::File { name, text } => std::fs::write(folder.join(name), text).unwrap(),
            Piece::Commands(commands) => {
                runs += commands.len();
                printed = commands.iter().map(|command| command.run(folder)).collect();
            }
            Piece::Printed(shown) => {
                let (p, s): (Vec<&str>, Vec<&str>) =
                    (printed.trim_end().lines().collect(), shown.lines().collect());
                assert!(is_shown(&p, &s), "printed\n{printed}\nshown\n{shown}");
                shown_answers += 1;
            }
        }
    }
    [runs, shown_answers]
}

/// What a page says in the order in which it says it.
#[derive(Debug, PartialEq)]
pub enum Piece {
    /// A block of another language with a name behind it (`csv points.csv`): a file that the reader writes.
    File { name: String, text: String },
    /// The commands of a block `sh`, or of the cell of a table.
    Commands(Vec<Command>),
    /// A block `text` directly after a block `sh`: what its commands print. A line `…` stands for any lines.
    Printed(String),
}

pub fn pieces(page: &str) -> Vec<Piece> {
    let mut found = Vec::new();
    let mut lines = page.lines();
    let mut follows_commands = false;
    while let Some(line) = lines.next() {
        let Some(language) = line.strip_prefix("```") else {
            let cells = line.strip_prefix('|').unwrap_or("").split('`').skip(1).step_by(2);
            let commands = cells.filter(|cell| cell.starts_with("resight ") && 2 < cell.split(' ').count());
            follows_commands &= line.is_empty();
            found.extend(commands.map(|cell| Piece::Commands(Command::of(cell).into_iter().collect())));
            continue;
        };
        let block: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
        match language {
            "sh" => {
                let text = block.join("\n").replace("\\\n", " ");
                found.push(Piece::Commands(text.lines().filter_map(Command::of).collect()));
            }
            "text" if follows_commands => found.push(Piece::Printed(block.join("\n"))),
            file => found.extend(
                file.split_once(' ')
                    .map(|(_, name)| Piece::File { name: name.to_owned(), text: block.join("\n") + "\n" }),
            ),
        }
        follows_commands = language == "sh";
    }
    found
}

/// Whether what was printed is what a page shows, `…` standing for any lines.
pub fn is_shown(printed: &[&str], shown: &[&str]) -> bool {
    match shown.split_first() {
        None => printed.is_empty(),
        Some((first, rest)) if first.trim() == "…" => {
            (0..=printed.len()).any(|n| is_shown(&printed[n..], rest))
        }
        Some((first, rest)) => {
            printed.split_first().is_some_and(|(p, more)| same(p, first) && is_shown(more, rest))
        }
    }
}

/// Every page of the repository.
pub fn pages() -> Vec<PathBuf> {
    let mut folders = vec![root()];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && !["target", "node_modules"].contains(&name.as_str()) && !name.starts_with('.')
            {
                folders.push(path);
            } else if name.ends_with(".md") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The prose of a page: without fenced blocks and without code in backticks.
pub fn prose(page: &str) -> String {
    let outside = page.split("```").step_by(2);
    outside.map(|text| text.split('`').step_by(2).collect::<String>()).collect()
}

/// Where the links and images of a page lead, those to other hosts left out.
pub fn links(page: &str) -> Vec<String> {
    let text = prose(page);
    let linked = text.split("](").skip(1).filter_map(|rest| rest.split_once(')').map(|(link, _)| link));
    let drawn =
        text.split("<img src=\"").skip(1).filter_map(|rest| rest.split_once('"').map(|(link, _)| link));
    let is_here = |link: &&str| !link.contains("://") && !link.starts_with("mailto:");
    linked.chain(drawn).filter(is_here).map(str::to_string).collect()
}

/// The anchors of a page's headings, as GitHub makes them.
pub fn anchors(page: &str) -> Vec<String> {
    let outside: String = page.split("```").step_by(2).collect();
    let anchor = |heading: &str| -> String {
        let kept = heading.trim().to_lowercase();
        let kept = kept.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    let headings = outside.lines().filter(|line| line.starts_with('#'));
    headings.map(|line| anchor(line.trim_start_matches('#'))).collect()
}

/// The sources of all crates as one text, strings that are broken over lines joined as the compiler joins them.
pub fn sources() -> String {
    let mut folders: Vec<PathBuf> = ["core", "formats", "recording", "resight", "watch", "whisker", "cli"]
        .map(|c| root().join("crates").join(c).join("src"))
        .to_vec();
    let mut text = String::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let source = std::fs::read_to_string(&path).unwrap_or_default();
                let mut parts = source.split("\\\n");
                text += parts.next().unwrap_or_default();
                parts.for_each(|part| text += part.trim_start());
            }
        }
    }
    text
}
