//! The exact-line protocol: a serial line in virtual time, as requests and replies in lines of text.
//!
//! A server is an emulator or simulator in which time passes only on request; a client is a master on that line.
//! This module contains what both share: the types, and their text form. `docs/conformance.md` describes the
//! protocol.

mod reply;
mod request;
mod time;

pub use reply::{Ability, Event, Hello, Reply};
pub use request::{Piece, Request};

use std::time::Duration;

/// Version of the protocol that this module implements.
pub const VERSION: u32 = 1;

/// Longest request line in characters, without the line end. A server rejects longer lines.
pub const LONGEST_LINE: usize = 1 << 20;

/// Longest virtual time that one request may take.
pub const LONGEST_RUN: Duration = Duration::from_secs(600);
