//! The name of the board for clients of function 70, 0x00C8 to 0x00DB: wb-modbus-ext-scanner reads it from each
//! unit that it finds, and never stops waiting after an exception.

use crate::block::block;
use crate::rule::Rule;
use crate::value::Value;

/// The unit address of a unit without a switch, as clients of function 70 write it: alone, and in a request by serial
/// number (sub-function 08) only. It cannot be read; [`UNIT`](crate::configuration::UNIT) can.
pub const UNIT_BY_SERIAL: u16 = 0x0080;

block! {
    "Name of the board", 0x00C8..=0x00DB;

    /// A character in each low byte
    NAME "board name": 0x00C8 x 20, Value::Opaque, Rule::read_only();
}
