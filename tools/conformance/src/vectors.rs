//! Worked frames of manuals. Frames with a right CRC are test vectors, the others errata.
//!
//! `data/frames.txt` has the frames as they are printed.

use std::fmt::Write as _;

use crate::frame::{crc, hex};

const DATA: &str = include_str!("../data/frames.txt");

/// A frame as a manual prints it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Worked {
    /// The manual.
    pub source: &'static str,
    /// The place in the manual.
    pub place: &'static str,
    /// Whether the frame is a request; otherwise it is a reply.
    pub request: bool,
    /// The frame, including the printed CRC.
    pub bytes: Vec<u8>,
}

impl Worked {
    /// Returns the frame without its CRC, and the CRC as printed.
    fn parts(&self) -> (&[u8], [u8; 2]) {
        match self.bytes.split_last_chunk::<2>() {
            Some((body, printed)) => (body, *printed),
            None => (&[], [0; 2]),
        }
    }

    /// Returns whether the printed CRC is right.
    pub fn crc_ok(&self) -> bool {
        let (body, printed) = self.parts();
        crc(body) == printed
    }
}

/// Returns every worked frame, in the order of the manuals.
pub fn frames() -> impl Iterator<Item = Worked> {
    DATA.lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .filter_map(worked)
}

fn worked(line: &'static str) -> Option<Worked> {
    let mut parts = line.split('|').map(str::trim);
    let (source, place, kind, bytes) = (parts.next()?, parts.next()?, parts.next()?, parts.next()?);
    let bytes: Result<Vec<u8>, _> = bytes
        .split_whitespace()
        .map(|pair| u8::from_str_radix(pair, 16))
        .collect();
    Some(Worked {
        source,
        place,
        request: kind == "request",
        bytes: bytes.ok()?,
    })
}

/// Returns the errata as a table in Markdown.
pub fn errata() -> String {
    let mut table = "| manual | place | frame as printed | CRC printed | CRC right |\n".to_owned();
    table.push_str("|---|---|---|---|---|\n");
    for worked in frames().filter(|worked| !worked.crc_ok()) {
        let (body, printed) = worked.parts();
        // Writing to a String cannot fail.
        let _ = writeln!(
            table,
            "| {} | {} | `{}` | `{}` | `{}` |",
            worked.source,
            worked.place,
            hex(&worked.bytes),
            hex(&printed),
            hex(&crc(body))
        );
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Mode;

    #[test]
    fn every_line_of_the_data_is_a_frame() {
        let lines = DATA.lines().filter(|line| line.contains('|'));
        // The comment at the top of the file has bars, too.
        assert_eq!(frames().count(), lines.count() - 1);
        assert!(frames().all(|worked| worked.bytes.len() >= 5));
    }

    #[test]
    fn frame_with_a_right_crc_is_decoded_and_encoded_and_a_wrong_one_refused() {
        let mut right = 0;
        for worked in frames() {
            let decoded = Mode::Rtu.decode(&worked.bytes);
            if worked.crc_ok() {
                right += 1;
                let (unit, pdu) = decoded.unwrap();
                assert_eq!(Mode::Rtu.frame(unit, &pdu), worked.bytes);
                let ascii = Mode::Ascii.frame(unit, &pdu);
                assert_eq!(Mode::Ascii.decode(&ascii), Ok((unit, pdu)));
            } else {
                assert!(decoded.is_err(), "{worked:?}");
            }
        }
        assert!(right > 10 && right < frames().count(), "{right} are right");
    }
}
