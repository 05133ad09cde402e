//! The baud rate divider of a UART.

use crate::design::BAUD_ERROR_PPM;

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
