//! What the tests share: a master's side of the line, written independently of the crate, and a
//! unit made of the crate's parts, driven as a device would drive them.

#![allow(dead_code)] // each test file uses its own part of it

pub mod hearing;
mod points;
pub mod reference;
pub mod serving;

use modbus_server::line::{Faults, Framing, Next, Receiver, Transmitter, Width};
use modbus_server::{Counters, Outcome, Server};
#[allow(unused_imports)] // as above
pub use points::{MAX_WORD, Points, object};

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

/// The LRC as V1.02 6.2.1 describes it.
pub fn lrc(bytes: &[u8]) -> u8 {
    let sum: u32 = bytes.iter().map(|byte| u32::from(*byte)).sum();
    (0x100 - sum % 0x100) as u8
}

/// An ASCII frame: colon, unit, PDU and LRC in hexadecimal, carriage return, end mark.
pub fn ascii_frame(unit: u8, pdu: &[u8], delimiter: u8) -> Vec<u8> {
    let mut bytes = vec![unit];
    bytes.extend(pdu);
    bytes.push(lrc(&bytes));
    let digits: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    [b":", digits.as_bytes(), b"\r", &[delimiter]].concat()
}

/// A frame in either mode.
pub fn framed(framing: Framing, unit: u8, pdu: &[u8]) -> Vec<u8> {
    match framing {
        Framing::Rtu => frame(unit, pdu),
        Framing::Ascii { delimiter } => ascii_frame(unit, pdu, delimiter),
    }
}

/// Unit and PDU of a good frame.
pub fn unframed(framing: Framing, frame: &[u8]) -> Vec<u8> {
    let bytes = match framing {
        Framing::Rtu => {
            let (body, check) = frame.split_at(frame.len() - 2);
            assert_eq!(crc(body), check, "CRC of the reply");
            body.to_vec()
        }
        Framing::Ascii { delimiter } => {
            let text = frame
                .strip_prefix(b":")
                .and_then(|rest| rest.strip_suffix(&[b'\r', delimiter]))
                .expect("colon and end");
            let digit = |c: &u8| match c {
                b'0'..=b'9' => c - b'0',
                b'A'..=b'F' => c - b'A' + 10,
                _ => panic!("{c:02X} is no digit"),
            };
            let bytes = text
                .chunks(2)
                .map(|pair| digit(&pair[0]) * 16 + digit(&pair[1]));
            let mut bytes: Vec<u8> = bytes.collect();
            let check = bytes.pop();
            assert_eq!(check, Some(lrc(&bytes)), "LRC of the reply");
            bytes
        }
    };
    assert_eq!(framed(framing, bytes[0], &bytes[1..]), frame);
    bytes
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

/// The PDU of function 17.
pub fn write_then_read(read: u16, count: u16, write: u16, words: &[u16]) -> Vec<u8> {
    let mut request = pdu(0x17, &[read, count]);
    request.extend(&write_words(write, words)[1..]);
    request
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

/// A unit on a line: receiver, server, transmitter and points.
pub struct Unit {
    pub receiver: Receiver<'static>,
    pub server: Server,
    pub points: Points,
    /// The reply to an ASCII frame that has ended.
    said: Option<Vec<u8>>,
}

impl Unit {
    /// An RTU unit that has heard its first silence already.
    pub fn new(points: Points) -> Self {
        Self::with(UNIT, false, points)
    }

    pub fn with(unit: u8, strict_t15: bool, points: Points) -> Self {
        Self::of(
            Receiver::rtu(unit, strict_t15),
            Server::new(unit, Framing::Rtu),
            points,
        )
    }

    pub fn ascii(width: Width, points: Points) -> Self {
        Self::of(
            Receiver::ascii(UNIT, width),
            Server::new(UNIT, Framing::ASCII),
            points,
        )
    }

    fn of(mut receiver: Receiver<'static>, server: Server, points: Points) -> Self {
        receiver.give_back(Box::leak(Box::default()));
        receiver.give_back(Box::leak(Box::default()));
        assert!(receiver.close().is_none());
        let server = if points.lacks.contains(&0x08) {
            server.without_listen_only()
        } else {
            server
        };
        Self {
            receiver,
            server,
            points,
            said: None,
        }
    }

    /// One character.
    pub fn character(&mut self, byte: u8, faults: Faults) {
        self.receiver.character(byte, faults);
        if self.receiver.is_over() {
            assert_ne!(self.server.framing(), Framing::Rtu);
            self.said = self.close();
        }
    }

    /// Good characters.
    pub fn characters(&mut self, bytes: &[u8]) {
        bytes
            .iter()
            .for_each(|byte| self.character(*byte, Faults::NONE));
    }

    /// Silence of 3.5 characters, in ASCII mode of a second, and the reply to what came before it,
    /// as it goes over the line.
    pub fn silence(&mut self) -> Option<Vec<u8>> {
        self.receiver.pause();
        match self.said.take() {
            Some(said) => Some(said),
            None => self.close(),
        }
    }

    /// The reply to an ASCII frame, whose end was the last character.
    pub fn take_said(&mut self) -> Option<Vec<u8>> {
        self.said.take()
    }

    fn close(&mut self) -> Option<Vec<u8>> {
        let closed = self.receiver.close()?;
        let answers = self.server.answers(closed.adu);
        let mut transmitter = Transmitter::idle();
        let mut reply = Vec::new();
        if answers {
            transmitter = Transmitter::open(self.server.unit(), self.server.framing());
            while let Next::Byte(byte) = transmitter.next() {
                reply.push(byte);
            }
            assert_eq!(
                transmitter.next(),
                Next::Wait,
                "the unit address goes at once"
            );
        }
        let decision = self.server.decide(closed.adu, &self.points);
        assert_ne!(decision.outcome, Outcome::NotForUs);
        assert_eq!(decision.reply.is_some(), answers);
        if let Some(head) = decision.reply {
            transmitter.head(head);
            while let Next::Byte(byte) = transmitter.next() {
                reply.push(byte);
            }
        }
        self.server.commit(&decision, &closed.line);
        self.server
            .carry_out(&decision, closed.adu, &mut self.points);
        self.receiver.set_framing(self.server.framing());
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

    /// A whole frame with a good CRC or LRC; the reply, if any.
    pub fn raw(&mut self, bytes: &[u8]) -> Option<Vec<u8>> {
        self.characters(bytes);
        self.silence()
    }

    /// A request to this unit; the PDU of its reply, whose frame is checked.
    pub fn request(&mut self, pdu: &[u8]) -> Option<Vec<u8>> {
        let framing = self.server.framing();
        let reply = self.raw(&framed(framing, UNIT, pdu))?;
        let [unit, pdu @ ..] = &unframed(framing, &reply)[..] else {
            panic!("an empty reply");
        };
        assert_eq!(*unit, UNIT);
        assert!(pdu.len() <= 253);
        Some(pdu.to_vec())
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
        self.server.counters_at(self.receiver.counters())
    }

    /// The next good request must be answered.
    pub fn must_answer(&mut self) {
        let reply = self.request(&pdu(0x03, &[0, 1])).expect("a reply");
        assert_eq!(reply[..2], [0x03, 0x02]);
    }
}
