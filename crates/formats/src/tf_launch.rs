//! The arguments of every `static_transform_publisher` in a launch file (Python, XML) or a shell script.
//!
//! Only what is written out is read: expressions and substitutions are refused where they stand.

use super::document::{Document, Fault, Node, Syntax};
use super::entry::Entry;

pub(super) const PUBLISHER: &str = "static_transform_publisher";

/// One publisher: its arguments and the line it stands on.
pub(super) struct Command {
    pub line: usize,
    pub words: Vec<String>,
}

impl Command {
    pub fn fault(&self, reason: impl std::fmt::Display) -> Fault {
        Fault::at(self.line, format!("{PUBLISHER}: {reason}"))
    }
}

/// Every publisher of a file; at least one.
pub(super) fn commands(document: &Document) -> Result<Vec<Command>, Fault> {
    let found = match document.syntax {
        Syntax::Xml => xml_commands(&document.entry())?,
        _ if document.text.contains("LaunchDescription") => python_commands(&document.text)?,
        _ => shell_commands(&document.text),
    };
    if found.is_empty() {
        return Err(Fault::new(format!("no {PUBLISHER} in this file, so it states no pose")));
    }
    Ok(found)
}

fn xml_commands(element: &Entry<'_>) -> Result<Vec<Command>, Fault> {
    let mut found = Vec::new();
    let is_publisher = ["@exec", "@type"]
        .iter()
        .any(|key| element.get(key).is_some_and(|e| e.text().is_ok_and(|t| t == PUBLISHER)));
    if is_publisher {
        let args = element.need("@args").map_err(|_| element.fault("the attribute `args` is missing"))?;
        let command = Command { line: args.node.line, words: words(args.text()?) };
        if args.text()?.contains('$') {
            return Err(command.fault("its args hold a substitution, $(…); write the values out"));
        }
        found.push(command);
    }
    for child in element.need("children")?.items()? {
        found.extend(xml_commands(&child)?);
    }
    Ok(found)
}

fn words(text: &str) -> Vec<String> {
    let unquoted = |w: &str| w.trim_matches(|c| matches!(c, '"' | '\'')).to_owned();
    text.split_whitespace().map(unquoted).filter(|w| !w.is_empty()).collect()
}

/// A command a line; a backslash at its end continues it.
fn shell_commands(text: &str) -> Vec<Command> {
    let mut found = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((i, line)) = lines.next() {
        let mut whole = line.to_owned();
        while let Some(rest) = whole.trim_end().strip_suffix('\\') {
            let (_, next) = lines.next().unwrap_or_default();
            whole = format!("{rest} {next}");
        }
        let code = whole.split('#').next().unwrap_or_default();
        if let Some((_, arguments)) = code.split_once(PUBLISHER) {
            let end = arguments.find(['&', ';', '|']).unwrap_or(arguments.len());
            found.push(Command { line: i + 1, words: words(&arguments[..end]) });
        }
    }
    found
}

#[derive(Debug, Clone, PartialEq)]
enum Token {
    Text(String),
    Number(String),
    Name(String),
    Mark(char),
}

/// Each call around the string "static_transform_publisher" gives its `arguments=[…]`.
fn python_commands(text: &str) -> Result<Vec<Command>, Fault> {
    let tokens = python_tokens(text);
    let mut found = Vec::new();
    for (at, (line, token)) in tokens.iter().enumerate() {
        if *token != Token::Text(PUBLISHER.to_owned()) {
            continue;
        }
        let call = call_around(&tokens, at);
        let mut command = Command { line: *line, words: Vec::new() };
        let start = call.iter().position(|(_, t)| *t == Token::Name("arguments".into()));
        let list = start.map(|i| &call[i + 1..]).unwrap_or_default();
        let [(_, Token::Mark('=')), (_, Token::Mark('[')), items @ ..] = list else {
            return Err(command.fault("`arguments=[…]` with the values written out is missing"));
        };
        for (line, item) in items.iter().take_while(|(_, t)| *t != Token::Mark(']')) {
            match item {
                Token::Text(word) | Token::Number(word) => command.words.push(word.clone()),
                Token::Mark(',') => {}
                Token::Mark('-') => command.words.push("-".into()),
                Token::Name(name) => return Err(expression(*line, name)),
                Token::Mark(mark) => return Err(expression(*line, &mark.to_string())),
            }
        }
        found.push(signed(command));
    }
    Ok(found)
}

