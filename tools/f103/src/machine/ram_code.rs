//! Code in SRAM that a start copies there again.
//!
//! The core discards translated code when its source bytes are stored, even with the same values. From a reset on,
//! stores to pages with code are therefore sent to the bus until code in SRAM runs. Then only the code whose source
//! bytes have changed is discarded.

use rigless::emulator::{Processor, Queued};

use crate::memory::{Memory, RAM_BASE, ROUTED_PAGE as PAGE};

/// The pages of SRAM that code has run from.
#[derive(Debug, Default)]
pub(super) struct RamCode {
    /// One bit for each page with code.
    pages: u64,
    /// The bytes of SRAM that the translated code came from, while the stores are sent to the bus.
    translated: Option<Vec<u8>>,
}

impl RamCode {
    /// Handles a reset: stores to pages with code are sent to the bus from now on.
    pub(super) fn reset(&mut self, core: &mut dyn Processor, ram: &Memory) {
        if self.pages == 0 || self.translated.is_some() {
            return;
        }
        self.translated = Some(ram.bytes().to_vec());
        for page in self.with_code() {
            core.ask(Queued::Route(address(page * PAGE)));
        }
    }

    /// Called before code at this offset of SRAM runs.
    pub(super) fn runs(&mut self, offset: usize, core: &mut dyn Processor, ram: &Memory) {
        self.end(core, ram);
        self.pages |= 1 << (offset % ram.bytes().len() / PAGE);
    }

    /// Stops sending stores to pages with code to the bus.
    pub(super) fn end(&mut self, core: &mut dyn Processor, ram: &Memory) {
        let Some(translated) = self.translated.take() else {
            return;
        };
        for page in self.with_code() {
            let bytes = page * PAGE..(page + 1) * PAGE;
            let (was, is) = (&translated[bytes.clone()], &ram.bytes()[bytes.clone()]);
            for (at, (was, is)) in bytes.clone().zip(was.iter().zip(is)) {
                if was != is {
                    core.ask(Queued::Invalidate(address(at), address(at + 1)));
                }
            }
            core.ask(Queued::Unroute(address(bytes.start)));
        }
    }

    fn with_code(&self) -> impl Iterator<Item = usize> + use<> {
        let pages = self.pages;
        (0..u64::BITS as usize).filter(move |page| pages >> page & 1 != 0)
    }
}

fn address(offset: usize) -> u64 {
    u64::from(RAM_BASE) + offset as u64
}
