//! The RS-485 line as the tasks share it: UART, frame gap, and what is being received and sent.
//!
//! All of it runs from RAM (`memory.x`), so that it goes on while flash is erased or programmed: what is called here
//! must be there, too.

use board_support::{GapEvent, GapTimer, Rs485};
use modbus_server::{
    Answered, Decided, Request, Served, Server,
    line::{Faults, Next, Port},
};

use crate::clock;

/// A line in use: UART, frame-gap timer and port.
pub struct Line {
    uart: Rs485,
    gap: GapTimer,
    port: Port<'static>,
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
    GapControl,
    GapTimes,
    StartBit,
}

impl Line {
    /// Listens. The gap timer measures the port's silences. A reply that takes more than `longest_ms` milliseconds is
    /// cut off.
    pub fn new(uart: Rs485, mut gap: GapTimer, port: Port<'static>, longest_ms: u16) -> Self {
        gap.restart();
        Self {
            uart,
            gap,
            port,
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
            self.port.sent();
            // Whatever else there is calls again.
            return true;
        }
        if status.received() {
            let character = self.uart.read(status);
            self.gap.restart();
            self.port
                .received(character.byte, Faults::from_bits(character.faults));
        }
        if status.wants_byte() {
            match self.port.next() {
                Next::Byte(byte) => self.uart.send(byte),
                Next::Wait => self.uart.pause_sending(),
                Next::Done => self.uart.finish_sending(),
            }
        } else if !status.received() {
            self.without_cause();
        }
        false
    }

    /// The gap timer's interrupt. True when a request waits to be taken.
    #[inline]
    pub fn on_gap(&mut self) -> bool {
        match self.gap.take_event() {
            GapEvent::T15 => self.port.short_silence(clock::millis()),
            GapEvent::T35 => self.port.long_silence(clock::millis()),
            GapEvent::Nothing => false,
        }
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
        let is_sound = if self.port.is_sending() {
            self.sending_ms < self.longest_ms
        } else {
            match registers {
                Registers::Uart => self.uart.is_sound(),
                Registers::GapControl => {
                    let waits_for_silence = !self.port.is_idle();
                    self.gap.control_is_sound() && (!waits_for_silence || self.gap.is_running())
                }
                Registers::GapTimes => self.gap.times_are_sound(),
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
        self.port.sent();
        self.gap.restart();
        self.repaired = true;
    }

    /// The time has passed that the last reply to begin may take: one that is still being sent never ends.
    pub fn on_limit(&mut self) {
        if self.gap.take_limit() && self.port.is_sending() {
            self.repair();
        }
    }

    /// Whether the line was set up again since the last call.
    pub const fn take_repaired(&mut self) -> bool {
        core::mem::replace(&mut self.repaired, false)
    }

    /// A millisecond has passed: the response delay runs, and a disturbed line is set up again.
    pub fn on_millisecond(&mut self) {
        self.causeless = 0;
        self.sending_ms = self.sending_ms.saturating_add(1);
        self.looked_at = match self.looked_at {
            Registers::Uart => Registers::GapControl,
            Registers::GapControl => Registers::GapTimes,
            Registers::GapTimes => Registers::StartBit,
            Registers::StartBit => Registers::Uart,
        };
        self.check(self.looked_at);
        self.port.tick();
        self.start();
    }

    /// Whether a reply is on its way, or waits to be.
    pub fn is_replying(&self) -> bool {
        self.port.is_replying()
    }

    /// The request that waits, if any; its reply starts now, or after `delay_ms`.
    #[inline]
    pub fn take(&mut self, server: &Server, delay_ms: u16) -> Option<Request<'static>> {
        let request = server.take(&mut self.port, delay_ms);
        self.start();
        request
    }

    /// The reply is decided upon.
    pub fn answer(&mut self, decided: Decided<'static>) -> Answered<'static> {
        let answered = decided.answer(&mut self.port);
        self.resume();
        answered
    }

    /// The request has been carried out.
    pub fn finish(&mut self, served: Served<'static>) {
        served.finish(&mut self.port);
        self.resume();
    }

    /// Takes the bus and sends the first byte of a reply that starts now, if one does.
    #[inline]
    fn start(&mut self) {
        if let Some(first) = self.port.start() {
            self.gap.stop();
            self.sending_ms = 0;
            self.uart.start_sending(first);
            self.gap.limit_sending();
        }
    }

    /// There may be more of the reply now.
    #[inline]
    fn resume(&mut self) {
        if self.port.is_sending() {
            self.uart.resume_sending();
        }
    }
}
