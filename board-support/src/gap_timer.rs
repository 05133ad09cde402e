//! The frame-gap timer: TIM2 in one-pulse mode measures t1.5 and t3.5, and TIM1 detects whether the next character
//! may already have begun.
//!
//! The UART raises its flag only when a character is complete. A character that began just before t3.5 belongs to
//! the frame, but its flag is not set yet when t3.5 is reached. Its start bit is already on the line. PA10 is both
//! the input of USART1 and that of TIM1's channel 3: the capture flag shows, without an interrupt, that the line
//! has fallen since the flag was cleared. The pin of another UART is that of an external interrupt ([`edge`](crate::edge)).
//!
//! The line also falls when a noise pulse is too short for a start bit (RM0008 27.3.3). An edge therefore delays
//! the decision only once, by one character time. A real character is complete by then and restarts the silence.
//! Noise delays a reply by at most one character time, however often it occurs.
//!
//! TIM1 also limits the duration of a reply. Its counter runs free, its tick is long enough that the longest reply
//! takes fewer than 65,536 ticks, and its channel 1 compares. The times of an arbitration are counts of the same timer,
//! because the captured count is the time of an edge; its channel 2 compares for them.

use stm32f1xx_hal::{
    pac,
    rcc::{Enable, Reset},
};

use crate::{
    ClockSource,
    boards::BOARD,
    design::LONGEST_WAIT_US,
    edge::Edge,
    gap_ticks::{CharacterBits, GapTicks, LimitTicks, LineTimes},
};
use ports::{
    line::{Alarms, GapTimer, Silence},
    line_settings::LineSettings,
};

/// The external interrupt for the edges of the line, if TIM1 does not capture them.
const EDGE: Option<Edge> = match BOARD.line.edge() {
    Some(pin) => Some(Edge(pin)),
    None => None,
};

/// Handles the interrupt of an edge.
#[unsafe(link_section = ".ram_code")]
extern "C" fn on_edge() {
    if let Some(edge) = EDGE {
        edge.take();
    }
}

/// The timers of the line.
pub struct Rs485Timer {
    timer: pac::TIM2,
    start_bit: pac::TIM1,
    ticks: GapTicks,
    limit: LimitTicks,
    bits: CharacterBits,
    /// Times of an arbitration: a bit, the rest of a character after its flag, and a microsecond.
    bit: u32,
    rest: u32,
    us: u32,
}

// Flags and enables of TIM1's channels 1 and 2 (RM0008 14.4.4, 14.4.5).
const LIMIT: u32 = 1 << 1;
const WAKE: u32 = 1 << 2;

impl Rs485Timer {
    /// Sets the timers up for these times. Returns `None` when TIM2 cannot measure the silences.
    pub(crate) fn new(
        timer: pac::TIM2,
        start_bit: pac::TIM1,
        line: LineSettings,
        times: LineTimes,
        clock: ClockSource,
        rcc: &mut pac::RCC,
    ) -> Option<Self> {
        let ticks = GapTicks::new(clock.core_mhz(), line, times.t15_ns, times.t35_ns)?;
        pac::TIM2::enable(rcc);
        pac::TIM2::reset(rcc);
        pac::TIM1::enable(rcc);
        pac::TIM1::reset(rcc);
        let mhz = clock.core_mhz();
        let limit = LimitTicks::new(mhz, times.limit_us);
        let (bit, us) = (limit.bit(mhz, line.baud), limit.us(mhz));
        let mut gap = Self {
            timer,
            start_bit,
            ticks,
            limit,
            bits: CharacterBits::of(line.format),
            bit,
            rest: bit * line.format.sixteenths_after_flag() / 16,
            us,
        };
        gap.set_up();
        if let Some(edge) = EDGE {
            edge.start(on_edge);
        }
        Some(gap)
    }

    /// Returns the lengths of a bit and of a microsecond in an arbitration.
    #[must_use]
    pub const fn bit_and_us(&self) -> (u32, u32) {
        (self.bit, self.us)
    }

    /// Returns the time of the last falling edge.
    #[inline(always)]
    fn last_edge(&self) -> u32 {
        let count = EDGE.map_or_else(|| self.start_bit.ccr3().read().ccr().bits(), Edge::count);
        u32::from(count) << 16
    }

