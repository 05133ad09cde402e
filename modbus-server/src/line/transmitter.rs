//! Sends a reply: head, body, and the CRC or LRC, which are computed during sending.

use super::{Framing, ascii};
use crate::head::Head;
use crate::{Adu, crc};

/// What the line driver has to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Send this character.
    Byte(u8),
    /// The rest is not ready yet. Ask again once the reply has been [answered](crate::Decided::answer) or
    /// [finished](crate::Served::finish).
    Wait,
    /// The frame is complete: release the line after the last stop bit.
    Done,
}

/// Returns one reply character by character.
#[derive(Debug)]
pub(crate) struct Transmitter<'a> {
    framing: Framing,
    stage: Stage,
    /// In RTU mode: number of bytes of the head that were sent. In ASCII mode: `ELSEWHERE`.
    sent: u8,
    /// In ASCII mode: the byte whose first digit was sent.
    half: Option<u8>,
    head: Head,
    body: Option<&'a mut Adu>,
    /// In RTU mode: number of bytes left in the body. In ASCII mode: 0.
    left: u16,
    /// In RTU mode: index of the next byte of the body. In ASCII mode: index of the next byte of head and body.
    at: u16,
    /// CRC of the bytes sent; in ASCII mode their sum.
    check: u16,
}

/// Larger than the length of any head.
const ELSEWHERE: u8 = u8::MAX;

/// Next part of the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Nothing. It is the first variant, because [`Transmitter::take_buffer`] already has a 0 in a register.
    Over,
    /// In ASCII mode, the colon.
    Start,
    /// Head and body, then the LRC or the first byte of the CRC.
    Bytes,
    /// The second byte of the CRC, or the carriage return.
    End,
    /// In ASCII mode, the delimiter.
    Delimiter,
}

impl<'a> Transmitter<'a> {
    /// Returns a transmitter with nothing to send.
    pub(crate) const fn idle() -> Self {
        Self {
            stage: Stage::Over,
            sent: ELSEWHERE,
            ..Self::open(0, Framing::Rtu)
        }
    }

    /// Begins a reply of `unit`, of which nothing else is known yet. Its first byte, the unit address, can be sent
    /// immediately.
    #[inline]
    pub(crate) const fn open(unit: u8, framing: Framing) -> Self {
        let (stage, sent, check) = match framing {
            Framing::Rtu => (Stage::Bytes, 0, crc::START),
            Framing::Ascii { .. } => (Stage::Start, ELSEWHERE, 0),
        };
        Self {
            framing,
            stage,
            sent,
            half: None,
            head: Head::opening(unit),
            body: None,
            left: 0,
            at: 0,
            check,
        }
    }

    /// Sets the head of the reply. Call this once.
    #[inline]
    pub(crate) const fn head(&mut self, head: Head) {
        self.head = head;
    }

