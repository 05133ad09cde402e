//! The files of the page, which are part of the program.

use axum::Router;
use axum::http::header;
use axum::response::IntoResponse;
use axum::routing::get;
use register_map::Module;
use register_map::codes::{Command, LinkAction};
use register_map::configuration::{COMMAND, KEY, OPENING_KEY, RANGE, SCALE};
use register_map::links::LINKS;
use register_map::points::{self, Kind};
use serde_json::json;

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// Path, type and content of each file, except `/map.js`.
pub const FILES: [(&str, &str, &str); 19] = [
    ("/", HTML, include_str!("../page/index.html")),
    ("/page.css", CSS, include_str!("../page/page.css")),
    ("/board.css", CSS, include_str!("../page/board.css")),
    ("/page.js", SCRIPT, include_str!("../page/page.js")),
    ("/api.js", SCRIPT, include_str!("../page/api.js")),
    ("/board.js", SCRIPT, include_str!("../page/board.js")),
    ("/boards.js", SCRIPT, include_str!("../page/boards.js")),
    ("/channels.js", SCRIPT, include_str!("../page/channels.js")),
    ("/chart.js", SCRIPT, include_str!("../page/chart.js")),
    ("/coils.js", SCRIPT, include_str!("../page/coils.js")),
    ("/connect.js", SCRIPT, include_str!("../page/connect.js")),
    ("/events.js", SCRIPT, include_str!("../page/events.js")),
    ("/faults.js", SCRIPT, include_str!("../page/faults.js")),
    ("/frames.js", SCRIPT, include_str!("../page/frames.js")),
    ("/links.js", SCRIPT, include_str!("../page/links.js")),
    ("/modbus.js", SCRIPT, include_str!("../page/modbus.js")),
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
    let map = get(|| async { file(SCRIPT, map()) });
    let map = Router::new().route("/map.js", map.fallback(super::not_get));
    FILES.into_iter().fold(map, |router, (path, kind, text)| {
        let page = get(move || async move { file(kind, text) });
        router.route(path, page.fallback(super::not_get))
    })
}

/// Returns the script with the part of the register map that the page needs: the modules with their descriptions, the
/// actions of links, registers, and for each RANGE and SCALE of an analog input its unit and the power of ten of its step.
fn map() -> String {
    let modules = Module::ALL.map(|module| [module.name(), module.about()]);
    let actions = LinkAction::NAMES;
    let registers = json!({
        "links": LINKS, "key": KEY, "openingKey": OPENING_KEY, "command": COMMAND, "save": Command::Save.code(),
        "range": RANGE, "scale": SCALE,
    });
    let readings = points::readings(Kind::WordInput).iter().map(|reading| {
        json!([
            reading.signal.code(),
            reading.scale.code(),
            reading.unit.code,
            reading.unit.exponent
        ])
    });
    let parts = [
        ("modules", json!(modules)),
        ("actions", json!(actions)),
        ("registers", registers),
        ("readings", readings.collect()),
    ];
    parts
        .map(|(name, value)| format!("export const {name} = {value};\n"))
        .concat()
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
