//! A Modbus server small enough to be seen to be right, from V1.1b3 alone; wrong where it is told to be.

use super::fault::Fault;
use super::log::{COUNTERS, Log};
use super::modio::Modio;
use super::modio_fault::ModioFault;

/// Coils and registers, and where they are.
pub const COILS: (u16, usize) = (100, 2100);
pub const INPUTS: (u16, usize) = (0, 19);
pub const HOLDING: (u16, usize) = (1000, 200);
pub const INPUT_REGISTERS: (u16, usize) = (50, 10);
/// Holding registers take values up to this.
pub const MOST: u16 = 4095;

type Answer = Result<Vec<u8>, u8>;

/// No exception code: the unit stays silent.
pub const SILENT: u8 = 0xFF;

/// The server.
pub struct Server {
    pub fault: Option<Fault>,
    pub coils: Vec<bool>,
    pub holding: Vec<u16>,
    pub log: Log,
    pub delimiter: u8,
    /// What a modio has in place of coils and registers.
    pub modio: Option<Modio>,
}

impl Server {
    pub fn new(fault: Option<Fault>) -> Self {
        Self {
            fault,
            coils: vec![false; COILS.1],
            holding: vec![1; HOLDING.1],
            log: Log::new(fault),
            delimiter: b'\n',
            modio: None,
        }
    }

    /// Whether this is a modio with this fault.
    pub fn modio_has(&self, fault: ModioFault) -> bool {
        self.modio.as_ref().is_some_and(|modio| modio.has(fault))
    }

    pub fn has(&self, fault: Fault) -> bool {
        self.fault == Some(fault)
    }

    /// Does what a PDU asks for: the reply's data, or an exception code.
    pub fn answer(&mut self, pdu: &[u8]) -> Answer {
        let of_modio = self.modio.as_mut();
        if let Some(answer) = of_modio.and_then(|modio| modio.answer(pdu, &self.log)) {
            return answer;
        }
        let word = |at: usize| {
            pdu.get(at..at + 2)
                .map(|w| u16::from_be_bytes([w[0], w[1]]))
        };
        let two = || Ok::<_, u8>((word(1).ok_or(3)?, word(3).ok_or(3)?));
        let spare = self.has(Fault::IgnoresSpareBytes);
        let exactly = |length: usize| {
            let right = pdu.len() == length || (spare && pdu.len() > length);
            if right { Ok(()) } else { Err(3) }
        };
        let adds_a_byte = self.has(Fault::AddsAByte);
        let status = |mut reply: Vec<u8>| {
            reply.extend(adds_a_byte.then_some(0));
            reply
        };
        match pdu[0] {
            function @ 1..=4 => {
                if !self.has(Fault::IgnoresLength) || pdu.len() < 5 {
                    exactly(5)?;
                }
                let (at, quantity) = two()?;
                self.read(function, at, quantity)
            }
            5 => {
                exactly(5)?;
                let (at, value) = two()?;
                if self.has(Fault::CoilAddressFirst) {
                    place(COILS, at, 1)?;
                }
                let on = match value {
                    0xFF00 => true,
                    0 if self.has(Fault::NeverSwitchesOff) => return Ok(pdu[1..].to_vec()),
                    0 => false,
                    0x1234 if self.has(Fault::TakesCoil1234) => true,
                    _ => return Err(3),
                };
                if self.has(Fault::EchoesNowhere) && place(COILS, at, 1).is_err() {
                    return Ok(pdu[1..].to_vec());
                }
                let at = place(COILS, at, 1)?;
                self.coils[at] = on;
                Ok(pdu[1..].to_vec())
            }
            6 => {
                exactly(5)?;
                let (at, value) = two()?;
                if self.has(Fault::ValueFirst) && value > MOST {
                    return Err(3);
                }
                if self.has(Fault::EchoesNowhere) && place(HOLDING, at, 1).is_err() {
                    return Ok(pdu[1..].to_vec());
                }
                let at = place(HOLDING, at, 1)?;
                if self.has(Fault::WritesNeighbour) && value <= MOST && at + 1 < HOLDING.1 {
                    self.holding[at + 1] = value;
                }
                if value <= MOST || self.has(Fault::StoresRefused) {
                    self.holding[at] = value;
                }
                if value > MOST {
                    Err(3)
                } else {
                    Ok(pdu[1..].to_vec())
                }
            }
            7 => exactly(1).map(|()| status(vec![0x6D])),
            8 => self.diagnose(pdu),
            0x0B => exactly(1).map(|()| status(self.log.event_counter())),
            0x0C => exactly(1).map(|()| status(self.log.read())),
            0x0F => self.write_coils(pdu),
            0x10 => self.write_registers(pdu),
            0x11 => exactly(1).map(|()| status(vec![2, 0x42, 0xFF])),
            0x16 => {
                exactly(7)?;
                let (at, and) = two()?;
                let or = word(5).ok_or(3)?;
                if self.has(Fault::EchoesNowhere) && place(HOLDING, at, 1).is_err() {
                    return Ok(pdu[1..].to_vec());
                }
                let at = place(HOLDING, at, 1)?;
                let or = if self.has(Fault::PlainOr) {
                    or
                } else {
                    or & !and
                };
                let value = (self.holding[at] & and) | or;
                if value > MOST && !self.has(Fault::MasksBeyondRange) {
                    return Err(3);
                }
                self.holding[at] = value;
                Ok(pdu[1..].to_vec())
            }
            0x17 => self.read_write(pdu),
            0x2B => super::ident::answer(pdu, self.fault),
            _ => Err(1),
        }
    }

