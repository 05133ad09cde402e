//! The record of the line. It joins received words into frames.

use std::collections::VecDeque;

use modbus_line::{Direction, adu::Framing, fast};

use f103::serial::Word;
use f103::time::Time;

/// Number of the last frames that are kept, unless the record keeps all frames.
pub const KEPT: usize = 1000;

/// Number of bytes after which a frame is cut, in case the line is never silent: sixteen times the longest RTU frame.
pub const LONGEST: usize = 4096;

/// Character of an arbitration of function 70.
const ARBITRATION: u8 = 0xFF;

/// A frame on the line, as a receiver with the master's settings receives it. A frame consists of characters of one
/// sender with less than t3.5 of silence between them. The characters of an arbitration are no part of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Number of the frame on this line, from 1.
    pub number: u64,
    /// The master or noise sends requests, a unit responses.
    pub direction: Direction,
    /// Start of the first start bit.
    pub start: Time,
    /// End of the last stop bit.
    pub end: Time,
    /// Data of the characters.
    pub bytes: Vec<u8>,
    /// Whether this is a complete RTU frame with the right CRC, or a complete ASCII frame with the right LRC.
    pub crc_ok: bool,
    /// Whether a character had a wrong parity, a framing error or noise, or two senders were active.
    pub damaged: bool,
    /// Longest silence between two characters of the frame.
    pub longest_gap: Time,
    /// Silence between the frame before and this one; `None` for the first frame on the line.
    pub gap: Option<Time>,
    /// Time from the end of a request to the start of this frame, if this is the first frame of a unit after a request
    /// to that unit.
    pub turnaround: Option<Time>,
    /// PDU of the request that this frame answers, if this is the first frame of a unit after a request to that unit.
    pub request: Option<Vec<u8>>,
}

/// Joins words into frames.
#[derive(Clone, Debug, Default)]
pub struct Record {
    kept: VecDeque<Frame>,
    open: Option<Frame>,
    last_number: u64,
    /// End of the last frame.
    last_end: Option<Time>,
    /// Unit address, PDU and end of the last request, until a unit answers.
    request: Option<(u8, Vec<u8>, Time)>,
    from_master: u64,
    from_unit: u64,
}

impl Record {
    /// Adds a received word. A silence of `silence` ends a frame.
    pub fn word(&mut self, word: &Word, direction: Direction, collided: bool, silence: Time) {
        let continues = self.open.as_ref().is_some_and(|frame| {
            frame.direction == direction
                && word.start.saturating_sub(frame.end) < silence
                && frame.bytes.len() < LONGEST
                && (word.data as u8 == ARBITRATION || !self.is_arbitration(frame))
        });
        if !continues {
            self.close();
        }
        let number = self.last_number + 1;
        let frame = self.open.get_or_insert_with(|| Frame {
            number,
            direction,
            start: word.start,
            end: word.start,
            bytes: Vec::new(),
            crc_ok: false,
            damaged: false,
            longest_gap: Time::ZERO,
            gap: None,
            turnaround: None,
            request: None,
        });
        let gap = word.start.saturating_sub(frame.end);
        frame.longest_gap = frame.longest_gap.max(gap);
        frame.end = word.end;
        frame.bytes.push(word.data as u8);
        frame.damaged |= collided || word.parity_error || word.framing_error || word.noise;
    }

    /// Ends the frame if the silence after it has lasted for `silence`. The line is silent up to `now`.
    pub fn quiet(&mut self, now: Time, silence: Time) {
        if self.open.as_ref().is_some_and(|f| f.end + silence <= now) {
            self.close();
        }
    }

    /// Returns the complete frames that are kept, oldest first.
    pub fn frames(&self) -> impl DoubleEndedIterator<Item = &Frame> {
        self.kept.iter()
    }

    /// Returns the complete frames that are kept and have numbers above `number`, oldest first.
    pub fn since(&self, number: u64) -> impl Iterator<Item = &Frame> {
        let skip = self.kept.partition_point(|frame| frame.number <= number);
        self.kept.range(skip..)
    }

    /// Returns the number of frames so far: from the master, and from units.
    #[must_use]
    pub fn counts(&self) -> (u64, u64) {
        (self.from_master, self.from_unit)
    }

