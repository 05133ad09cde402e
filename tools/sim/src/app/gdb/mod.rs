//! The GDB server on the core (`--gdb`): one debugger at a time.
//!
//! A thread waits for a debugger and passes its bytes on. The protocol (crate gdbstub) runs on the boards' thread: the
//! session with the debugger in [`session`], its access to the board in [`target`]. While the debugger has halted the
//! core, no virtual time passes.

use std::io::Read;
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::Sender;
use std::thread;

use super::Event;

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
    Bytes(Vec<u8>),
    /// The debugger has disconnected.
    Gone,
}

/// Starts to listen at `address` for a debugger, and returns the address: with port 0 the system chooses the port.
///
/// # Errors
///
/// In one line, why the simulator cannot listen there.
pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<SocketAddr, String> {
    let cannot = |error| format!("cannot offer a GDB server at {address}: {error}");
    let listener = TcpListener::bind(address).map_err(cannot)?;
    let address = listener.local_addr().map_err(cannot)?;
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            // A second debugger waits until the first one has disconnected.
            if serve(stream, &events).is_none() {
                return;
            }
        }
    });
    Ok(address)
}

/// Passes on the bytes of a debugger until it disconnects. Returns `None` when the simulator is stopping.
fn serve(mut stream: TcpStream, events: &Sender<Event>) -> Option<()> {
    let pass_on = |message| events.send(Event::Gdb(message)).ok();
    let Ok(writing) = stream.try_clone() else {
        return Some(());
    };
    pass_on(Message::Connected(writing))?;
    let mut buffer = [0; 4096];
    while let Ok(length @ 1..) = stream.read(&mut buffer) {
        pass_on(Message::Bytes(buffer[..length].to_vec()))?;
    }
    // An error means that the connection is already closed.
    let _ = stream.shutdown(Shutdown::Both);
    pass_on(Message::Gone)
}
