//! Fast Modbus in the receiver: messages that end without a silence, and what is on the line around an arbitration.

use super::Receiver;
use crate::counters::count;
use crate::line::messages::{Message, begins_reply};
use crate::line::state::{FOLLOWS, PAUSED, QUIET, SEEKS, TORN};
use crate::line::{Units, length};
use crate::{crc, fast};

impl<U: Units> Receiver<'_, U> {
    /// Returns whether the frame so far has the function code of Fast Modbus.
    #[inline(always)]
    pub(super) fn is_for_fast(&self) -> bool {
        (self.filling.as_ref()).is_some_and(|adu| adu.get(1) == fast::FUNCTION)
    }

    /// Returns whether the RTU frame so far is a whole message of Fast Modbus between a master and all units: it has a
    /// valid CRC and the length that its sub-function requires. It ends without a silence: [`close`](Self::close) it.
    pub fn is_fast_message(&self) -> bool {
        self.check == crc::GOOD
            && self.state & !(FOLLOWS | QUIET | SEEKS) == 0
            && (self.filling.as_ref()).is_some_and(|adu| Message::of(adu).is_some())
    }

    /// Returns whether a valid RTU frame is a reply of Fast Modbus, and notes what follows it.
    #[inline(never)]
    pub(super) fn is_fast_reply(&mut self) -> bool {
        if !self.units.is_fast() {
            return false;
        }
        let frame = self.filling.as_ref();
        let message = frame.and_then(|adu| Message::of(adu));
        self.state |= match message {
            Some(Message::Request) => FOLLOWS,
            Some(Message::Reply) => QUIET,
            None => 0,
        };
        message == Some(Message::Reply)
    }

    /// The unit itself sends the reply of Fast Modbus.
    pub(in crate::line) const fn end_following(&mut self) {
        self.state = self.state & !FOLLOWS | QUIET;
    }

    /// Drops what is in front of the reply of Fast Modbus that the last three characters begin, if they do. What follows is
    /// the reply, whether or not it arrives whole: its characters come too fast to look for another beginning. While units
    /// arbitrate, several start bits can overlap, so that these characters need not be FF. A frame that begins as a request
    /// for this unit stays whole up to its length, whatever is in it.
    pub(super) fn seek_reply(&mut self) {
        let Some(adu) = &mut self.filling else {
            return;
        };
        let is_for_unit = self.units.contains(adu.get(0)) || adu.get(0) == 0;
        if is_for_unit && length::of_request(adu, 0).is_some_and(|length| adu.len() <= length) {
            return;
        }
        let Some(at) = adu.len().checked_sub(3) else {
            return;
        };
        // Below 256.
        let at = at as u8;
        if begins_reply(adu.get(at), adu.get(at + 1), adu.get(at + 2)) {
            adu.clear();
            self.check = crc::START;
            self.state = QUIET;
            // No byte is overwritten before it is read.
            for n in 0..3 {
                let byte = adu.get(at + n);
                self.check = crc::step(self.check, byte);
                adu.push(byte);
            }
        }
    }

    /// Notes a gap longer than t1.5 in an RTU frame. An arbitration has such gaps, which do not count.
    pub(super) fn note_gap(&mut self) {
        self.state &= !PAUSED;
        if self.units.is_fast() {
            self.state |= SEEKS;
        }
        if self.state & (FOLLOWS | QUIET) == 0 {
            count(&mut self.counters.gaps);
            if self.strict_t15 {
                self.state |= TORN;
            }
        }
    }
}
