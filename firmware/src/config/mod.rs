//! The configuration, registers 0x0100 to 0x01FF, the links, 0x0400 to 0x04FF, and DEADBAND, 0x0500 to 0x051F: which
//! writes are allowed, the edited settings, the stored settings and the settings in force.
//!
//! A setting has three values:
//!
//! ```text
//!   write          COMMAND 1                    restart
//!   -----> edited -----------> saved (flash) -----------> in force (settings that need a restart)
//!            |  ^                  |
//!            |  +--- COMMAND 4 ----+
//!            +--> in force immediately (all other settings)
//! ```
//!
//! A master reads back the edited values. A write is checked against the lock before it opens the lock, so a
//! request that writes KEY and settings together needs the lock to be open already.
//!
//! Everybody in radio range can send requests over the air. So the lock is open only for the line over which it was
//! opened, a broadcast over the air writes nothing here, and the radio may be set to write nothing here at all.

mod in_force;
mod linked;
mod links;
mod lock;
mod origin;
mod settings;

#[cfg(test)]
mod tests;

use modbus_server::{Exception, Span, Words, WordsOut};
use modio_drivers::{CHANNELS, Kind};
use register_map::board::{Board, Each};
use register_map::codes::{CommSource, Command, Lora};
use register_map::configuration::{
    AS_IT_WAS, COMM_SOURCE, COMM_TIMEOUT, COMMAND, FILTER, FORMAT, HEARTBEAT, KEY, LORA,
    LORA_FRAME_GAP, MODE, MODULE, RANGE, RESPONSE_DELAY, SAVE_EVERY_S, SAVES, SERIAL_LOW, START,
    UNIT,
};
use register_map::state::status;
use register_map::{Module, Run, Runs, links as links_map, runs};
use register_map::{deadband, points};

use crate::budget::Budget;
pub use in_force::{LineConfig, Point, RadioConfig};
use links::Links;
use lock::Lock;
pub use origin::{LineName, Origin};
pub use settings::RestartValues;
pub use settings::Settings;
use settings::{RESTARTS, format_suits_mode, has_deadband, is_setting, port_of, restart_addresses};

/// Whether the settings are stored, or how far a save is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Save {
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
    const fn of(invalid: bool) -> Self {
        if invalid { Self::Invalid } else { Self::Stored }
    }
}

/// A write that does nothing. It needs no lock, and every line may make it.
const HEARTBEAT_ALONE: Span = Span::single(HEARTBEAT);

/// Returns the number of a port, given its index.
fn port_at<B: Board>(index: usize) -> u16 {
    B::ROW.first_port.wrapping_add(index as u16)
}

/// Returns the points of a span of settings by point, point 0 in bit 0. A span of several settings has all points.
const fn points_of(span: Span) -> u32 {
    let first = span.start() % points::COUNT;
    match points::COUNT.checked_sub(first + span.count()) {
        Some(behind) => (u32::MAX >> behind) & (u32::MAX << first),
        None => u32::MAX,
    }
}

/// Checks whether registers of DEADBAND exist. The first one does.
///
/// # Errors
///
/// Exception 02 when the span goes beyond the last one.
fn check_deadbands(span: Span) -> Result<(), Exception> {
    let end = u32::from(deadband::BLOCK.last) + 1;
    if span.end() <= end {
        Ok(())
    } else {
        Err(Exception::IllegalDataAddress)
    }
}

/// The configuration of a running device.
#[derive(Debug)]
pub struct Config<B: Board> {
    edited: Settings<B>,
    /// The stored settings, or those being stored.
    saved: Settings<B>,
    /// Number of settings in `edited` that differ from `saved`.
    differences: u16,
    save: Save,
    saves: Budget<SAVES, SAVE_EVERY_S>,
    lock: Lock,
    /// Origin of the request that is being served.
    origin: Origin,
    /// The radio serves points and reads only.
    points_only: bool,
    /// The modules in force, by slot.
    modules: Each<B::Ports, Module>,
    /// The settings that need a restart, with their values at the start.
    started: [u16; RESTARTS],
    /// The stored configuration was damaged or contained rejected values at the start.
    invalid: bool,
    /// A saved change takes effect after a restart.
    waiting: bool,
    /// Ports whose MODULE has differed from the one in force since the start, or since changes were last dropped.
    /// Bit 0 is the board's first port.
    left: u8,
    /// Links of each slot that were written and are to begin again, a bit for each.
    written_links: Each<B::Ports, u8>,
    /// Points whose settings may have been written since they were last applied, point 0 in bit 0.
    written_points: u32,
    revision: u16,
}

