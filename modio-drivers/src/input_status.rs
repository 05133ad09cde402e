//! Checks whether an analog input's code is plausible for its signal: detects wire breaks, short circuits and
//! signals out of range.
//!
//! Every threshold has a second one a little further inside the range, at which the status is cleared, so that
//! noise near a threshold does not toggle the status.

use register_map::limits::{MAX_TENTHS, MIN_TENTHS};

use crate::scale::Measured;
use crate::{ChannelSettings, ChannelStatus, Code, Signal};

/// A 4-20 mA loop below this current, in uA, is under range. A transmitter signals its own failure with 3.6 mA or
/// less, and measures down to 3.8 mA (NAMUR NE 43).
pub const UNDER_RANGE_UA: u16 = 3_600;

/// A 4-20 mA loop below this current, in uA, is open. No transmitter can work with less; the rest is leakage.
pub const OPEN_CIRCUIT_UA: u16 = 1_000;

/// Hysteresis of a loop's thresholds, in uA: half of the 0.2 mA that NE 43 keeps between a failure and a
/// measurement.
pub const HYSTERESIS_UA: u16 = 100;

/// A voltage or current at this code is over range. The converter is at its limit, so the signal may have any value
/// from here up. Exactly full scale, 10 V or 20 mA, also counts as over range, because it gives the same code.
pub const OVER_RANGE_CODE: u16 = Code::MAX.get();

/// A thermistor at this code or below is shorted. This is 39 ohm: more than the wires have, and a quarter of the
/// resistance of the steepest thermistor at 125 degC.
pub const SHORT_CIRCUIT_CODE: u16 = 16;

/// A thermistor at this code or above is missing. This is 2.5 Mohm: more than twice the resistance of the steepest
/// thermistor at -40 degC.
pub const OPEN_CIRCUIT_CODE: u16 = Code::MAX.get() - 16;

/// Hysteresis of the codes above: two to three times the noise of the F103's converter.
pub const HYSTERESIS_CODE: u16 = 8;

/// Hysteresis of a thermistor's limits [`MIN_TENTHS`] and [`MAX_TENTHS`], in 0.1 degC.
pub const HYSTERESIS_TENTHS: i16 = 10;

/// Returns the status of an input with this code and measured value, whose status in the same range was `before`.
#[must_use]
pub fn judge(code: Code, measured: Measured, before: ChannelStatus) -> ChannelStatus {
    match measured {
        Measured::Millivolts(_) => saturation(code, before),
        Measured::Microamps(ua) => current(code, ua, before),
        Measured::TenthsCelsius(tenths) => thermistor(code, tenths, before),
    }
}

/// The smallest code at which a thermistor can be colder than [`MIN_TENTHS`], for the constants that BETA allows. Below it
/// [`is_implausible`] needs no temperature, whose computation is long.
const COLD_CODE: u16 = 3_500;

/// Returns whether a single code lies under the range, or shows an open or a short circuit.
#[must_use]
pub fn is_implausible(code: Code, settings: &ChannelSettings) -> bool {
    let is_cold = match settings.signal {
        // Nothing of it can be distinguished from 0 V.
        Signal::Voltage => return false,
        Signal::Current => true,
        Signal::Ntc => code.get() >= COLD_CODE,
    };
    let is_suspect = is_cold || code.get() <= SHORT_CIRCUIT_CODE;
    is_suspect
        && !matches!(
            judge(code, Measured::of(code, settings), ChannelStatus::Good),
            ChannelStatus::Good | ChannelStatus::OverRange
        )
}

fn saturation(code: Code, before: ChannelStatus) -> ChannelStatus {
    let over = OVER_RANGE_CODE - back_off(before == ChannelStatus::OverRange, HYSTERESIS_CODE);
    if code.get() >= over {
        ChannelStatus::OverRange
    } else {
        ChannelStatus::Good
    }
}

