//! What a unit must have heard, told from the whole text of a frame at its end: the model of the
//! receivers, plain where they are quick.

use modbus_server::LineCounters;

use crate::common::{UNIT, crc, reference::judge_ascii};

/// The line a unit listens to.
#[derive(Clone, Copy, Debug)]
pub enum Mode {
    /// RTU.
    Rtu {
        /// A gap above t1.5 costs the frame.
        strict: bool,
    },
    /// ASCII.
    Ascii {
        /// The top bit of a character is not data.
        seven_bits: bool,
        /// The highest bit of a byte is a stop bit, and a character in which it is 0 is damaged.
        stop_in_byte: bool,
        /// The last character of a frame.
        delimiter: u8,
    },
}

/// An ear with two buffers.
#[derive(Debug)]
pub struct Heard {
    mode: Mode,
    /// What has been counted.
    pub counters: LineCounters,
    /// Buffers that are not away.
    pub free: usize,
    deaf: bool,
    frame: Option<Frame>,
}

/// A frame under way.
#[derive(Debug, Default)]
struct Frame {
    text: Vec<u8>,
    faulty: bool,
    overrun: bool,
    torn: bool,
    paused: bool,
    /// There was a buffer when it began.
    kept: bool,
}

impl Heard {
    /// An ear on a line where a frame may be under way.
    #[must_use]
    pub fn new(mode: Mode) -> Self {
        Self {
            mode,
            counters: LineCounters::ZERO,
            free: 2,
            deaf: matches!(mode, Mode::Rtu { .. }),
            frame: None,
        }
    }

    /// A character, with faults as the bits of `Faults`, of which noise (4) does not count.
    pub fn character(&mut self, byte: u8, faults: u8) {
        let faults = faults & 11;
        match self.mode {
            Mode::Rtu { .. } if self.deaf => {}
            Mode::Rtu { strict } => {
                let mut frame = self.frame.take().unwrap_or_else(|| self.begin());
                if frame.paused {
                    self.counters.gaps = self.counters.gaps.wrapping_add(1);
                    frame.paused = false;
                    frame.torn |= strict;
                }
                self.take(frame, Some(byte), faults);
            }
            Mode::Ascii {
                seven_bits,
                stop_in_byte,
                ..
            } => {
                let low_stop = stop_in_byte && byte < 128;
                let faults = faults | u8::from(low_stop) << 1;
                let byte = if seven_bits { byte % 128 } else { byte };
                if byte == b':' && (self.frame.is_none() || faults == 0) {
                    // A complete frame that nobody took in time is dropped; its buffer is free again.
                    if self.close().is_some() {
                        self.counters.dropped = self.counters.dropped.wrapping_add(1);
                        self.free += 1;
                    }
                    let frame = self.begin();
                    self.take(frame, None, faults);
                } else if !self.is_over()
                    && let Some(frame) = self.frame.take()
                {
                    self.take(frame, Some(byte), faults);
                }
            }
        }
    }

    fn begin(&self) -> Frame {
        Frame {
            kept: self.free > 0,
            ..Frame::default()
        }
    }

    fn take(&mut self, mut frame: Frame, byte: Option<u8>, faults: u8) {
        frame.text.extend(byte);
        frame.faulty |= faults != 0;
        frame.overrun |= faults & 8 != 0;
        self.frame = Some(frame);
    }

    /// t1.5 has passed.
    pub fn pause(&mut self) {
        if let (Mode::Rtu { .. }, Some(frame)) = (self.mode, &mut self.frame) {
            frame.paused = true;
        }
    }

    /// Whether the last character was the end of an ASCII frame.
    #[must_use]
    pub fn is_over(&self) -> bool {
        match (self.mode, &self.frame) {
            (Mode::Ascii { delimiter, .. }, Some(frame)) => {
                frame.text.ends_with(&[b'\r', delimiter])
            }
            _ => false,
        }
    }

    /// The end of a frame: unit address and PDU, if it is good and for this unit.
    pub fn close(&mut self) -> Option<Vec<u8>> {
        self.deaf = false;
        let frame = self.frame.take()?;
        let counters = &mut self.counters;
        counters.overruns = counters.overruns.wrapping_add(u16::from(frame.overrun));
        let good = match self.mode {
            Mode::Rtu { .. } => judge_rtu(&frame.text),
            Mode::Ascii { delimiter, .. } => frame
                .text
                .strip_suffix(&[b'\r', delimiter])
                .and_then(judge_ascii),
        };
        let Some(good) = good.filter(|_| !frame.faulty) else {
            counters.communication_errors = counters.communication_errors.wrapping_add(1);
            return None;
        };
        counters.bus_messages = counters.bus_messages.wrapping_add(1);
        if ![0, UNIT].contains(&good[0]) {
            return None;
        }
        if frame.torn || !frame.kept {
            counters.dropped = counters.dropped.wrapping_add(1);
            return None;
        }
        self.free -= 1;
        Some(good)
    }

    /// The unit was sending itself.
    pub fn resume(&mut self) {
        self.deaf = false;
        self.frame = None;
    }
}

fn judge_rtu(text: &[u8]) -> Option<Vec<u8>> {
    if !(4..=256).contains(&text.len()) {
        return None;
    }
    let (body, check) = text.split_at(text.len() - 2);
    (crc(body) == check).then(|| body.to_vec())
}
