//! The GDB server on the core (`--gdb`): one debugger at a time.
//!
//! A thread waits for a debugger and passes its bytes on, as fast as they are handled. The protocol (crate gdbstub)
//! runs on the boards' thread: the session with the debugger in [`session`], its access to the board in [`target`].
//! While the debugger has halted the core, no virtual time passes.

use std::io::Read;
use std::net::{SocketAddr, TcpStream};
use std::sync::mpsc::Sender;

use super::clients::{self, Client};
use super::{Event, Hold, pass_on};

mod session;
mod target;
mod wire;

pub use session::Session;
pub use target::Debug;

/// Events from the debugger.
pub enum Message {
    /// A debugger has connected; packets for it are written to this stream.
    Connected(TcpStream),
    /// Bytes from the debugger.
    Bytes(Vec<u8>, Hold),
    /// The debugger has disconnected.
    Gone,
}

/// Starts to listen at `address` for a debugger, and returns the address: with port 0 the system chooses the port.
///
/// # Errors
///
/// In one line, why the simulator cannot listen there.
pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<SocketAddr, String> {
    // A second debugger waits until the first one has disconnected.
    let serve = move |client: Client| {
        // An error means that the connection is already closed, or that the simulator is stopping.
        let _ = serve(client.stream(), &events);
        client.close();
    };
    clients::listen(address, serve)
        .map_err(|error| format!("cannot offer a GDB server at {address}: {error}"))
}

/// Passes on the bytes of a debugger until it disconnects. A client that begins with something else than a debugger
/// does, such as a page in a browser, or with nothing, such as a port scan, does not halt the core.
fn serve(mut stream: &TcpStream, events: &Sender<Event>) -> std::io::Result<()> {
    stream.set_read_timeout(Some(clients::FIRST))?;
    let mut buffer = [0; 4096];
    let mut length = stream.read(&mut buffer)?;
    // An acknowledgement, a packet, or an interrupt.
    if !matches!(buffer[..length].first(), Some(b'+' | b'-' | b'$' | 0x03)) {
        return Ok(());
    }
    stream.set_read_timeout(None)?;
    let pass = |message| events.send(Event::Gdb(message)).is_ok();
    pass(Message::Connected(stream.try_clone()?));
    let bytes = |bytes, hold| Event::Gdb(Message::Bytes(bytes, hold));
    while length > 0 && pass_on(&buffer[..length], bytes, events) {
        length = stream.read(&mut buffer).unwrap_or(0);
    }
    pass(Message::Gone);
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::sync::mpsc::{self, Receiver};
    use std::thread;
    use std::time::Duration;

    use super::*;

    fn server() -> (SocketAddr, Receiver<Event>) {
        let (events, queue) = mpsc::channel();
        let address = listen("127.0.0.1:0".parse().unwrap(), events).unwrap();
        (address, queue)
    }

    /// Returns the next message; waits for it.
    fn next(queue: &Receiver<Event>) -> Message {
        match queue.recv_timeout(Duration::from_secs(60)) {
            Ok(Event::Gdb(message)) => message,
            _ => panic!("no message"),
        }
    }

    #[test]
    fn no_bytes_wait_in_the_queue_behind_those_that_are_not_handled_yet() {
        let (address, queue) = server();
        let mut debugger = TcpStream::connect(address).unwrap();
        let sending = thread::spawn(move || debugger.write_all(&[b'+'; 1 << 20]));
        assert!(matches!(next(&queue), Message::Connected(_)));
        let mut received = 0;
        while received < 1 << 20 {
            let Message::Bytes(bytes, hold) = next(&queue) else {
                panic!("the debugger has disconnected");
            };
            received += bytes.len();
            if received < 100_000 {
                thread::sleep(Duration::from_millis(5));
                assert!(queue.try_recv().is_err(), "more bytes are in the queue");
            }
            drop(hold);
        }
        sending.join().unwrap().unwrap();
        assert!(matches!(next(&queue), Message::Gone));
    }

    #[test]
    fn client_that_does_not_begin_as_a_debugger_is_disconnected_and_does_not_halt_the_core() {
        let (address, queue) = server();
        // A port scan, a page in a browser, and a client that sends nothing.
        drop(TcpStream::connect(address).unwrap());
        let mut page = TcpStream::connect(address).unwrap();
        let order = "$M20000010,4:78563412#3e";
        write!(page, "POST / HTTP/1.1\r\nHost: localhost\r\n\r\n{order}").unwrap();
        let _idle = TcpStream::connect(address).unwrap();
        let mut debugger = TcpStream::connect(address).unwrap();
        debugger.write_all(b"+").unwrap();
        assert!(matches!(next(&queue), Message::Connected(_)));
        let Message::Bytes(bytes, _) = next(&queue) else {
            panic!("the debugger has disconnected");
        };
        assert_eq!(bytes, b"+");
    }
}
