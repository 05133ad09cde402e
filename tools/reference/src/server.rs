//! The handling of good and bad frames (V1.1b3 6, V1.02 appendix A).

use crate::{Device, UNIT, framed};

/// A server and its counters.
pub struct Server {
    /// The device that it serves.
    pub device: Device,
    /// The end mark of frames in ASCII mode; `None` in RTU mode.
    pub delimiter: Option<u8>,
    /// Whether it is in listen-only mode.
    pub listening: bool,
    /// Whether listen-only mode can be entered.
    pub can_listen_only: bool,
    /// Counters in the order of their sub-functions from 0B on; the last one counts gaps.
    pub counters: [u16; 9],
    /// The event counter of function 11.
    pub events: u16,
    /// The event log, with the newest event last.
    pub log: Vec<u8>,
    /// Bad frames, and overruns, that are not yet in the log.
    pub unlogged: (u16, u16),
    /// Bits of the diagnostic register that were cleared while their cause lasts.
    cleared: [u8; 2],
}

// Indices of the counters.
/// Good frames on the bus.
pub const BUS: usize = 0;
/// Bad frames.
pub const ERRORS: usize = 1;
/// Requests refused.
pub const EXCEPTIONS: usize = 2;
/// Requests for this unit.
pub const UNIT_MESSAGES: usize = 3;
/// Requests without a reply.
pub const NO_RESPONSE: usize = 4;
/// Exceptions 07.
pub const NAK: usize = 5;
/// Exceptions 06.
pub const BUSY: usize = 6;
/// Bad frames with an overrun.
pub const OVERRUNS: usize = 7;
/// Gaps within frames.
pub const GAPS: usize = 8;

impl Server {
    /// A server that starts, in ASCII mode with this end mark or in RTU mode.
    pub fn new(delimiter: Option<u8>, device: Device) -> Self {
        Self {
            delimiter,
            listening: false,
            can_listen_only: !device.lacks.contains(&8),
            device,
            counters: [0; 9],
            events: 0,
            log: Vec::new(),
            unlogged: (0, 0),
            cleared: [0; 2],
        }
    }

    /// Counts a bad frame.
    pub fn bad(&mut self, overrun: bool) {
        self.counters[ERRORS] += 1;
        self.counters[OVERRUNS] += u16::from(overrun);
        self.unlogged.0 += 1;
        self.unlogged.1 += u16::from(overrun);
    }

    /// Handles a good frame; `torn`: the frame must not be served. Returns the frame of the reply.
    pub fn good(&mut self, unit: u8, pdu: &[u8], torn: bool) -> Option<Vec<u8>> {
        self.counters[BUS] += 1;
        if unit != UNIT && unit != 0 {
            return None;
        }
        if torn {
            self.drop_good();
            return None;
        }
        let delimiter = self.delimiter;
        let reply = self.request(unit == 0, pdu, |me, pdu| {
            let before = me.device.clone();
            let answer = me.answer(pdu);
            assert!(answer.is_ok() || me.device == before, "{pdu:02X?}");
            answer
        })?;
        Some(framed(delimiter, UNIT, &reply))
    }

    /// Counts a good frame for this unit that is not served.
    fn drop_good(&mut self) {
        self.counters[UNIT_MESSAGES] += 1;
        self.counters[NO_RESPONSE] += 1;
    }

