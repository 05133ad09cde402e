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
//! TIM1 limits the time of a reply as well: its counter runs free, with a tick so long that the longest reply has less
//! than 65,536 of them, and its channel 1 compares.

use stm32f1xx_hal::{
    pac,
    rcc::{Enable, Reset},
};

use crate::{
    ClockSource,
    gap::{GapTicks, LimitTicks, LineTimes},
    signature::Signature,
    uart::LineSettings,
};

/// What the timer's interrupt is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GapEvent {
    /// The line has been silent for t1.5 since the last character.
    T15,
    /// The line has been silent for t3.5.
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
    /// The signatures of the registers of TIM2 and TIM1 after they were set. They are compared with what they read, not with what was
    /// written: an emulator need not keep every bit.
    set: [Signature; 3],
}

impl GapTimer {
    /// Sets the timers up for these times. `None` when no setting of TIM2 reaches the silences.
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
        let mut gap = Self {
            timer,
            start_bit,
            ticks,
            limit: LimitTicks::new(clock.core_mhz(), times.limit_us),
            set: [Signature::default(); 3],
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
        // The channel is off while its input is selected (RM0008 14.4.7).
        start_bit.ccer().reset();
        start_bit.ccmr2_input().write(|w| w.cc3s().ti3());
        // Capture on the falling edge.
        start_bit
            .ccer()
            .write(|w| w.cc3e().set_bit().cc3p().set_bit());
        start_bit.psc().write(|w| w.psc().set(self.limit.prescaler));
        start_bit.arr().write(|w| w.arr().set(0xFFFF));
        // Loads the prescaler.
        start_bit.egr().write(|w| w.ug().update());
        start_bit.cr1().write(|w| w.cen().enabled());
        self.stop();
        self.set = [self.control(), self.times(), self.start_bit()];
    }

    /// A reply has begun: [`take_limit`](Self::take_limit) tells when it has taken longer than it can.
    #[inline]
    pub fn limit_sending(&mut self) {
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

    /// Takes the interrupt of the [limit](Self::limit_sending), which comes also when the reply has ended before.
    /// Whether the limit has been reached: not when a reply has begun since, and set another.
    pub fn take_limit(&mut self) -> bool {
        let reached = self.start_bit.sr().read().cc1if().bit_is_set();
        if reached {
            self.start_bit.dier().reset();
        }
        reached
    }

    /// Whether TIM2, which measures the silences, works as it was set up to.
    #[must_use]
    pub fn control_is_sound(&self) -> bool {
        self.control() == self.set[0]
    }

    /// Whether the times that TIM2 measures are those it was set up for.
    #[must_use]
    pub fn times_are_sound(&self) -> bool {
        self.times() == self.set[1]
    }

    /// Whether TIM1, which sees the start bit and limits replies, is as it was set up.
    #[must_use]
    pub fn start_bit_is_sound(&self) -> bool {
        self.start_bit() == self.set[2]
    }

    /// The signature of TIM2's control registers, without the bits that change while silences are measured.
    fn control(&self) -> Signature {
        const CEN: u32 = 1;
        const CC2IE: u32 = 1 << 2;
        let timer = &self.timer;
        Signature::default()
            .with(timer.cr1().read().bits() & !CEN)
            .with(timer.smcr().read().bits())
            .with(timer.dier().read().bits() & !CC2IE)
            .with(timer.ccmr1_output().read().bits())
            .with(timer.ccmr2_output().read().bits())
    }

    /// The signature of TIM2's times.
    fn times(&self) -> Signature {
        let timer = &self.timer;
        Signature::default()
            .with(timer.psc().read().bits())
            .with(timer.arr().read().bits())
            .with(timer.ccr1().read().bits())
            .with(timer.ccr2().read().bits())
            .with(timer.ccr3().read().bits())
    }

    /// The signature of TIM1's registers, without those that change with each reply.
    fn start_bit(&self) -> Signature {
        let start_bit = &self.start_bit;
        Signature::default()
            .with(start_bit.cr1().read().bits())
            .with(start_bit.smcr().read().bits())
            .with(start_bit.ccmr2_input().read().bits())
            .with(start_bit.ccer().read().bits())
            .with(start_bit.psc().read().bits())
            .with(start_bit.arr().read().bits())
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

    /// Stops: no silence is of interest until the next character.
    pub fn stop(&mut self) {
        self.halt();
        self.timer.sr().reset();
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
