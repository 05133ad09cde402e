//! A receiver that judges a frame by its whole text at its end. It is plain where real receivers are quick.

use crate::{UNIT, judge_ascii, judge_rtu};

/// Counters of a line (V1.02 appendix A, and the frames that a receiver drops).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineCounters {
    /// Frames with a good check.
    pub bus_messages: u16,
    /// Bad frames.
    pub communication_errors: u16,
    /// Bad frames with an overrun.
    pub overruns: u16,
    /// Silences above t1.5 within frames.
    pub gaps: u16,
    /// Good frames for this unit that it dropped.
    pub dropped: u16,
}

/// The result at the end of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Closed {
    /// No frame.
    Nothing,
    /// A bad frame.
    Bad {
        /// A character was lost.
        overrun: bool,
    },
    /// A good frame: unit address and PDU.
    Good {
        /// Unit address and PDU.
        body: Vec<u8>,
        /// The frame must not be served: it has a gap, or there was no buffer.
        dropped: bool,
    },
}

impl Closed {
    /// Unit address and PDU of a request that this unit serves.
    pub fn request(self) -> Option<Vec<u8>> {
        match self {
            Self::Good {
                body,
                dropped: false,
            } if is_for_us(&body) => Some(body),
            _ => None,
        }
    }
}

fn is_for_us(body: &[u8]) -> bool {
    [0, UNIT].contains(&body[0])
}

/// The mode of the line.
#[derive(Clone, Copy, Debug)]
pub enum Mode {
    /// RTU.
    Rtu {
        /// A frame with a gap above t1.5 is dropped.
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

/// A receiver with two buffers.
#[derive(Debug)]
pub struct Receiver {
    /// How the line is used.
    pub mode: Mode,
    /// The counters.
    pub counters: LineCounters,
    /// Number of free buffers.
    pub free: usize,
    deaf: bool,
    frame: Option<Frame>,
}

/// A frame that has begun.
#[derive(Debug, Default)]
struct Frame {
    text: Vec<u8>,
    faulty: bool,
    overrun: bool,
    torn: bool,
    paused: bool,
    /// Whether there was a free buffer when the frame began.
    kept: bool,
}

impl Receiver {
    /// A receiver of a line on which a frame may have begun.
    #[must_use]
    pub fn new(mode: Mode) -> Self {
        Self {
            mode,
            counters: LineCounters::default(),
            free: 2,
            deaf: matches!(mode, Mode::Rtu { .. }),
            frame: None,
        }
    }

    /// A character, with faults as the bits of `modbus_server::line::Faults`, of which noise (4) does not count.
    /// Returns the ASCII frame that a colon cut off.
    pub fn character(&mut self, byte: u8, faults: u8) -> Closed {
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
                    let closed = self.close();
                    // Drop a complete frame that was not taken in time. Its buffer is free again.
                    if closed.clone().request().is_some() {
                        self.counters.dropped = self.counters.dropped.wrapping_add(1);
                        self.free += 1;
                    }
                    let frame = self.begin();
                    self.take(frame, None, faults);
                    return closed;
                } else if !self.is_over()
                    && let Some(frame) = self.frame.take()
                {
                    self.take(frame, Some(byte), faults);
                }
            }
        }
        Closed::Nothing
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

    /// The end of a frame.
    pub fn close(&mut self) -> Closed {
        self.deaf = false;
        let Some(frame) = self.frame.take() else {
            return Closed::Nothing;
        };
        let overrun = frame.overrun;
        let counters = &mut self.counters;
        counters.overruns = counters.overruns.wrapping_add(u16::from(overrun));
        let good = match self.mode {
            Mode::Rtu { .. } => judge_rtu(&frame.text),
            Mode::Ascii { delimiter, .. } => frame
                .text
                .strip_suffix(&[b'\r', delimiter])
                .and_then(judge_ascii),
        };
        let Some(body) = good.filter(|_| !frame.faulty) else {
            counters.communication_errors = counters.communication_errors.wrapping_add(1);
            return Closed::Bad { overrun };
        };
        counters.bus_messages = counters.bus_messages.wrapping_add(1);
        let dropped = frame.torn || !frame.kept;
        if is_for_us(&body) {
            counters.dropped = counters.dropped.wrapping_add(u16::from(dropped));
            self.free -= usize::from(!dropped);
        }
        Closed::Good { body, dropped }
    }

    /// The unit was sending itself.
    pub fn resume(&mut self) {
        self.deaf = false;
        self.frame = None;
    }
}
