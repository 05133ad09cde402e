//! What every register block of the part is to the bus and to the run loop.

use crate::time::Time;

/// A register or a feature of a block that the simulator does not model: its name.
///
/// The bus records it as a finding, with the program counter and the instant; a read answers 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unmodelled(pub &'static str);

/// A register block on the part's buses.
///
/// Time reaches a block only through the instants it is handed, which never go back. Every access is
/// preceded by [`Peripheral::advance`] to the same instant, so that a block sees its own past first.
pub trait Peripheral {
    /// Reads the register at `offset` (word aligned, from the block's base).
    ///
    /// # Errors
    ///
    /// [`Unmodelled`] for a register or feature the block does not have: the bus records a finding and
    /// answers 0.
    fn read(&mut self, offset: u32, now: Time) -> Result<u32, Unmodelled>;

    /// Writes the register at `offset` (word aligned, from the block's base).
    ///
    /// # Errors
    ///
    /// [`Unmodelled`] for a register or feature the block does not have: the bus records a finding.
    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled>;

    /// The instant of the next event of this block; never before the last `advance`.
    fn next_event(&self) -> Option<Time> {
        None
    }

    /// Everything due up to and including `now` happens, in order. Called before each access and at
    /// each event.
    fn advance(&mut self, _now: Time) {}

    /// The level of the block's interrupt request line.
    fn irq(&self) -> bool {
        false
    }

    /// A system reset, or a reset by the block's bit in RCC_APB1RSTR or RCC_APB2RSTR.
    fn reset(&mut self, now: Time);

    /// The block's kernel clock is `hz` Hz from `now` on: the timer clock for a timer, PCLK for the
    /// others.
    fn set_clock(&mut self, _hz: u32, _now: Time) {}
}
