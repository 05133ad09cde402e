//! The log: lines on RTT channel 0, for a debug probe or the simulator. When the buffer is full because nobody
//! reads it, further lines are dropped; the firmware never waits.

use board_support::{ClockSource, boards::SLOTS, design::CRYSTAL_FAULTS, fault, tolerance, uart};
use firmware::{config, start_up::Address};
use heapless::Vec;
use modio_drivers::ModuleError;
use register_map::{
    Module,
    codes::{FaultKind, Format, Mode},
};
use rtt_target::UpChannel;

use crate::{board::BOARD, rtt};

/// Events that are logged while the device runs.
#[derive(Clone, Copy)]
pub enum Event {
    /// The module in this port's slot began to fail.
    ModuleFails(u16, ModuleError),
    /// The module in this port's slot works again.
    ModuleGood(u16),
    /// The communication watchdog has tripped.
    CommunicationLost,
    /// The configuration is stored.
    Saved,
    /// The configuration could not be stored.
    SaveFailed,
    /// The line's registers were disturbed, or a reply did not end: the line was set up again.
    LineRepaired,
    /// The supply is too low for the flash: a save, or an erase at the start, waits until it has recovered.
    LowSupply,
}

/// Data that is logged when the device starts.
pub struct Start {
    pub address: Address,
    pub dip: u8,
    pub line: config::LineConfig,
    /// The line settings as the UART uses them.
    pub on_wire: uart::LineSettings,
    /// The module of each slot.
    pub modules: [Module; SLOTS],
    pub clock: ClockSource,
    pub reset_cause: u8,
    pub faults: fault::FaultRecord,
    pub config_invalid: bool,
}

/// The names of the reset flags, from bit 0.
const CAUSES: [&str; 6] = [
    "low-power",
    "window watchdog",
    "independent watchdog",
    "software",
    "power-on",
    "pin",
];

/// Bytes of the longest line, including its end. Longer lines are cut.
const LONGEST: usize = 80;

/// A line being composed. It does not use `core::fmt`, which is large and can panic. The usual small replacements
/// for `core::fmt` expand into more code at every log line.
struct Text(Vec<u8, LONGEST>);

impl Text {
    fn of(text: &str) -> Self {
        let mut line = Self(Vec::new());
        line.text(text);
        line
    }

    fn text(&mut self, text: &str) -> &mut Self {
        for byte in text.bytes() {
            self.byte(byte);
        }
        self
    }

    /// Appends a number in decimal.
    fn number(&mut self, number: u32) -> &mut Self {
        let mut place = 1;
        while place <= number / 10 {
            place *= 10;
        }
        // The place value of the last digit is 1; dividing it by ten gives 0, which ends the loop.
        while let Some(leading) = number.checked_div(place) {
            self.byte(b'0' + (leading % 10) as u8);
            place /= 10;
        }
        self
    }

    fn byte(&mut self, byte: u8) {
        let _ = self.0.push(byte);
    }
}

/// Begins a line about the slot of a port.
fn slot(port: u16) -> Text {
    let mut line = Text::of("slot ");
    line.number(port.into()).text(": ");
    line
}

/// The log's writer.
pub struct Log(Option<UpChannel>);

impl Log {
    /// Opens the channel.
    pub fn new() -> Self {
        Self(rtt::open())
    }