fn current(code: Code, ua: u16, before: ChannelStatus) -> ChannelStatus {
    use ChannelStatus::{OpenCircuit, UnderRange};
    let was_open = before == OpenCircuit;
    let was_under = was_open || before == UnderRange;
    if ua < OPEN_CIRCUIT_UA + back_off(was_open, HYSTERESIS_UA) {
        OpenCircuit
    } else if ua < UNDER_RANGE_UA + back_off(was_under, HYSTERESIS_UA) {
        UnderRange
    } else {
        saturation(code, before)
    }
}

fn thermistor(code: Code, tenths: i16, before: ChannelStatus) -> ChannelStatus {
    use ChannelStatus::{Good, OpenCircuit, OverRange, ShortCircuit, UnderRange};
    let short = SHORT_CIRCUIT_CODE + back_off(before == ShortCircuit, HYSTERESIS_CODE);
    let open = OPEN_CIRCUIT_CODE - back_off(before == OpenCircuit, HYSTERESIS_CODE);
    if code.get() <= short {
        return ShortCircuit;
    }
    if code.get() >= open {
        return OpenCircuit;
    }
    let was_cold = matches!(before, UnderRange | OpenCircuit);
    let was_hot = matches!(before, OverRange | ShortCircuit);
    if tenths < MIN_TENTHS + if was_cold { HYSTERESIS_TENTHS } else { 0 } {
        UnderRange
    } else if tenths > MAX_TENTHS - if was_hot { HYSTERESIS_TENTHS } else { 0 } {
        OverRange
    } else {
        Good
    }
}

/// Returns the hysteresis while the status is active, otherwise 0.
const fn back_off(active: bool, hysteresis: u16) -> u16 {
    if active { hysteresis } else { 0 }
}

#[cfg(test)]
mod tests {
    use register_map::limits::{BETA_MAX, BETA_MIN};

    use super::*;
    use crate::{ChannelSettings, Kind, Signal, ntc};
    use ChannelStatus::{Good, OpenCircuit, OverRange, ShortCircuit, UnderRange};

    fn settings(signal: Signal) -> ChannelSettings {
        ChannelSettings {
            signal,
            ..ChannelSettings::default_for(Kind::WordInput)
        }
    }

    fn judge_code(
        code: u16,
        settings: &ChannelSettings,
        before: Option<ChannelStatus>,
    ) -> ChannelStatus {
        let code = Code::new(code);
        judge(
            code,
            Measured::of(code, settings),
            before.unwrap_or_default(),
        )
    }

    /// Sweeps the codes and returns each status with the code at which it began.
    fn sweep(
        signal: Signal,
        beta: u16,
        codes: impl Iterator<Item = u16>,
    ) -> [(u16, ChannelStatus); 5] {
        let settings = ChannelSettings {
            beta,
            ..settings(signal)
        };
        let mut seen = [(u16::MAX, Good); 5];
        let (mut count, mut before) = (0, None);
        for code in codes {
            let status = judge_code(code, &settings, before);
            if before != Some(status) {
                seen[count] = (code, status);
                count += 1;
                before = Some(status);
            }
        }
        seen
    }

    const NEVER: (u16, ChannelStatus) = (u16::MAX, Good);

    #[test]
    fn a_voltage_is_over_range_only_at_the_largest_code() {
        let up = sweep(Signal::Voltage, 3950, 0..=4095);
        assert_eq!(up, [(0, Good), (4095, OverRange), NEVER, NEVER, NEVER]);
        let down = sweep(Signal::Voltage, 3950, (0..=4095).rev());
        assert_eq!(down, [(4095, OverRange), (4086, Good), NEVER, NEVER, NEVER]);
    }

    #[test]
    fn a_loop_is_open_then_under_range_then_good_then_over_range() {
        let code = |ua: f64| (ua * 4095.0 / 20_000.0).ceil() as u16;
        let up = sweep(Signal::Current, 3950, 0..=4095);
        let expected = [
            (0, OpenCircuit),
            (code(1_100.0 - 0.5), UnderRange),
            (code(3_700.0 - 0.5), Good),
            (4095, OverRange),
            NEVER,
        ];
        assert_eq!(up, expected);
        let down = sweep(Signal::Current, 3950, (0..=4095).rev());
        let expected = [
            (4095, OverRange),
            (4086, Good),
            (code(3_600.0 - 0.5) - 1, UnderRange),
            (code(1_000.0 - 0.5) - 1, OpenCircuit),
            NEVER,
        ];
        assert_eq!(down, expected);
    }

