//! The run loop, which executes instructions and events in the order of their times.
//!
//! The core runs up to the next event of a peripheral, of its SysTick, or up to a limit. The event is then handled
//! and the core runs on. While the core waits (WFI), stalls on the flash or is held in reset, time jumps from event
//! to event.

use rigless::emulator::Exit;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use super::Chip;
use crate::finding::What;
use crate::machine::usage::Rest;
use crate::memory::RAM_BASE;
use crate::periph::rcc::Cause;
use crate::peripheral::Unmodelled;
use crate::rtt::POLL;
use crate::soc::Circuit;
use crate::time::Time;

/// The system control register and its bit that selects deep sleep, stop or standby (PM0056 4.4.6).
const SCR: u64 = 0xE000_ED10;
const SCR_SLEEPDEEP: u64 = 1 << 2;

/// The register with the bit that enables DWT (ARMv7-M ARM, DDI 0403E C1.6.5).
const DEMCR: u64 = 0xE000_EDFC;
const TRCENA: u64 = 1 << 24;

/// The register with the bit that pends the NMI (PM0056 4.4.3). A debugger can reach the core's NMI only through it.
const ICSR: u64 = 0xE000_ED04;
const NMIPENDSET: u64 = 1 << 31;
/// The number of the register xPSR, its field with the number of the active exception, and the NMI's exception number
/// (PM0056 2.1.3).
pub(super) const XPSR: usize = 16;
pub(super) const IPSR: u32 = 0x1FF;
const NMI: u32 = 2;

/// Finding when the firmware calls a debugger.
const SEMIHOSTING: &str =
    "semihosting: BKPT 0xAB calls a debugger; without one, as here, it is a hard fault";

/// A run without a limit in time ends when the core has executed no instruction for this long.
const GIVE_UP: Time = Time::from_secs(60);

/// Conditions that end a run; the first that occurs ends it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    /// At this instant.
    pub time: Time,
    /// After this number of instructions, counted since the chip was made.
    pub instructions: u64,
    /// Before the instruction at this address.
    pub pc: Option<u32>,
    /// Before an instruction at which a debugger has set a breakpoint.
    pub breakpoints: bool,
}

impl Limit {
    /// Returns a limit at this instant only.
    pub(crate) const fn until(time: Time) -> Self {
        Self {
            time,
            instructions: u64::MAX,
            pc: None,
            breakpoints: false,
        }
    }
}

impl<C: Circuit> Chip<C> {
    /// Runs up to `limit`. Returns whether the run ended before the instruction at `limit.pc` or at a breakpoint. While
    /// the power is off, time passes for the circuit around the part. A run without a limit in time also ends when the
    /// power is off, or when the core has executed nothing for a minute.
    pub(crate) fn run_core(&mut self, limit: Limit) -> bool {
        let address = limit.pc.map(|pc| u64::from(pc & !1));
        if let Some(address) = address {
            self.core.add_breakpoint(address);
            // The breakpoint is passed when the core is at the address now, but not when an interrupt comes first and
            // returns there.
            if self.core.pc() == address {
                self.core.pass_breakpoint(address);
            }
        }
        let stop = self.run_to(limit);
        if let Some(address) = address {
            self.core.remove_breakpoint(address);
        }
        stop
    }

    fn run_to(&mut self, limit: Limit) -> bool {
        let mut patience = self.now() + GIVE_UP;
        loop {
            let now = self.now();
            self.bus.advance(now, self.core.retired());
            self.serve_core_timer(now);
            self.look_at_trace();
            if self.cut_is_due(now) {
                self.power_off();
            }
            if self.powered && self.serve_resets() {
                continue;
            }
            self.serve_nmi();
            if now >= self.poll_at {
                self.log.poll(self.bus.soc.ram.bytes_mut());
                self.poll_at = POLL * (now.as_ps() / POLL.as_ps() + 1);
            }
            if now >= limit.time {
                return false;
            }
            if self.instructions() >= limit.instructions {
                return false;
            }
            self.look_at_waits(now);
            if let Some((end, why)) = self.idle_end(now) {
                if !self.idle(end, why, limit, patience) {
                    return false;
                }
                continue;
            }
            match self.execute(limit) {
                Exit::Breakpoint => {
                    let pc = self.pc();
                    if limit.breakpoints || limit.pc.is_some_and(|wanted| wanted & !1 == pc) {
                        return true;
                    }
                    self.core.pass_breakpoint(u64::from(pc));
                }
                Exit::Waiting if self.bus.queued.is_empty() => {
                    self.check_sleep();
                    if !self.idle(Time::MAX, self.why_waiting(), limit, patience) {
                        return false;
                    }
                    continue;
                }
                Exit::Lockup => {
                    self.locked_up = true;
                    let (now, pc) = (self.now(), self.pc());
                    self.bus.findings.add(now, pc, What::LockedUp);
                }
                // Semihosting is not modelled, so BKPT is a fault, as on a board without a debugger.
                Exit::HostCall => {
                    let (now, pc) = (self.now(), self.pc());
                    self.bus.findings.add(now, pc, What::Other(SEMIHOSTING));
                    self.core.answer_host_call(None);
                }
                _ => {}
            }
            patience = self.now() + GIVE_UP;
        }
    }

