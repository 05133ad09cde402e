//! The RS-485 line as the tasks share it: UART, frame gap, and what is being received and sent.

use board_support::{GapTimer, Rs485};
use modbus_server::{
    Adu, Head,
    rtu::{Closed, Faults, Next, Receiver, Transmitter},
};

/// The line in use.
pub struct Line {
    uart: Rs485,
    pub gap: GapTimer,
    receiver: Receiver<'static>,
    transmitter: Transmitter<'static>,
    request: Option<Closed<'static>>,
}

impl Line {
    /// Listens as `unit`. The first frame is taken after the first t3.5 of silence.
    pub fn new(uart: Rs485, mut gap: GapTimer, unit: u8, adus: &'static mut [Adu; 2]) -> Self {
        let mut receiver = Receiver::new(unit, false);
        adus.iter_mut().for_each(|adu| receiver.give_back(adu));
        gap.restart();
        Self {
            uart,
            gap,
            receiver,
            transmitter: Transmitter::idle(),
            request: None,
        }
    }

    /// The UART's interrupt.
    #[inline]
    pub fn on_uart(&mut self) {
        let status = self.uart.status();
        // First, for the bus is another's within a bit of the last stop bit.
        if status.sent() {
            self.uart.stop_sending();
            self.receiver.resume();
            if let Some(adu) = self.transmitter.take_buffer() {
                self.receiver.give_back(adu);
            }
        }
        if status.received() {
            let character = self.uart.read(status);
            self.gap.restart();
            self.receiver
                .character(character.byte, Faults::from_bits(character.faults));
        }
        if status.wants_byte() {
            match self.transmitter.next() {
                Next::Byte(byte) => self.uart.send(byte),
                Next::Wait => self.uart.pause_sending(),
                Next::Done => self.uart.finish_sending(),
            }
        }
    }

    /// t1.5 of silence.
    pub fn on_t15(&mut self) {
        self.receiver.t15();
    }

    /// t3.5 of silence: `Some` when a request waits to be taken.
    pub fn on_t35(&mut self) -> Option<()> {
        let closed = self.receiver.t35()?;
        // One that has not been taken by now will never be answered in time.
        if let Some(late) = self.request.replace(closed) {
            self.receiver.give_back(late.adu);
        }
        Some(())
    }

    /// The request that waits, if any. Its buffer comes back by [`finish_reply`](Self::finish_reply).
    pub fn take_request(&mut self) -> Option<&'static mut Adu> {
        self.request.take().map(|closed| closed.adu)
    }

    /// Takes the bus and sends the first byte of a reply.
    pub fn start_reply(&mut self, head: Head) {
        self.gap.stop();
        self.transmitter = Transmitter::new(head);
        if let Next::Byte(first) = self.transmitter.next() {
            self.uart.start_sending(first);
        }
    }

    /// Brings the request's buffer back: the body of the reply that was started, if it has one.
    pub fn finish_reply(&mut self, adu: &'static mut Adu, replying: bool) {
        let unneeded = if replying {
            self.transmitter.body(adu)
        } else {
            Some(adu)
        };
        match unneeded {
            Some(adu) => self.receiver.give_back(adu),
            None => self.uart.resume_sending(),
        }
    }
}
