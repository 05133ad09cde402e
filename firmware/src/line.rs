//! A line: UART, frame-gap timer and port, and its recovery after a disturbance.
//!
//! This module does not access hardware. UART and timer are two traits, so that every line of a board and the tests
//! use the same code. On the device all of it runs from RAM, so that it continues while flash is erased or
//! programmed. Functions that are called from here must be in RAM, too (`memory/sections.x`).

use modbus_server::{
    LineCounters, Reply, Request,
    line::{Faults, Port},
};

/// A UART with the driver enable of its transceiver.
pub trait Uart {
    /// State of the UART at the time of a [`status`](Self::status) call.
    type Status: Copy;

    /// Reads the state of the UART.
    fn status(&self) -> Self::Status;
    /// Returns whether a character is waiting to be [read](Self::read) or was lost.
    fn received(status: Self::Status) -> bool;
    /// Returns whether the UART wants the next byte and can [send](Self::send) it.
    fn wants_byte(status: Self::Status) -> bool;
    /// Returns whether the last stop bit has been sent.
    fn sent(status: Self::Status) -> bool;

    /// Reads the character that [`received`](Self::received) reported, with its errors.
    fn read(&mut self, status: Self::Status) -> (u8, Faults);
    /// Turns the receiver off and the driver on, and sends the first byte of a reply.
    fn start_sending(&mut self, first: u8);
    /// Sends the next byte.
    fn send(&mut self, byte: u8);
    /// Ends the sending: the last byte was given to the UART. [`sent`](Self::sent) reports when it has been sent.
    fn finish_sending(&mut self);
    /// Turns the driver off and the receiver on.
    fn stop_sending(&mut self);

    /// Turns the driver off, sets every register up, and turns the receiver on.
    fn set_up(&mut self);
    /// Returns whether every register is as set up and the driver is off. Only valid while nothing is being sent.
    fn is_sound(&self) -> bool;
}

/// The timer that measures a line's silences and limits the duration of a reply.
pub trait GapTimer {
    /// Number of [parts](Self::is_sound) of its registers, which are checked one after another.
    const PARTS: u8;

    /// Restarts the silence: a character was received.
    fn restart(&mut self);
    /// Stops measuring: silences do not matter while a reply is being sent.
    fn stop(&mut self);
    /// Returns whether a silence is being measured.
    fn is_running(&self) -> bool;
    /// Acknowledges its interrupt and returns the reason.
    fn take_event(&mut self) -> Silence;
    /// Starts the time limit of a reply that has just begun.
    fn limit_sending(&mut self);
    /// Acknowledges the interrupt of [`limit_sending`](Self::limit_sending). Returns whether the time limit has
    /// been reached.
    fn take_limit(&mut self) -> bool;

    /// Sets every register up.
    fn set_up(&mut self);
    /// Returns whether the registers of a part, 0 to [`PARTS`](Self::PARTS) - 1, are as set up. Checking all of
    /// them in one call would delay the line's interrupts for longer.
    fn is_sound(&self, part: u8) -> bool;
}

/// A silence on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Silence {
    /// t1.5 has passed.
    T15,
    /// t3.5 has passed.
    T35,
    /// Neither; the interrupt had no cause.
    None,
}

/// A line in use.
pub struct Line<U, G> {
    uart: U,
    gap: G,
    port: Port<'static>,
    /// Milliseconds that a reply may take, in case the timer does not limit it, and milliseconds that the present
    /// one has taken.
    longest_ms: u16,
    sending_ms: u16,
    /// Part that was checked in the last millisecond: [`UART`], or from 1 on a part of the timer.
    looked_at: u8,
    /// Number of interrupts of the UART without a cause since the last millisecond.
    causeless: u8,
    /// The line was set up again since the last [`take_repaired`](Self::take_repaired).
    repaired: bool,
}

/// Value of [`Line::looked_at`] for the UART.
const UART: u8 = 0;

/// Number of UART interrupts without a cause in one millisecond after which its registers are checked.
const CAUSELESS: u8 = 8;

impl<U: Uart, G: GapTimer> Line<U, G> {
    /// Creates a line that receives. The gap timer measures the port's silences. A reply that takes more than
    /// `longest_ms` milliseconds is aborted.
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

    /// Handles the UART's interrupt. Returns true when a reply has just been sent.
    #[inline]
    pub fn on_uart(&mut self) -> bool {
        let status = self.uart.status();
        // Checked first, because another station may drive the bus within a bit time after the last stop bit.
        if U::sent(status) {
            self.uart.stop_sending();
            self.port.sent();
            // Other causes raise the interrupt again.
            return true;
        }
        if U::received(status) {
            let (byte, faults) = self.uart.read(status);
            self.gap.restart();
            self.port.received(byte, faults);
        }
        if U::wants_byte(status) {
            match self.port.next_byte() {
                Some(byte) => self.uart.send(byte),
                None => self.uart.finish_sending(),
            }
        } else if !U::received(status) {
            self.without_cause();
        }
        false
    }

    /// Handles the gap timer's interrupt at `now_ms` milliseconds after the start. Returns true when a request
    /// waits to be served.
    #[inline]
    pub fn on_gap(&mut self, now_ms: u32) -> bool {
        match self.gap.take_event() {
            Silence::T15 => self.port.short_silence(now_ms),
            Silence::T35 => self.port.long_silence(now_ms),
            Silence::None => false,
        }
    }

    /// Counts an interrupt of the UART without a known cause. The scan pends the interrupt now and then. If there
    /// are more, a disturbed register raises the interrupt again and again, which blocks all tasks.
    fn without_cause(&mut self) {
        self.causeless += 1;
        if self.causeless == CAUSELESS {
            self.causeless = 0;
            self.check(UART);
        }
    }

    /// Sets the line up again when registers are not as set up, when the end of a frame is not being measured, or
    /// when a reply does not end. After that the driver is off and the next request is served, whatever the cause
    /// was. While a reply is being sent only its duration is checked, because the driver must be turned off right
    /// after the last bit.
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

    /// Handles the interrupt of the time limit: a reply that is still being sent is aborted.
    pub fn on_limit(&mut self) {
        if self.gap.take_limit() && self.port.is_sending() {
            self.repair();
        }
    }

    /// Returns whether the line was set up again since the last call.
    pub const fn take_repaired(&mut self) -> bool {
        core::mem::replace(&mut self.repaired, false)
    }

    /// Runs once per millisecond: advances the response delay and repairs a disturbed line.
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

    /// Turns the driver on and sends the first byte of a reply, if one starts now.
    #[inline]
    fn start(&mut self) {
        if let Some(first) = self.port.start() {
            self.gap.stop();
            self.sending_ms = 0;
            self.uart.start_sending(first);
            self.gap.limit_sending();
        }
    }

    /// Returns whether a reply is being sent or waits to be sent.
    pub fn is_replying(&self) -> bool {
        self.port.is_replying()
    }

    /// Takes the waiting request, if any.
    #[inline]
    pub fn take(&mut self) -> Option<Request<'static>> {
        self.port.take()
    }

    /// Sends a reply, if there is one, now or after `delay_ms`.
    pub fn send(&mut self, reply: Reply<'static>, delay_ms: u16) {
        self.port.send(reply, delay_ms);
        self.start();
    }

    /// Returns the counters of the line.
    pub fn counters(&self) -> LineCounters {
        *self.port.counters()
    }
}

#[cfg(test)]
mod tests;
