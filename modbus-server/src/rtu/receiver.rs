//! Characters and silences in, good requests for this unit out.

use core::mem;

use super::Faults;
use crate::counters::count;
use crate::server::BROADCAST;
use crate::{Adu, LineCounters, crc};

/// A good request for this unit, or a broadcast.
#[derive(Debug)]
pub struct Closed<'a> {
    /// Unit address and PDU; the CRC is cut off. Give the buffer back to the receiver when it is
    /// free again.
    pub adu: &'a mut Adu,
    /// The counters of the line, this frame included.
    pub line: LineCounters,
}

/// The receiving half of an RTU line (V1.02 2.5.1.1, figure 14).
///
/// It starts deaf: whatever arrives before the first t3.5 of silence belongs to a frame whose start
/// was missed.
///
/// It needs two buffers ([`give_back`](Self::give_back)): one to fill, and a spare to go on with
/// while the first is away with a request. Without a spare the next frame is followed to its end,
/// and counted, but not kept.
#[derive(Debug)]
pub struct Receiver<'a> {
    unit: u8,
    strict_t15: bool,
    state: u8,
    /// The first byte of the frame: the unit address.
    address: u8,
    /// The CRC of the frame so far.
    crc: u16,
    /// Bytes of a frame that is not kept.
    unkept: u16,
    filling: Option<&'a mut Adu>,
    spare: Option<&'a mut Adu>,
    counters: LineCounters,
}

// `state`: 0 while all is well in the middle of a frame, so that a character needs a single test.
/// Everything is ignored up to the next t3.5.
const DEAF: u8 = 1;
/// No frame yet: the next character starts one.
const IDLE: u8 = 1 << 1;
/// t1.5 has passed since the last character.
const PAUSED: u8 = 1 << 2;
/// The CRC has been cut off already, at t1.5.
const CUT: u8 = 1 << 3;
/// A gap above t1.5 was in the frame, and that is not tolerated.
const TORN: u8 = 1 << 4;
/// A faulty character, or too many of them.
const SPOILED: u8 = 1 << 5;
/// One of the faults was an overrun.
const OVERRUN: u8 = 1 << 6;
/// There was no buffer when the frame started: it is only followed.
const UNKEPT: u8 = 1 << 7;

/// Unit address, function code, CRC.
const SHORTEST: usize = 4;
/// Bytes of the CRC.
const CRC_LEN: usize = 2;

impl<'a> Receiver<'a> {
    /// A receiver without buffers for unit address `unit`. `strict_t15`: drop a frame with a gap
    /// above t1.5 in it, as the standard asks for; otherwise only count the gap.
    pub const fn new(unit: u8, strict_t15: bool) -> Self {
        Self {
            unit,
            strict_t15,
            state: DEAF,
            address: 0,
            crc: crc::START,
            unkept: 0,
            filling: None,
            spare: None,
            counters: LineCounters {
                bus_messages: 0,
                communication_errors: 0,
                overruns: 0,
                gaps: 0,
                dropped: 0,
            },
        }
    }

    /// Gives the receiver a buffer, at the start or after use. A third one at a time is not kept.
    #[inline]
    pub fn give_back(&mut self, adu: &'a mut Adu) {
        let place = if self.spare.is_none() {
            &mut self.spare
        } else {
            &mut self.filling
        };
        if place.is_none() {
            *place = Some(adu);
        }
    }

    /// A character has arrived.
    #[inline]
    pub fn character(&mut self, byte: u8, faults: Faults) {
        if (self.state | faults.bits()) != 0 && !self.special(byte, faults) {
            return;
        }
        self.crc = crc::step(self.crc, byte);
        if let Some(adu) = &mut self.filling
            && !adu.push(byte)
        {
            self.state |= SPOILED;
        }
    }

