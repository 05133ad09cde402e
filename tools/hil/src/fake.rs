//! Fake units on a line in virtual time: the part of a modio that the bench uses, with faults that a test can choose.

use std::collections::BTreeMap;
use std::time::Duration;

use modbus_line::{LineFormat, Parity};
use register_map::board::MODIO_02;
use register_map::configuration::{BAUD, COMMAND, FORMAT, KEY};
use register_map::{Module, counters, points, state};

use conformance::endpoint::{Abilities, Broken, Endpoint, Piece, Received};
use conformance::frame::Mode;

pub(super) struct Unit {
    pub address: u8,
    /// Rate and format in force.
    pub line: LineFormat,
    /// What a restart puts into force.
    pub stored: [u16; 2],
    pub registers: BTreeMap<u16, u16>,
    pub bits: [bool; 32],
    pub saves: u32,
}

impl Unit {
    pub fn new(address: u8, line: LineFormat) -> Self {
        let now = [(line.baud / 100) as u16, 0];
        let module = state::MODULE_IN_FORCE + MODIO_02.first_port - 1;
        Self {
            address,
            line,
            stored: now,
            registers: BTreeMap::from([
                (state::PRODUCT_CODE, (state::PRODUCT >> 16) as u16),
                (state::PRODUCT_CODE + 1, state::PRODUCT as u16),
                (state::BOARD, MODIO_02.code),
                (module, Module::Do4.code()),
                (BAUD, now[0]),
                (FORMAT, now[1]),
            ]),
            bits: [false; 32],
            saves: 0,
        }
    }

    fn answer(&mut self, pdu: &[u8]) -> Vec<u8> {
        let word = |at: usize| {
            pdu.get(at..at + 2)
                .map_or(0, |b| u16::from_be_bytes([b[0], b[1]]))
        };
        let (address, value) = (word(1), word(3));
        let exception = |code| vec![pdu[0] | 0x80, code];
        match pdu[0] {
            1 | 2 if address < 32 => vec![pdu[0], 1, u8::from(self.bits[usize::from(address)])],
            3 | 4 => {
                let word = |at| self.registers.get(&at).unwrap_or(&0).to_be_bytes();
                let data: Vec<u8> = (address..address + value).flat_map(word).collect();
                [vec![pdu[0], data.len() as u8], data].concat()
            }
            5 if address < 32 => {
                self.bits[usize::from(address)] = value == 0xFF00;
                pdu.to_vec()
            }
            6 if address == KEY => pdu.to_vec(),
            6 if address == COMMAND => {
                match value {
                    1 => {
                        self.stored = [self.registers[&BAUD], self.registers[&FORMAT]];
                        self.saves += 1;
                    }
                    2 => {
                        self.line.baud = u32::from(self.stored[0]) * 100;
                        (self.line.format.parity, self.line.format.stop_bits) = match self.stored[1]
                        {
                            1 => (Parity::Even, 1),
                            _ => (Parity::None, 2),
                        };
                    }
                    _ => {}
                }
                pdu.to_vec()
            }
            6 if address < points::COUNT => {
                self.registers.insert(address, value);
                pdu.to_vec()
            }
            8 => pdu.to_vec(),
            0x10 if address == BAUD => {
                self.registers.insert(BAUD, word(6));
                self.registers.insert(FORMAT, word(8));
                pdu[..5].to_vec()
            }
            1 | 2 | 5 | 6 => exception(2),
            _ => exception(1),
        }
    }
}

/// What happens to a request and its reply.
pub(super) enum Fate {
    Good,
    /// The unit does not receive it.
    Lost,
    /// The unit sends the reply to another request.
    Stale,
}

type Watch = Box<dyn FnMut(&[u8], &LineFormat) -> Fate>;

