//! A Modbus serial-line server (slave): from the characters of a request to the characters of its
//! reply.
//!
//! `no_std`, no allocation, no `unsafe`, no panic; it knows no hardware and no register map. The
//! device around it brings a UART, a timer for the silent times and a [`DataModel`] of its points
//! and registers.
//!
//! A request passes through four hands, each usable and tested by itself:
//!
//! ```text
//!  characters   +----------------+   Adu   +----------------+   Head   +-------------------+
//!  ------------>| line::Receiver |-------->| Server::decide |--------->| line::Transmitter |--->
//!  silences     +----------------+         +----------------+          +-------------------+
//!                        ^                         | Decision                ^
//!                        |                         v                         |
//!                        |               +-------------------+   Adu (body)  |
//!                        +---------------| Server::carry_out |---------------+
//!                           give_back    +-------------------+
//! ```
//!
//! Serving has three steps so that the reply starts at once, however long the request.
//! [`Server::answers`] looks at a few bytes and tells whether there will be a reply: its first byte,
//! the unit address, may go. [`Server::decide`] then settles *which* reply it will be and how it
//! begins, without touching anything, and [`Server::carry_out`] does the work, both while those
//! bytes are already on the wire. The buffers ([`Adu`]) move by ownership from hand to hand;
//! nothing is copied.
//!
//! RTU and ASCII mode differ in the [line](mod@line) alone: one [`line::Receiver`] and one
//! [`line::Transmitter`] speak both.
//!
//! What a broadcast may do: write, by functions 05, 06, 0F, 10 and 16. All else has no effect, also
//! 17, for which a broadcast's silence would lose the read, and 08, lest one frame silences all
//! units of a line.
//!
//! ```
//! use modbus_server::line::{Faults, Framing, Next, Receiver, Transmitter};
//! use modbus_server::{Adu, Server, Tables};
//!
//! // The device: ten holding registers. One with rules of its own implements `DataModel`.
//! let mut registers = [0x1111; 10];
//! let mut tables = Tables { holding_registers: &mut registers, ..Tables::default() };
//!
//! let mut server = Server::new(17, Framing::Rtu);
//! let (mut one, mut two) = (Adu::new(), Adu::new());
//! let mut receiver = Receiver::rtu(17, false);
//! receiver.give_back(&mut one);
//! receiver.give_back(&mut two);
//!
//! receiver.close(); // the line has been silent: the receiver listens from here on
//! for byte in [0x11, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x5B] {
//!     receiver.character(byte, Faults::NONE);
//! }
//! let closed = receiver.close().expect("a good frame for this unit");
//!
//! assert!(server.answers(closed.adu));
//! let mut transmitter = Transmitter::open(server.unit(), server.framing());
//! assert_eq!(transmitter.next(), Next::Byte(0x11)); // goes before anything is decided
//! let decision = server.decide(closed.adu, &tables);
//! transmitter.head(decision.reply.expect("it is answered"));
//! server.commit(&decision, &closed.line);
//! server.carry_out(&decision, closed.adu, &mut tables);
//! if let Some(adu) = transmitter.body(closed.adu) {
//!     receiver.give_back(adu); // an exception or an echo has no body
//! }
//!
//! let mut reply = vec![0x11];
//! while let Next::Byte(byte) = transmitter.next() {
//!     reply.push(byte);
//! }
//! assert_eq!(reply, [0x11, 0x03, 0x02, 0x11, 0x11, 0xB5, 0xDB]);
//! if let Some(adu) = transmitter.take_buffer() {
//!     receiver.give_back(adu);
//! }
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
