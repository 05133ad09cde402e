//! An STM32F103 in a circuit. This module has the run, [`pins`] the pins, the crystal and the supply, [`inside`] the
//! memories, and [`joined`] the run with other chips on one wire. The power, the measurements and the methods for a
//! debugger are in [`crate::machine`].

mod inside;
mod joined;
mod pins;

pub use crate::error::Error;
pub use crate::machine::Chip;
pub use crate::machine::usage::CoreTime;
pub use crate::machine::waits::Wait;
pub use crate::soc::Config;

use crate::machine::Limit;
use crate::soc::Circuit;
use crate::time::Time;

/// Time from power off to power on in a power cycle, as in [`Chip::cycle`].
pub const CYCLE: Time = Time::from_ms(100);

impl<C: Circuit> Chip<C> {
    /// Returns the circuit, for reading.
    #[must_use]
    pub fn circuit(&self) -> &C {
        &self.bus.soc.circuit
    }

    /// Changes the circuit at this instant. The part sees the change immediately.
    pub fn change<T>(&mut self, action: impl FnOnce(&mut C) -> T) -> T {
        self.sync();
        let answer = action(self.circuit_mut());
        self.refresh();
        answer
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
        })
    }

    pub(crate) fn run(&mut self, limit: Limit) -> bool {
        self.refresh();
        let reached = self.run_core(limit);
        self.sync();
        reached
    }

    /// Switches the power off, waits 100 ms of virtual time, and switches it on.
    pub fn cycle(&mut self) {
        self.power_off();
        self.run_for(CYCLE);
        self.power_on();
    }
}
