//! The log of frames, and the counters derived from the frames.

use std::collections::VecDeque;
use std::time::Duration;

use chrono::{DateTime, Local};
use tokio::time::Instant;

use crate::bus::{Direction, Seen, adu, decode};

/// Largest number of stored frames.
const MOST: usize = 10_000;

/// A frame of the log.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Time when the frame was sent, or was complete.
    pub at: DateTime<Local>,
    /// Direction of the frame.
    pub direction: Direction,
    /// The frame in words.
    pub text: String,
    /// The bytes, for people.
    pub bytes: String,
}

/// Frames that this program has sent and received.
#[derive(Clone, Debug, Default)]
pub struct Frames {
    entries: VecDeque<Entry>,
    removed: usize,
    /// Number of frames in front of the first one that is not shown; `None` when the newest frame is shown.
    end: Option<usize>,
    /// Whether the user has paused the log.
    pub paused: bool,
    /// Whether bytes are shown instead of words.
    pub hex: bool,
    /// The request that waits for its response.
    request: Option<(Instant, Vec<u8>)>,
    /// Counters of this program.
    pub counts: Counts,
}

/// Counters of this program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of requests sent.
    pub requests: u64,
    /// Number of exceptions received.
    pub exceptions: u64,
    /// Number of requests without an answer.
    pub no_answer: u64,
    /// Number of answers that could not be decoded.
    pub garbled: u64,
    /// Number of times that the port or the connection was lost.
    pub lost: u64,
    /// Latest time from a request to the end of its response.
    pub trip: Option<Duration>,
    /// The longest of these times.
    pub longest: Duration,
    /// Sum of these times, and their number.
    sum: (Duration, u32),
}

impl Counts {
    /// Returns the mean time from a request to the end of its response.
    pub fn mean(&self) -> Option<Duration> {
        self.sum.0.checked_div(self.sum.1)
    }

    fn trip(&mut self, trip: Duration) {
        self.trip = Some(trip);
        self.longest = self.longest.max(trip);
        self.sum = match self.sum.1.checked_add(1) {
            Some(count) => (self.sum.0.saturating_add(trip), count),
            None => (trip, 1),
        };
    }
}

impl Frames {
    /// Adds a frame.
    pub fn add(&mut self, seen: &Seen) {
        let opened = seen.framing.open(&seen.bytes);
        let request = self.request.as_ref().map(|(_, pdu)| pdu.as_slice());
        let text = decode::frame(seen.framing, seen.direction, &seen.bytes, request);
        let age = chrono::Duration::from_std(seen.at.elapsed()).unwrap_or_default();
        self.entries.push_back(Entry {
            at: Local::now() - age,
            direction: seen.direction,
            text,
            bytes: adu::bytes(seen.framing, &seen.bytes),
        });
        if self.entries.len() > MOST {
            self.entries.pop_front();
            self.removed += 1;
        }
        match (seen.direction, opened) {
            (Direction::Request, opened) => {
                self.counts.requests += 1;
                self.request = opened.map(|(_, pdu)| (seen.at, pdu));
            }
            (Direction::Response, Some((_, pdu))) => {
                self.counts.exceptions +=
                    u64::from(pdu.first().is_some_and(|code| code & 0x80 != 0));
                if let Some((asked, _)) = self.request.take() {
                    self.counts.trip(seen.at.saturating_duration_since(asked));
                }
            }
            (Direction::Response, None) => {}
        }
    }

    /// Drops the waiting request, whose answer is no longer expected.
    pub fn give_up(&mut self) {
        self.request = None;
    }

    /// Returns the number of frames since the start.
    pub fn total(&self) -> usize {
        self.removed + self.entries.len()
    }

    /// Returns the number of frames after the last one that is shown.
    pub fn below(&self) -> usize {
        self.end.map_or(0, |end| self.total().saturating_sub(end))
    }

