//! Notices posted to a web address: in order, each until it is acknowledged by a status of 2xx.

mod post;
mod retry_after;

use super::courier::Courier;
use super::notice::{Notice, Notices};
use super::outbox::Outbox;
use super::retry::{Backoff, Standing};
use super::{Common, Output};
use anyhow::Result;
use clap::Args;
use post::{Answer, Post};
use resight::live::Event;
use tokio::runtime::Runtime;

/// Notices that may wait; alarms are kept longest.
const WAITING: usize = 1000;

/// The webhook.
#[derive(Debug, Args)]
#[command(next_help_heading = "Webhook")]
pub struct WebhookArgs {
    /// Posts a JSON object to this http or https address when a state changes, when it is known who moved, and when a source is lost
    /// or back; tried again until it is acknowledged (status 2xx).
    #[arg(long, hide_short_help = true, value_name = "URL")]
    webhook: Option<String>,
    /// A header for --webhook, 'Name: value', or @FILE with one a line: secrets belong in a file. May be given again.
    #[arg(long, hide_short_help = true, value_name = "HEADER", requires = "webhook")]
    webhook_header: Vec<String>,
}

/// The output, where it was asked for.
///
/// # Errors
/// An address or a header that is none.
pub fn open(args: &WebhookArgs, common: &mut Common<'_>) -> Result<Option<Box<dyn Output>>> {
    let Some(url) = &args.webhook else { return Ok(None) };
    let post = Post::new(url, post::headers(&args.webhook_header)?, common.ca.as_deref())?;
    let receiver = post.receiver().to_string();
    let notices = Notices::new(common.names);
    let courier = Courier::start("webhook", &receiver, WAITING, common, move |outbox, standing, runtime| {
        deliver(&post, &outbox, standing, &runtime);
    })?;
    Ok(Some(Box::new(Webhook { notices, courier })))
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

/// Until the queue is closed and empty.
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
