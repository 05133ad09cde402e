//! A character as a waveform, undamaged or damaged in the ways that occur on a line.

use super::settings::{Rate, Settings};
use crate::time::Time;

/// A character on the wire, start and stop bits included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Character {
    /// Start of the start bit.
    pub start: Time,
    /// Duration of one bit.
    pub bit: Time,
    /// Level of each bit, with the start bit in bit 0. A 1 is high (mark).
    pub levels: u16,
    /// Number of bits, at most 16.
    pub bits: u8,
}

impl Character {
    /// Returns a character of `byte` in the format and at the rate of `settings`, starting at time 0. With seven data
    /// bits the highest bit of `byte` is not sent.
    #[must_use]
    pub fn new(settings: Settings, byte: u8) -> Self {
        let data_bits = settings.format.data_bits();
        let data = u16::from(byte) & ones(0, data_bits);
        let after_data = 1 + data_bits;
        let (levels, stop) = match settings.format.parity() {
            None => (data << 1, after_data),
            Some(parity) => {
                let parity = u16::from(parity.bit(data)) << after_data;
                (data << 1 | parity, after_data + 1)
            }
        };
        let bits = settings.format.bits();
        Self {
            start: Time::ZERO,
            bit: settings.rate().bits(1),
            levels: levels | ones(stop, bits),
            bits,
        }
    }

    /// Returns a character of the low `data_bits` bits of `data`, LSB first, with `stop_bits` stop bits and without
    /// parity.
    #[must_use]
    pub fn raw(start: Time, rate: Rate, data: u16, data_bits: u8, stop_bits: u8) -> Self {
        let bits = 1 + data_bits + stop_bits;
        let data = data & ones(0, data_bits);
        Self {
            start,
            bit: rate.bits(1),
            levels: data << 1 | ones(1 + data_bits, bits),
            bits,
        }
    }

    /// Returns a break at time 0: low for `low_bits` bits, then one stop bit. A break has 10 to 15 low bits; more than
    /// 15 count as 15.
    #[must_use]
    pub fn line_break(rate: Rate, low_bits: u8) -> Self {
        let low_bits = low_bits.min(15);
        Self {
            start: Time::ZERO,
            bit: rate.bits(1),
            levels: 1 << low_bits,
            bits: low_bits + 1,
        }
    }

    /// Returns the same character with bit `n` inverted: 0 is the start bit, 1 the lowest data bit. Nothing changes if
    /// the character has no bit `n`.
    #[must_use]
    pub const fn with_bit_flipped(mut self, n: u8) -> Self {
        if n < self.bits {
            self.levels ^= 1 << n;
        }
        self
    }

    /// Returns the same character with an inverted parity bit, which is the bit before the only stop bit. The format
    /// must have a parity bit.
    #[must_use]
    pub const fn with_wrong_parity(self) -> Self {
        self.with_bit_flipped(self.bits - 2)
    }

    /// Returns the same character with a low first stop bit: a framing error. `settings` must be those of the
    /// character.
    #[must_use]
    pub const fn with_bad_stop(mut self, settings: Settings) -> Self {
        let first_stop = self.bits - settings.format.stop_bits();
        self.levels &= !(1 << first_stop);
        self
    }

    /// Returns the same character, starting at `start`.
    #[must_use]
    pub const fn at(mut self, start: Time) -> Self {
        self.start = start;
        self
    }

    /// Returns the end of the last stop bit.
    #[must_use]
    pub fn end(&self) -> Time {
        self.start + self.bit * u64::from(self.bits)
    }

    /// Returns the level during bit `n`; high after the last bit.
    #[must_use]
    pub const fn level(&self, n: u8) -> bool {
        n >= self.bits || self.levels >> n & 1 == 1
    }
}

/// Returns a mask with ones from bit `from` up to, not including, bit `to`.
const fn ones(from: u8, to: u8) -> u16 {
    let mut mask = 0;
    let mut bit = from;
    while bit < to {
        mask |= 1 << bit;
        bit += 1;
    }
    mask
}

#[cfg(test)]
mod tests {
    #![expect(
        clippy::unusual_byte_groupings,
        reason = "grouped as stop bits, parity, data, start bit"
    )]

    use super::super::settings::Format;
    use super::*;

    fn made(format: Format, byte: u8) -> Character {
        Character::new(
            Settings {
                baud: 19_200,
                format,
            },
            byte,
        )
    }

    #[test]
    fn each_format_has_its_bits() {
        // From the left: stop bits, parity bit, data bits, start bit.
        assert_eq!(made(Format::N2, 0x55).levels, 0b11_0101_0101_0);
        assert_eq!(made(Format::N1, 0xFF).levels, 0b1_1111_1111_0);
        assert_eq!(made(Format::E1, 0x07).levels, 0b1_1_0000_0111_0);
        assert_eq!(made(Format::O1, 0x07).levels, 0b1_0_0000_0111_0);
        assert_eq!(made(Format::SevenE1, 0x87).levels, 0b1_1_000_0111_0);
        assert_eq!(made(Format::SevenO1, 0x07).levels, 0b1_0_000_0111_0);
        assert_eq!(made(Format::SevenN2, 0x85).levels, 0b11_000_0101_0);
        for format in [Format::SevenE1, Format::SevenO1, Format::SevenN2] {
            assert_eq!(made(format, 0).bits, 10, "{format:?}");
        }
        assert_eq!(made(Format::N1, 0).bits, 10);
        assert_eq!(made(Format::O1, 0).bits, 11);
    }

    #[test]
    fn damage_changes_only_its_bit() {
        let good = made(Format::E1, 0xA5);
        assert_eq!(good.with_wrong_parity().levels, good.levels ^ 1 << 9);
        let seven = made(Format::SevenO1, 0x25);
        assert_eq!(seven.with_wrong_parity().levels, seven.levels ^ 1 << 8);
        assert_eq!(good.with_bit_flipped(1).levels, good.levels ^ 1 << 1);
        assert_eq!(good.with_bit_flipped(11), good);
        let settings = Settings {
            baud: 19_200,
            format: Format::N2,
        };
        let bad = Character::new(settings, 0).with_bad_stop(settings);
        assert_eq!(bad.levels, 0b10_0000_0000_0);
        let line_break = Character::line_break(settings.rate(), 11);
        assert_eq!((line_break.levels, line_break.bits), (0x800, 12));
    }

    #[test]
    fn character_ends_after_its_bits_and_the_line_is_high_then() {
        let c = made(Format::N2, 0).at(Time::from_us(10));
        assert_eq!(c.end(), Time::from_us(10) + Time::cycles(1, 19_200) * 11);
        assert!(c.level(200));
    }
}
