//! UART settings of a line: character format and baud rate.

/// Format of a character on the line. It has eight data bits unless the name says seven.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// No parity, two stop bits.
    #[default]
    N2,
    /// Even parity, one stop bit.
    E1,
    /// Odd parity, one stop bit.
    O1,
    /// No parity, one stop bit.
    N1,
    /// Seven data bits, even parity, one stop bit.
    SevenE1,
    /// Seven data bits, odd parity, one stop bit.
    SevenO1,
    /// Seven data bits, no parity, two stop bits.
    SevenN2,
}

impl Format {
    /// Returns the bits of a character on the line, including start, parity and stop bits: 10 or 11.
    #[must_use]
    pub const fn bits(self) -> u32 {
        match self {
            Self::N2 | Self::E1 | Self::O1 => 11,
            Self::N1 | Self::SevenE1 | Self::SevenO1 | Self::SevenN2 => 10,
        }
    }

    /// Returns the longest time from the receiver's interrupt to the end of the character, in sixteenths of a bit.
    ///
    /// The UART samples a stop bit in its middle, at the 10th sixteenth. With two stop bits it sets the flag at the
    /// end of the first one (RM0008 27.3.3). The receiver's sampling clock is not synchronous with the line, and
    /// the first sample that is low counts as the first of the start bit, so the flag can be up to one sixteenth
    /// early. In 7N2 the UART treats the first stop bit as a data bit, so the second one is its only stop bit.
    #[must_use]
    pub const fn sixteenths_after_flag(self) -> u32 {
        match self {
            Self::N2 => 16 + 1,
            Self::E1 | Self::O1 | Self::N1 | Self::SevenE1 | Self::SevenO1 | Self::SevenN2 => 6 + 1,
        }
    }

    /// Returns the first stop bit as a bit of the data register: 0x80 in 7N2, 0 in every other format.
    ///
    /// The USARTs of the F103 have words of 8 or 9 bits (RM0008 27.6.4, bit M). 7N2 is therefore set up as 8N1 with
    /// the highest data bit always 1, which is the same on the line.
    #[must_use]
    pub const fn stop_in_data(self) -> u8 {
        match self {
            Self::SevenN2 => 0x80,
            _ => 0,
        }
    }
}

/// Baud rate and format of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineSettings {
    /// Bits per second.
    pub baud: u32,
    /// The character format.
    pub format: Format,
}

impl LineSettings {
    /// The factory setting, 9600 8N2, also used in recovery mode.
    pub const FACTORY: Self = Self {
        baud: 9600,
        format: Format::N2,
    };

    /// The second line, 9600 8N1. A LoRa module has no other rate in sleep mode.
    pub const SECOND: Self = Self {
        baud: 9600,
        format: Format::N1,
    };
}
