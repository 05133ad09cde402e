//! Saves of the settings: whether they are stored, how far a save is, and the budget for saves.

use modbus_server::{Exception, Span, Words};
use register_map::board::Board;
use register_map::configuration::UNIT;
use register_map::configuration::{AS_IT_WAS, START};
use register_map::points;

use super::settings::{is_setting, restart_addresses};
use super::{Config, RestartValues, Settings, port_at};
use crate::budget::Budget;

/// Whether the settings are stored, or how far a save is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Save {
    /// The flash holds `saved`. No save is ordered.
    Stored,
    /// The flash does not hold `saved`, because what it holds is invalid. No save is ordered.
    Invalid,
    /// The reply to the order has not been sent yet.
    Ordered,
    /// The settings to be stored are set aside.
    Begun,
}

impl Save {
    /// Returns the state without a save. `invalid`: what the flash holds is invalid, as for [`Config::new`].
    pub(super) const fn of(invalid: bool) -> Self {
        if invalid { Self::Invalid } else { Self::Stored }
    }
}

impl<B: Board> Config<B> {
    /// Returns whether a save is possible after a write of these values: there is one left, or the save would write
    /// nothing to the flash.
    pub(super) fn can_pay(&self, span: Span, words: Words<'_>) -> bool {
        if self.saves.left() > 0 {
            return true;
        }
        let written = span.addresses().zip(words.iter());
        let settings = written.filter(|(address, _)| is_setting(*address));
        let differences = settings.fold(self.differences, |differences, (address, value)| {
            let saved = self.saved.get(address);
            differences
                .wrapping_sub(u16::from(self.edited.get(address) != saved))
                .wrapping_add(u16::from(value != saved))
        });
        differences == 0 && self.save != Save::Invalid
    }

    /// COMMAND 1: copies the present settings for a save, which later changes do not affect. [`Self::to_save`]
    /// returns the copy until [`Self::end_save`] or [`Self::save_failed`].
    pub fn begin_save(&mut self) {
        self.save = Save::Begun;
        self.saved = self.edited;
        self.differences = 0;
    }

    /// Returns the settings that [`Self::begin_save`] copied.
    #[must_use]
    pub const fn to_save(&self) -> &Settings<B> {
        &self.saved
    }

    /// Returns the settings that need a restart, with the values in force since the start.
    #[must_use]
    pub const fn started(&self) -> RestartValues {
        RestartValues(self.started)
    }

    /// Ends a successful save. `changed` says whether the saved settings need a restart to be in force, see
    /// [`Settings::needs_restart`].
    pub const fn end_save(&mut self, changed: bool) {
        self.save = Save::Stored;
        self.waiting = self.left != 0 || changed;
    }

    /// Ends a save that failed. `stored` is what a start would use now, and `invalid` as for [`Self::new`].
    pub fn save_failed(&mut self, stored: Settings<B>, invalid: bool) {
        self.saved = stored;
        self.differences = self.edited.differences(&self.saved);
        self.save = Save::of(invalid);
    }

    /// Takes one save from the budget, before the first operation on the flash. Returns the number of saves left, which
    /// the caller keeps over a reset.
    ///
    /// Returns `None` when the budget is empty; the caller must not write the flash then. The order for this save was
    /// accepted because no setting differed from the stored ones. Since then the other line has changed a setting, or the
    /// stored record has turned out to differ.
    #[must_use]
    pub fn take_save(&mut self) -> Option<u8> {
        self.saves.take().then(|| self.saves.left())
    }

    /// Returns the number of saves in the budget, which the caller keeps over a reset.
    #[must_use]
    pub const fn saves_left(&self) -> u8 {
        self.saves.left()
    }

    /// Returns how many saves are left for others: a save under way takes one more from the budget.
    #[must_use]
    pub fn spare_saves(&self) -> u8 {
        self.saves.left().saturating_sub(self.has_save().into())
    }

    /// Sets the number of saves in the budget to the number that was kept over the reset.
    pub const fn set_saves_left(&mut self, left: u8) {
        self.saves = Budget::new(left);
    }

    /// Returns whether a save has begun and is not complete.
    #[must_use]
    pub const fn is_saving(&self) -> bool {
        matches!(self.save, Save::Begun)
    }

    /// Returns whether a save is ordered or has begun.
    #[must_use]
    pub const fn has_save(&self) -> bool {
        matches!(self.save, Save::Ordered | Save::Begun)
    }

    /// Checks whether the unit address may be written by serial number.
    ///
    /// # Errors
    ///
    /// Exception 02 on a board with a switch, and in a request to the unit address; 03 for a value that is not a unit
    /// address; 06 while a save is under way, or when nothing is left of the budget.
    pub fn check_unit(&self, unit: Option<u16>) -> Result<(), Exception> {
        if B::ROW.switch || !self.origin.by_serial {
            return Err(Exception::IllegalDataAddress);
        }
        match unit {
            Some(unit) if !(1..=247).contains(&unit) => Err(Exception::IllegalDataValue),
            Some(unit)
                if !self.has_save() && (self.saves.left() > 0 || unit == self.saved.get(UNIT)) =>
            {
                Ok(())
            }
            _ => Err(Exception::ServerDeviceBusy),
        }
    }

    /// Sets the unit address, which [`Self::check_unit`] has accepted, and begins a save of this alone.
    pub fn set_unit(&mut self, unit: u16) {
        self.edited.set(UNIT, unit);
        if self.saved.get(UNIT) != unit {
            self.saved.set(UNIT, unit);
            self.save = Save::Begun;
        }
        for (started, address) in self.started.iter_mut().zip(restart_addresses::<B>()) {
            if address == UNIT {
                *started = unit;
            }
        }
        // Without a save, which would find out.
        self.waiting &= self.left != 0 || self.saved.needs_restart(&self.started());
        self.revision = self.revision.wrapping_add(1);
    }

    /// Returns whether a point is to start as it was, at the next start with its present module. `index` counts the ports
    /// with a slot.
    #[must_use]
    pub fn starts_as_it_was(&self, index: usize, channel: usize) -> bool {
        let port = port_at::<B>(index);
        let point = points::of_port(port).wrapping_add(channel as u16);
        self.modules.get(index) == Some(&self.saved.module(port))
            && self.saved.get(START.wrapping_add(point)) == AS_IT_WAS
    }
}
