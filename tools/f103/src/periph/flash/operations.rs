//! The start of the operations, and the reasons why the controller rejects them.

use super::array::Operation;
use super::{
    Busy, CR_MER, CR_PER, CR_PG, Complaint, FETCHED_AHEAD, Flash, Lock, SR_BSY, SR_PGERR,
    SR_WRPRTERR,
};
use crate::memory::FLASH_BASE;
use crate::time::Time;

/// Bytes that a bit of FLASH_WRPR protects: four pages of 1 KiB or two of 2 KiB (PM0075 3.9).
const PROTECTED: usize = 4096;

impl Flash {
    /// Cuts the power at `now`: an operation under way is torn.
    pub fn power_off(&mut self, now: Time) {
        self.ahead = 0;
        self.bsy_is_late = false;
        if let Some(busy) = self.busy.take() {
            let whole = (busy.until - busy.from).as_ps().max(1);
            let done = now.saturating_sub(busy.from).as_ps();
            let parts = (u128::from(done) * 65_536 / u128::from(whole)).min(65_536) as u32;
            self.changed = Some(self.cells.tear(busy.operation, self.torn, parts));
            self.changes = self.changes.saturating_add(1);
        }
    }

    /// Stores `value` at `offset` into the flash for the core; `half` when the store is 16 bits wide.
    pub fn program(&mut self, offset: u32, half: bool, value: u16, now: Time) {
        let complain = |text, bus_error| Some(Complaint { text, bus_error });
        if !half {
            self.complaint = complain("flash is written by half-words only", true);
        } else if self.busy.is_some() {
            self.complaint = complain("flash written while an operation runs", false);
        } else if self.cr & CR_PG == 0 || self.lock != Lock::Open {
            self.complaint = complain("a store to flash with PG clear", false);
        } else if self.is_protected(offset as usize) {
            self.sr |= SR_WRPRTERR;
        } else {
            let at = offset as usize & !1;
            // A half-word that is not erased takes only 0x0000 (PM0075 2.3.3).
            if self.cells.read(at) != [0xFF; 2] && value != 0 {
                self.sr |= SR_PGERR;
                self.complaint = complain("a half-word that was not erased was programmed", false);
                return;
            }
            self.start(Operation::Program { at, value }, now);
        }
    }

    fn is_protected(&self, offset: usize) -> bool {
        self.wrpr >> (offset / PROTECTED).min(31) & 1 == 0
    }

    fn start(&mut self, operation: Operation, now: Time) {
        if !self.hsi_on {
            self.complaint = Some(Complaint {
                text: "flash operation with the HSI off",
                bus_error: false,
            });
            return;
        }
        let (lasts, is_erase) = match operation {
            Operation::Program { .. } => (self.durations.program, false),
            Operation::Page { .. } | Operation::Mass => (self.durations.erase, true),
        };
        self.started += 1;
        self.sr |= SR_BSY;
        self.ahead = FETCHED_AHEAD;
        self.bsy_is_late = is_erase;
        self.busy = Some(Busy {
            operation,
            from: now,
            until: now + lasts,
        });
    }

    /// Handles STRT: starts the erase that PER or MER selects.
    pub(super) fn erase(&mut self, now: Time) {
        let complain = |text| {
            Some(Complaint {
                text,
                bus_error: false,
            })
        };
        let offset = self.ar.wrapping_sub(FLASH_BASE) as usize;
        match self.cr & (CR_PG | CR_PER | CR_MER) {
            CR_PER => match self.cells.page_of(offset) {
                None => self.complaint = complain("erase of a page that does not exist"),
                Some(_) if self.is_protected(offset) => self.sr |= SR_WRPRTERR,
                Some(page) => self.start(Operation::Page { page }, now),
            },
            CR_MER if self.wrpr != u32::MAX => self.sr |= SR_WRPRTERR,
            CR_MER => self.start(Operation::Mass, now),
            _ => self.complaint = complain("STRT without exactly one of PER and MER"),
        }
    }
}
