//! What the polling task and the display send each other.

use std::collections::BTreeSet;
use std::time::Duration;

use tokio::time::Instant;

use super::plan::Words;
use crate::bus::Seen;
use crate::failure::Failure;
use crate::names::{Book, Item};

/// A value to write, as the user ordered it.
#[derive(Clone, Debug, PartialEq)]
pub struct Write {
    /// The output.
    pub item: Item,
    /// Its new value.
    pub words: Vec<u16>,
    /// When the user ordered it.
    pub ordered: Instant,
}

/// Values of one round of polling.
#[derive(Clone, Debug)]
pub struct Polled {
    /// When the first of these values was asked for.
    pub at: Instant,
    /// Duration of the whole round.
    pub took: Duration,
    /// Values by the name of their item. A point that the unit refused is missing.
    pub words: Words,
    /// Ports of which the unit refused the points, with its reason.
    pub refused: Vec<(u8, String)>,
    /// Ports whose analog values have no known meaning until the unit restarts.
    pub waiting: BTreeSet<u8>,
}

/// News from the polling task.
#[derive(Clone, Debug)]
pub enum Update {
    /// The polling task has learned what the unit is, for the first time or again.
    Learned(Box<Book>),
    /// A round of polling is complete.
    Polled(Polled),
    /// A round of polling failed.
    Lost(Failure),
    /// The unit has carried out or refused a write, or did not answer.
    Wrote(Write, Result<(), Failure>),
    /// A frame was sent or received.
    Seen(Seen),
}
