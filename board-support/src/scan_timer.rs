//! TIM4: the beat of all clocks and of the scan, [`SCAN_HZ`].

use stm32f1xx_hal::{
    pac,
    rcc::{Enable, Reset},
};

use crate::{ClockSource, design::SCAN_HZ};

/// The scan's timer.
pub struct ScanTimer {
    timer: pac::TIM4,
}

impl ScanTimer {
    pub(crate) fn new(timer: pac::TIM4, clock: ClockSource, rcc: &mut pac::RCC) -> Self {
        pac::TIM4::enable(rcc);
        pac::TIM4::reset(rcc);
        // Half the clock fits 16 bits; the design constants see to that and to whole numbers.
        timer.psc().write(|w| w.psc().set(1));
        let ticks = clock.core_hz() / 2 / SCAN_HZ;
        timer.arr().write(|w| w.arr().set((ticks - 1) as u16));
        Self { timer }
    }

    /// Starts the beat: an interrupt every millisecond.
    pub fn start(&mut self) {
        // The update by software loads the prescaler; its flag is no beat.
        self.timer.egr().write(|w| w.ug().update());
        self.timer.sr().write(|w| w.uif().clear_bit());
        self.timer.dier().write(|w| w.uie().enabled());
        self.timer.cr1().write(|w| w.cen().enabled());
    }

    /// Takes a beat: its interrupt is over.
    pub fn take_beat(&mut self) {
        self.timer.sr().write(|w| w.uif().clear_bit());
    }
}
