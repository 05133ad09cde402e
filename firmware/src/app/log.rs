//! The log: lines on RTT channel 0, for a probe or the simulator. When nobody reads, what no longer
//! fits is left out; nothing ever waits.

use board_support::{ClockSource, fault};
use firmware::{config::Line, start_up::Address};
use modio_drivers::ModuleError;
use register_map::{Module, codes::Format};
use rtt_target::UpChannel;
use ufmt::uwriteln;

use crate::rtt;

/// What can happen while the device runs.
#[derive(Clone, Copy)]
pub enum Event {
    /// The slot's module began to fail.
    ModuleFails(ModuleError),
    /// The slot's module works again.
    ModuleGood,
    /// The communication watchdog has tripped.
    CommunicationLost,
    /// The configuration is stored.
    Saved,
    /// The configuration could not be stored.
    SaveFailed,
}

/// What is known when the device starts.
pub struct Start {
    pub address: Address,
    pub dip: u8,
    pub line: Line,
    pub module: Module,
    pub clock: ClockSource,
    pub reset_cause: u8,
    pub fault: fault::Kind,
    pub config_invalid: bool,
}

/// The log's writer.
pub struct Log(Option<UpChannel>);

/// The names of the reset flags, from bit 0.
const CAUSES: [&str; 6] = [
    "low-power",
    "window watchdog",
    "independent watchdog",
    "software",
    "power-on",
    "pin",
];

impl Log {
    /// Opens the channel.
    pub fn new() -> Self {
        Self(rtt::open())
    }

    /// How the device starts.
    pub fn start(&mut self, start: &Start) {
        let baud = start.line.baud.bits_per_second();
        let format = match start.line.format {
            Format::F8N2 => "8N2",
            Format::F8E1 => "8E1",
            Format::F8O1 => "8O1",
            Format::F8N1 => "8N1",
        };
        let version = env!("CARGO_PKG_VERSION");
        self.line(|out| uwriteln!(out, "modio {} on modio-02, {} {}", version, baud, format));
        for (bit, cause) in CAUSES.iter().enumerate() {
            if start.reset_cause & (1 << bit) != 0 {
                self.line(|out| uwriteln!(out, "reset: {}", *cause));
            }
        }
        let fault = match start.fault {
            fault::Kind::None => None,
            fault::Kind::Panic => Some("panic"),
            fault::Kind::HardFault => Some("hard fault"),
            fault::Kind::Watchdog => Some("watchdog bite"),
            fault::Kind::Crystal => Some("crystal failure"),
            fault::Kind::StackOverflow => Some("stack overflow"),
        };
        if let Some(fault) = fault {
            self.line(|out| uwriteln!(out, "last fault: {}, see the registers from 0x0260", fault));
        }
        if start.clock == ClockSource::Internal {
            let text = "clock: the crystal did not start, running on the internal oscillator";
            self.line(|out| uwriteln!(out, "{}", text));
        }
        match start.address {
            Address::Unit(unit) => self.line(|out| uwriteln!(out, "unit address {}", unit)),
            Address::Loader => self.line(|out| uwriteln!(out, "unit address 255 (loader mode)")),
            Address::Invalid => {
                let text = "which is no unit address: the line stays silent";
                self.line(|out| uwriteln!(out, "SW01 shows {}, {}", start.dip, text));
            }
        }
        if start.config_invalid {
            let text = "configuration: what was stored is damaged, defaults are in force";
            self.line(|out| uwriteln!(out, "{}", text));
        }
        self.line(|out| uwriteln!(out, "slot 5: {}", start.module.name()));
    }

    /// Something happened.
    pub fn event(&mut self, event: Event) {
        let text = match event {
            Event::ModuleFails(ModuleError::Line { channel }) => {
                return self.line(|out| uwriteln!(out, "slot 5: channel {} fails", channel + 1));
            }
            Event::ModuleFails(_) => "slot 5: the module does not answer",
            Event::ModuleGood => "slot 5: the module works again",
            Event::CommunicationLost => "communication lost: outputs go to SAFE",
            Event::Saved => "configuration saved",
            Event::SaveFailed => "configuration: the flash does not take it",
        };
        self.line(|out| uwriteln!(out, "{}", text));
    }

    /// Writes a line. RTT's writer cannot fail: it leaves out what does not fit.
    fn line<E>(&mut self, write: impl FnOnce(&mut rtt_target::uWriter<'_>) -> Result<(), E>) {
        if let Some(channel) = &mut self.0 {
            let _ = write(&mut channel.u());
        }
    }
}

/// The fault record as its registers have it, from 0x0260 on.
pub fn fault_words(record: &fault::FaultRecord) -> [u16; 16] {
    let high = |word: u32| (word >> 16) as u16;
    let low = |word: u32| word as u16;
    let fault::FaultRecord {
        fault,
        count,
        uptime,
        missing,
    } = *record;
    [
        fault.kind as u16,
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
