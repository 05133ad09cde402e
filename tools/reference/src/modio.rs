//! A modio: what the register map says about points, registers and files, the lock, the communication watchdog and the
//! commands. Unlike the rest of this crate it is not written from the standard; tests of tools use it in place of a board.
//!
//! The caller passes the time. A [`crate::Server`] has the functions that are not about points, registers or files:
//!
//! ```
//! use modbus_reference::{Device, Modio, Server};
//! use register_map::{Module, board::MODIO_02, state};
//!
//! let mut modio = Modio::new(&MODIO_02, |_| Module::Relay2);
//! let mut server = Server::new(None, Device::new(0, 0));
//! let mut answer = |pdu: &[u8]| match modio.answer(pdu, &server.counters) {
//!     Some(answer) => answer,
//!     None => server.answer(pdu),
//! };
//! let [high, low] = state::BOARD.to_be_bytes();
//! assert_eq!(answer(&[3, high, low, 0, 1]), Ok(vec![3, 2, 0, 1]));
//! assert_eq!(answer(&[5, 0, 18, 0xFF, 0]), Ok(vec![5, 0, 18, 0xFF, 0]));
//! assert_eq!(answer(&[8, 0, 0, 1, 2]), Ok(vec![8, 0, 0, 1, 2]));
//! ```

use std::collections::BTreeMap;
use std::ops::Range;
use std::time::Duration;

use modio_description::{Description, checksum, describe};
use register_map::codes::{Command, Format, Mode, Scale, Signal};
use register_map::edges::log;
use register_map::points::{self, Kind};
use register_map::{
    Access, BLOCKS, Module, Row, Rule, Value, configuration as at, counters, runs, state,
};

use crate::Device;

/// The commit in its registers.
const COMMIT: u128 = 0x1234_ABCD;

/// The PDU of a reply, or an exception code.
type Answer = Result<Vec<u8>, u8>;

/// The first address after all registers.
const END: u16 = 0x0600;
const POINTS: usize = points::COUNT as usize;

/// Reset causes: power-on or the software, and the pin.
const POWER_ON: u16 = state::reset_cause::POWER_ON | state::reset_cause::PIN;
const SOFTWARE: u16 = state::reset_cause::SOFTWARE | state::reset_cause::PIN;

/// Time that the lock stays open.
const OPEN: Duration = Duration::from_secs(at::OPEN_S as u64);
/// Saves that are left at the start. A unit that is tested was saved before, and the suite waits when none is left.
const SAVES_LEFT: u8 = 5;
/// Time after which one more save is possible.
const SAVE_EVERY: Duration = Duration::from_secs(at::SAVE_EVERY_S as u64);

/// The points, registers and state of a modio.
#[derive(Clone, Debug)]
pub struct Modio {
    /// The present time, since any instant before the start.
    pub now: Duration,
    /// Values of bits, by address.
    pub bits: [bool; POINTS],
    /// Values of words, by address.
    pub words: [u16; POINTS],
    /// The settings that are read.
    pub edited: BTreeMap<u16, u16>,
    /// The settings in flash.
    pub saved: BTreeMap<u16, u16>,
    /// Registers that have these values, whatever the register map says. They can only be read.
    pub fixed: BTreeMap<u16, u16>,
    /// When the lock closes.
    pub open_until: Duration,
    /// When the watchdog tripped. The flag can remain set after the watchdog is no longer in force.
    pub tripped: Option<Duration>,
    /// The unit has to restart after the reply.
    pub restart: bool,
    board: &'static Row,
    modules: [Module; points::PORTS as usize],
    file: Vec<u16>,
    description_crc: u16,
    booted: Duration,
    cause: u16,
    saves_left: u8,
    /// When the number of saves left was last raised.
    save_added: Duration,
    /// The last valid request.
    last: Duration,
    flag: bool,
}

impl Modio {
    /// Creates a unit that was switched on just now. `module` returns the module of each slot, 1 to 8.
    pub fn new(board: &'static Row, module: impl Fn(u16) -> Module) -> Self {
        let mut settings = defaults(board);
        for port in board.ports().filter(|port| board.fixed(*port).is_none()) {
            settings.insert(at::module_of(port), module(port).code());
        }
        let mut modio = Self {
            now: Duration::ZERO,
            bits: [false; POINTS],
            words: [0; POINTS],
            saved: settings.clone(),
            edited: settings,
            fixed: BTreeMap::new(),
            open_until: Duration::ZERO,
            tripped: None,
            restart: false,
            board,
            modules: [Module::None; points::PORTS as usize],
            file: Vec::new(),
            description_crc: 0,
            booted: Duration::ZERO,
            cause: POWER_ON,
            saves_left: SAVES_LEFT,
            save_added: Duration::ZERO,
            last: Duration::ZERO,
            flag: false,
        };
        modio.start(Duration::ZERO, true);
        modio
    }

