//! A port whose silences are measured by comparing times.

use super::{Faults, Gaps, Port, Units};

/// The silences that end a frame, in ticks of the caller's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Silences {
    /// t1.5 in RTU mode, t3.5 in ASCII mode.
    pub short: u32,
    /// t3.5 in RTU mode, the time-out in ASCII mode.
    pub long: u32,
}

impl Silences {
    /// Returns the silences of an RTU line, in ticks of `tick_ns` nanoseconds, rounded up.
    #[must_use]
    pub const fn rtu(gaps: &Gaps, tick_ns: u32) -> Self {
        Self {
            short: gaps.t15.div_ceil(tick_ns),
            long: gaps.t35.div_ceil(tick_ns),
        }
    }

    /// Returns the silences of an ASCII line, in ticks of `tick_ns` nanoseconds, rounded up.
    #[must_use]
    pub const fn ascii(gaps: &Gaps, tick_ns: u32) -> Self {
        Self {
            short: gaps.t35.div_ceil(tick_ns),
            long: Gaps::ASCII_TIMEOUT.div_ceil(tick_ns),
        }
    }
}

/// A [`Port`] with the time of the last character, for a caller that has a clock but no timer for silences. Such a
/// caller reads a serial port of an operating system, or polls a UART.
///
/// Its time is a count of ticks that wraps. A silence counts once [`poll`](Self::poll) or
/// [`received`](Self::received) is called after its end. So `poll` should be called at each
/// [`deadline`](Self::deadline), and at least twice while the count goes round.
#[derive(Debug)]
pub struct TimedPort<'a, U = u8> {
    port: Port<'a, U>,
    silences: Silences,
    /// Start of the silence that is being measured.
    since: Option<u32>,
    /// The short silence has passed.
    short_has_passed: bool,
}

impl<'a, U: Units> TimedPort<'a, U> {
    /// Starts in tick `now`. On an RTU line, characters before the first long silence are ignored, because they may
    /// be the rest of a frame that began earlier.
    #[must_use]
    pub const fn new(port: Port<'a, U>, silences: Silences, now: u32) -> Self {
        Self {
            port,
            silences,
            since: Some(now),
            short_has_passed: false,
        }
    }

    /// Returns the port, to serve its request and to send its reply.
    pub const fn port(&mut self) -> &mut Port<'a, U> {
        &mut self.port
    }

    /// Processes a character that ended in tick `now`. Returns whether a request waits to be served.
    pub fn received(&mut self, byte: u8, faults: Faults, now: u32) -> bool {
        let mut waits = self.poll(now);
        if self.port.received(byte, faults) {
            waits |= self.port.ends_fast_message(now);
        }
        self.since = Some(now);
        self.short_has_passed = false;
        waits
    }

    /// Ends silences that have passed by tick `now`. Returns whether a request waits to be served.
    pub fn poll(&mut self, now: u32) -> bool {
        let Some(since) = self.since else {
            return false;
        };
        let silence = now.wrapping_sub(since);
        let mut waits = false;
        if !self.short_has_passed && silence >= self.silences.short {
            self.short_has_passed = true;
            waits = self.port.short_silence(now);
        }
        if silence >= self.silences.long {
            self.since = None;
            waits |= self.port.long_silence(now);
        }
        waits
    }

    /// Ends the reply: its last stop bit was sent ([`Port::sent`]).
    pub fn sent(&mut self) {
        self.port.sent();
        self.since = None;
    }

    /// Returns the tick at which [`poll`](Self::poll) must be called next if no character is received before.
    #[must_use]
    pub const fn deadline(&self) -> Option<u32> {
        let Some(since) = self.since else {
            return None;
        };
        let silence = if self.short_has_passed {
            self.silences.long
        } else {
            self.silences.short
        };
        Some(since.wrapping_add(silence))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Adu;
    use crate::line::{Receiver, Width};

    const SILENCES: Silences = Silences {
        short: 15,
        long: 35,
    };
    const REQUEST: [u8; 8] = [0x11, 0x03, 0x00, 0x04, 0x00, 0x01, 0xC7, 0x5B];

    #[test]
    fn silences_are_rounded_up_to_ticks() {
        let gaps = Gaps::standard(9600, 11);
        let rtu = Silences::rtu(&gaps, 1_000);
        assert_eq!((rtu.short, rtu.long), (1_719, 4_011));
        let ascii = Silences::ascii(&gaps, 1_000_000);
        assert_eq!((ascii.short, ascii.long), (5, 1_000));
    }

    #[test]
    fn a_frame_ends_at_the_long_silence_wherever_the_count_wraps() {
        for start in [0, 1_000, u32::MAX - 60, u32::MAX - 130] {
            let mut adus = [Adu::new(), Adu::new()];
            let port = Port::new(Receiver::rtu(17, false), &mut adus);
            let mut port = TimedPort::new(port, SILENCES, start);
            let at = |ticks: u32| start.wrapping_add(ticks);
            assert_eq!(port.deadline(), Some(at(15)));
            assert!(!port.poll(at(15)));
            assert_eq!(port.deadline(), Some(at(35)));
            assert!(!port.poll(at(35)));
            assert_eq!(port.deadline(), None, "the port is idle");
            for (n, byte) in (0..).zip(REQUEST) {
                assert!(!port.received(byte, Faults::NONE, at(50 + 10 * n)));
            }
            assert!(!port.poll(at(120 + 34)));
            assert!(port.poll(at(120 + 35)));
            assert_eq!(port.deadline(), None);
            assert_eq!(port.port().counters().bus_messages, 1);
            assert_eq!(port.port().counters().gaps, 0);
        }
    }

    #[test]
    fn a_character_after_a_silence_ends_the_frame_before_it() {
        let mut adus = [Adu::new(), Adu::new()];
        let port = Port::new(Receiver::rtu(17, false), &mut adus);
        let mut port = TimedPort::new(port, SILENCES, 0);
        // `poll` was not called since the start.
        assert!(!port.received(REQUEST[0], Faults::NONE, 40));
        for byte in &REQUEST[1..] {
            assert!(!port.received(*byte, Faults::NONE, 50));
        }
        assert!(port.received(0x11, Faults::NONE, 90), "a request waits");
    }

    #[test]
    fn an_ascii_frame_is_taken_at_the_short_silence() {
        let mut adus = [Adu::new(), Adu::new()];
        let port = Port::new(Receiver::ascii(17, Width::Eight), &mut adus);
        let mut port = TimedPort::new(port, SILENCES, 0);
        for byte in b":110300040001E7\r\n" {
            assert!(!port.received(*byte, Faults::NONE, 7));
        }
        assert!(!port.poll(7 + 14));
        assert!(port.poll(7 + 15));
        port.sent();
        assert_eq!(
            port.deadline(),
            None,
            "after sending no silence is measured"
        );
    }
}
