//! The RS-485 line as the tasks share it: UART, frame gap, and what is being received and sent.
//!
//! All of it runs from RAM (`memory.x`), so that it goes on while flash is erased or programmed: what is called here
//! must be there, too.

use board_support::{GapTimer, Rs485};
use firmware::start_up::LOADER_UNIT;
use modbus_server::{
    Adu, Head, LineCounters,
    line::{Closed, Faults, Framing, Next, Receiver, Transmitter},
};

use crate::clock;

/// The line in use.
pub struct Line {
    uart: Rs485,
    pub gap: GapTimer,
    receiver: Receiver<'static>,
    transmitter: Transmitter<'static>,
    request: Option<Closed<'static>>,
    /// When the request ended, by the device's clock.
    closed_ms: u32,
    reply: Reply,
    /// The good frames on the bus when a reply began to be delayed.
    heard_before: u16,
    /// Milliseconds that a reply may take, should TIM1 not limit it, and that the one under way has taken.
    longest_ms: u16,
    sending_ms: u16,
    /// Which registers were looked at in the last millisecond.
    looked_at: Registers,
    /// Interrupts of the UART without a cause since the last millisecond.
    causeless: u8,
    /// The line was set up again since [`take_repaired`](Self::take_repaired).
    repaired: bool,
}

/// Interrupts of the UART without a cause in one millisecond after which its registers are checked.
const CAUSELESS: u8 = 8;

/// Registers that are looked at together. All at once would hold the line's interrupts off for longer.
#[derive(Clone, Copy)]
enum Registers {
    Uart,
    Silences,
    StartBit,
}

/// How far the reply is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reply {
    /// There is none.
    None,
    /// It waits for the response delay to pass, and is given up if the bus goes on without it.
    Delayed { ms: u16 },
    /// It is being sent.
    Sending,
}

impl Line {
    /// Listens with this receiver. The gap timer's t1.5 and t3.5 are, on an ASCII line, t3.5 and the
    /// time-out. A reply that takes more than `longest_ms` milliseconds is cut off.
    pub fn new(
        uart: Rs485,
        mut gap: GapTimer,
        mut receiver: Receiver<'static>,
        adus: &'static mut [Adu; 2],
        longest_ms: u16,
    ) -> Self {
        adus.iter_mut().for_each(|adu| receiver.give_back(adu));
        gap.restart();
        Self {
            uart,
            gap,
            receiver,
            transmitter: Transmitter::idle(),
            request: None,
            closed_ms: 0,
            reply: Reply::None,
            heard_before: 0,
            longest_ms,
            sending_ms: 0,
            looked_at: Registers::StartBit,
            causeless: 0,
            repaired: false,
        }
    }

    /// The UART's interrupt. True when a reply has just left.
    #[inline]
    pub fn on_uart(&mut self) -> bool {
        let status = self.uart.status();
        // First, for the bus is another's within a bit of the last stop bit.
        if status.sent() {
            self.uart.stop_sending();
            self.reply = Reply::None;
            self.receiver.resume();
            self.take_back();
            // Whatever else there is calls again.
            return true;
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
        } else if !status.received() {
            self.without_cause();
        }
        false
    }

    /// The UART's interrupt has come without a cause that is known here. The scan pends it now and then; more
    /// than that is a disturbed register whose interrupt comes again at once and keeps all tasks from running.
    fn without_cause(&mut self) {
        self.causeless += 1;
        if self.causeless == CAUSELESS {
            self.causeless = 0;
            self.check(Registers::Uart);
        }
    }

    /// Sets the line up again when registers are not what they were set to, when the end of a frame is
    /// not being waited for, or when a reply does not end: whatever has disturbed them, the driver goes off
    /// and the next request is served. While a reply is being sent only its time is looked at, because the driver must
    /// go off right after the last bit.
    #[cold]
    fn check(&mut self, registers: Registers) {
        let sending = self.reply == Reply::Sending;
        let is_sound = if sending {
            self.sending_ms < self.longest_ms
        } else {
            match registers {
                Registers::Uart => self.uart.is_sound(),
                Registers::Silences => {
                    let waits_for_silence = !self.receiver.is_idle();
                    self.gap.silences_are_sound() && (!waits_for_silence || self.gap.is_running())
                }
                Registers::StartBit => self.gap.start_bit_is_sound(),
            }
        };
        if !is_sound {
            self.repair();
        }
    }

    fn repair(&mut self) {
        self.uart.set_up();
        self.gap.set_up();
        if self.reply == Reply::Sending {
            self.reply = Reply::None;
            self.take_back();
        }
        self.receiver.resume();
        self.gap.restart();
        self.repaired = true;
    }

    /// The time has passed that the last reply to begin may take: one that is still being sent never ends.
    pub fn on_limit(&mut self) {
        if self.gap.take_limit() && self.reply == Reply::Sending {
            self.repair();
        }
    }

