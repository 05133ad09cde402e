//! The RS-485 line as raw bytes on a TCP socket: every client receives the bytes that the units send, and the bytes of
//! all clients are sent on the line.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{self, Receiver, Sender, SyncSender, TrySendError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use super::{Event, pass_on};

/// Pieces of received bytes that may wait for a client that does not read. The client misses further pieces.
const WAITING: usize = 1024;

type Clients = Arc<Mutex<Vec<SyncSender<Vec<u8>>>>>;

/// The listening socket and its clients.
pub struct Tcp {
    address: SocketAddr,
    clients: Clients,
}

impl Tcp {
    /// Starts to listen at `address`.
    ///
    /// # Errors
    ///
    /// In one line, why the simulator cannot listen there.
    pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<Self, String> {
        let cannot = |error| format!("cannot offer the line over TCP at {address}: {error}");
        let listener = TcpListener::bind(address).map_err(cannot)?;
        let address = listener.local_addr().map_err(cannot)?;
        let clients = Clients::default();
        let joined = Arc::clone(&clients);
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (sender, receiver) = mpsc::sync_channel(WAITING);
                if serve(stream, events.clone(), receiver).is_ok() {
                    joined
                        .lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .push(sender);
                }
            }
        });
        Ok(Self { address, clients })
    }

    /// The address of the socket: with port 0 the system has chosen the port.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Sends these bytes to every client; never waits.
    pub fn write(&self, bytes: &[u8]) {
        let mut clients = self.clients.lock().unwrap_or_else(PoisonError::into_inner);
        clients.retain(|client| {
            !matches!(
                client.try_send(bytes.to_vec()),
                Err(TrySendError::Disconnected(_))
            )
        });
    }
}

/// Starts two threads for a client, one for each direction. They end when the client disconnects.
fn serve(
    stream: TcpStream,
    events: Sender<Event>,
    to_client: Receiver<Vec<u8>>,
) -> std::io::Result<()> {
    // Requests and replies are short and alternate. Collecting more bytes before sending would only delay them.
    stream.set_nodelay(true)?;
    let (mut from, mut to) = (stream.try_clone()?, stream);
    thread::spawn(move || {
        for bytes in to_client {
            if to.write_all(&bytes).is_err() {
                return;
            }
        }
    });
    thread::spawn(move || {
        let mut buffer = [0; 4096];
        while let Ok(length @ 1..) = from.read(&mut buffer) {
            if !pass_on(&buffer[..length], Event::Bytes, &events) {
                return;
            }
        }
        // The writing thread ends when it next writes.
        let _ = from.shutdown(std::net::Shutdown::Both);
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    fn eventually(what: &str, mut is: impl FnMut() -> bool) {
        let end = Instant::now() + Duration::from_secs(20);
        while !is() {
            assert!(Instant::now() < end, "{what}");
            thread::sleep(Duration::from_millis(2));
        }
    }

    #[test]
    fn bytes_of_a_client_are_an_event_and_all_clients_receive_written_bytes() {
        let (events, queue) = mpsc::channel();
        let tcp = Tcp::listen("127.0.0.1:0".parse().unwrap(), events).unwrap();
        let mut first = TcpStream::connect(tcp.address()).unwrap();
        let mut second = TcpStream::connect(tcp.address()).unwrap();
        eventually("two clients are not connected", || {
            tcp.clients.lock().unwrap().len() == 2
        });

        first.write_all(&[1, 2, 3]).unwrap();
        let event = queue.recv_timeout(Duration::from_secs(20)).unwrap();
        assert!(matches!(event, Event::Bytes(bytes, _) if bytes == [1, 2, 3]));

        tcp.write(&[4, 5]);
        for client in [&mut first, &mut second] {
            let mut received = [0; 2];
            client.read_exact(&mut received).unwrap();
            assert_eq!(received, [4, 5]);
        }

        drop(first);
        eventually("the disconnected client is not removed", || {
            tcp.write(&[6]);
            tcp.clients.lock().unwrap().len() == 1
        });
    }

    #[test]
    fn port_in_use_is_an_error() {
        let taken = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap();
        let text = Tcp::listen(address, mpsc::channel().0).err().unwrap();
        assert!(
            text.contains(&address.to_string()) && text.contains(crate::app::testing::IN_USE),
            "{text}"
        );
    }
}
