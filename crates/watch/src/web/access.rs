//! Access control: the server answers requests that name this machine by a known name (a foreign page whose name points to this machine uses its
//! own name), and, where a token is required, that contain it.

use crate::outputs::secret;
use anyhow::{Result, bail};
use std::net::SocketAddr;
use std::path::Path;

/// Shorter tokens can be guessed: 32 letters of base64 have 192 bits.
const TOKEN_LETTERS: usize = 32;

/// The access rules.
#[derive(Debug, Clone)]
pub struct Access {
    hosts: Vec<String>,
    token: Option<String>,
}

/// Reads the file of a token, whose flag is `flag`.
///
/// # Errors
/// A file that others can read, or a token that could be guessed.
pub fn token(flag: &str, path: &Path) -> Result<String> {
    let token = secret::read(flag, path)?;
    if token.len() < TOKEN_LETTERS {
        bail!(
            "{flag} {}: {} characters; at least {TOKEN_LETTERS} are needed: openssl rand -hex 32",
            path.display(),
            token.len()
        );
    }
    Ok(token)
}

impl Access {
    /// Builds the rules of a server at this address, with these further names.
    pub fn new(place: SocketAddr, token: Option<String>, hosts: &[String]) -> Self {
        let port = place.port();
        let own = ["localhost", "127.0.0.1", "[::1]"].map(|name| format!("{name}:{port}"));
        let mut hosts: Vec<String> = hosts.iter().map(|host| host.to_ascii_lowercase()).collect();
        hosts.extend(own);
        hosts.push(place.to_string());
        Access { hosts, token }
    }

    /// Returns whether `Host` names this machine. A name given without a port stands for every port.
    pub fn knows_host(&self, host: &str) -> bool {
        let host = host.to_ascii_lowercase();
        let name = host.rsplit_once(':').map_or(host.as_str(), |(name, _)| name);
        self.hosts.iter().any(|known| *known == host || known == name)
    }

    /// Returns whether `Origin` is a page of this server: none means no browser, or a page of its own.
    pub fn knows_origin(&self, origin: Option<&str>) -> bool {
        let Some(origin) = origin else { return true };
        origin
            .split_once("://")
            .is_some_and(|(scheme, host)| (scheme == "http" || scheme == "https") && self.knows_host(host))
    }

    /// Returns whether a token is required.
    pub fn asks_for_token(&self) -> bool {
        self.token.is_some()
    }

    /// Returns whether `Authorization` contains the token, where one is required.
    pub fn admits(&self, authorization: Option<&str>) -> bool {
        let Some(token) = &self.token else { return true };
        let given = authorization.and_then(|text| text.split_once(' '));
        given.is_some_and(|(scheme, given)| {
            scheme.eq_ignore_ascii_case("bearer")
                && secret::is_same(given.trim().as_bytes(), token.as_bytes())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(token: Option<&str>) -> Access {
        let place = "127.0.0.1:9464".parse().expect("an address");
        Access::new(place, token.map(str::to_string), &["Watch.example".to_string(), "gate:80".to_string()])
    }

    #[test]
    fn only_its_own_names_are_known() {
        let access = access(None);
        for known in [
            "localhost:9464",
            "127.0.0.1:9464",
            "[::1]:9464",
            "watch.example",
            "WATCH.example:123",
            "gate:80",
        ] {
            assert!(access.knows_host(known), "{known}");
        }
        for foreign in
            ["", "evil.example:9464", "localhost:80", "127.0.0.1", "gate", "gate:81", "watch.example.evil"]
        {
            assert!(!access.knows_host(foreign), "{foreign}");
        }
    }

    #[test]
    fn only_the_token_admits() {
        let asks = access(Some("0123456789abcdef0123456789abcdef"));
        assert!(asks.admits(Some("Bearer 0123456789abcdef0123456789abcdef")));
        for wrong in [
            None,
            Some("Bearer 0123456789abcdef0123456789abcdeX"),
            Some("Basic 0123456789abcdef0123456789abcdef"),
        ] {
            assert!(!asks.admits(wrong));
        }
        assert!(access(None).admits(None));
    }
}
