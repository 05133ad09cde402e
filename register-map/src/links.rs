//! The links, 0x0400 to 0x04FF: inputs that switch digital outputs. Four registers for each of two links of an output.
//!
//! ```text
//!           0x0400 + 4 n, first link of point n         0x0480 + 4 n, second link
//!         +--------+---------------+--------------+-----+
//!         | SOURCE | ACTION | WHEN | TIME or HIGH | LOW |
//!         +--------+---------------+--------------+-----+
//! ```

use crate::block::block;
use crate::codes::LinkAction;
use crate::kind::Kind::BitOutput;
use crate::rule::Rule;
use crate::value::{Field, Value};
use crate::values::Values;

/// Number of registers of a link.
pub const WORDS: u16 = 4;

/// Number of links of an output.
pub const EACH: u16 = 2;

/// SOURCE of a link that does nothing.
pub const NO_SOURCE: u16 = 0xFFFF;

/// The registers of a link, in order.
static FIELDS: [Field; WORDS as usize] = [
    Field::new("source", Value::Point, Values::ANY, NO_SOURCE),
    Field::new(
        "action",
        Value::Codes(LinkAction::NAMES),
        Values::up_to(LinkAction::ChangeAlone.code()),
        0,
    ),
    Field::new("time or high", Value::NUMBER, Values::ANY, 0),
    Field::new("low", Value::NUMBER, Values::ANY, 0),
];

block! {
    "Links", 0x0400..=0x04FF;

    /// Input that switches the output
    LINKS "link": 0x0400 x 256, Value::Fields(BitOutput, &FIELDS), Rule::now(Values::ANY, 0);
}

/// Returns whether a board with this number of slots has links. With one slot there is nothing to connect: a module with
/// digital outputs has no inputs but the jumpers of relays.
#[inline]
#[must_use]
pub const fn exist(slots: usize) -> bool {
    slots > 1
}

/// Returns the first register of a link of a point, 0 to 31. `second`: its second link.
#[inline]
#[must_use]
pub const fn of_point(point: u16, second: bool) -> u16 {
    let row = if second { crate::points::COUNT } else { 0 };
    LINKS.wrapping_add(row.wrapping_add(point).wrapping_mul(WORDS))
}

/// Returns the point, 0 to 31, of an address of this block.
#[inline]
#[must_use]
pub const fn point_of(address: u16) -> u16 {
    (address / WORDS) % crate::points::COUNT
}

/// Returns whether an address is of this block.
#[inline]
#[must_use]
pub const fn contain(address: u16) -> bool {
    address >> 8 == LINKS >> 8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_of_a_point_are_in_two_rows() {
        assert_eq!((of_point(0, false), of_point(0, true)), (0x400, 0x480));
        assert_eq!((of_point(18, false), of_point(31, true)), (0x448, 0x4FC));
        assert_eq!((point_of(0x44B), point_of(0x4FF)), (18, 31));
        assert!(contain(LINKS) && contain(0x4FF) && !contain(0x3FF) && !contain(0x500));
    }
}
