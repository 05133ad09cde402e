//! The RS-485 line as raw bytes on a TCP socket: every client receives what the unit sends, and the
//! bytes of all clients go out on the line.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{self, Receiver, Sender, SyncSender, TrySendError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use super::Event;

/// Pieces of the line's traffic that may wait for a client that does not read: some seconds' worth.
/// Beyond, it misses them, as anyone does who does not listen.
const WAITING: usize = 1024;

type Clients = Arc<Mutex<Vec<SyncSender<Vec<u8>>>>>;

/// The listening socket, and who has connected.
pub struct Tcp {
    address: SocketAddr,
    clients: Clients,
}

impl Tcp {
    /// Listens at `address` from now on.
    ///
    /// # Errors
    ///
    /// When nothing can listen there, in one line.
    pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<Self, String> {
        let cannot = |error| format!("cannot offer the line over TCP at {address}: {error}");
        let listener = TcpListener::bind(address).map_err(cannot)?;
        let address = listener.local_addr().map_err(cannot)?;
        let clients = Clients::default();
        let joined = Arc::clone(&clients);
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (sender, receiver) = mpsc::sync_channel(WAITING);
                if attend(stream, events.clone(), receiver).is_ok() {
                    joined
                        .lock()
                        .unwrap_or_else(PoisonError::into_inner)
                        .push(sender);
                }
            }
        });
        Ok(Self { address, clients })
    }

    /// Where it listens: with port 0 the system has chosen one.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Lets every client hear these bytes; never waits.
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

/// Two threads for a client: one for each direction, until it goes.
fn attend(
    stream: TcpStream,
    events: Sender<Event>,
    to_client: Receiver<Vec<u8>>,
) -> std::io::Result<()> {
    // A request and its response are short and follow one another: waiting for more would only delay.
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
            if events
                .send(Event::Bytes(buffer[..length].to_vec()))
                .is_err()
            {
                return;
            }
        }
        // The writing thread then ends at its next bytes.
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
    fn clients_speak_and_all_hear() {
        let (events, queue) = mpsc::channel();
        let tcp = Tcp::listen("127.0.0.1:0".parse().unwrap(), events).unwrap();
        let mut first = TcpStream::connect(tcp.address()).unwrap();
        let mut second = TcpStream::connect(tcp.address()).unwrap();
        eventually("both have joined", || {
            tcp.clients.lock().unwrap().len() == 2
        });

        first.write_all(&[1, 2, 3]).unwrap();
        let event = queue.recv_timeout(Duration::from_secs(20)).unwrap();
        assert!(matches!(event, Event::Bytes(bytes) if bytes == [1, 2, 3]));

        tcp.write(&[4, 5]);
        for client in [&mut first, &mut second] {
            let mut heard = [0; 2];
            client.read_exact(&mut heard).unwrap();
            assert_eq!(heard, [4, 5]);
        }

        drop(first);
        eventually("the client that left is dropped", || {
            tcp.write(&[6]);
            tcp.clients.lock().unwrap().len() == 1
        });
    }

    #[test]
    fn a_port_in_use_is_an_error() {
        let taken = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap();
        let text = Tcp::listen(address, mpsc::channel().0).err().unwrap();
        assert!(
            text.contains(&address.to_string()) && text.contains(crate::app::testing::IN_USE),
            "{text}"
        );
    }
}
