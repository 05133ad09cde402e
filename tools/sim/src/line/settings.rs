//! How characters are cut on the line: the rate, the parity, the stop bits.

use crate::time::Time;

/// Parity of a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parity {
    /// The number of ones, parity bit included, is even.
    Even,
    /// The number of ones, parity bit included, is odd.
    Odd,
}

impl Parity {
    /// The parity bit that belongs to `data`.
    #[must_use]
    pub const fn bit(self, data: u16) -> bool {
        let odd = data.count_ones() % 2 == 1;
        match self {
            Self::Even => odd,
            Self::Odd => !odd,
        }
    }
}

/// Character format of the line: eight data bits unless the name says seven, in the numbering of the
/// FORMAT register.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// 8N2: no parity, two stop bits.
    #[default]
    N2,
    /// 8E1: even parity, one stop bit.
    E1,
    /// 8O1: odd parity, one stop bit.
    O1,
    /// 8N1: no parity, one stop bit.
    N1,
    /// 7E1: seven data bits, even parity, one stop bit.
    SevenE1,
    /// 7O1: seven data bits, odd parity, one stop bit.
    SevenO1,
    /// 7N2: seven data bits, no parity, two stop bits.
    SevenN2,
}

impl Format {
    /// Every format.
    pub const ALL: [Self; 7] = [
        Self::N2,
        Self::E1,
        Self::O1,
        Self::N1,
        Self::SevenE1,
        Self::SevenO1,
        Self::SevenN2,
    ];

    /// The format with this [`name`](Self::name).
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }

    /// Data bits: 7 or 8.
    #[must_use]
    pub const fn data_bits(self) -> u8 {
        match self {
            Self::N2 | Self::E1 | Self::O1 | Self::N1 => 8,
            Self::SevenE1 | Self::SevenO1 | Self::SevenN2 => 7,
        }
    }

    /// The parity, if there is one.
    #[must_use]
    pub const fn parity(self) -> Option<Parity> {
        match self {
            Self::N2 | Self::N1 | Self::SevenN2 => None,
            Self::E1 | Self::SevenE1 => Some(Parity::Even),
            Self::O1 | Self::SevenO1 => Some(Parity::Odd),
        }
    }

    /// Stop bits: 1 or 2.
    #[must_use]
    pub const fn stop_bits(self) -> u8 {
        match self {
            Self::N2 | Self::SevenN2 => 2,
            Self::E1 | Self::O1 | Self::N1 | Self::SevenE1 | Self::SevenO1 => 1,
        }
    }

    /// Bits of one character, start and stop bits included: 10 or 11.
    #[must_use]
    pub const fn bits(self) -> u8 {
        1 + self.data_bits() + self.parity().is_some() as u8 + self.stop_bits()
    }

    /// The name on a panel, such as `8N2`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::N2 => "8N2",
            Self::E1 => "8E1",
            Self::O1 => "8O1",
            Self::N1 => "8N1",
            Self::SevenE1 => "7E1",
            Self::SevenO1 => "7O1",
            Self::SevenN2 => "7N2",
        }
    }
}

/// A bit rate as a clock and the cycles of it that one bit lasts, so that no instant is rounded twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate {
    cycles: u32,
    hz: u32,
}

impl Rate {
    /// `baud` bits a second.
    #[must_use]
    pub const fn from_baud(baud: u32) -> Self {
        Self {
            cycles: 1,
            hz: baud,
        }
    }

    /// One bit every `cycles` cycles of a clock of `hz` Hz: at most 268 MHz.
    #[must_use]
    pub const fn from_clock(cycles: u32, hz: u32) -> Self {
        Self { cycles, hz }
    }

    /// The span of `n` bits.
    #[must_use]
    pub fn bits(self, n: u64) -> Time {
        Time::cycles(n * u64::from(self.cycles), self.hz)
    }

    /// The span of `n` sixteenths of a bit: the sampling clock of a receiver.
    #[must_use]
    pub fn sixteenths(self, n: u64) -> Time {
        Time::cycles(n * u64::from(self.cycles), self.hz.saturating_mul(16))
    }
}

/// The settings of one end of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Bits a second.
    pub baud: u32,
    /// Character format.
    pub format: Format,
}

impl Default for Settings {
    /// The device's factory default: 9600 8N2.
    fn default() -> Self {
        Self {
            baud: 9600,
            format: Format::N2,
        }
    }
}

impl Settings {
    /// The bit rate.
    #[must_use]
    pub const fn rate(self) -> Rate {
        Rate::from_baud(self.baud)
    }

    /// The span of `n` characters without a gap.
    #[must_use]
    pub fn characters(self, n: u64) -> Time {
        self.rate().bits(n * u64::from(self.format.bits()))
    }

    /// The shortest silence that ends an RTU frame. Up to 19200 bit/s it is 3.5 characters of this
    /// format, above that 1750 us (Modbus over Serial Line V1.02, 2.5.1.1).
    ///
    /// The standard counts 11-bit characters (2.5.1); in a format of 10 bits a unit may count its own.
    /// Between the two values nothing is demanded. The unit on this board counts its own, so the
    /// shorter value is t3.5 here: with 11 bits the record would join frames that the unit answers.
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

    #[test]
    fn a_bit_at_115200_from_72_mhz() {
        // RM0008 table 192: 72 MHz, 115.2 kbit/s, USARTDIV = 39.0625, BRR = 39 * 16 + 1 = 0x271.
        let rate = Rate::from_clock(0x271, 72_000_000);
        assert_eq!(rate.bits(1).as_ps(), 8_680_555);
        assert_eq!(rate.bits(10).as_ps(), 86_805_555);
        assert_eq!(rate.sixteenths(16), rate.bits(1));
    }

    #[test]
    fn silence_is_fixed_above_19200() {
        let at = |baud| Settings {
            baud,
            ..Settings::default()
        };
        // 38.5 bits at 19200 baud: 2.005 ms.
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

    #[test]
    fn parity_makes_the_ones_even_or_odd() {
        assert!(!Parity::Even.bit(0x03));
        assert!(Parity::Even.bit(0x07));
        assert!(Parity::Odd.bit(0x03));
        assert!(!Parity::Odd.bit(0x07));
    }
}
