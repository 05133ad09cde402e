//! The configuration, registers 0x0100 to 0x01FF: what a master may write when, what has been written,
//! what is stored, and what is in force.
//!
//! There are three states of a setting:
//!
//! ```text
//!   write          COMMAND 1                    restart
//!   -----> edited -----------> saved (flash) -----------> in force, of those that need a restart
//!            |  ^                  |
//!            |  +--- COMMAND 4 ----+
//!            +--> in force at once, of the others
//! ```
//!
//! A master reads back what was edited. The lock counts as it is when a request comes in, so KEY and
//! settings in one request need it open already.

mod in_force;
mod lock;
mod settings;

#[cfg(test)]
mod tests;

use modbus_server::{Exception, Span, Words, WordsOut};
use register_map::codes::Command;
use register_map::configuration::{
    COMM_TIMEOUT, COMMAND, FILTER, FORMAT, KEY, MODE, RESPONSE_DELAY, RULES,
};
use register_map::points::{CHANNELS, PointKind, SLOT_FIRST, SLOT_PORT};
use register_map::state::status;
use register_map::{Run, runs};

pub use in_force::{Line, Lora, Point, Slot};
use lock::Lock;
pub use settings::RestartValues;
pub use settings::Settings;
use settings::{RESTARTS, format_suits_mode};

/// The configuration of a running device.
#[derive(Debug)]
pub struct Config {
    edited: Settings,
    /// What is stored, or what is just being stored.
    saved: Settings,
    /// How many of `edited` differ from `saved`.
    differences: u16,
    /// A save was ordered and is not complete.
    saving: bool,
    lock: Lock,
    line: Line,
    slot: Slot,
    /// The settings that need a restart, as they were at the start.
    started: [u16; RESTARTS],
    /// What was stored at the start was not good, or not all of it.
    invalid: bool,
    /// A saved change waits for a restart.
    waiting: bool,
    /// The slot's MODULE has been another than the one in force since the start, or since changes were
    /// last dropped.
    left: bool,
    revision: u16,
}

impl Config {
    /// The configuration at the start. `invalid`: what was stored is not good, or a part of it, and has
    /// defaults in its place.
    #[must_use]
    #[inline(never)]
    pub fn new(stored: Settings, invalid: bool) -> Self {
        let mut started = [0; RESTARTS];
        for (place, value) in started.iter_mut().zip(stored.restart_values()) {
            *place = value;
        }
        Self {
            line: Line::of(&stored),
            slot: Slot::of(&stored),
            edited: stored.clone(),
            saved: stored,
            differences: 0,
            saving: false,
            lock: Lock::closed(),
            started,
            invalid,
            waiting: false,
            left: false,
            revision: 0,
        }
    }

    /// May these registers be read?
    ///
    /// # Errors
    ///
    /// 02 where there is a gap.
    pub fn check_read(&self, span: Span) -> Result<(), Exception> {
        match runs(RULES, span.start(), span.count()) {
            Some(_) => Ok(()),
            None => Err(Exception::IllegalDataAddress),
        }
    }

    /// Pushes every register of a span that [`Self::check_read`] found good.
    pub fn read(&self, span: Span, out: &mut WordsOut<'_>) {
        let mut values = self.edited.slice(span.start(), span.count()).iter();
        if span.start() == KEY {
            values.next();
            out.push(u16::from(self.lock.is_open()));
        }
        values.for_each(|value| out.push(*value));
    }

