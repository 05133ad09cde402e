//! Whether an analog input's signal can be trusted, judged by its codes before the low-pass, which hides a loose wire: with
//! one that opens and closes 20 times a second, the word of a thermistor moves far from the temperature and never shows an
//! open circuit.

use modio_drivers::{ChannelSettings, Code, input_status};
use register_map::limits::LOW_PASS_MAX;

/// Number of implausible codes that make an input bad, and of plausible ones in a row after which it is so no more.
pub const CODES: u16 = 10;

/// Time constants of the low-pass after which nothing is left in the word of fewer than [`CODES`] implausible codes.
const SETTLED: u16 = 5;

/// The codes of an analog input.
///
/// A code is implausible when it lies under the range, or shows an open or a short circuit. One over the range is
/// plausible.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plausible {
    /// Number of implausible codes since the input was good, at most [`CODES`].
    implausible: u16,
    /// Number of plausible codes since the last implausible one.
    in_a_row: u16,
}

impl Plausible {
    /// Returns an input that is good.
    pub const fn new() -> Self {
        Self {
            implausible: 0,
            in_a_row: 0,
        }
    }

    /// Adds the code of a scan. Implausible codes need not follow each other: of a wire that opens and closes many times a
    /// second, a part of the codes is plausible. An input that did not become bad is good when the low-pass has forgotten
    /// them; one that was bad waits for longer anyway.
    pub fn add(&mut self, code: u16, settings: &ChannelSettings) {
        if input_status::is_implausible(Code::new(code), settings) {
            self.implausible = (self.implausible + 1).min(CODES);
            self.in_a_row = 0;
        } else if self.implausible > 0 {
            self.in_a_row += 1;
            let settling = if self.is_bad() {
                0
            } else {
                SETTLED << settings.filter.min(LOW_PASS_MAX)
            };
            if self.in_a_row >= CODES + settling {
                self.implausible = 0;
            }
        }
    }

    /// Returns whether the input is good: no code was implausible, or enough in a row were plausible since then.
    pub const fn is_good(&self) -> bool {
        self.implausible == 0
    }

    /// Returns whether the input is bad: ten codes have been implausible since it was good.
    pub const fn is_bad(&self) -> bool {
        self.implausible >= CODES
    }
}

#[cfg(test)]
mod tests {
    use modio_drivers::{Kind, Signal};

    use super::*;

    /// Codes of a thermistor at 20 degC and of a wire that is cut.
    const WARM: u16 = 2_269;
    const CUT: u16 = 4_095;

    #[test]
    fn input_is_bad_after_ten_implausible_codes_and_good_after_plausible_ones_in_a_row() {
        let settings = ChannelSettings {
            signal: Signal::Ntc,
            filter: 0,
            ..ChannelSettings::default_for(Kind::WordInput)
        };
        let mut input = Plausible::new();
        let mut add = |code, number| {
            (0..number).for_each(|_| input.add(code, &settings));
            (input.is_good(), input.is_bad())
        };
        let [good, uncertain, bad] = [(true, false), (false, false), (false, true)];
        assert_eq!(add(WARM, 1), good);
        assert_eq!([add(CUT, 1), add(CUT, 8)], [uncertain; 2]);
        assert_eq!([add(WARM, 14), add(WARM, 1)], [uncertain, good]);
        assert_eq!([add(CUT, 9), add(WARM, 1)], [uncertain; 2]);
        assert_eq!([add(CUT, 1), add(CUT, 255)], [bad; 2], "nine and one");
        assert_eq!([add(WARM, 9), add(CUT, 1)], [bad; 2]);
        assert_eq!([add(WARM, 9), add(WARM, 1)], [bad, good]);
    }
}
