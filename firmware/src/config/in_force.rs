//! The settings as the rest of the device takes them: typed, and those in force.

use register_map::Module;
use register_map::codes::{AirRate, Baud, Format, GapRule, Mode, Power, Scale, Signal};
use register_map::configuration as at;
use register_map::points::{CHANNELS, PointKind, SLOT_FIRST, SLOT_PORT};

use super::Settings;

/// The RS-485 line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
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

impl Line {
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

/// The LoRa line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lora {
    /// Address of the LoRa module.
    pub address: u16,
    /// Channel: 410 MHz + n, 0 to 31.
    pub channel: u8,
    /// Speed on the air.
    pub air_rate: AirRate,
    /// Power on the air.
    pub power: Power,
    /// Silence that ends a frame, in ms, 5 to 500.
    pub frame_gap_ms: u16,
}

impl Lora {
    /// `None`: the line is off.
    #[must_use]
    pub fn of(settings: &Settings) -> Option<Self> {
        let get = |address| settings.get(address);
        (get(at::LORA) != 0).then(|| Self {
            address: get(at::LORA_ADDRESS),
            channel: get(at::LORA_CHANNEL).to_le_bytes()[0],
            air_rate: AirRate::from_code(get(at::LORA_AIR_RATE)).unwrap_or(AirRate::K2d4),
            power: Power::from_code(get(at::LORA_POWER)).unwrap_or(Power::Dbm20),
            frame_gap_ms: get(at::LORA_FRAME_GAP),
        })
    }
}

/// A point of the slot, for the module in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Point {
    /// What the module makes of it.
    pub kind: PointKind,
    /// A bit input's debounce in ms, 0 to 1000; an analog input's low-pass over 2^n samples, n 0 to 8.
    pub filter: u16,
    /// NTC constant in K, 2000 to 5000.
    pub beta: u16,
    /// Its signal; never NTC for an output.
    pub signal: Signal,
    /// How it is counted.
    pub scale: Scale,
    /// Output when the line falls silent: 0 or 1 for a bit, 0 to 4095 raw for a word; `None`: hold.
    pub safe: Option<u16>,
}

impl Point {
    pub(super) fn of(settings: &Settings, channel: u16) -> Self {
        let point = SLOT_FIRST.wrapping_add(channel);
        let get = |first: u16| settings.get(first.wrapping_add(point));
        Self {
            kind: settings.kind(point),
            filter: get(at::FILTER),
            beta: get(at::BETA),
            signal: Signal::from_code(get(at::RANGE)).unwrap_or(Signal::Voltage),
            scale: Scale::from_code(get(at::SCALE)).unwrap_or(Scale::Raw),
            safe: Some(get(at::SAFE)).filter(|safe| *safe != at::HOLD),
        }
    }
}

/// The slot's module and its outputs at power-on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The module.
    pub module: Module,
    /// START by channel: 0 or 1 for a bit, 0 to 4095 raw for a word.
    pub start: [u16; CHANNELS as usize],
}

impl Slot {
    pub(super) fn of(settings: &Settings) -> Self {
        let module = settings.module(SLOT_PORT);
        let mut start = [0; CHANNELS as usize];
        for (point, start) in (SLOT_FIRST..).zip(&mut start) {
            *start = settings.get(at::START.wrapping_add(point));
        }
        Self { module, start }
    }
}
