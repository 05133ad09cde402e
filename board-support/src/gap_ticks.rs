//! Conversion of a line's silences to the settings of the frame-gap timer.
//!
//! The receiver raises its flag some time before the character has left the line. The timer starts at that flag and
//! must not end a silence early, so this time is added to t1.5 and t3.5.
//!
//! ```text
//!  character |......t1.5|.......t3.5|
//!       ^ flag: count 0 ^           ^
//!                       |-- late ---|-- late --->    one character each
//! ```
//!
//! A character that has begun by t1.5 or t3.5 raises its flag within one more character time. The decision can be
//! delayed by that much and no longer.

use ports::line_settings::{Format, LineSettings};

/// Times on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineTimes {
    /// t1.5 in nanoseconds.
    pub t15_ns: u32,
    /// t3.5 in nanoseconds.
    pub t35_ns: u32,
    /// The longest time that a reply may take, in microseconds, up to 33 s.
    pub limit_us: u32,
}

/// Settings of a 16-bit up-counting timer in one-pulse mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GapTicks {
    /// Prescaler register: the clock is divided by this value plus 1.
    pub prescaler: u16,
    /// Compare value: t1.5 after the character's end.
    pub t15: u16,
    /// Compare value: one character after `t15`.
    pub t15_late: u16,
    /// Compare value: t3.5 after the character's end.
    pub t35: u16,
    /// Reload value: one character after `t35`.
    pub t35_late: u16,
}

/// Settings of a free-running 16-bit timer for the time after which a reply is aborted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitTicks {
    /// Prescaler register: the clock is divided by this value plus 1.
    pub prescaler: u16,
    /// The time in ticks.
    pub ticks: u16,
}

impl LimitTicks {
    /// Returns settings for `us` microseconds, up to 33 s, with the timer's clock in whole MHz, up to 128. The time
    /// is rounded up.
    #[must_use]
    pub const fn new(clock_mhz: u8, us: u32) -> Self {
        let cycles = us.saturating_mul(clock_mhz as u32);
        let divider = cycles / 0xFFFF + 1;
        Self {
            prescaler: (divider - 1) as u16,
            ticks: cycles.div_ceil(divider) as u16,
        }
    }

    const fn cycles(self) -> u32 {
        self.prescaler as u32 + 1
    }

    /// Returns the duration of a microsecond in fractions of a tick: 65,536 to a tick.
    #[must_use]
    pub const fn us(self, clock_mhz: u8) -> u32 {
        fractions(clock_mhz as u32, self.cycles())
    }

    /// Returns the duration of a bit in fractions of a tick.
    #[must_use]
    pub const fn bit(self, clock_mhz: u8, baud: u32) -> u32 {
        fractions(clock_mhz as u32 * 1_000_000, baud * self.cycles())
    }
}

/// Returns `n / d` in fractions, rounded down. `d` must be below 2^24. A division of 64-bit numbers would cost 400 bytes
/// of code.
const fn fractions(n: u32, d: u32) -> u32 {
    let d = if d == 0 { 1 } else { d };
    let rest = (n % d) << 8;
    let more = (rest % d) << 8;
    ((n / d) << 16) | ((rest / d) << 8) | (more / d)
}

/// The bits of a character on the line, to find its last falling edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CharacterBits {
    /// All bits, with start, parity and stop bits.
    count: u8,
    parity: Parity,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Parity {
    None,
    Even,
    Odd,
}

impl CharacterBits {
    /// Returns the bits of a format with eight data bits: others do not arbitrate.
    #[must_use]
    pub const fn of(format: Format) -> Self {
        Self {
            count: format.bits() as u8,
            parity: match format {
                Format::E1 => Parity::Even,
                Format::O1 => Parity::Odd,
                _ => Parity::None,
            },
        }
    }

    /// Returns the number of bits from the last falling edge of this character to its end.
    #[inline]
    #[must_use]
    pub const fn after_last_fall(self, character: u8) -> u32 {
        let is_odd = character.count_ones() & 1;
        // The highest bit that differs from the one in front of it and is 0; the line is high in front of the start bit.
        let parity = match self.parity {
            Parity::None => 1,
            Parity::Even => is_odd,
            Parity::Odd => is_odd ^ 1,
        };
        let bits = (parity << 9) | ((character as u32) << 1);
        let falls = !bits & ((bits << 1) | 1) & 0x3FF;
        // Bit 0 is set, so there is a highest one.
        (self.count as u32 + falls.leading_zeros()).wrapping_sub(31)
    }
}

