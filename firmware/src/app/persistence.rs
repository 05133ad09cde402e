//! Saving the configuration from the background, and restarts, which wait for it.

use firmware::{
    config::Settings,
    device::Device,
    store::{Saving, Store},
};
use rtic::Mutex;

use crate::{log::Event, pages::Pages};

/// The store, and a save under way.
pub struct Persistence {
    store: Store,
    pages: Pages,
    saving: Option<Saving>,
    /// The settings that are being saved: a copy, so that requests do not wait while they are encoded.
    settings: Settings,
    /// The page that is no longer needed waits to be erased.
    erase: bool,
    restart: bool,
}

impl Persistence {
    pub fn new(store: Store, pages: Pages) -> Self {
        Self {
            store,
            pages,
            saving: None,
            settings: Settings::defaults(),
            erase: false,
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

    /// Restarts the device when nothing is being saved.
    pub const fn restart_when_done(&mut self) {
        self.restart = true;
    }

    /// Goes on with a save to its end, one flash operation at a time with interrupts in between; then
    /// restarts, if that was ordered.
    pub fn work(&mut self, device: &mut impl Mutex<T = &'static mut Device>) -> Option<Event> {
        let event = self.saving.take().map(|saving| self.save(saving, device));
        if self.restart {
            board_support::restart();
        }
        event
    }

    /// Whether there is a page to erase, so that the next save that needs it does not have to.
    pub const fn wants_erase(&self) -> bool {
        self.erase
    }

    /// Erases it. The program stands still for up to 40 ms.
    pub fn erase(&mut self) {
        self.erase = false;
        // When the flash fails, the next save that needs the page tries again.
        let _ = self.store.make_spare(&mut self.pages);
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
    ) -> Event {
        let mut good = true;
        while let Some(operation) = saving.next(&self.settings) {
            good = operation.perform(&mut self.pages).is_ok();
            if !good {
                break;
            }
        }
        good = saving.finish(&mut self.store, &self.pages).is_ok() && good;
        self.erase = !self.store.has_spare();
        if good {
            self.end(device);
            Event::Saved
        } else {
            let stored = self.store.load(&self.pages).settings;
            device.lock(|device| device.config.save_failed(stored));
            Event::SaveFailed
        }
    }
}
