//! Turns characters and silences into valid requests for this unit.

mod fast;

use super::ascii::{self, Part, Reader, Width};
use super::state::{
    ASCII, ASCII_ENDED, ASCII_IDLE, DEAF, FOLLOWS, IDLE, NOT_ENDED, OVERRUN, PAUSED, QUIET, RTU,
    SEEKS, SPOILED, TORN, UNKEPT,
};
use super::{Faults, Framing, Units, length};
use crate::counters::count;
use crate::{Adu, BROADCAST, LineCounters, crc};

/// The receiving half of a line (V1.02 2.5.1.1, figure 14, for RTU; 2.5.2.1, figure 17, for ASCII).
///
/// A program creates it for its [`Port`](super::Port), which calls all other methods.
///
/// In RTU mode it first ignores everything: characters before the first t3.5 of silence belong to a frame whose
/// start was missed. In ASCII mode everything in front of a colon is ignored.
///
/// It needs two buffers ([`give_back`](Self::give_back)): one to fill, and a spare to continue with while the first
/// one holds a request. Without a spare the next frame is followed to its end and counted, but not stored.
///
/// `U` is a `u8` for a single unit address, or a [`UnitSet`](super::UnitSet).
#[derive(Debug)]
pub struct Receiver<'a, U = u8> {
    units: U,
    strict_t15: bool,
    state: u16,
    /// First byte of a frame that is not stored: the unit address.
    address: u8,
    /// CRC of the frame so far. In ASCII mode the sum of its bytes, in the high byte.
    check: u16,
    /// Number of bytes of a frame that is not stored.
    unkept: u16,
    /// Buffer of the frame, or empty for the next one.
    filling: Option<&'a mut Adu>,
    spare: Option<&'a mut Adu>,
    counters: LineCounters,
    reader: Reader,
}

impl<'a, U: Units> Receiver<'a, U> {
    /// Creates a receiver of an RTU line, without buffers, for requests to `units`. With `strict_t15` it drops a
    /// frame with a gap longer than t1.5, as the standard requires; otherwise it only counts the gap.
    pub const fn rtu(units: U, strict_t15: bool) -> Self {
        Self::new(units, strict_t15, Width::Eight, DEAF | UNKEPT)
    }

    /// Creates a receiver of an ASCII line, without buffers, for requests to `units`. Frames end with CR LF, until
    /// [`set_framing`](Self::set_framing).
    pub const fn ascii(units: U, width: Width) -> Self {
        Self::new(units, false, width, ASCII | IDLE | UNKEPT)
    }

