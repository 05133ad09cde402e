//! Targets `receiver_rtu` and `receiver_ascii`: characters with and without faults, silences in any order, replies,
//! and buffers that are given back late.
//!
//! After every event the receiver must have the same requests and counters as [`modbus_reference::Receiver`]. At
//! the end both buffers still exist, and valid requests after a silence are received.
//!
//! ```text
//!   script: settings, delimiter (ASCII), events
//!   event:  0 characters          length, characters
//!           1 a good frame        unit (0: this one, 1: all), length, PDU
//!           2 a faulty character  character, faults
//!           3 t1.5                4 t3.5, the buffer stays in use
//!           5 a buffer is given back 6 the unit has been sending
//!           7 t3.5, the buffer is given back immediately
//! ```

use modbus_reference::{LineCounters, Mode, UNIT, framed};
use modbus_server::Adu;
use modbus_server::line::{Faults, Framing, Receiver, Width};

use crate::script::Script;

/// Target `receiver_rtu`.
pub fn rtu(input: &[u8]) {
    let mut script = Script::new(input);
    let strict = script.byte() & 1 != 0;
    let receiver = Receiver::rtu(UNIT, strict);
    play(script, receiver, Mode::Rtu { strict });
}

/// Target `receiver_ascii`.
pub fn ascii(input: &[u8]) {
    let mut script = Script::new(input);
    let (width, seven_bits, stop_in_byte) = match script.byte() & 3 {
        1 => (Width::Seven, true, false),
        3 => (Width::SevenAndStop, true, true),
        _ => (Width::Eight, false, false),
    };
    let mut receiver = Receiver::ascii(UNIT, width);
    // Function 08 sub-function 03 allows no other values (V1.1b3 6.8).
    let delimiter = match script.byte() {
        0 => b'\n',
        other if other > 127 || b":\r0123456789ABCDEF".contains(&other) => b'\n',
        other => other,
    };
    receiver.set_framing(Framing::Ascii { delimiter });
    let mode = Mode::Ascii {
        seven_bits,
        stop_in_byte,
        delimiter,
    };
    play(script, receiver, mode);
}

/// Receiver and model, which receive the same events.
struct Pair<'a> {
    receiver: Receiver<'a>,
    model: modbus_reference::Receiver,
    /// The end mark of ASCII frames.
    delimiter: Option<u8>,
    /// Mask of the stop bit that is 1 in every byte of a valid character, or 0.
    stop: u8,
    away: Vec<&'a mut Adu>,
}

fn play(mut script: Script<'_>, receiver: Receiver<'_>, mode: Mode) {
    let (mut one, mut two) = (Adu::new(), Adu::new());
    let mut pair = Pair {
        receiver,
        model: modbus_reference::Receiver::new(mode),
        delimiter: match mode {
            Mode::Rtu { .. } => None,
            Mode::Ascii { delimiter, .. } => Some(delimiter),
        },
        stop: match mode {
            Mode::Ascii {
                stop_in_byte: true, ..
            } => 0x80,
            _ => 0,
        },
        away: Vec::new(),
    };
    pair.receiver.give_back(&mut one);
    pair.receiver.give_back(&mut two);
    while let Some(tag) = script.tag() {
        pair.event(tag & 7, &mut script);
        assert_eq!(pair.counters(), pair.model.counters);
        assert_eq!(pair.receiver.is_over(), pair.model.is_over());
    }
    pair.must_be_whole();
}

impl Pair<'_> {
    fn counters(&self) -> LineCounters {
        let counters = self.receiver.counters();
        LineCounters {
            bus_messages: counters.bus_messages,
            communication_errors: counters.communication_errors,
            overruns: counters.overruns,
            gaps: counters.gaps,
            dropped: counters.dropped,
        }
    }

    fn event(&mut self, event: u8, script: &mut Script<'_>) {
        match event {
            0 => self.characters(script.string()),
            1 => {
                let unit = match script.byte() {
                    0 => UNIT,
                    1 => 0,
                    unit => unit,
                };
                let pdu = script.string();
                self.frame(unit, &pdu[..pdu.len().min(253)]);
            }
            2 => {
                let (byte, faults) = (script.byte(), script.byte() & 15);
                self.receiver.character(byte, Faults::from_bits(faults));
                self.model.character(byte, faults);
            }
            3 => {
                self.receiver.pause();
                self.model.pause();
            }
            4 => self.close(),
            5 => self.give_back(),
            6 => {
                self.receiver.resume();
                self.model.resume();
            }
            _ => {
                let before = self.away.len();
                self.close();
                if self.away.len() > before {
                    self.give_back();
                }
            }
        }
    }

    /// Sends a frame with a valid CRC or LRC.
    fn frame(&mut self, unit: u8, pdu: &[u8]) {
        let mut frame = framed(self.delimiter, unit, pdu);
        frame.iter_mut().for_each(|byte| *byte |= self.stop);
        self.characters(&frame);
    }

    fn characters(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.receiver.character(*byte, Faults::NONE);
            self.model.character(*byte, 0);
        }
    }

    fn close(&mut self) {
        let closed = self.receiver.close();
        let expected = self.model.close().request();
        let delivered = closed.as_ref().map(|adu| adu.as_slice());
        assert_eq!(delivered, expected.as_deref());
        self.away.extend(closed);
    }

    fn give_back(&mut self) {
        if let Some(adu) = self.away.pop() {
            self.receiver.give_back(adu);
            self.model.free += 1;
        }
    }

    /// Checks that there are still two buffers: after a silence two requests are taken. A third request finds no
    /// buffer and is counted.
    fn must_be_whole(&mut self) {
        self.close();
        while !self.away.is_empty() {
            self.give_back();
        }
        assert_eq!(self.model.free, 2);
        let request = [0x03, 0, 1, 0, 1];
        for (taken, dropped) in [(1, 0), (2, 0), (2, 1)] {
            let before = self.counters();
            self.frame(UNIT, &request);
            self.close();
            assert_eq!(self.away.len(), taken, "requests taken");
            let counters = self.counters();
            assert_eq!(counters.dropped.wrapping_sub(before.dropped), dropped);
            assert_eq!(counters.bus_messages, before.bus_messages.wrapping_add(1));
        }
        for adu in &self.away {
            assert_eq!(adu.as_slice(), [&[UNIT][..], &request].concat());
        }
    }
}
