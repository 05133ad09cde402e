//! The diagnostic counters of V1.02 appendix A, wrapping at 16 bits.

/// What the receiver of a line has counted since it was made. Only ever counts up, so that a reader
/// that keeps an older copy can always tell the difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
// Whole words: a copy is made of them with every request, without a call of memcpy.
#[repr(align(4))]
pub struct LineCounters {
    /// Frames with a good CRC or LRC, for whatever unit (sub-function 0B).
    pub bus_messages: u16,
    /// Frames with a bad CRC or LRC, with a faulty character, of an impossible length, and, in
    /// ASCII mode, without an end (0C).
    pub communication_errors: u16,
    /// Frames spoiled because a character was overwritten before it was read (12).
    pub overruns: u16,
    /// Silences above t1.5 inside an RTU frame.
    pub gaps: u16,
    /// Good frames for this unit, or for all, that were not served: there was no free buffer, a gap
    /// above t1.5 is not tolerated, or it was too late for a reply. They are part of
    /// `bus_messages`.
    pub dropped: u16,
}

impl LineCounters {
    /// All zero.
    pub const ZERO: Self = Self {
        bus_messages: 0,
        communication_errors: 0,
        overruns: 0,
        gaps: 0,
        dropped: 0,
    };

    /// What has been counted since these stood at `then`, less than once around.
    #[must_use]
    pub(crate) const fn since(&self, then: &Self) -> Self {
        Self {
            bus_messages: self.bus_messages.wrapping_sub(then.bus_messages),
            communication_errors: (self.communication_errors)
                .wrapping_sub(then.communication_errors),
            overruns: self.overruns.wrapping_sub(then.overruns),
            gaps: self.gaps.wrapping_sub(then.gaps),
            dropped: self.dropped.wrapping_sub(then.dropped),
        }
    }
}

/// All counters of a line and its server since the start, or since function 08 last cleared them, in
/// the order of its sub-functions.
///
/// A request is counted before it is served: the one that asks for 0B or 0E is among those it is
/// told of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// 0B: frames with a good CRC, for whatever unit.
    pub bus_messages: u16,
    /// 0C: frames with a bad CRC, a faulty character or an impossible length.
    pub communication_errors: u16,
    /// 0D: requests refused with an exception, broadcasts included.
    pub exceptions: u16,
    /// 0E: good frames for this unit, broadcasts included, whether they were served or dropped.
    pub unit_messages: u16,
    /// 0F: those of `unit_messages` that got no reply, broadcasts included.
    pub no_response: u16,
    /// 10: requests answered with exception 07.
    pub nak: u16,
    /// 11: requests answered with exception 06.
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
