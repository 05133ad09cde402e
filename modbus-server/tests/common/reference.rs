//! A second server, as plain as can be: what a unit should do, told independently of the crate.

use super::{MAX_WORD, Points, UNIT, crc};

/// Serves the PDU of a request to this unit. `None`: silence.
pub fn serve(points: &mut Points, pdu: &[u8]) -> Option<Vec<u8>> {
    let function = pdu[0];
    if function == 0 || function > 127 {
        return None;
    }
    Some(answer(points, pdu).unwrap_or_else(|code| vec![function + 128, code]))
}

fn answer(points: &mut Points, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    let field = |at: usize| pdu[at] as usize * 256 + pdu[at + 1] as usize;
    let function = pdu[0];
    match function {
        1..=4 => {
            let (bits, limit) = (function <= 2, if function <= 2 { 2000 } else { 125 });
            if pdu.len() != 5 || field(3) == 0 || field(3) > limit {
                return Err(3);
            }
            let there = if bits {
                points.bits.len()
            } else {
                points.words.len()
            };
            if field(1) + field(3) > there {
                return Err(2);
            }
            let mut data = vec![
                0;
                if bits {
                    field(3).div_ceil(8)
                } else {
                    field(3) * 2
                }
            ];
            for n in 0..field(3) {
                if bits && points.bits[field(1) + n] {
                    data[n / 8] += 1 << (n % 8);
                }
                if !bits {
                    data[2 * n] = (points.words[field(1) + n] / 256) as u8;
                    data[2 * n + 1] = (points.words[field(1) + n] % 256) as u8;
                }
            }
            Ok([vec![function, data.len() as u8], data].concat())
        }
        5 | 6 => {
            if pdu.len() != 5 || (function == 5 && field(3) != 0 && field(3) != 0xFF00) {
                return Err(3);
            }
            let there = if function == 5 {
                points.bits.len()
            } else {
                points.words.len()
            };
            if field(1) >= there.min(points.read_only_from as usize) {
                return Err(2);
            }
            if function == 6 && field(3) > MAX_WORD as usize {
                return Err(3);
            }
            if function == 5 {
                points.bits[field(1)] = field(3) != 0;
            } else {
                points.words[field(1)] = field(3) as u16;
            }
            Ok(pdu.to_vec())
        }
        15 | 16 => {
            if pdu.len() < 6 {
                return Err(3);
            }
            let (count, limit) = (field(3), if function == 15 { 1968 } else { 123 });
            let bytes = if function == 15 {
                count.div_ceil(8)
            } else {
                count * 2
            };
            if count == 0 || count > limit || pdu[5] as usize != bytes || pdu.len() != 6 + bytes {
                return Err(3);
            }
            let there = if function == 15 {
                points.bits.len()
            } else {
                points.words.len()
            };
            if field(1) + count > there.min(points.read_only_from as usize) {
                return Err(2);
            }
            if function == 16 && (0..count).any(|n| field(6 + 2 * n) > MAX_WORD as usize) {
                return Err(3);
            }
            for n in 0..count {
                if function == 15 {
                    points.bits[field(1) + n] = pdu[6 + n / 8] & (1 << (n % 8)) != 0;
                } else {
                    points.words[field(1) + n] = field(6 + 2 * n) as u16;
                }
            }
            Ok(pdu[..5].to_vec())
        }
        _ => Err(1),
    }
}

/// A whole unit on a line: collects what it hears, judges it at the end.
pub struct Reference {
    pub points: Points,
    pub strict: bool,
    pub heard: Vec<u8>,
    pub faulty: bool,
    pub paused: bool,
    pub torn: bool,
    pub bus_messages: u16,
    pub communication_errors: u16,
    pub gaps: u16,
}

impl Reference {
    pub fn new(points: Points, strict: bool) -> Self {
        Self {
            points,
            strict,
            heard: Vec::new(),
            faulty: false,
            paused: false,
            torn: false,
            bus_messages: 0,
            communication_errors: 0,
            gaps: 0,
        }
    }

    pub fn character(&mut self, byte: u8, faulty: bool) {
        if self.paused {
            self.gaps += 1;
            self.torn = true;
        }
        self.paused = false;
        self.heard.push(byte);
        self.faulty |= faulty;
    }

    pub fn pause(&mut self) {
        self.paused = !self.heard.is_empty();
    }

    /// The reply to what was heard before this silence.
    pub fn silence(&mut self) -> Option<Vec<u8>> {
        let frame = std::mem::take(&mut self.heard);
        let faulty = std::mem::take(&mut self.faulty);
        let torn = std::mem::take(&mut self.torn);
        self.paused = false;
        if frame.is_empty() {
            return None;
        }
        let good = (4..=256).contains(&frame.len()) && {
            let (body, check) = frame.split_at(frame.len() - 2);
            crc(body) == check
        };
        if faulty || !good {
            self.communication_errors += 1;
            return None;
        }
        self.bus_messages += 1;
        if torn && self.strict {
            return None;
        }
        let pdu = &frame[1..frame.len() - 2];
        let reads = (1..=4).contains(&pdu[0]);
        match frame[0] {
            UNIT => {
                let reply = serve(&mut self.points, pdu)?;
                Some(super::frame(UNIT, &reply))
            }
            0 if !reads => {
                serve(&mut self.points, pdu);
                None
            }
            _ => None,
        }
    }
}
