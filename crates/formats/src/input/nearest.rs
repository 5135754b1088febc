//! The name that was meant, where one slip of the hand explains the name that was given.

/// Letters of a word that are compared: a hostile one stays cheap.
const LONGEST: usize = 64;

/// The candidate nearest to a name, when it is near enough to be a slip of the hand.
pub fn nearest(name: &str, candidates: impl Iterator<Item = String>) -> Option<String> {
    let limit = (name.chars().count() / 3).clamp(1, 4);
    let mut scored: Vec<(usize, String)> =
        candidates.map(|c| (edits(&name.to_lowercase(), &c.to_lowercase()), c)).collect();
    scored.sort();
    scored.into_iter().next().filter(|(edits, _)| *edits <= limit).map(|(_, candidate)| candidate)
}

/// Returns the message about a name that is none of those there are.
pub fn not_among(name: &str, kind: &str, names: &[String]) -> String {
    let hint = nearest(name, names.iter().cloned());
    let hint = hint.map(|nearest| format!("; did you mean `{nearest}`?")).unwrap_or_default();
    format!("there is no {kind} `{name}`; the {kind}s are {}{hint}", names.join(", "))
}

/// Levenshtein distance with swaps of neighbours counted as one.
fn edits(a: &str, b: &str) -> usize {
    let letters = |word: &str| word.chars().take(LONGEST).collect::<Vec<char>>();
    let (a, b) = (letters(a), letters(b));
    let mut before: Vec<usize> = Vec::new();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut next = vec![i];
        for j in 1..=b.len() {
            let change = row[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let swap = 1 < i && 1 < j && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
            let best = change.min(row[j] + 1).min(next[j - 1] + 1);
            next.push(if swap { best.min(before[j - 2] + 1) } else { best });
        }
        before = std::mem::replace(&mut row, next);
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_slip_is_one_edit() {
        for (a, b, n) in [
            ("left", "left", 0),
            ("left", "lfet", 1),
            ("left", "lef", 1),
            ("left", "right", 4),
            ("", "ab", 2),
        ] {
            assert_eq!(edits(a, b), n, "{a} {b}");
        }
    }

    #[test]
    fn a_stranger_is_not_offered() {
        assert_eq!(nearest("camera.yml", ["zebra.png".to_string()].into_iter()), None);
        assert_eq!(
            nearest("camera.yml", ["camera.yaml".to_string()].into_iter()).as_deref(),
            Some("camera.yaml")
        );
    }
}