impl<B: Board> Config<B> {
    /// Creates the configuration at the start. `invalid` says that the stored settings were damaged,
    /// or that some were rejected, and defaults are used instead.
    #[must_use]
    #[inline(never)]
    pub fn new(stored: Settings<B>, invalid: bool) -> Self {
        let mut started = [0; RESTARTS];
        for (place, value) in started.iter_mut().zip(stored.restart_values()) {
            *place = value;
        }
        let points_only = stored.get(LORA) == Lora::PointsOnly.code();
        Self {
            modules: Each::of(|slot| stored.module(port_at::<B>(slot))),
            edited: stored,
            saved: stored,
            differences: 0,
            save: Save::of(invalid),
            saves: Budget::new(SAVES),
            lock: Lock::default(),
            origin: Origin::default(),
            points_only,
            started,
            invalid,
            waiting: false,
            left: 0,
            written_links: Each::all(0),
            written_points: u32::MAX,
            revision: 0,
        }
    }

    /// Sets the origin of the requests that are checked and executed from now on.
    pub const fn set_origin(&mut self, origin: Origin) {
        self.origin = origin;
    }

    /// Returns the line of the request that is being served.
    #[must_use]
    pub const fn origin_line(&self) -> LineName {
        self.origin.line
    }

    /// Returns whether the radio serves points and reads only.
    #[must_use]
    pub const fn air_serves_points_only(&self) -> bool {
        self.points_only
    }

    /// Checks whether the line of the request may change more than points.
    ///
    /// # Errors
    ///
    /// Exception 06 for a request over the air while the radio serves points and reads only.
    pub const fn check_line(&self) -> Result<(), Exception> {
        match self.origin.line {
            LineName::Second if self.points_only => Err(Exception::ServerDeviceBusy),
            LineName::Second | LineName::Rs485 => Ok(()),
        }
    }

    /// Returns whether the request that is being served is to the unit's own address: neither to all units nor by serial
    /// number.
    #[must_use]
    pub const fn is_to_the_address(&self) -> bool {
        !self.origin.broadcast && !self.origin.by_serial
    }

    /// Returns whether the request that is being served came over the air.
    #[must_use]
    pub fn is_over_the_air(&self) -> bool {
        self.origin.line == LineName::Second && B::ROW.has_radio()
    }

    /// Keeps the lock open for as long as after a write, if it is open for the request.
    pub const fn keep_open(&mut self) {
        if self.is_unlocked() {
            self.lock.open(self.origin.line);
        }
    }

    /// Returns whether the lock is open for the request.
    const fn is_unlocked(&self) -> bool {
        self.lock.is_open(self.origin.line)
    }

    /// Checks whether these registers can be read.
    ///
    /// # Errors
    ///
    /// Exception 02 when the span contains a gap, or a register that the board does not have.
    pub fn check_read(&self, span: Span) -> Result<(), Exception> {
        match runs(B::ROW.rules(), span.start(), span.count()) {
            _ if Links::<B>::contain(span.start()) => self.check_links(span),
            _ if has_deadband::<B>(span.start()) => check_deadbands(span),
            Some(_) if self.has(span) => Ok(()),
            _ => Err(Exception::IllegalDataAddress),
        }
    }

    /// Returns whether the board has these registers, which are not in a gap.
    fn has(&self, span: Span) -> bool {
        let has = |first: u16, last: u16| u32::from(first) < span.end() && span.start() <= last;
        let lacks_unit = B::ROW.switch;
        !(lacks_unit && has(UNIT, UNIT)) && (B::ROW.has_radio() || !has(LORA, LORA_FRAME_GAP))
    }

    /// Returns whether the board has these registers, and lets them be written.
    fn lets_write(&self, span: Span) -> bool {
        let fixed = |address| port_of(address).is_some_and(|port| !B::ROW.chooses(port));
        self.has(span) && (B::ROW.is_modular() || !span.addresses().any(fixed))
    }

    /// Appends every register of a span that [`Self::check_read`] has accepted.
    pub fn read(&self, span: Span, out: &mut WordsOut<'_>) {
        if Links::<B>::contain(span.start()) {
            let addresses = span.addresses();
            return addresses.for_each(|address| out.push(self.edited.get(address)));
        }
        let mut values = self.edited.slice(span.start(), span.count()).iter();
        if span.start() == KEY {
            values.next();
            out.push(u16::from(self.is_unlocked()));
        }
        values.for_each(|value| out.push(*value));
    }

