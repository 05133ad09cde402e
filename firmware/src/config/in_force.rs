//! The settings in force, as typed values for the rest of the device.

use modio_drivers::{ChannelSettings, LoraSettings, Scale, Signal};
use register_map::board::Board;
use register_map::codes::{Format, GapRule, Mode};
use register_map::configuration as at;
use register_map::deadband::DEADBAND;

use super::Settings;

/// Settings of the RS-485 line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineConfig {
    /// Baud rate, in bit/s.
    pub baud: u32,
    /// Parity and stop bits.
    pub format: Format,
    /// RTU or ASCII.
    pub mode: Mode,
    /// Silence that ends a frame, in 0.1 ms, 2 to 1000; `None` stands for t3.5 as in the standard.
    pub frame_gap: Option<u16>,
    /// What to do with a frame that contains a gap longer than t1.5.
    pub gap_rule: GapRule,
}

impl LineConfig {
    /// The factory setting: 9600 8N2 RTU. Recovery mode always uses it.
    pub const FACTORY: Self = Self {
        baud: 9600,
        format: Format::F8N2,
        mode: Mode::Rtu,
        frame_gap: None,
        gap_rule: GapRule::Count,
    };

    /// Returns the settings of the line that a start with these settings puts in force.
    #[must_use]
    pub fn of<B: Board>(settings: &Settings<B>) -> Self {
        let get = |address| settings.get(address);
        Self {
            baud: u32::from(get(at::BAUD)) * 100,
            format: Format::from_code(get(at::FORMAT)).unwrap_or(Self::FACTORY.format),
            mode: Mode::from_code(get(at::MODE)).unwrap_or(Self::FACTORY.mode),
            frame_gap: Some(get(at::FRAME_GAP)).filter(|gap| *gap != 0),
            gap_rule: GapRule::from_code(get(at::STRICT_T15)).unwrap_or(Self::FACTORY.gap_rule),
        }
    }
}

/// Settings of the radio line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RadioConfig {
    /// Settings of the radio module.
    pub module: LoraSettings,
    /// Silence that ends a frame, in milliseconds, 5 to 500.
    pub frame_gap_ms: u16,
}

impl RadioConfig {
    /// Returns the settings of the radio line that a start with these settings puts in force, or `None` when the
    /// radio is off.
    #[must_use]
    pub fn of<B: Board>(settings: &Settings<B>) -> Option<Self> {
        let get = |address| settings.get(address);
        // The values are in the ranges of the register map, which fit a byte.
        let byte = |address| get(address).to_le_bytes()[0];
        let module = LoraSettings::new(
            get(at::LORA_ADDRESS),
            byte(at::LORA_CHANNEL),
            byte(at::LORA_AIR_RATE),
            byte(at::LORA_POWER),
        )?;
        (get(at::LORA) != 0).then_some(Self {
            module,
            frame_gap_ms: get(at::LORA_FRAME_GAP),
        })
    }
}

/// The settings in force of one point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Point {
    /// Settings of the channel that reads or drives the point.
    pub settings: ChannelSettings,
    /// Output when the line is silent for too long: 0 or 1 for a bit, 0 to 4095 raw for a word; `None` holds the
    /// output.
    pub safe: Option<u16>,
    /// Change of an analog input that is an event, in its unit; 0 for 1/256 of its range.
    pub deadband: u16,
    /// Output at power-on: 0 or 1 for a bit, 0 to 4095 raw for a word. 0 for an output that is to start as it was, until
    /// its value is restored.
    pub start: u16,
}

impl Point {
    /// Returns the settings of a point, 0 to 31.
    pub(super) fn of<B: Board>(settings: &Settings<B>, point: u16) -> Self {
        let get = |first: u16| settings.get(first.wrapping_add(point));
        Self {
            settings: ChannelSettings {
                filter: get(at::FILTER),
                beta: get(at::BETA),
                signal: Signal::from_code(get(at::RANGE)).unwrap_or_default(),
                scale: Scale::from_code(get(at::SCALE)).unwrap_or_default(),
            },
            safe: Some(get(at::SAFE)).filter(|safe| *safe != at::HOLD),
            deadband: if B::ROW.events { get(DEADBAND) } else { 0 },
            start: match get(at::START) {
                at::AS_IT_WAS if B::ROW.keeps_outputs => 0,
                start => start,
            },
        }
    }
}
