//! Reads of flash that are not those of plain memory: while flash is being erased or programmed, and of unsteady cells.
//!
//! A read by code in SRAM stalls the core until the operation ends (PM0075 2.3.1): of a literal, a table or the vector
//! of an interrupt. The core reads flash without the bus, so all reads of flash are sent to the bus while an operation
//! runs, and always where every read of constants is charged ([`crate::costs`]). Reads of pages with unsteady cells are
//! always sent there; instructions are fetched from the more probable bits.

use rigless::emulator::Queued;

use super::bus::Bus;
use crate::memory::{FLASH_BASE, ROUTED_PAGE};
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
        let vectors = self.waits.as_ref().and_then(|waits| waits.table());
        for (page, routed) in self.routed_pages.iter_mut().enumerate() {
            let start = page * ROUTED_PAGE;
            let wanted = watched || self.soc.flash.is_unsteady(start..start + ROUTED_PAGE);
            if core::mem::replace(routed, wanted) == wanted {
                continue;
            }
            for base in [FLASH_BASE, 0] {
                let first = base + start as u32;
                let has_vectors =
                    vectors.is_some_and(|table| table & !(ROUTED_PAGE as u32 - 1) == first);
                if wanted {
                    self.queued.push(Queued::Route(first.into()));
                } else if !has_vectors {
                    self.queued.push(Queued::Unroute(first.into()));
                }
            }
        }
    }
}