    /// Returns the frames that fill a window of this height, the oldest first.
    pub fn window(&self, height: usize) -> impl Iterator<Item = &Entry> {
        let end = self.end.unwrap_or_else(|| self.total());
        let end = end.max(self.removed + height).min(self.total()) - self.removed;
        let start = end.saturating_sub(height);
        self.entries.range(start..end)
    }

    /// Pauses the log, or shows the newest frames again.
    pub fn pause(&mut self) {
        self.paused = !self.paused;
        self.end = self
            .paused
            .then(|| self.end.unwrap_or_else(|| self.total()));
    }

    /// Scrolls towards older frames with a negative number, otherwise towards newer ones. The log does not move
    /// until it is scrolled to its end again.
    pub fn scroll(&mut self, by: isize, height: usize) {
        let least = (self.removed + height).min(self.total());
        let end = self.end.unwrap_or_else(|| self.total());
        let end = end.saturating_add_signed(by).clamp(least, self.total());
        self.end = (self.paused || end < self.total()).then_some(end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::adu::Framing;

    fn seen(direction: Direction, pdu: &[u8], at: Instant) -> Seen {
        Seen {
            at,
            direction,
            framing: Framing::Rtu,
            bytes: Framing::Rtu.frame(0, 1, pdu),
        }
    }

    fn filled(count: u16) -> Frames {
        let mut frames = Frames::default();
        for n in 0..count {
            let [high, low] = n.to_be_bytes();
            let request = [3, high, low, 0, 1];
            frames.add(&seen(Direction::Request, &request, Instant::now()));
        }
        frames
    }

    fn last(frames: &Frames) -> String {
        frames.window(5).last().unwrap().text.clone()
    }

    #[test]
    fn paused_log_does_not_move_while_frames_are_added() {
        let mut frames = filled(10);
        frames.pause();
        let shown = last(&frames);
        frames.add(&seen(Direction::Request, &[7], Instant::now()));
        assert_eq!((last(&frames), frames.below()), (shown, 1));
        frames.pause();
        assert_eq!(last(&frames), "unit 1: read exception status");
    }

    #[test]
    fn scrolled_log_does_not_move_until_it_is_at_its_end() {
        let mut frames = filled(10);
        frames.scroll(-3, 5);
        assert_eq!(last(&frames), "unit 1: read holding registers 0x0006 x 1");
        frames.scroll(-100, 5);
        assert_eq!(frames.window(5).count(), 5);
        assert_eq!(last(&frames), "unit 1: read holding registers 0x0004 x 1");
        frames.scroll(100, 5);
        assert_eq!(frames.below(), 0);
        frames.add(&seen(Direction::Request, &[7], Instant::now()));
        assert_eq!(last(&frames), "unit 1: read exception status");
        assert_eq!(Frames::default().window(5).count(), 0);
    }

    #[test]
    fn more_frames_than_are_kept_remove_the_oldest_and_a_paused_log_follows() {
        let mut frames = filled(100);
        frames.pause();
        for n in 0..MOST {
            frames.add(&seen(Direction::Request, &[7, n as u8], Instant::now()));
        }
        assert_eq!((frames.total(), frames.window(5).count()), (MOST + 100, 5));
        frames.scroll(-100_000, 5);
        assert_eq!(frames.window(5).count(), 5);
    }

    #[test]
    fn response_is_counted_with_its_round_trip() {
        let mut frames = Frames::default();
        let start = Instant::now();
        let later = start + Duration::from_millis(20);
        frames.add(&seen(Direction::Request, &[3, 0, 0, 0, 1], start));
        frames.add(&seen(Direction::Response, &[0x83, 2], later));
        frames.add(&seen(Direction::Response, &[0x83, 2], later));
        assert_eq!((frames.counts.requests, frames.counts.exceptions), (1, 2));
        assert_eq!(frames.counts.trip, Some(Duration::from_millis(20)));
        assert_eq!(frames.counts.mean(), Some(Duration::from_millis(20)));
    }
}