pub(super) struct Line {
    now: Duration,
    line: LineFormat,
    pub units: Vec<Unit>,
    /// Inputs that follow outputs: unit and point of both.
    pub wires: Vec<[(u8, u16); 2]>,
    /// Analog inputs that follow analog outputs: unit and point of both, and the input's error.
    pub analog: Vec<([(u8, u16); 2], u16)>,
    /// Number that the pulse counters count for each rising edge.
    pub counts: u16,
    /// Decides what happens to each frame that is sent.
    pub watch: Watch,
    /// A rate that the endpoint does not support.
    pub lacks: Option<u32>,
    reply: Vec<Received>,
}

/// Time from the end of a request to the reply.
pub(super) const TURNAROUND: Duration = Duration::from_micros(4100);

impl Line {
    pub fn new(units: &[u8]) -> Self {
        let line = LineFormat::default();
        Self {
            now: Duration::ZERO,
            line,
            units: units.iter().map(|unit| Unit::new(*unit, line)).collect(),
            wires: Vec::new(),
            analog: Vec::new(),
            counts: 1,
            watch: Box::new(|_, _| Fate::Good),
            lacks: None,
            reply: Vec::new(),
        }
    }

    fn unit(&mut self, address: u8) -> &mut Unit {
        let mut units = self.units.iter_mut();
        units.find(|unit| unit.address == address).unwrap()
    }

    /// Sets inputs to the values of their outputs.
    fn carry(&mut self) {
        for [(unit, output), (other, input)] in self.wires.clone() {
            let level = self.unit(unit).bits[usize::from(output)];
            let counts = self.counts;
            let other = self.unit(other);
            let before = std::mem::replace(&mut other.bits[usize::from(input)], level);
            if level && !before {
                let low = counters::of_point(input) + 1;
                *other.registers.entry(low).or_default() += counts;
            }
        }
        for ([(unit, output), (other, input)], error) in self.analog.clone() {
            let value = self.unit(unit).registers.get(&output).copied();
            let value = value.unwrap_or_default().saturating_add(error);
            self.unit(other).registers.insert(input, value);
        }
    }

    fn receive_request(&mut self, frame: &[u8]) {
        let fate = (self.watch)(frame, &self.line);
        let Ok((address, pdu)) = Mode::Rtu.decode(frame) else {
            return;
        };
        let line = self.line;
        let mut units = self.units.iter_mut();
        let unit = units.find(|unit| unit.address == address && unit.line == line);
        let (Some(unit), false) = (unit, matches!(fate, Fate::Lost)) else {
            return;
        };
        let mut reply = unit.answer(&pdu);
        if matches!(fate, Fate::Stale) {
            *reply.last_mut().unwrap() ^= 1;
        }
        self.carry();
        let mut start = self.now + TURNAROUND;
        for byte in Mode::Rtu.frame(address, &reply) {
            let end = start + line.characters(1);
            let good = true;
            self.reply.push(Received {
                byte,
                start,
                end,
                good,
            });
            start = end;
        }
    }
}

impl Endpoint for Line {
    fn name(&self) -> String {
        "a fake".to_owned()
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            exact: true,
            set_line: true,
            character_time: true,
            start_bit: true,
            ..Abilities::default()
        }
    }

    fn line(&self) -> LineFormat {
        self.line
    }

    fn set_line(&mut self, line: LineFormat) -> Result<(), Broken> {
        if self.lacks == Some(line.baud) {
            return Err(Broken(format!("a fake does not take {line}")));
        }
        self.line = line;
        Ok(())
    }

    fn now(&self) -> Duration {
        self.now
    }

    fn rest(&mut self, time: Duration) -> Result<(), Broken> {
        self.now += time;
        Ok(())
    }

    fn send(&mut self, pieces: &[Piece]) -> Result<Duration, Broken> {
        for piece in pieces {
            let Piece::Bytes(frame) = piece else {
                continue;
            };
            self.now += self.line.characters(frame.len());
            self.receive_request(frame);
        }
        Ok(self.now)
    }

    fn receive(
        &mut self,
        patience: Duration,
        quiet: Duration,
        _: usize,
    ) -> Result<Vec<Received>, Broken> {
        let last = self.reply.last();
        self.now = last.map_or(self.now + patience, |last| last.end + quiet);
        Ok(std::mem::take(&mut self.reply))
    }
}
