//! Sends a reply: unit address and PDU, and the CRC or LRC, which are computed during sending.

use super::{Framing, ascii};
use crate::{Adu, crc};

/// Returns one reply character by character.
#[derive(Debug)]
pub(super) struct Transmitter<'a> {
    framing: Framing,
    stage: Stage,
    /// In ASCII mode: the byte whose first digit was sent.
    half: Option<u8>,
    adu: Option<&'a mut Adu>,
    /// In RTU mode: number of bytes left. In ASCII mode: 0.
    left: u16,
    /// Index of the next byte.
    at: u16,
    /// CRC of the bytes sent; in ASCII mode their sum.
    check: u16,
}

/// Next part of the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// In RTU mode, unit and PDU, then the first byte of the CRC. In ASCII mode, the colon.
    Start,
    /// In ASCII mode, unit and PDU, then the LRC.
    Bytes,
    /// The second byte of the CRC, or the carriage return.
    End,
    /// In ASCII mode, the delimiter.
    Delimiter,
    /// Nothing.
    Over,
}

impl<'a> Transmitter<'a> {
    /// Returns a transmitter with nothing to send.
    pub(super) const fn idle() -> Self {
        Self {
            framing: Framing::Rtu,
            stage: Stage::Over,
            half: None,
            adu: None,
            left: 0,
            at: 0,
            check: 0,
        }
    }

    /// Returns a transmitter of a reply, unit address and PDU.
    #[inline]
    pub(super) const fn new(adu: &'a mut Adu, framing: Framing) -> Self {
        let left = match framing {
            // At most 256.
            Framing::Rtu => adu.len() as u16,
            Framing::Ascii { .. } => 0,
        };
        Self {
            framing,
            stage: Stage::Start,
            half: None,
            adu: Some(adu),
            left,
            at: 0,
            check: crc::START,
        }
    }

    /// Returns the next character to send, or `None` when the frame is complete.
    #[inline(always)]
    pub(super) fn next(&mut self) -> Option<u8> {
        if self.left > 0
            && let Some(adu) = &self.adu
        {
            // The index is below 256, because bytes are left.
            let byte = adu.get(self.at as u8);
            self.at += 1;
            self.left -= 1;
            self.check = crc::step(self.check, byte);
            return Some(byte);
        }
        self.rest()
    }

    /// Returns what follows when the next character is not a byte of unit or PDU in RTU mode.
    #[inline(never)]
    fn rest(&mut self) -> Option<u8> {
        if let Framing::Ascii { delimiter } = self.framing {
            return self.ascii(delimiter);
        }
        self.stage = match self.stage {
            Stage::Start => Stage::End,
            Stage::End => Stage::Over,
            _ => return None,
        };
        // Low byte first. Updating a CRC with its own low byte shifts its high byte down, which is sent next.
        let [low, _] = self.check.to_le_bytes();
        self.check = crc::step(self.check, low);
        Some(low)
    }

    /// Returns the next character in ASCII mode.
    #[inline(always)]
    fn ascii(&mut self, delimiter: u8) -> Option<u8> {
        if let Some(byte) = self.half.take() {
            return Some(ascii::character(byte));
        }
        let byte = match self.stage {
            Stage::Bytes => {
                let byte = self.adu.as_ref()?.as_slice().get(usize::from(self.at));
                byte.copied().unwrap_or_else(|| {
                    self.stage = Stage::End;
                    // The sum is not used after this.
                    self.check.to_le_bytes()[0].wrapping_neg()
                })
            }
            Stage::Start => {
                self.check = 0;
                return self.then(Stage::Bytes, ascii::START);
            }
            Stage::End => return self.then(Stage::Delimiter, ascii::CR),
            Stage::Delimiter => return self.then(Stage::Over, delimiter),
            Stage::Over => return None,
        };
        self.at += 1;
        self.check = self.check.wrapping_add(u16::from(byte));
        self.half = Some(byte);
        Some(ascii::character(byte >> 4))
    }

    const fn then(&mut self, stage: Stage, character: u8) -> Option<u8> {
        self.stage = stage;
        Some(character)
    }

    /// Returns the buffer for the receiver and ends the reply. Before the last character this aborts the reply: no CRC
    /// or LRC is sent, so no master accepts it.
    #[inline]
    pub(super) const fn take_buffer(&mut self) -> Option<&'a mut Adu> {
        (self.stage, self.half) = (Stage::Over, None);
        self.adu.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aborted_reply_sends_neither_crc_nor_lrc() {
        let rtu: &[u8] = &[0x01, 0x03, 0x04, 1, 2, 3, 4, 0x5B, 0x3C];
        let ascii: &[u8] = b":01030401020304EE\r\n";
        for (framing, whole) in [(Framing::Rtu, rtu), (Framing::ASCII, ascii)] {
            for sent in 0..=whole.len() {
                let mut adu = Adu::new();
                adu.extend(&rtu[..7]);
                let mut transmitter = Transmitter::new(&mut adu, framing);
                for character in &whole[..sent] {
                    assert_eq!(transmitter.next(), Some(*character), "{framing:?}");
                }
                assert!(transmitter.take_buffer().is_some());
                assert_eq!(transmitter.next(), None, "{framing:?} {sent}");
                assert!(transmitter.take_buffer().is_none());
            }
        }
    }
}
