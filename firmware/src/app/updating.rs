//! The steps of an update by the background task: flash of the slot that does not run, and the boot state.

use board_support::{
    CrcUnit, Flash, SLOT,
    flash::{BootPages, FlashError},
    kept,
};
use boot_state::{Record, journal::Journal};
use firmware::update::{Failed, InSlot, Job, Update, described};
use ports::pages::{Slot as _, WriteError};
use register_map::update::{Slot, keys};
use rtic::Mutex;

use crate::{
    board::{BOARD, Device, LAYOUT},
    clock,
};

/// Time in which the watchdog can be refreshed, in milliseconds.
const STEPS_APART_MS: u32 = 1;
/// Steps without such a pause: as many as blocks are staged.
const STEPS: usize = 2;

/// The boot state, and the steps under way.
pub struct Updating {
    journal: Journal,
    crc: CrcUnit,
    /// End of the last step.
    ended: u32,
}

impl Updating {
    // Not inlined into init, as `Store::prepare`.
    #[inline(never)]
    pub fn new(flash: &mut Flash, crc: CrcUnit) -> Self {
        Self {
            journal: Journal::open(&BootPages(flash)),
            crc,
            ended: 0,
        }
    }

    /// Returns the update of a device behind the loader. `switched`: SW01 = 254 chose the slot.
    pub fn update(&self, flash: &mut Flash, switched: bool) -> Option<Update> {
        let slot = Slot::ALL.get(SLOT?).copied()?;
        let running = described(Flash::running_slot().unwrap_or_default());
        let images = [running, other(flash)];
        Some(Update::new(
            BOARD.code as u8,
            LAYOUT,
            slot,
            self.journal.record(),
            images,
            keys::words(Flash::loader_keys()),
            switched,
        ))
    }

    /// Performs the steps that are due: one erase, or two others. Blocks may arrive faster than they are programmed.
    // Not inlined, so that blocks are on the stack during this work only.
    #[inline(never)]
    pub fn work(&mut self, flash: &mut Flash, device: &mut impl Mutex<T = &'static mut Device>) {
        let passed = clock::millis().wrapping_sub(self.ended);
        if passed < STEPS_APART_MS {
            return;
        }
        for _ in 0..STEPS {
            let next = device.lock(|device| device.update.as_ref()?.next());
            let Some(job) = next else { return };
            let erases = matches!(job, Job::InSlot(InSlot::Erase(_)));
            if erases && !Flash::may_erase() {
                return;
            }
            let Some(done) = self.perform(&job, flash) else {
                return;
            };
            let image = other(flash);
            if device.lock(|device| device.end_step(&job, done, image)) {
                kept::end_choice();
            }
            self.ended = clock::millis();
            if erases {
                return;
            }
        }
    }

    /// Performs a step. Returns `None` if it must wait, because the supply is low or the watchdog comes first.
    fn perform(&mut self, job: &Job, flash: &mut Flash) -> Option<Result<(), Failed>> {
        let done = match job {
            Job::Write(record) => write(&mut self.journal, flash, *record),
            Job::InSlot(job) => job.perform(&mut flash.other_slot()?, |parts| self.crc.of(parts)),
        };
        match done {
            Ok(done) => Some(done),
            Err(FlashError::NotNow) => None,
            Err(FlashError::Failed) => Some(Err(Failed(None))),
        }
    }
}

/// Writes a boot state that is not in force yet. Returns how that has ended.
fn write(
    journal: &mut Journal,
    flash: &mut Flash,
    record: Record,
) -> Result<Result<(), Failed>, FlashError> {
    if journal.record() == Some(record) {
        return Ok(Ok(()));
    }
    match journal.write(&mut BootPages(flash), record) {
        Ok(()) => Ok(Ok(())),
        Err(WriteError::Worn) => Ok(Err(Failed(None))),
        Err(WriteError::Flash(error)) => Err(error),
    }
}

/// Describes the image in the slot that does not run.
fn other(flash: &mut Flash) -> [u16; 10] {
    flash
        .other_slot()
        .map_or([0; 10], |slot| described(slot.bytes()))
}
