//! Decides whether the bytes received so far contain the answer to a request.

use crate::adu::{Framing, response_length};

/// Number of bytes in front of an answer that are tolerated: a driver that is switched on can create them.
pub(crate) const NOISE: usize = 3;

/// A request that waits for its answer.
#[derive(Debug)]
pub struct Waiting<'a> {
    /// Framing of the line.
    pub framing: Framing,
    /// Transaction number of the request, on Modbus TCP.
    pub transaction: u16,
    /// Address of the unit.
    pub unit: u8,
    /// PDU of the request.
    pub pdu: &'a [u8],
}

impl Waiting<'_> {
    /// Returns the answer in `bytes` and its position there; `None` while there is none.
    #[must_use]
    pub fn find(&self, bytes: &[u8]) -> Option<(Vec<u8>, std::ops::Range<usize>)> {
        match self.framing {
            Framing::Rtu => {
                (0..bytes.len().min(NOISE + 1)).find_map(|start| self.rtu_at(bytes, start))
            }
            Framing::Ascii => {
                let starts = bytes.iter().enumerate().filter(|(_, byte)| **byte == b':');
                let mut frames = starts.filter_map(|(start, _)| {
                    let length = self.framing.length(bytes.get(start..)?)?;
                    Some(start..start + length)
                });
                frames.find_map(|range| {
                    let pdu = self.answer(bytes.get(range.clone())?)?;
                    Some((pdu, range))
                })
            }
            Framing::Mbap => {
                let mut start = 0;
                loop {
                    let rest = bytes.get(start..)?;
                    let range = start..start + self.framing.length(rest)?;
                    let frame = bytes.get(range.clone())?;
                    if frame.starts_with(&self.transaction.to_be_bytes())
                        && let Some(pdu) = self.answer(frame)
                    {
                        return Some((pdu, range));
                    }
                    start = range.end;
                }
            }
        }
    }

    /// Returns the answer, if all bytes before a silence are one frame. For functions whose length only the silence
    /// shows.
    #[must_use]
    pub fn whole(&self, bytes: &[u8]) -> Option<Vec<u8>> {
        (self.framing == Framing::Rtu).then(|| self.answer(bytes))?
    }

    fn rtu_at(&self, bytes: &[u8], start: usize) -> Option<(Vec<u8>, std::ops::Range<usize>)> {
        let frame = bytes.get(start..)?;
        let range = start..start + response_length(self.pdu, frame)?;
        let pdu = self.answer(bytes.get(range.clone())?)?;
        Some((pdu, range))
    }

    fn answer(&self, frame: &[u8]) -> Option<Vec<u8>> {
        let (unit, pdu) = self.framing.open(frame)?;
        (unit == self.unit && self.fits(&pdu)).then_some(pdu)
    }

    /// Returns whether a response can belong to this request, and not be a late one to another.
    #[must_use]
    pub fn fits(&self, response: &[u8]) -> bool {
        let (Some(asked), Some(answered)) = (self.pdu.first(), response.first()) else {
            return false;
        };
        if *answered == asked | 0x80 {
            return response.len() == 2;
        }
        let count = |at: usize| match self.pdu.get(at..at + 2) {
            Some([high, low]) => usize::from(u16::from_be_bytes([*high, *low])),
            _ => 0,
        };
        let counted =
            |bytes: usize| response.len() == bytes + 2 && usize::from(response[1]) == bytes;
        answered == asked
            && match asked {
                0x01 | 0x02 => counted(count(3).div_ceil(8)),
                0x03 | 0x04 | 0x17 => counted(count(3) * 2),
                // Lengths and types of the groups, and two bytes for each record.
                0x14 => {
                    let groups = self.pdu.get(2..).unwrap_or_default().chunks_exact(7);
                    let bytes = groups
                        .map(|group| 2 + 2 * usize::from(u16::from_be_bytes([group[5], group[6]])));
                    counted(bytes.sum())
                }
                0x05 | 0x06 | 0x16 => response == self.pdu,
                // Returns the data of the request.
                0x08 if self.pdu.get(1..3) == Some(&[0, 0]) => response == self.pdu,
                0x0F | 0x10 => Some(response) == self.pdu.get(..5),
                _ => true,
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const READ: &[u8] = &[3, 0, 0x10, 0, 1];

    fn waiting(framing: Framing, pdu: &[u8]) -> Waiting<'_> {
        Waiting {
            framing,
            transaction: 9,
            unit: 1,
            pdu,
        }
    }

    #[test]
    fn an_answer_is_found_after_noise_once_it_is_complete() {
        for framing in [Framing::Rtu, Framing::Ascii, Framing::Mbap] {
            let waiting = waiting(framing, READ);
            let answer = framing.frame(9, 1, &[3, 2, 0, 5]);
            for length in 0..answer.len() {
                assert_eq!(waiting.find(&answer[..length]), None, "{framing:?}");
            }
            assert_eq!(
                waiting.find(&answer),
                Some((vec![3, 2, 0, 5], 0..answer.len()))
            );
            if framing != Framing::Mbap {
                let noisy = [&[0, 0xFF], &answer[..]].concat();
                assert!(waiting.find(&noisy).is_some(), "{framing:?}");
            }
        }
    }

    #[test]
    fn frames_that_cannot_be_the_answer_are_ignored() {
        for framing in [Framing::Rtu, Framing::Ascii, Framing::Mbap] {
            let find = |unit, pdu: &[u8]| waiting(framing, READ).find(&framing.frame(9, unit, pdu));
            assert_eq!(find(2, &[3, 2, 0, 5]), None, "from another unit");
            assert_eq!(find(1, &[3, 4, 0, 5, 0, 6]), None, "to another request");
            assert_eq!(find(1, &[4, 2, 0, 5]), None, "of another function");
            assert!(find(1, &[0x83, 2]).is_some(), "an exception");
        }
        let write = waiting(Framing::Rtu, &[6, 1, 0, 0x5A, 0x17]);
        let other = Framing::Rtu.frame(0, 1, &[6, 1, 0, 0x5A, 0x18]);
        assert_eq!(write.find(&other), None);
        let data = waiting(Framing::Rtu, &[8, 0, 0, 0x12, 0x34]);
        let other = Framing::Rtu.frame(0, 1, &[8, 0, 0, 0x12, 0x33]);
        assert_eq!(data.find(&other), None, "the data of another 08/00");
        let late = Framing::Mbap.frame(8, 1, &[3, 2, 0, 5]);
        assert_eq!(waiting(Framing::Mbap, READ).find(&late), None);
        let then = [late, Framing::Mbap.frame(9, 1, &[3, 2, 0, 5])].concat();
        assert!(waiting(Framing::Mbap, READ).find(&then).is_some());
    }
}
