//! What the tests share: a master's side of the line, written independently of the crate, and a
//! unit made of the crate's parts, driven as a device would drive them.

#![allow(dead_code)] // each test file uses its own part of it

pub mod reference;

use modbus_server::rtu::{Faults, Next, Receiver, Transmitter};
use modbus_server::{
    Adu, Bits, BitsOut, Counters, DataModel, Exception, Outcome, Server, Span, Words, WordsOut,
};

/// The unit address of the tests.
pub const UNIT: u8 = 17;

/// CRC-16/MODBUS bit by bit, as V1.02 6.2.2 describes it, low byte first.
pub fn crc(bytes: &[u8]) -> [u8; 2] {
    let mut register = 0xFFFF_u16;
    for byte in bytes {
        register ^= u16::from(*byte);
        for _ in 0..8 {
            let carry = register & 1 != 0;
            register >>= 1;
            if carry {
                register ^= 0xA001;
            }
        }
    }
    register.to_le_bytes()
}

/// A frame: unit, PDU, CRC.
pub fn frame(unit: u8, pdu: &[u8]) -> Vec<u8> {
    let mut frame = vec![unit];
    frame.extend(pdu);
    frame.extend(crc(&frame.clone()));
    frame
}

/// Function code and 16-bit fields.
pub fn pdu(function: u8, fields: &[u16]) -> Vec<u8> {
    let mut pdu = vec![function];
    fields
        .iter()
        .for_each(|field| pdu.extend(field.to_be_bytes()));
    pdu
}

/// The PDU of function 0F.
pub fn write_bits(start: u16, bits: &[bool]) -> Vec<u8> {
    let mut pdu = pdu(0x0F, &[start, bits.len() as u16]);
    let packed = pack(bits);
    pdu.push(packed.len() as u8);
    pdu.extend(packed);
    pdu
}

/// The PDU of function 10.
pub fn write_words(start: u16, words: &[u16]) -> Vec<u8> {
    let mut pdu = pdu(0x10, &[start, words.len() as u16]);
    pdu.push((words.len() * 2) as u8);
    words.iter().for_each(|word| pdu.extend(word.to_be_bytes()));
    pdu
}

/// Eight bits to a byte, the first lowest.
pub fn pack(bits: &[bool]) -> Vec<u8> {
    let packed = |bits: &[bool]| {
        bits.iter()
            .rev()
            .fold(0, |byte, bit| byte << 1 | *bit as u8)
    };
    bits.chunks(8).map(packed).collect()
}

/// Bits and words from address 0 on, some of them read-only; words above `MAX_WORD` are refused.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    pub bits: Vec<bool>,
    pub words: Vec<u16>,
    /// Points from here on cannot be written.
    pub read_only_from: u32,
    /// If set, everything that has a right address and value is refused with it.
    pub state: Option<Exception>,
}

/// The largest word [`Points`] takes.
pub const MAX_WORD: u16 = 0xFFF0;

impl Points {
    pub fn new(bits: usize, words: usize) -> Self {
        Self {
            bits: vec![false; bits],
            words: vec![0; words],
            read_only_from: u32::MAX,
            state: None,
        }
    }

    fn check(&self, end: u32, points: usize, value_is_good: bool) -> Result<(), Exception> {
        if end as usize > points {
            return Err(Exception::IllegalDataAddress);
        }
        if !value_is_good {
            return Err(Exception::IllegalDataValue);
        }
        self.state.map_or(Ok(()), Err)
    }

    fn writable(&self, points: usize) -> usize {
        points.min(self.read_only_from as usize)
    }
}

impl DataModel for Points {
    fn check_read_bits(&self, span: Span) -> Result<(), Exception> {
        self.check(span.end(), self.bits.len(), true)
    }

    fn check_read_words(&self, span: Span) -> Result<(), Exception> {
        self.check(span.end(), self.words.len(), true)
    }

    fn check_write_bits(&self, span: Span, bits: Bits<'_>) -> Result<(), Exception> {
        assert_eq!(span.count(), bits.count());
        self.check(span.end(), self.writable(self.bits.len()), true)
    }

    fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        assert_eq!(usize::from(span.count()), words.count());
        let good = words.iter().all(|word| word <= MAX_WORD);
        self.check(span.end(), self.writable(self.words.len()), good)
    }

    fn read_bits(&self, span: Span, out: &mut BitsOut<'_>) {
        for address in span.addresses() {
            out.push(self.bits[usize::from(address)]);
        }
    }

    fn read_words(&self, span: Span, out: &mut WordsOut<'_>) {
        for address in span.addresses() {
            out.push(self.words[usize::from(address)]);
        }
    }

    fn write_bits(&mut self, span: Span, bits: Bits<'_>) {
        assert_eq!(span.count(), bits.count());
        for (address, bit) in span.addresses().zip(bits.iter()) {
            self.bits[usize::from(address)] = bit;
        }
    }

    fn write_words(&mut self, span: Span, words: Words<'_>) {
        assert_eq!(usize::from(span.count()), words.count());
        for (address, word) in span.addresses().zip(words.iter()) {
            self.words[usize::from(address)] = word;
        }
    }
}

/// A unit on a line: receiver, server, transmitter and points.
pub struct Unit {
    pub receiver: Receiver<'static>,
    pub server: Server,
    pub points: Points,
}

impl Unit {
    /// A unit that has heard its first silence already.
    pub fn new(points: Points) -> Self {
        Self::with(UNIT, false, points)
    }

    pub fn with(unit: u8, strict_t15: bool, points: Points) -> Self {
        let mut receiver = Receiver::new(unit, strict_t15);
        receiver.give_back(Box::leak(Box::default()));
        receiver.give_back(Box::leak(Box::default()));
        assert!(receiver.t35().is_none());
        Self {
            receiver,
            server: Server::new(unit),
            points,
        }
    }

    /// Good characters.
    pub fn characters(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.receiver.character(*byte, Faults::NONE);
        }
    }

    /// Silence of 3.5 characters, and the reply to what came before it, as it goes over the line.
    pub fn silence(&mut self) -> Option<Vec<u8>> {
        let ahead = self
            .receiver
            .t15()
            .map(|request| self.server.decide(request, &self.points));
        let closed = self.receiver.t35()?;
        let decision = self.server.decide(closed.adu, &self.points);
        assert_eq!(ahead, Some(decision), "decided ahead as at the end");
        assert_ne!(decision.outcome, Outcome::NotForUs);

        let mut reply = Vec::new();
        let mut transmitter = match decision.reply {
            Some(head) => Transmitter::new(head),
            None => Transmitter::idle(),
        };
        while let Next::Byte(byte) = transmitter.next() {
            reply.push(byte);
        }
        self.server.commit(&decision);
        self.server
            .carry_out(&decision, closed.adu, &mut self.points);
        let spare = match transmitter.next() {
            Next::Wait => {
                assert!(transmitter.body(closed.adu).is_none());
                while let Next::Byte(byte) = transmitter.next() {
                    reply.push(byte);
                }
                transmitter.take_buffer().expect("the body")
            }
            _ => transmitter.body(closed.adu).expect("no body is needed"),
        };
        self.receiver.give_back(spare);
        assert_eq!(transmitter.next(), Next::Done);
        self.receiver.resume();
        (!reply.is_empty()).then_some(reply)
    }

    /// A whole frame with a good CRC; the reply, if any.
    pub fn raw(&mut self, bytes: &[u8]) -> Option<Vec<u8>> {
        self.characters(bytes);
        self.silence()
    }

    /// A request to this unit; the PDU of its reply, whose frame is checked.
    pub fn request(&mut self, pdu: &[u8]) -> Option<Vec<u8>> {
        let reply = self.raw(&frame(UNIT, pdu))?;
        let (body, check) = reply.split_at(reply.len() - 2);
        assert_eq!(crc(body), check, "CRC of the reply");
        assert_eq!(body[0], UNIT);
        assert!(reply.len() <= Adu::CAPACITY);
        Some(body[1..].to_vec())
    }

    /// A request that must be refused.
    pub fn refused(&mut self, pdu: &[u8]) -> u8 {
        let points = self.points.clone();
        let reply = self.request(pdu).expect("a reply");
        assert_eq!(reply.len(), 2, "{reply:02X?} to {pdu:02X?}");
        assert_eq!(reply[0], pdu[0] | 0x80);
        assert_eq!(self.points, points, "refused, so nothing changes");
        reply[1]
    }

    pub fn counters(&self) -> Counters {
        self.server.counters(self.receiver.counters())
    }

    /// The next good request must be answered.
    pub fn must_answer(&mut self) {
        let reply = self.request(&pdu(0x03, &[0, 1])).expect("a reply");
        assert_eq!(reply[..2], [0x03, 0x02]);
    }
}