fn expression(line: usize, what: &str) -> Fault {
    Fault::at(line, format!("{PUBLISHER}: `{what}` in its arguments is an expression; write the value out"))
}

/// A minus sign is a token of its own.
fn signed(command: Command) -> Command {
    let mut words: Vec<String> = Vec::new();
    for word in command.words {
        match words.last_mut() {
            Some(last) if last == "-" => last.push_str(&word),
            _ => words.push(word),
        }
    }
    Command { words, ..command }
}

/// The tokens inside the innermost parentheses around one.
fn call_around(tokens: &[(usize, Token)], at: usize) -> &[(usize, Token)] {
    let mut depth = 0;
    let start = tokens[..at].iter().rposition(|(_, t)| {
        depth += i32::from(*t == Token::Mark(')')) - i32::from(*t == Token::Mark('('));
        depth < 0
    });
    let mut depth = 0;
    let end = tokens[at..].iter().position(|(_, t)| {
        depth += i32::from(*t == Token::Mark('(')) - i32::from(*t == Token::Mark(')'));
        depth < 0
    });
    &tokens[start.map_or(0, |i| i + 1)..end.map_or(tokens.len(), |i| at + i)]
}

/// Strings (plain), numbers, names and marks, with their lines; comments left out.
fn python_tokens(text: &str) -> Vec<(usize, Token)> {
    let mut tokens = Vec::new();
    let mut line = 1;
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = match c {
            '#' => rest.find('\n').unwrap_or(rest.len()),
            '"' | '\'' => {
                let (token, length) = python_string(rest, c);
                tokens.push((line, token));
                length
            }
            c if c.is_alphanumeric() || matches!(c, '_' | '.') => {
                let length = word_length(rest);
                let word = rest[..length].to_owned();
                let numeric = word.parse::<f64>().is_ok();
                tokens.push((line, if numeric { Token::Number(word) } else { Token::Name(word) }));
                length
            }
            c if c.is_whitespace() => c.len_utf8(),
            mark => {
                tokens.push((line, Token::Mark(mark)));
                mark.len_utf8()
            }
        };
        line += rest[..length].matches('\n').count();
        rest = &rest[length..];
    }
    tokens
}

/// `1.5e-3` is one word: the sign belongs to the exponent of a number.
fn word_length(rest: &str) -> usize {
    let part = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.');
    let length = rest.find(|c| !part(c)).unwrap_or(rest.len());
    let starts_like_number = rest.starts_with(|c: char| c.is_ascii_digit() || c == '.');
    if starts_like_number && rest[..length].ends_with(['e', 'E']) && rest[length..].starts_with(['-', '+']) {
        return length
            + 1
            + rest[length + 1..].find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len() - length - 1);
    }
    length
}

/// One string and its length in bytes with the quotes; three quotes make it a comment or a long text.
fn python_string(rest: &str, quote: char) -> (Token, usize) {
    let long = quote.to_string().repeat(3);
    if let Some(inner) = rest.strip_prefix(&long) {
        let end = inner.find(&long).map_or(rest.len(), |i| i + 6);
        return (Token::Text(String::new()), end);
    }
    let inner = &rest[1..];
    match inner.find(quote) {
        Some(end) => (Token::Text(inner[..end].to_owned()), end + 2),
        None => (Token::Mark(quote), 1),
    }
}

/// Whether a text that is neither XML nor YAML runs publishers.
pub(super) fn runs_publishers(text: &str) -> bool {
    text.contains(PUBLISHER)
        && text.lines().any(|line| line.split('#').next().is_some_and(|code| code.contains(PUBLISHER)))
}

/// A place of an element for messages.
pub(super) fn named<'a>(path: String, node: &'a Node) -> Entry<'a> {
    Entry::called(path, node)
}
