//! An STM32F103 with a circuit around it, as its user sees it: power and time here, the pins in [`pins`], its memories
//! in [`inside`], measurements in [`measure`], a debugger's actions in [`debug`].

mod config;
mod debug;
mod inside;
mod measure;
mod pins;

use std::collections::BTreeMap;

pub use config::{Config, Error};

pub use crate::machine::usage::CoreTime;
pub use crate::machine::waits::Wait;

use crate::image::Image;
use crate::machine::{Limit, Machine, Stop};
use crate::periph::flash::Flash;
use crate::periph::ident::Ident;
use crate::periph::rcc::Cause;
use crate::soc::{Circuit, Soc};
use crate::time::Time;

/// Time from power off to power on in a power cycle, as in [`Chip::cycle`].
pub const CYCLE: Time = Time::from_ms(100);

/// An STM32F103 in the circuit `C`.
#[derive(Debug)]
pub struct Chip<C> {
    pub(crate) machine: Machine<C>,
    symbols: BTreeMap<String, u32>,
}

impl<C: Circuit> Chip<C> {
    /// A part with `image` in its flash, powered on at time 0 in `circuit`.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] when the image does not fit the flash, or `config.flash` is not as large as the flash.
    pub fn in_circuit(image: &Image, config: Config, circuit: C) -> Result<Self, Error> {
        let part = config.part;
        let mut flash = Flash::new(part, config.write_protection, config.seed);
        if let Some(contents) = &config.flash {
            if contents.len() != part.flash_size {
                return Err(Error::Image(format!(
                    "flash contents of {} bytes, not {}",
                    contents.len(),
                    part.flash_size
                )));
            }
            flash.bytes_mut().copy_from_slice(contents);
        }
        image.load(flash.bytes_mut(), part.page_size)?;
        let ident = Ident::new(part, config.unique_id, config.write_protection);
        let soc = Soc::new(&config, flash, circuit);
        let costs = config.corner.costs();
        let rtt_block = image.symbol("_SEGGER_RTT");
        let mut machine = Machine::new(part, soc, ident, costs, rtt_block, config.new_core);
        machine.bus.soc.refresh(Time::ZERO);
        machine.power_on();
        Ok(Self {
            machine,
            symbols: image
                .symbols()
                .map(|(name, address)| (name.to_owned(), address))
                .collect(),
        })
    }

    /// Whether the core goes on with what it has translated for an earlier chip.
    #[must_use]
    pub fn core_is_used(&self) -> bool {
        self.machine.core_is_used()
    }

    /// The circuit, to look at.
    #[must_use]
    pub fn circuit(&self) -> &C {
        &self.machine.bus.soc.circuit
    }

    /// Does something to the circuit at this instant; the part sees it immediately.
    pub fn change<T>(&mut self, action: impl FnOnce(&mut C) -> T) -> T {
        self.sync();
        let answer = action(&mut self.machine.bus.soc.circuit);
        let now = self.now();
        self.machine.bus.soc.refresh(now);
        answer
    }

    /// The virtual time.
    #[must_use]
    pub fn now(&self) -> Time {
        self.machine.now()
    }

    /// Runs until the virtual time is `t`, or the end of the instruction under way then; at once when it is
    /// past. Time passes with the power off too.
    pub fn run_until(&mut self, t: Time) {
        self.run(Limit {
            time: t,
            instructions: u64::MAX,
            pc: None,
            breakpoints: false,
        });
    }

    /// Runs for `d`.
    pub fn run_for(&mut self, d: Time) {
        self.run_until(self.now() + d);
    }

    /// Runs `n` instructions. Waiting in WFI costs none. Stops early when the power is off or the core has
    /// done nothing for a minute of virtual time.
    pub fn step(&mut self, n: u64) {
        self.run(Limit {
            time: Time::MAX,
            instructions: self.instructions().saturating_add(n),
            pc: None,
            breakpoints: false,
        });
    }

    /// Runs until the instruction at `address` is next, or until `limit`; returns whether it got there. From
    /// that very instruction it runs on to the next time.
    pub fn run_until_pc(&mut self, address: u32, limit: Time) -> bool {
        self.run(Limit {
            time: limit,
            instructions: u64::MAX,
            pc: Some(address),
            breakpoints: false,
        }) == Stop::Pc
    }

    fn run(&mut self, limit: Limit) -> Stop {
        let now = self.now();
        self.machine.bus.soc.refresh(now);
        let stop = self.machine.run(limit);
        self.sync();
        stop
    }

    /// Brings the wires up to the present.
    pub(crate) fn sync(&mut self) {
        let now = self.now();
        self.machine.bus.soc.sync(now);
    }

    /// Turns the power on; nothing when it is on.
    pub fn power_on(&mut self) {
        self.machine.power_on();
    }

    /// Cuts the power at this instant, between two instructions, in the middle of a flash operation if one
    /// runs. RAM is lost.
    pub fn power_off(&mut self) {
        self.machine.power_off();
    }

    /// Power off, 100 ms, power on.
    pub fn cycle(&mut self) {
        self.power_off();
        self.run_for(CYCLE);
        self.power_on();
    }

    /// Whether the power is on.
    #[must_use]
    pub fn powered(&self) -> bool {
        self.machine.powered()
    }

    /// Cuts the power in the middle of the `nth` flash operation (page erase, mass erase or half-word) from
    /// now, 1 = the next, when `fraction` (0 to 1) of it is done. A power cut before then takes it back.
    pub fn cut_in_flash_operation(&mut self, nth: u64, fraction: f64) {
        self.machine.cut_in_flash_operation(nth, fraction);
    }

    /// How often the power came on.
    #[must_use]
    pub fn power_ons(&self) -> u64 {
        self.machine.power_ons()
    }

    /// Pulls the reset pin for a moment.
    pub fn reset(&mut self) {
        if self.powered() {
            self.machine.reset(Cause::Pin);
        }
    }

    /// Resets since power-on, by the watchdog, by software or by the pin.
    #[must_use]
    pub fn resets(&self) -> u32 {
        self.machine.resets()
    }
}
