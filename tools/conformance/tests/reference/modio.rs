//! The part of a modio that the reference server does not have: points and registers by the register map, the lock, the
//! communication watchdog and the commands. The module in its slot is a 2Relay: two inputs, two outputs.

use std::collections::BTreeMap;
use std::time::Duration;

use modbus_line::LineFormat;
use modbus_reference::Device;
use modio_description::{Description, checksum, describe};
use register_map::board::MODIO_02;
use register_map::codes::{Baud, Command, Format, Mode};
use register_map::edges::log;
use register_map::points::{self, Kind};
use register_map::{BLOCKS, Module, configuration as at, counters, rule_at, runs, state};

use super::modio_fault::ModioFault;

type Answer = Result<Vec<u8>, u8>;

/// The unit's address: that of most worked frames.
pub const UNIT: u8 = 1;

const MODULE: Module = Module::Relay2;
/// The relays' modes, which are inputs, and the relays, which are outputs.
const INPUTS: [bool; 2] = [true, false];
const OUTPUT: u16 = FIRST + 2;
/// The first point of the slot, port 5.
const FIRST: u16 = points::first(5);
const OUTPUTS: usize = 2;
/// The first address after all registers.
const END: u16 = 0x0600;

/// Reset causes: power-on or the software, and the pin.
const POWER_ON: u16 = 0x30;
const SOFTWARE: u16 = 0x28;

/// Time that the lock stays open.
const OPEN: Duration = Duration::from_secs(60);

/// Saves that are left at the start. A unit that is tested was saved before, and the suite waits when none is left.
const SAVES_LEFT: u8 = 5;
/// Time after which one more save is possible.
const SAVE_EVERY: Duration = Duration::from_secs(at::SAVE_EVERY_S as u64);

/// Time between two outputs that are set to SAFE, with [`ModioFault::SafeOneByOne`].
const ONE_BY_ONE: Duration = Duration::from_millis(1);

/// The points, registers and state of a modio.
pub struct Modio {
    fault: Option<ModioFault>,
    edited: BTreeMap<u16, u16>,
    saved: BTreeMap<u16, u16>,
    outputs: [bool; OUTPUTS],
    now: Duration,
    booted: Duration,
    cause: u16,
    open_until: Duration,
    saves_left: u8,
    /// When the number of saves left was last raised.
    save_added: Duration,
    /// The last valid request.
    last: Duration,
    /// When the watchdog tripped. The flag can remain set after the watchdog is no longer in force.
    tripped: Option<Duration>,
    flag: bool,
    last_command: u16,
    /// The unit has to restart after the reply.
    pub restart: bool,
}

impl Modio {
    pub fn new(fault: Option<ModioFault>) -> Self {
        let mut settings = BTreeMap::new();
        for rule in at::RULES {
            let default = |address| (address, rule.default);
            settings.extend(rule.addresses().map(default));
        }
        settings.insert(at::module_of(5), MODULE.code());
        Self {
            fault,
            saved: settings.clone(),
            edited: settings,
            outputs: [false; OUTPUTS],
            now: Duration::ZERO,
            booted: Duration::ZERO,
            cause: POWER_ON,
            open_until: Duration::ZERO,
            saves_left: SAVES_LEFT,
            save_added: Duration::ZERO,
            last: Duration::ZERO,
            tripped: None,
            flag: false,
            last_command: 0,
            restart: false,
        }
    }

    pub fn has(&self, fault: ModioFault) -> bool {
        self.fault == Some(fault)
    }

