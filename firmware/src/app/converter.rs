//! Implements the drivers' analog input trait for a slot's analog lines.

use board_support::{AnalogInputs, NotCalibrated};
use modio_drivers::{AnalogSource, Code};

/// The analog lines of a slot.
pub struct Converter(pub AnalogInputs);

impl AnalogSource for Converter {
    type Error = NotCalibrated;

    fn read(&mut self, line: u8) -> nb::Result<Code, NotCalibrated> {
        self.0.read(line).map(Code::new)
    }
}
