//! The log: lines on RTT channel 0, for a probe or the simulator. When nobody reads, what no longer
//! fits is left out; nothing ever waits.

use board_support::ClockSource;
use firmware::start_up::Address;
use modio_drivers::ModuleError;
use register_map::Module;
use rtt_target::{UpChannel, rtt_init};
use ufmt::uwriteln;

/// What can happen while the device runs.
#[derive(Clone, Copy)]
pub enum Event {
    /// The slot's module began to fail.
    ModuleFails(ModuleError),
    /// The slot's module works again.
    ModuleGood,
}

/// What is known when the device starts.
pub struct Start {
    pub address: Address,
    pub dip: u8,
    pub module: Module,
    /// Whether there is a driver for the module.
    pub drivable: bool,
    pub clock: ClockSource,
    pub reset_cause: u8,
}

/// The log's writer.
pub struct Log(UpChannel);

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
    /// Opens the channel. Called once, first of all.
    pub fn new() -> Self {
        let channels = rtt_init! { up: { 0: { size: 512, name: "Terminal" } } };
        Self(channels.up.0)
    }

    /// How the device starts.
    pub fn start(&mut self, start: &Start) {
        self.line(|out| {
            uwriteln!(
                out,
                "modio {} on modio-02, 9600 8N2",
                env!("CARGO_PKG_VERSION")
            )
        });
        for (bit, cause) in CAUSES.iter().enumerate() {
            if start.reset_cause & (1 << bit) != 0 {
                self.line(|out| uwriteln!(out, "reset: {}", *cause));
            }
        }
        if start.clock == ClockSource::Internal {
            self.line(|out| {
                uwriteln!(
                    out,
                    "clock: the crystal did not start, running on the internal oscillator"
                )
            });
        }
        match start.address {
            Address::Unit(unit) => self.line(|out| uwriteln!(out, "unit address {}", unit)),
            Address::Loader => self.line(|out| uwriteln!(out, "unit address 255 (loader mode)")),
            Address::Invalid => self.line(|out| {
                uwriteln!(
                    out,
                    "SW01 shows {}, which is no unit address: the line stays silent",
                    start.dip
                )
            }),
        }
        let name = start.module.name();
        if start.drivable {
            self.line(|out| uwriteln!(out, "slot 5: {}", name));
        } else {
            self.line(|out| uwriteln!(out, "slot 5: {}, which this firmware cannot drive", name));
        }
    }

    /// Something happened.
    pub fn event(&mut self, event: Event) {
        match event {
            Event::ModuleFails(ModuleError::Line { channel }) => {
                self.line(|out| uwriteln!(out, "slot 5: channel {} fails", channel + 1));
            }
            Event::ModuleFails(_) => self.line(|out| uwriteln!(out, "slot 5: the module fails")),
            Event::ModuleGood => self.line(|out| uwriteln!(out, "slot 5: the module works again")),
        }
    }

    /// Writes a line. RTT's writer cannot fail: it leaves out what does not fit.
    fn line<E>(&mut self, write: impl FnOnce(&mut rtt_target::uWriter<'_>) -> Result<(), E>) {
        let _ = write(&mut self.0.u());
    }
}