    /// Starts the unit: the saved settings and modules are in force.
    pub fn start(&mut self, now: Duration, power_on: bool) {
        self.edited.clone_from(&self.saved);
        (self.booted, self.last, self.now) = (now, now, now);
        self.cause = if power_on { POWER_ON } else { SOFTWARE };
        (self.open_until, self.tripped, self.flag) = (Duration::ZERO, None, false);
        self.restart = false;
        for (port, module) in (1..).zip(&mut self.modules) {
            let code = self.saved.get(&at::module_of(port)).copied();
            *module = code.and_then(Module::from_code).unwrap_or(Module::None);
        }
        let [version, patch] = [state::FIRMWARE_VERSION, state::FIRMWARE_PATCH]
            .map(|address| self.register(address, &[0; 9]));
        let version = format!("{}.{}.{patch}", version >> 8, version & 0xFF);
        let modules = self.modules;
        let description = describe(self.board, &version, |port| modules[usize::from(port) - 1]);
        self.describe(&description);
        self.set_outputs(at::START, at::AS_IT_WAS);
    }

    /// Replaces file 1, the self-description, until the next start.
    pub fn describe(&mut self, description: &Description) {
        let file = description.file();
        let words = file.as_chunks().0.iter().copied();
        self.file = words.map(u16::from_be_bytes).collect();
        self.description_crc = checksum(&description.encode());
    }

    /// Sets each output to its value in these settings. `kept` leaves an output unchanged.
    fn set_outputs(&mut self, settings: u16, kept: u16) {
        for point in self.board.points() {
            let value = self.edited[&(settings + point)];
            let index = usize::from(point);
            match self.kind(point) {
                _ if value == kept => {}
                Kind::BitOutput => self.bits[index] = value == 1,
                Kind::WordOutput => self.words[index] = value,
                Kind::None | Kind::BitInput | Kind::WordInput => {}
            }
        }
    }

    /// Sets the time, and the outputs to SAFE if the time since the last valid request is longer than COMM_TIMEOUT.
    pub fn watch(&mut self, now: Duration) {
        self.now = now;
        let timeout = Duration::from_millis(100) * u32::from(self.edited[&at::COMM_TIMEOUT]);
        if !timeout.is_zero() && now > self.last + timeout && self.tripped.is_none() {
            self.tripped = Some(self.last + timeout);
            self.flag = true;
        }
        if self.tripped.is_some() {
            self.set_outputs(at::SAFE, at::HOLD);
        }
    }

    /// Notes a valid request for this unit, or a broadcast. COMM_SOURCE has no effect.
    pub fn note_request(&mut self) {
        self.last = self.now;
    }

    /// Returns whether the configuration is unlocked.
    pub fn is_open(&self) -> bool {
        self.now < self.open_until
    }

    /// Serves a PDU; `None` when the function is not about points, registers or files.
    pub fn answer(&mut self, pdu: &[u8], counters: &[u16; 9]) -> Option<Answer> {
        match pdu[0] {
            1..=6 | 0x0F | 0x10 | 0x16 | 0x17 => Some(self.points(pdu, counters)),
            0x14 | 0x15 => Some(self.files(pdu)),
            _ => None,
        }
    }

    /// Serves file 1, the self-description, and file 3, the log of edges, which is empty. Without a loader there is no
    /// file 2.
    fn files(&self, pdu: &[u8]) -> Answer {
        let mut device = Device {
            files: vec![self.file.clone(), Vec::new(), vec![0; log::END.into()]],
            read_only_from: 0,
            ..Device::new(0, 0)
        };
        crate::answer(&mut device, pdu)
    }

    fn points(&mut self, pdu: &[u8], counters: &[u16; 9]) -> Answer {
        let words = (0..END).map(|address| self.register(address, counters));
        let words: Vec<u16> = words.collect();
        let mut device = Device {
            bits: self.bits.into(),
            input_bits: self.bits.into(),
            words: words.clone(),
            input_words: words,
            max_word: u16::MAX,
            ..Device::new(0, 0)
        };
        let reply = crate::answer(&mut device, pdu)?;
        let word = |at: usize| u16::from_be_bytes([pdu[at], pdu[at + 1]]);
        let (start, count) = match pdu[0] {
            5 | 6 | 0x16 => (word(1), 1),
            0x17 => (word(5), word(7)),
            _ => (word(1), word(3)),
        };
        let written = usize::from(start)..usize::from(start) + usize::from(count);
        match pdu[0] {
            1 | 2 => self.have(start..start + count, &[Kind::BitInput, Kind::BitOutput])?,
            3 | 4 => self.can_read(start, count)?,
            5 | 0x0F => {
                self.have(start..start + count, &[Kind::BitOutput])?;
                self.bits[written.clone()].copy_from_slice(&device.bits[written]);
                self.tripped = None;
            }
            0x17 => {
                self.can_read(word(1), word(3))?;
                self.write(start, &device.words[written])?;
                let mut reply = self.points(&[&[3], &pdu[1..5]].concat(), counters)?;
                reply[0] = pdu[0];
                return Ok(reply);
            }
            _ => self.write(start, &device.words[written])?,
        }
        Ok(reply)
    }

