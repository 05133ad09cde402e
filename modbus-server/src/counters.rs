//! The diagnostic counters of V1.02 appendix A, wrapping at 16 bits.

/// Counters of a line's receiver since it was created. They only count up, so a reader with an older copy can
/// always compute the difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
// Aligned to words: every request copies these counters, and this avoids a call of memcpy.
#[repr(align(4))]
pub struct LineCounters {
    /// Frames with a valid CRC or LRC, for any unit (sub-function 0B).
    pub bus_messages: u16,
    /// Frames with a wrong CRC or LRC, with a faulty character, of an impossible length, or, in ASCII mode, without an
    /// end (0C).
    pub communication_errors: u16,
    /// Frames damaged because a character was overwritten before it was read (12).
    pub overruns: u16,
    /// Silences longer than t1.5 inside an RTU frame.
    pub gaps: u16,
    /// Valid frames for this unit or a broadcast that were not served: no buffer was free, a gap longer than t1.5
    /// is not tolerated, or it was too late for a reply. `bus_messages` includes them.
    pub dropped: u16,
    /// Replies that were not sent: another frame was being received, or a valid one had come since the request.
    pub unsent: u16,
}

impl LineCounters {
    /// All counters at zero.
    pub const ZERO: Self = Self {
        bus_messages: 0,
        communication_errors: 0,
        overruns: 0,
        gaps: 0,
        dropped: 0,
        unsent: 0,
    };

    /// Returns the difference to an older copy `then`, for fewer than 65536 counts.
    #[must_use]
    pub(crate) const fn since(&self, then: &Self) -> Self {
        Self {
            bus_messages: self.bus_messages.wrapping_sub(then.bus_messages),
            communication_errors: (self.communication_errors)
                .wrapping_sub(then.communication_errors),
            overruns: self.overruns.wrapping_sub(then.overruns),
            gaps: self.gaps.wrapping_sub(then.gaps),
            dropped: self.dropped.wrapping_sub(then.dropped),
            unsent: self.unsent.wrapping_sub(then.unsent),
        }
    }
}

/// All counters of a line and its server since the start, or since function 08 last cleared them, in the order of
/// its sub-functions.
///
/// A request is counted before it is served, so a request for 0B or 0E is included in its own result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// 0B: frames with a valid CRC, for any unit.
    pub bus_messages: u16,
    /// 0C: frames with a wrong CRC, a faulty character or an impossible length.
    pub communication_errors: u16,
    /// 0D: requests rejected with an exception, including broadcasts.
    pub exceptions: u16,
    /// 0E: valid frames for this unit, including broadcasts, whether they were served or dropped.
    pub unit_messages: u16,
    /// 0F: frames of `unit_messages` without a reply, including broadcasts.
    pub no_response: u16,
    /// 10: requests answered with exception 07.
    pub nak: u16,
    /// 11: requests answered with exception 06.
    pub busy: u16,
    /// 12: frames damaged by a character overrun.
    pub overruns: u16,
    /// Silences longer than t1.5 inside a frame (not in the standard).
    pub gaps: u16,
}

impl Counters {
    /// Returns the counters in the order above.
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

/// Adds 1, wrapping.
#[inline]
pub(crate) const fn count(counter: &mut u16) {
    *counter = counter.wrapping_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_are_in_the_order_of_their_sub_functions() {
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
    fn counters_wrap() {
        let mut counter = 0xFFFF;
        count(&mut counter);
        assert_eq!(counter, 0);
    }
}
