//! Everything that a master can access, as one data model: points, counters, configuration, state.
//!
//! ```text
//!            requests (serve)
//!                  |
//!   +--------------v---------------------------------------------+
//!   | points    the value of every channel                        |<--> scan, 1 kHz
//!   | pulses    counters of digital inputs                        |
//!   | edges     time of each input's last edge, log of all edges  |
//!   | config    settings, lock, commands                          |<--> store, in flash
//!   | state     identity, counters, health                        |<--- all tasks
//!   +-------------------------------------------------------------+
//! ```
//!
//! The scan copies inputs in and outputs out; requests read and write the device only. Neither waits for the
//! other's hardware. A request that accesses several points reads or writes all of them at the same time.

mod comm_watchdog;
mod data_model;
mod description;
mod edge_log;
mod events;
mod identification;
mod keeping;
mod linking;
mod points;
mod port;
mod staging;
mod state;

#[cfg(test)]
mod tests;

use core::mem::MaybeUninit;

use modio_drivers::{CHANNELS, Channels, Codes};
use register_map::board::Board;
use register_map::codes::Command;

pub use comm_watchdog::CommWatchdog;
use description::Description;
use edge_log::EdgeLog;
use events::Events;
use linking::Linking;
pub use points::Points;
pub use port::IoPort;
pub use state::{Identity, State};

use crate::config::{Config, LineName, Origin, Point};
use crate::update::{Failed, Job, Order, TRIAL_S, Update, order_of};

/// The device behind the line.
#[derive(Debug)]
pub struct Device<B: Board> {
    /// The values of all channels.
    pub points: Points<B>,
    /// The settings.
    pub config: Config<B>,
    /// Identity and health.
    pub state: State<B>,
    description: Description,
    comm_watchdog: CommWatchdog,
    edges: EdgeLog,
    linking: Linking<B>,
    events: Events<B>,
    /// A command from a request, to be executed when its reply has been sent.
    ordered: Option<Command>,
    /// The unit address, after a master has changed it.
    new_unit: Option<u8>,
    /// The device is to restart once no save is under way.
    pub restart: Option<Restart>,
    /// The update over the line; `None` without a loader.
    pub update: Option<Update>,
    /// The LEDs are to blink.
    pub identify: bool,
    /// A request for this unit has been served since the LEDs were last updated.
    pub activity: bool,
    /// Revision of the configuration whose settings the points have.
    revision: u16,
}

/// Longest time between two scans, in ms, unless flash is erased, which takes 20 ms at least.
const LONGEST_MS: u32 = 2;

/// A restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Restart {
    /// COMMAND 2. It does not count as a start on trial.
    Asked,
    /// COMMAND 0xB007: the next start is one as with SW01 = 255.
    As255,
    /// The boot state has changed, or nobody has confirmed the image on trial.
    Update,
}

impl<B: Board> Device<B> {
    /// Creates a device with these settings in `place`, because it is too large to be moved over the stack. The outputs
    /// are set to START.
    #[must_use]
    #[inline(never)]
    pub fn new_in(
        place: &mut MaybeUninit<Self>,
        config: Config<B>,
        identity: Identity,
    ) -> &mut Self {
        let device = place.write(Self {
            points: Points::new(&config),
            state: State::new(identity),
            description: Description::new(&config),
            comm_watchdog: CommWatchdog::new(),
            edges: EdgeLog::new(),
            linking: Linking::new(),
            events: Events::new(),
            ordered: None,
            new_unit: None,
            restart: None,
            update: None,
            identify: false,
            activity: false,
            revision: config.revision(),
            config,
        });
        device.configure_points();
        device.for_each_point(u32::MAX, |port, channel, point| {
            port.command_raw(channel, point.start)
        });
        device.begin_links(|_| 0);
        device
    }

    /// Applies the settings in force to the points, after the settings may have changed.
    #[inline(never)]
    fn configure_points(&mut self) {
        self.config.compare();
        self.revision = self.config.revision();
        let written = self.config.take_written_points();
        let changed = self.changed_sources(written);
        self.for_each_point(written, IoPort::configure);
        if B::ROW.stage {
            for point in linking::bits(self.config.take_written_times()) {
                if let Some((slot, channel)) = Points::<B>::index_of(point as u16)
                    && let Some(times) = self.config.times(slot, channel)
                {
                    self.points.set_times(slot, channel, times);
                }
            }
        }
        if written == u32::MAX
            || changed.iter().any(|channels| *channels != 0)
            || self.config.has_written_links()
        {
            self.set_up_links(&changed);
        }
    }

    /// Passes the settings in force of these points, point 0 in bit 0, to `act`, with the point's port and channel.
    fn for_each_point(&mut self, points: u32, act: fn(&mut IoPort<B>, usize, Point)) {
        for (index, port) in self.points.ports_mut().iter_mut().enumerate() {
            let points = points >> (Points::<B>::first_of(index) & 31);
            for channel in 0..CHANNELS {
                if points >> channel & 1 != 0
                    && let Some(point) = self.config.point(index, channel)
                {
                    act(port, channel, point);
                }
            }
        }
    }

