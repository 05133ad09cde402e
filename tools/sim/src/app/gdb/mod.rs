//! The GDB server on the core (`--gdb`): one debugger at a time.
//!
//! A thread waits for it and passes its bytes on; the protocol itself (crate gdbstub) runs on the board's own
//! thread, in [`session`], and sees the board through [`target`]. While the debugger has the core halted, no
//! virtual time passes.

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
    /// It has connected; this end is for writing.
    Connected(TcpStream),
    /// Bytes of the protocol.
    Bytes(Vec<u8>),
    /// It has gone.
    Gone,
}

/// Waits for a debugger at `address`; returns where it listens, as with port 0 the system chooses one.
///
/// # Errors
///
/// When nothing can listen there, in one line.
pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<SocketAddr, String> {
    let cannot = |error| format!("cannot offer a GDB server at {address}: {error}");
    let listener = TcpListener::bind(address).map_err(cannot)?;
    let address = listener.local_addr().map_err(cannot)?;
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            // The next one waits until this one has gone.
            if attend(stream, &events).is_none() {
                return;
            }
        }
    });
    Ok(address)
}

/// Passes on what one debugger sends, until it goes; `None` when nobody takes it any more.
fn attend(mut stream: TcpStream, events: &Sender<Event>) -> Option<()> {
    let pass_on = |message| events.send(Event::Gdb(message)).ok();
    let Ok(writing) = stream.try_clone() else {
        return Some(());
    };
    pass_on(Message::Connected(writing))?;
    let mut buffer = [0; 4096];
    while let Ok(length @ 1..) = stream.read(&mut buffer) {
        pass_on(Message::Bytes(buffer[..length].to_vec()))?;
    }
    // That it is closed already does not matter.
    let _ = stream.shutdown(Shutdown::Both);
    pass_on(Message::Gone)
}
