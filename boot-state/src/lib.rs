//! The boot state of a modio: which image each slot holds, and which one is started.
//!
//! A unit runs from one of two slots, and an update is written into the other one. [`Record`] is the whole state;
//! [`journal`] keeps it in two pages of flash. [`decide`] has the decisions of the loader and [`commands`] those of the
//! application. Its tests walk through every state, every event, and a power cut
//! between any two writes.
//!
//! ```text
//!           0xB001              0xB002            loader             loader, at a start       0xB003
//!   any ─────────────> receiving ──────> new ─────────────> checking ────────────────> trial ──────> confirmed
//!                          ▲                                   │                         │
//!                          │ 0xB001                            ▼                         ▼
//!                          └─────────────────────────────── rejected (why) <─────────────┘
//! ```
//!

#![no_std]

pub mod commands;
pub mod decide;
pub mod journal;

#[cfg(test)]
mod walk;

use register_map::update::{Slot, State};

/// The whole boot state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Record {
    /// The slot that is started when nothing else is asked for.
    pub preferred: Slot,
    /// The states of slots A and B.
    pub states: [State; 2],
    /// The lowest security epoch of an image that becomes new.
    pub floor: u16,
}

impl Record {
    /// Returns the state of a slot.
    #[must_use]
    pub const fn state(&self, slot: Slot) -> State {
        let [a, b] = self.states;
        match slot {
            Slot::A => a,
            Slot::B => b,
        }
    }

    /// Returns the record with another state of a slot.
    #[must_use]
    pub const fn with(mut self, slot: Slot, state: State) -> Self {
        let [a, b] = &mut self.states;
        *match slot {
            Slot::A => a,
            Slot::B => b,
        } = state;
        self
    }
}