    /// Whether the line was set up again since the last call.
    pub const fn take_repaired(&mut self) -> bool {
        core::mem::replace(&mut self.repaired, false)
    }

    /// t1.5 of silence; on an ASCII line t3.5, after which a frame that is over is taken: its sender
    /// has left the line by then. `Some` when a request waits to be taken.
    pub fn on_t15(&mut self) -> Option<()> {
        self.receiver.pause();
        if self.receiver.is_over() {
            return self.take();
        }
        None
    }

    /// t3.5 of silence; on an ASCII line the time-out, which spoils what there is of a frame. `Some`
    /// when a request waits to be taken.
    pub fn on_t35(&mut self) -> Option<()> {
        // A frame that was over long ago has found no silence for its reply: it is too late.
        let late = self.receiver.is_over();
        self.take()?;
        if late && let Some(closed) = self.request.take() {
            self.receiver.drop_request(closed.adu);
            return None;
        }
        Some(())
    }

    fn take(&mut self) -> Option<()> {
        let closed = self.receiver.close()?;
        self.closed_ms = clock::millis();
        // One that has not been taken by now will never be answered in time.
        if let Some(late) = self.request.replace(closed) {
            self.receiver.drop_request(late.adu);
        }
        Some(())
    }

    /// A millisecond has passed: the response delay runs, and a disturbed line is set up again.
    pub fn on_millisecond(&mut self) {
        self.causeless = 0;
        self.sending_ms = self.sending_ms.saturating_add(1);
        self.looked_at = match self.looked_at {
            Registers::Uart => Registers::Silences,
            Registers::Silences => Registers::StartBit,
            Registers::StartBit => Registers::Uart,
        };
        self.check(self.looked_at);
        match self.reply {
            Reply::Delayed { ms: 0 } => {
                if self.receiver.is_idle() && self.heard() == self.heard_before {
                    self.send();
                } else {
                    self.give_up();
                }
            }
            Reply::Delayed { ms } => self.reply = Reply::Delayed { ms: ms - 1 },
            Reply::None | Reply::Sending => {}
        }
    }

    /// Whether a reply is on its way, or waits to be.
    pub fn is_replying(&self) -> bool {
        self.reply != Reply::None
    }

    /// The request that waits, if any, what the line has counted, and when the request ended by the device's clock.
    /// Its buffer comes back by [`finish_reply`](Self::finish_reply). A reply that has not begun yet is given up: the
    /// master has.
    pub fn take_request(&mut self) -> Option<(&'static mut Adu, LineCounters, u32)> {
        let closed = self.request.take()?;
        if matches!(self.reply, Reply::Delayed { .. }) {
            self.give_up();
        }
        Some((closed.adu, closed.line, self.closed_ms))
    }

    /// Good frames on the bus so far.
    fn heard(&self) -> u16 {
        self.receiver.counters().bus_messages
    }

    fn give_up(&mut self) {
        self.reply = Reply::None;
        self.take_back();
    }

    /// A reply of `unit` will come: its first byte leaves now, or after a delay in milliseconds.
    #[inline]
    pub fn open_reply(&mut self, unit: u8, framing: Framing, delay_ms: u16) {
        self.transmitter = Transmitter::open(unit, framing);
        // The loader mode is to be found by a master with any time-out.
        let delay_ms = if unit == LOADER_UNIT { 0 } else { delay_ms };
        if delay_ms == 0 {
            self.send();
        } else {
            self.heard_before = self.heard();
            self.reply = Reply::Delayed { ms: delay_ms };
        }
    }

    /// The reply is settled: this is how it begins.
    pub fn continue_reply(&mut self, head: Head) {
        self.transmitter.head(head);
        if self.reply == Reply::Sending {
            self.uart.resume_sending();
        }
    }

    /// How frames end from the next one on.
    pub fn set_framing(&mut self, framing: Framing) {
        self.receiver.set_framing(framing);
    }

    /// Takes the bus and sends the first byte.
    #[inline]
    fn send(&mut self) {
        self.gap.stop();
        self.reply = Reply::Sending;
        self.sending_ms = 0;
        if let Next::Byte(first) = self.transmitter.next() {
            self.uart.start_sending(first);
        }
        self.gap.limit_sending();
    }

    /// Brings the request's buffer back: the body of the reply that was started, if it has one.
    pub fn finish_reply(&mut self, adu: &'static mut Adu, replying: bool) {
        // A reply that has been cut off by now takes no body.
        let unneeded = if replying && self.reply != Reply::None {
            self.transmitter.body(adu)
        } else {
            Some(adu)
        };
        match unneeded {
            Some(adu) => self.receiver.give_back(adu),
            None if self.reply == Reply::Sending => self.uart.resume_sending(),
            None => {}
        }
    }

    fn take_back(&mut self) {
        if let Some(adu) = self.transmitter.take_buffer() {
            self.receiver.give_back(adu);
        }
    }
}
