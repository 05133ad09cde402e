//! A unit for tests: it has the state that file 2 reports. The program's tests include this file, too.

use std::time::Duration;

use modbus_reference::Modio;
use register_map::Module;
use register_map::board::MODIO_02;
use register_map::codes::Command;
use register_map::configuration::COMMAND;
use register_map::state::{BUILD, COMMIT, FIRMWARE_PATCH, FIRMWARE_VERSION, STATUS, UPDATE, build};
use register_map::update::{BLOCK_BYTES, Header, Reason, Slot, State, block_at};

/// Time in which a block is programmed.
const BLOCK: Duration = Duration::from_millis(5);
/// Pages of a slot.
const PAGES: u32 = 54;

/// What a unit does wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    None,
    /// It loses its supply when it has received this many blocks.
    RestartsAfter(usize),
    /// It is gone when it has received this many blocks.
    GoneAfter(usize),
    /// It does not answer for 9 s when it has received this many blocks.
    AwayAfter(usize),
    /// It finds a wrong CRC-32 once.
    WrongCrc,
    /// Another program has updated it when it has received this many blocks.
    UpdatedAfter(usize),
    /// The confirmed image in its other slot has aged: its CRC-32 is wrong.
    Rotten,
    /// It rejects the image.
    Rejects(Reason),
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
    /// CRC-32 of both images.
    pub crcs: [u32; 2],
    /// Numbers of the loader's keys. Zeros as in a unit that does not report them: the loader takes every key.
    pub keys: [u32; 2],
    /// The first key is revoked.
    pub revoked: bool,
    /// The loader accepts a development key.
    pub development: bool,
    /// Lowest security epoch that it accepts.
    pub floor: u16,
    /// Time in which a page is erased.
    pub page: Duration,
    /// Time from the order to start an image until it answers.
    pub restart: Duration,
    /// The orders that it was given, but for those that it refused because its lock was closed.
    pub orders: Vec<Command>,
    /// Register STATUS.
    pub status: u16,
    /// Its registers that an update does not change, its points and its lock.
    pub modio: Modio,
    reason: u16,
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
        let mut model = Self {
            address,
            runs: Slot::A,
            state: State::Empty,
            flaw: Flaw::None,
            images: [[1, 2, 0, 3, 4, 300, 0, 0], [0; 8]],
            content: Vec::new(),
            trial: false,
            crcs: [0; 2],
            keys: [0; 2],
            revoked: false,
            development: false,
            floor: 0,
            page: Duration::from_millis(50),
            restart: Duration::from_secs(3),
            orders: Vec::new(),
            status: 0,
            modio: Modio::new(&MODIO_02, |_| Module::Di4),
            reason: 0,
            erased_at: Duration::ZERO,
            blocks: 0,
            staged: Vec::new(),
            silent_until: Duration::ZERO,
            received: 0,
        };
        model.start(Duration::ZERO);
        model
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
            5 => self.floor,
            6 => {
                let left = self.erased_at.saturating_sub(now);
                left.as_nanos().div_ceil(self.page.as_nanos()) as u16
            }
            8..16 => self.images[0][usize::from(record) - 8],
            16..24 => self.images[1][usize::from(record) - 16],
            24..32 => {
                let longs = [self.crcs, self.keys];
                let long = longs.as_flattened()[usize::from(record - 24) / 2];
                (long >> (16 * (1 - record % 2))) as u16
            }
            32 => self.revoked.into(),
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
    pub fn take(&mut self, unit: u8, pdu: &[u8], now: Duration) -> Option<Vec<u8>> {
        if now < self.silent_until || (unit != self.address && unit != 0) {
            return None;
        }
        let answer = match pdu[0] {
            0x14 => self.read(pdu, now),
            0x15 => self.write(pdu, now),
            6 => self.order(pdu, now),
            _ => self.registers(pdu, now),
        };
        let answer = answer.unwrap_or_else(|code| vec![pdu[0] | 0x80, code]);
        (unit != 0 || self.flaw == Flaw::AnswersBroadcasts).then_some(answer)
    }

    /// Returns whether the loader takes the running image, or the other one, by the key that signed it.
    fn takes_key_of(&self, image: usize) -> bool {
        let key = self.key_of(image);
        let [first, second] = self.keys;
        self.keys == [0; 2] || key == second || (key == first && !self.revoked)
    }

    const fn key_of(&self, image: usize) -> u32 {
        let [.., high, low] = self.images[image];
        (high as u32) << 16 | low as u32
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
            let header = Header::beginning(&bytes).ok_or(3)?;
            let length = MODIO_02.layout().slot as usize;
            let blocks = usize::from(header.blocks(length).map_err(|_| 3)?);
            if self.blocks != blocks {
                self.blocks = blocks;
                self.content = vec![None; blocks];
            }
            let [words @ .., _, _] = header.words();
            (self.images[1], self.crcs[1]) = (words, header.crc());
        } else if block == 1 {
            // The number of the key is at byte 156 of the header.
            let (words, _) = bytes[28..32].as_chunks();
            let words: Vec<_> = words.iter().copied().map(u16::from_be_bytes).collect();
            self.images[1][6..].copy_from_slice(&words);
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
            Flaw::AwayAfter(blocks) if self.received == blocks => {
                self.silent_until = now + Duration::from_secs(9);
            }
            Flaw::UpdatedAfter(blocks) if self.received == blocks => {
                self.switch(now);
                self.trial = false;
            }
            _ => {}
        }
        Ok(pdu.to_vec())
    }

    fn order(&mut self, pdu: &[u8], now: Duration) -> Result<Vec<u8>, u8> {
        let [address, word] = [1, 3].map(|at| u16::from_be_bytes([pdu[at], pdu[at + 1]]));
        let answer = self.registers(pdu, now)?;
        if address != COMMAND {
            return Ok(answer);
        }
        let is_whole = self.blocks > 0 && self.content.iter().all(Option::is_some);
        let may_finish = match self.state {
            State::Receiving => is_whole,
            State::Rejected(Reason::Interrupted | Reason::NotConfirmed) => true,
            _ => false,
        };
        let command = Command::from_code(word).unwrap();
        self.orders.push(command);
        match command {
            Command::Prepare if !self.trial => {
                self.state = State::Receiving;
                self.erased_at = now + PAGES * self.page;
                self.blocks = 0;
                self.content.clear();
                self.reason = 0;
            }
            Command::Finish if may_finish => match self.flaw {
                Flaw::WrongCrc => {
                    self.flaw = Flaw::None;
                    self.reason = 6;
                    self.content.fill(None);
                }
                Flaw::Rejects(reason) => {
                    self.silent_until = now + self.restart;
                    self.state = State::Rejected(reason);
                }
                _ if !self.takes_key_of(1) => {
                    self.silent_until = now + self.restart;
                    self.state = State::Rejected(Reason::Signature);
                }
                _ => self.switch(now),
            },
            Command::GoBack if self.state == State::Confirmed && self.flaw == Flaw::Rotten => {
                self.reason = Reason::Crc as u16;
            }
            Command::GoBack if self.state == State::Confirmed && self.takes_key_of(1) => {
                self.switch(now);
            }
            Command::Confirm if self.flaw == Flaw::ConfirmsLate => self.flaw = Flaw::None,
            Command::Confirm if self.takes_key_of(0) => {
                self.trial = false;
                self.revoked |= self.keys != [0; 2] && self.key_of(0) == self.keys[1];
            }
            _ => return Err(6),
        }
        Ok(answer)
    }

    /// Starts the image in the other slot, on trial.
    fn switch(&mut self, now: Duration) {
        self.silent_until = now + self.restart;
        self.runs = self.runs.other();
        self.images.swap(0, 1);
        self.crcs.swap(0, 1);
        self.state = State::Confirmed;
        self.trial = true;
        self.start(now);
    }

    /// Starts the running image.
    fn start(&mut self, now: Duration) {
        self.set_registers();
        self.modio.start(now, false);
    }

    /// Serves points and registers.
    fn registers(&mut self, pdu: &[u8], now: Duration) -> Result<Vec<u8>, u8> {
        self.set_registers();
        self.modio.now = now;
        self.modio.answer(pdu, &[0; 9]).unwrap_or(Err(1))
    }

    fn set_registers(&mut self) {
        let [version, patch, _, high, low, ..] = self.images[0];
        let key = u16::from(self.development) * build::DEVELOPMENT_TRUSTED;
        let trial = u16::from(self.trial) << 5;
        self.modio.fixed.extend([
            (FIRMWARE_VERSION, version),
            (FIRMWARE_PATCH, patch),
            (STATUS, self.status),
            (COMMIT, high),
            (COMMIT + 1, low),
            (BUILD, key),
            (UPDATE, (self.runs as u16 + 1) | trial),
        ]);
    }
}
