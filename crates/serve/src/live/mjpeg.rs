//! A camera as motion JPEG, for dashboards: no overlay, and a slow reader gets the newest picture when it is ready.

use super::asked::Asked;
use super::feed::Looker;
use super::pictures::Size;
use super::routes::{live, number};
use super::small::jpeg_at;
use crate::app::App;
use crate::error::Problem;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Query, State};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::timeout;

/// For a client to take a picture.
const PATIENCE: Duration = Duration::from_secs(20);

/// Returns its route.
pub fn routes() -> Router<App> {
    Router::new().route("/cameras.mjpg", get(stream))
}

async fn stream(State(app): State<App>, Query(asked): Query<Asked>) -> Result<Response, Problem> {
    let live = Arc::clone(live(&app)?);
    let camera = number(&live, &asked.camera)?;
    let parts = parts(Looker::one(&live, camera, Size::Small), live.pictures.news());
    let media_type = "multipart/x-mixed-replace; boundary=frame";
    Ok(([(header::CONTENT_TYPE, media_type)], Body::from_stream(parts)).into_response())
}

/// Part after part.
fn parts(mut looker: Looker, mut news: tokio::sync::watch::Receiver<u64>) -> Parts {
    let (sender, receiver) = mpsc::channel::<Bytes>(1);
    tokio::spawn(async move {
        loop {
            tokio::select! {
                changed = news.changed() => if changed.is_err() { return },
                () = sender.closed() => return,
            }
            let Some(picture) = looker.take() else { continue };
            let Some(at) = jpeg_at(&picture) else { continue };
            let jpeg = picture.slice(at..);
            let head =
                format!("--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.len());
            for part in [head.into(), jpeg, Bytes::from_static(b"\r\n")] {
                if !matches!(timeout(PATIENCE, sender.send(part)).await, Ok(Ok(()))) {
                    return;
                }
            }
        }
    });
    Parts(receiver)
}

struct Parts(mpsc::Receiver<Bytes>);

impl futures_core::Stream for Parts {
    type Item = std::io::Result<Bytes>;

    fn poll_next(
        mut self: std::pin::Pin<&mut Self>,
        context: &mut std::task::Context<'_>,
    ) -> std::task::Poll<Option<Self::Item>> {
        self.0.poll_recv(context).map(|part| part.map(Ok))
    }
}