    /// Starts the unit. Returns the rate and format in force.
    pub fn start(&mut self, at: Duration, power_on: bool) -> LineFormat {
        self.edited.clone_from(&self.saved);
        (self.booted, self.last, self.now) = (at, at, at);
        self.cause = if power_on { POWER_ON } else { SOFTWARE };
        (self.open_until, self.tripped, self.flag) = (Duration::ZERO, None, false);
        self.restart = false;
        if !self.has(ModioFault::KeepsOutputs) {
            for (n, output) in (0..).zip(&mut self.outputs) {
                *output = self.saved[&(at::START + OUTPUT + n)] == 1;
            }
        }
        let mut baud = u32::from(self.saved[&at::BAUD]) * 100;
        if baud == Baud::B230400.bits_per_second() && self.has(ModioFault::LacksARate) {
            baud = Baud::B115200.bits_per_second();
        }
        let mut format = Format::from_code(self.saved[&at::FORMAT]).unwrap_or(Format::F8N2);
        if format == Format::F8O1 && self.has(ModioFault::OddIsEven) {
            format = Format::F8E1;
        }
        let name = Format::NAMES[usize::from(format.code())].1;
        LineFormat::new(baud, name.parse().unwrap())
    }

    /// Silence before a reply, in addition to t3.5.
    pub fn response_delay(&self) -> Duration {
        if self.has(ModioFault::RepliesUndelayed) {
            return Duration::ZERO;
        }
        Duration::from_millis(self.edited[&at::RESPONSE_DELAY].into())
    }

    /// Notes a valid request for this unit, or a broadcast, at this instant. COMM_SOURCE has no effect.
    pub fn request(&mut self, at: Duration, broadcast: bool, pdu: &[u8]) {
        self.now = at;
        let timeout = Duration::from_millis(100) * u32::from(self.edited[&at::COMM_TIMEOUT]);
        let dead = !timeout.is_zero() && at > self.last + timeout;
        if dead && self.tripped.is_none() && !self.has(ModioFault::WatchdogSleeps) {
            self.tripped = Some(self.last + timeout);
            self.flag = true;
        }
        if let Some(tripped) = self.tripped {
            let each = if self.has(ModioFault::SafeOneByOne) {
                ONE_BY_ONE
            } else {
                Duration::ZERO
            };
            for (n, output) in (0_u16..).zip(&mut self.outputs) {
                let safe = self.edited[&(at::SAFE + OUTPUT + n)];
                if safe != at::HOLD && at >= tripped + each * u32::from(n) {
                    *output = safe == 1;
                }
            }
        }
        let is_heartbeat = pdu.starts_with(&[6, 1, 0x0C]);
        if !(broadcast && self.has(ModioFault::BroadcastsAreNoLife)
            || is_heartbeat && self.has(ModioFault::HeartbeatsAreNoLife))
        {
            self.last = at;
        }
    }

    /// Handles a request with a function code of 80 or above.
    pub fn odd_request(&mut self) {
        if self.has(ModioFault::RestartsByOddFrames) {
            self.start(self.now, false);
        }
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
        let mut pdu = pdu.to_vec();
        if pdu[0] == 0x15 && self.has(ModioFault::EchoesFileWrites) {
            return Ok(pdu[1..].to_vec());
        }
        let file = description().file();
        let mut words: Vec<u16> = file
            .as_chunks()
            .0
            .iter()
            .copied()
            .map(u16::from_be_bytes)
            .collect();
        if self.has(ModioFault::ReadsBeyondTheFile) {
            words.push(0);
        }
        if self.has(ModioFault::RefusesLongestGroup) && pdu.get(7..9) == Some(&[0, 124]) {
            return Err(3);
        }
        if self.has(ModioFault::RepeatsFirstGroup) && pdu.len() > 9 {
            let (first, others) = pdu[2..].split_at_mut(7);
            others
                .chunks_exact_mut(7)
                .for_each(|group| group[3..5].copy_from_slice(&first[3..5]));
        }
        let mut device = Device {
            files: vec![words, Vec::new(), vec![0; log::END.into()]],
            read_only_from: 0,
            ..Device::new(0, 0)
        };
        let reply = modbus_reference::answer(&mut device, &pdu)?;
        Ok(reply[1..].to_vec())
    }

