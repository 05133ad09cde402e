//! UART settings of a line: character format and baud rate divider.

use crate::design::BAUD_ERROR_PPM;

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

/// Returns the baud rate register for a rate, given the UART's clock in Hz: clock divided by rate, in sixteenths of
/// the oversampling (RM0008 27.3.4), rounded to the nearest.
///
/// Returns `None` when no divider reaches the rate within [`BAUD_ERROR_PPM`].
#[must_use]
pub const fn divider(clock_hz: u32, baud: u32) -> Option<u16> {
    if baud == 0 {
        return None;
    }
    let divider = (clock_hz + baud / 2) / baud;
    // Below 16 the integer part of the divider would be zero.
    if divider < 16 || divider > u16::MAX as u32 {
        return None;
    }
    // The product is at most the clock plus half the rate.
    let error = (divider * baud).abs_diff(clock_hz);
    if error <= clock_hz / 1_000_000 * BAUD_ERROR_PPM {
        Some(divider as u16)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{SYSCLK_ON_HSE_HZ, SYSCLK_ON_HSI_HZ};

    #[test]
    fn dividers_are_those_of_the_reference_manual() {
        // RM0008 table 192, fPCLK = 72 MHz: 9.6 kbit/s 468.75, 115.2 kbit/s 39.0625.
        assert_eq!(divider(72_000_000, 9600), Some(7500));
        assert_eq!(divider(72_000_000, 115_200), Some(0x271));
    }

    #[test]
    fn every_rate_of_the_register_map_has_a_divider_on_both_clocks() {
        for baud in [
            1200, 2400, 4800, 9600, 19200, 38400, 57600, 115_200, 230_400, 460_800, 921_600,
        ] {
            for clock in [SYSCLK_ON_HSE_HZ, SYSCLK_ON_HSI_HZ] {
                assert!(divider(clock, baud).is_some(), "{baud} at {clock}");
            }
        }
    }

    #[test]
    fn uart_with_half_the_clock_has_every_rate_but_the_highest_without_crystal() {
        for baud in [1200, 115_200, 230_400, 460_800] {
            for clock in [SYSCLK_ON_HSE_HZ, SYSCLK_ON_HSI_HZ] {
                assert!(divider(clock / 2, baud).is_some(), "{baud} at {clock}");
            }
        }
        assert_eq!(divider(SYSCLK_ON_HSE_HZ / 2, 921_600), Some(39));
        assert_eq!(divider(SYSCLK_ON_HSI_HZ / 2, 921_600), None);
    }

    #[test]
    fn a_rate_out_of_tolerance_has_no_divider() {
        assert_eq!(divider(72_000_000, 0), None);
        assert_eq!(divider(72_000_000, 300), None, "the divider has 16 bits");
        assert_eq!(
            divider(72_000_000, 5_000_000),
            None,
            "fewer than sixteen clocks per bit"
        );
        assert_eq!(divider(8_000_000, 460_800), None, "2.1 % off");
    }
}