impl GapTicks {
    /// Returns settings for silences of `t15_ns` and `t35_ns` nanoseconds on a line, with the timer's clock in
    /// whole MHz, up to 128. The prescaler is the smallest with which 16 bits are enough, and every time is rounded
    /// up.
    ///
    /// Returns `None` when the rate or the clock is 0, or the clock is above 128 MHz.
    #[must_use]
    pub const fn new(clock_mhz: u8, line: LineSettings, t15_ns: u32, t35_ns: u32) -> Option<Self> {
        if line.baud == 0 || clock_mhz == 0 || clock_mhz > 128 {
            return None;
        }
        let clock = clock_mhz as u32;
        // At most 128 * 62,500 * 176, so 32 bits are enough. A 64-bit division would cost 400 bytes of code.
        let sixteenth = clock * 62_500;
        let rest = (sixteenth * line.format.sixteenths_after_flag()).div_ceil(line.baud);
        let character = (sixteenth * 16 * line.format.bits()).div_ceil(line.baud);
        // At most 4.3 s at 128 MHz: 30 bits.
        let t15 = rest.saturating_add(cycles(clock, t15_ns));
        let t35 = rest.saturating_add(cycles(clock, t35_ns));
        let t35_late = t35.saturating_add(character);
        let divider = t35_late.div_ceil(0xFFFF);
        let divider = if divider == 0 { 1 } else { divider };
        Some(Self {
            prescaler: (divider - 1) as u16,
            t15: t15.div_ceil(divider) as u16,
            t15_late: t15.saturating_add(character).div_ceil(divider) as u16,
            t35: t35.div_ceil(divider) as u16,
            t35_late: t35_late.div_ceil(divider) as u16,
        })
    }
}

/// Converts nanoseconds to cycles of a clock in MHz, rounded up.
const fn cycles(clock_mhz: u32, ns: u32) -> u32 {
    clock_mhz * (ns / 1000) + (clock_mhz * (ns % 1000)).div_ceil(1000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ports::line_settings::Format;

    #[test]
    fn the_last_falling_edge_of_a_character_is_found() {
        for (format, character, expected) in [
            // Only the start bit.
            (Format::N2, 0xFF, 11),
            (Format::N2, 0x00, 11),
            (Format::N1, 0xFF, 10),
            // Bit 7, eight bits after the start.
            (Format::N2, 0x7F, 3),
            (Format::N1, 0x40, 2),
            (Format::N2, 0x01, 9),
            // The parity bit.
            (Format::E1, 0xFF, 2),
            (Format::O1, 0xFF, 11),
            (Format::O1, 0xFE, 2),
            (Format::E1, 0xFE, 11),
        ] {
            let bits = CharacterBits::of(format).after_last_fall(character);
            assert_eq!(bits, expected, "{format:?} {character:02X}");
        }
    }

    /// Returns the time of a count after the character's end, in nanoseconds.
    fn after_end(ticks: GapTicks, count: u16, line: LineSettings) -> i64 {
        let divider = u64::from(ticks.prescaler) + 1;
        let flag_to_end = u64::from(line.format.sixteenths_after_flag()) * 1_000_000_000
            / (16 * u64::from(line.baud));
        (u64::from(count) * divider * 1_000_000_000 / 72_000_000) as i64 - flag_to_end as i64
    }

    #[test]
    fn a_silence_is_never_too_short_and_at_most_two_ticks_too_long() {
        for (baud, t15, t35) in [
            (1200, 13_750_000, 32_083_334),
            (9600, 1_718_750, 4_010_417),
            (115_200, 750_000, 1_750_000),
            (921_600, 750_000, 1_750_000),
            (9600, 1_718_750, 100_000_000),
        ] {
            for format in [
                Format::N2,
                Format::E1,
                Format::O1,
                Format::N1,
                Format::SevenE1,
                Format::SevenO1,
                Format::SevenN2,
            ] {
                let line = LineSettings { baud, format };
                let ticks = GapTicks::new(72, line, t15, t35).unwrap();
                let tick_ns = (i64::from(ticks.prescaler) + 1) * 1_000_000_000 / 72_000_000 + 1;
                let character = 1_000_000_000 / baud * format.bits();
                for (count, wanted) in [
                    (ticks.t15, t15),
                    (ticks.t15_late, t15 + character),
                    (ticks.t35, t35),
                    (ticks.t35_late, t35 + character),
                ] {
                    let over = after_end(ticks, count, line) - i64::from(wanted);
                    assert!(
                        // The character time above is up to 11 ns short.
                        (-1..=2 * tick_ns + 11).contains(&over),
                        "{line:?} {wanted}: {over} ns over"
                    );
                }
            }
        }
    }

    #[test]
    fn a_limit_is_never_too_short_and_at_most_one_tick_too_long() {
        for us in [1, 900, 3_600, 24_900, 300_000, 4_800_000, 33_000_000] {
            let ticks = LimitTicks::new(72, us);
            let divider = u64::from(ticks.prescaler) + 1;
            let over = u64::from(ticks.ticks) * divider - 72 * u64::from(us);
            assert!(over < divider, "{us}: {over} cycles over {divider}");
        }
    }

    #[test]
    fn a_rate_or_clock_of_zero_is_rejected() {
        let line = LineSettings {
            baud: 0,
            format: Format::N2,
        };
        assert_eq!(GapTicks::new(72, line, 1, 2), None);
        let line = LineSettings::FACTORY;
        assert_eq!(GapTicks::new(0, line, 1, 2), None);
        assert!(
            GapTicks::new(72, line, u32::MAX, u32::MAX).is_some(),
            "4.3 s can be measured"
        );
    }
}
