//! What a board has, as types. A value that contains the proof of something that the board does not have cannot exist, so
//! the compiler leaves out all code for it.

use core::convert::Infallible;

use crate::boards::BOARD;

/// A condition that is known at compile time.
pub struct If<const YES: bool>;

/// The proof of something that the board has.
#[derive(Clone, Copy, Debug)]
pub struct Yes;

/// Something that a board has or does not have.
pub trait Fitted {
    /// The proof: a type with one value if the board has the thing, or a type without values if it does not.
    type Proof: Copy;

    /// Returns the proof, or `None` if the board does not have the thing.
    fn proof() -> Option<Self::Proof>;
}

impl Fitted for If<true> {
    type Proof = Yes;

    #[inline(always)]
    fn proof() -> Option<Yes> {
        Some(Yes)
    }
}

impl Fitted for If<false> {
    type Proof = Infallible;

    #[inline(always)]
    fn proof() -> Option<Infallible> {
        None
    }
}

/// The second line.
pub type Second = If<{ BOARD.second.is_some() }>;
/// Slots for modules.
pub type Slots = If<{ BOARD.has_slots() }>;
/// Analog inputs or outputs.
pub type Analog = If<{ BOARD.has_analog() }>;
/// The part's own DAC.
pub type OwnDac = If<{ BOARD.has_own_dac() }>;
