//! Measures how long interrupts wait: from the instant at which one is pending and enabled to the entry of its handler.
//!
//! A wait includes all that delays the handler: PRIMASK, BASEPRI, a handler of the same or a higher priority, a flash
//! operation. It does not include the cycles of the entry itself ([`crate::costs`]).
//!
//! During the measurement the core returns to the run loop after every access outside the memories, so that no change
//! of the NVIC's registers is missed. An entry is detected by its read of the vector table: reads of the page with this
//! table are passed to the bus. The core executes the same instructions as without the measurement, but the run takes
//! longer.

use rigless::emulator::{Processor, Queued};
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::memory::RAM_BASE;
use crate::soc::map::irq;
use crate::time::Time;

/// Number of exceptions of the part: 16 of the core, then the interrupt lines (RM0008 table 63).
pub const EXCEPTIONS: usize = 16 + irq::LINES as usize;
/// Number of the exception PendSV (PM0056 table 17).
pub const PENDSV: usize = 14;
/// Number of the exception SysTick (PM0056 table 17).
pub const SYSTICK: usize = 15;

/// Registers of the NVIC and the system control block (PM0056 4.3, 4.4).
const ISER: u64 = 0xE000_E100;
const ISPR: u64 = 0xE000_E200;
const ICSR: u64 = 0xE000_ED04;
const VTOR: u64 = 0xE000_ED08;
const PENDSVSET: u64 = 1 << 28;
const PENDSTSET: u64 = 1 << 26;

/// The waits of an exception.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wait {
    /// Number of times that the handler was entered.
    pub entries: u64,
    /// The longest wait.
    pub longest: Time,
    /// Instant at which the handler was entered after the longest wait.
    pub at: Time,
}

/// The measurement.
#[derive(Debug)]
pub(super) struct Waits {
    /// Instant since which each exception is pending and enabled.
    since: [Option<Time>; EXCEPTIONS],
    done: [Wait; EXCEPTIONS],
    /// Address of the vector table. Accesses to its page are passed to the bus.
    table: Option<u32>,
    /// Whether all accesses to the flash are passed to the bus, also without the measurement.
    flash_is_sent: bool,
}

impl Waits {
    pub(super) fn new(flash_is_sent: bool) -> Self {
        Self {
            flash_is_sent,
            since: [None; EXCEPTIONS],
            done: [Wait::default(); EXCEPTIONS],
            table: None,
        }
    }

    /// Returns the waits of exception `number` so far.
    pub(super) fn of(&self, number: usize) -> Wait {
        self.done.get(number).copied().unwrap_or_default()
    }

    /// Returns the address of the vector table whose page is passed to the bus.
    pub(super) fn table(&self) -> Option<u32> {
        self.table
    }

    /// Restarts after a reset of the core: no exception waits any more, and the vector table is at another address.
    pub(super) fn reset(&mut self, core: &mut dyn Processor) {
        self.since = [None; EXCEPTIONS];
        self.leave(core);
    }

    /// Stops passing accesses to the page of the vector table to the bus.
    pub(super) fn leave(&mut self, core: &mut dyn Processor) {
        let table = self.table.take();
        if let Some(table) = table.filter(|&table| !self.flash_is_sent || table >= RAM_BASE) {
            core.ask(Queued::Unroute(u64::from(table)));
        }
    }

    /// Reads which exceptions are pending and enabled, and where the vector table is. Called between two instructions.
    pub(super) fn look(&mut self, core: &mut dyn Processor, now: Time, cycle: u64) {
        let mut read = |address| {
            core.debugger_access(None, address, Width::W32, VirtualNanos(cycle))
                .unwrap_or(0)
        };
        let table = read(VTOR) as u32;
        let icsr = read(ICSR);
        let lines = |base, read: &mut dyn FnMut(u64) -> u64| read(base) | read(base + 4) << 32;
        let waiting = lines(ISPR, &mut read) & lines(ISER, &mut read);
        for (number, since) in self.since.iter_mut().enumerate() {
            let waits = match number {
                PENDSV => icsr & PENDSVSET != 0,
                SYSTICK => icsr & PENDSTSET != 0,
                16.. => waiting >> (number - 16) & 1 != 0,
                _ => false,
            };
            *since = waits.then(|| since.unwrap_or(now));
        }
        if self.table != Some(table) {
            self.leave(core);
            core.ask(Queued::Route(u64::from(table)));
            self.table = Some(table);
        }
    }

    /// Handles a read of the word at `address` by the core itself. If the word is a vector, the core enters its
    /// handler.
    pub(super) fn vector_read(&mut self, address: u32, now: Time) {
        let Some(offset) = self.table.and_then(|table| address.checked_sub(table)) else {
            return;
        };
        let number = offset as usize / 4;
        if number < EXCEPTIONS {
            let waited = self.since[number]
                .take()
                .map_or(Time::ZERO, |since| now.saturating_sub(since));
            let done = &mut self.done[number];
            done.entries += 1;
            if waited > done.longest {
                (done.longest, done.at) = (waited, now);
            }
        }
    }
}
