//! Where the I/O points of each port stand: `(port - 1) * 4 + (channel - 1)`, for bits and words alike,
//! and what a point can be.

use crate::block::block;
use crate::codes::{Scale, Signal};
use crate::rule::Rule;
use crate::values::Values;

/// Channels of one port.
pub const CHANNELS: u16 = 4;

/// Ports the address space has room for.
pub const PORTS: u16 = 8;

/// The only port of the modio-02 board that has a slot.
pub const SLOT_PORT: u16 = 5;

/// The first address of a port's points, for ports 1 to 8.
///
/// # Panics
///
/// At compile time where it is used in a constant, for a port outside 1 to 8.
#[must_use]
pub const fn first(port: u16) -> u16 {
    assert!(port >= 1 && port <= PORTS);
    (port - 1) * CHANNELS
}

/// The first point of the slot: 0x0010.
pub const SLOT_FIRST: u16 = first(SLOT_PORT);

/// Points of all ports.
pub const COUNT: u16 = PORTS * CHANNELS;

/// What a point is, seen from the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// Nothing: the point does not exist.
    None,
    /// A bit that can only be read.
    BitInput,
    /// A bit that can be read and written.
    BitOutput,
    /// A word that can only be read.
    WordInput,
    /// A word that can be read and written.
    WordOutput,
}

/// What an analog output takes from a master: 0-4095 raw, 0-10000 mV or 4000-20000 uA.
///
/// There is no output for [`Signal::Ntc`]; it takes nothing but raw values.
#[must_use]
pub const fn output_values(signal: Signal, scale: Scale) -> Values {
    match (scale, signal) {
        (Scale::Raw, _) | (Scale::Engineering, Signal::Ntc) => Values::up_to(4095),
        (Scale::Engineering, Signal::Voltage) => Values::up_to(10_000),
        (Scale::Engineering, Signal::Current) => Values::range(4000, 20_000),
    }
}

block! {
    "Points", 0x0000..=0x001F;

    /// Points of ports 1-8, four each: bits or words as the port's module has them
    POINT "points": 0x0000 x 32, "", Rule::by_module(Values::up_to(20_000)), &[];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_follow_one_another_and_the_slot_is_where_the_manual_has_it() {
        assert_eq!((first(1), first(8)), (0x0000, 0x001C));
        assert_eq!(SLOT_FIRST, 0x0010);
    }
}
