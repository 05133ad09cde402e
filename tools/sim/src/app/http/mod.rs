//! The HTTP server: sends the page, passes requests to the boards' thread, and sends the replies.

mod connections;
mod guard;
mod page;
#[cfg(test)]
mod tests;

use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::thread;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{Method, StatusCode, Uri, header};
use axum::response::sse::{self, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::{Semaphore, broadcast, oneshot};
use tokio_stream::StreamExt;
use tokio_stream::wrappers::BroadcastStream;
use tokio_stream::wrappers::errors::BroadcastStreamRecvError::Lagged;

use super::live::Note;
use super::{Event, api};
use connections::Bounded;
use guard::Guard;

/// Longest body that is accepted, in bytes. A valid body is much shorter.
const LONGEST_BODY: usize = 64 * 1024;
/// Longest body that is read to its end before it is refused, in bytes. Some clients read the reply only after they
/// have sent the whole body.
const MOST_TO_DROP: usize = 64 * 1024 * 1024;
/// A client that sends nothing of its body for this long is refused.
const PATIENCE: Duration = Duration::from_secs(30);
/// Most streams of events at the same time. The other connections stay free for requests that end.
const STREAMS: usize = 48;

/// Starts to serve at `address`, and returns the address: with port 0 the system chooses the port. `live` carries the
/// events that `/api/events` streams.
///
/// # Errors
///
/// In one line, why the simulator cannot listen there.
pub fn listen(
    address: SocketAddr,
    events: Sender<Event>,
    live: broadcast::Sender<Note>,
) -> Result<SocketAddr, String> {
    serve(address, events, live, connections::PATIENCE)
}

/// Does the same as [`listen`]. A connection over which nothing can be sent for `patience` is closed.
fn serve(
    address: SocketAddr,
    events: Sender<Event>,
    live: broadcast::Sender<Note>,
    patience: Duration,
) -> Result<SocketAddr, String> {
    let cannot = |error: std::io::Error| {
        format!("cannot serve HTTP at {address}: {error} (choose another address with --http ADDR)")
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(cannot)?;
    let listener = TcpListener::bind(address).map_err(cannot)?;
    listener.set_nonblocking(true).map_err(cannot)?;
    let bound = listener.local_addr().map_err(cannot)?;
    let listener = {
        let _in_runtime = runtime.enter();
        tokio::net::TcpListener::from_std(listener).map_err(cannot)?
    };
    let server = Server {
        events,
        live,
        guard: Guard::new(bound),
        requests: Arc::new(Semaphore::new(connections::MOST)),
        streams: Arc::new(Semaphore::new(STREAMS)),
    };
    let app = Router::new()
        .merge(page::routes())
        .route("/api/events", get(stream_of_first).fallback(not_get))
        .route(
            "/api/boards/{name}/events",
            get(stream_of).fallback(not_get),
        )
        .fallback(ask)
        .with_state(server);
    thread::spawn(move || {
        // The server ends with the program.
        let _ =
            runtime.block_on(async { axum::serve(Bounded::new(listener, patience), app).await });
    });
    Ok(bound)
}

/// The state that every request handler gets.
#[derive(Clone)]
pub struct Server {
    events: Sender<Event>,
    live: broadcast::Sender<Note>,
    guard: Guard,
    /// Free places for requests in the queue of the boards' thread.
    requests: Arc<Semaphore>,
    /// Free places for streams of events.
    streams: Arc<Semaphore>,
}

impl Server {
    /// Sends a request to the boards' thread and returns its reply.
    async fn board(&self, request: api::Request) -> api::Reply {
        let stopping = || api::Reply::error(503, "the simulator is stopping");
        let place = Arc::clone(&self.requests).acquire_owned().await;
        let (reply, answer) = oneshot::channel();
        if self.events.send(Event::Request(request, reply)).is_err() {
            return stopping();
        }
        // A separate task keeps the place until the boards' thread has replied. When the client disconnects, this
        // function ends earlier.
        let answered = tokio::spawn(async move {
            let reply = answer.await;
            drop(place);
            reply
        });
        match answered.await {
            Ok(Ok(reply)) => reply,
            _ => stopping(),
        }
    }

    /// Returns the reply to `GET target`.
    async fn get(&self, target: &str) -> api::Reply {
        self.board(api::Request {
            method: "GET".to_owned(),
            target: target.to_owned(),
            body: Vec::new(),
        })
        .await
    }
}

async fn ask(State(server): State<Server>, request: axum::extract::Request) -> api::Reply {
    let (head, body) = request.into_parts();
    if head.method != Method::GET
        && let Err(why) = server.guard.check(&head.headers)
    {
        return api::Reply::error(403, why);
    }
    let announced = head
        .headers
        .get(header::CONTENT_LENGTH)
        .and_then(|length| length.to_str().ok()?.parse().ok());
    match whole(body, announced.unwrap_or(0)).await {
        Err(refusal) => refusal,
        Ok(body) => {
            server
                .board(api::Request {
                    method: head.method.to_string(),
                    target: target(&head.uri),
                    body,
                })
                .await
        }
    }
}

/// Returns path and query of a request.
fn target(uri: &Uri) -> String {
    uri.path_and_query()
        .map_or_else(|| uri.path().to_owned(), ToString::to_string)
}

/// Reads the body of a request. `announced` is the length in its header `Content-Length`, in bytes.
async fn whole(body: Body, announced: u64) -> Result<Vec<u8>, api::Reply> {
    let too_long = || api::Reply::error(413, "the body is longer than 64 KiB");
    if announced > MOST_TO_DROP as u64 {
        return Err(too_long());
    }
    let mut whole = Vec::new();
    let mut length: usize = 0;
    let mut pieces = body.into_data_stream();
    while let Some(piece) = tokio::time::timeout(PATIENCE, pieces.next())
        .await
        .unwrap_or_else(|_| Some(Err(axum::Error::new("the client sends nothing"))))
    {
        let piece = piece.map_err(|_| api::Reply::error(400, "the body is not complete"))?;
        length = length.saturating_add(piece.len());
        if length > MOST_TO_DROP {
            break;
        }
        if length <= LONGEST_BODY {
            whole.extend(piece);
        }
    }
    if length > LONGEST_BODY {
        return Err(too_long());
    }
    Ok(whole)
}

async fn not_get() -> api::Reply {
    api::Reply::error(405, "this path accepts GET only")
}

async fn stream_of_first(State(server): State<Server>) -> Result<Response, api::Reply> {
    stream(server, 0, "/api/state").await
}

async fn stream_of(
    State(server): State<Server>,
    Path(name): Path<String>,
) -> Result<Response, api::Reply> {
    let boards = server.get("/api/boards").await.body;
    let mut names = boards.as_array().into_iter().flatten();
    match names.position(|board| board["name"] == name) {
        Some(board) => stream(server, board, &format!("/api/boards/{name}/state")).await,
        None => Err(api::Reply::error(404, format!("there is no board {name}"))),
    }
}

/// Streams server-sent events: the state of a board, and then its changes and the frames on the line.
async fn stream(server: Server, board: usize, state: &str) -> Result<Response, api::Reply> {
    let Ok(place) = Arc::clone(&server.streams).try_acquire_owned() else {
        let what = format!("too many streams of events: {STREAMS} are open");
        return Err(api::Reply::error(503, what));
    };
    // Subscribe before reading the state, so that no event between the two is missed.
    let notes = BroadcastStream::new(server.live.subscribe());
    let state = server.get(state).await;
    if state.status != 200 {
        return Err(state);
    }
    let first = event("state", state.body.to_string());
    let then = notes.filter_map(move |note| match note {
        Ok(note) if note.board.is_some_and(|about| about != board) => None,
        Ok(note) => Some(event(note.name, note.data.as_ref())),
        // A client that reads too slowly can read the state and the frames again.
        Err(Lagged(count)) => Some(event("lost", count.to_string())),
    });
    let all = tokio_stream::once(first).chain(then).map(move |event| {
        // The stream keeps its place until it ends.
        let _ = &place;
        Ok::<_, Infallible>(event)
    });
    let events = Sse::new(all).keep_alive(KeepAlive::default());
    Ok(events.into_response())
}

fn event(name: &str, data: impl AsRef<str>) -> sse::Event {
    sse::Event::default().event(name).data(data)
}

impl IntoResponse for api::Reply {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let json = [(header::CONTENT_TYPE, "application/json")];
        (status, json, self.body.to_string()).into_response()
    }
}
