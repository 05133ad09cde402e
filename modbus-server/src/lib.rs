//! A Modbus serial-line server (slave): from the characters of a request to the characters of its
//! reply.
//!
//! `no_std`, no allocation, no `unsafe`, no panic; it knows no hardware and no register map. The
//! device around it brings a UART, a timer for the silent times and a [`DataModel`] of its points
//! and registers.
//!
//! A [`line::Port`] is a line without hardware: characters and silences go in, the characters of replies come out. A
//! [`Server`] serves the requests that wait there, at once with [`Server::serve`], or step by step with
//! [`Server::take`], where each step needs only the port or only the model:
//!
//! ```text
//!  characters   +-------------------------+   take, answer, finish   +--------+   decide, carry out   +-----------+
//!  ------------>|       line::Port        |<------------------------>| Server |<--------------------->| DataModel |
//!  <------------| Receiver -- Transmitter |                          +--------+                       +-----------+
//!  silences     +-------------------------+
//! ```
//!
//! The steps let a reply start at once, however long the request: its first byte, the unit address, may go when the
//! request is taken, and its beginning when it is decided upon, which touches nothing; the work is done while those
//! bytes are on the wire. The buffers ([`Adu`]) move by ownership from hand to hand; nothing is copied.
//!
//! A caller without a timer for the silences has [`line::TimedPort`].
//!
//! RTU and ASCII mode differ in the [line](mod@line) alone: one [`line::Receiver`] and one
//! [`line::Transmitter`] speak both.
//!
//! What a broadcast may do: write, by functions 05, 06, 0F, 10 and 16. All else has no effect, also
//! 17, for which a broadcast's silence would lose the read, and 08, lest one frame silences all
//! units of a line.
//!
//! ```
//! use modbus_server::line::{Faults, Framing, Next, Port, Receiver};
//! use modbus_server::{Adu, Server, Tables};
//!
//! // The device: ten holding registers. One with rules of its own implements `DataModel`.
//! let mut registers = [0x1111; 10];
//! let mut tables = Tables { holding_registers: &mut registers, ..Tables::default() };
//!
//! let mut server = Server::new(17, Framing::Rtu);
//! let mut buffers = [Adu::new(), Adu::new()];
//! let mut port = Port::new(Receiver::rtu(17, false), &mut buffers);
//!
//! port.long_silence(0); // the line has been silent: the port listens from here on
//! for byte in [0x11, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x5B] {
//!     port.received(byte, Faults::NONE);
//! }
//! if port.long_silence(0) {
//!     server.serve(&mut port, 0, &mut tables);
//! }
//!
//! let mut reply: Vec<u8> = port.start().into_iter().collect(); // turn the driver on
//! while let Next::Byte(byte) = port.next() {
//!     reply.push(byte);
//! }
//! port.sent(); // turn the driver off
//! assert_eq!(reply, [0x11, 0x03, 0x02, 0x11, 0x11, 0xB5, 0xDB]);
//! ```
//!
//! "V1.02" in the comments is *Modbus over Serial Line, Specification and Implementation Guide
//! V1.02*, "V1.1b3" is *Modbus Application Protocol Specification V1.1b3*, both of the Modbus
//! Organization.

#![no_std]
#![forbid(unsafe_code)]

mod adu;
mod bits;
mod counters;
mod crc;
mod decision;
mod diagnostic;
mod events;
mod exception;
mod function;
mod head;
mod identification;
pub mod line;
mod model;
mod pdu;
mod server;
mod span;
mod table;
mod tables;
mod words;

pub use adu::Adu;
pub use bits::{Bits, BitsOut};
pub use counters::{Counters, LineCounters};
pub use decision::{Decision, Outcome, Work};
pub use exception::Exception;
pub use function::Function;
pub use head::Head;
pub use model::DataModel;
pub use server::{Answered, Committed, Decided, Request, Served, Server};
pub use span::Span;
pub use table::Table;
pub use tables::Tables;
pub use words::{Words, WordsOut};
