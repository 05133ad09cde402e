//! The frame-gap timer: TIM2 in one-pulse mode measures t1.5 and t3.5, and TIM1 sees whether a character
//! may already be on its way.
//!
//! The UART raises its flag only when a character is complete. A character that began just before t3.5
//! belongs to the frame, but its flag is not set yet when t3.5 is reached. Its start bit has been on the
//! line: PA10 is the input of USART1 and of TIM1's channel 3, and the capture flag shows, without any
//! interrupt, that the line has fallen since the flag was cleared.
//!
//! The line also falls when a pulse of noise is too short for a start bit (RM0008 27.3.3). So an edge
//! puts the decision off by one character, once: a real character is complete by then and starts the
//! silence again, and noise delays a reply by one character at most, however often it comes.
//!
//! While the unit sends there is no silence to measure: TIM2 then limits the time of the reply.

use stm32f1xx_hal::{
    pac,
    rcc::{Enable, Reset},
};

use crate::{
    ClockSource,
    gap::{GapTicks, LimitTicks},
    signature,
    uart::LineSettings,
};

/// What the timer's interrupt is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GapEvent {
    /// The line has been silent for t1.5 since the last character.
    T15,
    /// The line has been silent for t3.5; or the [limit](GapTimer::limit_sending) has been reached.
    T35,
    /// Nothing to do: the interrupt was overtaken by a character, or one is on its way.
    Nothing,
}

/// The timer, one per line.
pub struct GapTimer {
    timer: pac::TIM2,
    start_bit: pac::TIM1,
    ticks: GapTicks,
    limit: LimitTicks,
    /// The signature of the registers after they were set. They are compared with what they read, not with what was
    /// written: an emulator need not keep every bit.
    set: u32,
}

impl GapTimer {
    /// Sets the timer up for silences of these lengths in nanoseconds, and for replies of `limit_us` microseconds at
    /// most. `None` when no setting of the timer reaches them.
    pub(crate) fn new(
        timer: pac::TIM2,
        start_bit: pac::TIM1,
        line: LineSettings,
        t15_ns: u32,
        t35_ns: u32,
        limit_us: u32,
        clock: ClockSource,
        rcc: &mut pac::RCC,
    ) -> Option<Self> {
        let ticks = GapTicks::new(clock.core_mhz(), line, t15_ns, t35_ns)?;
        pac::TIM2::enable(rcc);
        pac::TIM2::reset(rcc);
        pac::TIM1::enable(rcc);
        pac::TIM1::reset(rcc);
        let mut gap = Self {
            timer,
            start_bit,
            ticks,
            limit: LimitTicks::new(clock.core_mhz(), limit_us),
            set: 0,
        };
        gap.set_up();
        Some(gap)
    }

    /// Sets every register of both timers that matters. The silence is measured from the next
    /// [`restart`](Self::restart) on.
    pub fn set_up(&mut self) {
        let (timer, ticks) = (&self.timer, self.ticks);
        timer.cr1().reset();
        timer.cr2().reset();
        timer.smcr().reset();
        timer.ccmr1_output().reset();
        timer.ccmr2_output().reset();
        timer.ccer().reset();
        timer.ccr1().write(|w| w.ccr().set(ticks.t15));
        timer.ccr2().write(|w| w.ccr().set(ticks.t15_late));
        timer.ccr3().write(|w| w.ccr().set(ticks.t35));

        let start_bit = &self.start_bit;
        start_bit.cr1().reset();
        start_bit.smcr().reset();
        // The channel is off while its input is selected (RM0008 14.4.7).
        start_bit.ccer().reset();
        start_bit.ccmr2_input().write(|w| w.cc3s().ti3());
        // Capture on the falling edge.
        start_bit
            .ccer()
            .write(|w| w.cc3e().set_bit().cc3p().set_bit());
        start_bit.arr().write(|w| w.arr().set(0xFFFF));
        start_bit.cr1().write(|w| w.cen().enabled());
        self.stop();
        self.set = self.settings();
    }

    /// Has the timer count for the silences from the next [`restart`](Self::restart) on.
    #[inline]
    fn select_silences(&mut self) {
        let (timer, ticks) = (&self.timer, self.ticks);
        timer.psc().write(|w| w.psc().set(ticks.prescaler));
        timer.arr().write(|w| w.arr().set(ticks.t35_late));
        timer
            .dier()
            .write(|w| w.uie().enabled().cc1ie().enabled().cc3ie().enabled());
    }

