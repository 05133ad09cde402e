//! A line for the tests of the plan: it counts the time of frames and silences, and loses frames.

use std::time::Duration;

use modbus_line::{Format, LineFormat, t35};
use register_map::codes::Command;
use register_map::update::BLOCK_BYTES;

use super::model::Model;
use crate::update::{Campaign, Patience, Step, messages};

/// Time for which the master waits for an answer as usual, three times.
const USUAL: Duration = Duration::from_secs(1);
/// What it adds to the time of the longest answer with little patience.
const LITTLE: Duration = Duration::from_millis(100);

/// A line with units.
pub struct Bus {
    pub units: Vec<Model>,
    pub baud: u32,
    /// Wrong bits of a million: the same ones for all units, and ones of each unit.
    pub errors: [f64; 2],
    /// Broadcasts are not passed on, as by some gateways.
    pub drops_broadcasts: bool,
    /// The adapter joins blocks with a shorter pause between them, so that most are lost.
    pub joins: Duration,
    /// The answer to the first order of this kind is lost.
    pub loses: Option<Command>,
    /// Number of writes of a register that a gateway answers with exception 06, before it passes them on.
    pub busy: u8,
    pub random: fastrand::Rng,
    pub now: Duration,
    /// Time from the first block until the last one has been sent.
    blocks: Option<(Duration, Duration)>,
    /// Beginning of the last block.
    last: Duration,
}

impl Bus {
    pub fn new(baud: u32, units: u8) -> Self {
        Self {
            units: (1..=units).map(Model::new).collect(),
            baud,
            errors: [0.0; 2],
            drops_broadcasts: false,
            joins: Duration::ZERO,
            loses: None,
            busy: 0,
            random: fastrand::Rng::with_seed(1),
            now: Duration::from_secs(1),
            blocks: None,
            last: Duration::ZERO,
        }
    }

    fn line(&self) -> LineFormat {
        LineFormat::new(self.baud, Format::default())
    }

    /// Spends the time of a PDU in a frame, and the silence after it.
    fn frame(&mut self, pdu: usize) {
        let line = self.line();
        self.now += line.characters(pdu + 3) + t35(self.baud, line.format.bits());
    }

    fn is_lost(&mut self, pdu: usize, errors: f64) -> bool {
        let bits = (pdu as f64 + 3.0) * f64::from(self.line().format.bits());
        self.random.f64() > (1.0 - errors / 1e6).powf(bits)
    }

    /// Sends a request. Returns the answer.
    fn send(&mut self, unit: u8, pdu: &[u8]) -> Option<Vec<u8>> {
        self.frame(pdu.len());
        let [all, own] = self.errors;
        if self.is_lost(pdu.len(), all) || (unit == 0 && self.drops_broadcasts) {
            return None;
        }
        if pdu[0] == 6 && self.busy > 0 {
            self.busy -= 1;
            return Some(vec![0x86, 6]);
        }
        let mut answer = None;
        for index in 0..self.units.len() {
            if !self.is_lost(pdu.len(), own) {
                let now = self.now;
                let answered = self.units[index].take(unit, pdu, now);
                answer = answer.or(answered);
            }
        }
        let answer = answer?;
        if self
            .loses
            .is_some_and(|command| pdu == messages::order(command.code()))
        {
            self.loses = None;
            return None;
        }
        self.frame(answer.len());
        let lost = self.is_lost(answer.len(), all) || self.is_lost(answer.len(), own);
        (!lost).then_some(answer)
    }

    /// Carries out one step of the plan. Returns false at its end.
    pub fn step(&mut self, campaign: &mut Campaign) -> bool {
        let (sent, _) = campaign.blocks();
        let Some(step) = campaign.next_step() else {
            return false;
        };
        let begins = self.now;
        let answer = match step {
            Step::Wait(time) => {
                self.now += time;
                None
            }
            Step::Probe(pdu) => self.send(0, &pdu),
            Step::Broadcast { pdu, apart, pause } => {
                self.now = (self.now + pause).max(self.last + apart);
                self.last = self.now;
                if pause < self.joins && self.random.bool() {
                    self.frame(pdu.len());
                    None
                } else {
                    self.send(0, &pdu)
                }
            }
            Step::Ask {
                unit,
                pdu,
                patience,
            } => {
                let (time, times) = match patience {
                    Patience::Little => (LITTLE + self.line().characters(80), 1),
                    Patience::Usual => (USUAL, 3),
                };
                let mut answer = None;
                for _ in 0..times {
                    answer = self.send(unit, &pdu);
                    if answer.is_some() {
                        break;
                    }
                    self.now += time;
                }
                answer
            }
        };
        if campaign.blocks().0 > sent {
            let (first, _) = self.blocks.unwrap_or((begins, begins));
            self.blocks = Some((first, self.now));
        }
        campaign.take_answer(answer.as_deref());
        true
    }

    /// Carries out the plan to its end.
    pub fn run(&mut self, campaign: &mut Campaign) {
        for _ in 0..1_000_000 {
            if !self.step(campaign) {
                return;
            }
        }
        panic!("no end: {:?}", campaign.units());
    }

    /// Returns the time of the blocks, as a multiple of the time that the bytes of the image take on the line.
    pub fn ratio(&self, blocks: usize) -> f64 {
        let (first, last) = self.blocks.unwrap();
        let image = self.line().characters(blocks * BLOCK_BYTES);
        (last - first).as_secs_f64() / image.as_secs_f64()
    }
}
