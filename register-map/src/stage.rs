//! The stage between coils and terminals of digital outputs, 0x0520 to 0x057F: settings by point, as those of the
//! configuration. Those of points that are no digital outputs are stored, without effect.

use core::ops::Range;

use crate::block::block;
use crate::points::COUNT;
use crate::rule::Rule;
use crate::value::Value;
use crate::values::Values;

block! {
    "Output stage", 0x0520..=0x057F;

    /// Channels 1 and 2, or 3 and 4: never both on, this time between; at the lower channel; 0 = none
    DEAD_TIME "DEAD_TIME": 0x0520 x 32, Value::tens("s", -2), Rule::now(DEAD_TIMES, 0);
    /// Longest time on, in 0.1 s or 0x8000 + 1-32767 minutes; 0 = any
    MAX_ON "MAX_ON": 0x0540 x 32, Value::NUMBER, Rule::now(Values::ANY, 0);
    /// Shortest time off
    MIN_OFF "MIN_OFF": 0x0560 x 32, Value::tens("s", -1), Rule::now(Values::ANY, 0);
}

/// The values of DEAD_TIME.
const DEAD_TIMES: Values = Values::range(2, 1000).or(0);

/// Number of the registers.
pub const REGISTERS: u16 = 3 * COUNT;

/// The addresses.
pub const ADDRESSES: Range<u16> = DEAD_TIME..DEAD_TIME + REGISTERS;

/// A value of MAX_ON that has this bit has minutes in the others.
pub const MINUTES: u16 = 0x8000;

/// Returns whether the register at this address allows the value. Other addresses allow every value.
#[must_use]
pub fn allows(address: u16, value: u16) -> bool {
    match address {
        DEAD_TIME..MAX_ON => DEAD_TIMES.allow(value),
        // 0 minutes would be no time, and no limit is 0.
        MAX_ON..MIN_OFF => value != MINUTES,
        _ => true,
    }
}

/// Returns whether an address is of this block.
#[inline]
#[must_use]
pub const fn contain(address: u16) -> bool {
    address.wrapping_sub(DEAD_TIME) < REGISTERS
}

/// Returns MAX_ON in milliseconds; 0 = no limit.
#[must_use]
pub const fn max_on_ms(value: u16) -> u32 {
    let number = (value & !MINUTES) as u32;
    if value & MINUTES == 0 {
        number * 100
    } else {
        number * 60_000
    }
}
