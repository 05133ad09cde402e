//! The configuration, registers 0x0100 to 0x01FF, the links, 0x0400 to 0x04FF, and the settings behind them, 0x0500 to
//! 0x057F: which writes are allowed, the edited settings, the stored settings and the settings in force.
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

mod checking;
mod in_force;
mod linked;
mod links;
mod lock;
mod origin;
mod saving;
mod settings;

#[cfg(test)]
mod tests;

use modbus_server::{Exception, Span, Words, WordsOut};
use modio_drivers::{CHANNELS, Kind};
use register_map::board::{Board, Each};
use register_map::codes::{CommSource, Command, Lora};
use register_map::configuration::{
    COMM_SOURCE, COMM_TIMEOUT, COMMAND, FILTER, HEARTBEAT, KEY, LORA, RESPONSE_DELAY, SAVE_EVERY_S,
    SAVES, SERIAL_LOW,
};
use register_map::stage::{DEAD_TIME, MAX_ON, MIN_OFF, max_on_ms};
use register_map::state::status;
use register_map::{Module, links as links_map, points};

use crate::budget::Budget;
use crate::stage::Times;
pub use in_force::{LineConfig, Point, RadioConfig};
use links::Links;
use lock::Lock;
pub use origin::{LineName, Origin};
use saving::Save;
pub use settings::RestartValues;
pub use settings::Settings;
use settings::{RESTARTS, is_behind, port_of};

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
    /// Points with times of the stage that may have been written since they were last applied, point 0 in bit 0.
    written_times: u32,
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
            written_times: u32::MAX,
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
        if (FILTER..links_map::LINKS).contains(&span.start()) || is_behind::<B>(span.start()) {
            // These registers do not affect others.
            let edited = self.edited.slice_mut(span.start(), span.count());
            for (edited, value) in edited.iter_mut().zip(words.iter()) {
                *edited = value;
            }
            let points = points_of(span);
            self.written_points |= points;
            if is_behind::<B>(span.start()) {
                self.written_times |= points;
            }
        } else {
            for (address, value) in span.addresses().zip(words.iter()) {
                match address {
                    KEY | HEARTBEAT => {}
                    COMMAND => command = Command::from_code(value),
                    _ => {
                        self.edited.set(address, value);
                        if port_of(address).is_some() {
                            (self.written_points, self.written_times) = (u32::MAX, u32::MAX);
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

    /// Returns the points with times of the stage that may have been written since the last call, point 0 in bit 0.
    pub const fn take_written_times(&mut self) -> u32 {
        core::mem::replace(&mut self.written_times, 0)
    }

    /// COMMAND 3: sets every setting to its default. These values are not stored in flash.
    pub fn load_defaults(&mut self) {
        self.edited = Settings::defaults();
        self.written_links = Each::all(u8::MAX);
        (self.written_points, self.written_times) = (u32::MAX, u32::MAX);
        self.revision = self.revision.wrapping_add(1);
    }

    /// COMMAND 4: sets every setting to its saved value.
    pub fn drop_changes(&mut self) {
        self.edited = self.saved;
        self.written_links = Each::all(u8::MAX);
        (self.written_points, self.written_times) = (u32::MAX, u32::MAX);
        self.left = 0;
        self.revision = self.revision.wrapping_add(1);
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

    /// Returns the times of a digital output; `None` as [`point`](Self::point) does. `index` counts the ports with a slot.
    #[must_use]
    pub fn times(&self, index: usize, channel: usize) -> Option<Times> {
        let first = points::of_port(port_at::<B>(index));
        let point = first.wrapping_add(channel as u16);
        let get = |first: u16| self.edited.get(first.wrapping_add(point));
        self.is_in_force(index).then(|| Times {
            dead: u32::from(get(DEAD_TIME)) * 10,
            max_on: max_on_ms(get(MAX_ON)),
            min_off: u32::from(get(MIN_OFF)) * 100,
        })
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
