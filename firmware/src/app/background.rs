//! Background work that is not urgent: DAC transfers, configuration store, LEDs, log.

use board_support::stack::LowWater;
use heapless::spsc::Consumer;
use rtic::Mutex;

use crate::{
    board::Device,
    installed::AnalogOutputs,
    log::{Event, Log},
    orders::Orders,
    persistence::Persistence,
    signals::Signals,
};

/// The state of the background task.
pub struct Background {
    pub analog_outputs: AnalogOutputs,
    pub persistence: Persistence,
    pub signals: Signals,
    pub log: Log,
    pub stack: LowWater,
}

impl Background {
    /// Brings the DACs, the store, the LEDs and the log up to date.
    pub fn run(
        &mut self,
        device: &mut impl Mutex<T = &'static mut Device>,
        activity: &mut impl Mutex<T = bool>,
        orders: &mut impl Mutex<T = Orders>,
        logged: &mut Consumer<'static, Event>,
    ) {
        self.analog_outputs.work();

        let Orders {
            save,
            restart,
            identify,
        } = orders.lock(core::mem::take);
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

        if identify {
            self.signals.identify();
        }
        let free = self.stack.check();
        let (failing, millis) = device.lock(|device| {
            device.state.stack_free = free;
            (device.points.any_fails(), device.state.millis())
        });
        self.signals
            .show(millis, failing, || activity.lock(core::mem::take));
        while let Some(event) = logged.dequeue() {
            self.log.event(event);
        }
    }
}
