//! Conversion between the 12-bit codes of the converters and mV, uA and 0.1 degC.
//!
//! Full scale, 10 V or 20 mA, is code 4095, for inputs and outputs. Every conversion rounds to the nearest value.
//!
//! A master may command an output within [`of_output`](register_map::limits::of_output), so the smallest current is 4 mA
//! in uA. A raw code may be any code, so that an output can also have no current; [`output_from_raw`] then returns 0 uA.
//! Converting any code to its unit and back returns the same code.

use register_map::limits::{FULL_SCALE_MV, FULL_SCALE_UA, MAX_TENTHS, MIN_TENTHS};

use crate::{ChannelSettings, Code, Scale, Signal, ntc};

/// The measured value of an analog input, in the unit of its signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// 0 to 10000 mV.
    Millivolts(u16),
    /// 0 to 20000 uA.
    Microamps(u16),
    /// In 0.1 degC, from [`ntc::tenths_celsius`].
    TenthsCelsius(i16),
}

impl Measured {
    /// Returns the measured value for a code with these settings.
    #[must_use]
    pub fn of(code: Code, settings: &ChannelSettings) -> Self {
        match settings.signal {
            Signal::Voltage => Self::Millivolts(units_from_code(code, FULL_SCALE_MV)),
            Signal::Current => Self::Microamps(units_from_code(code, FULL_SCALE_UA)),
            Signal::Ntc => Self::TenthsCelsius(ntc::tenths_celsius(code, settings.beta)),
        }
    }

    /// Returns the word of an input in engineering units. A temperature is in two's complement and limited to
    /// [`MIN_TENTHS`] to [`MAX_TENTHS`].
    #[must_use]
    pub fn word(self) -> u16 {
        match self {
            Self::Millivolts(units) | Self::Microamps(units) => units,
            Self::TenthsCelsius(tenths) => tenths.clamp(MIN_TENTHS, MAX_TENTHS) as u16,
        }
    }
}

/// Returns the word for a code of the DAC.
#[must_use]
pub const fn output_from_raw(code: Code, signal: Signal, scale: Scale) -> u16 {
    match full_scale(signal, scale) {
        Some(full_scale) => units_from_code(code, full_scale),
        None => code.get(),
    }
}

/// Returns the DAC's code for a word. A word above full scale counts as full scale.
#[must_use]
pub const fn output_to_raw(word: u16, signal: Signal, scale: Scale) -> Code {
    let full_scale = match full_scale(signal, scale) {
        Some(full_scale) => full_scale,
        None => Code::MAX.get(),
    };
    let word = if word > full_scale { full_scale } else { word };
    Code::new(rescale(word, Code::MAX.get(), full_scale))
}

/// Converts an output's word to new settings. When signal and scale have not changed, the word is returned
/// unchanged. Otherwise the new word stands for the same code, so that the output does not change.
#[must_use]
pub const fn output_rescaled(word: u16, from: &ChannelSettings, to: &ChannelSettings) -> u16 {
    if from.signal as u8 == to.signal as u8 && from.scale as u8 == to.scale as u8 {
        word
    } else {
        output_from_raw(
            output_to_raw(word, from.signal, from.scale),
            to.signal,
            to.scale,
        )
    }
}

/// Returns the value at code 4095 in the unit, or `None` for raw.
const fn full_scale(signal: Signal, scale: Scale) -> Option<u16> {
    match (scale, signal) {
        (Scale::Raw, _) => None,
        (Scale::Engineering, Signal::Voltage | Signal::Ntc) => Some(FULL_SCALE_MV),
        (Scale::Engineering, Signal::Current) => Some(FULL_SCALE_UA),
    }
}

/// Converts a code to the unit.
const fn units_from_code(code: Code, full_scale: u16) -> u16 {
    rescale(code.get(), full_scale, Code::MAX.get())
}