    #[test]
    fn a_thermistor_goes_through_all_five_statuses_for_every_beta() {
        for beta in (BETA_MIN..=BETA_MAX).step_by(50) {
            let first = |limit: i16| {
                (0..=4095)
                    .find(|&code| ntc::tenths_celsius(Code::new(code), beta) <= limit)
                    .unwrap()
            };
            let up = sweep(Signal::Ntc, beta, 0..=4095);
            let expected = [
                (0, ShortCircuit),
                (25, OverRange),
                (first(1240), Good),
                (first(-401), UnderRange),
                (4079, OpenCircuit),
            ];
            assert_eq!(up, expected, "beta {beta}");
            let down = sweep(Signal::Ntc, beta, (0..=4095).rev());
            let expected = [
                (4095, OpenCircuit),
                (4070, UnderRange),
                (first(-391) - 1, Good),
                (first(1250) - 1, OverRange),
                (16, ShortCircuit),
            ];
            assert_eq!(down, expected, "beta {beta}");
        }
    }

    #[test]
    fn implausible_codes_are_those_under_range_and_those_of_an_open_or_a_short_circuit() {
        for signal in [Signal::Voltage, Signal::Current, Signal::Ntc] {
            for beta in (BETA_MIN..=BETA_MAX).step_by(250) {
                let settings = ChannelSettings {
                    beta,
                    ..settings(signal)
                };
                for code in 0..=4095 {
                    let status = judge_code(code, &settings, None);
                    let expected = matches!(status, UnderRange | OpenCircuit | ShortCircuit);
                    let found = is_implausible(Code::new(code), &settings);
                    assert_eq!(found, expected, "{signal:?}, beta {beta}, code {code}");
                }
            }
        }
    }

    #[test]
    fn a_jump_out_of_a_break_or_a_short_uses_the_hysteresis_of_the_limits_in_between() {
        let loop_ = settings(Signal::Current);
        let ua = |ua: u32| (ua * 4095 / 20_000) as u16;
        for (before, expected) in [
            (OpenCircuit, UnderRange),
            (UnderRange, UnderRange),
            (Good, Good),
            (OverRange, Good),
        ] {
            assert_eq!(judge_code(ua(3_650), &loop_, Some(before)), expected);
        }
        let settings = settings(Signal::Ntc);
        let code = |tenths| {
            (0..4095)
                .find(|&code| ntc::tenths_celsius(Code::new(code), settings.beta) <= tenths)
                .unwrap()
        };
        let (hot, cold) = (code(1_245), code(-395));
        for (before, at_hot, at_cold) in [
            (Good, Good, Good),
            (OverRange, OverRange, Good),
            (ShortCircuit, OverRange, Good),
            (UnderRange, Good, UnderRange),
            (OpenCircuit, Good, UnderRange),
        ] {
            assert_eq!(judge_code(hot, &settings, Some(before)), at_hot);
            assert_eq!(judge_code(cold, &settings, Some(before)), at_cold);
        }
    }

    #[test]
    fn noise_within_the_hysteresis_changes_a_status_once() {
        for signal in [Signal::Voltage, Signal::Current, Signal::Ntc] {
            for middle in 0..=4095_u16 {
                let (mut changes, mut before) = (0, None);
                for i in 0..20_u16 {
                    let code = (middle + i % 2 * 3).min(4095);
                    let status = judge_code(code, &settings(signal), before);
                    changes += u8::from(before.is_some_and(|before| before != status));
                    before = Some(status);
                }
                assert!(changes <= 1, "{signal:?} around {middle}: {changes}");
            }
        }
    }
}
