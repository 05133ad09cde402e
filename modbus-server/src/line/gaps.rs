//! The silent times between characters and frames.

/// Silent times in nanoseconds, measured from the end of a character's last stop bit.
///
/// A UART only reports the end of a character, not the start of the next. Without other means, such as a pin
/// interrupt on the start bit, a gap longer than t1.5 is certain only when no character has ended for `t15 +
/// character`. In the same way, a frame that has ended can be distinguished from a frame that continues at the
/// limit only after `t35 + character`.
///
/// ```text
///   ___________            ___________
///   character n|...gap....|     n + 1 |
///              ^ end                  ^ end: gap = time between ends - character
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gaps {
    /// t1.5: the longest silence allowed within a frame.
    pub t15: u32,
    /// t3.5: the shortest silence between frames.
    pub t35: u32,
    /// Duration of one character, including start and stop bits.
    pub character: u32,
}

impl Gaps {
    /// Rate above which the silent times are fixed, in bit/s (V1.02 2.5.1.1).
    const FIXED_ABOVE: u32 = 19_200;
    /// t1.5 above 19200 bit/s, in ns.
    const FIXED_T15: u32 = 750_000;
    /// t3.5 above 19200 bit/s, in ns.
    const FIXED_T35: u32 = 1_750_000;

    /// The longest silence within an ASCII frame, in ns (V1.02 2.5.2.1).
    pub const ASCII_TIMEOUT: u32 = 1_000_000_000;

    /// Returns the times of the standard in nanoseconds (V1.02 2.5.1.1), for `baud` in bit/s and characters of
    /// `bits` bits, including start and stop bits. The duration of a bit is rounded up, so that no silence is too
    /// short.
    ///
    /// The standard uses 11-bit characters (2.5.1); with 8N1 a unit may use its own 10-bit characters. Between the
    /// two values the standard requires nothing. With `bits` = 10 the unit also serves masters that use 10.
    ///
    /// Intended for 1200 bit/s and above. Below 10 bit/s the times would not fit and are limited to the largest
    /// `u32`.
    pub const fn standard(baud: u32, bits: u8) -> Self {
        let bit = ns_per_bit(baud);
        let half_character = bit.saturating_mul(bits as u32).div_ceil(2);
        let (t15, t35) = if baud > Self::FIXED_ABOVE {
            (Self::FIXED_T15, Self::FIXED_T35)
        } else {
            (
                half_character.saturating_mul(3),
                half_character.saturating_mul(7),
            )
        };
        Self {
            t15,
            t35,
            character: bit.saturating_mul(bits as u32),
        }
    }

    /// Returns a silence between frames of this many tenths of a millisecond, in ns, to be used instead of t3.5. It
    /// is at least 1.5 characters: the line seems silent until a character has ended, and a sender may leave up to t1.5
    /// between two characters of a frame.
    pub const fn frame_gap(&self, tenths_of_ms: u16) -> u32 {
        let gap = (tenths_of_ms as u32).saturating_mul(100_000);
        let shortest = self.character.saturating_add(self.character.div_ceil(2));
        if gap < shortest { shortest } else { gap }
    }
}

/// Returns the duration of a bit in nanoseconds, rounded up.
const fn ns_per_bit(baud: u32) -> u32 {
    const SECOND: u32 = 1_000_000_000;
    if baud == 0 {
        u32::MAX
    } else {
        SECOND.div_ceil(baud)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_gap_below_one_and_a_half_characters_counts_as_these() {
        let gaps = Gaps::standard(9600, 11);
        assert_eq!(gaps.frame_gap(1000), 100_000_000);
        // 16.5 bits are 1.719 ms.
        assert_eq!(gaps.frame_gap(18), 1_800_000);
        for shorter in [1, 2, 17] {
            let shortest = gaps.frame_gap(shorter);
            assert!(
                (1_718_750..1_718_800).contains(&shortest),
                "{shorter}: {shortest}"
            );
        }
        // 16.5 bits are 286 us at 57600 bit/s and 143 us at 115200.
        assert_eq!(Gaps::standard(57_600, 11).frame_gap(5), 500_000);
        assert!((286_450..286_500).contains(&Gaps::standard(57_600, 11).frame_gap(2)));
        assert_eq!(Gaps::standard(115_200, 11).frame_gap(2), 200_000);
    }

    #[test]
    fn up_to_19200_the_times_are_multiples_of_a_character() {
        for (baud, bits) in [(1200, 11), (2400, 11), (9600, 11), (9600, 10), (19_200, 11)] {
            let gaps = Gaps::standard(baud, bits);
            let character = f64::from(bits) * 1e9 / f64::from(baud);
            let about = |gap: u32, characters: f64| {
                let excess = f64::from(gap) - characters * character;
                (0.0..50.0).contains(&excess)
            };
            assert!(about(gaps.t15, 1.5), "{baud} {gaps:?}");
            assert!(about(gaps.t35, 3.5), "{baud} {gaps:?}");
            assert!(about(gaps.character, 1.0), "{baud} {gaps:?}");
        }
    }

    #[test]
    fn above_19200_the_times_are_fixed() {
        for baud in [19_201, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600] {
            let gaps = Gaps::standard(baud, 11);
            assert_eq!((gaps.t15, gaps.t35), (750_000, 1_750_000));
        }
        assert_eq!(Gaps::standard(1_000_000, 10).character, 10_000);
    }

    #[test]
    fn no_rate_makes_the_times_overflow() {
        for baud in [0, 1, 9, u32::MAX] {
            for bits in [0, 1, 255] {
                let gaps = Gaps::standard(baud, bits);
                assert!(gaps.t15 <= gaps.t35);
            }
        }
    }
}
