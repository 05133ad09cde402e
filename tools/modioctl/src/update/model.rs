//! Units and a line for the tests of the plan: each unit has the state that file 2 reports, and the line loses frames.

use std::time::Duration;

use modbus_line::{Format, LineFormat, t35};
use register_map::codes::Command;
use register_map::configuration::{COMMAND, KEY, OPENING_KEY};
use register_map::state::UPDATE;
use register_map::update::{BLOCK_BYTES, Slot, State, block_at};

use super::{Campaign, Patience, Step};

/// Time from the order to start an image until it answers.
const RESTART: Duration = Duration::from_secs(3);
/// Time in which a page is erased, and a block programmed.
const PAGE: Duration = Duration::from_millis(50);
const BLOCK: Duration = Duration::from_millis(5);
/// Time for which the master waits for an answer as usual, three times, and what it adds to the time of the longest
/// answer with little patience.
const USUAL: Duration = Duration::from_secs(1);
const LITTLE: Duration = Duration::from_millis(50);

/// What a unit does wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    None,
    /// It loses its supply when it has received this many blocks.
    RestartsAfter(usize),
    /// It is gone when it has received this many blocks.
    GoneAfter(usize),
    /// It finds a wrong CRC-32 once.
    WrongCrc,
    /// It rejects the image.
    Rejects(register_map::update::Reason),
    /// It answers broadcasts, as devices of some makers do.
    AnswersBroadcasts,
    /// It carries out the order to confirm only the second time.
    ConfirmsLate,
}

/// A unit of a modio-02.
#[derive(Clone, Debug)]
pub struct Model {
    pub address: u8,
    pub runs: Slot,
    pub state: State,
    pub flaw: Flaw,
    /// The running image and the other one, as file 2 reports them.
    pub images: [[u16; 8]; 2],
    pub content: Vec<Option<[u8; BLOCK_BYTES]>>,
    pub trial: bool,
    reason: u16,
    is_open: bool,
    erased_at: Duration,
    /// Blocks of the header that was received.
    blocks: usize,
    /// When each staged block is programmed.
    staged: Vec<(Duration, usize)>,
    silent_until: Duration,
    received: usize,
}

impl Model {
    pub fn new(address: u8) -> Self {
        Self {
            address,
            runs: Slot::A,
            state: State::Empty,
            flaw: Flaw::None,
            images: [[1, 2, 0, 3, 4, 300, 0, 0], [0; 8]],
            content: Vec::new(),
            trial: false,
            reason: 0,
            is_open: false,
            erased_at: Duration::ZERO,
            blocks: 0,
            staged: Vec::new(),
            silent_until: Duration::ZERO,
            received: 0,
        }
    }

    fn lacks(&self, block: usize, now: Duration) -> bool {
        let is_staged = self
            .staged
            .iter()
            .any(|(end, staged)| *staged == block && *end > now);
        self.content.get(block).is_none_or(Option::is_none) || is_staged
    }

    fn record(&self, record: u16, now: Duration) -> u16 {
        let (state, detail) = self.state.code();
        let missing = |block: &usize| self.lacks(*block, now);
        match record {
            0 => state.into(),
            1 => self.reason.max(detail.into()),
            2 => self.blocks as u16,
            3 => (0..self.blocks).filter(missing).count() as u16,
            4 => self.runs as u16 + 1,
            6 => {
                let left = self.erased_at.saturating_sub(now);
                left.as_nanos().div_ceil(PAGE.as_nanos()) as u16
            }
            8..16 => self.images[0][usize::from(record) - 8],
            16..24 => self.images[1][usize::from(record) - 16],
            64.. => {
                let first = usize::from(record - 64) * 16;
                let bits = (0..16).filter(|bit| first + bit < self.blocks);
                let bits = bits.filter(|bit| self.lacks(first + bit, now));
                bits.map(|bit| 1 << bit).sum()
            }
            _ => 0,
        }
    }

    /// Takes a request to this unit or to all. Returns the answer.
    fn take(&mut self, unit: u8, pdu: &[u8], now: Duration) -> Option<Vec<u8>> {
        if now < self.silent_until || (unit != self.address && unit != 0) {
            return None;
        }
        let answer = match pdu[0] {
            0x14 => self.read(pdu, now),
            0x15 => self.write(pdu, now),
            6 => self.order(pdu, now),
            _ => self.registers(pdu),
        };
        let answer = answer.unwrap_or_else(|code| vec![pdu[0] | 0x80, code]);
        (unit != 0 || self.flaw == Flaw::AnswersBroadcasts).then_some(answer)
    }

    fn read(&self, pdu: &[u8], now: Duration) -> Result<Vec<u8>, u8> {
        let mut answer = vec![0x14, 0];
        for group in pdu[2..].chunks(7) {
            let [first, count] = [3, 5].map(|at| u16::from_be_bytes([group[at], group[at + 1]]));
            answer.extend([1 + 2 * count as u8, 6]);
            let words = (first..first + count).map(|record| self.record(record, now));
            answer.extend(words.flat_map(u16::to_be_bytes));
        }
        answer[1] = answer.len() as u8 - 2;
        assert!(answer.len() <= 253, "{} bytes", answer.len());
        Ok(answer)
    }

