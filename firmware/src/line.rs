//! A line: UART, frame-gap timer and port, and what keeps it going after a disturbance.
//!
//! It knows no hardware: UART and timer are two traits, so that every line of a board, and the tests, have the same
//! code. On the device all of it runs from RAM, so that it goes on while flash is erased or programmed: what is called
//! here must be there, too (`memory/sections.x`).

use modbus_server::{
    Answered, Decided, Request, Served, Server,
    line::{Faults, Next, Port},
};

/// A UART with the driver enable of its transceiver.
pub trait Uart {
    /// What the UART wants, as it was when it was asked.
    type Status: Copy;

    /// What the UART wants.
    fn status(&self) -> Self::Status;
    /// A character is waiting to be [read](Self::read), or was lost.
    fn received(status: Self::Status) -> bool;
    /// The next byte can be [sent](Self::send), and one is wanted.
    fn wants_byte(status: Self::Status) -> bool;
    /// The last stop bit has left the unit.
    fn sent(status: Self::Status) -> bool;

    /// Takes the character that [`received`](Self::received) told of, with what was wrong with it.
    fn read(&mut self, status: Self::Status) -> (u8, Faults);
    /// Turns the driver on and sends the first byte of a reply, with the receiver off.
    fn start_sending(&mut self, first: u8);
    /// Sends the next byte.
    fn send(&mut self, byte: u8);
    /// No byte is ready yet: asks no more until [`resume_sending`](Self::resume_sending).
    fn pause_sending(&mut self);
    /// Bytes are ready again.
    fn resume_sending(&mut self);
    /// The last byte was given to the UART: [`sent`](Self::sent) will tell when it has left.
    fn finish_sending(&mut self);
    /// Turns the driver off and the receiver on.
    fn stop_sending(&mut self);

    /// Turns the driver off, sets every register up, and listens.
    fn set_up(&mut self);
    /// Whether every register is as it was set up and the driver is off, while nothing is being sent.
    fn is_sound(&self) -> bool;
}

/// The timer of a line's silences, which also limits the time of a reply.
pub trait GapTimer {
    /// How many [parts](Self::is_sound) of its registers are looked at one after the other.
    const PARTS: u8;

    /// A character has come: the silence begins.
    fn restart(&mut self);
    /// No silence is waited for while a reply is being sent.
    fn stop(&mut self);
    /// Whether a silence is waited for.
    fn is_running(&self) -> bool;
    /// Takes what its interrupt is about.
    fn take_event(&mut self) -> Silence;
    /// A reply has begun, and may take its time.
    fn limit_sending(&mut self);
    /// Takes the interrupt of [`limit_sending`](Self::limit_sending): whether the time has passed.
    fn take_limit(&mut self) -> bool;

    /// Sets every register up.
    fn set_up(&mut self);
    /// Whether the registers of a part, 0 to [`PARTS`](Self::PARTS) less 1, are as they were set up. All at once would
    /// hold the line's interrupts off for longer.
    fn is_sound(&self, part: u8) -> bool;
}

/// A silence on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Silence {
    /// t1.5 has passed.
    T15,
    /// t3.5 has passed.
    T35,
    /// None has; the interrupt came for nothing.
    None,
}

/// A line in use.
pub struct Line<U, G> {
    uart: U,
    gap: G,
    port: Port<'static>,
    /// Milliseconds that a reply may take, should the timer not limit it, and that the one under way has taken.
    longest_ms: u16,
    sending_ms: u16,
    /// What was looked at in the last millisecond: the UART, or from 1 on a part of the timer.
    looked_at: u8,
    /// Interrupts of the UART without a cause since the last millisecond.
    causeless: u8,
    /// The line was set up again since [`take_repaired`](Self::take_repaired).
    repaired: bool,
}

/// The place of the UART in [`Line::looked_at`].
const UART: u8 = 0;

/// Interrupts of the UART without a cause in one millisecond after which its registers are checked.
const CAUSELESS: u8 = 8;

impl<U: Uart, G: GapTimer> Line<U, G> {
    /// Listens. The gap timer measures the port's silences. A reply that takes more than `longest_ms` milliseconds is
    /// cut off.
    pub fn new(uart: U, mut gap: G, port: Port<'static>, longest_ms: u16) -> Self {
        gap.restart();
        Self {
            uart,
            gap,
            port,
            longest_ms,
            sending_ms: 0,
            looked_at: UART,
            causeless: 0,
            repaired: false,
        }
    }

    /// The UART's interrupt. True when a reply has just left.
    #[inline]
    pub fn on_uart(&mut self) -> bool {
        let status = self.uart.status();
        // First, for the bus is another's within a bit of the last stop bit.
        if U::sent(status) {
            self.uart.stop_sending();
            self.port.sent();
            // Whatever else there is calls again.
            return true;
        }
        if U::received(status) {
            let (byte, faults) = self.uart.read(status);
            self.gap.restart();
            self.port.received(byte, faults);
        }
        if U::wants_byte(status) {
            match self.port.next() {
                Next::Byte(byte) => self.uart.send(byte),
                Next::Wait => self.uart.pause_sending(),
                Next::Done => self.uart.finish_sending(),
            }
        } else if !U::received(status) {
            self.without_cause();
        }
        false
    }

    /// The gap timer's interrupt, `now_ms` milliseconds after the start. True when a request waits to be taken.
    #[inline]
    pub fn on_gap(&mut self, now_ms: u32) -> bool {
        match self.gap.take_event() {
            Silence::T15 => self.port.short_silence(now_ms),
            Silence::T35 => self.port.long_silence(now_ms),
            Silence::None => false,
        }
    }

    /// The UART's interrupt has come without a cause that is known here. The scan pends it now and then; more
    /// than that is a disturbed register whose interrupt comes again at once and keeps all tasks from running.
    fn without_cause(&mut self) {
        self.causeless += 1;
        if self.causeless == CAUSELESS {
            self.causeless = 0;
            self.check(UART);
        }
    }

    /// Sets the line up again when registers are not what they were set to, when the end of a frame is
    /// not being waited for, or when a reply does not end: whatever has disturbed them, the driver goes off
    /// and the next request is served. While a reply is being sent only its time is looked at, because the driver must
    /// go off right after the last bit.
    #[cold]
    fn check(&mut self, registers: u8) {
        let is_sound = if self.port.is_sending() {
            self.sending_ms < self.longest_ms
        } else if let Some(part) = registers.checked_sub(UART + 1) {
            let waits_for_silence = part == 0 && !self.port.is_idle();
            self.gap.is_sound(part) && (!waits_for_silence || self.gap.is_running())
        } else {
            self.uart.is_sound()
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
        self.looked_at = if self.looked_at < G::PARTS {
            self.looked_at + 1
        } else {
            UART
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

#[cfg(test)]
mod tests;
