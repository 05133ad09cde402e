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

use core::array;

use modbus_server::{Exception, Span, Words, WordsOut};
use register_map::codes::Command;
use register_map::configuration::{
    COMM_TIMEOUT, COMMAND, FILTER, FORMAT, KEY, MODE, MODULE, RESPONSE_DELAY, RULES,
};
use register_map::points::{self, CHANNELS};
use register_map::state::status;
use register_map::{Board, Run, runs};

pub use in_force::{LineConfig, Point, PortConfig};
use lock::Lock;
pub use settings::RestartValues;
pub use settings::Settings;
use settings::{RESTARTS, format_suits_mode, takes_module};

/// The configuration of a running device on a board with so many slots.
#[derive(Debug)]
pub struct Config<const SLOTS: usize> {
    board: &'static Board,
    edited: Settings,
    /// What is stored, or what is just being stored.
    saved: Settings,
    /// How many of `edited` differ from `saved`.
    differences: u16,
    /// A save was ordered and is not complete.
    saving: bool,
    lock: Lock,
    line: LineConfig,
    /// Of the ports with slots.
    ports: [PortConfig; SLOTS],
    /// The settings that need a restart, as they were at the start.
    started: [u16; RESTARTS],
    /// What was stored at the start was not good, or not all of it.
    invalid: bool,
    /// A saved change waits for a restart.
    waiting: bool,
    /// Ports whose MODULE has been another than the one in force since the start, or since changes were
    /// last dropped; the board's first port in bit 0.
    left: u8,
    revision: u16,
}

impl<const SLOTS: usize> Config<SLOTS> {
    /// The configuration at the start, on a board with `SLOTS` slots. `invalid`: what was stored is not good, or a
    /// part of it, and has defaults in its place.
    #[must_use]
    #[inline(never)]
    pub fn new(board: &'static Board, stored: Settings, invalid: bool) -> Self {
        let mut started = [0; RESTARTS];
        for (place, value) in started.iter_mut().zip(stored.restart_values()) {
            *place = value;
        }
        Self {
            board,
            line: LineConfig::of(&stored),
            ports: array::from_fn(|index| {
                PortConfig::of(&stored, board.first_port.wrapping_add(index as u16))
            }),
            edited: stored.clone(),
            saved: stored,
            differences: 0,
            saving: false,
            lock: Lock::closed(),
            started,
            invalid,
            waiting: false,
            left: 0,
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
        for run in runs {
            let of_run = values.slice(0, run.count);
            values = values.slice(run.count, u16::MAX);
            if !run.rule.values.allow_all(of_run.iter()) || !self.suits_the_ports(run, of_run) {
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

    /// Whether values for points are such as their ports' modules allow, and values for MODULE such as the board's
    /// slots allow.
    fn suits_the_ports(&self, run: Run, words: Words<'_>) -> bool {
        if run.rule.first == MODULE {
            return (run.index..)
                .zip(words.iter())
                .all(|(index, code)| takes_module(self.board, index.wrapping_add(1), code));
        }
        let Some(narrower) = run.rule.narrower else {
            return true;
        };
        // Points of ports without a slot have no module that could ask for less.
        self.board.ports().all(|port| {
            let kinds = self.edited.module(port).points();
            (points::of_port(port)..).zip(kinds).all(|(point, kind)| {
                kind != narrower.kind
                    || words
                        .get(point.wrapping_sub(run.index))
                        .is_none_or(|word| narrower.values.allow(word))
            })
        })
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
        for (index, port) in self.ports.iter().enumerate() {
            let number = self.board.first_port.wrapping_add(index as u16);
            if self.edited.module(number) != port.module {
                self.left |= 1 << (index & 7);
            }
        }
    }

    /// COMMAND 3: every setting to its default. Saved are they not.
    pub fn load_defaults(&mut self) {
        self.edited = Settings::defaults();
        self.edited_anew();
    }

    /// COMMAND 4: every setting to what is saved.
    pub fn drop_changes(&mut self) {
        self.edited.clone_from(&self.saved);
        self.left = 0;
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
        self.waiting = self.left != 0 || changed;
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
    pub const fn line(&self) -> LineConfig {
        self.line
    }

    /// The board.
    #[must_use]
    pub const fn board(&self) -> &'static Board {
        self.board
    }

    /// The modules in force and their outputs at power-on, of every port that has a slot, in the order of the ports.
    #[must_use]
    pub const fn ports(&self) -> &[PortConfig; SLOTS] {
        &self.ports
    }

    /// The settings in force of a port's points, by channel; `index` counts the ports that have a slot. `None` once
    /// the port's MODULE has been changed, up to the restart, even if it was changed back: the settings by point went
    /// to the new module's defaults, and for what runs those hold that were given here last.
    #[must_use]
    pub fn points(&self, index: usize) -> Option<impl Iterator<Item = Point>> {
        let first = points::of_port(self.board.first_port.wrapping_add(index as u16));
        let in_force = self.left >> (index & 7) & 1 == 0;
        in_force.then(|| {
            (first..first.wrapping_add(CHANNELS)).map(|point| Point::of(&self.edited, point))
        })
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