    /// Returns whether the line has fallen since the last call of [`Self::forget_edge`].
    #[inline(always)]
    fn has_fallen(&self) -> bool {
        EDGE.map_or_else(
            || self.start_bit.sr().read().cc3if().bit_is_set(),
            Edge::fell,
        )
    }

    #[inline(always)]
    fn forget_edge(&self) {
        match EDGE {
            Some(edge) => edge.clear(),
            None => {
                self.start_bit.sr().write(|w| w.cc3if().clear_bit());
            }
        }
    }

    fn halt(&mut self) {
        self.timer
            .cr1()
            .write(|w| w.urs().counter_only().opm().enabled());
    }

    /// Enables the interrupt of an edge, or disables it.
    #[inline(always)]
    fn set_edge_interrupt(on: bool) {
        if let Some(edge) = EDGE {
            edge.set_interrupt(on);
        }
    }

    /// Selects whether t1.5 is reported one character time late. Returns the previous selection.
    fn late_t15(&mut self, on: bool) -> bool {
        let before = self.timer.dier().read().cc2ie().bit_is_set();
        self.timer.dier().modify(|_, w| w.cc2ie().bit(on));
        before
    }
}

impl GapTimer for Rs485Timer {
    /// Sets every register of both timers that matters. The silence is measured from the next
    /// [`restart`](Self::restart).
    fn set_up(&mut self) {
        let (timer, ticks) = (&self.timer, self.ticks);
        timer.cr1().reset();
        timer.cr2().reset();
        timer.smcr().reset();
        timer.ccmr1_output().reset();
        timer.ccmr2_output().reset();
        timer.ccer().reset();
        timer.psc().write(|w| w.psc().set(ticks.prescaler));
        timer.arr().write(|w| w.arr().set(ticks.t35_late));
        timer.ccr1().write(|w| w.ccr().set(ticks.t15));
        timer.ccr2().write(|w| w.ccr().set(ticks.t15_late));
        timer.ccr3().write(|w| w.ccr().set(ticks.t35));
        timer
            .dier()
            .write(|w| w.uie().enabled().cc1ie().enabled().cc3ie().enabled());

        let start_bit = &self.start_bit;
        start_bit.cr1().reset();
        start_bit.smcr().reset();
        start_bit.dier().reset();
        start_bit.ccmr1_output().reset();
        // The channel must be off while its input is selected (RM0008 14.4.7).
        start_bit.ccer().reset();
        if let Some(edge) = EDGE {
            start_bit.ccmr2_output().reset();
            edge.set_up();
        } else {
            start_bit.ccmr2_input().write(|w| w.cc3s().ti3());
            // Capture on the falling edge.
            start_bit
                .ccer()
                .write(|w| w.cc3e().set_bit().cc3p().set_bit());
        }
        start_bit.psc().write(|w| w.psc().set(self.limit.prescaler));
        start_bit.arr().write(|w| w.arr().set(0xFFFF));
        // Load the prescaler.
        start_bit.egr().write(|w| w.ug().update());
        start_bit.cr1().write(|w| w.cen().enabled());
        self.stop();
    }

    /// Starts the time limit of a reply that has just begun. [`take_alarms`](Self::take_alarms) reports when it is
    /// exceeded.
    #[inline]
    fn limit_sending(&mut self) {
        let timer = &self.start_bit;
        let end = timer
            .cnt()
            .read()
            .cnt()
            .bits()
            .wrapping_add(self.limit.ticks);
        timer.ccr1().write(|w| w.ccr().set(end));
        timer.sr().write(|w| w.cc1if().clear_bit());
        timer.dier().write(|w| w.cc1ie().enabled());
    }