    /// Sets the unit addresses.
    pub(super) fn set_units(&mut self, units: U) {
        self.units = units;
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

    /// Returns the framing of the line.
    #[inline]
    pub(super) const fn framing(&self) -> Framing {
        if self.state & ASCII == 0 {
            Framing::Rtu
        } else {
            self.reader.framing()
        }
    }

    /// Sets the end mark of an ASCII line. The mode itself does not change.
    pub const fn set_framing(&mut self, framing: Framing) {
        if let Framing::Ascii { delimiter } = framing {
            self.reader.set_delimiter(delimiter);
        }
    }

    /// Gives the receiver a buffer, at the start or after use. It holds at most two; a third one is dropped.
    #[inline]
    pub fn give_back(&mut self, adu: &'a mut Adu) {
        adu.clear();
        if self.filling.is_none() {
            self.filling = Some(adu);
            // A frame that began without a buffer is not stored, even when one is given back before its end.
            if self.state & (DEAF | IDLE) != 0 {
                self.state &= !UNKEPT;
            }
        } else if self.spare.is_none() {
            self.spare = Some(adu);
        }
    }

    /// Gives back the buffer of a request that was not served, and counts the request as dropped.
    #[cold]
    #[inline(never)]
    pub fn drop_request(&mut self, adu: &'a mut Adu) {
        count(&mut self.counters.dropped);
        self.give_back(adu);
    }

    /// Counts a reply that was not sent.
    #[cold]
    #[inline(never)]
    pub(super) const fn count_unsent(&mut self) {
        count(&mut self.counters.unsent);
    }

    /// Processes a received character. Returns whether it may be the last of a message of Fast Modbus, or one of an
    /// arbitration.
    #[inline(always)]
    pub fn character(&mut self, byte: u8, faults: Faults) -> bool {
        let special = self.state | u16::from(faults.bits());
        if special != 0 {
            // While QUIET errors are not counted, so a good character needs no other treatment. At 921600 bit/s there is no
            // time for it.
            if special != IDLE && !(U::FAST && special == QUIET) {
                self.special(byte, faults);
                return U::FAST && self.state & ASCII == 0;
            }
            // The first character of an RTU frame needs no other treatment, because everything is prepared for it.
            self.state &= !IDLE;
        }
        let check = crc::step(self.check, byte);
        self.check = check;
        self.keep(byte);
        U::FAST && check == crc::GOOD && self.is_for_fast()
    }

    /// Notes that 1.5 characters of silence have passed, in RTU mode. Has no effect in ASCII mode.
    #[inline]
    pub const fn pause(&mut self) {
        if self.state & (DEAF | IDLE | ASCII) == 0 {
            self.state |= PAUSED;
        }
    }

    /// Returns whether the last character was the end of an ASCII frame. [`close`](Self::close) takes that frame,
    /// immediately or when the line is free for a reply. If the colon of another frame is received first, the frame
    /// is lost; other characters are ignored. Always `false` in RTU mode, where silence ends a frame.
    #[inline]
    pub fn is_over(&self) -> bool {
        // The decoder keeps its state after a frame until the next one begins.
        self.state & ASCII_IDLE == ASCII && self.reader.is_over()
    }

    /// Returns whether the RTU frame so far has a valid CRC and the length that its function requires: of a request,
    /// or, for a frame of another unit, of a request or a reply. Always `false` in ASCII mode, for a damaged frame, and
    /// for a frame that is not stored.
    // Inlined, so that the caller decides whether this code is in RAM.
    #[inline(always)]
    pub fn is_complete(&self) -> bool {
        // The CRC is almost never valid before the end, so this is cheap for a call after each character.
        if self.check != crc::GOOD || self.state != 0 {
            return false;
        }
        self.filling.as_ref().is_some_and(|adu| {
            length::is_request(adu, 0) || (!self.takes(adu.get(0)) && length::is_reply(adu, 0))
        })
    }

    /// Returns whether the frame so far can never become valid: it is damaged or too long, or its beginning was missed.
    #[inline(always)]
    pub const fn is_lost(&self) -> bool {
        self.state & (DEAF | SPOILED) != 0
    }

    /// Returns whether requests to this address are taken.
    #[inline(always)]
    fn takes(&self, address: u8) -> bool {
        if address == BROADCAST {
            self.units.takes_broadcasts()
        } else {
            self.units.contains(address)
        }
    }

    /// Returns whether no frame has begun.
    pub const fn is_idle(&self) -> bool {
        self.state & IDLE != 0
    }

    /// Ends the frame. In RTU mode, call this when 3.5 characters of silence have passed. In ASCII mode, call this
    /// when the frame [`is_over`](Self::is_over), or when one second has passed without a character; the partial
    /// frame is then counted as damaged.
    ///
    /// Returns unit address and PDU of a valid frame to this unit or a broadcast. All other frames are counted and
    /// dropped. Give the buffer back when it is free again.
    #[inline]
    pub fn close(&mut self) -> Option<&'a mut Adu> {
        let request = self.judge(self.state);
        self.resume();
        request
    }