    /// Passes to DWT whether DEMCR.TRCENA is set.
    fn look_at_trace(&mut self) {
        if self.bus.dwt.in_use() {
            let cycle = self.cycles();
            let demcr = self
                .core
                .debugger_access(None, DEMCR, Width::W32, VirtualNanos(cycle));
            let enabled = demcr.is_some_and(|demcr| demcr & TRCENA != 0);
            if let Err(Unmodelled(text)) = self.bus.dwt.look(enabled, cycle) {
                let (now, pc) = (self.now(), self.bus.pc);
                self.bus.findings.add(now, pc, What::Other(text));
            }
        }
    }

    /// Reports a finding when the core enters stop or standby mode, which are not modelled: both also stop the clocks
    /// (RM0008 4.3.4, 4.3.5).
    fn check_sleep(&mut self) {
        let now = VirtualNanos(self.bus.clock.cycle(self.core.retired()));
        let scr = self.core.debugger_access(None, SCR, Width::W32, now);
        if scr.is_some_and(|scr| scr & SCR_SLEEPDEEP != 0) {
            let what = What::Other("stop and standby modes (SLEEPDEEP) are not modelled");
            self.bus.findings.add(self.now(), self.pc(), what);
        }
    }

    /// Lets time pass without an instruction up to `end`, the next event, or the limit, whichever is first. Returns
    /// whether time has passed: not when nothing will ever happen, or not before `patience` in a run without a limit
    /// in time.
    fn idle(&mut self, end: Time, why: Rest, limit: Limit, patience: Time) -> bool {
        let until = end.min(self.next_event()).min(limit.time);
        if until == Time::MAX || (limit.time == Time::MAX && until > patience) {
            return false;
        }
        let from = self.now();
        self.bus
            .clock
            .jump(self.core.retired(), until.min(self.poll_at));
        self.resting.add(why, self.now() - from);
        true
    }

    /// Returns why the core waits: after WFI or WFE, or in a branch to itself, which the emulated core treats as a
    /// wait.
    fn why_waiting(&self) -> Rest {
        const BRANCH: u16 = 0xE7FE;
        const WIDE_BRANCH: [u16; 2] = [0xF7FF, 0xBFFE];
        const WAITS: [u16; 2] = [0xBF20, 0xBF30];
        let pc = self.pc();
        let [before, at, behind] = [pc.wrapping_sub(2), pc, pc.wrapping_add(2)]
            .map(|address| self.half(address).unwrap_or(0));
        let branch = at == BRANCH || [at, behind] == WIDE_BRANCH;
        if branch && !WAITS.contains(&before) {
            Rest::Spinning
        } else {
            Rest::Asleep
        }
    }

    /// Returns the half-word of code at `address`.
    pub(super) fn half(&self, address: u32) -> Option<u16> {
        let (bytes, at) = match self.bus.flash_offset(address) {
            Some(at) => (self.bus.soc.flash.bytes(), at),
            None => (self.ram(), address.wrapping_sub(RAM_BASE)),
        };
        let half = bytes.get(at as usize..)?.first_chunk()?;
        Some(u16::from_le_bytes(*half))
    }

    /// Returns whether an instruction at `pc` is fetched from flash.
    pub(super) fn is_flash(&self, pc: u32) -> bool {
        self.bus.flash_offset(pc).is_some()
    }

