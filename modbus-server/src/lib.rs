#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

mod adu;
mod bits;
mod counters;
pub mod crc;
mod diagnostic;
mod events;
mod exception;
pub mod fast;
mod file;
mod function;
mod identification;
pub mod line;
mod model;
mod pdu;
mod request;
mod server;
mod span;
mod table;
mod tables;
mod text;
mod words;

pub use adu::Adu;
pub use bits::{Bits, BitsOut};
pub use counters::{Counters, LineCounters};
pub use exception::Exception;
pub use function::Function;
pub use model::DataModel;
pub use request::{Outcome, Reply, Request};
pub use server::Server;
pub use span::Span;
pub use table::Table;
pub use tables::Tables;
pub use text::TextOut;
pub use words::{Words, WordsOut};

/// The unit address of a broadcast (V1.02 2.2).
pub(crate) const BROADCAST: u8 = 0;
