//! The board's converter as the drivers take it.

use board_support::{AdcError, AnalogInputs};
use modio_drivers::AnalogSource;

/// The analog lines of the slot.
pub struct Converter(pub AnalogInputs);

impl AnalogSource for Converter {
    type Error = AdcError;

    fn read(&mut self, line: u8) -> nb::Result<u16, AdcError> {
        self.0.read(line)
    }
}
