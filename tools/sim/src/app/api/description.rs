//! The OpenAPI description of the interface, made from the functions that carry out the requests and from the types of
//! their bodies.

use utoipa::openapi::{Content, OpenApi as Description, Ref, ResponseBuilder};
use utoipa::{Modify, OpenApi};

/// Returns the description.
pub fn description() -> Description {
    Interface::openapi()
}

#[derive(OpenApi)]
#[openapi(
    info(
        title = "modio-sim",
        description = "Reads and changes virtual modio boards on one RS-485 line. A path below means the first board; with `/api/boards/NAME/` in place of `/api/` it means the board of that name. A request that changes something needs a `Host` that is a loopback name or the simulator's address. If the request has an `Origin`, it must be the simulator's. At most 64 connections are served at the same time; a further one gets status 503."
    ),
    paths(
        super::get_state,
        super::get_frames,
        super::get_boards,
        super::get_endpoints,
        super::get_findings,
        super::get_openapi,
        super::get_faults,
        super::post_faults,
        super::post_dip,
        super::post_power,
        super::outside::post_module,
        super::outside::post_channel,
        super::outside::post_slot_module,
        super::outside::post_slot_channel,
        super::outside::post_terminal,
        super::pdu::post,
        get_events,
    ),
    modifiers(&Replies)
)]
struct Interface;

/// Server-sent events: `state` at the beginning and whenever it has changed, at most ten times a second; `frame` when a
/// frame has ended; `lost`, with the number of missed events, when the client reads too slowly
#[utoipa::path(
    get,
    path = "/api/events",
    responses((
        status = 200,
        description = "The stream; the data of `state` is a State, of `frame` a Frame",
        body = String,
        content_type = "text/event-stream",
    ))
)]
#[expect(dead_code, reason = "`http` carries this request out")]
fn get_events() {}

/// Adds the replies that all requests that change something have in common.
struct Replies;

impl Modify for Replies {
    fn modify(&self, description: &mut Description) {
        for item in description.paths.paths.values_mut() {
            for operation in [&mut item.get, &mut item.post].into_iter().flatten() {
                // By default, each path has the tag of its module in this program.
                operation.tags = None;
            }
            let Some(post) = &mut item.post else {
                continue;
            };
            let foreign = "`Host` or `Origin` is not that of the simulator";
            for (status, what, schema) in [
                ("200", "The state after the request", "State"),
                ("400", "The body is not as described here", "Error"),
                ("403", foreign, "Error"),
                ("413", "The body is longer than 64 KiB", "Error"),
            ] {
                let content = Content::new(Some(Ref::from_schema_name(schema)));
                let reply = ResponseBuilder::new()
                    .description(what)
                    .content("application/json", content);
                let replies = &mut post.responses.responses;
                replies
                    .entry(status.to_owned())
                    .or_insert_with(|| reply.into());
            }
        }
    }
}
