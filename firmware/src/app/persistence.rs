//! Saves of the configuration by the background task, records of outputs, and restarts, which wait for a save.
//!
//! While the supply is too low for the flash, a save waits, before its first operation or between two operations.
//! It continues once the supply has recovered. Until then another save is rejected as busy.

use core::mem;

use board_support::{Flash, flash::FlashError, kept};
use firmware::{
    config::Settings,
    device::Restart,
    outputs::Schedule,
    store::{Given, Saving, Store, WriteError},
};
use rtic::Mutex;

use crate::{
    board::{B, BOARD, Device},
    log::Event,
};

/// What is under way in the store.
enum Work {
    Nothing,
    /// The page that is no longer needed is to be erased, before anything else, so that no record has to erase one.
    Erase,
    /// A save waits for the supply.
    Save(Saving<B>),
}

/// The store, and what is under way there.
pub struct Persistence {
    store: Store<B>,
    pages: Flash,
    work: Work,
    /// The low supply has been logged.
    low: bool,
    /// When outputs that are to start as they were are stored.
    schedule: Schedule,
}

impl Persistence {
    /// `erase`: the start could not erase the page that is no longer needed.
    pub fn new(store: Store<B>, pages: Flash, erase: bool) -> Self {
        Self {
            store,
            pages,
            work: if erase { Work::Erase } else { Work::Nothing },
            low: false,
            schedule: Schedule::new(if BOARD.keeps_outputs {
                kept::records()
            } else {
                0
            }),
        }
    }

    /// Begins a save that was ordered, or continues one, until its end or until the supply is too low. Then restarts the
    /// device if that was ordered.
    pub fn work(&mut self, device: &mut impl Mutex<T = &'static mut Device>) -> Option<Event> {
        let mut event = None;
        if !matches!(self.work, Work::Erase) {
            if device.lock(|device| device.config.is_saving()) {
                event = self.save(device);
            } else if BOARD.keeps_outputs {
                let now = device.lock(|device| device.state.millis());
                if self.schedule.is_due(now) {
                    self.record(device);
                }
            }
        }
        // Under the lock, so that no save is ordered in between.
        device.lock(|device| match device.restart {
            Some(restart) if !device.config.has_save() => {
                kept::keep_saves(device.config.saves_left());
                match restart {
                    Restart::Asked => kept::keep_asked(),
                    Restart::As255 => kept::keep_as_255(),
                    Restart::Update => {}
                }
                board_support::restart()
            }
            _ => {}
        });
        event
    }

    /// Returns the flash, for other work than saves.
    pub const fn flash(&mut self) -> &mut Flash {
        &mut self.pages
    }

    /// Erases the page that is no longer needed, if there is one, so that the next save does not have to. This
    /// takes up to 40 ms, on clones of the part 400 ms, during which only the tasks in RAM run.
    pub fn erase(&mut self) {
        if !matches!(self.work, Work::Erase) || !self.pages.has_supply() || !Flash::may_erase() {
            return;
        }
        self.work = Work::Nothing;
        // After a failure of the flash, the next save that needs the page erases it. If it is only too early, or the supply is
        // low, this function tries again.
        if let Err(WriteError::Flash(FlashError::NotNow)) = self.store.make_spare(&mut self.pages) {
            self.work = Work::Erase;
        }
    }

    /// Stores the outputs that are to start as they were, if they are not stored already. Unlike a save, a record that the
    /// flash refuses is not continued: another one is written at the next time.
    // Not inlined, so that the copy is on the stack during a record only.
    #[inline(never)]
    fn record(&mut self, device: &mut impl Mutex<T = &'static mut Device>) {
        let outputs = device.lock(|device| device.outputs());
        // Also without outputs: values that are stored from before would return when START is set again.
        let saving = if self.pages.has_supply() {
            Saving::of_outputs(&self.store, &self.pages, &outputs)
        } else {
            None
        };
        if saving.is_some() {
            self.schedule.take();
        }
        // Before the first operation, so that a reset does not lose the number.
        kept::keep_records(self.schedule.left());
        let Some(mut saving) = saving else {
            return;
        };
        // A record that is not complete does not count.
        let _ = saving.perform(&mut self.pages, Given::Outputs(&outputs));
        let _ = saving.finish(&mut self.store, &self.pages);
        self.end_of_record();
    }

    fn end_of_record(&mut self) {
        self.work = if self.store.has_spare() {
            Work::Nothing
        } else {
            Work::Erase
        };
        Flash::has_worked();
    }

    // Not inlined, so that the copy is on the stack during a save only.
    #[inline(never)]
    fn save(&mut self, device: &mut impl Mutex<T = &'static mut Device>) -> Option<Event> {
        // A copy, so that requests do not wait while the settings are encoded. They stay the same until the end of
        // the save.
        let settings = device.lock(|device| *device.config.to_save());
        let mut saving = match mem::replace(&mut self.work, Work::Nothing) {
            Work::Save(saving) => saving,
            Work::Nothing | Work::Erase => {
                let Some(saving) = Saving::of_settings(&self.store, &self.pages, &settings) else {
                    // These settings are already stored, so nothing is written and the flash does not wear.
                    Self::end(&settings, device);
                    return None;
                };
                let Some(left) = device.lock(|device| device.config.take_save()) else {
                    self.fail(device);
                    return None;
                };
                // A restart may follow before the background keeps the number.
                kept::keep_saves(left);
                saving
            }
        };
        if !self.pages.has_supply() {
            return self.wait(saving);
        }
        let performed = saving.perform(&mut self.pages, Given::Settings(&settings));
        if let Err(WriteError::Flash(FlashError::NotNow)) = performed {
            return self.wait(saving);
        }
        self.low = false;
        let finished = saving.finish(&mut self.store, &self.pages);
        self.end_of_record();
        Some(if performed.is_ok() && finished.is_ok() {
            Self::end(&settings, device);
            Event::Saved
        } else {
            self.fail(device);
            Event::SaveFailed
        })
    }

    /// Reports the settings as not stored.
    fn fail(&mut self, device: &mut impl Mutex<T = &'static mut Device>) {
        let stored = self.store.load(&self.pages);
        let invalid = stored.is_invalid();
        device.lock(|device| device.config.save_failed(stored.settings, invalid));
    }

    /// Reports the settings as stored. Compares them outside the lock, so that requests do not wait.
    fn end(settings: &Settings<B>, device: &mut impl Mutex<T = &'static mut Device>) {
        let started = device.lock(|device| device.config.started());
        let changed = settings.needs_restart(&started);
        device.lock(|device| device.config.end_save(changed));
    }

    /// Keeps a save until the supply has recovered. Returns the event to log, once.
    fn wait(&mut self, saving: Saving<B>) -> Option<Event> {
        self.work = Work::Save(saving);
        let is_low = !self.pages.has_supply();
        (is_low && !mem::replace(&mut self.low, true)).then_some(Event::LowSupply)
    }
}