    /// A reply has begun: [`GapEvent::T35`] comes when it takes longer than it can, unless it is
    /// [stopped](Self::stop) before.
    #[inline]
    pub fn limit_sending(&mut self) {
        self.halt();
        let (timer, limit) = (&self.timer, self.limit);
        timer.psc().write(|w| w.psc().set(limit.prescaler));
        timer.arr().write(|w| w.arr().set(limit.reload));
        timer.dier().write(|w| w.uie().enabled());
        self.start();
    }

    /// Whether both timers are as they were set up.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.settings() == self.set
    }

    /// The signature of the registers of both timers, without the bits that change while silences are measured.
    fn settings(&self) -> u32 {
        const CEN: u32 = 1;
        const CC2IE: u32 = 1 << 2;
        let (timer, start_bit) = (&self.timer, &self.start_bit);
        signature([
            timer.cr1().read().bits() & !CEN,
            timer.smcr().read().bits(),
            timer.dier().read().bits() & !CC2IE,
            timer.ccmr1_output().read().bits(),
            timer.ccmr2_output().read().bits(),
            timer.psc().read().bits(),
            timer.arr().read().bits(),
            timer.ccr1().read().bits(),
            timer.ccr2().read().bits(),
            timer.ccr3().read().bits(),
            start_bit.cr1().read().bits(),
            start_bit.smcr().read().bits(),
            start_bit.ccmr2_input().read().bits(),
            start_bit.ccer().read().bits(),
            start_bit.arr().read().bits(),
        ])
    }

    /// Whether a silence is being measured, or its end has not been [taken](Self::take_event) yet.
    #[must_use]
    pub fn is_running(&self) -> bool {
        let timer = &self.timer;
        timer.cr1().read().cen().is_enabled()
            || timer.sr().read().bits() & timer.dier().read().bits() != 0
    }

    /// Starts the silence over: a character has just come in.
    #[inline]
    pub fn restart(&mut self) {
        // The flag stands for edges after this character.
        self.start_bit.sr().write(|w| w.cc3if().clear_bit());
        self.start();
    }

    /// Starts the count over.
    #[inline]
    fn start(&mut self) {
        // An update by software clears counter and prescaler, and with URS raises no interrupt.
        self.timer
            .cr1()
            .write(|w| w.urs().counter_only().opm().enabled());
        self.timer.egr().write(|w| w.ug().update());
        self.timer.sr().reset();
        self.timer
            .cr1()
            .write(|w| w.urs().counter_only().opm().enabled().cen().enabled());
    }

    /// Stops: no silence is of interest until the next character, and no limit any more.
    pub fn stop(&mut self) {
        self.halt();
        self.timer.sr().reset();
        self.select_silences();
    }

    fn halt(&mut self) {
        self.timer
            .cr1()
            .write(|w| w.urs().counter_only().opm().enabled());
    }

    /// Takes what the timer's interrupt is about.
    #[inline]
    pub fn take_event(&mut self) -> GapEvent {
        let flags = self.timer.sr().read();
        // Only the flags that were read: one that is set from here on raises the interrupt again.
        // SAFETY: every bit of SR is cleared by 0 and left alone by 1 (RM0008 15.4.5).
        self.timer.sr().write(|w| unsafe { w.bits(!flags.bits()) });
        let may_be_on_its_way = self.start_bit.sr().read().cc3if().bit_is_set();
        if flags.uif().bit_is_set() {
            // One-pulse mode has stopped the counter.
            GapEvent::T35
        } else if flags.cc3if().bit_is_set() {
            if may_be_on_its_way {
                return GapEvent::Nothing;
            }
            self.halt();
            GapEvent::T35
        } else if flags.cc2if().bit_is_set() && self.late_t15(false) {
            GapEvent::T15
        } else if flags.cc1if().bit_is_set() {
            // When the later instant has passed too, it has been waited for.
            if may_be_on_its_way && flags.cc2if().bit_is_clear() {
                self.late_t15(true);
                return GapEvent::Nothing;
            }
            GapEvent::T15
        } else {
            GapEvent::Nothing
        }
    }

    /// Has t1.5 reported one character late, or not; returns whether it was to be until now.
    fn late_t15(&mut self, on: bool) -> bool {
        let before = self.timer.dier().read().cc2ie().bit_is_set();
        self.timer.dier().modify(|_, w| w.cc2ie().bit(on));
        before
    }
}
