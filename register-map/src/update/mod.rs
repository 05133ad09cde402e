//! What an update over the line brings and reports: slots, their states, and the header of an image.

mod header;
pub mod keys;
mod manifest;
mod transfer;

pub use header::{Header, crc32, intact};
pub use manifest::Manifest;
pub use transfer::{BLOCK, BLOCK_BYTES, block_at, place_of, status};

/// One of the two places for an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Slot {
    /// At the lower address.
    A,
    /// At the higher address.
    B,
}

impl Slot {
    /// Both slots, A first.
    pub const ALL: [Self; 2] = [Self::A, Self::B];

    /// Returns the other slot.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}

/// Why an image was rejected. The codes are those of record 1 of file 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Reason {
    /// The magic number or the bytes that must be zero.
    Magic = 1,
    /// The image is for another board.
    Board = 2,
    /// The image is linked for another address.
    Address = 3,
    /// The length is no multiple of 4, or outside the slot.
    Length = 4,
    /// The security epoch is below the floor.
    Epoch = 5,
    /// The CRC-32.
    Crc = 6,
    /// The SHA-512 of the application.
    Hash = 7,
    /// The signature.
    Signature = 8,
    /// The check was interrupted.
    Interrupted = 9,
    /// The image was started twice, and nobody confirmed it.
    NotConfirmed = 10,
}

impl Reason {
    const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            1 => Self::Magic,
            2 => Self::Board,
            3 => Self::Address,
            4 => Self::Length,
            5 => Self::Epoch,
            6 => Self::Crc,
            7 => Self::Hash,
            8 => Self::Signature,
            9 => Self::Interrupted,
            10 => Self::NotConfirmed,
            _ => return None,
        })
    }
}

/// First bytes of the SHA-512 of the public development key, whose private half everybody has.
pub const DEVELOPMENT_KEY: u32 = 0x11FA_5AB8;

/// Number of starts that an image on trial has. A start that was asked for does not count.
pub const TRIALS: u8 = 2;

/// What a slot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// Nothing that counts.
    Empty,
    /// Blocks of an update. After a restart this counts as empty.
    Receiving,
    /// A whole image, which the loader checks at the next start.
    New,
    /// An image that the loader is checking.
    Checking,
    /// A genuine image that was started this many times, and is not confirmed.
    Trial(u8),
    /// A genuine image that serves.
    Confirmed,
    /// An image that is not started.
    Rejected(Reason),
}

impl State {
    /// Returns the code, as in record 0 of file 2, and the number of starts or the reason, as in record 1.
    #[must_use]
    pub const fn code(self) -> (u8, u8) {
        match self {
            Self::Empty => (0, 0),
            Self::Receiving => (1, 0),
            Self::New => (2, 0),
            Self::Checking => (3, 0),
            Self::Trial(starts) => (4, starts),
            Self::Confirmed => (5, 0),
            Self::Rejected(reason) => (6, reason as u8),
        }
    }

    /// Returns the state with this code and detail, or `None` if there is none.
    #[must_use]
    pub fn from_code(code: u8, detail: u8) -> Option<Self> {
        Some(match (code, detail) {
            (0, 0) => Self::Empty,
            (1, 0) => Self::Receiving,
            (2, 0) => Self::New,
            (3, 0) => Self::Checking,
            (4, starts @ 0..=TRIALS) => Self::Trial(starts),
            (5, 0) => Self::Confirmed,
            (6, code) => Self::Rejected(Reason::from_code(code)?),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_has_its_own_code_and_other_codes_have_no_state() {
        let mut found = 0;
        for code in 0..=u8::MAX {
            for detail in 0..=u8::MAX {
                if let Some(state) = State::from_code(code, detail) {
                    assert_eq!(state.code(), (code, detail));
                    found += 1;
                }
            }
        }
        // Five states alone, a trial by its starts, a rejection by its reason.
        assert_eq!(found, 5 + 3 + 10);
    }
}
