//! An STM32F103 in a circuit. This module has power and time, [`pins`] the pins, the crystal and the supply, [`inside`]
//! the memories, [`joined`] the run with other chips on one wire, [`measure`] the measurements, and [`debug`] the
//! methods for a debugger.

mod debug;
mod inside;
mod joined;
mod measure;
mod pins;

use std::collections::BTreeMap;

pub use crate::error::Error;
pub use crate::machine::usage::CoreTime;
pub use crate::machine::waits::Wait;
pub use crate::soc::Config;

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
    machine: Machine<C>,
    symbols: BTreeMap<String, u32>,
}

impl<C: Circuit> Chip<C> {
    /// Returns a part with `image` in its flash, powered on at time 0 in `circuit`.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] if the image does not fit into the flash, or if `config.flash` has another size.
    pub fn in_circuit(image: &Image, config: Config, circuit: C) -> Result<Self, Error> {
        let part = config.part;
        let mut flash = Flash::new(part, config.write_protection, config.seed);
        if let Some(contents) = &config.flash {
            if contents.len() != part.flash_size {
                return Err(Error::Image(format!(
                    "the contents of the flash have {} bytes, but the flash has {}",
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

    /// Returns whether the core uses code that was translated for an earlier chip.
    #[must_use]
    pub fn core_is_used(&self) -> bool {
        self.machine.core_is_used()
    }

    /// Returns the circuit, for reading.
    #[must_use]
    pub fn circuit(&self) -> &C {
        &self.machine.bus.soc.circuit
    }

    /// Changes the circuit at this instant. The part sees the change immediately.
    pub fn change<T>(&mut self, action: impl FnOnce(&mut C) -> T) -> T {
        self.sync();
        let answer = action(self.circuit_mut());
        self.refresh();
        answer
    }

    /// Returns the virtual time.
    #[must_use]
    pub fn now(&self) -> Time {
        self.machine.now()
    }

    /// Runs until the virtual time is `t`, and finishes the instruction that is being executed then. Returns
    /// immediately if `t` is in the past. Time also passes while the power is off.
    pub fn run_until(&mut self, t: Time) {
        self.run(Limit::until(t));
    }

    /// Runs for `d` of virtual time.
    pub fn run_for(&mut self, d: Time) {
        self.run_until(self.now() + d);
    }

    /// Runs `n` instructions. Waiting in WFI is not an instruction. Stops early if the power is off, or if the core has
    /// executed nothing for a minute of virtual time.
    pub fn step(&mut self, n: u64) {
        self.run(Limit {
            instructions: self.instructions().saturating_add(n),
            ..Limit::until(Time::MAX)
        });
    }

    /// Runs until the instruction at `address` is the next one, or until `limit`. Returns whether it has reached the
    /// instruction. If the core is already there, it runs until it is there again.
    pub fn run_until_pc(&mut self, address: u32, limit: Time) -> bool {
        self.run(Limit {
            pc: Some(address),
            ..Limit::until(limit)
        }) == Stop::Pc
    }

    fn run(&mut self, limit: Limit) -> Stop {
        self.refresh();
        let stop = self.machine.run(limit);
        self.sync();
        stop
    }

    /// Switches the power on. Does nothing if it is on.
    pub fn power_on(&mut self) {
        self.machine.power_on();
    }

    /// Switches the power off at this instant, between two instructions. This may be in the middle of a flash
    /// operation. The contents of the SRAM are lost.
    pub fn power_off(&mut self) {
        self.machine.power_off();
    }

    /// Switches the power off, waits 100 ms of virtual time, and switches it on.
    pub fn cycle(&mut self) {
        self.power_off();
        self.run_for(CYCLE);
        self.power_on();
    }

    /// Returns whether the power is on.
    #[must_use]
    pub fn powered(&self) -> bool {
        self.machine.powered()
    }

    /// Cuts the power in the `nth` flash operation (page erase, mass erase or half-word) from now (1 = the next), when
    /// `fraction` (0 to 1) of the operation is done. A power cut before that cancels this order.
    pub fn cut_in_flash_operation(&mut self, nth: u64, fraction: f64) {
        self.machine.cut_in_flash_operation(nth, fraction);
    }

    /// Returns the number of times that the power was switched on.
    #[must_use]
    pub fn power_ons(&self) -> u64 {
        self.machine.power_ons()
    }

    /// Resets the part through its reset pin. Does nothing while the power is off.
    pub fn reset(&mut self) {
        if self.powered() {
            self.machine.reset(Cause::Pin);
        }
    }

    /// Returns the number of resets since power-on: by the watchdog, by software or by the pin.
    #[must_use]
    pub fn resets(&self) -> u32 {
        self.machine.resets()
    }
}