    /// Advances the time by `ms` milliseconds, at the beginning of a scan. When the communication watchdog expires, sets the
    /// outputs to SAFE that no level link holds, and returns true.
    pub fn tick(&mut self, ms: u32) -> bool {
        let second = self.state.tick(ms);
        self.config.tick(ms);
        let timeout_ms = self.config.comm_timeout_ms();
        let tripped = self.comm_watchdog.check(self.state.millis(), timeout_ms);
        if self.state.uptime_s() >= TRIAL_S
            && self.update.as_ref().is_some_and(Update::is_unconfirmed)
        {
            self.restart.get_or_insert(Restart::Update);
        }
        // Under the same lock, so that SAFE and links see the same state of the watchdog.
        self.tick_links(ms, second);
        if tripped {
            let linking = &self.linking;
            self.points.go_safe(|slot| linking.with_level(slot));
        }
        tripped
    }

    /// Stores the inputs that a scan of a slot has read from `codes`, `ms` milliseconds after the scan before. `words` is false when the
    /// settings have changed since the scan began: then the words of the scan have the wrong unit. The next scan calls
    /// [`Self::run_links`] for all slots after [`Self::tick`].
    // Not inlined into the scan, whose frame is large.
    #[inline(never)]
    pub fn scanned(
        &mut self,
        slot: usize,
        channels: &Channels,
        codes: &Codes,
        words: bool,
        ms: u32,
    ) {
        // 0 stands for an input without an edge.
        let now = self.state.millis().max(1);
        if ms > LONGEST_MS {
            self.edges.set_late(now);
        }
        let first = Points::<B>::first_of(slot);
        let Some(port) = self.points.ports_mut().get_mut(slot) else {
            return;
        };
        let edges = port.scanned(channels, words, now);
        self.scanned_sources(slot, codes, edges, ms);
        let Some(port) = self.points.ports().get(slot) else {
            return;
        };
        if B::ROW.events {
            self.events.look(slot, port, now);
        }
        if edges == 0 {
            return;
        }
        for (channel, settings) in port.settings().iter().enumerate() {
            if edges >> channel & 1 != 0 {
                let point = first.wrapping_add(channel as u16);
                let level = channels.bit(channel);
                self.edges.add(point, level, now, settings.filter);
                if B::ROW.events {
                    self.events.edge(slot, channel, level);
                }
            }
        }
    }

    /// Restarts the communication watchdog, unless COMM_SOURCE excludes the request: a valid request for this unit ended
    /// at `at_ms` milliseconds after the start. `writes`: it writes points or registers.
    pub fn request_seen(&mut self, at_ms: u32, writes: bool) {
        if self.config.restarts_watchdog(writes) {
            self.comm_watchdog.refresh(at_ms);
        }
    }

    /// Sets the origin of the request that is served next.
    pub const fn set_origin(&mut self, origin: Origin) {
        self.config.set_origin(origin);
    }

    /// Returns whether a module or the radio does not work.
    #[must_use]
    pub fn any_fails(&self) -> bool {
        self.points.any_fails() || self.radio_fails()
    }

    fn radio_fails(&self) -> bool {
        self.state.radio_works == Some(false)
    }

    /// Ends a request whose reply has begun: applies changed settings to the points. Returns the command that the
    /// request ordered.
    pub fn end_request(&mut self) -> Option<Command> {
        self.activity = true;
        self.settings_may_have_changed();
        self.ordered.take()
    }

    /// Takes the unit address that a request has set, which is in force from now on.
    pub fn take_unit(&mut self) -> Option<u8> {
        let unit = self.new_unit.take()?;
        self.state.set_unit(unit);
        Some(unit)
    }

    /// Executes a command of this line whose reply has been sent. The background task does what is left: a save that has begun,
    /// a restart, identify.
    pub fn carry_out(&mut self, order: Command, line: LineName) {
        match order {
            Command::Save => self.config.begin_save(),
            Command::Restart => {
                self.restart.get_or_insert(Restart::Asked);
            }
            Command::RestartAs255 => {
                self.restart.get_or_insert(Restart::As255);
            }
            Command::LoadDefaults => self.config.load_defaults(),
            Command::DropChanges => self.config.drop_changes(),
            Command::ClearWatchdogFlag => self.comm_watchdog.clear(),
            Command::Identify => self.identify = true,
            Command::Prepare | Command::Finish | Command::Confirm | Command::GoBack => {
                self.order_update(order, line);
            }
        }
        self.settings_may_have_changed();
    }

    /// Passes an order to the update, which may cost a save of the budget.
    fn order_update(&mut self, order: Command, line: LineName) {
        if let Some(update) = &mut self.update
            && let Some(order) = order_of(order)
            // The other line may have given an order since this one was checked.
            && let Ok(costs) = update.check(order, self.config.spare_saves())
            && (!costs || self.config.take_save().is_some())
        {
            update.take(order, line);
        }
    }

    /// Notes the end of a step of the update, as [`Update::end`], and restarts if it has carried out an order that asks for
    /// it. Returns whether the choice of SW01 = 254 ends.
    pub fn end_step(&mut self, job: &Job, done: Result<(), Failed>, image: [u16; 10]) -> bool {
        let update = self.update.as_mut();
        match update.and_then(|update| update.end(job, done, image)) {
            Some(Order::Finish | Order::GoBack) => self.restart = Some(Restart::Update),
            // The 15 minutes may have just ended.
            Some(Order::Confirm) => {
                self.restart.take_if(|restart| *restart == Restart::Update);
            }
            Some(Order::Prepare) | None => return false,
        }
        true
    }

    #[inline(always)]
    fn settings_may_have_changed(&mut self) {
        if self.revision != self.config.revision() {
            self.configure_points();
        }
    }
}
