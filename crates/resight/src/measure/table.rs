//! The answers as a table for spreadsheets.

use super::answers::Answers;
use super::words;
use crate::report::verdict::Status;

/// Columns: name, kind, axis, value, unit, sigma, low_95, high_95, remark, status; one line a value. The remark of an answer that is not
/// `ok` says why.
pub fn csv(answers: &Answers) -> String {
    let mut out = String::from("name,kind,axis,value,unit,sigma,low_95,high_95,remark,status\n");
    for answer in &answers.answers {
        let (name, kind) = (quoted(&answer.query.name), answer.query.kind.name());
        let unit = words::unit(answer.query.kind);
        let status = answers.word(answer.status);
        let (why, status) = (status, status.name());
        let why = match why {
            Status::Ok => String::new(),
            _ => quoted(&answers.verdict.join("; ")),
        };
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
            Err(reason) => out += &format!("{name},{kind},,,{unit},,,,{},{status}\n", quoted(reason)),
        }
    }
    out
}

fn quoted(text: &str) -> String {
    match text.contains([',', '"', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_string(),
    }
}
