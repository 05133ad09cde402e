//! The reply on its way out: head, body, and the CRC or LRC made as they leave.

use super::{Framing, ascii};
use crate::{Adu, Head, crc};

/// What the line driver has to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Send this character.
    Byte(u8),
    /// The rest is not here yet: ask again once it has been handed over ([`Transmitter::head`],
    /// [`Transmitter::body`]).
    Wait,
    /// The frame is complete: release the line after the last stop bit.
    Done,
}

/// Gives out one reply character by character.
#[derive(Debug)]
pub struct Transmitter<'a> {
    framing: Framing,
    head: Head,
    body: Option<&'a mut Adu>,
    /// How many bytes of unit address and PDU, and in RTU mode of the CRC, have gone.
    sent: u16,
    /// How many bytes unit address and PDU are, or `UNKNOWN`.
    end: u16,
    /// The CRC of the bytes sent; in ASCII mode their sum.
    check: u16,
    /// In ASCII mode: the second digit of a byte whose first has gone, else 0.
    second: u8,
    /// In ASCII mode.
    stage: Stage,
}

/// What of an ASCII frame comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Colon,
    Bytes,
    CarriageReturn,
    Delimiter,
    Over,
}

/// Bytes of the CRC.
const CRC_LEN: u16 = 2;
/// There is more to come, who knows how much.
const UNKNOWN: u16 = u16::MAX;

impl<'a> Transmitter<'a> {
    /// Nothing to send.
    pub const fn idle() -> Self {
        Self {
            framing: Framing::Rtu,
            head: Head::opening(0),
            body: None,
            sent: CRC_LEN,
            end: 0,
            check: 0,
            second: 0,
            stage: Stage::Over,
        }
    }

    /// A reply of `unit`, of which no more is known yet. Its first byte, the unit address, is ready
    /// at once.
    #[inline]
    pub const fn open(unit: u8, framing: Framing) -> Self {
        Self {
            framing,
            head: Head::opening(unit),
            body: None,
            sent: 0,
            end: UNKNOWN,
            check: match framing {
                Framing::Rtu => crc::START,
                Framing::Ascii { .. } => 0,
            },
            second: 0,
            stage: Stage::Colon,
        }
    }

    /// Hands over what [`Server::decide`](crate::Server::decide) says the reply is, once.
    #[inline]
    pub const fn head(&mut self, head: Head) {
        self.head = head;
        if !head.has_body() {
            self.end = head.len() as u16;
        }
    }

