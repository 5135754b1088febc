//! Notices posted to a web address: in order, each until it is acknowledged by a status of 2xx.

mod post;
mod retry_after;

use super::courier::Courier;
use super::notice::{Notice, Notices};
use super::outbox::Outbox;
use super::retry::{Backoff, Standing};
use super::{Common, Output, secret};
use crate::live::Event;
use anyhow::Result;
use post::{Answer, Post};
use std::path::PathBuf;
use tokio::runtime::Runtime;

/// Largest number of waiting notices; alarms are dropped last.
const WAITING: usize = 1000;

/// The settings of the webhook.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WebhookConfig {
    /// The http or https address that notices are posted to, `@FILE`, or `env:VARIABLE`.
    pub url: String,
    /// The session file that contains it; none where it is an argument.
    pub session: Option<PathBuf>,
    /// Headers, `Name: value`, or `@FILE` with one on each line.
    pub headers: Vec<String>,
}

/// Opens the output.
///
/// # Errors
/// An invalid address or header.
pub(super) fn open(config: &WebhookConfig, common: &mut Common<'_>) -> Result<Box<dyn Output>> {
    let url = secret::address("--webhook", &config.url, config.session.as_deref())?;
    let post = Post::new(&url, post::headers(&config.headers)?, common.ca.as_deref())?;
    let receiver = post.receiver().to_string();
    let notices = Notices::new(common.names);
    let courier = Courier::start("webhook", &receiver, WAITING, common, move |outbox, standing, runtime| {
        deliver(&post, &outbox, standing, &runtime);
    })?;
    Ok(Box::new(Webhook { notices, courier }))
}

struct Webhook {
    notices: Notices,
    courier: Courier<Notice>,
}

impl Output for Webhook {
    fn take(&mut self, event: &Event) -> Result<()> {
        if let Some(notice) = self.notices.of(event) {
            self.courier.tell(notice.weight, notice);
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.courier.finish();
        Ok(())
    }
}

/// Delivers notices until the queue is closed and empty.
fn deliver(post: &Post, outbox: &Outbox<Notice>, mut standing: Standing, runtime: &Runtime) {
    let mut backoff = Backoff::new();
    while let Some((_, notice)) = runtime.block_on(outbox.next()) {
        loop {
            match post.send(&notice) {
                Answer::Acknowledged => standing.delivered(outbox.delivered()),
                Answer::Refused(reason) => {
                    standing.refused(outbox.refused(), &format!("{reason}: not tried again"));
                }
                Answer::Later { reason, asked } => {
                    standing.failed(&reason);
                    runtime.block_on(backoff.rest(outbox, asked));
                    continue;
                }
            }
            break;
        }
        backoff.reset();
    }
}
