//! Reads of flash while it is being erased or programmed: they stall like fetches.
//!
//! A read by code in SRAM stalls the core until the operation ends (PM0075 2.3.1), be it a literal, a table or the
//! vector of an interrupt. The core reads flash without asking, so all of flash is sent to the bus while an
//! operation runs: always, where every read of constants is charged ([`super::costs`]).

use rigless::emulator::Queued;

use super::bus::Bus;
use super::memory::{FLASH_BASE, FLASH_SIZE};

/// The stretches of memory that the core sends to the bus or not.
const PAGE: u32 = 1024;

impl Bus {
    /// Sends reads of flash to the bus while they are watched, and no longer.
    pub(super) fn watch_flash(&mut self) {
        let busy = self.soc.flash.busy_until().is_some();
        self.read_stalls &= busy;
        let watched = busy || self.charges_tables();
        if watched == self.flash_is_watched {
            return;
        }
        self.flash_is_watched = watched;
        let vectors = self.waits.as_ref().and_then(|waits| waits.table());
        for base in [FLASH_BASE, 0] {
            for page in (base..base + FLASH_SIZE as u32).step_by(PAGE as usize) {
                let address = u64::from(page);
                if watched {
                    self.queued.push(Queued::Route(address));
                } else if vectors.is_none_or(|table| table & !(PAGE - 1) != page) {
                    self.queued.push(Queued::Unroute(address));
                }
            }
        }
    }
}