    /// Checks whether these registers can be written with these values.
    ///
    /// # Errors
    ///
    /// The first of these exceptions that applies:
    ///
    /// - 02: the registers have a gap, or a MODULE belongs to a port that is part of the board.
    /// - 03: a value is not allowed. This includes a setting by point that does not suit the module written last, and a
    ///   FORMAT with seven data bits in RTU mode.
    /// - 06: the request is a broadcast over the air, or its line may not write the configuration.
    /// - 06: the lock is closed for this line, and the request does not write KEY alone.
    /// - 06: the request orders a save while another save runs, or while no save is left in the budget.
    ///
    /// A write of HEARTBEAT alone is always allowed.
    pub fn check_write(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        if span == HEARTBEAT_ALONE {
            return Ok(());
        }
        let suits = if Links::<B>::contain(span.start()) {
            self.check_links(span)?;
            self.suits_the_links(span, words)
        } else if has_deadband::<B>(span.start()) {
            check_deadbands(span)?;
            true
        } else {
            let runs = runs(B::ROW.rules(), span.start(), span.count());
            let runs = runs.filter(|_| self.lets_write(span));
            let runs = runs.ok_or(Exception::IllegalDataAddress)?;
            self.suit(runs, words) && self.suits_the_mode(span, words)
        };
        if !suits {
            return Err(Exception::IllegalDataValue);
        }
        self.check_line()?;
        let aired = self.origin.broadcast && self.is_over_the_air();
        let order = words.get(COMMAND.wrapping_sub(span.start()));
        let cannot_save =
            order == Some(Command::Save.code()) && (self.has_save() || !self.can_pay(span, words));
        if aired || cannot_save || !(self.is_unlocked() || span == Span::single(KEY)) {
            return Err(Exception::ServerDeviceBusy);
        }
        Ok(())
    }

    /// Returns whether the registers of these runs allow the values.
    fn suit(&self, runs: Runs, mut values: Words<'_>) -> bool {
        for run in runs {
            let of_run = values.slice(0, run.count);
            values = values.slice(run.count, u16::MAX);
            if !run.rule.values.allow_all(of_run.iter()) || !self.suits_the_ports(run, of_run) {
                return false;
            }
        }
        true
    }

