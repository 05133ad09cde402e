//! The capture and compare channels of a timer (RM0008 15.3.4 to 15.3.8): which of their flags can rise,
//! captures, and the registers CCMR and CCR.

use super::counter::compare;
use super::{Kind, MOE, OVERCAPTURE, Timer};
use crate::peripheral::Unmodelled;
use crate::time::Time;

impl Timer {
    /// Returns whether an edge at the input of `channel` (1 to 4) can raise an interrupt now. Only then must edges be
    /// passed on immediately.
    #[must_use]
    pub fn capture_interrupt_enabled(&self, channel: usize) -> bool {
        let n = channel - 1;
        self.captures(n) && self.dier & compare(n) != 0
    }

    /// Takes an edge at the input pin of `channel` (1 to 4) at `at`. Edges come in order and before any access or
    /// [`Peripheral::advance`](crate::peripheral::Peripheral::advance) to a later instant; then the captured count is
    /// exact.
    pub fn capture_edge(&mut self, channel: usize, at: Time, rising: bool) {
        let n = channel - 1;
        let wants_falling = self.ccer >> (4 * n + 1) & 1 == 1;
        if self.captures(n) && rising != wants_falling {
            self.sync(at);
            self.capture(n);
        }
    }

    /// Returns whether channel `n` (from 0) captures its own input: CCxS = 01 and CCxE.
    fn captures(&self, n: usize) -> bool {
        self.selection(n) == 1 && self.ccer >> (4 * n) & 1 == 1
    }

    /// Returns the half of CCMR that belongs to channel `n` (from 0).
    pub(super) fn mode(&self, n: usize) -> u32 {
        self.ccmr[n / 2] >> (8 * (n % 2)) & 0xFF
    }

    /// CCxS: 0 = output, 1 = capture of the own input.
    pub(super) fn selection(&self, n: usize) -> u32 {
        self.mode(n) & 3
    }

    pub(super) fn capture(&mut self, n: usize) {
        if self.sr & compare(n) != 0 {
            self.sr |= OVERCAPTURE << n;
        }
        self.sr |= compare(n);
        let count = self.counter.count();
        self.counter.compare[n].write(count, false);
    }

    pub(super) fn write_ccmr(&mut self, half: usize, value: u32) -> Result<(), Unmodelled> {
        let mut value = value & 0xFFFF;
        let mut finding = Ok(());
        for n in [2 * half, 2 * half + 1] {
            let at = 8 * (n % 2);
            let (old, new) = (self.ccmr[half] >> at & 3, value >> at & 3);
            if old != new && self.ccer >> (4 * n) & 1 == 1 {
                // 15.4.7: CCxS is writable only while the channel is off.
                value = value & !(3 << at) | old << at;
                finding = Err(Unmodelled(
                    "timer CCxS written while CCxE = 1: the write is ignored",
                ));
            }
        }
        self.ccmr[half] = value;
        for n in [2 * half, 2 * half + 1] {
            let mode = self.mode(n);
            match mode & 3 {
                0 if mode & 0x84 != 0 => {
                    finding = Err(Unmodelled(
                        "timer output compare fast enable or clear (CCMR)",
                    ));
                }
                0 if mode & 8 == 0 => {
                    let value = self.counter.compare[n].preload;
                    self.counter.compare[n].write(value, false);
                }
                0 => {}
                1 if mode & 0xFC != 0 => {
                    finding = Err(Unmodelled("timer capture filter or prescaler (CCMR)"));
                }
                1 => {}
                _ => {
                    finding = Err(Unmodelled(
                        "timer capture of another channel's input (CCMR)",
                    ))
                }
            }
        }
        finding.and_then(|()| self.check_outputs())
    }

    /// Returns a finding when a compare output is enabled that is not frozen: the pin would move.
    pub(super) fn check_outputs(&self) -> Result<(), Unmodelled> {
        let enabled = |n: usize| self.ccer >> (4 * n) & 5 != 0;
        let moves = |n: usize| self.selection(n) == 0 && self.mode(n) >> 4 & 7 != 0;
        let gated = self.kind == Kind::Advanced && self.bdtr & MOE == 0;
        if !gated && (0..4).any(|n| enabled(n) && moves(n)) {
            return Err(Unmodelled("timer output on a pin (CCER, OCxM)"));
        }
        Ok(())
    }

    pub(super) fn read_ccr(&mut self, n: usize) -> u32 {
        if self.selection(n) != 0 {
            // 15.4.5: reading the captured value clears the flag.
            self.sr &= !compare(n);
        }
        self.counter.compare[n].preload
    }

    pub(super) fn write_ccr(&mut self, n: usize, value: u32) {
        // 15.4.13: read only while the channel is an input.
        if self.selection(n) == 0 {
            let buffered = self.mode(n) & 8 != 0;
            self.counter.compare[n].write(value & 0xFFFF, buffered);
        }
    }
}
