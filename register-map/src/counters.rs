//! The pulse counters of digital inputs, 0x0300 to 0x033F: two registers a point.

use crate::block::block;
use crate::rule::Rule;
use crate::values::Values;

/// Registers of one counter, high word first.
pub const WORDS: u16 = 2;

block! {
    "Pulse counters of digital inputs", 0x0300..=0x033F;

    /// By point, two registers each, high word first: rising edges after debounce, wrapping.
    /// A write of 0 to both registers of a point in one request clears it, any other write is exception 03
    PULSES "pulses": 0x0300 x 64, "", Rule::now(Values::only(0), 0), &[];
}

/// The first register of a point's counter, for points 0 to 31.
#[inline]
#[must_use]
pub const fn of_point(point: u16) -> u16 {
    PULSES.wrapping_add(point.wrapping_mul(WORDS))
}
