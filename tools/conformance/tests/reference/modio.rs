//! A modio with a fault. Around the modio of the reference, which is right, this changes requests, replies and state. The
//! module in its slot is a 2Relay: two inputs, which are the relays' modes, and two outputs, the relays.

use std::ops::Range;
use std::time::Duration;

use modbus_line::LineFormat;
use modbus_reference::Modio as Reference;
use register_map::board::{MODIO_02, MODIO_08};
use register_map::codes::{Baud, Format};
use register_map::{Module, configuration as at, counters, points, runs, state};

use super::modio_fault::ModioFault;
use super::server::{set, word};

type Answer = Result<Vec<u8>, u8>;

/// The unit's address: that of most worked frames.
pub const UNIT: u8 = 1;

/// The inputs are the points of port 5 in front of its outputs.
const INPUTS: Range<u16> = FIRST..FIRST + 2;
const FIRST: u16 = points::first(5);
const SECOND_OUTPUT: usize = FIRST as usize + 3;

/// Time between two outputs that are set to SAFE, with [`ModioFault::SafeOneByOne`].
const ONE_BY_ONE: Duration = Duration::from_millis(1);

/// A modio with a fault, or without one.
pub struct Modio {
    fault: Option<ModioFault>,
    modio: Reference,
    last_command: u16,
}

impl Modio {
    pub fn new(fault: Option<ModioFault>) -> Self {
        let board = if fault == Some(ModioFault::TimesWithoutEffect) {
            &MODIO_08
        } else {
            &MODIO_02
        };
        let mut modio = Reference::new(board, |_| Module::Relay2);
        modio.bits[usize::from(INPUTS.start)] = true;
        Self {
            fault,
            modio,
            last_command: 0,
        }
    }

    pub fn has(&self, fault: ModioFault) -> bool {
        self.fault == Some(fault)
    }

    /// Starts the unit. Returns the rate and format in force.
    pub fn start(&mut self, at: Duration, power_on: bool) -> LineFormat {
        let bits = self.modio.bits;
        self.modio.start(at, power_on);
        if self.has(ModioFault::KeepsOutputs) {
            self.modio.bits = bits;
        }
        let mut baud = u32::from(self.modio.saved[&at::BAUD]) * 100;
        if baud == Baud::B230400.bits_per_second() && self.has(ModioFault::LacksARate) {
            baud = Baud::B115200.bits_per_second();
        }
        let mut format = Format::from_code(self.modio.saved[&at::FORMAT]).unwrap_or(Format::F8N2);
        if format == Format::F8O1 && self.has(ModioFault::OddIsEven) {
            format = Format::F8E1;
        }
        let name = Format::NAMES[usize::from(format.code())].1;
        LineFormat::new(baud, name.parse().unwrap())
    }

    /// Restarts the unit if a command was to do so. Returns the rate and format in force.
    pub fn restart(&mut self, at: Duration) -> Option<LineFormat> {
        self.modio.restart.then(|| self.start(at, false))
    }

    /// Silence before a reply, in addition to t3.5.
    pub fn response_delay(&self) -> Duration {
        if self.has(ModioFault::RepliesUndelayed) {
            return Duration::ZERO;
        }
        Duration::from_millis(self.modio.edited[&at::RESPONSE_DELAY].into())
    }

    /// Notes a valid request for this unit, or a broadcast, at this instant.
    pub fn request(&mut self, at: Duration, broadcast: bool, pdu: &[u8]) {
        if self.has(ModioFault::WatchdogSleeps) {
            self.modio.now = at;
        } else {
            let before = self.modio.bits[SECOND_OUTPUT];
            self.modio.watch(at);
            let tripped = self.modio.tripped;
            let now = tripped.is_some_and(|tripped| at < tripped + ONE_BY_ONE);
            if now && self.has(ModioFault::SafeOneByOne) {
                self.modio.bits[SECOND_OUTPUT] = before;
            }
        }
        let is_heartbeat = pdu[0] == 6 && word(pdu, 1) == at::HEARTBEAT;
        if !(broadcast && self.has(ModioFault::BroadcastsAreNoLife)
            || is_heartbeat && self.has(ModioFault::HeartbeatsAreNoLife))
        {
            self.modio.note_request();
        }
    }

    /// Notes at this instant a frame that is not for this unit: with this fault it counts as a request.
    pub fn other_frame(&mut self, at: Duration, fault: ModioFault) {
        if self.has(fault) {
            self.modio.watch(at);
            self.modio.note_request();
        }
    }

    /// Handles a request with a function code of 80 or above.
    pub fn odd_request(&mut self) {
        if self.has(ModioFault::RestartsByOddFrames) {
            self.start(self.modio.now, false);
        }
    }