    /// Continues after the unit has sent with its receiver off: the next character starts a frame.
    #[inline(always)]
    pub fn resume(&mut self) {
        self.state = IDLE | (self.state & (ASCII | FOLLOWS | QUIET));
        self.check = if self.state & ASCII == 0 {
            crc::START
        } else {
            0
        };
        if let Some(adu) = &mut self.filling {
            adu.clear();
            return;
        }
        // A spare buffer is already empty.
        self.filling = self.spare.take();
        if self.filling.is_none() {
            self.state |= UNKEPT;
            self.unkept = 0;
        }
    }

    /// Decides about the received frame.
    #[inline]
    fn judge(&mut self, state: u16) -> Option<&'a mut Adu> {
        if state & (DEAF | IDLE) != 0 {
            if U::FAST {
                self.state &= !QUIET;
            }
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
        // Over a valid frame including its CRC or LRC, both CRC and sum are zero.
        let good = self.check == crc::GOOD && shortest <= len && len <= longest;
        if state & SPOILED != 0 || !good {
            if state & (FOLLOWS | QUIET) == 0 {
                count(&mut self.counters.communication_errors);
            }
            self.state &= !QUIET;
            return None;
        }
        count(&mut self.counters.bus_messages);
        if U::FAST {
            self.state &= !(FOLLOWS | QUIET);
            if self.is_for_fast() && self.is_fast_reply() {
                return None;
            }
        }
        if !self.takes(address) {
            return None;
        }
        if state & (TORN | UNKEPT) != 0 {
            count(&mut self.counters.dropped);
            return None;
        }
        let adu = self.filling.take()?;
        adu.cut(check_len);
        Some(adu)
    }

    /// Returns the counters.
    pub const fn counters(&self) -> &LineCounters {
        &self.counters
    }

    /// Processes a character that is not the next valid one of an RTU frame.
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

    /// Processes a character inside an ASCII frame that is stored and valid so far, if the character is valid, too.
    #[inline(always)]
    fn ascii_inside(&mut self, character: u8) -> bool {
        let part = self.reader.take_good(character);
        if let Some(Part::Byte(byte)) = part {
            self.add(byte);
            self.keep(byte);
        }
        part.is_some()
    }

    /// Processes faulty characters, characters of damaged frames, and frames that are not stored.
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
            self.note_gap();
        }
        self.note(faults);
        self.check = crc::step(self.check, byte);
        self.keep_or_follow(byte);
        if U::FAST && self.state & (FOLLOWS | SEEKS) != 0 {
            self.seek_reply();
        }
    }

    /// Processes a character in ASCII mode.
    fn ascii_character(&mut self, character: u8, faults: Faults) {
        let idle = self.state & IDLE != 0;
        if character == ascii::START && (idle || !faults.spoil()) {
            // A frame without its end is counted as damaged. A complete frame is dropped, because its reply would
            // be sent too late.
            if let Some(late) = self.close() {
                self.drop_request(late);
            }
            self.begin();
            self.reader.begin();
            self.note(faults);
            return;
        }
        // Characters between a complete frame and the next colon are ignored.
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

    /// Adds a byte to the sum, which the LRC makes zero.
    #[inline]
    const fn add(&mut self, byte: u8) {
        self.check = self.check.wrapping_add((byte as u16) << 8);
    }

    /// Starts a frame.
    fn begin(&mut self) {
        self.state &= ASCII | UNKEPT | FOLLOWS | QUIET;
    }

    fn note(&mut self, faults: Faults) {
        if faults.spoil() {
            self.state |= SPOILED;
        }
        if faults.contains(Faults::OVERRUN) {
            self.state |= OVERRUN;
        }
    }

    /// Stores a byte of the frame.
    #[inline(always)]
    fn keep(&mut self, byte: u8) {
        if let Some(adu) = &mut self.filling
            && !adu.push(byte)
        {
            self.overflow();
        }
    }

    /// Marks a frame with too many bytes as damaged.
    #[cold]
    #[inline(never)]
    fn overflow(&mut self) {
        self.state |= SPOILED;
    }

    /// Stores a byte of the frame, or only counts it.
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