    fn write(&mut self, pdu: &[u8], now: Duration) -> Result<Vec<u8>, u8> {
        let [file, record] = [3, 5].map(|at| u16::from_be_bytes([pdu[at], pdu[at + 1]]));
        let (slot, block) = block_at(file, record).ok_or(2)?;
        let block = usize::from(block);
        let bytes: [u8; BLOCK_BYTES] = pdu[9..].try_into().map_err(|_| 3)?;
        self.staged.retain(|(end, _)| *end > now);
        if slot == self.runs {
            return Err(2);
        }
        let knows = block == 0 || self.blocks > 0;
        if self.state != State::Receiving || now < self.erased_at || !knows || self.staged.len() > 1
        {
            return Err(6);
        }
        if block == 0 {
            let length = u32::from_le_bytes(bytes[16..20].try_into().unwrap());
            let blocks = (length as usize + 512).div_ceil(BLOCK_BYTES);
            if self.blocks != blocks {
                self.blocks = blocks;
                self.content = vec![None; blocks];
            }
            let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
            let version = u16::from_be_bytes([bytes[8], bytes[9]]);
            let (commit, key) = ([word(26), word(24)], [0, 0]);
            let (patch, epoch) = (word(10), word(6));
            self.images[1] = [
                version,
                patch,
                epoch,
                commit[0],
                commit[1],
                blocks as u16,
                key[0],
                key[1],
            ];
        }
        let begins = self.staged.last().map_or(now, |(end, _)| *end);
        self.staged.push((begins + BLOCK, block));
        *self.content.get_mut(block).ok_or(2)? = Some(bytes);
        self.received += 1;
        match self.flaw {
            Flaw::RestartsAfter(blocks) if self.received == blocks => {
                self.silent_until = now + Duration::from_millis(100);
                self.state = State::Empty;
                self.blocks = 0;
            }
            Flaw::GoneAfter(blocks) if self.received == blocks => {
                self.silent_until = Duration::MAX;
            }
            _ => {}
        }
        Ok(pdu.to_vec())
    }

    fn order(&mut self, pdu: &[u8], now: Duration) -> Result<Vec<u8>, u8> {
        let [address, word] = [1, 3].map(|at| u16::from_be_bytes([pdu[at], pdu[at + 1]]));
        if address == KEY {
            self.is_open = word == OPENING_KEY;
            return Ok(pdu.to_vec());
        }
        assert_eq!(address, COMMAND);
        let is_whole = self.blocks > 0 && self.content.iter().all(Option::is_some);
        match Command::from_code(word).unwrap() {
            _ if !self.is_open => return Err(6),
            Command::Prepare if !self.trial => {
                self.state = State::Receiving;
                self.erased_at = now + 54 * PAGE;
                self.blocks = 0;
                self.content.clear();
                self.reason = 0;
            }
            Command::Finish if self.state == State::Receiving && is_whole => match self.flaw {
                Flaw::WrongCrc => {
                    self.flaw = Flaw::None;
                    self.reason = 6;
                    self.content.fill(None);
                }
                Flaw::Rejects(reason) => {
                    self.silent_until = now + RESTART;
                    self.state = State::Rejected(reason);
                }
                _ => self.switch(now),
            },
            Command::GoBack if self.state == State::Confirmed => self.switch(now),
            Command::Confirm if self.flaw == Flaw::ConfirmsLate => self.flaw = Flaw::None,
            Command::Confirm => self.trial = false,
            _ => return Err(6),
        }
        Ok(pdu.to_vec())
    }

    /// Starts the image in the other slot, on trial.
    fn switch(&mut self, now: Duration) {
        self.silent_until = now + RESTART;
        self.runs = self.runs.other();
        self.images.swap(0, 1);
        self.state = State::Confirmed;
        self.trial = true;
        self.is_open = false;
    }

    fn registers(&self, pdu: &[u8]) -> Result<Vec<u8>, u8> {
        let first = u16::from_be_bytes([pdu[1], pdu[2]]);
        let words = if first == UPDATE {
            vec![(self.runs as u16 + 1) | u16::from(self.trial) << 5]
        } else {
            let [version, patch, _, high, low, ..] = self.images[0];
            let mut words = vec![version, patch];
            words.resize(10, 0);
            words.extend([high, low]);
            words
        };
        let mut answer = vec![3, 2 * words.len() as u8];
        answer.extend(words.into_iter().flat_map(u16::to_be_bytes));
        Ok(answer)
    }
}

/// A line with units.
pub struct Bus {
    pub units: Vec<Model>,
    pub baud: u32,
    /// Wrong bits of a million: the same ones for all units, and ones of each unit.
    pub errors: [f64; 2],
    /// Broadcasts are not passed on, as by some gateways.
    pub drops_broadcasts: bool,
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
        let mut answer = None;
        for index in 0..self.units.len() {
            if !self.is_lost(pdu.len(), own) {
                let now = self.now;
                let answered = self.units[index].take(unit, pdu, now);
                answer = answer.or(answered);
            }
        }
        let answer = answer?;
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
            Step::Broadcast { pdu, apart } => {
                self.now = self.now.max(self.last + apart);
                self.last = self.now;
                self.send(0, &pdu)
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
        campaign.heard(answer.as_deref());
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