    fn read(&self, function: u8, at: u16, quantity: u16) -> Answer {
        let bits = function <= 2;
        let most = match bits {
            true if self.has(Fault::Answers2001) => 2001,
            true if self.has(Fault::RefusesLongestReads) => 1999,
            true => 2000,
            false if self.has(Fault::RefusesLongestReads) => 124,
            false if self.has(Fault::Answers126) => 126,
            false => 125,
        };
        let table = [COILS, INPUTS, HOLDING, INPUT_REGISTERS][usize::from(function) - 1];
        if self.has(Fault::AddressFirst) {
            place(table, at, quantity.max(1))?;
        }
        if quantity > most || (quantity == 0 && !self.has(Fault::AnswersQuantity0)) {
            return Err(3);
        }
        let reach = quantity - u16::from(self.has(Fault::ReadsPastTheEnd) && quantity > 1);
        let start = match place(table, at, reach) {
            Err(_) if self.has(Fault::Wraps) && at.checked_add(quantity).is_none() => 0,
            found => found?,
        };
        let range = start..start + usize::from(quantity);
        let mut data = Vec::new();
        if bits {
            let bit = |n: usize| {
                if function == 1 {
                    self.coils.get(n).copied().unwrap_or(false)
                } else {
                    n.is_multiple_of(3)
                }
            };
            data = vec![0_u8; usize::from(quantity).div_ceil(8)];
            for (n, source) in range.enumerate() {
                data[n / 8] |= u8::from(bit(source)) << (n % 8);
            }
            if self.has(Fault::DirtyPadding) && !quantity.is_multiple_of(8) {
                *data.last_mut().unwrap() |= 0x80;
            }
        } else {
            for n in range {
                let word = if function == 3 {
                    self.holding.get(n).copied().unwrap_or(0)
                } else {
                    n as u16 * 7
                };
                data.extend(word.to_be_bytes());
            }
        }
        let count = if self.has(Fault::CountsRegisters) && !bits {
            data.len() / 2
        } else {
            data.len()
        };
        Ok([vec![count as u8], data].concat())
    }

    /// What 0F and 10 reply.
    fn written(&self, pdu: &[u8]) -> Answer {
        let length = if self.has(Fault::EchoesData) {
            pdu.len()
        } else {
            5
        };
        Ok(pdu[1..length].to_vec())
    }

