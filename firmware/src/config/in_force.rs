//! The settings as the rest of the device takes them: typed, and those in force.

use modio_drivers::{ChannelSettings, Scale, Signal};
use register_map::Module;
use register_map::codes::{Baud, Format, GapRule, Mode};
use register_map::configuration as at;
use register_map::points::{self, CHANNELS};

use super::Settings;

/// The RS-485 line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineConfig {
    /// Speed.
    pub baud: Baud,
    /// Parity and stop bits.
    pub format: Format,
    /// RTU or ASCII.
    pub mode: Mode,
    /// Silence that ends a frame, in 0.1 ms, 5 to 1000; `None`: t3.5 by the standard.
    pub frame_gap: Option<u16>,
    /// What becomes of a frame with a gap above t1.5 in it.
    pub gap_rule: GapRule,
}

impl LineConfig {
    /// As the factory sets it: 9600 8N2 RTU. The loader mode has this whatever is stored.
    pub const FACTORY: Self = Self {
        baud: Baud::B9600,
        format: Format::F8N2,
        mode: Mode::Rtu,
        frame_gap: None,
        gap_rule: GapRule::Count,
    };

    pub(super) fn of(settings: &Settings) -> Self {
        let get = |address| settings.get(address);
        Self {
            baud: Baud::from_code(get(at::BAUD)).unwrap_or(Self::FACTORY.baud),
            format: Format::from_code(get(at::FORMAT)).unwrap_or(Self::FACTORY.format),
            mode: Mode::from_code(get(at::MODE)).unwrap_or(Self::FACTORY.mode),
            frame_gap: Some(get(at::FRAME_GAP)).filter(|gap| *gap != 0),
            gap_rule: GapRule::from_code(get(at::STRICT_T15)).unwrap_or(Self::FACTORY.gap_rule),
        }
    }
}

/// The settings by point of one point, for the module in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Point {
    /// How its channel is read or driven.
    pub settings: ChannelSettings,
    /// Output when the line falls silent: 0 or 1 for a bit, 0 to 4095 raw for a word; `None`: hold.
    pub safe: Option<u16>,
}

impl Point {
    /// Of a point, 0 to 31.
    pub(super) fn of(settings: &Settings, point: u16) -> Self {
        let get = |first: u16| settings.get(first.wrapping_add(point));
        Self {
            settings: ChannelSettings {
                filter: get(at::FILTER),
                beta: get(at::BETA),
                signal: Signal::from_code(get(at::RANGE)).unwrap_or_default(),
                scale: Scale::from_code(get(at::SCALE)).unwrap_or_default(),
            },
            safe: Some(get(at::SAFE)).filter(|safe| *safe != at::HOLD),
        }
    }
}

/// A port's module and its outputs at power-on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PortConfig {
    /// The module.
    pub module: Module,
    /// START by channel: 0 or 1 for a bit, 0 to 4095 raw for a word.
    pub start: [u16; CHANNELS as usize],
}

impl PortConfig {
    /// Of a port, 1 to 8.
    pub(super) fn of(settings: &Settings, port: u16) -> Self {
        let first = points::of_port(port);
        let mut start = [0; CHANNELS as usize];
        for (point, start) in (first..).zip(&mut start) {
            *start = settings.get(at::START.wrapping_add(point));
        }
        Self {
            module: settings.module(port),
            start,
        }
    }
}
