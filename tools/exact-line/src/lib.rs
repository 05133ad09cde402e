//! The exact-line protocol: a serial line in virtual time, as requests and replies in lines of text.
//!
//! A server is an emulator or simulator in which time passes on request only; a client is a master on that
//! line. This crate holds what both have in common: the types, and how they are written and read. The
//! protocol itself is described in `docs/conformance.md`.

#![forbid(unsafe_code)]

mod reply;
mod request;
mod time;

pub use reply::{Ability, Event, Hello, Reply};
pub use request::{Piece, Request};

use std::time::Duration;

/// The version of the protocol that this crate speaks.
pub const VERSION: u32 = 1;

/// Longest request line in characters, without the line end. A server refuses a longer one.
pub const LONGEST_LINE: usize = 1 << 20;

/// The most virtual time that one request may take.
pub const LONGEST_RUN: Duration = Duration::from_secs(600);
