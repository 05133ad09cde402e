//! Which changes of analog inputs are events of function 70, 0x0500 to 0x051F: a setting by point, as those of the
//! configuration.

use crate::block::block;
use crate::points::COUNT;
use crate::rule::Rule;
use crate::value::Value;
use crate::values::Values;

block! {
    "Events of analog inputs", 0x0500..=0x051F;

    /// Change that is an event; 0 = 1/256 of the range
    DEADBAND "DEADBAND": 0x0500 x 32, Value::NUMBER, Rule::now(Values::ANY, 0);
}

/// Returns whether an address is of this block.
#[inline]
#[must_use]
pub const fn contain(address: u16) -> bool {
    address.wrapping_sub(DEADBAND) < COUNT
}