    fn points(&mut self, pdu: &[u8], counters: &[u16; 9]) -> Answer {
        let points = [&[false; FIRST as usize][..], &INPUTS, &self.outputs].concat();
        let words = (0..END).map(|address| self.value(address, counters));
        let words: Vec<u16> = words.collect();
        let mut device = Device {
            bits: points.clone(),
            input_bits: points,
            words: words.clone(),
            input_words: words,
            max_word: u16::MAX,
            ..Device::new(0, 0)
        };
        if self.has(ModioFault::InputsBy02Only) {
            device.bits[usize::from(FIRST)..usize::from(OUTPUT)].fill(false);
        }
        if self.has(ModioFault::HidesFrom04) {
            device.input_words[usize::from(at::BAUD)] = 0;
        }
        let reply = modbus_reference::answer(&mut device, pdu)?;
        let word = |at: usize| u16::from_be_bytes([pdu[at], pdu[at + 1]]);
        let (start, count) = match pdu[0] {
            5 | 6 | 0x16 => (word(1), 1),
            0x17 => (word(5), word(7)),
            _ => (word(1), word(3)),
        };
        let written = usize::from(start)..usize::from(start) + usize::from(count);
        match pdu[0] {
            1 | 2 if start < FIRST => return Err(2),
            1 | 2 => {}
            3 | 4 => can_read(start, count)?,
            5 | 0x0F => self.write_bits(start, &device.bits[written])?,
            0x17 => {
                can_read(word(1), word(3))?;
                self.write(start, &device.words[written])?;
                return self.points(&[&[3], &pdu[1..5]].concat(), counters);
            }
            _ => self.write(start, &device.words[written])?,
        }
        Ok(reply[1..].to_vec())
    }

    fn value(&self, address: u16, counters: &[u16; 9]) -> u16 {
        const SLOT_MODULE: u16 = state::MODULE_IN_FORCE + 4;
        let open = self.now < self.open_until;
        let uptime = (self.now - self.booted).as_secs() as u32;
        match address {
            at::KEY => u16::from(open),
            at::COMMAND if self.has(ModioFault::CommandReadsBack) => self.last_command,
            at::COMMAND => 0,
            0x0200 => (state::PRODUCT >> 16) as u16,
            0x0201 => state::PRODUCT as u16,
            state::UNIT_ADDRESS => UNIT.into(),
            state::RESET_CAUSE => self.cause,
            0x0208 => (uptime >> 16) as u16,
            0x0209 => uptime as u16,
            state::STATUS => {
                let flags = [
                    (state::status::COMM_WATCHDOG, self.flag),
                    (state::status::UNSAVED, self.edited != self.saved),
                    (state::status::UNLOCKED, open),
                ];
                flags.iter().map(|(bit, set)| bit * u16::from(*set)).sum()
            }
            SLOT_MODULE => MODULE.code(),
            state::BUILD => state::build::NO_LOADER,
            state::DESCRIPTION_CRC if self.has(ModioFault::StaleDescriptionCrc) => 0x1234,
            state::DESCRIPTION_CRC => checksum(&description().encode()),
            state::BUS_MESSAGES..state::T15_GAPS => {
                let lag = u16::from(self.has(ModioFault::RegistersLag));
                counters[usize::from(address - state::BUS_MESSAGES)].wrapping_sub(lag)
            }
            _ => self.edited.get(&address).copied().unwrap_or(0),
        }
    }

    fn write_bits(&mut self, start: u16, bits: &[bool]) -> Result<(), u8> {
        let inputs = FIRST..OUTPUT;
        if inputs.contains(&start) && self.has(ModioFault::EchoesInputs) {
            return Ok(());
        }
        let from = usize::from(start.checked_sub(OUTPUT).ok_or(2)?);
        let outputs = self.outputs.get_mut(from..from + bits.len()).ok_or(2)?;
        outputs.copy_from_slice(bits);
        self.tripped = None;
        Ok(())
    }

