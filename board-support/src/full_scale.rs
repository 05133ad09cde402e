//! Codes of converters whose full scale is not that of the input or output: 10 V or 20 mA are less than 3.3 V.

use crate::boards::{Analog, PortKind};

/// The largest code of a converter.
const MAX: u32 = 4095;

impl PortKind {
    /// Returns the code of an input's range for a code of the converter, 4095 for 10 V or 20 mA and above.
    #[must_use]
    pub const fn from_converter(&self, line: usize, code: u16) -> u16 {
        match *self {
            Self::AnalogInputs(full) | Self::Analog(Analog { inputs: full, .. }) => {
                match (code as u32 * MAX).checked_div(full[line % full.len()] as u32) {
                    Some(code) if code < MAX => code as u16,
                    _ => MAX as u16,
                }
            }
            _ => code,
        }
    }

    /// Returns the code of the DAC for a code of an output's range.
    #[must_use]
    pub const fn to_converter(&self, line: usize, code: u16) -> u16 {
        match *self {
            Self::AnalogOutputs(full) | Self::Analog(Analog { output: full, .. }) => {
                (code as u32 * full[line % full.len()] as u32 / MAX) as u16
            }
            _ => code,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::boards::{fx3u_14, fx3u_24};

    #[test]
    fn full_range_of_an_input_is_the_largest_code() {
        let voltages = fx3u_14::BOARD.slots[4].kind;
        for (line, full) in [(0, 3968), (3, 3830)] {
            assert_eq!(voltages.from_converter(line, 0), 0);
            assert_eq!(voltages.from_converter(line, full), 4095);
            assert_eq!(voltages.from_converter(line, 4095), 4095);
        }
        // 5 V.
        assert_eq!(voltages.from_converter(1, 1984), 2047);
        let potentiometer = fx3u_14::BOARD.slots[5].kind;
        assert_eq!(potentiometer.from_converter(2, 4000), 4000);
    }

    #[test]
    fn largest_code_of_an_output_is_its_full_range() {
        for kind in [fx3u_14::BOARD.slots[6].kind, fx3u_24::BOARD.slots[7].kind] {
            assert_eq!(kind.to_converter(0, 0), 0);
            assert_eq!(kind.to_converter(3, 4095), 3965);
        }
    }
}