    /// Hands over the body: what [`Server::carry_out`](crate::Server::carry_out) has left in the
    /// buffer. A buffer that is not needed, because the head is the whole reply or the body is here
    /// already, comes straight back, for the receiver.
    #[inline]
    #[must_use = "a buffer that is not needed belongs back in the receiver"]
    pub fn body(&mut self, adu: &'a mut Adu) -> Option<&'a mut Adu> {
        if !self.head.has_body() || self.body.is_some() {
            return Some(adu);
        }
        let body = self.head.body_in(adu).len();
        // Neither is above 256.
        self.end = self.head.len() as u16 + body as u16;
        self.body = Some(adu);
        None
    }

    /// The next thing to do. Called at each "transmit register empty"; in the end it is
    /// [`Next::Done`] as often as asked.
    #[inline]
    #[expect(
        clippy::should_implement_trait,
        reason = "not an iterator: it may have to wait"
    )]
    pub fn next(&mut self) -> Next {
        if let Framing::Ascii { delimiter } = self.framing {
            return self.next_character(delimiter);
        }
        let byte = match self.payload() {
            Next::Byte(byte) => byte,
            Next::Wait => return Next::Wait,
            // Low byte first; a CRC fed with its own low byte moves its high byte down to be the
            // next one.
            Next::Done if self.sent < self.end + CRC_LEN => {
                let [low, _] = self.check.to_le_bytes();
                low
            }
            Next::Done => return Next::Done,
        };
        self.check = crc::step(self.check, byte);
        self.sent += 1;
        Next::Byte(byte)
    }

    /// In ASCII mode.
    fn next_character(&mut self, delimiter: u8) -> Next {
        if self.second != 0 {
            let second = self.second;
            self.second = 0;
            return Next::Byte(second);
        }
        let (character, stage) = match self.stage {
            Stage::Colon => (ascii::START, Stage::Bytes),
            Stage::Bytes => {
                let (byte, stage) = match self.payload() {
                    Next::Byte(byte) => (byte, Stage::Bytes),
                    Next::Wait => return Next::Wait,
                    Next::Done => {
                        let [sum, _] = self.check.to_le_bytes();
                        (sum.wrapping_neg(), Stage::CarriageReturn)
                    }
                };
                self.check = self.check.wrapping_add(u16::from(byte));
                self.sent += 1;
                let [first, second] = ascii::digits(byte);
                self.second = second;
                (first, stage)
            }
            Stage::CarriageReturn => (ascii::CR, Stage::Delimiter),
            Stage::Delimiter => (delimiter, Stage::Over),
            Stage::Over => return Next::Done,
        };
        self.stage = stage;
        Next::Byte(character)
    }

    /// The next byte of head and body.
    #[inline]
    fn payload(&self) -> Next {
        let head = u16::from(self.head.len());
        if self.sent < head {
            return Next::Byte(self.head.get(self.sent));
        }
        if self.sent >= self.end {
            return Next::Done;
        }
        match &self.body {
            Some(adu) => Next::Byte(adu.get(self.sent - head + u16::from(self.head.body_from()))),
            None => Next::Wait,
        }
    }

    /// Takes the buffer of the body back, for the receiver. Before [`Next::Done`] this cuts the
    /// reply short.
    #[inline]
    pub fn take_buffer(&mut self) -> Option<&'a mut Adu> {
        self.body.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Exception;

    fn is_next(transmitter: &mut Transmitter<'_>, characters: &[u8]) {
        for character in characters {
            assert_eq!(transmitter.next(), Next::Byte(*character));
        }
    }

    #[test]
    fn nothing_to_send_is_done() {
        assert_eq!(Transmitter::idle().next(), Next::Done);
    }

    #[test]
    fn the_unit_address_goes_before_anything_else_is_known() {
        let head = Head::exception(1, 3, Exception::ServerDeviceFailure);
        let mut transmitter = Transmitter::open(1, Framing::Rtu);
        is_next(&mut transmitter, &[0x01]);
        assert_eq!(transmitter.next(), Next::Wait);
        transmitter.head(head);
        is_next(&mut transmitter, &[0x83, 0x04, 0x40, 0xF3]);
        assert_eq!(transmitter.next(), Next::Done);
        assert_eq!(transmitter.next(), Next::Done);
        let mut adu = Adu::new();
        assert!(transmitter.body(&mut adu).is_some(), "not needed");
        assert!(transmitter.take_buffer().is_none());
    }

    #[test]
    fn it_waits_for_the_body_as_long_as_it_takes() {
        let mut adu = Adu::new();
        adu.extend(&[0x03, 0xE8]);
        let mut transmitter = Transmitter::open(1, Framing::Rtu);
        transmitter.head(Head::read(1, 3, 2));
        is_next(&mut transmitter, &[0x01, 0x03, 0x02]);
        assert_eq!(transmitter.next(), Next::Wait);
        assert_eq!(transmitter.next(), Next::Wait);
        assert!(transmitter.body(&mut adu).is_none());
        let mut other = Adu::new();
        assert!(transmitter.body(&mut other).is_some());
        is_next(&mut transmitter, &[0x03, 0xE8, 0xB8, 0xFA]);
        assert_eq!(transmitter.next(), Next::Done);
        assert!(transmitter.take_buffer().is_some());
    }

    #[test]
    fn an_ascii_reply_has_its_own_clothes() {
        let mut adu = Adu::new();
        adu.extend(&[0x03, 0xE8]);
        let mut transmitter = Transmitter::open(1, Framing::ASCII);
        is_next(&mut transmitter, b":01");
        assert_eq!(transmitter.next(), Next::Wait);
        transmitter.head(Head::read(1, 3, 2));
        is_next(&mut transmitter, b"0302");
        assert_eq!(transmitter.next(), Next::Wait);
        assert!(transmitter.body(&mut adu).is_none());
        // 01 + 03 + 02 + 03 + E8 = F1, and 0F makes it 100.
        is_next(&mut transmitter, b"03E80F\r\n");
        assert_eq!(transmitter.next(), Next::Done);
        assert_eq!(transmitter.next(), Next::Done);

        let mut transmitter = Transmitter::open(1, Framing::Ascii { delimiter: b'#' });
        transmitter.head(Head::exception(1, 3, Exception::ServerDeviceFailure));
        is_next(&mut transmitter, b":01830478\r#");
        assert_eq!(transmitter.next(), Next::Done);
    }
}
