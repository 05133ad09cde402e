//! The RS-485 line as raw bytes on a TCP socket: the bytes of all clients are sent on the line, and every client
//! receives all bytes on the line except its own.

use std::io::{Read, Write};
use std::net::SocketAddr;
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;

use super::clients::{self, Client};
use super::{Event, Origin, pass_on};

/// Pieces of received bytes that may wait for a client that does not read. The client misses further pieces.
const WAITING: usize = 1024;

/// The beginnings of the requests that a page in a browser can send without asking the server before. Any page can send
/// them to this computer, and a part of such a request could be a valid frame on the line.
const OF_A_PAGE: [&[u8]; 4] = [b"GET /", b"HEAD /", b"POST /", b"OPTIONS /"];

/// Sends bytes to a client.
struct Outlet {
    client: Weak<Client>,
    bytes: SyncSender<Vec<u8>>,
}

/// The outlets of all clients.
#[derive(Clone, Default)]
struct Outlets(Arc<Mutex<Vec<Outlet>>>);

impl Outlets {
    fn all(&self) -> MutexGuard<'_, Vec<Outlet>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The listening socket and its clients.
pub struct Tcp {
    address: SocketAddr,
    outlets: Outlets,
}

impl Tcp {
    /// Starts to listen at `address`.
    ///
    /// # Errors
    ///
    /// In one line, why the simulator cannot listen there.
    pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<Self, String> {
        let outlets = Outlets::default();
        let joined = outlets.clone();
        let serve = move |client| serve(client, events.clone(), joined.clone());
        let address = clients::listen(address, serve)
            .map_err(|error| format!("cannot offer the line over TCP at {address}: {error}"))?;
        Ok(Self { address, outlets })
    }

    /// Returns the address of the socket: with port 0 the system has chosen the port.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Sends these bytes to every client except `origin`, which has sent them itself; never waits.
    pub fn write(&self, bytes: &[u8], origin: Option<&Origin>) {
        for outlet in &*self.outlets.all() {
            if matches!(origin, Some(Origin::Tcp(client)) if client.ptr_eq(&outlet.client)) {
                continue;
            }
            // A client that reads too slowly, or that has just disconnected, misses them.
            let _ = outlet.bytes.try_send(bytes.to_vec());
        }
    }
}

/// Starts two threads for a client, one for each direction. They end when the client disconnects.
fn serve(client: Client, events: Sender<Event>, outlets: Outlets) {
    // Requests and replies are short and alternate. Collecting more bytes before sending would only delay them. An
    // error means that the client has already disconnected.
    let _ = client.stream().set_nodelay(true);
    let client = Arc::new(client);
    let (bytes, to_client) = mpsc::sync_channel(WAITING);
    outlets.all().push(Outlet {
        client: Arc::downgrade(&client),
        bytes,
    });
    let writing = Arc::clone(&client);
    thread::spawn(move || write(&writing, to_client));
    thread::spawn(move || {
        read(&client, &events);
        client.close();
        // This also ends the writing thread.
        let own = Arc::downgrade(&client);
        outlets.all().retain(|outlet| !outlet.client.ptr_eq(&own));
    });
}

fn write(client: &Client, to_client: Receiver<Vec<u8>>) {
    for bytes in to_client {
        if client.stream().write_all(&bytes).is_err() {
            return;
        }
    }
}

/// Passes on the bytes of a client until it disconnects.
fn read(client: &Arc<Client>, events: &Sender<Event>) {
    let mut buffer = [0; 4096];
    let mut is_first = true;
    while let Ok(length @ 1..) = client.stream().read(&mut buffer) {
        let bytes = &buffer[..length];
        if is_first && OF_A_PAGE.iter().any(|page| bytes.starts_with(page)) {
            return;
        }
        is_first = false;
        client.heard();
        let event = |bytes, hold| Event::Tcp(Arc::downgrade(client), bytes, hold);
        if !pass_on(bytes, event, events) {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::testing::eventually;
    use std::net::TcpStream;
    use std::time::Duration;

    #[test]
    fn bytes_of_a_client_are_an_event_and_clients_receive_all_bytes_except_their_own() {
        let (events, queue) = mpsc::channel();
        let tcp = Tcp::listen("127.0.0.1:0".parse().unwrap(), events).unwrap();
        let mut first = TcpStream::connect(tcp.address()).unwrap();
        let mut second = TcpStream::connect(tcp.address()).unwrap();
        eventually("two clients are not connected", || {
            tcp.outlets.all().len() == 2
        });

        first.write_all(&[1, 2, 3]).unwrap();
        let event = queue.recv_timeout(Duration::from_secs(20)).unwrap();
        let Event::Tcp(client, bytes, hold) = event else {
            panic!("another event");
        };
        assert_eq!(bytes, [1, 2, 3]);
        drop(hold);

        tcp.write(&[1, 2, 3], Some(&Origin::Tcp(client)));
        tcp.write(&[4], Some(&Origin::Pty));
        let mut received = [0; 3];
        second.read_exact(&mut received).unwrap();
        assert_eq!(received, [1, 2, 3]);
        tcp.write(&[5], None);
        for client in [&mut first, &mut second] {
            let mut received = [0; 2];
            client.read_exact(&mut received).unwrap();
            assert_eq!(received, [4, 5]);
        }

        // Nothing is sent to the client, so only the end of the connection shows that it has disconnected.
        drop(first);
        eventually("the disconnected client is not removed", || {
            tcp.outlets.all().len() == 1
        });
    }

    #[test]
    fn request_of_a_page_in_a_browser_is_not_sent_on_the_line() {
        let (events, queue) = mpsc::channel();
        let tcp = Tcp::listen("127.0.0.1:0".parse().unwrap(), events).unwrap();
        for method in ["GET", "HEAD", "POST", "OPTIONS"] {
            let mut page = TcpStream::connect(tcp.address()).unwrap();
            page.set_read_timeout(Some(Duration::from_secs(20)))
                .unwrap();
            // A browser sends its request as a whole; `write!` would send it in pieces.
            let request = format!("{method} / HTTP/1.1\r\nHost: localhost\r\n\r\n");
            page.write_all(request.as_bytes()).unwrap();
            assert!(!matches!(page.read(&mut [0]), Ok(1..)), "{method}");
        }
        let mut master = TcpStream::connect(tcp.address()).unwrap();
        master.write_all(b"G").unwrap();
        let event = queue.recv_timeout(Duration::from_secs(20)).unwrap();
        assert!(matches!(event, Event::Tcp(_, bytes, _) if bytes == b"G"));
    }
}
