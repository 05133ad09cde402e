//! Limits of the settings and of the words of analog points.

use crate::codes::{Scale, Signal};

/// Factory default of FILTER for a point that is not an analog input, in ms.
pub const DEBOUNCE_DEFAULT_MS: u16 = 5;

/// The longest debounce, in ms.
pub const DEBOUNCE_MAX_MS: u16 = 1000;

/// Factory default of FILTER for an analog input: a low-pass over 2^4 samples.
pub const LOW_PASS_DEFAULT: u16 = 4;

/// The largest FILTER of an analog input: a low-pass over 2^8 samples.
pub const LOW_PASS_MAX: u16 = 8;

/// The smallest B constant of a thermistor, in K.
pub const BETA_MIN: u16 = 2000;

/// The largest B constant of a thermistor, in K.
pub const BETA_MAX: u16 = 5000;

/// Factory default of BETA, in K.
pub const BETA_DEFAULT: u16 = 3950;

/// Largest raw value of a word point: 12 bits.
pub const RAW_MAX: u16 = 4095;

/// 10 V in mV.
pub const FULL_SCALE_MV: u16 = 10_000;

/// 20 mA in uA.
pub const FULL_SCALE_UA: u16 = 20_000;

/// The smallest current that an output may be commanded to, in uA.
pub const OUTPUT_MIN_UA: u16 = 4_000;

/// The lowest temperature, in 0.1 degC: -40 degC, the limit of common thermistors of 10 kOhm.
pub const MIN_TENTHS: i16 = -400;

/// The highest temperature, in 0.1 degC: 125 degC, for the same reason.
pub const MAX_TENTHS: i16 = 1250;

/// Returns the smallest and the largest word of an input: 0 to 4095 raw, 0 to 10000 mV, 0 to 20000 uA, -400 to 1250
/// in 0.1 degC.
#[must_use]
pub const fn of_input(signal: Signal, scale: Scale) -> (i16, i16) {
    match (scale, signal) {
        (Scale::Raw, _) => (0, RAW_MAX as i16),
        (Scale::Engineering, Signal::Voltage) => (0, FULL_SCALE_MV as i16),
        (Scale::Engineering, Signal::Current) => (0, FULL_SCALE_UA as i16),
        (Scale::Engineering, Signal::Ntc) => (MIN_TENTHS, MAX_TENTHS),
    }
}

/// Returns the smallest and the largest word that an output may be commanded to: 0 to 4095 raw, 0 to 10000 mV, 4000
/// to 20000 uA.
#[must_use]
pub const fn of_output(signal: Signal, scale: Scale) -> (u16, u16) {
    match (scale, signal) {
        (Scale::Raw, _) => (0, RAW_MAX),
        (Scale::Engineering, Signal::Voltage | Signal::Ntc) => (0, FULL_SCALE_MV),
        (Scale::Engineering, Signal::Current) => (OUTPUT_MIN_UA, FULL_SCALE_UA),
    }
}
