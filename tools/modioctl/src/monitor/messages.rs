//! Messages between the polling task and the display.

use std::collections::BTreeSet;
use std::time::Duration;

use tokio::time::Instant;

use super::edges::Edge;
use super::plan::Words;
use crate::bus::Seen;
use crate::failure::Failure;
use crate::names::{Book, Item};

/// A value to write, ordered by the user.
#[derive(Clone, Debug, PartialEq)]
pub struct Write {
    /// The output.
    pub item: Item,
    /// Its new value.
    pub words: Vec<u16>,
    /// Time when the user ordered it.
    pub ordered: Instant,
}

/// Values of one round of polling.
#[derive(Clone, Debug)]
pub struct Polled {
    /// Time when the first of these values was requested.
    pub at: Instant,
    /// Duration of the whole round.
    pub took: Duration,
    /// Values by the name of their item. Points that the unit refused are missing.
    pub words: Words,
    /// Ports whose points the unit refused, with its reason.
    pub refused: Vec<(u8, String)>,
    /// Ports whose analog values have no known meaning until the unit restarts.
    pub waiting: BTreeSet<u8>,
    /// The newest edges of digital inputs, newest first; `None` when they were not read.
    pub edges: Option<Vec<Edge>>,
}

/// Message from the polling task.
#[derive(Clone, Debug)]
pub enum Update {
    /// The polling task has learned the names of the unit, for the first time or again.
    Learned(Box<Book>),
    Polled(Polled),
    /// A round of polling failed.
    Lost(Failure),
    /// The unit has executed or refused a write, or did not answer.
    Wrote(Write, Result<(), Failure>),
    /// A frame was sent or received.
    Seen(Seen),
}
