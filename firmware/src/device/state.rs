//! Identity and health: the read-only registers at 0x0200 and the fault record at 0x0260.

use modbus_server::Counters;
use register_map::{
    board::{Board, Each},
    codes::ModuleState,
    fault,
    points::PORTS,
    second, state as at,
};

use super::identification::{self, SERIAL_LEN};
use super::points::{Points, words_of};
use super::port::IoPort;
use crate::built;
use crate::config::{Config, LineName};

/// Data that is known when the device starts and never changes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Identity {
    /// Unit address in force.
    pub unit: u8,
    /// Reset flags: bit 0 low power, 1 window watchdog, 2 independent watchdog, 3 software, 4 power-on, 5 pin.
    pub reset_cause: u8,
    /// The 96-bit unique identity, half-words in the order of their addresses.
    pub unique_id: [u16; 6],
    /// The fault record as registers, from 0x0260 on.
    pub fault: [u16; fault_words()],
    /// The core runs on the internal oscillator.
    pub internal_oscillator: bool,
    /// Serial number for function 70.
    pub serial_number: u32,
    /// The unit reports events with function 70.
    pub reports_events: bool,
    /// Bits of the register BUILD that depend on loader and slot.
    pub build: u16,
}

const fn fault_words() -> usize {
    (fault::RESERVED + 2 - fault::KIND) as usize
}

/// The firmware's version as its registers hold it: major << 8 | minor, and patch.
const VERSION: [u16; 2] = [
    number(env!("CARGO_PKG_VERSION_MAJOR")) << 8 | number(env!("CARGO_PKG_VERSION_MINOR")),
    number(env!("CARGO_PKG_VERSION_PATCH")),
];

const fn number(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => panic!("cargo's version parts are numbers"),
    }
}

/// Identity and health.
#[derive(Debug)]
pub struct State<B: Board> {
    identity: Identity,
    /// The unique identity as text.
    serial: [u8; SERIAL_LEN],
    /// The server ID for function 11: the code of the board. It is one byte long, because some masters expect the
    /// run indicator right after the first byte.
    server_id: [u8; 1],
    /// Milliseconds since the start, wrapping.
    millis: u32,
    /// Milliseconds of the current second.
    part_ms: u32,
    uptime_s: u32,
    /// The counters of the RS-485 line, copied from its server before a read over this line, and ten times a second.
    counters: Counters,
    /// The counters of the second line, copied in the same way. Zero while a radio is off.
    second_counters: Each<B::Second, Counters>,
    /// Whether the radio works; `None` without one, and while it is off or being set up for the first time.
    pub radio_works: Option<bool>,
    /// The smallest amount of free stack so far, in bytes.
    pub stack_free: u16,
    /// Number of times that registers were repaired or the line was set up again since the start; stops at 65535.
    pub line_repairs: u16,
}

impl<B: Board> State<B> {
    /// Returns the state at the start.
    #[must_use]
    pub fn new(identity: Identity) -> Self {
        Self {
            server_id: [B::ROW.code as u8],
            serial: identification::serial(identity.unique_id),
            identity,
            millis: 0,
            part_ms: 0,
            uptime_s: 0,
            counters: Counters::default(),
            second_counters: Each::all(Counters::default()),
            radio_works: None,
            stack_free: 0,
            line_repairs: 0,
        }
    }

    /// Advances the time by `ms` milliseconds. Returns whether a second of the uptime has begun.
    pub const fn tick(&mut self, ms: u32) -> bool {
        self.millis = self.millis.wrapping_add(ms);
        self.part_ms = self.part_ms.saturating_add(ms);
        let second = self.part_ms >= 1000;
        while self.part_ms >= 1000 {
            self.part_ms -= 1000;
            self.uptime_s = self.uptime_s.wrapping_add(1);
        }
        second
    }

    /// Returns whether the start was a power-on.
    pub(super) fn was_powered_on(&self) -> bool {
        u16::from(self.identity.reset_cause) & at::reset_cause::POWER_ON != 0
    }

    /// Returns the counters of a line, to be updated.
    pub fn counters_of(&mut self, line: LineName) -> &mut Counters {
        match (line, self.second_counters.first_mut()) {
            (LineName::Second, Some(counters)) => counters,
            _ => &mut self.counters,
        }
    }