    /// Checks that all these points are of one of these kinds.
    fn have(&self, mut points: Range<u16>, kinds: &[Kind]) -> Result<(), u8> {
        let all = points.all(|point| kinds.contains(&self.kind(point)));
        all.then_some(()).ok_or(2)
    }

    fn kind(&self, point: u16) -> Kind {
        let port = point / points::CHANNELS + 1;
        if !self.board.has_slot(port) {
            return Kind::None;
        }
        let module = self.modules[usize::from(port) - 1];
        self.board.kinds(port, module)[usize::from(point % points::CHANNELS)]
    }

    /// Checks that these words are in one block.
    fn can_read(&self, start: u16, count: u16) -> Result<(), u8> {
        let mut span = start..start + count;
        if start < points::COUNT {
            return self.have(span, &[Kind::WordInput, Kind::WordOutput]);
        }
        let mut blocks = BLOCKS.iter();
        let is_block = blocks.any(|block| runs(block.rules, start, count).is_some());
        let has = is_block && span.clone().all(|address| self.board.has(address));
        let is_fixed = span.all(|address| self.fixed.contains_key(&address));
        (has || is_fixed).then_some(()).ok_or(2)
    }

    /// Returns a register.
    pub fn register(&self, address: u16, counters: &[u16; 9]) -> u16 {
        let long = |value: u128, low: u16| (value >> if address == low { 0 } else { 16 }) as u16;
        let up = self.now - self.booted;
        match address {
            _ if self.fixed.contains_key(&address) => self.fixed[&address],
            0..points::COUNT => self.words[usize::from(address)],
            at::KEY => u16::from(self.is_open()),
            at::COMMAND => 0,
            state::PRODUCT_CODE..state::FIRMWARE_VERSION => {
                long(state::PRODUCT.into(), state::PRODUCT_CODE + 1)
            }
            state::FIRMWARE_VERSION => 0x0001,
            state::MAP_VERSION => state::MAP_VERSION_VALUE,
            state::BOARD => self.board.code,
            state::COMMIT..state::BUILD => long(COMMIT, state::COMMIT + 1),
            state::UNIT_ADDRESS => 1,
            state::RESET_CAUSE => self.cause,
            state::UPTIME..state::STATUS => long(up.as_secs().into(), state::UPTIME + 1),
            state::UPTIME_MS..state::SERIAL_NUMBER => long(up.as_millis(), state::UPTIME_MS + 1),
            state::STATUS => {
                let flags = [
                    (state::status::COMM_WATCHDOG, self.flag),
                    (state::status::UNSAVED, self.edited != self.saved),
                    (state::status::UNLOCKED, self.is_open()),
                ];
                flags.iter().map(|(bit, set)| bit * u16::from(*set)).sum()
            }
            state::MODULE_IN_FORCE..state::MODULE_STATE => {
                self.modules[usize::from(address - state::MODULE_IN_FORCE)].code()
            }
            state::BUILD => state::build::NO_LOADER,
            state::DESCRIPTION_CRC => self.description_crc,
            state::BUS_MESSAGES..=state::T15_GAPS => {
                counters[usize::from(address - state::BUS_MESSAGES)]
            }
            _ => self.edited.get(&address).copied().unwrap_or(0),
        }
    }