    /// Handles a request to this unit or to all units by `answer`. Returns the PDU of the reply.
    pub fn request(
        &mut self,
        broadcast: bool,
        pdu: &[u8],
        answer: impl FnOnce(&mut Self, &[u8]) -> Result<Vec<u8>, u8>,
    ) -> Option<Vec<u8>> {
        let listening = |me: &Self| if me.listening { 0x20 } else { 0 };
        let (bad, overruns) = std::mem::take(&mut self.unlogged);
        // If there are more bad frames than the log can hold, their order is unknown. Overruns are logged first.
        for n in 0..bad.min(64) {
            let overrun = if n < overruns { 0x10 } else { 0 };
            self.log.push(0x82 + overrun + listening(self));
        }
        let to_all = if broadcast { 0x40 } else { 0 };
        self.log.push(0x80 + to_all + listening(self));
        self.counters[UNIT_MESSAGES] += 1;

        let restarts = !broadcast
            && [[8, 0, 1, 0, 0], [8, 0, 1, 0xFF, 0]]
                .iter()
                .any(|r| r == pdu);
        let hushes = !broadcast && pdu == [8, 0, 4, 0, 0] && !self.listening;
        let hushes = hushes && self.can_listen_only;
        let obeyed = (1..=127).contains(&pdu[0]) && (!self.listening || restarts);
        let silent = broadcast || hushes || self.listening || !obeyed;
        self.counters[NO_RESPONSE] += u16::from(silent);

        let can_be_broadcast = [5, 6, 15, 16, 21, 22].contains(&pdu[0]);
        let mut refused = None;
        let mut reply = None;
        if obeyed {
            let before = self.device.clone();
            // Count the request before the counters are read.
            self.events += u16::from(!matches!(pdu[0], 11 | 12));
            match answer(self, pdu) {
                Ok(pdu) => reply = Some(pdu),
                Err(code) => {
                    refused = Some(code);
                    reply = Some(vec![pdu[0] + 128, code]);
                }
            }
            let counts = refused.is_none() && (!broadcast || can_be_broadcast);
            if !counts {
                self.events -= u16::from(!matches!(pdu[0], 11 | 12));
            }
            if broadcast && !can_be_broadcast {
                self.device = before;
            }
        }
        if let Some(code) = refused {
            self.counters[EXCEPTIONS] += 1;
            if !silent {
                self.counters[NAK] += u16::from(code == 7);
                self.counters[BUSY] += u16::from(code == 6);
            }
        }
        let exception = match refused {
            Some(1..=3) if !silent => 1,
            Some(4) if !silent => 2,
            Some(5 | 6) if !silent => 4,
            Some(7) if !silent => 8,
            _ => 0,
        };
        self.log.push(0x40 + exception + listening(self));
        if !broadcast && obeyed && refused.is_none() && pdu[0] == 8 {
            self.afterwards(pdu);
        }
        reply.filter(|_| !silent)
    }

    /// Carries out the effect of function 08 after its reply.
    fn afterwards(&mut self, pdu: &[u8]) {
        let gone = |me: &mut Self| {
            me.counters = [0; 9];
            me.events = 0;
        };
        match pdu[2] {
            0x01 => {
                self.listening = false;
                self.delimiter = self.delimiter.map(|_| b'\n');
                gone(self);
                if pdu[3] == 0xFF {
                    self.log.clear();
                }
                self.log.push(0);
            }
            0x03 => self.delimiter = Some(pdu[3]),
            0x04 => {
                self.listening = true;
                self.log.push(4);
            }
            0x0A => {
                gone(self);
                self.cleared = self.register();
            }
            0x14 => self.counters[OVERRUNS] = 0,
            _ => {}
        }
    }

