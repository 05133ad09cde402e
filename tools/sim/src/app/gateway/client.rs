//! The clients of the gateway: a thread that reads requests, and one that writes responses, for each.

use std::io::Write;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender, SyncSender, TryRecvError};
use std::thread;
use std::time::Duration;

use super::Message;
use super::mbap::{self, Request};
use crate::app::{Event, clients};

/// Most requests of a client that wait in the gateway. Further requests wait in the connection.
const WAITING: usize = 16;

/// Most responses that wait for a client to read them. With more, the client is disconnected.
const UNREAD: usize = 64;

/// A client that does not read for this long is disconnected.
const PATIENCE: Duration = Duration::from_secs(10);

/// A client, as the thread of the line sees it.
pub struct Client {
    requests: Receiver<Request>,
    /// Takes the responses for the client.
    pub responses: Responses,
}

impl Client {
    /// Returns the oldest request that waits.
    ///
    /// # Errors
    ///
    /// No request waits now, or the client has disconnected, or was disconnected.
    pub fn next(&self) -> Result<Request, TryRecvError> {
        match self.responses.client.is_closed() {
            true => Err(TryRecvError::Disconnected),
            false => self.requests.try_recv(),
        }
    }
}

/// Sends responses to a client. The connection is closed when all clones of this are dropped.
#[derive(Clone)]
pub struct Responses {
    frames: SyncSender<Vec<u8>>,
    client: Arc<clients::Client>,
}

impl Responses {
    /// Sends a frame; never waits. A client with too many unread responses is disconnected.
    pub fn send(&self, frame: Vec<u8>) {
        if self.frames.try_send(frame).is_err() {
            self.client.close();
        }
    }
}

/// Starts to listen at `address`, and returns the address: with port 0 the system chooses the port.
///
/// # Errors
///
/// In one line, why the simulator cannot listen there.
pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<SocketAddr, String> {
    // An error means that the client has already disconnected.
    let serve = move |client| drop(serve(client, events.clone()));
    clients::listen(address, serve)
        .map_err(|error| format!("cannot serve Modbus TCP at {address}: {error}"))
}

/// Starts the two threads of a client.
fn serve(client: clients::Client, events: Sender<Event>) -> std::io::Result<()> {
    // Requests and responses are short and alternate. Collecting more bytes before sending would only delay them.
    client.stream().set_nodelay(true)?;
    client.stream().set_write_timeout(Some(PATIENCE))?;
    let client = Arc::new(client);
    let (from, to) = (Arc::clone(&client), Arc::clone(&client));
    let (send_request, requests) = mpsc::sync_channel(WAITING);
    let (frames, to_send) = mpsc::sync_channel::<Vec<u8>>(UNREAD);
    let client = Client {
        requests,
        responses: Responses { frames, client },
    };
    // Sending fails only while the simulator is ending.
    let notify = move |message| drop(events.send(Event::Gateway(message)));
    notify(Message::Joined(client));
    thread::spawn(move || {
        for frame in to_send {
            if to.stream().write_all(&frame).is_err() {
                break;
            }
        }
        to.close();
    });
    thread::spawn(move || {
        // The loop ends when the connection ends or carries something other than Modbus.
        while let Ok(Some(request)) = mbap::read(&mut from.stream()) {
            from.heard();
            if send_request.send(request).is_err() {
                break;
            }
            notify(Message::Ready);
        }
        drop(send_request);
        notify(Message::Ready);
    });
    Ok(())
}