    /// Returns whether a save is possible after a write of these values: there is one left, or the save would write
    /// nothing to the flash.
    fn can_pay(&self, span: Span, words: Words<'_>) -> bool {
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

    /// Returns whether values for points are allowed by the modules of their ports, and values for MODULE by the
    /// board's slots.
    fn suits_the_ports(&self, run: Run, words: Words<'_>) -> bool {
        if run.rule.first == MODULE {
            return (run.index..)
                .zip(words.iter())
                .all(|(index, code)| B::ROW.takes(index.wrapping_add(1), code));
        }
        if !B::ROW.is_modular() && run.rule.first == RANGE {
            let addresses = RANGE.wrapping_add(run.index)..;
            let mut ranges = addresses.zip(words.iter());
            if !ranges.all(|(address, range)| self.edited.takes_range(address, range)) {
                return false;
            }
        }
        let Some(narrower) = run.rule.narrower else {
            return true;
        };
        // Ports without a slot have no module that could restrict their points.
        B::ROW.ports().all(|port| {
            let first = points::of_port(port);
            if first >= run.index.wrapping_add(run.count) {
                return true;
            }
            let kinds = B::ROW.kinds(port, self.edited.module(port));
            (first..).zip(kinds).all(|(point, kind)| {
                kind != narrower.kind
                    || words
                        .get(point.wrapping_sub(run.index))
                        .is_none_or(|word| narrower.values.allow(word))
            })
        })
    }

    /// Returns whether FORMAT and MODE are compatible once these values are written.
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

    /// Writes registers that [`Self::check_write`] has accepted, and opens the lock or keeps it open. HEARTBEAT alone
    /// does nothing. Returns the command to execute, if one was written. The caller must execute it after the response
    /// has been sent and before the next request.
    ///
    /// - [`Command::Save`]: [`Self::begin_save`], then the save itself.
    /// - [`Command::LoadDefaults`], [`Command::DropChanges`]: the method of that name.
    /// - [`Command::Restart`]: only when no save is running, [`Self::is_saving`].
    #[must_use = "the caller must execute the command"]
    pub fn write(&mut self, span: Span, words: Words<'_>) -> Option<Command> {
        if span == HEARTBEAT_ALONE {
            return None;
        }
        self.lock.open(self.origin.line);
        let mut command = None;
        if (FILTER..links_map::LINKS).contains(&span.start()) || has_deadband::<B>(span.start()) {
            // These registers do not affect others.
            let edited = self.edited.slice_mut(span.start(), span.count());
            for (edited, value) in edited.iter_mut().zip(words.iter()) {
                *edited = value;
            }
            self.written_points |= points_of(span);
        } else {
            for (address, value) in span.addresses().zip(words.iter()) {
                match address {
                    KEY | HEARTBEAT => {}
                    COMMAND => command = Command::from_code(value),
                    _ => {
                        self.edited.set(address, value);
                        if port_of(address).is_some() {
                            self.written_points = u32::MAX;
                        }
                    }
                }
            }
            self.note_links(span);
        }
        if span != Span::single(KEY) && span != Span::single(COMMAND) {
            self.revision = self.revision.wrapping_add(1);
        }
        if command == Some(Command::Save) {
            self.save = Save::Ordered;
        }
        command
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

    /// Compares the edited settings with the others after [`revision`](Self::revision) has changed, before
    /// anything needs the result.
    pub fn compare(&mut self) {
        self.differences = self.edited.differences(&self.saved);
        for (index, module) in self.modules.iter().enumerate() {
            if self.edited.module(port_at::<B>(index)) != *module {
                self.left |= 1 << (index & 7);
            }
        }
    }

    /// Returns the points whose settings may have been written since the last call, point 0 in bit 0.
    pub const fn take_written_points(&mut self) -> u32 {
        core::mem::replace(&mut self.written_points, 0)
    }

    /// COMMAND 3: sets every setting to its default. These values are not stored in flash.
    pub fn load_defaults(&mut self) {
        self.edited = Settings::defaults();
        self.written_links = Each::all(u8::MAX);
        self.written_points = u32::MAX;
        self.revision = self.revision.wrapping_add(1);
    }

    /// COMMAND 4: sets every setting to its saved value.
    pub fn drop_changes(&mut self) {
        self.edited = self.saved;
        self.written_links = Each::all(u8::MAX);
        self.written_points = u32::MAX;
        self.left = 0;
        self.revision = self.revision.wrapping_add(1);
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

    /// Advances the time by `ms` milliseconds. The lock closes 60 s after the last write, and the budget gets one
    /// save a minute.
    pub fn tick(&mut self, ms: u32) {
        self.lock.tick(ms);
        self.saves.tick(ms);
    }

    /// Returns bits 1, 3, 4 and 5 of the status register, which the configuration defines. Bit 5 is that of the
    /// line of the request.
    #[must_use]
    pub const fn status(&self) -> u16 {
        const fn bit(mask: u16, set: bool) -> u16 {
            if set { mask } else { 0 }
        }
        let unsaved = self.differences > 0 || self.has_save();
        bit(status::STORED_INVALID, self.invalid)
            | bit(status::UNSAVED, unsaved)
            | bit(status::RESTART_NEEDED, self.waiting)
            | bit(status::UNLOCKED, self.is_unlocked())
    }

    /// Returns a counter that changes whenever a setting may have changed; it wraps. Code with copies of settings
    /// compares it.
    #[must_use]
    pub const fn revision(&self) -> u16 {
        self.revision
    }

    /// Returns the modules in force, for every port with a slot, in the order of the ports.
    #[must_use]
    pub fn modules(&self) -> &[Module] {
        &self.modules
    }

    /// Returns the kinds of the points of a port with its module in force. `index` counts the ports with a slot.
    #[must_use]
    pub fn kinds(&self, index: usize) -> [Kind; CHANNELS] {
        let module = self.modules.get(index).copied().unwrap_or(Module::None);
        B::ROW.kinds(port_at::<B>(index), module)
    }

    /// Returns whether MODULE of a port has not been changed since the start. `index` counts the ports with a slot.
    const fn is_in_force(&self, index: usize) -> bool {
        self.left >> (index & 7) & 1 == 0
    }

    /// Returns the settings in force of a point. `index` counts the ports with a slot. Returns `None` from a change of
    /// the port's MODULE until the restart, even when the change was reverted: the change has reset the settings by
    /// point to the new module's defaults, so the running module keeps the settings that were returned last.
    #[must_use]
    pub fn point(&self, index: usize, channel: usize) -> Option<Point> {
        let first = points::of_port(port_at::<B>(index));
        self.is_in_force(index)
            .then(|| Point::of(&self.edited, first.wrapping_add(channel as u16)))
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

    /// Returns SERIAL_LOW.
    #[must_use]
    pub fn serial_low(&self) -> u16 {
        self.edited.get(SERIAL_LOW)
    }

    /// Returns COMM_TIMEOUT in milliseconds, up to an hour, or `None` when the communication watchdog is off.
    #[must_use]
    pub fn comm_timeout_ms(&self) -> Option<u32> {
        let tenths = self.edited.get(COMM_TIMEOUT);
        (tenths != 0).then_some(u32::from(tenths) * 100)
    }

    /// Returns whether the request that is being served restarts the communication watchdog. `writes`: it writes points
    /// or registers.
    #[must_use]
    pub fn restarts_watchdog(&self, writes: bool) -> bool {
        let only = |source: CommSource| self.edited.get(COMM_SOURCE) & source.code() != 0;
        (writes || !only(CommSource::Writes))
            && (self.origin.line == LineName::Rs485 || !only(CommSource::Rs485))
    }

    /// Returns RESPONSE_DELAY in milliseconds, 0 to 1000.
    #[must_use]
    pub fn response_delay_ms(&self) -> u16 {
        self.edited.at::<RESPONSE_DELAY>()
    }
}
