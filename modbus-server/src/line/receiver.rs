//! Characters and silences in, good requests for this unit out.

use super::ascii::{self, Part, Reader, Width};
use super::state::{
    ASCII, ASCII_ENDED, ASCII_IDLE, DEAF, IDLE, NOT_ENDED, OVERRUN, PAUSED, RTU, SPOILED, TORN,
    UNKEPT,
};
use super::{Faults, Framing, Units};
use crate::counters::count;
use crate::server::BROADCAST;
use crate::{Adu, LineCounters, crc};

/// A good request for this unit, or a broadcast.
#[derive(Debug)]
pub struct Closed<'a> {
    /// Unit address and PDU; the CRC or LRC is cut off. Give the buffer back to the receiver when
    /// it is free again.
    pub adu: &'a mut Adu,
    /// The counters of the line, this frame included.
    pub line: LineCounters,
}

/// The receiving half of a line (V1.02 2.5.1.1, figure 14, for RTU; 2.5.2.1, figure 17, for ASCII).
///
/// A program makes it for its [`Port`](super::Port), which calls all other methods.
///
/// In RTU mode it starts deaf: whatever arrives before the first t3.5 of silence belongs to a frame
/// whose start was missed. In ASCII mode nothing counts that comes before a colon.
///
/// It needs two buffers ([`give_back`](Self::give_back)): one to fill, and a spare to go on with
/// while the first is away with a request. Without a spare the next frame is followed to its end,
/// and counted, but not kept.
///
/// `U` is a `u8` for a single unit address, or a [`UnitSet`](super::UnitSet).
#[derive(Debug)]
pub struct Receiver<'a, U = u8> {
    units: U,
    strict_t15: bool,
    state: u16,
    /// The first byte of a frame that is not kept: the unit address.
    address: u8,
    /// The CRC of the frame so far; in ASCII mode the sum of its bytes, in the high byte.
    check: u16,
    /// Bytes of a frame that is not kept.
    unkept: u16,
    /// Of the frame, or empty for the next one.
    filling: Option<&'a mut Adu>,
    spare: Option<&'a mut Adu>,
    counters: LineCounters,
    reader: Reader,
}

impl<'a, U: Units> Receiver<'a, U> {
    /// A receiver of an RTU line, without buffers, for requests to `units`. `strict_t15`: drop a
    /// frame with a gap above t1.5 in it, as the standard asks for; otherwise only count the gap.
    pub const fn rtu(units: U, strict_t15: bool) -> Self {
        Self::new(units, strict_t15, Width::Eight, DEAF | UNKEPT)
    }

    /// A receiver of an ASCII line, without buffers, for requests to `units`. Frames end with CR
    /// LF, until [`set_framing`](Self::set_framing).
    pub const fn ascii(units: U, width: Width) -> Self {
        Self::new(units, false, width, ASCII | IDLE | UNKEPT)
    }

    const fn new(units: U, strict_t15: bool, width: Width, state: u16) -> Self {
        Self {
            units,
            strict_t15,
            state,
            address: 0,
            check: if state & ASCII == 0 { crc::START } else { 0 },
            unkept: 0,
            filling: None,
            spare: None,
            counters: LineCounters::ZERO,
            reader: Reader::new(width),
        }
    }

    /// Takes over the end mark of an ASCII line; the mode itself does not change.
    pub const fn set_framing(&mut self, framing: Framing) {
        if let Framing::Ascii { delimiter } = framing {
            self.reader.set_delimiter(delimiter);
        }
    }

    /// Gives the receiver a buffer, at the start or after use. A third one at a time is not kept.
    #[inline]
    pub fn give_back(&mut self, adu: &'a mut Adu) {
        adu.clear();
        if self.filling.is_none() {
            self.filling = Some(adu);
            // A frame that began without one is followed to its end all the same.
            if self.state & (DEAF | IDLE) != 0 {
                self.state &= !UNKEPT;
            }
        } else if self.spare.is_none() {
            self.spare = Some(adu);
        }
    }