    /// Looks at the pending interrupts, to measure how long they wait. The queued changes of interrupt lines reach the
    /// core first.
    fn look_at_waits(&mut self, now: Time) {
        if self.bus.waits.is_none() || !self.powered {
            return;
        }
        for queued in core::mem::take(&mut self.bus.queued) {
            self.core.ask(queued);
            self.unsettled = true;
        }
        let cycle = self.cycles();
        if let Some(waits) = &mut self.bus.waits {
            waits.look(&mut *self.core, now, cycle);
        }
    }

    /// Returns the earliest time of an event other than an instruction, or [`Time::MAX`] for never.
    pub(super) fn next_event(&self) -> Time {
        let timer = self.core.next_event().filter(|_| self.powered);
        let timer = timer.map_or(Time::MAX, |VirtualNanos(cycle)| {
            self.bus.clock.time_of_cycle(cycle)
        });
        self.bus
            .soc
            .next_event()
            .min(timer)
            .min(self.cut_at.unwrap_or(Time::MAX))
    }

    /// Returns the instant before which the core executes nothing, as far as is known: [`Time::MAX`] if it sleeps and
    /// no event is due.
    #[must_use]
    pub fn next_instruction(&self) -> Time {
        let now = self.now();
        let event = self.next_event();
        if let Some((end, _)) = self.idle_end(now) {
            return end.min(event);
        }
        let asleep = self.core.waiting() && self.bus.queued.is_empty() && !self.stirred;
        if asleep && !self.bus.soc.rcc.nmi() {
            event.max(now)
        } else {
            now
        }
    }

    /// Returns until when the core cannot execute an instruction, and why: no power, no clock, held in reset, locked
    /// up, or stalled by the flash.
    fn idle_end(&self, now: Time) -> Option<(Time, Rest)> {
        if !self.powered || self.locked_up || self.bus.soc.rcc.stopped() {
            return Some((Time::MAX, Rest::Off));
        }
        if now < self.held_until {
            return Some((self.held_until, Rest::Off));
        }
        self.bus
            .soc
            .flash
            .stalled_until()
            .filter(|_| self.is_flash(self.pc()))
            .or_else(|| {
                self.bus
                    .soc
                    .flash
                    .busy_until()
                    .filter(|_| self.bus.read_stalls)
            })
            .map(|end| (end, Rest::Stalled))
    }

    /// Delivers the events of SysTick that are due.
    fn serve_core_timer(&mut self, now: Time) {
        while let Some(VirtualNanos(cycle)) = self.core.next_event() {
            if !self.powered || self.bus.clock.time_of_cycle(cycle) > now {
                return;
            }
            let count = self.core.retired();
            self.bus.clock.reach_cycle(count, cycle);
            self.core
                .on_event(VirtualNanos(self.bus.clock.cycle(count)));
            self.unsettled = true;
            self.stirred = true;
        }
    }

    /// Enters the NMI's handler while its line is high, which it is until CSSC is written (RM0008 7.2.7). A handler
    /// that returns without writing CSSC is entered again. The NMI also ends a lock-up in the hard fault handler.
    fn serve_nmi(&mut self) {
        if !self.bus.soc.rcc.nmi() {
            return;
        }
        let active = self.register(XPSR).is_some_and(|xpsr| xpsr & IPSR == NMI);
        if !active {
            let now = VirtualNanos(self.bus.clock.cycle(self.core.retired()));
            self.core
                .debugger_access(Some(NMIPENDSET), ICSR, Width::W32, now);
            self.locked_up = false;
            self.unsettled = true;
        }
    }

    /// Performs a reset that a peripheral or the core has requested. Returns whether there was one.
    fn serve_resets(&mut self) -> bool {
        let asked = self.core.take_reset_request().then_some(Cause::Software);
        let cause = self.bus.soc.signals.reset.take().or(asked);
        if let Some(cause) = cause {
            self.reset_by(cause);
        }
        cause.is_some()
    }

    /// Returns whether a power cut in the middle of a flash operation is due now.
    fn cut_is_due(&mut self, now: Time) -> bool {
        if let Some(cut) = self.cut
            && let Some((from, until)) = self.bus.soc.flash.busy_span()
            && self.bus.soc.flash.started() >= cut.operation
        {
            let whole = (until - from).as_ps();
            let done = (whole as f64 * cut.fraction) as u64;
            self.cut_at = Some(from + Time::from_ps(done.min(whole.saturating_sub(1))));
            self.cut = None;
        }
        self.cut_at.is_some_and(|at| at <= now)
    }
}
