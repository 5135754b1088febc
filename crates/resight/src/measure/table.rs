//! Writes the answers as a table for spreadsheets.

use super::answers::Answers;
use super::words;
use crate::report::verdict::Status;

/// Writes the columns name, kind, axis, value, unit, sigma, low_95, high_95, remark, status, with one line per value. The remark of an answer
/// that is not `ok` states the reason.
pub fn csv(answers: &Answers) -> String {
    let mut out = String::from("name,kind,axis,value,unit,sigma,low_95,high_95,remark,status\n");
    for answer in &answers.answers {
        let (name, kind) = (cell(&answer.query.name), answer.query.kind.name());
        let unit = words::unit(answer.query.kind);
        let status = answers.word(answer.status);
        let why = match status {
            Status::Ok => String::new(),
            _ => cell(&answers.verdict.join("; ")),
        };
        let status = status.name();
        match &answer.result {
            Ok(values) => {
                for (axis, m) in values.iter().enumerate() {
                    let axis = if values.len() == 3 { ["x", "y", "z"][axis] } else { "" };
                    let m = words::printed(answer.query.kind, m);
                    let (v, s, l, h) = (m.value, m.sigma, m.low, m.high);
                    out +=
                        &format!("{name},{kind},{axis},{v:.6},{unit},{s:.6},{l:.6},{h:.6},{why},{status}\n");
                }
            }
            Err(reason) => out += &format!("{name},{kind},,,{unit},,,,{},{status}\n", cell(reason)),
        }
    }
    out
}

/// Writes a text as a cell of a table. Spreadsheets interpret a text that begins with =, +, −, @, a tab or a line end as a formula, which may
/// access data outside the table: an apostrophe before it marks it as text.
pub fn cell(text: &str) -> String {
    let is_formula = text.starts_with(['=', '+', '-', '−', '@', '\t', '\r', '\n']);
    let text = if is_formula { format!("'{text}") } else { text.to_owned() };
    match is_formula || text.contains([',', ';', '"', '\n', '\r', '\t']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::cell;

    #[test]
    fn a_text_is_no_formula() {
        for (text, expected) in [
            ("kerb", "kerb"),
            ("kerb, left", "\"kerb, left\""),
            ("the \"long\" one", "\"the \"\"long\"\" one\""),
            ("=HYPERLINK(\"http://x\")", "\"'=HYPERLINK(\"\"http://x\"\")\""),
            ("+1", "\"'+1\""),
            ("-1", "\"'-1\""),
            ("−1", "\"'−1\""),
            ("@SUM(A1)", "\"'@SUM(A1)\""),
            ("\t=1", "\"'\t=1\""),
            ("a=1", "a=1"),
        ] {
            assert_eq!(cell(text), expected);
        }
    }
}
