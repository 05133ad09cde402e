//! The exact-line protocol: a serial line in virtual time, as requests and replies in lines of text.
//!
//! A server is an emulator or simulator in which time passes on request only; a client is a master on that
//! line. This crate has what both share: the types, and how they are written and read.
//! `docs/conformance.md` describes the protocol.

#![forbid(unsafe_code)]

mod reply;
mod request;
mod time;

pub use reply::{Ability, Event, Hello, Reply};
pub use request::{Piece, Request};

use std::time::Duration;

/// The version of the protocol in this crate.
pub const VERSION: u32 = 1;

/// Longest request line in characters, without the line end. A server refuses a longer one.
pub const LONGEST_LINE: usize = 1 << 20;

/// The longest virtual time of one request.
pub const LONGEST_RUN: Duration = Duration::from_secs(600);
