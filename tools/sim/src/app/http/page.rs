//! The front panel: files that are part of the program.

use axum::Router;
use axum::http::header;
use axum::response::IntoResponse;
use axum::routing::get;

/// Path, type and content of each file.
const FILES: [(&str, &str, &str); 4] = [
    (
        "/",
        "text/html; charset=utf-8",
        include_str!("../page/index.html"),
    ),
    (
        "/page.css",
        "text/css; charset=utf-8",
        include_str!("../page/page.css"),
    ),
    (
        "/page.js",
        "text/javascript; charset=utf-8",
        include_str!("../page/page.js"),
    ),
    (
        "/model.js",
        "text/javascript; charset=utf-8",
        include_str!("../page/model.js"),
    ),
];

/// The page needs nothing from elsewhere and no script in its text.
const POLICY: &str = "default-src 'self'; img-src data:; frame-ancestors 'none'";

/// The routes of the page.
pub fn routes<S: Clone + Send + Sync + 'static>() -> Router<S> {
    FILES
        .into_iter()
        .fold(Router::new(), |router, (path, kind, text)| {
            let page = get(move || async move { file(kind, text) });
            router.route(path, page.fallback(super::not_get))
        })
}

fn file(kind: &'static str, text: &'static str) -> impl IntoResponse {
    let headers = [
        (header::CONTENT_TYPE, kind),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        // A newer simulator at the same address has a newer page.
        (header::CACHE_CONTROL, "no-cache"),
    ];
    (headers, text)
}
