//! Reads of flash that are not those of plain memory: while flash is being erased or programmed, and of unsteady cells.
//!
//! A read by code in SRAM stalls the core until the operation ends (PM0075 2.3.1), be it a literal, a table or the
//! vector of an interrupt. The core reads flash without asking, so all of flash is sent to the bus while an
//! operation runs: always, where every read of constants is charged ([`super::costs`]). Pages with unsteady cells
//! always are; instructions are fetched from the likelier bits.

use rigless::emulator::Queued;

use super::bus::Bus;
use super::memory::FLASH_BASE;
use crate::periph::flash::PAGE;
use crate::soc::Circuit;

impl<C: Circuit> Bus<C> {
    /// Sends reads of flash to the bus, page by page, or no longer. `changed`: cells have changed.
    pub(super) fn route_flash(&mut self, changed: bool) {
        let busy = self.soc.flash.busy_until().is_some();
        self.read_stalls &= busy;
        let watched = busy || self.charges_tables();
        if watched == self.flash_is_watched && !changed {
            return;
        }
        self.flash_is_watched = watched;
        let wanted = if watched {
            u128::MAX
        } else {
            self.soc.flash.unsteady_pages()
        };
        let differ = wanted ^ core::mem::replace(&mut self.routed_pages, wanted);
        let vectors = self.waits.as_ref().and_then(|waits| waits.table());
        for page in (0..u128::BITS).filter(|page| differ >> page & 1 != 0) {
            for base in [FLASH_BASE, 0] {
                let first = base + page * PAGE as u32;
                let has_vectors = vectors.is_some_and(|table| table & !(PAGE as u32 - 1) == first);
                if wanted >> page & 1 != 0 {
                    self.queued.push(Queued::Route(first.into()));
                } else if !has_vectors {
                    self.queued.push(Queued::Unroute(first.into()));
                }
            }
        }
    }
}