    /// Gives back the buffer of a request that nobody has served and counts the request as dropped.
    #[cold]
    #[inline(never)]
    pub fn drop_request(&mut self, adu: &'a mut Adu) {
        count(&mut self.counters.dropped);
        self.give_back(adu);
    }

    /// A character has arrived.
    #[inline]
    pub fn character(&mut self, byte: u8, faults: Faults) {
        let special = self.state | u16::from(faults.bits());
        if special != 0 {
            if special != IDLE {
                return self.special(byte, faults);
            }
            // The first of an RTU frame is as good as any other: all is ready for it.
            self.state = 0;
        }
        self.check = crc::step(self.check, byte);
        self.keep(byte);
    }

    /// 1.5 characters of silence have passed, in RTU mode; in ASCII mode it means nothing.
    #[inline]
    pub const fn pause(&mut self) {
        if self.state & (DEAF | IDLE | ASCII) == 0 {
            self.state |= PAUSED;
        }
    }

    /// In ASCII mode, whether the last character was the end of a frame, which
    /// [`close`](Self::close) takes, at once or when the line is free for a reply. Another frame's
    /// colon before that, and it is lost; other characters are ignored. Always `false` in RTU mode,
    /// where silence ends a frame.
    #[inline]
    pub fn is_over(&self) -> bool {
        // The reader keeps the place of the last frame until the next one begins.
        self.state & ASCII_IDLE == ASCII && self.reader.is_over()
    }

    /// Whether no frame has begun.
    pub const fn is_idle(&self) -> bool {
        self.state & IDLE != 0
    }

