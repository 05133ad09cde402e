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
//!  characters   +---------------+   Adu   +----------------+   Head   +------------------+
//!  ------------>| rtu::Receiver |-------->| Server::decide |--------->| rtu::Transmitter |--->
//!  t1.5, t3.5   +---------------+         +----------------+          +------------------+
//!                       ^                         | Decision                ^
//!                       |                         v                         |
//!                       |               +-------------------+   Adu (body)  |
//!                       +---------------| Server::carry_out |---------------+
//!                          give_back    +-------------------+
//! ```
//!
//! Serving has two steps so that the reply can start at once: [`Server::decide`] settles *which*
//! reply it will be and its first bytes, without touching anything; [`Server::carry_out`] then does
//! the work while those bytes are already on the wire. What takes long to check can be decided
//! sooner still, in the silence before t3.5 ([`rtu::Receiver::t15`]). The buffers ([`Adu`]) move by
//! ownership from hand to hand; nothing is copied.
//!
//! ```
//! use modbus_server::rtu::{Faults, Next, Receiver, Transmitter};
//! use modbus_server::{Adu, Bits, BitsOut, DataModel, Exception, Server, Span, Words, WordsOut};
//!
//! /// Ten registers, no bit points.
//! struct Registers([u16; 10]);
//!
//! impl DataModel for Registers {
//!     fn check_read_bits(&self, _: Span) -> Result<(), Exception> {
//!         Err(Exception::IllegalDataAddress)
//!     }
//!     fn check_write_bits(&self, _: Span, _: Bits<'_>) -> Result<(), Exception> {
//!         Err(Exception::IllegalDataAddress)
//!     }
//!     fn check_read_words(&self, span: Span) -> Result<(), Exception> {
//!         if span.end() <= 10 { Ok(()) } else { Err(Exception::IllegalDataAddress) }
//!     }
//!     fn check_write_words(&self, span: Span, _: Words<'_>) -> Result<(), Exception> {
//!         self.check_read_words(span)
//!     }
//!     fn read_bits(&self, _: Span, _: &mut BitsOut<'_>) {}
//!     fn write_bits(&mut self, _: Span, _: Bits<'_>) {}
//!     fn read_words(&self, span: Span, out: &mut WordsOut<'_>) {
//!         for address in span.addresses() {
//!             out.push(self.0[usize::from(address)]);
//!         }
//!     }
//!     fn write_words(&mut self, span: Span, words: Words<'_>) {
//!         for (address, word) in span.addresses().zip(words.iter()) {
//!             self.0[usize::from(address)] = word;
//!         }
//!     }
//! }
//!
//! let mut registers = Registers([0x1111; 10]);
//! let mut server = Server::new(17);
//! let (mut one, mut two) = (Adu::new(), Adu::new());
//! let mut receiver = Receiver::new(17, false);
//! receiver.give_back(&mut one);
//! receiver.give_back(&mut two);
//!
//! receiver.t35(); // the line has been silent: the receiver listens from here on
//! for byte in [0x11, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x5B] {
//!     receiver.character(byte, Faults::NONE);
//! }
//! let closed = receiver.t35().expect("a good frame for this unit");
//!
//! let decision = server.decide(closed.adu, &registers);
//! let mut transmitter = Transmitter::new(decision.reply.expect("not a broadcast"));
//! assert_eq!(transmitter.next(), Next::Byte(0x11)); // the first byte goes before the work is done
//! server.commit(&decision);
//! server.carry_out(&decision, closed.adu, &mut registers);
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
mod exception;
mod function;
mod model;
mod pdu;
pub mod rtu;
mod server;
mod span;
mod words;

pub use adu::Adu;
pub use bits::{Bits, BitsOut};
pub use counters::{Counters, LineCounters};
pub use decision::{Decision, Head, Outcome, Work};
pub use exception::Exception;
pub use function::Function;
pub use model::DataModel;
pub use server::Server;
pub use span::Span;
pub use words::{Words, WordsOut};
