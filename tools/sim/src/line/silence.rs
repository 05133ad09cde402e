//! The silence that ends a frame of Modbus RTU.

use f103::serial::Settings;
use f103::time::Time;

/// Returns the shortest silence that ends an RTU frame: t3.5 for a unit that counts characters of this format.
///
/// The modio firmware counts them so. With the standard's 11 bits the record would join frames of a format with 10 bits
/// that the unit answers separately.
#[must_use]
pub fn frame_silence(settings: Settings) -> Time {
    let silence = modbus_line::t35(settings.baud, settings.format.bits());
    Time::from_ns(silence.as_nanos() as u64)
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
                let expected = Time::cycles(bits, 2 * baud);
                assert_eq!(at(baud).as_ns(), expected.as_ns(), "{format:?} {baud}");
            }
            assert_eq!(at(38_400), Time::from_us(1750));
        }
    }
}
