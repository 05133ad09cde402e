//! A line: UART, frame-gap timer and port, and its recovery after a disturbance.
//!
//! This module does not access hardware: UART and timer are traits of [`ports::line`]. On the device all of it
//! runs from RAM, so that it continues while flash is erased or programmed. Functions that are called from here must be
//! in RAM, too (`board-support/memory/sections.x`).

use modbus_server::{
    LineCounters, Reply, Request,
    fast::Contest,
    line::{Arbitration, FastUnit, Faults, Port, Turn, Units, Windows},
};
use ports::line::{GapTimer, Silence, Uart};
use register_map::board::{Count, Exactly};

/// The unit addresses of both lines of a board, which depend on whether it has events. Both have the same type, so that they
/// share their code.
pub trait Addresses: Count {
    /// The unit addresses of a line.
    type Units: Units;

    /// Returns the addresses of a line, or `None` if it is not served. `is_fast`: it serves function 70, by which a unit
    /// without an address can be found.
    fn units(unit: Option<u8>, is_fast: bool) -> Option<Self::Units>;
}

impl Addresses for Exactly<0> {
    type Units = u8;

    fn units(unit: Option<u8>, _is_fast: bool) -> Option<u8> {
        unit
    }
}

impl Addresses for Exactly<1> {
    type Units = FastUnit;

    fn units(unit: Option<u8>, is_fast: bool) -> Option<FastUnit> {
        let units = FastUnit {
            unit: unit.unwrap_or_default(),
            is_fast,
        };
        (unit.is_some() || is_fast).then_some(units)
    }
}

/// A line in use.
pub struct Line<U, G, N> {
    uart: U,
    gap: G,
    port: Port<'static, N>,
    /// Times of an arbitration, and the end of the last request of Fast Modbus.
    windows: Windows,
    ended: Option<u32>,
    /// Milliseconds that a reply may take, in case the timer does not limit it.
    longest_ms: u16,
    /// Milliseconds since the last request has ended, or its reply has begun. Unlike the times of an arbitration, this
    /// count does not wrap while a task waits for an erase of flash.
    passed_ms: u16,
    /// An event of the timer was pending in the last millisecond, and its interrupt has not run since.
    is_pending: bool,
    /// The line was set up again since the last millisecond.
    repaired: bool,
}

impl<U: Uart, G: GapTimer, N: Units> Line<U, G, N> {
    /// Creates a line that receives. The gap timer measures the port's silences, and the times of `windows` are in its
    /// ticks. A reply that takes more than `longest_ms` milliseconds is aborted.
    pub fn new(
        uart: U,
        mut gap: G,
        port: Port<'static, N>,
        windows: Windows,
        longest_ms: u16,
    ) -> Self {
        gap.restart();
        Self {
            uart,
            gap,
            port,
            windows,
            ended: None,
            longest_ms,
            passed_ms: 0,
            is_pending: false,
            repaired: false,
        }
    }

    /// Sets the unit addresses, which have changed.
    pub fn set_units(&mut self, units: N) {
        self.port.set_units(units);
    }

    /// Handles the UART's interrupt. `now_ms` returns the milliseconds since the start. Returns true when a reply has just
    /// been sent, or a request waits to be served.
    #[inline]
    pub fn on_uart(&mut self, now_ms: impl FnOnce() -> u32) -> bool {
        let status = self.uart.status();
        // Checked first, because another station may drive the bus within a bit time after the last stop bit.
        if U::sent(status) {
            self.uart.stop_sending();
            self.port.sent();
            // Other causes raise the interrupt again.
            return true;
        }
        if U::received(status) {
            let character = self.uart.read(status);
            let faults = Faults::from_bits(character.faults);
            if self.port.received(character.byte, faults) && N::FAST {
                // If the UART wants a byte, too, it raises the interrupt again.
                return self.on_special(character.byte, now_ms());
            }
            self.gap.restart();
        }
        if U::wants_byte(status) {
            match self.port.next_byte() {
                Some(byte) => self.uart.send(byte),
                None => self.uart.finish_sending(),
            }
        } else if !U::received(status) {
            self.repaired |= self.uart.disable_other_interrupts();
        }
        false
    }

    /// Handles a character that may end a message of Fast Modbus, or is one of an arbitration. Returns whether a request
    /// waits to be served.
    #[inline(never)]
    fn on_special(&mut self, character: u8, now_ms: u32) -> bool {
        if let Some(at) = self.gap.fell() {
            self.port.fell(at);
        }
        let waits = self.port.ends_fast_message(now_ms);
        if waits {
            self.ended = Some(self.gap.end_of(character));
            self.passed_ms = 0;
        }
        self.gap.restart();
        waits
    }

