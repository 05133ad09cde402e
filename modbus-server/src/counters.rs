//! The diagnostic counters of V1.02 appendix A, wrapping at 16 bits.

/// What the receiver of a line has counted since it was made. Only ever counts up, so that a reader
/// that keeps an older copy can always tell the difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineCounters {
    /// Frames with a good CRC, for whatever unit (sub-function 0B).
    pub bus_messages: u16,
    /// Frames with a bad CRC, with a faulty character, shorter than 4 or longer than 256 bytes
    /// (0C).
    pub communication_errors: u16,
    /// Frames spoiled because a character was overwritten before it was read (12).
    pub overruns: u16,
    /// Silences above t1.5 inside a frame.
    pub gaps: u16,
    /// Good frames for this unit that found no free buffer.
    pub dropped: u16,
}

/// All counters of a line and its server, in the order of their sub-functions of function 08.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// 0B: frames with a good CRC, for whatever unit.
    pub bus_messages: u16,
    /// 0C: frames with a bad CRC, a faulty character or an impossible length.
    pub communication_errors: u16,
    /// 0D: requests refused with an exception, broadcasts included.
    pub exceptions: u16,
    /// 0E: requests for this unit, broadcasts included.
    pub unit_messages: u16,
    /// 0F: requests for this unit that got no reply, broadcasts included.
    pub no_response: u16,
    /// 10: requests answered with exception 07.
    pub nak: u16,
    /// 11: requests answered with exception 06, or dropped because every buffer was in use.
    pub busy: u16,
    /// 12: frames spoiled by a character overrun.
    pub overruns: u16,
    /// Silences above t1.5 inside a frame (not in the standard).
    pub gaps: u16,
}

impl Counters {
    /// The counters in the order above.
    pub const fn as_words(&self) -> [u16; 9] {
        [
            self.bus_messages,
            self.communication_errors,
            self.exceptions,
            self.unit_messages,
            self.no_response,
            self.nak,
            self.busy,
            self.overruns,
            self.gaps,
        ]
    }
}

/// One more, wrapping.
#[inline]
pub(crate) const fn count(counter: &mut u16) {
    *counter = counter.wrapping_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_come_in_the_order_of_their_sub_functions() {
        let counters = Counters {
            bus_messages: 1,
            communication_errors: 2,
            exceptions: 3,
            unit_messages: 4,
            no_response: 5,
            nak: 6,
            busy: 7,
            overruns: 8,
            gaps: 9,
        };
        assert_eq!(counters.as_words(), [1, 2, 3, 4, 5, 6, 7, 8, 9]);
    }

    #[test]
    fn they_wrap() {
        let mut counter = 0xFFFF;
        count(&mut counter);
        assert_eq!(counter, 0);
    }
}
