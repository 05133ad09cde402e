//! TIM4: the beat of the scan, [`SCAN_HZ`](crate::design::SCAN_HZ).

use stm32f1xx_hal::{
    pac,
    rcc::Rcc,
    timer::{CounterHz, Event, Timer},
};

use crate::design::SCAN_HZ;

/// The scan's timer.
pub struct ScanTimer {
    counter: CounterHz<pac::TIM4>,
}

impl ScanTimer {
    pub(crate) fn new(timer: pac::TIM4, rcc: &mut Rcc) -> Self {
        Self {
            counter: Timer::new(timer, rcc).counter_hz(),
        }
    }

    /// Starts the beat: an interrupt every millisecond.
    pub fn start(&mut self) {
        // Cannot fail: the design constants give a prescaler and a reload of 16 bits on both clocks.
        let _ = self
            .counter
            .start(stm32f1xx_hal::time::Hertz::from_raw(SCAN_HZ));
        self.counter.listen(Event::Update);
    }

    /// Whether a beat has come since the last call.
    pub fn take_beat(&mut self) -> bool {
        self.counter.wait().is_ok()
    }
}