    fn write(&mut self, start: u16, words: &[u16]) -> Result<(), u8> {
        let count = words.len() as u16;
        if runs(counters::RULES, start, count).is_some() {
            let whole = start.is_multiple_of(2) && count.is_multiple_of(2);
            let zero = words.iter().all(|word| *word == 0);
            let right = whole || self.has(ModioFault::ClearsHalfCounters);
            return if right && zero { Ok(()) } else { Err(3) };
        }
        let echoes = self.has(ModioFault::EchoesStateWrites);
        if echoes && runs(state::RULES, start, count).is_some() {
            return Ok(());
        }
        runs(at::RULES, start, count).ok_or(2)?;
        if (start, count) == (at::HEARTBEAT, 1) && !self.has(ModioFault::LocksHeartbeat) {
            return Ok(());
        }
        let locked = self.now >= self.open_until && (start, count) != (at::KEY, 1);
        let locked = locked && !self.has(ModioFault::NoLock);
        if locked && self.has(ModioFault::LockFirst) {
            return Err(6);
        }
        for (address, value) in (start..).zip(words) {
            if !self.allows(address, *value) {
                return Err(3);
            }
            if self.has(ModioFault::WritesUpToTheBadOne) && !locked {
                self.edited.insert(address, *value);
            }
        }
        let pair = |address: u16| {
            let new = usize::from(address.wrapping_sub(start));
            words.get(new).copied().unwrap_or(self.edited[&address])
        };
        let mode = Mode::from_code(pair(at::MODE)).unwrap_or(Mode::Rtu);
        let format = Format::from_code(pair(at::FORMAT));
        if format.is_some_and(|format| !format.suits(mode)) {
            return Err(3);
        }
        while self.saves_left < at::SAVES && self.now >= self.save_added + SAVE_EVERY {
            self.saves_left += 1;
            self.save_added += SAVE_EVERY;
        }
        let order = words.get(usize::from(at::COMMAND.wrapping_sub(start)));
        let saves = order == Some(&Command::Save.code()) && self.edited != self.saved;
        if locked || saves && self.saves_left == 0 {
            return Err(6);
        }
        if saves {
            self.saves_left -= 1;
        }
        self.open_until = self.now + OPEN;
        for (address, value) in (start..).zip(words) {
            match address {
                at::KEY | at::HEARTBEAT => {}
                at::COMMAND => self.command(*value),
                _ => drop(self.edited.insert(address, *value)),
            }
        }
        Ok(())
    }

    fn allows(&self, address: u16, value: u16) -> bool {
        if address == at::KEY && self.has(ModioFault::AnyKey)
            || address == at::BAUD && self.has(ModioFault::AnyBaud)
        {
            return true;
        }
        // Ports 1 to 8; only port 5 has a slot.
        if (at::MODULE..at::MODULE + 8).contains(&address) && address != at::module_of(5) {
            return value == 0;
        }
        let kind = match at::point_of(address) {
            Some(point) if (OUTPUT..OUTPUT + 2).contains(&point) => Kind::BitOutput,
            Some(point) if (FIRST..OUTPUT).contains(&point) => Kind::BitInput,
            _ => Kind::None,
        };
        rule_at(at::RULES, address).is_some_and(|(rule, _)| rule.values_for(kind).allow(value))
    }

    fn command(&mut self, code: u16) {
        self.last_command = code;
        match Command::from_code(code) {
            Some(Command::Save) => self.saved.clone_from(&self.edited),
            Some(Command::Restart) => self.restart = true,
            Some(Command::DropChanges) => self.edited.clone_from(&self.saved),
            Some(Command::ClearWatchdogFlag) => self.flag = false,
            _ => {}
        }
    }
}

/// The self-description of the unit.
fn description() -> Description {
    describe(&MODIO_02, "0.1.0", |_| MODULE)
}

/// Checks that these registers are in one block.
fn can_read(start: u16, count: u16) -> Result<(), u8> {
    let blocks = BLOCKS.iter().skip(1);
    let mut found = blocks.filter_map(|block| runs(block.rules, start, count));
    found.next().map(|_| ()).ok_or(2)
}
