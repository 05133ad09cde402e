//! Measurements of the firmware: its instructions, its time, and the waits of its interrupts.
//!
//! To count the instructions between two addresses, use [`Chip::symbol`], [`Chip::run_until_pc`] and
//! [`Chip::instructions`]. They do not slow the run down. No measurement changes the run.

use super::Chip;
use super::usage::CoreTime;
use super::waits::{Wait, Waits};
use crate::soc::Circuit;

impl<C: Circuit> Chip<C> {
    /// Returns the number of instructions that were executed since the chip was made.
    #[must_use]
    pub fn instructions(&self) -> u64 {
        self.counted + self.core.retired()
    }

    /// Returns the number of cycles of HCLK since the chip was made, also while the core slept.
    #[must_use]
    pub fn cycles(&self) -> u64 {
        self.bus.clock.cycle(self.core.retired())
    }

    /// Returns the times that the core has spent running, stalled, asleep and off, since the chip was made.
    #[must_use]
    pub fn core_time(&self) -> CoreTime {
        self.resting.of(self.now())
    }

    /// Starts to measure how long interrupts wait, from zero. `false` ends the measurement and drops its results. With
    /// it a busy unit runs several times slower.
    pub fn measure_waits(&mut self, on: bool) {
        self.ram_code.end(&mut *self.core, &self.bus.soc.ram);
        if let Some(mut waits) = self.bus.waits.take() {
            waits.leave(&mut *self.core);
        }
        let keep = self.bus.charges_tables();
        self.bus.waits = on.then(|| Box::new(Waits::new(keep)));
    }

    /// Returns the waits of an exception since [`Chip::measure_waits`]: the time from pending and enabled to the entry
    /// of its handler. 14 is PendSV, 15 SysTick, 16 + n interrupt line n ([`crate::soc::map::irq`]). For the other
    /// exceptions only the entries are counted. All values are 0 without a measurement, or if the number does not
    /// exist.
    #[must_use]
    pub fn wait(&self, number: usize) -> Wait {
        self.bus
            .waits
            .as_ref()
            .map_or_else(Wait::default, |waits| waits.of(number))
    }

    /// Returns whether the core uses code that was translated for an earlier chip.
    #[must_use]
    pub fn core_is_used(&self) -> bool {
        self.core_is_used
    }
}
