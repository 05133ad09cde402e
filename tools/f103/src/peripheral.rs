//! The trait of a register block, for the bus and the run loop.

use crate::time::Time;

/// The name of a register or a feature of a block that the simulator does not model.
///
/// The bus records a finding, with the program counter and the time. A read returns 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unmodelled(pub &'static str);

/// A register block on the part's buses.
///
/// A block has no clock. Each call passes the present time, which never goes back. Before an access the bus calls
/// [`Peripheral::advance`] with the time of the access, so that the block first handles the events that are due.
pub trait Peripheral {
    /// Reads the register at `offset` (word aligned, from the block's base).
    ///
    /// # Errors
    ///
    /// [`Unmodelled`] for a register or a feature that is not modelled. The bus then records a finding and returns 0.
    fn read(&mut self, offset: u32, now: Time) -> Result<u32, Unmodelled>;

    /// Writes the register at `offset` (word aligned, from the block's base).
    ///
    /// # Errors
    ///
    /// [`Unmodelled`] for a register or a feature that is not modelled. The bus then records a finding.
    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled>;

    /// Returns the time of the next event of this block, which is never before the last `advance`.
    fn next_event(&self) -> Option<Time> {
        None
    }

    /// Handles every event that is due up to and including `now`, in order. Called before each access and at each
    /// event.
    fn advance(&mut self, _now: Time) {}

    /// Returns the level of the block's interrupt request line.
    fn irq(&self) -> bool {
        false
    }

    /// Returns whether the block requests a DMA transfer: a read of it, and a write to it.
    fn dma_requests(&self) -> [bool; 2] {
        [false; 2]
    }

    /// Resets the block: a system reset, or its bit in RCC_APB1RSTR or RCC_APB2RSTR.
    fn reset(&mut self, now: Time);

    /// Sets the kernel clock of the block to `hz` Hz from `now` on: the timer clock of a timer, PCLK of any other
    /// block.
    fn set_clock(&mut self, _hz: u32, _now: Time) {}
}
