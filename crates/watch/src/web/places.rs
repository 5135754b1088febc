//! The limited number of connections: the slowest is closed when another one needs an answer. A connection without a request goes first, then
//! the one whose request arrives most slowly; one that is being answered stays.

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::Request;
use axum::http::StatusCode;
use axum::response::Response;
use hyper::body::{Frame, SizeHint};
use std::collections::BTreeMap;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// A connection that is younger, or whose request began later, is not closed for another one.
const GRACE: Duration = Duration::from_secs(1);

/// The activity of a connection.
#[derive(Debug, Clone, Copy)]
enum Doing {
    /// It has sent no request, or has its answer.
    Nothing,
    /// The body of its request is arriving.
    Sending { bytes: u64 },
    /// It is being answered, or has become a WebSocket.
    Answered,
}

struct Kept {
    doing: Doing,
    since: Instant,
    leave: Arc<Notify>,
}

/// All connections.
#[derive(Default)]
pub(super) struct Places {
    kept: Mutex<(u64, BTreeMap<u64, Kept>)>,
}

/// A connection, until it is dropped.
pub(super) struct Place {
    places: Arc<Places>,
    number: u64,
    /// Notified when the connection is to be closed.
    pub leave: Arc<Notify>,
}

impl Places {
    /// Adds a connection.
    pub fn take(self: &Arc<Self>) -> Place {
        let leave = Arc::new(Notify::new());
        let mut all = self.lock();
        all.0 += 1;
        let number = all.0;
        all.1
            .insert(number, Kept { doing: Doing::Nothing, since: Instant::now(), leave: Arc::clone(&leave) });
        Place { places: Arc::clone(self), number, leave }
    }

    /// Closes the slowest connection; returns whether there is one that may be closed.
    pub fn leave_one(&self) -> bool {
        let now = Instant::now();
        let all = self.lock();
        let age = |kept: &Kept| now.duration_since(kept.since);
        let slow = all.1.values().filter(|kept| GRACE < age(kept)).filter_map(|kept| match kept.doing {
            Doing::Nothing => Some((-age(kept).as_secs_f64() - 1e6, kept)),
            Doing::Sending { bytes } => Some((bytes as f64 / age(kept).as_secs_f64(), kept)),
            Doing::Answered => None,
        });
        let slowest = slow.min_by(|a, b| a.0.total_cmp(&b.0));
        slowest.map(|(_, kept)| kept.leave.notify_one()).is_some()
    }

    fn set(&self, number: u64, doing: Doing) {
        if let Some(kept) = self.lock().1.get_mut(&number) {
            (kept.doing, kept.since) = (doing, Instant::now());
        }
    }

    fn add(&self, number: u64, more: u64) {
        if let Some(Kept { doing: Doing::Sending { bytes }, .. }) = self.lock().1.get_mut(&number) {
            *bytes += more;
        }
    }

    fn lock(&self) -> MutexGuard<'_, (u64, BTreeMap<u64, Kept>)> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Place {
    /// Returns the request with a body that records its progress.
    pub fn asked(&self, request: Request) -> Request {
        self.places.set(self.number, Doing::Sending { bytes: 0 });
        if request.body().is_end_stream() {
            self.places.set(self.number, Doing::Answered);
            return request;
        }
        request.map(|body| Body::new(Counted { body, end: self.end(Doing::Answered) }))
    }

    /// Returns the answer with a body that records its end.
    pub fn answered(&self, response: Response) -> Response {
        self.places.set(self.number, Doing::Answered);
        if response.status() == StatusCode::SWITCHING_PROTOCOLS {
            return response;
        }
        response.map(|body| Body::new(Counted { body, end: self.end(Doing::Nothing) }))
    }

    fn end(&self, then: Doing) -> End {
        End { places: Arc::clone(&self.places), number: self.number, then }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.lock().1.remove(&self.number);
    }
}

/// The state after a body has ended or was given up.
struct End {
    places: Arc<Places>,
    number: u64,
    then: Doing,
}

impl Drop for End {
    fn drop(&mut self) {
        self.places.set(self.number, self.then);
    }
}

struct Counted {
    body: Body,
    end: End,
}

impl HttpBody for Counted {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let polled = Pin::new(&mut self.body).poll_frame(context);
        if let Poll::Ready(Some(Ok(frame))) = &polled
            && let Some(data) = frame.data_ref()
        {
            self.end.places.add(self.end.number, data.len() as u64);
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