    /// Sets the body, after the head: the buffer that the server has filled. Returns the buffer for the receiver
    /// when it is not needed, because the head is the whole reply or there already is a body.
    #[inline]
    #[must_use = "a buffer that is not needed must be given back to the receiver"]
    pub(crate) fn body(&mut self, adu: &'a mut Adu) -> Option<&'a mut Adu> {
        if !self.head.has_body() || self.body.is_some() || self.stage == Stage::Over {
            return Some(adu);
        }
        if self.framing == Framing::Rtu {
            self.at = u16::from(self.head.body_from());
            // At most 256.
            self.left = (adu.len() as u16).saturating_sub(self.at);
        }
        self.body = Some(adu);
        None
    }

    /// Returns what to do next. Call this at each "transmit register empty". After the end it returns
    /// [`Next::Done`] every time.
    #[inline(always)]
    pub(crate) fn next(&mut self) -> Next {
        let byte = if self.sent < self.head.len() {
            let byte = self.head.get(self.sent);
            self.sent += 1;
            byte
        } else if self.left > 0
            && let Some(adu) = &self.body
        {
            // The index is below 256, because bytes are left.
            let byte = adu.get(self.at as u8);
            self.at += 1;
            self.left -= 1;
            byte
        } else {
            return self.rest();
        };
        self.check = crc::step(self.check, byte);
        Next::Byte(byte)
    }

    /// Returns what follows when the next byte is not a byte of an RTU body.
    #[inline(never)]
    fn rest(&mut self) -> Next {
        if let Framing::Ascii { delimiter } = self.framing {
            return self.ascii(delimiter);
        }
        self.stage = match self.stage {
            Stage::Bytes if self.must_wait() => return Next::Wait,
            Stage::Bytes => Stage::End,
            Stage::End => Stage::Over,
            _ => return Next::Done,
        };
        // Low byte first. Updating a CRC with its own low byte shifts its high byte down, which is sent next.
        let [low, _] = self.check.to_le_bytes();
        self.check = crc::step(self.check, low);
        Next::Byte(low)
    }

    /// Returns the next character in ASCII mode.
    #[inline(always)]
    fn ascii(&mut self, delimiter: u8) -> Next {
        if let Some(byte) = self.half.take() {
            return Next::Byte(ascii::character(byte));
        }
        let byte = match self.stage {
            Stage::Bytes => match self.byte_at(self.at) {
                Some(byte) => byte,
                None if self.must_wait() => return Next::Wait,
                None => {
                    self.stage = Stage::End;
                    // The sum is not used after this.
                    self.check.to_le_bytes()[0].wrapping_neg()
                }
            },
            Stage::Start => return self.then(Stage::Bytes, ascii::START),
            Stage::End => return self.then(Stage::Delimiter, ascii::CR),
            Stage::Delimiter => return self.then(Stage::Over, delimiter),
            Stage::Over => return Next::Done,
        };
        self.at += 1;
        self.check = self.check.wrapping_add(u16::from(byte));
        self.half = Some(byte);
        Next::Byte(ascii::character(byte >> 4))
    }

    const fn then(&mut self, stage: Stage, character: u8) -> Next {
        self.stage = stage;
        Next::Byte(character)
    }

    /// Returns the byte at this index of head and body, if it is ready and not after the end.
    #[inline(always)]
    fn byte_at(&self, at: u16) -> Option<u8> {
        let head = u16::from(self.head.len());
        if at < head {
            return Some(self.head.get(at as u8));
        }
        let adu = self.body.as_ref()?;
        let at = at - head + u16::from(self.head.body_from());
        (usize::from(at) < adu.len()).then(|| adu.get(at as u8))
    }

    /// Returns whether the rest of the reply is not ready yet.
    fn must_wait(&self) -> bool {
        self.head.has_body() && self.body.is_none()
    }

    /// Returns the buffer of the body for the receiver and ends the reply. Before [`Next::Done`] this aborts the
    /// reply: at most the rest of its head is still sent, and no CRC or LRC, so that no master accepts it.
    #[inline]
    pub(crate) fn take_buffer(&mut self) -> Option<&'a mut Adu> {
        self.stage = Stage::Over;
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
    fn the_unit_address_is_sent_before_anything_else_is_known() {
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
    fn it_waits_until_the_body_is_ready() {
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
    fn an_ascii_reply_has_colon_digits_lrc_and_end_mark() {
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

    /// Checks that the remaining bytes of a reply, including CRC or LRC, are not sent, except for the head.
    fn is_cut_short(transmitter: &mut Transmitter<'_>, framing: Framing, left: &[u8]) {
        let mut sent = 0;
        while let Next::Byte(byte) = transmitter.next() {
            assert_eq!(byte, left[sent], "{framing:?} {left:02X?}");
            sent += 1;
        }
        assert_eq!(transmitter.next(), Next::Done, "{framing:?} {left:02X?}");
        // At most three bytes of the head in RTU mode, or the second digit of a byte in ASCII mode.
        let most = match framing {
            Framing::Rtu => left.len().saturating_sub(6),
            Framing::Ascii { .. } => 1,
        };
        assert!(sent <= most, "{framing:?} {left:02X?}");
    }

    #[test]
    fn taking_the_buffer_during_a_reply_aborts_the_reply() {
        let rtu: &[u8] = &[0x01, 0x03, 0x04, 1, 2, 3, 4, 0x5B, 0x3C];
        let ascii: &[u8] = b":01030401020304EE\r\n";
        for (framing, whole) in [(Framing::Rtu, rtu), (Framing::ASCII, ascii)] {
            for sent in 0..=whole.len() {
                let (mut adu, mut other) = (Adu::new(), Adu::new());
                adu.extend(&[1, 2, 3, 4]);
                let mut transmitter = Transmitter::open(1, framing);
                transmitter.head(Head::read(1, 3, 4));
                assert!(transmitter.body(&mut adu).is_none());
                is_next(&mut transmitter, &whole[..sent]);
                assert!(transmitter.take_buffer().is_some());
                is_cut_short(&mut transmitter, framing, &whole[sent..]);
                assert!(transmitter.body(&mut other).is_some(), "not needed");
                assert_eq!(transmitter.next(), Next::Done, "{framing:?} {sent}");
            }
        }
    }

    #[test]
    fn taking_the_buffer_before_the_body_is_ready_aborts_the_reply() {
        for framing in [Framing::Rtu, Framing::ASCII] {
            for head_is_known in [false, true] {
                for sent in [0, 1, 8] {
                    let mut adu = Adu::new();
                    let mut transmitter = Transmitter::open(1, framing);
                    if head_is_known {
                        transmitter.head(Head::read(1, 3, 4));
                    }
                    for _ in 0..sent {
                        transmitter.next();
                    }
                    assert!(transmitter.take_buffer().is_none());
                    while let Next::Byte(_) = transmitter.next() {}
                    assert_eq!(transmitter.next(), Next::Done, "{framing:?} {sent}");
                    // The rest of the reply is passed too late.
                    transmitter.head(Head::read(1, 3, 4));
                    assert!(transmitter.body(&mut adu).is_some(), "not needed");
                    while let Next::Byte(_) = transmitter.next() {}
                    assert_eq!(transmitter.next(), Next::Done, "{framing:?} {sent}");
                }
            }
        }
    }
}
