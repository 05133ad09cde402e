//! Rate and format of characters.

use crate::time::Time;

/// Parity of a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parity {
    /// The number of ones, with the parity bit, is even.
    Even,
    /// The number of ones, with the parity bit, is odd.
    Odd,
}

impl Parity {
    /// Returns the parity bit that belongs to `data`.
    #[must_use]
    pub const fn bit(self, data: u16) -> bool {
        let odd = data.count_ones() % 2 == 1;
        match self {
            Self::Even => odd,
            Self::Odd => !odd,
        }
    }
}

/// Format of characters. They have eight data bits, except in the formats with `Seven` in their name.
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

    /// Returns the format with this [`name`](Self::name).
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }

    /// Returns the number of data bits: 7 or 8.
    #[must_use]
    pub const fn data_bits(self) -> u8 {
        match self {
            Self::N2 | Self::E1 | Self::O1 | Self::N1 => 8,
            Self::SevenE1 | Self::SevenO1 | Self::SevenN2 => 7,
        }
    }

    /// Returns the parity; `None` for a format without a parity bit.
    #[must_use]
    pub const fn parity(self) -> Option<Parity> {
        match self {
            Self::N2 | Self::N1 | Self::SevenN2 => None,
            Self::E1 | Self::SevenE1 => Some(Parity::Even),
            Self::O1 | Self::SevenO1 => Some(Parity::Odd),
        }
    }

    /// Returns the number of stop bits: 1 or 2.
    #[must_use]
    pub const fn stop_bits(self) -> u8 {
        match self {
            Self::N2 | Self::SevenN2 => 2,
            Self::E1 | Self::O1 | Self::N1 | Self::SevenE1 | Self::SevenO1 => 1,
        }
    }

    /// Returns the number of bits in a character, with the start and stop bits: 10 or 11.
    #[must_use]
    pub const fn bits(self) -> u8 {
        1 + self.data_bits() + self.parity().is_some() as u8 + self.stop_bits()
    }

    /// Returns the usual name, such as `8N2`.
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

/// A bit rate. It is stored as the frequency of a clock and the number of clock cycles in a bit, so that no instant is
/// rounded twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate {
    cycles: u32,
    hz: u32,
}

impl Rate {
    /// Returns a rate of `baud` bits per second.
    #[must_use]
    pub const fn from_baud(baud: u32) -> Self {
        Self {
            cycles: 1,
            hz: baud,
        }
    }

    /// Returns a rate of one bit in `cycles` cycles of a clock of `hz` Hz, at most 268 MHz.
    #[must_use]
    pub const fn from_clock(cycles: u32, hz: u32) -> Self {
        Self { cycles, hz }
    }

    /// Returns the duration of `n` bits.
    #[must_use]
    pub fn bits(self, n: u64) -> Time {
        Time::cycles(n * u64::from(self.cycles), self.hz)
    }

    /// Returns the number and time of the first tick at `span` or later, of a clock that ticks `parts` times in a bit.
    /// Ticks and time count from the start of the clock.
    #[must_use]
    pub fn ticks(self, parts: u32, span: Time) -> (u64, Time) {
        let hz = self.hz.saturating_mul(parts);
        let cycles = u64::from(self.cycles).max(1);
        let mut tick = span.in_cycles(hz) / cycles;
        let at = |tick: u64| Time::cycles(tick * cycles, hz);
        while at(tick) < span {
            tick += 1;
        }
        (tick, at(tick))
    }

    /// Returns the duration of `n` sixteenths of a bit, which is the period of a receiver's sampling clock.
    #[must_use]
    pub fn sixteenths(self, n: u64) -> Time {
        Time::cycles(n * u64::from(self.cycles), self.hz.saturating_mul(16))
    }
}

/// The settings of one end of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Rate in bits per second.
    pub baud: u32,
    /// Character format.
    pub format: Format,
}

impl Default for Settings {
    /// 9600 8N2.
    fn default() -> Self {
        Self {
            baud: 9600,
            format: Format::N2,
        }
    }
}

impl Settings {
    /// Returns the bit rate.
    #[must_use]
    pub const fn rate(self) -> Rate {
        Rate::from_baud(self.baud)
    }

    /// Returns the duration of `n` characters without gaps.
    #[must_use]
    pub fn characters(self, n: u64) -> Time {
        self.rate().bits(n * u64::from(self.format.bits()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bit_at_115200_from_72_mhz_has_the_duration_of_the_reference_manual() {
        // RM0008 table 192: 72 MHz, 115.2 kbit/s, USARTDIV = 39.0625, BRR = 39 * 16 + 1 = 0x271.
        let rate = Rate::from_clock(0x271, 72_000_000);
        assert_eq!(rate.bits(1).as_ps(), 8_680_555);
        assert_eq!(rate.bits(10).as_ps(), 86_805_555);
        assert_eq!(rate.sixteenths(16), rate.bits(1));
    }

    #[test]
    fn parity_bit_makes_the_number_of_ones_even_or_odd() {
        assert!(!Parity::Even.bit(0x03));
        assert!(Parity::Even.bit(0x07));
        assert!(Parity::Odd.bit(0x03));
        assert!(!Parity::Odd.bit(0x07));
    }
}