    /// May these registers be written with these values?
    ///
    /// # Errors
    ///
    /// The first of: 02, a gap; 03, a value not allowed, for a setting by point also by its module as
    /// chosen last, or a FORMAT with seven data bits in RTU mode; 06, the lock is closed and it is not KEY alone, or a save is ordered before the
    /// last is complete.
    pub fn check_write(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        let runs = runs(RULES, span.start(), span.count());
        let runs = runs.ok_or(Exception::IllegalDataAddress)?;
        let mut values = words;
        let kinds = self.edited.module(SLOT_PORT).points();
        for run in runs {
            let of_run = values.slice(0, run.count);
            values = values.slice(run.count, u16::MAX);
            if !run.rule.values.allow_all(of_run.iter()) || !suit_the_slot(kinds, run, span, words)
            {
                return Err(Exception::IllegalDataValue);
            }
        }
        if !self.suits_the_mode(span, words) {
            return Err(Exception::IllegalDataValue);
        }
        let order = words.get(COMMAND.wrapping_sub(span.start()));
        let saves = self.saving && order == Some(Command::Save.code());
        if saves || !(self.lock.is_open() || span == Span::single(KEY)) {
            return Err(Exception::ServerDeviceBusy);
        }
        Ok(())
    }

    /// Whether FORMAT and MODE can be used together once these values are written.
    fn suits_the_mode(&self, span: Span, words: Words<'_>) -> bool {
        let written = |address: u16| words.get(address.wrapping_sub(span.start()));
        match (written(FORMAT), written(MODE)) {
            (None, None) => true,
            (format, mode) => format_suits_mode(
                format.unwrap_or_else(|| self.edited.get(FORMAT)),
                mode.unwrap_or_else(|| self.edited.get(MODE)),
            ),
        }
    }

    /// Writes registers that [`Self::check_write`] found good, and opens the lock or keeps it open. A
    /// command is given back: it is to be carried out when the response is out, before the next request.
    ///
    /// - [`Command::Save`]: [`Self::begin_save`] and what follows from it.
    /// - [`Command::LoadDefaults`], [`Command::DropChanges`]: the method of that name.
    /// - [`Command::Restart`], [`Command::EnterLoader`]: not before a running save is complete,
    ///   [`Self::is_saving`].
    #[must_use = "a command is for the caller to carry out"]
    pub fn write(&mut self, span: Span, words: Words<'_>) -> Option<Command> {
        self.lock.open();
        if span.start() >= FILTER {
            self.write_plain(span, words);
            return None;
        }
        let mut command = None;
        for (address, value) in span.addresses().zip(words.iter()) {
            match address {
                KEY => {}
                COMMAND => command = Command::from_code(value),
                _ => self.edited.set(address, value),
            }
        }
        if span != Span::single(KEY) && span != Span::single(COMMAND) {
            self.edited_anew();
        }
        self.saving |= command == Some(Command::Save);
        command
    }

    /// Writes registers that have no effect on others.
    fn write_plain(&mut self, span: Span, words: Words<'_>) {
        let edited = self.edited.slice_mut(span.start(), span.count()).iter_mut();
        let saved = self.saved.slice(span.start(), span.count());
        let mut differences = self.differences;
        for ((edited, saved), word) in edited.zip(saved).zip(words.iter()) {
            differences = differences
                .wrapping_sub(u16::from(*edited != *saved))
                .wrapping_add(u16::from(word != *saved));
            *edited = word;
        }
        self.differences = differences;
        self.revision = self.revision.wrapping_add(1);
    }

    fn edited_anew(&mut self) {
        self.differences = self.edited.differences(&self.saved);
        self.revision = self.revision.wrapping_add(1);
        self.left |= self.edited.module(SLOT_PORT) != self.slot.module;
    }

    /// COMMAND 3: every setting to its default. Saved are they not.
    pub fn load_defaults(&mut self) {
        self.edited = Settings::defaults();
        self.edited_anew();
    }

    /// COMMAND 4: every setting to what is saved.
    pub fn drop_changes(&mut self) {
        self.edited.clone_from(&self.saved);
        self.left = false;
        self.edited_anew();
    }

    /// COMMAND 1: takes the settings as they are now to be saved; changes made from now on are not
    /// among them. [`Self::to_save`] has them until [`Self::end_save`] or [`Self::save_failed`].
    pub fn begin_save(&mut self) {
        self.saving = true;
        self.saved.clone_from(&self.edited);
        self.differences = 0;
    }

