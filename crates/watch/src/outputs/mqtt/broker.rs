//! The address and the user of the broker: `mqtt://user@host:1883/prefix`; the password comes from elsewhere.

use crate::outputs::secret;
use anyhow::{Context, Result, bail};
use std::path::Path;
use ureq::http::Uri;

/// The variable that holds the password where no file does.
const PASSWORD_VARIABLE: &str = "RESIGHT_MQTT_PASSWORD";

/// A broker.
#[derive(Clone, PartialEq)]
pub struct Broker {
    pub host: String,
    pub port: u16,
    pub is_tls: bool,
    pub user: Option<String>,
    pub password: Option<String>,
    /// Prefix of all topics, without a slash at its ends.
    pub prefix: String,
}

impl Broker {
    /// # Errors
    /// An invalid address, or one with a password; a password without a user.
    pub fn read(url: &str, password_file: Option<&Path>) -> Result<Self> {
        let mut broker = Self::parse(url)?;
        if let Some(file) = password_file {
            broker.password = Some(secret::read("--mqtt-password-file", file)?);
        } else if broker.user.is_some() {
            broker.password = std::env::var(PASSWORD_VARIABLE).ok();
        }
        if broker.password.is_some() && broker.user.is_none() {
            bail!("--mqtt: a password needs a user: mqtt://USER@{}", broker.host);
        }
        Ok(broker)
    }

    fn parse(url: &str) -> Result<Self> {
        let uri: Uri = url.parse().context("--mqtt: is no address; mqtt://host:1883/prefix is needed")?;
        let is_tls = match uri.scheme_str() {
            Some("mqtt") => false,
            Some("mqtts") => true,
            _ => bail!("--mqtt: mqtt:// or mqtts:// is needed"),
        };
        let Some(authority) = uri.authority().filter(|authority| !authority.host().is_empty()) else {
            bail!("--mqtt: the host is missing");
        };
        let who = authority.as_str().rsplit_once('@').map(|(who, _)| who);
        let user = match who.map(|who| who.split_once(':').unwrap_or((who, ""))) {
            None => None,
            Some((user, "")) => Some(decoded(user)?),
            Some((user, _)) => bail!(
                "--mqtt: a password in an argument can be read by everybody on this machine; give mqtt://{user}@HOST, and the \
                 password with --mqtt-password-file FILE or in the variable {PASSWORD_VARIABLE}"
            ),
        };
        let host = authority.host().trim_start_matches('[').trim_end_matches(']').to_string();
        let place = authority.as_str().rsplit('@').next().unwrap_or_default();
        let port = match authority.port_u16() {
            Some(port) => port,
            None if place.trim_start_matches(authority.host()).starts_with(':') => {
                bail!("--mqtt: the port is none; 1 to 65535")
            }
            None => {
                if is_tls {
                    8883
                } else {
                    1883
                }
            }
        };
        Ok(Broker { host, port, is_tls, user, password: None, prefix: prefix(uri.path())? })
    }

    /// Returns the receiver's name for the log, without secrets.
    pub fn receiver(&self) -> String {
        let scheme = if self.is_tls { "mqtts" } else { "mqtt" };
        match self.host.contains(':') {
            true => format!("{scheme}://[{}]:{}", self.host, self.port),
            false => format!("{scheme}://{}:{}", self.host, self.port),
        }
    }
}

fn prefix(path: &str) -> Result<String> {
    let prefix = decoded(path.trim_matches('/'))?;
    if prefix.contains(['+', '#']) || prefix.chars().any(char::is_control) {
        bail!("--mqtt: the prefix {prefix:?} holds + or #, which no topic can");
    }
    Ok(if prefix.is_empty() { "resight".to_string() } else { prefix })
}

/// Decodes an address, in which `%40` is `@`.
fn decoded(text: &str) -> Result<String> {
    let (mut bytes, mut rest) = (Vec::new(), text.as_bytes());
    while let Some((first, after)) = rest.split_first() {
        let digits = after.get(..2).and_then(|two| std::str::from_utf8(two).ok());
        match digits.and_then(|two| u8::from_str_radix(two, 16).ok()).filter(|_| *first == b'%') {
            Some(byte) => (bytes.push(byte), rest = &after[2..]).1,
            None => (bytes.push(*first), rest = after).1,
        }
    }
    String::from_utf8(bytes).context("--mqtt: what stands after % is no UTF-8")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_taken_apart() {
        let broker = Broker::parse("mqtt://gate%40site@broker.example:1884/site/a/").expect("an address");
        assert_eq!(broker.user.as_deref(), Some("gate@site"));
        assert_eq!((broker.port, broker.prefix.as_str(), broker.is_tls), (1884, "site/a", false));
        assert_eq!(broker.receiver(), "mqtt://broker.example:1884");
        let short = Broker::parse("mqtts://[::1]").expect("an address");
        assert_eq!((short.host.as_str(), short.port, short.prefix.as_str()), ("::1", 8883, "resight"));
        assert_eq!(short.receiver(), "mqtts://[::1]:8883");
    }

    #[test]
    fn wrong_addresses_are_refused_without_showing_secrets() {
        for wrong in [
            "broker:1883",
            "http://secret@host",
            "mqtt://",
            "mqtt://host/a+b",
            "mqtt://host/%23",
            "mqtt://host:99999",
        ] {
            let reported = format!("{:#}", Broker::parse(wrong).err().expect("no address"));
            assert!(reported.starts_with("--mqtt") && !reported.contains("secret"), "{wrong}: {reported}");
        }
        assert!(Broker::parse("mqtt://%ff@host").is_err());
    }

    #[test]
    fn a_password_in_the_address_is_refused_unshown_with_the_way_out() {
        for address in
            ["mqtt://gate:secret@host", "mqtts://gate:se%2Fcret@host:8883/site", "mqtt://:secret@host"]
        {
            let reported = format!("{:#}", Broker::parse(address).err().expect("refused"));
            assert!(
                reported.contains("--mqtt-password-file") && reported.contains(PASSWORD_VARIABLE),
                "{reported}"
            );
            assert!(!reported.contains("secret") && !reported.contains("cret@"), "{reported}");
        }
    }
}