    fn write(&mut self, start: u16, words: &[u16]) -> Result<(), u8> {
        let count = words.len() as u16;
        let span = start..start + count;
        if start < points::COUNT {
            return self.write_points(span, words);
        }
        if runs(counters::RULES, start, count).is_some() {
            let whole = start.is_multiple_of(2) && count.is_multiple_of(2);
            let zero = words.iter().all(|word| *word == 0);
            return if whole && zero { Ok(()) } else { Err(3) };
        }
        self.can_read(start, count)?;
        if !span.clone().all(|address| self.is_setting(address)) {
            return Err(2);
        }
        if (start, count) == (at::HEARTBEAT, 1) {
            return Ok(());
        }
        let mut values = span.clone().zip(words);
        if !values.all(|(address, value)| self.allows(address, *value)) {
            return Err(3);
        }
        let new = |address: u16| {
            let written = words.get(usize::from(address.wrapping_sub(start)));
            written.copied().unwrap_or(self.edited[&address])
        };
        let mode = Mode::from_code(new(at::MODE)).unwrap_or(Mode::Rtu);
        let format = Format::from_code(new(at::FORMAT));
        if format.is_some_and(|format| !format.suits(mode)) {
            return Err(3);
        }
        while self.saves_left < at::SAVES && self.now >= self.save_added + SAVE_EVERY {
            self.saves_left += 1;
            self.save_added += SAVE_EVERY;
        }
        let order = words.get(usize::from(at::COMMAND.wrapping_sub(start)));
        let saves = order == Some(&Command::Save.code()) && self.edited != self.saved;
        let is_locked = !self.is_open() && (start, count) != (at::KEY, 1);
        if is_locked || saves && self.saves_left == 0 {
            return Err(6);
        }
        if saves {
            self.saves_left -= 1;
        }
        self.open_until = self.now + OPEN;
        for (address, value) in span.zip(words) {
            match address {
                at::KEY | at::HEARTBEAT => {}
                at::COMMAND => self.command(*value),
                _ => drop(self.edited.insert(address, *value)),
            }
        }
        Ok(())
    }

    fn write_points(&mut self, points: Range<u16>, words: &[u16]) -> Result<(), u8> {
        self.have(points.clone(), &[Kind::WordOutput])?;
        let allows = |(point, value): (u16, &u16)| {
            let setting = |run| self.edited[&(run + point)];
            let signal = Signal::from_code(setting(at::RANGE)).unwrap_or(Signal::Voltage);
            let scale = Scale::from_code(setting(at::SCALE)).unwrap_or(Scale::Raw);
            points::output_values(signal, scale).allow(*value)
        };
        if !points.clone().zip(words).all(allows) {
            return Err(3);
        }
        let written = usize::from(points.start)..usize::from(points.end);
        self.words[written].copy_from_slice(words);
        self.tripped = None;
        Ok(())
    }

    fn is_setting(&self, address: u16) -> bool {
        let rule = rule(self.board, address);
        rule.is_some_and(|rule| rule.access == Access::ReadWrite)
            && !self.fixed.contains_key(&address)
    }

    /// Returns whether a setting may have a value. Links may have any.
    pub fn allows(&self, address: u16, value: u16) -> bool {
        if (at::MODULE..at::MODULE + points::PORTS).contains(&address)
            && !self.board.takes(address - at::MODULE + 1, value)
        {
            return false;
        }
        let kind = at::point_of(address).map_or(Kind::None, |point| self.kind(point));
        let rule = rule(self.board, address);
        rule.is_some_and(|rule| rule.values_for(kind).allow(value))
    }

    fn command(&mut self, code: u16) {
        match Command::from_code(code) {
            Some(Command::Save) => self.saved.clone_from(&self.edited),
            Some(Command::Restart) => self.restart = true,
            Some(Command::LoadDefaults) => self.edited = defaults(self.board),
            Some(Command::DropChanges) => self.edited.clone_from(&self.saved),
            Some(Command::ClearWatchdogFlag) => self.flag = false,
            _ => {}
        }
    }
}

/// Returns the factory settings of a board.
fn defaults(board: &Row) -> BTreeMap<u16, u16> {
    let settings = board.registers().filter(|(rule, _)| {
        rule.access == Access::ReadWrite && runs(counters::RULES, rule.first, 1).is_none()
    });
    let values = settings.flat_map(|(rule, text)| {
        let value = move |address: u16| match text.value {
            Value::Fields(_, fields) => {
                fields[usize::from(address - rule.first) % fields.len()].default
            }
            _ => rule.default,
        };
        rule.addresses()
            .map(move |address| (address, value(address)))
    });
    let mut defaults: BTreeMap<_, _> = values.collect();
    for (port, fixed) in (board.first_port..).zip(board.fixed) {
        defaults.insert(at::module_of(port), fixed.module.code());
        let currents = (0..points::CHANNELS).filter(|channel| fixed.currents >> channel & 1 == 1);
        defaults.extend(currents.map(|channel| (at::RANGE + points::of_port(port) + channel, 1)));
    }
    defaults
}

/// Returns the rule for a register of a board.
fn rule(board: &Row, address: u16) -> Option<&'static Rule> {
    let mut rules = board.registers().map(|(rule, _)| rule);
    rules.find(|rule| (rule.first..rule.end()).contains(&address))
}
