//! Saving the configuration from the background, and restarts, which wait for it.
//!
//! While the supply is too low for the flash, a save waits where it is, before its first operation or between
//! two, and goes on once the supply is back. Until then another save is refused as busy.

use board_support::flash::FlashError;
use firmware::{
    config::Settings,
    store::{Operation, Saving, Store, StoreError},
};
use rtic::Mutex;

use crate::{
    board::{BOARD, Device},
    log::Event,
    pages::Pages,
};

/// The store, and a save under way.
pub struct Persistence {
    store: Store,
    pages: Pages,
    saving: Option<Saving>,
    /// The settings that are being saved: a copy, so that requests do not wait while they are encoded.
    settings: Settings,
    /// The save's operation that the flash refused because of a low supply.
    refused: Option<Operation>,
    /// The low supply was logged.
    low: bool,
    /// The page that is no longer needed waits to be erased.
    erase: bool,
    restart: bool,
}

impl Persistence {
    /// `erase`: the page that is no longer needed could not be erased at the start.
    pub fn new(store: Store, pages: Pages, erase: bool) -> Self {
        Self {
            store,
            pages,
            saving: None,
            settings: Settings::defaults(),
            refused: None,
            low: false,
            erase,
            restart: false,
        }
    }

    /// Begins to save what the configuration has set aside for it.
    pub fn begin(&mut self, device: &mut impl Mutex<T = &'static mut Device>) {
        device.lock(|device| self.settings.clone_from(device.config.to_save()));
        self.saving = Saving::new(&self.store, &self.pages, &self.settings);
        if self.saving.is_none() {
            // These settings are stored already: no wear.
            self.end(device);
        }
    }

    /// Restarts the device when nothing is being saved, nor waits to be.
    pub const fn restart_when_done(&mut self) {
        self.restart = true;
    }

    /// Goes on with a save to its end, one flash operation at a time with interrupts in between, or until the
    /// supply is too low; after its end restarts, if that was ordered.
    pub fn work(&mut self, device: &mut impl Mutex<T = &'static mut Device>) -> Option<Event> {
        let event = self
            .saving
            .take()
            .and_then(|saving| self.save(saving, device));
        if self.restart && self.saving.is_none() {
            board_support::restart();
        }
        event
    }

    /// Erases the page that is no longer needed, if there is one, so that the next save that needs it does not have to.
    /// All but the tasks that run from RAM stand still for up to 40 ms.
    pub fn erase(&mut self) {
        if !self.erase || !self.pages.has_supply() {
            return;
        }
        self.erase = false;
        // When the flash fails, the next save that needs the page tries again; when the supply is too low, this
        // does.
        if let Err(StoreError::Flash(_, FlashError::LowSupply)) =
            self.store.make_spare(&mut self.pages)
        {
            self.erase = true;
        }
    }

    /// The settings are stored. What takes long is worked out while requests are served.
    fn end(&self, device: &mut impl Mutex<T = &'static mut Device>) {
        let started = device.lock(|device| device.config.started());
        let changed = self.settings.needs_restart(&started);
        device.lock(|device| device.config.end_save(changed));
    }

    fn save(
        &mut self,
        mut saving: Saving,
        device: &mut impl Mutex<T = &'static mut Device>,
    ) -> Option<Event> {
        let mut good = true;
        if !self.pages.has_supply() {
            return self.wait(saving);
        }
        while let Some(operation) = self.refused.take().or_else(|| saving.next(&self.settings)) {
            match operation.perform(&mut self.pages) {
                Ok(()) => {}
                Err(StoreError::Flash(_, FlashError::LowSupply)) => {
                    self.refused = Some(operation);
                    return self.wait(saving);
                }
                Err(_) => {
                    good = false;
                    break;
                }
            }
        }
        self.low = false;
        good = saving.finish(&mut self.store, &self.pages).is_ok() && good;
        self.erase = !self.store.has_spare();
        Some(if good {
            self.end(device);
            Event::Saved
        } else {
            let stored = self.store.load(BOARD, &self.pages).settings;
            device.lock(|device| device.config.save_failed(stored));
            Event::SaveFailed
        })
    }

    /// Keeps a save for when the supply is back, which is logged once.
    fn wait(&mut self, saving: Saving) -> Option<Event> {
        self.saving = Some(saving);
        (!core::mem::replace(&mut self.low, true)).then_some(Event::LowSupply)
    }
}