    /// Returns whether these are characters of the arbitration after a request of function 70, so far.
    fn is_arbitration(&self, frame: &Frame) -> bool {
        use fast::sub::{CONTINUE_SCAN, FETCH, START_SCAN};
        let Some((fast::ADDRESS, request, _)) = &self.request else {
            return false;
        };
        matches!(
            request[..],
            [fast::FUNCTION, START_SCAN | CONTINUE_SCAN | FETCH, ..]
        ) && frame.direction == Direction::Response
            && frame.bytes.iter().all(|byte| *byte == ARBITRATION)
    }

    fn close(&mut self) {
        let Some(mut frame) = self.open.take() else {
            return;
        };
        if self.is_arbitration(&frame) {
            return;
        }
        let opened = Framing::on_line(&frame.bytes).and_then(|framing| framing.open(&frame.bytes));
        frame.crc_ok = opened.is_some();
        frame.gap = self.last_end.map(|end| frame.start.saturating_sub(end));
        self.last_end = Some(frame.end);
        self.last_number = frame.number;
        match frame.direction {
            Direction::Request => {
                self.from_master += 1;
                if let Some((unit, pdu)) = opened {
                    // No unit answers a broadcast.
                    self.request = (unit != 0).then_some((unit, pdu, frame.end));
                }
            }
            Direction::Response => {
                self.from_unit += 1;
                let unit = opened.map(|(unit, _)| unit);
                if let Some((asked, pdu, end)) = self.request.take()
                    && unit.is_none_or(|unit| unit == asked)
                {
                    frame.turnaround = Some(frame.start.saturating_sub(end));
                    frame.request = Some(pdu);
                }
            }
        }
        self.kept.push_back(frame);
        if self.kept.len() > KEPT {
            self.kept.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn word(start_us: u64, data: u16) -> Word {
        Word {
            start: Time::from_us(start_us),
            at: Time::from_us(start_us + 90),
            end: Time::from_us(start_us + 100),
            data,
            parity_error: false,
            framing_error: false,
            noise: false,
        }
    }

    const SILENCE: Time = Time::from_us(350);

    #[test]
    fn silence_or_another_sender_ends_a_frame() {
        let mut record = Record::default();
        // Read coils of unit 17: the example of V1.1b3, with its CRC.
        let request = [0x11_u8, 0x01, 0x00, 0x13, 0x00, 0x25, 0x0E, 0x84];
        for (byte, n) in request.into_iter().zip(0..) {
            record.word(
                &word(n * 110, u16::from(byte)),
                Direction::Request,
                false,
                SILENCE,
            );
        }
        record.word(&word(880, 0x55), Direction::Response, false, SILENCE);
        record.word(&word(1329, 0x56), Direction::Response, false, SILENCE);
        record.word(&word(1779, 0x57), Direction::Response, true, SILENCE);
        record.quiet(Time::from_us(2228), SILENCE);
        assert_eq!(record.frames().count(), 2);
        record.quiet(Time::from_us(2229), SILENCE);
        let frames: Vec<_> = record.since(0).cloned().collect();
        assert_eq!(frames.len(), 3);
        assert_eq!(frames[0].bytes, [0x11, 1, 0, 0x13, 0, 0x25, 0x0E, 0x84]);
        assert!(frames[0].crc_ok && !frames[0].damaged);
        assert_eq!(frames[0].longest_gap, Time::from_us(10));
        assert_eq!(frames[1].bytes, [0x55, 0x56]);
        assert!(!frames[1].crc_ok && !frames[1].damaged);
        assert!(frames[2].damaged);
        assert_eq!(record.since(2).count(), 1);
        assert_eq!(record.counts(), (1, 2));
    }

    #[test]
    fn only_the_last_frames_are_kept_with_their_numbers() {
        let mut record = Record::default();
        for n in 0..1200 {
            record.word(&word(n * 1000, 1), Direction::Request, false, SILENCE);
        }
        record.quiet(Time::from_secs(2), SILENCE);
        let numbers: Vec<_> = record.frames().map(|f| f.number).collect();
        assert_eq!((numbers.len(), numbers[0], numbers[999]), (1000, 201, 1200));
        assert_eq!(record.since(1190).count(), 10);
    }

    #[test]
    fn frame_without_silence_is_cut_at_the_longest_length() {
        let mut record = Record::default();
        for n in 0..10_000 {
            record.word(&word(n * 100, 7), Direction::Request, false, SILENCE);
        }
        let lengths: Vec<_> = record.frames().map(|f| f.bytes.len()).collect();
        assert_eq!(lengths, [LONGEST, LONGEST]);
    }

    /// Records these frames: direction, start in us, and bytes.
    fn record(frames: &[(Direction, u64, Vec<u8>)]) -> Vec<Frame> {
        let mut record = Record::default();
        for (direction, start, bytes) in frames {
            for (byte, n) in bytes.iter().zip(0..) {
                let word = word(start + n * 100, u16::from(*byte));
                record.word(&word, *direction, false, SILENCE);
            }
        }
        record.quiet(Time::from_secs(1), SILENCE);
        record.frames().cloned().collect()
    }

    #[test]
    fn ascii_frames_are_checked_by_their_lrc() {
        let good = Framing::Ascii.frame(0, 17, &[3, 0, 0x6B, 0, 3]);
        let mut bad = good.clone();
        bad[4] ^= 1;
        let frames = record(&[
            (Direction::Request, 0, good),
            (Direction::Request, 10_000, bad),
        ]);
        let checks: Vec<_> = frames.iter().map(|frame| frame.crc_ok).collect();
        assert_eq!(checks, [true, false]);
    }

    #[test]
    fn arbitration_in_front_of_a_reply_is_no_frame() {
        let fetch = Framing::Rtu.frame(0, fast::ADDRESS, &[0x46, 0x10, 0, 64, 0, 0]);
        let events = Framing::Rtu.frame(0, 1, &[0x46, 0x11, 0, 1, 5, 1, 2, 0, 0, 1]);
        let joined = [&[0xFF; 3][..], &events].concat();
        let frames = record(&[
            (Direction::Request, 0, fetch.clone()),
            // A 1 is silence, which ends a frame.
            (Direction::Response, 2000, vec![0xFF; 2]),
            (Direction::Response, 3000, joined),
            (Direction::Response, 9000, vec![0xFF; 2]),
        ]);
        let bytes: Vec<_> = frames.iter().map(|frame| frame.bytes.clone()).collect();
        assert_eq!(bytes, [fetch, events, vec![0xFF; 2]]);
        assert!(frames[1].crc_ok);
        assert_eq!(frames[1].start, Time::from_us(3300));
        assert_eq!(frames[1].longest_gap, Time::ZERO);
    }

    #[test]
    fn gaps_and_turnarounds_are_measured() {
        use Direction::{Request, Response};
        let frame = |unit| Framing::Rtu.frame(0, unit, &[7]);
        let noise = || vec![0xFF];
        let frames = record(&[
            (Request, 1000, frame(1)),
            // A glitch between a request and its reply does not change the turnaround.
            (Request, 2000, noise()),
            (Response, 5000, frame(1)),
            (Response, 6000, frame(1)),
            (Request, 10_000, frame(0)),
            (Response, 11_000, frame(2)),
            (Request, 20_000, frame(1)),
            (Response, 21_000, frame(2)),
            (Request, 30_000, frame(1)),
            (Response, 32_000, noise()),
        ]);
        let us = |time: Option<Time>| time.map(Time::as_us);
        let gaps: Vec<_> = frames.iter().map(|frame| us(frame.gap)).collect();
        assert_eq!(
            gaps[..5],
            [None, Some(600), Some(2900), Some(600), Some(3600)]
        );
        let turnarounds: Vec<_> = frames.iter().map(|frame| us(frame.turnaround)).collect();
        let mut wanted = [None; 10];
        (wanted[2], wanted[9]) = (Some(3600), Some(1600));
        assert_eq!(turnarounds, wanted);
        for frame in &frames {
            let request = frame.turnaround.map(|_| vec![7]);
            assert_eq!(frame.request, request, "frame {}", frame.number);
        }
    }
}
