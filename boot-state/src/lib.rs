//! The boot state of a modio: which image each slot holds, and which one is started.
//!
//! A unit runs from one of two slots, and an update is written into the other one. [`Record`] is the whole state;
//! [`journal`] keeps it in two pages of flash. [`decide`] has the decisions of the loader and [`commands`] those of the
//! application. Its tests walk through every state, every event, and a power cut between any two writes.
//!
//! ```text
//!           0xB001              0xB002            loader             loader, at a start       0xB003
//!   any ─────────────> receiving ──────> new ─────────────> checking ────────────────> trial ──────> confirmed
//!                          ▲                                   │                         │
//!                          │ 0xB001                            ▼                         ▼
//!                          └─────────────────────────────── rejected (why) <─────────────┘
//! ```

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
    /// [`Self::FIRST_KEY_REVOKED`], and bits that only a newer image knows, which are copied.
    pub bits: u8,
}

/// What an image says of itself, and what the check has found true.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Image {
    /// The security epoch.
    pub epoch: u16,
    /// Signed by the second of the loader's keys.
    pub by_second: bool,
}

impl Record {
    /// A bit of a record: an image that the second key signed was confirmed, so the first key is trusted no more. It is
    /// never cleared.
    pub const FIRST_KEY_REVOKED: u8 = 2;

    /// Returns whether the first key is revoked.
    #[must_use]
    pub const fn is_revoked(&self) -> bool {
        self.bits & Self::FIRST_KEY_REVOKED != 0
    }

    /// Returns whether an order or SW01 = 254 may choose this image.
    #[must_use]
    pub const fn allows(&self, image: Image) -> bool {
        image.epoch >= self.floor && (image.by_second || !self.is_revoked())
    }

    /// Prefers this image, which is in `slot`, from now on: no older epoch counts any more, and when the second key
    /// signed it, the first is revoked.
    pub fn prefer(&mut self, slot: Slot, image: Image) {
        self.preferred = slot;
        self.floor = self.floor.max(image.epoch);
        if image.by_second {
            self.bits |= Self::FIRST_KEY_REVOKED;
        }
    }

    /// Returns the state of a slot.
    #[must_use]
    pub const fn state(&self, slot: Slot) -> State {
        self.states[slot as usize % 2]
    }

    /// Returns the record with another state of a slot.
    #[must_use]
    pub const fn with(mut self, slot: Slot, state: State) -> Self {
        self.states[slot as usize % 2] = state;
        self
    }
}
