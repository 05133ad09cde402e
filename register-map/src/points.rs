//! Where the I/O points of each port stand: `(port - 1) * 4 + (channel - 1)`, for bits and words alike,
//! and what a point can be.

use modio_drivers::scale::{input_limits, output_limits};

use crate::block::block;
use crate::codes::{Scale, Signal};
use crate::rule::Rule;
use crate::value::{Unit, Value};
use crate::values::Values;

/// Channels of one port.
pub const CHANNELS: u16 = 4;

/// Ports the address space has room for.
pub const PORTS: u16 = 8;

/// The first address of a port's points, for ports 1 to 8.
///
/// # Panics
///
/// At compile time where it is used in a constant, for a port outside 1 to 8.
#[must_use]
pub const fn first(port: u16) -> u16 {
    assert!(port >= 1 && port <= PORTS);
    of_port(port)
}

/// The same for a port that is known to be 1 to 8, without the check: the firmware has no panics.
#[inline]
#[must_use]
pub const fn of_port(port: u16) -> u16 {
    port.wrapping_sub(1).wrapping_mul(CHANNELS)
}

/// Points of all ports.
pub const COUNT: u16 = PORTS * CHANNELS;

/// What a point is: what its module makes of the channel.
pub use modio_drivers::Kind;

/// What an analog output takes from a master: 0-4095 raw, 0-10000 mV or 4000-20000 uA.
///
/// There is no output for [`Signal::Ntc`]; it counts as [`Signal::Voltage`].
#[must_use]
pub const fn output_values(signal: Signal, scale: Scale) -> Values {
    let (min, max) = output_limits(signal, scale);
    Values::range(min, max)
}

/// What the word of an analog point means while RANGE and SCALE have these values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// RANGE.
    pub signal: Signal,
    /// SCALE.
    pub scale: Scale,
    /// What the word counts.
    pub unit: Unit,
    /// The least value. Below 0: the word is in two's complement.
    pub min: i32,
    /// The greatest value.
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
    let (min, max) = input_limits(signal, scale);
    reading(signal, scale, min as i32, max as i32)
}

const fn output(signal: Signal, scale: Scale) -> Reading {
    let (min, max) = output_limits(signal, scale);
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

/// What the word of a point of this kind means, for each RANGE and SCALE; empty for a point that is no word.
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
    fn ports_follow_one_another_from_address_0() {
        assert_eq!((first(1), first(5), first(8)), (0x0000, 0x0010, 0x001C));
    }

    #[test]
    fn readings_cover_every_range_and_scale_that_a_point_takes() {
        use crate::codes::{SCALE_NAMES, SIGNAL_NAMES};
        for (kind, signals) in [(Kind::WordInput, 3), (Kind::WordOutput, 2)] {
            let readings = readings(kind).iter();
            let codes = readings.map(|reading| (reading.signal.code(), reading.scale.code()));
            let signals = SIGNAL_NAMES.iter().take(signals);
            let all =
                signals.flat_map(|signal| SCALE_NAMES.iter().map(move |scale| (signal.0, scale.0)));
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
