//! `completions` and `man`: what a shell and a reader of manuals want to know of the program.

use crate::output::{Outcome, print};
use anyhow::{Context, Result};
use clap::{Args, Command};
use clap_complete::Shell;
use resight::formats::write_atomically;
use std::path::PathBuf;

/// Prints a script that makes a shell complete the commands, flags and files of `resight`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight completions bash > ~/.local/share/bash-completion/completions/resight
  resight completions zsh > ~/.zfunc/_resight
  resight completions fish > ~/.config/fish/completions/resight.fish")]
pub struct Completions {
    /// The shell.
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// Writes manual pages, one for the program and one for each command.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  resight man -o ~/.local/share/man/man1 && man resight-locate")]
pub struct Man {
    /// The folder, which is made where it is missing.
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
}

/// See `Completions`.
pub fn completions(args: &Completions, mut program: Command) -> Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "resight", &mut script);
    print(&String::from_utf8(script)?)?;
    Ok(Outcome::Answered)
}

/// See `Man`.
pub fn man(args: &Man, mut program: Command) -> Result<Outcome> {
    std::fs::create_dir_all(&args.output).with_context(|| args.output.display().to_string())?;
    program.build();
    let commands = program.get_subcommands().filter(|command| command.get_name() != "help");
    let pages = commands.map(|command| {
        // The name of the page is that of `man`, the usage keeps the space.
        let name = format!("resight-{}", command.get_name());
        (name.clone(), command.clone().display_name(name))
    });
    for (name, command) in std::iter::once(("resight".to_string(), program.clone())).chain(pages) {
        let mut page = Vec::new();
        clap_mangen::Man::new(command).render(&mut page)?;
        write_atomically(args.output.join(format!("{name}.1")), &page)?;
    }
    Ok(Outcome::Answered)
}
