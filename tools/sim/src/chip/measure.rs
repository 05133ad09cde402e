//! Measuring the firmware: its instructions, its time, and how long its interrupts wait.
//!
//! Instructions between two places are counted with [`Chip::symbol`], [`Chip::run_until_pc`] and
//! [`Chip::instructions`], which cost next to nothing. All measurements leave the run as it is.

use super::Chip;
use crate::machine::usage::CoreTime;
use crate::machine::waits::Wait;
use crate::soc::Circuit;

impl<C: Circuit> Chip<C> {
    /// Instructions retired since the chip was made.
    #[must_use]
    pub fn instructions(&self) -> u64 {
        self.machine.instructions()
    }

    /// Cycles of HCLK since the chip was made, those that the core slept through included.
    #[must_use]
    pub fn cycles(&self) -> u64 {
        self.machine.cycles()
    }

    /// How the core has spent the time since the chip was made.
    #[must_use]
    pub fn core_time(&self) -> CoreTime {
        self.machine.core_time()
    }

    /// Measures from now on how long interrupts wait, anew; `false` ends it and forgets. It makes a busy
    /// unit's run several times slower.
    pub fn measure_waits(&mut self, on: bool) {
        self.machine.measure_waits(on);
    }

    /// How long an exception had to wait, from pending and enabled to its handler's entry, since
    /// [`Chip::measure_waits`]: 14 is PendSV, 15 SysTick, 16 + n interrupt line n
    /// ([`crate::soc::map::irq`]). Of all others only the entries are counted. All 0 for a number that does
    /// not exist, or when nothing is measured.
    #[must_use]
    pub fn wait(&self, exception: usize) -> Wait {
        self.machine.wait(exception)
    }
}
