//! Background work that is not urgent: DAC transfers, configuration store, LEDs, log.

use board_support::{
    IoPin, RecoveryPins,
    boards::{LEDS, SLOTS},
    kept,
    stack::LowWater,
};
use firmware::{device::Restart, leds::Leds};
use heapless::spsc::Consumer;
use modio_drivers::DacLink;
use rtic::Mutex;

use crate::{
    board::Device,
    installed::AnalogOutputs,
    log::{Event, Log},
    persistence::Persistence,
    updating::Updating,
};

/// The state of the background task.
pub struct Background {
    pub analog_outputs: AnalogOutputs,
    pub persistence: Persistence,
    pub updating: Updating,
    pub leds: Leds<IoPin, LEDS>,
    pub recovery: RecoveryPins,
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
        dacs: &mut impl Mutex<T = [DacLink; SLOTS]>,
        logged: &mut Consumer<'static, Event>,
    ) {
        self.analog_outputs.work(dacs);

        if let Some(event) = self.persistence.work(device) {
            self.log.event(event);
        }
        self.persistence.erase();

        let free = self.stack.check();
        let (identify, request, failing, millis, radio, saves) = device.lock(|device| {
            let identify = core::mem::take(&mut device.identify);
            let request = core::mem::take(&mut device.activity);
            let state = &mut device.state;
            state.stack_free = free;
            let (millis, radio) = (state.millis(), state.radio_works);
            let saves = device.config.saves_left();
            (identify, request, device.any_fails(), millis, radio, saves)
        });
        kept::keep_saves(saves);
        self.updating.work(self.persistence.flash(), device);
        if let Some(works) = radio
            && self.radio.replace(works) != radio
        {
            self.log.event(Event::Radio(works));
        }
        if self.recovery.is_asked(millis) {
            kept::keep_recovery();
            device.lock(|device| {
                device.restart.get_or_insert(Restart::Asked);
            });
        }
        if identify {
            self.leds.identify();
        }
        self.leds.show(millis, failing, request);
        while let Some(event) = logged.dequeue() {
            self.log.event(event);
        }
    }
}
