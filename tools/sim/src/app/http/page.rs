//! The files of the page, which are part of the program.

use axum::Router;
use axum::http::header;
use axum::response::IntoResponse;
use axum::routing::get;
use register_map::Module;
use serde_json::json;

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// Path, type and content of each file, except `/modules.js`.
pub const FILES: [(&str, &str, &str); 15] = [
    ("/", HTML, include_str!("../page/index.html")),
    ("/page.css", CSS, include_str!("../page/page.css")),
    ("/board.css", CSS, include_str!("../page/board.css")),
    ("/page.js", SCRIPT, include_str!("../page/page.js")),
    ("/api.js", SCRIPT, include_str!("../page/api.js")),
    ("/board.js", SCRIPT, include_str!("../page/board.js")),
    ("/boards.js", SCRIPT, include_str!("../page/boards.js")),
    ("/channels.js", SCRIPT, include_str!("../page/channels.js")),
    ("/chart.js", SCRIPT, include_str!("../page/chart.js")),
    ("/connect.js", SCRIPT, include_str!("../page/connect.js")),
    ("/faults.js", SCRIPT, include_str!("../page/faults.js")),
    ("/frames.js", SCRIPT, include_str!("../page/frames.js")),
    ("/model.js", SCRIPT, include_str!("../page/model.js")),
    (
        "/terminals.js",
        SCRIPT,
        include_str!("../page/terminals.js"),
    ),
    ("/ui.js", SCRIPT, include_str!("../page/ui.js")),
];

/// Content security policy: the page loads nothing from other servers and has no script in its HTML.
const POLICY: &str = "default-src 'self'; img-src data:; frame-ancestors 'none'";

/// Returns the routes of the page.
pub fn routes<S: Clone + Send + Sync + 'static>() -> Router<S> {
    let modules = get(|| async { file(SCRIPT, modules()) });
    let modules = Router::new().route("/modules.js", modules.fallback(super::not_get));
    FILES
        .into_iter()
        .fold(modules, |router, (path, kind, text)| {
            let page = get(move || async move { file(kind, text) });
            router.route(path, page.fallback(super::not_get))
        })
}

/// Returns the script with the name and the description of every module.
fn modules() -> String {
    let modules = Module::ALL.map(|module| [module.name(), module.about()]);
    format!("export const modules = {};\n", json!(modules))
}

fn file(kind: &'static str, text: impl IntoResponse) -> impl IntoResponse {
    let headers = [
        (header::CONTENT_TYPE, kind),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        // A newer simulator at the same address may have a newer page.
        (header::CACHE_CONTROL, "no-cache"),
    ];
    (headers, text)
}
