//! The crates as text: what each is, and which uses which.

use super::Package;
use std::collections::BTreeSet;
use std::fmt::Write;

/// An arrow from a crate to one that uses it; by a feature only, or always.
type Arrow<'a> = (&'a str, &'a str, bool);

/// One line a crate: folder, package, and what its manifest says of it.
pub fn map(order: &[&Package]) -> String {
    let widest = |of: fn(&Package) -> usize| order.iter().map(|one| of(one)).max().unwrap_or(0);
    let (folder, name) = (widest(|one| one.folder.len()), widest(|one| one.name.len()));
    let mut text = String::new();
    for one in order {
        let _ = writeln!(text, "crates/{:folder$}   {:name$}   {}", one.folder, one.name, one.description);
    }
    text
}

/// Chains of arrows that together hold every arrow once, the longest first; those that others imply are left out.
pub fn arrows(order: &[&Package]) -> String {
    let mut left = direct(order);
    let mut text = String::new();
    while let Some(chain) = longest(order, &left) {
        for (i, (from, to, is_optional)) in chain.iter().enumerate() {
            let line = if *is_optional { "┄►" } else { "─►" };
            let _ = match i {
                0 => write!(text, "{from} {line} {to}"),
                _ => write!(text, " {line} {to}"),
            };
        }
        text.push('\n');
        left.retain(|arrow| !chain.contains(arrow));
    }
    text
}

fn direct<'a>(order: &[&'a Package]) -> Vec<Arrow<'a>> {
    let by_name = |name: &String| order.iter().find(|one| one.name == *name);
    let mut all: Vec<Arrow<'a>> = Vec::new();
    for to in order {
        for from in to.dependencies.iter().filter_map(by_name) {
            all.push((&from.folder, &to.folder, to.optional.contains(&from.name)));
        }
    }
    let is_implied = |arrow: &Arrow<'_>| {
        let firm: Vec<&Arrow<'_>> = all.iter().filter(|other| !other.2 && *other != arrow).collect();
        let (mut seen, mut open) = (BTreeSet::new(), vec![arrow.0]);
        while let Some(at) = open.pop() {
            open.extend(
                firm.iter().filter(|other| other.0 == at && seen.insert(other.1)).map(|other| other.1),
            );
        }
        seen.contains(arrow.1)
    };
    all.iter().filter(|arrow| !is_implied(arrow)).copied().collect()
}

fn longest<'a>(order: &[&'a Package], left: &[Arrow<'a>]) -> Option<Vec<Arrow<'a>>> {
    // The longest chain that ends at each crate, in the order of the crates.
    let mut ending: Vec<(&str, Vec<Arrow<'a>>)> = Vec::new();
    for one in order {
        let mut best: Vec<Arrow<'a>> = Vec::new();
        for arrow in left.iter().filter(|arrow| arrow.1 == one.folder) {
            let before = ending.iter().find(|(at, _)| *at == arrow.0).map_or(&[][..], |(_, chain)| chain);
            if best.len() < before.len() + 1 {
                best = [before, &[*arrow]].concat();
            }
        }
        ending.push((&one.folder, best));
    }
    let all = ending.into_iter().map(|(_, chain)| chain);
    all.reduce(|a, b| if a.len() < b.len() { b } else { a }).filter(|chain| !chain.is_empty())
}
