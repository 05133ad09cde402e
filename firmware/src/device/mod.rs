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
mod description;
mod edge_log;
mod events;
mod identification;
mod keeping;
mod linking;
mod points;
mod port;
mod state;

#[cfg(test)]
mod tests;

use core::{mem::MaybeUninit, ops::Range};

use modbus_server::fast::{self, EventSource, Packet, Waiting};
use modbus_server::{
    Adu, Bits, BitsOut, DataModel, Exception, Server, Span, Table, TextOut, Words, WordsOut,
};
use modio_drivers::{CHANNELS, Channels, Codes};
use register_map::board::Board;
use register_map::configuration::COMMAND;
use register_map::update::status;
use register_map::{codes::Command, counters, edges, fault, name, second, state as state_map};

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

/// The block of the address space that contains the start of a span. The span must not leave the block.
enum Block {
    Points,
    Config,
    Pulses,
    /// Name of the board, state, fault record, counters of the second line, last edges.
    ReadOnly,
}

/// The registers of [`Block::ReadOnly`]. A span lies within one of these ranges.
const READ_ONLY: [&[Range<u16>]; 5] = [
    name::SPANS,
    state_map::SPANS,
    fault::SPANS,
    second::SPANS,
    edges::SPANS,
];

impl Block {
    #[inline(always)]
    const fn of<B: Board>(span: Span) -> Self {
        // Most requests are for points.
        if span.start() < register_map::points::COUNT {
            Self::Points
        } else {
            Self::of_others::<B>(span)
        }
    }

    #[inline(never)]
    const fn of_others<B: Board>(span: Span) -> Self {
        match span.start().to_be_bytes() {
            [1 | 4, _] => Self::Config,
            [5, _] if B::ROW.events => Self::Config,
            [0 | 2, _] | [3, 0x80..=0xFF] => Self::ReadOnly,
            [3, _] => Self::Pulses,
            _ => Self::Points,
        }
    }
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

    /// Checks whether a write of the configuration may give the order of an update that it contains, if any.
    fn check_order(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        let code = words.get(COMMAND.wrapping_sub(span.start()));
        let Some(command) = code.and_then(Command::from_code).filter(is_of_update) else {
            return Ok(());
        };
        let Some(update) = &self.update else {
            return Err(Exception::IllegalDataValue);
        };
        let allowed = match order_of(command) {
            Some(order) => update.check(order, self.config.spare_saves()).is_ok(),
            // The unit would leave the air until somebody stands before it: there is no radio in recovery.
            None => !self.config.is_over_the_air(),
        };
        if allowed && self.config.is_to_the_address() {
            Ok(())
        } else {
            Err(Exception::ServerDeviceBusy)
        }
    }

    #[inline(always)]
    fn settings_may_have_changed(&mut self) {
        if self.revision != self.config.revision() {
            self.configure_points();
        }
    }

    /// Returns whether these are counters of a second line that the board does not have.
    const fn lacks(span: Span) -> bool {
        B::ROW.second.is_none() && matches!(span.start(), second::BUS_MESSAGES..=second::T15_GAPS)
    }

    /// Returns a register of the board's name.
    fn name_word(&self, address: u16) -> u16 {
        let index = usize::from(address.wrapping_sub(name::NAME));
        let byte = B::ROW.name.as_bytes().get(index);
        byte.copied().unwrap_or_default().into()
    }

    /// Returns the status register (0x020A).
    fn status(&self) -> u16 {
        use state_map::status;
        let bit = |mask, set| if set { mask } else { 0 };
        self.config.status()
            | bit(status::COMM_WATCHDOG, self.comm_watchdog.has_tripped())
            | bit(
                status::MODULE_FAULT,
                self.points.has_fault() || self.radio_fails(),
            )
            | bit(
                status::INTERNAL_OSCILLATOR,
                self.state.on_internal_oscillator(),
            )
    }

