//! Shells and manuals know every command.

use crate::support::{folder, resight};

const COMMANDS: [&str; 6] = ["locate", "rig", "pose-graph", "hand-eye", "watch", "whisker"];

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
