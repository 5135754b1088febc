//! One request, and the meaning of its answer.

use super::retry_after::retry_after;
use crate::outputs::{notice::Notice, secret, trust};
use anyhow::{Context, Result, bail};
use std::path::Path;
use std::time::{Duration, SystemTime};
use ureq::http::{HeaderName, HeaderValue, StatusCode, Uri};
use ureq::{Agent, Error};

/// Longest time for one request, from looking up the name to the answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// The receiver of notices.
pub struct Post {
    agent: Agent,
    url: String,
    receiver: String,
    headers: Vec<(HeaderName, HeaderValue)>,
}

/// The meaning of an answer.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// Status 2xx.
    Acknowledged,
    /// The receiver will never accept it.
    Refused(String),
    /// To be tried again, if requested not before this time.
    Later { reason: String, asked: Option<Duration> },
}

impl Post {
    /// # Errors
    /// An invalid address, or one of another scheme than http.
    pub fn new(url: &str, headers: Vec<(HeaderName, HeaderValue)>, ca: Option<&[u8]>) -> Result<Self> {
        let uri: Uri = url.parse().context("--webhook: is no address; https://host/path is needed")?;
        let (Some(scheme @ ("http" | "https")), Some(authority)) = (uri.scheme_str(), uri.authority()) else {
            bail!("--webhook: http:// or https:// with a host is needed");
        };
        // Path, query and password may be secrets.
        let place = authority.as_str().rsplit('@').next().unwrap_or_default();
        let config = Agent::config_builder()
            .timeout_global(Some(PATIENCE))
            .http_status_as_error(false)
            // A redirected POST may arrive as a GET without its body, and be acknowledged.
            .max_redirects(0)
            .max_redirects_will_error(false)
            // A reused connection that broke while idle would look like a failure.
            .max_idle_connections(0)
            .user_agent(concat!("resight/", env!("CARGO_PKG_VERSION")))
            .tls_config(trust::of_webhook(ca))
            .build();
        let receiver = format!("{scheme}://{place}");
        Ok(Post { agent: config.into(), url: url.to_string(), receiver, headers })
    }

    /// Returns the receiver's name, without secrets.
    pub fn receiver(&self) -> &str {
        &self.receiver
    }

    /// Tries once.
    pub fn send(&self, notice: &Notice) -> Answer {
        let mut request = self
            .agent
            .post(&self.url)
            .header("Content-Type", "application/json")
            .header("Idempotency-Key", &notice.id);
        for (name, value) in &self.headers {
            request = request.header(name, value);
        }
        match request.send(notice.body.to_string()) {
            Ok(answer) => {
                let after = answer.headers().get("Retry-After").and_then(|value| value.to_str().ok());
                meaning(answer.status(), after.and_then(|text| retry_after(text, SystemTime::now())))
            }
            Err(reason) => Answer::Later { reason: words(&reason), asked: None },
        }
    }
}

fn meaning(status: StatusCode, asked: Option<Duration>) -> Answer {
    let reason = format!("answers {status}");
    match status.as_u16() {
        200..=299 => Answer::Acknowledged,
        408 | 429 | 500..=599 => Answer::Later { reason, asked },
        300..=399 => {
            Answer::Refused(format!("{reason} (redirects are not followed; give the final address)"))
        }
        _ => Answer::Refused(reason),
    }
}

/// Returns the reason without the address, which may contain a secret.
fn words(reason: &Error) -> String {
    match reason {
        Error::Io(e) if e.get_ref().is_some() => format!("cannot be reached: {e}"), // TLS has its say
        Error::Io(e) => format!("cannot be reached: {}", e.kind()),
        Error::Timeout(_) => format!("gave no answer within {} s", PATIENCE.as_secs()),
        Error::HostNotFound => "its name is not known".to_string(),
        Error::ConnectionFailed => "cannot be reached".to_string(),
        Error::BadUri(_) => "is no address".to_string(),
        other => format!("failed: {other}"),
    }
}

/// Reads headers, each `Name: value` or `@FILE`. Values are never shown.
///
/// # Errors
/// An invalid header, by its name; a file that cannot be read or that others can read.
pub fn headers(arguments: &[String]) -> Result<Vec<(HeaderName, HeaderValue)>> {
    let mut all = Vec::new();
    for argument in arguments {
        match argument.strip_prefix('@') {
            None => all.push(header(argument)?),
            Some(file) => {
                secret::must_be_private("--webhook-header", Path::new(file))?;
                let text = resight::input::read_text(Path::new(file), resight::input::Kind::Secret)
                    .context("--webhook-header")?;
                for line in text.lines().filter(|line| !line.trim().is_empty()) {
                    all.push(header(line)?);
                }
            }
        }
    }
    Ok(all)
}

fn header(text: &str) -> Result<(HeaderName, HeaderValue)> {
    let Some((name, value)) = text.split_once(':') else {
        bail!("--webhook-header: 'Name: value' is needed, a colon is missing");
    };
    let shown = name.trim();
    let name: HeaderName =
        shown.parse().context("--webhook-header: what stands before the colon is no name")?;
    let mut value: HeaderValue = value.trim().parse().with_context(|| {
        format!("--webhook-header {shown}: its value holds characters that no header can")
    })?;
    value.set_sensitive(true);
    Ok((name, value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_2xx_acknowledges_and_only_some_are_tried_again() {
        let of = |code| meaning(StatusCode::from_u16(code).expect("a status"), None);
        assert!([200, 201, 204].into_iter().all(|code| of(code) == Answer::Acknowledged));
        assert!([408, 429, 500, 503, 504].into_iter().all(|code| matches!(of(code), Answer::Later { .. })));
        assert!(
            [301, 308, 400, 401, 404, 410, 413]
                .into_iter()
                .all(|code| matches!(of(code), Answer::Refused(_)))
        );
    }

    #[test]
    fn a_receiver_is_named_without_its_secrets() {
        let url = "https://user:word@hooks.example:8443/T0/secret?token=secret";
        let post = Post::new(url, Vec::new(), None).expect("an address");
        assert_eq!(post.receiver(), "https://hooks.example:8443");
        for wrong in ["ftp://host/", "host/path", "https://", "http://bad host/"] {
            assert!(Post::new(wrong, Vec::new(), None).is_err(), "{wrong}");
        }
    }

    #[test]
    fn headers_are_checked_and_their_values_never_shown() {
        let (name, value) = header("Authorization: Bearer secret:1").expect("a header");
        assert_eq!((name.as_str(), value.to_str().expect("text")), ("authorization", "Bearer secret:1"));
        assert!(value.is_sensitive());
        for wrong in ["no colon secret", "a name: secret", "X: secret\u{1}"] {
            let reported = format!("{:#}", header(wrong).expect_err("no header"));
            assert!(!reported.contains("secret"), "{reported}");
        }
    }
}
