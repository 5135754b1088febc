//! Reads scene files that were saved by the page: the page's own table `[session]`, which includes photographs, is removed. The remainder is as
//! small as other scene files.

/// The syntactic context of a character of TOML.
#[derive(Clone, Copy, PartialEq, Eq)]
enum At {
    Plain,
    Basic,
    Literal,
    LongBasic,
    LongLiteral,
}

/// Returns the text with every line of the tables `[session]`, `[session.…]` and `[[session.…]]` emptied, so that line numbers do not change.
pub(super) fn without_session(text: &str) -> String {
    let (mut rest, mut at, mut is_session) = (String::new(), At::Plain, false);
    for line in text.split_inclusive('\n') {
        let begins = line.trim_start();
        if at == At::Plain && begins.starts_with('[') {
            let name = begins.trim_start_matches('[').trim_start();
            let after = name.strip_prefix("session").map(str::trim_start);
            is_session = after.is_some_and(|after| after.starts_with(['.', ']']));
        }
        at = after(line.as_bytes(), at);
        rest.push_str(if !is_session {
            line
        } else if line.ends_with('\n') {
            "\n"
        } else {
            ""
        });
    }
    rest
}

/// Returns the context of the character after a line.
fn after(line: &[u8], mut at: At) -> At {
    let mut i = 0;
    while let Some(byte) = line.get(i) {
        let is_long = |quote: &[u8]| line[i..].starts_with(quote);
        let (next, step) = match (at, byte) {
            (At::Plain, b'#') => return at,
            (At::Plain, b'"') if is_long(b"\"\"\"") => (At::LongBasic, 3),
            (At::Plain, b'\'') if is_long(b"'''") => (At::LongLiteral, 3),
            (At::Plain, b'"') => (At::Basic, 1),
            (At::Plain, b'\'') => (At::Literal, 1),
            (At::Basic | At::LongBasic, b'\\') => (at, 2),
            (At::LongBasic, b'"') if is_long(b"\"\"\"") => (At::Plain, 3),
            (At::LongLiteral, b'\'') if is_long(b"'''") => (At::Plain, 3),
            // A string of one line ends with the line, even if it is not closed.
            (At::Basic, b'"' | b'\n') | (At::Literal, b'\'' | b'\n') => (At::Plain, 1),
            _ => (at, 1),
        };
        (at, i) = (next, i + step);
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_session_is_left_out_and_nothing_else() {
        let text = "sigma_px = 1.0\n[[photo]]\ntext = \"\"\"\n[session]\n\\\"\"\"\" # [session]\n[session]\nlens = '''\n[[photo]]\n'''\nname = \"[photo]\"\n\
                    [[session.photos]]\nimage_base64 = \"AAAA\"\n[ session . positions ]\na = 1\n[[query]]\nname = 'session' # \"\"\"\n[sessions]\nb = 2";
        let rest = without_session(text);
        assert_eq!(rest.lines().count(), text.lines().count());
        let kept: Vec<&str> = rest.lines().filter(|line| !line.is_empty()).collect();
        let expected = [
            "sigma_px = 1.0",
            "[[photo]]",
            "text = \"\"\"",
            "[session]",
            "\\\"\"\"\" # [session]",
            "[[query]]",
            "name = 'session' # \"\"\"",
            "[sessions]",
            "b = 2",
        ];
        assert_eq!(kept, expected);
        assert_eq!(without_session(""), "");
    }
}
