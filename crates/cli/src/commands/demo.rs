//! `demo`.
use crate::output::Outcome;
/// Demo.
#[derive(Debug, clap::Args)]
pub struct Demo {}
/// See.
pub fn run(_: &Demo) -> anyhow::Result<Outcome> {
    Ok(Outcome::Answered)
}
