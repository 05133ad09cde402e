//! The log: lines on RTT channel 0, for a debug probe or the simulator. When the buffer is full because nobody
//! reads it, further lines are dropped; the firmware never waits. docs/architecture.md describes the lines;
//! docs/decisions.md says why they are text.

use board_support::{ClockSource, design::CRYSTAL_FAULTS, fault};
use firmware::{config, start_up::Address};
use heapless::String;
use modio_drivers::ModuleError;
use register_map::{
    Module,
    codes::{FaultKind, Mode},
};
use rtt_target::{ChannelMode, UpChannel};

use crate::{board::BOARD, clock, fault_record, rtt};

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
    /// Registers were disturbed, or a reply did not end: they, or the line, were set up again.
    LineRepaired,
    /// The radio is ready, or does not answer.
    Radio(bool),
    /// The supply is too low for the flash: a save, or an erase at the start, waits until it has recovered.
    LowSupply,
}

/// Data that is logged when the device starts.
pub struct Start<'a> {
    pub address: Address,
    pub dip: u8,
    pub line: config::LineConfig,
    /// The module of each slot.
    pub modules: &'a [Module],
    pub clock: ClockSource,
    pub reset_cause: u8,
    pub faults: fault::FaultRecord,
    pub config_invalid: bool,
}

/// The names of the reset flags, from bit 2. Bits 0 and 1 are of the low-power modes and of the window watchdog, which
/// nothing here uses.
const CAUSES: [&str; 4] = ["independent watchdog", "software", "power-on", "pin"];

/// Text for a module that fails as a whole.
const SILENT: &str = "the module does not answer";

/// Bytes that a line may have, including its end. Text that does not fit is dropped.
const LONGEST: usize = 96;

/// A line being composed. It does not use `core::fmt`, `ufmt` or `itoa`, with which the image is larger; `itoa` can
/// also panic.
struct Line(String<LONGEST>);

impl Line {
    fn of(text: &str) -> Self {
        let mut line = Self(String::new());
        line.text(text);
        line
    }

    /// Returns a line that begins with the time since the start in seconds, as in `[12.345] `.
    fn at(millis: u32) -> Self {
        let mut line = Self::of("[");
        line.number(millis / 1000).text(".");
        line.digits(millis % 1000, 100).text("] ");
        line
    }

    fn text(&mut self, text: &str) -> &mut Self {
        let _ = self.0.push_str(text);
        self
    }

    /// Appends a number in decimal.
    fn number(&mut self, number: u32) -> &mut Self {
        let mut place = 1;
        while place <= number / 10 {
            place *= 10;
        }
        self.digits(number, place)
    }

    /// Appends the decimal digits of a number, from the digit with this place value on.
    fn digits(&mut self, number: u32, mut place: u32) -> &mut Self {
        // The place value of the last digit is 1; dividing it by ten gives 0, which ends the loop.
        while let Some(leading) = number.checked_div(place) {
            let _ = self.0.push(char::from(b'0' + (leading % 10) as u8));
            place /= 10;
        }
        self
    }

    /// Appends the slot of a port.
    fn slot(&mut self, port: u16) -> &mut Self {
        self.text("slot ").number(port.into()).text(": ")
    }
}

/// The log's writer.
pub struct Log(Option<UpChannel>);

impl Log {
    /// Opens the channel.
    pub fn new() -> Self {
        Self(rtt::open())
    }

    /// Logs how the device starts.
    pub fn start(&mut self, start: &Start<'_>) {
        let format = start.line.format.name();
        let baud = start.line.baud;
        let mode = match start.line.mode {
            Mode::Rtu => "",
            Mode::Ascii => " ASCII",
        };
        let mut line = Line::of(concat!("modio ", env!("CARGO_PKG_VERSION"), " on "));
        line.text(BOARD.name).text(", ");
        self.write(line.number(baud).text(" ").text(format).text(mode));
        for (bit, cause) in CAUSES.iter().enumerate() {
            if start.reset_cause & (4 << bit) != 0 {
                self.write(Line::of("reset: ").text(cause));
            }
        }
        let fault = fault_record::kind(&start.faults);
        if fault != FaultKind::None {
            self.write(Line::of("WARN last fault: ").text(fault.name()));
        }
        if start.clock == ClockSource::Internal {
            let text = if start.faults.crystal_faults < CRYSTAL_FAULTS {
                "WARN the crystal did not start: internal oscillator"
            } else {
                "WARN the crystal failed twice: it is off until power-on"
            };
            self.write(&mut Line::of(text));
        }
        match start.address {
            Address::Unit(unit) => self.write(Line::of("unit address ").number(unit.into())),
            Address::Recovery => self.write(&mut Line::of("unit address 255 (recovery mode)")),
            // Without a switch there is always an address.
            Address::Invalid if !BOARD.switch => {}
            Address::Invalid => {
                let text = ": no unit address";
                self.write(
                    Line::of("WARN SW01 shows ")
                        .number(start.dip.into())
                        .text(text),
                );
            }
        }
        if start.config_invalid {
            let text = "WARN the stored settings are damaged: defaults are in force";
            self.write(&mut Line::of(text));
        }
        for (port, module) in BOARD.ports().zip(start.modules.iter().copied()) {
            self.write(Line::of("").slot(port).text(module.name()));
        }
    }

    /// Logs an event, with the time.
    pub fn event(&mut self, event: Event) {
        let mut line = Line::at(clock::millis());
        self.write(match event {
            Event::ModuleFails(port, error) => {
                let line = line.text("WARN ").slot(port);
                match error.first_line() {
                    Some(channel) => {
                        let channel = channel as u32 + 1;
                        line.text("channel ").number(channel).text(" fails")
                    }
                    None => line.text(SILENT),
                }
            }
            Event::ModuleGood(port) => line.slot(port).text("the module works again"),
            Event::CommunicationLost => line.text("WARN communication lost: outputs go to SAFE"),
            Event::Saved => line.text("configuration saved"),
            Event::SaveFailed => line.text("WARN the flash could not be written"),
            Event::LineRepaired => line.text("WARN line: set up again"),
            // The board has none.
            Event::Radio(_) if !BOARD.has_radio() => &mut line,
            Event::Radio(true) => line.text("radio: ready"),
            Event::Radio(false) => line.text("WARN radio: ").text(SILENT),
            Event::LowSupply => line.text("WARN the supply is too low for the flash"),
        });
    }

    /// Ends a line and writes it completely, or drops it when it does not fit.
    fn write(&mut self, line: &mut Line) {
        if let Some(channel) = &mut self.0 {
            // A debugger may have changed the mode to one in which the firmware waits until the debugger has read.
            channel.set_mode(ChannelMode::NoBlockSkip);
            channel.write(line.text("\n").0.as_bytes());
        }
    }
}
