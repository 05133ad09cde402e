//! One character as a waveform: right, or wrong in every way a line can make it wrong.

use super::settings::{Rate, Settings};
use crate::time::Time;

/// A character on the wire, start and stop bits included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Character {
    /// When the start bit begins.
    pub start: Time,
    /// How long one bit lasts.
    pub bit: Time,
    /// The level of each bit, the first (the start bit) in bit 0; 1 = mark, high.
    pub levels: u16,
    /// How many bits there are, at most 16.
    pub bits: u8,
}

impl Character {
    /// `byte` in the format and at the rate of `settings`, starting at time 0. With seven data bits its
    /// highest bit is not sent.
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

    /// A character of `data`, LSB first, its low `data_bits` bits, and `stop_bits` stop bits.
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

    /// A break: low for `low_bits` bits, then one stop bit. At least 10 to 15 of them.
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

    /// The same with bit `n` turned over: 0 is the start bit, 1 the lowest data bit. Nothing changes
    /// when the character is shorter.
    #[must_use]
    pub const fn with_bit_flipped(mut self, n: u8) -> Self {
        if n < self.bits {
            self.levels ^= 1 << n;
        }
        self
    }

    /// The same with its parity bit turned over, in a format that has one: the bit before the only stop bit.
    #[must_use]
    pub const fn with_wrong_parity(self) -> Self {
        self.with_bit_flipped(self.bits - 2)
    }

    /// The same with its first stop bit low: a framing error. `settings` are those it was made with.
    #[must_use]
    pub const fn with_bad_stop(mut self, settings: Settings) -> Self {
        let first_stop = self.bits - settings.format.stop_bits();
        self.levels &= !(1 << first_stop);
        self
    }

    /// The same starting at `start`.
    #[must_use]
    pub const fn at(mut self, start: Time) -> Self {
        self.start = start;
        self
    }

    /// When the last stop bit ends.
    #[must_use]
    pub fn end(&self) -> Time {
        self.start + self.bit * u64::from(self.bits)
    }

    /// The level during bit `n`; high after the last.
    #[must_use]
    pub const fn level(&self, n: u8) -> bool {
        n >= self.bits || self.levels >> n & 1 == 1
    }
}

/// Ones from bit `from` up to, not including, bit `to`.
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
    fn the_bits_of_each_format() {
        // Written LSB first from the right: stop bits, parity, data, start bit 0.
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
    fn damage_touches_only_its_bit() {
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
        let pause = Character::line_break(settings.rate(), 11);
        assert_eq!((pause.levels, pause.bits), (0x800, 12));
    }

    #[test]
    fn it_ends_after_its_bits() {
        let c = made(Format::N2, 0).at(Time::from_us(10));
        assert_eq!(c.end(), Time::from_us(10) + Time::cycles(1, 19_200) * 11);
        assert!(c.level(200));
    }
}
