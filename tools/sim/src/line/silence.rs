//! The silence that ends a frame of Modbus RTU.

use f103::serial::Settings;
use f103::time::Time;

/// The shortest silence that ends an RTU frame. Up to 19200 bit/s it is 3.5 characters of this format, above that
/// 1750 us (Modbus over Serial Line V1.02, 2.5.1.1).
///
/// The standard counts characters of 11 bits (2.5.1). In a format with 10 bits a unit may count characters of 10 bits,
/// and the standard demands nothing between the two values. The modio firmware counts 10 bits, so this function does,
/// too: with 11 bits the record would join frames that the unit answers separately.
pub fn frame_silence(settings: Settings) -> Time {
    if settings.baud > 19_200 {
        Time::from_us(1750)
    } else {
        let half_bits = 7 * u64::from(settings.format.bits());
        Time::cycles(half_bits, settings.baud.saturating_mul(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use f103::serial::Format;

    #[test]
    fn frame_silence_counts_the_bits_of_the_format_up_to_19200() {
        for format in Format::ALL {
            let at = |baud| frame_silence(Settings { baud, format });
            let bits = match format {
                Format::N2 | Format::E1 | Format::O1 => 77,
                Format::N1 | Format::SevenE1 | Format::SevenO1 | Format::SevenN2 => 70,
            };
            for baud in [1200, 9600, 19_200] {
                assert_eq!(at(baud), Time::cycles(bits, 2 * baud), "{format:?} {baud}");
            }
            assert_eq!(at(38_400), Time::from_us(1750));
        }
    }
}
