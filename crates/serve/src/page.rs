//! The page's files, compiled in.

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::Request;
use axum::http::{HeaderName, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use sha2::{Digest, Sha256};

const FILES: [(&str, &str, &[u8]); 3] = [
    ("/", "text/html; charset=utf-8", include_bytes!("../page/index.html")),
    ("/app.js", "text/javascript; charset=utf-8", include_bytes!("../page/app.js")),
    ("/app.css", "text/css; charset=utf-8", include_bytes!("../page/app.css")),
];

/// Their routes.
pub fn routes<S: Clone + Send + Sync + 'static>() -> Router<S> {
    FILES.iter().fold(Router::new(), |router, (path, media_type, bytes)| {
        let digest = Sha256::digest(bytes);
        let tag = format!("\"{}\"", digest.iter().take(12).map(|b| format!("{b:02x}")).collect::<String>());
        router.route(
            path,
            get(move |request: Request| async move {
                is_known(&request, &tag)
                    .unwrap_or_else(|| file(&tag, media_type, Bytes::from_static(bytes).into()))
            }),
        )
    })
}

/// Returns the answer to a browser that has the file of this tag already.
pub fn is_known(request: &Request, tag: &str) -> Option<Response> {
    let known = request.headers().get(header::IF_NONE_MATCH)?.to_str().ok()?;
    let is_there = known.split(',').any(|one| one.trim() == tag);
    is_there.then(|| (StatusCode::NOT_MODIFIED, headers(tag)).into_response())
}

/// Returns a file with its tag.
pub fn file(tag: &str, media_type: &'static str, body: Body) -> Response {
    (headers(tag), [(header::CONTENT_TYPE, media_type)], body).into_response()
}

fn headers(tag: &str) -> [(HeaderName, String); 2] {
    [(header::ETAG, tag.to_owned()), (header::CACHE_CONTROL, "no-cache".to_owned())]
}