    /// Whether 0F, 10 and 17 write so many points, at most `most`.
    fn takes(&self, quantity: u16, most: u16) -> bool {
        let most = most - u16::from(self.has(Fault::RefusesLongestWrites));
        let least = u16::from(!self.has(Fault::WritesQuantity0));
        (least..=most).contains(&quantity)
    }

    /// Where `quantity` points from an address in a request that writes several are in a table, looked up
    /// before anything else is checked.
    fn address_first(&self, table: (u16, usize), pdu: &[u8], at: usize) -> Result<(), u8> {
        let address = pdu.get(at..at + 2);
        match address.filter(|_| self.has(Fault::AddressFirstInWrites)) {
            Some(word) => place(table, u16::from_be_bytes([word[0], word[1]]), 1).map(drop),
            None => Ok(()),
        }
    }

    fn write_coils(&mut self, pdu: &[u8]) -> Answer {
        self.address_first(COILS, pdu, 1)?;
        let (at, quantity, data) = self.many(pdu)?;
        let whole = usize::from(quantity).div_ceil(8);
        let wrong = data.len() != whole && !self.has(Fault::IgnoresOtherByteCounts);
        if !self.takes(quantity, 1968) || wrong {
            return Err(3);
        }
        let data = [data, &vec![0; whole][..]].concat();
        if self.has(Fault::WritesCoilsPartly) && place(COILS, at, 1).is_ok() {
            let first = place(COILS, at, 1)?;
            for (n, coil) in self.coils[first..]
                .iter_mut()
                .take(quantity.into())
                .enumerate()
            {
                *coil = data[n / 8] >> (n % 8) & 1 == 1;
            }
        }
        let start = place(COILS, at, quantity)?;
        let written = if self.has(Fault::WritesPadding) {
            whole * 8
        } else {
            usize::from(quantity)
        };
        for n in 0..written {
            if let Some(coil) = self.coils.get_mut(start + n) {
                *coil = data[n / 8] >> (n % 8) & 1 == 1;
            }
        }
        self.written(pdu)
    }

    fn write_registers(&mut self, pdu: &[u8]) -> Answer {
        self.address_first(HOLDING, pdu, 1)?;
        let quantity = pdu.get(3..5).map(|w| u16::from_be_bytes([w[0], w[1]]));
        if self.has(Fault::IgnoresByteCount)
            && let (Some(quantity @ 1..=123), Some(data)) = (quantity, pdu.get(6..))
        {
            let at = u16::from_be_bytes([pdu[1], pdu[2]]);
            let start = place(HOLDING, at, quantity)?;
            for (n, word) in data.chunks(2).take(usize::from(quantity)).enumerate() {
                self.holding[start + n] = u16::from_be_bytes([word[0], *word.get(1).unwrap_or(&0)]);
            }
            return Ok(pdu[1..5].to_vec());
        }
        let (at, quantity, data) = self.many(pdu)?;
        if !self.takes(quantity, 123) || data.len() != usize::from(quantity) * 2 {
            return Err(3);
        }
        self.store(at, data)?;
        self.written(pdu)
    }

    /// All of it or nothing.
    fn store(&mut self, at: u16, data: &[u8]) -> Result<(), u8> {
        let words: Vec<u16> = data
            .chunks(2)
            .map(|w| u16::from_be_bytes([w[0], w[1]]))
            .collect();
        if self.has(Fault::WritesPartly) {
            for (address, word) in (at..=u16::MAX).zip(&words) {
                let at = place(HOLDING, address, 1)?;
                self.holding[at] = *word;
            }
            return Ok(());
        }
        if self.has(Fault::ValueFirst) && words.iter().any(|word| *word > MOST) {
            return Err(3);
        }
        let start = place(HOLDING, at, words.len() as u16)?;
        if words.iter().any(|word| *word > MOST) {
            return Err(3);
        }
        self.holding[start..start + words.len()].copy_from_slice(&words);
        Ok(())
    }

