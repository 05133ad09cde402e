//! Limits the clients of an endpoint on TCP, so that connections that nobody uses cannot shut others out, and cannot
//! use up the threads, the memory or the open files of the simulator.

use std::io;
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Most clients of an endpoint at the same time.
pub const MOST: usize = 32;

/// Time that a further client waits for a place, before another client is disconnected for it. A port scan, whose
/// connections end immediately, therefore disconnects nobody.
const WAIT: Duration = Duration::from_secs(1);

/// Pause after the system could not accept a connection, for example because too many files are open.
const PAUSE: Duration = Duration::from_millis(100);

/// Time in which a client of an endpoint for one client must send its first bytes.
pub const FIRST: Duration = Duration::from_secs(10);

/// The connections of an endpoint.
#[derive(Default)]
struct Open {
    links: Mutex<Vec<Arc<Link>>>,
    /// Notified when a client has given its place back.
    freed: Condvar,
}

struct Link {
    stream: TcpStream,
    /// Time at which the client sent something last; `None` if it has sent nothing yet.
    heard: Mutex<Option<Instant>>,
    closed: AtomicBool,
}

impl Link {
    fn heard(&self) -> MutexGuard<'_, Option<Instant>> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn close(&self) {
        self.closed.store(true, Ordering::Release);
        // An error means that the connection is already closed.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

/// A client of an endpoint. It has its place until this is dropped.
pub struct Client {
    link: Arc<Link>,
    open: Arc<Open>,
}

impl Client {
    /// Returns the connection.
    pub fn stream(&self) -> &TcpStream {
        &self.link.stream
    }

    /// Notes that the client has sent something. Of the clients that send, the client with the longest silence loses its
    /// place first.
    pub fn heard(&self) {
        *self.link.heard() = Some(Instant::now());
    }

    /// Closes the connection in both directions, which also ends the threads that read or write.
    pub fn close(&self) {
        self.link.close();
    }

    /// Returns whether the simulator has closed the connection.
    pub fn is_closed(&self) -> bool {
        self.link.closed.load(Ordering::Acquire)
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        self.open
            .links()
            .retain(|link| !Arc::ptr_eq(link, &self.link));
        self.open.freed.notify_all();
    }
}

impl Open {
    fn links(&self) -> MutexGuard<'_, Vec<Arc<Link>>> {
        self.links.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives a new client a place. If there is none, and none becomes free, the client that has been silent for the
    /// longest is disconnected: first those that have never sent anything.
    fn admit(self: &Arc<Self>, stream: TcpStream) -> Client {
        let mut links = self.links();
        while links.len() >= MOST {
            let waited = self.freed.wait_timeout(links, WAIT);
            let (guard, timeout) = waited.unwrap_or_else(PoisonError::into_inner);
            links = guard;
            if timeout.timed_out() && links.len() >= MOST {
                // `None` is less than every instant. The links are in the order in which they were made.
                let silent = links.iter().min_by_key(|link| *link.heard());
                silent.inspect(|link| link.close());
            }
        }
        let link = Arc::new(Link {
            stream,
            heard: Mutex::new(None),
            closed: AtomicBool::new(false),
        });
        links.push(Arc::clone(&link));
        Client {
            link,
            open: Arc::clone(self),
        }
    }
}

/// Starts to listen at `address`, and returns the address: with port 0 the system chooses the port. `serve` is called
/// with each client; the next one is accepted after it has returned.
///
/// # Errors
///
/// The simulator cannot listen there.
pub fn listen(
    address: SocketAddr,
    mut serve: impl FnMut(Client) + Send + 'static,
) -> io::Result<SocketAddr> {
    let listener = TcpListener::bind(address)?;
    let address = listener.local_addr()?;
    let open = Arc::<Open>::default();
    thread::spawn(move || {
        loop {
            match listener.accept() {
                Ok((stream, _)) => serve(open.admit(stream)),
                Err(_) => thread::sleep(PAUSE),
            }
        }
    });
    Ok(address)
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};

    use super::*;

    /// Returns an endpoint that sends back the bytes that it receives.
    fn echo() -> SocketAddr {
        let serve = |client: Client| {
            thread::spawn(move || {
                let mut buffer = [0; 16];
                while let Ok(length @ 1..) = client.stream().read(&mut buffer) {
                    client.heard();
                    let _ = client.stream().write_all(&buffer[..length]);
                }
            });
        };
        listen("127.0.0.1:0".parse().unwrap(), serve).unwrap()
    }

    fn connect(address: SocketAddr) -> TcpStream {
        let stream = TcpStream::connect(address).unwrap();
        let patience = Some(Duration::from_secs(20));
        stream.set_read_timeout(patience).unwrap();
        stream
    }

    /// Returns whether the endpoint answers.
    fn answers(mut stream: &TcpStream) -> bool {
        stream.write_all(b"x").is_ok() && matches!(stream.read(&mut [0]), Ok(1))
    }

    #[test]
    fn new_client_replaces_the_one_that_has_been_silent_for_the_longest() {
        let address = echo();
        let clients: Vec<_> = (0..MOST).map(|_| connect(address)).collect();
        // The first and the fourth client never send anything.
        let mut speaking = clients.iter().enumerate();
        assert!(speaking.all(|(n, client)| n == 0 || n == 3 || answers(client)));
        let more: Vec<_> = (0..3)
            .map(|_| {
                let client = connect(address);
                assert!(answers(&client));
                client
            })
            .collect();
        // The third new client has replaced the second client, because that one sent before all others.
        for n in [0, 3, 1] {
            assert!(!answers(&clients[n]), "client {n} is still connected");
        }
        let kept = clients.iter().enumerate();
        let kept: Vec<_> = kept.filter(|(n, _)| ![0, 3, 1].contains(n)).collect();
        assert!(kept.iter().all(|(_, client)| answers(client)));
        assert!(more.iter().all(answers));
    }

    #[test]
    fn connections_that_end_immediately_disconnect_nobody() {
        let address = echo();
        let silent = connect(address);
        (0..300).for_each(|_| drop(connect(address)));
        assert!(answers(&connect(address)));
        assert!(answers(&silent));
    }
}