    /// Returns a register of [`Block::ReadOnly`] or of the pulse counters.
    // Not inlined into the loop over the registers, which has few registers of the core left.
    #[inline(never)]
    fn read_only_word(&self, address: u16) -> u16 {
        match address {
            ..state_map::PRODUCT_CODE => self.name_word(address),
            counters::PULSES.. => self.points.input_word(address),
            fault::KIND..second::BUS_MESSAGES => self.state.fault_word(address),
            state_map::STATUS => self.status(),
            state_map::UPDATE => self.update.as_ref().map_or(0, Update::register),
            state_map::DESCRIPTION_CRC => self.description.crc(),
            address => self.state.word(address, &self.points, &self.config),
        }
    }
}

/// Returns whether a command exists only behind the loader.
const fn is_of_update(command: &Command) -> bool {
    command.code() >= Command::Prepare.code()
}

/// Checks whether a span lies in one of these ranges of registers.
fn check_exists(blocks: &[&[Range<u16>]], span: Span) -> Result<(), Exception> {
    let within =
        |range: &Range<u16>| range.contains(&span.start()) && span.end() <= u32::from(range.end);
    if blocks.iter().any(|block| block.iter().any(within)) {
        Ok(())
    } else {
        Err(Exception::IllegalDataAddress)
    }
}

/// Functions 01 and 02 read the same bits, and 03 and 04 the same words.
impl<B: Board> DataModel for Device<B> {
    fn check_read_bits(&self, _: Table, span: Span) -> Result<(), Exception> {
        self.points.check_read_bits(span)
    }

    fn check_read_words(&self, _: Table, span: Span) -> Result<(), Exception> {
        match Block::of::<B>(span) {
            Block::Points => self.points.check_read_words(span),
            Block::Config => self.config.check_read(span),
            Block::Pulses => check_exists(&[counters::SPANS], span),
            Block::ReadOnly if Self::lacks(span) => Err(Exception::IllegalDataAddress),
            Block::ReadOnly => check_exists(&READ_ONLY, span),
        }
    }

    fn check_write_bits(&self, span: Span, _bits: Bits<'_>) -> Result<(), Exception> {
        self.points.check_write_bits(span)
    }

    fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        match Block::of::<B>(span) {
            Block::Points => self.points.check_write_words(span, words),
            Block::Config => {
                let checked = self.config.check_write(span, words);
                // Address and value come before the state.
                if matches!(checked, Ok(()) | Err(Exception::ServerDeviceBusy)) {
                    self.check_order(span, words)?;
                }
                checked
            }
            Block::ReadOnly if span == Span::single(name::UNIT_BY_SERIAL) => {
                self.config.check_unit(words.get(0))
            }
            Block::ReadOnly => Err(Exception::IllegalDataAddress),
            Block::Pulses => {
                check_exists(&[counters::SPANS], span)?;
                points::check_clear(span, words)?;
                self.config.check_line()
            }
        }
    }

    fn read_bits(&self, _: Table, span: Span, out: &mut BitsOut<'_>) {
        self.points.read_bits(span, out);
    }

    #[inline]
    fn before_read_words(&mut self, span: Span, server: &Server) {
        // The request may have written settings, which may change anything else.
        if !matches!(Block::of::<B>(span), Block::Config) {
            self.settings_may_have_changed();
        }
        if span.start() >= state_map::PRODUCT_CODE {
            *self.state.counters_of(self.config.origin_line()) = server.counters();
        }
    }

    fn read_words(&self, _: Table, span: Span, out: &mut WordsOut<'_>) {
        match Block::of::<B>(span) {
            Block::Points => self.points.read_words(span, out),
            Block::Config => self.config.read(span, out),
            Block::Pulses | Block::ReadOnly => span
                .addresses()
                .for_each(|address| out.push(self.read_only_word(address))),
        }
    }

    fn write_bits(&mut self, span: Span, bits: Bits<'_>) {
        self.end_holds(span.start(), span.count());
        self.points.write_bits(span, bits);
    }

    fn write_words(&mut self, span: Span, words: Words<'_>) {
        match Block::of::<B>(span) {
            Block::Points => self.points.write_words(span, words),
            Block::Config => {
                self.ordered = self.config.write(span, words);
            }
            Block::Pulses => self.points.clear_pulses(span),
            // Of these registers `check_write_words` accepts only UNIT_BY_SERIAL.
            Block::ReadOnly => {
                if !B::ROW.switch
                    && let Some(unit) = words.get(0)
                {
                    self.config.set_unit(unit);
                    self.new_unit = Some(unit as u8);
                }
            }
        }
    }

    /// The self-description is file 1, the log of edges file 3. Behind the loader, file 2 is the state of an update, and the
    /// images are files that can be written.
    fn has_files(&self) -> bool {
        true
    }

    fn check_read_file(&self, file: u16, records: Span) -> Result<(), Exception> {
        if file == status::FILE
            && let Some(update) = &self.update
        {
            return update.check_read(records);
        }
        if file == edges::log::FILE {
            return EdgeLog::check_read(records);
        }
        self.description.check_read::<B>(file, records)
    }

    fn read_file(&self, file: u16, records: Span, out: &mut WordsOut<'_>) {
        let update = self.update.as_ref().filter(|_| file == status::FILE);
        if file == edges::log::FILE || update.is_some() {
            return records.addresses().for_each(|record| {
                out.push(
                    update
                        .map_or_else(|| self.edges.record(record), |update| update.record(record)),
                );
            });
        }
        self.description.read(&self.config, records, out);
    }

    fn check_write_file(
        &self,
        file: u16,
        records: Span,
        words: Words<'_>,
    ) -> Result<(), Exception> {
        let Some(update) = &self.update else {
            return Err(Exception::IllegalDataAddress);
        };
        let line = self.config.origin_line();
        update.check_write(file, records, words, line)?;
        self.config.check_line()
    }

    fn write_file(&mut self, file: u16, records: Span, words: Words<'_>) {
        if let Some(update) = &mut self.update {
            update.write(file, records, words);
            self.config.keep_open();
        }
    }

    /// Returns the low byte of the status register.
    fn exception_status(&self) -> u8 {
        self.status().to_le_bytes()[0]
    }

    /// Returns the status register.
    fn diagnostic_register(&self) -> u16 {
        self.status()
    }

    /// Function 70 with the unit's own address: which points report events.
    fn check_custom(&self, code: u8, data: &[u8]) -> Result<(), Exception> {
        let is_served = B::ROW.events
            && code == fast::FUNCTION
            && self.state.reports_events()
            && self.config.origin_line() == LineName::Rs485;
        if !is_served {
            return Err(Exception::IllegalFunction);
        }
        fast::check_settings(data)
    }

    fn serve_custom(&mut self, _: u8, adu: &mut Adu) {
        let (ports, first) = (self.points.ports(), Points::<B>::first_of(0));
        fast::apply_settings(adu, |kind, id, to| {
            self.events.set(ports, first, kind, id, to)
        });
    }

    fn server_id(&self) -> &[u8] {
        self.state.server_id()
    }

    /// Returns false while the communication watchdog has set the outputs to SAFE.
    fn is_running(&self) -> bool {
        !self.comm_watchdog.has_tripped()
    }

    fn identification(&self, object: u8, text: &mut TextOut<'_>) -> bool {
        let value = identification::object(object, self.state.serial(), &self.config);
        text.extend(value.unwrap_or_default());
        value.is_some()
    }
}

impl<B: Board> EventSource for Device<B> {
    fn waiting(&self) -> Waiting {
        self.events.waiting()
    }

    fn reports_start(&self) -> bool {
        self.events.reports_start()
    }

    fn start_is_known(&mut self) {
        self.events.start_is_known();
    }

    fn fill(&mut self, packet: &mut Packet) {
        let first = Points::<B>::first_of(0);
        self.events.fill(packet, self.points.ports(), first);
    }

    fn sent(&mut self) {
        self.events.sent();
    }
}