    /// The frame is at its end. In RTU mode: 3.5 characters of silence have passed. In ASCII mode:
    /// it [`is_over`](Self::is_over), or one second has passed without any character, which makes
    /// what there is of a frame a faulty one.
    ///
    /// `Some` only for a good one to this unit or to all; everything else is counted and dropped.
    #[inline]
    pub fn close(&mut self) -> Option<Closed<'a>> {
        let request = self.judge(self.state);
        self.resume();
        request
    }

    /// The unit has been sending, with its receiver off, and is done: the next character starts a
    /// frame.
    #[inline(always)]
    pub fn resume(&mut self) {
        self.state = IDLE | (self.state & ASCII);
        self.check = if self.state & ASCII == 0 {
            crc::START
        } else {
            0
        };
        if let Some(adu) = &mut self.filling {
            adu.clear();
            return;
        }
        // A spare buffer is empty already.
        self.filling = self.spare.take();
        if self.filling.is_none() {
            self.state |= UNKEPT;
            self.unkept = 0;
        }
    }

    /// What becomes of what has been received.
    #[inline]
    fn judge(&mut self, state: u16) -> Option<Closed<'a>> {
        if state & (DEAF | IDLE) != 0 {
            return None;
        }
        if state & OVERRUN != 0 {
            count(&mut self.counters.overruns);
        }
        let (len, address) = match &self.filling {
            Some(adu) if state & UNKEPT == 0 => (adu.len(), adu.get(0)),
            _ => (usize::from(self.unkept), self.address),
        };
        let (shortest, longest, check_len) = if state & ASCII == 0 {
            RTU
        } else if self.reader.is_over() {
            ASCII_ENDED
        } else {
            NOT_ENDED
        };
        // Over a frame with its CRC or LRC, CRC and sum alike are zero.
        let good = self.check == crc::GOOD && shortest <= len && len <= longest;
        if state & SPOILED != 0 || !good {
            count(&mut self.counters.communication_errors);
            return None;
        }
        count(&mut self.counters.bus_messages);
        let is_for_us = address == BROADCAST || self.units.contains(address);
        if !is_for_us {
            return None;
        }
        if state & (TORN | UNKEPT) != 0 {
            count(&mut self.counters.dropped);
            return None;
        }
        let adu = self.filling.take()?;
        adu.cut(check_len);
        Some(Closed {
            adu,
            line: self.counters,
        })
    }

    /// What has been counted so far.
    pub const fn counters(&self) -> &LineCounters {
        &self.counters
    }

    /// Sees to a character that is not just the next good one of an RTU frame.
    #[cold]
    #[inline(never)]
    fn special(&mut self, byte: u8, faults: Faults) {
        let character = self.reader.masked(byte);
        let faults = self.reader.faults(byte, faults);
        match self.state | u16::from(faults.bits()) {
            ASCII if self.ascii_inside(character) => {}
            ASCII_IDLE if character == ascii::START => {
                self.state = ASCII;
                self.reader.begin();
            }
            _ => self.rare(byte, faults),
        }
    }

    /// Takes a character inside an ASCII frame that is kept and good so far, if it is good, too.
    #[inline(always)]
    fn ascii_inside(&mut self, character: u8) -> bool {
        let part = self.reader.take_good(character);
        if let Some(Part::Byte(byte)) = part {
            self.add(byte);
            self.keep(byte);
        }
        part.is_some()
    }

    /// Sees to what is not a good character of a good frame, and to frames that are not kept.
    #[inline(never)]
    fn rare(&mut self, byte: u8, faults: Faults) {
        if self.state & ASCII != 0 {
            return self.ascii_character(self.reader.masked(byte), faults);
        }
        if self.state & DEAF != 0 {
            return;
        }
        if self.state & IDLE != 0 {
            self.begin();
        }
        if self.state & PAUSED != 0 {
            count(&mut self.counters.gaps);
            self.state &= !PAUSED;
            if self.strict_t15 {
                self.state |= TORN;
            }
        }
        self.note(faults);
        self.check = crc::step(self.check, byte);
        self.keep_or_follow(byte);
    }

    /// A character in ASCII mode.
    fn ascii_character(&mut self, character: u8, faults: Faults) {
        let idle = self.state & IDLE != 0;
        if character == ascii::START && (idle || !faults.spoil()) {
            // A frame without its end is counted as faulty. A complete one is dropped: its reply
            // would be sent too late.
            if let Some(late) = self.close() {
                self.drop_request(late.adu);
            }
            self.begin();
            self.reader.begin();
            self.note(faults);
            return;
        }
        // A frame that is over is complete, whatever comes before it is taken.
        if idle || self.reader.is_over() {
            return;
        }
        self.note(faults);
        match self.reader.take(character) {
            Part::Byte(byte) => {
                self.add(byte);
                self.keep_or_follow(byte);
            }
            Part::Nothing => {}
            Part::Wrong => self.state |= SPOILED,
        }
    }

    /// Adds a byte to the sum that the LRC makes zero.
    #[inline]
    const fn add(&mut self, byte: u8) {
        self.check = self.check.wrapping_add((byte as u16) << 8);
    }

    /// Starts a frame: all is ready for it.
    fn begin(&mut self) {
        self.state &= ASCII | UNKEPT;
    }

    fn note(&mut self, faults: Faults) {
        if faults.spoil() {
            self.state |= SPOILED;
        }
        if faults.contains(Faults::OVERRUN) {
            self.state |= OVERRUN;
        }
    }

    /// Keeps a byte of the frame.
    #[inline(always)]
    fn keep(&mut self, byte: u8) {
        if let Some(adu) = &mut self.filling
            && !adu.push(byte)
        {
            self.overflow();
        }
    }

    /// There are more bytes than a frame can have.
    #[cold]
    #[inline(never)]
    fn overflow(&mut self) {
        self.state |= SPOILED;
    }

    /// Keeps a byte of the frame, or only counts it.
    fn keep_or_follow(&mut self, byte: u8) {
        if self.state & UNKEPT == 0 {
            self.keep(byte);
            return;
        }
        if self.unkept == 0 {
            self.address = byte;
        }
        self.unkept = self.unkept.saturating_add(1);
        if usize::from(self.unkept) > Adu::CAPACITY {
            self.overflow();
        }
    }
}
