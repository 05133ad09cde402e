//! Saves of the configuration by the background task, and restarts, which wait for a save.
//!
//! While the supply is too low for the flash, a save waits, before its first operation or between two operations.
//! It continues once the supply has recovered. Until then another save is rejected as busy.

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
    /// A copy of the settings being saved, so that requests do not wait while they are encoded.
    settings: Settings,
    /// The operation of the save that the flash refused because of a low supply.
    refused: Option<Operation>,
    /// The low supply has been logged.
    low: bool,
    /// The page that is no longer needed is to be erased.
    erase: bool,
    restart: bool,
}

impl Persistence {
    /// `erase`: the start could not erase the page that is no longer needed.
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

    /// Begins to save the settings that the configuration has set aside.
    pub fn begin(&mut self, device: &mut impl Mutex<T = &'static mut Device>) {
        device.lock(|device| self.settings.clone_from(device.config.to_save()));
        self.saving = Saving::new(&self.store, &self.pages, &self.settings);
        if self.saving.is_none() {
            // These settings are already stored, so nothing is written and the flash does not wear.
            self.end(device);
        }
    }

    /// Restarts the device as soon as no save is under way or waiting.
    pub const fn restart_when_done(&mut self) {
        self.restart = true;
    }

    /// Continues a save until its end or until the supply is too low, one flash operation at a time with interrupts
    /// in between. Then restarts the device if that was ordered.
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

    /// Erases the page that is no longer needed, if there is one, so that the next save does not have to. This
    /// takes up to 40 ms, during which only the tasks in RAM run.
    pub fn erase(&mut self) {
        if !self.erase || !self.pages.has_supply() {
            return;
        }
        self.erase = false;
        // After a failure of the flash, the next save that needs the page erases it. After a low supply, this
        // function tries again.
        if let Err(StoreError::Flash(_, FlashError::LowSupply)) =
            self.store.make_spare(&mut self.pages)
        {
            self.erase = true;
        }
    }

    /// Reports the settings as stored. Compares them outside the lock, so that requests do not wait.
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

    /// Keeps a save until the supply has recovered. Returns the event to log, once.
    fn wait(&mut self, saving: Saving) -> Option<Event> {
        self.saving = Some(saving);
        (!core::mem::replace(&mut self.low, true)).then_some(Event::LowSupply)
    }
}
