//! A whole unit on a line.

use crate::server::GAPS;
use crate::{Closed, Device, Mode, Receiver, Server};

/// Receives, serves and replies.
pub struct Unit {
    /// Handles frames.
    pub server: Server,
    receiver: Receiver,
}

impl Unit {
    /// A unit after the first silence; `delimiter`: in ASCII mode with this end mark, else in RTU mode. `strict`: an
    /// RTU frame with a gap above t1.5 is dropped.
    pub fn new(delimiter: Option<u8>, device: Device, strict: bool) -> Self {
        let server = Server::new(delimiter, device);
        let mut receiver = Receiver::new(mode(delimiter, strict));
        receiver.resume();
        Self { server, receiver }
    }

    /// Receives a character, with faults as for [`Receiver::character`]. Returns the reply to an ASCII frame that
    /// ends with the character.
    pub fn character(&mut self, byte: u8, faults: u8) -> Option<Vec<u8>> {
        let gaps = self.receiver.counters.gaps;
        let cut_off = self.receiver.character(byte, faults);
        self.server.counters[GAPS] += self.receiver.counters.gaps - gaps;
        self.serve(cut_off);
        if self.receiver.is_over() {
            self.silence()
        } else {
            None
        }
    }

    /// 1.5 characters of silence.
    pub fn pause(&mut self) {
        self.receiver.pause();
    }

    /// Ends the frame. Returns the reply to it.
    pub fn silence(&mut self) -> Option<Vec<u8>> {
        let closed = self.receiver.close();
        self.serve(closed)
    }

    fn serve(&mut self, closed: Closed) -> Option<Vec<u8>> {
        self.receiver.free = 2;
        let reply = match closed {
            Closed::Nothing => None,
            Closed::Bad { overrun } => {
                self.server.bad(overrun);
                None
            }
            Closed::Good { body, dropped } => self.server.good(body[0], &body[1..], dropped),
        };
        if let (Mode::Ascii { delimiter, .. }, Some(end)) =
            (&mut self.receiver.mode, self.server.delimiter)
        {
            *delimiter = end;
        }
        reply
    }
}

fn mode(delimiter: Option<u8>, strict: bool) -> Mode {
    match delimiter {
        None => Mode::Rtu { strict },
        Some(delimiter) => Mode::Ascii {
            seven_bits: false,
            stop_in_byte: false,
            delimiter,
        },
    }
}
