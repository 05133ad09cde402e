//! What may be late at no cost: DAC transfers, configuration store, LEDs, log.

use board_support::stack;
use firmware::device::Device;
use heapless::spsc::Consumer;
use rtic::Mutex;

use crate::{
    installed::AnalogOutputs,
    log::{Event, Log},
    orders::Orders,
    persistence::Persistence,
    signals::Signals,
};

/// What the background works on.
pub struct Background {
    pub analog_outputs: Option<AnalogOutputs>,
    pub persistence: Persistence,
    pub signals: Signals,
    pub log: Log,
}

impl Background {
    /// Brings the DAC, the store, the LEDs and the log up to date.
    pub fn run(
        &mut self,
        device: &mut impl Mutex<T = &'static mut Device>,
        activity: &mut impl Mutex<T = bool>,
        orders: &mut impl Mutex<T = Orders>,
        logged: &mut Consumer<'static, Event>,
    ) {
        if let Some(outputs) = &mut self.analog_outputs {
            outputs.work();
        }

        let Orders { save, restart } = orders.lock(core::mem::take);
        if save {
            self.persistence.begin(device);
        }
        if restart {
            self.persistence.restart_when_done();
        }
        if let Some(event) = self.persistence.work(device) {
            self.log.event(event);
        }
        self.persistence.erase();

        let free = stack::free_low_water();
        let (failing, millis) = device.lock(|device| {
            device.state.stack_free = free;
            (device.points.failing() != 0, device.state.millis())
        });
        self.signals
            .show(millis, failing, || activity.lock(core::mem::take));
        while let Some(event) = logged.dequeue() {
            self.log.event(event);
        }
    }
}