    /// Handles the gap timer's interrupt at `now_ms` milliseconds after the start. Returns true when a request
    /// waits to be served.
    #[inline]
    pub fn on_gap(&mut self, now_ms: u32) -> bool {
        self.is_pending = false;
        let waits = match self.gap.take_event() {
            Silence::T15 => self.port.short_silence(now_ms),
            Silence::T35 => self.port.long_silence(now_ms),
            Silence::None => false,
        };
        if N::FAST && waits {
            self.ended = None;
            self.passed_ms = 0;
        }
        waits
    }

    /// Returns whether the line's registers change: a reply is being sent, or the unit arbitrates.
    pub fn is_sending(&self) -> bool {
        self.port.is_sending() || N::FAST && self.port.is_arbitrating()
    }

    /// Returns whether a reply has not taken too long, or the driver is off and the end of a frame is measured. An event
    /// that is pending in two milliseconds, while its interrupt has not run, is not going to be handled.
    fn is_sound(&mut self) -> bool {
        if self.is_sending() {
            return self.passed_ms < self.longest_ms;
        }
        if !self.uart.driver_is_off() {
            return false;
        }
        // In this order: a timer that stops between the two reads has its event pending in the second one.
        let is_running = self.gap.is_running();
        let is_pending = self.gap.is_pending();
        let was_pending = core::mem::replace(&mut self.is_pending, is_pending);
        if is_pending {
            !was_pending
        } else {
            is_running || self.port.is_idle()
        }
    }

    /// Sets the line up again. After that the driver is off and the next request is served, whatever the state was
    /// before.
    pub fn repair(&mut self) {
        self.uart.set_up();
        self.gap.set_up();
        self.port.withdraw();
        self.port.sent();
        self.gap.restart();
        self.repaired = true;
    }

    /// Handles the interrupt of the time limit, when a reply that is still being sent is aborted, and of the unit's turns in
    /// an arbitration.
    pub fn on_alarm(&mut self) {
        let alarms = self.gap.take_alarms();
        if alarms.limit && self.port.is_sending() {
            self.repair();
        }
        if N::FAST && alarms.wake {
            self.take_turn();
        }
    }

    fn take_turn(&mut self) {
        if let Some(at) = self.gap.fell() {
            self.port.fell(at);
        }
        match self.port.turn() {
            Turn::None => {}
            Turn::Bit(character) => self.uart.start_sending(character),
            Turn::Reply(first) => self.begin(first),
        }
        self.wait_for_turn();
    }

    fn wait_for_turn(&mut self) {
        if let Some(deadline) = self.port.deadline()
            && !self.gap.wake_at(deadline)
        {
            self.port.withdraw();
        }
    }

    /// Takes part in an arbitration, and sends the reply if this unit wins it. A request that is served too late for its
    /// first window has no reply.
    pub fn arbitrate(&mut self, reply: Reply<'static>, contest: Contest) {
        // A request with a function of unknown length inside has ended with a silence.
        let ended = self.ended.unwrap_or_else(|| self.gap.now());
        let Contest { value, windows } = contest;
        let arbitration = Arbitration::new(value, windows, ended, self.windows);
        self.port.arbitrate(reply, arbitration);
        // Otherwise the times are those of a request that has come since.
        if self.port.is_arbitrating() {
            self.ended = None;
            // After a count of n at least n - 1 milliseconds have passed.
            if core::mem::take(&mut self.passed_ms) > self.windows.start_ms + 1 {
                self.port.withdraw();
            }
            self.wait_for_turn();
        }
    }

    /// Runs once per millisecond: advances the response delay and, when `checks`, repairs a line that does not work.
    /// Returns whether the line was set up again since the last call.
    pub fn on_millisecond(&mut self, checks: bool) -> bool {
        self.passed_ms = self.passed_ms.saturating_add(1);
        if checks && !self.is_sound() {
            self.repair();
        }
        if self.port.tick() {
            self.start();
        }
        core::mem::take(&mut self.repaired)
    }

    /// Turns the driver on and sends the first byte of a reply, if one starts now.
    #[inline]
    fn start(&mut self) {
        if let Some(first) = self.port.start() {
            self.begin(first);
        }
    }

    #[inline(always)]
    fn begin(&mut self, first: u8) {
        self.gap.stop();
        self.passed_ms = 0;
        self.uart.start_sending(first);
        self.gap.limit_sending();
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