    /// 1.5 characters of silence have passed. If the frame is complete as it stands, it is lent for
    /// a look ahead: what is decided on it holds if [`t35`](Self::t35) comes next, and is void if
    /// another character does.
    pub fn t15(&mut self) -> Option<&Adu> {
        if self.state & (DEAF | IDLE) != 0 {
            return None;
        }
        self.state |= PAUSED;
        if self.state & (TORN | SPOILED | UNKEPT) != 0
            || !self.is_complete(self.state)
            || !self.is_for_us()
        {
            return None;
        }
        let adu = self.filling.as_deref_mut()?;
        if self.state & CUT == 0 {
            self.state |= CUT;
            adu.cut(CRC_LEN);
        }
        Some(adu)
    }

    /// 3.5 characters of silence have passed: the frame is closed. `Some` only for a good one to
    /// this unit or to all; everything else is counted and dropped.
    #[inline]
    pub fn t35(&mut self) -> Option<Closed<'a>> {
        let state = mem::replace(&mut self.state, IDLE);
        if state & (DEAF | IDLE) != 0 {
            return None;
        }
        if state & OVERRUN != 0 {
            count(&mut self.counters.overruns);
        }
        // A frame that was cut at t1.5 is complete: it was found so then.
        if state & SPOILED != 0 || (state & CUT == 0 && !self.is_complete(state)) {
            count(&mut self.counters.communication_errors);
            return None;
        }
        count(&mut self.counters.bus_messages);
        if state & TORN != 0 || !self.is_for_us() {
            return None;
        }
        if state & UNKEPT != 0 {
            count(&mut self.counters.dropped);
            return None;
        }
        let adu = self.filling.take()?;
        if state & CUT == 0 {
            adu.cut(CRC_LEN);
        }
        Some(Closed {
            adu,
            line: self.counters,
        })
    }

    /// The unit has been sending, with its receiver off, and is done: the next character starts a
    /// frame.
    #[inline]
    pub fn resume(&mut self) {
        self.state = IDLE;
    }

    /// What has been counted so far.
    pub const fn counters(&self) -> &LineCounters {
        &self.counters
    }

    /// Sees to a character that is not just the next good one of a frame. Whether it is to be kept.
    #[cold]
    #[inline(never)]
    fn special(&mut self, byte: u8, faults: Faults) -> bool {
        if self.state & DEAF != 0 {
            return false;
        }
        if self.state & IDLE != 0 {
            self.begin(byte);
        }
        if self.state & PAUSED != 0 {
            self.go_on();
        }
        if faults != Faults::NONE {
            self.state |= SPOILED;
        }
        if faults.contains(Faults::OVERRUN) {
            self.state |= OVERRUN;
        }
        if self.state & UNKEPT != 0 {
            self.follow(byte);
            return false;
        }
        true
    }

    /// Starts a frame.
    fn begin(&mut self, address: u8) {
        self.state = 0;
        self.address = address;
        self.crc = crc::START;
        self.unkept = 0;
        if self.filling.is_none() {
            self.filling = self.spare.take();
        }
        match &mut self.filling {
            Some(adu) => adu.clear(),
            None => self.state |= UNKEPT,
        }
    }

    /// The frame goes on after t1.5 of silence.
    fn go_on(&mut self) {
        count(&mut self.counters.gaps);
        if let (true, Some(adu)) = (self.state & CUT != 0, &mut self.filling) {
            adu.uncut(CRC_LEN);
        }
        self.state &= !(PAUSED | CUT);
        if self.strict_t15 {
            self.state |= TORN;
        }
    }

    /// A byte of a frame that is not kept.
    fn follow(&mut self, byte: u8) {
        self.crc = crc::step(self.crc, byte);
        self.unkept = self.unkept.saturating_add(1);
        if usize::from(self.unkept) > Adu::CAPACITY {
            self.state |= SPOILED;
        }
    }

    /// Whether the bytes of a frame in this state make a good one.
    fn is_complete(&self, state: u8) -> bool {
        let len = match &self.filling {
            Some(adu) if state & UNKEPT == 0 => adu.len(),
            _ => usize::from(self.unkept),
        };
        self.crc == crc::GOOD && len >= SHORTEST
    }

    fn is_for_us(&self) -> bool {
        self.address == self.unit || self.address == BROADCAST
    }
}
