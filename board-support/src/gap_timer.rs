//! The frame-gap timer: TIM2 in one-pulse mode tells t1.5 and t3.5, and TIM1 tells whether a
//! character is already on its way.
//!
//! The receiver speaks up only when a character is whole. A character that began just before t3.5
//! belongs to the frame, yet is not there when the timer runs out. Its start bit is: PA10 is
//! USART1's input and TIM1's channel 3 as well, and the capture flag keeps, without any interrupt,
//! that the line has fallen since the flag was last taken back.

use stm32f1xx_hal::{
    pac,
    rcc::{Enable, Reset},
};

use crate::{ClockSource, gap::GapTicks, uart::LineSettings};

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
}

impl GapTimer {
    /// Sets the timer up for silences of these lengths in nanoseconds. `None` when no setting of the
    /// timer reaches them.
    pub(crate) fn new(
        timer: pac::TIM2,
        start_bit: pac::TIM1,
        line: LineSettings,
        t15_ns: u32,
        t35_ns: u32,
        clock: ClockSource,
        rcc: &mut pac::RCC,
    ) -> Option<Self> {
        let ticks = GapTicks::new(clock.core_mhz(), line, t15_ns, t35_ns)?;
        pac::TIM2::enable(rcc);
        pac::TIM2::reset(rcc);
        timer.psc().write(|w| w.psc().set(ticks.prescaler));
        timer.arr().write(|w| w.arr().set(ticks.t35));
        timer.ccr1().write(|w| w.ccr().set(ticks.t15));
        timer.dier().write(|w| w.uie().enabled().cc1ie().enabled());

        pac::TIM1::enable(rcc);
        pac::TIM1::reset(rcc);
        start_bit.ccmr2_input().write(|w| w.cc3s().ti3());
        // Capture on the falling edge.
        start_bit
            .ccer()
            .write(|w| w.cc3e().set_bit().cc3p().set_bit());
        start_bit.cr1().write(|w| w.cen().enabled());
        Some(Self { timer, start_bit })
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
        self.timer
            .sr()
            .write(|w| w.uif().clear_bit().cc1if().clear_bit());
        self.timer
            .cr1()
            .write(|w| w.urs().counter_only().opm().enabled().cen().enabled());
    }

    /// Stops: no silence is of interest until the next character.
    pub fn stop(&mut self) {
        self.timer
            .cr1()
            .write(|w| w.urs().counter_only().opm().enabled());
        self.timer
            .sr()
            .write(|w| w.uif().clear_bit().cc1if().clear_bit());
    }

    /// Takes what the timer's interrupt is about.
    #[inline]
    pub fn take_event(&mut self) -> GapEvent {
        let flags = self.timer.sr().read();
        let on_its_way = self.start_bit.sr().read().cc3if().bit_is_set();
        if flags.uif().bit_is_clear() && flags.cc1if().bit_is_clear() {
            return GapEvent::Nothing;
        }
        if on_its_way {
            // The character restarts the silence itself; should the edge have been noise, this does.
            self.restart();
            return GapEvent::Nothing;
        }
        if flags.uif().bit_is_set() {
            self.timer
                .sr()
                .write(|w| w.uif().clear_bit().cc1if().clear_bit());
            GapEvent::T35
        } else {
            self.timer.sr().modify(|_, w| w.cc1if().clear_bit());
            GapEvent::T15
        }
    }
}