    /// The PDU of the reply, or an exception code.
    pub fn answer(&mut self, pdu: &[u8]) -> Result<Vec<u8>, u8> {
        let (events, bus) = (self.events.to_be_bytes(), self.counters[BUS].to_be_bytes());
        if self.device.lacks.contains(&pdu[0]) {
            return Err(1);
        }
        let alone = if pdu.len() == 1 { Ok(()) } else { Err(3) };
        match pdu[0] {
            7 => alone.map(|()| vec![7, self.device.status]),
            8 => self.diagnose(pdu),
            11 => alone.map(|()| vec![11, 0, 0, events[0], events[1]]),
            12 => {
                alone?;
                let log = self.log.iter().rev().take(64).copied();
                let body: Vec<u8> = [0, 0]
                    .into_iter()
                    .chain(events)
                    .chain(bus)
                    .chain(log)
                    .collect();
                Ok([vec![12, body.len() as u8], body].concat())
            }
            17 => {
                alone?;
                let mut body = self.device.server_id.clone();
                body.push(if self.device.running { 255 } else { 0 });
                body.extend(&self.device.additional_data);
                Ok([vec![17, body.len() as u8], body].concat())
            }
            code if self.device.custom == Some(code) => {
                let data = &pdu[1..];
                if data.is_empty() {
                    return Err(3);
                }
                self.device.kept = data.to_vec();
                let backwards: Vec<u8> = data.iter().rev().copied().collect();
                let reply = [vec![code], backwards.repeat(3)].concat();
                Ok(reply.into_iter().take(253).collect())
            }
            _ => crate::answer(&mut self.device, pdu),
        }
    }

    /// The whole diagnostic register of the device.
    fn register(&self) -> [u8; 2] {
        [0xAB, self.device.status]
    }

    fn diagnose(&mut self, pdu: &[u8]) -> Result<Vec<u8>, u8> {
        if pdu.len() < 3 {
            return Err(3);
        }
        let ascii = self.delimiter.is_some();
        let data = &pdu[3..];
        let allowed = match (pdu[1], pdu[2]) {
            (0, 0) => true,
            (0, 1) => data == [0, 0] || data == [255, 0],
            (0, 3) if ascii => {
                let taken = b":\r0123456789ABCDEF";
                data.len() == 2 && data[1] == 0 && data[0] < 128 && !taken.contains(&data[0])
            }
            (0, 4) if !self.can_listen_only => return Err(1),
            (0, 2 | 4 | 10..=18 | 20) => data == [0, 0],
            _ => return Err(1),
        };
        if !allowed {
            return Err(3);
        }
        let [high, low] = match pdu[2] {
            2 => {
                let register = self.register();
                self.cleared = [0, 1].map(|at| self.cleared[at] & register[at]);
                [0, 1].map(|at| register[at] & !self.cleared[at])
            }
            sub @ 11..=18 => self.counters[usize::from(sub) - 11].to_be_bytes(),
            _ => return Ok(pdu.to_vec()),
        };
        Ok(vec![8, 0, pdu[2], high, low])
    }
}

/// The longest value that fits into a reply with no other value.
const LONGEST: usize = 253 - 7 - 2;

/// Serves function 2B/0E with as many whole objects as fit into a reply.
pub(crate) fn identify(device: &Device, pdu: &[u8]) -> Result<Vec<u8>, u8> {
    match pdu {
        [_] => return Err(3),
        [_, mei, ..] if *mei != 14 => return Err(1),
        _ => {}
    }
    if pdu.len() != 4 || !(1..=4).contains(&pdu[2]) {
        return Err(3);
    }
    let (code, first) = (pdu[2], pdu[3]);
    let last = [2, 6, 255, 255][usize::from(code) - 1];
    let there: Vec<(u8, &[u8])> = (0..=last)
        .filter_map(|id| Some((id, device.objects[usize::from(id)].as_deref()?)))
        .map(|(id, value)| (id, &value[..value.len().min(LONGEST)]))
        .collect();
    let start = there.iter().position(|(id, _)| *id == first);
    let mut reply = vec![0x2B, 14, code, 0x83, 0, 0, 0];
    if code == 4 {
        let (id, value) = there[start.ok_or(2)?];
        reply.extend([id, value.len() as u8]);
        reply.extend(value);
        reply[6] = 1;
        return Ok(reply);
    }
    for (id, value) in &there[start.unwrap_or(0)..] {
        if reply.len() + 2 + value.len() > 253 {
            reply[4] = 255;
            reply[5] = *id;
            break;
        }
        reply.extend([*id, value.len() as u8]);
        reply.extend(*value);
        reply[6] += 1;
    }
    Ok(reply)
}
