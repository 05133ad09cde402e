//! Requests and responses as frames on the line, in both transmission modes.

use modbus_line::adu::Framing;
use register_map::codes::Mode;

use crate::requests::UNIT;

const fn framing(mode: Mode) -> Framing {
    match mode {
        Mode::Rtu => Framing::Rtu,
        Mode::Ascii => Framing::Ascii,
    }
}

/// Returns the frame for the unit.
#[must_use]
pub fn adu(mode: Mode, pdu: &[u8]) -> Vec<u8> {
    framing(mode).frame(0, UNIT, pdu)
}

/// Returns whether these bytes are a valid frame of the unit.
#[must_use]
pub fn is_adu(mode: Mode, bytes: &[u8]) -> bool {
    let opened = framing(mode).open(bytes);
    opened.is_some_and(|(unit, _)| unit == UNIT)
}
