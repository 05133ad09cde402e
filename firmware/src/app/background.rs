//! Background work that is not urgent: DAC transfers, configuration store, LEDs, log.

use board_support::{kept, stack::LowWater};
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
    /// The state of the radio that was logged last.
    pub radio: Option<bool>,
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
            self.persistence.begin();
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
        let (failing, millis, radio, saves) = device.lock(|device| {
            let state = &mut device.state;
            state.stack_free = free;
            let (millis, radio) = (state.millis(), state.radio_works);
            let saves = device.config.saves_left();
            (device.any_fails(), millis, radio, saves)
        });
        kept::keep_saves(saves);
        if let Some(works) = radio
            && self.radio.replace(works) != radio
        {
            self.log.event(Event::Radio(works));
        }
        self.signals
            .show(millis, failing, || activity.lock(core::mem::take));
        while let Some(event) = logged.dequeue() {
            self.log.event(event);
        }
    }
}
