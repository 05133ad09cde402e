//! The clients of the gateway: a thread that reads requests, and one that writes responses, for each.

use std::io::Write;
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender, SyncSender, TryRecvError};
use std::thread;
use std::time::Duration;

use super::Message;
use super::mbap::{self, Request};
use crate::app::Event;

/// Clients that are served at the same time. The connection of another one is closed.
pub const CLIENTS: usize = 32;

/// Requests of a client that wait for the line. Further requests stay in the connection until there is room.
const WAITING: usize = 16;

/// Responses that wait for a client to read them. Beyond, the client is given up.
const UNREAD: usize = 64;

/// So long may a client not read before it is given up.
const PATIENCE: Duration = Duration::from_secs(10);

/// A client, as the thread of the line sees it.
pub struct Client {
    requests: Receiver<Request>,
    /// Where its responses go.
    pub responses: Responses,
    /// Counts the clients.
    _place: Arc<()>,
}

impl Client {
    /// The oldest request that waits.
    ///
    /// # Errors
    ///
    /// There is none now, or there will be none any more.
    pub fn next(&self) -> Result<Request, TryRecvError> {
        self.requests.try_recv()
    }
}

/// Sends responses to a client. Its connection is closed when all of these are gone.
#[derive(Clone)]
pub struct Responses {
    frames: SyncSender<Vec<u8>>,
    stream: Arc<TcpStream>,
}

impl Responses {
    /// Sends a frame; never waits. A client that does not read is given up.
    pub fn send(&self, frame: Vec<u8>) {
        if self.frames.try_send(frame).is_err() {
            let _ = self.stream.shutdown(Shutdown::Both);
        }
    }
}

/// Listens at `address` from now on, and returns where: with port 0 the system chooses one.
///
/// # Errors
///
/// When the address cannot be listened at, in one line.
pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<SocketAddr, String> {
    let cannot = |error| format!("cannot serve Modbus TCP at {address}: {error}");
    let listener = TcpListener::bind(address).map_err(cannot)?;
    let address = listener.local_addr().map_err(cannot)?;
    let places = Arc::new(());
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let place = Arc::clone(&places);
            // The listener has one, and this client.
            if Arc::strong_count(&places) > CLIENTS + 1 {
                continue;
            }
            // A client that is gone already is none.
            let _ = attend(stream, place, events.clone());
        }
    });
    Ok(address)
}

fn attend(stream: TcpStream, place: Arc<()>, events: Sender<Event>) -> std::io::Result<()> {
    // A request and its response are short and follow one another: waiting for more would only delay.
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let (mut from, mut to) = (stream.try_clone()?, stream.try_clone()?);
    let (send_request, requests) = mpsc::sync_channel(WAITING);
    let (frames, to_send) = mpsc::sync_channel::<Vec<u8>>(UNREAD);
    let client = Client {
        requests,
        responses: Responses {
            frames,
            stream: Arc::new(stream),
        },
        _place: place,
    };
    // When the events have no receiver any more, the simulator ends.
    let tell = move |message| drop(events.send(Event::Gateway(message)));
    tell(Message::Joined(client));
    thread::spawn(move || {
        for frame in to_send {
            if to.write_all(&frame).is_err() {
                break;
            }
        }
        let _ = to.shutdown(Shutdown::Both);
    });
    thread::spawn(move || {
        // The connection ends, or what it carries is not Modbus.
        while let Ok(Some(request)) = mbap::read(&mut from) {
            if send_request.send(request).is_err() {
                break;
            }
            tell(Message::Ready);
        }
        drop(send_request);
        tell(Message::Ready);
    });
    Ok(())
}
