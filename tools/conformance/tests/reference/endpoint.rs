//! A line in virtual time with the reference unit on it.

use std::time::Duration;

use modbus_line::LineFormat;

use conformance::endpoint::{Abilities, Broken, Endpoint, Piece, Received};
use conformance::frame::Mode;

use super::fault::Fault;
use super::modio_fault::ModioFault;
use super::unit::{Character, Unit};

/// Returns what the unit receives of bytes that the master sends on this line; nothing when they are lost.
type Way = Box<dyn FnMut(&[u8], LineFormat) -> Vec<u8>>;

/// Time that the unit needs to start.
const START: Duration = Duration::from_millis(100);

pub struct Reference {
    unit: Unit,
    now: Duration,
    powered: bool,
    starts: Option<Duration>,
    pub way: Way,
    /// A rate that the endpoint does not take.
    pub lacks: Option<u32>,
}

impl Reference {
    pub fn new(fault: Option<Fault>, mode: Mode, line: LineFormat) -> Self {
        Self {
            unit: Unit::new(fault, mode, line),
            now: Duration::from_secs(1),
            powered: true,
            starts: None,
            way: Box::new(|bytes, _| bytes.to_vec()),
            lacks: None,
        }
    }

    /// A modio with this fault.
    pub fn modio(fault: Option<ModioFault>, mode: Mode, line: LineFormat) -> Self {
        Self {
            unit: Unit::modio(fault, mode, line),
            ..Self::new(None, mode, line)
        }
    }

    /// A unit that was switched on this long before it answers.
    pub fn starting_for(mut self, time: Duration) -> Self {
        self.starts = Some(self.now + time);
        self
    }

    /// A unit that counts characters of the line's format for t1.5 and t3.5.
    pub fn counting_own_characters(mut self) -> Self {
        self.unit.own_characters = true;
        self
    }

    /// A unit that is silent to a write whose byte count differs from the number of data bytes.
    pub fn silent_to_incomplete_writes(mut self) -> Self {
        self.unit.silent_to_incomplete_writes = true;
        self
    }

    /// Lets time pass up to `to`, with everything that is due until then.
    fn advance(&mut self, to: Duration) {
        if let Some(at) = self.starts.filter(|at| *at <= to) {
            self.unit.start(at);
            self.starts = None;
        }
        if let Some(at) = self.unit.closes().filter(|at| *at <= to) {
            self.unit.close(at);
        }
        self.now = self.now.max(to);
    }

    fn character(&mut self, character: Character) {
        self.advance(character.start);
        if self.powered && self.starts.is_none() {
            self.unit.receive(character);
        }
        self.now = character.end;
    }
}

impl Endpoint for Reference {
    fn name(&self) -> String {
        "the reference server".to_owned()
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            exact: true,
            faults: true,
            power: true,
            driver: true,
            echo: true,
            character_time: true,
            start_bit: true,
            set_line: self.unit.server.modio.is_some(),
            ..Abilities::default()
        }
    }

    #[expect(clippy::misnamed_getters, reason = "the endpoint is the master's end")]
    fn line(&self) -> LineFormat {
        self.unit.master
    }

    fn set_line(&mut self, line: LineFormat) -> Result<(), Broken> {
        if self.lacks == Some(line.baud) {
            return Err(Broken(format!("this line does not take {line}")));
        }
        self.unit.master = line;
        Ok(())
    }

    fn now(&self) -> Duration {
        self.now
    }

    fn rest(&mut self, time: Duration) -> Result<(), Broken> {
        self.advance(self.now + time);
        Ok(())
    }

    fn send(&mut self, pieces: &[Piece]) -> Result<Duration, Broken> {
        let length = self.unit.master.characters(1);
        let bit = self.unit.master.bits(1);
        for piece in pieces {
            let start = self.now;
            let character = |byte| Character {
                byte,
                start,
                end: start + length,
                parity_error: false,
                stop_error: false,
            };
            match piece {
                Piece::Bytes(bytes) => {
                    for byte in &(self.way)(bytes, self.unit.master) {
                        let start = self.now;
                        let character = Character {
                            start,
                            end: start + length,
                            ..character(*byte)
                        };
                        self.character(character);
                    }
                    self.advance(start + length * bytes.len() as u32);
                }
                Piece::Gap(gap) => self.advance(start + *gap),
                Piece::BadParity(byte) => self.character(Character {
                    parity_error: true,
                    ..character(*byte)
                }),
                Piece::BadStop(byte) => self.character(Character {
                    stop_error: true,
                    ..character(*byte)
                }),
                Piece::Break(bits) => self.character(Character {
                    stop_error: true,
                    end: start + bit * u32::from(*bits + 1),
                    ..character(0)
                }),
                Piece::Glitch(width) => {
                    self.advance(start + *width);
                    self.unit.glitch(self.now);
                }
            }
        }
        Ok(self.now)
    }

    fn receive(
        &mut self,
        patience: Duration,
        quiet: Duration,
        enough: usize,
    ) -> Result<Vec<Received>, Broken> {
        let mut received: Vec<Received> = Vec::new();
        let mut until = self.now + patience;
        while received.len() < enough {
            if let Some(next) = self
                .unit
                .sent
                .front()
                .copied()
                .filter(|next| next.end <= until)
            {
                self.unit.sent.pop_front();
                self.now = self.now.max(next.end);
                until = next.end + quiet;
                received.push(next);
                continue;
            }
            match self.unit.closes().filter(|at| *at <= until) {
                Some(at) => self.advance(at),
                None if self.starts.is_some_and(|at| at <= until) => {
                    let at = self.starts.unwrap_or_default();
                    self.advance(at);
                }
                None => {
                    self.advance(until);
                    break;
                }
            }
        }
        Ok(received)
    }

    fn set_power(&mut self, on: bool) -> Result<(), Broken> {
        self.powered = on;
        self.starts = on.then_some(self.now + START);
        if !on {
            self.unit.sent.clear();
        }
        Ok(())
    }

    fn set_echo(&mut self, echo: bool) -> Result<(), Broken> {
        self.unit.echo = echo;
        Ok(())
    }

    fn take_driver_edges(&mut self) -> Result<Vec<(Duration, bool)>, Broken> {
        Ok(std::mem::take(&mut self.unit.edges))
    }
}
