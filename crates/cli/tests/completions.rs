//! Shells and manuals know every command.

use crate::support::{folder, resight};

const COMMANDS: [&str; 8] = ["locate", "capture", "rig", "map", "pose-graph", "hand-eye", "watch", "whisker"];

#[test]
fn every_shell_completes_every_command() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let run = resight(&["completions", shell]);
        assert_eq!(run.code, 0, "{shell}: {}", run.stderr);
        for command in COMMANDS.into_iter().chain(["--sync-tolerance-s"]) {
            let name = command.trim_start_matches('-');
            assert!(run.stdout.contains(name), "{shell} does not complete {command}");
        }
    }
    let run = resight(&["completions", "tcsh"]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("bash"), "{}", run.stderr);
}

/// `-h` of every command fits a terminal of 24 rows with the prompt's line to spare where it lists flags, and the list of commands one of 36;
/// `--help` explains what it leaves out.
#[test]
fn short_help_fits_one_screen() {
    let listed = |path: &[&str]| -> Vec<String> {
        let help = resight(&[path, &["-h"]].concat()).stdout;
        let commands = help.split("Commands:\n").nth(1).unwrap_or_default().split("\n\n").next();
        let names = commands.unwrap_or_default().lines().filter_map(|line| line.split_whitespace().next());
        names.filter(|name| *name != "help").map(str::to_string).collect()
    };
    let lines = |path: &[&str], flag: &str| resight(&[path, &[flag]].concat()).stdout.lines().count();
    assert!(lines(&[], "-h") <= 38, "{}", lines(&[], "-h"));
    let mut paths: Vec<Vec<String>> = listed(&[]).into_iter().map(|name| vec![name]).collect();
    paths.extend(listed(&["whisker"]).into_iter().map(|name| vec!["whisker".into(), name]));
    assert!(25 <= paths.len(), "{paths:?}");
    for path in &paths {
        let path: Vec<&str> = path.iter().map(String::as_str).collect();
        let (short, long) = (lines(&path, "-h"), lines(&path, "--help"));
        assert!(short <= 24 && short <= long, "{path:?}: {short} lines, --help {long}");
    }
}

#[test]
fn every_command_has_a_manual_page() {
    let pages = folder("man").join("man1");
    let run = resight(&["man", "-o", &pages.display().to_string()]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    for command in COMMANDS {
        let page = std::fs::read_to_string(pages.join(format!("resight-{command}.1"))).expect("a page");
        assert!(
            page.starts_with(".ie") && page.contains(".SH SYNOPSIS") && page.contains("resight "),
            "{page}"
        );
    }
    let program = std::fs::read_to_string(pages.join("resight.1")).expect("a page");
    assert!(program.contains("resight\\-locate(1)"), "{program}");
}