    /// Logs how the device starts.
    pub fn start(&mut self, start: &Start) {
        let format = match start.line.format {
            Format::F8N2 => "8N2",
            Format::F8E1 => "8E1",
            Format::F8O1 => "8O1",
            Format::F8N1 => "8N1",
            Format::F7E1 => "7E1",
            Format::F7O1 => "7O1",
            Format::F7N2 => "7N2",
        };
        let baud = start.line.baud.bits_per_second();
        let mode = match start.line.mode {
            Mode::Rtu => "",
            Mode::Ascii => " ASCII",
        };
        let mut line = Text::of(concat!("modio ", env!("CARGO_PKG_VERSION"), " on "));
        line.text(BOARD.name).text(", ");
        self.write(line.number(baud).text(" ").text(format).text(mode));
        for (bit, cause) in CAUSES.iter().enumerate() {
            if start.reset_cause & (1 << bit) != 0 {
                self.write(Text::of("reset: ").text(cause));
            }
        }
        let fault = match start.faults.fault.kind {
            fault::Kind::None => None,
            fault::Kind::Panic => Some("panic"),
            fault::Kind::HardFault => Some("hard fault"),
            fault::Kind::Watchdog => Some("watchdog bite"),
            fault::Kind::Crystal => Some("crystal failure"),
            fault::Kind::StackOverflow => Some("stack overflow"),
        };
        if let Some(fault) = fault {
            let mut line = Text::of("last fault: ");
            self.write(line.text(fault));
        }
        if start.clock == ClockSource::Internal {
            let text = if start.faults.crystal_faults < CRYSTAL_FAULTS {
                "the crystal did not start: internal oscillator"
            } else {
                "the crystal failed twice: internal oscillator until power-on"
            };
            self.write(&mut Text::of(text));
            if !tolerance::internal_oscillator_serves(start.on_wire) {
                let text = "warning: too fast for the internal oscillator at all temperatures";
                self.write(&mut Text::of(text));
            }
        }
        match start.address {
            Address::Unit(unit) => self.write(Text::of("unit address ").number(unit.into())),
            Address::Loader => self.write(&mut Text::of("unit address 255 (loader mode)")),
            Address::Invalid => {
                let text = ", which is no unit address: the line stays silent";
                self.write(Text::of("SW01 shows ").number(start.dip.into()).text(text));
            }
        }
        if start.config_invalid {
            let text = "configuration: what was stored is damaged, defaults are in force";
            self.write(&mut Text::of(text));
        }
        for (port, module) in BOARD.ports().zip(start.modules) {
            self.write(slot(port).text(module.name()));
        }
    }

    /// Logs an event.
    pub fn event(&mut self, event: Event) {
        let text = match event {
            Event::ModuleFails(port, error) => {
                let mut line = slot(port);
                return self.write(match error.first_line() {
                    Some(channel) => {
                        let channel = channel as u32 + 1;
                        line.text("channel ").number(channel).text(" fails")
                    }
                    None => line.text("the module does not answer"),
                });
            }
            Event::ModuleGood(port) => {
                return self.write(slot(port).text("the module works again"));
            }
            Event::CommunicationLost => "communication lost: outputs go to SAFE",
            Event::Saved => "configuration saved",
            Event::SaveFailed => "configuration: the flash does not take it",
            Event::LineRepaired => "line: set up again after a disturbance",
            Event::LowSupply => "configuration: the supply is too low, the flash has to wait",
        };
        self.write(&mut Text::of(text));
    }

    /// Ends a line and writes it completely, or drops it when it does not fit.
    fn write(&mut self, line: &mut Text) {
        if let Some(channel) = &mut self.0 {
            channel.write(&line.text("\n").0);
        }
    }
}

/// Returns the code of a fault in the fault record's register.
const fn kind_of(kind: fault::Kind) -> FaultKind {
    match kind {
        fault::Kind::None => FaultKind::None,
        fault::Kind::Panic => FaultKind::Panic,
        fault::Kind::HardFault => FaultKind::HardFault,
        fault::Kind::Watchdog => FaultKind::Watchdog,
        fault::Kind::Crystal => FaultKind::Crystal,
        fault::Kind::StackOverflow => FaultKind::StackOverflow,
    }
}

/// Returns the fault record as its registers, from 0x0260 on.
pub fn fault_words(record: &fault::FaultRecord) -> [u16; 16] {
    let high = |word: u32| (word >> 16) as u16;
    let low = |word: u32| word as u16;
    let fault::FaultRecord {
        fault,
        count,
        uptime,
        missing,
        crystal_faults: _,
    } = *record;
    [
        kind_of(fault.kind).code(),
        count,
        high(fault.pc),
        low(fault.pc),
        high(fault.lr),
        low(fault.lr),
        high(fault.status),
        low(fault.status),
        high(fault.address),
        low(fault.address),
        high(uptime),
        low(uptime),
        missing,
        0,
        0,
        0,
    ]
}
