//! The silence that ends a frame of Modbus RTU.

use crate::serial::Settings;
use crate::time::Time;

impl Settings {
    /// The shortest silence that ends an RTU frame. Up to 19200 bit/s it is 3.5 characters of this
    /// format, above that 1750 us (Modbus over Serial Line V1.02, 2.5.1.1).
    ///
    /// The standard counts characters of 11 bits (2.5.1). In a format with 10 bits a unit may count characters of 10
    /// bits, and the standard demands nothing between the two values. The modio firmware counts 10 bits, so this
    /// function does, too: with 11 bits the record would join frames that the unit answers separately.
    #[must_use]
    pub fn frame_silence(self) -> Time {
        if self.baud > 19_200 {
            Time::from_us(1750)
        } else {
            let half_bits = 7 * u64::from(self.format.bits());
            Time::cycles(half_bits, self.baud.saturating_mul(2))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::serial::Format;

    #[test]
    fn silence_is_fixed_above_19200() {
        let at = |baud| Settings {
            baud,
            ..Settings::default()
        };
        // 38.5 bits at 19200 bit/s: 2.005 ms.
        assert_eq!(at(19_200).frame_silence().as_ns(), 2_005_208);
        assert_eq!(at(38_400).frame_silence(), Time::from_us(1750));
        assert_eq!(at(9600).characters(2), Time::cycles(22, 9600));
    }

    #[test]
    fn frame_silence_counts_the_bits_of_the_format_up_to_19200() {
        for format in Format::ALL {
            let at = |baud| Settings { baud, format };
            let bits = match format {
                Format::N2 | Format::E1 | Format::O1 => 77,
                Format::N1 | Format::SevenE1 | Format::SevenO1 | Format::SevenN2 => 70,
            };
            for baud in [1200, 9600, 19_200] {
                let expected = Time::cycles(bits, 2 * baud);
                assert_eq!(at(baud).frame_silence(), expected, "{format:?} {baud}");
            }
            assert_eq!(at(38_400).frame_silence(), Time::from_us(1750));
        }
    }
}
