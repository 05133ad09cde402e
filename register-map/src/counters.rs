//! The pulse counters of digital inputs, 0x0300 to 0x033F: two registers per point.

use crate::block::block;
use crate::rule::Rule;
use crate::value::Value;
use crate::values::Values;

/// Number of registers of one counter, high word first.
pub const WORDS: u16 = 2;

block! {
    "Pulse counters of digital inputs", 0x0300..=0x033F;

    /// Rising edges. Write 0 to both registers to clear
    PULSES "pulses": 0x0300 x 64, Value::LONG, Rule::now(Values::only(0), 0);
}

/// Returns the first register of a point's counter, for points 0 to 31.
#[inline]
#[must_use]
pub const fn of_point(point: u16) -> u16 {
    PULSES.wrapping_add(point.wrapping_mul(WORDS))
}