    /// Sets the unit address in force.
    pub(super) const fn set_unit(&mut self, unit: u8) {
        self.identity.unit = unit;
    }

    /// Returns the unique identity as text.
    pub(super) const fn serial(&self) -> &[u8; SERIAL_LEN] {
        &self.serial
    }

    /// Returns the server ID for function 11.
    pub(super) const fn server_id(&self) -> &[u8] {
        &self.server_id
    }

    /// Returns the milliseconds since the start, wrapping after 49 days.
    #[must_use]
    pub const fn millis(&self) -> u32 {
        self.millis
    }

    /// Returns whether the core runs on the internal oscillator.
    #[must_use]
    pub const fn on_internal_oscillator(&self) -> bool {
        self.identity.internal_oscillator
    }

    /// Returns whether the unit reports events with function 70.
    pub(super) const fn reports_events(&self) -> bool {
        self.identity.reports_events
    }

    /// Returns the seconds since the start.
    #[must_use]
    pub const fn uptime_s(&self) -> u32 {
        self.uptime_s
    }

    /// Returns a register other than the status, or 0 for one that does not exist.
    pub(super) fn word(&self, address: u16, points: &Points<B>, config: &Config<B>) -> u16 {
        let [version, patch] = VERSION;
        // Numbers of 32 bits begin at even addresses.
        let double = match address & !1 {
            at::PRODUCT_CODE => Some(at::PRODUCT),
            at::UPTIME => Some(self.uptime_s),
            at::UPTIME_MS => Some(self.millis),
            at::SERIAL_NUMBER => Some(self.identity.serial_number),
            at::COMMIT => Some(built::COMMIT),
            _ => None,
        };
        if let Some(number) = double {
            let [high, low] = words_of(number);
            return if address & 1 == 0 { high } else { low };
        }
        match address {
            at::FIRMWARE_VERSION => version,
            at::FIRMWARE_PATCH => patch,
            at::MAP_VERSION => at::MAP_VERSION_VALUE,
            at::BOARD => B::ROW.code,
            at::UNIT_ADDRESS => self.identity.unit.into(),
            at::RESET_CAUSE => self.identity.reset_cause.into(),
            at::STACK_FREE => self.stack_free,
            at::BUILD => built::FLAGS | self.identity.build,
            at::MODULE_IN_FORCE.. => self.by_index(address, points, config),
            _ => 0,
        }
    }

    /// Returns a register of the blocks with one register per port, counter or point.
    fn by_index(&self, address: u16, points: &Points<B>, config: &Config<B>) -> u16 {
        let nth = |words: &[u16], first: u16| {
            let index = usize::from(address.wrapping_sub(first));
            words.get(index).copied().unwrap_or_default()
        };
        let slot = |index: u16| usize::from((index + 1).wrapping_sub(B::ROW.first_port));
        match address.wrapping_sub(at::MODULE_IN_FORCE) {
            index if index < PORTS => {
                let module = config.modules().get(slot(index));
                module.map_or(0, |module| module.code())
            }
            index if index < 2 * PORTS => {
                let port = points.ports().get(slot(index - PORTS));
                port.map_or(ModuleState::None, IoPort::module_state).code()
            }
            _ if address < at::BUS_MESSAGES => nth(&self.identity.unique_id, at::UNIQUE_ID),
            _ if address < at::CHANNEL_STATUS => nth(&self.counters.as_words(), at::BUS_MESSAGES),
            _ if address >= second::BUS_MESSAGES => {
                let counters = self.second_counters.first();
                counters.map_or(0, |counters| {
                    nth(&counters.as_words(), second::BUS_MESSAGES)
                })
            }
            _ => points
                .status_of(address.wrapping_sub(at::CHANNEL_STATUS))
                .code(),
        }
    }

    /// Returns a register of the fault record.
    pub(super) fn fault_word(&self, address: u16) -> u16 {
        if address == fault::LINE_REPAIRS {
            return self.line_repairs;
        }
        let index = usize::from(address.wrapping_sub(fault::KIND));
        self.identity.fault.get(index).copied().unwrap_or_default()
    }
}
