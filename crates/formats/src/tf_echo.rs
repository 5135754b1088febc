//! What `tf2_echo PARENT CHILD` (ROS 2, ROS 1's `tf_echo`) prints: the pose of the child in the parent, quaternion x y z w, metres, three decimals.
//! The frames stand in the command alone, which must be in the text; of repeated answers the last counts.

use super::document::{Document, Fault, Node, Value};
use super::entry::Entry;
use super::{Contents, Placement, checks};
use nalgebra::Vector3;

const TRANSLATION: &str = "- Translation: [";
const ROTATION: &str = "- Rotation: in Quaternion";

/// A text that holds both lines of an answer.
pub(super) fn is_echo(text: &str) -> bool {
    let has = |begin: &str| text.lines().any(|line| line.trim_start().starts_with(begin));
    has(TRANSLATION) && has(ROTATION)
}

/// Numbers in brackets.
fn bracketed<const N: usize>(number: usize, line: &str) -> Result<[f64; N], Fault> {
    let inner = line.split_once('[').and_then(|(_, rest)| rest.split_once(']')).map(|(inner, _)| inner);
    let numbers: Vec<f64> =
        inner.unwrap_or_default().split(',').filter_map(|word| word.trim().parse().ok()).collect();
    let found: Option<[f64; N]> = numbers.try_into().ok();
    found
        .filter(|numbers| numbers.iter().all(|x| x.is_finite()))
        .ok_or_else(|| Fault::at(number, format!("{N} finite numbers in brackets are needed")))
}

/// The frames of a command in a line.
fn frames(line: &str) -> Option<[String; 2]> {
    let mut words =
        line.split_whitespace().skip_while(|word| !matches!(*word, "tf2_echo" | "tf_echo")).skip(1);
    let mut frame =
        || Some(words.next()?.trim_matches(['/', '"', '\'']).to_owned()).filter(|name| !name.is_empty());
    Some([frame()?, frame()?])
}

pub(super) fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    let (mut named, mut translation) = (None, None);
    for (i, line) in document.text.lines().enumerate() {
        let (number, line) = (i + 1, line.trim_start());
        if let Some(found) = frames(line) {
            named = Some(found);
        } else if line.starts_with(TRANSLATION) {
            translation = Some(bracketed::<3>(number, line)?);
        } else if line.starts_with(ROTATION)
            && let Some(t) = translation.take()
        {
            let Some([b, a]) = named.clone() else {
                return Err(Fault::at(
                    number,
                    "the answer of tf2_echo names no frames; put the command above it: `ros2 run tf2_ros tf2_echo PARENT CHILD`",
                ));
            };
            contents.relations.retain(|known| (&known.b, &known.a) != (&b, &a));
            contents.relations.push(placement(number, [b, a], bracketed(number, line)?, t)?);
        }
    }
    contents.warnings.push("tf2_echo prints three decimals: positions to 0.5 mm, rotations to 0.06°".into());
    Ok(contents)
}

/// Three decimals leave this of a unit quaternion's length.
const ROUNDED: f64 = 2e-3;

fn placement(line: usize, [b, a]: [String; 2], xyzw: [f64; 4], t: [f64; 3]) -> Result<Placement, Fault> {
    let node = Node { line, value: Value::Null };
    let length = xyzw.iter().map(|x| x * x).sum::<f64>().sqrt();
    let unit = if (length - 1.0).abs() < ROUNDED { xyzw.map(|x| x / length) } else { xyzw };
    let [x, y, z, w] = unit;
    let b_from_a =
        checks::quaternion_pose(&Entry::called("tf2_echo", &node), [w, x, y, z], Vector3::from(t))?;
    Ok(Placement { b, a, b_from_a, covariance: None })
}
