//! The I/O points: the addresses of each port, the kinds of a point, and the meaning of the words of analog points.

use crate::block::block;
use crate::codes::{Scale, Signal};
use crate::limits;
use crate::rule::Rule;
use crate::value::{Unit, Value};
use crate::values::Values;

pub use crate::kind::Kind;
pub use crate::port::{CHANNELS, COUNT, PORTS, first, of_port};

/// Returns the values that a master may write to an analog output: 0-4095 raw, 0-10000 mV or 4000-20000 uA.
///
/// Outputs have no [`Signal::Ntc`]; it is treated as [`Signal::Voltage`].
#[must_use]
pub const fn output_values(signal: Signal, scale: Scale) -> Values {
    let (min, max) = limits::of_output(signal, scale);
    Values::range(min, max)
}

/// Meaning of the word of an analog point for one value of RANGE and SCALE.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Value of RANGE.
    pub signal: Signal,
    /// Value of SCALE.
    pub scale: Scale,
    /// Unit of the word.
    pub unit: Unit,
    /// Smallest value. If it is below 0, the word is in two's complement.
    pub min: i32,
    /// Largest value.
    pub max: i32,
}

/// The readings of an analog input.
static INPUT_READINGS: [Reading; 6] = [
    input(Signal::Voltage, Scale::Raw),
    input(Signal::Voltage, Scale::Engineering),
    input(Signal::Current, Scale::Raw),
    input(Signal::Current, Scale::Engineering),
    input(Signal::Ntc, Scale::Raw),
    input(Signal::Ntc, Scale::Engineering),
];

/// The readings of an analog output. An output has no [`Signal::Ntc`].
static OUTPUT_READINGS: [Reading; 4] = [
    output(Signal::Voltage, Scale::Raw),
    output(Signal::Voltage, Scale::Engineering),
    output(Signal::Current, Scale::Raw),
    output(Signal::Current, Scale::Engineering),
];

const fn input(signal: Signal, scale: Scale) -> Reading {
    let (min, max) = limits::of_input(signal, scale);
    reading(signal, scale, min as i32, max as i32)
}

const fn output(signal: Signal, scale: Scale) -> Reading {
    let (min, max) = limits::of_output(signal, scale);
    reading(signal, scale, min as i32, max as i32)
}

const fn reading(signal: Signal, scale: Scale, min: i32, max: i32) -> Reading {
    let (code, exponent) = match (scale, signal) {
        (Scale::Raw, _) => ("", 0),
        (Scale::Engineering, Signal::Voltage) => ("mV", 0),
        (Scale::Engineering, Signal::Current) => ("uA", 0),
        (Scale::Engineering, Signal::Ntc) => ("Cel", -1),
    };
    Reading {
        signal,
        scale,
        unit: Unit {
            code,
            exponent,
            offset: 0,
        },
        min,
        max,
    }
}

/// Returns the meaning of the word of a point of this kind, for each RANGE and SCALE; empty for a point that is not
/// a word.
#[must_use]
pub fn readings(kind: Kind) -> &'static [Reading] {
    match kind {
        Kind::WordInput => &INPUT_READINGS,
        Kind::WordOutput => &OUTPUT_READINGS,
        Kind::None | Kind::BitInput | Kind::BitOutput => &[],
    }
}

block! {
    "Points", 0x0000..=0x001F;

    /// Points of ports 1-8, four each: bits or words as the port's module has them
    POINT "points": 0x0000 x 32, Value::NUMBER, Rule::by_module(Values::up_to(20_000));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_cover_every_range_and_scale_that_a_point_allows() {
        for (kind, signals) in [(Kind::WordInput, 3), (Kind::WordOutput, 2)] {
            let readings = readings(kind).iter();
            let codes = readings.map(|reading| (reading.signal.code(), reading.scale.code()));
            let signals = Signal::NAMES.iter().take(signals);
            let all = signals
                .flat_map(|signal| Scale::NAMES.iter().map(move |scale| (signal.0, scale.0)));
            assert!(codes.eq(all), "{kind:?}");
        }
        assert!(readings(Kind::BitInput).is_empty());
    }

    #[test]
    fn readings_of_an_output_have_the_limits_of_its_writes() {
        for reading in readings(Kind::WordOutput) {
            let (min, max) = (reading.min as u16, reading.max as u16);
            let values = output_values(reading.signal, reading.scale);
            assert_eq!(values, Values::range(min, max));
        }
    }
}