    /// Serves a PDU; `None` when the function is not about points, registers or files.
    pub fn answer(&mut self, pdu: &[u8], counters: &[u16; 9]) -> Option<Answer> {
        let mut request = pdu.to_vec();
        let mut counters = *counters;
        let address = word(pdu, 1);
        let open_until = self.modio.open_until;
        match (self.fault, pdu[0]) {
            (Some(ModioFault::EchoesFileWrites), 0x15) => return Some(Ok(request)),
            (Some(ModioFault::RefusesLongestGroup), 0x14) if word(pdu, 7) == 124 => {
                return Some(Err(3));
            }
            (Some(ModioFault::RepeatsFirstGroup), 0x14) if pdu.len() > 9 => {
                let (first, others) = request[2..].split_at_mut(7);
                let others = others.chunks_exact_mut(7);
                others.for_each(|group| group[3..5].copy_from_slice(&first[3..5]));
            }
            (Some(ModioFault::RegistersLag), _) => {
                counters = counters.map(|counter| counter.wrapping_sub(1));
            }
            (Some(ModioFault::AnyKey), 6) if address == at::KEY => {
                set(&mut request, 3, at::OPENING_KEY);
            }
            (Some(ModioFault::AnyBaud), 6) if address == at::BAUD => set(&mut request, 3, 96),
            (Some(ModioFault::AnyBaud), 0x10) if address == at::BAUD => set(&mut request, 6, 96),
            (Some(ModioFault::LocksHeartbeat), 6)
                if address == at::HEARTBEAT && !self.modio.is_open() =>
            {
                return Some(Err(6));
            }
            (Some(ModioFault::NoLock), 5..) => self.modio.open_until = Duration::MAX,
            _ => {}
        }
        let answer = self.modio.answer(&request, &counters)?;
        if self.modio.open_until == Duration::MAX {
            self.modio.open_until = open_until;
        }
        if pdu[0] == 6 && address == at::COMMAND && answer.is_ok() {
            self.last_command = word(pdu, 3);
        }
        Some(self.spoil(pdu, answer))
    }

    /// Returns the answer of the fault, from the right one.
    fn spoil(&mut self, pdu: &[u8], answer: Answer) -> Answer {
        let Some(fault) = self.fault else {
            return answer;
        };
        let address = word(pdu, 1);
        let count = if pdu[0] == 6 { 1 } else { word(pdu, 3) };
        let data = pdu.get(if pdu[0] == 6 { 3 } else { 6 }..).unwrap_or(&[]);
        let echo = || Ok(pdu[..5].to_vec());
        match (fault, pdu[0], answer) {
            (ModioFault::InputsBy02Only, 1, Ok(mut reply)) => {
                for input in INPUTS {
                    if let Some(at) = input.checked_sub(address).filter(|at| *at < count) {
                        reply[2 + usize::from(at) / 8] &= !(1 << (at % 8));
                    }
                }
                Ok(reply)
            }
            (ModioFault::HidesFrom04, 4, Ok(reply)) => Ok(with(reply, address, at::BAUD, 0)),
            (ModioFault::StaleDescriptionCrc, 3 | 4, Ok(reply)) => {
                Ok(with(reply, address, state::DESCRIPTION_CRC, 0x1234))
            }
            (ModioFault::CommandReadsBack, 3 | 4, Ok(reply)) => {
                Ok(with(reply, address, at::COMMAND, self.last_command))
            }
            (ModioFault::ReadsBeyondTheFile, 0x14, Err(2)) => {
                let words = vec![0; 2 * usize::from(word(pdu, 7))];
                let length = words.len() as u8;
                Ok([&[0x14, length + 2, length + 1, 6], &words[..]].concat())
            }
            (ModioFault::EchoesInputs, 5 | 0x0F, Err(2)) if INPUTS.contains(&address) => echo(),
            (ModioFault::EchoesStateWrites, 6 | 0x10, Err(2))
                if runs(state::RULES, address, count).is_some() =>
            {
                echo()
            }
            (ModioFault::ClearsHalfCounters, 6 | 0x10, Err(3))
                if runs(counters::RULES, address, count).is_some()
                    && data.iter().all(|byte| *byte == 0) =>
            {
                echo()
            }
            (ModioFault::AnyKey, 6, Ok(_)) => echo(),
            (ModioFault::AnyBaud, 6 | 0x10, Ok(_)) if address == at::BAUD => {
                self.modio.edited.insert(at::BAUD, word(data, 0));
                echo()
            }
            (ModioFault::LockFirst, 6 | 0x10, Err(3)) if !self.modio.is_open() => Err(6),
            (ModioFault::WritesUpToTheBadOne, 0x10, Err(3)) if self.modio.is_open() => {
                for (address, pair) in (address..).zip(data.chunks_exact(2)) {
                    let value = word(pair, 0);
                    if !self.modio.allows(address, value) {
                        break;
                    }
                    self.modio.edited.insert(address, value);
                }
                Err(3)
            }
            (_, _, answer) => answer,
        }
    }
}

/// Returns the reply to a read of registers from `start` on, with another value of one register.
fn with(mut reply: Vec<u8>, start: u16, register: u16, value: u16) -> Vec<u8> {
    if let Some(at) = register.checked_sub(start) {
        set(&mut reply, 2 + 2 * usize::from(at), value);
    }
    reply
}