    /// The interrupt of the [limit](Self::limit_sending) also occurs when the reply ended in time. Then the limit is not
    /// reported, if a newer reply has started its own.
    fn take_alarms(&mut self) -> Alarms {
        let timer = &self.start_bit;
        let flags = timer.sr().read().bits() & timer.dier().read().bits();
        // Clear every flag that is enabled. A disturbed enable bit would otherwise raise this interrupt without end.
        // SAFETY: writing 0 clears a bit of SR and writing 1 leaves it unchanged (RM0008 14.4.5). Only enables whose
        // event has come are cleared.
        unsafe {
            timer.sr().write(|w| w.bits(!flags));
            timer
                .dier()
                .modify(|r, w| w.bits(r.bits() & !(flags & (LIMIT | WAKE))));
        }
        Alarms {
            limit: flags & LIMIT != 0,
            wake: flags & WAKE != 0,
        }
    }

    fn now(&self) -> u32 {
        u32::from(self.start_bit.cnt().read().cnt().bits()) << 16
    }

    fn fell(&mut self) -> Option<u32> {
        let fell = self.has_fallen().then(|| self.last_edge());
        // Reading the captured count has cleared its flag (RM0008 14.4.5).
        if let Some(edge) = EDGE {
            edge.forget_taken();
        }
        fell
    }

    /// The interrupt of a character may be late. So its end is calculated from its last falling edge, unless that was
    /// noise.
    fn end_of(&self, character: u8) -> u32 {
        let now = self.now();
        let after_edge = self.bits.after_last_fall(character) * self.bit;
        let end = self.last_edge().wrapping_add(after_edge);
        let latest = now.wrapping_add(self.rest);
        // The flag is raised up to `rest` before the end.
        if latest.wrapping_sub(end) <= LONGEST_WAIT_US * self.us {
            end
        } else {
            latest
        }
    }

    fn wake_at(&mut self, time: u32) -> bool {
        let timer = &self.start_bit;
        timer.ccr2().write(|w| w.ccr().set((time >> 16) as u16));
        timer.sr().write(|w| w.cc2if().clear_bit());
        timer.dier().modify(|_, w| w.cc2ie().enabled());
        Self::set_edge_interrupt(true);
        // The count may have reached it in front of the flag's clearing.
        time.wrapping_sub(self.now()).cast_signed() > 0
    }

    fn is_running(&self) -> bool {
        self.timer.cr1().read().cen().is_enabled()
    }

    fn is_pending(&self) -> bool {
        self.timer.sr().read().bits() & self.timer.dier().read().bits() != 0
    }

    #[inline]
    fn restart(&mut self) {
        // Only edges after this character count.
        self.forget_edge();
        Self::set_edge_interrupt(true);
        // The update event clears the counter and the prescaler. With URS set it raises no interrupt.
        self.timer
            .cr1()
            .write(|w| w.urs().counter_only().opm().enabled());
        self.timer.egr().write(|w| w.ug().update());
        self.timer.sr().reset();
        self.timer
            .cr1()
            .write(|w| w.urs().counter_only().opm().enabled().cen().enabled());
    }

    fn stop(&mut self) {
        self.halt();
        self.timer.sr().reset();
        Self::set_edge_interrupt(false);
    }

    #[inline]
    fn take_event(&mut self) -> Silence {
        let flags = self.timer.sr().read();
        // Clear only the flags that were read; a flag set after that raises the interrupt again.
        // SAFETY: writing 0 clears a bit of SR and writing 1 leaves it unchanged (RM0008 15.4.5).
        self.timer.sr().write(|w| unsafe { w.bits(!flags.bits()) });
        // The frame is over, or nearly so. Outside an arbitration the times of further edges do not matter.
        if EDGE.is_some() && self.start_bit.dier().read().bits() & WAKE == 0 {
            Self::set_edge_interrupt(false);
        }
        let may_be_on_its_way = self.has_fallen();
        if flags.uif().bit_is_set() {
            // The counter has stopped, because of one-pulse mode.
            Silence::T35
        } else if flags.cc3if().bit_is_set() {
            if may_be_on_its_way {
                return Silence::None;
            }
            self.halt();
            Silence::T35
        } else if flags.cc2if().bit_is_set() && self.late_t15(false) {
            Silence::T15
        } else if flags.cc1if().bit_is_set() {
            // The decision is delayed only once: not after the later compare value has passed.
            if may_be_on_its_way && flags.cc2if().bit_is_clear() {
                self.late_t15(true);
                return Silence::None;
            }
            Silence::T15
        } else {
            Silence::None
        }
    }
}
