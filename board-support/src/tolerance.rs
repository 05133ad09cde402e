//! Baud rates that a UART can still receive when this unit runs on the internal oscillator.

use crate::{
    design::{HSI_ERROR_PPM, LINE_ASYMMETRY_NS, MASTER_ERROR_PPM, SYSCLK_ON_HSI_HZ},
    uart::{Format, LineSettings, divider},
};

/// Returns the deviation that a receiver tolerates, in ppm (RM0008 27.3.5, tables for a zero and any other
/// DIV_Fraction, noise allowed), and the number of half bits from the start edge to the sample of the last bit.
const fn receiver(format: Format, whole_divider: bool) -> (u32, u32) {
    match (format, whole_divider) {
        (Format::E1 | Format::O1, true) => (39_700, 21),
        (Format::E1 | Format::O1, false) => (35_300, 21),
        // Words of 8 bits, parity bit included.
        (_, true) => (43_750, 19),
        (_, false) => (38_800, 19),
    }
}

/// Returns whether the sum of all errors stays within what a receiver tolerates, over the whole temperature range:
/// the errors of the internal oscillator, the divider, the other station and the line.
#[must_use]
pub const fn internal_oscillator_serves(settings: LineSettings) -> bool {
    let LineSettings { baud, format } = settings;
    let Some(divider) = divider(SYSCLK_ON_HSI_HZ, baud) else {
        return false;
    };
    let (tolerance, half_bits) = receiver(format, divider & 0xF == 0);
    let mhz = SYSCLK_ON_HSI_HZ / 1_000_000;
    let quantised = (divider as u32 * baud).abs_diff(SYSCLK_ON_HSI_HZ) / mhz;
    let line = 2 * LINE_ASYMMETRY_NS * baud / half_bits / 1_000;
    HSI_ERROR_PPM + MASTER_ERROR_PPM + quantised + line <= tolerance
}

#[cfg(test)]
mod tests {
    use super::*;

    fn serves(baud: u32, format: Format) -> bool {
        internal_oscillator_serves(LineSettings { baud, format })
    }

    #[test]
    fn rates_up_to_230400_with_words_of_8_bits_and_19200_with_9_are_within_tolerance() {
        let rates = [
            1200, 2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600,
        ];
        for baud in rates {
            for format in [
                Format::N1,
                Format::N2,
                Format::SevenE1,
                Format::SevenO1,
                Format::SevenN2,
            ] {
                assert_eq!(serves(baud, format), baud <= 230_400, "{baud}");
            }
            for format in [Format::E1, Format::O1] {
                assert_eq!(serves(baud, format), baud <= 19_200, "{baud}");
            }
        }
    }

    #[test]
    fn rate_without_a_divider_is_not_served() {
        assert!(!serves(0, Format::N2));
        assert!(!serves(300, Format::N2));
    }
}
