//! The reply on its way out: head, body, and the CRC made as they leave.

use crate::{Adu, Head, crc};

/// What the line driver has to do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Send this byte.
    Byte(u8),
    /// The body is not here yet: ask again once it has been handed over ([`Transmitter::body`]).
    Wait,
    /// The frame is complete: release the line after the last stop bit.
    Done,
}

/// Gives out one reply byte by byte.
#[derive(Debug)]
pub struct Transmitter<'a> {
    head: Head,
    body: Option<&'a mut Adu>,
    /// How many bytes have gone.
    sent: u16,
    /// The CRC of those bytes.
    crc: u16,
}

/// Bytes of the CRC.
const CRC_LEN: u16 = 2;

impl<'a> Transmitter<'a> {
    /// Nothing to send.
    pub const fn idle() -> Self {
        Self {
            head: Head::EMPTY,
            body: None,
            sent: CRC_LEN,
            crc: crc::START,
        }
    }

    /// A reply that starts with `head`. The first byte is ready at once.
    #[inline]
    pub const fn new(head: Head) -> Self {
        Self {
            head,
            body: None,
            sent: 0,
            crc: crc::START,
        }
    }

    /// Hands over the body: what [`Server::carry_out`](crate::Server::carry_out) has left in the
    /// buffer. A buffer that is not needed, because the head is the whole reply or the body is here
    /// already, comes straight back, for the receiver.
    #[inline]
    #[must_use = "a buffer that is not needed belongs back in the receiver"]
    pub fn body(&mut self, adu: &'a mut Adu) -> Option<&'a mut Adu> {
        if self.head.body_len() == 0 || self.body.is_some() {
            return Some(adu);
        }
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
        let head = u16::from(self.head.len());
        let body_end = head + u16::from(self.head.body_len());
        let byte = if self.sent < head {
            self.head.get(self.sent)
        } else if self.sent < body_end {
            match &self.body {
                Some(adu) => adu.get(self.sent - head),
                None => return Next::Wait,
            }
        } else if self.sent < body_end + CRC_LEN {
            // Low byte first; a CRC fed with its own low byte moves its high byte down to be the
            // next one.
            let [low, _] = self.crc.to_le_bytes();
            low
        } else {
            return Next::Done;
        };
        self.crc = crc::step(self.crc, byte);
        self.sent += 1;
        Next::Byte(byte)
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

    #[test]
    fn nothing_to_send_is_done() {
        assert_eq!(Transmitter::idle().next(), Next::Done);
    }

    #[test]
    fn a_head_alone_is_followed_by_its_crc() {
        let head = Head::exception(1, 3, Exception::ServerDeviceFailure);
        let mut transmitter = Transmitter::new(head);
        for byte in [0x01, 0x83, 0x04, 0x40, 0xF3] {
            assert_eq!(transmitter.next(), Next::Byte(byte));
        }
        assert_eq!(transmitter.next(), Next::Done);
        assert_eq!(transmitter.next(), Next::Done);
        let mut adu = Adu::new();
        assert!(transmitter.body(&mut adu).is_some(), "not needed");
        assert!(transmitter.take_buffer().is_none());
    }

    #[test]
    fn it_waits_for_the_body_as_long_as_it_takes() {
        let mut adu = Adu::new();
        adu.resize(2).copy_from_slice(&[0x03, 0xE8]);
        let mut transmitter = Transmitter::new(Head::read(1, 3, 2));
        for byte in [0x01, 0x03, 0x02] {
            assert_eq!(transmitter.next(), Next::Byte(byte));
        }
        assert_eq!(transmitter.next(), Next::Wait);
        assert_eq!(transmitter.next(), Next::Wait);
        assert!(transmitter.body(&mut adu).is_none());
        let mut other = Adu::new();
        assert!(transmitter.body(&mut other).is_some());
        for byte in [0x03, 0xE8, 0xB8, 0xFA] {
            assert_eq!(transmitter.next(), Next::Byte(byte));
        }
        assert_eq!(transmitter.next(), Next::Done);
        assert!(transmitter.take_buffer().is_some());
    }
}
