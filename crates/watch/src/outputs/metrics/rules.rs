//! Tests of the rules that the documents give operators: each metric in them is exported, and each rule can fire.

use super::exposition::page;
use super::tally::Tally;
use crate::live::{CheckingReason, Event, State};
use crate::log::Log;
use crate::names::Names;
use crate::outputs::Session;
use crate::outputs::said::{WORDS, word};
use resight::core::temporal::monitor::{Drift, MotionKind};
use resight::core::{Matrix6, Vector6};
use std::collections::BTreeSet;
use std::path::Path;

/// Returns every document with its name.
fn documents() -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    let files = std::fs::read_dir(&folder).expect("documents").map(|file| file.expect("a file").path());
    let pages = files.filter(|path| path.extension().is_some_and(|ending| ending == "md"));
    let name = |path: &Path| path.file_name().map(|name| name.display().to_string()).unwrap_or_default();
    pages.map(|path| (name(&path), std::fs::read_to_string(&path).expect("a page"))).collect()
}

fn tally() -> Tally {
    let names = Names::new(&["gate=a".to_string()], &["door=b".to_string()]);
    let (log, stop) = (Log::default(), std::sync::Arc::default());
    let session = Session {
        names: &names,
        references: vec![None],
        false_alarms_per_day: 1.0,
        log: &log,
        stop: &stop,
        is_once: false,
    };
    Tally::new(&session, Vec::new())
}

/// Returns one of each state.
fn states() -> [State; 7] {
    let drift = Drift {
        old_from_new: Vector6::zeros(),
        covariance: Matrix6::identity(),
        began_s: 1.0,
        began_sigma_s: 1.0,
        course: MotionKind::Step,
        course_probability: 1.0,
        rate: None,
        again: None,
    };
    [
        State::Learning { readings: 1, needed: 50 },
        State::Steady,
        State::Checking(CheckingReason::Different),
        State::Drifted(Box::new(drift)),
        State::Stale { for_s: 6.0, reason: None },
        State::Inconsistent,
        State::Tracking,
    ]
}

/// Returns the page of a camera in a state, whose source provides frames or has been lost.
fn page_in(state: &State, is_lost: bool) -> String {
    let mut tally = tally();
    tally.take(&Event::Observed { camera: 0, target: 0, observation: Box::default() });
    tally.take(&Event::StateChanged { camera: 0, target: 0, t_s: 1.0, state: state.clone() });
    if is_lost {
        tally.take(&Event::Source { camera: 0, connected: false, reason: None });
    }
    page(&tally)
}

/// Returns a rule such as `name{label=~"a|b"} == 1` as one condition for each alternative: name, label with its value, and the number.
fn conditions(expression: &str) -> Vec<(String, Option<String>, f64)> {
    let (left, number) = expression.split_once("==").unwrap_or_else(|| panic!("no comparison: {expression}"));
    let number = number.trim().parse().unwrap_or_else(|_| panic!("no number: {expression}"));
    let Some((name, matchers)) = left.trim().split_once('{') else {
        return vec![(left.trim().to_string(), None, number)];
    };
    let (label, values) = matchers.trim_end_matches('}').split_once('=').expect("a label");
    let values = values.trim_start_matches('~').trim_matches('"').split('|');
    values.map(|value| (name.to_string(), Some(format!("{label}=\"{value}\"")), number)).collect()
}

/// Returns whether a page has such a sample.
fn fires(page: &str, (name, label, number): &(String, Option<String>, f64)) -> bool {
    let is_one = |line: &&str| {
        line.strip_prefix(name.as_str()).is_some_and(|rest| rest.starts_with('{'))
            && label.as_ref().is_none_or(|label| line.contains(label.as_str()))
    };
    let value = |line: &str| line.rsplit(' ').next().and_then(|value| value.parse::<f64>().ok());
    page.lines().filter(is_one).any(|line| value(line) == Some(*number))
}

/// A camera in trouble makes each rule of the documents true, in each of its alternatives, and a steady one makes none true.
#[test]
fn every_rule_of_the_documents_can_fire() {
    let pages: Vec<String> =
        states().iter().flat_map(|state| [false, true].map(|is_lost| page_in(state, is_lost))).collect();
    let steady = page_in(&State::Steady, false);
    let mut rules = 0;
    for (file, text) in documents() {
        for expression in text.lines().filter_map(|line| line.trim().strip_prefix("expr: ")) {
            if expression.starts_with("up{") {
                let job = expression.split('"').nth(1).expect("a job");
                assert!(text.contains(&format!("job_name: {job}\n")), "{file}: no job of {expression}");
                continue; // Prometheus itself reports whether it reaches a session.
            }
            for condition in conditions(expression) {
                assert!(
                    pages.iter().any(|page| fires(page, &condition)),
                    "{file}: {condition:?} never fires"
                );
                assert!(!fires(&steady, &condition), "{file}: {condition:?} fires though all is well");
                rules += 1;
            }
        }
    }
    assert!(4 <= rules, "{rules} conditions");
}

/// Whatever the documents use of a state or a metric is exported: `state="…"`, `resight_…`; states that were renamed occur nowhere.
#[test]
fn what_the_documents_ask_for_is_exported() {
    assert_eq!(states().iter().map(word).collect::<BTreeSet<_>>(), WORDS.into_iter().collect());
    let all: String = states().iter().map(|state| page_in(state, true)).collect();
    let (mut asked, mut metrics) = (0, 0);
    for (file, text) in documents() {
        for value in text.split("state=\"").skip(1).chain(text.split("state=~\"").skip(1)) {
            for state in value.split('"').next().unwrap_or_default().split('|') {
                assert!(WORDS.contains(&state), "{file}: no state is called {state:?}");
                asked += 1;
            }
        }
        let names = text.split("resight_").skip(1).map(|rest| {
            rest.split(|c: char| !(c.is_ascii_lowercase() || c == '_')).next().unwrap_or_default()
        });
        let crates = ["core", "watch", "whisker", "fleet", "formats", "recording", "session", "serve", "cli"];
        // What begins so there is the library for C.
        let names = names.filter(|_| file != "c.md");
        for name in names.filter(|name| !crates.contains(name) && !name.is_empty()) {
            assert!(all.contains(&format!("resight_{name}")), "{file}: no metric is called resight_{name}");
            metrics += 1;
        }
        if file.starts_with("watch") {
            for old in ["unseen", "settling"] {
                assert!(!text.contains(old), "{file}: the state {old} has another name");
            }
        }
    }
    assert!(4 <= asked && 3 <= metrics, "{asked} states, {metrics} metrics");
}
