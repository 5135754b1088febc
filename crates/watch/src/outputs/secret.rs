//! Secrets come from files, never from what the log or the list of processes shows.

use anyhow::{Context, Result, bail};
use std::path::Path;

/// Reads the first line of a file that only its owner can read. `flag` names the flag in messages.
pub fn read(flag: &str, path: &Path) -> Result<String> {
    let shown = path.display();
    must_be_private(flag, path)?;
    let text =
        resight::input::read_text(path, resight::input::Kind::Secret).with_context(|| flag.to_string())?;
    match text.lines().next().map(str::trim) {
        Some(line) if !line.is_empty() => Ok(line.to_string()),
        _ => bail!("{flag} {shown}: its first line is empty; the secret belongs there"),
    }
}

/// Refuses a file that other users of this machine can read.
#[cfg(unix)]
pub fn must_be_private(flag: &str, path: &Path) -> Result<()> {
    use std::os::unix::fs::PermissionsExt;
    let shown = path.display();
    let mode = std::fs::metadata(path).with_context(|| format!("{flag} {shown}"))?.permissions().mode();
    if mode & 0o077 != 0 {
        bail!(
            "{flag} {shown}: others can read it (mode {:03o}, needed 600); chmod 600 {shown}",
            mode & 0o777
        );
    }
    Ok(())
}

/// Refuses a file that other users of this machine can read.
#[cfg(not(unix))]
pub fn must_be_private(_flag: &str, _path: &Path) -> Result<()> {
    Ok(())
}

/// Whether two secrets are the same, in a time that does not tell where they differ.
pub fn is_same(given: &[u8], known: &[u8]) -> bool {
    let differing = given.iter().zip(known).fold(0, |all, (a, b)| all | (a ^ b));
    std::hint::black_box(differing) == 0 && given.len() == known.len()
}

#[cfg(test)]
mod tests {
    use super::is_same;

    #[test]
    fn only_the_same_is_the_same() {
        assert!(is_same(b"secret", b"secret") && is_same(b"", b""));
        for other in [b"secres".as_slice(), b"xecret", b"secre", b"secrets", b""] {
            assert!(!is_same(other, b"secret"));
        }
    }
}