/// Returns `value * to / from`, rounded, for a value of at most `from`. The product is at most 20000 * 4095, which
/// fits. `from` is one of the constants above and never 0.
const fn rescale(value: u16, to: u16, from: u16) -> u16 {
    let product = value as u32 * to as u32 + from as u32 / 2;
    match product.checked_div(from as u32) {
        Some(quotient) => quotient as u16,
        None => 0,
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use register_map::limits::of_output;

    use super::*;
    use crate::Kind;

    const SIGNALS: [Signal; 3] = [Signal::Voltage, Signal::Current, Signal::Ntc];
    const SCALES: [Scale; 2] = [Scale::Raw, Scale::Engineering];

    fn codes() -> impl Iterator<Item = Code> {
        (0..=Code::MAX.get()).map(Code::new)
    }

    fn settings(signal: Signal, scale: Scale) -> ChannelSettings {
        ChannelSettings {
            signal,
            scale,
            ..ChannelSettings::default_for(Kind::WordInput)
        }
    }

    #[test]
    fn voltage_and_current_are_rounded_to_the_nearest_for_every_code() {
        for code in codes() {
            for (signal, full_scale) in [(Signal::Voltage, 10_000.0), (Signal::Current, 20_000.0)] {
                let exact = (f64::from(code.get()) * full_scale / 4095.0).round() as u16;
                let measured = Measured::of(code, &settings(signal, Scale::Engineering));
                assert_eq!(measured.word(), exact, "{signal:?} {code:?}");
                assert_eq!(output_from_raw(code, signal, Scale::Engineering), exact);
            }
        }
    }

    #[test]
    fn a_temperature_is_in_twos_complement_and_limited_to_the_measured_range() {
        let settings = settings(Signal::Ntc, Scale::Engineering);
        let word = |code| Measured::of(Code::new(code), &settings).word();
        assert_eq!(word(2048), 250, "10 k is 25 degC");
        assert_eq!(word(3160), (-1_i16) as u16);
        assert_eq!(word(0), 1250);
        assert_eq!(word(4095), (-400_i16) as u16);
    }

    #[test]
    fn a_commanded_word_becomes_the_nearest_code() {
        for (signal, full_scale) in [(Signal::Voltage, 10_000.0), (Signal::Current, 20_000.0)] {
            let (min, max) = of_output(signal, Scale::Engineering);
            for word in min..=max {
                let exact = (f64::from(word) * 4095.0 / full_scale).round() as u16;
                let code = output_to_raw(word, signal, Scale::Engineering);
                assert_eq!(code.get(), exact);
            }
        }
        let current = |ua| output_to_raw(ua, Signal::Current, Scale::Engineering).get();
        assert_eq!([4_000, 12_000, 20_000].map(current), [819, 2457, 4095]);
    }

    #[test]
    fn every_code_is_restored_from_its_word_and_limits_are_within_full_scale() {
        for signal in SIGNALS {
            for scale in SCALES {
                for code in codes() {
                    let word = output_from_raw(code, signal, scale);
                    assert_eq!(output_to_raw(word, signal, scale), code);
                }
                let (min, max) = of_output(signal, scale);
                assert!(min < max);
                assert_eq!(output_to_raw(max, signal, scale), Code::MAX);
                for beyond in [max, max + 1, u16::MAX] {
                    assert_eq!(output_to_raw(beyond, signal, scale), Code::MAX);
                }
                assert_eq!(output_from_raw(Code::MAX, signal, scale), max);
            }
        }
    }

    #[test]
    fn new_settings_do_not_change_the_output() {
        let all = SIGNALS.map(|signal| SCALES.map(|scale| settings(signal, scale)));
        for from in all.iter().flatten() {
            for to in all.iter().flatten() {
                for code in codes() {
                    let word = output_from_raw(code, from.signal, from.scale);
                    let new = output_rescaled(word, from, to);
                    assert_eq!(output_to_raw(new, to.signal, to.scale), code);
                }
            }
            let odd = 5_001;
            assert_eq!(
                output_rescaled(odd, from, from),
                odd,
                "unchanged settings do not round"
            );
        }
    }
}
