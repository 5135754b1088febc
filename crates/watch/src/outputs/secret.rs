//! Secrets come from files, never from the arguments, which the log or the list of processes shows.

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

/// Names of a secret in an address, in lower case; `accesstoken`, `user_password` and `api-key` end in one of them.
const NAMES: [&str; 15] = [
    "password",
    "passwd",
    "passphrase",
    "pwd",
    "pw",
    "psw",
    "pass",
    "pas",
    "token",
    "secret",
    "key",
    "signature",
    "auth",
    "credential",
    "credentials",
];

/// Returns the start of the value of the first secret that an address names as `password=…`, `token=…` and the like: behind `?`, or in its path,
/// as in the addresses of many cameras (`…/user=admin_password=…_channel=1`). Letters of the name, and the `=`, may be written as `%70`, `%3D`.
pub fn named_in(address: &str) -> Option<usize> {
    let begin = address.split_once("://").map_or(0, |(scheme, _)| scheme.len() + 3);
    let is_equals = |at: &usize| matches!(decoded_at(address.as_bytes(), *at), (b'=', _));
    (begin..address.len()).filter(is_equals).find_map(|at| {
        let (_, length) = decoded_at(address.as_bytes(), at);
        let before = decoded(&address.as_bytes()[begin..at]);
        let separators = ['/', '?', '&', ';', ',', '_', '-', '.', '=', '#', '%'];
        let name = before.rsplit(separators).next().unwrap_or_default().to_ascii_lowercase();
        let has_value = address[at + length..].chars().next().is_some_and(|c| !"/?&;".contains(c));
        (has_value && NAMES.iter().any(|one| name.ends_with(one))).then_some(at + length)
    })
}

/// Returns the byte that a text has at a place, and its length there: 3 where it is written as `%3D`.
fn decoded_at(text: &[u8], at: usize) -> (u8, usize) {
    let digit = |byte: &u8| char::from(*byte).to_digit(16);
    if let [b'%', high, low, ..] = &text[at..]
        && let (Some(high), Some(low)) = (digit(high), digit(low))
    {
        return ((16 * high + low) as u8, 3);
    }
    (text[at], 1)
}

fn decoded(text: &[u8]) -> String {
    let (mut bytes, mut at) = (Vec::new(), 0);
    while at < text.len() {
        let (byte, length) = decoded_at(text, at);
        bytes.push(byte);
        at += length;
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Returns whether an address contains a secret that no list of processes may show: `user:password@` before the host (a password may contain a
/// slash that should have been written %2F), or one by its name.
pub fn is_in(address: &str) -> bool {
    let Some((_, rest)) = address.split_once("://") else { return false };
    let is_port = |text: &str| text.chars().all(|c| c.is_ascii_digit());
    let has_user = rest.rsplit_once('@').is_some_and(|(user, _)| {
        let first = user.split(['/', '?']).next().unwrap_or_default();
        // `cam:554/video@2x` has a port, `me:1234@cam` a password.
        first.split_once(':').is_some_and(|(_, behind)| first.len() == user.len() || !is_port(behind))
    });
    has_user || named_in(address).is_some()
}

/// Returns an address from its argument: the address itself, the first line of a private file (`@FILE`), or a variable (`env:VARIABLE`). `flag`
/// is the flag of the argument, `session` the file that contains it, if it is no argument.
///
/// # Errors
/// A secret in an argument, or in a session file that others can read (the message does not show it); a missing file or variable.
pub fn address(flag: &str, given: &str, session: Option<&Path>) -> Result<String> {
    if let Some(file) = given.strip_prefix('@') {
        return read(&format!("{flag} @FILE"), Path::new(file));
    }
    if let Some(variable) = given.strip_prefix("env:") {
        let found = std::env::var(variable).ok().filter(|address| !address.is_empty());
        return found.with_context(|| format!("{flag} env:{variable}: there is no such variable"));
    }
    match (is_in(given), session) {
        (true, Some(file)) => must_be_private(&format!("{flag}, which holds a secret:"), file)?,
        (true, None) => bail!(
            "{flag}: a password or token in an argument can be read by everybody on this machine; write the address into a session file or a file that only you can read and give @FILE instead of it, or into a variable and give env:VARIABLE"
        ),
        (false, _) => {}
    }
    Ok(given.to_string())
}

/// Returns whether two secrets are equal, in a time that does not depend on where they differ.
pub fn is_same(given: &[u8], known: &[u8]) -> bool {
    let differing = given.iter().zip(known).fold(0, |all, (a, b)| all | (a ^ b));
    std::hint::black_box(differing) == 0 && given.len() == known.len()
}

#[cfg(test)]
mod tests {
    use super::{is_in, is_same, named_in};

    #[test]
    fn is_in_password_or_token_is_seen_however_it_is_written() {
        for address in [
            "rtsp://cam/x?password=7",
            "rtsp://cam/x?a=1&PWD=7",
            "rtsp://cam:554/user=admin_password=7_channel=1_stream=0.sdp",
            "rtsp://cam/user=admin&password=7&channel=1",
            "http://cam/video;accessToken=7",
            "https://chat/hook?api-key=7",
            "https://chat/hook?sig=1&X-Signature=7",
            "rtsp://cam/x?pw=7",
            "rtsp://cam/x?psw=7",
            "rtsp://cam/x?user_pas=7",
            "rtsp://cam/x?auth=YWRtaW46Nw",
            "rtsp://cam/x?credentials=7",
            "rtsp://cam/x?%70assw%6Frd=7",
            "rtsp://cam/x?a=1%26password%3D7",
            "rtsp://me:7@cam/x",
            "rtsp://me:a/b@cam/x",
        ] {
            assert!(is_in(address), "{address}");
        }
        for address in [
            "rtsp://cam:554/a@2x",
            "rtsp://cam/user=admin_password=_channel=1".replace("=_", "=&").as_str(),
            "http://cam/video?tokens=3&channel=1",
            "https://ntfy.sh/my-cameras?tpl=1&t={{.camera}}",
            "night/password=7/*.png",
            "http://cam/video?author=me&channel=north",
            "http://cam/100%/video?spaß%=1",
            "film.mp4",
        ] {
            assert!(!is_in(address), "{address}");
        }
        assert_eq!(
            named_in("rtsp://c/user=a_password=xyz").map(|at| &"rtsp://c/user=a_password=xyz"[at..]),
            Some("xyz")
        );
    }

    #[test]
    fn only_the_same_is_the_same() {
        assert!(is_same(b"secret", b"secret") && is_same(b"", b""));
        for other in [b"secres".as_slice(), b"xecret", b"secre", b"secrets", b""] {
            assert!(!is_same(other, b"secret"));
        }
    }
}
