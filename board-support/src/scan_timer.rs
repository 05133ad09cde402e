//! TIM4, the timer of the scan and of the device's clock, at [`SCAN_HZ`].

use stm32f1xx_hal::{
    pac,
    rcc::{Enable, Reset},
};

use crate::{ClockSource, design::SCAN_HZ};

/// The scan's timer.
pub struct ScanTimer {
    timer: pac::TIM4,
    /// Reload value.
    reload: u16,
}

impl ScanTimer {
    pub(crate) fn new(timer: pac::TIM4, clock: ClockSource, rcc: &mut pac::RCC) -> Self {
        pac::TIM4::enable(rcc);
        pac::TIM4::reset(rcc);
        // Half the clock fits 16 bits and is a whole number; the design constants check both.
        let ticks = clock.core_hz() / 2 / SCAN_HZ;
        Self {
            timer,
            reload: (ticks - 1) as u16,
        }
    }

    /// Sets every register up and starts the timer: one interrupt every millisecond. Runs from RAM, because a
    /// disturbed timer is started again while flash may be busy.
    #[inline(never)]
    #[unsafe(link_section = ".ram_code")]
    pub fn start(&mut self) {
        let timer = &self.timer;
        // The update event by software loads the prescaler. With URS it sets no flag, because it is no tick of the
        // timer. A flag could not be cleared here: it appears in SR some cycles after UG.
        timer.cr1().write(|w| w.urs().counter_only());
        timer.smcr().reset();
        timer.psc().write(|w| w.psc().set(1));
        timer.arr().write(|w| w.arr().set(self.reload));
        timer.egr().write(|w| w.ug().update());
        timer.dier().write(|w| w.uie().enabled());
        timer
            .cr1()
            .write(|w| w.urs().counter_only().cen().enabled());
    }

    /// Acknowledges the timer's interrupt, and any other that a disturbed bit has enabled.
    pub fn take_beat(&mut self) {
        self.timer.sr().reset();
    }
}