    fn read_write(&mut self, pdu: &[u8]) -> Answer {
        self.address_first(HOLDING, pdu, 5)?;
        let mut pdu = pdu.to_vec();
        if self.has(Fault::FillsTruncated) && pdu.len() > 10 {
            let whole = 10 + usize::from(pdu[9]);
            pdu.resize(whole, 0);
        }
        let [_, r1, r0, q1, q0, rest @ ..] = &pdu[..] else {
            return Err(3);
        };
        let (read, quantity) = (
            u16::from_be_bytes([*r1, *r0]),
            u16::from_be_bytes([*q1, *q0]),
        );
        let (at, written, data) = self
            .many(&[&[0], rest].concat())
            .map(|(a, q, d)| (a, q, d.to_vec()))?;
        let at = if self.has(Fault::WritesWhereItReads) {
            read
        } else {
            at
        };
        let fits = data.len() == usize::from(written) * 2
            || (self.has(Fault::IgnoresOtherByteCounts) && data.len() % 2 == 0);
        let most = if self.has(Fault::Reads124) { 124 } else { 125 };
        let wrong = !(1..=most).contains(&quantity) || !self.takes(written, 121) || !fits;
        if wrong {
            return Err(3);
        }
        if self.has(Fault::WritesBeforeItChecks) {
            self.store(at, &data)?;
        }
        place(HOLDING, read, quantity)?;
        if self.has(Fault::ReadsFirst) {
            let reply = self.read(3, read, quantity);
            return self.store(at, &data).and(reply);
        }
        self.store(at, &data)?;
        self.read(3, read, quantity)
    }

    fn many<'a>(&self, pdu: &'a [u8]) -> Result<(u16, u16, &'a [u8]), u8> {
        many(pdu, self.has(Fault::IgnoresSpareData))
    }

    fn diagnose(&mut self, pdu: &[u8]) -> Answer {
        let [_, high, low, ref data @ ..] = *pdu else {
            if self.has(Fault::EchoesShortDiagnostics) {
                return Ok(pdu[1..].to_vec());
            }
            return Err(3);
        };
        let sub = u16::from_be_bytes([high, low]);
        if sub == 0 {
            let shown = if self.has(Fault::ShortEcho) {
                pdu.len().min(5)
            } else {
                pdu.len()
            };
            return Ok(pdu[1..shown].to_vec());
        }
        if sub == 3 {
            if self.has(Fault::SilentToDelimiter) {
                return Err(SILENT);
            }
            let [delimiter, low] = *data else {
                return Err(3);
            };
            let digit = delimiter.is_ascii_digit() || (b'A'..=b'F').contains(&delimiter);
            let wrong = low != 0 || digit || matches!(delimiter, b':' | b'\r');
            if wrong && !self.has(Fault::TakesAnyDelimiter) {
                return Err(3);
            }
            if !self.has(Fault::KeepsDelimiter) {
                self.delimiter = delimiter;
            }
            return Ok(pdu[1..].to_vec());
        }
        let clears = if self.has(Fault::NeverClears) {
            0
        } else if self.has(Fault::ClearsOneAlone) {
            1
        } else {
            COUNTERS
        };
        self.log
            .diagnose(sub, data, clears)
            .map(|value| [vec![high, low], value].concat())
    }
}

/// Where `quantity` points from address `at` on are in a table.
fn place((first, count): (u16, usize), at: u16, quantity: u16) -> Result<usize, u8> {
    let start = at.checked_sub(first).map(usize::from).ok_or(2)?;
    if start + usize::from(quantity) <= count {
        Ok(start)
    } else {
        Err(2)
    }
}

/// Address, quantity and as many data bytes as the byte count says. They must be all there are, unless `spare`.
fn many(pdu: &[u8], spare: bool) -> Result<(u16, u16, &[u8]), u8> {
    let [_, a1, a0, q1, q0, count, ref data @ ..] = *pdu else {
        return Err(3);
    };
    let count = usize::from(count);
    if count > data.len() || (count < data.len() && !spare) {
        return Err(3);
    }
    let data = &data[..count];
    Ok((
        u16::from_be_bytes([a1, a0]),
        u16::from_be_bytes([q1, q0]),
        data,
    ))
}