    /// The settings that [`Self::begin_save`] took.
    #[must_use]
    pub const fn to_save(&self) -> &Settings {
        &self.saved
    }

    /// The settings in force since the start that count only after a restart.
    #[must_use]
    pub const fn started(&self) -> RestartValues {
        RestartValues(self.started)
    }

    /// The save is complete; `changed` says whether the saved settings need a restart to be in force,
    /// [`Settings::needs_restart`].
    pub const fn end_save(&mut self, changed: bool) {
        self.saving = false;
        self.waiting = self.left || changed;
    }

    /// The save did not succeed; `stored` is what is stored, as before.
    pub fn save_failed(&mut self, stored: Settings) {
        self.saved = stored;
        self.differences = self.edited.differences(&self.saved);
        self.saving = false;
    }

    /// Whether a save was ordered and is not complete.
    #[must_use]
    pub const fn is_saving(&self) -> bool {
        self.saving
    }

    /// Lets time pass, in milliseconds: the lock closes 60 s after the last write.
    pub fn tick(&mut self, ms: u32) {
        self.lock.tick(ms);
    }

    /// The bits of the status register that are the configuration's: 1, 3, 4 and 5.
    #[must_use]
    pub const fn status(&self) -> u16 {
        const fn bit(mask: u16, set: bool) -> u16 {
            if set { mask } else { 0 }
        }
        bit(status::STORED_INVALID, self.invalid)
            | bit(status::UNSAVED, self.differences > 0 || self.saving)
            | bit(status::RESTART_NEEDED, self.waiting)
            | bit(status::UNLOCKED, self.lock.is_open())
    }

    /// Goes up, and wraps, whenever a setting may have changed: to tell what has copies of settings.
    #[must_use]
    pub const fn revision(&self) -> u16 {
        self.revision
    }

    /// The RS-485 line in force.
    #[must_use]
    pub const fn line(&self) -> Line {
        self.line
    }

    /// The slot's module in force and its outputs at power-on.
    #[must_use]
    pub const fn slot(&self) -> Slot {
        self.slot
    }

    /// The settings of the slot's points in force, by channel. `None` once MODULE has been changed, up
    /// to the restart, even if it was changed back: the settings by point went to the new module's
    /// defaults, and for what runs those hold that were given here last.
    #[must_use]
    pub fn points(&self) -> Option<impl Iterator<Item = Point>> {
        (!self.left).then(|| (0..CHANNELS).map(|channel| Point::of(&self.edited, channel)))
    }

    /// COMM_TIMEOUT in milliseconds, up to an hour; `None`: the communication watchdog is off.
    #[must_use]
    pub fn comm_timeout_ms(&self) -> Option<u32> {
        let tenths = self.edited.get(COMM_TIMEOUT);
        (tenths != 0).then_some(u32::from(tenths) * 100)
    }

    /// RESPONSE_DELAY in milliseconds, 0 to 1000.
    #[must_use]
    pub fn response_delay_ms(&self) -> u16 {
        self.edited.get(RESPONSE_DELAY)
    }
}

/// Whether the values for the slot's points are such as its module allows. No other port has a slot,
/// so none of their points has a narrower rule.
fn suit_the_slot(
    kinds: [PointKind; CHANNELS as usize],
    run: Run,
    span: Span,
    words: Words<'_>,
) -> bool {
    let Some(narrower) = run.rule.narrower else {
        return true;
    };
    (SLOT_FIRST..)
        .zip(kinds)
        .filter(|(point, kind)| *kind == narrower.kind && point.wrapping_sub(run.index) < run.count)
        .all(|(point, _)| {
            let address = run.rule.first.wrapping_add(point);
            let word = words.get(address.wrapping_sub(span.start()));
            word.is_none_or(|word| narrower.values.allow(word))
        })
}
